"""Signed deviation of the stock along design normals: rays traced in the swept volume's distance field.

Remaining stock = box minus swept volume.  The distance is 1-Lipschitz, so a step as long as
the distance never jumps over the surface.  The box is convex: its two crossings are closed form.
"""

import math

import numpy as np

from cuspline.stock.distance_kernels import child_distances, piece_distance
from cuspline.stock.path_pieces import FORM, LEVEL_ARC, LINE, SIDE
from cuspline.stock.tree import (
    CHUNK,
    CORNER_RADIUS,
    DEPTH,
    FIRST_PIECE,
    FLAT_RADIUS,
    PIECES,
    SLACK_MM,
    block_of,
    nearest_piece,
    open_root,
    piece_of,
    push_children,
    tree_of,
    work,
)
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z
from cuspline.values.threads import in_blocks

CLOSE_MM = 1e-8           # where tracing stops short of the surface
SETTLED_MM = 1e-10        # how well a surface is met
PATIENT_STEPS = 48        # after these a ray is grazing, and steps at least GRAZING of its length
GRAZING = 0.01
MORE_PATIENT_STEPS = 4 * PATIENT_STEPS      # the same along arcs that a ray may meet from their hollow side
AHEAD_MM = 1e-5           # over which these are straight


@njit
def box_crossings(p, n, low, high):
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


@njit
def _is_convex(g):
    """Whether a convex cutter sweeps a convex volume along a piece: a line, or an arc that hangs down."""
    return g[FORM] == LINE or g[FORM] != LEVEL_ARC and g[SIDE] < 0.0


@njit(error_model="numpy")
def _entry(p, n, d, limit, g, a, rc):
    """Where a ray enters what one piece sweeps, from a point at distance d > 0 outside it; `limit` if not before.

    In a convex volume the distance is convex along the ray: its secant through two places before the entry meets zero no
    later than it does, and never steps over.
    """
    if not _is_convex(g):
        return _entry_by_steps(p, n, d, limit, g, a, rc)
    before, f_before, t = 0.0, d, d
    for _ in range(60):
        if t >= limit:
            return limit
        f = piece_distance(p[X] + t * n[X], p[Y] + t * n[Y], p[Z] + t * n[Z], g, a, rc)
        if f <= SETTLED_MM:
            return t
        fall = (f_before - f) / (t - before)
        if not fall > 0.0:
            return limit
        before, f_before, step = t, f, f / min(fall, 1.0)
        if step <= SETTLED_MM:
            return t
        t += step
    return min(t, limit)


@njit
def _entry_by_steps(p, n, d, limit, g, a, rc):
    """As `_entry`, past the back of an arc or the inner side of a level one: by steps as long as the distance."""
    before, way, t = d, d, d
    for step in range(2 * MORE_PATIENT_STEPS):
        if t >= limit:
            return limit
        f = piece_distance(p[X] + t * n[X], p[Y] + t * n[Y], p[Z] + t * n[Z], g, a, rc)
        if f <= SETTLED_MM:
            return t
        if f * way <= AHEAD_MM * (before - f):
            return min(t + f * way / (before - f), limit)
        before, way = f, f if step < MORE_PATIENT_STEPS else max(f, GRAZING * t + 1e-6)
        t += way
    return limit


@njit
def first_entry(p, n, limit, forest, hint, stack, bounds):
    """First place along a ray, no farther than `limit`, where it enters anything swept, and the piece entered.

    The distance of a piece, or of a node's pieces, bounds how soon the ray can meet it.

    Returns:
        (t, piece); (-1, piece) as soon as a piece is found that the point itself lies in or on; (limit, -1): none.
    """
    geometry, blocks, trees, tools = forest
    best, found = limit, -1
    for pick in range(2):                    # first the hint alone, then all trees
        for k in range(len(trees)):
            tree = trees[k]
            a, rc, first, count = tools[k, FLAT_RADIUS], tools[k, CORNER_RADIUS], tree[FIRST_PIECE], tree[PIECES]
            top, t = 0, -1
            if pick == 0:
                if not first <= hint < first + count:
                    continue
                t = hint
            elif count > 0:
                top = open_root(stack, bounds)
            while True:
                if t >= 0:
                    d = piece_distance(p[X], p[Y], p[Z], geometry[t], a, rc)
                    if d <= CLOSE_MM:
                        return -1.0, t
                    if d < best:
                        there = _entry(p, n, d, best, geometry[t], a, rc)
                        if there < best:
                            best, found = there, t
                t = -1
                if top == 0:
                    break
                top -= 1
                if bounds[top] - SLACK_MM >= best:
                    continue
                code = stack[top]
                t = piece_of(code, tree)
                if t >= 0:
                    continue
                child_distances(p[X], p[Y], p[Z], blocks[block_of(code, tree)], a, rc, bounds[DEPTH:])
                top = push_children(code, best + SLACK_MM, top, stack, bounds)
    return best, found


@njit
def _exit(p, n, start, limit, forest, piece, stack, bounds):
    """Depth along -n from `start` to where stock begins, and the piece that reaches deepest at the start."""
    geometry, _, trees, tools = forest
    t, deepest = start, -1
    while t < limit:
        d, piece = nearest_piece(p[X] - t * n[X], p[Y] - t * n[Y], p[Z] - t * n[Z], forest, piece, stack, bounds,
                                 -CLOSE_MM)
        if piece < 0:
            break
        deepest = piece if deepest < 0 else deepest
        k = tree_of(piece, trees)
        t = max(_leave(p, n, t, d, limit, geometry[piece], tools[k, FLAT_RADIUS], tools[k, CORNER_RADIUS]), t + CLOSE_MM)
    return min(t, limit), deepest


@njit
def _leave(p, n, t, d, limit, g, a, rc):
    """Where the ray back from depth t, at distance d < 0 within one piece, leaves it: bracketed, then halved and by secants."""
    if not _is_convex(g):
        return _leave_by_steps(p, n, t, d, limit, g, a, rc)
    lo, f_lo, step = t, d, -2.0 * d
    hi = f_hi = 0.0
    while True:
        hi = min(lo + step, limit)
        f_hi = piece_distance(p[X] - hi * n[X], p[Y] - hi * n[Y], p[Z] - hi * n[Z], g, a, rc)
        if f_hi >= 0.0:
            break
        if hi >= limit:
            return limit
        lo, f_lo, step = hi, f_hi, 2.0 * step
    for k in range(100):
        if hi - lo <= SETTLED_MM or f_hi <= SETTLED_MM:
            break
        share = 0.5 if k % 3 == 2 else min(max(f_lo / (f_lo - f_hi), 0.01), 0.99)
        middle = lo + share * (hi - lo)
        f = piece_distance(p[X] - middle * n[X], p[Y] - middle * n[Y], p[Z] - middle * n[Z], g, a, rc)
        if f >= 0.0:
            hi, f_hi = middle, f
        else:
            lo, f_lo = middle, f
    return hi


@njit
def _leave_by_steps(p, n, t, d, limit, g, a, rc):
    """As `_leave`, where the ray may leave more than once: by steps as long as it is deep."""
    start, step = t, 0
    while d < -SETTLED_MM and t < limit:
        before, way = d, -d if step < MORE_PATIENT_STEPS else max(-d, GRAZING * (t - start) + 1e-6)
        t += way
        d = piece_distance(p[X] - t * n[X], p[Y] - t * n[Y], p[Z] - t * n[Z], g, a, rc)
        if 0.0 < -d * way <= AHEAD_MM * (d - before):
            return min(t - d * way / (d - before), limit)
        step += 1
    return min(t, limit)


@njit
def _deviation(p, n, low, high, limit, forest, hint, stack, bounds):
    """Deviation of one point and the piece it belongs to: the one its ray meets first, or the deepest round the point."""
    enter, leave = box_crossings(p, n, low, high)
    is_outside = not (enter < 0.0 and leave > -CLOSE_MM)
    if not is_outside:
        t, piece = first_entry(p, n, min(max(leave, 0.0), limit), forest, hint, stack, bounds)
        if t >= 0.0:
            return t, piece
        hint = piece
    enter, leave = -leave, -enter            # along -normal
    start = max(enter, 0.0)
    if is_outside and start >= min(leave, limit):
        return -limit, hint
    t, piece = _exit(p, n, start, limit, forest, hint, stack, bounds)
    # where the ray leaves the billet before it meets stock, everything along it is gone, and no more
    return -min(t, max(leave, start)), piece if piece >= 0 else hint


def deviations(points, normals, low, high, limit, forest):
    """Deviation (n,) along normals (n, 3) at points (n, 3), and the piece nearest to each point (n,)."""
    out, piece = np.empty(len(points)), np.empty(len(points), np.int64)
    in_blocks(_deviations, len(points), CHUNK, points, normals, low, high, limit, forest, out, piece)
    return out, piece


@njit
def _deviations(points, normals, low, high, limit, forest, out, piece, first, last):
    (stack, bounds), hint = work(), -1
    for i in range(first, last):
        out[i], hint = _deviation(points[i], normals[i], low, high, limit, forest, hint, stack, bounds)
        piece[i] = hint
