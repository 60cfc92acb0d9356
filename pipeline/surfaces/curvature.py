"""Where the part is most hollow: smallest concave radius on the exact faces, and inner edges.

A grid finds candidates, pattern search on the exact surface brings them home.
"""

from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

from cuspline.arrays import frozen
from cuspline.surfaces.nurbs import local_shape

GRID = 48
REFINED = 6                 # best grid points taken further
CONCAVE_SINE = 1e-3         # edges flatter than this angle count as smooth


@dataclass(frozen=True, eq=False, kw_only=True)
class FaceSamples:
    """Points of the faces to cut with their shape, one row each; for planning, not for the verdict."""

    point_mm: np.ndarray            # (n, 3)
    normal: np.ndarray              # (n, 3)
    hollow_per_mm: np.ndarray       # (n,) most hollow principal curvature (negative in a hollow)
    across_per_mm: np.ndarray       # (n,) normal curvature along the step direction
    area_mm2: np.ndarray            # (n,) share of the face's area
    face: np.ndarray                # (n,) index


def sample_faces(faces, indices, across_axis):
    """FaceSamples over a parameter grid of each face, inside its trim."""
    rows = []
    for index in indices:
        face = faces[index]
        u, v, cell = _inside_grid(face)
        derivatives = face.nurbs.derivatives(u, v)
        shape = local_shape(derivatives, face.is_reversed)
        weight = np.linalg.norm(np.cross(derivatives[:, 1], derivatives[:, 2]), axis=1) * cell
        weight *= face.area_mm2 / max(weight.sum(), 1e-30)
        across = _normal_curvature(derivatives, shape.normal, across_axis)
        rows.append((shape.point_mm, shape.normal, shape.curvature_low_per_mm, across, weight,
                     np.full(len(u), index)))
    joined = [np.concatenate(column) for column in zip(*rows)]
    n = len(joined[0])
    return FaceSamples(point_mm=frozen(joined[0], (n, 3), "point_mm"), normal=frozen(joined[1], (n, 3), "normal"),
                       hollow_per_mm=frozen(joined[2], (n,), "hollow_per_mm"),
                       across_per_mm=frozen(joined[3], (n,), "across_per_mm"),
                       area_mm2=frozen(joined[4], (n,), "area_mm2"), face=frozen(joined[5], (n,), "face", int))


def _inside_grid(face):
    """Parameters at the middles of a grid over the face's trim, and the size of a cell."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face.nurbs_face)
    step = (np.arange(GRID) + 0.5) / GRID
    uu, vv = np.meshgrid(u0 + step * (u1 - u0), v0 + step * (v1 - v0), indexing="ij")
    u, v = uu.ravel(), vv.ravel()
    inside = face.is_inside(u, v)
    if not inside.any():
        u, v, inside = np.array([(u0 + u1) / 2]), np.array([(v0 + v1) / 2]), np.array([True])
    return u[inside], v[inside], (u1 - u0) * (v1 - v0) / GRID ** 2


def _normal_curvature(derivatives, normal, axis):
    """(n,) normal curvature in the tangent direction nearest to a coordinate axis; ridge positive."""
    s, su, sv, suu, suv, svv = np.moveaxis(derivatives, 1, 0)
    wanted = -normal * normal[:, [axis]]
    wanted[:, axis] += 1.0
    dot = lambda a, b: np.einsum("ij,ij->i", a, b)
    E, F, G, p, q = dot(su, su), dot(su, sv), dot(sv, sv), dot(su, wanted), dot(sv, wanted)
    det = np.maximum(E * G - F * F, 1e-30)
    a, b = (G * p - F * q) / det, (E * q - F * p) / det
    second = a * a * dot(suu, normal) + 2 * a * b * dot(suv, normal) + b * b * dot(svv, normal)
    return -second / np.maximum(dot(wanted, wanted), 1e-12)


@dataclass(frozen=True, kw_only=True)
class Hollow:
    """The tightest hollow of some faces."""

    radius_mm: float                        # inf where nothing is hollow
    place_mm: tuple[float, float, float]
    face: int


def tightest_hollow(faces, indices):
    """Smallest concave principal radius over the given faces and where it is."""
    best = Hollow(radius_mm=np.inf, place_mm=tuple(faces[indices[0]].middle.point_mm[0]), face=indices[0])
    for index in indices:
        face = faces[index]
        if face.kind == "plane":
            continue
        u, v, _ = _inside_grid(face)
        low = face.shape_at(u, v).curvature_low_per_mm
        for k in np.argsort(low)[:REFINED]:
            curvature, point = _descend(face, u[k], v[k])
            if curvature < -1e-9 and -1.0 / curvature < best.radius_mm:
                best = Hollow(radius_mm=float(-1.0 / curvature), place_mm=tuple(float(x) for x in point), face=index)
    return best


def _descend(face, u, v):
    """Pattern search for the most hollow point near (u, v), inside the trim; returns curvature, point."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face.nurbs_face)
    du, dv = (u1 - u0) / GRID, (v1 - v0) / GRID
    here = face.shape_at(u, v)
    best, point = here.curvature_low_per_mm[0], here.point_mm[0]
    while du > (u1 - u0) * 1e-6:
        uu = np.clip(u + du * np.array([-1, 1, 0, 0, -1, 1, -1, 1]), u0, u1)
        vv = np.clip(v + dv * np.array([0, 0, -1, 1, -1, -1, 1, 1]), v0, v1)
        shape = face.shape_at(uu, vv)
        values = np.where(face.is_inside(uu, vv), shape.curvature_low_per_mm, np.inf)
        k = int(values.argmin())
        if values[k] < best - 1e-15:
            u, v, best, point = uu[k], vv[k], values[k], shape.point_mm[k]
        else:
            du, dv = du / 2, dv / 2
    return best, point


@dataclass(frozen=True, kw_only=True)
class InnerEdge:
    """Two faces that meet in a hollow without a fillet: no cutter of revolution cleans it."""

    faces: tuple[int, int]
    place_mm: tuple[float, float, float]
    opening_deg: float          # angle of air between the faces, below 180
    length_mm: float


def inner_edges(faces, indices):
    """Concave edges that lie between faces of which at least one is to be cut."""
    owners = {}
    for index, face in enumerate(faces):
        explorer = TopExp_Explorer(face.shape, TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge_s(explorer.Current())
            owners.setdefault(edge.TShape(), []).append((index, edge))
            explorer.Next()
    found = []
    for pair in owners.values():
        if len(pair) == 2 and pair[0][0] != pair[1][0] and (pair[0][0] in indices or pair[1][0] in indices):
            edge = _inner_edge(faces, pair)
            if edge is not None:
                found.append(edge)
    return found


def _inner_edge(faces, pair):
    (i, first), (j, second) = pair
    curve = BRepAdaptor_Curve(first)
    middle = (curve.FirstParameter() + curve.LastParameter()) / 2
    n1, n2 = (_normal_on(faces[k], e, middle) for k, e in pair)
    point, tangent = gp_Pnt(), gp_Vec()
    curve.D1(middle, point, tangent)
    t = np.array([tangent.X(), tangent.Y(), tangent.Z()])
    t *= (-1 if first.Orientation() == TopAbs_REVERSED else 1) / np.linalg.norm(t)
    into_first = np.cross(n1, t)            # the face lies to the left of its own edges
    sine = float(into_first @ n2)
    if sine < CONCAVE_SINE:
        return None
    return InnerEdge(faces=(i, j), place_mm=(point.X(), point.Y(), point.Z()),
                     opening_deg=float(180.0 - np.degrees(np.arctan2(sine, n1 @ n2))),
                     length_mm=float(GCPnts_AbscissaPoint.Length_s(curve)))


def _normal_on(face, edge, parameter):
    """Outward normal of the face at a parameter of one of its edges."""
    pcurve = BRep_Tool.CurveOnSurface_s(edge, face.shape, 0.0, 0.0)
    uv = pcurve.Value(parameter)
    p, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    face.adaptor.D1(uv.X(), uv.Y(), p, du, dv)
    n = np.cross((du.X(), du.Y(), du.Z()), (dv.X(), dv.Y(), dv.Z()))
    return n / max(np.linalg.norm(n), 1e-30) * (-1 if face.is_reversed else 1)
