"""Cutters of any shape with tilted, turning axes, against closed forms, brute force, and the upright engine."""

import numpy as np
import pytest
from known_programs import feed, program, random_moves, rapid, tool

from cuspline.program.program import Kind, Plane
from cuspline.shop.cutter_profile import CutterProfile
from cuspline.shop.cutters import Cutter, Tool
from cuspline.stock import tilted_tree
from cuspline.stock.contact_bounds import AT_U, AT_V, FACE, HALF_U, facing_distance, seen_from, step_bound
from cuspline.stock.outlines import outline_pieces
from cuspline.stock.swept import (
    deviation_mm,
    is_height_field,
    nearest_moves,
    signed_distance_mm,
    stock_height_mm,
    stock_intervals,
    swept_paths,
)
from cuspline.stock.tilted import posed_path
from cuspline.stock.tilted_kernels import FRAME_U, IS_FILLED, pose_distance
from cuspline.stock.tilted_pieces import AXIS, TIP, WAY
from cuspline.values.compiled import njit
from cuspline.values.errors import SimulationError

BOX = (-50, -50, -30), (50, 50, 30)
PLAIN = [("ball", None), ("bull_nose", 1.0), ("flat", None)]
CORPUS = (11, 23, 57)          # seeds of random programs; one that ever failed stays


def shaped(type_, diameter=6.0, corner=None, flute=20.0, neck=1.0, **shape):
    """A tool of any type, with a thin neck."""
    corner = {"ball": diameter / 2, "tapered_ball": diameter / 2, "flat": 0.0}.get(type_, corner or 0.0)
    cutter = Cutter(name=type_, type=type_, diameter_mm=diameter, corner_radius_mm=corner, flutes=2,
                    flute_length_mm=flute, neck_diameter_mm=neck, reach_mm=max(flute, 60.0), shank_diameter_mm=diameter,
                    overall_length_mm=120.0, **shape)
    return Tool(number=1, cutter=cutter, holder=tool("ball", 6).holder, stick_out_mm=80.0)


ALL = {"ball": shaped("ball"), "bull": shaped("bull_nose", corner=1.0), "flat": shaped("flat"),
       "tapered ball": shaped("tapered_ball", 4.0, taper_deg=6.0),
       "dovetail": shaped("dovetail", 12.0, flute=6.0, taper_deg=30.0),
       "round dovetail": shaped("dovetail", 12.0, corner=0.5, flute=6.0, taper_deg=20.0),
       "lens": shaped("lens", 12.0, corner=1.0, flute=8.0, tip_radius_mm=20.0),
       "pointed": shaped("apt", 10.0, flute=10.0, taper_deg=-10.0, tip_angle_deg=20.0, corner_center_radius_mm=5.0,
                         corner_center_height_mm=5 * np.tan(np.radians(20)))}


def unit(v):
    return np.asarray(v, float) / np.linalg.norm(v, axis=-1, keepdims=True)


def tilted(start, moves, axes):
    """A program with an axis at its start and behind every move."""
    axes = unit(axes)
    return program(start, moves, start_axis=axes[:-1], end_axis=axes[1:])


def random_program(seed, count=8, turn=0.5):
    """Random moves in a small box with leaning, turning axes; some moves pivot, some stay upright in their axis."""
    rng = np.random.default_rng(seed)
    start, moves = random_moves(rng, count, (0, 0, 0), (12, 10, 6))
    axes = [unit((*rng.uniform(-0.4, 0.4, 2), 1.0))]
    for k in range(count):
        axes.append(axes[-1] if rng.random() < 0.25 else unit(axes[-1] + rng.uniform(-turn, turn, 3)))
        if rng.random() < 0.2:
            moves[k] = feed(*(moves[k - 1][1] if k else start))
    return tilted(start, moves, axes), rng


def axes_at(posted, row, share):
    a, b = posted.start_axis[row], posted.end_axis[row]
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))[..., None]
    near = angle < 1e-9
    sine = np.where(near, 1.0, np.sin(angle))
    return unit(np.where(near, a, (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / sine))


def brute_body(profile, r, z):
    """Signed distance in the half plane: largest distance to a touching plane, for ever finer fans of directions."""
    best, width = np.full(len(r), np.pi / 2), np.pi / 2
    for count in (181, 21, 21, 21, 21):
        gamma = np.clip(best[:, None] + width * np.linspace(-1, 1, count), 0, np.pi)
        far = profile.support(gamma.ravel())[0].reshape(gamma.shape)
        value = r[:, None] * np.sin(gamma) + z[:, None] * np.cos(gamma) - far
        best = np.take_along_axis(gamma, value.argmax(axis=1)[:, None], axis=1)[:, 0]
        width *= 4 / (count - 1)
    return value.max(axis=1)


def brute_distance(posted, profile, points, steps=60):
    """Least distance over steps of every move, then over ever finer steps round the best ones."""
    out = np.empty(len(points))
    for i, p in enumerate(points):
        row = np.repeat(np.arange(len(posted)), steps + 1)
        share, width = np.tile(np.linspace(0, 1, steps + 1), len(posted))[:, None], 1.0 / steps
        for _ in range(4):
            d = brute_body(profile, *_in_tool(posted, row, share, p))
            keep = np.argsort(d)[:4]
            row = np.repeat(row[keep], 21)
            share = np.clip(share[keep] + width * np.linspace(-1, 1, 21), 0, 1).reshape(-1, 1)
            width /= 10
        out[i] = d.min()
    return out


def _in_tool(posted, row, share, p):
    axis = axes_at(posted, row, share)
    y = p - posted.start_mm[row] - share * (posted.end_mm[row] - posted.start_mm[row])
    z = (y * axis).sum(axis=1)
    return np.linalg.norm(y - z[:, None] * axis, axis=1), z


def rotation(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


@pytest.mark.parametrize("name", ALL)
def test_distance_to_the_body_is_the_largest_distance_to_a_touching_plane(name):
    rng = np.random.default_rng(1)
    profile = ALL[name].cutter.profile
    radius, height = profile.largest_radius_mm, profile.height_mm
    r, z = rng.uniform(0, 1.6 * radius, 400), rng.uniform(-0.5 * height, 1.5 * height, 400)
    r[:40] = 0.0
    posted = program((0, 0, 0), [feed(0, 0, 0)])
    path = posed_path(posted, [0], ALL[name])
    d = signed_distance_mm((path,), np.column_stack([r, 0 * r, z]))
    assert np.abs(d - brute_body(profile, r, z)).max() < 1e-7
    assert ((d < 0).sum() > 60) and ((d > 0).sum() > 60)


def test_the_ball_of_a_turning_cutter_sweeps_capsules_less_what_turning_adds():
    posted, rng = random_program(7, turn=0.2)
    ball = posed_path(posted, np.arange(len(posted)), ALL["ball"]).of_its_ball()
    points, g = rng.uniform((-4, -4, -4), (16, 14, 12), (200, 3)), ball.geometry
    way = points[:, None] - g[:, TIP:WAY]
    share = np.clip((way * g[:, WAY:AXIS]).sum(axis=2) / np.maximum((g[:, WAY:AXIS] ** 2).sum(axis=1), 1e-300), 0.0, 1.0)
    to_line = np.linalg.norm(way - share[..., None] * g[:, WAY:AXIS], axis=2).min(axis=1)
    assert np.abs(signed_distance_mm((ball,), points) - (to_line - 3.0 - ball.grown_mm)).max() < 1e-9
    assert -0.06 < ball.grown_mm < 0.0


@pytest.mark.parametrize("seed", [*CORPUS, 101])
def test_random_programs_agree_with_brute_force(seed):
    posted, rng = random_program(seed)
    name = list(ALL)[seed % len(ALL)]
    paths = swept_paths(posted, {1: ALL[name]})
    points = rng.uniform((-4, -4, -4), (16, 14, 12), (25, 3))
    have, row = nearest_moves(paths, points)
    error = max(p.error_mm for p in paths)
    want = brute_distance(posted, ALL[name].cutter.profile, points)
    assert error <= 1e-5
    assert np.abs(have - want).max() < 2e-5 + error
    assert ((row >= 0) & (row < len(posted))).all()


def test_a_tilted_flat_cutter_leaves_a_tilted_slot():
    lean = np.radians(30)
    axis = (np.sin(lean), 0, np.cos(lean))                 # leaning in the plane across the slot
    paths = swept_paths(tilted((0, -20, 0), [feed(0, 20, 0)], [axis, axis]), {1: shaped("flat", 6.0)})
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.uniform(-8, 14, 500), rng.uniform(-15, 15, 500), rng.uniform(-8, 22, 500)])
    across = points[:, 0] * np.cos(lean) - points[:, 2] * np.sin(lean)
    along = points[:, 0] * np.sin(lean) + points[:, 2] * np.cos(lean)
    q = np.column_stack([np.abs(across) - 3, np.abs(along - 10) - 10])
    want = np.hypot(*np.maximum(q, 0).T) + np.minimum(q.max(axis=1), 0)
    assert np.abs(signed_distance_mm(paths, points) - want).max() < 1e-8


def test_a_ball_pivoting_about_its_centre_stays_a_ball_below():
    posted = tilted((0, 0, -3), [feed(3 * -np.sin(a), 0, 3 * -np.cos(a)) for a in np.linspace(0.01, 0.8, 80)],
                    [(np.sin(a), 0, np.cos(a)) for a in np.linspace(0, 0.8, 81)])
    paths = swept_paths(posted, {1: shaped("ball", 6.0)})
    d = unit(np.random.default_rng(3).normal(size=(300, 3)) - (0, 0, 2.5))
    d = d[d[:, 2] < -0.75]
    off = np.linspace(0.0, 2.0, len(d))
    # the tip's chords lie 3 (1 - cos(0.005)) = 4e-5 mm inside the arc that keeps the centre fixed
    assert np.abs(signed_distance_mm(paths, d * (3 + off)[:, None]) - off).max() < 5e-5


def test_an_axis_that_turns_about_its_tip_sweeps_a_sector():
    """A flat cutter's axis sweeps a disk sector: its wall stands R off the sector's plane."""
    turned = tilted((0, 0, 0), [feed(0, 0, 0)], [(-1, 0, 1), (1, 0, 1)])
    paths = swept_paths(turned, {1: shaped("flat", 4.0, flute=10.0)})
    angle, rng = np.linspace(-0.6, 0.6, 50), np.random.default_rng(4)
    radius = rng.uniform(4, 8, 50)
    points = np.column_stack([radius * np.sin(angle), 2 + rng.uniform(-0.5, 3, 50), radius * np.cos(angle)])
    assert np.abs(signed_distance_mm(paths, points) - (points[:, 1] - 2)).max() < 1e-8
    end = np.column_stack([12 * np.sin(angle), 0 * angle, 12 * np.cos(angle)])
    assert np.abs(signed_distance_mm(paths, end) - (12 - np.hypot(10, 2))).max() < 1e-7    # the rim of the flutes' end
    assert paths[0].error_mm <= 1e-5


def test_a_cone_swept_about_its_own_tip_has_the_volume_of_its_union():
    """A pointed cutter (half angle 45 degrees) leaning 20 degrees all round a cone: by rays, against the closed form.

    On the sphere of directions the union is the cap of 65 degrees; every flute end is a flat disk, so only what is
    within the disks' common sphere of 5 mm is asked.
    """
    t = np.linspace(0, 2 * np.pi, 73)
    lean = np.radians(20)
    axes = np.column_stack([np.sin(lean) * np.cos(t), np.sin(lean) * np.sin(t), np.cos(lean) + 0 * t])
    pointed = shaped("apt", 10.0, flute=5.0, taper_deg=0.0, tip_angle_deg=45.0, corner_center_radius_mm=5.0,
                     corner_center_height_mm=5.0)
    paths = swept_paths(tilted((0, 0, 0), [feed(0, 0, 0)] * 72, axes), {1: pointed})
    polar, turn = np.radians(np.array([10, 40, 55, 60])), 0.3
    points = 3 * np.column_stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)])
    assert (signed_distance_mm(paths, points) < 0).all()
    beside = np.radians(np.array([66, 70, 80]))
    points = 3 * np.column_stack([np.sin(beside) * np.cos(turn), np.sin(beside) * np.sin(turn), np.cos(beside)])
    # great circles between leans 5 degrees apart in azimuth dip inside the cone by lean tan²(2.5°)/2 cos(20°): 3e-4 rad
    assert np.abs(signed_distance_mm(paths, points) - 3 * np.sin(beside - np.radians(65))).max() < 3 * 4e-4


def test_a_dovetail_slot_is_wider_below_than_above():
    paths = swept_paths(program((0, -40, -6), [feed(0, 40, -6)]), {1: ALL["dovetail"]})
    low, high = (-20, -20, -10), (20, 20, 0)
    z = np.array([-5.9, -3.0, -0.1, -7.0])
    flat, offsets = stock_intervals(paths, low, high, np.column_stack([0 * z, 0 * z, z]), np.tile((1.0, 0, 0), (4, 1)))
    half = 6 - (z + 6) * np.tan(np.radians(30))
    want = [(-20, -h, h, 20) for h in half[:3]] + [(-20, 20)]
    assert offsets.tolist() == [0, 2, 4, 6, 7]
    assert np.abs(flat.ravel() - np.concatenate(want)).max() < 1e-7
    # over the floor, beside the slot's mouth, the highest stock is the billet's top; in the mouth the floor
    assert np.abs(stock_height_mm(paths, [(5.0, 0), (0.0, 0)], 0.0) - (0.0, -6.0)).max() < 1e-7
    assert not is_height_field(paths)


def test_a_lens_leaves_its_large_radius_and_a_tapered_ball_its_flank():
    y = np.linspace(-4, 4, 41)
    xy = np.column_stack([0 * y, y])
    lens = swept_paths(program((-40, 0, -3), [feed(40, 0, -3)]), {1: ALL["lens"]})
    assert np.abs(stock_height_mm(lens, xy, 0.0) - (17 - np.sqrt(400 - y ** 2))).max() < 1e-7
    taper = np.radians(6)
    paths = swept_paths(program((-40, 0, -8), [feed(40, 0, -8)]), {1: ALL["tapered ball"]})
    join = 2 * np.cos(taper)
    y = np.linspace(-2.6, 2.6, 53)
    want = np.where(np.abs(y) < join, 2 - np.sqrt(np.maximum(4 - y ** 2, 0)),
                    2 - 2 * np.sin(taper) + (np.abs(y) - join) / np.tan(taper)) - 8
    have = stock_height_mm(paths, np.column_stack([0 * y, y]), 0.0)
    assert np.abs(have - want).max() < 1e-6                # over steep flanks 1e-7 along the normal is ten times that
    assert is_height_field(paths) and is_height_field(lens)


def test_flutes_shorter_than_the_slot_leave_what_stood_above_them():
    short = shaped("tapered_ball", 4.0, flute=5.0, taper_deg=6.0)
    paths = swept_paths(program((-40, 0, -8), [feed(40, 0, -8)]), {1: short})
    flat, offsets = stock_intervals(paths, (-9, -9, -12), (9, 9, 0), [(0, 0, 0)], [(0, 0, 1.0)])
    assert np.abs(flat - [(-12, -8), (-3, 0)]).max() < 1e-7
    assert stock_height_mm(paths, [(0, 0)], 0.0)[0] == 0.0


def test_nothing_left_is_the_billets_bottom():
    paths = swept_paths(program((-40, 0, -8), [feed(40, 0, -8)]), {1: ALL["tapered ball"]})
    assert stock_height_mm(paths, [(0, 0)], 0.0, bottom_mm=-5.0)[0] == -5.0
    _, offsets = stock_intervals(paths, (-9, -1, -5), (9, 1, 0), [(0, 0, 0)], [(0, 0, 1.0)])
    assert offsets.tolist() == [0, 0]


@pytest.mark.parametrize("type_,corner", PLAIN)
def test_both_engines_agree_on_upright_cutters(type_, corner):
    rng = np.random.default_rng(7)
    start, moves = random_moves(rng, 25, (0, 0, -5), (25, 20, 5))
    posted, t = program(start, moves), tool(type_, 6, corner, flute=40.0)
    upright, posed = swept_paths(posted, {1: t}), (posed_path(posted, np.arange(25), t),)
    points = rng.uniform((-3, -3, -9), (28, 23, 9), (1500, 3))
    a, b = signed_distance_mm(upright, points), signed_distance_mm(posed, points)
    assert np.abs(a - b)[a > 0].max() < 1e-7 and (np.sign(a) == np.sign(b)).all()
    low, high = (0, 0, -10), (25, 20, 9)
    directions = unit(rng.normal(size=points.shape))
    of_upright, of_posed = (stock_intervals(p, low, high, points, directions) for p in (upright, posed))
    assert (of_upright[1] == of_posed[1]).all() and len(of_posed[0]) > 1000
    assert np.abs(of_upright[0] - of_posed[0]).max() < 1e-6
    z = stock_height_mm(upright, points[:, :2], 20.0)
    assert np.abs(z - stock_height_mm(posed, points[:, :2], 20.0)).max() < 3e-6     # steep walls


@pytest.mark.parametrize("seed", [5, 6])
def test_deviations_and_intervals_agree_with_the_distance_along_their_rays(seed):
    """Fine steps along every ray: stock where the distance is positive, and only there."""
    posted, rng = random_program(seed)
    paths = swept_paths(posted, {1: list(ALL.values())[seed]})
    low, high = np.array((-3.0, -3, -3)), np.array((15.0, 13, 10))
    points, normals = rng.uniform(low + 0.1, high - 0.1, (60, 3)), unit(rng.normal(size=(60, 3)))
    flat, offsets = stock_intervals(paths, low, high, points, normals)
    depth = deviation_mm(paths, low, high, points, normals, 3.0)
    s = np.linspace(-20, 20, 4001)
    for i, (p, n) in enumerate(zip(points, normals)):
        q = p + s[:, None] * n
        inside = ((q > low) & (q < high)).all(axis=1)
        d = signed_distance_mm(paths, q[inside])
        mine = flat[offsets[i]:offsets[i + 1]]
        is_stock = ((s[inside, None] > mine[:, 0]) & (s[inside, None] < mine[:, 1])).any(axis=1)
        assert (is_stock == (d > 0))[np.abs(d) > 1e-6].all()
        edges = mine[(mine > s[inside][0] + 0.01) & (mine < s[inside][-1] - 0.01)]
        assert len(edges) == 0 or np.abs(signed_distance_mm(paths, p + edges[:, None] * n)).max() < 1e-7
        here = signed_distance_mm(paths, p[None])[0]
        behind = s[inside][(s[inside] < 0) & (d > 1e-6)]
        if here > 0:
            ahead = mine[(mine[:, 0] <= 0) & (mine[:, 1] >= 0), 1]
            assert abs(depth[i] - min(ahead[0], 3.0)) < 1e-6
        elif len(behind) and behind.max() > -2.9:
            assert abs(depth[i] + mine[mine[:, 1] < 0, 1].max() * -1) < 1e-6


def test_a_gouge_deep_in_many_moves_is_measured_to_where_stock_begins():
    """Passes 0.2 mm apart: the floor is 4 mm below, though no single position of the ball holds so much of the ray."""
    ys = np.arange(-4, 4.1, 0.2)
    moves = [feed(x, y, 0) for y in ys for x in (-8, 8)]
    posted = tilted((-8, -4, 0), moves, np.tile((0.2, 0.1, 1.0), (len(moves) + 1, 1)))
    paths = swept_paths(posted, {1: shaped("ball", 6)})
    normal = unit(np.array([0.3, 0.5, 1.0]))
    depth = deviation_mm(paths, *BOX, [(0, 0, 4)], [normal], 20.0)[0]
    end = np.array([0, 0, 4]) + depth * normal
    assert depth < -4 and abs(signed_distance_mm(paths, end[None])[0]) < 1e-7
    inside = np.array([0, 0, 4]) + np.linspace(0, depth + 1e-6, 500)[:, None] * normal
    assert (signed_distance_mm(paths, inside) < 0).all()


@pytest.mark.parametrize("name", ["bull", "round dovetail", "tapered ball"])
def test_a_rigid_motion_of_everything_changes_nothing(name):
    posted, rng = random_program(31)
    turn, shift = rotation(rng), rng.uniform(-20, 20, 3)
    moved = program(posted.start_mm[0] @ turn.T + shift, [feed(*(e @ turn.T + shift)) for e in posted.end_mm],
                    start_axis=unit(posted.start_axis @ turn.T), end_axis=unit(posted.end_axis @ turn.T))
    points = rng.uniform((-4, -4, -4), (16, 14, 12), (400, 3))
    a, b = (swept_paths(p, {1: ALL[name]}) for p in (posted, moved))
    assert np.abs(signed_distance_mm(a, points) - signed_distance_mm(b, points @ turn.T + shift)).max() < 1e-9


@pytest.mark.parametrize("name", ["flat", "lens", "dovetail"])
def test_splitting_and_retracing_change_nothing(name):
    posted, rng = random_program(37)
    n = len(posted)
    middle = (posted.start_mm + posted.end_mm) / 2
    axis = axes_at(posted, np.arange(n), np.full((n, 1), 0.5))
    woven = lambda a, b: np.stack([a, b], axis=1).reshape(-1, 3)
    split = program(posted.start_mm[0], [feed(*e) for e in woven(middle, posted.end_mm)],
                    start_axis=woven(posted.start_axis, axis), end_axis=woven(axis, posted.end_axis))
    ends, axes = [*posted.start_mm, posted.end_mm[-1]], [*posted.start_axis, posted.end_axis[-1]]
    there_and_back = tilted(ends[0], [feed(*e) for e in ends[1:] + ends[-2::-1]], axes + axes[-2::-1])
    points = rng.uniform((-4, -4, -4), (16, 14, 12), (400, 3))
    want = signed_distance_mm(swept_paths(posted, {1: ALL[name]}), points)
    bound = 2 * swept_paths(posted, {1: ALL[name]})[0].error_mm + 1e-7
    for other, tolerance in ((split, bound), (there_and_back, 1e-7)):
        assert np.abs(signed_distance_mm(swept_paths(other, {1: ALL[name]}), points) - want).max() < tolerance


def test_sub_steps_of_a_turn_err_by_less_than_their_bound_and_by_its_third_power():
    """The error of halved sub-steps falls to an eighth; the finest ones stand for the truth."""
    posted = tilted((0, 0, 0), [feed(9, 2, 1)], [(-0.5, 0.2, 1), (0.6, 0.1, 1)])
    points = np.random.default_rng(8).uniform((-9, -3, -2), (18, 5, 22), (3000, 3))
    of = lambda error: posed_path(posted, [0], ALL["flat"], error)
    distance = lambda path: signed_distance_mm((path,), points)
    truth, errors = distance(of(1e-9)), []
    for wanted in (0.064, 0.008, 0.001):
        path = of(wanted)
        errors.append(np.abs(distance(path) - truth).max())
        assert errors[-1] <= path.error_mm <= wanted
    assert errors[0] > 1e-4 and errors[0] / errors[2] > 16


@pytest.mark.parametrize("name", ["ball", "bull", "lens", "dovetail"])
def test_a_grown_cutter_moves_the_surface_by_as_much(name):
    posted, rng = random_program(41)
    paths = swept_paths(posted, {1: ALL[name]})
    points = rng.uniform((-4, -4, -4), (16, 14, 12), (300, 3))
    for by in (0.05, -0.05):
        grown = signed_distance_mm([p.grown(by) for p in paths], points)
        assert np.abs(grown - (signed_distance_mm(paths, points) - by)).max() < 2e-7
    with pytest.raises(SimulationError, match="T1 cannot be made smaller by 9 mm"):
        paths[0].grown(-9)


def test_upright_and_tilted_moves_of_one_program_are_answered_together():
    posted = tilted((-20, -8, -2), [feed(20, -8, -2), rapid(20, 8, -2), feed(-20, 8, -2)],
                    [(0, 0, 1), (0, 0, 1), (0, 0.5, 1), (0, 0.5, 1)])
    paths = swept_paths(posted, {1: shaped("ball", 6)})
    d, row = nearest_moves(paths, [(0, -8, -2.5), (0, 8, -2.2)])
    assert row.tolist() == [0, 2] and [p.is_height_field for p in paths] == [True, False]
    assert abs(d[0] - 0.5) < 1e-9
    center = np.array([0, 8, -2]) + 3 * unit((0, 0.5, 1))
    assert abs(d[1] - (np.linalg.norm(np.array([0, 8, -2.2]) - center) - 3)) < 1e-9


def test_arcs_of_other_cutters_become_chords_with_the_axis_turning_along():
    posted = program((-10, 0, 0), [(Kind.ARC_CW, (10, 0, 0), (0, 0, 0), Plane.XY)], start_axis=[unit((-0.5, 0, 1))],
                     end_axis=[unit((0.5, 0, 1))])
    paths = swept_paths(posted, {1: ALL["lens"]})
    assert paths[0].error_mm < 4e-5
    # half way the tip is at the arc's top, and the axis upright
    assert abs(signed_distance_mm(paths, [(0, 10, -1.0)])[0] - 1.0) < 0.02


def test_bad_axes_and_hollow_outlines_are_refused():
    with pytest.raises(SimulationError, match="unit vectors"):
        program((0, 0, 0), [feed(1, 0, 0)], start_axis=[(0, 0, 2.0)])
    turned = tilted((0, 0, 0), [feed(1, 0, 0)], [(0, 0, 1), (0, 0, -1)])
    with pytest.raises(SimulationError, match="line 10: the tool axis turns by 180.0°"):
        swept_paths(turned, {1: ALL["flat"]})
    hollow = CutterProfile(start_mm=[(0, 0), (2, 0), (2, 1)], end_mm=[(2, 0), (2, 1), (4, 3)],
                           center_mm=np.full((3, 2), np.nan))
    with pytest.raises(SimulationError, match="corner rounder has a concave corner"):
        outline_pieces(hollow, "corner rounder")


# bounds of nodes and of sub-steps -----------------------------------------------------------------

SHARES = np.linspace(0, 1, 21)


@njit(error_model="numpy")
def bound_of_step(point, nodes, row, touches, k):
    pu, pv, pw, across, least = seen_from(point[0], point[1], point[2], nodes, row)
    return step_bound(pu, pv, pw, across, least, nodes, row, touches, k)


@njit(error_model="numpy")
def least_of_steps(point, geometry, outline, first, last, shares):
    least = np.inf
    for k in range(first, last):
        for share in shares:
            least = min(least, pose_distance(point[0], point[1], point[2], geometry, k, share, outline, 0, len(outline))[0])
    return least


def dense(name, lean_deg, along=40, passes=8, step_mm=0.4):
    """Passes over a wavy surface; the axis leans and the side to which it leans turns."""
    x, y = np.meshgrid(np.arange(along) * step_mm, np.arange(passes) * step_mm)
    x[1::2] = x[1::2, ::-1]
    x, y = x.ravel(), y.ravel()
    lean, side = np.radians(lean_deg), 0.1 * x + 0.05 * y
    axes = np.column_stack([np.sin(lean) * np.cos(side), np.sin(lean) * np.sin(side), np.full(len(x), np.cos(lean))])
    tips = np.column_stack([x, y, 0.5 * np.sin(0.2 * x) * np.cos(0.3 * y)])
    posted = tilted(tips[0], [feed(*tip) for tip in tips[1:]], axes)
    return posed_path(posted, np.arange(len(posted)), ALL[name])


def places(path, row, rng, count, wide_mm):
    """Points round what touches at a node's side."""
    node = path.nodes[row]
    frame = node[FRAME_U:FRAME_U + 9].reshape(3, 3)
    at = np.column_stack([node[AT_U] + wide_mm * rng.normal(size=count), node[AT_V] + wide_mm * rng.normal(size=count),
                          node[FACE] + 0.2 * wide_mm * rng.normal(size=count)])
    return node[:3] + at @ frame


def paths_of(name):
    posted, _ = random_program(CORPUS[0], 12)
    return dense(name, 15.0), dense(name, 2.0), posed_path(posted, np.arange(len(posted)), ALL[name])


@pytest.mark.parametrize("name", ALL)
def test_no_pose_under_a_node_is_nearer_than_its_bound(name):
    rng = np.random.default_rng(3)
    for path in paths_of(name):
        for row in np.flatnonzero(path.nodes[:, IS_FILLED] > 0):
            level = int(np.log2(row + 1))
            span = (path.leaves >> level) * tilted_tree.LEAF
            first = (row + 1 - (1 << level)) * span
            for wide in (0.1, 3.0):
                for p in places(path, row, rng, 2, wide):
                    least = least_of_steps(p, path.geometry, path.outline, first, min(first + span, len(path.geometry)), SHARES)
                    assert facing_distance(*p, path.nodes, row)[0] <= least + 1e-9


@pytest.mark.parametrize("name", ALL)
def test_no_pose_of_a_sub_step_is_nearer_than_its_bound(name):
    rng = np.random.default_rng(4)
    for path in paths_of(name):
        for k in rng.integers(0, len(path.geometry), 200):
            row = path.leaves - 1 + k // tilted_tree.LEAF
            for p in places(path, row, rng, 2, rng.choice([0.05, 0.5, 4.0])):
                least = least_of_steps(p, path.geometry, path.outline, k, k + 1, SHARES)
                assert bound_of_step(p, path.nodes, row, path.touches, k) <= least + 1e-9


@pytest.mark.parametrize("name", ["ball", "bull", "flat", "lens"])
def test_bounds_of_leaves_get_sharper_as_the_square_of_the_step(name):
    """What a bound is below the distance, at the place of a leaf that touches: a quarter at half the step."""
    lost = []
    for step in (0.4, 0.2):
        path, rng = dense(name, 15.0, step_mm=step), np.random.default_rng(5)
        rows = path.leaves - 1 + np.arange(len(path.geometry) // tilted_tree.LEAF)
        loose = []
        for row in rows:
            first = (row + 1 - path.leaves) * tilted_tree.LEAF
            for p in places(path, row, rng, 3, 0.25 * path.nodes[row, HALF_U]):
                least = least_of_steps(p, path.geometry, path.outline, first, first + tilted_tree.LEAF, SHARES)
                loose.append(least - facing_distance(*p, path.nodes, row)[0])
        lost.append(np.median(loose))
    assert lost[1] < 0.4 * lost[0]


@pytest.mark.parametrize("name", ALL)
def test_the_nearest_of_many_leaning_sub_steps_is_that_of_all_one_by_one(name):
    path, rng = dense(name, 15.0), np.random.default_rng(6)
    points = np.vstack([places(path, 0, rng, 15, wide) for wide in (0.3, 3.0, 10.0)])
    have = signed_distance_mm((path,), points)
    for p, d in zip(points, have):
        shares = np.linspace(0, 1, 201)
        off = least_of_steps(p, path.geometry, path.outline, 0, len(path.geometry), shares) - d
        assert -1e-8 < off < 1e-3                  # half of a share of 0.4 mm
