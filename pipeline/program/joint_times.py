"""How long blocks take when every joint keeps within its speed and acceleration.

A block runs its joints evenly, so its time is at least what the slowest joint needs.  From block to block a joint's speed
changes by what its acceleration allows in the time from the middle of one to the middle of the other: where it would
change by more, the faster of the two gets more time.
"""

import numpy as np

from cuspline.shop.kinematics import LINEARS
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.errors import PostError

MOST_SWEEPS = 20_000        # over a program; each carries a ramp from one end of it to the other
WITHIN = 1e-3               # share by which an acceleration may be exceeded
BLENDED = 0.5               # of the acceleration is used where blocks are blended: two of them may run at once
STANDS_MM = 1e-9            # X Y Z move less: the rotaries' degrees are the block's length
LEAST_S = 1e-12             # stands for no time at all
MOST_ROUNDS = 200           # of slowing down before corners,
LOOKED_AT = (0.25, 0.5, 0.75)       # shares of a blend
SLOWER = 1.5                # by this factor at most in one
SHARPEST = 1e-3             # cosine of half a corner, below which it is no corner


def block_seconds(chain, joints, wanted_s, is_linked):
    """Times of blocks.

    Args:
        chain: kinematics.Chain.
        joints: (n + 1, m) one after the other.
        wanted_s: (n,) that each should take; more where a joint cannot.
        is_linked: (n,) bool: the block goes on from the one before without a stop.
    Returns:
        (n,) seconds; no joint is beyond its speed, nor by more than WITHIN beyond its acceleration.
    Raises:
        PostError: no times were found; `.rows`.
    """
    delta = for_kernel(np.diff(np.asarray(joints, float), axis=0))
    least = (np.abs(delta) / chain.speed).max(axis=1)
    seconds = for_kernel(np.maximum(np.asarray(wanted_s, float), least))
    worst = _eased(delta, seconds, for_kernel(chain.acceleration), for_kernel(is_linked, np.bool_))
    if worst >= 0:
        raise PostError(f"block {worst}: its joints cannot be brought within their accelerations; correct the machine's file",
                        rows=[worst])
    return seconds


def rounded_seconds(chain, joints, seconds, length_mm, blend_mm, within_mm):
    """Times of blocks so that a control that blends them rounds no corner of the tip by more than allowed.

    LinuxCNC's P of G64 looks at the corners of X Y Z alone: where rotaries change their pace, the tip may leave its line by any
    amount.  While one block comes to rest the next begins; where the joints are then follows from both accelerations.

    Args:
        chain: kinematics.Chain.   joints: (n + 1, m) one after the other.
        seconds: (n,) of cutting blocks; 0: a rapid, which stays as it is.
        length_mm: from the spindle nose to the tip.   blend_mm: P of G64.   within_mm: of the tip at any corner.
    Returns:
        (n,) seconds, not less than given; corners between cutting blocks only.
    Raises:
        PostError: no times were found.
    """
    joints, seconds = np.asarray(joints, float), np.array(seconds, float)
    delta = np.diff(joints, axis=0)
    moving = np.flatnonzero((np.abs(delta) > 0).any(axis=1))
    if len(moving) < 2:
        return seconds
    ends, cuts = joints[np.append(moving, moving[-1] + 1)], seconds[moving] > 0
    tips = chain.forward(ends, length_mm)[0]
    for _ in range(MOST_ROUNDS):
        length, v, a = _runs(chain, delta[moving], seconds[moving])
        blend = _blends(delta[moving], length, v, a, blend_mm)[:-1] / a[:-1]
        pull = delta[moving] * (a / length)[:, None]
        over = np.zeros(len(blend))
        for share in LOOKED_AT:
            there = (0.5 * (share * blend) ** 2)[:, None] * pull[1:] - (0.5 * ((1 - share) * blend) ** 2)[:, None] * pull[:-1]
            at = chain.forward(ends[1:-1] + there, length_mm)[0]
            off = np.minimum(_off_segments(at, tips[:-2], tips[1:-1]), _off_segments(at, tips[1:-1], tips[2:]))
            over = np.maximum(over, off / within_mm)
        over = np.where(cuts[1:] & cuts[:-1], over, 0.0)
        if not (over > 1.0 + WITHIN).any():
            return seconds
        slower = np.minimum(np.sqrt(np.maximum(np.maximum(np.append(over, 0.0), np.append(0.0, over)), 1.0)), SLOWER)
        seconds[moving] = np.where(cuts & (slower > 1.0), np.maximum(seconds[moving], length / v * slower), seconds[moving])
    raise PostError(f"block {moving[np.argmax(over) + 1]}: the control would round a corner by more than {within_mm:g} mm however "
                    "slowly it runs; correct the machine's file")


def driven_seconds(chain, joints, seconds, blend_mm):
    """What blocks add to the time of a program on LinuxCNC, which blends blocks with rotary words parabolically.

    Each block runs a trapezoid of its own from rest to rest at half its acceleration; the next begins while it comes to
    rest, as early as both can follow and the corner stays within the tolerance.

    Args:
        chain: kinematics.Chain.   joints: (n + 1, m) one after the other.
        seconds: (n,) that each was programmed to take; 0: as fast as it can.
        blend_mm: P of G64.
    Returns:
        (n,) seconds.  Within 5 % of its controller on all presets, at full and at a fifth of the feed (tests/authorities).
    """
    delta = np.diff(np.asarray(joints, float), axis=0)
    out, moves = np.zeros(len(delta)), (np.abs(delta) > 0).any(axis=1)
    delta = delta[moves]
    length, v, a = _runs(chain, delta, np.asarray(seconds, float)[moves])
    blend = _blends(delta, length, v, a, blend_mm)
    out[moves] = length / v + (v - blend) / a
    return out


def _blends(delta, length, v, a, blend_mm):
    """(n,) speed of each block at which the next begins; 0 at the last."""
    out = np.zeros(len(v))
    both = np.minimum(np.minimum(length / v, np.roll(length / v, -1)), np.maximum(v / a, np.roll(v / a, -1)))
    out[:-1] = np.minimum(v, both * a)[:-1]
    u = delta[:, :LINEARS] / np.maximum(np.sqrt((delta[:, :LINEARS] ** 2).sum(axis=1)), STANDS_MM)[:, None]
    corner = np.sqrt(np.maximum(0.5 - 0.5 * (u[:-1] * u[1:]).sum(axis=1), 0.0))     # cosine of half of it
    limit = 2.0 * np.sqrt(a[:-1] * blend_mm / np.maximum(corner, SHARPEST))
    out[:-1] = np.where(corner > SHARPEST, np.minimum(out[:-1], limit), out[:-1])
    return out


def _off_segments(points, a, b):
    """(n,) distance of each point to its segment."""
    along = b - a
    t = np.clip(((points - a) * along).sum(axis=1) / np.maximum((along ** 2).sum(axis=1), STANDS_MM ** 2), 0.0, 1.0)
    return np.sqrt(((points - a - t[:, None] * along) ** 2).sum(axis=1))


def _runs(chain, delta, seconds):
    """(n,) length, speed reached and acceleration of each block, as LinuxCNC counts them: along X Y Z, else degrees."""
    along = np.sqrt((delta[:, :LINEARS] ** 2).sum(axis=1))
    length = np.where(along > STANDS_MM, along, np.degrees(np.sqrt((delta[:, LINEARS:] ** 2).sum(axis=1))))
    fastest = length / (np.abs(delta) / chain.speed).max(axis=1)
    a = BLENDED * length / (np.abs(delta) / chain.acceleration).max(axis=1)
    asked = length / np.maximum(seconds, LEAST_S)
    return length, np.minimum(np.minimum(fastest, asked), np.sqrt(a * length)), a


@njit
def _over(delta, seconds, acceleration, k):
    """By how much the change of speed from block k - 1 to k exceeds what the accelerations allow: up to 1 is none."""
    over, span = 0.0, 0.5 * (seconds[k - 1] + seconds[k])
    for c in range(len(acceleration)):
        change = abs(delta[k, c] / seconds[k] - delta[k - 1, c] / seconds[k - 1])
        over = max(over, change / (acceleration[c] * span))
    return over


@njit
def _pace(delta, seconds, acceleration, k):
    """Speed of a block, each joint's beside its acceleration."""
    most = 0.0
    for c in range(len(acceleration)):
        most = max(most, abs(delta[k, c]) / (seconds[k] * acceleration[c]))
    return most


@njit
def _eased(delta, seconds, acceleration, is_linked):
    """Lengthen `seconds` to and fro until every joint can follow; -1, or a block at which that does not come to an end."""
    n = len(seconds)
    for sweep in range(MOST_SWEEPS):
        worst = -1
        for i in range(1, n):
            k = i if sweep % 2 == 0 else n - i
            if not is_linked[k] or seconds[k] == 0.0 or seconds[k - 1] == 0.0:
                continue
            over = _over(delta, seconds, acceleration, k)
            if over <= 1.0 + WITHIN:
                continue
            worst = k
            faster = k if _pace(delta, seconds, acceleration, k) >= _pace(delta, seconds, acceleration, k - 1) else k - 1
            seconds[faster] *= max(min(np.sqrt(over), 2.0), 1.0 + WITHIN)
        if worst < 0:
            return -1
    return worst
