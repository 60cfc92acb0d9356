"""Plane distance fields of a level against closed forms and against every seed looked at."""

import numpy as np
import pytest

from cuspline.toolpaths.roughing.level_fields import PlaneGrid, inner_distance, level_distance_mm, nearest_seed

RADIUS_MM = 6.3


def _cone(xy_mm):
    return np.linalg.norm(xy_mm - np.array([10.1, 9.7]), axis=1)


def _cylinder(xy_mm):
    return np.where(_cone(xy_mm) < RADIUS_MM, -1.0, 50.0)


SWEEP_NODES = 0.1       # a carried place is the nearest one of a node beside it: so much too far at most


@pytest.mark.parametrize("height", [_cone, _cylinder])
def test_distance_to_a_circle_is_good_to_its_chords_beside_it_and_to_a_tenth_of_a_node_farther_off(height):
    grid = PlaneGrid.over((0, 0), (20, 20), 0.25)
    level = RADIUS_MM if height is _cone else 0.0
    found = level_distance_mm(grid, grid.sampled(height) <= level, lambda xy: height(xy) <= level)
    exact = RADIUS_MM - grid.sampled(_cone)
    beside, near = np.abs(exact) < 0.25, np.abs(exact) < 4.0
    chords_mm = 0.25 ** 2 / 4 / RADIUS_MM + 0.25 / 64       # a cell's diagonal as chord, and the bisection
    assert np.abs(found - exact)[beside].max() <= chords_mm
    assert np.abs(found - exact)[near].max() <= chords_mm + SWEEP_NODES * 0.25


def test_the_line_inside_a_circle_is_a_smaller_circle():
    x, y = np.meshgrid(np.arange(60.0), np.arange(60.0))
    distance = 20.0 - np.hypot(x - 30.2, y - 29.6)
    found, exact = inner_distance(distance, 5.0), distance - 5.0
    assert np.abs(found - exact)[np.abs(exact) < 1.0].max() < 1 / 4 / 15 + 1e-3
    assert np.abs(found - exact)[np.abs(exact) < 8.0].max() < 1 / 4 / 15 + SWEEP_NODES


def test_idle_nodes_and_a_limit_change_nothing_that_is_wanted():
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(80.0), np.arange(50.0))
    distance = np.min([np.hypot(x - a, y - b) - 6.0 for a, b in rng.uniform(5, 45, (6, 2))], axis=0)
    whole = inner_distance(distance, 0.0)
    idle = (distance < -3.0) | (x > 70)
    part = inner_distance(distance, 0.0, idle, 8.0)
    wanted = ~idle & (np.abs(whole) < 8.0) & (x < 62)
    assert wanted.sum() > 500
    assert np.abs(part - whole)[wanted].max() < SWEEP_NODES


def test_nearest_seeds_are_those_that_looking_at_every_seed_finds():
    rng = np.random.default_rng(5)
    is_seed = rng.random((40, 55)) < 0.02
    near, apart = nearest_seed(is_seed, np.zeros(is_seed.shape, bool), np.inf)
    j, i = np.nonzero(is_seed)
    y, x = np.indices(is_seed.shape)
    every = np.hypot(x[..., None] - i, y[..., None] - j)
    assert (apart >= every.min(axis=2) - 1e-9).all()
    assert (apart - every.min(axis=2)).max() < 0.1      # the sweeps miss the nearest by little, seldom
    assert np.mean(apart > every.min(axis=2) + 1e-9) < 0.01
    assert np.allclose(np.hypot(near[..., 0] - x, near[..., 1] - y), apart)


def test_where_there_is_no_seed_everything_is_far():
    assert nearest_seed(np.zeros((4, 5), bool), np.zeros((4, 5), bool), np.inf)[1].min() == 1e9
