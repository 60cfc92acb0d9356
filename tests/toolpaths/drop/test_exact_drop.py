"""Exact drop heights against closed forms and against a search that shares nothing with them."""

import importlib.util
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCone, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Pnt

from cuspline.kernel import brep
from cuspline.toolpaths.drop.dropcutter import DropMesh
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm as mesh_tips_mm
from cuspline.toolpaths.drop.exact_drop import ExactPart, PartNear, drop_contacts, drop_tips_mm, gouge_depths_mm
from cuspline.toolpaths.drop.patch_bounds import EVERYWHERE
from cuspline.values.errors import ToolpathError

_spec = importlib.util.spec_from_file_location("exact_parts", Path(__file__).parents[2] / "parts" / "exact_parts.py")
parts = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(parts)

EXACT_MM = 1e-9         # rounding of coordinates below 100 mm
FINE_MM = 5e-9         # the finest that can be asked for: bounds are rounded outward by 1e-9
PROMISE_MM = 1e-5       # drop_tips_mm's own tolerance, a tenth of the tenth of a micrometre that is promised
CUTTERS = pytest.mark.parametrize("R, rc", [(4.0, 4.0), (4.0, 1.0), (3.0, 0.0)], ids=["ball", "bull nose", "flat"])


@pytest.fixture(scope="module")
def block():
    solid = parts.machined_block()
    return solid, ExactPart.of_solid(solid), parts.BruteDrop(solid)


@CUTTERS
def test_a_sphere_is_touched_where_the_offset_sphere_says(R, rc):
    part = ExactPart.of_solid(BRepPrimAPI_MakeSphere(10.0).Solid())
    rng = np.random.default_rng(3)
    xy = rng.uniform(-7, 7, (200, 2))
    xy[0] = 0.0
    e = np.maximum(np.hypot(*xy.T) - (R - rc), 0.0)
    np.testing.assert_allclose(drop_tips_mm(part, xy, R, rc), np.sqrt((10 + rc) ** 2 - e ** 2) - rc, rtol=0,
                               atol=PROMISE_MM)


@CUTTERS
def test_an_inclined_plane_is_touched_in_closed_form(R, rc):
    slab = cq.Workplane("XY").box(80, 60, 20).rotate((0, 0, 0), (0, 1, 0), 25).val().wrapped
    xy = np.random.default_rng(1).uniform(-12, 12, (50, 2))
    slope = np.tan(np.radians(25))
    plane = 10 / np.cos(np.radians(25)) - slope * xy[:, 0]
    tips = plane + (R - rc) * slope + rc * (np.sqrt(1 + slope ** 2) - 1)
    np.testing.assert_allclose(drop_tips_mm(ExactPart.of_solid(slab), xy, R, rc), tips, rtol=0, atol=EXACT_MM)


@CUTTERS
def test_edges_and_corners_of_a_box_are_touched_in_closed_form(R, rc):
    part = ExactPart.of_solid(BRepPrimAPI_MakeBox(20.0, 16.0, 5.0).Solid())
    xy = np.random.default_rng(2).uniform((-5, -5), (25, 21), (400, 2))
    d = np.linalg.norm(np.maximum(np.maximum(-xy, xy - (20, 16)), 0.0), axis=1)
    e = np.maximum(d - (R - rc), 0.0)
    beneath = d < R
    tips = drop_tips_mm(part, xy, R, rc, tolerance_mm=FINE_MM)
    np.testing.assert_allclose(tips[beneath], 5.0 - (rc - np.sqrt(np.maximum(rc ** 2 - e ** 2, 0)))[beneath], rtol=0,
                               atol=FINE_MM)
    assert (tips[d > R] == -np.inf).all()


def test_a_ball_rests_on_the_flank_and_on_the_tip_of_a_cone():
    part = ExactPart.of_solid(BRepPrimAPI_MakeCone(8.0, 0.0, 8.0).Solid())
    d = np.linspace(0, 7, 60)
    tips = drop_tips_mm(part, np.column_stack([d * np.cos(1.0), d * np.sin(1.0)]), 3.0, 3.0, tolerance_mm=FINE_MM)
    flank, tip = 8 - d + 3 * np.sqrt(2) - 3, 8 - 3 + np.sqrt(np.maximum(9 - d ** 2, 0))
    np.testing.assert_allclose(tips, np.where(d > 3 / np.sqrt(2), flank, tip), rtol=0, atol=FINE_MM)


@CUTTERS
@settings(max_examples=2, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(seed=strategies.integers(0, 10_000))
def test_random_spline_solids_agree_with_brute_force(R, rc, seed):
    solid = parts.patch_solid(parts.random_poles(seed), -12.0)
    xy = np.random.default_rng(seed).uniform((-3, -3), (33, 27), (6, 2))
    search = parts.BruteDrop(solid)
    brute = np.array([search.tip(*p, R, rc) for p in xy])
    agree(drop_contacts(ExactPart.of_solid(solid), xy, R, rc), xy, brute, R, rc)


@CUTTERS
def test_a_trimmed_part_of_many_faces_agrees_with_brute_force(block, R, rc):
    solid, part, search = block
    xy = np.random.default_rng(5).uniform((-32, -27), (32, 27), (12, 2))
    xy[:4] = (-18, 12), (14, 12), (22, -14), (-18, -12)
    agree(drop_contacts(part, xy, R, rc), xy, np.array([search.tip(*p, R, rc) for p in xy]), R, rc)


def agree(found, xy, brute, R, rc):
    """No contact missed; where the search found less, the contact itself proves the height."""
    assert (found.tip_z_mm >= brute - PROMISE_MM).all()
    own = [parts.asked(c[None], *p, R + 1e-8, rc)[0] for c, p in zip(found.contact_mm, xy)]
    touched = found.face >= 0
    assert (touched == np.isfinite(brute)).all()
    np.testing.assert_allclose(found.tip_z_mm[touched], np.array(own)[touched], rtol=0, atol=2e-4 if rc else EXACT_MM)
    if rc:
        np.testing.assert_allclose(found.tip_z_mm[touched], brute[touched], rtol=0, atol=PROMISE_MM)


def test_contacts_name_the_face_and_the_direction_into_the_cutter(block):
    solid, part, _ = block
    faces = brep.faces_of(solid)
    found = drop_contacts(part, np.random.default_rng(6).uniform((-16, -20), (24, 20), (200, 2)), 3.0, 3.0,
                          tolerance_mm=FINE_MM)
    assert (found.face >= 0).all()
    middle = found.contact_mm + 3.0 * found.normal
    np.testing.assert_allclose(middle[:, 2] - 3.0, found.tip_z_mm, rtol=0, atol=PROMISE_MM)
    kinds = {faces[k].kind for k in found.face[~found.is_edge]}
    assert {"plane", "torus", "sphere", "cylinder"} & kinds >= {"plane", "torus"}


@CUTTERS
def test_turning_the_part_about_the_tool_axis_turns_the_answer(block, R, rc):
    solid, part, _ = block
    turned = cq.Shape.cast(solid).rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), 33).wrapped
    xy = np.random.default_rng(7).uniform(-25, 25, (60, 2))
    a = np.radians(33)
    there = xy @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
    np.testing.assert_allclose(drop_tips_mm(ExactPart.of_solid(turned), there, R, rc), drop_tips_mm(part, xy, R, rc),
                               rtol=0, atol=2 * PROMISE_MM)


def test_order_and_threads_change_nothing(block):
    _, part, _ = block
    xy = np.random.default_rng(8).uniform(-25, 25, (1500, 2))
    one_by_one = np.concatenate([drop_tips_mm(part, xy[k:k + 50], 3.0, 1.0) for k in range(0, 1500, 50)])
    np.testing.assert_allclose(drop_tips_mm(part, xy, 3.0, 1.0), one_by_one, rtol=0, atol=PROMISE_MM)


@CUTTERS
def test_a_fine_mesh_comes_close(R, rc):
    solid = parts.patch_solid(parts.random_poles(11), -12.0)
    mesh = brep.planning_mesh(solid, 2e-3)
    xy = np.random.default_rng(9).uniform((4, 4), (26, 20), (100, 2))
    coarse = mesh_tips_mm(DropMesh.from_triangles(mesh.vertices_mm, mesh.triangles), xy, R, rc)
    assert np.abs(coarse - drop_tips_mm(ExactPart.of_solid(solid), xy, R, rc)).max() < 0.02


@CUTTERS
def test_a_gouge_is_as_deep_as_the_cutter_was_lowered(block, R, rc):
    _, part, _ = block
    xy = np.random.default_rng(10).uniform(-20, 20, (40, 2))
    tips = np.column_stack([xy, drop_tips_mm(part, xy, R, rc)])
    tips = tips[np.isfinite(tips[:, 2])]        # the flat cutter falls through the hole
    assert (gouge_depths_mm(part, tips, R, rc) <= PROMISE_MM).all()
    np.testing.assert_allclose(gouge_depths_mm(part, tips - (0, 0, 0.25), R, rc), 0.25, rtol=0, atol=PROMISE_MM)


def test_radii_that_are_no_cutters_are_refused(block):
    for R, rc in ((0.0, 0.0), (2.0, 3.0), (2.0, -1.0)):
        with pytest.raises(ToolpathError, match="no cutter"):
            drop_tips_mm(block[1], np.zeros((1, 2)), R, rc)


def test_what_lies_beside_a_box_is_left_out_and_asked_for_where_a_cutter_comes_beyond_it():
    log = BRepPrimAPI_MakeBox(20.0, 16.0, 5.0).Solid()
    post = BRepPrimAPI_MakeBox(gp_Pnt(60.0, 0.0, 0.0), 4.0, 16.0, 9.0).Solid()
    both = brep.faces_of(log) + brep.faces_of(post)
    asked = []

    def make(box):
        asked.append(box)
        return ExactPart.of_faces(both, within_mm=box)

    near, whole = PartNear(make, (-10.0, 30.0, -10.0, 26.0)), ExactPart.of_faces(both)
    inside, beyond = np.array([[4.0, 5.0], [21.0, 8.0]]), np.array([[4.0, 5.0], [62.0, 8.0]])
    for xy in (inside, beyond):
        np.testing.assert_array_equal(drop_tips_mm(near.under(xy, 3.0), xy, 3.0, 3.0), drop_tips_mm(whole, xy, 3.0, 3.0))
    assert asked == [(-10.0, 30.0, -10.0, 26.0), EVERYWHERE]
    assert near.under(inside, 3.0).memory_bytes < whole.memory_bytes == near.under(beyond, 3.0).memory_bytes
    assert ExactPart.of_faces(both, within_mm=(200.0, 210.0, 0.0, 1.0)).memory_bytes == whole.memory_bytes
