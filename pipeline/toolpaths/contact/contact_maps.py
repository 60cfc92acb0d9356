"""The contact map of a cutter: where its axis stands when it touches a smooth surface at a point.

A cutter of radius R and corner radius rc touches S(sigma, tau) with upward unit normal n when its axis stands over

    G = S_xy + rc n_xy + (R - rc) n_xy / |n_xy|

Where every matrix within the bounds of G's derivatives over a box is regular, G is one-to-one there: at most one
contact for each axis, and Newton's interval step says where in the box it must lie.  G's determinant has the sign
of the Hessian of the cutter's distance at the contact; where it is negative the hollow is narrower than the cutter,
and no contact holds.  Neither depends on where in the box the axis stands, so large boxes are settled at once.
"""

import math

from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, DS, DSS, DST, DT, DTT, IS_RATIONAL, OFFSET, POINT, derive
from cuspline.toolpaths.contact.leaf_rows import (
    AT_S,
    AT_T,
    REACH_S,
    REACH_SS,
    REACH_SSS,
    REACH_SST,
    REACH_ST,
    REACH_STT,
    REACH_T,
    REACH_TT,
    REACH_TTT,
)
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z

S_BY_X, S_BY_Y, T_BY_X, T_BY_Y = range(4, 8)            # of what `map_proof` leaves: the inverse of G's derivatives,
ERROR_SS, ERROR_ST, ERROR_TS, ERROR_TT = range(8, 12)   # and what it makes of their errors
HAIR = 1e-8         # of a box: contacts on the line between two boxes belong to both


@njit(error_model="numpy")
def map_proof(row, o, alpha, beta, sign, nx, ny, nz, length, sine, x, y, R, rc, w):
    """What the contact map says about contacts with the cutter over (x, y) in a box of a leaf of a face.

    Args:
        row: the leaf's row (see patch_tree); alpha, beta: half sizes of the box within the leaf.
        o: (6, 3) position and derivatives in the middle, per alpha, beta.
        sign, nx, ny, nz, length: upward normal = sign (S_s x S_t), unit, and its length, in the middle.
        sine: of the angle that normals leave it by at most.
        w: (12,); filled where the answer is 1: sigma, tau of Newton's step (AT_S, AT_T), the inverse of G's derivatives
            (S_BY_X to T_BY_Y), what it makes of their errors (ERROR_SS to ERROR_TT).
    Returns:
        0: nothing; 1: at most one contact; 2: none.
    """
    c = R - rc
    if sine > 0.5:
        return 0
    level = math.sqrt(nx * nx + ny * ny)        # of the unit normal: its horizontal part
    spread = turn = 0.0
    px, py = 1.0, 0.0                           # horizontal direction of the normal
    if c > 0.0:
        if level <= 1.5 * sine:
            return 0
        px, py = nx / level, ny / level
        turn = 1.01 * sine / level
        spread = c / (level - 1.04 * sine)             # largest c / |n_xy|
    ass, ast, att = row[REACH_SS] * alpha * alpha, row[REACH_ST] * alpha * beta, row[REACH_TT] * beta * beta
    ls, lt = row[REACH_S] * alpha, row[REACH_T] * beta
    sss, sst = row[REACH_SSS] * alpha ** 3, row[REACH_SST] * alpha * alpha * beta
    stt, ttt = row[REACH_STT] * alpha * beta * beta, row[REACH_TTT] * beta ** 3
    least = length * (1.0 - sine)
    # derivatives of the normal vector in the middle, then of the unit normal
    mx = o[DSS, Y] * o[DT, Z] - o[DSS, Z] * o[DT, Y] + o[DS, Y] * o[DST, Z] - o[DS, Z] * o[DST, Y]
    my = o[DSS, Z] * o[DT, X] - o[DSS, X] * o[DT, Z] + o[DS, Z] * o[DST, X] - o[DS, X] * o[DST, Z]
    mz = o[DSS, X] * o[DT, Y] - o[DSS, Y] * o[DT, X] + o[DS, X] * o[DST, Y] - o[DS, Y] * o[DST, X]
    vs = math.sqrt(mx * mx + my * my + mz * mz)
    k = nx * mx + ny * my + nz * mz
    scale = sign / length
    sx, sy = scale * (mx - k * nx), scale * (my - k * ny)
    mx = o[DST, Y] * o[DT, Z] - o[DST, Z] * o[DT, Y] + o[DS, Y] * o[DTT, Z] - o[DS, Z] * o[DTT, Y]
    my = o[DST, Z] * o[DT, X] - o[DST, X] * o[DT, Z] + o[DS, Z] * o[DTT, X] - o[DS, X] * o[DTT, Z]
    mz = o[DST, X] * o[DT, Y] - o[DST, Y] * o[DT, X] + o[DS, X] * o[DTT, Y] - o[DS, Y] * o[DTT, X]
    vt = math.sqrt(mx * mx + my * my + mz * mz)
    k = nx * mx + ny * my + nz * mz
    tx, ty = scale * (mx - k * nx), scale * (my - k * ny)
    # how far they leave these over the box
    turned = 1.01 * sine * (1.0 / least + 1.0 / length)
    cross = sst * lt + ass * att + ls * stt
    ds = (sss * lt + 2.0 * ass * ast + ls * sst + cross) / least + vs * turned
    dt = (stt * lt + 2.0 * ast * att + ls * ttt + cross) / least + vt * turned
    # rows of G's derivatives along the normal's horizontal direction p and across it
    middle = c / level if c > 0.0 else 0.0
    a = px * o[DS, X] + py * o[DS, Y] + rc * (px * sx + py * sy)
    b = px * o[DT, X] + py * o[DT, Y] + rc * (px * tx + py * ty)
    ns, nt = px * sy - py * sx, px * ty - py * tx
    d = px * o[DS, Y] - py * o[DS, X] + (rc + middle) * ns
    e = px * o[DT, Y] - py * o[DT, X] + (rc + middle) * nt
    hs, ht = math.sqrt(sx * sx + sy * sy), math.sqrt(tx * tx + ty * ty)
    es, et = ass + ast + rc * ds, ast + att + rc * dt
    ea, eb = es + spread * turn * (hs + ds), et + spread * turn * (ht + dt)
    loose = spread - middle + spread * turn * turn
    ed = es + spread * ds + loose * abs(ns) + spread * turn * hs
    ee = et + spread * dt + loose * abs(nt) + spread * turn * ht
    det = a * e - b * d
    size = abs(det)
    if not size > 0.0:
        return 0
    q = 1.000001 / size
    ja, jb = (abs(e) * ea + abs(b) * ed) * q, (abs(e) * eb + abs(b) * ee) * q
    jd, je = (abs(d) * ea + abs(a) * ed) * q, (abs(d) * eb + abs(a) * ee) * q
    if ja >= 1.0 or je >= 1.0 or (1.0 - ja) * (1.0 - je) <= jb * jd:
        return 0
    if det * sign < 0.0:
        return 2
    gx, gy = o[POINT, X] + rc * nx + c * px - x, o[POINT, Y] + rc * ny + c * py - y
    if c == 0.0:
        gx, gy = o[POINT, X] + rc * nx - x, o[POINT, Y] + rc * ny - y
    w[S_BY_X], w[S_BY_Y] = (e * px + b * py) / det, (e * py - b * px) / det
    w[T_BY_X], w[T_BY_Y] = -(a * py + d * px) / det, (a * px - d * py) / det
    w[ERROR_SS], w[ERROR_ST], w[ERROR_TS], w[ERROR_TT] = ja, jb, jd, je
    w[AT_S], w[AT_T] = -(w[S_BY_X] * gx + w[S_BY_Y] * gy), -(w[T_BY_X] * gx + w[T_BY_Y] * gy)
    if abs(w[AT_S]) > 1.0 + HAIR + ja + jb or abs(w[AT_T]) > 1.0 + HAIR + jd + je:
        return 2
    return 1


@njit(error_model="numpy")
def map_step(coefficients, patch, s, t, hs, ht, sign, x, y, R, rc, o, w):
    """Another step of Newton, from what `map_proof` left in w: false where the contact lies outside the box."""
    c = R - rc
    u, v = min(max(w[AT_S], -1.0), 1.0), min(max(w[AT_T], -1.0), 1.0)
    derive(coefficients, patch[OFFSET], patch[DEGREE_U], patch[DEGREE_V], patch[IS_RATIONAL] != 0, s + hs * u,
           t + ht * v, o)
    nx = sign * (o[DS, Y] * o[DT, Z] - o[DS, Z] * o[DT, Y])
    ny = sign * (o[DS, Z] * o[DT, X] - o[DS, X] * o[DT, Z])
    nz = o[DS, X] * o[DT, Y] - o[DS, Y] * o[DT, X]
    level = math.sqrt(nx * nx + ny * ny)
    k = rc / math.sqrt(level * level + nz * nz)
    if c > 0.0:
        k += c / level
    gx, gy = o[POINT, X] + k * nx - x, o[POINT, Y] + k * ny - y
    du, dv = w[S_BY_X] * gx + w[S_BY_Y] * gy, w[T_BY_X] * gx + w[T_BY_Y] * gy
    # the contact lies within |step| + J |distance| of here: distance <= (1 - J)^-1 |step|
    ja, jb, jd, je = w[ERROR_SS], w[ERROR_ST], w[ERROR_TS], w[ERROR_TT]
    det = (1.0 - ja) * (1.0 - je) - jb * jd
    fu, fv = ((1.0 - je) * abs(du) + jb * abs(dv)) / det, ((1.0 - ja) * abs(dv) + jd * abs(du)) / det
    w[AT_S], w[AT_T] = u - du, v - dv
    return abs(w[AT_S]) <= 1.0 + HAIR + ja * fu + jb * fv and abs(w[AT_T]) <= 1.0 + HAIR + jd * fu + je * fv
