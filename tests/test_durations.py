"""The order of tests, and which ones a fast run takes, as recorded durations say."""

import pytest
from durations import Durations

KNOWN = Durations(tests={"a.py::short": 0.1, "a.py::other": 0.2, "b.py::long": 3.0}, fixtures={"a.py::part": 5.0})


def test_a_module_takes_what_its_tests_take_and_what_they_share_once():
    needs = {"a.py::short": {"a.py::part"}, "a.py::other": {"a.py::part"}, "b.py::long": set(), "b.py::new": {"b.py::quick"}}
    assert KNOWN.modules_s(needs) == pytest.approx({"a.py": 5.3, "b.py": 3.0})


def test_a_test_alone_takes_what_it_shares_too():
    assert KNOWN.alone_s("a.py::short", {"a.py::part"}) == pytest.approx(5.1)
    assert KNOWN.alone_s("a.py::short", set()) == pytest.approx(0.1) and KNOWN.alone_s("c.py::new", {"c.py::new"}) == 0.0
