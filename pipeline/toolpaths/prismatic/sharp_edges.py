r"""Sharp edges that a pointed cutter may break: where a level face ends at an upright wall, as lines and arcs in plan.

     level face ________
                        \|  <- the edge, material on the right of its way
                         |
                         |  upright wall, the air on the left
"""

import math
from dataclasses import dataclass

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GeomAbs import GeomAbs_Circle, GeomAbs_Line
from OCP.gp import gp_Pnt, gp_Vec

from cuspline.surfaces.inner_corners import edge_pairs, edge_sines, normal_on_edge
from cuspline.toolpaths.prismatic.plan_elements import PlanElement
from cuspline.toolpaths.prismatic.upright_walls import fitted_elements
from cuspline.values import fixed_math as fixed

SHARP_RAD = math.radians(50)    # of the turn; less is what a chamfer leaves, which eases the edge already
FLAT = 1e-6                     # of unit normals that are level or upright
FULL_RAD = 1e-9
SAMPLES = 400                   # of a general curve


@dataclass(frozen=True, eq=False, kw_only=True)
class SharpEdge:
    """One edge in plan, material on its right."""

    elements: tuple[PlanElement, ...]
    z_mm: float

    @property
    def length_mm(self):
        return sum(e.length_mm for e in self.elements)


@dataclass(frozen=True, eq=False, kw_only=True)
class LeftEdge:
    """A sharp edge, or a part of one, that is not broken."""

    place_mm: np.ndarray        # (3,)
    length_mm: float
    why: str


def sharp_edges(faces, indices, tolerance_mm):
    """([SharpEdge], [LeftEdge]) of the sharp outer edges of some faces.

    Args:
        faces: all brep.Face values.   indices: of those wanted.
        tolerance_mm: of arcs along general curves; lines and circles are exact.
    """
    sharp, left = [], []
    for pair in edge_pairs(faces):
        if pair[0][0] == pair[1][0] or not {pair[0][0], pair[1][0]} & set(indices):
            continue
        sines, cosines, points, parameters = edge_sines(faces, pair)
        if float(np.median(fixed.arctan2(-sines, cosines))) < SHARP_RAD:
            continue
        why, wall = _what_keeps(faces, pair, points, parameters)
        if why:
            length = float(np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)).sum()) * len(points) / (len(points) - 1)
            left.append(LeftEdge(place_mm=points[len(points) // 2], length_mm=length, why=why))
        else:
            sharp.append(SharpEdge(elements=tuple(_elements(faces, pair, wall, tolerance_mm)), z_mm=float(points[0, 2])))
    return sharp, left


def _what_keeps(faces, pair, points, parameters):
    """(why an edge is not broken, None) or ("", which of the pair is its wall)."""
    normals = [np.array([normal_on_edge(faces[i], edge, t) for t in parameters.tolist()]) for i, edge in pair]
    if np.ptp(points[:, 2]) > FLAT:
        return "it does not run level", None
    up = [n[:, 2] for n in normals]
    for over, wall in ((0, 1), (1, 0)):
        if (up[over] > 1 - FLAT).all() and (np.abs(up[wall]) < FLAT).all():
            return "", wall
    if any((n < -FLAT).any() for n in up):
        return "one of its faces looks down: give it to a setup from the other side", None
    return "its faces are not a level one and an upright wall", None


def _elements(faces, pair, wall, tolerance_mm):
    """PlanElement values of one edge, the wall's air on their left."""
    index, edge = pair[wall]
    curve = BRepAdaptor_Curve(edge)
    low, high = curve.FirstParameter(), curve.LastParameter()
    middle = (low + high) / 2
    out = normal_on_edge(faces[index], edge, middle)[:2]
    at = lambda t: np.array([(p := curve.Value(t)).X(), p.Y()])
    p, d = gp_Pnt(), gp_Vec()
    curve.D1(middle, p, d)
    is_ahead = d.X() * out[1] - d.Y() * out[0] > 0          # the air on the left of the curve's own way
    if curve.GetType() == GeomAbs_Line:
        ends = (at(low), at(high))[:: 1 if is_ahead else -1]
        return [PlanElement(start=ends[0], end=ends[1])]
    if curve.GetType() == GeomAbs_Circle:
        return _arcs(curve, at, (low, high), is_ahead, out)
    return _fitted(curve, (low, high), is_ahead, tolerance_mm)


def _arcs(curve, at, ends, is_ahead, out):
    location = curve.Circle().Location()
    center = np.array([location.X(), location.Y()])
    low, high = ends
    stops = [low, high] if high - low < 1.5 * math.pi else [low, (low + high) / 2, high]
    places = [at(t) for t in stops]
    if high - low > 2 * math.pi - FULL_RAD:
        places[-1] = places[0]
    is_left = bool(((at((low + high) / 2) - center) * out).sum() < 0)
    places = places if is_ahead else places[::-1]
    return [PlanElement(start=a, end=b, center=center, is_left=is_left) for a, b in zip(places, places[1:])]


def _fitted(curve, ends, is_ahead, tolerance_mm):
    p, d = gp_Pnt(), gp_Vec()
    points, ways = np.empty((SAMPLES, 2)), np.empty((SAMPLES, 2))
    for k, t in enumerate(np.linspace(*ends, SAMPLES).tolist()):
        curve.D1(t, p, d)
        points[k], ways[k] = (p.X(), p.Y()), (d.X(), d.Y())
    if not is_ahead:
        points, ways = points[::-1], -ways[::-1]
    return fitted_elements(points, ways, tolerance_mm)
