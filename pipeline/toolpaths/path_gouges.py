"""Gouges of straight moves between their points, bounded from above and narrowed down to a tolerance."""

import numpy as np
from numba import njit, prange

from cuspline.errors import ToolpathError
from cuspline.toolpaths.exact_drop import TOLERANCE_MM, checked_radii_mm
from cuspline.toolpaths.move_gouges import gouge_of_move, gouge_scratch

CHUNK = 64                  # moves a thread takes at a time
SERIAL_ROWS = 256


def path_gouges(part, start_mm, end_mm, radius_mm, corner_radius_mm, tolerance_mm):
    """How deep straight moves cut into the part, at any place along them.

    The bound is within the tolerance of the true depth, except where a cutter passes within 1e-6 mm of an upright
    wall, or touches along so much of the part that `move_gouges.MOST_BOXES` do not settle it: there what is open
    counts as cut, the safe side.  Bounds are rounded outward by `move_gouges.OUTWARD_MM`.

    Args:
        part: exact_drop.ExactPart.
        start_mm, end_mm: (n, 3) tips, finite.
        radius_mm, corner_radius_mm: R > 0 and rc, 0 (flat) to R (ball).
        tolerance_mm: > 1e-5.
    Returns:
        (n,) upper bound of the depth, >= 0, in mm along z; (n,) where along the move (0..1) it is deepest.
    Raises:
        ToolpathError: radii or a tolerance that cannot be.
    """
    R, rc = checked_radii_mm(radius_mm, corner_radius_mm)
    if not tolerance_mm > TOLERANCE_MM:
        raise ToolpathError(f"a gouge tolerance of {tolerance_mm} mm is finer than the drop-cutter's own "
                            f"{TOLERANCE_MM} mm: ask for more than that")
    start, end = np.ascontiguousarray(start_mm, float), np.ascontiguousarray(end_mm, float)
    depth, worst = np.empty(len(start)), np.empty(len(start))
    args = start, end, R, rc, float(tolerance_mm)
    if len(start) > SERIAL_ROWS:
        _gouges_in_parallel(part.arrays[:9], part.arrays[9], *args, depth, worst)
    else:
        _gouge_rows(part.arrays, *args, 0, len(start), depth, worst)
    return depth, worst


@njit(cache=True, error_model="numpy")
def _gouge_rows(tree, start, end, R, rc, tolerance, low, high, depth, worst):
    scratch = gouge_scratch()
    for i in range(low, high):
        depth[i], worst[i] = gouge_of_move(tree, start[i], end[i], R, rc, tolerance, scratch)


@njit(cache=True, parallel=True, error_model="numpy")
def _gouges_in_parallel(tree, trims, start, end, R, rc, tolerance, depth, worst):
    n = start.shape[0]
    for block in prange((n + CHUNK - 1) // CHUNK):      # parallel loops take no tuples of tuples
        _gouge_rows(tree + (trims,), start, end, R, rc, tolerance, block * CHUNK, min(n, block * CHUNK + CHUNK),
                    depth, worst)
