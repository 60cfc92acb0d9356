"""The smallest angle by which a tool, turned about one of its points, comes clear of triangles: kernels only.

A triangle's point that the tool holds stays in its way until the tool has turned past it; how far that is follows from the
point alone, in steps of (depth / distance from the middle), each of which it provably still blocks.  So a search jumps from
one point in the way to the next and leaves out no angle that is clear, but for windows narrower than its smallest step.
Segments are those of replay/clearance.py, grown by the margins wanted: clear is a distance of 0 or more.
"""

import math

import numpy as np

from cuspline.replay.clearance_kernels import NEAREST, least_distance, segment_distance, set_place, workspace
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z, put

SMALLEST_STEP_RAD = math.radians(0.05)
DEEP_MM = 0.5               # a point so deep in the way is deep enough to go on from
ROUGH_MM = 0.2              # how roughly the tool is looked at first
CLOSE_MM = 0.002            # and where that does not tell
MARCHES = 24                # steps past one point at the most; the search goes on from any of them
SPANNED = 0.02              # sine between axis and normal: nearer to each other they span no plane that a run can go by
PART, BESIDE = range(2)     # of the hints: triangles of the two meshes
STUCK_RAD = 1e-5            # of a step past a point: the smallest step does as well


@njit
def _depth(along, beside, angle, square, radius, segments):
    """Signed distance to the tool, turned by an angle, of a point so far along its axis and beside it, `square` from its middle."""
    height = along * fixed.cos(angle) + beside * fixed.sin(angle)
    rho, least = math.sqrt(max(square - height * height, 0.0)), math.inf
    for k in range(len(segments)):
        distance, _, _ = segment_distance(rho, height + radius, segments[k])
        least = min(least, distance)
    return least


@njit
def _past(point, middle, axis, way, angle, radius, segments):
    """A larger angle; at all between the point is still in the way."""
    along = beside = square = 0.0
    for k in range(3):
        arm = point[k] - middle[k]
        along, beside, square = along + arm * axis[k], beside + arm * way[k], square + arm * arm
    reach = math.sqrt(square)
    for _ in range(MARCHES):
        depth = -_depth(along, beside, angle, square, radius, segments)
        if depth <= STUCK_RAD * reach:
            break
        angle += depth / reach
    return angle


@njit
def _stand(place, middle, axis, way, angle, radius):
    """The tool turned by an angle from its axis toward the way."""
    c, s = fixed.cos(angle), fixed.sin(angle)
    x, y, z = c * axis[X] + s * way[X], c * axis[Y] + s * way[Y], c * axis[Z] + s * way[Z]
    set_place(place, middle[X] - radius * x, middle[Y] - radius * y, middle[Z] - radius * z, x, y, z)
    return z


@njit
def is_clear_at(mesh, place, segments, hint, work):
    """(proven clear, triangle in the way or nearest, -1: none near; whether work[NEAREST] is a point in the way)."""
    lower, got, found = least_distance(mesh, place, segments, ROUGH_MM, -DEEP_MM, ROUGH_MM, hint, work)
    if got >= 0.0 and lower < 0.0:
        lower, got, found = least_distance(mesh, place, segments, CLOSE_MM, -math.inf, CLOSE_MM, found, work)
    return lower >= 0.0, found, got < 0.0


@njit
def _is_clear_of_both(mesh, segments, beside, beside_segments, place, hints, work):
    """(proven clear of two meshes, each with its segments; whether work[NEAREST] is a point in the way; is it the second's)."""
    is_clear, found, is_met = is_clear_at(mesh, place, segments, hints[PART], work)
    hints[PART] = found if found >= 0 else hints[PART]
    if not is_clear or len(beside_segments) == 0:
        return is_clear, is_met, False
    is_clear, found, is_met = is_clear_at(beside, place, beside_segments, hints[BESIDE], work)
    hints[BESIDE] = found if found >= 0 else hints[BESIDE]
    return is_clear, is_met, True


@njit
def smallest_angle(mesh, segments, beside, beside_segments, middle, axis, way, most, lowest_z, radius, hints, place, work):
    """Angle from the axis toward the way at which the tool is proven clear of both meshes, inf: none up to `most`.

    lowest_z: the axis' own z must not be below it.   hints: (2,) triangles to look at first, or -1; left as they were found.
    """
    angle = 0.0
    while angle <= most:
        if _stand(place, middle, axis, way, angle, radius) < lowest_z:
            angle += SMALLEST_STEP_RAD
            continue
        is_clear, is_met, is_beside = _is_clear_of_both(mesh, segments, beside, beside_segments, place, hints, work)
        if is_clear:
            return angle
        further = angle
        if is_met:
            further = _past(work[NEAREST], middle, axis, way, angle, radius, beside_segments if is_beside else segments)
        angle = max(further, angle + SMALLEST_STEP_RAD)
    return math.inf


@njit
def smallest_angles(mesh, segments, beside, beside_segments, middles, axes, ways, most, lowest_z, radius, angles, first, last):
    """`angles` of rows first .. last - 1; each helps the next.   most: (n,), below 0: not looked for."""
    place, work, hints = np.zeros(17), workspace(), np.full(2, -1)
    for i in range(first, last):
        angles[i] = math.inf
        if most[i] >= 0.0:
            angles[i] = smallest_angle(mesh, segments, beside, beside_segments, middles[i], axes[i], ways[i], most[i], lowest_z,
                                       radius, hints, place, work)


@njit
def clear_rows(mesh, segments, beside, beside_segments, middles, axes, radius, is_clear, first, last):
    """`is_clear` of rows first .. last - 1: proven, the tool standing as it does."""
    place, work, hints = np.zeros(17), workspace(), np.full(2, -1)
    for i in range(first, last):
        _stand(place, middles[i], axes[i], axes[i], 0.0, radius)
        is_clear[i], _, _ = _is_clear_of_both(mesh, segments, beside, beside_segments, place, hints, work)


@njit
def go_on(axes, level, spans, found, first):
    """`found` (n, 3), `square_to` at first, from one row to both ends: `level` or its opposite, the nearer to the way before.

    Where level spans no plane: what is left of the way before, square to the axis.
    """
    for step in (1, -1):
        k = first if step == 1 else first - 1
        while 0 <= k < len(found):
            near = found[k - step] if k != first else found[first]
            if spans[k]:
                dot = level[k, X] * near[X] + level[k, Y] * near[Y] + level[k, Z] * near[Z]
                sign = 1.0 if dot >= 0.0 else -1.0
                for j in range(3):
                    found[k, j] = sign * level[k, j]
            elif k != first:
                along = near[X] * axes[k, X] + near[Y] * axes[k, Y] + near[Z] * axes[k, Z]
                x, y, z = near[X] - along * axes[k, X], near[Y] - along * axes[k, Y], near[Z] - along * axes[k, Z]
                length = math.sqrt(x * x + y * y + z * z)
                if length > SPANNED:
                    put(found[k], (x / length, y / length, z / length))
            k += step
