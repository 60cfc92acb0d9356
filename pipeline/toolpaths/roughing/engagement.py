r"""A cutter steered through a plane field of material so that its engagement never passes a bound.

The field holds, at each node, the distance to what has been cleared: positive in material.  A pass
keeps the material on the right (climb milling under a spindle that turns clockwise) and at every
step turns as far to the right as the bound on the engaged arc and the permitted region allow:

        cleared          heading ↑   the engaged arc lies between ahead and right
      ~~~~~~~(  tool  )▒▒▒▒▒▒▒▒▒▒
             material ▒▒▒▒▒▒▒▒▒▒▒

Too much in the cut: the pass bears left and leaves the rest to later passes; so corners are taken
in thin slices and narrow channels in crescents, without being looked for.
"""

import math

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y

ARC_SAMPLES = 120           # half the circle ahead is looked at in steps of 1.5 degrees
SIDE_SAMPLES = 8
CHIP_SHARE = 0.2            # of the thinnest material that is worth a pass: so thin a chip is still engagement
TURNS = 12                  # directions tried at each step, from right to left
REFINEMENTS = 5
SHARP_TURNS = 16            # tried when no gentle turn is possible: up to half a turn to the left


@njit(inline="always")
def value_at(field, x, y):
    """Bilinear value at grid coordinates; the border value outside."""
    ny, nx = field.shape
    x = min(max(x, 0.0), nx - 1.000001)
    y = min(max(y, 0.0), ny - 1.000001)
    i, j = int(x), int(y)
    u, v = x - i, y - j
    return ((field[j, i] * (1.0 - u) + field[j, i + 1] * u) * (1.0 - v)
            + (field[j + 1, i] * (1.0 - u) + field[j + 1, i + 1] * u) * v)


@njit
def engaged_rad(material, x, y, heading, radius, thin):
    """Arc of the cutter's front half that stands in material thicker than `thin`; lengths in nodes.

    Close beside the cutter the chip of one step is thinner than that: a first engaged sample within
    SIDE_SAMPLES of either end counts from that end on.
    """
    count, first, last = 0, -1, -1
    cosine, sine = fixed.cos(math.pi / ARC_SAMPLES), fixed.sin(math.pi / ARC_SAMPLES)
    angle = heading - math.pi / 2 + 0.5 * math.pi / ARC_SAMPLES
    dx, dy = radius * fixed.cos(angle), radius * fixed.sin(angle)
    for k in range(ARC_SAMPLES):
        if value_at(material, x + dx, y + dy) > thin:
            count += 1
            last = k
            if first < 0:
                first = k
        dx, dy = dx * cosine - dy * sine, dx * sine + dy * cosine
    if 0 <= first <= SIDE_SAMPLES:
        count += first
    if last >= ARC_SAMPLES - 1 - SIDE_SAMPLES:
        count += ARC_SAMPLES - 1 - last
    return count * math.pi / ARC_SAMPLES


@njit
def clear_stroke(material, x0, y0, x1, y1, radius, thin):
    """Lower the field to the distance from one straight stroke; gives the number of nodes newly cleared."""
    ny, nx = material.shape
    reach = radius + 2.0
    ux, uy = x1 - x0, y1 - y0
    square = ux * ux + uy * uy
    fresh = 0
    for j in range(max(0, math.ceil(min(y0, y1) - reach)), min(ny, math.floor(max(y0, y1) + reach) + 1)):
        for i in range(max(0, math.ceil(min(x0, x1) - reach)), min(nx, math.floor(max(x0, x1) + reach) + 1)):
            old = material[j, i]
            if old <= -radius:
                continue
            t = 0.0 if square == 0.0 else min(max(((i - x0) * ux + (j - y0) * uy) / square, 0.0), 1.0)
            px, py = x0 + t * ux - i, y0 + t * uy - j
            limit = old + radius
            d = px * px + py * py
            if d < limit * limit:
                new = math.sqrt(d) - radius
                material[j, i] = new
                if old > thin and new <= thin:
                    fresh += 1
    return fresh


@njit
def _may(material, permitted, x, y, heading, radius, thin, bound):
    return value_at(permitted, x, y) >= 0.0 and engaged_rad(material, x, y, heading, radius, CHIP_SHARE * thin) <= bound


@njit
def _next_heading(material, permitted, x, y, heading, radius, thin, bound, step, right, left):
    """The heading farthest to the right that keeps the bound and stays permitted; NaN: none."""
    blocked = math.nan
    for k in range(TURNS + SHARP_TURNS + 1):
        if k <= TURNS:
            turn = -right + (right + left) * k / TURNS
        else:
            turn = left + (0.9 * math.pi - left) * (k - TURNS) / SHARP_TURNS
        h = heading + turn
        if not _may(material, permitted, x + step * fixed.cos(h), y + step * fixed.sin(h), h, radius, thin, bound):
            blocked = turn
            continue
        if k == 0:
            return h
        free = turn
        for _ in range(REFINEMENTS):
            middle = 0.5 * (free + blocked)
            h = heading + middle
            if _may(material, permitted, x + step * fixed.cos(h), y + step * fixed.sin(h), h, radius, thin, bound):
                free = middle
            else:
                blocked = middle
        return heading + free
    return math.nan


@njit
def cut_pass(material, permitted, x, y, heading, radius, thin, bound, step, right, left, idle, longest):
    """One pass from a place where the cutter stands free, as far as it finds material within the bound.

    Args:
        material: (ny, nx) distance to what is cleared, positive in material; lowered in place.
        permitted: (ny, nx) >= 0 where the tip may be.
        x, y, heading: start, grid coordinates and radians.
        radius, thin, step, idle: cutter, thinnest material that counts, step, and how far the pass
            runs on without material, all in nodes.
        bound: largest engaged arc, radians.   right, left: largest turns of one step, radians.
        longest: number of steps.
    Returns:
        (k, 2) positions, cut back to the last one in material; number of nodes cleared; largest engaged arc.
    """
    path = np.empty((longest + 1, 2))
    path[0, X], path[0, Y] = x, y
    count, last, fresh, without, most = 1, 1, 0, 0.0, 0.0
    while count <= longest and without < idle:
        heading = _next_heading(material, permitted, x, y, heading, radius, thin, bound, step, right, left)
        if math.isnan(heading):
            break
        nx, ny = x + step * fixed.cos(heading), y + step * fixed.sin(heading)
        engaged = engaged_rad(material, nx, ny, heading, radius, CHIP_SHARE * thin)
        x, y = nx, ny
        path[count, X], path[count, Y] = x, y
        count += 1
        if engaged > 0.0:
            for k in range(last, count):        # steps that run out into the air are not made, and clear nothing
                fresh += clear_stroke(material, path[k - 1, X], path[k - 1, Y], path[k, X], path[k, Y], radius, thin)
            most, without, last = max(most, engaged), 0.0, count
        else:
            without += step
    return path[:last].copy(), fresh, most

