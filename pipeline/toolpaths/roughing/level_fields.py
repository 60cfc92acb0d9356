r"""Plane distance fields of one level: how far each place is from where a height function passes the level.

A grid of heights is cut at the level.  Each grid edge that the cut crosses is bisected, so a vertical wall is
found as exactly as a slope; inside a cell crossings are joined straight, and every node learns its nearest
place on those lines.

    ● ● ● ○ ○      ● below the level, ○ above it
    ● ●╱○ ○ ○      the line lies where the height function says, not halfway
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y

BISECTIONS = 6          # a crossing is found to the pitch / 64, on the low side
NOWHERE, FARTHEST_SQUARE = 1e18, 1e17       # nodes²: nearest place not known, or farther off than any is carried


@dataclass(frozen=True, eq=False, kw_only=True)
class PlaneGrid:
    """Square nodes over a rectangle: x = low + i pitch, y = low + j pitch, arrays are (ny, nx)."""

    low_mm: np.ndarray          # (2,)
    pitch_mm: float
    nx: int
    ny: int

    @classmethod
    def over(cls, low_mm, high_mm, pitch_mm):
        """The smallest grid from `low_mm` on that covers the rectangle."""
        count = np.ceil((np.asarray(high_mm, float) - low_mm) / pitch_mm).astype(int) + 1
        return cls(low_mm=frozen(low_mm, (2,), "low_mm"), pitch_mm=float(pitch_mm), nx=int(count[0]), ny=int(count[1]))

    @property
    def xy_mm(self):
        """(ny * nx, 2) nodes row by row."""
        x = self.low_mm[0] + self.pitch_mm * np.arange(self.nx)
        y = self.low_mm[1] + self.pitch_mm * np.arange(self.ny)
        return np.column_stack([np.tile(x, self.ny), np.repeat(y, self.nx)])

    def sampled(self, height_mm):
        """(ny, nx) values of a function of (n, 2) places."""
        return np.ascontiguousarray(height_mm(self.xy_mm), float).reshape(self.ny, self.nx)


def level_distance_mm(grid, is_low, is_low_at):
    """Signed distance to where a height passes a level.

    Args:
        grid: PlaneGrid.
        is_low: (ny, nx) bool: at the nodes the height is at or below the level.
        is_low_at: function of (n, 2) places -> (n,) bool, the same anywhere.
    Returns:
        (ny, nx) positive where the height is at or below the level, negative above; +-1e9 where the
        level is not met at all.  Within a node of the line off by at most pitch² / 4 of its curvature
        radius and the bisection, farther away by a tenth of the pitch more, and within a cell of a sharp
        corner by a fraction of the pitch.
    """
    cross_x, cross_y = (_crossings(grid, is_low, is_low_at, axis) for axis in (1, 0))
    return _distances(is_low, cross_x, cross_y, grid.pitch_mm, np.zeros(is_low.shape, np.bool_), np.inf)


def inner_distance(distance, by, is_idle=None, farthest=np.inf):
    """Signed distance (ny, nx) to the line that lies `by` inside the positive side of a distance field; all in nodes.

    Args:
        distance: (ny, nx) field.
        by: how far inside.
        is_idle: (ny, nx) bool nodes that no distance is wanted for and that none has to come across; None: no node.
        farthest: distances up to this are wanted; what is farther away may come out as 1e9.
    """
    idle = np.zeros(distance.shape, np.bool_) if is_idle is None else is_idle
    return _distances(distance >= by, *_inner_crossings(distance, by), 1.0, idle, farthest)


@njit
def _inner_crossings(distance, by):
    """Share of each grid edge, along x and along y, at which a field passes a value; NaN where it does not."""
    ny, nx = distance.shape
    cross_x, cross_y = np.full((ny, nx - 1), np.nan), np.full((ny - 1, nx), np.nan)
    for j in range(ny):
        for i in range(nx):
            a = distance[j, i] - by
            if i + 1 < nx and (a >= 0.0) != (distance[j, i + 1] >= by):
                cross_x[j, i] = a / (distance[j, i] - distance[j, i + 1])
            if j + 1 < ny and (a >= 0.0) != (distance[j + 1, i] >= by):
                cross_y[j, i] = a / (distance[j, i] - distance[j + 1, i])
    return cross_x, cross_y


def _crossings(grid, is_low, is_low_at, axis):
    """Share of each grid edge along an axis at which the level is passed; NaN where it is not."""
    here, there = (is_low[:, :-1], is_low[:, 1:]) if axis == 1 else (is_low[:-1], is_low[1:])
    shares = np.full(here.shape, np.nan)
    rows, columns = np.nonzero(here != there)
    low_first = here[rows, columns]
    start = grid.low_mm + grid.pitch_mm * np.column_stack([columns, rows])
    step = np.array([grid.pitch_mm, 0.0]) if axis == 1 else np.array([0.0, grid.pitch_mm])
    low, high = np.where(low_first, 0.0, 1.0), np.where(low_first, 1.0, 0.0)
    for _ in range(BISECTIONS if len(rows) else 0):
        middle = (low + high) / 2
        below = is_low_at(start + middle[:, None] * step)
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    shares[rows, columns] = low             # the side that is known to be low
    return shares


class _Places(NamedTuple):
    """The nearest places of all nodes of a grid, or of a row of it, in grid units.

    Round the grid stands a border of one node without a place: node i, j has row j + 1 and column i + 1.
    """

    square: np.ndarray      # of the distance; NOWHERE as long as no place is known
    x: np.ndarray
    y: np.ndarray


@njit
def _no_places(ny, nx):
    shape = ny + 2, nx + 2
    return _Places(np.full(shape, NOWHERE), np.zeros(shape), np.zeros(shape))


@njit
def _row(places, j):
    return _Places(places.square[j], places.x[j], places.y[j])


@njit
def _offer(places, j, i, ax, ay, bx, by):
    """Let a node know of a piece of the line, in grid units."""
    ux, uy = bx - ax, by - ay
    square = ux * ux + uy * uy
    t = 0.0 if square == 0.0 else min(max(((i - ax) * ux + (j - ay) * uy) / square, 0.0), 1.0)
    px, py = ax + t * ux, ay + t * uy
    d = (px - i) * (px - i) + (py - j) * (py - j)
    if d < places.square[j + 1, i + 1]:
        places.square[j + 1, i + 1], places.x[j + 1, i + 1], places.y[j + 1, i + 1] = d, px, py


@njit
def _seed(is_low, cross_x, cross_y, places):
    """Join the crossings of every cell and tell the nodes around it."""
    ny, nx = is_low.shape
    ends = np.empty((4, 2))
    for j in range(ny - 1):
        for i in range(nx - 1):
            low = is_low[j, i]
            if low == is_low[j, i + 1] and low == is_low[j + 1, i] and low == is_low[j + 1, i + 1]:
                continue
            count = _crossings_of_cell(cross_x, cross_y, j, i, ends)
            for a in range(count):              # a saddle (four crossings) is fenced off all round
                for b in range(a + 1, count):
                    for jj in range(max(j - 1, 0), min(j + 3, ny)):
                        for ii in range(max(i - 1, 0), min(i + 3, nx)):
                            _offer(places, jj, ii, ends[a, X], ends[a, Y], ends[b, X], ends[b, Y])


@njit
def _crossings_of_cell(cross_x, cross_y, j, i, ends):
    """Fill x, y of where the line leaves a cell; how many there are."""
    count = 0
    if not math.isnan(cross_x[j, i]):
        ends[count, X], ends[count, Y] = i + cross_x[j, i], j
        count += 1
    if not math.isnan(cross_y[j, i + 1]):
        ends[count, X], ends[count, Y] = i + 1, j + cross_y[j, i + 1]
        count += 1
    if not math.isnan(cross_x[j + 1, i]):
        ends[count, X], ends[count, Y] = i + cross_x[j + 1, i], j + 1
        count += 1
    if not math.isnan(cross_y[j, i]):
        ends[count, X], ends[count, Y] = i, j + cross_y[j, i]
        count += 1
    return count


@njit
def _carry_from_row(to, row, y, columns, first, last, limit):
    """Tell nodes first..last-1 of a row at y the places of the three nodes beside each in another row.

    Without a branch: so compilers make it eight nodes at a time.
    """
    for i in range(first, last):
        square, px, py, x = to.square[i], to.x[i], to.y[i], columns[i]
        for k in range(-1, 2):
            ax, ay = row.x[i + k], row.y[i + k]
            d = (ax - x) * (ax - x) + (ay - y) * (ay - y)
            is_nearer = (row.square[i + k] < limit) & (d < square)
            square, px, py = (d if is_nearer else square), (ax if is_nearer else px), (ay if is_nearer else py)
        to.square[i], to.x[i], to.y[i] = square, px, py


@njit
def _carry_along(row, y, columns, first, last, step, limit):
    """Tell nodes first, first + step.. before `last` the place of the one before each in their row."""
    for i in range(first, last, step):
        if row.square[i - step] < limit:
            px, py = row.x[i - step], row.y[i - step]
            d = (px - columns[i]) * (px - columns[i]) + (py - y) * (py - y)
            if d < row.square[i]:
                row.square[i], row.x[i], row.y[i] = d, px, py


@njit
def _stretches(is_idle, out):
    """Fill first, last (k, 2) of the stretches of a row that are not idle, as `_Places` counts; how many there are."""
    count, is_inside = 0, False
    for i in range(len(is_idle)):
        if is_inside == is_idle[i]:
            out[count, 1 if is_inside else 0] = i + 1
            count, is_inside = count + (1 if is_inside else 0), not is_inside
    if is_inside:
        out[count, 1] = len(is_idle) + 1
    return count + (1 if is_inside else 0)


@njit
def _take_over(places, j, beside, is_idle, stretches, columns, limit):
    """Tell the nodes of row j what the row beside it (+-1) knows, then each other, to and fro."""
    row, y = _row(places, j + 1), float(j)
    count = _stretches(is_idle, stretches)
    for k in range(count):
        _carry_from_row(row, _row(places, j + 1 + beside), y, columns, stretches[k, 0], stretches[k, 1], limit)
    for step in (-beside, beside):
        for k in range(count):
            first, last = (stretches[k, 0], stretches[k, 1]) if step > 0 else (stretches[k, 1] - 1, stretches[k, 0] - 1)
            _carry_along(row, y, columns, first, last, step, limit)


@njit
def _sweep(places, is_idle, farthest):
    """Carry nearest places down and up the grid (Danielsson's four passes with all eight neighbours)."""
    ny, nx = is_idle.shape
    limit = min(farthest * farthest, FARTHEST_SQUARE)
    stretches, columns = np.empty((nx // 2 + 1, 2), np.int64), np.arange(nx + 2) - 1.0
    for j in range(ny):
        _take_over(places, j, -1, is_idle[j], stretches, columns, limit)
    for j in range(ny - 1, -1, -1):
        _take_over(places, j, 1, is_idle[j], stretches, columns, limit)


@njit
def _distances(is_low, cross_x, cross_y, pitch, is_idle, farthest):
    """Signed distances (ny, nx) from crossings: nearest places carried from node to node."""
    ny, nx = is_low.shape
    places = _no_places(ny, nx)
    _seed(is_low, cross_x, cross_y, places)
    _sweep(places, is_idle, farthest)
    out = np.empty((ny, nx))
    for j in range(ny):
        for i in range(nx):
            out[j, i] = (1.0 if is_low[j, i] else -1.0) * math.sqrt(places.square[j + 1, i + 1]) * pitch
    return out


@njit
def nearest_seed(is_seed, is_idle, farthest):
    """Grid coordinates (ny, nx, 2) of the nearest seed of every node, and its distance (ny, nx) in nodes.

    `is_idle` and `farthest` as in `inner_distance`; 1e9 and no place where no seed is found.
    """
    ny, nx = is_seed.shape
    places = _no_places(ny, nx)
    for j in range(ny):
        for i in range(nx):
            if is_seed[j, i]:
                places.x[j + 1, i + 1], places.y[j + 1, i + 1], places.square[j + 1, i + 1] = i, j, 0.0
    _sweep(places, is_idle, farthest)
    near, apart = np.empty((ny, nx, 2)), np.empty((ny, nx))
    for j in range(ny):
        for i in range(nx):
            near[j, i, X], near[j, i, Y] = places.x[j + 1, i + 1], places.y[j + 1, i + 1]
            apart[j, i] = math.sqrt(places.square[j + 1, i + 1])
    return near, apart
