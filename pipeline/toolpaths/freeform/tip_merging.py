"""Fewest straight moves through dense tips: each runs as far as the tolerance allows."""

import math

import numpy as np

from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z

HIGH_SHARE = 0.9            # of the tolerance, for air at the dense tips
STRAIGHT_MM = 1e-9          # dense tips this near a chord in plan lie on it: they have tested it already


def merged_rows(dense, dropper, tolerance_mm, lateral_mm):
    """Rows of the dense tips that stay.

    Where a chord leaves the curve in plan it is tested against the lowered cutter below itself, beside every
    dense tip it passes; one that fails is split.

    Args:
        dense: DenseTips.
        dropper: Dropper.
        tolerance_mm: as the dense tips were made with.
        lateral_mm: how far a chord may leave the curve in plan.
    Returns:
        (k,) rising rows.
    """
    keep = _greedy(dense.tip_mm, dense.is_corner, dense.low_mm, HIGH_SHARE * tolerance_mm, max(lateral_mm, STRAIGHT_MM))
    untested = np.ones(len(keep), bool)
    while True:
        rows = np.flatnonzero(keep)
        chord, spots, share, inner = _beside(dense.tip_mm, rows, untested)
        if not len(spots):
            return rows
        tips = dropper.tips_mm(spots)
        first, last = dense.tip_mm[rows[chord]], dense.tip_mm[rows[chord + 1]]
        gap = first[:, 2] + share * (last[:, 2] - first[:, 2]) - tips
        way = np.linalg.norm(last - first, axis=1)
        cosine = np.linalg.norm((last - first)[:, :2], axis=1) / way
        bad = (gap < -dense.low_mm[inner]) | (gap * cosine > tolerance_mm)
        untested[:] = False
        failed = np.unique(chord[bad])
        untested[rows[failed]] = True
        middle = (rows[failed] + rows[failed + 1]) // 2
        keep[middle] = untested[middle] = True


def straight_rows(tip_mm, within_mm):
    """(k,) rising rows of tips (n, 3) of one height that stay where chords may leave the others so far in plan."""
    none, free = np.zeros(len(tip_mm), bool), np.full(len(tip_mm), within_mm)
    return np.flatnonzero(_greedy(np.ascontiguousarray(tip_mm), none, free, within_mm, within_mm))


def _beside(tips, rows, untested):
    """Spots below chords that leave the curve: (chord (n,), xy (n, 2), share of the chord (n,), row beside it (n,))."""
    inner = np.ones(len(tips), bool)
    inner[rows] = False
    inner = np.flatnonzero(inner)
    chord = np.searchsorted(rows, inner) - 1
    use = untested[rows[chord]]
    inner, chord = inner[use], chord[use]
    first, last = tips[rows[chord], :2], tips[rows[chord + 1], :2]
    d = last - first
    share = np.clip(((tips[inner, :2] - first) * d).sum(axis=1) / np.maximum((d ** 2).sum(axis=1), 1e-300), 0.0, 1.0)
    spots = first + share[:, None] * d
    off = np.linalg.norm(tips[inner, :2] - spots, axis=1) > STRAIGHT_MM
    bent = np.isin(chord, chord[off])
    return chord[bent], spots[bent], share[bent], inner[bent]


@njit(error_model="numpy")
def _holds(p, a, b, low, high, lateral):
    """All points between a and b lie beside the chord within the bounds."""
    dx, dy, dz = p[b, X] - p[a, X], p[b, Y] - p[a, Y], p[b, Z] - p[a, Z]
    level2 = dx * dx + dy * dy
    if level2 == 0.0:
        return False
    steep = math.sqrt(level2 / (level2 + dz * dz))
    last = 0.0
    for k in range(a + 1, b):
        ex, ey = p[k, X] - p[a, X], p[k, Y] - p[a, Y]
        t = (ex * dx + ey * dy) / level2
        if t < last or t > 1.0:
            return False
        last = t
        side = ex - t * dx, ey - t * dy
        if side[X] * side[X] + side[Y] * side[Y] > lateral * lateral:
            return False
        gap = p[a, Z] + t * dz - p[k, Z]
        if gap < -low[k] or gap * steep > high:
            return False
    return True


@njit(error_model="numpy")
def _greedy(p, corner, low, high, lateral):
    """(n,) bool: points that stay; from each the farthest chord that doubling and halving finds."""
    n = len(p)
    keep = np.zeros(n, np.bool_)
    limit = np.empty(n, np.int64)           # next corner at or after each point
    nearest = n - 1
    for k in range(n - 1, -1, -1):
        limit[k] = nearest
        if corner[k]:
            nearest = k
    a = 0
    keep[0] = True
    while a < n - 1:
        stop = limit[a]
        good, reach = a + 1, 2
        bad = stop + 1
        while a + reach <= stop:
            if _holds(p, a, a + reach, low, high, lateral):
                good = a + reach
                reach *= 2
            else:
                bad = a + reach
                break
        if bad == stop + 1 and good < stop and _holds(p, a, stop, low, high, lateral):
            good = stop
        while bad - good > 1:
            middle = (good + bad) // 2
            if _holds(p, a, middle, low, high, lateral):
                good = middle
            else:
                bad = middle
        a = good
        keep[a] = True
    return keep
