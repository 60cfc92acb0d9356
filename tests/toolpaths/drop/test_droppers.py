"""Cutters lowered onto triangles: heights, contacts, faces and allowance."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.kernel import brep
from cuspline.toolpaths.contact.contacts import NO_FACE
from cuspline.toolpaths.drop.droppers import MeshDropper
from cuspline.values.errors import ToolpathError

STEP_Z_MM = 4.0


@pytest.fixture(scope="module")
def stepped():
    """A block 30 x 20 x 10 with a lower floor for x > 15, its faces and mesh."""
    solid = brep.the_solid(cq.Workplane().box(30, 20, 10, centered=False).cut(
        cq.Workplane().box(15, 20, 10, centered=False).translate((15, 0, STEP_Z_MM))))
    return brep.faces_of(solid), brep.planning_mesh(solid, 0.01)


def face_at(faces, point):
    return next(i for i, f in enumerate(faces) if np.allclose(f.middle.point_mm[0], point, atol=1e-6))


def test_each_triangle_lies_on_its_face(stepped):
    faces, mesh = stepped
    for index, face in enumerate(faces):
        corners = mesh.vertices_mm[mesh.triangles[mesh.face_of_triangle == index]].reshape(-1, 3)
        assert np.abs((corners - face.middle.point_mm[0]) @ face.middle.normal[0]).max() < 1e-9


def test_a_ball_touches_the_face_the_edge_and_the_wall_it_should(stepped):
    faces, mesh = stepped
    top, floor, wall = face_at(faces, (7.5, 10, 10)), face_at(faces, (22.5, 10, 4)), face_at(faces, (15, 10, 7))
    c = MeshDropper.of(mesh, 2.0, 2.0).contacts(np.array([[7, 7.3], [16, 7.3], [22, 7.3], [3, 21], [60, 0.0]]))
    assert np.abs(c.tip_z_mm[:4] - [10, 8 + 3 ** 0.5, 4, 8 + 3 ** 0.5]).max() < 1e-12 and c.tip_z_mm[4] == -np.inf
    assert c.face[[0, 2, 4]].tolist() == [top, floor, NO_FACE]
    assert c.is_edge.tolist() == [False, True, False, True, False]
    assert {c.face[1], c.beside[1]} == {top, wall}
    assert np.abs(c.normal[:3] - [(0, 0, 1), (0.5, 0, 3 ** 0.5 / 2), (0, 0, 1)]).max() < 1e-12
    assert c.touches({top}).tolist() == [True, False, False, False, False]
    assert c.touches({top, wall}).tolist() == [True, True, False, False, False]
    assert c.touches_rim({top}).tolist() == [False, True, False, True, False]


@pytest.mark.parametrize("radius, corner", [(2.0, 2.0), (3.0, 0.5), (2.5, 0.0)])
def test_an_allowance_is_left_on_top_and_kept_from_the_wall(stepped, radius, corner):
    """Above the floor the true cutter stands clear of the wall by at least the allowance, and no more."""
    _, mesh = stepped
    left = 0.3
    dropper = MeshDropper.of(mesh, radius, corner, left)
    assert abs(dropper.tips_mm(np.array([[5.0, 5.0]]))[0] - 10 - left) < 1e-12
    near, far = dropper.tips_mm(np.array([[15 + radius + left - 1e-6, 10.0], [15 + radius + left + 1e-6, 10.0]]))
    assert abs(far - STEP_Z_MM - left) < 1e-12 and near > 10 - corner


def test_tips_and_contacts_agree(stepped):
    dropper = MeshDropper.of(stepped[1], 3.0, 1.0, 0.2)
    xy = np.random.default_rng(1).uniform((-5, -5), (35, 25), (2000, 2))
    assert np.array_equal(dropper.tips_mm(xy), dropper.contacts(xy).tip_z_mm)


def test_contacts_lie_on_the_cutter_and_normals_lead_to_its_corner_circle(stepped):
    dropper = MeshDropper.of(stepped[1], 3.0, 1.0)
    xy = np.random.default_rng(2).uniform((-2, -2), (32, 22), (2000, 2))
    c = dropper.contacts(xy)
    level = c.contact_mm + 1.0 * c.normal
    arm = np.linalg.norm(level[:, :2] - xy, axis=1)
    assert np.abs(level[:, 2] - c.tip_z_mm - 1.0).max() < 1e-9
    assert (arm < 2.0 + 1e-6).all() and np.abs(arm[c.normal[:, 2] < 0.999] - 2.0).max() < 1e-6


def test_a_cutter_with_a_corner_beyond_its_radius_is_refused(stepped):
    with pytest.raises(ToolpathError, match="corner radius"):
        MeshDropper.of(stepped[1], 2.0, 3.0)


def test_a_smooth_face_has_no_edges_inside_nor_at_its_seam():
    middle = 8 * 0.5 ** 0.5
    solid = brep.the_solid(cq.Workplane("XZ").lineTo(8, 0).threePointArc((middle, middle), (0, 8)).close()
                           .revolve(360, (0, 0, 0), (0, 1, 0)))
    faces, mesh = brep.faces_of(solid), brep.planning_mesh(solid, 0.05)
    dome = next(i for i, f in enumerate(faces) if f.kind == "sphere")
    xy = np.random.default_rng(3).uniform(-6, 6, (500, 2))
    c = MeshDropper.of(mesh, 2.0, 2.0).contacts(np.vstack([xy, [[3.0, 0.0], [-3.0, 0.0]]]))
    assert (c.face == dome).all() and not c.is_edge.any()
