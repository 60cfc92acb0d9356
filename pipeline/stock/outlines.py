r"""Exact signed distance to a cutter of revolution, in its half plane (r, z).

The cutter is the closed body under its cutting outline, closed by a disk where the flutes end:

    z   ──────┐ ← disk          pieces run counter-clockwise, the body on their left; no corner turns right,
    │         │                 so the body is convex (dovetails, lenses and barrels are too, though they undercut)
    └──___⎯⎯╱   ← outline       r

Of a convex body every piece is touched by planes.  The depth of a point inside is its distance to the nearest
of them; a point outside lies over the inside of one piece, or nearest to a corner.

A piece is a row of ten numbers:

    IS_ARC                              0 line, 1 arc
    START_R, START_Z                    its first point
    DIRECTION_R, DIRECTION_Z, LINE_LENGTH   of a line
    CENTER_R, CENTER_Z, RADIUS          of an arc, in the same three columns
    FROM_R, FROM_Z, TO_R, TO_Z          of an arc: directions from the centre to its ends
"""

import math

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.errors import SimulationError

TURN_RIGHT = 1e-6         # a corner may turn right by this (rad): rounding of an outline's own numbers
ROUNDING_MM = 1e-10       # of a point on the outline
IS_ARC, START_R, START_Z, CENTER_R, CENTER_Z, RADIUS, FROM_R, FROM_Z, TO_R, TO_Z = range(10)
DIRECTION_R, DIRECTION_Z, LINE_LENGTH = range(3, 6)


def outline_pieces(profile, name):
    """(k, 10) pieces of the closed body under a CutterProfile.

    Raises:
        SimulationError: a corner of the outline turns right, so the body is not convex.
    """
    top, height = profile.top_radius_mm, profile.height_mm
    lines = [_line(p, q) for p, q in zip(profile.start_mm, profile.end_mm)]
    rows = np.array([_arc(p, c, rho, angles) if rho > 0 else line for line, p, c, rho, angles in
                     zip(lines, profile.start_mm, profile.center_mm, profile.arc_radius_mm, profile.arc_angles_rad)]
                    + [_line(np.array([top, height]), np.array([0.0, height]))])
    is_arc = rows[:, :1] != 0
    first = np.where(is_arc, np.column_stack([-rows[:, 7], rows[:, 6]]), rows[:, 3:5])
    last = np.where(is_arc, np.column_stack([-rows[:, 9], rows[:, 8]]), rows[:, 3:5])
    turn = last[:-1, 0] * first[1:, 1] - last[:-1, 1] * first[1:, 0]
    if turn.min() < -TURN_RIGHT or first[0, 1] < -TURN_RIGHT:
        raise SimulationError(f"the outline of {name} has a concave corner, so its body is not convex, which the "
                              "simulation needs; simulate it as two cutters, below and above that corner")
    return rows


def frustum_outline(z0, r0, z1, r1):
    """(k, 10) pieces of a frustum from height z0 with radius r0 to z1 > z0 with r1; one of the radii is above 0."""
    corners = np.array([(0.0, z0), (r0, z0), (r1, z1), (0.0, z1)])
    return np.array([_line(p, q) for p, q in zip(corners[:-1], corners[1:]) if (p != q).any()])


def _line(start, end):
    length = fixed.hypot(*(end - start))
    return [0.0, *start, *((end - start) / length), length, 0.0, 0.0, 0.0, 0.0]


def _arc(start, center, radius, angles):
    return [1.0, *start, *center, radius, *(f(a) for a in angles for f in (fixed.cos, fixed.sin))]


@njit(error_model="numpy")
def outline_distance(r, z, outline, first, last):
    """Signed distance of (r, z), r >= 0, to the body of pieces first..last, and its gradient (r, z).

    Outside it is the way to the nearest piece or corner.  On the outline rounding may call a point outside one piece's
    plane and inside the piece that it lies on: within ROUNDING_MM of all planes it is taken for inside.
    """
    worst, wr, wz = -math.inf, 0.0, 0.0
    for k in range(first, last):                 # outline[k] as an array of its own would take longer than all the rest
        if outline[k, IS_ARC] == 0.0:
            x, y, dr, dz = r - outline[k, START_R], z - outline[k, START_Z], outline[k, DIRECTION_R], outline[k, DIRECTION_Z]
            s, nr, nz = x * dz - y * dr, dz, -dr
            is_over = 0.0 <= x * dr + y * dz <= outline[k, LINE_LENGTH]
        else:
            x, y, radius = r - outline[k, CENTER_R], z - outline[k, CENTER_Z], outline[k, RADIUS]
            fr, fz, tr, tz = outline[k, FROM_R], outline[k, FROM_Z], outline[k, TO_R], outline[k, TO_Z]
            is_over = fr * y - fz * x >= 0.0 and x * tz - y * tr >= 0.0
            rho = math.sqrt(x * x + y * y)
            if is_over and rho > 0.0:
                s, nr, nz = rho - radius, x / rho, y / rho
            else:
                s, nr, nz = x * fr + y * fz - radius, fr, fz
                other = x * tr + y * tz - radius
                if other > s:
                    s, nr, nz = other, tr, tz
        if s > 0.0 and is_over:
            return s, nr, nz
        if s > worst:
            worst, wr, wz = s, nr, nz
    if worst <= ROUNDING_MM:
        return worst, wr, wz
    least, x0, z0 = math.inf, 0.0, 0.0
    for k in range(first, last):
        x, y = r - outline[k, START_R], z - outline[k, START_Z]
        square = x * x + y * y
        if square < least:
            least, x0, z0 = square, x, y
    d = math.sqrt(least)
    return (d, x0 / d, z0 / d) if d > 0.0 else (0.0, wr, wz)


@njit(error_model="numpy")
def touching_point(nr, nz, outline, first, last):
    """Point (r, z) of the body that lies farthest in a direction (nr, nz), nr >= 0, and the outline's radius there."""
    best, br, bz, radius = -math.inf, 0.0, 0.0, 0.0
    for k in range(first, last):
        o = outline[k]
        r, z, bend = o[START_R], o[START_Z], 0.0
        if o[IS_ARC] != 0.0 and o[FROM_R] * nz - o[FROM_Z] * nr >= 0.0 and nr * o[TO_Z] - nz * o[TO_R] >= 0.0:
            r, z, bend = o[CENTER_R] + o[RADIUS] * nr, o[CENTER_Z] + o[RADIUS] * nz, o[RADIUS]
        far = r * nr + z * nz
        if far > best:
            best, br, bz, radius = far, r, z, bend
    return br, bz, radius
