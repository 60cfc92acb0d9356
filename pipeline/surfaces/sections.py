"""Vertical sections of a B-rep as exact elements: lines, arcs, ellipse arcs, splines.

A section plane is ZX (along = x, across = y) or YZ (along = y, across = x); its elements live in
(along, up).  A face is prismatic when its normals lie in the plane everywhere: its section is then
the same at every `across`, and exact: the plane's line, the cylinder's circle, the extrusion's curve.
All other faces are followed by `toolpaths.centers` on their centre surface instead.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GeomAbs import GeomAbs_CurveType
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS

from cuspline.kernel.brep import edge_points, explore
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen

PARALLEL = 1e-9             # sine of the angle below which directions count as parallel
CLEAR_MM = 1e-7             # a plane through a corner of a face would meet its edges there twice or not at all
CURVE_SAMPLES = 1500        # of an extruded curve: Hermite error far below 1e-8 mm at these sizes
SAMPLED_KINDS = {GeomAbs_CurveType.GeomAbs_Ellipse: "ellipse", GeomAbs_CurveType.GeomAbs_BSplineCurve: "spline",
                 GeomAbs_CurveType.GeomAbs_BezierCurve: "spline"}


@dataclass(frozen=True, kw_only=True)
class SectionPlane:
    """Orientation of the section planes."""

    along: int      # axis index of the horizontal in-plane coordinate
    across: int     # axis index of the plane normal

    @classmethod
    def named(cls, name):
        """"ZX" or "YZ"."""
        return {"ZX": cls(along=0, across=1), "YZ": cls(along=1, across=0)}[name]

    @property
    def name(self):
        return "ZX" if self.along == 0 else "YZ"

    def flat(self, points):
        """(n, 3) → (n, 2) along, up."""
        return np.asarray(points)[..., [self.along, 2]]

    def lift(self, flat, across):
        """(n, 2) along, up at one across coordinate → (n, 3)."""
        flat = np.atleast_2d(flat)
        points = np.empty((len(flat), 3))
        points[:, self.along], points[:, self.across], points[:, 2] = flat[:, 0], across, flat[:, 1]
        return points


@dataclass(frozen=True, eq=False, kw_only=True)
class Element:
    """One exact element of a section, with its outward normals.

    kind: "line" (two points), "arc" (center, radius, two points), "ellipse" or "spline" (sampled).
    """

    kind: str
    points: np.ndarray          # (n, 2) along, up; two for lines and arcs; arcs counter-clockwise (equal: all round)
    normals: np.ndarray         # (n, 2) unit, out of the material
    center: np.ndarray | None
    radius: float
    is_ridge: bool              # arcs: material on the centre's side
    owner: int                  # face index


@dataclass(frozen=True, eq=False)
class PrismaticFace:
    """A face whose section does not depend on where the plane cuts it."""

    face: object                # brep.Face
    index: int
    plane: SectionPlane

    @cached_property
    def edges(self):
        """Boundary edges of the face."""
        return [TopoDS.Edge_s(e) for e in explore(self.face.shape, TopAbs_EDGE)]

    @cached_property
    def across_range(self):
        """(low, high) across coordinates of the face."""
        values = np.concatenate([edge_points(e, 9)[0][:, self.plane.across] for e in self.edges])
        return values.min(), values.max()

    @cached_property
    def is_uniform(self):
        """Every edge runs straight across or stays in one section plane: one section serves all."""
        for edge in self.edges:
            points, tangents = edge_points(edge, 9)
            runs_across = np.abs(tangents[:, self.plane.across]) > 1 - PARALLEL
            stays = np.ptp(points[:, self.plane.across]) < 1e-7
            if not (runs_across.all() or stays):
                return False
        return True

    @cached_property
    def _uniform_elements(self):
        return self._cut(sum(self.across_range) / 2)

    def elements(self, across):
        """The face's section at one plane: a list of Elements, empty where the plane misses it."""
        low, high = self.across_range
        if not low - 1e-7 <= across <= high + 1e-7:
            return []
        return self._uniform_elements if self.is_uniform else self._cut(across)

    def _cut(self, across):
        low, high = self.across_range
        inside = np.clip(across, low + 1e-7 * (high - low), high - 1e-7 * (high - low))
        if np.abs(self._corners - inside).min() < CLEAR_MM:
            inside += 2 * CLEAR_MM * (1 if inside < (low + high) / 2 else -1)
        crossings, seam = self._crossings(inside)
        if len(crossings) < 2:
            return []
        parameters = self._parameter(crossings, seam)
        order = np.argsort(parameters, kind="stable")
        ends, parameters = crossings[order], parameters[order]
        return [self._element(ends[k:k + 2], parameters[k:k + 2]) for k in range(0, len(ends) - 1, 2)]

    @cached_property
    def _corners(self):
        """Across coordinates of the edges' ends."""
        return np.concatenate([edge_points(e, 2)[0][:, self.plane.across] for e in self.edges])

    def _crossings(self, across):
        """(k, 2) where the boundary meets the plane; (k,) -1 and 1 at a seam, which bounds the face on both sides."""
        found, seam = [], []
        for edge in self.edges:
            points, _ = edge_points(edge, 65)
            side = points[:, self.plane.across] - across
            sides = (-1, 1) if BRep_Tool.IsClosed_s(edge, self.face.shape) else (0,)
            for k in np.flatnonzero((side[:-1] >= 0) != (side[1:] >= 0)):
                found += [_cross_edge(edge, k / 64, (k + 1) / 64, across, self.plane)] * len(sides)
                seam += sides
        return np.array(found).reshape(-1, 2), np.array(seam)

    @cached_property
    def _basis(self):
        """What the section runs on: ("line",), ("arc", center, radius) or (kind, samples (n, 2))."""
        adaptor, kind = self.face.adaptor, self.face.kind
        if kind == "plane":
            return ("line",)
        if kind == "cylinder":
            c = adaptor.Cylinder()
            p = c.Axis().Location()
            return "arc", self.plane.flat(np.array([p.X(), p.Y(), p.Z()])), c.Radius()
        curve = adaptor.BasisCurve()
        if curve.GetType() == GeomAbs_CurveType.GeomAbs_Circle:
            circle = curve.Circle()
            n = circle.Axis().Direction()
            if abs((n.X(), n.Y(), n.Z())[self.plane.across]) > 1 - PARALLEL:
                p = circle.Location()
                return "arc", self.plane.flat(np.array([p.X(), p.Y(), p.Z()])), circle.Radius()
        if curve.GetType() == GeomAbs_CurveType.GeomAbs_Line:
            return ("line",)
        return SAMPLED_KINDS.get(curve.GetType(), "spline"), *self._sample(curve)

    def _sample(self, curve):
        """Dense points and directions of an extruded curve over the face's own range, in the plane."""
        u0, u1, _, _ = self.face.uv_bounds
        p, d = gp_Pnt(), gp_Vec()
        points, directions = np.empty((CURVE_SAMPLES, 3)), np.empty((CURVE_SAMPLES, 3))
        parameters = np.linspace(u0, u1, CURVE_SAMPLES)
        for i, u in enumerate(parameters.tolist()):
            curve.D1(u, p, d)
            points[i], directions[i] = (p.X(), p.Y(), p.Z()), (d.X(), d.Y(), d.Z())
        return self.plane.flat(points), self.plane.flat(directions)

    def _parameter(self, points, seam):
        """Place of (k, 2) points along the section: length, angle from the middle or row of the samples."""
        basis = self._basis
        if basis[0] == "line":
            d = points[-1] - points[0]
            return fixed.matmul(points, d)
        if basis[0] == "arc":
            middle = self.plane.flat(self.face.middle.point_mm[0]) - basis[1]
            d = points - basis[1]
            turn = fixed.arctan2(d[:, 1], d[:, 0]) - fixed.arctan2(middle[1], middle[0])
            return np.where(seam == 0, (turn + np.pi) % (2 * np.pi) - np.pi, seam * np.pi)
        samples = basis[1]
        nearest = np.array([np.argmin(((samples - p) ** 2).sum(axis=1)) for p in points])
        return np.where(seam == 0, nearest, np.where(seam < 0, 0, len(samples) - 1))

    def _element(self, ends, parameters):
        basis, out = self._basis, self.plane.flat(self.face.middle.normal[0])
        if basis[0] == "line":
            return Element(kind="line", points=ends, normals=np.array([out, out]),
                           center=None, radius=np.inf, is_ridge=False, owner=self.index)
        if basis[0] == "arc":
            center, radius = basis[1], basis[2]
            middle = self.plane.flat(self.face.middle.point_mm[0]) - center
            ridge = bool(fixed.matmul(middle, out) > 0)
            radial = (ends - center) / radius * (1 if ridge else -1)
            return Element(kind="arc", points=ends, normals=radial, center=center,
                           radius=radius, is_ridge=ridge, owner=self.index)
        return self._curve_element(ends, *(int(p) for p in parameters))

    def _curve_element(self, ends, first, last):
        kind, points, directions = self._basis
        # a cut between samples takes the next sample outward: the face's smooth continuation, 0.02 mm
        # long, lifts the ball by less than 0.02²/2r
        if np.linalg.norm(points[[first, last]] - ends, axis=1).max() > 1e-7:
            first, last = max(first - 1, 0), min(last + 1, len(points) - 1)
        points, directions = points[first:last + 1], directions[first:last + 1]
        normals = np.column_stack([-directions[:, 1], directions[:, 0]])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        middle, out = self.plane.flat(self.face.middle.point_mm[0]), self.plane.flat(self.face.middle.normal[0])
        nearest = int(np.argmin(((points - middle) ** 2).sum(axis=1)))
        if fixed.matmul(normals[nearest], out) < 0:
            normals = -normals
        return Element(kind=kind, points=frozen(points, (None, 2), "points"), normals=normals, center=None,
                       radius=np.nan, is_ridge=False, owner=self.index)


def _cross_edge(edge, low, high, across, plane):
    """(along, up) where the edge passes the plane, between two shares of its parameter range."""
    curve = BRepAdaptor_Curve(edge)
    t0, span = curve.FirstParameter(), curve.LastParameter() - curve.FirstParameter()
    at = lambda share: curve.Value(t0 + share * span)
    coordinate = lambda p: (p.X(), p.Y(), p.Z())
    sign = coordinate(at(low))[plane.across] - across
    for _ in range(60):
        middle = (low + high) / 2
        if (coordinate(at(middle))[plane.across] - across) * sign > 0:
            low = middle
        else:
            high = middle
    return plane.flat(np.array(coordinate(at((low + high) / 2))))


def is_prismatic(face, plane):
    """The face's normals lie in the section planes, so its section does not change across."""
    adaptor, axis = face.adaptor, plane.across
    if face.kind == "plane":
        d = adaptor.Plane().Axis().Direction()
        return abs((d.X(), d.Y(), d.Z())[axis]) < PARALLEL
    if face.kind == "cylinder":
        d = adaptor.Cylinder().Axis().Direction()
        return abs((d.X(), d.Y(), d.Z())[axis]) > 1 - PARALLEL
    if face.kind == "extrusion":
        d = adaptor.Direction()
        return abs((d.X(), d.Y(), d.Z())[axis]) > 1 - PARALLEL
    return False


def is_cap(face, plane):
    """A plane face parallel to the section planes: it never carries the ball."""
    if face.kind != "plane":
        return False
    d = face.adaptor.Plane().Axis().Direction()
    return abs((d.X(), d.Y(), d.Z())[plane.across]) > 1 - PARALLEL
