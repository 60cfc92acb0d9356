"""Walls that stand along Z, as lines and arcs in plan with the heights between which they stand."""

import math
from dataclasses import dataclass, replace

import numpy as np
from OCP.gp import gp_Pnt, gp_Vec

from cuspline.kernel.brep import bounding_box_mm, edge_points, edges_of_faces
from cuspline.toolpaths.prismatic.plan_elements import SAME_MM, PlanElement
from cuspline.toolpaths.sections.arcfit import fit_arcs
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import PlanError

UPRIGHT = 1e-6              # of a unit normal's z, and of a ruling's way in plan
SAMPLES = 800               # of a general curve, for its arcs
LARGEST_RADIUS_MM = 1e4     # of them; flatter ones are lines
EDGE_PLACES = 17            # along each edge of a plane


@dataclass(frozen=True, eq=False, kw_only=True)
class UprightWall:
    """One element in plan, material on its right, and what stands over it."""

    element: PlanElement
    low_mm: float
    high_mm: float
    face: int


def upright_walls(faces, indices, tolerance_mm):
    """UprightWall values of some faces.

    Args:
        faces: all brep.Face values.   indices: of those wanted.
        tolerance_mm: of arcs along general curves; planes and cylinders are exact.
    Raises:
        PlanError: a face does not stand along Z.
    """
    walls = []
    for i in indices:
        low, high = (float(corner[2]) for corner in bounding_box_mm(faces[i].shape))
        for element in _elements(faces[i], tolerance_mm):
            walls.append(UprightWall(element=element, low_mm=low, high_mm=high, face=i))
    return _merged(walls)


def _merged(walls):
    """Faces over one another, one curve in plan, as one wall."""
    out = []
    for wall in walls:
        k = next((k for k, w in enumerate(out) if _is_same(w.element, wall.element)), None)
        if k is None:
            out.append(wall)
        else:
            out[k] = replace(out[k], low_mm=min(out[k].low_mm, wall.low_mm), high_mm=max(out[k].high_mm, wall.high_mm))
    return out


def _is_same(a, b):
    middle = lambda e: e.at(e.length_mm / 2)
    return all(fixed.length(p - q) < SAME_MM for p, q in ((a.start, b.start), (a.end, b.end), (middle(a), middle(b))))


def _elements(face, tolerance_mm):
    """PlanElement values of one face."""
    if abs(float(face.middle.normal[0, 2])) < UPRIGHT:
        if face.kind == "plane":
            return [_line(face)]
        if face.kind == "cylinder" and abs(abs(face.adaptor.Cylinder().Axis().Direction().Z()) - 1.0) < UPRIGHT ** 2:
            return _arcs(face)
        ruled = _ruling(face)
        if ruled is not None:
            return _fitted(face, ruled, tolerance_mm)
    place = ", ".join(f"{v:.3f}" for v in face.middle.point_mm[0])
    raise PlanError(f"the {face.kind} at ({place}) does not stand along the setup's Z: contours are for upright walls; give the "
                    "face to another operation")


def _line(face):
    """The plan of a plane's whole border."""
    normal = face.middle.normal[0, :2]
    way = np.array([normal[1], -normal[0]]) / fixed.length(normal)
    places = np.vstack([edge_points(edge, EDGE_PLACES)[0] for (_, edge), *_ in edges_of_faces([face])])[:, :2]
    along = places[:, 0] * way[0] + places[:, 1] * way[1]
    return PlanElement(start=places[along.argmin()], end=places[along.argmax()])


def _arcs(face):
    location = face.adaptor.Cylinder().Axis().Location()
    u0, u1, v0, v1 = face.uv_bounds
    return arcs_of_turn(face, np.array([location.X(), location.Y()]), (u0, u1), (v0 + v1) / 2)


def arcs_of_turn(face, center, turn, v):
    """[one arc, or the two halves of a full turn] of a face of revolution about Z.

    Args:
        face: brep.Face.   center: (2,).   turn: (first, last) parameter u.   v: at which it is cut.
    """
    u0, u1 = turn
    at = lambda u: _plan(face.adaptor.Value(u, v))
    middle = face.middle
    is_hollow = float(((middle.point_mm[0, :2] - center) * middle.normal[0, :2]).sum()) < 0
    stops = [u0, u1] if u1 - u0 < 1.5 * math.pi else [u0, (u0 + u1) / 2, u1]
    places = [at(u) for u in stops]
    turns_left = _cross(places[0] - center, at(stops[0] + 0.01) - center) > 0
    if turns_left != is_hollow:
        places = places[::-1]
    if u1 - u0 > 2 * math.pi - 1e-9:
        places[-1] = places[0]
    return [PlanElement(start=a, end=b, center=center, is_left=is_hollow) for a, b in zip(places[:-1], places[1:])]


def _plan(p):
    return np.array([p.X(), p.Y()])


def _cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def _ruling(face):
    """0 or 1: the parameter along which the surface runs in plan, the other straight up; None: it is no such surface."""
    u0, u1, v0, v1 = face.uv_bounds
    p, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    up = np.zeros(2)
    for s in np.linspace(0.05, 0.95, 7):
        for t in np.linspace(0.05, 0.95, 7):
            face.adaptor.D1(u0 + s * (u1 - u0), v0 + t * (v1 - v0), p, du, dv)
            for k, way in enumerate((du, dv)):
                up[k] = max(up[k], math.hypot(way.X(), way.Y()) / max(way.Magnitude(), 1e-12))
    return 0 if up[1] < UPRIGHT else 1 if up[0] < UPRIGHT else None


def _fitted(face, ruled, tolerance_mm):
    """Arcs along the plan of a general upright face, tangent to one another."""
    u0, u1, v0, v1 = face.uv_bounds
    p, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    points, ways = np.empty((SAMPLES, 2)), np.empty((SAMPLES, 2))
    for k, share in enumerate(np.linspace(0.0, 1.0, SAMPLES).tolist()):
        u, v = (u0 + share * (u1 - u0), (v0 + v1) / 2) if ruled == 0 else ((u0 + u1) / 2, v0 + share * (v1 - v0))
        face.adaptor.D1(u, v, p, du, dv)
        way = du if ruled == 0 else dv
        points[k], ways[k] = (p.X(), p.Y()), (way.X(), way.Y())
    middle = face.middle
    nearest = int(((points - middle.point_mm[0, :2]) ** 2).sum(axis=1).argmin())
    if _cross(ways[nearest], middle.normal[0, :2]) < 0:         # the air is on the left
        points, ways = points[::-1], -ways[::-1]
    return fitted_elements(points, ways, tolerance_mm)


def fitted_elements(points, ways, tolerance_mm):
    """[PlanElement] tangent to one another along places (n, 2) of a curve and its ways there (n, 2), any length."""
    headings = np.unwrap(fixed.arctan2(ways[:, 1], ways[:, 0]))
    found = fit_arcs(points, headings, tolerance_mm, LARGEST_RADIUS_MM)
    return [PlanElement(start=e.start, end=e.end, center=e.center, is_left=e.is_left) for e in found]
