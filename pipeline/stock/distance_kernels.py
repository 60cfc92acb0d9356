"""Exact signed distance of a point to the volume swept by one piece of path.

A cutter with corner radius rc and flat radius a = R - rc is a disk of radius a, lifted rc
above the tip and extended upward without end, grown by a ball of radius rc:

        │  a  │           the neck is never wider than the flutes, so what the cutter
        ├─────┤ ← rc      removes is closed upward
         ╲___╱  ← tip

The distance is negative inside, 1-Lipschitz, and its sign is exact.  All lengths in mm.
"""

import math

from cuspline.stock.path_pieces import CENTER_U, CENTER_V, FORM, IN_YZ, LEVEL_ARC, LINE, RADIUS, SIDE, X0, X1, Y0, Y1, Z0, Z1
from cuspline.values.compiled import njit

VERTICAL_MM = 1e-9        # a move shorter than this from above is a plunge
CLOSE_MM = 1e-10          # how well the closest position along a sloping move is found


@njit
def corner_distance(beside, below):
    """Signed distance to a quarter plane: `beside` its wall, `below` its floor (negative inside)."""
    if beside > 0.0 and below > 0.0:
        return math.sqrt(beside * beside + below * below)
    return max(beside, below)


@njit
def _column(px, py, pz, hx, hy, g, t, a, rc):
    """Distance (and its slope along t) of a rectangle at height pz to the disk column at position t.

    The rectangle has half sides hx, hy round (px, py); a point has hx = hy = 0.
    """
    dx, dy, dz = g[X1] - g[X0], g[Y1] - g[Y0], g[Z1] - g[Z0]
    x, y = g[X0] + t * dx - px, g[Y0] + t * dy - py
    x = math.copysign(max(abs(x) - hx, 0.0), x)
    y = math.copysign(max(abs(y) - hy, 0.0), y)
    rho = math.sqrt(x * x + y * y)
    e, f = rho - a, g[Z0] + t * dz + rc - pz
    slope = (x * dx + y * dy) / rho if rho > 0.0 else 0.0
    if e > 0.0 and f > 0.0:
        d = math.sqrt(e * e + f * f)
        return d, (e * slope + f * dz) / d
    if e > f:
        return e, slope
    return f, dz


@njit
def least_along_line(px, py, pz, hx, hy, g, a, rc):
    """Least of `_column` over a line: convex in t, so tangents from both sides bound it from below."""
    lo, hi = 0.0, 1.0
    f_lo, s_lo = _column(px, py, pz, hx, hy, g, lo, a, rc)
    f_hi, s_hi = _column(px, py, pz, hx, hy, g, hi, a, rc)
    best = min(f_lo, f_hi)
    if s_lo >= 0.0 or s_hi <= 0.0:
        return best
    for k in range(100):
        t = (f_lo - f_hi + s_hi * hi - s_lo * lo) / (s_hi - s_lo)
        bound = f_lo + s_lo * (t - lo)
        if best - bound <= CLOSE_MM or hi - lo < 1e-16:
            break
        if k % 4 == 3:                       # a kink beside a flat stretch: halve now and then
            t = 0.5 * (lo + hi)
        t = min(max(t, lo), hi)
        f, s = _column(px, py, pz, hx, hy, g, t, a, rc)
        best = min(best, f)
        if s < 0.0:
            lo, f_lo, s_lo = t, f, s
        elif s > 0.0:
            hi, f_hi, s_hi = t, f, s
        else:
            break
    return best


@njit
def _ball_on_line(px, py, pz, g, r):
    """In the vertical plane of the line: distance to the region above it; then across the plane."""
    dx, dy, dz = g[X1] - g[X0], g[Y1] - g[Y0], g[Z1] - g[Z0]
    length = math.sqrt(dx * dx + dy * dy)
    s = ((px - g[X0]) * dx + (py - g[Y0]) * dy) / length
    q = ((px - g[X0]) * dy - (py - g[Y0]) * dx) / length
    v = pz - g[Z0] - r
    if 0.0 <= s <= length and v * length >= dz * s:
        return abs(q) - r
    v0, v1 = min(v, 0.0), min(v - dz, 0.0)
    d2 = min(s * s + v0 * v0, (s - length) * (s - length) + v1 * v1)
    square = length * length + dz * dz
    t = s * length + v * dz
    if 0.0 < t < square:
        across = v * length - s * dz
        d2 = min(d2, across * across / square)
    return math.sqrt(q * q + d2) - r


@njit
def _ball_on_arc(px, py, pz, g, r):
    """As `_ball_on_line`, with an arc of a quarter turn for the lower edge of the region."""
    k = int(g[IN_YZ])
    u, q = (px, py - g[Y0]) if k == 0 else (py, px - g[X0])
    u0, u1 = g[k], g[X1 + k]
    v, du = pz - r - g[CENTER_V], u - g[CENTER_U]
    if u0 <= u <= u1:
        edge = g[SIDE] * math.sqrt(max(g[RADIUS] * g[RADIUS] - du * du, 0.0))
        if v >= edge:
            return abs(q) - r
    v0, v1 = min(pz - r - g[Z0], 0.0), min(pz - r - g[Z1], 0.0)
    d2 = min((u - u0) * (u - u0) + v0 * v0, (u - u1) * (u - u1) + v1 * v1)
    rho = math.sqrt(du * du + v * v)
    if rho > 0.0 and v * g[SIDE] >= 0.0:
        foot = g[CENTER_U] + du * g[RADIUS] / rho
        if u0 <= foot <= u1:
            d2 = min(d2, (rho - g[RADIUS]) * (rho - g[RADIUS]))
    return math.sqrt(q * q + d2) - r


@njit
def _beside_level_arc(px, py, g):
    """Seen from above, distance of a point to a level arc."""
    x, y = px - g[CENTER_U], py - g[CENTER_V]
    x0, y0, x1, y1 = g[X0] - g[CENTER_U], g[Y0] - g[CENTER_V], g[X1] - g[CENTER_U], g[Y1] - g[CENTER_V]
    if x0 * y - y0 * x >= 0.0 and x * y1 - y * x1 >= 0.0:
        return abs(math.sqrt(x * x + y * y) - g[RADIUS])
    return math.sqrt(min((x - x0) * (x - x0) + (y - y0) * (y - y0), (x - x1) * (x - x1) + (y - y1) * (y - y1)))


@njit
def piece_distance(px, py, pz, g, a, rc):
    """Signed distance of a point to what the cutter (a, rc) sweeps along one piece, mm."""
    if g[FORM] != LINE:
        if g[FORM] == LEVEL_ARC:
            return corner_distance(_beside_level_arc(px, py, g) - a, g[Z0] + rc - pz) - rc
        return _ball_on_arc(px, py, pz, g, rc)
    dx, dy = g[X1] - g[X0], g[Y1] - g[Y0]
    square = dx * dx + dy * dy
    if square < VERTICAL_MM * VERTICAL_MM:
        rho = math.sqrt((px - g[X0]) * (px - g[X0]) + (py - g[Y0]) * (py - g[Y0]))
        return corner_distance(rho - a, min(g[Z0], g[Z1]) + rc - pz) - rc
    if a == 0.0:
        return _ball_on_line(px, py, pz, g, rc)
    if g[Z0] == g[Z1]:
        t = min(max(((px - g[X0]) * dx + (py - g[Y0]) * dy) / square, 0.0), 1.0)
        x, y = g[X0] + t * dx - px, g[Y0] + t * dy - py
        return corner_distance(math.sqrt(x * x + y * y) - a, g[Z0] + rc - pz) - rc
    return least_along_line(px, py, pz, 0.0, 0.0, g, a, rc) - rc


@njit(error_model="numpy")
def child_distances(px, py, pz, block, a, rc, out):
    """Lower bounds of `piece_distance` over the eight children of a tree node (see tree.py for the block's rows).

    All tips of a child lie in a rectangle, above a plane and above a height: a convex set.  The bounds come out in
    out[64:72]; out[:64] takes the block, so that nothing written can be what is still to be read.
    """
    for i in range(8):
        for j in range(8):
            out[8 * i + j] = block[i, j]
    if a == 0.0:
        _child_distances_of_ball(px, py, pz, rc, out)
    else:
        _child_distances_of_disk(px, py, pz, a, rc, out)


@njit(error_model="numpy")
def _child_distances_of_ball(px, py, pz, rc, out):
    """The squared distance to the plane's part over the rectangle is convex by 2 at least in x and in y: from a place
    near its least value it is bounded in each of them apart."""
    for j in range(8):
        xl, xh, yl, yh = out[j] - px, out[8 + j] - px, out[16 + j] - py, out[24 + j] - py
        ex, ey, ez = max(xl, -xh, 0.0), max(yl, -yh, 0.0), max(out[32 + j] + rc - pz, 0.0)
        sx, sy = out[40 + j], out[48 + j]
        gap = out[56 + j] + sx * px + sy * py + rc - pz      # from the point straight up to the lifted plane
        y = min(max(-sy * max(gap, 0.0) / (1.0 + sx * sx + sy * sy), yl), yh)
        x = min(max(-sx * max(gap + sy * y, 0.0) / (1.0 + sx * sx), xl), xh)
        up = max(gap + sx * x + sy * y, 0.0)
        gx, gy = x + up * sx, y + up * sy
        dx, dy = min(max(-gx, xl - x), xh - x), min(max(-gy, yl - y), yh - y)
        plane = x * x + y * y + up * up + dx * (2.0 * gx + dx) + dy * (2.0 * gy + dy)
        out[64 + j] = math.sqrt(max(plane, ex * ex + ey * ey + ez * ez)) - rc


@njit(error_model="numpy")
def _child_distances_of_disk(px, py, pz, a, rc, out):
    """For every unit direction n, min n.(Q - P) over a convex set's points Q bounds the distance; n is taken towards the
    point that a cutter would touch first."""
    for j in range(8):
        xl, xh, yl, yh = out[j] - px, out[8 + j] - px, out[16 + j] - py, out[24 + j] - py
        ex, ey = max(xl, -xh, 0.0), max(yl, -yh, 0.0)
        beside, below = math.sqrt(ex * ex + ey * ey) - a, out[32 + j] + rc - pz
        deep = max(beside, below)
        far = math.sqrt(max(beside, 0.0) * max(beside, 0.0) + max(below, 0.0) * max(below, 0.0))
        box = far if deep > 0.0 else deep
        sx, sy = out[40 + j], out[48 + j]
        gap = out[56 + j] + sx * px + sy * py + rc - pz      # from the point straight up to the lifted plane
        steep = sx * sx + sy * sy
        reach = max(gap, 0.0) / (1.0 + steep) + a / math.sqrt(max(steep, 1e-300))
        x, y = min(max(-sx * reach, xl), xh), min(max(-sy * reach, yl), yh)
        rho = math.sqrt(x * x + y * y)
        e, f = max(rho - a, 0.0), gap + sx * x + sy * y
        d = max(math.sqrt(e * e + f * f), 1e-300)
        nx, ny, nz = x / max(rho, 1e-300) * e / d, y / max(rho, 1e-300) * e / d, f / d
        tx, ty = nx + nz * sx, ny + nz * sy
        plane = min(tx * xl, tx * xh) + min(ty * yl, ty * yh) + nz * gap - a * e / d
        out[64 + j] = (max(box, plane) if f > 0.0 else box) - rc
