"""How long blocks take when every joint keeps within its speed and acceleration.

A block runs its joints evenly, so its time is at least what the slowest joint needs.  From block to block a joint's speed
changes by what its acceleration allows in the time from the middle of one to the middle of the other: where it would
change by more, the faster of the two gets more time.
"""

import numpy as np

from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.errors import PostError

MOST_SWEEPS = 20_000        # over a program; each carries a ramp from one end of it to the other
WITHIN = 1e-3               # share by which an acceleration may be exceeded


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
