"""A ball's axis evened out along each run, as far as it may leave its strategy, until the rotaries follow at the feed wanted.

    strategy   ____|‾‾‾‾‾       the mean over a window of stations, brought back to `smooth_deg` of the strategy where it strays
    even       ___/‾‾‾‾‾‾       farther; the narrowest window that the rotaries follow, else the one that asks least of them

The ball turns about its middle: what it cuts stays, and shank and holder are proven clear of the part anew.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.planning.clearing_axes import SPACING, WINDOWS
from cuspline.toolpaths.five_axis.even_turns import mean_over
from cuspline.toolpaths.five_axis.leaning_moves import Swing, angles_between, on_great_circle
from cuspline.values.rows import X, Y, Z

SHORTEST = 1e-6             # of a mean of directions that cancel out


@dataclass(frozen=True, eq=False, kw_only=True)
class EvenAxes:
    """Axes of one run at lengths along it, straight between; None: as the strategy has them."""

    along_mm: np.ndarray        # (k,) rising
    axis: np.ndarray | None     # (k, 3) unit
    most_rad: float             # that one of them leaves the strategy's
    share: tuple                # of what the rotaries can, before and after
    reversals: tuple            # the same

    def turned(self, stations):
        """(n, 3) axes of Stations."""
        if self.axis is None:
            return stations.axis
        mixed = np.column_stack([np.interp(stations.along_mm, self.along_mm, self.axis[:, k]) for k in (X, Y, Z)])
        return mixed / np.sqrt((mixed * mixed).sum(axis=1))[:, None]

    @property
    def corners_mm(self):
        """Lengths at which they turn faster or slower than before."""
        return self.along_mm[:0] if self.axis is None else self.along_mm[1:-1]


class SmoothingSwing(Swing):
    """Evens out the axes of runs."""

    draws_out = False

    def __init__(self, use, radius_mm, most_rad):
        """
        Args:
            use: clearing_axes.RotaryUse.   radius_mm: of the ball.   most_rad: that an axis may leave its strategy's.
        """
        self.use, self.most_rad, self.spacing_mm = use, most_rad, SPACING * radius_mm

    def turns(self, runs):
        return [self._even(stations) for stations in runs]

    def _even(self, stations):
        """EvenAxes of a run."""
        first, reversals = self.use.of(stations.axis, stations.along_mm)
        best = None, first, reversals
        for window in WINDOWS if first > 1.0 else ():
            if window > len(stations.along_mm):
                break
            axes = self._mean(stations.axis, window)
            share, turned_round = self.use.of(axes, stations.along_mm)
            if share < best[1]:
                best = axes, share, turned_round
            if share <= 1.0:
                break
        axes, share, turned_round = best
        most = 0.0 if axes is None else float(angles_between(axes, stations.axis).max())
        return EvenAxes(along_mm=stations.along_mm, axis=axes, most_rad=most, share=(first, share),
                        reversals=(reversals, turned_round))

    def _mean(self, axes, window):
        """(n, 3) means over so many stations to either side, no farther than allowed from where they were."""
        mixed = np.column_stack([mean_over(axes[:, k], window) for k in (X, Y, Z)])
        size = np.sqrt((mixed * mixed).sum(axis=1))[:, None]
        mixed = np.where(size > SHORTEST, mixed / np.maximum(size, SHORTEST), axes)
        off = angles_between(axes, mixed)
        share = np.minimum(self.most_rad / np.maximum(off, SHORTEST), 1.0)
        return on_great_circle(axes, mixed, share)


def smoothing_facts(turns):
    """For plan.json: how far axes left their strategy, what the rotaries were asked before and after.

    A share that no way of the rotaries gives is null.
    """
    shares = [max((t.share[k] for t in turns), default=0.0) for k in (0, 1)]
    finite = [round(s, 3) if math.isfinite(s) else None for s in shares]
    return {"most_deg": round(math.degrees(max((t.most_rad for t in turns), default=0.0)), 3),
            "rotary_share": finite, "rotary_reversals": [sum(t.reversals[k] for t in turns) for k in (0, 1)]}
