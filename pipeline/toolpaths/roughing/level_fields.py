r"""Plane distance fields of one level: how far each place is from where a height function passes the level.

A grid of heights is cut at the level.  Each grid edge that the cut crosses is bisected with the
height function itself, so a vertical wall is found as exactly as a slope; inside a cell crossings
are joined straight, and every node learns its nearest place on those lines.

    ● ● ● ○ ○      ● below the level, ○ above it
    ● ●╱○ ○ ○      the line lies where the height function says, not halfway
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y

BISECTIONS = 6          # a crossing is found to the pitch / 64, on the low side


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


def level_distance_mm(grid, heights_mm, height_mm, level_mm):
    """Signed distance to where the height passes the level.

    Args:
        grid: PlaneGrid.
        heights_mm: (ny, nx) the height function at the nodes.
        height_mm: function of (n, 2) places -> (n,) heights; -inf is low.
        level_mm: the level.
    Returns:
        (ny, nx) positive where the height is at or below the level, negative above; +-1e9 where the
        level is not met at all.  Within a node of the line off by at most pitch² / 4 of its curvature
        radius and the bisection, farther away by a tenth of the pitch more, and within a cell of a sharp
        corner by a fraction of the pitch.
    """
    is_low = heights_mm <= level_mm
    cross_x = _crossings(grid, is_low, height_mm, level_mm, axis=1)
    cross_y = _crossings(grid, is_low, height_mm, level_mm, axis=0)
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


def _crossings(grid, is_low, height_mm, level_mm, axis):
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
        below = height_mm(start + middle[:, None] * step) <= level_mm
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    shares[rows, columns] = low             # the side that is known to be low
    return shares


@njit
def _offer(near, best, j, i, ax, ay, bx, by):
    """Let a node know of a piece of the line, in grid units."""
    ux, uy = bx - ax, by - ay
    square = ux * ux + uy * uy
    t = 0.0 if square == 0.0 else min(max(((i - ax) * ux + (j - ay) * uy) / square, 0.0), 1.0)
    px, py = ax + t * ux, ay + t * uy
    d = (px - i) * (px - i) + (py - j) * (py - j)
    if d < best[j, i]:
        best[j, i], near[j, i, X], near[j, i, Y] = d, px, py


@njit
def _seed(is_low, cross_x, cross_y, near, best):
    """Join the crossings of every cell and tell the nodes around it."""
    ny, nx = is_low.shape
    ends = np.empty((4, 2))
    for j in range(ny - 1):
        for i in range(nx - 1):
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
            for a in range(count):              # a saddle (four crossings) is fenced off all round
                for b in range(a + 1, count):
                    for jj in range(max(j - 1, 0), min(j + 3, ny)):
                        for ii in range(max(i - 1, 0), min(i + 3, nx)):
                            _offer(near, best, jj, ii, ends[a, X], ends[a, Y], ends[b, X], ends[b, Y])


@njit(inline="always")
def _carry(near, best, j, i, jj, ii, limit):
    if 0 <= jj < len(best) and 0 <= ii < best.shape[1] and best[jj, ii] < limit:
        px, py = near[jj, ii, X], near[jj, ii, Y]
        d = (px - i) * (px - i) + (py - j) * (py - j)
        if d < best[j, i]:
            best[j, i], near[j, i, X], near[j, i, Y] = d, px, py


@njit
def _sweep(near, best, is_idle, farthest):
    """Carry nearest places down and up the grid (Danielsson's four passes with all eight neighbours)."""
    ny, nx = best.shape
    limit = min(farthest * farthest, 1e17)
    for j in range(ny):
        for i in range(nx):
            if not is_idle[j, i] and best[j, i] > 0.0:
                for k in range(-1, 2):
                    _carry(near, best, j, i, j - 1, i + k, limit)
                _carry(near, best, j, i, j, i - 1, limit)
        for i in range(nx - 1, -1, -1):
            if not is_idle[j, i] and best[j, i] > 0.0:
                _carry(near, best, j, i, j, i + 1, limit)
    for j in range(ny - 1, -1, -1):
        for i in range(nx - 1, -1, -1):
            if not is_idle[j, i] and best[j, i] > 0.0:
                for k in range(-1, 2):
                    _carry(near, best, j, i, j + 1, i + k, limit)
                _carry(near, best, j, i, j, i + 1, limit)
        for i in range(nx):
            if not is_idle[j, i] and best[j, i] > 0.0:
                _carry(near, best, j, i, j, i - 1, limit)


@njit
def _distances(is_low, cross_x, cross_y, pitch, is_idle, farthest):
    """Signed distances (ny, nx) from crossings: nearest places carried from node to node."""
    ny, nx = is_low.shape
    best, near = np.full((ny, nx), 1e18), np.empty((ny, nx, 2))
    _seed(is_low, cross_x, cross_y, near, best)
    _sweep(near, best, is_idle, farthest)
    out = np.empty((ny, nx))
    for j in range(ny):
        for i in range(nx):
            out[j, i] = (1.0 if is_low[j, i] else -1.0) * math.sqrt(best[j, i]) * pitch
    return out


@njit
def nearest_seed(is_seed, is_idle, farthest):
    """Grid coordinates (ny, nx, 2) of the nearest seed of every node, and its distance (ny, nx) in nodes.

    `is_idle` and `farthest` as in `inner_distance`; 1e9 and no place where no seed is found.
    """
    ny, nx = is_seed.shape
    near, best = np.zeros((ny, nx, 2)), np.full((ny, nx), 1e18)
    for j in range(ny):
        for i in range(nx):
            if is_seed[j, i]:
                near[j, i, X], near[j, i, Y], best[j, i] = i, j, 0.0
    _sweep(near, best, is_idle, farthest)
    return near, np.sqrt(best)
