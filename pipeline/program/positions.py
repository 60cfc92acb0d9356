"""Indexed positions of one program (3+2): its moves seen from each of them, the tool upright there.

The reader gives places and axes in the WCS of the clamping.  A move belongs to a position where its axis is the position's
own from end to end; what turns the part, or the head, between two positions belongs to none.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from cuspline.program.posted import PostedMoves
from cuspline.program.program import UPRIGHT, Kind, tilt_rad
from cuspline.values.errors import ReadError

SAME_RAD = 1e-6             # rounded angles: a tenth of a micrometre 100 mm above the tip


@dataclass(frozen=True, eq=False, kw_only=True)
class Positions:
    """A program taken apart."""

    moves: tuple[PostedMoves, ...]      # one a position, in its own frame
    turning: PostedMoves                # what leads from one to the next, in the clamping's WCS
    leads_to: np.ndarray                # (n,) position that each move of `turning` leads to
    turning_from_deg: np.ndarray        # (n, r) where the rotaries stand when it begins; NaN: unknown
    position: np.ndarray                # (m,) that each move of the whole program is made in; -1: in none


def led_to(position):
    """(n,) position that each move is made in, or leads to; of `Positions.position`.

    >>> led_to(np.array([-1, 0, -1, 0, -1, 1, -1]))
    array([0, 0, 0, 0, 1, 1, 1])
    """
    inside = np.flatnonzero(position >= 0)
    return position[inside[np.minimum(np.searchsorted(inside, np.arange(len(position))), len(inside) - 1)]]


def by_position(posted, frames, held):
    """The moves of a program by the position that they are made in.

    Args:
        posted: PostedMoves in the WCS of the clamping.
        frames: values.frames.Frame of each position, seen from the part, in the order in which they are cut.
        held: Frame of the clamping's WCS.
    Returns:
        Positions.
    Raises:
        ReadError: a cutting move in none of them, or out of turn; a position that is not cut.
    """
    axes = held.turn_into(np.vstack([frame.turn_out(np.array([UPRIGHT])) for frame in frames]))
    fits = np.array([(tilt_rad(posted.start_axis, a) < SAME_RAD) & (tilt_rad(posted.end_axis, a) < SAME_RAD) for a in axes])
    position, begin = np.full(len(posted), -1), 0
    for k, own in enumerate(fits):
        leaves = np.flatnonzero(~own[begin:] & fits[k + 1, begin:]) if k + 1 < len(fits) else ()
        end = begin + int(leaves[0]) if len(leaves) else len(posted)
        position[begin:end] = np.where(own[begin:end], k, -1)
        begin = end
    _refuse_strays(posted, position)
    missing = sorted(set(range(len(frames))) - set(position.tolist()))
    if missing:
        raise ReadError(f"the program never points the tool along {' '.join(f'{x:.4f}' for x in axes[missing[0]])} in the WCS, as "
                        f"position {missing[0] + 1} requires: correct its rotary words, or the machine's file")
    order = np.maximum.accumulate(position)
    rows = np.flatnonzero(position < 0)
    leads_to = np.minimum(order[rows] + 1, len(frames) - 1)
    return Positions(position=position, turning=_taken(posted, position < 0), leads_to=leads_to,
                     moves=tuple(_seen(_taken(posted, position == k), frame, held) for k, frame in enumerate(frames)),
                     turning_from_deg=np.vstack(
                         [np.full((1, posted.rotary_deg.shape[1]), np.nan), posted.rotary_deg])[rows])


def _refuse_strays(posted, position):
    """A cut must be made in a position; a rapid may lead from one to the next."""
    stray = np.flatnonzero((position < 0) & (posted.kind != Kind.RAPID))
    if len(stray):
        line = int(posted.line[stray[0]])
        axis = " ".join(f"{x:.6f}" for x in posted.end_axis[stray[0]])
        raise ReadError(f"line {line}: a cutting move with its tool axis along {axis}, which is none of the positions that follow: "
                        "correct the rotary words", rows=[line])


def _taken(posted, is_taken):
    """Some of the rows."""
    number = np.cumsum(is_taken) - 1
    columns = {f.name: getattr(posted, f.name)[is_taken] for f in fields(posted)
               if isinstance(getattr(posted, f.name), np.ndarray)}
    after = np.concatenate([[0], np.cumsum(is_taken)])
    return replace(posted, **columns, remarks=tuple(replace(r, row=int(number[r.row])) for r in posted.remarks if is_taken[r.row]),
                   stops=tuple(replace(s, row=int(after[s.row]), nose_z_mm=float(posted.machine_end_mm[s.row - 1, 2]) if s.row else
                                       math.nan) for s in posted.stops if is_taken[min(s.row, len(is_taken) - 1)]))


def _seen(posted, frame, held):
    """The same from a position's own frame; from the clamping's own nothing changes."""
    upright = np.tile(UPRIGHT, (len(posted), 1))
    if frame.rotation.tolist() == held.rotation.tolist() and frame.origin_mm.tolist() == held.origin_mm.tolist():
        return replace(posted, start_axis=upright, end_axis=upright)
    turned = {name: frame.into(held.out(getattr(posted, name))) for name in ("start_mm", "end_mm")}
    return replace(posted, **turned, start_axis=upright, end_axis=upright)
