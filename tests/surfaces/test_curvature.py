"""The tightest hollow and the inner edges of parts where both are known."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.brep import faces_of, the_solid
from cuspline.surfaces.curvature import inner_edges, sample_faces, tightest_hollow

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


def test_samples_carry_the_curvature_across_and_the_whole_area():
    R = 25.0
    bar = cq.Workplane("YZ").circle(R).extrude(30)          # axis along x
    faces, _ = all_of(bar)
    side = [i for i, f in enumerate(faces) if f.kind == "cylinder"]
    for axis, curvature in ((1, 1 / R), (0, 0.0)):
        samples = sample_faces(faces, side, axis)
        level = np.abs(samples.normal[:, axis]) < 0.99
        np.testing.assert_allclose(samples.across_per_mm[level], curvature, atol=1e-9)
        assert samples.area_mm2.sum() == pytest.approx(2 * np.pi * R * 30, rel=1e-6)
