"""How long edges last, when they are changed, how many a part takes (docs/formulas.md 12)."""

import numpy as np

from cuspline.values.errors import InputError


def machining_time_h(aluminium_h, time_factor):
    """Machining time of a part in another material, from its time in aluminium or brass.

    >>> [machining_time_h(1.0, factor) for factor in (5, 7, 10)]
    [5.0, 7.0, 10.0]
    """
    return float(aluminium_h * time_factor)


def edges_needed(cutting_min, life_min):
    """How many sets of edges a time in the cut takes.

    >>> [edges_needed(60 * hours, life) for hours, life in ((5, 420), (7, 360), (10, 40))]
    [1, 2, 15]
    """
    return max(1, int(np.ceil(cutting_min / life_min - 1e-9)))


def change_points(minutes, life_min):
    """Where to change edges: before which of the stretches between places where the program may be stopped.

    Args:
        minutes: (n,) time in the cut of each stretch, one after the other.   life_min: of a set of edges.
    Returns:
        growing numbers of stretches; no set of edges cuts for longer than its life.
    Raises:
        InputError: one stretch alone takes longer than the edges last.

    >>> change_points([10, 10, 10, 15, 5], 25)
    [2, 4]
    """
    worn, out = 0.0, []
    for k, own in enumerate(minutes):
        if own > life_min + 1e-9:
            raise InputError(f"stretch {k + 1} takes {own:.1f} minutes in the cut, edges last {life_min:g}: give the program a "
                             "restart point within it")
        if worn + own > life_min + 1e-9:
            out.append(k)
            worn = 0.0
        worn += own
    return out
