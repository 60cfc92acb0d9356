"""The shortest way of the rotaries over a list of tool axes: which branch, how many whole turns, where they must rewind.

Along the great circle from one axis to the next a branch is followed without a jump: the azimuth turns by less than half a
turn, and psi and chi (kinematics.py) never leave 0 .. pi.  Branches meet only where the axis passes a pole.  So a step is
either the continuation of its branch, in closed form, or it leads through a pole, or it is a rewind: the tool must leave the
cut and the rotaries go somewhere else, by whole turns or to the other branch.

Fewest rewinds first, then least travel of the rotaries, each in seconds at its full speed; by dynamic programming over
branches and whole turns, so that a way that will be short of range later begins one turn earlier.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cuspline.shop.kinematics import (
    ACROSS,
    ALONG,
    CHI,
    FULL,
    LIMIT_SLACK,
    LINEARS,
    PHI,
    POLE_RAD,
    PSI,
    and_others,
    bearings_of,
    called,
    cross,
    unit_rows,
    wrapped,
)
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.errors import PostError
from cuspline.values.rows import X, Y, Z

SAME_RAD = 1e-7             # two ways to compute one angle, near a pole
OFF_CUT = 1e-6              # of a rewind in the cut counts one beside it
NOT_ROTARY = 1.0            # speed of a rotary that is not there
KEPT_RAD = np.radians(3.0)  # from both ends of a range of more than a turn: past a pole a rotary swings out between two rows
QUARTER = np.pi / 2
REWINDS = 2                 # of what `_shortest` returns
ONE, TWO, SIGN = range(3)   # columns of states: angles of rotaries 1 and 2, branch


class Ranges(NamedTuple):
    """The rotaries as kernels read them; a rotary that is not there has no range and stays at 0."""

    count: int
    zero: float             # see kinematics.Wrist
    low: np.ndarray         # (2,) -inf where it is endless
    high: np.ndarray        # (2,)
    speed: np.ndarray       # (2,)
    start: np.ndarray       # (2,)


@dataclass(frozen=True, eq=False, kw_only=True)
class RotaryWay:
    """Angles of the rotaries over a list of axes."""

    angles: np.ndarray          # (n, rotaries) rad, whole turns counted
    sign: np.ndarray            # (n,) +1 or -1, the branch
    is_pole: np.ndarray         # (n,) rotary 1 is free here, it keeps the angle with which it came
    passes_pole: np.ndarray     # (n,) between the row before and this one the axis passes a pole
    rewinds: np.ndarray         # rows that can be reached only by leaving the cut, in order
    bearings: np.ndarray        # (n, 5) see kinematics.bearings_of


def shortest_way(chain, axes, start=None, pole_rad=POLE_RAD, rows=None, off_cut=None):
    """Angles of the rotaries over a list of axes.

    Args:
        chain: kinematics.Chain.
        axes: (n, 3) from the tip to the holder, in the part's frame; between two the axis turns on the great circle.
        start: (rotaries,) where they stand before, rad; left out: at 0.
        pole_rad: an axis, or a passage, this close to a pole goes through it.
        rows: (n,) what the rows are called in messages; left out: counted from 0.
        off_cut: (n,) bool, the tool is out of the cut on the way to the row: a rewind there is no harm; left out: nowhere.
    Returns:
        RotaryWay, with the fewest rewinds in the cut, then beside it.
    Raises:
        PostError: an axis that the rotaries cannot take, or that is beyond their ranges, by row, axis and value; two
            axes that point against each other, between which every way is as short.
    """
    axes, count = unit_rows(axes), len(chain.rotaries)
    names = called(rows, len(axes))
    angles, _ = chain.branches(axes, names)
    wrist = chain.wrist
    bearings = _all_bearings(wrist, axes)
    is_pole = (bearings[:, ACROSS] <= pole_rad) & (count > 0)
    passes = np.concatenate([[False], _passes(wrist.u1, axes, is_pole, pole_rad)]) if len(axes) and count == 2 else np.zeros(
        len(axes), bool)
    _refuse_opposite(axes, names)
    low, high, speed = _padded(chain.low, -np.inf), _padded(chain.high, np.inf), _padded(chain.speed, NOT_ROTARY)
    _refuse_out_of_range(chain, angles, is_pole, names)
    begin = for_kernel(np.append(() if start is None else start, np.zeros(2))[:2])
    weight = for_kernel(np.where(off_cut, OFF_CUT, 1.0) if off_cut is not None else np.ones(len(axes)))
    within = lambda kept: _shortest(Ranges(count, wrist.zero, low + kept, high - kept, speed, begin), bearings,
                                    for_kernel(is_pole, np.bool_), for_kernel(passes, np.bool_), weight)
    in_cut = lambda way: int((weight[way[REWINDS]] > OFF_CUT).sum())
    kept = _kept(low, high)
    way = within(kept)
    if kept.any() and in_cut(way):          # the ends of the ranges too, where that saves one
        way = min(way, within(np.zeros(2)), key=in_cut)
    found, sign, is_rewind = way
    found = np.where(np.abs(found - np.clip(found, low, high)) <= LIMIT_SLACK, np.clip(found, low, high), found)[:, :count]
    _refuse_pole_beyond(chain, found, is_pole, names)
    return RotaryWay(angles=found, sign=sign, is_pole=is_pole, passes_pole=passes, rewinds=np.flatnonzero(is_rewind),
                     bearings=bearings)


def _kept(low, high):
    """(2,) rad that is kept from both ends of the rotaries' ranges, of those that wind up."""
    span = high - low
    return np.where(np.isfinite(span) & (span > FULL + 2 * KEPT_RAD), KEPT_RAD, 0.0)


def _padded(of_joints, what):
    """(2,) of the rotaries, filled up for those that are not there."""
    return for_kernel(np.append(of_joints[LINEARS:], [what, what])[:2])


def _refuse_opposite(axes, names):
    bad = np.flatnonzero(((axes[1:] + axes[:-1]) ** 2).sum(axis=1) < SAME_RAD ** 2) + 1
    if len(bad):
        raise PostError(f"row {names[bad[0]]}: the tool axis turns right round in one move: say by a row between which way",
                        rows=names[bad])


def _refuse_out_of_range(chain, angles, is_pole, names):
    """Every row must have a branch within the ranges, by some whole turns; the free rotary of a pole always has."""
    if not chain.rotaries:
        return
    low, high = chain.low[LINEARS:], chain.high[LINEARS:]
    first = np.where(np.isfinite(low), low, -np.pi) - LIMIT_SLACK
    above = angles + FULL * np.ceil((first - angles) / FULL)
    beyond = np.maximum(np.minimum(above - high, low - (above - FULL)), 0.0)     # of the turn that misses the range by least
    beyond[is_pole, :, 0] = 0.0
    bad = np.flatnonzero((beyond > LIMIT_SLACK).any(axis=2).all(axis=1))
    if not len(bad):
        return
    row = bad[0]
    branch = int(np.argmin(beyond[row].max(axis=1)))
    column = LINEARS + int(np.argmax(beyond[row, branch]))
    over = above[row, branch, column - LINEARS]
    value = over if over - chain.high[column] <= chain.low[column] - over + FULL else over - FULL
    raise PostError(f"row {names[row]}: {chain.letters[column]} would stand at {chain.in_words(column, value)}, its range is "
                    f"{chain.in_words(column, chain.low[column])} to {chain.in_words(column, chain.high[column])}"
                    f"{and_others(bad)}; lean the tool another way, or turn the part", rows=names[bad])


def _refuse_pole_beyond(chain, angles, is_pole, names):
    """At a pole rotary 2 stands where the pole is."""
    rows = np.flatnonzero(is_pole)
    joints = np.zeros((len(rows), len(chain.letters)))
    joints[:, :LINEARS] = np.clip(0.0, chain.low[:LINEARS], chain.high[:LINEARS])
    joints[:, LINEARS:] = angles[rows]
    chain.refuse_beyond_limits(joints, names[rows])


# kernels -------------------------------------------------------------------------------------


@njit
def _all_bearings(wrist, axes):
    out = np.empty((len(axes), 5))
    for n in range(len(axes)):
        bearings_of(wrist, axes[n], out[n])
    return out


@njit
def passage(u, a, b, pole_rad, foot):
    """Whether the great circle from a to b passes +u or -u between them; that pole into foot (3,)."""
    nx, ny, nz = cross(a, b)
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length < SAME_RAD * SAME_RAD:
        return False
    nx, ny, nz = nx / length, ny / length, nz / length
    off = u[X] * nx + u[Y] * ny + u[Z] * nz
    if abs(off) > pole_rad:
        return False
    for side in (1.0, -1.0):
        foot[X], foot[Y], foot[Z] = side * u[X], side * u[Y], side * u[Z]
        ax, ay, az = cross(a, foot)
        bx, by, bz = cross(foot, b)
        if ax * nx + ay * ny + az * nz > pole_rad and bx * nx + by * ny + bz * nz > pole_rad:
            return True
    return False


@njit
def _passes(u, axes, is_pole, pole_rad):
    out, foot = np.zeros(len(axes) - 1, np.bool_), np.empty(3)
    for n in range(len(out)):
        out[n] = not (is_pole[n] or is_pole[n + 1]) and passage(u, axes[n], axes[n + 1], pole_rad, foot)
    return out


@njit
def _first_turn(base, low):
    """How many whole turns bring an angle to the beginning of a range; 0 where there is no range."""
    return np.ceil((low - LIMIT_SLACK - base) / FULL) if low > -np.inf else 0.0


@njit
def _turns(low, high):
    """How many whole turns of one angle a range holds at most."""
    return 1 if low == -np.inf else int(np.floor((high - low + 2 * LIMIT_SLACK) / FULL)) + 1


@njit
def _put_states(r, bearings, out):
    """Angles of rotaries 1 and 2, and sign, of every state at a row into out (s, 3); NaN where one is out of range."""
    many = _turns(r.low[TWO], r.high[TWO])
    per_sign = _turns(r.low[ONE], r.high[ONE]) * many
    for s in range(len(out)):
        sign = 1.0 - 2.0 * (s // per_sign)
        one, two = wrapped(bearings[PHI] - sign * bearings[PSI]), 0.0
        if r.count == 2:
            two = wrapped(-sign * bearings[CHI] - r.zero)
        one += FULL * (_first_turn(one, r.low[ONE]) + (s % per_sign) // many)
        two += FULL * (_first_turn(two, r.low[TWO]) + s % many)
        is_within = one <= r.high[ONE] + LIMIT_SLACK and two <= r.high[TWO] + LIMIT_SLACK
        out[s, ONE], out[s, TWO], out[s, SIGN] = one if is_within else np.nan, two, sign


@njit
def _step(was, now, before, after, pole, low, out):
    """Travel of both rotaries from one state (3,) to the next into out (2,); whether it is a rewind.

    before, after: bearings of their rows.   pole: +1 or -1 where that pole is met between them, else 0.
    """
    for k in range(2):
        out[k] = wrapped(now[k] - was[k]) if low[k] == -np.inf else now[k] - was[k]
    if pole:
        chi = 0.0 if pole > 0.0 else np.pi
        want_1 = out[ONE]           # on a pole rotary 1 turns as it likes
        want_2 = now[SIGN] * (chi - after[CHI]) - was[SIGN] * (chi - before[CHI])
    elif now[SIGN] != was[SIGN]:
        return True
    else:
        want_1 = wrapped(after[PHI] - before[PHI]) - was[SIGN] * (after[PSI] - before[PSI])
        want_2 = -was[SIGN] * (after[CHI] - before[CHI])
    if low[ONE] == -np.inf:
        out[ONE] = want_1
    if low[TWO] == -np.inf:
        out[TWO] = want_2
    return abs(out[ONE] - want_1) > SAME_RAD or abs(out[TWO] - want_2) > SAME_RAD


@njit
def _pole_between(before, row, bearings, passes):
    """+1 or -1: the pole that is met between two rows beside poles; 0: none."""
    if row > before + 1:
        return 1.0 if bearings[before + 1, ALONG] > 0.0 else -1.0
    if passes[row]:
        return 1.0 if bearings[before, ALONG] + bearings[row, ALONG] > 0.0 else -1.0
    return 0.0


@njit
def _shortest(r, bearings, is_pole, passes, weight):
    """Angles (n, 2), signs (n,), rewinds (n,); rows on poles are filled in after the others.   weight: (n,) of a rewind."""
    n = len(bearings)
    angles, signs, is_rewind = np.zeros((n, 2)), np.ones(n), np.zeros(n, np.bool_)
    anchors = np.flatnonzero(~is_pole)
    if r.count and len(anchors):
        last, came = _best_way(r, anchors, bearings, passes, weight)
        _follow(r, anchors, came, last, bearings, passes, angles, signs, is_rewind)
    if r.count:
        _fill_poles(r, anchors, bearings, is_pole, angles, signs)
    return angles, signs, is_rewind


@njit
def _best_way(r, anchors, bearings, passes, weight):
    """The best state of the last row beside poles, and (n, states) the best state before each."""
    states = r.count * _turns(r.low[ONE], r.high[ONE]) * _turns(r.low[TWO], r.high[TWO])
    came = np.zeros((len(anchors), states), np.int32)
    rewinds, travel = np.zeros(states), np.full(states, np.inf)
    was, now, step = np.empty((states, 3)), np.empty((states, 3)), np.empty(2)
    _put_states(r, bearings[anchors[0]], was)
    for s in range(states):
        if not np.isnan(was[s, ONE]):
            travel[s] = _seconds(_from_start(r, was[s], ONE), _from_start(r, was[s], TWO), r.speed)
    for i in range(1, len(anchors)):
        row, before = anchors[i], anchors[i - 1]
        pole = _pole_between(before, row, bearings, passes)
        _put_states(r, bearings[row], now)
        next_rewinds, next_travel = np.zeros(states), np.full(states, np.inf)
        for s in range(states):
            for t in range(states):
                if np.isnan(now[s, ONE]) or travel[t] == np.inf:
                    continue
                is_rewind = _step(was[t], now[s], bearings[before], bearings[row], pole, r.low, step)
                count, seconds = rewinds[t] + is_rewind * weight[row], travel[t] + _seconds(step[ONE], step[TWO], r.speed)
                if _is_better(count, seconds, next_rewinds[s], next_travel[s]):
                    next_rewinds[s], next_travel[s], came[i, s] = count, seconds, t
        rewinds, travel = next_rewinds, next_travel
        was, now = now, was
    best = 0
    for s in range(1, states):
        if _is_better(rewinds[s], travel[s], rewinds[best], travel[best]):
            best = s
    return best, came


@njit(inline="always")
def _is_better(rewinds, travel, than_rewinds, than_travel):
    """Fewer rewinds, then less travel; of equals the first stays."""
    return travel < np.inf and (than_travel == np.inf or rewinds < than_rewinds or (
        rewinds == than_rewinds and travel < than_travel - SAME_RAD))


@njit
def _from_start(r, state, k):
    off = state[k] - r.start[k]
    return wrapped(off) if r.low[k] == -np.inf else off


@njit(inline="always")
def _seconds(one, two, speed):
    return abs(one) / speed[ONE] + abs(two) / speed[TWO]


@njit
def _follow(r, anchors, came, last, bearings, passes, angles, signs, is_rewind):
    """The states of the best way, back from its end, as angles with whole turns counted from the start."""
    state = np.empty(len(anchors), np.int32)
    state[len(anchors) - 1] = last
    for i in range(len(anchors) - 1, 0, -1):
        state[i - 1] = came[i, state[i]]
    was, now, step = np.empty((came.shape[1], 3)), np.empty((came.shape[1], 3)), np.empty(2)
    for i in range(len(anchors)):
        row = anchors[i]
        _put_states(r, bearings[row], now)
        chosen = now[state[i]]
        signs[row] = chosen[SIGN]
        if i:
            before = anchors[i - 1]
            is_rewind[row] = _step(was[state[i - 1]], chosen, bearings[before], bearings[row],
                                   _pole_between(before, row, bearings, passes), r.low, step)
        for k in range(2):
            angles[row, k] = chosen[k]
            if r.low[k] == -np.inf:
                angles[row, k] = angles[before, k] + step[k] if i else r.start[k] + _from_start(r, chosen, k)
        was, now = now, was


@njit
def _fill_poles(r, anchors, bearings, is_pole, angles, signs):
    """At a pole rotary 1 keeps the angle with which it came, rotary 2 stands where the pole is."""
    first = anchors[0] if len(anchors) else -1
    for row in range(len(bearings)):
        if not is_pole[row]:
            continue
        if row > 0 and is_pole[row - 1]:
            signs[row], angles[row, ONE], angles[row, TWO] = signs[row - 1], angles[row - 1, ONE], angles[row - 1, TWO]
        elif row > 0:
            signs[row] = signs[row - 1]
            angles[row, ONE], angles[row, TWO] = at_pole(signs[row], bearings[row - 1], bearings[row, ALONG], angles[row - 1])
        else:
            signs[row] = signs[first] if first >= 0 else 1.0
            angles[row, ONE] = min(max(r.start[ONE], r.low[ONE]), r.high[ONE])
            if r.count == 2 and first >= 0:
                _, angles[row, TWO] = at_pole(signs[row], bearings[first], bearings[row, ALONG], angles[first])
            elif r.count == 2:
                chi = 0.0 if bearings[row, ALONG] > 0.0 else np.pi
                angles[row, TWO] = _nearest_within(-chi - r.zero, r.start[TWO], r.low[TWO], r.high[TWO])


@njit
def at_pole(sign, bearings, along, angles):
    """Both angles at the pole (along > 0: +u1) that the great circle from a row with these bearings and angles reaches."""
    chi = 0.0 if along > 0.0 else np.pi
    return angles[ONE] - sign * (QUARTER - bearings[PSI]), angles[TWO] - sign * (chi - bearings[CHI])


@njit
def _nearest_within(base, wanted, low, high):
    """The angle, by whole turns, within a range and nearest to the wanted one."""
    angle = wanted + wrapped(base - wanted)
    while angle > high + LIMIT_SLACK and angle - FULL >= low - LIMIT_SLACK:
        angle -= FULL
    while angle < low - LIMIT_SLACK and angle + FULL <= high + LIMIT_SLACK:
        angle += FULL
    return angle
