"""Spirals: one curve, the whole region, the height asked for; islands are refused."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from cuspline.scallop.stepover import stepover_for_scallop_mm
from cuspline.toolpaths.freeform.scallop_region import Ground
from cuspline.toolpaths.freeform.spiral_passes import spiral_curve
from cuspline.values.errors import ToolpathError

R, H, GRID_MM = 6.0, 0.02, 0.1
STEP_MM = stepover_for_scallop_mm(R, H, 0.0)[0]


def flat(is_wanted):
    """A plane under a ball: the metric is 1 / step²."""
    x = np.arange(-7, 7 + GRID_MM / 2, GRID_MM)
    xx, yy = np.meshgrid(x, x)
    metric = np.broadcast_to(np.array([1.0, 0.0, 1.0]) / STEP_MM ** 2, (*xx.shape, 3)).copy()
    return Ground.of(x, x, metric, is_wanted(xx, yy))


def disk(x, y):
    return np.hypot(x, y) < 5


def square(x, y):
    return np.maximum(np.abs(x), np.abs(y)) < 5


def highest_mm(curve, is_wanted):
    places = np.random.default_rng(2).uniform(-5, 5, (40_000, 2))
    places = places[is_wanted(*places.T)]
    line = curve.line_mm
    run = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
    at = np.arange(0, run[-1], 0.01)
    away = cKDTree(np.column_stack([np.interp(at, run, line[:, k]) for k in (0, 1)])).query(places)[0].max()
    return math.hypot(away, R) - R


@pytest.mark.parametrize("is_wanted", [disk, square])
def test_a_spiral_is_one_curve_that_leaves_nothing_higher_than_wanted(is_wanted):
    curve = spiral_curve(flat(is_wanted))
    assert not curve.is_closed
    assert np.linalg.norm(np.diff(curve.xy_mm, axis=0), axis=1).max() < 5 * GRID_MM
    assert highest_mm(curve, is_wanted) < 1.12 * H


def test_on_a_disk_its_length_is_the_area_by_the_step_and_its_outer_loop():
    curve = spiral_curve(flat(disk))
    length = np.linalg.norm(np.diff(curve.xy_mm, axis=0), axis=1).sum()
    turns = math.pi * 5 ** 2 / STEP_MM
    assert turns * 0.95 < length < (turns + 2 * math.pi * 5 / 2) * 1.2


def test_inward_it_ends_in_the_middle_and_outward_it_begins_there():
    inward, outward = (spiral_curve(flat(disk), is_inward=way) for way in (True, False))
    assert np.linalg.norm(inward.xy_mm[-1]) < 1.0 < 4.0 < np.linalg.norm(inward.xy_mm[0])
    np.testing.assert_array_equal(outward.xy_mm, inward.xy_mm[::-1])


def test_islands_and_waists_are_refused():
    with pytest.raises(ToolpathError, match="2 borders"):
        spiral_curve(flat(lambda x, y: disk(x, y) & (np.hypot(x - 1, y) > 1)))
    with pytest.raises(ToolpathError, match="parts into 2 loops"):
        spiral_curve(flat(lambda x, y: np.minimum(np.hypot(x - 2.5, y), np.hypot(x + 2.5, y)) < 3))
