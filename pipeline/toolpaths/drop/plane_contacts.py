"""Where a cutter rests on a sub-patch that is a plane: closed form, its parameters by Newton's method."""

import math

import numpy as np

from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, DS, DT, IS_RATIONAL, OFFSET, POINT, derive
from cuspline.toolpaths.contact.leaf_rows import AT_S, AT_T, HALF_S, HALF_T, MIDDLE_S, MIDDLE_T, PATCH, SHAPE
from cuspline.toolpaths.drop.patch_contacts import bottom
from cuspline.toolpaths.drop.patch_tree import LEVEL
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z


@njit(error_model="numpy")
def plane_contact(tree, leaf, x, y, R, rc, o, w):
    """Contact on a plane leaf: (tip, found); on a level plane the point nearest the axis, else the closed form."""
    row, tag = tree.rows[leaf], tree.tags[leaf]
    p = tree.patch[tag[PATCH]]
    derive(tree.coefficients, p[OFFSET], p[DEGREE_U], p[DEGREE_V], p[IS_RATIONAL] != 0, row[MIDDLE_S], row[MIDDLE_T], o)
    sign = tree.sign[tag[PATCH]]
    tx, ty = x, y
    if tag[SHAPE] != LEVEL:
        nx = sign * (o[DS, Y] * o[DT, Z] - o[DS, Z] * o[DT, Y])
        ny = sign * (o[DS, Z] * o[DT, X] - o[DS, X] * o[DT, Z])
        nz = sign * (o[DS, X] * o[DT, Y] - o[DS, Y] * o[DT, X])
        n, h = math.sqrt(nx * nx + ny * ny + nz * nz), math.sqrt(nx * nx + ny * ny)
        if h > 0.0:
            k = (R - rc) / h + rc / n
            tx, ty = x - k * nx, y - k * ny
    s, t = row[MIDDLE_S], row[MIDDLE_T]
    best = np.inf
    w[AT_S], w[AT_T] = s, t
    for _ in range(6):                      # one step where the parametrisation is even, a few where it is not
        dx, dy = tx - o[POINT, X], ty - o[POINT, Y]
        if dx * dx + dy * dy < best:
            best = dx * dx + dy * dy
            w[AT_S], w[AT_T] = s, t
        else:
            break
        if best < 1e-24:
            break
        det = o[DS, X] * o[DT, Y] - o[DS, Y] * o[DT, X]
        if abs(det) < 1e-300:
            break
        ns, nt = s + (dx * o[DT, Y] - dy * o[DT, X]) / det, t + (o[DS, X] * dy - o[DS, Y] * dx) / det
        if tag[SHAPE] != LEVEL:
            s, t = ns, nt
            if (abs(s - row[MIDDLE_S]) > row[HALF_S] * 1.000001 + 1e-12
                    or abs(t - row[MIDDLE_T]) > row[HALF_T] * 1.000001 + 1e-12):
                return -np.inf
        else:
            s, t = _nearest_in_box(row, s, t, ns, nt, o)
        derive(tree.coefficients, p[OFFSET], p[DEGREE_U], p[DEGREE_V], p[IS_RATIONAL] != 0, s, t, o)
    d = math.sqrt((o[POINT, X] - x) ** 2 + (o[POINT, Y] - y) ** 2)
    if d > R + 1e-9:
        return -np.inf
    return o[POINT, Z] - bottom(min(d, R), R, rc)


@njit(error_model="numpy")
def _nearest_in_box(row, s, t, ns, nt, o):
    """Point of the leaf's box nearest (in the plane's metric) to the unbounded solution ns, nt."""
    sl, sh, tl, th = (row[MIDDLE_S] - row[HALF_S], row[MIDDLE_S] + row[HALF_S], row[MIDDLE_T] - row[HALF_T],
                      row[MIDDLE_T] + row[HALF_T])
    if sl <= ns <= sh and tl <= nt <= th:
        return ns, nt
    ss = o[DS, X] ** 2 + o[DS, Y] ** 2
    st = o[DS, X] * o[DT, X] + o[DS, Y] * o[DT, Y]
    tt = o[DT, X] ** 2 + o[DT, Y] ** 2
    bs, bt, least = s, t, np.inf
    for side in range(4):                   # quadratic in the rest along each side
        if side < 2:
            a = sl if side == 0 else sh
            b = min(max(nt - st * (a - ns) / max(tt, 1e-300), tl), th)
        else:
            b = tl if side == 2 else th
            a = min(max(ns - st * (b - nt) / max(ss, 1e-300), sl), sh)
        far = ss * (a - ns) ** 2 + 2.0 * st * (a - ns) * (b - nt) + tt * (b - nt) ** 2
        if far < least:
            bs, bt, least = a, b, far
    return bs, bt
