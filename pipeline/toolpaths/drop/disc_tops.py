"""How high a mesh can stand under a level disc: bounds on a grid, by which most places are told clear without the tree.

    heights of cells, from triangles:     ▁▁▂▅█▅▂▁▁
    within the disc of any place of one:  ▂▅███████▅▂     never too low
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.rows import X_HIGH, X_LOW, Y_HIGH, Y_LOW, A, B, C, X, Y, Z

CELLS_A_RADIUS = 8          # of the grid
MOST_CELLS = 400            # along the mesh's longer side
SLACK_MM = 1e-9             # rounding of a plane at a cell's corners
STEEPEST = 100.0            # a plane that rises more is not followed, its triangle's top counts


@dataclass(frozen=True, eq=False, kw_only=True)
class DiscTops:
    """Bounds for discs of one radius."""

    low_mm: np.ndarray      # (2,) corner of the grid
    cell_mm: float
    tops_mm: np.ndarray     # (i, j) nothing within the disc of a place in this cell stands higher

    @classmethod
    def of_triangles(cls, corners_mm, box_mm, radius_mm):
        """Over (m, 3, 3) corners; `box_mm`: (4,) in plan, as `values.rows` has it, that holds them."""
        corners = for_kernel(corners_mm)
        low, high = box_mm[[X_LOW, Y_LOW]], box_mm[[X_HIGH, Y_HIGH]]
        cell = float(max(radius_mm / CELLS_A_RADIUS, (high - low).max() / MOST_CELLS))
        beside = int(radius_mm / cell) + 2
        count = np.ceil((high - low) / cell).astype(np.int64) + 1 + 2 * beside
        low = low - cell * beside
        alone, tops = (np.full(count, -np.inf) for _ in range(2))
        _raise_cells(corners, for_kernel(low), cell, alone)
        _raise_discs(alone, _half_widths(radius_mm / cell), tops)
        return cls(low_mm=low, cell_mm=cell, tops_mm=tops)

    def over(self, xy_mm):
        """(n,) bounds over places (n, 2); -inf where nothing lies beneath the disc."""
        tops = np.empty(len(xy_mm))
        _look_up(for_kernel(xy_mm), self.low_mm, self.cell_mm, self.tops_mm, tops)
        return tops


def _half_widths(radius):
    """(k,) cells to each side that a disc of a radius in cells can reach, of the rows 0, 1, ... beside its middle's."""
    beside = np.arange(int(radius) + 2)
    across = radius ** 2 - np.maximum(beside - 1, 0) ** 2
    return np.floor(np.sqrt(np.maximum(across, 0.0)) + SLACK_MM).astype(np.int64) + 1


@njit(error_model="numpy")
def _look_up(xy, low, cell, tops, out):
    """Bounds of the cells that places (n, 2) lie in, rounding added; -inf beside the grid."""
    rows, columns = tops.shape
    for k in range(len(xy)):
        i, j = math.floor((xy[k, X] - low[X]) / cell), math.floor((xy[k, Y] - low[Y]) / cell)
        is_there = 0 <= i < rows and 0 <= j < columns
        out[k] = tops[int(i), int(j)] + SLACK_MM if is_there else -np.inf


@njit(error_model="numpy")
def _raise_cells(corners, low, cell, tops):
    """Highest place of the triangles (m, 3, 3) in each cell, or above it."""
    for k in range(len(corners)):
        a, b, c = corners[k, A], corners[k, B], corners[k, C]
        top = max(a[Z], b[Z], c[Z])
        ux, uy, uz, vx, vy, vz = b[X] - a[X], b[Y] - a[Y], b[Z] - a[Z], c[X] - a[X], c[Y] - a[Y], c[Z] - a[Z]
        nz = ux * vy - uy * vx
        sx, sy = (uz * vy - uy * vz) / nz, (ux * vz - uz * vx) / nz
        is_followed = abs(sx) <= STEEPEST and abs(sy) <= STEEPEST
        first_i, last_i = int((min(a[X], b[X], c[X]) - low[X]) / cell), int((max(a[X], b[X], c[X]) - low[X]) / cell)
        first_j, last_j = int((min(a[Y], b[Y], c[Y]) - low[Y]) / cell), int((max(a[Y], b[Y], c[Y]) - low[Y]) / cell)
        for i in range(first_i, last_i + 1):
            for j in range(first_j, last_j + 1):
                z = top
                if is_followed:
                    x, y = low[X] + cell * (i + (sx > 0.0)), low[Y] + cell * (j + (sy > 0.0))
                    z = min(top, a[Z] + sx * (x - a[X]) + sy * (y - a[Y]))
                tops[i, j] = max(tops[i, j], z)


@njit(error_model="numpy")
def _raise_discs(alone, half_widths, tops):
    """Each cell raised to the highest that a disc about any of its places can reach."""
    rows, columns = alone.shape
    for beside in range(len(half_widths)):
        half = half_widths[beside]
        for i in range(rows):
            for j in range(columns):
                top = -np.inf
                for k in range(max(j - half, 0), min(j + half + 1, columns)):
                    top = max(top, alone[i, k])
                if i + beside < rows:
                    tops[i + beside, j] = max(tops[i + beside, j], top)
                if i >= beside:
                    tops[i - beside, j] = max(tops[i - beside, j], top)
