"""Pieces of trimmed faces: rectangles of a patch's local parameters, halved until whoever asks is content.

A piece is known by its patch and its local rectangle (s low, s high, t low, t high), and lies outside, inside or across
the border of its face.  Borders are those of `trims`: chords closer than CHORD_MM to the true edge.
"""

import numpy as np

from cuspline.surfaces.patches import U_HIGH, U_LOW, V_HIGH, V_LOW, U, V
from cuspline.surfaces.trims import (
    BINS,
    BORDER_U_HIGH,
    BORDER_U_LOW,
    FIRST_BIN,
    IS_WHOLE,
    STRIPS_FROM,
    STRIPS_PER_V,
    U0,
    U1,
    V0,
    V1,
    is_inside,
)
from cuspline.values.compiled import njit

OUTSIDE, ACROSS, INSIDE = 0, 1, 2


def whole_patches(patches, face):
    """Patch indices (n,) and local rectangles (n, 4) of all patches of a face."""
    first, nu, nv = patches.face[face, :3]
    return np.arange(first, first + nu * nv), np.tile([-1.0, 1.0, -1.0, 1.0], (nu * nv, 1))


def halves(patch, box, side):
    """Both halves of pieces; `side` (n,): 0 cuts s, 1 cuts t."""
    first, second, row = box.copy(), box.copy(), np.arange(len(box))
    low, high = np.where(side == 1, 2, 0), np.where(side == 1, 3, 1)
    middle = (box[row, low] + box[row, high]) / 2
    first[row, high], second[row, low] = middle, middle
    return np.concatenate([patch, patch]), np.concatenate([first, second])


def side_to_cut(box, of_s, of_t):
    """(n,) 0 or 1: the side, s or t, that measures more; the wider one where a measure is not finite."""
    s_low, s_high, t_low, t_high = box.T
    is_wider = t_high - t_low > s_high - s_low      # weights that cannot be told from 0 bound nothing
    return np.where(np.isfinite(of_s) & np.isfinite(of_t), of_t > of_s, is_wider).astype(int)


def in_face_parameters(patches, patch, s, t):
    """(n,) u and v of local places."""
    u0, u1, v0, v1 = patches.span[patch].T
    return (u0 + u1 + s * (u1 - u0)) / 2, (v0 + v1 + t * (v1 - v0)) / 2


def trim_states(patches, trims, patch, box):
    """(n,) OUTSIDE, ACROSS or INSIDE for pieces."""
    u0, v0 = in_face_parameters(patches, patch, box[:, 0], box[:, 2])
    u1, v1 = in_face_parameters(patches, patch, box[:, 1], box[:, 3])
    out = np.empty(len(box), np.int64)
    _states(trims.arrays, patches.patch[patch, 0], np.column_stack([u0, u1, v0, v1]), out)
    return out


@njit
def _states(trims, face, box, out):
    for k in range(len(box)):
        out[k] = trim_state(trims, face[k], box[k])


@njit
def trim_state(trims, face, box):
    """State of one rectangle (u low, u high, v low, v high) of a face."""
    chords, bins, items, faces, strip = trims
    if faces[face, IS_WHOLE] == 1:
        return INSIDE
    count = faces[face, BINS]
    first, last = ((box[V_LOW] - strip[face, STRIPS_FROM]) * strip[face, STRIPS_PER_V],
                   (box[V_HIGH] - strip[face, STRIPS_FROM]) * strip[face, STRIPS_PER_V])
    if (last < 0.0 or first > count or box[U_HIGH] < strip[face, BORDER_U_LOW]
            or box[U_LOW] > strip[face, BORDER_U_HIGH]):
        return OUTSIDE
    low, high = max(0, min(int(first), count - 1)), max(0, min(int(last), count - 1))
    for b in range(faces[face, FIRST_BIN] + low, faces[face, FIRST_BIN] + high + 1):
        for k in range(bins[b], bins[b + 1]):
            if _meets(chords[items[k]], box):
                return ACROSS
    inside = is_inside(trims, face, (box[U_LOW] + box[U_HIGH]) / 2, (box[V_LOW] + box[V_HIGH]) / 2)
    return INSIDE if inside else OUTSIDE


@njit
def _meets(chord, box):
    """A chord and a rectangle have a point in common: no axis and no normal of the chord separates them."""
    if (max(chord[U0], chord[U1]) < box[U_LOW] or min(chord[U0], chord[U1]) > box[U_HIGH]
            or max(chord[V0], chord[V1]) < box[V_LOW] or min(chord[V0], chord[V1]) > box[V_HIGH]):
        return False
    du, dv = chord[U1] - chord[U0], chord[V1] - chord[V0]
    middle = dv * ((box[U_LOW] + box[U_HIGH]) / 2 - chord[U0]) - du * ((box[V_LOW] + box[V_HIGH]) / 2 - chord[V0])
    return abs(middle) <= abs(dv) * (box[U_HIGH] - box[U_LOW]) / 2 + abs(du) * (box[V_HIGH] - box[V_LOW]) / 2


@njit
def point_on_border(trims, face, box, out):
    """Parameters of a border point in a rectangle that lies across the border, into out (2,); False: none found."""
    chords, bins, items, faces, strip = trims
    count = faces[face, BINS]
    first, last = ((box[V_LOW] - strip[face, STRIPS_FROM]) * strip[face, STRIPS_PER_V],
                   (box[V_HIGH] - strip[face, STRIPS_FROM]) * strip[face, STRIPS_PER_V])
    low, high = max(0, min(int(first), count - 1)), max(0, min(int(last), count - 1))
    for b in range(faces[face, FIRST_BIN] + low, faces[face, FIRST_BIN] + high + 1):
        for k in range(bins[b], bins[b + 1]):
            c = chords[items[k]]
            if not _meets(c, box):
                continue
            begin, end = 0.0, 1.0                   # the chord's share within the rectangle
            for a in range(2):
                d = c[a + 2] - c[a]
                if d != 0.0:
                    p, q = (box[2 * a] - c[a]) / d, (box[2 * a + 1] - c[a]) / d
                    begin, end = max(begin, min(p, q)), min(end, max(p, q))
            share = (begin + end) / 2
            out[U] = min(max(c[U0] + share * (c[U1] - c[U0]), box[U_LOW]), box[U_HIGH])
            out[V] = min(max(c[V0] + share * (c[V1] - c[V0]), box[V_LOW]), box[V_HIGH])
            return True
    return False
