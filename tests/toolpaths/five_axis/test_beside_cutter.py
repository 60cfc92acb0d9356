"""What lies left, right and above of a cutter between two walls, beside looking at every place of these."""

import math

import numpy as np
import pytest
from known_tools import tool

from cuspline.replay.clearance import ClearanceTree
from cuspline.replay.clearance_kernels import segment_distance
from cuspline.toolpaths.five_axis.beside_cutter import Way, beside, cutting_part, largest_ball_mm, turned_by_rule
from cuspline.toolpaths.five_axis.clear_axes import AxisSearch
from cuspline.values.compiled import njit

RADIUS, INTO, KEEP = 4.0, 0.03, 0.3
TALL, LONG, EVERY = 50.0, 32.0, 1.0     # of the walls, and how far apart their places are looked at
BALL = tool("ball", 2 * RADIUS)
CUTTER = cutting_part(BALL, INTO)


def two_walls(left, right):
    """(vertices, triangles) of walls at x = left and right, leaning apart by a tenth, and a floor at z = 0."""
    corners = [[(x + s * 0.1 * z, y, z) for y, z in ((-LONG, 0), (LONG, 0), (LONG, TALL), (-LONG, TALL))]
               for x, s in ((left, -1), (right, 1))]
    floor = [(left, -LONG, 0), (right, -LONG, 0), (right, LONG, 0), (left, LONG, 0)]
    vertices = np.array([*corners[0], *corners[1], *floor], float)
    return vertices, np.array([(a, a + b, a + b + 1) for a in (0, 4, 8) for b in (1, 2)])


def searched(left, right):
    return AxisSearch.of_tool(ClearanceTree.of_triangles(*two_walls(left, right)), BALL, into_mm=INTO, keep_mm=KEEP)


def places(left, right):
    """(m, 3) all over walls and floor."""
    y, z = np.meshgrid(np.arange(-LONG, LONG + EVERY, EVERY), np.arange(0.0, TALL + EVERY, EVERY), indexing="ij")
    y, z = y.ravel(), np.minimum(z.ravel(), TALL)
    walls = [np.column_stack([x + s * 0.1 * z, y, z]) for x, s in ((left, -1), (right, 1))]
    x, v = np.meshgrid(np.linspace(left, right, int((right - left) / EVERY) + 2), np.unique(y), indexing="ij")
    return np.vstack([*walls, np.column_stack([x.ravel(), v.ravel(), 0 * x.ravel()])])


@njit
def nearest_rows(points, tips, axes, sides, segments, near):
    """(n,) least distance of the points on a side of the axis to the tool, no farther than `near`."""
    found = np.empty(len(tips))
    for i in range(len(tips)):
        best = near
        for p in range(len(points)):
            h = square = beyond = 0.0
            for k in range(3):
                arm = points[p, k] - tips[i, k]
                h, square, beyond = h + arm * axes[i, k], square + arm * arm, beyond + arm * sides[i, k]
            if beyond < 0.0:
                continue
            rho = math.sqrt(max(square - h * h, 0.0))
            for s in range(len(segments)):
                d, _, _ = segment_distance(rho, h, segments[s])
                best = min(best, d)
        found[i] = best
    return found


def poses(count, seed):
    """(middles, axes, feeds) over the channel's floor, ten degrees this way and that."""
    rng = np.random.default_rng(seed)
    axes = rng.normal(0, 0.17, (count, 3)) + (0, 0, 1.0)
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    middles = np.column_stack([rng.uniform(-10.8, 10.8, count), rng.uniform(-20, 20, count), RADIUS + rng.uniform(0, 15, count)])
    return middles, axes, np.column_stack([rng.normal(0, 0.3, count), np.ones(count), np.zeros(count)])


def test_ten_thousand_poses_between_two_walls_miss_nothing_and_call_nothing_clear_that_is_not():
    middles, axes, feeds = poses(10_000, seed=1)
    search, ground = searched(-13.0, 14.0), places(-13.0, 14.0)
    found, right = beside(search, CUTTER, middles, axes, feeds), np.cross(feeds, axes)
    above = search.segments[1:]
    gap, tips = 1.01 * EVERY / math.sqrt(2), middles - RADIUS * axes        # no place of a wall is farther from one looked at
    for told, segments, side in ((found.cutter_left, CUTTER, -right), (found.cutter_right, CUTTER, right),
                                 (found.above_left, above, -right), (found.above_right, above, right)):
        segments = np.ascontiguousarray(segments)
        assert told[nearest_rows(ground, tips, axes, side, segments, 0.1) < 0.0].all()
        assert (nearest_rows(ground, tips[told], axes[told], 0.0 * side[told], segments, 10.0) < gap).all()
        assert 200 < told.sum() < 9_800
    assert {Way(w) for w in np.unique(found.way)} == set(Way)


def test_the_rule_turns_away_from_one_wall_and_along_between_two():
    up, feed = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 1.0, 0.0]])
    at = lambda x: np.array([[x, 0.0, RADIUS]])
    wide = searched(-40.0, 40.0)
    assert beside(wide, CUTTER, at(0.0), up, feed).way[0] == Way.STAY
    way, angle, axis = turned_by_rule(wide, CUTTER, at(-30.0), up, feed, math.radians(60))
    assert way[0] == Way.TILT_RIGHT and 0 < angle[0] < 1 and axis[0, 0] > 0
    way, angle, axis = turned_by_rule(wide, CUTTER, at(30.0), up, feed, math.radians(60))
    assert way[0] == Way.TILT_LEFT and 0 < angle[0] < 1 and axis[0, 0] < 0
    assert beside(searched(-14.0, 14.0), CUTTER, at(0.0), up, feed).way[0] == Way.INCLINE


def test_a_channel_narrower_than_the_cutter_is_incline_then_unreachable_with_the_ball_that_would():
    """Walls 6 mm apart at the floor that lean apart by a tenth: r + 0 = (3 + 0.1 r) / sqrt(1.01) for the ball in its middle."""
    search = searched(-3.0, 3.0)
    middle, up, feed = np.array([[0.0, 0.0, RADIUS]]), np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 1.0, 0.0]])
    found = beside(search, CUTTER, middle, up, feed)
    assert found.cutter_left[0] and found.cutter_right[0] and found.way[0] == Way.INCLINE
    way, angle, axis = turned_by_rule(search, CUTTER, middle, up, feed, math.radians(80))
    assert way[0] == Way.INCLINE and np.isinf(angle[0]) and np.isnan(axis).all()
    largest = largest_ball_mm(search.tree, np.zeros((1, 3)), up, RADIUS)[0]
    assert largest == pytest.approx(3.0 / (math.sqrt(1.01) - 0.1), abs=0.005)
    slim = tool("ball", 2 * largest - 0.02)
    fits = AxisSearch.of_tool(search.tree, slim, into_mm=INTO, keep_mm=KEEP)
    met = beside(fits, cutting_part(slim, INTO), np.array([[0.0, 0.0, largest - 0.01]]), up, feed)
    assert not met.cutter_left[0] and not met.cutter_right[0]


def test_a_ball_that_fits_is_not_made_smaller():
    tree = ClearanceTree.of_triangles(*two_walls(-40.0, 40.0))
    assert largest_ball_mm(tree, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), 12.0)[0] == 12.0
