"""A program that is fed into a small memory while it runs: when blocks are requested, when they arrive, where the control waits.

A control with a rotary buffer requests blocks as soon as fewer than m wait behind the one it runs, and takes them until more than n
do (PMAC: Buffer Request On and Off).  Each comes as fast as the line carries its bytes; the first of a request a moment later.

    blocks behind   n |      /\\        /\\
    the running one   |     /  \\      /  \\        a wait, where it comes down to 0
                    m |    /    \\____/    \\____
"""

import numpy as np

from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit


def waits_s(lasts_s, bytes_of, feeding):
    """How long a control waits before each block because it has not arrived.

    Args:
        lasts_s: (n,) how long each block runs, 0 for what moves nothing.
        bytes_of: (n,) that each takes on the line, its end with it.
        feeding: machines.Feeding.
    Returns:
        (n,) seconds; before the first block none: it is begun when the memory is filled.

    A block lasts a second and takes two to come. Three stand in the memory; the fourth is requested when the second begins:
    >>> from cuspline.shop.machines import Feeding
    >>> slow = Feeding(request_on_blocks=2, request_off_blocks=2, bytes_per_s=10, refill_s=0)
    >>> waits_s(np.full(6, 1.0), np.full(6, 20), slow).tolist()
    [0.0, 0.0, 0.0, 0.0, 1.0, 1.0]
    """
    coming_s = np.asarray(bytes_of, float) / feeding.bytes_per_s
    return _waits(for_kernel(np.asarray(lasts_s, float)), for_kernel(coming_s), feeding.request_on_blocks,
                  feeding.request_off_blocks, feeding.refill_s)


@njit
def _waits(lasts_s, coming_s, on, off, refill_s):
    """See `waits_s`; begun[k] is when block k begins, of those that have arrived."""
    n = len(lasts_s)
    begun, wait, here = np.zeros(n), np.zeros(n), min(off + 1, n)
    for k in range(1, here):                                # what the memory holds at the start
        begun[k] = begun[k - 1] + lasts_s[k - 1]
    free_s, runs, is_coming = 0.0, 0, False                 # the line is free from then on; block that runs at that time
    for k in range(here, n):
        while runs + 1 < k and begun[runs + 1] <= free_s:
            runs += 1
        if not is_coming or k - 1 - runs > off:             # it stands still until fewer than `on` wait behind the running one
            runs = max(runs, k - on)
            free_s, is_coming = max(free_s, begun[runs]) + refill_s, True
        free_s += coming_s[k]
        ends_s = begun[k - 1] + lasts_s[k - 1]
        begun[k] = max(ends_s, free_s)
        wait[k] = begun[k] - ends_s
    return wait
