"""Roots of many rising functions at once."""

import numpy as np

STEPS = 80              # Newton ends long before; halving alone would take fifty
CLOSE = 1e-14           # change, as a share of the largest root (of 1 where all are smaller), at which it has ended


def rising_roots(value, slope, low, high):
    """Roots by Newton's steps, each kept within its bracket: a step that leaves it is replaced by halving.

    Args:
        value: function ((n,)) -> (n,), below 0 before each row's root and above 0 behind it.
        slope: its derivative, likewise; where it is 0 the bracket is halved.
        low, high: (n,) value(low) <= 0 <= value(high).
    Returns:
        (n,) roots, to rounding.

    >>> rising_roots(lambda r: r * r - [2.0, 9.0], lambda r: 2 * r, [0.0, 0.0], [4.0, 4.0]).round(9)
    array([1.41421356, 3.        ])
    """
    low, high = np.array(low, float), np.array(high, float)
    root = (low + high) / 2
    for _ in range(STEPS):
        f = value(root)
        low, high = np.where(f < 0, root, low), np.where(f < 0, high, root)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = root - f / slope(root)
        new = np.where((newton >= low) & (newton <= high), newton, (low + high) / 2)
        if np.abs(new - root).max(initial=0.0) <= CLOSE * np.abs(root).max(initial=1.0):
            break
        root = new
    return root
