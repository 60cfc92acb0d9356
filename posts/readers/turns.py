"""Turns of a tilted plane, as controls give them: about one axis after the other."""

from math import radians

import numpy as np

from cuspline.values import fixed_math as fixed


def turned_about(axis, degrees):
    """(3, 3) turn about X, Y or Z, 0 to 2, counter-clockwise as seen from its end.

    >>> turned_about(2, 90.0).round(9).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    turn, (i, j) = np.eye(3), ((axis + 1) % 3, (axis + 2) % 3)
    turn[i, i] = turn[j, j] = fixed.cos(radians(degrees))
    turn[j, i] = fixed.sin(radians(degrees))
    turn[i, j] = -turn[j, i]
    return turn
