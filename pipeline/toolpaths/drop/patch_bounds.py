"""Sub-patches small enough to be answered by one local search, with the bounds that make the answer complete.

A sub-patch is a box of a patch's (s, t); on it sigma, tau run over [-1, 1].  Its Bernstein coefficients (the
control hull) bound position and plane; their differences bound the derivatives:

    reach of S_s, S_t, S_ss, S_st, S_tt, S_sss, S_sst, S_stt, S_ttt     (norms, in mm per sigma, tau)

Rational patches go through the quotient rule on norms.  The surface's normal S_s x S_t leaves the one in the
middle by no more than the product rule allows: that gives the cone of normals.
"""

import math

import numpy as np

from cuspline.surfaces.trims import is_inside
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import put

TURN_RAD = 0.08             # cone half-angle below which a sub-patch is left whole
SMALLEST_MM = 0.02          # sub-patches without a normal (poles) are halved down to this
MOST_HALVINGS = 40
UPWARD = 1e-9               # nz below which a face cannot be touched from above
PLANAR_MM = 1e-9            # a sub-patch this close to its parametrisation's plane is one
HULL_MM = 1e-9              # outward rounding of hulls
OUTSIDE, INSIDE, BORDER = 0, 1, 2
FACE, EDGE = 0, 1


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
def box_state(trims, face, ul, uh, vl, vh):
    """OUTSIDE, INSIDE or BORDER: what a parameter box is to the trim; chords count with a hair around them."""
    chords, bins, items, faces, strip = trims
    if faces[face, 2] == 1:
        return INSIDE
    count = faces[face, 1]
    if count == 0:
        return INSIDE
    hair_u, hair_v = 1e-6 * (uh - ul), 1e-6 * (vh - vl)
    ul, uh, vl, vh = ul - hair_u, uh + hair_u, vl - hair_v, vh + hair_v
    low = int(math.floor((vl - strip[face, 0]) * strip[face, 1]))
    high = int(math.floor((vh - strip[face, 0]) * strip[face, 1]))
    if low <= count and high >= 0:
        first = faces[face, 0]
        for b in range(first + min(max(low, 0), count - 1), first + min(max(high, 0), count - 1) + 1):
            for k in range(bins[b], bins[b + 1]):
                c = chords[items[k]]
                if _chord_meets(c[0], c[1], c[2], c[3], ul, uh, vl, vh):
                    return BORDER
    return INSIDE if is_inside(trims, face, 0.5 * (ul + uh), 0.5 * (vl + vh)) else OUTSIDE


@njit
def part_state(trims, face, span, s, hs, t, ht):
    """`box_state` of a box of a patch over its `span`: middle s, t and half sides hs, ht in local parameters."""
    u0, v0 = 0.5 * (span[0] + span[1]), 0.5 * (span[2] + span[3])
    hu, hv = 0.5 * (span[1] - span[0]), 0.5 * (span[3] - span[2])
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
    nu, nv = b.shape[0], b.shape[1]
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
            out[0] = max(out[0], math.hypot(d[i, j, 0], d[i, j, 1]))
            out[1] = max(out[1], abs(d[i, j, 2]))
            out[2] = max(out[2], abs(d[i, j, 3]))
    for k in range(3):
        out[k] *= factor


@njit(error_model="numpy")
def derivative_reaches(b, derivatives, is_rational, out):
    """Bounds of the derivatives of S over the box into out (10, 2): xy norm and |z| of
    S - middle, S_s, S_t, S_ss, S_st, S_tt, S_sss, S_sst, S_stt, S_ttt; `derivatives` (6, 3) are those in the middle,
    per sigma, tau."""
    local = b.copy()
    low = np.inf
    out[0] = 0.0
    for i in range(b.shape[0]):
        for j in range(b.shape[1]):
            w = b[i, j, 3]
            low = min(low, w)
            for k in range(3):
                local[i, j, k] -= derivatives[0, k] * w
            out[0, 0] = max(out[0, 0], math.hypot(local[i, j, 0], local[i, j, 1]) / w)
            out[0, 1] = max(out[0, 1], abs(local[i, j, 2]) / w)
    r = np.empty((10, 3))
    orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
    for n in range(1, 10):
        _reach(local, orders[n][0], orders[n][1], r[n])
    if not is_rational:
        for n in range(1, 10):
            put(out[n], r[n, :2])
        _tighten(derivatives, out)
        return
    w = r[:, 2]
    for k in range(2):
        o, n = out[:, k], r[:, k]
        o[1] = (n[1] + w[1] * o[0]) / low
        o[2] = (n[2] + w[2] * o[0]) / low
        o[3] = (n[3] + 2 * w[1] * o[1] + w[3] * o[0]) / low
        o[4] = (n[4] + w[1] * o[2] + w[2] * o[1] + w[4] * o[0]) / low
        o[5] = (n[5] + 2 * w[2] * o[2] + w[5] * o[0]) / low
    for _ in range(2):                          # once with the crude ones, once with the tightened
        for k in range(2):
            o, n = out[:, k], r[:, k]
            o[6] = (n[6] + 3 * w[1] * o[3] + 3 * w[3] * o[1] + w[6] * o[0]) / low
            o[7] = (n[7] + 2 * w[1] * o[4] + w[2] * o[3] + 2 * w[4] * o[1] + w[3] * o[2] + w[7] * o[0]) / low
            o[8] = (n[8] + 2 * w[2] * o[4] + w[1] * o[5] + 2 * w[4] * o[2] + w[5] * o[1] + w[8] * o[0]) / low
            o[9] = (n[9] + 3 * w[2] * o[5] + 3 * w[5] * o[2] + w[9] * o[0]) / low
        _tighten(derivatives, out)


@njit(error_model="numpy")
def _tighten(derivatives, out):
    """No derivative leaves its value in the middle by more than the next ones' reaches."""
    for k in range(2):
        for n, first, second in ((3, 6, 7), (4, 7, 8), (5, 8, 9), (1, 3, 4), (2, 4, 5)):
            if k == 0:
                size = math.hypot(derivatives[n, 0], derivatives[n, 1])
            else:
                size = abs(derivatives[n, 2])
            out[n, k] = min(out[n, k], size + out[first, k] + out[second, k])
        out[0, k] = min(out[0, k], out[1, k] + out[2, k])


@njit(error_model="numpy")
def normal_change(r):
    """How far S_s x S_t leaves its value in the middle of the box: (whole, z component) from (10, 2) reaches."""
    s, t, ss, st, tt = (fixed.hypot(r[1, 0], r[1, 1]), fixed.hypot(r[2, 0], r[2, 1]), fixed.hypot(r[3, 0], r[3, 1]),
                        fixed.hypot(r[4, 0], r[4, 1]), fixed.hypot(r[5, 0], r[5, 1]))
    whole = ss * t + s * st + st * t + s * tt
    return whole, r[3, 0] * r[2, 0] + r[1, 0] * r[4, 0] + r[4, 0] * r[2, 0] + r[1, 0] * r[5, 0]


@njit(error_model="numpy", inline="always")
def cone_box(nx, ny, nz, sine, up, out):
    """Ranges over a cone of unit normals (axis n, sine of the half-angle) into out (8,): nx low, high, ny low,
    high, and the same of the unit horizontal direction.  `up`: the largest nz; nothing is known if sine >= 1."""
    out[0] = out[2] = out[4] = out[6] = -1.0
    out[1] = out[3] = out[5] = out[7] = 1.0
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
        out[4 + 2 * k] = -1.0 if n < -cosine_h else max(n * cosine_h - side, -1.0) - hair
        out[5 + 2 * k] = 1.0 if n > cosine_h else min(n * cosine_h + side, 1.0) + hair
