r"""Contours that the control runs beside: G41 and G42, and the moves of the cutter's middle that they come to.

        G41 D   ↘          planned    the cutter's middle, at its nominal radius
     planned  .---->--.    programmed the contour itself: in the D register stands the radius as measured
             /         \
       _____/ contour   \  the first block and the last, with G40, are straight and touch it
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.program.program import Moves
from cuspline.values.arrays import frozen
from cuspline.values.errors import ToolpathError


@dataclass(frozen=True, eq=False, kw_only=True)
class CompensatedContour:
    """One contour of an Operation, the cutter on its left (G41)."""

    first: int                      # of the operation's moves it stands for `first` to `end`
    end: int
    contour: Moves                  # as programmed: the way in, the contour, the way out; arcs run about the tool's axis
    row: np.ndarray                 # (n,) of its moves, the operation's move whose feed it takes
    worn_mm: float                  # by which the radius in the register may be smaller than the cutter's own

    def __post_init__(self):
        object.__setattr__(self, "row", frozen(self.row, (len(self.contour),), "row", int))
        if len(self.contour) < 3 or not self.first < self.end:
            raise ToolpathError("a compensated contour without a way in, a contour and a way out")

    def moved(self, into):
        """The same with its places seen from another frame, in which the tool may lean; `into`: (n, 3) -> (n, 3)."""
        m = self.contour
        return replace(self, contour=replace(m, start_mm=into(m.start_mm[None])[0], end_mm=into(m.end_mm),
                                             center_mm=into(m.center_mm)))

    def among(self, first):
        """The same of an operation whose moves are others: move k is there from `first[k]` to `first[k + 1]`."""
        return replace(self, first=first[self.first], end=first[self.end], row=[first[k] for k in self.row.tolist()])

    def later(self, by):
        """The same of an operation with so many moves more before."""
        return replace(self, first=self.first + by, end=self.end + by, row=self.row + by)
