"""The contact map of a cutter: where its axis stands when it touches a smooth surface at a point.

A cutter of radius R and corner radius rc touches S(sigma, tau) with upward unit normal n when its axis stands over

    G = S_xy + rc n_xy + (R - rc) n_xy / |n_xy|

Where every matrix within the bounds of G's derivatives over a box is regular, G is one-to-one there: at most one
contact for each axis, and Newton's interval step says where in the box it must lie.  G's determinant has the sign
of the Hessian of the cutter's distance at the contact; where it is negative the hollow is narrower than the cutter,
and no contact holds.  Neither depends on where in the box the axis stands, so large boxes are settled at once.
"""

import math

from cuspline.surfaces.patches import derive
from cuspline.values.compiled import njit

HAIR = 1e-8         # of a box: contacts on the line between two boxes belong to both


@njit(error_model="numpy")
def map_proof(row, o, alpha, beta, sign, nx, ny, nz, length, sine, x, y, R, rc, w):
    """What the contact map says about contacts with the cutter over (x, y) in a box of a leaf of a face.

    Args:
        row: the leaf's row (see patch_tree); alpha, beta: half sizes of the box within the leaf.
        o: (6, 3) position and derivatives in the middle, per alpha, beta.
        sign, nx, ny, nz, length: upward normal = sign (S_s x S_t), unit, and its length, in the middle.
        sine: of the angle that normals leave it by at most.
        w: (12,); filled where the answer is 1: sigma, tau of Newton's step in 0, 1, the inverse of G's derivatives
            in 4 to 7, what it makes of their errors in 8 to 11 (rows).
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
    ass, ast, att = row[6] * alpha * alpha, row[7] * alpha * beta, row[8] * beta * beta
    ls, lt = row[4] * alpha, row[5] * beta
    sss, sst = row[9] * alpha ** 3, row[10] * alpha * alpha * beta
    stt, ttt = row[11] * alpha * beta * beta, row[12] * beta ** 3
    least = length * (1.0 - sine)
    # derivatives of the normal vector in the middle, then of the unit normal
    mx = o[3, 1] * o[2, 2] - o[3, 2] * o[2, 1] + o[1, 1] * o[4, 2] - o[1, 2] * o[4, 1]
    my = o[3, 2] * o[2, 0] - o[3, 0] * o[2, 2] + o[1, 2] * o[4, 0] - o[1, 0] * o[4, 2]
    mz = o[3, 0] * o[2, 1] - o[3, 1] * o[2, 0] + o[1, 0] * o[4, 1] - o[1, 1] * o[4, 0]
    vs = math.sqrt(mx * mx + my * my + mz * mz)
    k = nx * mx + ny * my + nz * mz
    scale = sign / length
    sx, sy = scale * (mx - k * nx), scale * (my - k * ny)
    mx = o[4, 1] * o[2, 2] - o[4, 2] * o[2, 1] + o[1, 1] * o[5, 2] - o[1, 2] * o[5, 1]
    my = o[4, 2] * o[2, 0] - o[4, 0] * o[2, 2] + o[1, 2] * o[5, 0] - o[1, 0] * o[5, 2]
    mz = o[4, 0] * o[2, 1] - o[4, 1] * o[2, 0] + o[1, 0] * o[5, 1] - o[1, 1] * o[5, 0]
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
    a = px * o[1, 0] + py * o[1, 1] + rc * (px * sx + py * sy)
    b = px * o[2, 0] + py * o[2, 1] + rc * (px * tx + py * ty)
    ns, nt = px * sy - py * sx, px * ty - py * tx
    d = px * o[1, 1] - py * o[1, 0] + (rc + middle) * ns
    e = px * o[2, 1] - py * o[2, 0] + (rc + middle) * nt
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
    gx, gy = o[0, 0] + rc * nx + c * px - x, o[0, 1] + rc * ny + c * py - y
    if c == 0.0:
        gx, gy = o[0, 0] + rc * nx - x, o[0, 1] + rc * ny - y
    w[4], w[5] = (e * px + b * py) / det, (e * py - b * px) / det
    w[6], w[7] = -(a * py + d * px) / det, (a * px - d * py) / det
    w[8], w[9], w[10], w[11] = ja, jb, jd, je
    w[0], w[1] = -(w[4] * gx + w[5] * gy), -(w[6] * gx + w[7] * gy)
    if abs(w[0]) > 1.0 + HAIR + ja + jb or abs(w[1]) > 1.0 + HAIR + jd + je:
        return 2
    return 1


@njit(error_model="numpy")
def map_step(coefficients, patch, s, t, hs, ht, sign, x, y, R, rc, o, w):
    """Another step of Newton, from what `map_proof` left in w: false where the contact lies outside the box."""
    c = R - rc
    u, v = min(max(w[0], -1.0), 1.0), min(max(w[1], -1.0), 1.0)
    derive(coefficients, patch[1], patch[2], patch[3], patch[4] != 0, s + hs * u, t + ht * v, o)
    nx = sign * (o[1, 1] * o[2, 2] - o[1, 2] * o[2, 1])
    ny = sign * (o[1, 2] * o[2, 0] - o[1, 0] * o[2, 2])
    nz = o[1, 0] * o[2, 1] - o[1, 1] * o[2, 0]
    level = math.sqrt(nx * nx + ny * ny)
    k = rc / math.sqrt(level * level + nz * nz)
    if c > 0.0:
        k += c / level
    gx, gy = o[0, 0] + k * nx - x, o[0, 1] + k * ny - y
    du, dv = w[4] * gx + w[5] * gy, w[6] * gx + w[7] * gy
    # the contact lies within |step| + J |distance| of here: distance <= (1 - J)^-1 |step|
    ja, jb, jd, je = w[8], w[9], w[10], w[11]
    det = (1.0 - ja) * (1.0 - je) - jb * jd
    fu, fv = ((1.0 - je) * abs(du) + jb * abs(dv)) / det, ((1.0 - ja) * abs(dv) + jd * abs(du)) / det
    w[0], w[1] = u - du, v - dv
    return abs(w[0]) <= 1.0 + HAIR + ja * fu + jb * fv and abs(w[1]) <= 1.0 + HAIR + jd * fu + je * fv
