"""Creases within a face: where they are, how far they go, and that a cutter rests on them."""

import cadquery as cq
import numpy as np
import pytest
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_NurbsConvert
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Pnt
from OCP.TColgp import TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal
from OCP.TopAbs import TopAbs_FACE

from cuspline.kernel.brep import faces_of, planning_mesh
from cuspline.kernel.topology import explore
from cuspline.surfaces.creases import creases_of, proud_curves
from cuspline.toolpaths.drop.dropcutter import DropMesh
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm as mesh_tips_mm
from cuspline.toolpaths.drop.exact_drop import ExactPart, drop_tips_mm
from cuspline.toolpaths.drop.exact_dropper import ExactDropper

SLOPE = 0.6


def roof(ridge_z=0.0, slope=SLOPE):
    """Face of one spline of degree one, its crease along y over x = 0; proud where the slope is positive."""
    poles = TColgp_Array2OfPnt(1, 3, 1, 2)
    for i, x in enumerate((-8.0, 0.0, 8.0), 1):
        for j, y in enumerate((-5.0, 5.0), 1):
            poles.SetValue(i, j, gp_Pnt(x, y, ridge_z - slope * abs(x)))
    knots_u, knots_v = TColStd_Array1OfReal(1, 3), TColStd_Array1OfReal(1, 2)
    count_u, count_v = TColStd_Array1OfInteger(1, 3), TColStd_Array1OfInteger(1, 2)
    for knots, counts, values, many in ((knots_u, count_u, (0, 1, 2), (2, 1, 2)), (knots_v, count_v, (0, 1), (2, 2))):
        for k, (value, number) in enumerate(zip(values, many), 1):
            knots.SetValue(k, float(value))
            counts.SetValue(k, number)
    return BRepBuilderAPI_MakeFace(Geom_BSplineSurface(poles, knots_u, knots_v, count_u, count_v, 1, 1), 1e-6).Face()


@pytest.mark.parametrize("radius", [0.5, 3.0, 12.0])
def test_a_ball_rests_on_a_crease_as_on_an_edge(radius):
    part = ExactPart.of_solid(roof())
    reach = radius * SLOPE / np.sqrt(1 + SLOPE ** 2)        # farther aside it touches a slope
    x = np.linspace(-0.98, 0.98, 15) * min(reach, 4.0)
    tips = drop_tips_mm(part, np.column_stack([x, np.linspace(-4, 4, 15)]), radius, radius)
    np.testing.assert_allclose(tips, np.sqrt(radius ** 2 - x ** 2) - radius, atol=2e-5)     # twice what is asked of the search


def test_the_face_on_both_sides_of_a_crease_is_its_own():
    contacts = ExactDropper.of_faces(faces_of(roof()), 2.0, 2.0).contacts(np.array([[0.3, 1.0]]))
    assert contacts.is_edge[0] and contacts.face[0] == contacts.beside[0] == 0


def test_a_hollow_crease_is_none_to_rest_on():
    valley, = creases_of(faces_of(roof(slope=-SLOPE))[0])
    assert not valley.is_proud and (valley.turn_rad > 0).all() and proud_curves(faces_of(roof(slope=-SLOPE))[0]) == []


def test_knots_that_are_smooth_are_no_creases():
    ball = BRepBuilderAPI_NurbsConvert(cq.Workplane("XY").sphere(6).val().wrapped, True).Shape()
    found = [c for f in faces_of(ball) for c in creases_of(f)]
    assert found and not any(c.is_proud for c in found)


def test_a_crease_ends_where_its_face_is_trimmed_and_the_exact_drop_is_that_of_fine_triangles():
    slab = cq.Workplane(obj=cq.Solid.extrudeLinear(cq.Workplane("XY").circle(3).wires().val(), [], cq.Vector(0, 0, 20)))
    cut = cq.Workplane(obj=cq.Shape.cast(roof())).val().intersect(slab.translate((0, 0.5, -10)).val())
    face, = faces_of(cut.wrapped)
    (_, low, high), = proud_curves(face)
    line = proud_curves(face)[0][0]
    np.testing.assert_allclose([line.Value(low).Y(), line.Value(high).Y()], [-2.5, 3.5], atol=1e-6)
    mesh = planning_mesh(cut.wrapped, 1e-4)
    triangles = DropMesh.from_triangles(mesh.vertices_mm, mesh.triangles)
    side = np.linspace(-5, 5, 21)
    xy = np.column_stack([np.tile(side, 21), np.repeat(side, 21)])
    exact, near = drop_tips_mm(ExactPart.of_solid(cut.wrapped), xy, 2.0, 2.0), mesh_tips_mm(triangles, xy, 2.0, 2.0)
    both = np.isfinite(exact) & np.isfinite(near)
    assert len(list(explore(cut.wrapped, TopAbs_FACE))) == 1 and both.sum() > 150
    inner = both & (np.hypot(xy[:, 0], xy[:, 1] - 0.5) < 4.9)       # a rim's triangles are no circle
    np.testing.assert_allclose(exact[inner], near[inner], atol=3e-3)
