"""A dense plane polyline as few long lines and arcs that lie within a tolerance of its points."""

import math

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y

STRAIGHT_RADII = 1e4        # flatter arcs (radius over tolerance) are lines
WIDEST_SWEEP_RAD = 2.8      # an arc stays below half a turn
LEAST_RADIUS_MM = 0.05
END_ROW, TURN, CENTER_X, CENTER_Y = range(4)    # columns of elements
FITS, FIT_X, FIT_Y, FIT_TURN = range(4)         # of what `_fits` says


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
    ux, uy = points[last, X] - ax, points[last, Y] - ay
    length = math.hypot(ux, uy)
    if length < 1e-12:
        return False
    before = 0.0
    for k in range(first + 1, last):
        dx, dy = points[k, X] - ax, points[k, Y] - ay
        along = (dx * ux + dy * uy) / length
        if abs(dx * uy - dy * ux) / length > tolerance or along < before - 1e-9 or along > length:
            return False
        before = along
    return True


@njit
def _arc_fits(points, first, last, tolerance):
    """(fits, centre x, centre y, turn: +1 left, -1 right)."""
    middle = (first + last) // 2
    cx, cy, radius = _circle(points[first, X], points[first, Y], points[middle, X], points[middle, Y],
                             points[last, X], points[last, Y])
    if not LEAST_RADIUS_MM < radius < STRAIGHT_RADII * tolerance:
        return False, 0.0, 0.0, 0
    ax, ay = points[first, X] - cx, points[first, Y] - cy
    mx, my = points[middle, X] - cx, points[middle, Y] - cy
    turn = 1 if ax * my - ay * mx > 0.0 else -1
    before = 0.0
    for k in range(first + 1, last + 1):
        dx, dy = points[k, X] - cx, points[k, Y] - cy
        if abs(math.hypot(dx, dy) - radius) > tolerance:
            return False, 0.0, 0.0, 0
        px, py = points[k - 1, X] - cx, points[k - 1, Y] - cy
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
            if not answer[FITS]:
                break
            good, best = first + step, answer
            step *= 2
        bad = min(first + step, len(points))
        while bad - good > 1:
            middle = (good + bad) // 2
            answer = _fits(points, first, middle, tolerance)
            if answer[FITS]:
                good, best = middle, answer
            else:
                bad = middle
        out[count, END_ROW], out[count, TURN], out[count, CENTER_X], out[count,
                                                                         CENTER_Y] = (good, best[FIT_TURN], best[FIT_X],
                                                                                      best[FIT_Y])
        count += 1
        first = good
    return out[:count].copy()
