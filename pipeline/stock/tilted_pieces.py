r"""Posted moves with any tool axis, broken into the sub-steps that the kernels understand.

A sub-step runs straight from tip to tip, while its axis turns as the normalised mean of both ends' axes.  It is
a row of fourteen numbers, WCS, mm and rad:

    TIP      (3) where it begins      AXIS       (3) where it begins
    WAY      (3) of the tip           AXIS_WAY   (3) axis where it ends less axis where it begins
    LENGTH   of the tip's way         TURN       fastest turning of the axis, rad a sub-step

The normalised mean runs on the great circle of the true axis, only not evenly.  Over a turn of h, at the share
(1 + u)/2 of it, the angle from the middle is atan(u tan(h/2)) in place of u h/2.  The difference is below
(u - u³)/3 tan³(h/2), so at most 2/(9 sqrt 3) tan³(h/2), and a point of the cutter is off by at most that times its
distance from the tip.  Sub-steps are cut so short that the farthest point stays within TURN_ERROR_MM.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.stock.path_pieces import pieces_of, repeated_parts
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import SimulationError

TIP, WAY, AXIS, AXIS_WAY, LENGTH, TURN = 0, 3, 6, 9, 12, 13
TURN_ERROR_MM = 1e-5      # a tenth of what an answer may be off
UNEVEN = 2 / (9 * np.sqrt(3))
OPPOSITE_RAD = np.radians(179)


@dataclass(frozen=True, eq=False, kw_only=True)
class PosedPieces:
    """Sub-steps in the order in which they are cut."""

    geometry: np.ndarray      # (m, 14)
    row: np.ndarray           # (m,) row of PostedMoves
    error_mm: float           # largest distance between the cutter in a sub-step and in the posted move

    def __post_init__(self):
        object.__setattr__(self, "geometry", frozen(self.geometry, (None, 14), "geometry"))
        object.__setattr__(self, "row", frozen(self.row, (len(self.geometry),), "row", np.int64))


def posed_pieces(posted, rows, longest_mm, reach_mm, turn_error_mm=TURN_ERROR_MM):
    """Sub-steps of the given moves.

    Args:
        posted: PostedMoves.
        rows: (k,) rows with known start and end, growing.
        longest_mm: no sub-step's tip runs farther.
        reach_mm: tip to the cutter's farthest point.
        turn_error_mm: how far that point may be off where the axis turns.
    Raises:
        SimulationError: an axis that turns half round, so that the way there is open; a bad arc; `.rows`.
    """
    turn = _turns_rad(posted, np.asarray(rows, dtype=np.int64))
    chords = pieces_of(posted, rows, longest_mm=longest_mm)
    start, way = chords.geometry[:, :3], chords.geometry[:, 3:6] - chords.geometry[:, :3]
    share0, share1 = _shares(chords.row, np.sqrt((way ** 2).sum(axis=1)))
    angle = (share1 - share0) * turn[chords.row]
    most = 2 * fixed.arctan(fixed.cbrt(turn_error_mm / (UNEVEN * reach_mm)))
    length = np.sqrt((way ** 2).sum(axis=1))
    counts = np.maximum(1, np.ceil(np.maximum(angle / most, length / longest_mm) - 1e-9)).astype(np.int64)
    whole, part = repeated_parts(counts)
    tip = lambda k: start[whole] + (k / counts[whole])[:, None] * way[whole]
    share = lambda k: share0[whole] + k / counts[whole] * (share1 - share0)[whole]
    axis = lambda k: _axes(posted, chords.row[whole], share(k), turn)
    return _pieces_between((tip(part), tip(part + 1)), (axis(part), axis(part + 1)), chords.row[whole], reach_mm, chords.error_mm)


def straight_pieces(start_tips_mm, end_tips_mm, start_axes, end_axes, reach_mm, turn_error_mm=TURN_ERROR_MM):
    """PosedPieces of straight moves as they are planned, (n, 3) each, the axis on the great circle between both ends.

    Args:
        start_tips_mm, end_tips_mm, start_axes, end_axes: (n, 3), unit axes.   reach_mm, turn_error_mm: as for `posed_pieces`.
    Raises:
        SimulationError: an axis that turns half round; `.rows`.
    """
    turn = _angles_between(start_axes, end_axes)
    bad = np.flatnonzero(turn > OPPOSITE_RAD)
    if len(bad):
        raise SimulationError("a move turns the axis by half a turn, so the way that it takes is open: split it", rows=bad)
    most = 2 * fixed.arctan(fixed.cbrt(turn_error_mm / (UNEVEN * reach_mm)))
    counts = np.maximum(1, np.ceil(turn / most - 1e-9)).astype(np.int64)
    whole, part = repeated_parts(counts)
    tip = lambda k: start_tips_mm[whole] + (k / counts[whole])[:, None] * (end_tips_mm - start_tips_mm)[whole]
    axis = lambda k: _on_circle(start_axes[whole], end_axes[whole], turn[whole], k / counts[whole])
    return _pieces_between((tip(part), tip(part + 1)), (axis(part), axis(part + 1)), whole, reach_mm, 0.0)


def _pieces_between(tips, axes, row, reach_mm, error_mm):
    """PosedPieces from the first to the second of two (m, 3) of tips and axes."""
    geometry = np.zeros((len(row), 14))
    geometry[:, TIP:WAY], geometry[:, AXIS:AXIS_WAY] = tips[0], axes[0]
    geometry[:, WAY:AXIS], geometry[:, AXIS_WAY:LENGTH] = tips[1] - tips[0], axes[1] - axes[0]
    geometry[:, LENGTH] = np.sqrt((geometry[:, WAY:AXIS] ** 2).sum(axis=1))
    chord = np.sqrt((geometry[:, AXIS_WAY:LENGTH] ** 2).sum(axis=1))
    geometry[:, TURN] = chord / np.sqrt(1 - chord ** 2 / 4)
    uneven = UNEVEN * reach_mm * fixed.power(geometry[:, TURN].max(initial=0.0) / 2, 3)
    return PosedPieces(geometry=geometry, row=row, error_mm=float(error_mm + uneven))


def _angles_between(a, b):
    """(n,) angles between unit vectors."""
    return fixed.arctan2(np.sqrt((np.cross(a, b) ** 2).sum(axis=1)), (a * b).sum(axis=1))


def upright_pieces(lines, row):
    """PosedPieces of straight moves (m, 6), both ends, of an upright tool; `row` (m,) of PostedMoves."""
    geometry = np.zeros((len(lines), 14))
    geometry[:, TIP:TIP + 3], geometry[:, WAY:WAY + 3], geometry[:, AXIS + 2] = lines[:, :3], lines[:, 3:6] - lines[:, :3], 1.0
    geometry[:, LENGTH] = np.sqrt((geometry[:, WAY:WAY + 3] ** 2).sum(axis=1))
    return PosedPieces(geometry=geometry, row=row, error_mm=0.0)


def _turns_rad(posted, rows):
    """(n,) angle between both axes of each move; 0 on rows that are not asked for."""
    turn = np.zeros(len(posted))
    a, b = posted.start_axis[rows], posted.end_axis[rows]
    turn[rows] = _angles_between(a, b)
    bad = np.flatnonzero(turn > OPPOSITE_RAD)
    if len(bad):
        raise SimulationError(f"line {posted.line[bad[0]]}: the tool axis turns by {np.degrees(turn[bad[0]]):.1f}° in "
                              "one move, so the way it takes is open; give a position between", rows=bad)
    return turn


def _shares(row, length):
    """(m,), (m,) share of its move at which each chord begins and ends: by length, or evenly where nothing moves."""
    first = np.flatnonzero(np.r_[True, row[1:] != row[:-1]]) if len(row) else np.zeros(0, np.int64)
    counts = np.diff(np.r_[first, len(row)])
    whole = np.repeat(np.arange(len(first)), counts)
    total = np.add.reduceat(length, first) if len(first) else np.zeros(0)
    length = np.where(total[whole] > 0, length / np.where(total > 0, total, 1.0)[whole], 1.0 / counts[whole])
    done = np.cumsum(length)
    before = (done - length)[first][whole]
    is_last = np.r_[first[1:], len(row)][whole] - 1 == np.arange(len(row))
    return done - length - before, np.where(is_last, 1.0, done - before)


def _axes(posted, row, share, turn):
    """(m, 3) axes of moves at a share of their turn along the great circle."""
    return _on_circle(posted.start_axis[row], posted.end_axis[row], turn[row], share)


def _on_circle(a, b, angle, share):
    """(m, 3) axes at shares of turns by angles (m,) from a to b (m, 3)."""
    is_still = angle < 1e-12
    sine = np.where(is_still, 1.0, fixed.sin(angle))
    weight = lambda s: np.where(is_still, s, fixed.sin(s * angle) / sine)[:, None]
    axis = weight(1 - share) * a + weight(share) * b
    return axis / np.sqrt((axis ** 2).sum(axis=1))[:, None]
