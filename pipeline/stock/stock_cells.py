"""Cubes that hold all stock which cuts from several directions leave: a height that nothing exceeds, in any frame.

Rays that ask what stands over a place begin there, not at the top of the blank.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from cuspline.stock.swept import nearest_moves
from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y

FIRST, FINEST = 8, 256      # cubes along the longest side of the blank: at the beginning, and the smallest
OCTANTS = np.array(list(np.ndindex(2, 2, 2))) - 0.5


@dataclass(frozen=True, eq=False, kw_only=True)
class StockCells:
    """Cubes along the part's axes; all stock lies in them."""

    middle_mm: np.ndarray       # (n, 3)
    half_mm: np.ndarray         # (n,) half their sides
    least_half_mm: float            # half the side of the smallest

    def __post_init__(self):
        object.__setattr__(self, "middle_mm", frozen(self.middle_mm, (None, 3), "middle_mm"))
        object.__setattr__(self, "half_mm", frozen(self.half_mm, (len(self.middle_mm),), "half_mm"))

    @classmethod
    def of_box(cls, low_mm, high_mm):
        """All of a box."""
        size = high_mm - low_mm
        side = float(size.max()) / FIRST
        counts = np.maximum(np.ceil(size / side).astype(int), 1)
        middles = low_mm + side * (np.array(list(np.ndindex(*counts))) + 0.5)
        return cls(middle_mm=middles, half_mm=np.full(len(middles), side / 2), least_half_mm=side * FIRST / FINEST / 2)

    def less(self, cut):
        """Without what a workpiece.Cut takes: a cube that it takes whole is gone, one that it meets is parted."""
        kept, middle, half = [], self.middle_mm, self.half_mm
        while len(middle):
            away = nearest_moves(cut.paths, cut.frame.into(middle))[0]
            reach = np.sqrt(3.0) * half
            parts = (np.abs(away) < reach) & (half > 1.5 * self.least_half_mm)
            stays = (away > -reach) & ~parts
            kept.append((middle[stays], half[stays]))
            half = np.repeat(half[parts] / 2, len(OCTANTS))
            middle = (middle[parts][:, None] + 2 * half.reshape(-1, len(OCTANTS), 1) * OCTANTS).reshape(-1, 3)
        middles, halves = (np.concatenate(c) for c in zip(*kept))
        return StockCells(middle_mm=middles, half_mm=halves, least_half_mm=self.least_half_mm)

    def tops_in(self, frame):
        """CellTops of the cubes, as seen from a frame."""
        middle, pitch = frame.into(self.middle_mm), 2 * self.least_half_mm
        reach = np.abs(frame.rotation).sum(axis=0)
        half = self.half_mm[:, None] * reach
        low, high = (middle - half).min(axis=0, initial=np.inf)[:2], (middle + half).max(axis=0, initial=-np.inf)[:2]
        counts = np.maximum(np.ceil((high - low) / pitch), 1).astype(int) if len(middle) else np.ones(2, int)
        tops = np.full(counts, -np.inf)
        _raise(tops, (middle[:, :2] - half[:, :2] - low) / pitch, (middle[:, :2] + half[:, :2] - low) / pitch,
               middle[:, 2] + half[:, 2])
        return CellTops(low_mm=low, pitch_mm=pitch, top_mm=tops)


@dataclass(frozen=True, eq=False, kw_only=True)
class CellTops:
    """Squares in plan with the height that no stock over them exceeds."""

    low_mm: np.ndarray          # (2,)
    pitch_mm: float
    top_mm: np.ndarray          # (nx, ny); -inf: nothing stands

    def __post_init__(self):
        object.__setattr__(self, "low_mm", frozen(self.low_mm, (2,), "low_mm"))
        object.__setattr__(self, "top_mm", frozen(self.top_mm, (None, None), "top_mm"))

    def grown(self, by_mm):
        """The same of cubes larger all round by so much, in plan by up to a square more."""
        squares = int(np.ceil(by_mm / self.pitch_mm))
        tops = np.pad(self.top_mm, squares, constant_values=-np.inf)
        for axis in range(2):
            tops = maximum_filter1d(tops, 2 * squares + 1, axis=axis, mode="nearest")
        return CellTops(low_mm=self.low_mm - squares * self.pitch_mm, pitch_mm=self.pitch_mm, top_mm=tops + by_mm)

    def at(self, xy_mm):
        """(n,) over places (n, 2); -inf beside all cubes."""
        cell = np.floor((xy_mm - self.low_mm) / self.pitch_mm)
        inside = ((cell >= 0) & (cell < self.top_mm.shape)).all(axis=1)
        found = np.full(len(xy_mm), -np.inf)
        i, j = cell[inside].astype(int).T
        found[inside] = self.top_mm[i, j]
        return found


@njit
def _raise(tops, low, high, top):
    """Raise the squares that each cube covers, from low to high (n, 2) in squares, to its top (n,)."""
    nx, ny = tops.shape
    for k in range(len(top)):
        for i in range(max(int(low[k, X]), 0), min(int(high[k, X]), nx - 1) + 1):
            for j in range(max(int(low[k, Y]), 0), min(int(high[k, Y]), ny - 1) + 1):
                if tops[i, j] < top[k]:
                    tops[i, j] = top[k]
