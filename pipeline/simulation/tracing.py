"""Signed deviation of the stock along design normals: rays traced in the swept volume's distance field.

Remaining stock = box minus swept volume.  The distance is 1-Lipschitz, so a step as long as
the distance never jumps over the surface.  The box is convex: its two crossings are closed form.
"""

import math

import numpy as np
from numba import njit, prange

from cuspline.simulation.tree import CHUNK, nearest_piece, work

CLOSE_MM = 1e-8           # where tracing stops short of the surface
PATIENT_STEPS = 48        # after these a ray is grazing, and steps at least GRAZING of its length
GRAZING = 0.01


@njit(cache=True)
def _box_crossings(p, n, low, high):
    """Parameters (enter, leave) of the line p + t n through the box; enter > leave: it misses."""
    enter, leave = -math.inf, math.inf
    for k in range(3):
        if abs(n[k]) < 1e-12:
            if p[k] < low[k] - CLOSE_MM or p[k] > high[k] + CLOSE_MM:
                return math.inf, -math.inf
            continue
        t0, t1 = (low[k] - p[k]) / n[k], (high[k] - p[k]) / n[k]
        enter, leave = max(enter, min(t0, t1)), min(leave, max(t0, t1))
    return enter, leave


@njit(cache=True)
def _trace(p, n, t0, t1, sign, forest, hint, stack, bounds):
    """First t in [t0, t1] where sign * distance to the swept volume is no longer positive; t1 if never."""
    t, before, step = t0, t0, 0
    while t < t1:
        d, hint = nearest_piece(p[0] + t * n[0], p[1] + t * n[1], p[2] + t * n[2], forest, hint, stack, bounds)
        d *= sign
        if d <= CLOSE_MM:
            break
        before = t
        step += 1
        t += d if step < PATIENT_STEPS else max(d, GRAZING * (t - t0) + 1e-6)
    t = min(t, t1)
    if step < PATIENT_STEPS or t >= t1:
        return t
    lo, hi = before, t                       # a grazing step may have gone in too deep
    while hi - lo > CLOSE_MM:
        mid = 0.5 * (lo + hi)
        d, hint = nearest_piece(p[0] + mid * n[0], p[1] + mid * n[1], p[2] + mid * n[2],
                                forest, hint, stack, bounds)
        if sign * d <= CLOSE_MM:
            hi = mid
        else:
            lo = mid
    return hi


@njit(cache=True)
def _deviation(p, n, low, high, limit, d, forest, hint, stack, bounds):
    """Deviation of one point whose distance d to the swept volume is known."""
    enter, leave = _box_crossings(p, n, low, high)
    is_outside = not (enter < 0.0 and leave > -CLOSE_MM)
    if d > CLOSE_MM and not is_outside:
        return _trace(p, n, 0.0, min(max(leave, 0.0), limit), 1.0, forest, hint, stack, bounds)
    if d >= -CLOSE_MM and not is_outside:
        return 0.0
    enter, leave = -leave, -enter            # along -normal
    start = max(enter, 0.0)
    if start >= min(leave, limit):
        return -limit
    back = np.array([-n[0], -n[1], -n[2]])
    t = _trace(p, back, start, limit, -1.0, forest, hint, stack, bounds)
    # where the ray leaves the billet before it meets stock, everything along it is gone, and no more
    return -min(t, max(leave, start))


@njit(cache=True, parallel=True)
def deviations(points, normals, low, high, limit, forest):
    """Deviation (n,) along normals (n, 3) at points (n, 3), and the piece nearest to each point (n,)."""
    n = len(points)
    out, piece = np.empty(n), np.empty(n, np.int64)
    for c in prange((n + CHUNK - 1) // CHUNK):
        (stack, bounds), hint = work(), -1
        for i in range(c * CHUNK, min(n, (c + 1) * CHUNK)):
            p = points[i]
            d, hint = nearest_piece(p[0], p[1], p[2], forest, hint, stack, bounds)
            piece[i] = hint
            out[i] = _deviation(p, normals[i], low, high, limit, d, forest, hint, stack, bounds)
    return out, piece
