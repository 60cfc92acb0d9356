"""Arcs as RS-274 writes them, in the two axes of their plane, seen from its third axis.

            end
       .--*         counter-clockwise (G3): from the first axis towards the second;
     (    |\\        the centre by offsets (I J K) or by the radius (R, negative for
      `.  | start   the longer way round)
         `c'
Bounds measured on LinuxCNC 2.9.0~pre1: they are in program units, so those of G20 are in inches.
"""

from math import atan2, hypot, sqrt, tau
from typing import NamedTuple

from cuspline.posts.readers.rs274_expressions import Complaint

MM_PER_INCH = 25.4
SAME_POINT_MM = 1e-9        # rounding of sums of program numbers, far below any controller's resolution
FULL_CIRCLE_RAD = 2e-6      # LinuxCNC turns a full circle below 1e-6 rad
RELATIVE_RADIUS_ERROR = 1e-3


class ArcBounds(NamedTuple):
    """What LinuxCNC lets pass in one of the units, all as mm."""

    radius_error_mm: float          # always let pass
    largest_error_mm: float         # never let pass; between them 0.1 % of the radius
    smallest_radius_mm: float


MM_BOUNDS = ArcBounds(0.02 * sqrt(2), 2 * sqrt(2), 0.00127)
CLOSE_BOUNDS = ArcBounds(0.005, 0.005, 0.00127)     # what every control takes that we know, whatever its parameters
INCH_BOUNDS = ArcBounds(*(MM_PER_INCH * inch for inch in (0.002 * sqrt(2), 0.2 * sqrt(2), 0.00005)))


def check_radii(start, end, center, bounds):
    """Compare the radii at both ends by the controller's rule.

    Args:
        start, end, center: (first, second) coordinates, mm.
    Raises:
        Complaint: no arc goes through both ends.
    """
    at_start = hypot(start[0] - center[0], start[1] - center[1])
    at_end = hypot(end[0] - center[0], end[1] - center[1])
    error, larger = abs(at_start - at_end), max(at_start, at_end)
    if min(at_start, at_end) < bounds.smallest_radius_mm:
        raise Complaint(f"an arc of radius {min(at_start, at_end):.6f} mm", "give its centre, or write G1")
    if error > bounds.largest_error_mm or (
            error > bounds.radius_error_mm and error > RELATIVE_RADIUS_ERROR * larger):
        raise Complaint(
            f"the radius is {at_start:.5f} mm at the start and {at_end:.5f} mm at the end",
            f"they may differ by {bounds.radius_error_mm:.4f} mm or 0.1 % of the radius: correct the centre or the end")


def center_from_radius(start, end, radius, is_clockwise, bounds):
    """(first, second) centre of the arc written with R; a negative radius is the longer way round.

    Source: the centre stands on the perpendicular of the chord's middle, sqrt(R² - (chord/2)²) away;
    left of the chord for a short counter-clockwise arc.
    Raises:
        Complaint: the ends coincide, or are too far apart.
    """
    along, across = end[0] - start[0], end[1] - start[1]
    half = hypot(along, across) / 2
    if half * 2 <= SAME_POINT_MM:
        raise Complaint("an R arc that ends where it begins has no centre", "write a full circle with I J K")
    if half > abs(radius) + bounds.smallest_radius_mm:
        raise Complaint(f"R {abs(radius):.5f} mm cannot span its ends, {2 * half:.5f} mm apart",
                        "correct the radius or the end")
    height = sqrt(max(radius * radius - half * half, 0.0)) / (2 * half)
    if is_clockwise != (radius < 0):
        height = -height
    return (start[0] + along / 2 - across * height, start[1] + across / 2 + along * height)


def sweep_rad(start, end, center, is_clockwise):
    """Angle from start to end in the arc's own sense, above 0; a whole turn where they coincide.

    Raises:
        Complaint: so short an arc that the controller would turn a whole circle.

    >>> round(sweep_rad((1, 0), (0, 1), (0, 0), is_clockwise=True), 6)
    4.712389
    """
    if is_same_point(start, end):
        return tau
    turned = (atan2(end[1] - center[1], end[0] - center[0])
              - atan2(start[1] - center[1], start[0] - center[0]))
    sweep = (-turned if is_clockwise else turned) % tau
    if sweep < FULL_CIRCLE_RAD:
        raise Complaint(f"an arc of {sweep:.1e} rad: the controller would turn a whole circle", "write G1")
    return sweep


def is_same_point(start, end):
    """Both coordinates agree but for rounding."""
    return max(abs(end[0] - start[0]), abs(end[1] - start[1])) <= SAME_POINT_MM
