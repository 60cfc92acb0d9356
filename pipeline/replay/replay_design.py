"""Neck, shank and holder against the finished design, over every move: groups of moves first, single ones where needed.

The tips of a group stand in a box; a tool that may stand anywhere in it is convex again (clearance_kernels).  A group
whose box keeps the distance wanted is done with; another is halved, down to single pieces, each swept exactly.
"""

import math

import numpy as np

from cuspline.replay.clearance_kernels import AXIS, HALF_X, NEAREST, SIDE_X, SIDE_Y, TIP, WAY, least_distance, workspace
from cuspline.replay.replay_stock import AMOUNT, DEEP_MM, SHARE, beyond
from cuspline.stock.path_pieces import X1, Z0, Z1
from cuspline.values.compiled import njit
from cuspline.values.rows import FROM, TO, X, Y, Z, put

TOLERANCE_MM = 1e-3       # of an amount, and of the least clearance
GROUP = 64                # pieces looked at as one, at most


@njit
def upright(place, lines, first, last):
    """The place of an upright tool that stands anywhere in the box round some lines; a single line is a way."""
    place[:] = 0.0
    place[SIDE_X + X] = place[SIDE_Y + Y] = place[AXIS + Z] = 1.0
    if last - first == 1:
        for k in range(3):
            place[TIP + k], place[WAY + k] = lines[first, k], lines[first, X1 + k] - lines[first, k]
        return
    for k in range(3):
        low, high = math.inf, -math.inf
        for p in range(first, last):
            low, high = min(low, lines[p, k], lines[p, X1 + k]), max(high, lines[p, k], lines[p, X1 + k])
        if k < 2:
            place[TIP + k], place[HALF_X + k] = 0.5 * (low + high), 0.5 * (high - low)
        else:
            place[TIP + Z], place[WAY + Z] = low, high - low


@njit
def _lowest_first(lines):
    """First pieces of the groups, in the order of their lowest ends."""
    starts = np.arange(0, len(lines), GROUP)
    lowest = np.full(len(starts), math.inf)
    for p in range(len(lines)):
        lowest[p // GROUP] = min(lowest[p // GROUP], lines[p, Z0], lines[p, Z1])
    return starts[np.argsort(lowest, kind="mergesort")]


@njit
def sweep(mesh, lines, rows, segments, wanted, least, tolerance, worst):
    """Contacts of pieces, and the least distance of them all; groups that come lowest first: what is least is soon known.

    Args:
        mesh: see clearance_kernels.   lines: (m, 6) ends of the pieces.   rows: (m,) their moves, growing.
        segments: (k, 5).
        wanted: distance below which a piece is in contact.
        least: distances beyond it do not matter; -inf: only contacts are asked for.
        worst: (moves, 4) takes how much is missing where something is, and where: too little by the tolerance at most,
            or by SHARE of it where it is more than DEEP_MM.
    Returns:
        (proven lower bound of the least distance, the least attained, (3,) its point).
    """
    place, work, spot, proven, hint = np.zeros(17), workspace(), np.full(3, math.nan), math.inf, -1
    spans = np.empty((64, 2), np.int64)
    for start in _lowest_first(lines):
        waiting = 1
        spans[0, FROM], spans[0, TO] = start, min(start + GROUP, len(lines))
        while waiting > 0:
            waiting -= 1
            first, last = spans[waiting]
            table = worst[rows[first]]
            upright(place, lines, first, last)
            enough = max(beyond(wanted, table[AMOUNT]) if rows[first] == rows[last - 1] else wanted, least - tolerance)
            if last - first > 1:
                bound, _, found = least_distance(mesh, place, segments, enough + 2.0 * tolerance, enough + tolerance,
                                                 tolerance, hint, work)
                hint = found if found >= 0 else hint
                if bound >= enough:
                    proven = min(proven, bound)
                    continue
                middle = (first + last) // 2
                spans[waiting, FROM], spans[waiting, TO] = middle, last
                spans[waiting + 1, FROM], spans[waiting + 1, TO] = first, middle
                waiting += 2
                continue
            bound, rough, floor = -math.inf, tolerance, wanted - DEEP_MM
            while bound == -math.inf:        # deeper than the floor: asked again, as roughly as that is deep
                bound, got, found = least_distance(mesh, place, segments, enough + tolerance, floor, rough, hint, work)
                rough, floor = SHARE * (wanted - got), 2.0 * got - wanted
                if found < 0:
                    continue
                hint = found
                if got < least:
                    least = got
                    put(spot, work[NEAREST])
                if wanted - got > max(table[AMOUNT], 0.0):
                    table[AMOUNT] = wanted - got
                    put(table[1:], work[NEAREST])
            proven = min(proven, bound)
    return proven, least, spot
