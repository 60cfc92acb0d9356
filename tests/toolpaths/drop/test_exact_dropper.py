"""The exact dropper names the same faces as the mesh where the mesh is the part itself."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.kernel import brep
from cuspline.toolpaths.drop.droppers import MeshDropper
from cuspline.toolpaths.drop.exact_dropper import EdgeNeighbours, ExactDropper


@pytest.fixture(scope="module")
def stepped():
    solid = brep.the_solid(cq.Workplane().box(30, 20, 10, centered=False).cut(
        cq.Workplane().box(15, 20, 10, centered=False).translate((15, 0, 4))))
    return brep.faces_of(solid), brep.planning_mesh(solid, 0.01)


@pytest.mark.parametrize("radius, corner, left", [(2.0, 2.0, 0.0), (3.0, 0.5, 0.2), (2.5, 0.0, 0.0)])
def test_heights_and_regions_agree_with_the_mesh_of_a_part_of_planes(stepped, radius, corner, left):
    faces, mesh = stepped
    xy = np.random.default_rng(4).uniform((-3, -3), (33, 23), (500, 2))
    a, b = (d.contacts(xy) for d in (MeshDropper.of(mesh, radius, corner, left),
                                     ExactDropper.of_faces(faces, radius, corner, left)))
    held = np.isfinite(a.tip_z_mm)
    assert np.array_equal(held, np.isfinite(b.tip_z_mm)) and np.abs(a.tip_z_mm[held] - b.tip_z_mm[held]).max() < 2e-5
    if corner == radius:    # others lie flat on whole areas and edges: which point is named is their choice
        for wanted in ([i] for i in range(len(faces))):
            assert (a.touches(wanted) != b.touches(wanted)).mean() < 2e-3
            assert (a.touches_rim(wanted) != b.touches_rim(wanted)).mean() < 2e-2       # corners have three faces
        assert np.abs(a.normal[held] - b.normal[held]).max() < 1e-3


def test_the_face_beside_an_edge_is_the_other_one_and_a_seam_has_the_same_on_both_sides():
    solid = brep.the_solid(cq.Workplane().circle(5).extrude(8))
    faces = brep.faces_of(solid)
    side = next(i for i, f in enumerate(faces) if f.kind == "cylinder")
    top = next(i for i, f in enumerate(faces) if f.middle.point_mm[0, 2] > 7.9)
    seam = np.array([[5.0, 0.0, 4.0]])
    rim = np.array([[0.0, 5.0, 8.0]])
    neighbours = EdgeNeighbours.of_faces(faces)
    assert neighbours.beside(rim, np.array([top]))[0] == side and neighbours.beside(rim, np.array([side]))[0] == top
    assert neighbours.beside(seam, np.array([side]))[0] == side


def test_a_place_on_the_border_lies_beside_the_border_also_where_another_edge_of_its_face_ends():
    """Floor and round foot of a rib: a ball that hung over the border near the end of the line between them seemed to lie on
    that, and passes led on until it fell off."""
    part = cq.Workplane().box(20, 10, 4).union(cq.Workplane().box(4, 10, 4).translate((0, 0, 4)))
    feet = part.edges("|Y").edges(cq.selectors.BoxSelector((-3, -9, 1.9), (3, 9, 2.1)))
    faces = brep.faces_of(brep.the_solid(feet.fillet(1.0)))
    at = lambda *place: int(np.argmin([np.linalg.norm(f.middle.point_mm[0] - place) for f in faces]))
    floor, foot, side = at(-6.5, 0, 2), at(-2.3, 0, 2.3), at(0, -5, 2)
    neighbours, across = EdgeNeighbours.of_faces(faces), np.linspace(1e-3, 0.5, 200)
    border, line = np.tile((-3.0, -5.0, 2.0), (2, 200, 1))
    border[:, 0] -= across
    line[:, 1] += across
    assert (neighbours.beside(border, np.full(200, floor)) == side).all()
    assert (neighbours.beside(line, np.full(200, floor)) == foot).all()
