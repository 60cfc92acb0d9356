r"""The contour that a control runs beside (G41), out of the path of the cutter's middle, with straight ways in and out.

    o------.              way in: straight, along the tangent of the arc in at its contour, longer than the radius;
     \      \  contour    the cutter's middle comes aside by its radius on the way
      \      \
  middle o    |           an arc about an outside corner is the corner itself, what was cut back at an inner
          \   |           corner goes on to it
"""

import numpy as np

from cuspline.program.compensation import CompensatedContour
from cuspline.program.program import MoveWriter
from cuspline.toolpaths.prismatic.contour_moves import Leads, follow
from cuspline.toolpaths.prismatic.plan_elements import SAME_MM, SNUG_MM, PlanElement, crossings
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import PlanError

WAY_SHARE, WAY_MORE_MM = 1.1, 0.5       # of the radius, and more: length of the straight ways in and out


def with_straight_ways(leads, radius_mm):
    """Leads that begin and end with the straight ways on which the cutter comes aside by its radius, and back."""
    far = WAY_SHARE * radius_mm + WAY_MORE_MM
    first, last = leads.way_in[0], leads.way_out[-1]
    begin = first.start - radius_mm * first.left(0.0) - far * first.heading(0.0)
    end = last.end - radius_mm * last.left(last.length_mm) + far * last.heading(last.length_mm)
    return Leads(way_in=(PlanElement(start=begin, end=first.start), *leads.way_in),
                 way_out=(*leads.way_out, PlanElement(start=last.end, end=end)))


def compensated_contour(elements, radius_mm, height_mm, first, worn_mm):
    """The CompensatedContour of a run of elements at one height.

    Args:
        elements: PlanElements of the cutter's middle, one straight way in first, one straight way out last.
        radius_mm: of the cutter.   first: the operation's move that runs the first of them.   worn_mm: see there.
    """
    rows = first + np.cumsum([0, *(is_move(e) for e in elements[:-1])])
    contour = contour_of(elements[1:-1], radius_mm)
    ends = [e.end for _, e in contour]
    way_in, way_out = (PlanElement(start=elements[0].start, end=contour[0][1].start),
                       PlanElement(start=ends[-1], end=elements[-1].end))
    writer, taken = MoveWriter((*elements[0].start, height_mm)), []
    for k, element in ((0, way_in), *((k + 1, e) for k, e in contour), (len(elements) - 1, way_out)):
        before = len(writer)
        follow(writer, (element,), height_mm, 1.0)
        taken += [int(rows[k])] * (len(writer) - before)
    return CompensatedContour(first=first, end=int(rows[-1]) + 1, contour=writer.moves(), row=taken, worn_mm=worn_mm)


def is_move(element):
    """Whether it goes out as a move: it leads somewhere."""
    return bool(np.abs(element.end - element.start).max() > 1e-9) if element.center is None else element.length_mm > 0


def contour_of(elements, radius_mm):
    """[(number of the element it belongs to, PlanElement of the contour)] of the middle's elements, each from where the one before
    ends.

    Raises:
        PlanError: two of them have no common corner.
    """
    kept = [(k, e.moved_left(-radius_mm)) for k, e in enumerate(elements)
            if is_move(e) and (e.center is None or e.is_left or e.radius_mm - radius_mm > SAME_MM)]
    kept = [item for n, item in enumerate(kept) if not _is_chord(kept, n)]
    corners = [_corner(a, b) for (_, a), (_, b) in zip(kept, kept[1:])]
    starts, ends = [kept[0][1].start, *corners], [*corners, kept[-1][1].end]
    return [(k, PlanElement(start=start, end=end, center=e.center, is_left=e.is_left))
            for (k, e), start, end in zip(kept, starts, ends) if e.center is not None or fixed.length(end - start) > SNUG_MM]


def _is_chord(kept, n):
    """Whether an element is the short straight joint about a corner at which its neighbours meet."""
    if not 0 < n < len(kept) - 1 or kept[n][1].center is not None:
        return False
    return fixed.length(kept[n - 1][1].end - kept[n + 1][1].start) < SNUG_MM


def _corner(a, b):
    if fixed.length(a.end - b.start) < SNUG_MM:
        return a.end
    middle, found = 0.5 * (a.end + b.start), crossings(a, b)
    if not found:
        raise PlanError(f"the contour has no corner near ({middle[0]:.3f}, {middle[1]:.3f}) for the control to run beside: leave "
                        "compensation out")
    return min(found, key=lambda place: float(fixed.length(place - middle)))
