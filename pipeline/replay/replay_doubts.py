"""Moves that the replay's cells leave undecided, looked at once more with the exact stock that stands before each.

The cells of the replay bound what earlier clampings have left only as finely as the z-map is; here it is asked anew,
down to CELL_MM, in the region that a part of the tool passes over.
"""

import numpy as np

from cuspline.program.program import Kind
from cuspline.replay.replay_kernel import RAPID, UNCUT
from cuspline.replay.replay_stock import CELL_MM
from cuspline.shop.cutters import cylinders_of
from cuspline.values import fixed_math as fixed

MOST_CELLS = 20_000         # of one size: so many are no fin, the move meets stock
MOST_ROWS = 40              # more of them are a program that is wrong as a whole
DIAGONAL = np.sqrt(2.0) * (1 + 1e-6)        # of half a cell's side to its corner, rounding included
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])


def cleared(rows, posted, script, wanted_mm, stock):
    """Of undecided moves those that surely meet no stock.

    Args:
        rows: (k,) of PostedMoves.   script: of `replay`.
        wanted_mm: (3,) distance by kind: rapids, shank, holder.
        stock: scene.FoundStock with `within_before`.
    Returns:
        list of rows.
    """
    left, found = list(rows) if len(rows) <= MOST_ROWS else [], []
    while left:                                 # what stands before one of them stood there before those behind it too
        within = stock.within_before(left[0])
        clear = [row for row in left if _is_clear(row, posted, script, wanted_mm, stock, within)]
        found += clear
        left = [row for row in left[1:] if row not in clear]
    return found


def _is_clear(row, posted, script, wanted_mm, stock, within):
    if posted.kind[row] >= Kind.ARC_CW:
        return False
    _, of, cutter, _, _, parts, kinds = script
    k = cutter[np.flatnonzero(of == row)[0]]
    ends = np.array([posted.start_mm[row], posted.end_mm[row]])
    lowest = ends[:, 2].min()
    for (*frustum, grow), (owner, kind) in zip(parts, kinds):
        if owner != k or kind == UNCUT or (kind == RAPID and posted.kind[row] != Kind.RAPID):
            continue
        more = grow + wanted_mm[kind]
        if not all(stands_below(ends[:, :2], radius + more, lowest + z - more, within, stock.min_mm, stock.max_mm)
                   for z, radius in cylinders_of(*frustum)):
            return False
    return True


def stands_below(ends, radius_mm, floor_mm, within, low, high):
    """Whether all stock within a radius of a way between two ends (2, 2) stands below a height: surely, if True."""
    first = np.maximum(ends.min(axis=0) - radius_mm, low[:2])
    last = np.minimum(ends.max(axis=0) + radius_mm, high[:2])
    if (first > last).any():
        return True
    cells, half = (first + last)[None] / 2, float((last - first).max()) / 2
    while half > CELL_MM / 2:
        cells, half = (cells[:, None] + half / 2 * CORNERS).reshape(-1, 2), half / 2
        over = _beside(cells, ends) <= radius_mm + DIAGONAL * half
        cells = cells[over & ((cells - half <= last) & (cells + half >= first)).all(axis=1)]
        cells = cells[within(cells, DIAGONAL * half) > floor_mm] if len(cells) else cells
        if not len(cells):
            return True
        if len(cells) > MOST_CELLS:
            return False
    return False


def _beside(points, ends):
    """(n,) distance of points from a straight way."""
    way = ends[1] - ends[0]
    share = np.clip(fixed.matmul(points - ends[0], way) / max(fixed.matmul(way, way), 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - ends[0] - share[:, None] * way, axis=1)
