"""Sample points on the exact B-rep faces: dense enough for cusps, with normal and area weight.

The triangles of a face are bisected along their longest sides until none is longer than the
spacing; one point falls in each, jittered by a fixed seed so that the pattern does not beat
with the pass spacing, and is then evaluated on the exact surface.  A second set follows the
borders 1e-4 mm inside.
"""

import math
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepGProp import BRepGProp
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.gp import gp_Pnt2d, gp_Vec2d
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_IN, TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

from cuspline.kernel.tessellation import free_parameters, mesh_faces, surface_points, surface_tangents
from cuspline.values.arrays import frozen
from cuspline.values.errors import DesignError

INSIDE_MM = 1e-4          # border points lie this far inside
MESH_MM = 0.02            # deflection of the triangles that are bisected; points themselves are exact
JITTER = 0.6              # share of a triangle over which its point may fall
SIDE = 1.0                # longest side of a bisected triangle, in spacings
SEED = 20260101
TRIM = 1e-9               # tolerance of the trim test in the face's parameters


@dataclass(frozen=True, eq=False, kw_only=True)
class Samples:
    """Points on the design, part coordinates."""

    points_mm: np.ndarray     # (n, 3) exact
    normals: np.ndarray       # (n, 3) unit, out of the material
    weight_mm2: np.ndarray    # (n,) area each stands for; 0 at border points
    face: np.ndarray          # (n,) index into the given faces
    is_border: np.ndarray     # (n,) bool

    def __post_init__(self):
        n = len(self.points_mm)
        for name, shape, dtype in (("points_mm", (n, 3), float), ("normals", (n, 3), float),
                                   ("weight_mm2", (n,), float), ("face", (n,), np.int64), ("is_border", (n,), bool)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))

    def __len__(self):
        return len(self.points_mm)

    def first(self, count):
        """The first ones."""
        return Samples(**{name: getattr(self, name)[:count]
                          for name in ("points_mm", "normals", "weight_mm2", "face", "is_border")})

    @classmethod
    def joined(cls, parts):
        """Several one after the other."""
        names = ("points_mm", "normals", "weight_mm2", "face", "is_border")
        return cls(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})


def sample_faces(faces, spacing_mm):
    """Samples of B-rep faces; from any place on a face the nearest one is closer than `spacing_mm`.

    Args:
        faces: TopoDS_Face values of one solid, or values with such a `.shape`.
        spacing_mm: largest distance, scalar > 0.
    Returns:
        Samples; the weights of a face add up to its area.
    Raises:
        DesignError: a face without area.
    """
    parts = [_sample_face(getattr(face, "shape", face), k, spacing_mm) for k, face in enumerate(faces)]
    return Samples(**{name: np.concatenate([p[name] for p in parts])
                      for name in ("points_mm", "normals", "weight_mm2", "face", "is_border")})


def face_area_mm2(face):
    """Exact area by adaptive integration."""
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties, 1e-6)
    return properties.Mass()


def _sample_face(original, number, spacing_mm):
    face = TopoDS.Face_s(BRepBuilderAPI_Copy(original, True, False).Shape())
    area = face_area_mm2(face)
    if not area > 0:
        raise DesignError(f"face {number} has no area: heal the solid", rows=[number])
    part = mesh_faces(face, MESH_MM)[0]
    uv, share, at_border = _bisected(part, SIDE * spacing_mm, np.random.default_rng(SEED + number))
    points, normals, stretch, good = _exact(face, uv)
    classifier = BRepTopAdaptor_FClass2d(face, TRIM)
    good[at_border & good] = _is_inside(classifier, uv[at_border & good])
    border_uv = _border_parameters(face, spacing_mm)
    border_points, border_normals, _, border_good = _exact(face, border_uv)
    border_good[border_good] = _is_inside(classifier, border_uv[border_good])
    weight = (share * stretch)[good]
    rim = border_points[border_good]
    rim_weight = np.zeros(len(rim)) if len(weight) else np.full(len(rim), 1.0)
    total = weight.sum() + rim_weight.sum()
    if not total > 0:
        raise DesignError(f"face {number} ({area:.3g} mm2) cannot be sampled: heal the solid", rows=[number])
    count = len(weight) + len(rim)
    return {"points_mm": np.vstack([points[good], rim]), "normals": np.vstack([normals[good], border_normals[border_good]]),
            "weight_mm2": np.concatenate([weight, rim_weight]) * (area / total), "face": np.full(count, number),
            "is_border": np.arange(count) >= len(weight)}


def _exact(face, uv):
    """Points, outward normals, |Su x Sv| and whether the surface is regular there."""
    points, du, dv = surface_tangents(face, uv)
    normal = np.cross(du, dv)
    length = np.linalg.norm(normal, axis=1)
    good = length > 1e-12
    sign = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    return points, sign * normal / np.where(good, length, 1.0)[:, None], length, good


def _bisected(part, longest_mm, rng):
    """One jittered parameter point in each of the bisected triangles.

    Returns:
        uv (n, 2); area in parameters (n,); whether the triangle has a corner on the mesh's border (n,).
    """
    uv, xyz, rim, border = _in_parameter_plane(part)
    done = []
    while len(uv):
        sides = np.linalg.norm(xyz - np.roll(xyz, -1, axis=1), axis=2)       # corner k to k + 1
        side = sides.argmax(axis=1)
        is_long = sides.max(axis=1) > longest_mm
        done.append((uv[~is_long], rim[~is_long]))
        uv, xyz, rim, border = _halved(part.face, *(a[is_long] for a in (uv, xyz, rim, border, side)))
    uv, rim = (np.concatenate(column) for column in zip(*done))
    e, f = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = np.abs(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]) / 2
    b = rng.random((len(uv), 2))
    b = np.where((b.sum(axis=1) > 1)[:, None], 1 - b, b)
    b = 1 / 3 + JITTER * (b - 1 / 3)
    return uv[:, 0] + b[:, :1] * e + b[:, 1:] * f, area, rim.any(axis=1)


def _in_parameter_plane(part):
    """Corners of all triangles: parameters (m, 3, 2), points (m, 3, 3), whether each is on the mesh's border (m, 3), and so its
    side to the next one (m, 3).

    Where the surface shrinks to a point, a triangle is a quadrangle in parameters: its halves come out.
    """
    uv, free = part.uv[part.triangles].copy(), free_parameters(part)[part.triangles]
    border = _border_sides(part)
    nodes = np.zeros(len(part.uv), bool)
    nodes[np.concatenate([part.triangles[border], np.roll(part.triangles, -1, axis=1)[border]])] = True
    xyz, rim = part.points_mm[part.triangles], nodes[part.triangles]
    is_point = free.any(axis=(1, 2))
    if not is_point.any():
        return uv, xyz, rim, border
    side = free.any(axis=2)[is_point].argmax(axis=1)
    k = (side[:, None] + np.arange(3)) % 3                       # the point first
    turn = lambda a: np.take_along_axis(a[is_point], k.reshape(k.shape + (1,) * (a.ndim - 2)), axis=1)
    q, f, x, r, b = turn(uv), turn(free), turn(xyz), turn(rim), turn(border)
    near1, near2 = np.where(f[:, 0], q[:, 1], q[:, 0]), np.where(f[:, 0], q[:, 2], q[:, 0])
    first, second = np.stack([near1, q[:, 1], q[:, 2]], axis=1), np.stack([near1, q[:, 2], near2], axis=1)
    whole = ~is_point           # of the new sides one lies within and one is the point: counted as border where the last is
    return (np.concatenate([uv[whole], first, second]), np.concatenate([xyz[whole], x, x[:, [0, 2, 0]]]),
            np.concatenate([rim[whole], r, r[:, [0, 2, 0]]]), np.concatenate([border[whole], b, np.column_stack([b[:, 2]] * 3)]))


def _halved(face, uv, xyz, rim, border, side):
    """Both halves of triangles cut from the middle of side `side` (k to k + 1) to the opposite corner."""
    k = (side[:, None] + np.arange(3)) % 3
    turn = lambda a: np.take_along_axis(a, k.reshape(k.shape + (1,) * (a.ndim - 2)), axis=1)
    uv, xyz, rim, border = turn(uv), turn(xyz), turn(rim), turn(border)
    middle = (uv[:, 0] + uv[:, 1]) / 2
    exact, edge, within = surface_points(face, middle), border[:, 0], np.zeros(len(uv), bool)
    halves = lambda a, m: np.concatenate([np.stack([a[:, 0], m, a[:, 2]], axis=1), np.stack([m, a[:, 1], a[:, 2]], axis=1)])
    sides = np.concatenate([np.stack([edge, within, border[:, 2]], axis=1), np.stack([edge, border[:, 1], within], axis=1)])
    return halves(uv, middle), halves(xyz, exact), halves(rim, edge), sides


def _border_sides(part):
    """(m, 3) bool: sides, corner k to k + 1, that belong to one triangle only."""
    sides = np.sort(np.stack([part.triangles, np.roll(part.triangles, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    _, which, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    return (count == 1)[which.ravel()].reshape(-1, 3)


def _is_inside(classifier, uv):
    return np.array([classifier.Perform(gp_Pnt2d(u, v), True) == TopAbs_IN for u, v in uv.tolist()], dtype=bool)


def _border_parameters(face, spacing_mm):
    """(n, 2) parameters along all edges but seams, INSIDE_MM towards the inner side."""
    flat = TopoDS.Face_s(face.Oriented(TopAbs_FORWARD))
    explorer, rows = TopExp_Explorer(flat, TopAbs_EDGE), [np.zeros((0, 2))]
    while explorer.More():
        edge = TopoDS.Edge_s(explorer.Current())
        if not BRep_Tool.Degenerated_s(edge) and not BRep_Tool.IsClosed_s(edge, flat):
            rows.append(_inside_of_edge(edge, flat, spacing_mm))
        explorer.Next()
    return np.concatenate(rows)


def _inside_of_edge(edge, face, spacing_mm):
    curve, p, d = BRepAdaptor_Curve2d(edge, face), gp_Pnt2d(), gp_Vec2d()
    first, last = curve.FirstParameter(), curve.LastParameter()
    length = GCPnts_AbscissaPoint.Length_s(BRepAdaptor_Curve(edge))
    count = max(1, math.ceil(length / spacing_mm))
    uv, along = np.empty((count, 2)), np.empty((count, 2))
    for i, share in enumerate(((np.arange(count) + 0.5) / count).tolist()):
        curve.D1(first + share * (last - first), p, d)
        uv[i], along[i] = (p.X(), p.Y()), (d.X(), d.Y())
    if edge.Orientation() == TopAbs_REVERSED:
        along = -along
    _, du, dv = surface_tangents(face, uv)
    tangent = along[:, :1] * du + along[:, 1:] * dv
    inward = np.cross(np.cross(du, dv), tangent)
    length = np.linalg.norm(inward, axis=1)
    good = length > 1e-12
    step = INSIDE_MM * inward[good] / length[good, None]
    return uv[good] + in_parameters(step, du[good], dv[good])


def in_parameters(step, du, dv):
    """(n, 2) parameters of tangential steps: least squares in the surface's metric."""
    dot = lambda a, b: np.einsum("nc,nc->n", a, b)
    e, f, g, a, b = dot(du, du), dot(du, dv), dot(dv, dv), dot(step, du), dot(step, dv)
    det = e * g - f * f
    return np.column_stack([g * a - f * b, e * b - f * a]) / det[:, None]
