"""The smallest angle that clears a tool, beside closed forms and beside looking at every angle."""

import itertools
import math

import numpy as np
import pytest
from known_tools import tool

from cuspline.replay.clearance import ClearanceTree, stacked_head
from cuspline.shop.cutters import ToolLibrary
from cuspline.toolpaths.five_axis.clear_axes import AxisSearch, square_to, turned, ways_of, zero_ways
from cuspline.toolpaths.five_axis.even_turns import even_angles, runs_of_least_turn, runs_of_one_bearing

EVERY_RAD = math.radians(0.05)          # between the angles of the brute force
WITHIN_RAD = math.radians(0.1)
MOST_RAD = math.radians(60.0)
CLOSE_MM = 1e-4                         # of the brute force's distances
RADIUS, INTO, KEEP = 4.0, 0.03, 0.3
BALL = tool("ball", 2 * RADIUS)         # shank to 45 mm above the tip, then a holder of 40 mm diameter
HEAD = ((60.0, 90.0),)                  # of the spindle: height, diameter
IN_SPINDLE = ToolLibrary(tools=(BALL,)).in_spindle(tuple(stacked_head(HEAD, 0.0))).tools[0]


def wall(x_of, along=60.0, height=70.0, count=24):
    """(vertices, triangles) of a surface x = x_of(y, z) that stands on z = 0."""
    y, z = np.meshgrid(np.linspace(-along / 2, along / 2, count), np.linspace(0.0, height, count), indexing="ij")
    first = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    triangles = np.vstack([np.column_stack([first, first + 1, first + count]),
                           np.column_stack([first + 1, first + count + 1, first + count])])
    return np.stack([x_of(y, z), y, z], axis=-1).reshape(-1, 3), triangles


def tree_of(*meshes):
    begins = np.cumsum([0, *(len(v) for v, _ in meshes)])
    return ClearanceTree.of_triangles(np.vstack([v for v, _ in meshes]), np.vstack([t + b for (_, t), b in zip(meshes, begins)]))


CHANNEL = tree_of(wall(lambda y, z: -15.0 + 0.1 * y - 0.12 * z * np.sin(y / 15), height=54.0),
                  wall(lambda y, z: 13.0 - 0.08 * y + 0.2 * z * np.cos(y / 20), height=50.0))


def swung(axes, normals, angles_rad, bearings_rad):
    """(n, 3) axes turned by angles (n,) toward bearings (n,) of `ways_of`."""
    return turned(axes, ways_of(axes, normals, bearings_rad), angles_rad)


def searched(tree=CHANNEL, **more):
    return AxisSearch.of_tool(tree, IN_SPINDLE, into_mm=INTO, keep_mm=KEEP, **more)


def contacts(count, seed):
    """(middles, axes, normals) on the floor of the channel, standard directions leaning a little this way and that."""
    rng = np.random.default_rng(seed)
    middles = np.column_stack([rng.uniform(-7, 5, count), np.sort(rng.uniform(-25, 25, count)), np.full(count, RADIUS)])
    axes = rng.normal(0.0, 0.15, (count, 3)) + (0.0, 0.0, 1.0)
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    return middles, axes, np.tile((0.0, 0.0, 1.0), (count, 1))


def spare_mm(segments, tree, middles, axes):
    """(k,) how much farther off than wanted a tool about middles (k, 3) is, by the exact distance of each of its parts."""
    bare = np.array(segments) * (1.0, 1.0, 1.0, 1.0, 0.0)
    return np.min([tree.distances_mm(part[None], middles - RADIUS * axes, axes, CLOSE_MM) - grow
                   for part, grow in zip(bare, np.array(segments)[:, 4])], axis=0)


def test_beside_a_tall_wall_the_angle_is_that_of_the_lowest_corner():
    """A bare shank of radius 5 from 6 mm above the middle, a wall 4 mm beside it: 5 cos t - 6 sin t = 4."""
    tall = tree_of(wall(lambda y, z: -4.0 + 0 * y, height=90.0))
    search = AxisSearch(tree=tall, segments=[[10, 5, 80, 5, 0.0]], radius_mm=RADIUS)
    middle, up = np.array([[0.0, 0.0, RADIUS]]), np.array([[0.0, 0.0, 1.0]])
    away = search.angles_rad(middle, up, np.array([[1.0, 0.0, 0.0]]), MOST_RAD)[0]
    exact = math.acos(4.0 / math.hypot(5, 6)) - math.atan2(6, 5)
    assert exact <= away <= exact + EVERY_RAD
    assert np.isinf(search.angles_rad(middle, up, np.array([[-1.0, 0.0, 0.0]]), MOST_RAD))


def test_ways_along_a_run_go_on_where_normals_pass_through_the_axis_or_stand_along_it():
    """From one fillet over a floor to the other; then round a boss, all the way, where they follow the normals."""
    lean = np.concatenate([np.linspace(-0.5, 0.0, 20), np.zeros(20), np.linspace(0.0, 0.5, 20)])
    normals = np.column_stack([np.sin(lean), 1e-7 * np.sign(lean), np.cos(lean)])
    axes = np.tile((0.0, 0.0, 1.0), (60, 1))
    for way in (1, -1):
        found = zero_ways(axes, normals[::way])
        assert np.abs(found - found[0]).max() < 1e-5 and np.abs(np.abs(found[0]) - (1.0, 0.0, 0.0)).max() < 1e-6
    assert zero_ways(axes, axes) == pytest.approx(np.tile((1.0, 0.0, 0.0), (60, 1)))
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    steep = np.column_stack([0.9 * np.cos(angle), 0.9 * np.sin(angle), np.full(60, math.sqrt(0.19))])
    assert zero_ways(axes, steep) == pytest.approx(ways_of(axes, steep, np.zeros(60)))
    leaning = np.column_stack([np.sin(lean), np.zeros(60), np.cos(lean)])
    found = zero_ways(leaning, normals)
    assert np.abs((found * leaning).sum(axis=1)).max() < 1e-12 and (found[1:] * found[:-1]).sum(axis=1).min() > 0.99


def test_what_stands_beside_holds_off_all_but_the_flutes():
    """Two walls, the lower one beside: flutes are in it at some of the angles found, which are those of looking at every one."""
    middles, axes, normals = contacts(60, seed=11)
    far = tree_of(wall(lambda y, z: 13.0 - 0.08 * y + 0.2 * z * np.cos(y / 20), height=50.0))
    near = tree_of(wall(lambda y, z: -9.0 + 0.1 * y - 0.12 * z * np.sin(y / 15), height=30.0))
    alone = searched(far)
    search = alone.with_beside(near, IN_SPINDLE, (0.1, 1.0))
    ways, grid = ways_of(axes, normals, np.zeros(60)), np.arange(0.0, MOST_RAD, EVERY_RAD)
    found = search.angles_rad(middles, axes, ways, MOST_RAD)
    assert 10 < (found > alone.angles_rad(middles, axes, ways, MOST_RAD) + WITHIN_RAD).sum() < 40
    looked = np.full(60, np.inf)
    for angle in grid[::-1]:
        turned_to = turned(axes, ways, np.full(60, angle))
        clear = np.minimum(spare_mm(alone.segments, far, middles, turned_to),
                           spare_mm(search.beside_segments, near, middles, turned_to)) >= 0.0
        looked[clear] = angle
    assert np.isfinite(looked).sum() > 30 and (np.isfinite(found) == np.isfinite(looked)).all()
    both = np.isfinite(found)
    assert np.abs(found[both] - looked[both]).max() < WITHIN_RAD
    flutes_too = AxisSearch.of_tool(near, IN_SPINDLE, keep_mm=0.1)
    assert (~flutes_too.is_clear(middles, turned(axes, ways, np.where(both, found, 0.0))))[both].sum() > 5


def test_the_smallest_angle_is_that_of_looking_at_every_one():
    middles, axes, normals = contacts(150, seed=5)
    search, grid = searched(), np.arange(0.0, MOST_RAD, EVERY_RAD)
    rng = np.random.default_rng(6)
    bearings = rng.uniform(-math.pi, math.pi, len(middles))
    ways = ways_of(axes, normals, bearings)
    found = search.angles_rad(middles, axes, ways, MOST_RAD)
    leans, never = np.flatnonzero((found > 0.0) & np.isfinite(found)), np.flatnonzero(np.isinf(found))
    assert len(leans) > 12 and len(never) > 5
    for row in [*leans[:12], *never[:5]]:
        every = turned(np.repeat(axes[row:row + 1], len(grid), axis=0), np.repeat(ways[row:row + 1], len(grid), axis=0), grid)
        free = grid[spare_mm(search.segments, CHANNEL, middles[row], every) >= 2 * CLOSE_MM]
        assert abs(min(free, default=math.inf) - found[row]) < WITHIN_RAD if len(free) else found[row] > MOST_RAD - WITHIN_RAD


def test_over_both_angles_none_is_smaller():
    """Against every lead and tilt on a grid of 2 by 8 degrees below it."""
    middles, axes, normals = contacts(10, seed=9)
    angles, bearings = searched().over_both_rad(middles, axes, normals, MOST_RAD)
    directions = np.linspace(-math.pi, math.pi, 45, endpoint=False)
    grid = np.radians(np.arange(0.0, 60.0, 2.0))
    looked = 0
    for row in np.flatnonzero(angles > 0.0):
        a, t = np.meshgrid(grid[grid < angles[row] - WITHIN_RAD], directions, indexing="ij")
        rows = lambda v: np.repeat(v[row:row + 1], a.size, axis=0)
        every = swung(rows(axes), rows(normals), a.ravel(), t.ravel())
        assert (spare_mm(searched().segments, CHANNEL, middles[row], every) < 0.0).all()
        looked += 1
    assert looked >= 4


def test_what_it_says_clears_does():
    middles, axes, normals = contacts(200, seed=11)
    angles, bearings = searched().over_both_rad(middles, axes, normals, MOST_RAD)
    found = np.isfinite(angles)
    stand = swung(axes[found], normals[found], angles[found], bearings[found])
    assert spare_mm(searched().segments, CHANNEL, middles[found], stand).min() > -2 * CLOSE_MM
    assert searched().is_clear(middles[found], stand).all() and found.sum() > 150


def test_a_holder_2_mm_longer_and_walls_2_mm_nearer_are_found_wherever_they_touch():
    """Poses that just clear: with the fault each is asked again, and beside the exact distance none is overlooked."""
    middles, axes, normals = contacts(400, seed=13)
    angles, bearings = searched().over_both_rad(middles, axes, normals, MOST_RAD)
    leans = np.isfinite(angles) & (angles > math.radians(1.0))
    stand = swung(axes, normals, np.where(leans, angles, 0.0), bearings)[leans]
    assert searched().is_clear(middles[leans], stand).all() and leans.sum() > 100
    longer, nearer = np.array(searched().segments), np.array(searched().segments)
    longer[-2, 0] -= 2.0                # the holder; above it stands the spindle head
    nearer[:, 4] += 2.0                 # every part of the tool, which is the same
    for segments, least in ((longer, 60), (nearer, leans.sum())):
        faulty = AxisSearch(tree=CHANNEL, segments=segments, radius_mm=RADIUS)
        touches = spare_mm(segments, CHANNEL, middles[leans], stand) < 0.0
        assert not faulty.is_clear(middles[leans], stand)[touches].any() and touches.sum() >= least


def test_ways_are_square_to_the_axis_and_begin_toward_the_normal():
    _, axes, normals = contacts(50, seed=3)
    zero, quarter = ways_of(axes, normals, np.zeros(50)), ways_of(axes, normals, np.full(50, math.pi / 2))
    assert np.abs((zero * axes).sum(axis=1)).max() < 1e-12 and (zero * normals).sum(axis=1).min() > 0
    assert np.abs(np.cross(zero, axes) - quarter).max() < 1e-12
    assert np.array_equal(ways_of(axes, axes, np.zeros(50)), square_to(axes))
    assert np.abs((square_to(np.eye(3)) * np.eye(3)).sum(axis=1)).max() == 0.0


def test_the_limit_holds_and_a_standard_direction_beyond_it_is_turned_back():
    search = searched(limit_rad=math.radians(20.0))
    middle = np.array([[0.0, 0.0, 60.0]])           # above everything: only the limit turns it
    axis, up = np.array([[0.0, math.sin(0.6), math.cos(0.6)]]), np.array([[0.0, 0.0, 1.0]])
    back = ways_of(axis, up, np.zeros(1))
    assert search.angles_rad(middle, axis, back, MOST_RAD)[0] == pytest.approx(0.6 - math.radians(20.0), abs=EVERY_RAD)
    assert not search.is_clear(middle, axis)[0] and np.isinf(search.angles_rad(middle, axis, -back, MOST_RAD))[0]


@pytest.mark.parametrize("window", [1, 2, 5, 9])
def test_an_evened_turn_is_nowhere_below_the_least_and_its_slope_is_bounded(window):
    least = np.abs(np.random.default_rng(window).normal(size=300)) * (np.arange(300) % 37 < 9)
    even = even_angles(least, window)
    assert (even >= least - 1e-12).all()
    assert np.abs(np.diff(even)).max() <= least.max() / (2 * (window - window // 2) + 1) + 1e-12


def test_a_pass_is_cut_into_the_fewest_runs_of_one_bearing():
    inf = math.inf
    least = np.array([[0.1, inf], [0.1, 0.2], [inf, 0.2], [inf, inf], [inf, 0.3], [0.2, 0.3], [0.1, inf]])
    assert runs_of_one_bearing(least) == [(0, 1, 0), (1, 2, 1), (4, 5, 1), (5, 6, 0)]
    assert runs_of_one_bearing(np.full((4, 2), inf)) == [] and runs_of_one_bearing(np.zeros((4, 2))) == [(0, 3, 0)]


def test_runs_of_least_turn_are_the_cheapest_of_all_choices():
    """Every choice of a bearing a station, tried; stations that nothing clears part the run."""
    rng = np.random.default_rng(3)
    for _ in range(40):
        least = np.where(rng.random((6, 3)) < 0.35, np.inf, rng.uniform(0.0, 1.0, (6, 3)))
        is_clear, change = np.isfinite(least).any(axis=1), rng.uniform(0.05, 0.6)
        joined = is_clear[1:] & is_clear[:-1]

        def cost(chosen):
            chosen = np.asarray(chosen)
            return least[is_clear, chosen[is_clear]].sum() + change * (joined & (chosen[1:] != chosen[:-1])).sum()

        runs = runs_of_least_turn(least, change)
        chosen = np.zeros(6, int)
        for first, last, bearing in runs:
            assert np.isfinite(least[first:last + 1, bearing]).all()
            chosen[first:last + 1] = bearing
        # a run that begins where the one before ends shares that station: it is the one before's
        for (_, last, bearing), (first, _, _) in zip(runs, runs[1:]):
            if first == last:
                chosen[last] = bearing
        assert set(np.flatnonzero(is_clear)) == {k for first, last, _ in runs for k in range(first, last + 1)}
        assert cost(chosen) == pytest.approx(min(cost(c) for c in itertools.product(range(3), repeat=6)))
