"""Where a round-edged cutter (corner radius rc > 0: ball, bull nose) rests on one sub-patch or edge piece.

The cutter with its tip at height h is everything within rc of the disk of radius a = R - rc at height h + rc
and of the column above it.  With e = max(d - a, 0), q = min(z - h - rc, 0) the squared distance 2 F = q² + e²
is convex in space; its Hessian along a surface S(sigma, tau) is

    H_ij = m . S_ij + [q < 0] z_i z_j + w S_i . S_j + (1 - w) [d > a] d_i d_j        (dots in xy)
    m = (e D/d, q),  D = S_xy - axis,  w = max(1 - a/d, 0)

Where H is positive over a box for every tip height that a contact there could have, {F <= rc²/2} is convex for
each of them: at most one contact, and the local search finds it.  Boxes without that proof are halved.
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
    REACH_Z,
)
from cuspline.toolpaths.drop.drop_kernels import (
    LEAN_X,
    LEAN_Y,
    PLANE_A,
    PLANE_B,
    PLANE_C,
    TOP,
    UPHILL_X,
    UPHILL_Y,
    bottom,
    rise,
    tangent_of_bottom,
)
from cuspline.values.compiled import njit
from cuspline.values.rows import X_HIGH, X_LOW, Y_HIGH, Y_LOW, X, Y, Z

KEEP = 0.7          # share of d_i d_j kept when the direction to the axis turns within a box (Young's inequality)
STEPS = 24
CONVERGED_MM = 1e-11


@njit(inline="always", error_model="numpy")
def on_rim(a, b, xl, xh, yl, yh, R):
    """Upper bound of a x + b y over a rectangle within the disk of radius R: the disk by Lagrange's multiplier."""
    m = max(0.5 * (a * (xl + xh) + b * (yl + yh)), 0.0) / (R * R)
    if m == 0.0:
        return max(a * xl, a * xh) + max(b * yl, b * yh)
    x, y = min(max(a / m, xl), xh), min(max(b / m, yl), yh)
    return a * x + b * y - 0.5 * m * (x * x + y * y - R * R)


@njit(error_model="numpy")
def node_bound(nodes, k, x, y, R, rc):
    """Upper bound of the tip height that anything in node k can ask for."""
    xl, xh, yl, yh = nodes[k, X_LOW] - x, nodes[k, X_HIGH] - x, nodes[k, Y_LOW] - y, nodes[k, Y_HIGH] - y
    dx, dy = max(xl, -xh, 0.0), max(yl, -yh, 0.0)
    near2 = dx * dx + dy * dy
    if near2 > R * R:
        return -np.inf
    a, b = nodes[k, PLANE_A], nodes[k, PLANE_B]
    px = (R - rc) * nodes[k, UPHILL_X] + rc * nodes[k, LEAN_X]
    py = (R - rc) * nodes[k, UPHILL_Y] + rc * nodes[k, LEAN_Y]
    px, py, p, steep = tangent_of_bottom(min(max(px, xl), xh), min(max(py, yl), yh), R, rc, 0.96)
    m = 1.0 / R if rc == R else 0.0     # a ball bends by that or more everywhere
    bound = nodes[k, PLANE_C] + a * (x + px) + b * (y + py) - p
    bound += rise(a - steep * px, xl - px, xh - px, m) + rise(b - steep * py, yl - py, yh - py, m)
    if rc < R:                          # the plane alone: highest over the whole cutter
        g = a * nodes[k, UPHILL_X] + b * nodes[k, UPHILL_Y]
        level = nodes[k, PLANE_C] + a * x + b * y
        bound = min(bound, level + (R - rc) * g + rc * (math.sqrt(1.0 + g * g) - 1.0))
        if rc == 0.0:
            bound = min(bound, level + on_rim(a, b, xl, xh, yl, yh, R))
    top = nodes[k, TOP]
    if top < bound:
        top -= bottom(math.sqrt(near2), R, rc)
    return min(bound, top)


@njit(error_model="numpy")
def climb(coefficients, patch, s, t, sl, sh, tl, th, x, y, R, rc, guess, o, w):
    """Highest z - p(d) near (s, t) within a box of a patch, by Newton's method on the distance to the cutter.

    Args:
        guess: tip height at which the cutter stands while the point is not yet below it.
        o: (6, 3) scratch.  w: (4,): s, t of the best point, 1 if it is a maximum within the box, 2 if no border
            of the box holds it there.
    Returns:
        the tip height that the point asks for; -inf if none was found below the cutter.
    """
    c = R - rc
    offset, du, dv, rational = patch[OFFSET], patch[DEGREE_U], patch[DEGREE_V], patch[IS_RATIONAL] != 0
    best, bs, bt = -np.inf, s, t
    step_s = step_t = 0.0
    done, kind = 0.0, 1.0
    for _ in range(STEPS):
        derive(coefficients, offset, du, dv, rational, s, t, o)
        dx, dy = o[POINT, X] - x, o[POINT, Y] - y
        d = math.sqrt(dx * dx + dy * dy)
        e = max(d - c, 0.0)
        if d <= R:
            tip = o[POINT, Z] - (rc - math.sqrt(max(rc * rc - e * e, 0.0)))
        else:
            tip = -np.inf
        if best > -np.inf and tip < best:
            if abs(step_s) + abs(step_t) < 1e-15 or (best - tip < CONVERGED_MM):
                done = kind if best - tip < CONVERGED_MM else 0.0
                break
            step_s, step_t = 0.4 * step_s, 0.4 * step_t
            s, t = bs + step_s, bt + step_t
            continue
        best, bs, bt = max(best, tip), s, t
        level = tip if tip > -np.inf else guess
        q = min(o[POINT, Z] - level - rc, 0.0)
        wz = 1.0 if q < 0.0 else 0.0
        share, inverse = (e / d, 1.0 / d) if e > 0.0 and d > 0.0 else ((1.0, 0.0) if c == 0.0 else (0.0, 0.0))
        mx, my = share * dx, share * dy
        gs = mx * o[DS, X] + my * o[DS, Y] + q * o[DS, Z]
        gt = mx * o[DT, X] + my * o[DT, Y] + q * o[DT, Z]
        radial = c * inverse * inverse * inverse    # (1 - w) / d² once divided below
        rs, rt = dx * o[DS, X] + dy * o[DS, Y], dx * o[DT, X] + dy * o[DT, Y]
        hss = mx * o[DSS, X] + my * o[DSS, Y] + q * o[DSS, Z] + wz * o[DS, Z] * o[DS, Z] \
            + share * (o[DS, X] * o[DS, X] + o[DS, Y] * o[DS, Y]) + radial * rs * rs
        free_s = not ((s <= sl and gs > 0.0) or (s >= sh and gs < 0.0))
        free_t = dv > 0 and not ((t <= tl and gt > 0.0) or (t >= th and gt < 0.0))
        kind = 2.0 if free_s and (free_t or dv == 0) else 1.0
        step_s = step_t = 0.0
        if free_s and free_t:
            hst = mx * o[DST, X] + my * o[DST, Y] + q * o[DST, Z] + wz * o[DS, Z] * o[DT, Z] \
                + share * (o[DS, X] * o[DT, X] + o[DS, Y] * o[DT, Y]) + radial * rs * rt
            htt = mx * o[DTT, X] + my * o[DTT, Y] + q * o[DTT, Z] + wz * o[DT, Z] * o[DT, Z] \
                + share * (o[DT, X] * o[DT, X] + o[DT, Y] * o[DT, Y]) + radial * rt * rt
            step_s, step_t = _descent(hss, hst, htt, gs, gt, o)
            if (s <= sl and step_s < 0.0) or (s >= sh and step_s > 0.0) \
                    or (t <= tl and step_t < 0.0) or (t >= th and step_t > 0.0):    # back inside, one by one
                step_s = -gs / max(abs(hss), 1e-3 * _square(o[DS]), 1e-300)
                step_t = -gt / max(abs(htt), 1e-3 * _square(o[DT]), 1e-300)
        elif free_s:
            step_s = -gs / max(abs(hss), 1e-3 * _square(o[DS]), 1e-300)
        elif free_t:
            htt = mx * o[DTT, X] + my * o[DTT, Y] + q * o[DTT, Z] + wz * o[DT, Z] * o[DT, Z] \
                + share * (o[DT, X] * o[DT, X] + o[DT, Y] * o[DT, Y]) + radial * rt * rt
            step_t = -gt / max(abs(htt), 1e-3 * _square(o[DT]), 1e-300)
        gain = -(gs * step_s + gt * step_t)
        if tip > -np.inf and 0.5 * gain <= CONVERGED_MM * max(-q, 1e-3 * rc):
            done = kind
            break
        s, t = min(max(bs + step_s, sl), sh), min(max(bt + step_t, tl), th)
        if s != bs + step_s or t != bt + step_t:
            kind = 1.0
        step_s, step_t = s - bs, t - bt
        if tip == -np.inf and abs(step_s) + abs(step_t) < 1e-14:
            break
    w[AT_S], w[AT_T], w[CERTAINTY] = bs, bt, done
    return best


@njit(inline="always", error_model="numpy")
def _square(v):
    return v[X] * v[X] + v[Y] * v[Y] + v[Z] * v[Z]


@njit(error_model="numpy")
def _descent(hss, hst, htt, gs, gt, o):
    """Newton's step; where the Hessian is not positive, with its eigenvalues' sizes instead (scaled by the metric)."""
    a, b = math.sqrt(max(_square(o[DS]), 1e-300)), math.sqrt(max(_square(o[DT]), 1e-300))
    hss, hst, htt, gs, gt = hss / (a * a), hst / (a * b), htt / (b * b), gs / a, gt / b
    middle = 0.5 * (hss + htt)
    spread = math.sqrt(0.25 * (hss - htt) ** 2 + hst * hst)
    low, high = middle - spread, middle + spread
    floor = 1e-6 * max(abs(low), abs(high), 1e-12)
    if low > floor:
        det = hss * htt - hst * hst
        return -(htt * gs - hst * gt) / det / a, -(hss * gt - hst * gs) / det / b
    low, high = max(abs(low), floor), max(abs(high), floor)
    ex, ey = high - htt, hst
    if hss >= htt:
        ex, ey = spread + 0.5 * (hss - htt), hst
    else:
        ex, ey = hst, spread + 0.5 * (htt - hss)
    n = math.sqrt(ex * ex + ey * ey)
    if n < 1e-300:
        return -gs / high / a, -gt / high / b
    ex, ey = ex / n, ey / n
    along, across = (ex * gs + ey * gt) / high, (-ey * gs + ex * gt) / low
    return -(ex * along - ey * across) / a, -(ey * along + ex * across) / b


@njit(error_model="numpy")
def box_proof(row, tag_kind, o, alpha, beta, x, y, R, rc, best, bound, tolerance, normal_z, sine):
    """What can be proven about a box of a leaf from the derivatives in its middle.

    Args:
        row: the leaf's row (see patch_tree); alpha, beta: half sizes of the box within the leaf.
        o: (6, 3) position and derivatives in the middle, per alpha, beta.
        best, bound: tips of interest lie between.
        normal_z, sine: of the normal in the middle, and how far it turns (sine >= 1: unknown).
    Returns:
        0: nothing; 1: at most one contact, a maximum; 2: no contact above best + tolerance.
    """
    c = R - rc
    is_face = tag_kind == 0
    ls, lt = row[REACH_S] * alpha, row[REACH_T] * beta
    ass, ast, att = row[REACH_SS] * alpha * alpha, row[REACH_ST] * alpha * beta, row[REACH_TT] * beta * beta
    bend = 0.5 * (ass + 2.0 * ast + att)
    dx, dy = o[POINT, X] - x, o[POINT, Y] - y
    d = math.sqrt(dx * dx + dy * dy)
    wide = math.sqrt(o[DS, X] ** 2 + o[DS, Y] ** 2) + math.sqrt(o[DT, X] ** 2 + o[DT, Y] ** 2) + bend
    tall = min(abs(o[DS, Z]) + abs(o[DT, Z]) + bend, row[REACH_Z] * 2.0)
    near, far = max(d - wide, 0.0), d + wide
    if d > 0.0:                                 # along the direction to the axis a box reaches less far
        near = max(d - (abs(dx * o[DS, X] + dy * o[DS, Y]) + abs(dx * o[DT, X] + dy * o[DT, Y])) / d - bend, near)
    if near > R:
        return 2
    low = max(best, o[POINT, Z] - tall - bottom(min(far, R), R, rc))
    high = min(bound, o[POINT, Z] + tall - bottom(near, R, rc))
    if is_face and sine < 1.0:
        low = max(low, o[POINT, Z] - tall - rc * (1.0 - max(normal_z - 1.01 * sine, -1.0)))
        high = min(high, o[POINT, Z] + tall - rc * (1.0 - min(normal_z + 1.01 * sine, 1.0)))
    if high <= best + tolerance or high < low:
        return 2
    half = 0.5 * (high - low)
    q = min(o[POINT, Z] - 0.5 * (low + high) - rc, 0.0)
    e = max(d - c, 0.0)
    share = e / d if d > 0.0 else 0.0
    if c == 0.0:
        share = 1.0
    mx, my = share * dx, share * dy
    reach = math.sqrt(q * q + e * e) + wide + tall + half
    moved = ls + lt + half
    wz = 1.0 if o[POINT, Z] + tall < low + rc else 0.0
    w = max(1.0 - c / near, 0.0) if near > 0.0 else (1.0 if c == 0.0 else 0.0)
    hss = mx * o[DSS, X] + my * o[DSS, Y] + q * o[DSS, Z] + wz * o[DS, Z] * o[DS, Z] \
        + w * (o[DS, X] * o[DS, X] + o[DS, Y] * o[DS, Y])
    ess = reach * (row[REACH_SSS] * alpha ** 3 + row[REACH_SST] * alpha * alpha * beta) + moved * ass \
        + 2.0 * ls * (ass + ast)
    hst = ess_t = htt = ett = 0.0
    if is_face:
        hst = mx * o[DST, X] + my * o[DST, Y] + q * o[DST, Z] + wz * o[DS, Z] * o[DT, Z] \
            + w * (o[DS, X] * o[DT, X] + o[DS, Y] * o[DT, Y])
        htt = mx * o[DTT, X] + my * o[DTT, Y] + q * o[DTT, Z] + wz * o[DT, Z] * o[DT, Z] \
            + w * (o[DT, X] * o[DT, X] + o[DT, Y] * o[DT, Y])
        ess_t = reach * (row[REACH_SST] * alpha * alpha * beta + row[REACH_STT] * alpha * beta * beta) + moved * ast \
            + lt * (ass + ast) + ls * (ast + att)
        ett = (reach * (row[REACH_STT] * alpha * beta * beta + row[REACH_TTT] * beta ** 3) + moved * att
               + 2.0 * lt * (ast + att))
    if near > c and c > 0.0:
        v = c / far                             # 1 - w at the far side
        rs, rt = (dx * o[DS, X] + dy * o[DS, Y]) / d, (dx * o[DT, X] + dy * o[DT, Y]) / d
        turn = wide / near
        qs, qt = ass + ast + turn * ls, ast + att + turn * lt
        loss = KEEP / (1.0 - KEEP)
        hss += KEEP * v * rs * rs
        ess += loss * v * qs * qs
        hst += KEEP * v * rs * rt
        ess_t += loss * v * qs * qt
        htt += KEEP * v * rt * rt
        ett += loss * v * qt * qt
    hss, htt, cross = hss - ess, htt - ett, abs(hst) + ess_t
    if is_face:
        if hss > 0.0 and htt > 0.0 and hss * htt > cross * cross:
            return 1
    elif hss > 0.0:
        return 1
    # the cutter raised by the tolerance: does it reach the box at all?
    rest = best + tolerance
    if best == -np.inf or low > rest:
        return 0
    q = min(o[POINT, Z] - rest - rc, 0.0)
    gs = -(mx * o[DS, X] + my * o[DS, Y] + q * o[DS, Z])
    gt = -(mx * o[DT, X] + my * o[DT, Y] + q * o[DT, Z])
    extra = max(rest - low, high - rest, 0.0)
    hss, htt = hss - cross - extra * (ass + ast), htt - cross - extra * (att + ast)
    inside = 0.5 * (rc * rc - q * q - e * e) + _parabola(gs, hss) + (_parabola(gt, htt) if is_face else 0.0)
    return 2 if inside <= 0.0 else 0


@njit(inline="always", error_model="numpy")
def _parabola(g, h):
    """Largest g s - h s²/2 for |s| <= 1."""
    g = abs(g)
    if h > g:
        return 0.5 * g * g / h
    return g - 0.5 * h
