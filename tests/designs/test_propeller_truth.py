"""A handful of the random propellers of bench/propeller_truth.py, and that its judge knows a false one."""

import importlib.util
from pathlib import Path

import pytest

from cuspline.designs.propellers import root

HERE = Path(__file__).parents[2] / "bench/propeller_truth.py"


@pytest.fixture(scope="module")
def truth():
    spec = importlib.util.spec_from_file_location("propeller_truth", HERE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("number, outcome", [
    (157, "true"), (385, "true"),
    (205, "refused with a radius that works")],     # a bevel: its fillet turns over between the balls it is made of
    ids=["own", "table", "bevelled"])
def test_random_propellers_are_true_or_refused_with_a_radius_that_works(truth, number, outcome):
    assert truth.tried(number)["outcome"] == outcome


def test_the_judge_of_random_propellers_knows_a_false_one(truth, monkeypatch):
    _, table, hub, law = truth.drawn(205)
    monkeypatch.setattr(root, "obstacle", lambda *_: None)
    assert truth.untrue(truth.surfaces_of(table, hub, law)) == "the fillet turns over"
