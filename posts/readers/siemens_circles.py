"""Circles through three points, as Sinumerik's CIP writes them, in one of the three main planes."""

from math import hypot, isfinite

from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.program.program import Plane

SAME = 1e-9             # of two coordinates of a program
STRAIGHT = 1e-9         # sine of the angle at the middle point, below which the three lie on a line


def arc_through(start, through, end):
    """The arc from start through a point between to the end.

    Args:
        start, through, end: (x, y, z), one unit.
    Returns:
        (program.Plane, whether it runs clockwise seen from the plane's third axis, centre (x, y, z)).
    Raises:
        Complaint: the points are in none of the main planes, or on one line.

    >>> arc_through((1, 0, 5), (0, 1, 5), (-1, 0, 5))[1:]
    (False, [0.0, 0.0, 5])
    """
    if not all(map(isfinite, start)):
        raise Complaint("CIP while nobody knows where the tool stands", "go to a named place by G0 first")
    for plane in Plane:
        a, b, third = plane.axes
        if max(abs(through[third] - start[third]), abs(end[third] - start[third])) <= SAME:
            break
    else:
        raise Complaint("a CIP circle outside the main planes", "write it as chords, or turn it into one of them")
    u, v = (through[a] - start[a], through[b] - start[b]), (end[a] - start[a], end[b] - start[b])
    across = u[0] * v[1] - u[1] * v[0]
    uu, vv = u[0] * u[0] + u[1] * u[1], v[0] * v[0] + v[1] * v[1]
    if abs(across) <= STRAIGHT * hypot(*u) * hypot(*v):
        raise Complaint("CIP through three points of one line", "write G1, or a point between the ends")
    center = list(start)
    center[a] += (v[1] * uu - u[1] * vv) / (2 * across)
    center[b] += (u[0] * vv - v[0] * uu) / (2 * across)
    return plane, across < 0, center
