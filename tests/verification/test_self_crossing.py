"""Solids that cross themselves are told; those that do not, are not."""

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_SHELL
from OCP.TopoDS import TopoDS, TopoDS_Solid
from scipy.interpolate import make_interp_spline
from troublesome_parts import bow_tie, closed_face, hole_and_islands, knife_edge, pole_and_apex, slivers

from cuspline.kernel import brep
from cuspline.kernel.shells import spline_surface
from cuspline.report.view_mesh import tessellate_for_view
from cuspline.splines.nurbs import NurbsSurface
from cuspline.surfaces.folds import folds_of
from cuspline.values.errors import DesignError
from cuspline.verification.crossing_kernels import enclosures
from cuspline.verification.self_crossing import refuse_self_crossing, self_crossings


def crossings(solid, deflection_mm=0.05):
    return self_crossings(solid, tessellate_for_view(solid, deflection_mm))


def solid_of_shells(*shapes):
    """One solid bounded by all shells of some shapes."""
    solid, builder = TopoDS_Solid(), BRep_Builder()
    builder.MakeSolid(solid)
    for shape in shapes:
        for shell in brep.explore(shape, TopAbs_SHELL):
            builder.Add(solid, TopoDS.Shell_s(shell))
    return solid


def box(x, size=10.0):
    return BRepPrimAPI_MakeBox(gp_Pnt(x, x, x), size, size, size).Solid()


@pytest.mark.parametrize("make", [
    lambda: cq.Workplane().box(10, 8, 4).edges("|Z").fillet(2).faces(">Z").shell(-0.5),
    lambda: cq.Workplane().sphere(5), lambda: cq.Workplane().cylinder(8, 3).faces(">Z").workplane().hole(2),
    lambda: cq.Workplane().polygon(3, 10).workplane(offset=8).circle(0.01).loft(),
    lambda: cq.Workplane("XZ").moveTo(6, 0).circle(2).revolve(300, (0, 0), (0, 1)),
    lambda: cq.Workplane().rect(0.02, 30).extrude(20), knife_edge, pole_and_apex, closed_face, slivers, hole_and_islands],
    ids=["hollow box", "sphere", "bored cylinder", "needle", "part of a ring", "foil of 0.02 mm", "knife edge",
         "pole and apex", "closed face", "slivers", "hole and islands"])
def test_sound_solids_do_not_cross_themselves(make):
    assert crossings(brep.the_solid(make())) == ()


def test_a_bow_tie_crosses_itself():
    solid = bow_tie()
    places = [c.place_mm for c in crossings(solid) if "cross" in c.what]
    on_sides = [p for p in places if 0 <= p[2] <= 5]
    assert on_sides and all(np.allclose(p[:2], (5, 4), atol=1e-3) for p in on_sides)
    with pytest.raises(DesignError, match="part 7 crosses itself, it bounds no solid: "):
        refuse_self_crossing(solid, tessellate_for_view(solid, 0.1), "part 7")


def test_overlapping_shells_cross_and_nested_or_doubled_ones_enclose_twice():
    assert any(" cross" in c.what for c in crossings(solid_of_shells(box(0.0), box(6.0))))
    for second in (box(2.0, 3.0), box(0.0)):
        assert any("2 times inside" in c.what or "1 times outside" in c.what
                   for c in crossings(solid_of_shells(box(0.0), second)))


def test_a_solid_inside_out_is_told():
    solid = TopoDS.Solid_s(box(0.0).Reversed())
    assert all("1 times outside" in c.what or "-1 times" in c.what for c in crossings(solid)) and crossings(solid)


def canal(bend_mm, ball_mm):
    """Half a tube of `ball_mm` round a way that turns with `bend_mm`, as one spline surface: u along, v across."""
    u = np.linspace(0.0, 2.0, 60)
    v = np.linspace(-np.pi / 2, np.pi / 2, 24)
    grid_u, grid_v = np.meshgrid(u, v, indexing="ij")
    # an ellipse whose sharpest bend is at u = 1; its radius of curvature there is `bend_mm`
    turn = np.pi * (grid_u - 1) / 3
    way = np.stack([8.0 * np.sin(turn), (64.0 / bend_mm) * (1 - np.cos(turn))], -1)
    tangent = np.stack([8.0 * np.cos(turn), (64.0 / bend_mm) * np.sin(turn)], -1)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    side = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
    points = np.concatenate([way + ball_mm * np.cos(grid_v)[..., None] * side, ball_mm * np.sin(grid_v)[..., None]], -1)
    along = make_interp_spline(u, points, 5)
    across = make_interp_spline(v, along.c.transpose(1, 0, 2), 5)
    poles = across.c.transpose(1, 0, 2)
    nurbs = NurbsSurface(degree_u=5, degree_v=5, knots_u=along.t, knots_v=across.t,
                         poles=np.concatenate([poles, np.ones((*poles.shape[:2], 1))], axis=-1))
    return brep.Face(BRepBuilderAPI_MakeFace(spline_surface(nurbs), 1e-7).Face())


@pytest.mark.parametrize("ball, folds", [(2.8, False), (2.97, False), (3.03, True), (4.0, True)])
def test_a_tube_folds_where_its_way_bends_tighter_than_its_radius(ball, folds):
    places = folds_of(canal(3.0, ball))
    assert bool(len(places)) is folds
    # a fold lies about the sharpest bend
    assert not folds or np.abs(places[:, 0]).max() < 4.0


def test_enclosures_count_layers():
    mesh = tessellate_for_view(box(0.0), 1.0)
    corners = np.ascontiguousarray(mesh.vertices_mm[mesh.triangles])
    points = np.array([[5.0, 5.0, 5.0], [11.0, 5.0, 5.0], [-3.0, 2.0, 1.0]])
    way = np.array([0.3, 0.5, 0.81])
    assert enclosures(points, way, corners).tolist() == [1, 0, 0]
    assert enclosures(points, way, np.concatenate([corners, corners])).tolist() == [2, 0, 0]
    assert enclosures(points, way, np.ascontiguousarray(corners[:, ::-1])).tolist() == [-1, 0, 0]
