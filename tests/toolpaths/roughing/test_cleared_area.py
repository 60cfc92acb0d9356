"""Fields kept up to date round a pass are those that are worked out anew over the whole level."""

import numpy as np
import pytest

from cuspline.toolpaths.roughing.cleared_area import FARTHEST_NODES, LevelGround
from cuspline.toolpaths.roughing.engagement import clear_stroke

RADIUS, THIN, HIDDEN, SHALLOW = 9.0, 0.06, 0.8, 0.3


def _ground(material):
    permitted = np.full(material.shape, 100.0)
    permitted[50:62, 120:140] = -20.0
    return LevelGround(material, permitted, RADIUS, THIN, HIDDEN, SHALLOW)


def _block():
    y, x = np.indices((130, 170)).astype(float)
    return np.minimum(np.minimum(x - 30, 150 - x), np.minimum(y - 30, 110 - y))


def _stroke(ground, path):
    for a, b in zip(path, path[1:]):
        clear_stroke(ground.material, *a, *b, RADIUS, THIN)


PATHS = (np.array([[20.0, 40.0], [20.0, 100.0]]), np.array([[25.0, 25.0], [100.0, 28.0], [140.0, 60.0]]),
         np.array([[60.0, 60.0], [90.0, 70.0]]))


def test_passes_leave_the_fields_as_a_fresh_look_finds_them():
    ground = _ground(_block())
    for path in PATHS:
        _stroke(ground, path)
        ground.accept(path)
    fresh = _ground(ground.material)
    assert np.array_equal(ground.is_goal, fresh.is_goal)
    for kept, new in ((ground.standing, fresh.standing), (ground.surely, fresh.surely)):
        told = np.maximum(kept, new) > -RADIUS
        assert np.abs(kept - new)[told].max() < 0.1         # sweeps over another window miss the nearest elsewhere
    close = np.minimum(ground.apart, fresh.apart) < RADIUS + FARTHEST_NODES - 0.1
    beside = close & (ground.material < THIN)
    assert np.abs(ground.apart - fresh.apart)[beside].max() < 0.1


def test_a_pass_that_is_refused_leaves_no_trace_but_its_start():
    ground = _ground(_block())
    material, standing = ground.material.copy(), ground.standing.copy()
    _stroke(ground, PATHS[0])
    ground.refuse(PATHS[0], PATHS[0][0], 3)
    assert np.array_equal(ground.material, material) and np.array_equal(ground.standing, standing)
    assert ground.is_tabu[40, 20] and ground.is_tabu.sum() == 29


@pytest.mark.parametrize("largest, is_left", [(30, True), (20, False)])
def test_only_a_small_patch_is_given_up_and_it_still_counts_as_left(largest, is_left):
    y, x = np.indices((90, 90)).astype(float)
    material = np.where((np.abs(x - 40) <= 2) & (np.abs(y - 40) <= 2), 0.5, -0.5)
    ground = LevelGround(material, np.full(material.shape, 100.0), RADIUS, THIN, HIDDEN, SHALLOW)
    assert ground.is_goal.sum() == 25
    ground.give_up_scrap(np.array([50.0, 40.0]), largest)
    assert ground.is_goal.sum() == (0 if is_left else 25)
    assert ground.left_nodes == 25
