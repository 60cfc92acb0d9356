"""Edges of faces as rational polynomial pieces in power form, laid out like patches of degree (n, 0).

A cutter that rests on an edge, on a crease within a face, or on a corner touches one of these; ends of pieces count, so
corners need no kind of their own, except where an edge has shrunk to a point (the apex of a cone): there a piece of
degree 0 stands.
"""

from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepLib import BRepLib
from OCP.Geom import Geom_TrimmedCurve
from OCP.GeomConvert import GeomConvert
from OCP.TopExp import TopExp

from cuspline.kernel.brep import edges_of_faces
from cuspline.surfaces.creases import proud_curves
from cuspline.surfaces.patches import span_powers
from cuspline.values.arrays import frozen


@dataclass(frozen=True, eq=False, kw_only=True)
class EdgeCurves:
    """Polynomial pieces of all edges and proud creases, millimetres, parameter -1..1 along each piece."""

    coefficients: np.ndarray    # (c,) as in PatchSet
    piece: np.ndarray           # (p, 5) int: a face it borders, offset, degree, 0, is rational

    @classmethod
    def of_faces(cls, faces):
        """Pieces of the edges of `brep.Face` values; an edge that several of them share comes once."""
        coefficients, rows, at = [], [], 0
        lines = [(face, curve_spans(edge)) for (face, edge), *_ in edges_of_faces(faces, with_points=True)]
        lines += [(k, _spans(*crease)) for k, face in enumerate(faces) for crease in proud_curves(face)]
        for face, spans in lines:
            for powers in spans:
                rational = np.abs(powers[1:, 3]).max(initial=0.0) > 1e-14 * powers[0, 3]
                rows.append((face, at, len(powers) - 1, 0, int(rational)))
                coefficients.append(powers.ravel() if rational else (powers / powers[0, 3]).ravel())
                at += powers.size
        every = np.concatenate(coefficients) if coefficients else np.zeros(0)
        return cls(coefficients=frozen(every, (None,), "coefficients"),
                   piece=frozen(np.reshape(rows, (-1, 5)), (None, 5), "piece", np.int64))


def curve_spans(edge):
    """[(degree + 1, 4)] homogeneous power coefficients of an edge's knot spans; of a degenerate edge its point."""
    if BRep_Tool.Degenerated_s(edge):
        p = BRep_Tool.Pnt_s(TopExp.FirstVertex_s(edge))
        return [np.array([[p.X(), p.Y(), p.Z(), 1.0]])]
    if not BRep_Tool.IsGeometric_s(edge) or BRep_Tool.Curve_s(edge, 0.0, 1.0) is None:
        BRepLib.BuildCurve3d_s(edge)
    first, last = BRep_Tool.Range_s(edge)
    return _spans(BRep_Tool.Curve_s(edge, first, last), first, last)


def _spans(curve, first, last):
    """`curve_spans` of a stretch of the kernel's curve."""
    spline = GeomConvert.CurveToBSplineCurve_s(Geom_TrimmedCurve(curve, first, last))
    if spline.IsPeriodic():
        spline.SetNotPeriodic()
    count = spline.NbPoles()
    weights = np.array([spline.Weight(i) for i in range(1, count + 1)])
    points = [spline.Pole(i) for i in range(1, count + 1)]
    poles = np.array([(p.X(), p.Y(), p.Z(), 1.0) for p in points]) * weights[:, None]
    knots = np.repeat([spline.Knot(i) for i in range(1, spline.NbKnots() + 1)],
                      [spline.Multiplicity(i) for i in range(1, spline.NbKnots() + 1)])
    _, powers = span_powers(knots, spline.Degree(), count)
    return list(np.einsum("aip,pk->aik", powers, poles / weights.max()))
