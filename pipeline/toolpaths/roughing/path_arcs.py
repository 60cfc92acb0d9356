"""A dense plane polyline as few long lines and arcs that lie within a tolerance of its points."""

import math

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit

STRAIGHT_RADII = 1e4        # flatter arcs (radius over tolerance) are lines
WIDEST_SWEEP_RAD = 2.8      # an arc stays below half a turn
LEAST_RADIUS_MM = 0.05


@njit
def _circle(ax, ay, bx, by, cx, cy):
    """Centre and radius through three points; radius inf where they are in line."""
    ux, uy, vx, vy = bx - ax, by - ay, cx - ax, cy - ay
    cross = 2.0 * (ux * vy - uy * vx)
    if abs(cross) < 1e-12:
        return 0.0, 0.0, math.inf
    uu, vv = ux * ux + uy * uy, vx * vx + vy * vy
    px, py = (vy * uu - uy * vv) / cross, (ux * vv - vx * uu) / cross
    return ax + px, ay + py, math.hypot(px, py)


@njit
def _line_fits(points, first, last, tolerance):
    ax, ay = points[first]
    ux, uy = points[last, 0] - ax, points[last, 1] - ay
    length = math.hypot(ux, uy)
    if length < 1e-12:
        return False
    before = 0.0
    for k in range(first + 1, last):
        dx, dy = points[k, 0] - ax, points[k, 1] - ay
        along = (dx * ux + dy * uy) / length
        if abs(dx * uy - dy * ux) / length > tolerance or along < before - 1e-9 or along > length:
            return False
        before = along
    return True


@njit
def _arc_fits(points, first, last, tolerance):
    """(fits, centre x, centre y, turn: +1 left, -1 right)."""
    middle = (first + last) // 2
    cx, cy, radius = _circle(points[first, 0], points[first, 1], points[middle, 0], points[middle, 1],
                             points[last, 0], points[last, 1])
    if not LEAST_RADIUS_MM < radius < STRAIGHT_RADII * tolerance:
        return False, 0.0, 0.0, 0
    ax, ay = points[first, 0] - cx, points[first, 1] - cy
    mx, my = points[middle, 0] - cx, points[middle, 1] - cy
    turn = 1 if ax * my - ay * mx > 0.0 else -1
    before = 0.0
    for k in range(first + 1, last + 1):
        dx, dy = points[k, 0] - cx, points[k, 1] - cy
        if abs(math.hypot(dx, dy) - radius) > tolerance:
            return False, 0.0, 0.0, 0
        px, py = points[k - 1, 0] - cx, points[k - 1, 1] - cy
        step = turn * fixed.arctan2(px * dy - py * dx, px * dx + py * dy)
        before += step
        if step < 0.0 or before > WIDEST_SWEEP_RAD:
            return False, 0.0, 0.0, 0
    return True, cx, cy, turn


@njit
def _fits(points, first, last, tolerance):
    if last == first + 1 or _line_fits(points, first, last, tolerance):
        return True, 0.0, 0.0, 0
    return _arc_fits(points, first, last, tolerance)


@njit
def lines_and_arcs(points, tolerance):
    """Elements one after the other, each as long as it can be.

    Args:
        points: (n, 2) polyline, n >= 2.
        tolerance: largest distance of any point from its element, mm.
    Returns:
        (k, 4) row of the end point, turn (0 line, +1 left arc, -1 right arc), arc centre x, y.
    """
    out, count, first = np.empty((len(points), 4)), 0, 0
    while first < len(points) - 1:
        good, step = first + 1, 2
        best = (True, 0.0, 0.0, 0)
        while first + step < len(points):
            answer = _fits(points, first, first + step, tolerance)
            if not answer[0]:
                break
            good, best = first + step, answer
            step *= 2
        bad = min(first + step, len(points))
        while bad - good > 1:
            middle = (good + bad) // 2
            answer = _fits(points, first, middle, tolerance)
            if answer[0]:
                good, best = middle, answer
            else:
                bad = middle
        out[count, 0], out[count, 1], out[count, 2], out[count, 3] = good, best[3], best[1], best[2]
        count += 1
        first = good
    return out[:count].copy()
