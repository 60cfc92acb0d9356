"""A path that gouges, made clean: lifted, trimmed back, or with its gouging moves left out; and what was done to it."""

from dataclasses import dataclass

import numpy as np

from cuspline.arrays import frozen
from cuspline.errors import ToolpathError
from cuspline.toolpaths.path_gouges import path_gouges

HOW = ("lift", "trim", "leave out")
TRIM_HALVINGS = 14          # places a trimmed end within 1/16384 of its move


@dataclass(frozen=True, eq=False, kw_only=True)
class CorrectedPath:
    """Runs of straight moves that gouge by no more than the tolerance, and the report of the correction."""

    runs: tuple             # of (m, 3) tips, m >= 2, in the path's order
    how: str
    depth_mm: np.ndarray    # (n - 1,) bound of each move's gouge before
    is_changed: np.ndarray  # (n - 1,) bool: moves that were lifted, shortened or left out
    lift_mm: np.ndarray     # (n,) how far each point was raised; zeros unless lifted

    def __post_init__(self):
        object.__setattr__(self, "runs", tuple(frozen(r, (None, 3), "run") for r in self.runs))
        for name, dtype in (("depth_mm", float), ("is_changed", bool), ("lift_mm", float)):
            object.__setattr__(self, name, frozen(getattr(self, name), (None,), name, dtype))


def corrected_path(part, tips_mm, radius_mm, corner_radius_mm, tolerance_mm, how):
    """Keep a path from gouging deeper than the tolerance.

    Args:
        part: exact_drop.ExactPart.
        tips_mm: (n, 3), n >= 2, straight moves from each to the next.
        radius_mm, corner_radius_mm, tolerance_mm: as `path_gouges`.
        how: "lift" both ends of a gouging move by its depth, "trim" it back from both ends as far as they are clean,
            or "leave out" the whole move.
    Returns:
        CorrectedPath.
    Raises:
        ToolpathError: fewer than two points, or another way of correcting.
    """
    tips = np.ascontiguousarray(tips_mm, float)
    if how not in HOW:
        raise ToolpathError(f"a gouging path cannot be corrected by {how!r}: choose one of {', '.join(HOW)}")
    if len(tips) < 2:
        raise ToolpathError(f"a path of {len(tips)} point has no moves to correct: give at least two")
    cutter = radius_mm, corner_radius_mm, tolerance_mm
    depth, _ = path_gouges(part, tips[:-1], tips[1:], *cutter)
    bad = depth > tolerance_mm
    lift = np.zeros(len(tips))
    if how == "lift":
        need = np.where(bad, depth, 0.0)
        lift = np.maximum(np.r_[need, 0.0], np.r_[0.0, need])
        runs = [tips + lift[:, None] * (0.0, 0.0, 1.0)]
    else:
        ends = _clean_ends(part, tips, np.flatnonzero(bad), cutter) if how == "trim" else {}
        runs = _runs(tips, bad, ends)
    changed = bad if how != "lift" else (lift[:-1] > 0) | (lift[1:] > 0)
    return CorrectedPath(runs=tuple(runs), how=how, depth_mm=depth, is_changed=changed, lift_mm=lift)


def _clean_ends(part, tips, rows, cutter):
    """{move: (tip where it must end, tip where it may begin again)}; each end stays clean up to there."""
    start, end = tips[rows], tips[rows + 1]
    kept = []
    for a, b in ((start, end), (end, start)):
        low, high = np.zeros(len(rows)), np.ones(len(rows))
        for _ in range(TRIM_HALVINGS):
            middle = (low + high) / 2
            depth, _ = path_gouges(part, a, a + middle[:, None] * (b - a), *cutter)
            clean = depth <= cutter[2]
            low, high = np.where(clean, middle, low), np.where(clean, high, middle)
        kept.append(a + low[:, None] * (b - a))
    return {int(k): (p, q) for k, p, q in zip(rows, *kept)}


def _runs(tips, bad, ends):
    """Split the path at its bad moves; what is left of a trimmed one stays with its neighbours."""
    runs, run = [], [tips[0]]
    for k in range(len(tips) - 1):
        if bad[k]:
            stop, again = ends.get(k, (tips[k], tips[k + 1]))
            runs.append([*run, stop] if (stop != tips[k]).any() else run)
            run = [again] if (again != tips[k + 1]).any() else []
        run.append(tips[k + 1])
    return [np.array(r) for r in [*runs, run] if len(r) > 1]
