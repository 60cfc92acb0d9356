"""What the cutters take off on their way, read from the events of the replay's z-map.

The way of all feed moves is laid out in one line, each millimetre in diameters of its cutter, and cut into bins.  A node
that a move lowers counts in the bin where the cutter's front meets it.  What follows a rapid begins with a bin of its own.
Chips of a window of bins:

    slot depth = volume / (length x diameter): a slot of the cutter's full width that is as deep

A strip of nodes stands for a strip of stock that may be thinner: of a window's figure, one strip as deep as its deepest
node does not count.  What is left is surely taken off, up to the pitch.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Kind, Plane
from cuspline.stock.path_pieces import Arcs
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit

BINS = 8                  # of a diameter of way
WINDOW = 4                # bins looked at together: half a diameter, so that a pass that nicks an edge is seen
MOST_BINS = 4_000_000     # a longer way has longer bins
INSIDE = 1e-6             # of a bin: so far inside its first bin lies a way's beginning, whatever is rounded
BEGIN_X, BEGIN_Y, END_X, END_Y, CENTER_X, CENTER_Y, SENSE = range(7)     # columns of a move's ends
FIRST_X, FIRST_Y, PITCH = range(3)                                       # of a grid
SAME_RAD = 1e-9           # an arc that turns by less is a whole circle


@dataclass(frozen=True, eq=False, kw_only=True)
class Loads:
    """Of one program; rows of PostedMoves, rapids and unknown moves 0."""

    slot_mm: np.ndarray       # (n,) chips of the heaviest window that begins in the move, as a slot of full width
    sure_mm: np.ndarray       # (n,) the same less what the nodes' distance may add
    plunge_mm: np.ndarray     # (n,) how deep the cutter's centre goes into stock
    slope_rad: np.ndarray     # (n,) how steeply the move leads down; 0 level or upward
    fall: np.ndarray          # (n,) share of the feed that leads down, its sine
    takes: np.ndarray         # (n,) bool: lowers some node of the map, be it by a rapid
    nodes: np.ndarray         # (n,) nodes that its cutter's width passes over


def loads(posted, tools, zmap, events, first, before_mm, columns=None):
    """What each move of a replayed program takes off.

    Args:
        posted: PostedMoves.   tools: {number: cutters.Tool}.   zmap: scene.ZMap.
        events: rows, cells, heights, each (e,), in order.   first: of them the first that is not from before the program.
        before_mm: (ny, nx) heights before the first move.
        columns: (ny * nx, k, 2) heights between which the nodes' material stands as delivered, inf behind the last; what is
            air between them is no chip.  None: all below the heights is material.
    Returns:
        Loads.
    """
    diameter = of_tools(posted, tools, lambda cutter: cutter.diameter_mm)
    feeds = (posted.kind != Kind.RAPID) & (diameter > 0)
    length = np.where(feeds, lengths_mm(posted), 0.0)
    way = np.divide(length, diameter, out=np.zeros(len(posted)), where=feeds)
    cut = np.cumsum(posted.kind == Kind.RAPID)          # windows do not reach over rapids, to another place or tool
    bin_way = max(1.0 / BINS, way.sum() / MOST_BINS)
    starts, count = _begins(way, cut, bin_way)
    taken = _lowered_mm(events, np.asarray(before_mm, float).ravel(), columns)
    volume, deepest, plunge = _taken(*events[:2], taken, first, zmap.nx, np.array([*zmap.origin_mm, zmap.pitch_mm]), count,
                                     bin_way, starts, way, feeds, _ends(posted), diameter)
    of = np.maximum(np.searchsorted(starts, (np.arange(count) + 2 * INSIDE) * bin_way, side="right") - 1, 0)
    slot, sure = _windows(volume * zmap.pitch_mm ** 2, deepest * zmap.pitch_mm, bin_way, diameter[of], cut[of])
    first_bin = (starts / bin_way).astype(np.int64)
    last_bin = np.minimum(((starts + way) / bin_way).astype(np.int64), count - 1)
    best = _best_of(sure, first_bin, last_bin)
    down = np.nan_to_num(np.maximum(posted.start_mm[:, 2] - posted.end_mm[:, 2], 0.0))
    return Loads(slot_mm=np.where(feeds, slot[best], 0.0), sure_mm=np.where(feeds, sure[best], 0.0),
                 plunge_mm=plunge, slope_rad=_slopes_rad(posted, length),
                 fall=np.divide(down, length, out=np.zeros(len(posted)), where=length > 0),
                 takes=np.bincount(events[0][first:].astype(np.int64), minlength=len(posted))[:len(posted)] > 0,
                 nodes=length * diameter / zmap.pitch_mm ** 2)


def _begins(way, cut, bin_way):
    """(Where each move's way begins in one line of bins (n,), number of bins); ways in diameters of the cutter.

    Args:
        way: (n,) of each move.   cut: (n,) numbers that rise by one at most; each begins with a bin of its own.
        bin_way: of a bin.
    """
    sums = np.bincount(cut, way)
    bins = np.ceil(sums / bin_way + 2 * INSIDE).astype(np.int64)
    first, before = np.cumsum(bins) - bins, np.cumsum(sums) - sums
    inside = np.cumsum(way) - way - before[cut]
    return (first[cut] + INSIDE) * bin_way + np.maximum(inside, 0.0), max(int(bins.sum()), 1)


def of_tools(posted, tools, figure):
    """(n,) figure(cutter) of each move's tool, 0 without one."""
    known = {n: float(figure(t.cutter)) for n, t in tools.items()}
    return np.array([known.get(n, 0.0) for n in posted.tool.tolist()])


def lengths_mm(posted):
    """(n,) length of each move, arcs along their circle; 0 where an end is not known."""
    length = np.nan_to_num(np.linalg.norm(posted.end_mm - posted.start_mm, axis=1))
    rows = np.flatnonzero(posted.kind >= Kind.ARC_CW)
    if len(rows):
        arcs = Arcs(posted, rows)
        around = np.abs(arcs.angle1 - arcs.angle0) * (arcs.radius0 + arcs.radius1) / 2
        length[rows] = np.sqrt(around * around + arcs.rise * arcs.rise)
    return length


def _slopes_rad(posted, length_mm):
    """(n,) slope of straight moves and helices that lead down; level arcs and all that leads up: 0."""
    fall = np.nan_to_num(posted.start_mm[:, 2] - posted.end_mm[:, 2])
    lies = (posted.kind >= Kind.ARC_CW) & (posted.plane != Plane.XY)
    level = np.nan_to_num(np.linalg.norm((posted.end_mm - posted.start_mm)[:, :2], axis=1))
    level = np.where((posted.kind >= Kind.ARC_CW) & ~lies, np.sqrt(np.maximum(length_mm ** 2 - fall ** 2, 0.0)), level)
    return np.where(fall > 0, fixed.arctan2(np.maximum(fall, 0.0), level), 0.0)


def _ends(posted):
    """(n, 7) x, y of both ends; centre of arcs about +Z, NaN for others; +1 against the clock, else -1."""
    about_z = (posted.kind >= Kind.ARC_CW) & (posted.plane == Plane.XY)
    center = np.where(about_z[:, None], posted.center_mm[:, :2], np.nan)
    turn = np.where(posted.kind == Kind.ARC_CCW, 1.0, -1.0)
    return np.column_stack([posted.start_mm[:, :2], posted.end_mm[:, :2], center, turn])


@njit
def _met(x, y, end, way, diameter):
    """Where along the way of a move, in diameters, its cutter's front meets a place."""
    if np.isnan(end[CENTER_X]):
        dx, dy = end[END_X] - end[BEGIN_X], end[END_Y] - end[BEGIN_Y]
        length = math.sqrt(dx * dx + dy * dy)
        if length == 0.0:
            return 0.0
        share = ((x - end[BEGIN_X]) * dx + (y - end[BEGIN_Y]) * dy) / (length * length)
        aside = abs((x - end[BEGIN_X]) * dy - (y - end[BEGIN_Y]) * dx) / length
    else:
        share = _turned(x, y, end)
        aside = abs(math.sqrt((x - end[CENTER_X]) ** 2 + (y - end[CENTER_Y]) ** 2)
                    - math.sqrt((end[BEGIN_X] - end[CENTER_X]) ** 2 + (end[BEGIN_Y] - end[CENTER_Y]) ** 2))
    ahead = math.sqrt(max(0.25 - (aside / diameter) ** 2, 0.0))
    return min(max(share * way - ahead, 0.0), way)


@njit
def _turned(x, y, end):
    """Share of an arc's turn at which it passes a place; the nearer end beside it."""
    a0 = fixed.arctan2(end[BEGIN_Y] - end[CENTER_Y], end[BEGIN_X] - end[CENTER_X])
    whole = ((fixed.arctan2(end[END_Y] - end[CENTER_Y], end[END_X] - end[CENTER_X]) - a0) * end[SENSE]) % (2 * math.pi)
    part = ((fixed.arctan2(y - end[CENTER_Y], x - end[CENTER_X]) - a0) * end[SENSE]) % (2 * math.pi)
    whole = 2 * math.pi if whole < SAME_RAD else whole
    if part <= whole:
        return part / whole
    return 1.0 if part - whole < 2 * math.pi - part else 0.0


def _lowered_mm(events, before_mm, columns):
    """(e,) material that each event takes from its node, mm: by how much it lowers it, less the air on the way."""
    _, cells, heights = events
    above = _before_each(cells, heights, before_mm.copy())
    if columns is None:
        above -= heights
        return above
    spans = columns[cells]
    known = np.isfinite(spans[..., 1])
    top, bottom = np.minimum(spans[..., 1], above[:, None]), np.maximum(spans[..., 0], heights[:, None])
    return np.where(known, np.maximum(np.where(known, top, 0.0) - np.where(known, bottom, 0.0), 0.0), 0.0).sum(axis=1)


@njit
def _before_each(cells, heights, now_mm):
    """(e,) height of each event's node before it; `now_mm` (nodes,) are those before all, lowered in place."""
    above = np.empty(len(cells))
    for e in range(len(cells)):
        above[e] = now_mm[cells[e]]
        now_mm[cells[e]] = heights[e]
    return above


@njit
def _taken(rows, cells, taken, first, nx, grid, count, bin_way, starts, way, feeds, ends, diameter):
    """Sum and greatest of the heights by which nodes are lowered, per bin (count,), and of the node at each move's end (n,).

    taken: (e,) see `_lowered_mm`.   grid: x and y of the first node, pitch.
    """
    volume, deepest, plunge = np.zeros(count), np.zeros(count), np.zeros(len(starts))
    for e in range(len(rows)):
        row, cell = rows[e], cells[e]
        if e < first or not feeds[row]:
            continue
        x, y = grid[FIRST_X] + grid[PITCH] * (cell % nx), grid[FIRST_Y] + grid[PITCH] * (cell // nx)
        k = min(int((starts[row] + _met(x, y, ends[row], way[row], diameter[row])) / bin_way), count - 1)
        volume[k] += taken[e]
        deepest[k] = max(deepest[k], taken[e])
        if max(abs(x - ends[row, END_X]), abs(y - ends[row, END_Y])) <= 0.5 * grid[PITCH]:
            plunge[row] += taken[e]
    return volume, deepest, plunge


@njit
def _windows(volume, strip, bin_way, width, cut):
    """(k,) slot depth of the window around each bin within its cut, and the same less its deepest strip."""
    count = len(volume)
    slot, sure = np.zeros(count), np.zeros(count)
    for k in range(count):
        total, deep = 0.0, 0.0
        for j in range(max(0, k - WINDOW // 2), min(count, k - WINDOW // 2 + WINDOW)):
            if cut[j] == cut[k]:
                total += volume[j]
                deep = max(deep, strip[j])
        if width[k] > 0.0:
            area = total / (WINDOW * bin_way * width[k])
            slot[k], sure[k] = area / width[k], max(area - deep, 0.0) / width[k]
    return slot, sure


@njit
def _best_of(values, first, last):
    """(n,) where the greatest of each stretch of values stands."""
    best = first.copy()
    for row in range(len(first)):
        for k in range(first[row], last[row] + 1):
            if values[k] > values[best[row]]:
                best[row] = k
    return best
