r"""How far the axis turns along a run: from the least that clears each station to a turn that a machine follows.

    least     ___|‾‾|_______|‾|___          A largest value over a window, then two means over half of it each: nowhere below
    even      __/‾‾‾‾\_____/‾‾‾\__          the least, its slope and the change of its slope bounded by the window's length.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit


def even_angles(least_rad, window):
    """Angles nowhere below the least.

    Args:
        least_rad: (n,) at stations evenly apart.   window: stations to either side, at least 0.
    Returns:
        (n,).

    >>> even_angles(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), 2).round(3).tolist()
    [0.444, 0.667, 0.889, 1.0, 0.889, 0.667, 0.444]
    """
    if window == 0:
        return np.array(least_rad, float)
    half = window // 2
    highest = _windows(least_rad, window).max(axis=1)
    return mean_over(mean_over(highest, half), window - half)


def runs_of_one_bearing(least_rad):
    """The fewest runs of stations, each along one bearing, that leave out only what no bearing clears.

    Args:
        least_rad: (n, b) by station and bearing; inf: not clear.
    Returns:
        [(first, last, bearing)] of stations, both ends included; a run begins where the one before ends if both bearings are
        clear there.

    >>> inf = np.inf
    >>> runs_of_one_bearing(np.array([[0.0, 0.1], [0.2, 0.1], [inf, 0.1], [inf, inf], [0.3, inf]]))
    [(0, 2, 1), (4, 4, 0)]
    """
    n, found, at = len(least_rad), [], 0
    is_clear = np.isfinite(least_rad)
    while at < n:
        if not is_clear[at].any():
            at += 1
            continue
        blocked = np.vstack([~is_clear[at:], np.ones(is_clear.shape[1], bool)])
        ends = at + blocked.argmax(axis=0)                      # first station that is not clear
        sums = np.where(np.isfinite(least_rad[at:ends.max()]), least_rad[at:ends.max()], 0.0).sum(axis=0)
        bearing = int(np.lexsort((sums, -ends))[0])
        end = int(ends[bearing])
        found.append((at, end - 1, bearing))
        others = end < n and is_clear[end] & is_clear[end - 1]
        at = end - 1 if end - 1 > at and np.any(others) else end
    return found


def runs_of_least_turn(least_rad, change_rad):
    """The runs of stations, each along one bearing, over which the axis turns least in sum, a change of bearing counted as well.

    Args:
        least_rad: (n, b) by station and bearing; inf: not clear.   change_rad: what a change counts.
    Returns:
        As `runs_of_one_bearing`.

    >>> inf = np.inf
    >>> runs_of_least_turn(np.array([[0.0, 0.3], [0.0, 0.3], [inf, 0.3], [inf, inf], [0.3, inf]]), 0.4)
    [(0, 1, 0), (1, 2, 1), (4, 4, 0)]
    >>> runs_of_least_turn(np.array([[0.0, 0.3], [0.0, 0.3], [inf, 0.3], [inf, inf], [0.3, inf]]), 1.0)
    [(0, 2, 1), (4, 4, 0)]
    """
    n, is_open = len(least_rad), np.isfinite(least_rad)
    bearing = np.full(n, -1)
    _choose_bearings(for_kernel(least_rad), is_open.any(axis=1), float(change_rad), bearing)
    found, begins = [], np.flatnonzero(np.diff(bearing, prepend=-2))
    for first, end in zip(begins, [*begins[1:], n]):
        if (b := int(bearing[first])) >= 0:
            shares = first > 0 and is_open[first - 1, b]
            found.append((int(first) - int(shares), int(end) - 1, b))
    return found


@njit
def _choose_bearings(least, is_clear, change, bearing):
    """`bearing` (n,) of every station that some bearing clears; stretches between others are chosen each for itself."""
    n, count = least.shape
    cost, came, best = np.zeros(count), np.zeros((n, count), np.int64), np.zeros(n, np.int64)
    for k in range(n):
        if not is_clear[k]:
            cost[:] = 0.0
            continue
        at = best[k - 1]
        stays = k == 0 or not is_clear[k - 1]
        changed = cost[at] + change
        for j in range(count):
            came[k, j] = j if stays or cost[j] <= changed else at
            cost[j] = (cost[j] if stays else min(cost[j], changed)) + least[k, j]
        best[k] = cost.argmin()
    for k in range(n - 1, -1, -1):
        if is_clear[k]:
            goes_on = k + 1 < n and is_clear[k + 1]
            bearing[k] = came[k + 1, bearing[k + 1]] if goes_on else best[k]


def _windows(values, half):
    return sliding_window_view(np.pad(values, half, mode="edge"), 2 * half + 1)


def mean_over(values, half):
    """(n,) means over so many stations to either side, the ends' values going on beyond them."""
    return _windows(values, half).sum(axis=1) / (2 * half + 1) if half else values
