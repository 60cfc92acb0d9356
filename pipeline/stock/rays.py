r"""Distances, deviations and intervals of stock in what upright and tilted cutters have swept together.

The world is the arrays of a forest of tree.py, then those of a forest of tilted_tree.py, in one tuple; sub-steps are
numbered behind the pieces.

Remaining stock = billet minus swept volume.  The distance to the swept volume is 1-Lipschitz, so from a place with
distance d the ray meets no surface for d, and back from a place with distance d' none for d':

    s ├──── d ────┤  gap  ├─ d' ─┤ s'      a step may be longer than d as long as the gap stays below GAP_MM

The step is chosen so that both just meet if the surface were a plane.  Outside, the distance to everything
swept is exact.  Inside it is only a bound (a point may lie deep in two pieces together), so a ray is
followed through one piece to where it leaves it, and from there through the next.
"""

import math

import numpy as np

from cuspline.stock import tree
from cuspline.stock.tilted_kernels import WAITING
from cuspline.stock.tilted_tree import holding_substep, nearest_substep, one_distance, one_slope, worth_keeping
from cuspline.stock.tracing import CLOSE_MM, GRAZING, PATIENT_STEPS, box_crossings
from cuspline.stock.tree import CHUNK, nearest_piece, one_piece_distance
from cuspline.values.compiled import njit
from cuspline.values.rows import FROM, TO, X, Y, Z
from cuspline.values.threads import in_blocks

UPRIGHT_ARRAYS = 4        # of the world's arrays
PIECES_OF_UPRIGHT = 0     # the first of them
STACK, BOUNDS, WAITING_ROWS, KEPT_ROWS, COVERED = range(5)     # of a thread's work space, see `scratch`
FIRST = 0                 # the one entry of what is covered
GAP_MM = 2e-5             # stock or air along less of a ray than this may be overlooked
SLOPE_MM = 1e-6           # over which the slope of the distance to an upright piece is taken along a ray
SLIDE = 0.1               # a ray that runs in the swept surface is followed in steps of this share of its way there
KEPT_MM = 0.005           # a point this near to the surface keeps the sub-steps round it for the rest of its ray
KEPT = 64                 # as many of them as there is room for


@njit(error_model="numpy")
def scratch():
    """Work space of one thread: stacks of nodes and of intervals, sub-steps kept and up to which distance."""
    stack, bounds = tree.work()
    return stack, bounds, np.empty((WAITING, 6)), np.zeros(KEPT + 1, np.int64), np.full(1, -1.0)


@njit(error_model="numpy")
def nearest(px, py, pz, world, hint, work):
    """Least signed distance of a point to anything swept, the piece or sub-step it belongs to (-1: none), and where."""
    return _nearest(px, py, pz, world, hint, -math.inf, work)


@njit(error_model="numpy")
def _nearest(px, py, pz, world, hint, keep, work):
    upright, posed = world[:UPRIGHT_ARRAYS], world[UPRIGHT_ARRAYS:]
    stack, bounds, waiting, kept, reach = work
    behind = len(upright[0])
    d, found, at = math.inf, -1, 0.5
    if behind:
        limit = math.inf
        if hint >= behind:                         # pieces farther than the hint are not looked for
            limit = one_distance(px, py, pz, hint - behind, posed, math.inf, waiting)[0]
            limit = max(limit, min(keep, worth_keeping(limit)))
        d, found = nearest_piece(px, py, pz, upright, hint if hint < behind else -1, stack, bounds, limit)
    reach[0] = -1.0
    if len(posed[0]):
        of_upright, best = d, d if found >= 0 else math.inf
        d, substep, t, left = nearest_substep(px, py, pz, posed, best, hint - behind if hint >= behind else -1, keep, kept,
                                              stack, bounds, waiting)
        if substep >= 0:
            found, at = behind + substep, t
        if of_upright > left:
            reach[0] = left
    return d, found, at


@njit(error_model="numpy")
def _nearest_kept(px, py, pz, s, world, hint, work):
    """As `nearest`, s away from where sub-steps were kept; -1: none is within the reach that is left, others may be."""
    posed, behind = world[UPRIGHT_ARRAYS:], len(world[PIECES_OF_UPRIGHT])
    _, _, waiting, kept, reach = work
    d, found, at = reach[0] - s, -1, 0.5
    for i in range(-1, kept[0]):                   # the hint first
        piece = hint - behind if i < 0 else kept[1 + i]
        if i >= 0 and piece == hint - behind:
            continue
        one, t = one_distance(px, py, pz, piece, posed, d, waiting)
        if one < d:
            d, found, at = one, behind + piece, t
    return d, found, at


@njit(error_model="numpy")
def _of_one(px, py, pz, piece, world, work):
    """Signed distance to one piece or sub-step alone, and where along it."""
    behind = len(world[PIECES_OF_UPRIGHT])
    if piece < behind:
        return one_piece_distance(px, py, pz, piece, world[:UPRIGHT_ARRAYS]), 0.5
    return one_distance(px, py, pz, piece - behind, world[UPRIGHT_ARRAYS:], math.inf, work[WAITING_ROWS])


@njit(error_model="numpy")
def _holding(p, n, s, limit, world, work):
    """A piece nearer than `limit` to p + s n, not always the nearest: its distance, which it is (-1: none), and where."""
    stack, bounds, waiting = work[STACK], work[BOUNDS], work[WAITING_ROWS]
    x, y, z, behind = p[X] + s * n[X], p[Y] + s * n[Y], p[Z] + s * n[Z], len(world[PIECES_OF_UPRIGHT])
    if len(world[UPRIGHT_ARRAYS]):
        d, found, at = holding_substep(x, y, z, world[UPRIGHT_ARRAYS:], limit, stack, bounds, waiting)
        if found >= 0:
            return d, behind + found, at
    d, found = limit, -1
    if behind:
        d, found = nearest_piece(x, y, z, world[:UPRIGHT_ARRAYS], -1, stack, bounds, limit)
    return d, found, 0.5


@njit(error_model="numpy")
def _at(p, n, s, is_all, piece, world, work):
    """Distance at p + s n to everything swept, the piece it belongs to and where; or to the given piece alone."""
    x, y, z = p[X] + s * n[X], p[Y] + s * n[Y], p[Z] + s * n[Z]
    if is_all and s < work[COVERED][FIRST] and piece >= len(world[PIECES_OF_UPRIGHT]):
        d, found, t = _nearest_kept(x, y, z, s, world, piece, work)
        if found >= 0:
            return d, found, t
    if is_all:
        return nearest(x, y, z, world, piece, work)
    d, t = _of_one(x, y, z, piece, world, work)
    return d, piece, t


@njit(error_model="numpy")
def _fall(p, n, s, g, sign, piece, at, world, work):
    """How fast sign * distance to a piece falls along the ray at s, where it is g."""
    behind = len(world[PIECES_OF_UPRIGHT])
    if piece >= behind:
        x, y, z = p[X] + s * n[X], p[Y] + s * n[Y], p[Z] + s * n[Z]
        slope = one_slope(x, y, z, n, piece - behind, at, world[UPRIGHT_ARRAYS:])
    else:
        s += SLOPE_MM
        ahead, _ = _of_one(p[X] + s * n[X], p[Y] + s * n[Y], p[Z] + s * n[Z], piece, world, work)
        slope = (ahead - sign * g) / SLOPE_MM
    return min(max(-sign * slope, 0.0), 1.0)


@njit(error_model="numpy")
def _back(p, n, lo, hi, d, piece, at, sign, is_all, world, work):
    """March has gone over the surface from lo to hi, where the distance is d: back to where it met it."""
    while hi - lo > CLOSE_MM:
        middle = 0.5 * (lo + hi)
        d1, found, t1 = _at(p, n, middle, is_all, piece, world, work)
        if sign * d1 > CLOSE_MM:
            lo = middle
        else:
            hi, d, piece, at = middle, d1, found, t1
    return hi, d, piece, at


@njit(error_model="numpy")
def march(p, n, s, end, d, piece, at, sign, is_all, world, work):
    """First s where sign * distance, now sign * d > 0, is no longer positive; the distance, the piece and where, there.

    `end` if that never happens before; is_all: the distance to everything swept, else to the one piece.
    """
    if piece < 0:                            # nothing moves
        return end, d, piece, at
    start, before, g, step = s, s, sign * d, 0
    while g > CLOSE_MM and s < end:
        fall = _fall(p, n, s, g, sign, piece, at, world, work)
        ahead = 2.0 * g / (1.0 + fall)
        if fall > 0.0 and g / fall - g <= 0.5 * GAP_MM:
            ahead = g / fall
        step += 1
        if step > PATIENT_STEPS:
            ahead = max(ahead, GRAZING * (s - start) + 1e-6)
        nxt = min(s + ahead, end)
        d1, found, t1 = _at(p, n, nxt, is_all, piece, world, work)
        if step <= PATIENT_STEPS and nxt - max(sign * d1, 0.0) > s + g + GAP_MM:
            nxt = min(s + g, end)
            d1, found, t1 = _at(p, n, nxt, is_all, piece, world, work)
        before, s, d, g, piece, at = s, nxt, d1, sign * d1, found, t1
    if g < -CLOSE_MM or step > PATIENT_STEPS and g <= CLOSE_MM:
        return _back(p, n, before, s, d, piece, at, sign, is_all, world, work)
    return s, d, piece, at


@njit(error_model="numpy")
def leave(p, n, s, end, d, piece, at, world, work):
    """From inside the swept volume: where along the ray stock begins, at most `end`; the piece that ends there."""
    start, step = s, 0
    while d < -CLOSE_MM and s < end:
        nxt, _, _, _ = march(p, n, s, end, d, piece, at, -1.0, False, world, work)
        step += 1
        least = CLOSE_MM if step < PATIENT_STEPS else GRAZING * (s - start) + 1e-6
        s = max(nxt, s + least)
        if s >= end:
            break
        before = piece
        d, piece, at = _holding(p, n, s, -CLOSE_MM, world, work)
        if piece < 0:
            return s, before
    return min(s, end), piece


@njit(error_model="numpy")
def _nearest_and_keep(p, world, hint, work):
    """As `nearest`; near the surface, what else is near is kept for the ray from here."""
    return _nearest(p[X], p[Y], p[Z], world, hint, KEPT_MM, work)


@njit(error_model="numpy")
def _deviation(p, n, low, high, limit, d, piece, at, world, work):
    """Deviation of one point whose distance d to the swept volume is known."""
    enter, out = box_crossings(p, n, low, high)
    is_outside = not (enter < 0.0 and out > -CLOSE_MM)
    if d > CLOSE_MM and not is_outside:
        return march(p, n, 0.0, min(max(out, 0.0), limit), d, piece, at, 1.0, True, world, work)[0]
    if d >= -CLOSE_MM and not is_outside:
        return 0.0
    enter, out = -out, -enter                # along -normal
    start = max(enter, 0.0)
    if start >= min(out, limit):
        return -limit
    back = np.array([-n[X], -n[Y], -n[Z]])
    if start > 0.0:
        d, piece, at = _at(p, back, start, True, piece, world, work)
    s = leave(p, back, start, limit, d, piece, at, world, work)[0] if d < -CLOSE_MM else start
    # where the ray leaves the billet before it meets stock, everything along it is gone, and no more
    return -min(s, max(out, start))


def distances(points, world):
    """Signed distance (n,) and piece (n,) of points (n, 3)."""
    out, piece = np.empty(len(points)), np.empty(len(points), np.int64)
    in_blocks(_distances, len(points), CHUNK, points, world, out, piece)
    return out, piece


@njit(error_model="numpy")
def _distances(points, world, out, piece, first, last):
    work, hint = scratch(), -1
    for i in range(first, last):
        out[i], hint, _ = nearest(points[i, X], points[i, Y], points[i, Z], world, hint, work)
        piece[i] = hint


def deviations(points, normals, low, high, limit, world):
    """Deviation (n,) along normals (n, 3) at points (n, 3), and the piece nearest to each point (n,)."""
    out, piece = np.empty(len(points)), np.empty(len(points), np.int64)
    in_blocks(_deviations, len(points), CHUNK, points, normals, low, high, limit, world, out, piece)
    return out, piece


@njit(error_model="numpy")
def _deviations(points, normals, low, high, limit, world, out, piece, first, last):
    work, hint = scratch(), -1
    for i in range(first, last):
        p = points[i]
        d, hint, at = _nearest_and_keep(p, world, hint, work)
        piece[i] = hint
        out[i] = _deviation(p, normals[i], low, high, limit, d, hint, at, world, work)


def highest_stock(xy, top, bottom, world):
    """Highest remaining stock (n,) over xy (n, 2) between top and bottom, and the piece that ends there (-1: uncut)."""
    out, piece = np.empty(len(xy)), np.empty(len(xy), np.int64)
    in_blocks(_highest_stock, len(xy), CHUNK, xy, top, bottom, world, out, piece)
    return out, piece


@njit(error_model="numpy")
def _highest_stock(xy, top, bottom, world, out, piece, first, last):
    down = np.array([0.0, 0.0, -1.0])
    work = scratch()
    for i in range(first, last):
        p, s = np.array([xy[i, X], xy[i, Y], top]), 0.0
        out[i], piece[i] = top, -1
        d, found, at = _holding(p, down, s, CLOSE_MM, world, work)
        if found >= 0 and d >= -CLOSE_MM:          # flutes that end in the billet's top
            s = GAP_MM
            d, found, at = _holding(p, down, s, -CLOSE_MM, world, work)
        if found >= 0:
            s, piece[i] = leave(p, down, s, top - bottom, d, found, at, world, work)
            out[i] = top - s


@njit(error_model="numpy")
def _off_the_surface(p, n, on, off, hint, world, work):
    """Where the ray lifts off the swept surface between a place on it and one in the stock."""
    while off - on > GAP_MM:
        middle = 0.5 * (on + off)
        d, hint, _ = _at(p, n, middle, True, hint, world, work)
        if d > CLOSE_MM:
            off = middle
        else:
            on = middle
    return on


@njit(error_model="numpy")
def _stock_on_ray(p, n, s, end, out, hint, world, work):
    """Writes intervals of stock on the ray from s to end as far as there is room; how many, and the last piece met."""
    count, touched, last = 0, s, s
    while s < end:
        d, hint, at = _at(p, n, s, True, hint, world, work)
        if d < -CLOSE_MM:
            s, hint = leave(p, n, s, end, d, hint, at, world, work)
            touched = last = s
        elif d > CLOSE_MM:
            begin = _off_the_surface(p, n, last, s, hint, world, work)
            s, d, hint, _ = march(p, n, s, end, d, hint, at, 1.0, True, world, work)
            if s - begin > GAP_MM:
                if count < len(out):
                    out[count, FROM], out[count, TO] = begin, s
                count += 1
            touched = last = s
        else:
            last = s
            s += 0.5 * GAP_MM + SLIDE * (s - touched)
    return count, hint


def stock_along(origins, directions, low, high, room, world):
    """Intervals of remaining stock along lines: (n, room, 2), and how many there are (n,), the last ones cut off."""
    out, count = np.empty((len(origins), room, 2)), np.zeros(len(origins), np.int64)
    in_blocks(_stock_along, len(origins), CHUNK, origins, directions, low, high, world, out, count)
    return out, count


@njit(error_model="numpy")
def _stock_along(origins, directions, low, high, world, out, count, first, last):
    work, hint = scratch(), -1
    for i in range(first, last):
        enter, end = box_crossings(origins[i], directions[i], low, high)
        if enter < end:
            count[i], hint = _stock_on_ray(origins[i], directions[i], enter, end, out[i], hint, world, work)


def crossings(start, way, length, ends_mm, value, met_mm, world):
    """Where on straight ways the distance to everything swept falls to a value: (n,) mm from their starts.

    Args:
        start: (n, 3).   way: (n, 3) unit.   length: (n,) mm.   value: mm.   met_mm: how close to it the distance must come.
        ends_mm: two of (n,), distances at both ends less the value: above 0, and not.
    """
    out = np.empty(len(start))
    in_blocks(_crossings, len(start), CHUNK, start, way, length, *ends_mm, value, met_mm, world, out)
    return out


@njit(error_model="numpy")
def _crossings(start, way, length, first_mm, last_mm, value, met_mm, world, out, first, last):
    work, hint = scratch(), -1
    for i in range(first, last):
        p, n = start[i], way[i]
        low, high, above, below = 0.0, length[i], first_mm[i], last_mm[i]
        s = high * above / (above - below)
        for _ in range(PATIENT_STEPS):
            d, hint, at = nearest(p[X] + s * n[X], p[Y] + s * n[Y], p[Z] + s * n[Z], world, hint, work)
            if abs(d - value) <= met_mm or high - low <= met_mm:
                break
            if d > value:
                low, above = s, d - value
            else:
                high, below = s, d - value
            fall = _fall(p, n, s, d, 1.0, hint, at, world, work)
            s += (d - value) / fall if fall > 0.0 else 0.0
            if not low < s < high:
                s = 0.5 * (low + high)
        out[i] = s
