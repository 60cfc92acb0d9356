"""Tree over the sub-patches of faces and the pieces of edges: a box and an upper plane z <= a x + b y + c per node.

Leaves are boxes of one patch (see `patch_bounds`); planes come from control hulls, so they hold for the whole
sub-patch.  Sub-patches whose normal is nowhere upward cannot be touched from above and are left out, as are
those outside the trim.
"""

import math

import numpy as np

from cuspline.surfaces.patches import (
    DEGREE_U,
    DEGREE_V,
    DS,
    DSS,
    DST,
    DT,
    DTT,
    IS_RATIONAL,
    OF_FACE,
    OFFSET,
    POINT,
    derive,
    scale_derivatives,
)
from cuspline.toolpaths.contact.leaf_rows import (
    HALF_S,
    HALF_T,
    KIND,
    MIDDLE_S,
    MIDDLE_T,
    NORMAL_CHANGE,
    NORMALS,
    PATCH,
    REACH_S,
    REACH_Z,
    SHAPE,
    STATE,
    TOP_NZ,
)
from cuspline.toolpaths.drop.drop_kernels import LEAN_X, LEAN_Y, PLANE_A, PLANE_B, PLANE_C, TOP, UPHILL_X, UPHILL_Y
from cuspline.toolpaths.drop.patch_bounds import (
    EDGE,
    FACE,
    HULL_MM,
    IN_PLAN,
    IN_Z,
    MOST_HALVINGS,
    OUTSIDE,
    PLANAR_MM,
    SMALLEST_MM,
    TURN_RAD,
    bernstein,
    cone_box,
    derivative_reaches,
    is_beside,
    normal_change,
    part_state,
)
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import X_HIGH, X_LOW, Y_HIGH, Y_LOW, W, X, Y, Z, put

STEEPEST = 5.0              # slope up to which a node's plane follows the surface
LEAF_COLUMNS = 24           # middle and half sizes (4), reaches (9), change of the normal, normals (8), top nz, dz
CURVED, LEVEL, TILTED = 0, 1, 2


@njit(error_model="numpy")
def leaf_row(coefficients, patch, span, sign, face, box, kind, trims, mu, mv, upward, row, tag, hull):
    """Describe one box of a patch.

    Args:
        box: (4,) middle s, half s, middle t, half t.
        upward: boxes whose normals have no larger nz are left out.
        row: (24,) and tag (4,) are filled: patch, FACE or EDGE, trim state, CURVED, LEVEL or TILTED plane.
        hull: (du + 1, dv + 1, 3) control points, filled.
    Returns:
        -1: leave it out; 0: it is a leaf; 1, 2: halve it in s, in t first.
    """
    du, dv, rational = patch[DEGREE_U], patch[DEGREE_V], patch[IS_RATIONAL] != 0
    state = 1
    if kind == FACE:
        state = part_state(trims, face, span, box[MIDDLE_S], box[HALF_S], box[MIDDLE_T], box[HALF_T])
        if state == OUTSIDE:
            return -1
    b = np.empty((du + 1, dv + 1, 4))
    bernstein(coefficients, patch[OFFSET], du, dv, box[MIDDLE_S], box[HALF_S], box[MIDDLE_T], box[HALF_T], mu, mv, b)
    o = np.empty((6, 3))
    derive(coefficients, patch[OFFSET], du, dv, rational, box[MIDDLE_S], box[MIDDLE_T], o)
    scale_derivatives(o, box[HALF_S], box[HALF_T])
    r = np.empty((10, 2))
    derivative_reaches(b, o, rational, r)
    a = np.empty(len(r))
    for k in range(len(r)):
        a[k] = fixed.hypot(r[k, IN_PLAN], r[k, IN_Z])
    for i in range(du + 1):
        for j in range(dv + 1):
            for k in range(3):
                hull[i, j, k] = b[i, j, k] / b[i, j, W]
    row[MIDDLE_S], row[HALF_S], row[MIDDLE_T], row[HALF_T] = box[MIDDLE_S], box[HALF_S], box[MIDDLE_T], box[HALF_T]
    put(row[REACH_S:NORMAL_CHANGE], a[1:10])
    row[REACH_Z] = r[POINT, IN_Z]
    tag[KIND], tag[STATE], tag[SHAPE] = kind, state, CURVED
    if kind == EDGE:
        row[NORMAL_CHANGE] = np.inf
        cone_box(0.0, 0.0, 1.0, 1.0, 1.0, row[NORMALS:TOP_NZ])
        row[TOP_NZ] = 1.0
        return 1 if a[DSS] > TURN_RAD * 2.0 * max(a[DS], 1e-30) and a[POINT] > SMALLEST_MM else 0
    sine, top = 2.0, 1.0
    whole, upright = normal_change(r)
    x = sign * (o[DS, Y] * o[DT, Z] - o[DS, Z] * o[DT, Y])
    y = sign * (o[DS, Z] * o[DT, X] - o[DS, X] * o[DT, Z])
    z = sign * (o[DS, X] * o[DT, Y] - o[DS, Y] * o[DT, X])
    length = math.sqrt(x * x + y * y + z * z)
    if length > whole:
        sine = whole / length
        top = (z + upright) / (length - whole)
        if top <= upward:
            return -1
        x, y, z = x / length, y / length, z / length
    row[NORMAL_CHANGE] = whole
    cone_box(x, y, z, sine, top, row[NORMALS:TOP_NZ])
    row[TOP_NZ] = top
    bend = 0.5 * (a[DSS] + 2.0 * a[DST] + a[DTT])
    if sine < TURN_RAD:
        if bend < PLANAR_MM:
            tag[SHAPE] = TILTED
        if r[POINT, IN_Z] < PLANAR_MM:
            tag[SHAPE] = LEVEL
        return 0
    if a[POINT] < SMALLEST_MM:
        return 0
    along, across = a[DSS] * a[DT] + a[DS] * a[DST], a[DST] * a[DT] + a[DS] * a[DTT]
    if sine >= 1.0 and max(a[DS], a[DT]) > 3.0 * min(a[DS], a[DT]) and min(a[DS], a[DT]) > 0.0:
        along, across = a[DS], a[DT]
    return 1 if along >= across else 2


@njit(error_model="numpy")
def grow_leaves(coefficients, patch, span, sign, kinds, trims, matrices, upward, within):
    """All leaves of all patches that reach into a box (low x, high x, low y, high y).

    Returns:
        rows (m, 24), tags (m, 4), hull points (h, 3), first hull point of each leaf (m + 1,).
    """
    rows, tags = np.empty((1024, LEAF_COLUMNS)), np.empty((1024, 4), np.int64)
    points, firsts = np.empty((16384, 3)), np.empty(1025, np.int64)
    count = used = 0
    stack, depth = np.empty((2 * MOST_HALVINGS + 64, 4)), np.empty(2 * MOST_HALVINGS + 64, np.int64)
    row, tag = np.zeros(LEAF_COLUMNS), np.zeros(4, np.int64)
    for p in range(len(patch)):
        du, dv = patch[p, DEGREE_U], patch[p, DEGREE_V]
        mu, mv = matrices[du, :du + 1, :du + 1], matrices[dv, :dv + 1, :dv + 1]
        hull = np.empty((du + 1, dv + 1, 3))
        size = (du + 1) * (dv + 1)
        put(stack[0], np.array([0.0, 1.0, 0.0, 1.0]))
        depth[0] = 0
        top = 1
        while top > 0:
            top -= 1
            box, level = stack[top].copy(), depth[top]
            verdict = leaf_row(coefficients, patch[p], span[p], sign[p], patch[p, OF_FACE], box, kinds[p], trims,
                               mu, mv, upward, row, tag, hull)
            if verdict < 0 or is_beside(hull, within):
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
            if count == len(rows):
                rows, tags = _doubled(rows), _doubled(tags)
                more = np.empty(2 * count + 1, np.int64)
                put(more, firsts[:count])
                firsts = more
            while used + size > len(points):
                points = _doubled(points)
            tag[PATCH] = p
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
    out = np.empty((2 * len(a), a.shape[1]), a.dtype)
    put(out.reshape(-1), a.reshape(-1))
    return out


@njit(error_model="numpy")
def grow_tree(points, firsts):
    """Halve the leaves at the median of the longest side until one is left.

    Returns:
        nodes (2 m - 1, 12): x low, high, y low, high, z top, a, b, c, (a, b) / sqrt(1 + a² + b²), (a, b) / |(a, b)|.
        first (2 m - 1,): the two children stand at first, first + 1; a leaf holds -1 - (its number).
    """
    m = len(firsts) - 1
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
            x, y, z = points[i, X], points[i, Y], points[i, Z]
            xl, xh, yl, yh, zh = min(xl, x), max(xh, x), min(yl, y), max(yh, y), max(zh, z)
            mx, my, mz, n = mx + x, my + y, mz + z, n + 1.0
    mx, my, mz = mx / n, my / n, mz / n
    xx = xy = yy = xz = yz = 0.0
    for leaf in leaves:
        for i in range(firsts[leaf], firsts[leaf + 1]):
            x, y, z = points[i, X] - mx, points[i, Y] - my, points[i, Z] - mz
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
            c = max(c, points[i, Z] - a * points[i, X] - b * points[i, Y])
    s = 1.0 / math.sqrt(1.0 + g * g)
    out[X_LOW], out[X_HIGH], out[Y_LOW], out[Y_HIGH] = xl - HULL_MM, xh + HULL_MM, yl - HULL_MM, yh + HULL_MM
    out[TOP], out[PLANE_A], out[PLANE_B], out[PLANE_C] = zh + HULL_MM, a, b, c + HULL_MM * (1.0 + g)
    out[LEAN_X], out[LEAN_Y] = a * s, b * s
    out[UPHILL_X], out[UPHILL_Y] = (a / g, b / g) if g > 1e-12 else (0.0, 0.0)
