"""Shank and holder over moves against the design's triangles: contacts, and the least distance."""

import numpy as np
import pytest

from cuspline.replay.clearance import ClearanceTree
from cuspline.replay.replay_design import TOLERANCE_MM, sweep
from cuspline.replay.replay_stock import SHARE

HOLDER = np.array([[40.0, 12.0, 60.0, 12.0, 0.0]])      # from 40 to 60 mm above the tip, radius 12
LEVELS_MM = np.arange(6.0, -0.01, -0.25)


def dome():
    """Triangles of a spherical cap, 6 mm high."""
    n = 24
    x, y = np.meshgrid(np.linspace(-12, 12, n), np.linspace(-12, 12, n))
    vertices = np.column_stack([x.ravel(), y.ravel(), (np.sqrt(30.0 ** 2 - x ** 2 - y ** 2) - 24.0).ravel()])
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    return ClearanceTree.of_triangles(vertices, np.vstack([np.column_stack([a, a + 1, a + n + 1]),
                                                           np.column_stack([a, a + n + 1, a + n])]))


def passes(levels_mm):
    """Ends of short moves over the cap and back, level by level."""
    xs = np.linspace(-15, 15, 41)
    return np.vstack([np.column_stack([xs[:-1], 0 * xs[1:], z + 0 * xs[1:], xs[1:], 0 * xs[1:], z + 0 * xs[1:]])
                      for z in levels_mm])


@pytest.mark.parametrize("wanted_mm", [1.0, 36.0])
def test_the_least_distance_and_the_contacts_do_not_hang_on_the_order_of_the_levels(wanted_mm):
    """A flat holder 40 mm above the tip, the cap's top at 6: 34 mm from it over the lowest level, exactly."""
    tree, found = dome(), []
    top_mm = tree.triangles_mm[..., 2].max()
    for levels in (LEVELS_MM, LEVELS_MM[::-1]):
        lines = passes(levels)
        worst = np.full((len(levels), 4), -np.inf)
        proven, least, spot = sweep(tree.arrays, lines, np.arange(len(lines)) // 40, HOLDER, wanted_mm, 50.0, TOLERANCE_MM, worst)
        rough_mm = max(TOLERANCE_MM, SHARE * (wanted_mm - 40.0 + top_mm))      # deep contacts are measured as roughly
        assert 40.0 - top_mm - rough_mm <= proven <= 40.0 - top_mm <= least <= 40.0 - top_mm + rough_mm
        assert abs(spot[2] - top_mm) <= rough_mm
        found.append(worst[np.argsort(levels), 0])
    is_near = 40.0 + np.sort(LEVELS_MM) - top_mm < wanted_mm - TOLERANCE_MM
    assert ((found[0] > 0) == is_near).all() and ((found[1] > 0) == is_near).all()
    amount = wanted_mm - 40.0 - np.sort(LEVELS_MM)[is_near] + top_mm
    assert all((np.abs(f[is_near] - amount) <= np.maximum(TOLERANCE_MM, SHARE * amount)).all() for f in found)
