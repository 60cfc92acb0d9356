"""Where a flat end mill (corner radius 0) rests on one sub-patch or edge piece: highest z within the disk d <= R.

On a face the highest point is either a summit (level tangent plane) inside the disk, or on the rim, where with
Q = (d² - R²)/2 the gradients of z and Q are parallel: Q = 0, P = z_s Q_t - z_t Q_s = 0.  On an edge it is a
summit, an end, or a crossing of the rim.  Proofs: z concave; (Q, P) one-to-one because every matrix made of
rows within the ranges of their gradients is regular; along an edge z and Q monotone.
"""

import math

import numpy as np

from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, DS, DSS, DST, DT, DTT, IS_RATIONAL, OFFSET, POINT, derive
from cuspline.toolpaths.contact.leaf_rows import (
    AT_S,
    AT_T,
    CERTAINTY,
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
from cuspline.values.rows import FROM, TO, X, Y, Z

STEPS = 30
RIM_MM = 1e-9           # a point this far outside the disk counts as under it: the safe side


@njit(error_model="numpy")
def climb_flat(coefficients, patch, s, t, sl, sh, tl, th, x, y, R, o, w):
    """Highest point found under the disk from (s, t) within a box of a patch.

    Returns:
        its z, -inf if none; w (4,) holds s, t and 2 if the search on a face came to a maximum, 1 on an edge.
    """
    if patch[DEGREE_V] == 0:
        return _climb_edge(coefficients, patch, sl, sh, x, y, R, o, w)
    found = _to_rim(coefficients, patch, s, t, sl, sh, tl, th, x, y, R, o, w)
    if not found:
        found = _to_summit(coefficients, patch, s, t, sl, sh, tl, th, o, w)
    w[CERTAINTY] = 0.0
    if not found or (o[POINT, X] - x) ** 2 + (o[POINT, Y] - y) ** 2 > (R + RIM_MM) ** 2:
        return -np.inf
    w[CERTAINTY] = 2.0
    return o[POINT, Z]


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
        derive(coefficients, patch[OFFSET], patch[DEGREE_U], patch[DEGREE_V], patch[IS_RATIONAL] != 0, s, t, o)
        dx, dy = o[POINT, X] - x, o[POINT, Y] - y
        q = 0.5 * (dx * dx + dy * dy - R * R)
        qs, qt = dx * o[DS, X] + dy * o[DS, Y], dx * o[DT, X] + dy * o[DT, Y]
        qss = o[DS, X] ** 2 + o[DS, Y] ** 2 + dx * o[DSS, X] + dy * o[DSS, Y]
        qst = o[DS, X] * o[DT, X] + o[DS, Y] * o[DT, Y] + dx * o[DST, X] + dy * o[DST, Y]
        qtt = o[DT, X] ** 2 + o[DT, Y] ** 2 + dx * o[DTT, X] + dy * o[DTT, Y]
        p = o[DS, Z] * qt - o[DT, Z] * qs
        ps = o[DSS, Z] * qt + o[DS, Z] * qst - o[DST, Z] * qs - o[DT, Z] * qss
        pt = o[DST, Z] * qt + o[DS, Z] * qtt - o[DTT, Z] * qs - o[DT, Z] * qst
        det = qs * pt - qt * ps
        if not abs(det) > 1e-300:
            return False
        ns, nt = s - (pt * q - qt * p) / det, t - (qs * p - ps * q) / det
        clamped = _is_outside(ns, nt, sl, sh, tl, th)
        ns, nt = min(max(ns, sl), sh), min(max(nt, tl), th)
        moved = abs(ns - s) * math.sqrt(o[DS, X] ** 2 + o[DS, Y] ** 2 + o[DS, Z] ** 2) \
            + abs(nt - t) * math.sqrt(o[DT, X] ** 2 + o[DT, Y] ** 2 + o[DT, Z] ** 2)
        if moved < 1e-12:
            w[AT_S], w[AT_T] = s, t
            return not clamped and abs(q) < 2.0 * RIM_MM * R and qs * o[DS, Z] + qt * o[DT, Z] >= 0.0
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
        derive(coefficients, patch[OFFSET], patch[DEGREE_U], patch[DEGREE_V], patch[IS_RATIONAL] != 0, s, t, o)
        det = o[DSS, Z] * o[DTT, Z] - o[DST, Z] * o[DST, Z]
        if not (det > 0.0 and o[DSS, Z] < 0.0):
            return False
        ns = s - (o[DTT, Z] * o[DS, Z] - o[DST, Z] * o[DT, Z]) / det
        nt = t - (o[DSS, Z] * o[DT, Z] - o[DST, Z] * o[DS, Z]) / det
        clamped = _is_outside(ns, nt, sl, sh, tl, th)
        ns, nt = min(max(ns, sl), sh), min(max(nt, tl), th)
        moved = abs(ns - s) * (abs(o[DS, X]) + abs(o[DS, Y])) + abs(nt - t) * (abs(o[DT, X]) + abs(o[DT, Y]))
        if moved < 1e-10:
            w[AT_S], w[AT_T] = s, t
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
    if (values[FROM] > R) != (values[TO] > R):          # crossing of the rim: Newton kept in a bracket
        inside, outside = (sl, sh) if values[FROM] <= R else (sh, sl)
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
            rate = ((o[POINT, X] - x) * o[DS, X] + (o[POINT, Y] - y) * o[DS, Y]) / max(d, 1e-300)
            n = s - (d - R) / rate if rate != 0.0 else np.inf
            if not (min(inside, outside) < n < max(inside, outside)):
                n = 0.5 * (inside + outside)
            s = n
    s = 0.5 * (sl + sh)
    for _ in range(STEPS):                          # summit
        z, d = _edge_at(coefficients, patch, s, x, y, o)
        if d <= R + RIM_MM and z > best:
            best, bs = z, s
        if not o[DSS, Z] < 0.0:
            break
        n = min(max(s - o[DS, Z] / o[DSS, Z], sl), sh)
        if abs(n - s) < 1e-14:
            break
        s = n
    w[AT_S], w[AT_T], w[CERTAINTY] = bs, 0.0, 1.0
    return best


@njit(error_model="numpy", inline="always")
def _edge_at(coefficients, patch, s, x, y, o):
    """z and distance to the axis; derivatives stay in o."""
    derive(coefficients, patch[OFFSET], patch[DEGREE_U], patch[DEGREE_V], patch[IS_RATIONAL] != 0, s, 0.0, o)
    return o[POINT, Z], math.sqrt((o[POINT, X] - x) ** 2 + (o[POINT, Y] - y) ** 2)


@njit(error_model="numpy")
def flat_proof(row, kind, o, alpha, beta, x, y, R, normal_z, sine):
    """As `patch_contacts.box_proof` for a flat end mill: 0 nothing, 1 at most one contact, 2 none."""
    ls, lt = row[REACH_S] * alpha, row[REACH_T] * beta
    ass, ast, att = row[REACH_SS] * alpha * alpha, row[REACH_ST] * alpha * beta, row[REACH_TT] * beta * beta
    sss, sst = row[REACH_SSS] * alpha ** 3, row[REACH_SST] * alpha * alpha * beta
    stt, ttt = row[REACH_STT] * alpha * beta * beta, row[REACH_TTT] * beta ** 3
    dx, dy = o[POINT, X] - x, o[POINT, Y] - y
    d = math.sqrt(dx * dx + dy * dy)
    bend = 0.5 * (ass + 2.0 * ast + att)
    reach = d + math.sqrt(o[DS, X] ** 2 + o[DS, Y] ** 2) + math.sqrt(o[DT, X] ** 2 + o[DT, Y] ** 2) + bend
    qs, qt = dx * o[DS, X] + dy * o[DS, Y], dx * o[DT, X] + dy * o[DT, Y]
    qss = o[DS, X] ** 2 + o[DS, Y] ** 2 + dx * o[DSS, X] + dy * o[DSS, Y]
    qst = o[DS, X] * o[DT, X] + o[DS, Y] * o[DT, Y] + dx * o[DST, X] + dy * o[DST, Y]
    qtt = o[DT, X] ** 2 + o[DT, Y] ** 2 + dx * o[DTT, X] + dy * o[DTT, Y]
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
        falls = abs(o[DS, Z]) > ass or o[DSS, Z] + sss < 0.0
        return 1 if falls and (q_high <= 0.0 or abs(qs) > eqs) else 0
    summit = not (sine < 1.0 and math.sqrt(max(1.0 - normal_z * normal_z, 0.0)) > 1.01 * sine)
    if summit and (o[DSS, Z] - sss - sst > 0.0 or o[DTT, Z] - stt - ttt > 0.0):
        summit = False                              # z curves upward: no maximum inside
    rim = q_high >= -RIM_MM * R
    if not rim and not summit:
        return 2
    if not rim:
        a, b, c = -o[DSS, Z] - sss - sst, -o[DTT, Z] - stt - ttt, abs(o[DST, Z]) + sst + stt
        return 1 if a > 0.0 and b > 0.0 and a * b > c * c else 0
    if summit:
        return 0
    ps = o[DSS, Z] * qt + o[DS, Z] * qst - o[DST, Z] * qs - o[DT, Z] * qss
    pt = o[DST, Z] * qt + o[DS, Z] * qtt - o[DTT, Z] * qs - o[DT, Z] * qst
    eqt = abs(qst) + abs(qtt) + xsst + 2.0 * xstt + xttt
    gs, gt = abs(qs) + eqs, abs(qt) + eqt
    # every factor of ps, pt at its largest, times how far the other leaves its middle
    rss, rst, rtt = xsss + xsst, xsst + xstt, xstt + xttt
    eps = (sss + sst) * gt + abs(o[DSS, Z]) * eqt + (ass + ast) * (abs(qst) + rst) + abs(o[DS, Z]) * rst \
        + (sst + stt) * gs + abs(o[DST, Z]) * eqs + (ast + att) * (abs(qss) + rss) + abs(o[DT, Z]) * rss
    ept = (sst + stt) * gt + abs(o[DST, Z]) * eqt + (ass + ast) * (abs(qtt) + rtt) + abs(o[DS, Z]) * rtt \
        + (stt + ttt) * gs + abs(o[DTT, Z]) * eqs + (ast + att) * (abs(qst) + rst) + abs(o[DT, Z]) * rst
    det = abs(qs * pt - qt * ps)
    loss = abs(qs) * ept + abs(pt) * eqs + eqs * ept + abs(qt) * eps + abs(ps) * eqt + eqt * eps
    return 1 if det > loss else 0
