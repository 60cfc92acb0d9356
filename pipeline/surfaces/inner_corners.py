"""Where no cutter of revolution cleans to the bottom: sharp edges in a hollow, and the fillets that ease others.

A cutter of revolution has a radius of its own: it leaves metal along every sharp inner edge, whatever its size.  A
fillet is cleaned by a ball no larger than its radius.
"""

from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_REVERSED

from cuspline.kernel.brep import edges_of_faces
from cuspline.surfaces.creases import creases_of
from cuspline.values import fixed_math as fixed

CONCAVE_SINE = 1e-3         # edges flatter than this angle count as smooth
ALONG_EDGE = 15             # places of an edge looked at, its middle among them
SHARPER_RAD = 1e-7          # the middle speaks for the edge unless another place is sharper by this
FILLET_GRID = 12
EVEN = 0.01                 # share within which a fillet's radius is the same all over


@dataclass(frozen=True, kw_only=True)
class InnerEdge:
    """Two faces that meet in a hollow without a fillet: no cutter of revolution cleans it."""

    faces: tuple[int, int]      # the same twice: a crease within one face
    place_mm: tuple[float, float, float]        # where it is sharpest
    opening_deg: float          # angle of air between the faces there, below 180
    length_mm: float            # of the part of the edge that is hollow


@dataclass(frozen=True, kw_only=True)
class Fillet:
    """A face rounded with one hollow radius that joins its neighbours smoothly."""

    face: int
    radius_mm: float            # the smallest over the face; within EVEN of the largest
    place_mm: tuple[float, float, float]


def inner_edges(faces, indices):
    """Concave edges that lie between faces of which at least one is to be cut; creases within a face included."""
    found = []
    for pair in edge_pairs(faces):
        if pair[0][0] in indices or pair[1][0] in indices:
            edge = _inner_edge(faces, pair)
            if edge is not None:
                found.append(edge)
    for index in sorted(set(indices)):
        found += _hollow_creases(faces[index], index)
    return found


def fillets(faces, indices):
    """Fillets among the given faces."""
    smooth = {}
    for pair in edge_pairs(faces):
        (i, _), (j, _) = pair
        if i != j and np.abs(edge_sines(faces, pair)[0]).max() < CONCAVE_SINE:
            for k in (i, j):
                smooth[k] = smooth.get(k, 0) + 1
    candidates = [i for i in indices if smooth.get(i, 0) >= 2 and faces[i].kind != "plane"]
    return [f for f in (_fillet(faces[i], i) for i in candidates) if f is not None]


def _fillet(face, index):
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face.nurbs_face)
    step = (np.arange(FILLET_GRID) + 0.5) / FILLET_GRID
    u, v = (a.ravel() for a in np.meshgrid(u0 + step * (u1 - u0), v0 + step * (v1 - v0), indexing="ij"))
    inside = face.is_inside(u, v)
    shape = face.shape_at(u[inside], v[inside])
    hollow = -shape.curvature_low_per_mm[shape.is_regular]
    if not len(hollow) or hollow.min() <= 0 or hollow.max() > (1 + EVEN) * hollow.min():
        return None
    k = int(hollow.argmax())
    return Fillet(face=index, radius_mm=float(1 / hollow[k]),
                  place_mm=tuple(float(x) for x in shape.point_mm[shape.is_regular][k]))


def edge_pairs(faces):
    """[((face, edge), (face, edge))] of all edges with a face on either side."""
    return [tuple(uses) for uses in edges_of_faces(faces) if len(uses) == 2]


def edge_sines(faces, pair):
    """Along an edge: sine (k,) and cosine (k,) of the angle, positive in a hollow, points (k, 3), parameters (k,)."""
    (i, first), (j, second) = pair
    curve = BRepAdaptor_Curve(first)
    low, high = curve.FirstParameter(), curve.LastParameter()
    parameters = low + (np.arange(ALONG_EDGE) + 0.5) / ALONG_EDGE * (high - low)
    turn = -1 if first.Orientation() == TopAbs_REVERSED else 1
    sines, cosines, points = np.empty(ALONG_EDGE), np.empty(ALONG_EDGE), np.empty((ALONG_EDGE, 3))
    point, tangent = gp_Pnt(), gp_Vec()
    for k, t in enumerate(parameters.tolist()):
        n1, n2 = (normal_on_edge(faces[index], edge, t) for index, edge in pair)
        curve.D1(t, point, tangent)
        along = np.array([tangent.X(), tangent.Y(), tangent.Z()])
        along *= turn / max(fixed.length(along), 1e-300)
        # the face lies to the left of its own edges: n1 x along points into it
        sines[k], cosines[k] = fixed.matmul(np.cross(n1, along), n2), fixed.matmul(n1, n2)
        points[k] = point.X(), point.Y(), point.Z()
    return sines, cosines, points, parameters


def _inner_edge(faces, pair):
    sines, cosines, points, parameters = edge_sines(faces, pair)
    is_hollow = sines >= CONCAVE_SINE
    if not is_hollow.any():
        return None
    angle = np.where(is_hollow, fixed.arctan2(sines, cosines), -np.inf)
    k, middle = int(angle.argmax()), ALONG_EDGE // 2
    if angle[middle] > angle[k] - SHARPER_RAD:
        k = middle
    curve = BRepAdaptor_Curve(pair[0][1])
    half = (parameters[1] - parameters[0]) / 2
    length = sum(GCPnts_AbscissaPoint.Length_s(curve, t - half, t + half) for t in parameters[is_hollow].tolist())
    return InnerEdge(faces=(pair[0][0], pair[1][0]), place_mm=tuple(float(x) for x in points[k]),
                     opening_deg=float(180.0 - np.degrees(angle[k])), length_mm=float(length))


def normal_on_edge(face, edge, parameter):
    """Outward normal of the face at a parameter of one of its edges."""
    pcurve = BRep_Tool.CurveOnSurface_s(edge, face.shape, 0.0, 0.0)
    uv = pcurve.Value(parameter)
    p, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    face.adaptor.D1(uv.X(), uv.Y(), p, du, dv)
    n = np.cross((du.X(), du.Y(), du.Z()), (dv.X(), dv.Y(), dv.Z()))
    return n / max(fixed.length(n), 1e-30) * (-1 if face.is_reversed else 1)


def _hollow_creases(face, index):
    """Hollow creases along knots at which a face's surface is only continuous."""
    found = []
    for crease in creases_of(face):
        is_hollow = crease.is_inside & (crease.turn_rad > 0) & (fixed.sin(crease.turn_rad) >= CONCAVE_SINE)
        if is_hollow.any():
            k = int(np.where(is_hollow, crease.turn_rad, -np.inf).argmax())
            found.append(InnerEdge(faces=(index, index), place_mm=tuple(float(x) for x in crease.point_mm[k]),
                                   opening_deg=float(180.0 - np.degrees(crease.turn_rad[k])),
                                   length_mm=float(crease.step_mm[is_hollow].sum())))
    return found
