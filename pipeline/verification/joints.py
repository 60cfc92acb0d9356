"""Joints: where two clampings have finished the same place, the step between what each of them left there."""

import numpy as np
from scipy.spatial import cKDTree

CELL_SPACINGS = 8.0       # edge of the cells over which cusps average out, in spacings of the samples
LEAST_SAMPLES = 20        # in a cell whose mean is told


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
        largest mean step over a small cell and its place (part coordinates).  A step is positive where the later one
        left more.
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
    away, _ = cKDTree(left).query(points[rows], distance_upper_bound=fade_mm)
    return rows[away > fade_mm]


def _step(before, after, rows):
    """The step over chosen samples."""
    points, weight = after.samples.points_mm[rows], after.samples.weight_mm2[rows]
    step = after.deviation_mm[rows] - before.deviation_mm[rows]
    cell = np.floor(points / (CELL_SPACINGS * after.spacing_mm)).astype(np.int64)
    _, cell, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    cell = cell.reshape(-1)
    area = np.bincount(cell, weights=weight, minlength=len(count))
    average = lambda values: np.bincount(cell, weights=weight * values, minlength=len(count)) / area
    mean = np.where(count >= LEAST_SAMPLES, average(step), 0.0)
    worst = int(np.abs(mean).argmax())
    return {"area_mm2": float(weight.sum()), "step_mean_mm": float(np.average(step, weights=weight)),
            "step_max_mm": float(mean[worst]), "place_mm": [float(average(x)[worst]) for x in points.T]}
