"""Places on circles about a point, in plan."""

import math

import numpy as np

from cuspline.values import fixed_math as fixed


def rings_of(radii_mm, spokes):
    """(rings, spokes, 2) places all round on circles of radii (rings,) about the origin.

    >>> rings_of(np.array([0.0, 2.0]), 4).round(9)[1].tolist()
    [[2.0, 0.0], [0.0, 2.0], [-2.0, 0.0], [-0.0, -2.0]]
    """
    turn = 2 * math.pi * np.arange(spokes) / spokes
    return radii_mm[:, None, None] * np.column_stack([fixed.cos(turn), fixed.sin(turn)])
