"""Heights of a workpiece as planning asks for them: exact along one frame, on a grid and never too low across frames.

What was cut in another direction is met by rays, one a place, and clearing asks for a place again and again.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.values.arrays import frozen

NODES = 200                 # along the longer side
FINEST_MM, COARSEST_MM = 0.1, 1.0


@dataclass(frozen=True, eq=False, kw_only=True)
class HeightGrid:
    """Squares in plan, each with a height that no stock over it exceeds."""

    low_mm: np.ndarray          # (2,) lowest corner
    pitch_mm: float             # sides of the squares
    highest_mm: np.ndarray      # (nx, ny)

    def __post_init__(self):
        object.__setattr__(self, "low_mm", frozen(self.low_mm, (2,), "low_mm"))
        object.__setattr__(self, "highest_mm", frozen(self.highest_mm, (None, None), "highest_mm"))

    @classmethod
    def of(cls, piece, frame):
        """Over the box round a Workpiece, seen from a frame."""
        low, high = (corner[:2] for corner in piece.box_in(frame))
        pitch = float(np.clip((high - low).max() / NODES, FINEST_MM, COARSEST_MM))
        counts = np.ceil((high - low) / pitch).astype(int) + 1
        lines = [low[k] + pitch * (np.arange(counts[k]) + 0.5) for k in (0, 1)]
        middles = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
        highest = piece.highest_within_mm(frame, middles, pitch * np.sqrt(0.5))
        return cls(low_mm=low, pitch_mm=pitch, highest_mm=highest.reshape(counts))

    def heights_mm(self, xy_mm):
        """(n,) bounds over places (n, 2) within the box."""
        cell = np.floor((xy_mm - self.low_mm) / self.pitch_mm).astype(int)
        i, j = np.clip(cell, 0, np.array(self.highest_mm.shape) - 1).T
        return self.highest_mm[i, j]


def heights_of(piece, frame):
    """Function (n, 2) -> (n,) heights of a Workpiece, seen from a frame: exact, or where other frames cut it a bound."""
    if all(np.array_equal(cut.frame.rotation, frame.rotation) for cut in piece.cuts):
        return lambda xy_mm: piece.heights_mm(frame, xy_mm)
    return HeightGrid.of(piece, frame).heights_mm
