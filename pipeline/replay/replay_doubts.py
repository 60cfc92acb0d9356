"""Moves that the replay's cells leave undecided, looked at once more with the exact stock that stands before each.

The cells of the replay bound what earlier clampings have left only as finely as the z-map is; here it is asked anew,
down to CELL_MM, in the region that a part of the tool passes over.  Moves lie beside each other: they are asked
together, and by halves where not all of them are clear.  So are cones, as the cylinders that hold them.
"""

from itertools import groupby
from math import inf, sqrt

import numpy as np

from cuspline.program.program import Kind
from cuspline.replay.replay_kernel import RAPID, UNCUT
from cuspline.replay.replay_stock import CELL_MM
from cuspline.shop.cutters import slices_of
from cuspline.values.compiled import njit
from cuspline.values.rows import X_HIGH, X_LOW, Y_HIGH, Y_LOW, X, Y

MOST_CELLS = 20_000         # of one size under one move: so many are no fin, it meets stock
OF_SLICES = 0.1             # share of these under a slice of a cone that can still be halved
FINEST_MM = 0.05            # of radius, from which on no slice is halved
MORE_CELLS = 0.025          # share of these, that each move asked together with the first adds
MOST_ASKED = 3_000_000      # cells in all: a program that is wrong as a whole need not be looked at to its end
MOST_TOGETHER = 512         # moves
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
    left, found, asked = [row for row in rows if posted.kind[row] < Kind.ARC_CW], [], _Asked()
    parts = _Parts(posted, script, wanted_mm)
    while left and not asked.is_enough:         # what stands before one of them stood there before those behind it too
        within = asked.counted(stock.within_before(left[0]))
        clear = {row for group in parts.groups(left) for row in _clear_among(group, parts, within, stock, asked)}
        found += clear
        left = [row for row in left[1:] if row not in clear]
    return found


class _Asked:
    """How many cells have been asked."""

    def __init__(self):
        self.cells = 0

    @property
    def is_enough(self):
        return self.cells > MOST_ASKED

    def counted(self, within):
        """The same function, counted."""
        def ask(xy_mm, radius_mm):
            self.cells += len(xy_mm)
            return within(xy_mm, radius_mm)
        return ask


class _Parts:
    """What of the tools is held against stock."""

    def __init__(self, posted, script, wanted_mm):
        self.posted, self.wanted_mm = posted, wanted_mm
        _, self.of, self.cutter, _, _, parts, kinds = script
        self.parts = list(zip(parts, kinds))

    def groups(self, rows):
        """Rows that may be asked together, in their order: the same tool, all rapids or none."""
        for _, group in groupby(rows, self._key):
            group = list(group)
            yield from (group[k:k + MOST_TOGETHER] for k in range(0, len(group), MOST_TOGETHER))

    def slices_of(self, row):
        """Slices of what is held against stock, frusta z0, r0, z1, r1 above the tip, each with the distance wanted."""
        tool, is_rapid = self._key(row)
        for (*frustum, grow), (owner, kind) in self.parts:
            if owner == tool and kind != UNCUT and (kind != RAPID or is_rapid):
                yield from ((one, grow + self.wanted_mm[kind]) for one in slices_of(*frustum))

    def _key(self, row):
        return int(self.cutter[np.searchsorted(self.of, row)]), bool(self.posted.kind[row] == Kind.RAPID)


def _clear_among(rows, parts, within, stock, asked):
    """Of rows of one group those that are surely clear of the stock, as a list."""
    ends = np.stack([parts.posted.start_mm[rows], parts.posted.end_mm[rows]], axis=1)
    lowest, ways = ends[:, :, 2].min(axis=1), np.ascontiguousarray(ends[:, :, :2])
    if all(_is_clear(frustum, more, (ways, lowest), within, stock, asked) for frustum, more in parts.slices_of(rows[0])):
        return rows
    if len(rows) == 1 or asked.is_enough:
        return []
    half = len(rows) // 2
    return [row for some in (rows[:half], rows[half:]) for row in _clear_among(some, parts, within, stock, asked)]


def _is_clear(frustum, more_mm, moved, within, stock, asked):
    """Whether a frustum above tips is surely clear of the stock by a distance; `moved`: ways in plan, the lowest tip of each."""
    z0, r0, z1, r1 = frustum
    ways, lowest = moved
    is_last = r1 - r0 < FINEST_MM
    most = MOST_CELLS if is_last else OF_SLICES * MOST_CELLS
    if stands_below(ways, lowest + z0 - more_mm, max(r0, r1) + more_mm, within, stock, most):
        return True
    if is_last or asked.is_enough:
        return False
    z, r = (z0 + z1) / 2, (r0 + r1) / 2
    return all(_is_clear(half, more_mm, moved, within, stock, asked) for half in ((z0, r0, z, r), (z, r, z1, r1)))


def stands_below(ways, floors_mm, radius_mm, within, stock, most_cells=MOST_CELLS):
    """Whether all stock within a radius of straight ways stands below each one's height: surely, if True.

    Args:
        ways: (k, 2, 2) their ends in plan.   floors_mm: (k,).
        within: function of places (n, 2) and a radius to heights (n,) that no stock so near exceeds.
        stock: scene.FoundStock.
        most_cells: of one size in doubt under one way: beyond, False.
    """
    low, high = np.array(stock.min_mm[:2]), np.array(stock.max_mm[:2])
    first, last = np.maximum(ways.min(axis=(0, 1)) - radius_mm, low), np.minimum(ways.max(axis=(0, 1)) + radius_mm, high)
    if (first > last).any():
        return True
    box = np.array([first[X], last[X], first[Y], last[Y]])
    cells, half = (first + last)[None] / 2, float((last - first).max()) / 2
    while half > CELL_MM / 2:
        cells, half = (cells[:, None] + half / 2 * CORNERS).reshape(-1, 2), half / 2
        floors = np.empty(len(cells))
        _put_floors(cells, half, box, ways, floors_mm, radius_mm + DIAGONAL * half, floors)
        cells, floors = cells[floors < inf], floors[floors < inf]
        cells = cells[within(cells, DIAGONAL * half) > floors] if len(cells) else cells
        if not len(cells):
            return True
        if len(cells) > most_cells * (1.0 + MORE_CELLS * (len(ways) - 1)):
            return False
    return False


@njit(error_model="numpy")
def _put_floors(cells, half, box, ways, heights, reach, floors):
    """The lowest height of the ways within reach of each cell's middle; infinite where none is, or the cell lies beside the box."""
    for i in range(len(cells)):
        x, y = cells[i, X], cells[i, Y]
        floors[i] = inf
        if x - half > box[X_HIGH] or x + half < box[X_LOW] or y - half > box[Y_HIGH] or y + half < box[Y_LOW]:
            continue
        for k in range(len(ways)):
            if heights[k] >= floors[i]:
                continue
            start, end = ways[k]
            dx, dy, ax, ay = end[X] - start[X], end[Y] - start[Y], x - start[X], y - start[Y]
            share = min(max((ax * dx + ay * dy) / max(dx * dx + dy * dy, 1e-300), 0.0), 1.0)
            if sqrt((ax - share * dx) ** 2 + (ay - share * dy) ** 2) <= reach:
                floors[i] = heights[k]
