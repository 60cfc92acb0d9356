"""Where the ball's centre may run in a section plane: pieces over faces, edges and corners.

Over a face the centre is S + r n; in the plane across = c the pieces are
- exact offsets of the section's elements where the face is prismatic;
- the contour across(S + r n) = c, followed by Newton on the exact surface, for every other face:
  the ball then touches beside the plane, so an offset of the section alone would gouge;
- the section of a pipe of radius r about an edge; a circle about a corner.
"""

from dataclasses import dataclass

import contourpy
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_TrimmedCurve
from OCP.GeomConvert import GeomConvert
from scipy.interpolate import BSpline
from scipy.optimize import brentq

from cuspline.kernel.brep import bounding_box_mm, edge_points, edges_with_faces, faces_of
from cuspline.surfaces.sections import PrismaticFace, is_cap, is_prismatic
from cuspline.toolpaths.sections.section_pieces import (
    EDGE_RANK,
    NO_FACE,
    ArcPiece,
    LinePiece,
    curve_pieces,
    half_circle,
)
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import runs_of

GRID = 140                  # parameter grid that finds the contours; Newton makes them exact
BESIDE_MM = 1e-7
EDGE_SPACING_MM = 0.5       # finds where the plane meets an edge's pipe; that range is sampled anew
PIPE_SAMPLES = 400
ALONG_SINE = 0.7            # edges within 45 degrees of the section planes run along the passes
WALL_MM = 1e-4              # contacts that keep their place to this slide along one wall
STEEP = 1e-3                # sampled pieces end where the contact normal comes this close to level


@dataclass(frozen=True, eq=False, kw_only=True)
class Wall:
    """A vertical contact: the centre may stand at `along` between two heights, touching the owner."""

    along: float
    low: float
    high: float
    owner: int
    side: int       # +1: the wall faces rising along


@dataclass(frozen=True, eq=False, kw_only=True)
class _CenterSurface:
    """The offset of one general face on a parameter grid."""

    index: int
    face: object
    u: np.ndarray
    v: np.ndarray
    across: np.ndarray      # (GRID, GRID) across coordinate of S + r n


class CenterSections:
    """All centre pieces of one solid for one ball, plane by plane."""

    def __init__(self, solid, plane, radius_mm):
        """
        Args:
            solid: TopoDS solid.
            plane: SectionPlane.
            radius_mm: distance of the centre from the part: ball radius plus allowance.
        """
        self.plane, self.radius_mm = plane, radius_mm
        self.faces = faces_of(solid)
        self.lowest_mm = float(bounding_box_mm(solid)[0][2]) + radius_mm       # of the centre: beside the part
        self.prismatic = [PrismaticFace(f, i, plane) for i, f in enumerate(self.faces) if is_prismatic(f, plane)]
        flat = {p.index for p in self.prismatic}
        self.general = [self._center_surface(i, f) for i, f in enumerate(self.faces)
                        if i not in flat and not is_cap(f, plane)]
        self.edges = [_Edge(e, plane, self._carrier(e, f)) for e, f in edges_with_faces(solid)]

    def _carrier(self, edge, shapes):
        """Face that a ball rolling along the edge still belongs to: the most level of its neighbours.

        Only where the edge runs along the section planes: over an edge that crosses them the ball
        leaves the face, and the pass may end.
        """
        _, tangents = edge_points(edge, 9)
        if np.abs(tangents[:, self.plane.across]).max() > ALONG_SINE:
            return NO_FACE
        rows = [i for i, f in enumerate(self.faces) if any(f.shape.IsSame(s) for s in shapes)]
        return max(rows, key=lambda i: self.faces[i].middle.normal[0, 2], default=NO_FACE)

    def pieces(self, across):
        """(pieces, walls) in one section plane."""
        pieces, walls = [], []
        elements = [e for p in self.prismatic for e in p.elements(across)]
        for element in elements:
            self._add_element(element, pieces, walls)
        for surface in self.general:
            pieces += self._contour_pieces(surface, across, walls)
        if self.general or self._leaves_a_face(across):
            for edge in self.edges:
                if edge.low - self.radius_mm < across < edge.high + self.radius_mm:
                    pieces += self._pipe_pieces(edge, across)
        return pieces, walls

    def _leaves_a_face(self, across):
        """Some prismatic face that can hold the ball does not reach through this plane."""
        reach = self.radius_mm + 1e-6
        for p in self.prismatic:
            low, high = p.across_range
            if low - reach < across < high + reach and not low - 1e-7 <= across <= high + 1e-7:
                return True
        return False

    # prismatic faces -------------------------------------------------------------------------

    def _add_element(self, element, pieces, walls):
        r = self.radius_mm
        if element.kind == "line":
            start, end = sorted(element.points + r * element.normals, key=lambda p: (p[0], p[1]))
            if abs(element.normals[0, 1]) < 1e-9:
                walls.append(Wall(along=start[0], low=start[1], high=end[1], owner=element.owner,
                                  side=int(np.sign(element.normals[0, 0]))))
            elif element.normals[0, 1] > 0:
                pieces.append(LinePiece(start=start, end=end, owner=element.owner))
        elif element.kind == "arc":
            pieces += self._offset_arc(element)
        else:
            pieces += _steepless(element.points + r * element.normals, element.normals, element.owner)
        for end in (element.points[0], element.points[-1]):
            pieces.append(half_circle(end, r, NO_FACE))

    def _offset_arc(self, element):
        """Ridge: radius R + r over the top; hollow: R - r through the bottom, nothing if the ball is larger.

        Only the half of the circle whose normals point up carries the ball; an arc of more than half
        a turn may meet it twice.
        """
        radius = element.radius + (1 if element.is_ridge else -1) * self.radius_mm
        if radius < 1e-6:
            return []
        first, last = (fixed.arctan2(p[1], p[0]) for p in element.points - element.center)
        last = first + ((last - first) % (2 * np.pi) or 2 * np.pi)
        pieces = []
        for half in (0.0 if element.is_ridge else np.pi) + 2 * np.pi * np.array([-1, 0, 1]):
            low, high = max(first, half), min(last, half + np.pi)
            if high - low > 1e-9:
                ends = element.center + radius * np.array([(fixed.cos(a), fixed.sin(a)) for a in (low, high)])
                start, end = sorted(ends, key=lambda p: p[0])
                pieces.append(ArcPiece(center=element.center, radius=radius, start=start, end=end,
                                       is_over=element.is_ridge, owner=element.owner))
        return pieces

    # general faces ---------------------------------------------------------------------------

    def _center_surface(self, index, face):
        u0, u1, v0, v1 = face.regular_domain
        u, v = np.linspace(u0, u1, GRID), np.linspace(v0, v1, GRID)
        uu, vv = np.meshgrid(u, v, indexing="ij")
        shape = face.shape_at(uu.ravel(), vv.ravel())
        center = shape.point_mm + self.radius_mm * shape.normal
        return _CenterSurface(index=index, face=face, u=u, v=v,
                              across=center[:, self.plane.across].reshape(GRID, GRID))

    def _contour_pieces(self, surface, across, walls):
        low, high = surface.across.min(), surface.across.max()
        if not low <= across <= high:
            return []
        pieces = []
        # a plane along a border or a seam of the face: its contour is noise, the one beside it is a line
        beside = float(across + BESIDE_MM * (1 if across < (low + high) / 2 else -1))
        lines = contourpy.contour_generator(surface.v, surface.u, surface.across, name="serial").lines(beside)
        for line in lines:
            line = _halved(line)
            u, v = self._onto_contour(surface, line[:, 1].copy(), line[:, 0].copy(), across)
            walls += self._walls_of(surface, u, v)
            for first, last in runs_of(self._carries(surface, u, v)):
                run_u, run_v = self._to_the_border(surface, u, v, first, last, across)
                pieces += self._curve_of(surface, run_u, run_v, across)
        return pieces

    def _walls_of(self, surface, u, v):
        """Vertical runs of the contour: the ball slides up and down along them."""
        shape = surface.face.shape_at(u, v)
        normals = self.plane.flat(shape.normal)
        centers = self.plane.flat(shape.point_mm) + self.radius_mm * normals
        walls = []
        for first, last in runs_of(np.abs(normals[:, 1]) <= STEEP):
            along = centers[first:last, 0]
            if np.ptp(along) < WALL_MM and np.ptp(centers[first:last, 1]) > WALL_MM:
                walls.append(Wall(along=float(along.mean()), low=centers[first:last, 1].min(),
                                  high=centers[first:last, 1].max(), owner=surface.index,
                                  side=int(np.sign(normals[first, 0]))))
        return walls

    def _carries(self, surface, u, v):
        """(n,) bool: inside the trim, and not so steep that only a wall can hold the ball there."""
        normals = self.plane.flat(surface.face.shape_at(u, v).normal)
        rises = normals[:, 1] > STEEP * np.linalg.norm(normals, axis=1)
        rises[rises] = surface.face.is_inside(u[rises], v[rises])
        return rises

    def _to_the_border(self, surface, u, v, first, last, across):
        """Points first..last-1 with the contour's exact last carrying points added."""
        run = [(u[first:last], v[first:last])]
        if first > 0:
            run.insert(0, self._border_point(surface, (u[first], v[first]), (u[first - 1], v[first - 1]), across))
        if last < len(u):
            run.append(self._border_point(surface, (u[last - 1], v[last - 1]), (u[last], v[last]), across))
        return np.concatenate([r[0] for r in run]), np.concatenate([r[1] for r in run])

    def _border_point(self, surface, inside, outside, across):
        """The last carrying point of the contour between two of its points, to 1e-6 of their distance."""
        inside, outside = np.array(inside), np.array(outside)
        found = inside
        for _ in range(20):
            middle = (inside + outside) / 2
            u, v = self._onto_contour(surface, middle[:1].copy(), middle[1:].copy(), across)
            if self._carries(surface, u, v)[0]:
                inside, found = middle, np.array([u[0], v[0]])
            else:
                outside = middle
        return found[:1], found[1:]

    def _onto_contour(self, surface, u, v, across, steps=6):
        """Newton along the gradient of across(S + r n); borders of the domain are kept."""
        u0, u1, v0, v1 = surface.face.regular_domain
        fixed_u, fixed_v = (u <= u0) | (u >= u1), (v <= v0) | (v >= v1)
        for _ in range(steps):
            value, gu, gv = self._across_gradient(surface, u, v)
            gu, gv = np.where(fixed_u, 0.0, gu), np.where(fixed_v, 0.0, gv)
            size = np.maximum(gu * gu + gv * gv, 1e-30)
            miss = value - across
            if np.abs(miss).max() < 1e-11:
                break
            u, v = np.clip(u - miss * gu / size, u0, u1), np.clip(v - miss * gv / size, v0, v1)
        return u, v

    def _across_gradient(self, surface, u, v):
        d = surface.face.nurbs.derivatives(u, v)
        s, su, sv, suu, suv, svv = np.moveaxis(d, 1, 0)
        cross = np.cross(su, sv)
        length = np.maximum(np.linalg.norm(cross, axis=1), 1e-30)[:, None]
        sign = -1.0 if surface.face.is_reversed else 1.0
        n = cross / length
        turn = lambda a: (a - n * (a * n).sum(axis=1)[:, None]) / length
        nu = turn(np.cross(suu, sv) + np.cross(su, suv))
        nv = turn(np.cross(suv, sv) + np.cross(su, svv))
        k, r = self.plane.across, sign * self.radius_mm
        return s[:, k] + r * n[:, k], su[:, k] + r * nu[:, k], sv[:, k] + r * nv[:, k]

    def _curve_of(self, surface, u, v, across):
        if len(u) < 2:
            return []
        shape = surface.face.shape_at(u, v)
        normals = self.plane.flat(shape.normal)
        centers = self.plane.flat(shape.point_mm) + self.radius_mm * normals
        return curve_pieces(centers, normals, surface.index)

    # edges and corners -----------------------------------------------------------------------

    def _pipe_pieces(self, edge, across):
        """Section of the pipe about an edge: centre = E + r w with w at right angles to the edge."""
        pieces = [half_circle(self.plane.flat(point), np.sqrt(self.radius_mm ** 2 - offset ** 2), NO_FACE)
                  for point, offset in zip(edge.ends, across - edge.ends[:, self.plane.across])
                  if abs(offset) < self.radius_mm - 1e-9]
        if edge.runs_across:
            low, high = sorted(edge.ends[:, self.plane.across])
            if low <= across <= high:
                pieces.append(half_circle(self.plane.flat(edge.ends[0]), self.radius_mm, NO_FACE))
            return pieces
        for low, high in self._touching_ranges(edge, across):
            middle, half = (low + high) / 2, (high - low) / 2
            parameters = middle - half * fixed.cos(np.linspace(0, np.pi, PIPE_SAMPLES))
            for points, w in self._pipe_sections(edge, parameters, across):
                centers = self.plane.flat(points + self.radius_mm * w)
                pieces += _steepless(centers, self.plane.flat(w), edge.owner, rank=EDGE_RANK)
        return pieces

    def _touching_ranges(self, edge, across):
        """Parameter ranges over which the plane meets the pipe: |share| <= 1."""
        share = edge.coarse.share(across, self.radius_mm)
        meets = (np.minimum(share[:-1], share[1:]) < 1.0) & (np.maximum(share[:-1], share[1:]) > -1.0)
        at = lambda t: float(edge.frames(np.array([t])).share(across, self.radius_mm)[0])
        ranges = []
        for first, last in runs_of(meets):
            k = first + int(np.abs(share[first:last + 1]).argmin())
            inside = edge.parameters[k]
            if abs(share[k]) > 1.0:     # the range lies between two samples: start from share = 0
                other = k + 1 if k < last and share[k] * share[k + 1] < 0 else k - 1
                inside = brentq(at, edge.parameters[k], edge.parameters[other], xtol=1e-15)
            ranges.append(tuple(
                edge.parameters[j] if abs(share[j]) <= 1.0
                else brentq(lambda t: abs(at(t)) - 1.0, inside, edge.parameters[j], xtol=1e-15)
                for j in (first, last)))
        return ranges

    def _pipe_sections(self, edge, parameters, across):
        """Edge points and unit vectors from them to the ball's centre, on both sides of the pipe."""
        frames = edge.frames(parameters)
        share = np.clip(frames.share(across, self.radius_mm), -1.0, 1.0)[:, None]
        flank = np.cross(frames.tangents, frames.side) * np.sqrt(1.0 - share ** 2)
        return (frames.points, frames.side * share + flank), (frames.points, frames.side * share - flank)


class _Edge:
    """An edge as points and unit tangents at any parameters, as a rational B-spline."""

    def __init__(self, edge, plane, owner):
        self.owner, self.across = owner, plane.across
        self._curve, self._slope, first, last = _homogeneous(edge)
        points, _ = self.at(np.linspace(first, last, 17))
        length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        self.parameters = np.linspace(first, last, int(np.clip(length / EDGE_SPACING_MM, 33, 4000)))
        points, tangents = self.at(self.parameters)
        self.ends = points[[0, -1]]
        self.low, self.high = points[:, plane.across].min(), points[:, plane.across].max()
        self.runs_across = bool((np.abs(tangents[:, plane.across]) > 1 - 1e-12).all())
        self.coarse = _Frames(points, tangents, plane.across)

    def at(self, parameters):
        """(n, 3) points and (n, 3) unit tangents."""
        h, d = self._curve(parameters), self._slope(parameters)
        points = h[:, :3] / h[:, 3:]
        along = d[:, :3] - points * d[:, 3:]
        return points, along / np.linalg.norm(along, axis=1)[:, None]

    def frames(self, parameters):
        return _Frames(*self.at(parameters), self.across)


class _Frames:
    """Points of an edge with the unit direction in which a section plane leaves them."""

    def __init__(self, points, tangents, across):
        side = -tangents * tangents[:, [across]]
        side[:, across] += 1.0
        self.sine = np.maximum(np.sqrt((side * side).sum(axis=1)), 1e-12)
        self.points, self.tangents, self.side = points, tangents, side / self.sine[:, None]
        self._at = points[:, across]

    def share(self, across, radius_mm):
        """(n,) how far toward the pipe's side the plane lies: it meets the pipe where |share| <= 1."""
        return (across - self._at) / (radius_mm * self.sine)


def _homogeneous(edge):
    """(curve, derivative, first, last): scipy splines of the edge in homogeneous coordinates."""
    first, last = BRepAdaptor_Curve(edge).FirstParameter(), BRepAdaptor_Curve(edge).LastParameter()
    curve = GeomConvert.CurveToBSplineCurve_s(Geom_TrimmedCurve(BRep_Tool.Curve_s(edge, 0.0, 1.0), first, last))
    poles = np.array([[p.X() * w, p.Y() * w, p.Z() * w, w] for p, w in
                      ((curve.Pole(i), curve.Weight(i)) for i in range(1, curve.NbPoles() + 1))])
    knots = np.repeat([curve.Knot(k) for k in range(1, curve.NbKnots() + 1)],
                      [curve.Multiplicity(k) for k in range(1, curve.NbKnots() + 1)])
    spline = BSpline(knots, poles, curve.Degree())
    return spline, spline.derivative(), curve.FirstParameter(), curve.LastParameter()


def _steepless(centers, normals, owner, rank=2):
    """Curve pieces of a sampled run, without what is so steep that only a wall can hold the ball there."""
    pieces = []
    for first, last in runs_of(normals[:, 1] > STEEP * np.linalg.norm(normals, axis=1)):
        pieces += curve_pieces(centers[first:last], normals[first:last], owner, rank)
    return pieces


def _halved(line):
    """A polyline with the middle of every segment added: a sixteenth of the Hermite error."""
    out = np.empty((2 * len(line) - 1, line.shape[1]))
    out[::2], out[1::2] = line, (line[1:] + line[:-1]) / 2
    return out
