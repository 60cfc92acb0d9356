"""Lines through a closed mesh, and the highest that it stands within a radius: compiled.

Boxes stand in a complete binary tree over the triangles; node k has the children 2 k + 1 and 2 k + 2, leaf j holds the
triangles j LEAF to j LEAF + LEAF - 1.  A line that meets a side or a corner of triangles counts as one that runs a hair
beside it, the same hair for all of them: it passes in and out as often, through a closed mesh.
Source: S. Woop, C. Benthin, I. Wald, Watertight Ray/Triangle Intersection, JCGT 2 (2013) 65: the sheared sides; the hair
is this project's.
"""

import math

import numpy as np

from cuspline.values.compiled import njit
from cuspline.values.rows import FROM, TO, A, B, C, X, Y, Z
from cuspline.values.threads import in_blocks

LEAF = 4
DEPTH = 64                # more open nodes than any tree leaves
ROOT = 0                  # of a tree; it waits first
CHUNK = 64                # lines or places answered by one thread, one after the other
SHORTEST_MM = 1e-9        # material along less of a line than this is none
LOW, HIGH = 0, 3          # first column of a box's lower corner, and of its upper one
SLOPE_X, SLOPE_Y, RISE, STEEPNESS, TOP = range(5)       # of a facet that looks up: z = rise + x slope_x + y slope_y


@njit
def tree_of(corners, leaves):
    """(2 leaves - 1, 6) boxes over triangles (n, 3, 3), low and high corner."""
    tree = np.empty((2 * leaves - 1, 6))
    tree[:, LOW:HIGH], tree[:, HIGH:] = math.inf, -math.inf
    for i in range(len(corners)):
        node = tree[leaves - 1 + i // LEAF]
        for j in range(3):
            for k in range(3):
                node[LOW + k] = min(node[LOW + k], corners[i, j, k])
                node[HIGH + k] = max(node[HIGH + k], corners[i, j, k])
    for n in range(leaves - 2, -1, -1):
        for k in range(3):
            tree[n, LOW + k] = min(tree[2 * n + 1, LOW + k], tree[2 * n + 2, LOW + k])
            tree[n, HIGH + k] = max(tree[2 * n + 1, HIGH + k], tree[2 * n + 2, HIGH + k])
    return tree


@njit(error_model="numpy")
def _passes(p, d, node):
    """Whether a line may meet a box: the box is taken a little larger than it is; behind the last triangle boxes are empty."""
    if node[LOW] > node[HIGH]:
        return False
    enter, leave = -math.inf, math.inf
    for k in range(3):
        spare = SHORTEST_MM + 1e-12 * (abs(node[LOW + k]) + abs(node[HIGH + k]) + abs(p[k]))
        low, high = node[LOW + k] - spare - p[k], node[HIGH + k] + spare - p[k]
        if d[k] == 0.0:
            if low > 0.0 or high < 0.0:
                return False
            continue
        a, b = low / d[k], high / d[k]
        enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    return enter <= leave


@njit(inline="always")
def _side(bx, by, cx, cy):
    """Sign of the place of the line beside a triangle's side, and twice the area between; no line is on it."""
    area = cx * by - cy * bx
    if area != 0.0:
        return math.copysign(1.0, area), area
    if cy != by:
        return math.copysign(1.0, cy - by), 0.0
    return math.copysign(1.0, bx - cx), 0.0


@njit(error_model="numpy")
def _met(p, d, axes, t):
    """(where along a line it passes a triangle, +1 into the material, -1 out of it, 0: it does not)."""
    kx, ky, kz = axes
    shear_x, shear_y = d[kx] / d[kz], d[ky] / d[kz]
    az, bz, cz = t[A, kz] - p[kz], t[B, kz] - p[kz], t[C, kz] - p[kz]
    ax, ay = t[A, kx] - p[kx] - shear_x * az, t[A, ky] - p[ky] - shear_y * az
    bx, by = t[B, kx] - p[kx] - shear_x * bz, t[B, ky] - p[ky] - shear_y * bz
    cx, cy = t[C, kx] - p[kx] - shear_x * cz, t[C, ky] - p[ky] - shear_y * cz
    side, u = _side(bx, by, cx, cy)
    other, v = _side(cx, cy, ax, ay)
    if other != side:
        return 0.0, 0.0
    other, w = _side(ax, ay, bx, by)
    area = u + v + w
    if other != side or area == 0.0:
        return 0.0, 0.0
    return (u * az + v * bz + w * cz) / (area * d[kz]), side


@njit
def _axes(d):
    """Axes of the shear: the line's longest last, all three right-handed as seen along the line."""
    kz = 0
    for k in range(1, 3):
        if abs(d[k]) > abs(d[kz]):
            kz = k
    kx, ky = (kz + 1) % 3, (kz + 2) % 3
    return (ky, kx, kz) if d[kz] < 0.0 else (kx, ky, kz)


@njit
def _put(at, sign, count, places, signs):
    """Puts a crossing where it belongs along the line, those into the material first; how many there are then."""
    if count < len(places):
        k = count
        while k > 0 and (places[k - 1] > at or (places[k - 1] == at and signs[k - 1] < sign)):
            places[k], signs[k] = places[k - 1], signs[k - 1]
            k -= 1
        places[k], signs[k] = at, sign
    return count + 1


@njit
def _spans(places, signs, count, out):
    """Writes the stretches of material between crossings; how many."""
    found, inside, begin = 0, 0, 0.0
    for k in range(count):
        was, inside = inside, inside + (1 if signs[k] > 0.0 else -1)
        if was == 0 and inside == 1:
            begin = places[k]
        elif was == 1 and inside == 0 and places[k] - begin > SHORTEST_MM:
            out[found, FROM], out[found, TO] = begin, places[k]
            found += 1
    return found


def lines_through(origins, directions, corners, tree, room):
    """Where lines run through the material of a closed mesh.

    Args:
        origins, directions: (n, 3), directions of length 1.
        corners: (m, 3, 3) triangles in the order of the tree, counter-clockwise seen from outside.
        room: crossings that there is room for on a line.
    Returns:
        (n, room // 2, 2) begin and end of each stretch along the line, growing, inf behind the last one; crossings (n,)
        of each line: where they are more than the room the stretches are not to be used.
    """
    n = len(origins)
    out, crossings = np.full((n, room // 2, 2), np.inf), np.zeros(n, np.int64)
    in_blocks(_lines_through, n, CHUNK, origins, directions, corners, tree, room, out, crossings)
    return out, crossings


@njit
def _lines_through(origins, directions, corners, tree, room, out, crossings, begin, end):
    """Lines begin..end-1."""
    leaves = (len(tree) + 1) // 2
    stack, places, signs = np.empty(DEPTH, np.int64), np.empty(room), np.empty(room)
    for i in range(begin, end):
        p, d, axes = origins[i], directions[i], _axes(directions[i])
        count, waiting, stack[0] = 0, 1, 0
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            if not _passes(p, d, tree[node]):
                continue
            if node < leaves - 1:
                stack[waiting], stack[waiting + 1] = 2 * node + 1, 2 * node + 2
                waiting += 2
                continue
            first = (node - leaves + 1) * LEAF
            for t in range(first, min(first + LEAF, len(corners))):
                at, sign = _met(p, d, axes, corners[t])
                if sign != 0.0:
                    count = _put(at, sign, count, places, signs)
        crossings[i] = count
        _spans(places, signs, min(count, room), out[i])


@njit
def facets_of(corners):
    """(m, 5) planes of triangles: slopes, rise, steepness, highest corner; NaN where one does not look up."""
    out = np.full((len(corners), 5), np.nan)
    for i in range(len(corners)):
        a, b, c = corners[i]
        e, f, g = b[X] - a[X], b[Y] - a[Y], b[Z] - a[Z]
        h, k, m = c[X] - a[X], c[Y] - a[Y], c[Z] - a[Z]
        up = e * k - f * h
        if up > 0.0:
            sx, sy = (g * k - f * m) / up, (e * m - g * h) / up
            out[i, SLOPE_X], out[i, SLOPE_Y], out[i, RISE] = sx, sy, a[Z] - sx * a[X] - sy * a[Y]
            out[i, STEEPNESS], out[i, TOP] = math.sqrt(sx * sx + sy * sy), max(a[Z], b[Z], c[Z])
    return out


@njit
def _beside_side(x, y, a, b):
    """Square of the distance of (x, y) from a triangle's side in plan; whether it lies to the left of it."""
    dx, dy = b[X] - a[X], b[Y] - a[Y]
    square = dx * dx + dy * dy
    share = min(max(((x - a[X]) * dx + (y - a[Y]) * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
    ex, ey = x - a[X] - share * dx, y - a[Y] - share * dy
    return ex * ex + ey * ey, dx * (y - a[Y]) - dy * (x - a[X]) >= 0.0


@njit
def _beside(x, y, t):
    """Square of the distance of (x, y) from a triangle that looks up, in plan."""
    d0, left0 = _beside_side(x, y, t[A], t[B])
    d1, left1 = _beside_side(x, y, t[B], t[C])
    d2, left2 = _beside_side(x, y, t[C], t[A])
    return 0.0 if left0 and left1 and left2 else min(d0, d1, d2)


def tops_over(xy, corners, tree):
    """Height of the highest place of a closed mesh over (x, y), by lines from above.

    Args:
        xy: (n, 2).   corners: (m, 3, 3) in the order of the tree, counter-clockwise seen from outside.
    Returns:
        (n,), -inf where it has none; (n,) bool: under it the line leaves the material at once, at an edge: ask all of the line.
    """
    out, at_edge = np.full(len(xy), -np.inf), np.zeros(len(xy), np.bool_)
    in_blocks(_tops_over, len(xy), CHUNK, xy, corners, tree, out, at_edge)
    return out, at_edge


@njit
def _tops_over(xy, corners, tree, out, at_edge, begin, end):
    """Places begin..end-1; the higher of two boxes first, and what lies deeper than the best is not looked at."""
    stack, leaves = np.empty(DEPTH, np.int64), (len(tree) + 1) // 2
    p, up = np.zeros(3), np.array([0.0, 0.0, 1.0])
    for i in range(begin, end):
        p[X], p[Y], leave, enter = xy[i, X], xy[i, Y], -math.inf, -math.inf
        waiting, stack[ROOT] = 1, ROOT
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            box = tree[node]
            if (box[LOW] > p[X] or box[LOW + 1] > p[Y] or box[HIGH] < p[X] or box[HIGH + 1] < p[Y]
                    or box[HIGH + 2] < leave - SHORTEST_MM):
                continue
            if node < leaves - 1:
                left = 2 * node + 1
                higher = left if tree[left, HIGH + 2] >= tree[left + 1, HIGH + 2] else left + 1
                stack[waiting], stack[waiting + 1] = 2 * left + 1 - higher, higher
                waiting += 2
                continue
            first = (node - leaves + 1) * LEAF
            for t in range(first, min(first + LEAF, len(corners))):
                at, sign = _met(p, up, (X, Y, Z), corners[t])
                if sign < 0.0:
                    leave = max(leave, at)
                elif sign > 0.0:
                    enter = max(enter, at)
        out[i], at_edge[i] = leave, enter >= leave - SHORTEST_MM and enter > -math.inf


def tops_within(xy, radius, corners, facets, tree):
    """(n,) height that no place of a closed mesh within a radius of (x, y) exceeds; -inf where it has none there.

    Args:
        xy: (n, 2).   corners: (m, 3, 3) in the order of the tree.   facets: see `facets_of`.
    """
    out = np.full(len(xy), -np.inf)
    in_blocks(_tops_within, len(xy), CHUNK, xy, radius, corners, facets, tree, out)
    return out


@njit
def _tops_within(xy, radius, corners, facets, tree, out, begin, end):
    """Places begin..end-1."""
    stack, leaves = np.empty(DEPTH, np.int64), (len(tree) + 1) // 2
    for i in range(begin, end):
        x, y, best = xy[i, X], xy[i, Y], -math.inf
        waiting, stack[0] = 1, 0
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            box = tree[node]
            ex, ey = max(box[LOW] - x, x - box[HIGH], 0.0), max(box[LOW + 1] - y, y - box[HIGH + 1], 0.0)
            if ex * ex + ey * ey > radius * radius or box[HIGH + 2] <= best:
                continue
            if node < leaves - 1:
                stack[waiting], stack[waiting + 1] = 2 * node + 1, 2 * node + 2
                waiting += 2
                continue
            first = (node - leaves + 1) * LEAF
            for t in range(first, min(first + LEAF, len(corners))):
                f = facets[t]
                if f[TOP] > best and _beside(x, y, corners[t]) <= radius * radius:
                    plane = f[RISE] + f[SLOPE_X] * x + f[SLOPE_Y] * y + f[STEEPNESS] * radius
                    best = max(best, min(f[TOP], plane + SHORTEST_MM))
        out[i] = best
