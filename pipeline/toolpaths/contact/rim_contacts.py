"""Where a flat end mill (corner radius 0) rests on one sub-patch or edge piece: highest z within the disk d <= R.

On a face the highest point is either a summit (level tangent plane) inside the disk, or on the rim, where with
Q = (d² - R²)/2 the gradients of z and Q are parallel: Q = 0, P = z_s Q_t - z_t Q_s = 0.  On an edge it is a
summit, an end, or a crossing of the rim.  Proofs: z concave; (Q, P) one-to-one because every matrix made of
rows within the ranges of their gradients is regular; along an edge z and Q monotone.
"""

import math

import numpy as np

from cuspline.surfaces.patches import derive
from cuspline.values.compiled import njit

STEPS = 30
RIM_MM = 1e-9           # a point this far outside the disk counts as under it: the safe side


@njit(error_model="numpy")
def climb_flat(coefficients, patch, s, t, sl, sh, tl, th, x, y, R, o, w):
    """Highest point found under the disk from (s, t) within a box of a patch.

    Returns:
        its z, -inf if none; w (4,) holds s, t and 2 if the search on a face came to a maximum, 1 on an edge.
    """
    if patch[3] == 0:
        return _climb_edge(coefficients, patch, sl, sh, x, y, R, o, w)
    found = _to_rim(coefficients, patch, s, t, sl, sh, tl, th, x, y, R, o, w)
    if not found:
        found = _to_summit(coefficients, patch, s, t, sl, sh, tl, th, o, w)
    w[2] = 0.0
    if not found or (o[0, 0] - x) ** 2 + (o[0, 1] - y) ** 2 > (R + RIM_MM) ** 2:
        return -np.inf
    w[2] = 2.0
    return o[0, 2]


@njit(inline="always")
def _is_outside(s, t, sl, sh, tl, th):
    """Outside a box by more than rounding: maxima on the line between two boxes must not fall between them."""
    hs, ht = 1e-9 * (sh - sl), 1e-9 * (th - tl)
    return s < sl - hs or s > sh + hs or t < tl - ht or t > th + ht


@njit(error_model="numpy")
def _to_rim(coefficients, patch, s, t, sl, sh, tl, th, x, y, R, o, w):
    """Newton on (Q, P) within a box; true when it converged inside it (o, w hold the point)."""
    blocked = 0
    for _ in range(STEPS):
        derive(coefficients, patch[1], patch[2], patch[3], patch[4] != 0, s, t, o)
        dx, dy = o[0, 0] - x, o[0, 1] - y
        q = 0.5 * (dx * dx + dy * dy - R * R)
        qs, qt = dx * o[1, 0] + dy * o[1, 1], dx * o[2, 0] + dy * o[2, 1]
        qss = o[1, 0] ** 2 + o[1, 1] ** 2 + dx * o[3, 0] + dy * o[3, 1]
        qst = o[1, 0] * o[2, 0] + o[1, 1] * o[2, 1] + dx * o[4, 0] + dy * o[4, 1]
        qtt = o[2, 0] ** 2 + o[2, 1] ** 2 + dx * o[5, 0] + dy * o[5, 1]
        p = o[1, 2] * qt - o[2, 2] * qs
        ps = o[3, 2] * qt + o[1, 2] * qst - o[4, 2] * qs - o[2, 2] * qss
        pt = o[4, 2] * qt + o[1, 2] * qtt - o[5, 2] * qs - o[2, 2] * qst
        det = qs * pt - qt * ps
        if not abs(det) > 1e-300:
            return False
        ns, nt = s - (pt * q - qt * p) / det, t - (qs * p - ps * q) / det
        clamped = _is_outside(ns, nt, sl, sh, tl, th)
        ns, nt = min(max(ns, sl), sh), min(max(nt, tl), th)
        moved = abs(ns - s) * math.sqrt(o[1, 0] ** 2 + o[1, 1] ** 2 + o[1, 2] ** 2) \
            + abs(nt - t) * math.sqrt(o[2, 0] ** 2 + o[2, 1] ** 2 + o[2, 2] ** 2)
        if moved < 1e-12:
            w[0], w[1] = s, t
            return not clamped and abs(q) < 2.0 * RIM_MM * R and qs * o[1, 2] + qt * o[2, 2] >= 0.0
        if clamped:
            blocked += 1
            if blocked > 6:
                return False
        s, t = ns, nt
    return False


@njit(error_model="numpy")
def _to_summit(coefficients, patch, s, t, sl, sh, tl, th, o, w):
    """Newton on the gradient of z within a box; true when it converged on a maximum inside it."""
    for _ in range(STEPS):
        derive(coefficients, patch[1], patch[2], patch[3], patch[4] != 0, s, t, o)
        det = o[3, 2] * o[5, 2] - o[4, 2] * o[4, 2]
        if not (det > 0.0 and o[3, 2] < 0.0):
            return False
        ns = s - (o[5, 2] * o[1, 2] - o[4, 2] * o[2, 2]) / det
        nt = t - (o[3, 2] * o[2, 2] - o[4, 2] * o[1, 2]) / det
        clamped = _is_outside(ns, nt, sl, sh, tl, th)
        ns, nt = min(max(ns, sl), sh), min(max(nt, tl), th)
        moved = abs(ns - s) * (abs(o[1, 0]) + abs(o[1, 1])) + abs(nt - t) * (abs(o[2, 0]) + abs(o[2, 1]))
        if moved < 1e-10:
            w[0], w[1] = s, t
            return not clamped
        s, t = ns, nt
    return False


@njit(error_model="numpy")
def _climb_edge(coefficients, patch, sl, sh, x, y, R, o, w):
    """Best of the ends, the summit and the crossing of the rim on a stretch of an edge."""
    best, bs = -np.inf, sl
    values = np.empty(2)
    for k in range(2):
        s = sl if k == 0 else sh
        z, values[k] = _edge_at(coefficients, patch, s, x, y, o)
        if values[k] <= R + RIM_MM and z > best:
            best, bs = z, s
    if (values[0] > R) != (values[1] > R):          # crossing of the rim: Newton kept in a bracket
        inside, outside = (sl, sh) if values[0] <= R else (sh, sl)
        s = 0.5 * (inside + outside)
        for _ in range(80):
            z, d = _edge_at(coefficients, patch, s, x, y, o)
            if d <= R:
                inside = s
                if z > best:
                    best, bs = z, s
            else:
                outside = s
                if d <= R + RIM_MM and z > best:
                    best, bs = z, s
            if abs(d - R) < 1e-13 * R or abs(inside - outside) < 1e-15:
                break
            rate = ((o[0, 0] - x) * o[1, 0] + (o[0, 1] - y) * o[1, 1]) / max(d, 1e-300)
            n = s - (d - R) / rate if rate != 0.0 else np.inf
            if not (min(inside, outside) < n < max(inside, outside)):
                n = 0.5 * (inside + outside)
            s = n
    s = 0.5 * (sl + sh)
    for _ in range(STEPS):                          # summit
        z, d = _edge_at(coefficients, patch, s, x, y, o)
        if d <= R + RIM_MM and z > best:
            best, bs = z, s
        if not o[3, 2] < 0.0:
            break
        n = min(max(s - o[1, 2] / o[3, 2], sl), sh)
        if abs(n - s) < 1e-14:
            break
        s = n
    w[0], w[1], w[2] = bs, 0.0, 1.0
    return best


@njit(error_model="numpy", inline="always")
def _edge_at(coefficients, patch, s, x, y, o):
    """z and distance to the axis; derivatives stay in o."""
    derive(coefficients, patch[1], patch[2], patch[3], patch[4] != 0, s, 0.0, o)
    return o[0, 2], math.sqrt((o[0, 0] - x) ** 2 + (o[0, 1] - y) ** 2)


@njit(error_model="numpy")
def flat_proof(row, kind, o, alpha, beta, x, y, R, normal_z, sine):
    """As `patch_contacts.box_proof` for a flat end mill: 0 nothing, 1 at most one contact, 2 none."""
    ls, lt = row[4] * alpha, row[5] * beta
    ass, ast, att = row[6] * alpha * alpha, row[7] * alpha * beta, row[8] * beta * beta
    sss, sst = row[9] * alpha ** 3, row[10] * alpha * alpha * beta
    stt, ttt = row[11] * alpha * beta * beta, row[12] * beta ** 3
    dx, dy = o[0, 0] - x, o[0, 1] - y
    d = math.sqrt(dx * dx + dy * dy)
    bend = 0.5 * (ass + 2.0 * ast + att)
    reach = d + math.sqrt(o[1, 0] ** 2 + o[1, 1] ** 2) + math.sqrt(o[2, 0] ** 2 + o[2, 1] ** 2) + bend
    qs, qt = dx * o[1, 0] + dy * o[1, 1], dx * o[2, 0] + dy * o[2, 1]
    qss = o[1, 0] ** 2 + o[1, 1] ** 2 + dx * o[3, 0] + dy * o[3, 1]
    qst = o[1, 0] * o[2, 0] + o[1, 1] * o[2, 1] + dx * o[4, 0] + dy * o[4, 1]
    qtt = o[2, 0] ** 2 + o[2, 1] ** 2 + dx * o[5, 0] + dy * o[5, 1]
    # how far the second derivatives of Q leave their middle values: its third derivatives
    xsss, xsst = 3.0 * ls * ass + reach * sss, 2.0 * ls * ast + lt * ass + reach * sst
    xstt, xttt = 2.0 * lt * ast + ls * att + reach * stt, 3.0 * lt * att + reach * ttt
    cubic = (xsss + 3.0 * xsst + 3.0 * xstt + xttt) / 6.0
    q = 0.5 * (d * d - R * R)
    slack = abs(qs) + abs(qt) + abs(qst) + cubic
    q_low = q - slack + 0.5 * min(qss, 0.0) + 0.5 * min(qtt, 0.0)
    q_high = q + slack + 0.5 * max(qss, 0.0) + 0.5 * max(qtt, 0.0)
    if q_low > RIM_MM * R:
        return 2
    eqs = abs(qss) + abs(qst) + xsss + 2.0 * xsst + xstt
    if kind == 1:
        falls = abs(o[1, 2]) > ass or o[3, 2] + sss < 0.0
        return 1 if falls and (q_high <= 0.0 or abs(qs) > eqs) else 0
    summit = not (sine < 1.0 and math.sqrt(max(1.0 - normal_z * normal_z, 0.0)) > 1.01 * sine)
    if summit and (o[3, 2] - sss - sst > 0.0 or o[5, 2] - stt - ttt > 0.0):
        summit = False                              # z curves upward: no maximum inside
    rim = q_high >= -RIM_MM * R
    if not rim and not summit:
        return 2
    if not rim:
        a, b, c = -o[3, 2] - sss - sst, -o[5, 2] - stt - ttt, abs(o[4, 2]) + sst + stt
        return 1 if a > 0.0 and b > 0.0 and a * b > c * c else 0
    if summit:
        return 0
    ps = o[3, 2] * qt + o[1, 2] * qst - o[4, 2] * qs - o[2, 2] * qss
    pt = o[4, 2] * qt + o[1, 2] * qtt - o[5, 2] * qs - o[2, 2] * qst
    eqt = abs(qst) + abs(qtt) + xsst + 2.0 * xstt + xttt
    gs, gt = abs(qs) + eqs, abs(qt) + eqt
    # every factor of ps, pt at its largest, times how far the other leaves its middle
    rss, rst, rtt = xsss + xsst, xsst + xstt, xstt + xttt
    eps = (sss + sst) * gt + abs(o[3, 2]) * eqt + (ass + ast) * (abs(qst) + rst) + abs(o[1, 2]) * rst \
        + (sst + stt) * gs + abs(o[4, 2]) * eqs + (ast + att) * (abs(qss) + rss) + abs(o[2, 2]) * rss
    ept = (sst + stt) * gt + abs(o[4, 2]) * eqt + (ass + ast) * (abs(qtt) + rtt) + abs(o[1, 2]) * rtt \
        + (stt + ttt) * gs + abs(o[5, 2]) * eqs + (ast + att) * (abs(qst) + rst) + abs(o[2, 2]) * rst
    det = abs(qs * pt - qt * ps)
    loss = abs(qs) * ept + abs(pt) * eqs + eqs * ept + abs(qt) * eps + abs(ps) * eqt + eqt * eps
    return 1 if det > loss else 0
