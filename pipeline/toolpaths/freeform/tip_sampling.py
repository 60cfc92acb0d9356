"""Exact tips along curves, as close together as their shape asks.

A chord between two tips is tested at its quarter points against the lowered cutter.  It holds when it lies
nowhere lower than three quarters of the tolerance below them nor further than the tolerance above, and when
the path cannot bulge by the last quarter between two of them: whatever stands out of the part lifts the
cutter along a curve no sharper than its corner,

    |d²z/ds²| <= (n_z² + n_t²) / (rc n_z³),        n = normal at the contact, t = direction of travel.

Over an edge the low side counts EDGE_SHARE of that: what a cutter takes off an edge shows larger along the
normals of the faces beside it.  A chord that fails is cut in four.  One that fails though it is shorter than
SMALLEST_SHARE of the tolerance is a step: the tool goes straight up on its low side, then across.  A wall that the
cutter's side grazes between two quarter points is entered by less than a quarter of the tolerance.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.scallop.stepover import segment_length_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen

LOW_SHARE = 0.75            # of the tolerance, for what is measured at the quarter points
BULGE_SHARE = 0.25          # of the tolerance, for what may hide between them
EDGE_SHARE = 0.4            # of that where the cutter rolls over an edge
SMALLEST_SHARE = 0.5        # of the tolerance
QUARTERS = np.array([0.25, 0.5, 0.75])


@dataclass(frozen=True, eq=False, kw_only=True)
class DenseTips:
    """Tips along runs, in order; straight lines between them follow the true path within the tolerance."""

    tip_mm: np.ndarray          # (n, 3)
    run: np.ndarray             # (n,) run each belongs to, rising
    is_corner: np.ndarray       # (n,) ends of runs and of steps: no chord may pass over them
    low_mm: np.ndarray          # (n,) how far below this tip a path may lie

    def __post_init__(self):
        object.__setattr__(self, "tip_mm", frozen(self.tip_mm, (None, 3), "tip_mm"))
        object.__setattr__(self, "run", frozen(self.run, (len(self.tip_mm),), "run", int))
        object.__setattr__(self, "is_corner", frozen(self.is_corner, (len(self.tip_mm),), "is_corner", bool))
        object.__setattr__(self, "low_mm", frozen(self.low_mm, (len(self.tip_mm),), "low_mm"))


def quarter_length_mm(dropper, tolerance_mm):
    """Distance of test points on level ground: the segment rule for a path of the cutter's corner radius.

    That is the path over an edge, the sharpest there is; a flat cutter (no corner) takes its radius.
    """
    return segment_length_mm(0.0, dropper.corner_radius_mm or dropper.radius_mm, BULGE_SHARE * tolerance_mm)


def dense_tips(scale, dropper, along_mm, run, tolerance_mm):
    """Refine stations until straight lines between the tips hold the tolerance.

    Args:
        scale: CurveScale.
        dropper: Dropper.
        along_mm: (n,) stations in rising order; between two of one run the curve is straight in plan and
            something lies beneath the cutter.
        run: (n,) run of each.
        tolerance_mm: largest gouge (vertical) and largest air (square to the chord).
    Returns:
        DenseTips.
    """
    allowed = LOW_SHARE * tolerance_mm
    tips, normals, low = _dropped(dropper, scale.at(along_mm), allowed)
    held = _held(tips, run)
    along_mm, run, tips, normals, low = along_mm[held], run[held], tips[held], normals[held], low[held]
    rows = [np.column_stack([along_mm, tips, run, np.zeros(len(run)), low])]    # along, z, run, place in a step, low
    same = np.flatnonzero(np.diff(run) == 0)
    ends = np.column_stack([along_mm[same], along_mm[same + 1]])
    z, owner = np.column_stack([tips[same], tips[same + 1]]), run[same]
    n, low = np.stack([normals[same], normals[same + 1]], axis=1), np.column_stack([low[same], low[same + 1]])
    while len(ends):
        inner = ends[:, :1] + QUARTERS * (ends[:, 1:] - ends[:, :1])
        spots = np.column_stack([ends[:, 0], inner, ends[:, 1]])
        mid_z, mid_n, mid_low = _dropped(dropper, scale.at(spots[:, 1:4].ravel()), allowed)
        all_z = np.column_stack([z[:, 0], mid_z.reshape(-1, 3), z[:, 1]])
        all_z = np.where(np.isinf(all_z), z.min(axis=1)[:, None], all_z)
        all_n = np.concatenate([n[:, :1], mid_n.reshape(-1, 3, 3), n[:, 1:]], axis=1)
        all_low = np.column_stack([low[:, 0], mid_low.reshape(-1, 3), low[:, 1]])
        direction = scale.at(ends[:, 1]) - scale.at(ends[:, 0])
        level, bend = _judged(spots, all_z, all_n, all_low, direction, dropper.corner_radius_mm, tolerance_mm)
        tiny = spots[:, 4] - spots[:, 0] <= SMALLEST_SHARE * tolerance_mm
        rows.append(_steps(spots, all_z, owner, tiny & ~level, allowed))
        more = ~tiny
        rows.append(np.column_stack([spots[more, 1:4].ravel(), all_z[more, 1:4].ravel(), np.repeat(owner[more], 3),
                                     np.zeros(3 * more.sum()), all_low[more, 1:4].ravel()]))
        split = ~tiny & ~(level & bend)
        pairs = lambda a: np.stack([a[split, :-1], a[split, 1:]], axis=2).reshape(-1, 2, *a.shape[2:])
        ends, z, low, owner = pairs(spots), pairs(all_z), pairs(all_low), np.repeat(owner[split], 4)
        n = np.stack([all_n[split, :-1], all_n[split, 1:]], axis=2).reshape(-1, 2, 3)
    return _in_order(scale, np.vstack(rows))


def _held(tips, run):
    """(n,) bool: stations with something beneath, of runs that keep two: one that ends where the cutter just grazes a wall may
    come out on either side of it when it is asked again."""
    held = np.isfinite(tips)
    return held & (np.bincount(run, held, minlength=1) >= 2)[run]


def _dropped(dropper, xy, allowed_mm):
    """Tips, normals, and how far below each tip a path may lie."""
    c = dropper.contacts(xy)
    return c.tip_z_mm.copy(), c.normal, np.where(c.is_edge, EDGE_SHARE * allowed_mm, allowed_mm)


def _judged(spots, z, n, low, direction, corner_mm, tolerance_mm):
    """(is level (m,), cannot bulge (m,)) of chords with five tips each."""
    length = spots[:, 4] - spots[:, 0]
    chord = z[:, :1] + np.r_[0.0, QUARTERS, 1.0] * (z[:, 4:] - z[:, :1])
    gap = chord - z
    cosine = length / np.maximum(fixed.hypot(length, z[:, 4] - z[:, 0]), 1e-300)
    level = (gap >= -low).all(axis=1) & (gap * cosine[:, None] <= tolerance_mm).all(axis=1)
    if corner_mm == 0.0:
        return level, np.ones(len(level), bool)
    ahead = direction / np.maximum(np.linalg.norm(direction, axis=1), 1e-300)[:, None]
    up = np.maximum(np.nan_to_num(n[..., 2], nan=1.0), 1e-6)
    along = np.nan_to_num(np.einsum("mki,mi->mk", n[..., :2], ahead))
    sharpest = ((up ** 2 + along ** 2) / (up * up * up)).max(axis=1) / corner_mm
    return level, (length / 4) ** 2 * sharpest / 8 <= BULGE_SHARE * tolerance_mm * (1 + 1e-9)


def _steps(spots, z, owner, which, allowed_mm):
    """Rows that lead straight up, across and straight down over chords that are steps."""
    top, m = z[which].max(axis=1), int(which.sum())
    side = lambda k, place: np.column_stack([spots[which, k], top, owner[which], np.full(m, place),
                                             np.full(m, allowed_mm)])
    return np.vstack([side(0, 1.0), side(4, -1.0)])


def _in_order(scale, rows):
    """Rows sorted along the runs; a step's rows stand after its first and before its last tip."""
    rows = rows[np.lexsort((rows[:, 3], rows[:, 0], rows[:, 2]))]
    run = rows[:, 2].astype(int)
    if not len(rows):
        return DenseTips(tip_mm=np.zeros((0, 3)), run=run, is_corner=np.zeros(0, bool), low_mm=np.zeros(0))
    near = lambda a, b: (np.abs(a[:, 0] - b[:, 0]) < 1e-12) & (np.abs(a[:, 1] - b[:, 1]) < 1e-12)
    again = np.r_[False, near(rows[1:], rows[:-1]) & (np.diff(run) == 0)]
    step = rows[:, 3] != 0
    beside = step | np.r_[step[1:], False] | np.r_[False, step[:-1]]
    ends = np.r_[True, np.diff(run) != 0] | np.r_[np.diff(run) != 0, True]
    corner = beside | ends
    # of rows that coincide the first stays, a corner when any of them is one
    group = np.cumsum(~again) - 1
    is_corner = np.zeros(group[-1] + 1, bool)
    np.logical_or.at(is_corner, group, corner)
    low = np.full(group[-1] + 1, np.inf)
    np.minimum.at(low, group, rows[:, 4])
    keep = ~again
    return DenseTips(tip_mm=np.column_stack([scale.at(rows[keep, 0]), rows[keep, 1]]), run=run[keep],
                     is_corner=is_corner, low_mm=low)
