"""Exact height that one piece of path leaves over a point (x, y), apart from distance_kernels.

Over (x, y) the cutter's bottom stands p(d) above its tip, d the distance to its axis:

    p(d) = 0 for d <= a,   rc - sqrt(rc² - (d - a)²) for a < d <= R = a + rc,   none beyond

and the piece leaves min over its positions of z + p(d).  Lengths in mm; inf: never passed over.
"""

import math

from cuspline.stock.distance_kernels import VERTICAL_MM
from cuspline.stock.path_pieces import CENTER_U, CENTER_V, FORM, IN_YZ, LEVEL_ARC, LINE, RADIUS, SIDE, X0, X1, Y0, Y1, Z0, Z1
from cuspline.values.compiled import njit

SLACK_MM = 1e-10          # what rounding may put on a bound: taken off, but where a bound is exact (the flat of a bottom)
STEEP = 0.003             # a tangent to p is taken where no more than this share of rc² is left below the root


@njit
def bottom(d, a, rc):
    """p(d) for d <= a + rc."""
    e = d - a
    if e <= 0.0:
        return 0.0
    return rc - math.sqrt(max(rc * rc - e * e, 0.0))


@njit
def _at(x, y, cx, cy, cz, a, rc):
    """Height left by the cutter standing still."""
    d = math.sqrt((x - cx) * (x - cx) + (y - cy) * (y - cy))
    return cz + bottom(d, a, rc) if d <= a + rc else math.inf


@njit
def _bull_position(s, q, lo, hi, slope, a, rc):
    """Position u in [lo, hi] where slope * u + p(d(u)) is least, d² = q² + (u - s)²: its derivative grows."""
    u = min(max(s, lo), hi)
    for _ in range(200):
        x = u - s
        d = math.sqrt(q * q + x * x)
        e = d - a
        root = math.sqrt(max(rc * rc - e * e, 0.0))
        pull = e / root * x / d if e > 0.0 and root > 0.0 else (math.copysign(math.inf, x) if e > 0.0 else 0.0)
        g = slope + pull
        if g > 0.0:
            hi = u
        else:
            lo = u
        if hi - lo < 1e-13:
            break
        bend = 0.0
        if e > 0.0 and root > 0.0:           # derivative of the pull
            bend = rc * rc / (root * root * root) * (x / d) * (x / d) + e / root * (q * q) / (d * d * d)
        nxt = u - g / bend if bend > 0.0 and math.isfinite(g) else 0.5 * (lo + hi)
        if not lo < nxt < hi:
            nxt = 0.5 * (lo + hi)
        if abs(nxt - u) < 1e-13:
            u = nxt
            break
        u = nxt
    return u


@njit
def _line_height(x, y, g, a, rc):
    dx, dy, dz = g[X1] - g[X0], g[Y1] - g[Y0], g[Z1] - g[Z0]
    length = math.sqrt(dx * dx + dy * dy)
    if length < VERTICAL_MM:
        return _at(x, y, g[X0], g[Y0], min(g[Z0], g[Z1]), a, rc)
    s = ((x - g[X0]) * dx + (y - g[Y0]) * dy) / length
    q = ((x - g[X0]) * dy - (y - g[Y0]) * dx) / length
    radius = a + rc
    if abs(q) > radius:
        return math.inf
    w = math.sqrt(radius * radius - q * q)
    lo, hi = max(0.0, s - w), min(length, s + w)
    if lo > hi:
        return math.inf
    slope = dz / length
    if slope == 0.0:
        u = min(max(s, lo), hi)
    elif rc == 0.0:
        u = lo if slope > 0.0 else hi
    elif a == 0.0:
        u = min(max(s - slope * w / math.sqrt(1.0 + slope * slope), lo), hi)
    else:
        u = _bull_position(s, q, lo, hi, slope, a, rc)
    d = math.sqrt(q * q + (u - s) * (u - s))
    return g[Z0] + slope * u + bottom(min(d, radius), a, rc)


@njit
def _arc_height(x, y, g, r):
    """A disc of radius w rolling on the arc: the envelope circle where it touches, else the end discs."""
    k = int(g[IN_YZ])
    s, q = (x, y - g[Y0]) if k == 0 else (y, x - g[X0])
    if abs(q) > r:
        return math.inf
    w = math.sqrt(r * r - q * q)
    u0, u1, rho, ds = g[k], g[X1 + k], g[RADIUS], s - g[CENTER_U]
    best = math.inf
    if abs(s - u0) <= w:
        best = g[Z0] + r - math.sqrt(w * w - (s - u0) * (s - u0))
    if abs(s - u1) <= w:
        best = min(best, g[Z1] + r - math.sqrt(w * w - (s - u1) * (s - u1)))
    envelope = rho + w if g[SIDE] < 0.0 else rho - w
    if envelope > 0.0 and abs(ds) <= envelope and u0 <= g[CENTER_U] + ds * rho / envelope <= u1:
        best = min(best, g[CENTER_V] + r + g[SIDE] * math.sqrt(envelope * envelope - ds * ds))
    return best


@njit
def _level_arc_height(x, y, g, a, rc):
    """The cutter stands where the arc is nearest: towards its middle by no less than its ends are, or at one of these."""
    u, v, rho = x - g[CENTER_U], y - g[CENTER_V], g[RADIUS]
    mu, mv = 0.5 * (g[X0] + g[X1]) - g[CENTER_U], 0.5 * (g[Y0] + g[Y1]) - g[CENTER_V]
    far = math.sqrt(u * u + v * v)
    if far > 0.0 and (u * mu + v * mv) * rho >= (mu * mu + mv * mv) * far:
        return _at(x, y, g[CENTER_U] + u * rho / far, g[CENTER_V] + v * rho / far, g[Z0], a, rc)
    return min(_at(x, y, g[X0], g[Y0], g[Z0], a, rc), _at(x, y, g[X1], g[Y1], g[Z0], a, rc))


@njit
def piece_height(x, y, g, a, rc):
    """Lowest z of the cutter's bottom over (x, y) along one piece; inf where it never passes, mm."""
    if g[FORM] != LINE:
        if g[FORM] == LEVEL_ARC:
            return _level_arc_height(x, y, g, a, rc)
        return _arc_height(x, y, g, rc)
    return _line_height(x, y, g, a, rc)


@njit(error_model="numpy")
def child_heights(x, y, block, a, rc, out):
    """Lower bounds of `piece_height` over the eight children of a tree node: a tangent of plane + p, which is convex.

    As `distance_kernels.child_distances`: bounds in out[64:72], the block copied into out[:64].
    """
    for i in range(8):
        for j in range(8):
            out[8 * i + j] = block[i, j]
    if a == 0.0:
        _child_heights_of_ball(x, y, rc, out)
    else:
        _child_heights_of_disk(x, y, a, rc, out)


@njit(error_model="numpy")
def _child_heights_of_ball(x, y, rc, out):
    """p is convex by 1/rc at least, in x and in y."""
    for j in range(8):
        xl, xh, yl, yh = out[j] - x, out[8 + j] - x, out[16 + j] - y, out[24 + j] - y
        ex, ey = max(xl, -xh, 0.0), max(yl, -yh, 0.0)
        square = ex * ex + ey * ey
        box = out[32 + j] + (rc - math.sqrt(max(rc * rc - square, 0.0))) - (SLACK_MM if square > 0.0 else 0.0)
        sx, sy = out[40 + j], out[48 + j]
        reach = rc / math.sqrt(1.0 + sx * sx + sy * sy)
        px, py = min(max(-sx * reach, xl), xh), min(max(-sy * reach, yl), yh)
        rest = rc * rc - px * px - py * py
        root = math.sqrt(max(rest, 1e-300))
        gx, gy = sx + px / root, sy + py / root
        dx, dy = min(max(-gx * rc, xl - px), xh - px), min(max(-gy * rc, yl - py), yh - py)
        tangent = (out[56 + j] + sx * (x + px) + sy * (y + py) + rc - root
                   + dx * (gx + 0.5 * dx / rc) + dy * (gy + 0.5 * dy / rc)) - SLACK_MM
        bound = max(box, tangent) if rest > STEEP * rc * rc else box
        out[64 + j] = math.inf if square > rc * rc else bound


@njit(error_model="numpy")
def _child_heights_of_disk(x, y, a, rc, out):
    radius, limit = a + rc, a + 0.98 * rc
    for j in range(8):
        xl, xh, yl, yh = out[j] - x, out[8 + j] - x, out[16 + j] - y, out[24 + j] - y
        ex, ey = max(xl, -xh, 0.0), max(yl, -yh, 0.0)
        square = ex * ex + ey * ey
        beyond = max(math.sqrt(square) - a, 0.0)
        box = out[32 + j] + (rc - math.sqrt(max(rc * rc - beyond * beyond, 0.0))) - (SLACK_MM if beyond > 0.0 else 0.0)
        sx, sy = out[40 + j], out[48 + j]
        here = out[56 + j] + sx * x + sy * y
        steep = max(math.sqrt(sx * sx + sy * sy), 1e-300)
        plane = here - radius * steep
        reach = (a + rc * steep / math.sqrt(1.0 + steep * steep)) / steep
        px, py = min(max(-sx * reach, xl), xh), min(max(-sy * reach, yl), yh)
        d = math.sqrt(px * px + py * py)
        share = limit / d if d > limit else 1.0
        px, py, d = px * share, py * share, min(d, limit)
        e = max(d - a, 0.0)
        root = math.sqrt(max(rc * rc - e * e, 1e-300))
        pull = e / root / max(d, 1e-300)
        gx, gy, p = sx + pull * px, sy + pull * py, rc - math.sqrt(max(rc * rc - e * e, 0.0))
        tangent = (here + sx * px + sy * py + p + min(gx * (xl - px), gx * (xh - px))
                   + min(gy * (yl - py), gy * (yh - py)))
        bound = max(box, plane - SLACK_MM, tangent - SLACK_MM) if sx * sx + sy * sy > 0.0 else box
        out[64 + j] = math.inf if square > radius * radius else bound
