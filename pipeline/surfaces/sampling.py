"""Points on trimmed faces, none farther from any point of its face than a given spacing: proven, not hoped.

A face is halved into pieces until the bound on a piece's size says that one point serves all of it: from the middle of
a piece inside the trim nothing is farther than its reach; in a piece across the border any point of the face serves
that is no farther than the piece's whole diameter, its middle or else a point of the border.  Slivers keep a point
each.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.splines.nurbs import local_shape
from cuspline.surfaces.enclosures import size_of_piece
from cuspline.surfaces.face_pieces import (
    ACROSS,
    OUTSIDE,
    halves,
    in_face_parameters,
    point_on_border,
    side_to_cut,
    trim_states,
    whole_patches,
)
from cuspline.surfaces.patches import U_HIGH, U_LOW, V_HIGH, V_LOW, PatchSet, U, V
from cuspline.surfaces.trims import TrimSet
from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit

ROUNDS = 60
SHARES = 6              # places along a side by which the inner share of a piece across the border is counted


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceSamples:
    """Points of faces, one row each, part frame."""

    point_mm: np.ndarray        # (n, 3)
    normal: np.ndarray          # (n, 3) unit, out of the material; NaN at a pole
    area_mm2: np.ndarray        # (n,) share of its face that the point stands for
    face: np.ndarray            # (n,) int: place in the given faces
    u: np.ndarray               # (n,) parameters of the face's `nurbs`
    v: np.ndarray               # (n,)
    is_border: np.ndarray       # (n,) bool: on the trim's border

    def __post_init__(self):
        n = len(self.point_mm)
        for name, shape, dtype in (("point_mm", (n, 3), float), ("normal", (n, 3), float), ("area_mm2", (n,), float),
                                   ("face", (n,), np.int64), ("u", (n,), float), ("v", (n,), float),
                                   ("is_border", (n,), bool)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))

    def __len__(self):
        return len(self.point_mm)


def samples_of_faces(faces, spacing_mm, *, geometry=None):
    """SurfaceSamples such that no point of a face is farther than `spacing_mm` from one of the face's own samples.

    Args:
        faces: brep.Face values.
        spacing_mm: scalar > 0, straight distance.
        geometry: (PatchSet, TrimSet) of the faces, if at hand.
    Returns:
        SurfaceSamples; a face's area shares add up to its area.
    """
    patches, trims = geometry or (PatchSet.of_faces(faces), TrimSet.of_faces(faces))
    parts = [_samples_of_face(patches, trims, k, face.area_mm2, spacing_mm) for k, face in enumerate(faces)]
    names = ("point_mm", "normal", "area_mm2", "face", "u", "v", "is_border")
    return SurfaceSamples(**{name: np.concatenate(column) for name, column in zip(names, zip(*parts))})


def _samples_of_face(patches, trims, face, area_mm2, spacing_mm):
    patch, box, state = served_pieces(patches, trims, face, spacing_mm)
    u, v = in_face_parameters(patches, patch, (box[:, 0] + box[:, 1]) / 2, (box[:, 2] + box[:, 3]) / 2)
    across = state == ACROSS
    is_border = across & ~trims.is_inside(face, u, v)
    u[is_border], v[is_border] = _border_places(patches, trims, face, patch[is_border], box[is_border])
    derivatives = patches.derivatives(face, u, v)
    shape = local_shape(derivatives, patches.sign[face] < 0)
    share = np.ones(len(u))
    share[across] = _inner_share(patches, trims, face, patch[across], box[across])
    u0, v0 = in_face_parameters(patches, patch, box[:, 0], box[:, 2])
    u1, v1 = in_face_parameters(patches, patch, box[:, 1], box[:, 3])
    stretch = np.linalg.norm(np.cross(derivatives[:, 1], derivatives[:, 2]), axis=1)
    weight = stretch * (u1 - u0) * (v1 - v0) * share
    weight = weight if weight.sum() > 0 else np.ones_like(weight)
    normal = np.where(shape.is_regular[:, None], shape.normal, np.nan)
    return (shape.point_mm, normal, weight * (area_mm2 / weight.sum()), np.full(len(u), face), u, v, is_border)


def served_pieces(patches, trims, face, spacing_mm):
    """Patches (n,), local rectangles (n, 4) and trim states (n,) of pieces of a face that one point each serves.

    No point of a piece is farther than `spacing_mm` from its middle, or half of that across the border.
    """
    patch, box = whole_patches(patches, face)
    work, done = np.empty((*(patches.patch[patch][:, 2:4].max(axis=0) + 1), 4)), []
    for _ in range(ROUNDS):
        state = trim_states(patches, trims, patch, box)
        patch, box, state = (a[state != OUTSIDE] for a in (patch, box, state))
        size = np.empty((len(patch), 6))
        _sizes(patches.coefficients, patches.patch, patch, box, work, size)
        served = size[:, 3] * np.where(state == ACROSS, 2.0, 1.0) <= spacing_mm
        done.append((patch[served], box[served], state[served]))
        patch, box, size = patch[~served], box[~served], size[~served]
        patch, box = halves(patch, box, side_to_cut(box, size[:, 4], size[:, 5]))
        if not len(patch):
            break
    return tuple(np.concatenate(column) for column in zip(*done))


@njit
def _sizes(coefficients, rows, patch, box, work, out):
    for k in range(len(box)):
        size_of_piece(coefficients, rows[patch[k]], box[k], work, out[k])


def _border_places(patches, trims, face, patch, box):
    """Parameters of a border point in each piece."""
    u0, v0 = in_face_parameters(patches, patch, box[:, 0], box[:, 2])
    u1, v1 = in_face_parameters(patches, patch, box[:, 1], box[:, 3])
    uv = np.empty((len(patch), 2))
    _border_rows(trims.arrays, face, np.column_stack([u0, u1, v0, v1]), uv)
    return uv[:, 0], uv[:, 1]


@njit
def _border_rows(trims, face, box, out):
    for k in range(len(box)):
        if not point_on_border(trims, face, box[k], out[k]):
            out[k, U], out[k, V] = (box[k, U_LOW] + box[k, U_HIGH]) / 2, (box[k, V_LOW] + box[k, V_HIGH]) / 2


def _inner_share(patches, trims, face, patch, box):
    """(n,) share of each piece inside the trim, counted on a small grid."""
    step = (np.arange(SHARES) + 0.5) / SHARES
    a, b = (g.ravel() for g in np.meshgrid(step, step, indexing="ij"))
    s, t = box[:, :1] + a * (box[:, 1:2] - box[:, :1]), box[:, 2:3] + b * (box[:, 3:] - box[:, 2:3])
    u, v = in_face_parameters(patches, np.repeat(patch, len(a)), s.ravel(), t.ravel())
    return trims.is_inside(face, u, v).reshape(-1, len(a)).mean(axis=1)
