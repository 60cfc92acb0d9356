"""Moves as a machine's joints run them: between two blocks every joint moves evenly, and the tip leaves its line.

A plan means the tip on the straight line from pose to pose, and the axis on the great circle.  A control that interpolates
joints is exact at the ends of a block only.  Blocks are inserted until no point of any leaves the plan by more than allowed.

How far a block is off is bounded, not sampled: a point p(t) of the chain has a second derivative of at most M, which the chain
gives joint by joint; the distance to a line segment is convex, so between two of N + 1 even samples it exceeds the larger of
them by at most M / (8 N^2).  With N = 16 that is 0.4 % of what a block of this M can be off at most.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cuspline.shop.kinematics import (
    ALONG,
    CHI,
    LINEARS,
    PHI,
    PSI,
    bearings_of,
    called,
    cross,
    dot,
    place,
    tip_and_axis,
    wrapped,
)
from cuspline.shop.rotary_way import ONE, TWO, at_pole, shortest_way
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.compiled import njit
from cuspline.values.errors import PostError
from cuspline.values.rows import X, Y, Z, put

SAMPLES = 16                # stretches of a block between two samples
SAFETY = 0.97               # of the length that the last block says would just do
GROWTH = 2.0                # at most, from one block to the next
LEAST_SHARE = 1e-9          # of a move: no block is shorter
SAME_RAD = 1e-9
SHARE, ROW, SPOT = range(3)                                     # columns beside joints
TIP_BOUND, TIP_FOUND, AXIS_BOUND, AXIS_FOUND = range(4)         # columns of deviations


@dataclass(frozen=True, eq=False, kw_only=True)
class JointPath:
    """Blocks one after the other; row 0 is where they begin."""

    joints: np.ndarray          # (n, m) at the end of each block, mm and rad
    row: np.ndarray             # (n,) pose towards which the block leads
    share: np.ndarray           # (n,) 0 .. 1, how much of the move to that pose is done at its end
    is_spot: np.ndarray         # (n,) the block turns the part or the head about a tip that stands still, at a pole
    rewinds: np.ndarray         # rows (of poses) that can be reached only by leaving the cut
    deviation: np.ndarray       # (n, 4) proven and found: tip off its line, mm; axis off its great circle, rad

    def __post_init__(self):
        put_in = lambda name, shape, dtype: object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))
        put_in("joints", (None, None), float)
        n = len(self.joints)
        put_in("row", (n,), np.int64)
        put_in("share", (n,), float)
        put_in("is_spot", (n,), bool)
        put_in("rewinds", (None,), np.int64)
        put_in("deviation", (n, 4), float)

    def __len__(self):
        return len(self.joints)


class Tolerance(NamedTuple):
    """How far a block may be off the plan."""

    tip_mm: float
    axis_rad: float


class Piece(NamedTuple):
    """A part of a move that no pole divides, as kernels read it; its shares run from 0 to 1."""

    from_tip: np.ndarray        # (3,)
    to_tip: np.ndarray          # (3,)
    from_axis: np.ndarray       # (3,) unit
    to_axis: np.ndarray         # (3,)
    angles: np.ndarray          # (2,) of the rotaries at the row that the bearings are of
    bearings: np.ndarray        # (5,)
    from_angles: np.ndarray     # (2,) where the piece begins
    to_angles: np.ndarray       # (2,)
    sign: float
    is_spot: bool               # the rotaries turn evenly from one to the other, tip and axis stand
    shares: np.ndarray          # (2,) of the whole move, where the piece begins and ends


def joint_path(chain, tips_mm, axes, tolerance, *, length_mm=0.0, rows=None, off_cut=None):
    """Lay moves out in joints.

    Args:
        chain: kinematics.Chain.
        tips_mm: (n, 3) poses in the part's frame, the first where it all begins.   axes: (n, 3) unit, tip to holder.
        tolerance: Tolerance.
        length_mm: from the spindle nose to the tip.
        rows: (n,) what the rows are called in messages; left out: counted from 0.
        off_cut: (n,) bool, see rotary_way.shortest_way.
    Returns:
        JointPath; no limit is asked (`Chain.refuse_beyond_limits`), but the ranges of the rotaries.  A row that needs a rewind
        is led to in one block, whose deviation is infinite.
    Raises:
        PostError: see rotary_way.shortest_way; an axis between two rows that the rotaries cannot take.
    """
    if not (tolerance.tip_mm > 0 and tolerance.axis_rad > 0):
        raise PostError(f"a path within {tolerance.tip_mm:g} mm and {tolerance.axis_rad:g} rad: both must be above 0")
    tips_mm = for_kernel(np.reshape(tips_mm, (-1, 3)))
    way = shortest_way(chain, axes, rows=rows, off_cut=off_cut)
    links, wrist = chain.links, chain.wrist
    axes = np.reshape(np.asarray(axes, float), (-1, 3))
    axes = axes / np.sqrt((axes ** 2).sum(axis=1))[:, None]
    if len(chain.rotaries) == 2:
        poles = np.where(way.bearings[:, ALONG, None] > 0, 1.0, -1.0) * wrist.u1
        axes = np.where(way.is_pole[:, None], poles, axes)
    angles = np.zeros((len(axes), 2))
    angles[:, :len(chain.rotaries)] = way.angles
    is_rewind = np.isin(np.arange(len(axes)), way.rewinds)
    joints, beside, deviation, failed = _laid(
        links, wrist, Rows(tips_mm, for_kernel(axes), angles, for_kernel(way.sign), for_kernel(way.bearings),
                           for_kernel(way.is_pole, np.bool_), for_kernel(way.passes_pole, np.bool_),
                           for_kernel(is_rewind, np.bool_)), float(length_mm), tolerance)
    if failed >= 0:
        name = called(rows, len(tips_mm))[failed]
        raise PostError(f"row {name}: on the way to it the tool axis passes where the rotaries {' and '.join(chain.rotaries)} "
                        "cannot hold it; lead it another way by rows between", rows=[name])
    return JointPath(joints=joints, row=beside[:, ROW], share=beside[:, SHARE], is_spot=beside[:, SPOT] > 0,
                     rewinds=way.rewinds, deviation=deviation)


def block_deviations(chain, before, after, length_mm=0.0):
    """How far blocks that run joints evenly are off the straight line and the great circle between their ends.

    Args:
        before, after: (n, m) joints at the two ends of each block.   length_mm: scalar or (n,).
    Returns:
        (n, 4): tip proven and found, mm, axis proven and found, rad.  Proven: no point of the block is farther off.
    """
    before, after = (for_kernel(np.reshape(joints, (-1, len(chain.letters)))) for joints in (before, after))
    return _deviations(chain.links, before, after, for_kernel(np.broadcast_to(np.asarray(length_mm, float), len(before))))


# kernels -------------------------------------------------------------------------------------


class Rows(NamedTuple):
    """Poses and the rotaries' way over them; see rotary_way.RotaryWay."""

    tips: np.ndarray            # (n, 3)
    axes: np.ndarray            # (n, 3)
    angles: np.ndarray          # (n, 2)
    sign: np.ndarray            # (n,)
    bearings: np.ndarray        # (n, 5)
    is_pole: np.ndarray         # (n,)
    passes: np.ndarray          # (n,)
    is_rewind: np.ndarray       # (n,)


@njit(inline="always")
def _between(a, b, t, k):
    return a[k] + t * (b[k] - a[k])


@njit
def _put_axis(a, b, t, out):
    """The unit vector after the share t of the great circle from a to b; the angle of all of it."""
    cx, cy, cz = cross(a, b)
    sine = np.sqrt(cx * cx + cy * cy + cz * cz)
    whole = fixed.arctan2(sine, dot(a, b))
    if sine < 1e-12:
        p, q = 1.0 - t, t
    else:
        p, q = fixed.sin((1.0 - t) * whole) / sine, fixed.sin(t * whole) / sine
    x, y, z = p * a[X] + q * b[X], p * a[Y] + q * b[Y], p * a[Z] + q * b[Z]
    length = np.sqrt(x * x + y * y + z * z)
    out[X], out[Y], out[Z] = x / length, y / length, z / length
    return whole


@njit
def _most_bent(links, before, after, length):
    """Bound of the tip's second derivative while joints run evenly from `before` to `after` in one unit of time.

    From the tool to the part: a point that moves by at most v and bends by at most a, at most r from the axis of a rotary
    that turns by w, then bends by at most w^2 r + 2 w v + a.  In one unit of time it is never farther than v / 2 from one of
    the two ends of its way.
    """
    a, b = np.empty(3), np.empty(3)
    for k in range(3):
        a[k] = b[k] = -length * links.spindle[k]
    v, bent = 0.0, 0.0
    run = np.zeros(3)           # of linear joints since the last rotary
    for n in range(len(links.order) - 1, -1, -1):
        c = links.order[n]
        u, turn = links.direction[c], after[c] - before[c]
        if not links.is_rotary[c]:
            for k in range(3):
                a[k] += before[c] * u[k]
                b[k] += after[c] * u[k]
                run[k] += turn * u[k]
            continue
        v += np.sqrt(dot(run, run))
        run[X] = run[Y] = run[Z] = 0.0
        r, w = max(_off_axis(a, u, links.pivot[c]), _off_axis(b, u, links.pivot[c])) + 0.5 * v, abs(turn)
        bent += w * w * r + 2.0 * w * v
        v += w * r
        _turn(a, u, links.pivot[c], before[c])
        _turn(b, u, links.pivot[c], after[c])
    return bent


@njit
def _off_axis(p, u, pivot):
    x, y, z = p[X] - pivot[X], p[Y] - pivot[Y], p[Z] - pivot[Z]
    along = x * u[X] + y * u[Y] + z * u[Z]
    return np.sqrt(max(x * x + y * y + z * z - along * along, 0.0))


@njit
def _turn(p, u, pivot, angle):
    s, c = fixed.sin(angle), fixed.cos(angle)
    x, y, z = p[X] - pivot[X], p[Y] - pivot[Y], p[Z] - pivot[Z]
    along = (u[X] * x + u[Y] * y + u[Z] * z) * (1.0 - c)
    p[X] = pivot[X] + x * c + (u[Y] * z - u[Z] * y) * s + u[X] * along
    p[Y] = pivot[Y] + y * c + (u[Z] * x - u[X] * z) * s + u[Y] * along
    p[Z] = pivot[Z] + z * c + (u[X] * y - u[Y] * x) * s + u[Z] * along


@njit
def _off_segment(x, y, z, a, b):
    """Distance of a point to the segment from a to b."""
    dx, dy, dz = b[X] - a[X], b[Y] - a[Y], b[Z] - a[Z]
    x, y, z = x - a[X], y - a[Y], z - a[Z]
    square = dx * dx + dy * dy + dz * dz
    t = min(max((x * dx + y * dy + z * dz) / square, 0.0), 1.0) if square > 0.0 else 0.0
    x, y, z = x - t * dx, y - t * dy, z - t * dz
    return np.sqrt(x * x + y * y + z * z)


@njit
def _put_deviation(links, before, after, length, ends, out):
    """TIP_BOUND .. AXIS_FOUND of one block into out (4,).

    ends: (4, 3) tip where it begins and ends, axis where it begins and ends, as planned.
    """
    joints, axis = np.empty(len(before)), np.empty(3)
    tip_off, axis_off, whole = 0.0, 0.0, 0.0
    for n in range(SAMPLES + 1):
        t = n / SAMPLES
        for k in range(len(before)):
            joints[k] = _between(before, after, t, k)
        x, y, z, i, j, k = tip_and_axis(links, joints, length)
        tip_off = max(tip_off, _off_segment(x, y, z, ends[0], ends[1]))
        whole = _put_axis(ends[2], ends[3], t, axis)
        i, j, k = i - axis[X], j - axis[Y], k - axis[Z]
        axis_off = max(axis_off, np.sqrt(i * i + j * j + k * k))
    turn = 0.0
    for k in range(LINEARS, len(before)):
        turn += abs(after[k] - before[k])
    within = 1.0 / (8.0 * SAMPLES * SAMPLES)
    out[TIP_FOUND], out[AXIS_FOUND] = tip_off, _angle_of_chord(axis_off)
    out[TIP_BOUND] = tip_off + within * _most_bent(links, before, after, length)
    out[AXIS_BOUND] = _angle_of_chord(axis_off + within * (turn * turn + whole * whole))


@njit
def _angle_of_chord(chord):
    return 2.0 * fixed.arcsin(min(0.5 * chord, 1.0))


@njit
def _deviations(links, before, after, lengths):
    out, ends = np.empty((len(before), 4)), np.empty((4, 3))
    for n in range(len(out)):
        _put_end(links, before[n], lengths[n], ends[0], ends[2])
        _put_end(links, after[n], lengths[n], ends[1], ends[3])
        _put_deviation(links, before[n], after[n], lengths[n], ends, out[n])
    return out


@njit
def _put_end(links, joints, length, tip, axis):
    tip[X], tip[Y], tip[Z], axis[X], axis[Y], axis[Z] = tip_and_axis(links, joints, length)


@njit
def _put_pose(links, wrist, piece, t, length, tip, axis, bearings, columns, joints):
    """Planned tip and axis at the share t of a piece, and the joints that hold them; how far the axis is missed."""
    for k in range(3):
        tip[k] = _between(piece.from_tip, piece.to_tip, t, k)
    _put_axis(piece.from_axis, piece.to_axis, t, axis)
    if piece.is_spot or t == 0.0 or t == 1.0:
        for k in range(wrist.count):
            joints[LINEARS + k] = _between(piece.from_angles, piece.to_angles, t, k)
    else:
        bearings_of(wrist, axis, bearings)
        for k in range(wrist.count):
            joints[LINEARS + k] = piece.angles[k]
        turn = wrapped(bearings[PHI] - piece.bearings[PHI])
        if wrist.count:
            joints[LINEARS + ONE] += turn - piece.sign * (bearings[PSI] - piece.bearings[PSI])
        if wrist.count == 2:
            joints[LINEARS + TWO] -= piece.sign * (bearings[CHI] - piece.bearings[CHI])
    place(links, tip, joints, length, columns)


@njit
def _lay_piece(links, wrist, piece, row, length, tolerance, blocks):
    """Blocks of one piece to the end of the list; False where none is short enough."""
    m = len(links.order)
    before, after, bearings, columns = np.empty(m), np.empty(m), np.empty(5), np.empty((3, 3))
    ends, off = np.empty((4, 3)), np.empty(4)
    _put_pose(links, wrist, piece, 0.0, length, ends[0], ends[2], bearings, columns, before)
    done, step = 0.0, 1.0
    while done < 1.0:
        even = np.ceil((1.0 - done) / step - 1e-9)
        to = done + (1.0 - done) / even if even > 1.0 else 1.0
        _put_pose(links, wrist, piece, to, length, ends[1], ends[3], bearings, columns, after)
        _put_deviation(links, before, after, length, ends, off)
        excess = max(off[TIP_BOUND] / tolerance.tip_mm, off[AXIS_BOUND] / tolerance.axis_rad)
        fitting = SAFETY * (to - done) / np.sqrt(max(excess, 1e-6))
        if excess > 1.0:
            step = max(min(fitting, 0.9 * (to - done)), 0.05 * (to - done))
            if step < LEAST_SHARE:
                return False
            continue
        block = np.empty(m + 3 + 4)
        put(block, after)
        block[m + SHARE] = piece.shares[0] + to * (piece.shares[1] - piece.shares[0])
        block[m + ROW], block[m + SPOT] = row, piece.is_spot
        put(block[m + 3:], off)
        blocks.append(block)
        step = min(fitting, GROWTH * (to - done)) if to < 1.0 else 1.0
        done = to
        put(before, after)
        put(ends[0], ends[1])
        put(ends[2], ends[3])
    return True


@njit
def _laid(links, wrist, rows, length, tolerance):
    """(joints, beside, deviations, row that failed or -1) of all moves."""
    m = len(links.order)
    first = np.zeros(m + 3 + 4)
    columns = np.empty((3, 3))
    _put_at(links, wrist, rows, 0, length, columns, first)
    first[m + SHARE] = 1.0
    blocks, failed = [first], -1
    for n in range(1, len(rows.tips)):
        if rows.is_rewind[n]:
            block = np.full(m + 3 + 4, np.inf)
            _put_at(links, wrist, rows, n, length, columns, block)
            block[m + SHARE], block[m + ROW], block[m + SPOT] = 1.0, n, 0.0
            blocks.append(block)
        elif not _lay_move(links, wrist, rows, n, length, tolerance, blocks):
            failed = n
            break
    table = np.empty((len(blocks), m + 7))
    for n in range(len(blocks)):
        put(table[n], blocks[n])
    return table[:, :m].copy(), table[:, m:m + 3].copy(), table[:, m + 3:].copy(), failed


@njit
def _put_at(links, wrist, rows, n, length, columns, out):
    """Joints of a row."""
    for k in range(wrist.count):
        out[LINEARS + k] = rows.angles[n, k]
    place(links, rows.tips[n], out[:len(links.order)], length, columns)


@njit
def _lay_move(links, wrist, rows, n, length, tolerance, blocks):
    """The move from row n - 1 to row n: at most two pieces beside a pole, and a turn on the spot between them."""
    a, b = n - 1, n
    here = rows.angles[a]
    if rows.passes[n]:
        return _lay_through_pole(links, wrist, rows, n, length, tolerance, blocks)
    if rows.is_pole[a] and not rows.is_pole[b] and wrist.count == 2:
        leave = np.empty(2)
        put(leave, at_pole(rows.sign[b], rows.bearings[b], rows.bearings[a, ALONG], rows.angles[b]))
        if not _lay_spot(links, wrist, rows.tips[a], rows.axes[a], here, leave, rows, n, 0.0, length, tolerance, blocks):
            return False
        here = leave
    ref = b if rows.is_pole[a] else a
    piece = Piece(rows.tips[a], rows.tips[b], rows.axes[a], rows.axes[b], rows.angles[ref], rows.bearings[ref], here,
                  rows.angles[b], rows.sign[ref], rows.is_pole[a] and rows.is_pole[b], np.array([0.0, 1.0]))
    return _lay_piece(links, wrist, piece, n, length, tolerance, blocks)


@njit
def _lay_through_pole(links, wrist, rows, n, length, tolerance, blocks):
    """A move that passes a pole: to it, on the spot, and away from it."""
    a, b = n - 1, n
    along = 1.0 if rows.bearings[a, ALONG] + rows.bearings[b, ALONG] > 0.0 else -1.0
    pole, tip, arrive, leave = np.empty(3), np.empty(3), np.empty(2), np.empty(2)
    for k in range(3):
        pole[k] = along * wrist.u1[k]
    way, rest = _angle(rows.axes[a], pole), _angle(pole, rows.axes[b])
    share = way / (way + rest)
    for k in range(3):
        tip[k] = _between(rows.tips[a], rows.tips[b], share, k)
    put(arrive, at_pole(rows.sign[a], rows.bearings[a], along, rows.angles[a]))
    put(leave, at_pole(rows.sign[b], rows.bearings[b], along, rows.angles[b]))
    to = Piece(rows.tips[a], tip, rows.axes[a], pole, rows.angles[a], rows.bearings[a], rows.angles[a], arrive, rows.sign[a],
               False, np.array([0.0, share]))
    away = Piece(tip, rows.tips[b], pole, rows.axes[b], rows.angles[b], rows.bearings[b], leave, rows.angles[b], rows.sign[b],
                 False, np.array([share, 1.0]))
    return (_lay_piece(links, wrist, to, n, length, tolerance, blocks)
            and _lay_spot(links, wrist, tip, pole, arrive, leave, rows, n, share, length, tolerance, blocks)
            and _lay_piece(links, wrist, away, n, length, tolerance, blocks))


@njit
def _lay_spot(links, wrist, tip, axis, here, leave, rows, n, share, length, tolerance, blocks):
    """Rotary 1 turns at a pole, where there is anything to turn; the tip stands."""
    if abs(leave[ONE] - here[ONE]) < SAME_RAD:
        return True
    piece = Piece(tip, tip, axis, axis, here, rows.bearings[n], here, leave, 1.0, True, np.array([share, share]))
    return _lay_piece(links, wrist, piece, n, length, tolerance, blocks)


@njit
def _angle(a, b):
    x, y, z = cross(a, b)
    return fixed.arctan2(np.sqrt(x * x + y * y + z * z), dot(a, b))
