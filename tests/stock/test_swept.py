"""The swept cutter against closed forms, against dense brute force, and its two formulas against each other."""

import numpy as np
import pytest
from known_programs import arc, feed, program, random_moves, rapid, tips_along, tool

from cuspline.program.program import Plane
from cuspline.stock.swept import deviation_mm, signed_distance_mm, stock_height_mm, swept_paths
from cuspline.values.errors import SimulationError

BOX = (-50, -50, -30), (50, 50, 0)
CUTTERS = [("ball", None), ("bull_nose", 1.0), ("flat", None)]


def paths_of(start, moves, type_="ball", diameter=6, corner=None):
    return swept_paths(program(start, moves), {1: tool(type_, diameter, corner)})


def test_slot_has_the_section_of_the_cutter():
    y = np.linspace(-2.9, 2.9, 30)
    xy = np.column_stack([np.zeros(30), y])
    for (type_, corner), section in zip(CUTTERS, (3 - np.sqrt(9 - y**2),
                                                  1 - np.sqrt(1 - np.maximum(np.abs(y) - 2, 0)**2), 0 * y)):
        paths = paths_of((-10, 0, -4), [feed(10, 0, -4)], type_, 6, corner)
        assert np.abs(stock_height_mm(paths, xy, 0.0) - (section - 4)).max() < 1e-12
    assert stock_height_mm(paths, [(0, 3.001)], 0.0) == 0.0


def test_cusp_between_two_passes_is_exact():
    r, s = 5.0, 0.6
    paths = paths_of((-20, 0, -1), [feed(20, 0, -1), feed(20, s, -1), feed(-20, s, -1)], diameter=2 * r)
    h = r - np.sqrt(r**2 - s**2 / 4)
    assert abs(stock_height_mm(paths, [(0, s / 2)], 0.0)[0] - (h - 1)) < 1e-12
    assert abs(deviation_mm(paths, *BOX, [(0, s / 2, -1)], [(0, 0, 1)], 1.0)[0] - h) < 1e-7
    assert abs(deviation_mm(paths, *BOX, [(0, 0, -1.5)], [(0, 0, 1)], 1.0)[0] - 0.5) < 1e-7
    assert abs(deviation_mm(paths, *BOX, [(0, 0, -0.9)], [(0, 0, 1)], 1.0)[0] + 0.1) < 1e-7


@pytest.mark.parametrize("plane", [Plane.ZX, Plane.YZ])
def test_groove_along_a_vertical_arc_is_a_torus(plane):
    """Ball centres on a circle of radius rho: everything within r of it is gone, nothing else below."""
    rho, r, k = 20.0, 3.0, 0 if plane == Plane.ZX else 1
    along = lambda u, z: (u, 0.0, z) if k == 0 else (0.0, u, z)
    center = along(0.0, 10.0 - r)
    turn = plane == Plane.YZ                               # from -u over the bottom to +u
    paths = paths_of(along(-rho * np.sin(1), 10 - r - rho * np.cos(1)),
                     [arc(along(rho * np.sin(1), 10 - r - rho * np.cos(1)), center, plane, clockwise=not turn)])
    a, phi = np.meshgrid(np.linspace(-0.9, 0.9, 9), np.linspace(-1.5, 1.5, 9))
    tube = lambda q: ((rho + q * np.cos(phi)) * np.sin(a), q * np.sin(phi), 10 - (rho + q * np.cos(phi)) * np.cos(a))
    for q in (r, r + 0.4, r - 0.3):
        u, v, z = (c.ravel() for c in tube(q))
        points = np.column_stack([u, v, z] if k == 0 else [v, u, z])
        assert np.abs(signed_distance_mm(paths, points) - (q - r)).max() < 1e-12
        if q == r:
            assert np.abs(stock_height_mm(paths, points[:, :2], 50.0) - z).max() < 1e-12


@pytest.mark.parametrize("type_,corner", CUTTERS)
@pytest.mark.parametrize("clockwise", [False, True])
def test_ring_groove_has_the_section_of_the_cutter_all_round(type_, corner, clockwise):
    """A whole circle at one height, in few pieces; beyond the ends of a part of it the cutter's own circle."""
    rho, z, rng = 8.0, -4.0, np.random.default_rng(1)
    whole = paths_of((rho + 1, 2, z), [arc((rho + 1, 2, z), (1, 2, z), Plane.XY, clockwise=clockwise)], type_, 6, corner)
    a, rc = whole[0].flat_radius_mm, whole[0].corner_radius_mm
    part = paths_of((rho + 1, 2, z), [arc((1, 2 - rho, z), (1, 2, z), Plane.XY, clockwise=clockwise)], type_, 6, corner)
    assert len(whole[0].row) == 32 and not whole[0].error_mm
    angle, far, up = rng.uniform(0, 2 * np.pi, 400), rng.uniform(0, rho + 5, 400), rng.uniform(-6, 2, 400)
    points = np.column_stack([1 + far * np.cos(angle), 2 + far * np.sin(angle), up])
    met = (angle >= 1.5 * np.pi) if clockwise else (angle <= 1.5 * np.pi)
    ends = np.minimum(*(np.hypot(*(points[:, :2] - end).T) for end in ((rho + 1, 2), (1, 2 - rho))))
    for paths, beside in ((whole, np.abs(far - rho)), (part, np.where(met, np.abs(far - rho), ends))):
        e, f = beside - a, z + rc - up
        exact = np.where((e > 0) & (f > 0), np.hypot(e, f), np.maximum(e, f)) - rc
        assert np.abs(signed_distance_mm(paths, points) - exact).max() < 1e-12
        height = np.where(beside <= a + rc, z + rc - np.sqrt(np.maximum(rc**2 - np.maximum(e, 0)**2, 0)), 0.0)
        assert np.abs(stock_height_mm(paths, points[:, :2], 0.0) - height).max() < 1e-9
        smaller = [p.grown(-0.1) for p in paths]
        less = signed_distance_mm(smaller, points) - exact
        assert (less >= 0.1 - 1e-12).all() and (rc == 0 or less.max() <= 0.1 + 1e-12)


def test_a_ray_through_the_inner_side_of_a_level_arc_meets_the_boss_that_it_leaves():
    paths = paths_of((12, 0, -4), [arc((12, 0, -4), (0, 0, -4), Plane.XY)], "flat", 6)      # leaves a boss of radius 9
    d = deviation_mm(paths, *BOX, [(9.5, 0, -2), (8.9, 0, -2), (9.5, 0, -2), (8.95, 1.5, -2), (8.95, 0.5, -2)],
                     [(1, 0, 0), (1, 0, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0)], 3.0)
    at = np.sqrt(81 - 8.95**2)
    assert np.allclose(d, [-0.5, 0.1, -3.0, at - 1.5, at - 0.5], atol=1e-7)


def test_arc_over_a_hill_leaves_the_inner_circle():
    rho, r = 20.0, 3.0
    paths = paths_of((-10, 0, np.sqrt(300) - r), [arc((10, 0, np.sqrt(300) - r), (0, 0, -r), Plane.ZX)])
    x = np.linspace(-7, 7, 15)
    assert np.abs(stock_height_mm(paths, np.column_stack([x, 0 * x]), 50.0) - np.sqrt((rho - r)**2 - x**2)).max() < 1e-12


def test_plunge_leaves_a_hemisphere():
    paths = paths_of((0, 0, 5), [feed(0, 0, -3)], diameter=10)
    rng = np.random.default_rng(0)
    d = rng.normal(size=(200, 3))
    d[:, 2] = -np.abs(d[:, 2])
    d /= np.linalg.norm(d, axis=1)[:, None]
    on, box = (0, 0, 2) + 5 * d, ((-9, -9, -9), (9, 9, 9))
    assert np.abs(signed_distance_mm(paths, on)).max() < 1e-12
    assert np.abs(deviation_mm(paths, *box, (0, 0, 2) + 5.2 * d, -d, 1.0) - 0.2).max() < 1e-7
    assert np.abs(deviation_mm(paths, *box, (0, 0, 2) + 4.9 * d, -d, 1.0) + 0.1).max() < 1e-7


@pytest.mark.parametrize("type_,corner", CUTTERS)
def test_vertical_wall_is_where_the_cutter_side_passed(type_, corner):
    paths = paths_of((-20, 3, -10), [feed(20, 3, -10)], type_, 6, corner)
    wall = np.column_stack([np.linspace(-15, 15, 20), np.zeros(20), np.linspace(-6.9, -0.1, 20)])
    normals = np.tile((0.0, 1.0, 0.0), (20, 1))
    for shift in (0.0, 0.02, -0.02):
        d = deviation_mm(paths, *BOX, wall + (0, -shift, 0), normals, 1.0)
        assert np.abs(d - shift).max() < 1e-7


def test_stock_sides_end_the_ray_and_uncut_stock_is_capped():
    paths = paths_of((0, 0, 20), [feed(1, 0, 20)])
    points = [(50, 0, -10), (49.7, 0, -10), (0, 0, -10), (0, 0, 0.5), (51, 0, -10)]
    normals = [(1, 0, 0), (1, 0, 0), (0, 0, 1), (0, 0, 1), (1, 0, 0)]
    d = deviation_mm(paths, *BOX, points, normals, 2.0)
    assert np.allclose(d, [0, 0.3, 2.0, -0.5, -1.0], atol=1e-7)


@pytest.mark.parametrize("type_,corner", CUTTERS)
@pytest.mark.parametrize("arcs", [False, True])
def test_distance_and_height_agree_with_dense_brute_force(type_, corner, arcs):
    rng = np.random.default_rng(7)
    start, moves = random_moves(rng, 25, (0, 0, -5), (25, 20, 5), arcs)
    posted = program(start, moves)
    paths = swept_paths(posted, {1: tool(type_, 6, corner)})
    a, rc = paths[0].flat_radius_mm, paths[0].corner_radius_mm
    tips = tips_along(posted, 3000)
    points = rng.uniform(tips.min(axis=0) - 4, tips.max(axis=0) + 4, (150, 3))
    distance, height = signed_distance_mm(paths, points), stock_height_mm(paths, points[:, :2], 40.0)
    for p, d, h in zip(points, distance, height):
        beside, below = np.hypot(*(tips[:, :2] - p[:2]).T) - a, tips[:, 2] + rc - p[2]
        brute = np.where((beside > 0) & (below > 0), np.hypot(beside, below), np.maximum(beside, below)).min() - rc
        assert -5e-5 < brute - d < 0.01                    # steps of brute force are up to 0.016 mm
        over = beside <= rc
        if over.any():
            e = np.clip(beside[over], 0, rc)
            assert (tips[over, 2] + rc - np.sqrt(rc**2 - e**2)).min() > h - 1e-3
    cut = height < 40.0
    surface = np.column_stack([points[:, :2], height])[cut]
    assert cut.sum() > 50 and np.abs(signed_distance_mm(paths, surface)).max() < 2e-9


def test_retracing_and_splitting_change_nothing():
    rng = np.random.default_rng(3)
    start, moves = random_moves(rng, 20, (0, 0, -5), (25, 20, 5))
    ends = [np.array(start), *(np.array(m[1]) for m in moves)]
    back = moves + [feed(*e) for e in ends[::-1]]
    split = [m for a, b in zip(ends, ends[1:]) for m in (feed(*((a + b) / 2)), feed(*b))]
    points = rng.uniform((0, 0, -8), (25, 20, 8), (500, 3))
    for type_, corner in CUTTERS:
        want = paths_of(start, moves, type_, 6, corner)
        for other in (back, split):
            have = paths_of(start, other, type_, 6, corner)
            assert np.abs(signed_distance_mm(have, points) - signed_distance_mm(want, points)).max() < 1e-9
            assert np.abs(stock_height_mm(have, points[:, :2], 9.0) - stock_height_mm(want, points[:, :2], 9.0)).max() < 1e-7


def test_turning_a_quarter_turn_changes_nothing():
    rng = np.random.default_rng(4)
    start, moves = random_moves(rng, 25, (0, 0, -5), (25, 20, 5), arcs=True)
    turn = lambda p: np.column_stack([-np.atleast_2d(p)[:, 1], np.atleast_2d(p)[:, 0], np.atleast_2d(p)[:, 2]])
    planes = {Plane.XY: (Plane.XY, False), Plane.ZX: (Plane.YZ, True), Plane.YZ: (Plane.ZX, False)}
    turned = []
    for kind, end, center, plane in moves:
        new, flips = planes[plane]
        flips = flips and kind >= 2
        turned.append((5 - kind if flips else kind, turn(end)[0], turn(center)[0], new))
    points = rng.uniform((0, 0, -8), (25, 20, 8), (500, 3))
    for type_, corner in CUTTERS:
        want = signed_distance_mm(paths_of(start, moves, type_, 6, corner), points)
        have = signed_distance_mm(paths_of(turn(start)[0], turned, type_, 6, corner), turn(points))
        assert np.abs(have - want).max() < 5e-5            # chords of two arcs may begin elsewhere


def test_grown_cutter_erodes_the_stock_exactly():
    rng = np.random.default_rng(5)
    start, moves = random_moves(rng, 10, (0, 0, -5), (25, 20, 5))
    for type_, corner in CUTTERS:
        paths = paths_of(start, moves, type_, 6, corner)
        xy = rng.uniform((0, 0), (25, 20), (300, 2))
        z = stock_height_mm(paths, xy, 40.0, inflate_mm=0.05)
        on = np.column_stack([xy, z])[z < 40.0]
        assert np.abs(signed_distance_mm(paths, on) - 0.05).max() < 1e-8


def test_unknown_starts_are_left_out_and_unknown_tools_refused():
    moves = [rapid(0, 0, 5), feed(0, 0, -1), feed(9, 0, -1)]
    paths = swept_paths(program((np.nan, np.nan, np.nan), moves), {1: tool("ball", 6)})
    assert set(paths[0].row) == {1, 2}
    with pytest.raises(SimulationError, match="T4"):
        swept_paths(program((0, 0, 5), moves, tool_number=4), {1: tool("ball", 6)})


def test_an_arc_with_two_radii_is_refused_and_a_rounded_one_is_bounded():
    with pytest.raises(SimulationError, match="line 10"):
        paths_of((-5, 0, 0), [arc((6, 0, 0), (0, 0, 0), Plane.ZX)])
    paths = paths_of((-5, 0, 0), [arc((5.0001, 0, 0), (0, 0, 0), Plane.ZX)])
    assert 0 < paths[0].error_mm <= 2e-5


def test_answers_do_not_depend_on_the_order_of_the_questions():
    rng = np.random.default_rng(6)
    start, moves = random_moves(rng, 40, (0, 0, -5), (25, 20, 5), arcs=True)
    paths = paths_of(start, moves)
    points = rng.uniform((0, 0, -8), (25, 20, 8), (999, 3))
    shuffle = rng.permutation(999)
    assert (signed_distance_mm(paths, points)[shuffle] == signed_distance_mm(paths, points[shuffle])).all()


def test_a_ray_that_leaves_the_billet_counts_only_as_far_as_it_runs_inside():
    """Beside the billet's edge the normal may point out of its side: no stock lies behind, nothing more is missing."""
    low, high = (0, 0, -10), (20, 20, 0)
    paths = paths_of((-10, 10, -1), [feed(30, 10, -1)], "flat", 30)
    normal = np.array([0.0, -0.6, 0.8])
    inside, beside = np.array([10, 10, -0.6]), np.array([10, 20 - 1e-3, -0.6])
    depth = deviation_mm(paths, low, high, [inside, beside], [normal, normal], 2.0)
    assert abs(depth[0] + 0.4 / 0.8) < 1e-7
    assert abs(depth[1] + 1e-3 / 0.6) < 1e-7
