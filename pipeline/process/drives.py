r"""What drives make of a posted path: each axis follows its command with a first-order lag, and turns round with backlash.

        T dx/dt + x = command        an axis runs V T behind, and cuts corners

The control is taken to command the posted feed all along, round corners too; a real one that slows down is nearer to the path.
Rapids stop at their end.  Source: docs/formulas.md 4.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.process.earlier_cuts import straight_pieces
from cuspline.program.program import Kind
from cuspline.stock.path_pieces import X0, X1
from cuspline.stock.swept import cutting_rows
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit

SAMPLES = 8               # a time constant
FORGOTTEN = 8.0           # time constants after which nothing is left of a corner
MOST_SAMPLES = 256        # a piece: a longer one is straight for longer than anything is left
CORNER = math.sqrt(2.0) / math.e        # of V T: how far from a right-angled corner the drives cross its bisector


def following_error_mm(feed_mm_per_min, time_constant_s):
    """How far an axis runs behind its command.

    >>> round(following_error_mm(406.4, 0.033), 4)
    0.2235
    """
    return feed_mm_per_min / 60 * time_constant_s


def corner_distance_mm(feed_mm_per_min, time_constant_s):
    """How far from a right-angled corner, along its bisector, two equal axes cut it.

    >>> round(corner_distance_mm(406.4, 0.033), 4)
    0.1163
    """
    return CORNER * following_error_mm(feed_mm_per_min, time_constant_s)


def time_constant_s(corner_mm, feed_mm_per_min):
    """The time constant of drives that cut a right-angled corner at a distance: the inverse of `corner_distance_mm`.

    >>> round(time_constant_s(corner_distance_mm(406.4, 0.033), 406.4), 6)
    0.033
    """
    return corner_mm / (CORNER * feed_mm_per_min / 60)


@dataclass(frozen=True, eq=False, kw_only=True)
class Drives:
    """Of X, Y and Z."""

    time_constants_s: np.ndarray        # (3,)
    backlash_mm: np.ndarray             # (3,)

    def __post_init__(self):
        for name in ("time_constants_s", "backlash_mm"):
            object.__setattr__(self, name, frozen(getattr(self, name), (3,), name))

    @classmethod
    def of(cls, machine):
        """As a machine's file states them; None: it states no time constant of an axis, or it has rotary axes."""
        if machine is None or machine.rotaries or any(a.time_constant_s is None for a in machine.axes):
            return None
        return cls(time_constants_s=[a.time_constant_s for a in machine.axes], backlash_mm=[a.backlash_mm for a in machine.axes])


def deviations_mm(posted, drives):
    """(n,) how far the tool is from the posted path at most, each place of its way against the nearest move; rapids 0.

    Args:
        posted: PostedMoves of an upright tool.   drives: Drives.
    """
    rows = np.flatnonzero(cutting_rows(posted) & (posted.kind != Kind.RAPID))
    geometry, row = straight_pieces(posted, rows, np.full(len(rows), np.inf))
    begins = np.r_[True, np.diff(row) > 1] if len(row) else np.zeros(0, bool)
    out, way = np.zeros(len(posted)), np.zeros((0, 3))
    _follow(geometry, row, posted.feed_mm_per_min[row] / 60, begins, drives.time_constants_s.copy(), drives.backlash_mm.copy(), out,
            way)
    return out


def way_mm(points_mm, feed_mm_per_min, drives, samples=4000):
    """(m, 3) where the tool goes while points (n, 3) are commanded one after the other at a feed; m <= samples."""
    points = np.asarray(points_mm, float)
    geometry = np.zeros((len(points) - 1, 12))
    geometry[:, X0:X1], geometry[:, X1:X1 + 3] = points[:-1], points[1:]
    row, begins, way = np.arange(len(geometry)), np.arange(len(geometry)) == 0, np.full((samples, 3), np.nan)
    _follow(geometry, row, np.full(len(row), feed_mm_per_min / 60), begins, drives.time_constants_s.copy(),
            drives.backlash_mm.copy(), np.zeros(len(row)), way)
    return way[np.isfinite(way[:, 0])]


@njit
def _follow(geometry, row, speed, begins, constants, backlash, out, way):
    """Runs the axes along pieces; `out` takes the largest distance by row, `way` the places as far as it has room.

    Along a piece the command is even in time, so what an axis is behind falls off exactly: e' = -v - e/T.
    """
    behind, at, slowest, fill, run = np.zeros(3), np.zeros(3), constants.max(), 0, 0
    for k in range(len(geometry)):
        if begins[k]:
            run = k
            for j in range(3):
                behind[j], at[j] = 0.0, geometry[k, j]
        length = _length(geometry[k])
        if length == 0.0 or speed[k] <= 0.0:
            continue
        time = length / speed[k]
        # once all is even nothing new comes: long pieces are looked at closely where they begin
        count = max(1, min(int(math.ceil(time / constants.min() * SAMPLES)), MOST_SAMPLES))
        step = min(time / count, max(FORGOTTEN * slowest / MOST_SAMPLES, constants.min() / SAMPLES))
        done = 0.0
        while done < time:
            h = min(step, time - done)
            if time - done - h < 1e-9 * time or done >= FORGOTTEN * slowest:
                h = time - done
            done += h
            for j in range(3):
                v = (geometry[k, X1 + j] - geometry[k, j]) / time
                left = fixed.exp(-h / constants[j])
                behind[j] = behind[j] * left - v * constants[j] * (1.0 - left)
                place = geometry[k, j] + v * done + behind[j]
                at[j] = min(max(at[j], place - 0.5 * backlash[j]), place + 0.5 * backlash[j])
            _keep_nearest(geometry, row, run, k, at, FORGOTTEN * slowest * speed[k], out)
            if fill < len(way):
                for j in range(3):
                    way[fill, j] = at[j]
                fill += 1
            if h == 0.0:
                break


@njit
def _keep_nearest(geometry, row, run, k, at, reach, out):
    """Distance of a place to the path behind the command, kept with the move that is nearest."""
    least, nearest, passed = math.inf, k, 0.0
    j = k
    while j >= run and passed <= reach:
        d = _distance(geometry[j], at)
        if d < least:
            least, nearest = d, j
        passed += _length(geometry[j]) if j < k else 0.0
        j -= 1
    out[row[nearest]] = max(out[row[nearest]], math.sqrt(least))


@njit
def _length(piece):
    total = 0.0
    for j in range(3):
        total += (piece[X1 + j] - piece[j]) * (piece[X1 + j] - piece[j])
    return math.sqrt(total)


@njit
def _distance(piece, at):
    """Square of the distance of a place to a straight piece."""
    along, square, away = 0.0, 0.0, 0.0
    for j in range(3):
        d = piece[X1 + j] - piece[j]
        along += d * (at[j] - piece[j])
        square += d * d
    share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    for j in range(3):
        d = at[j] - piece[j] - share * (piece[X1 + j] - piece[j])
        away += d * d
    return away
