"""The tightest hollow and the inner edges of parts where both are known."""

import cadquery as cq
import numpy as np
import pytest
from known_surfaces import bspline, clamped, face_of, random_weights, round_pocket_block, wavy_poles
from OCP.TopoDS import TopoDS
from scipy.spatial.transform import Rotation

from cuspline.designs._freeform_surface import freeform_face
from cuspline.kernel.brep import Face, faces_of, the_solid
from cuspline.surfaces import curvature
from cuspline.surfaces.curvature import (
    FLATTEST_MM,
    POLE_MM,
    PROVEN_SHARE,
    hollows_of_faces,
    sample_faces,
    tightest_hollow,
)
from cuspline.surfaces.inner_corners import fillets, inner_edges
from cuspline.values.errors import PlanError

FOUND_MM = 1e-4         # of a radius that the pattern search brings home to 1e-6 of the face


def all_of(part):
    faces = faces_of(the_solid(part))
    return faces, list(range(len(faces)))


def block():
    return cq.Workplane("XY").box(60, 40, 30)


def test_nothing_is_hollow_on_a_block_or_a_dome():
    for part in (block(), block().edges("|Z").fillet(5), cq.Workplane("XY").sphere(20)):
        assert tightest_hollow(*all_of(part)).radius_mm == np.inf


@pytest.mark.parametrize("radius", [3.0, 8.0])
def test_a_gutter_is_as_hollow_as_its_radius(radius):
    part = block().cut(cq.Workplane("YZ").circle(radius).extrude(100, both=True).translate((0, 0, 15)))
    faces, indices = all_of(part)
    found = tightest_hollow(faces, indices)
    assert found.radius_mm == pytest.approx(radius, abs=1e-9)
    assert faces[found.face].kind == "cylinder"
    assert np.hypot(found.place_mm[1], found.place_mm[2] - 15) == pytest.approx(radius, abs=1e-9)


def test_a_spherical_pocket_is_as_hollow_as_its_radius():
    part = block().cut(cq.Workplane("XY").sphere(12).translate((5, 3, 18)))
    assert tightest_hollow(*all_of(part)).radius_mm == pytest.approx(12, abs=1e-6)      # equal roots: half the digits


def test_a_fillet_round_a_boss_is_as_hollow_as_its_radius():
    part = block().faces(">Z").workplane().circle(9).extrude(12)
    part = part.edges(cq.selectors.BoxSelector((-10, -10, 14.9), (10, 10, 15.1))).fillet(4)
    found = tightest_hollow(*all_of(part))
    assert found.radius_mm == pytest.approx(4, abs=1e-9)


def test_an_elliptic_gutter_is_most_hollow_where_its_bottom_is():
    # semi-axes 6 across and 10 down: a²/b = 3.6 at the bottom
    gutter = cq.Workplane("YZ").ellipse(6, 10).extrude(100, both=True).translate((0, 0, 15))
    found = tightest_hollow(*all_of(block().cut(gutter)))
    assert found.radius_mm == pytest.approx(3.6, abs=FOUND_MM)
    np.testing.assert_allclose(found.place_mm[1:], (0, 5), atol=1e-2)


def test_only_the_given_faces_are_looked_at():
    part = block().cut(cq.Workplane("YZ").circle(3).extrude(100, both=True).translate((0, 0, 15)))
    faces = faces_of(the_solid(part))
    flat = [i for i, f in enumerate(faces) if f.kind == "plane"]
    assert tightest_hollow(faces, flat).radius_mm == np.inf


def test_the_radius_found_is_proven_within_a_hundredth():
    for part in (round_pocket_block(), cq.Workplane(obj=cq.Solid.makeTorus(16, 5))):
        for h in hollows_of_faces(*all_of(part)):
            if np.isfinite(h.radius_mm):
                assert h.radius_mm / (1 + PROVEN_SHARE) <= h.proven_mm * (1 + 1e-9) <= h.radius_mm * (1 + 1e-9)
            else:
                assert h.proven_mm == FLATTEST_MM


def test_a_pocket_is_as_hollow_as_its_tightest_fillet():
    faces, indices = all_of(round_pocket_block(4.0, 2.5))
    found = tightest_hollow(faces, indices)
    assert found.radius_mm == pytest.approx(2.5, abs=1e-9)
    upright = [i for i in indices if faces[i].kind == "cylinder" and abs(faces[i].middle.normal[0, 2]) < 1e-9]
    assert len(upright) == 4 and tightest_hollow(faces, upright).radius_mm == pytest.approx(4.0, abs=1e-9)


def test_a_torus_is_hollow_round_its_hole():
    # principal curvatures 1/5 and cos a / (16 + 5 cos a): most hollow at the hole, -1 / 11
    faces, indices = all_of(cq.Workplane(obj=cq.Solid.makeTorus(16, 5)))
    found = tightest_hollow(faces, indices)
    assert found.radius_mm == pytest.approx(11, rel=1e-9)
    assert np.hypot(*found.place_mm[:2]) == pytest.approx(11, abs=1e-6) and abs(found.place_mm[2]) < 1e-3


def saddle(a=0.03, b=0.05):
    """z = (a x² - b y²) / 2 over a square of 20 mm: a Bézier patch, hollow along x."""
    x = np.array([-10.0, 0.0, 10.0])
    bend = np.array([100.0, -100.0, 100.0])         # Bernstein coefficients of x² on -10..10
    z = (a * bend[:, None] - b * bend[None, :]) / 2
    return face_of(bspline(np.stack([*np.meshgrid(x, x, indexing="ij"), z], axis=-1), degree=(2, 2)))


def test_a_saddle_is_most_hollow_in_its_middle():
    found = tightest_hollow([saddle()], [0])
    assert found.radius_mm == pytest.approx(1 / 0.03, rel=1e-9)
    np.testing.assert_allclose(found.place_mm, 0, atol=1e-3)


def needle(at=(0.5 + 0.25 / 48, 0.5 - 0.21 / 48), width=0.004):
    """A flat sheet of 50 mm with a dimple 0.01 mm deep and 0.2 mm wide, between the points of a grid."""
    inner = [np.r_[c - 2 * width, c - width, c, c + width, c + 2 * width] for c in at]
    nodes = []
    for k in range(2):
        knots = clamped(0, 3, inner[k])
        nodes.append(np.array([knots[i + 1:i + 4].mean() for i in range(len(knots) - 4)]))
    poles = np.stack([*np.meshgrid(50 * nodes[0], 50 * nodes[1], indexing="ij"), np.zeros((9, 9))], axis=-1)
    poles[4, 4, 2] = -0.01
    return face_of(bspline(poles, knots_u=clamped(0, 3, inner[0]), knots_v=clamped(0, 3, inner[1])))


def on_grid(face, count):
    """The tightest hollow over the middles of a grid of cells: what a grid sees."""
    u0, u1, v0, v1 = face.nurbs.domain
    step = (np.arange(count) + 0.5) / count
    u, v = (a.ravel() for a in np.meshgrid(u0 + step * (u1 - u0), v0 + step * (v1 - v0), indexing="ij"))
    keep = face.is_inside(u, v)
    curvature = -face.shape_at(u[keep], v[keep]).curvature_low_per_mm.min()
    return 1 / curvature if curvature > 1e-9 else np.inf


def test_a_dimple_between_the_points_of_a_grid_is_found():
    face = needle()
    assert on_grid(face, 24) > 1e3              # known-bad: the grid sees nothing
    found = tightest_hollow([face], [0])
    sides = (np.linspace(c - 0.008, c + 0.008, 401) for c in (0.5 + 0.25 / 48, 0.5 - 0.21 / 48))
    u, v = (a.ravel() for a in np.meshgrid(*sides, indexing="ij"))
    truth = 1 / -face.shape_at(u, v).curvature_low_per_mm.min()
    assert truth < 10 and found.radius_mm <= truth * (1 + 1e-9) and found.radius_mm > 0.999 * truth


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("is_rational", [False, True])
def test_no_place_of_a_random_sheet_is_more_hollow_than_proven(seed, is_rational):
    face = face_of(bspline(wavy_poles(seed), random_weights(seed) if is_rational else None))
    found = tightest_hollow([face], [0])
    u, v = np.random.default_rng(seed).uniform(0, 1, (2, 200_000))
    seen = 1 / -face.shape_at(u, v).curvature_low_per_mm.min()
    assert found.proven_mm < seen and found.radius_mm < seen * (1 + 1e-9)
    at = face.shape_at(*np.array(found.uv).reshape(2, 1))
    assert 1 / -at.curvature_low_per_mm[0] == pytest.approx(found.radius_mm, rel=1e-9)
    np.testing.assert_allclose(at.point_mm[0], found.place_mm, atol=1e-9)


def test_a_reversed_face_is_hollow_where_it_was_a_ridge():
    up = face_of(bspline(wavy_poles(2)))
    down = Face(TopoDS.Face_s(up.shape.Reversed()))
    u, v = np.random.default_rng(0).uniform(0, 1, (2, 100_000))
    shape = up.shape_at(u, v)
    for face, most in ((up, -shape.curvature_low_per_mm.min()), (down, shape.curvature_high_per_mm.max())):
        found = tightest_hollow([face], [0]).radius_mm
        assert 0.97 / most < found < (1 + 1e-9) / most          # random places come near the worst one, no more


def pierced_sheet():
    """A sheet with a round hole, and the whole sheet."""
    poles = wavy_poles(11, (8, 8), (60, 60), 6.0)
    sheet = cq.Face(face_of(bspline(poles)).shape)
    middle = cq.Solid.extrudeLinear(cq.Wire.makeCircle(11, cq.Vector(30, 34, -60), cq.Vector(0, 0, 1)), [],
                                    cq.Vector(0, 0, 120))
    return Face(sheet.cut(middle).Faces()[0].wrapped), Face(sheet.wrapped)


def test_a_hollow_outside_the_trim_does_not_count():
    face, whole = pierced_sheet()
    found, without = tightest_hollow([face], [0]), tightest_hollow([whole], [0])
    u, v = np.random.default_rng(0).uniform(0, 1, (2, 60_000))
    low = -face.shape_at(u, v).curvature_low_per_mm
    inside = face.is_inside(u, v)
    assert 0.02 < 1 - inside.mean() < 0.5
    assert found.radius_mm == pytest.approx(1 / low[inside].max(), rel=0.03)
    assert found.radius_mm <= 1 / low[inside].max() * (1 + 1e-9) and without.radius_mm <= found.radius_mm * (1 + 1e-9)
    assert face.is_inside(*np.array(found.uv).reshape(2, 1))[0]


def test_only_the_part_within_the_given_box_counts():
    face = face_of(bspline(wavy_poles(3, (8, 8), (60, 60), 6.0)))
    u, v = np.random.default_rng(0).uniform(0, 1, (2, 100_000))
    shape = face.shape_at(u, v)
    for low, high in (((0, 0, -99), (30, 30, 99)), ((35, 10, -99), (50, 40, 99))):
        within = ((shape.point_mm >= low) & (shape.point_mm <= high)).all(axis=1)
        found = tightest_hollow([face], [0], within_mm=(low, high))
        most = -shape.curvature_low_per_mm[within].min()
        assert 0.97 / most < found.radius_mm < (1 + 1e-9) / most
        assert (np.array(found.place_mm) >= low).all() and (np.array(found.place_mm) <= high).all()


def test_a_hollow_that_does_not_close_in_is_told_with_its_own_face(monkeypatch):
    monkeypatch.setattr(curvature, "LARGEST_ROUNDS", 1)
    with pytest.raises(PlanError, match="face 1: the minimum concave radius is not found") as said:
        tightest_hollow([needle(), face_of(bspline(wavy_poles(2)))], [1])
    assert said.value.rows == [1]


def test_the_free_form_surface_is_most_hollow_where_it_is_known_to_be():
    found = tightest_hollow([Face(freeform_face())], [0])
    assert found.radius_mm == pytest.approx(63.66, abs=0.005)
    np.testing.assert_allclose(found.uv, (0.245, 0.5), atol=1e-3)


def test_a_pole_is_left_out_and_said_so():
    bowl = block().cut(cq.Workplane("XY").sphere(12).translate((5, 3, 15)))
    found = [h for h in hollows_of_faces(*all_of(bowl)) if np.isfinite(h.radius_mm)]
    assert [h.poles_left_out > 0 for h in found] == [True] and found[0].radius_mm == pytest.approx(12, abs=1e-6)


def test_a_countersink_is_tightest_where_its_point_is_left_out():
    # principal radius across a cone of half angle h, r from the axis: r / cos h
    cone = cq.Workplane(obj=cq.Solid.makeCone(0, 20, 20)).translate((0, 0, -5))
    found = tightest_hollow(*all_of(block().cut(cone)))
    assert found.poles_left_out > 0 and 0 < found.radius_mm < 3 * POLE_MM


def test_the_tightest_hollow_turns_with_the_part():
    part = round_pocket_block()
    here, there = (tightest_hollow(*all_of(p)) for p in (part, part.rotate((1, 2, 3), (4, 1, 7), 77)))
    assert there.radius_mm == pytest.approx(here.radius_mm, rel=1e-9)


@pytest.mark.parametrize("is_rational", [False, True])
def test_as_many_pieces_are_looked_at_however_the_part_is_turned(monkeypatch, is_rational):
    """Bounds that depended on the axes took 128 886 pieces for a blade's tip, and more than are allowed for the next blade's."""
    seen, one_round = [], curvature._Search._round

    def counted(search, patch, box):
        seen.append(len(box))
        return one_round(search, patch, box)

    monkeypatch.setattr(curvature._Search, "_round", counted)
    totals = []
    for turn in (np.eye(3), Rotation.from_rotvec((0.9, -0.4, 1.3)).as_matrix()):
        seen.clear()
        tightest_hollow([face_of(bspline(wavy_poles(3) @ turn.T, random_weights(3) if is_rational else None))], [0])
        totals.append(sum(seen))
    assert totals[1] == pytest.approx(totals[0], rel=0.02)


def test_a_pocket_lists_its_sharp_inner_edges_and_no_outer_one():
    faces, indices = all_of(block().faces(">Z").workplane().rect(30, 20).cutBlind(-10))
    edges = inner_edges(faces, indices)
    # four upright corners and four along the bottom
    assert sorted(round(e.length_mm, 6) for e in edges) == [10, 10, 10, 10, 20, 20, 30, 30]
    assert all(e.opening_deg == pytest.approx(90) for e in edges)
    assert all(abs(e.place_mm[0]) <= 15 and abs(e.place_mm[1]) <= 10 and 5 <= e.place_mm[2] <= 15 for e in edges)


@pytest.mark.parametrize("half_deg", [20, 45, 70])
def test_a_vee_opens_by_its_angle(half_deg):
    w = 8 * np.tan(np.radians(half_deg))
    vee = cq.Workplane("YZ").polyline([(-w, 15), (w, 15), (0, 7)]).close().extrude(100, both=True)
    (edge,) = inner_edges(*all_of(block().cut(vee)))
    assert edge.opening_deg == pytest.approx(2 * half_deg, abs=1e-6)
    assert edge.length_mm == pytest.approx(60)
    np.testing.assert_allclose(edge.place_mm, (0, 0, 7), atol=1e-9)


def test_a_filleted_pocket_has_no_inner_edge_where_the_fillets_are():
    part = block().faces(">Z").workplane().rect(30, 20).cutBlind(-10)
    inner = part.edges(cq.selectors.BoxSelector((-16, -11, 4), (16, 11, 14.9)))
    assert inner_edges(*all_of(inner.fillet(2))) == []


def test_edges_of_faces_that_are_not_cut_are_left_out():
    faces, _ = all_of(block().faces(">Z").workplane().rect(30, 20).cutBlind(-10))
    top = [i for i, f in enumerate(faces) if abs(f.middle.point_mm[0, 2] - 15) < 1e-9]
    assert inner_edges(faces, top) == []


def test_a_round_hole_with_a_flat_bottom_has_one_inner_edge():
    faces, indices = all_of(block().faces(">Z").workplane().hole(12, 8))
    (edge,) = inner_edges(faces, indices)
    assert edge.opening_deg == pytest.approx(90) and edge.length_mm == pytest.approx(12 * np.pi)


def test_the_corners_of_a_pocket_are_fillets_of_their_radius():
    faces, indices = all_of(round_pocket_block(4.0, 2.5))
    found = fillets(faces, indices)
    radii = sorted(round(f.radius_mm, 6) for f in found)
    assert set(radii) == {2.5, 4.0} and radii.count(4.0) == 4
    assert all(faces[f.face].kind in ("cylinder", "torus", "sphere", "bspline", "revolution") for f in found)


def test_holes_and_outer_roundings_are_no_fillets():
    part = block().faces(">Z").workplane().hole(12, 8).edges("|Z and >X").fillet(3)
    assert fillets(*all_of(part)) == []


def test_an_edge_that_opens_along_its_way_is_named_where_it_is_sharpest():
    # a groove with a level floor whose one wall leans more and more
    d = [(0, 0), (20, 0), (20, 10), (12, 10), (10, 4), (0, 4)]
    e = [(0, 0), (20, 0), (20, 10), (18, 10), (10, 4), (0, 4)]
    wires = [cq.Wire.makePolygon([cq.Vector(x, y, z) for x, z in points], close=True)
             for y, points in ((0, d), (30, e))]
    (edge,) = inner_edges(*all_of(cq.Solid.makeLoft(wires, True)))
    assert edge.place_mm[1] < 1.1 and edge.length_mm == pytest.approx(30, rel=1e-6)
    assert 180 - np.degrees(np.arctan2(6, 2.2)) < edge.opening_deg + 1 and edge.opening_deg < 115


def test_a_crease_within_one_face_is_an_inner_edge():
    x, y = np.meshgrid([0.0, 10, 20, 30, 40], np.linspace(0, 30, 4), indexing="ij")
    fold = lambda sign: np.stack([x, y, sign * np.abs(x - 20)], axis=-1)
    knots = np.r_[[0.0] * 3, 0.5, 0.5, [1.0] * 3]
    face = lambda sign: face_of(bspline(fold(sign), knots_u=knots, degree=(2, 3)))
    (crease,) = inner_edges([face(+1)], [0])
    assert crease.faces == (0, 0) and crease.opening_deg == pytest.approx(90, abs=1e-5)
    assert crease.length_mm == pytest.approx(30) and crease.place_mm[0] == pytest.approx(20, abs=1e-6)
    assert inner_edges([face(-1)], [0]) == []


def test_samples_carry_the_curvature_across_and_the_whole_area():
    R = 25.0
    bar = cq.Workplane("YZ").circle(R).extrude(30)          # axis along x
    faces, _ = all_of(bar)
    side = [i for i, f in enumerate(faces) if f.kind == "cylinder"]
    for axis, want in ((1, 1 / R), (0, 0.0)):
        samples = sample_faces(faces, side, axis)
        level = np.abs(samples.normal[:, axis]) < 0.99
        np.testing.assert_allclose(samples.across_per_mm[level], want, atol=1e-9)
        assert samples.area_mm2.sum() == pytest.approx(2 * np.pi * R * 30, rel=1e-6)


def test_an_outer_cone_up_to_its_apex_holds_no_hollow():
    faces = faces_of(the_solid(cq.Solid.makeCone(5, 0, 4)))
    assert np.isinf(tightest_hollow(faces, range(len(faces))).radius_mm)
