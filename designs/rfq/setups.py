r"""Clampings of a vane that is longer than the bed: where each begins and ends, its zero, its markers.

    |<-------------- vane -------------->|
    |<-- setup-1 -->|
                 |<-- setup-2 -->|            both cut the overlap
                              |<- setup-3 ->|

The vane stays on one carrier, a plate with tooling balls beside the jaws, and is shifted along the bed with it; the
balls' centres, measured anew, are the markers of a clamping.
"""

import math

from cuspline.design import FacePredicate, Marker
from cuspline.values.errors import DesignError

WORK_OFFSETS = ("G54", "G55", "G56", "G57", "G58", "G59")
FAR_MM = 1e5                # of a box that holds any vane
LEAST_PANEL_MM = 1.0        # faces are not split closer together than this
BALLS_OUT_MM = 60.0         # tooling balls from the body's side,
BALLS_UP_MM = 10.0          # above the jaws,
BALLS_SHARE = 0.1           # and so much of a clamping from its ends


def clampings(start_mm, end_mm, travel_mm, overlap_mm):
    """[(first, last)] x of what each clamping cuts: equally long, as few as reach.

    Args:
        start_mm, end_mm: of the vane.   travel_mm: longest that one clamping reaches.   overlap_mm: cut by both.
    Raises:
        DesignError: overlap and travel leave nothing to gain, or more clampings than there are work offsets.
    """
    length = end_mm - start_mm
    if length <= travel_mm:
        return [(start_mm, end_mm)]
    if travel_mm <= 2 * overlap_mm:
        raise DesignError(f"bed_travel_mm {travel_mm:g} is no more than twice overlap_mm {overlap_mm:g}: each setup "
                          "would only repeat its neighbours; lower the overlap, or take a longer bed")
    count = math.ceil((length - overlap_mm) / (travel_mm - overlap_mm) - 1e-9)
    if count > len(WORK_OFFSETS):
        raise DesignError(f"a vane of {length:.1f} mm takes {count} setups of {travel_mm:g} mm, and there are "
                          f"{len(WORK_OFFSETS)} work offsets: take a longer bed, or cut it with from_mm and to_mm")
    width = (length + (count - 1) * overlap_mm) / count
    firsts = [start_mm + k * (width - overlap_mm) for k in range(count)]
    return [(first, first + width) for first in firsts[:-1]] + [(firsts[-1], end_mm)]


def splits(joints_mm, spans):
    """Sorted x at which faces are split: where clampings begin and end, and the joints that lie apart from these."""
    borders = sorted({x for span in spans for x in span})[1:-1]
    apart = [x for x in joints_mm if all(abs(x - b) > LEAST_PANEL_MM for b in borders)]
    return sorted([*borders, *apart])


def predicates(spans):
    """A FacePredicate a clamping: tip and flanks between its ends."""
    if len(spans) == 1:
        return (FacePredicate(name="tip and flanks", at_least=3, kinds=("bspline",)),)
    return tuple(FacePredicate(name=f"tip and flanks {k}", at_least=3, kinds=("bspline",),
                               center_min_mm=(low, -FAR_MM, -FAR_MM), center_max_mm=(high, FAR_MM, FAR_MM))
                 for k, (low, high) in enumerate(spans, 1))


def markers(span, half_width_mm, grip_mm):
    """Centres of four tooling balls on the carrier, beside what a clamping cuts."""
    low, high = span
    inset, out = BALLS_SHARE * (high - low), half_width_mm + BALLS_OUT_MM
    return tuple(Marker(name=f"ball {n}", at_mm=(x, y, grip_mm + BALLS_UP_MM)) for n, (x, y) in enumerate(
        [(low + inset, -out), (high - inset, -out), (low + inset, out), (high - inset, out)], 1))
