"""Joints: where two clampings have finished the same place, the step between what each of them left there."""

import numpy as np
from scipy.spatial import cKDTree

CELL_SPACINGS = 8.0       # edge of the cells in which steps are looked for, in spacings of the samples
LEAST_SHARE = 0.5         # of the largest cell's area: one that a border cuts off may hold no groove's bottom


def joints(names, alone, counts, *, finished_mm, fade_mm):
    """Steps between clampings, later less earlier.

    Args:
        names: of the clampings, in the order in which they are cut.
        alone: one residuals.Residuals a clamping, of the same samples after it alone.
        counts: how many of these samples are of each clamping's faces, one after the other.
        finished_mm: a deviation of at most this, either way, is a place that a clamping has finished.
        fade_mm: nearer than this to what one of them left unfinished its last pass fades out: no joint.
    Returns:
        one list a clamping, of dicts: the earlier clamping, the area that both finished, the mean step over it, the
        largest step between the lowest points of a small cell and its place (part coordinates).  A step is positive
        where the later one left more.
    """
    found, ends = [[] for _ in names], np.cumsum([0, *counts])
    for late in range(len(names)):
        mine = slice(ends[late], ends[late + 1])
        for early in range(late):
            rows = ends[late] + _in_both(alone[early], alone[late], mine, finished_mm, fade_mm)
            if len(rows):
                found[late].append({"setup": names[late], "with": names[early],
                                    **_step(alone[early], alone[late], rows)})
    return found


def _in_both(before, after, mine, finished_mm, fade_mm):
    """Which of the chosen samples both finished, away from the border of what they did."""
    points = after.samples.points_mm[mine]
    inner = (after.samples.weight_mm2[mine] > 0) & ~after.is_top[mine]
    worst = np.maximum(np.abs(before.deviation_mm[mine]), np.abs(after.deviation_mm[mine]))
    rows, left = np.flatnonzero(inner & (worst <= finished_mm)), points[inner & (worst > finished_mm)]
    if not len(rows) or not len(left):
        return rows
    edge_mm = fade_mm + after.spacing_mm            # the border runs nearer by up to a spacing than a sample beyond it
    away, _ = cKDTree(left).query(points[rows], distance_upper_bound=edge_mm)
    return rows[away > edge_mm]


def _step(before, after, rows):
    """The step over chosen samples.

    Means over small cells would depend on where in them the ridges of the cusps happen to lie; what the cutters' lowest
    points have left does not, as long as a cell is as wide as a ridge.
    """
    points, weight = after.samples.points_mm[rows], after.samples.weight_mm2[rows]
    early, late = before.deviation_mm[rows], after.deviation_mm[rows]
    cell = np.floor(points / (CELL_SPACINGS * after.spacing_mm)).astype(np.int64)
    cell = np.unique(cell, axis=0, return_inverse=True)[1].reshape(-1)
    area = np.bincount(cell, weights=weight)
    step = np.where(area >= LEAST_SHARE * area.max(), _lowest(cell, late) - _lowest(cell, early), 0.0)
    worst = int(np.abs(step).argmax())
    place = np.average(points[cell == worst], axis=0, weights=weight[cell == worst])
    return {"area_mm2": float(weight.sum()), "step_mean_mm": float(np.average(late - early, weights=weight)),
            "step_max_mm": float(step[worst]), "place_mm": place.tolist()}


def _lowest(cell, values):
    """(c,) the smallest value of every cell; cells are numbered from 0, each has a value."""
    low = np.full(cell.max() + 1, np.inf)
    np.minimum.at(low, cell, values)
    return low
