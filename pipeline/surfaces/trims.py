"""Where on its surface a face is: borders as chords in parameter space, even-odd test in compiled kernels.

Chords leave their border by less than CHORD_MM on the part.  The answer within that distance of a border is
either; whoever must be exact there asks the edges themselves.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from cuspline.kernel import brep
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.compiled import njit
from cuspline.values.errors import DesignError
from cuspline.values.threads import in_blocks

CHORD_MM = 1e-5
LARGEST_ROUNDS = 14         # halvings of a border curve's first chords
FIRST_CHORDS = 8            # a knot span of a border curve
CHUNK = 2048
SERIAL_ROWS = 20_000
LARGEST_GAP = 1e-3          # between ends of border curves, as a share of the face's parameter range
FIRST_BIN, BINS, IS_WHOLE = range(3)                                # columns of TrimSet.face
STRIPS_FROM, STRIPS_PER_V, BORDER_U_LOW, BORDER_U_HIGH = range(4)   # of TrimSet.strip
U0, V0, U1, V1 = range(4)                                           # of TrimSet.chords
POLE_SHARE = 1e-9           # what a gap along a side that is one point counts for: enough to choose between ends there


@dataclass(frozen=True, eq=False, kw_only=True)
class TrimSet:
    """Borders of faces 0..f-1 in the parameters of their `nurbs`."""

    chords: np.ndarray      # (m, 4) u, v of one end, u, v of the other
    bins: np.ndarray        # (b + 1,) int: first item of each bin; bins are strips of equal height in v
    items: np.ndarray       # (k,) int: chords in the bins
    face: np.ndarray        # (f, 3) int: first bin, number of bins, 1 if the whole domain is the face
    strip: np.ndarray       # (f, 4) v low, strips per unit of v; u low and u high of the border

    @classmethod
    def of_faces(cls, faces):
        """Borders of `brep.Face` values, in their order.

        Raises:
            DesignError: a border that does not close in parameter space; names the face.
        """
        chords, bins, items, face, strip, first_item = [], [], [], [], [], 0
        first_chord = first_bin = 0
        for k, f in enumerate(faces):
            rows = _border_chords(f, k)
            starts, members, row = _binned(rows)
            u0, u1, v0, v1 = f.nurbs.domain
            face.append((first_bin, len(starts), int(_is_whole(rows, (u0, u1, v0, v1)))))
            strip.append(row)
            chords.append(rows)
            bins.append(starts + first_item)
            items.append(members + first_chord)
            first_item, first_chord = first_item + len(members), first_chord + len(rows)
            first_bin += len(starts)
        join = lambda parts, empty: np.concatenate(parts) if parts else np.zeros(empty)
        return cls(chords=frozen(join(chords, (0, 4)), (None, 4), "chords"),
                   bins=frozen(np.r_[join(bins, 0), first_item], (None,), "bins", np.int64),
                   items=frozen(join(items, 0), (None,), "items", np.int64),
                   face=frozen(np.reshape(face, (-1, 3)), (None, 3), "face", np.int64),
                   strip=frozen(np.reshape(strip, (-1, 4)), (None, 4), "strip"))

    @property
    def arrays(self):
        """What kernels take as one argument: (chords, bins, items, face, strip)."""
        return self.chords, self.bins, self.items, self.face, self.strip

    def is_inside(self, face, u, v):
        """(n,) bool: parameters inside the trim.

        Args:
            face: (n,) face indices, or one for all.
            u, v: (n,) parameters of the face's `nurbs`.
        """
        u, v = for_kernel(u), for_kernel(v)
        faces = for_kernel(np.broadcast_to(face, u.shape), np.int64)
        out = np.empty(len(u), np.bool_)
        in_blocks(_inside_rows, len(u), CHUNK, self.arrays, faces, u, v, out, serial_rows=SERIAL_ROWS)
        return out


def _border_chords(face, number):
    """(m, 4) chords of all border curves of a face, their ends joined."""
    loops = [_refined(face, *border) for border in brep.border_curves(face.nurbs_face)]
    u0, u1, v0, v1 = face.nurbs.domain
    scale = np.array([u1 - u0, v1 - v0])
    rows = [np.column_stack([p[:-1], p[1:]]) for p in loops]
    if loops:
        starts, ends = np.array([p[0] for p in loops]), np.array([p[-1] for p in loops])
        gaps = np.abs((ends[:, None] - starts[None]) / scale)
        poles = _collapsed(face, ends, scale)[:, None] & _collapsed(face, starts, scale)[None]
        gaps *= np.where(poles, POLE_SHARE, 1.0)
        gaps = gaps.max(axis=2)
        nearest = linear_sum_assignment(gaps)[1]        # several loops may touch in one corner
        worst = gaps[np.arange(len(loops)), nearest].max()
        if worst > LARGEST_GAP:
            raise DesignError(f"face {number} ({face.kind}): its border does not close in the surface's parameters "
                              f"(gap {worst:.3g} of its range): heal the part, or build the face anew")
        rows.append(np.column_stack([ends, starts[nearest]]))
    rows = np.concatenate(rows) if rows else np.zeros((0, 4))
    return rows[(rows[:, :2] != rows[:, 2:]).any(axis=1)]


def _collapsed(face, parameters, scale):
    """(m, 2) bool: where moving along u, along v, does not move on the part: a pole has no u of its own."""
    d = face.nurbs.derivatives(parameters[:, 0], parameters[:, 1])
    return np.linalg.norm(d[:, 1:3], axis=2) * scale < CHORD_MM


def _refined(face, at, knots):
    """(m, 2) points along a border curve: chords halved until the surface shows less than CHORD_MM between."""
    t = np.unique(np.concatenate([np.linspace(a, b, FIRST_CHORDS + 1) for a, b in zip(knots[:-1], knots[1:])]))
    if knots[-1] < knots[0]:
        t = t[::-1]
    points = at(t)
    for _ in range(LARGEST_ROUNDS):
        middle = (t[1:] + t[:-1]) / 2
        true, straight = at(middle), (points[1:] + points[:-1]) / 2
        d = face.nurbs.derivatives(true[:, 0], true[:, 1])
        off = true - straight
        far = np.linalg.norm(d[:, 1] * off[:, :1] + d[:, 2] * off[:, 1:], axis=1) > CHORD_MM
        if not far.any():
            break
        rows = np.flatnonzero(far)
        t, points = np.insert(t, rows + 1, middle[rows]), np.insert(points, rows + 1, true[rows], axis=0)
    return points


def _binned(chords):
    """First item of every strip, the chords in the strips, and (v low, strips per unit, u low, u high)."""
    if not len(chords):
        return np.zeros(1, np.int64), np.zeros(0, np.int64), (0.0, 0.0, 0.0, 0.0)
    low, high = np.minimum(chords[:, 1], chords[:, 3]), np.maximum(chords[:, 1], chords[:, 3])
    count = max(1, min(4096, len(chords)))
    per_unit = count / max(high.max() - low.min(), 1e-300)
    first = np.clip(((low - low.min()) * per_unit).astype(np.int64), 0, count - 1)
    last = np.clip(((high - low.min()) * per_unit).astype(np.int64), 0, count - 1)
    members = np.repeat(np.arange(len(chords)), last - first + 1)
    run = np.arange(len(members)) - np.repeat(np.cumsum(last - first + 1) - (last - first + 1), last - first + 1)
    strip = first[members] + run
    order = np.argsort(strip, kind="stable")
    starts = np.searchsorted(strip[order], np.arange(count))
    ends = chords[:, (0, 2)]
    return starts, members[order], (low.min(), per_unit, ends.min(), ends.max())


def _is_whole(chords, domain):
    """All chords run along the domain's border: nothing of the surface is cut away."""
    u0, u1, v0, v1 = domain
    hair_u, hair_v = 1e-9 * (u1 - u0), 1e-9 * (v1 - v0)
    on = np.zeros(len(chords), bool)
    covers = []
    for a, value, hair in ((0, u0, hair_u), (0, u1, hair_u), (1, v0, hair_v), (1, v1, hair_v)):
        here = (np.abs(chords[:, a] - value) <= hair) & (np.abs(chords[:, a + 2] - value) <= hair)
        side = (v1 - v0) if a == 0 else (u1 - u0)
        covers.append(np.abs(chords[here, 1 - a] - chords[here, 3 - a]).sum() >= (1 - 1e-6) * side)
        on |= here
    return len(chords) > 0 and on.all() and all(covers)


@njit
def is_inside(trims, face, u, v):
    """Even-odd test of one point."""
    chords, bins, items, faces, strip = trims
    if faces[face, IS_WHOLE] == 1:
        return True
    count = faces[face, BINS]
    place = (v - strip[face, STRIPS_FROM]) * strip[face, STRIPS_PER_V]
    if place < 0.0 or place > count or u < strip[face, BORDER_U_LOW] or u > strip[face, BORDER_U_HIGH]:
        return False
    b = faces[face, FIRST_BIN] + min(int(place), count - 1)
    inside = False
    for k in range(bins[b], bins[b + 1]):
        c = chords[items[k]]
        if (c[V0] <= v) != (c[V1] <= v) and c[U0] + (v - c[V0]) / (c[V1] - c[V0]) * (c[U1] - c[U0]) > u:
            inside = not inside
    return inside


@njit
def _inside_rows(trims, face, u, v, out, first, last):
    for k in range(first, last):
        out[k] = is_inside(trims, face[k], u[k], v[k])
