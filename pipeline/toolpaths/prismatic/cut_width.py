r"""How wide a cut a cutter takes that runs along a wall with a ring of stock before it.

    along a line    the ring's thickness
    in a hollow     more, for its middle goes the short way round:   (R^2 - (R - left)^2) / (2 (R - radius))
    round a corner  less
"""

import numpy as np


def widest_cut_mm(path, radius_mm, left_mm, window_mm):
    """Widest mean cut on any stretch of a path, as the replay sees it: area swept over length of way.

    Args:
        path: PlanChain of the cutter's middle, the wall on its right.   radius_mm: from the middle to the wall.
        left_mm: thickness of the ring that stands before the wall.
        window_mm: length of the stretches; of a shorter path the mean of all of it.
    Returns:
        mm, no less than 0.
    """
    lengths = np.array([e.length_mm for e in path.elements])
    areas = np.array([_ring_mm2(e, radius_mm, left_mm) for e in path.elements])
    rounds = 2 if path.is_closed else 1
    ends, swept = (np.concatenate([[0.0], np.cumsum(np.tile(values, rounds))]) for values in (lengths, areas))
    if ends[-1] <= rounds * window_mm:
        return float(swept[-1] / ends[-1])
    begins = np.concatenate([ends, ends - window_mm])               # the widest stretch begins or ends at an element's end
    begins = begins[(begins >= 0) & (begins <= ends[-1] - window_mm)]
    return float((np.interp(begins + window_mm, ends, swept) - np.interp(begins, ends, swept)).max()) / window_mm


def _ring_mm2(element, radius_mm, left_mm):
    """Area of the ring beside an element."""
    if element.center is None:
        return element.length_mm * left_mm
    wall = element.radius_mm + element.side * radius_mm         # a hollow's is outside the path, a corner's inside
    far = max(wall - element.side * left_mm, 0.0)
    return element.sweep_rad / 2 * abs(wall**2 - far**2)
