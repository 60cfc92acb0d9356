"""What is measured on: a wavy B-spline patch, alone and as the top of a closed solid, and a trimmed part of many faces.

The patch is 100 x 60 mm, bicubic, 44 x 28 control points, no graph of (u, v): waves, a bump and a flat pad.
Steepest normal n_z = 0.64; tightest hollow 3.6 mm, so that a ball of 6 mm cannot reach everywhere.
"""

from functools import lru_cache

import cadquery as cq
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeSolid, BRepBuilderAPI_Sewing
from OCP.BRepLib import BRepLib
from OCP.Geom import Geom_BezierCurve, Geom_BSplineSurface
from OCP.GeomFill import GeomFill
from OCP.gp import gp_Pnt
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal
from OCP.TopoDS import TopoDS

from cuspline.kernel.tessellation import tessellate
from cuspline.splines.nurbs import NurbsSurface, local_shape

CUTTERS = {"ball R6": (6.0, 6.0), "bull nose R10 r1": (10.0, 1.0), "flat R5": (5.0, 0.0)}
CONTROL = (44, 28)
SIZE_MM = (100.0, 60.0)
BOTTOM_MM = -20.0


@lru_cache
def patch():
    """The patch as a NurbsSurface."""
    knots = [np.concatenate([np.zeros(3), np.linspace(0, 1, n - 2), np.ones(3)]) for n in CONTROL]
    return NurbsSurface(degree_u=3, degree_v=3, knots_u=knots[0], knots_v=knots[1],
                        poles=np.concatenate([control_points_mm(), np.ones((*CONTROL, 1))], axis=-1))


def control_points_mm():
    """(44, 28, 3) control points."""
    knots = [np.concatenate([np.zeros(3), np.linspace(0, 1, n - 2), np.ones(3)]) for n in CONTROL]
    u, v = np.meshgrid(*([k[i + 1:i + 4].mean() for i in range(n)] for k, n in zip(knots, CONTROL)), indexing="ij")
    bulge = np.sin(np.pi * u) * np.sin(np.pi * v)
    x = SIZE_MM[0] * u + 1.2 * bulge * np.sin(3 * np.pi * v)
    y = SIZE_MM[1] * v + 0.9 * bulge * np.cos(2 * np.pi * u)
    z = 5 * np.sin(2 * np.pi * x / 50) * np.sin(2 * np.pi * y / 40)
    z += 5 * np.exp(-((x - 70) ** 2 + (y - 38) ** 2) / (2 * 7.0 ** 2))
    pad = np.clip((14 - np.hypot(x - 22, y - 44)) / 6, 0, 1)
    pad = pad * pad * (3 - 2 * pad)
    return np.stack([x, y, z * (1 - pad) + 1.5 * pad], axis=-1)


def patch_grid(nu, nv):
    """Vertices, triangles and (u, v) of the vertices of a uniform grid on the patch."""
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, nu + 1), np.linspace(0, 1, nv + 1), indexing="ij"))
    index = np.arange(len(u)).reshape(nu + 1, nv + 1)
    a, b, c, d = (q.ravel() for q in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return patch().derivatives(u, v)[:, 0], triangles, np.column_stack([u, v])


def grid_deviation_mm(nu, nv, samples=200_000):
    """Largest measured distance, along the normal, between the grid's triangles and the patch."""
    vertices, triangles, uv = patch_grid(nu, nv)
    rng = np.random.default_rng(1)
    t, share = triangles[rng.integers(0, len(triangles), samples)], rng.dirichlet([1, 1, 1], samples)
    on_mesh = np.einsum("nk,nkd->nd", share, vertices[t])
    shape = local_shape(patch().derivatives(*np.einsum("nk,nkd->nd", share, uv[t]).T))
    return np.abs(((on_mesh - shape.point_mm) * shape.normal).sum(axis=1)).max()


@lru_cache
def patch_mesh(deviation_mm):
    """Vertices, triangles and the measured deviation, within 5 % of the wanted one."""
    n = 100.0
    for _ in range(6):
        counts = round(n), round(0.61 * n)
        measured = grid_deviation_mm(*counts)
        if abs(measured / deviation_mm - 1) < 0.05:
            return *patch_grid(*counts)[:2], measured
        n *= np.sqrt(measured / deviation_mm)
    raise RuntimeError(f"no grid measures {deviation_mm} mm: the last one measures {measured} mm")


def patch_face():
    """The patch as an OCCT face, normal up."""
    points = TColgp_Array2OfPnt(1, CONTROL[0], 1, CONTROL[1])
    for (i, j), p in zip(np.ndindex(*CONTROL), control_points_mm().reshape(-1, 3)):
        points.SetValue(i + 1, j + 1, gp_Pnt(*p.tolist()))
    knots, times = zip(*(_knots(n) for n in CONTROL))
    surface = Geom_BSplineSurface(points, *knots, *times, 3, 3)
    return BRepBuilderAPI_MakeFace(surface, 1e-7).Face()


def _knots(count):
    """Clamped uniform knots and how often each counts, as OCCT wants them."""
    spans = count - 3
    knots, times = TColStd_Array1OfReal(1, spans + 1), TColStd_Array1OfInteger(1, spans + 1)
    for i in range(spans + 1):
        knots.SetValue(i + 1, i / spans)
        times.SetValue(i + 1, 4 if i in (0, spans) else 1)
    return knots, times


@lru_cache
def patch_solid():
    """A block whose top is the patch as one B-spline face, with four sides and a bottom at z = -20 mm."""
    top = patch_face()
    surface = BRep_Tool.Surface_s(top)
    sewing = BRepBuilderAPI_Sewing(1e-5)
    sewing.Add(top)
    for rim in (surface.UIso(0.0), surface.UIso(1.0), surface.VIso(0.0), surface.VIso(1.0)):
        floor = TColgp_Array1OfPnt(1, 2)
        for k in (0, 1):
            p = rim.Value(float(k))
            floor.SetValue(k + 1, gp_Pnt(p.X(), p.Y(), BOTTOM_MM))
        sewing.Add(BRepBuilderAPI_MakeFace(GeomFill.Surface_s(rim, Geom_BezierCurve(floor)), 1e-7).Face())
    x, y = SIZE_MM
    sewing.Add(cq.Face.makeFromWires(cq.Wire.makePolygon(
        [(0, 0, BOTTOM_MM), (x, 0, BOTTOM_MM), (x, y, BOTTOM_MM), (0, y, BOTTOM_MM)], close=True)).wrapped)
    sewing.Perform()
    solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell_s(sewing.SewedShape())).Solid()
    BRepLib.OrientClosedSolid_s(solid)
    return solid


@lru_cache
def trimmed_part():
    """A 100 x 60 block with a round boss, a rib, a pocket and a through hole, filleted: many trimmed faces."""
    part = (cq.Workplane("XY").box(100, 60, 20, centered=(False, False, False))
            .faces(">Z").workplane(origin=(0, 0, 20)).center(28, 30).circle(12).extrude(8)
            .faces(">Z[1]").workplane(origin=(0, 0, 20)).center(70, 40).rect(34, 24).cutBlind(-9)
            .faces(">Z[1]").workplane(origin=(0, 0, 20)).center(60, 14).rect(40, 6).extrude(5)
            .faces("<Z").workplane(origin=(0, 0, 0)).center(88, 12).hole(8))
    part = part.edges(cq.selectors.BoxSelector((52, 27, 10.5), (88, 53, 10.9 + 8))).edges("|Z").fillet(4.0)
    part = part.faces(cq.selectors.BoxSelector((15, 17, 27), (41, 43, 29))).edges().fillet(3.0)
    return part.solids().val().wrapped


def part_mesh(solid, deviation_mm):
    """Vertices, triangles and measured deviation of a solid's tessellation."""
    mesh = tessellate(solid, deviation_mm)
    return mesh.vertices_mm, mesh.triangles, mesh.deviation_mm
