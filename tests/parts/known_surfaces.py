"""Surfaces made straight in the CAD kernel: B-splines from arrays, and one face of every kind, moved and reversed."""

import cadquery as cq
import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_BezierSurface,
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_OffsetSurface,
    Geom_Plane,
    Geom_SphericalSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
)
from OCP.gp import gp_Ax1, gp_Ax3, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array2OfPnt
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from cuspline.kernel.brep import Face
from cuspline.kernel.shells import surface_of_poles

TOLERANCE_MM = 1e-7


def clamped(count, degree, inner=None):
    """Flat knots on 0..1."""
    inner = np.linspace(0, 1, count - degree + 1)[1:-1] if inner is None else inner
    return np.r_[[0.0] * (degree + 1), inner, [1.0] * (degree + 1)]


def bspline(poles, weights=None, knots_u=None, knots_v=None, degree=(3, 3)):
    """Geom_BSplineSurface of (nu, nv, 3) poles."""
    nu, nv = poles.shape[:2]
    weights = np.ones((nu, nv)) if weights is None else weights
    knots = [clamped(n, p) if k is None else k for n, p, k in zip((nu, nv), degree, (knots_u, knots_v))]
    return surface_of_poles(poles, weights, *knots, *degree)


def bezier(poles):
    points = TColgp_Array2OfPnt(1, poles.shape[0], 1, poles.shape[1])
    for i in range(poles.shape[0]):
        for j in range(poles.shape[1]):
            points.SetValue(i + 1, j + 1, gp_Pnt(*poles[i, j]))
    return Geom_BezierSurface(points)


def face_of(surface, bounds=None):
    """brep.Face of a surface, trimmed to (u0, u1, v0, v1) where given."""
    maker = (BRepBuilderAPI_MakeFace(surface, TOLERANCE_MM) if bounds is None
             else BRepBuilderAPI_MakeFace(surface, *bounds, TOLERANCE_MM))
    return Face(maker.Face())


def wavy_poles(seed, shape=(7, 6), size=(40.0, 30.0), height=4.0, jitter=1.0):
    """(nu, nv, 3) a random sheet over a rectangle."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, size[0], shape[0]), np.linspace(0, size[1], shape[1]), indexing="ij")
    return np.stack([x, y, height * rng.normal(size=shape)], axis=-1) + jitter * rng.uniform(-1, 1, (*shape, 3))


def random_weights(seed, shape=(7, 6)):
    return np.random.default_rng(seed + 1000).uniform(0.5, 2.0, shape)


def _curve():
    points = TColgp_Array1OfPnt(1, 4)
    for k, p in enumerate([(10, 0, 0), (16, 0, 6), (7, 0, 12), (12, 0, 20)]):
        points.SetValue(k + 1, gp_Pnt(*p))
    return Geom_BezierCurve(points)


def kinds():
    """{name: brep.Face}: a face of every kind of surface, each with a location of its own, every second reversed."""
    frame = gp_Ax3(gp_Pnt(1, 2, 3), gp_Dir(0.2, -0.4, 0.9))
    surfaces = {
        "plane": (Geom_Plane(frame), (-5, 8, -3, 9)),
        "cylinder": (Geom_CylindricalSurface(frame, 7.0), (0.3, 2.5, 0, 20)),
        "cone": (Geom_ConicalSurface(frame, 0.4, 5.0), (1.0, 4.0, 2, 15)),
        "sphere": (Geom_SphericalSurface(frame, 11.0), (0.2, 3.0, -1.2, 1.3)),
        "torus": (Geom_ToroidalSurface(frame, 16.0, 5.0), (0.5, 4.0, 0.2, 6.0)),
        "revolution": (Geom_SurfaceOfRevolution(_curve(), gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))), (0.3, 2.8, 0.1, 0.9)),
        "extrusion": (Geom_SurfaceOfLinearExtrusion(_curve(), gp_Dir(0.1, 1, 0.2)), (0.05, 0.95, -4, 12)),
        "bezier": (bezier(wavy_poles(3, (5, 4))), (0, 1, 0, 1)),
        "bspline": (bspline(wavy_poles(4), random_weights(4)), (0, 1, 0, 1)),
        "offset": (Geom_OffsetSurface(bezier(wavy_poles(5, (4, 4), height=2.0)), 1.5), (0, 1, 0, 1)),
    }
    made = {}
    for k, (name, (surface, bounds)) in enumerate(surfaces.items()):
        move = gp_Trsf()
        move.SetRotation(gp_Ax1(gp_Pnt(3, -2, 1), gp_Dir(1, 2, 3)), 0.3 + k)
        move.SetTranslationPart(gp_Vec(5 + k, -7, 11))
        shape = face_of(surface, bounds).shape.Moved(TopLoc_Location(move))
        made[name] = Face(TopoDS.Face_s(shape.Reversed() if k % 2 else shape))
    return made


def round_pocket_block(side_radius=4.0, floor_radius=2.5):
    """A block with a pocket: upright corners and floor edges rounded."""
    block = cq.Workplane("XY").box(60, 40, 30).faces(">Z").workplane().rect(40, 24).cutBlind(-12)
    block = block.edges(cq.selectors.BoxSelector((-21, -13, 4), (21, 13, 14.9))).edges("|Z").fillet(side_radius)
    return block.faces(cq.selectors.BoxSelector((-19, -11, 2.9), (19, 11, 3.1))).edges().fillet(floor_radius)


def wedge(angle_deg):
    """Solid along y with an edge on that axis, material from the x axis up to an angle (x to z), 30 mm long arms."""
    turn = np.radians(angle_deg)
    arms = [(30 * np.cos(t), 30 * np.sin(t)) for t in np.linspace(0.0, turn, 2 + int(angle_deg // 60))]
    return cq.Workplane("XZ").polyline([(0.0, 0.0), *arms]).close().extrude(20, both=True)
