"""Faults spliced between two clear poses of a leaning program are found: a few of each kind, hundreds in bench/spliced.py."""

import pytest
from spliced_faults import KINDS, faults


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_between_two_clear_poses_is_found_and_the_clear_poses_are_not_blamed(kind):
    assert [f for f in faults(kind, range(4)) if not f.is_found] == []
