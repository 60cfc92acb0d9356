"""Tree over the sub-patches of faces and the pieces of edges: a box and an upper plane z <= a x + b y + c per node.

Leaves are boxes of one patch (see `patch_bounds`); planes come from control hulls, so they hold for the whole
sub-patch.  Sub-patches whose normal is nowhere upward cannot be touched from above and are left out, as are
those outside the trim.
"""

import math

import numpy as np

from cuspline.surfaces.patches import derive, scale_derivatives
from cuspline.toolpaths.drop.patch_bounds import (
    EDGE,
    FACE,
    HULL_MM,
    MOST_HALVINGS,
    OUTSIDE,
    PLANAR_MM,
    SMALLEST_MM,
    TURN_RAD,
    UPWARD,
    bernstein,
    cone_box,
    derivative_reaches,
    normal_change,
    part_state,
)
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import put

STEEPEST = 5.0              # slope up to which a node's plane follows the surface
LEAF_COLUMNS = 24           # middle and half sizes (4), reaches (9), change of the normal, normals (8), top nz, dz
CURVED, LEVEL, TILTED = 0, 1, 2


@njit(error_model="numpy")
def leaf_row(coefficients, patch, span, sign, face, box, kind, trims, mu, mv, row, tag, hull):
    """Describe one box of a patch.

    Args:
        box: (4,) middle s, half s, middle t, half t.
        row: (24,) and tag (4,) are filled: patch, FACE or EDGE, trim state, CURVED, LEVEL or TILTED plane.
        hull: (du + 1, dv + 1, 3) control points, filled.
    Returns:
        -1: leave it out; 0: it is a leaf; 1, 2: halve it in s, in t first.
    """
    du, dv, rational = patch[2], patch[3], patch[4] != 0
    state = 1
    if kind == FACE:
        state = part_state(trims, face, span, box[0], box[1], box[2], box[3])
        if state == OUTSIDE:
            return -1
    b = np.empty((du + 1, dv + 1, 4))
    bernstein(coefficients, patch[1], du, dv, box[0], box[1], box[2], box[3], mu, mv, b)
    o = np.empty((6, 3))
    derive(coefficients, patch[1], du, dv, rational, box[0], box[2], o)
    scale_derivatives(o, box[1], box[3])
    r = np.empty((10, 2))
    derivative_reaches(b, o, rational, r)
    a = np.empty(len(r))
    for k in range(len(r)):
        a[k] = fixed.hypot(r[k, 0], r[k, 1])
    for i in range(du + 1):
        for j in range(dv + 1):
            for k in range(3):
                hull[i, j, k] = b[i, j, k] / b[i, j, 3]
    row[0], row[1], row[2], row[3] = box[0], box[1], box[2], box[3]
    put(row[4:13], a[1:10])
    row[23] = r[0, 1]
    tag[1], tag[2], tag[3] = kind, state, CURVED
    if kind == EDGE:
        row[13] = np.inf
        cone_box(0.0, 0.0, 1.0, 1.0, 1.0, row[14:22])
        row[22] = 1.0
        return 1 if a[3] > TURN_RAD * 2.0 * max(a[1], 1e-30) and a[0] > SMALLEST_MM else 0
    sine, top = 2.0, 1.0
    whole, upright = normal_change(r)
    x = sign * (o[1, 1] * o[2, 2] - o[1, 2] * o[2, 1])
    y = sign * (o[1, 2] * o[2, 0] - o[1, 0] * o[2, 2])
    z = sign * (o[1, 0] * o[2, 1] - o[1, 1] * o[2, 0])
    length = math.sqrt(x * x + y * y + z * z)
    if length > whole:
        sine = whole / length
        top = (z + upright) / (length - whole)
        if top <= UPWARD:
            return -1
        x, y, z = x / length, y / length, z / length
    row[13] = whole
    cone_box(x, y, z, sine, top, row[14:22])
    row[22] = top
    bend = 0.5 * (a[3] + 2.0 * a[4] + a[5])
    if sine < TURN_RAD:
        if bend < PLANAR_MM:
            tag[3] = TILTED
        if r[0, 1] < PLANAR_MM:
            tag[3] = LEVEL
        return 0
    if sine >= 1.0 and a[0] < SMALLEST_MM:
        return 0
    along, across = a[3] * a[2] + a[1] * a[4], a[4] * a[2] + a[1] * a[5]
    if sine >= 1.0 and max(a[1], a[2]) > 3.0 * min(a[1], a[2]) and min(a[1], a[2]) > 0.0:
        along, across = a[1], a[2]
    return 1 if along >= across else 2


@njit(error_model="numpy")
def grow_leaves(coefficients, patch, span, sign, kinds, trims, matrices):
    """All leaves of all patches.

    Returns:
        rows (m, 24), tags (m, 4), hull points (h, 3), first hull point of each leaf (m + 1,).
    """
    rows, tags = np.empty((1024, LEAF_COLUMNS)), np.empty((1024, 4), np.int64)
    points, firsts = np.empty((16384, 3)), np.empty(1025, np.int64)
    count = used = 0
    stack, depth = np.empty((2 * MOST_HALVINGS + 64, 4)), np.empty(2 * MOST_HALVINGS + 64, np.int64)
    row, tag = np.zeros(LEAF_COLUMNS), np.zeros(4, np.int64)
    for p in range(patch.shape[0]):
        du, dv = patch[p, 2], patch[p, 3]
        mu, mv = matrices[du, :du + 1, :du + 1], matrices[dv, :dv + 1, :dv + 1]
        hull = np.empty((du + 1, dv + 1, 3))
        size = (du + 1) * (dv + 1)
        put(stack[0], np.array([0.0, 1.0, 0.0, 1.0]))
        depth[0] = 0
        top = 1
        while top > 0:
            top -= 1
            box, level = stack[top].copy(), depth[top]
            verdict = leaf_row(coefficients, patch[p], span[p], sign[p], patch[p, 0], box, kinds[p], trims,
                               mu, mv, row, tag, hull)
            if verdict < 0:
                continue
            if verdict > 0 and level < MOST_HALVINGS:
                k = 0 if verdict == 1 else 2
                for side in (-1.0, 1.0):
                    put(stack[top], box)
                    stack[top, k] = box[k] + side * 0.5 * box[k + 1]
                    stack[top, k + 1] = 0.5 * box[k + 1]
                    depth[top] = level + 1
                    top += 1
                continue
            if count == rows.shape[0]:
                rows, tags = _doubled(rows), _doubled(tags)
                more = np.empty(2 * count + 1, np.int64)
                put(more, firsts[:count])
                firsts = more
            while used + size > points.shape[0]:
                points = _doubled(points)
            tag[0] = p
            put(rows[count], row)
            put(tags[count], tag)
            firsts[count] = used
            put(points[used:used + size].reshape(-1), hull.reshape(-1))
            used += size
            count += 1
    firsts[count] = used
    return rows[:count].copy(), tags[:count].copy(), points[:used].copy(), firsts[:count + 1].copy()


@njit
def _doubled(a):
    out = np.empty((2 * a.shape[0], a.shape[1]), a.dtype)
    put(out.reshape(-1), a.reshape(-1))
    return out


@njit(error_model="numpy")
def grow_tree(points, firsts):
    """Halve the leaves at the median of the longest side until one is left.

    Returns:
        nodes (2 m - 1, 12): x low, high, y low, high, z top, a, b, c, (a, b) / sqrt(1 + a² + b²), (a, b) / |(a, b)|.
        first (2 m - 1,): the two children stand at first, first + 1; a leaf holds -1 - (its number).
    """
    m = firsts.shape[0] - 1
    nodes, first = np.empty((2 * m - 1, 12)), np.empty(2 * m - 1, np.int64)
    middles = np.empty((m, 3))
    for leaf in range(m):
        for k in range(3):
            column = points[firsts[leaf]:firsts[leaf + 1], k]
            middles[leaf, k] = 0.5 * (column.min() + column.max())
    order = np.arange(m)
    stack = np.empty((128, 3), np.int64)
    put(stack[0], np.array([0, 0, m]))
    top, used = 1, 1
    while top > 0:
        top -= 1
        k, low, high = stack[top]
        _node(points, firsts, order[low:high], nodes[k])
        if high - low == 1:
            first[k] = -1 - order[low]
            continue
        axis, longest = 0, -1.0
        for a in range(3):
            side = middles[order[low:high], a]
            reach = side.max() - side.min()
            if reach > longest:
                axis, longest = a, reach
        run = order[low:high]
        put(run, run[np.argsort(middles[run, axis], kind="mergesort")])
        half = (low + high) // 2
        first[k] = used
        put(stack[top], np.array([used, low, half]))
        put(stack[top + 1], np.array([used + 1, half, high]))
        used += 2
        top += 2
    return nodes, first


@njit(error_model="numpy")
def _node(points, firsts, leaves, out):
    """Box and the least-squares plane lifted until all hull points lie below."""
    xl, xh, yl, yh, zh = np.inf, -np.inf, np.inf, -np.inf, -np.inf
    n = mx = my = mz = 0.0
    for leaf in leaves:
        for i in range(firsts[leaf], firsts[leaf + 1]):
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            xl, xh, yl, yh, zh = min(xl, x), max(xh, x), min(yl, y), max(yh, y), max(zh, z)
            mx, my, mz, n = mx + x, my + y, mz + z, n + 1.0
    mx, my, mz = mx / n, my / n, mz / n
    xx = xy = yy = xz = yz = 0.0
    for leaf in leaves:
        for i in range(firsts[leaf], firsts[leaf + 1]):
            x, y, z = points[i, 0] - mx, points[i, 1] - my, points[i, 2] - mz
            xx, xy, yy, xz, yz = xx + x * x, xy + x * y, yy + y * y, xz + x * z, yz + y * z
    ridge = 1e-9 * (xx + yy) + 1e-18
    det = (xx + ridge) * (yy + ridge) - xy * xy
    a = ((yy + ridge) * xz - xy * yz) / det
    b = ((xx + ridge) * yz - xy * xz) / det
    g = math.hypot(a, b)
    if not g <= STEEPEST:
        a = b = g = 0.0
    c = -np.inf
    for leaf in leaves:
        for i in range(firsts[leaf], firsts[leaf + 1]):
            c = max(c, points[i, 2] - a * points[i, 0] - b * points[i, 1])
    s = 1.0 / math.sqrt(1.0 + g * g)
    out[0], out[1], out[2], out[3] = xl - HULL_MM, xh + HULL_MM, yl - HULL_MM, yh + HULL_MM
    out[4], out[5], out[6], out[7] = zh + HULL_MM, a, b, c + HULL_MM * (1.0 + g)
    out[8], out[9] = a * s, b * s
    out[10], out[11] = (a / g, b / g) if g > 1e-12 else (0.0, 0.0)
