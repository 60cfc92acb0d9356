"""Solids built face by face from surfaces whose common edges are known: exact parameters, no projection, no sewing.

Every edge is made once and used by the two faces that meet in it.  Its tolerance is what its space curve and
its curves in the two surfaces' parameters are measured to differ.
"""

from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface, Geom_CylindricalSurface, Geom_Plane
from OCP.Geom2d import Geom2d_BSplineCurve, Geom2d_Line
from OCP.gp import gp_Ax3, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array1OfPnt2d, TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal, TColStd_Array2OfReal
from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shell, TopoDS_Solid, TopoDS_Vertex, TopoDS_Wire

from cuspline.values import fixed_math as fixed
from cuspline.values.amounts import counted
from cuspline.values.errors import DesignError

TIGHTEST_MM = 1e-7          # the kernel's own confusion
LOOKS = 192                 # places at which an edge's curves are compared, about
LOOKS_A_SPAN = 3            # of them between any two knots, at least
MARGIN = 2.0                # on the difference found there


@dataclass(frozen=True, eq=False, kw_only=True)
class Side:
    """One edge as it runs round a face."""

    edge: object                # TopoDS_Edge
    curve: object               # Geom2d curve in the face's parameters, along the edge's own parameter
    is_forward: bool = True


class ShellBuilder:
    """Collects named faces; `solid` closes them."""

    def __init__(self):
        self._builder, self._faces = BRep_Builder(), []
        self._curves, self._loosest, self._uses = {}, {}, {}

    def vertex(self, point_mm):
        vertex = TopoDS_Vertex()
        self._builder.MakeVertex(vertex, gp_Pnt(*map(float, point_mm)), TIGHTEST_MM)
        return vertex

    def edge(self, curve, low, high, start, end):
        """An edge along a Geom curve between two parameters and vertices."""
        edge = TopoDS_Edge()
        self._builder.MakeEdge(edge, curve, TIGHTEST_MM)
        self._builder.Add(edge, start.Oriented(TopAbs_FORWARD))
        self._builder.Add(edge, end.Oriented(TopAbs_REVERSED))
        self._builder.Range(edge, float(low), float(high))
        self._curves[edge.TShape()] = (curve, float(low), float(high), start, end)
        return edge

    def pole(self, vertex):
        """An edge that has shrunk to a vertex; its curve in the face's parameters runs from 0 to 1."""
        edge = TopoDS_Edge()
        self._builder.MakeEdge(edge)
        self._builder.Add(edge, vertex.Oriented(TopAbs_FORWARD))
        self._builder.Add(edge, vertex.Oriented(TopAbs_REVERSED))
        self._builder.Degenerated(edge, True)
        return edge

    def face(self, name, surface, wires, is_reversed=False):
        """Add a face.

        Args:
            name: of the face.
            surface: Geom surface.
            wires: lists of Side, the outer one counter-clockwise in the surface's parameters, inner ones clockwise.
            is_reversed: the outward normal is opposite to Su x Sv.
        """
        here, builder = TopLoc_Location(), self._builder
        face = TopoDS_Face()
        builder.MakeFace(face, surface, here, TIGHTEST_MM)
        for sides in wires:
            for side in sides:
                self._uses.setdefault(side.edge.TShape(), []).append(name)
            wire = TopoDS_Wire()
            builder.MakeWire(wire)
            for side in sides:
                if side.edge.TShape() in self._curves:
                    tolerance = self._tolerance(side, surface)
                    builder.UpdateEdge(side.edge, side.curve, surface, here, tolerance)
                else:
                    builder.UpdateEdge(side.edge, side.curve, surface, here, TIGHTEST_MM)
                    builder.Range(side.edge, surface, here, 0.0, 1.0)
                builder.Add(wire, side.edge.Oriented(TopAbs_FORWARD if side.is_forward else TopAbs_REVERSED))
            wire.Closed(True)
            builder.Add(face, wire)
        self._faces.append((name, TopoDS.Face_s(face.Oriented(TopAbs_REVERSED)) if is_reversed else face))

    def _tolerance(self, side, surface):
        """Tolerance for an edge on a surface; its vertices are kept at least as loose."""
        curve, low, high, start, end = self._curves[side.edge.TShape()]
        apart = 0.0
        for t in _looks(curve, side.curve, low, high).tolist():
            uv = side.curve.Value(t)
            apart = max(apart, curve.Value(t).Distance(surface.Value(uv.X(), uv.Y())))
        key = side.edge.TShape()
        self._loosest[key] = max(self._loosest.get(key, TIGHTEST_MM), MARGIN * apart)
        for vertex in (start, end):
            self._builder.UpdateVertex(vertex, self._loosest[key])
        return self._loosest[key]

    def solid(self):
        """(TopoDS_Solid, [(name, TopoDS_Face), ...]) of all faces added.

        Raises:
            DesignError: an edge that is not shared by exactly two faces.
        """
        for edge in self._curves:
            beside = self._uses.get(edge, [])
            if len(beside) != 2:
                raise DesignError(f"an edge of the solid is on {counted(len(beside), 'face')} ({', '.join(beside) or 'none'}), "
                                  "it must be shared by exactly 2")
        shell, solid = TopoDS_Shell(), TopoDS_Solid()
        self._builder.MakeShell(shell)
        for _, face in self._faces:
            self._builder.Add(shell, face)
        shell.Closed(True)
        self._builder.MakeSolid(solid)
        self._builder.Add(solid, shell)
        return solid, list(self._faces)


# curves and surfaces ---------------------------------------------------------------------------


def spline_curve(spline):
    """Geom curve of a clamped scipy BSpline with (n, 3) coefficients."""
    poles = TColgp_Array1OfPnt(1, len(spline.c))
    for k, p in enumerate(spline.c.tolist(), 1):
        poles.SetValue(k, gp_Pnt(*p[:3]))
    return Geom_BSplineCurve(poles, *_knots(spline.t), spline.k)


def rational_curve(knots, degree, poles):
    """Geom curve of homogeneous poles (n, 4)."""
    points, weights = TColgp_Array1OfPnt(1, len(poles)), TColStd_Array1OfReal(1, len(poles))
    for k, (x, y, z, w) in enumerate(poles.tolist(), 1):
        points.SetValue(k, gp_Pnt(x / w, y / w, z / w))
        weights.SetValue(k, w)
    return Geom_BSplineCurve(points, weights, *_knots(knots), degree)


def plane_curve(spline):
    """Geom2d curve of a clamped scipy BSpline with (n, 2) coefficients."""
    poles = TColgp_Array1OfPnt2d(1, len(spline.c))
    for k, p in enumerate(spline.c.tolist(), 1):
        poles.SetValue(k, gp_Pnt2d(*p))
    return Geom2d_BSplineCurve(poles, *_knots(spline.t), spline.k)


def plane_line(origin, direction):
    """Geom2d line at unit speed."""
    return Geom2d_Line(gp_Pnt2d(*map(float, origin)), gp_Dir2d(*map(float, direction)))


def plane_rational(knots, degree, poles):
    """Geom2d curve of homogeneous poles (n, 3)."""
    points, weights = TColgp_Array1OfPnt2d(1, len(poles)), TColStd_Array1OfReal(1, len(poles))
    for k, (x, y, w) in enumerate(poles.tolist(), 1):
        points.SetValue(k, gp_Pnt2d(x / w, y / w))
        weights.SetValue(k, w)
    return Geom2d_BSplineCurve(points, weights, *_knots(knots), degree)


def spline_surface(nurbs):
    """Geom surface of a NurbsSurface."""
    weights = nurbs.poles[..., 3]
    return surface_of_poles(nurbs.poles[..., :3] / weights[..., None], weights, nurbs.knots_u, nurbs.knots_v,
                            nurbs.degree_u, nurbs.degree_v)


def surface_of_poles(poles_mm, weights, knots_u, knots_v, degree_u, degree_v):
    """Geom B-spline surface of poles (nu, nv, 3), weights (nu, nv) and flat knots."""
    nu, nv = weights.shape
    net, shares = TColgp_Array2OfPnt(1, nu, 1, nv), TColStd_Array2OfReal(1, nu, 1, nv)
    for k, (pole, weight) in enumerate(zip(poles_mm.reshape(-1, 3).tolist(), weights.ravel().tolist())):
        i, j = divmod(k, nv)
        net.SetValue(i + 1, j + 1, gp_Pnt(*pole))
        shares.SetValue(i + 1, j + 1, weight)
    (ku, mu), (kv, mv) = _knots(knots_u), _knots(knots_v)
    if (weights == 1.0).all():
        return Geom_BSplineSurface(net, ku, kv, mu, mv, degree_u, degree_v)
    return Geom_BSplineSurface(net, shares, ku, kv, mu, mv, degree_u, degree_v)


def _knots(flat):
    """The kernel's knots and multiplicities of a flat knot vector."""
    values, counts = np.unique(flat, return_counts=True)
    knots, multiplicities = TColStd_Array1OfReal(1, len(values)), TColStd_Array1OfInteger(1, len(values))
    for k, (value, count) in enumerate(zip(values.tolist(), counts.tolist()), 1):
        knots.SetValue(k, value)
        multiplicities.SetValue(k, count)
    return knots, multiplicities


def plane_across_x(x_mm):
    """Geom plane x = constant; parameters y, z; normal +X."""
    return Geom_Plane(gp_Ax3(gp_Pnt(float(x_mm), 0, 0), gp_Dir(1, 0, 0), gp_Dir(0, 1, 0)))


def cylinder_round_x(radius_mm, start_rad):
    """Geom cylinder; parameters polar angle from `start_rad`, x."""
    return Geom_CylindricalSurface(gp_Ax3(gp_Pnt(0, 0, 0), gp_Dir(1, 0, 0), _radial(start_rad)), float(radius_mm))


def _radial(angle_rad):
    return gp_Dir(0, float(fixed.cos(angle_rad)), float(fixed.sin(angle_rad)))


def _looks(curve, flat, low, high):
    """Parameters at which a space curve and its curve in a surface are compared: between all knots of both."""
    knots = [low, high]
    for spline in (curve, flat):
        if isinstance(spline, (Geom_BSplineCurve, Geom2d_BSplineCurve)):
            knots += [spline.Knot(k) for k in range(1, spline.NbKnots() + 1)]
    knots = np.unique(np.clip(knots, low, high))
    spans = max(int(np.ceil(LOOKS / (len(knots) - 1))), LOOKS_A_SPAN)
    share = (np.arange(spans) + 0.5) / spans
    return np.concatenate([knots, (knots[:-1, None] + np.diff(knots)[:, None] * share).ravel()])
