"""Faces turned from a closed curve that lost their pole on the way through a STEP file, made whole.

A dome turned from an arc whose centre is off the axis ends in a pole.  The file keeps its seam and its rim; the kernel's
reader drops the seam and leaves the rim alone round nothing.  Seam and pole are put back on the side of the rim on which
the face lies, up to where the curve first meets the axis:

         ___pole___
        /    |seam \\
       (_____|______)  rim, the edge that is left
"""

import math

from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve2d
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepTools import BRepTools_ReShape
from OCP.Geom import Geom_Line, Geom_SurfaceOfRevolution, Geom_TrimmedCurve
from OCP.GeomAPI import GeomAPI_ExtremaCurveCurve
from OCP.gp import gp_Vec2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_SOLID
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from cuspline.kernel.topology import explore

POLE_MM = 1e-6              # so near to the axis a curve meets it
SAME = 1e-9                 # parameters


def with_poles(solid):
    """The solid with its poles put back; itself where none is missing."""
    swap, is_whole = BRepTools_ReShape(), True
    for face in map(TopoDS.Face_s, explore(solid, TopAbs_FACE)):
        whole = _whole(face)
        if whole is not None:
            swap.Replace(face, whole)
            is_whole = False
    return solid if is_whole else TopoDS.Solid_s(explore(swap.Apply(solid), TopAbs_SOLID)[0])


def _whole(face):
    """A face round whose pole only the rim is left, with seam and pole; None for others."""
    surface, edges = BRep_Tool.Surface_s(face), explore(face.Oriented(TopAbs_FORWARD), TopAbs_EDGE)
    if not isinstance(surface, Geom_SurfaceOfRevolution) or len(edges) != 1 or not surface.BasisCurve().IsPeriodic():
        return None
    rim = TopoDS.Edge_s(edges[0])
    along = BRepAdaptor_Curve2d(rim, face)
    first, last = along.Value(along.FirstParameter()), along.Value(along.LastParameter())
    if abs(last.Y() - first.Y()) > SAME or abs(abs(last.X() - first.X()) - 2 * math.pi) > SAME:
        return None
    pole = _next_pole(surface, first.Y(), (last.X() > first.X()) == (rim.Orientation() == TopAbs_FORWARD))
    if pole is None:
        return None
    start = min(first.X(), last.X())
    turned = Geom_SurfaceOfRevolution(Geom_TrimmedCurve(surface.BasisCurve(), *sorted((first.Y(), pole))), surface.Axis())
    low, high = turned.BasisCurve().FirstParameter(), turned.BasisCurve().LastParameter()
    made = BRepBuilderAPI_MakeFace(turned, start, start + 2 * math.pi, low, high, POLE_MM).Face()
    level = low if pole > first.Y() else high
    flat = BRep_Tool.CurveOnSurface_s(rim, face, 0.0, 0.0).Translated(gp_Vec2d(0.0, level - first.Y()))
    BRep_Builder().UpdateEdge(rim, flat, turned, TopLoc_Location(), BRep_Tool.Tolerance_s(rim))
    swap = BRepTools_ReShape()
    for edge in map(TopoDS.Edge_s, explore(made, TopAbs_EDGE)):
        around = BRepAdaptor_Curve2d(edge, made)
        levels = [around.Value(t).Y() for t in (around.FirstParameter(), around.LastParameter())]
        if not BRep_Tool.Degenerated_s(edge) and max(abs(y - level) for y in levels) < SAME:
            swap.Replace(edge, rim.Oriented(edge.Orientation()))
            swap.Replace(TopExp.FirstVertex_s(edge), TopExp.FirstVertex_s(rim))
    return TopoDS.Face_s(swap.Apply(made).Oriented(face.Orientation()))


def _next_pole(surface, rim, is_up):
    """Parameter of the place where the turned curve meets the axis first, from the rim on one way; None: nowhere."""
    curve = surface.BasisCurve()
    meets = GeomAPI_ExtremaCurveCurve(curve, Geom_Line(surface.Axis()))
    poles = [meets.Parameters(k)[0] for k in range(1, meets.NbExtrema() + 1) if meets.Distance(k) < POLE_MM]
    period = curve.Period()
    ways = [((p - rim) if is_up else (rim - p)) % period for p in poles]
    ways = [w for w in ways if SAME < w < period - SAME]
    if not ways:
        return None
    return rim + (min(ways) if is_up else -min(ways))
