"""Curvature of whole faces: samples to plan with, and the tightest hollow, proven by halving the faces piece by piece.

A piece whose proven most hollow curvature is no more than what has been found elsewhere is done with; the others are
halved.  What is left out, and why:
- what lies outside the face's trim (a piece smaller than BORDER_MM across the border counts as on it);
- a pole, where the surface has no normal to compute with: pieces smaller than POLE_MM that touch one are left out.
"""

from dataclasses import dataclass

import numpy as np
from OCP.BRepTools import BRepTools

from cuspline.splines.nurbs import local_shape
from cuspline.surfaces.enclosures import curvature_of_piece
from cuspline.surfaces.face_pieces import (
    ACROSS,
    INSIDE,
    OUTSIDE,
    halves,
    in_face_parameters,
    trim_states,
    whole_patches,
)
from cuspline.surfaces.patches import OF_FACE, PatchSet
from cuspline.surfaces.trims import TrimSet
from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit
from cuspline.values.errors import PlanError

GRID = 48
ONE_WAY = ("cylinder", "cone", "sphere")    # a ridge somewhere is a ridge everywhere
PROVEN_SHARE = 0.01         # the tightest radius is known within this share
FLATTEST_MM = 1e4           # a hollow flatter than this radius hinders no cutter and counts as none
BORDER_MM = 2e-5            # twice the chord error of a trim's border
POLE_MM = 0.01
LARGEST_ROUNDS = 200        # halvings of one face
LARGEST_COUNT = 400_000     # pieces of one face open at a time
REFINING_STEPS = 40         # halvings of the step that brings the best point home


@dataclass(frozen=True, eq=False, kw_only=True)
class FaceSamples:
    """Points of the faces to cut with their shape, one row each; for planning, not for the verdict."""

    point_mm: np.ndarray            # (n, 3)
    normal: np.ndarray              # (n, 3)
    hollow_per_mm: np.ndarray       # (n,) most hollow principal curvature (negative in a hollow)
    across_per_mm: np.ndarray       # (n,) normal curvature along the step direction
    area_mm2: np.ndarray            # (n,) share of the face's area
    face: np.ndarray                # (n,) index

    def leaning_faces(self, upright):
        """Set of indices of the faces that do not stand upright: the unit normal's z is `upright` or more at some sample."""
        return set(np.unique(self.face[np.abs(self.normal[:, 2]) >= upright]).tolist())


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
    """The tightest hollow of some faces, or of parts of them."""

    radius_mm: float                        # of the tightest hollow found; inf where all is flatter than FLATTEST_MM
    proven_mm: float                        # no hollow is tighter than this: at least radius_mm / (1 + PROVEN_SHARE)
    place_mm: tuple[float, float, float]
    face: int
    uv: tuple[float, float]                 # parameters of the face's `nurbs`
    poles_left_out: int                     # pieces that touch a pole and could not be bounded


def tightest_hollow(faces, indices, *, within_mm=None, geometry=None):
    """Smallest concave principal radius over the given faces and where it is.

    Args:
        faces: brep.Face values.
        indices: those to look at, at least one.
        within_mm: (low (3,), high (3,)) only the parts of the faces in this box, part frame.
        geometry: (PatchSet, TrimSet) of all faces, if they are at hand.
    Returns:
        Hollow.
    Raises:
        PlanError: the bound does not close in; names face and place.
    """
    return min(hollows_of_faces(faces, indices, within_mm=within_mm, geometry=geometry), key=lambda h: h.proven_mm)


def hollows_of_faces(faces, indices, *, within_mm=None, geometry=None):
    """Hollow of each of the given faces, in order; arguments as for `tightest_hollow`."""
    patches, trims = geometry or (PatchSet.of_faces(faces), TrimSet.of_faces(faces))
    return [_hollow_of_face(faces[index], index, patches, trims, within_mm) for index in indices]


def _hollow_of_face(face, index, patches, trims, within_mm):
    none = dict(radius_mm=np.inf, proven_mm=FLATTEST_MM, face=index, uv=tuple(_middle_parameters(face)),
                place_mm=tuple(float(x) for x in face.middle.point_mm[0]), poles_left_out=0)
    if face.kind == "plane" or (face.kind in ONE_WAY and face.middle.curvature_low_per_mm[0] > -1.0 / FLATTEST_MM):
        return Hollow(**none)
    within = np.array([[-np.inf] * 3, [np.inf] * 3] if within_mm is None else within_mm, float)
    search = _Search(patches, trims, index, within)
    bound = search.run()
    if search.uv is None:
        return Hollow(**{**none, "poles_left_out": search.poles})
    uv, curvature, point = search.refined(bound)
    return Hollow(radius_mm=1.0 / curvature, proven_mm=1.0 / max(bound, curvature), face=index, uv=uv,
                  place_mm=tuple(float(x) for x in point), poles_left_out=search.poles)


def _middle_parameters(face):
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face.nurbs_face)
    return (u0 + u1) / 2, (v0 + v1) / 2


class _Search:
    """Branch and bound over one face; curvature counts positive in a hollow here."""

    def __init__(self, patches, trims, face, within):
        self.patches, self.trims, self.face, self.within = patches, trims, face, within
        self.best, self.uv, self.step, self.poles = 1.0 / FLATTEST_MM, None, None, 0
        degrees = patches.patch[patches.patch[:, 0] == face][:, 2:4].max(axis=0) + 1
        self.work = np.empty((*degrees, 4))

    def run(self):
        """Proven upper bound of the curvature over the face, within PROVEN_SHARE of what was found."""
        patch, box = whole_patches(self.patches, self.face)
        for _ in range(LARGEST_ROUNDS):
            patch, box = self._round(patch, box)
            if not len(patch):
                return self.best * (1.0 + PROVEN_SHARE)
            if len(patch) > LARGEST_COUNT:
                break
        bounds = np.empty((1, 9))
        _examine(self.patches.coefficients, self.patches.patch, self.patches.sign, patch[:1], box[:1], self.work,
                 bounds)
        raise PlanError(f"face {self.face}: the minimum concave radius is not found near "
                        f"{np.round(bounds[0, 2:5], 3).tolist()}: look there for a cusp or a fold of the surface",
                        rows=[self.face])

    def _round(self, patch, box):
        """Examine pieces, keep the best place, return the halves of those that may still hold a tighter one."""
        bounds = np.empty((len(box), 9))
        _examine(self.patches.coefficients, self.patches.patch, self.patches.sign, patch, box, self.work, bounds)
        open_ = bounds[:, 0] > self.best * (1.0 + PROVEN_SHARE)
        patch, box, bounds = patch[open_], box[open_], bounds[open_]
        state, is_mine = self._states(patch, box, bounds)
        small = np.maximum(bounds[:, 6], bounds[:, 7])
        self._attain(patch, box, bounds, is_mine | (state == ACROSS) & (small < BORDER_MM))
        pole = np.isinf(bounds[:, 0]) & (small < POLE_MM)
        self.poles += int((pole & (state != OUTSIDE)).sum())
        open_ = (state != OUTSIDE) & ~pole & (bounds[:, 0] > self.best * (1.0 + PROVEN_SHARE))
        # a bound that has closed in on a middle outside the border: cut the longer side
        closed = bounds[:, 0] < 1.002 * bounds[:, 1]
        side = np.where(closed, bounds[:, 7] > bounds[:, 6], bounds[:, 8] == 1.0)
        return halves(patch[open_], box[open_], side[open_].astype(int))

    def _states(self, patch, box, bounds):
        """Where pieces lie, (n,), and whether their middles count, (n,) bool."""
        state = trim_states(self.patches, self.trims, patch, box)
        u, v = in_face_parameters(self.patches, patch, (box[:, 0] + box[:, 1]) / 2, (box[:, 2] + box[:, 3]) / 2)
        is_mine = (state == INSIDE) | (state == ACROSS) & self.trims.is_inside(self.face, u, v)
        low, high = self.within
        middle, reach = bounds[:, 2:5], bounds[:, 5:6]
        off = ((middle + reach < low) | (middle - reach > high)).any(axis=1)
        across = ~off & ((middle - reach < low) | (middle + reach > high)).any(axis=1)
        state = np.where(off, OUTSIDE, np.where(across & (state == INSIDE), ACROSS, state))
        return state, is_mine & ((middle >= low) & (middle <= high)).all(axis=1)

    def _attain(self, patch, box, bounds, counts):
        values = np.where(counts & np.isfinite(bounds[:, 0]), bounds[:, 1], -np.inf)
        k = int(values.argmax()) if len(values) else 0
        if len(values) and values[k] > self.best:
            self.best = float(values[k])
            u, v = in_face_parameters(self.patches, patch[[k, k]], box[k, :2], box[k, 2:])
            self.uv, self.step = (float(u.mean()), float(v.mean())), (np.ptp(u), np.ptp(v))

    def refined(self, bound):
        """Bring the best point home by pattern search: ((u, v), curvature, point); nothing above the bound counts."""
        (u, v), (du, dv) = self.uv, self.step
        u0, u1, v0, v1 = self.patches.domain(self.face)
        best, point = -np.inf, None
        for k in range(8 * REFINING_STEPS):
            uu = np.clip(u + du * np.array([0, -1, 1, 0, 0, -1, 1, -1, 1]), u0, u1)
            vv = np.clip(v + dv * np.array([0, 0, 0, -1, 1, -1, -1, 1, 1]), v0, v1)
            shape = local_shape(self.patches.derivatives(self.face, uu, vv), self.patches.sign[self.face] < 0)
            counts = self.trims.is_inside(self.face, uu, vv) & shape.is_regular
            counts &= ((shape.point_mm >= self.within[0]) & (shape.point_mm <= self.within[1])).all(axis=1)
            counts[0] = True
            values = np.where(counts, -shape.curvature_low_per_mm, -np.inf)
            values[values > max(bound, values[0])] = -np.inf
            j = int(values.argmax())
            if values[j] > best:
                best, point, u, v = float(values[j]), shape.point_mm[j], float(uu[j]), float(vv[j])
            else:
                du, dv = du / 2, dv / 2
                if du < 1e-9 * (u1 - u0) and dv < 1e-9 * (v1 - v0):
                    break
        return (u, v), best, point


@njit
def _examine(coefficients, rows, sign, patch, box, work, out):
    """Bounds of `enclosures.curvature_of_piece` for many pieces."""
    for k in range(len(box)):
        q = patch[k]
        curvature_of_piece(coefficients, rows[q], sign[rows[q, OF_FACE]], box[k], work, out[k])
