"""Sub-patches small enough to be answered by one local search, with the bounds that make the answer complete.

A sub-patch is a box of a patch's (s, t); on it sigma, tau run over [-1, 1].  Its Bernstein coefficients (the
control hull) bound position and plane; their differences bound the derivatives:

    reach of S_s, S_t, S_ss, S_st, S_tt, S_sss, S_sst, S_stt, S_ttt     (norms, in mm per sigma, tau)

Rational patches go through the quotient rule on norms.  The surface's normal S_s x S_t leaves the one in the
middle by no more than the product rule allows: that gives the cone of normals.
"""

import math

import numpy as np

from cuspline.surfaces.patches import DS, DSS, DST, DT, DTT, POINT, U_HIGH, U_LOW, V_HIGH, V_LOW
from cuspline.surfaces.trims import BINS, FIRST_BIN, IS_WHOLE, STRIPS_FROM, STRIPS_PER_V, U0, U1, V0, V1, is_inside
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import X_HIGH, X_LOW, Y_HIGH, Y_LOW, W, X, Y, Z, put

TURN_RAD = 0.08             # cone half-angle below which a sub-patch is left whole
SMALLEST_MM = 0.1             # sub-patches are halved down to this at the most, at poles and on edges that are as sharp
MOST_HALVINGS = 40
UPWARD = 1e-9               # nz below which a face cannot be touched from above
PLANAR_MM = 1e-9            # a sub-patch this close to its parametrisation's plane is one
HULL_MM = 1e-9              # outward rounding of hulls
EVERYWHERE = (-math.inf, math.inf, -math.inf, math.inf)     # low x, high x, low y, high y
OUTSIDE, INSIDE, BORDER = 0, 1, 2
FACE, EDGE = 0, 1
DSSS, DSST, DSTT, DTTT = range(6, 10)       # rows of reaches, behind those of `patches.derive`
IN_PLAN, IN_Z, IN_W = range(3)              # their columns: norm in xy, |z|, |w|
NX_LOW, NX_HIGH, NY_LOW, NY_HIGH, HX_LOW, HX_HIGH, HY_LOW, HY_HIGH = range(8)       # of `cone_box`


def conversions(degree):
    """(degree + 1, degree + 1): power form on [-1, 1] to Bernstein form."""
    n = degree
    # s = 2 q - 1;  q^k = sum over i >= k of C(i, k)/C(n, k) B_i
    to_q = np.array([[math.comb(j, k) * 2 ** k * (-1) ** (j - k) if k <= j else 0.0
                      for j in range(n + 1)] for k in range(n + 1)])
    to_b = np.array([[math.comb(i, k) / math.comb(n, k) if i >= k else 0.0 for k in range(n + 1)]
                     for i in range(n + 1)])
    return fixed.matmul(to_b, to_q)


@njit
def is_beside(hull, within):
    """Whether no point of a hull (i, j, 3) stands over a box (low x, high x, low y, high y)."""
    x, y = hull[:, :, X], hull[:, :, Y]
    return x.max() < within[X_LOW] or x.min() > within[X_HIGH] or y.max() < within[Y_LOW] or y.min() > within[Y_HIGH]


@njit
def box_state(trims, face, ul, uh, vl, vh):
    """OUTSIDE, INSIDE or BORDER: what a parameter box is to the trim; chords count with a hair around them."""
    chords, bins, items, faces, strip = trims
    if faces[face, IS_WHOLE] == 1:
        return INSIDE
    count = faces[face, BINS]
    if count == 0:
        return INSIDE
    hair_u, hair_v = 1e-6 * (uh - ul), 1e-6 * (vh - vl)
    ul, uh, vl, vh = ul - hair_u, uh + hair_u, vl - hair_v, vh + hair_v
    low = int(math.floor((vl - strip[face, STRIPS_FROM]) * strip[face, STRIPS_PER_V]))
    high = int(math.floor((vh - strip[face, STRIPS_FROM]) * strip[face, STRIPS_PER_V]))
    if low <= count and high >= 0:
        first = faces[face, FIRST_BIN]
        for b in range(first + min(max(low, 0), count - 1), first + min(max(high, 0), count - 1) + 1):
            for k in range(bins[b], bins[b + 1]):
                c = chords[items[k]]
                if _chord_meets(c[U0], c[V0], c[U1], c[V1], ul, uh, vl, vh):
                    return BORDER
    return INSIDE if is_inside(trims, face, 0.5 * (ul + uh), 0.5 * (vl + vh)) else OUTSIDE


@njit
def part_state(trims, face, span, s, hs, t, ht):
    """`box_state` of a box of a patch over its `span`: middle s, t and half sides hs, ht in local parameters."""
    u0, v0 = 0.5 * (span[U_LOW] + span[U_HIGH]), 0.5 * (span[V_LOW] + span[V_HIGH])
    hu, hv = 0.5 * (span[U_HIGH] - span[U_LOW]), 0.5 * (span[V_HIGH] - span[V_LOW])
    return box_state(trims, face, u0 + hu * (s - hs), u0 + hu * (s + hs), v0 + hv * (t - ht), v0 + hv * (t + ht))


@njit
def _chord_meets(u0, v0, u1, v1, ul, uh, vl, vh):
    """Does a chord meet a box: its box does, and the box's corners are not all on one side of it."""
    if max(u0, u1) < ul or min(u0, u1) > uh or max(v0, v1) < vl or min(v0, v1) > vh:
        return False
    du, dv = u1 - u0, v1 - v0
    m = du * (0.5 * (vl + vh) - v0) - dv * (0.5 * (ul + uh) - u0)
    return abs(m) <= abs(du) * 0.5 * (vh - vl) + abs(dv) * 0.5 * (uh - ul)


@njit(error_model="numpy")
def bernstein(coefficients, offset, du, dv, cs, hs, ct, ht, mu, mv, out):
    """Homogeneous Bernstein coefficients of a box of a patch into out (du + 1, dv + 1, 4)."""
    work = np.empty((du + 1, dv + 1, 4))
    for i in range(du + 1):
        for j in range(dv + 1):
            for k in range(4):
                work[i, j, k] = coefficients[offset + (i * (dv + 1) + j) * 4 + k]
    for j in range(dv + 1):                     # Taylor shift to the box's middle, scaled to [-1, 1]
        for k in range(4):
            for a in range(du):
                for i in range(du - 1, a - 1, -1):
                    work[i, j, k] += cs * work[i + 1, j, k]
            p = 1.0
            for i in range(du + 1):
                work[i, j, k] *= p
                p *= hs
    for i in range(du + 1):
        for k in range(4):
            for a in range(dv):
                for j in range(dv - 1, a - 1, -1):
                    work[i, j, k] += ct * work[i, j + 1, k]
            p = 1.0
            for j in range(dv + 1):
                work[i, j, k] *= p
                p *= ht
    half = np.zeros((du + 1, dv + 1, 4))
    for i in range(du + 1):
        for a in range(du + 1):
            for j in range(dv + 1):
                for k in range(4):
                    half[i, j, k] += mu[i, a] * work[a, j, k]
    out[:] = 0.0
    for j in range(dv + 1):
        for a in range(dv + 1):
            for i in range(du + 1):
                for k in range(4):
                    out[i, j, k] += mv[j, a] * half[i, a, k]


@njit(error_model="numpy")
def _reach(b, ds, dt, out):
    """Largest (xy norm, |z|, |w|) of the (ds, dt) derivative's Bernstein coefficients into out (3,)."""
    nu, nv = len(b), b.shape[1]
    out[:] = 0.0
    if nu <= ds or nv <= dt:
        return
    d = b.copy()
    factor = 1.0
    for a in range(ds):
        factor *= 0.5 * (nu - 1 - a)
        for i in range(nu - 1 - a):
            for j in range(nv):
                for k in range(4):
                    d[i, j, k] = d[i + 1, j, k] - d[i, j, k]
    for a in range(dt):
        factor *= 0.5 * (nv - 1 - a)
        for j in range(nv - 1 - a):
            for i in range(nu - ds):
                for k in range(4):
                    d[i, j, k] = d[i, j + 1, k] - d[i, j, k]
    for i in range(nu - ds):
        for j in range(nv - dt):
            out[IN_PLAN] = max(out[IN_PLAN], math.hypot(d[i, j, X], d[i, j, Y]))
            out[IN_Z] = max(out[IN_Z], abs(d[i, j, Z]))
            out[IN_W] = max(out[IN_W], abs(d[i, j, W]))
    for k in range(len(out)):
        out[k] *= factor


@njit(error_model="numpy")
def derivative_reaches(b, derivatives, is_rational, out):
    """Bounds of the derivatives of S over the box into out (10, 2): xy norm and |z| of
    S - middle, S_s, S_t, S_ss, S_st, S_tt, S_sss, S_sst, S_stt, S_ttt; `derivatives` (6, 3) are those in the middle,
    per sigma, tau."""
    local = b.copy()
    low = np.inf
    out[POINT] = 0.0
    for i in range(len(b)):
        for j in range(b.shape[1]):
            w = b[i, j, W]
            low = min(low, w)
            for k in range(3):
                local[i, j, k] -= derivatives[POINT, k] * w
            out[POINT, IN_PLAN] = max(out[POINT, IN_PLAN], math.hypot(local[i, j, X], local[i, j, Y]) / w)
            out[POINT, IN_Z] = max(out[POINT, IN_Z], abs(local[i, j, Z]) / w)
    r = np.empty((10, 3))
    orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
    for n in range(1, 10):
        _reach(local, orders[n][0], orders[n][1], r[n])
    if not is_rational:
        for n in range(1, 10):
            put(out[n], r[n, :2])
        _tighten(derivatives, out)
        return
    w = r[:, IN_W]
    for k in range(2):
        o, n = out[:, k], r[:, k]
        o[DS] = (n[DS] + w[DS] * o[POINT]) / low
        o[DT] = (n[DT] + w[DT] * o[POINT]) / low
        o[DSS] = (n[DSS] + 2 * w[DS] * o[DS] + w[DSS] * o[POINT]) / low
        o[DST] = (n[DST] + w[DS] * o[DT] + w[DT] * o[DS] + w[DST] * o[POINT]) / low
        o[DTT] = (n[DTT] + 2 * w[DT] * o[DT] + w[DTT] * o[POINT]) / low
    for _ in range(2):                          # once with the crude ones, once with the tightened
        for k in range(2):
            o, n = out[:, k], r[:, k]
            o[DSSS] = (n[DSSS] + 3 * w[DS] * o[DSS] + 3 * w[DSS] * o[DS] + w[DSSS] * o[POINT]) / low
            o[DSST] = (n[DSST] + 2 * w[DS] * o[DST] + w[DT] * o[DSS] + 2 * w[DST] * o[DS] + w[DSS] * o[DT]
                       + w[DSST] * o[POINT]) / low
            o[DSTT] = (n[DSTT] + 2 * w[DT] * o[DST] + w[DS] * o[DTT] + 2 * w[DST] * o[DT] + w[DTT] * o[DS]
                       + w[DSTT] * o[POINT]) / low
            o[DTTT] = (n[DTTT] + 3 * w[DT] * o[DTT] + 3 * w[DTT] * o[DT] + w[DTTT] * o[POINT]) / low
        _tighten(derivatives, out)


@njit(error_model="numpy")
def _tighten(derivatives, out):
    """No derivative leaves its value in the middle by more than the next ones' reaches."""
    for k in range(2):
        for n, first, second in ((DSS, DSSS, DSST), (DST, DSST, DSTT), (DTT, DSTT, DTTT), (DS, DSS, DST),
                                 (DT, DST, DTT)):
            if k == 0:
                size = math.hypot(derivatives[n, X], derivatives[n, Y])
            else:
                size = abs(derivatives[n, Z])
            out[n, k] = min(out[n, k], size + out[first, k] + out[second, k])
        out[POINT, k] = min(out[POINT, k], out[DS, k] + out[DT, k])


@njit(error_model="numpy")
def normal_change(r):
    """How far S_s x S_t leaves its value in the middle of the box: (whole, z component) from (10, 2) reaches."""
    s, t, ss, st, tt = (fixed.hypot(r[DS, IN_PLAN], r[DS, IN_Z]), fixed.hypot(r[DT, IN_PLAN], r[DT, IN_Z]),
                        fixed.hypot(r[DSS, IN_PLAN], r[DSS, IN_Z]), fixed.hypot(r[DST, IN_PLAN], r[DST, IN_Z]),
                        fixed.hypot(r[DTT, IN_PLAN], r[DTT, IN_Z]))
    whole = ss * t + s * st + st * t + s * tt
    return (whole, r[DSS, IN_PLAN] * r[DT, IN_PLAN] + r[DS, IN_PLAN] * r[DST, IN_PLAN]
            + r[DST, IN_PLAN] * r[DT, IN_PLAN] + r[DS, IN_PLAN] * r[DTT, IN_PLAN])


@njit(error_model="numpy", inline="always")
def cone_box(nx, ny, nz, sine, up, out):
    """Ranges over a cone of unit normals (axis n, sine of the half-angle) into out (8,): nx low, high, ny low,
    high, and the same of the unit horizontal direction.  `up`: the largest nz; nothing is known if sine >= 1."""
    out[NX_LOW] = out[NY_LOW] = out[HX_LOW] = out[HY_LOW] = -1.0
    out[NX_HIGH] = out[NY_HIGH] = out[HX_HIGH] = out[HY_HIGH] = 1.0
    if sine >= 1.0:
        return
    cosine = math.sqrt(1.0 - sine * sine)
    hair = 1e-12
    for k in range(2):
        n = nx if k == 0 else ny
        side = math.sqrt(max(1.0 - n * n, 0.0)) * sine
        out[2 * k] = -1.0 if n < -cosine else max(n * cosine - side, -1.0) - hair
        out[2 * k + 1] = 1.0 if n > cosine else min(n * cosine + side, 1.0) + hair
    h = math.hypot(nx, ny)
    if h <= sine * 1.000001 + 1e-12:            # the cone holds the vertical: any direction
        return
    sine_h = sine / h                           # half-angle of the horizontal fan
    cosine_h = math.sqrt(max(1.0 - sine_h * sine_h, 0.0))
    for k in range(2):
        n = (nx if k == 0 else ny) / h
        side = math.sqrt(max(1.0 - n * n, 0.0)) * sine_h
        out[HX_LOW + 2 * k] = -1.0 if n < -cosine_h else max(n * cosine_h - side, -1.0) - hair
        out[HX_HIGH + 2 * k] = 1.0 if n > cosine_h else min(n * cosine_h + side, 1.0) + hair
