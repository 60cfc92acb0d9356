"""The free-form surface of Lopes de Andrade et al., exact: one polynomial Bézier patch of degree 3 × 2.

    v = 1   c3 ───────────── cubic through four points
    v = ½   c2 ─────────────
    v = 0   c1 ─────────────
            u = 0        u = 1

Points and source: data/freeform_lopes_points.csv.  Chord-length parameters along each curve, quadratic across.
"""

import csv
from pathlib import Path

import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.Geom import Geom_BezierSurface
from OCP.gp import gp_Pnt
from OCP.TColgp import TColgp_Array2OfPnt

from cuspline.values import fixed_math as fixed

POINTS = Path(__file__).parent / "data" / "freeform_lopes_points.csv"
EDGE_TOLERANCE_MM = 1e-7
# powers of u against the cubic Bernstein polynomials: pole k holds C(k, j) / C(3, j) of the coefficient of u^j
POWER_TO_BEZIER = np.array([[1, 0, 0, 0], [1, 1 / 3, 0, 0], [1, 2 / 3, 1 / 3, 0], [1, 1, 1, 1]])


def curve_points_mm():
    """(3, 4, 3) the points of the three curves."""
    with POINTS.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return np.array([[float(r[k]) for k in ("x_mm", "y_mm", "z_mm")] for r in rows]).reshape(3, 4, 3)


def poles_mm():
    """(4, 3, 3) Bézier poles, u first."""
    first, middle, last = (fixed.matmul(POWER_TO_BEZIER, _cubic_through(points)) for points in curve_points_mm())
    return np.stack([first, 2 * middle - (first + last) / 2, last], axis=1)


def _cubic_through(points):
    """(4, 3) coefficients of 1, u, u², u³ through four points at their chord-length parameters."""
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    u = np.concatenate([[0.0], np.cumsum(chords) / chords.sum()])
    return fixed.solve(np.stack([np.ones_like(u), u, u * u, u * u * u], axis=1), points)


def freeform_face():
    """The patch as a TopoDS_Face, u and v in 0..1; its normal Su × Sv points up."""
    poles = TColgp_Array2OfPnt(1, 4, 1, 3)
    for (i, j), _ in np.ndenumerate(poles_mm()[..., 0]):
        poles.SetValue(i + 1, j + 1, gp_Pnt(*poles_mm()[i, j]))
    return BRepBuilderAPI_MakeFace(Geom_BezierSurface(poles), EDGE_TOLERANCE_MM).Face()
