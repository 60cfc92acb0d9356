"""Where a cutter of revolution comes to rest on triangles: contact, upper bound, branch and bound.

The cutter is the Minkowski sum of a disk (radius R - rc) and a ball (corner radius rc):
ball rc = R, flat rc = 0.  Over (x, y) the tip rests at

    max over surface points S of   S_z - p(|S_xy - (x, y)|),    p(d) = height of the cutter's bottom

p is convex.  Over one facet, or over a tree node whose surface lies below one plane, plane - p is therefore
concave: its maximum over a triangle lies on an edge that sees the free maximum, and any of its tangent planes
bounds it from above.  That bound converges quadratically with the node's size.
"""

import math

import numpy as np

from cuspline.values.compiled import njit
from cuspline.values.rows import X_HIGH, X_LOW, Y_HIGH, Y_LOW, A, B, C, X, Y, Z

TOP, PLANE_A, PLANE_B, PLANE_C, LEAN_X, LEAN_Y, UPHILL_X, UPHILL_Y = range(4, 12)   # of a node, behind X_LOW to Y_HIGH
FACET_A, FACET_B, FACET_C, FACET_SLOPE, FACET_ROOT = range(5)                       # of a facet
STACK = 128          # deeper than any balanced tree of 2**63 leaves
SETTLED_MM = 1e-12   # an edge's contact is left when nothing better than this can come


@njit(inline="always", error_model="numpy")
def bottom(d, R, rc):
    """Height of the cutter's bottom at distance d <= R from the axis."""
    e = d - (R - rc)
    if e <= 0.0:
        return 0.0
    return rc - math.sqrt(max((R - d) * (rc + e), 0.0))


@njit(error_model="numpy")
def node_bound(nodes, k, x, y, R, rc):
    """Upper bound of the tip height that anything in node k can ask for.

    Columns of nodes: X_LOW, X_HIGH, Y_LOW, Y_HIGH, TOP, plane z <= a x + b y + c as PLANE_A, PLANE_B, PLANE_C,
    then (a, b) / sqrt(1 + a² + b²) as LEAN_X, LEAN_Y and (a, b) / |(a, b)| as UPHILL_X, UPHILL_Y.
    """
    xl, xh, yl, yh = nodes[k, X_LOW] - x, nodes[k, X_HIGH] - x, nodes[k, Y_LOW] - y, nodes[k, Y_HIGH] - y
    dx, dy = max(xl, -xh, 0.0), max(yl, -yh, 0.0)
    near2 = dx * dx + dy * dy
    if near2 > R * R:
        return -np.inf
    a, b = nodes[k, PLANE_A], nodes[k, PLANE_B]
    # expand about the point of the box nearest to where the cutter would touch the plane
    px = min(max((R - rc) * nodes[k, UPHILL_X] + rc * nodes[k, LEAN_X], xl), xh)
    py = min(max((R - rc) * nodes[k, UPHILL_Y] + rc * nodes[k, LEAN_Y], yl), yh)
    d2 = px * px + py * py
    if rc == 0.0:
        # on the disk every multiple of R² - d² >= 0 may be added: with m = |(a, b)| / 2R the rim's contact is flat
        height = nodes[k, PLANE_C] + a * (x + px) + b * (y + py)
        inside = height + max(a * (xl - px), a * (xh - px)) + max(b * (yl - py), b * (yh - py))
        m = (a * nodes[k, UPHILL_X] + b * nodes[k, UPHILL_Y]) / R
        bound = height + 0.5 * m * (R * R - d2)
        bound += rise(a - m * px, xl - px, xh - px, m) + rise(b - m * py, yl - py, yh - py, m)
        bound = min(bound, inside)
    else:
        m = 1.0 / R if rc == R else 0.0     # p of a ball bends by that or more everywhere
        px, py, p, steep = tangent_of_bottom(px, py, R, rc, 0.96)
        bound = nodes[k, PLANE_C] + a * (x + px) + b * (y + py) - p
        bound += rise(a - steep * px, xl - px, xh - px, m) + rise(b - steep * py, yl - py, yh - py, m)
    if nodes[k, TOP] < bound:
        bound = min(bound, nodes[k, TOP] - bottom(math.sqrt(near2), R, rc))
    return bound


@njit(inline="always", error_model="numpy")
def tangent_of_bottom(px, py, R, rc, widest):
    """Where to lay a tangent plane to the cutter's bottom: a place, its height, and what its slopes are of px, py.

    Args:
        px, py: where it is wanted, from the axis; drawn inward where that lies beyond a share of R² (squared distance),
            for there the bottom has no finite slope.
        widest: that share, below 1.
    """
    d2 = px * px + py * py
    if d2 > widest * R * R:
        shrink = 0.5 * (1.0 + widest) * R / math.sqrt(d2)
        px, py, d2 = px * shrink, py * shrink, d2 * shrink * shrink
    height = steep = 0.0
    if rc == R:
        q = math.sqrt(R * R - d2)
        height, steep = R - q, 1.0 / q
    elif rc > 0.0:
        d = math.sqrt(d2)
        e = d - (R - rc)
        if e > 0.0:
            q = math.sqrt(rc * rc - e * e)
            height, steep = rc - q, e / (q * d)
    return px, py, height, steep


@njit(inline="always", error_model="numpy")
def rise(slope, low, high, bend):
    """Largest slope s - bend s² / 2 for low <= s <= high, with low <= high."""
    if bend > 0.0:
        s = min(max(slope / bend, low), high)
    else:
        s = high if slope > 0.0 else low
    return (slope - 0.5 * bend * s) * s


@njit(error_model="numpy")
def edge_contact(ax, ay, az, bx, by, bz, R, rc, best):
    """Where a straight edge (coordinates relative to the axis) holds the cutter: tip height and share of a to b.

    What cannot exceed `best` may come back lower than it is.
    """
    ux, uy = bx - ax, by - ay
    length2 = ux * ux + uy * uy
    if length2 < 1e-24:
        d2 = min(ax * ax + ay * ay, bx * bx + by * by)
        tip = max(az, bz) - bottom(math.sqrt(d2), R, rc) if d2 <= R * R else -np.inf
        return tip, (1.0 if bz > az else 0.0)
    length = math.sqrt(length2)
    ux, uy, slope = ux / length, uy / length, (bz - az) / length
    foot = -(ax * ux + ay * uy)
    q = ax * uy - ay * ux
    if q * q > R * R:
        return -np.inf, 0.0
    w = math.sqrt((R - q) * (R + q))
    low, high = max(0.0, foot - w), min(length, foot + w)
    if low > high:
        return -np.inf, 0.0
    if rc == 0.0:
        s = high if slope > 0.0 else low
        return az + slope * s, s / length
    steep = slope / math.sqrt(1.0 + slope * slope)
    if rc == R:
        s = min(max(foot + w * steep, low), high)
        t = s - foot
        return az + slope * s + math.sqrt(max((w - t) * (w + t), 0.0)) - R, s / length
    tip, s = _bull_nose_on_edge(az, slope, steep, foot, q, low, high, R, rc, best)
    return tip, s / length


@njit(error_model="numpy")
def _bull_nose_on_edge(az, slope, steep, foot, q, low, high, R, rc, best):
    """Largest az + slope s - p(d(s)), d² = q² + (s - foot)², low <= s <= high: safeguarded Newton.

    The function is concave: its tangent tells what the rest of the bracket can still bring.
    """
    a = R - rc
    d = a + rc * abs(steep)                  # exact for an edge through the axis
    t = math.sqrt(max(d * d - q * q, 0.0))
    s = min(max(foot + (t if slope > 0.0 else -t), low), high)
    tip, at, width = -np.inf, s, np.inf
    for _ in range(120):
        t = s - foot
        d = math.sqrt(q * q + t * t)
        e = d - a
        p, g, bend = 0.0, slope, 0.0
        if e > 0.0:
            z2 = max((R - d) * (rc + e), 0.0)
            p, c = rc - math.sqrt(z2), t / d
            z2 = max(z2, 1e-20 * rc * rc)    # the rim is upright
            z = math.sqrt(z2)
            g -= e / z * c
            bend = rc * rc / (z2 * z) * c * c + e / z * (q / d) * (q / d) / d
        f = az + slope * s - p
        if f > tip:
            tip, at = f, s
        if g > 0.0:
            low, room = s, g * (high - s)
        else:
            high, room = s, g * (low - s)
        if f + room <= max(tip, best) + SETTLED_MM:
            break
        ahead = s + g / bend if bend > 0.0 else np.inf
        if low < ahead < high and abs(g) < 0.5 * width * bend:
            width = abs(g) / bend
        else:                                # Newton leaves the bracket or creeps: halve
            ahead = 0.5 * (low + high)
            width = 0.5 * (high - low)
        if ahead == s:
            break
        s = ahead
    return tip, at


@njit(error_model="numpy")
def triangle_contact(corners, facets, k, x, y, R, rc, best):
    """Where triangle k holds the cutter over (x, y): tip height, contact x, y, z.

    What cannot exceed `best` may come back lower than it is.  Columns of facets: plane a, b, c as FACET_A, FACET_B,
    FACET_C, its slope |(a, b)| and sqrt(1 + slope²) as FACET_SLOPE, FACET_ROOT; an infinite slope stands for a facet
    whose plane is not to be relied on.
    """
    slope, root = facets[k, FACET_SLOPE], facets[k, FACET_ROOT]
    a, b = facets[k, FACET_A], facets[k, FACET_B]
    held = np.inf
    if slope < np.inf:
        held = facets[k, FACET_C] + a * x + b * y + (R - rc) * slope + rc * (root - 1.0)
        if held <= best:
            return -np.inf, x, y, 0.0
    ax, ay, az = corners[k, A, X] - x, corners[k, A, Y] - y, corners[k, A, Z]
    bx, by, bz = corners[k, B, X] - x, corners[k, B, Y] - y, corners[k, B, Z]
    cx, cy, cz = corners[k, C, X] - x, corners[k, C, Y] - y, corners[k, C, Z]
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    nz = ux * vy - uy * vx
    tip, tx, ty, tz = -np.inf, x, y, 0.0
    sees_ab = sees_bc = sees_ca = True
    if slope == np.inf and nz != 0.0:
        a, b = -(uy * vz - uz * vy) / nz, -(uz * vx - ux * vz) / nz
        slope = math.sqrt(a * a + b * b)
        root = math.sqrt(1.0 + slope * slope)
    if slope < np.inf:
        reach = rc / root + ((R - rc) / slope if slope > 1e-14 else 0.0)
        px, py = a * reach - ax, b * reach - ay
        u, v = (px * vy - py * vx) / nz, (ux * py - uy * px) / nz
        if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
            tz = az + u * uz + v * vz
            if held < np.inf:
                return held, x + px + ax, y + py + ay, tz
            tip, tx, ty = tz - bottom(min(math.hypot(px + ax, py + ay), R), R, rc), x + px + ax, y + py + ay
        elif held < np.inf:
            sees_ab, sees_bc, sees_ca = v < 0.0, u + v > 1.0, u < 0.0
    if sees_ab:
        f, s = edge_contact(ax, ay, az, bx, by, bz, R, rc, max(best, tip))
        if f > tip:
            tip, tx, ty, tz = f, x + ax + s * ux, y + ay + s * uy, az + s * uz
    if sees_bc:
        f, s = edge_contact(bx, by, bz, cx, cy, cz, R, rc, max(best, tip))
        if f > tip:
            tip, tx, ty, tz = f, x + bx + s * (cx - bx), y + by + s * (cy - by), bz + s * (cz - bz)
    if sees_ca:
        f, s = edge_contact(cx, cy, cz, ax, ay, az, R, rc, max(best, tip))
        if f > tip:
            tip, tx, ty, tz = f, x + cx - s * vx, y + cy - s * vy, cz - s * vz
    return tip, tx, ty, tz


@njit(inline="always")
def first_of(leaf, m, leaves):
    """Row of the first of m triangles in a leaf: they are dealt out evenly."""
    return leaf * m // leaves


@njit(error_model="numpy")
def drop_one(corners, facets, nodes, x, y, R, rc, start, stack, bounds):
    """Branch and bound, higher bound first, from the tip that triangle `start` asks for (-1 for none).

    Returns tip, the row of the triangle it rests on (-1 for nothing), contact x, y, z.
    """
    first_leaf = (len(nodes) - 1) // 2
    best, owner, tx, ty, tz = -np.inf, -1, np.nan, np.nan, np.nan
    if start >= 0:
        best, tx, ty, tz = triangle_contact(corners, facets, start, x, y, R, rc, best)
        owner = start if best > -np.inf else -1
    top = 1
    stack[0], bounds[0] = 0, np.inf
    while top > 0:
        top -= 1
        if bounds[top] <= best:
            continue
        k = stack[top]
        if k >= first_leaf:
            for t in range(first_of(k - first_leaf, len(corners), first_leaf + 1),
                           first_of(k - first_leaf + 1, len(corners), first_leaf + 1)):
                tip, cx, cy, cz = triangle_contact(corners, facets, t, x, y, R, rc, best)
                if tip > best:
                    best, owner, tx, ty, tz = tip, t, cx, cy, cz
            continue
        left, right = 2 * k + 1, 2 * k + 2
        bl, br = node_bound(nodes, left, x, y, R, rc), node_bound(nodes, right, x, y, R, rc)
        if bl > br:
            left, right, bl, br = right, left, br, bl
        if bl > best:
            stack[top], bounds[top] = left, bl
            top += 1
        if br > best:
            stack[top], bounds[top] = right, br
            top += 1
    if owner < 0:
        return -np.inf, -1, np.nan, np.nan, np.nan
    return best, owner, tx, ty, tz


@njit(error_model="numpy")
def holder_above(corners, facets, nodes, x, y, R, rc, z, start, stack):
    """Row of a triangle that keeps the tip above z, -1 where none does; `start` is tried first."""
    first_leaf = (len(nodes) - 1) // 2
    if start >= 0 and triangle_contact(corners, facets, start, x, y, R, rc, z)[0] > z:
        return start
    top = 1
    stack[0] = 0
    while top > 0:
        top -= 1
        k = stack[top]
        if k >= first_leaf:
            for t in range(first_of(k - first_leaf, len(corners), first_leaf + 1),
                           first_of(k - first_leaf + 1, len(corners), first_leaf + 1)):
                if triangle_contact(corners, facets, t, x, y, R, rc, z)[0] > z:
                    return t
            continue
        left, right = 2 * k + 1, 2 * k + 2
        bl, br = node_bound(nodes, left, x, y, R, rc), node_bound(nodes, right, x, y, R, rc)
        if bl > br:
            left, right, bl, br = right, left, br, bl
        if bl > z:
            stack[top] = left
            top += 1
        if br > z:
            stack[top] = right
            top += 1
    return -1
