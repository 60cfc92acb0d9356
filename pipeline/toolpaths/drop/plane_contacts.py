"""Where a cutter rests on a sub-patch that is a plane: closed form, its parameters by Newton's method."""

import math

import numpy as np

from cuspline.surfaces.patches import derive
from cuspline.toolpaths.drop.patch_contacts import bottom
from cuspline.toolpaths.drop.patch_tree import LEVEL
from cuspline.values.compiled import njit


@njit(error_model="numpy")
def plane_contact(tree, leaf, x, y, R, rc, o, w):
    """Contact on a plane leaf: (tip, found); on a level plane the point nearest the axis, else the closed form."""
    row, tag = tree[5][leaf], tree[6][leaf]
    p = tree[1][tag[0]]
    derive(tree[0], p[1], p[2], p[3], p[4] != 0, row[0], row[2], o)
    sign = tree[4][tag[0]]
    tx, ty = x, y
    if tag[3] != LEVEL:
        nx = sign * (o[1, 1] * o[2, 2] - o[1, 2] * o[2, 1])
        ny = sign * (o[1, 2] * o[2, 0] - o[1, 0] * o[2, 2])
        nz = sign * (o[1, 0] * o[2, 1] - o[1, 1] * o[2, 0])
        n, h = math.sqrt(nx * nx + ny * ny + nz * nz), math.sqrt(nx * nx + ny * ny)
        if h > 0.0:
            k = (R - rc) / h + rc / n
            tx, ty = x - k * nx, y - k * ny
    s, t = row[0], row[2]
    best = np.inf
    w[0], w[1] = s, t
    for _ in range(6):                      # one step where the parametrisation is even, a few where it is not
        dx, dy = tx - o[0, 0], ty - o[0, 1]
        if dx * dx + dy * dy < best:
            best = dx * dx + dy * dy
            w[0], w[1] = s, t
        else:
            break
        if best < 1e-24:
            break
        det = o[1, 0] * o[2, 1] - o[1, 1] * o[2, 0]
        if abs(det) < 1e-300:
            break
        ns, nt = s + (dx * o[2, 1] - dy * o[2, 0]) / det, t + (o[1, 0] * dy - o[1, 1] * dx) / det
        if tag[3] != LEVEL:
            s, t = ns, nt
            if abs(s - row[0]) > row[1] * 1.000001 + 1e-12 or abs(t - row[2]) > row[3] * 1.000001 + 1e-12:
                return -np.inf
        else:
            s, t = _nearest_in_box(row, s, t, ns, nt, o)
        derive(tree[0], p[1], p[2], p[3], p[4] != 0, s, t, o)
    d = math.sqrt((o[0, 0] - x) ** 2 + (o[0, 1] - y) ** 2)
    if d > R + 1e-9:
        return -np.inf
    return o[0, 2] - bottom(min(d, R), R, rc)


@njit(error_model="numpy")
def _nearest_in_box(row, s, t, ns, nt, o):
    """Point of the leaf's box nearest (in the plane's metric) to the unbounded solution ns, nt."""
    sl, sh, tl, th = row[0] - row[1], row[0] + row[1], row[2] - row[3], row[2] + row[3]
    if sl <= ns <= sh and tl <= nt <= th:
        return ns, nt
    ss = o[1, 0] ** 2 + o[1, 1] ** 2
    st = o[1, 0] * o[2, 0] + o[1, 1] * o[2, 1]
    tt = o[2, 0] ** 2 + o[2, 1] ** 2
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
