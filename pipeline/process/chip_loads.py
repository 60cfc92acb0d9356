"""How thick the chips are that an edge takes, and how full it is in the cut, against what its feed per tooth is meant for."""

import numpy as np

from cuspline.process.engagement import FIRST, LAST, OUT, RADIUS, UP, edge_of
from cuspline.values import fixed_math as fixed

HALF_TURN_RAD = np.pi / 2       # from straight ahead to the side: behind it an edge takes nothing of a level cut


def chip_shares(posted, tools, met):
    """(n,) thickest chip at each place of an Engagement as a share of the feed per tooth; 0 in air.

    Args:
        posted: PostedMoves.   tools: {number: cutters.Tool}.   met: engagement.Engagement.
    Source: docs/formulas.md 11: a chip is f_z (N·f), thickest where the edge's normal N is nearest to the feed f.
    """
    def thickest(rings, first, last, feed):
        nearest = np.minimum(np.maximum(first, 0.0), last)              # to straight ahead; NaN where there is no arc
        level = np.sqrt(feed[:, 0] * feed[:, 0] + feed[:, 1] * feed[:, 1])
        thick = (rings[:, OUT, None] * fixed.cos(np.nan_to_num(nearest)) * level[:, None, None]
                 + (rings[:, UP] * feed[:, 2:])[..., None])
        return np.where(np.isfinite(nearest), thick, 0.0).max(axis=(1, 2)).clip(0.0, 1.0)
    return _of_places(posted, tools, met, thickest)


def width_shares(posted, tools, met):
    """(n,) width of the cut across the feed at each place as a share of the cutter's diameter; 0 in air.  Arguments as above."""
    def widest(rings, first, last, feed):
        left, right = (rings[:, RADIUS, None] * fixed.sin(np.clip(np.nan_to_num(turn), -HALF_TURN_RAD, HALF_TURN_RAD))
                       for turn in (last, first))
        there = np.isfinite(first)
        whole = np.where(there, left, -np.inf).max(axis=(1, 2)) - np.where(there, right, np.inf).min(axis=(1, 2))
        return np.where(there.any(axis=(1, 2)), whole, 0.0) / (2 * rings[:, RADIUS].max())
    return _of_places(posted, tools, met, widest)


def _of_places(posted, tools, met, work_out):
    """(n,) of places, cutter by cutter: `work_out` of its rings, ends of arcs in the cut (k, rings, ARCS) each, feeds (k, 3)."""
    out, tool_of = np.zeros(len(met.row)), posted.tool[met.row]
    for number in np.unique(tool_of).tolist():
        mine = np.flatnonzero(tool_of == number)
        rings = edge_of(tools[number].cutter, met.look)[1]
        out[mine] = work_out(rings, *(met.arcs[mine, :len(rings), :, k] for k in (FIRST, LAST)), met.feed[mine])
    return out


def thin_chip_factor(chip_share, most):
    """What the feed grows by where chips are thinner than the feed per tooth, so that they get as thick; at most so much.

    >>> thin_chip_factor(np.array([1.0, 0.8, 0.1]), 1.5).tolist()
    [1.0, 1.25, 1.5]
    """
    return np.minimum(1.0 / np.maximum(chip_share, 1e-9), most)


def full_cut_factor(width_share):
    """What the feed shrinks by where the cut is wider than half a diameter, so that the mean torque stays that of such a cut.

    The mean torque goes with the width times the feed: a groove is fed half as fast.

    >>> full_cut_factor(np.array([0.1, 0.5, 0.75, 1.0])).round(4).tolist()
    [1.0, 1.0, 0.6667, 0.5]
    """
    return 0.5 / np.maximum(width_share, 0.5)
