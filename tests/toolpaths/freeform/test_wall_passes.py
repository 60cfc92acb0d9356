"""Waterlines cut to what is wanted: rings stay rings, runs end where the wish ends."""

import numpy as np
import pytest

from cuspline.toolpaths.freeform.wall_passes import wall_paths
from cuspline.toolpaths.freeform.waterline import Waterline


def square(height_mm, half=10.0):
    corners = np.array([[half, half], [half, -half], [-half, -half], [-half, half]])
    return Waterline(tip_mm=np.column_stack([corners, np.full(4, height_mm)]), is_closed=True)


def test_a_loop_that_is_wanted_all_round_stays_closed_with_its_own_points():
    path, = wall_paths([square(3.0)], lambda tips: np.ones(len(tips), bool), 0.5)
    assert path.is_closed and len(path.tips_mm) == 5
    assert np.array_equal(path.tips_mm[0], path.tips_mm[-1]) and (path.tips_mm[:, 2] == 3.0).all()


def test_a_loop_wanted_on_one_side_becomes_one_run_that_ends_within_the_spacing():
    path, = wall_paths([square(3.0)], lambda tips: tips[:, 0] > 2.0, 0.25)
    assert not path.is_closed and (path.tips_mm[:, 0] > 2.0).all()
    assert path.tips_mm[[0, -1], 0] == pytest.approx(2.0, abs=0.25)
    assert path.length_mm == pytest.approx(8 + 20 + 8, abs=0.5)
    assert len(path.tips_mm) == 4                       # two ends and two corners


def test_levels_keep_their_order_and_nothing_wanted_is_no_path():
    lines = [square(5.0), square(4.0, half=6.0)]
    heights = [p.tips_mm[0, 2] for p in wall_paths(lines, lambda tips: tips[:, 1] > 0, 0.5)]
    assert heights == [5.0, 4.0]
    assert wall_paths(lines, lambda tips: np.zeros(len(tips), bool), 0.5) == []
    assert wall_paths([], lambda tips: None, 0.5) == []


def test_a_run_over_the_start_of_a_loop_is_one_run():
    # the loop's first point lies in the middle of what is wanted
    paths = wall_paths([square(3.0)], lambda tips: tips[:, 1] > 0, 0.5)
    assert len(paths) == 1 and paths[0].length_mm == pytest.approx(10 + 20 + 10, abs=1.0)
