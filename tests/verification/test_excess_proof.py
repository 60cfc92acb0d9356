"""The proven height is never below the truth, close to it, and what stands higher is found however small it is."""

from dataclasses import replace

import cadquery as cq
import numpy as np
import pytest
from known_programs import arc, feed, program, rapid, raster, tool
from OCP.BRepTools import BRepTools

from cuspline.kernel import brep
from cuspline.program.program import Plane
from cuspline.scallop.cusp import Stance, cutter_scallop_mm
from cuspline.stock.distance_kernels import piece_distance
from cuspline.stock.path_pieces import ARC_ANGLE_RAD, FORM, LEVEL_ARC, LINE, X0, X1, Y0, Y1
from cuspline.stock.rays import UPRIGHT_ARRAYS, scratch
from cuspline.stock.shapes import BoxShape
from cuspline.stock.swept import swept_paths, world_of
from cuspline.stock.tilted_tree import one_distance
from cuspline.stock.workpiece import Workpiece
from cuspline.toolpaths.five_axis.corner_contact import CornerContact
from cuspline.values.frames import Frame
from cuspline.verification.climbing import Ground
from cuspline.verification.excess_kernels import MORE, _convex_distance, _posed_corners, _straightened, least_largest
from cuspline.verification.excess_proof import LEAST_SHARE, is_bare, prove_excess

R, STEP = 5.0, 0.6
CUSP = R - np.sqrt(R**2 - STEP**2 / 4)
ALLOWED = 0.012
HERE = Frame.shift((0, 0, 0))
YS = -0.3 + STEP * np.arange(17)


def upper(solid, kind):
    return [f for f in brep.faces_of(brep.the_solid(solid)) if f.kind == kind and f.middle.normal[0, 2] > 0.5]


TOP = upper(cq.Workplane().box(12, 9, 10, centered=False), "plane")


def cut(moves, cutter=tool("ball", 10), frame=HERE, piece=None):
    piece = piece or Workpiece(blank=BoxShape(min_mm=(-20, -20, 0), max_mm=(20, 20, 20)))
    return piece.after(frame, swept_paths(program((-9, -9, 40), moves), {1: cutter}))


def proof(piece, faces=TOP, known=0.0, allowed=ALLOWED, reachable=None, cuts=None):
    everywhere = lambda p, n, face: np.ones(len(p), bool)
    return prove_excess(Ground.of_faces(faces), piece.cuts if cuts is None else cuts, known, allowed,
                        lambda p, n: piece.deviations(p, n, 2.0)[0], reachable or everywhere)


def straight(y, z=10.0, missing=None):
    """A pass along x, lifted off between two places."""
    moves = [rapid(-6, y, 14), feed(-6, y, z)]
    for a, b in missing or ():
        moves += [feed(a, y, z), rapid(a, y, 14), rapid(b, y, 14), feed(b, y, z)]
    return [*moves, feed(18, y, z), rapid(18, y, 14)]


def test_no_middle_is_asked_twice_however_many_cuts_look():
    """The first proves all but some cells, which the others, made elsewhere, give back whole."""
    piece = cut([move for y in YS for move in straight(y, missing=[(3, 4)] if y == YS[6] else None)])
    far = piece
    for y in (-60.0, 60.0):
        far = cut(straight(y), piece=far)
    asked = []

    def deviation(points, normals):
        asked.append(points)
        return far.deviations(points, normals, 2.0)[0]

    of = lambda cuts: prove_excess(Ground.of_faces(TOP), cuts, 0.0, ALLOWED, deviation, lambda p, n, face: np.ones(len(p), bool))
    found = of(far.cuts)
    places = np.concatenate(asked)
    assert len(places) > 100 and len(np.unique(places, axis=0)) == len(places)
    alone = of(piece.cuts)
    assert found.height_mm == alone.height_mm and len(found.higher_mm) >= len(alone.higher_mm) > 0


def dense_mm(piece, face, count=(500, 500)):
    """Largest deviation on a dense grid inside a face."""
    ground = Ground.of_faces([face])
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face.nurbs_face)
    within = lambda low, high, n: low + (high - low) * np.linspace(1e-7, 1 - 1e-7, n)
    u, v = (g.ravel() for g in np.meshgrid(within(u0, u1, count[0]), within(v0, v1, count[1])))
    inside = ground.trims.is_inside(0, u, v)
    place = ground.places(np.zeros(inside.sum(), int), u[inside], v[inside])
    return piece.deviations(place.point_mm, place.normal, 2.0)[0].max()


def is_close_above(proven, truth, allowed=0.0):
    """Less than a tenth of what is allowed is not asked for."""
    return truth <= proven <= max(1.02 * truth + 2e-4, LEAST_SHARE * allowed)


@pytest.mark.parametrize("known", [0.0, CUSP])
@pytest.mark.parametrize("cutter,cusp", [(tool("ball", 10), CUSP), (tool("ball", 6), 3 - np.sqrt(9 - STEP**2 / 4))])
def test_the_cusp_of_passes_over_a_plane_is_proven(cutter, cusp, known):
    p = proof(cut(raster((-6, 18), YS, 10.0), cutter), known=min(known, cusp), allowed=0.016)
    assert is_close_above(p.height_mm, cusp) and p.is_complete and not len(p.higher_mm)


def test_passes_askew_to_the_parameters_of_the_face_are_proven_as_well():
    way, aside = np.array([np.cos(0.6), np.sin(0.6)]), np.array([-np.sin(0.6), np.cos(0.6)])
    ends = [[(6, 4.5) + s * 20 * way + k * STEP * aside for s in (-1, 1)] for k in range(-16, 17)]
    moves = [feed(*end, 10) for k, pair in enumerate(ends) for end in (pair if k % 2 else pair[::-1])]
    p = proof(cut(moves))
    assert is_close_above(p.height_mm, CUSP) and p.is_complete and p.cells < 40_000


@pytest.mark.parametrize("cutter,step,cusp", [
    (tool("bull_nose", 10, 2.0), 6.4, 2 - np.sqrt(4 - 0.2**2)), (tool("flat", 10), 8.0, 0.0)])
def test_other_cutters_leave_no_more_than_they_do(cutter, step, cusp):
    p = proof(cut(raster((-6, 18), -0.3 + step * np.arange(3), 10.0), cutter))
    assert is_close_above(p.height_mm, cusp, ALLOWED) and p.is_complete


def test_a_plane_that_the_stock_as_delivered_does_not_stand_above_needs_no_cut():
    """The side flush with the blank; the top of the same solid is cut."""
    solid = cq.Workplane().box(12, 9, 10, centered=False)
    faces = brep.faces_of(brep.the_solid(solid))
    blank = BoxShape(min_mm=(0, -1, 0), max_mm=(12, 9, 20))
    wanted = [f.middle.normal[0].round(9).tolist() in ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 0, -1]) for f in faces]
    assert is_bare(faces, blank, ALLOWED).tolist() == wanted
    higher = BoxShape(min_mm=(0, -1, 0), max_mm=(12 + 0.11 * ALLOWED, 9 + 0.09 * ALLOWED, 20))
    assert is_bare(faces, higher, ALLOWED).sum() == 3
    piece = cut(raster((-6, 18), YS, 10.0), piece=Workpiece(blank=blank))
    both = [*TOP, next(f for f, bare in zip(faces, wanted) if bare)]
    asked = lambda bare: prove_excess(Ground.of_faces(both), piece.cuts, 0.0, ALLOWED,
                                      lambda p, n: piece.deviations(p, n, 2.0)[0], lambda p, n, f: np.ones(len(p), bool), bare=bare)
    known = asked(is_bare(both, blank, ALLOWED))
    assert is_close_above(known.height_mm, CUSP) and known.is_complete and known.cells < 40_000
    assert asked(np.array([True, True])).cells == 0


def test_half_a_millimetre_that_was_missed_is_found_and_nothing_else():
    missing = (5.37, 5.87)
    aside = (STEP**2 - 0.25**2) / (2 * STEP)
    highest = R - np.sqrt(R**2 - (STEP - aside)**2)
    piece = cut([m for k, y in enumerate(YS) for m in straight(y, missing=[missing] if k == 7 else None)])
    p = proof(piece, known=CUSP)                                     # 12.4 um are left there, 12 um are allowed
    assert len(p.higher_mm) and 0 < p.unproven_mm2["excess"] < 0.01 and p.unproven_mm2["inside"] < 0.001
    assert ALLOWED < p.amount_mm.min() and p.amount_mm.max() <= highest + 1e-6
    assert np.abs(p.higher_mm[:, 0] - 5.62).max() < 0.1
    assert np.abs(np.abs(p.higher_mm[:, 1] - YS[7]) - aside).max() < 0.1
    raised = proof(piece, known=CUSP, allowed=0.02)                  # not excess: then the height must rise above it
    assert is_close_above(raised.height_mm, highest) and raised.is_complete and not len(raised.higher_mm)


def test_a_missing_pass_is_excess_and_the_rest_is_proven():
    p = proof(cut(raster((-6, 18), np.delete(YS, 7), 10.0)), known=CUSP)
    assert is_close_above(p.height_mm, CUSP) or p.height_mm == pytest.approx(ALLOWED + 1e-4)
    assert np.abs(p.higher_mm[:, 1] - YS[7]).max() < STEP and 1 < p.unproven_mm2["excess"] < 12 * STEP * 2
    assert p.is_complete


@pytest.mark.parametrize("sign", [1, -1])
def test_arcs_over_a_ridge_and_along_a_trough_are_proven(sign):
    block = cq.Workplane().box(14, 8, 10, centered=(True, True, False))
    rod = cq.Workplane("XZ").center(0, 0 if sign > 0 else 22).circle(12).extrude(8, both=True)
    block = block.translate((0, 0, 4))
    face, = upper(block.intersect(rod) if sign > 0 else block.cut(rod), "cylinder")
    radius, middle = (17.0, 0.0) if sign > 0 else (7.0, 22.0)
    half = radius * np.sin(0.95)
    z = middle + sign * radius * np.cos(0.95) - R
    moves = []
    for k, y in enumerate(np.arange(-4.3, 4.9, STEP)):
        ends = (-half, half) if k % 2 == 0 else (half, -half)
        clockwise = (ends[0] < 0) != (sign > 0)
        moves += [feed(ends[0], y, z), arc((ends[1], y, z), (0.0, y, middle - R), Plane.ZX, clockwise=clockwise)]
    piece = cut(moves)
    assert (piece.cuts[0].paths[0].geometry[:, 11] == 1).sum() > 50
    p = proof(piece, [face])
    assert dense_mm(piece, face) <= p.height_mm and is_close_above(p.height_mm, CUSP) and p.is_complete


def over(face, us, vs):
    """Passes of a ball along v of a face, touching it, in lines too short to count."""
    ground, moves = Ground.of_faces([face]), []
    for k, u in enumerate(us):
        place = ground.places(np.zeros(len(vs), int), np.full(len(vs), u), vs[::-1] if k % 2 else vs)
        tips = place.point_mm + R * place.normal - (0, 0, R)
        moves += [feed(*tip) for tip in tips]
    return moves


def test_a_sphere_stands_no_higher_than_proven_and_its_pole_counts_as_unproven():
    box = cq.Workplane().box(24, 24, 4, centered=(True, True, False)).translate((0, 0, 9.5))
    face, = upper(cq.Workplane().sphere(12).intersect(box), "sphere")
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face.nurbs_face)
    piece = cut(over(face, np.arange(u0, u1 + 0.1, 0.05), np.linspace(v0, v1, 400)))
    p = proof(piece, [face], allowed=0.05)
    assert is_close_above(p.height_mm, dense_mm(piece, face, (3000, 60)))
    assert p.unproven_mm2["inside"] < 0.001 and p.unproven_mm2["rim"] < 0.01


def wavy_face():
    points = [[cq.Vector(x, y, 8 + 0.6 * np.sin(0.5 * x) * np.cos(0.4 * y)) for y in np.linspace(-6, 6, 9)]
              for x in np.linspace(-6, 6, 9)]
    top = cq.Face.makeSplineApprox(points)
    face, = (f for f in brep.faces_of(cq.Solid.extrudeLinear(top, cq.Vector(0, 0, -6)).wrapped) if f.kind != "plane"
             and f.middle.point_mm[0, 2] > 7 and abs(f.middle.normal[0, 2]) > 0.5)
    return face


def test_a_bspline_stands_no_higher_than_proven():
    face = wavy_face()
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face.nurbs_face)
    vs = np.linspace(v0 - 0.3 * (v1 - v0), v1 + 0.3 * (v1 - v0), 300)
    piece = cut(over(face, np.linspace(u0, u1, 22), vs))
    p = proof(piece, [face], allowed=0.05)
    dense = dense_mm(piece, face, (3000, 150))
    assert is_close_above(p.height_mm, dense) and p.unproven_mm2["inside"] == 0
    assert p.unproven_mm2["rim"] < 0.5


def test_what_another_clamping_has_cut_counts():
    turned = Frame(rotation=np.array([[0, -1.0, 0], [1, 0, 0], [0, 0, 1]]), origin_mm=(6.0, 0.0, 0.0))
    left = cut(raster((-9, 6), YS, 10.0))
    both = cut(raster((-6, 16), -7.0 + STEP * np.arange(22), 10.0), frame=turned, piece=left)
    p = proof(both)
    assert is_close_above(p.height_mm, CUSP) and p.unproven_mm2["inside"] + p.unproven_mm2["excess"] < 0.02
    alone = proof(left)
    assert alone.unproven_mm2["excess"] > 1


def test_what_cannot_be_reached_is_left_out_and_counted():
    left = lambda p, n, face: p[:, 0] < 7.0
    piece = cut(raster((-9, 6), YS, 10.0))
    p = proof(piece, reachable=left)
    assert 4.0 * 9 < p.unproven_mm2["unreachable"] < 5.2 * 9


def leaning(start_axis, end_axis, flute=20.0):
    """A workpiece cut by a ball over the plane, its axis between these two on every move; tips so that it cuts the same."""
    axes = [np.tile([axis], (34, 1)) for axis in (start_axis, end_axis)]
    moves = raster((-6, 18), YS, 10.0)
    posted = program((-9, -9, 40), moves, start_axis=axes[0], end_axis=axes[1])
    shift = [R * (np.array([0.0, 0.0, 1.0]) - axis) for axis in (start_axis, end_axis)]      # the ball's middle stays where it was
    posted = replace(posted, start_mm=posted.start_mm + shift[0], end_mm=posted.end_mm + shift[1])
    return Workpiece(blank=BoxShape(min_mm=(0, 0, 0), max_mm=(12, 9, 12))).after(HERE, swept_paths(
        posted, {1: tool("ball", 10, flute=flute)}))


def test_a_ball_that_leans_and_keeps_its_axis_is_proven_as_an_upright_one_is():
    p = proof(leaning((0.6, 0.0, 0.8), (0.6, 0.0, 0.8)), known=CUSP)
    assert is_close_above(p.height_mm, CUSP) and p.is_complete


def turned(degrees):
    """An axis that leans by 37 degrees, its azimuth turned by so much."""
    return 0.6 * np.cos(np.radians(degrees)), 0.6 * np.sin(np.radians(degrees)), 0.8


def test_a_ball_whose_axis_turns_is_proven_as_an_upright_one_is():
    """By a degree in every move: its middle then leaves the line by R w^2 / 8, 0.07 um."""
    p = proof(leaning(turned(0.0), turned(1.0)), known=CUSP)
    assert is_close_above(p.height_mm, CUSP) and p.is_complete


def turning_corner(step, lead_deg=(10.0, 13.0)):
    """A bull nose of R5 r1 over the plane, its lead between these two along every pass, in moves of 3 mm; touching it."""
    cutter, x = tool("bull_nose", 10, 1.0), np.linspace(-6.0, 18.0, 9)
    corner = CornerContact(radius_mm=5.0, corner_radius_mm=1.0, lead_rad=0.2, tilt_rad=0.0)
    lead = np.radians(np.linspace(*lead_deg, len(x)))
    axis, up = np.column_stack([np.sin(lead), 0 * x, np.cos(lead)]), np.tile([0.0, 0.0, 1.0], (len(x), 1))
    moves, axes = [], []
    for y in np.arange(-1.0, 11.0, step):
        tips = np.column_stack([x, 0 * x + y, 0 * x + 11.0]) + corner.tips_off(up, axis)
        moves += [feed(*tips[0][:2], 30.0), *(feed(*tip) for tip in tips), feed(*tips[-1][:2], 30.0)]
        axes += [axis[0], *axis, axis[-1]]
    posted = program((-9, -9, 40), moves, start_axis=np.array([axes[0], *axes[:-1]]), end_axis=np.array(axes))
    return Workpiece(blank=BoxShape(min_mm=(0, 0, 0), max_mm=(12, 9, 12))).after(HERE, swept_paths(posted, {1: cutter}))


def test_a_bull_nose_whose_axis_turns_is_proven_as_far_as_it_cuts():
    """Its silhouette is flattest where it leans least: R_e = 1 + 4 / sin 10."""
    step = 1.6
    piece = turning_corner(step)
    truth = cutter_scallop_mm(tool("bull_nose", 10, 1.0).cutter.profile, step, 0.0, Stance(lead_rad=np.radians(12.5)))[0]
    p = proof(piece, known=0.9 * truth, allowed=0.1)
    assert p.is_complete and not len(p.higher_mm)
    assert 0.9 * truth < p.height_mm < 1.1 * truth and p.cells < 100_000


def test_a_bull_nose_whose_axis_turns_and_leaves_too_much_is_found():
    piece = turning_corner(1.6)
    p = proof(piece, known=0.0, allowed=0.008)
    assert len(p.higher_mm) and 0.008 < p.amount_mm.max() < 0.02


def test_the_bulge_of_a_turning_sub_step_covers_its_distances():
    """Distances to one sub-step at random places between a cell's corners, beside the mean of the corners' and its bulge."""
    path, = turning_corner(3.0).cuts[0].paths
    world, rng = world_of((path,)), np.random.default_rng(5)
    turning = np.flatnonzero((path.geometry[:, 13] > 1e-4) & (np.abs(path.geometry[:, 5]) < 0.2))
    work, corners, cell = scratch(), np.empty(4), np.zeros(13)
    most = 0.0
    for piece in rng.choice(turning, 200):
        g = path.geometry[piece]
        cell[3:6], cell[6:9] = rng.normal(0.0, 0.3, 3), rng.normal(0.0, 0.3, 3)
        middle = g[:3] + 0.5 * g[3:6] + rng.normal(0.0, 3.0, 3)
        _posed_corners(*middle, cell, piece, world, work, corners)
        for s, t in rng.uniform(-1.0, 1.0, (20, 2)):
            weights = np.array([(1 + a * s) * (1 + b * t) / 4 for b in (-1, 1) for a in (-1, 1)])
            there = middle + s * cell[3:6] + t * cell[6:9]
            d = one_distance(*there, piece, world[UPRIGHT_ARRAYS:], np.inf, work[2])[0]
            assert d <= weights @ corners + 1e-9
            most = max(most, weights @ corners - d)
    assert most > 0.01


def test_a_tangent_sweeps_no_more_than_its_arc_and_as_much_at_the_place():
    rng, out = np.random.default_rng(2), np.empty(MORE + 1)
    for _ in range(300):
        u = np.sort(rng.uniform(-1, 1, 2)) * 9
        g = np.array([u[0], 0.5, np.sqrt(81 - u[0]**2), u[1], 0.5, np.sqrt(81 - u[1]**2), 0, 0, 0, 9, 1, 1.0])
        place = np.array([rng.uniform(*u), 0.5, 2.0]) + (0, 0, np.sqrt(81 - max(abs(u))**2) / 2)
        _straightened(g, 2.0, *place, 1.0, out)
        points = rng.uniform(-12, 12, (50, 3))
        straight_mm, round_mm = (np.array([piece_distance(*p, h, 0.0, 2.0) for p in points]) for h in (out, g))
        assert out[MORE] == 0.0 and (straight_mm >= round_mm - 1e-9).all()


def test_a_line_beside_a_level_arc_and_what_it_may_be_off_bound_the_distance_to_the_arc():
    """Everywhere from above; for places within the stated reach no worse than twice what it may be off, under a flat not at all."""
    rng, out = np.random.default_rng(5), np.empty(MORE + 1)
    for k in range(600):
        r, at, turn = rng.choice([0.3, 4.0, 60.0]), rng.uniform(0, 7), rng.uniform(0.001, ARC_ANGLE_RAD)
        ends = r * np.array([np.cos([at, at + turn]), np.sin([at, at + turn])]).T + (2, -1)
        g = np.array([*ends[0], -3.0, *ends[1], -3.0, 0, 2, -1, r, 0, LEVEL_ARC])
        a, rc = [(0.0, 3.0), (2.0, 1.0), (3.0, 0.0)][k % 3]
        place, reach = np.array([*(ends.mean(axis=0) + rng.normal(0, 2, 2)), rng.uniform(-4, 0)]), rng.choice([0.01, 0.3])
        _straightened(g, rc, *place, reach, out)
        assert out[FORM] == LINE and out[MORE] <= 0.26 * turn * turn * r
        points = np.vstack([rng.uniform(-12, 12, (40, 3)), place + rng.uniform(-1, 1, (40, 3)) * reach / 2])
        line_mm = np.array([_convex_distance.py_func(*p, 0, out, (a, rc), ([g],), None) for p in points])
        arc_mm = np.array([piece_distance(*p, g, a, rc) for p in points])
        assert (line_mm >= arc_mm - 1e-12).all()
        if np.hypot(*(place[:2] - (2, -1))) > 2 * reach:
            assert (line_mm[40:] - arc_mm[40:]).max() <= 2 * out[MORE] + 1e-12
        under = np.append(0.5 * (out[[X0, Y0]] + out[[X1, Y1]]), -2.5)
        if rc + 1.0 < a:
            assert _convex_distance.py_func(*under, 0, out, (a, rc), ([g],), None) == pytest.approx(-0.5, abs=1e-12)


def test_the_mean_of_pieces_is_as_good_as_the_best_of_random_means():
    rng, mean = np.random.default_rng(4), np.empty(4)
    for _ in range(100):
        rows = rng.normal(0, 1, (3, 4))
        weights = rng.dirichlet(np.ones(3), 4000)
        least = least_largest(rows, 3, -np.inf, mean)
        assert mean.max() == pytest.approx(least, abs=1e-12)
        assert least >= (weights @ rows).max(axis=1).min() - 0.05 and least <= rows.max(axis=1).min()
