"""Drop-cutter on a triangle mesh: the lowest tip height at which a cutter touches without cutting in.

The cutter is the Minkowski sum of a disk (radius a = R - rc) and a ball (corner radius rc):
ball a = 0, flat rc = 0.  Over (x, y) the tip rests at

    max over surface points S of   S_z - p(|S_xy - (x, y)|),    p(d) = height of the cutter's bottom

p is convex, so over a tree node whose surface lies below one plane, plane - p is concave and any of
its tangent planes bounds it from above.  The bound converges quadratically with the node's size.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from cuspline.arrays import frozen

LEAF_TRIANGLES = 2
STACK = 128          # deeper than any balanced tree of 2**63 leaves


@dataclass(frozen=True, eq=False, kw_only=True)
class DropMesh:
    """Triangles in Morton order with a balanced tree of upper planes over them."""

    triangles_mm: np.ndarray    # (m, 3, 3) corners
    nodes: np.ndarray           # (k, 8) x low, x high, y low, y high, z max, and z <= a x + b y + c

    @classmethod
    def from_triangles(cls, vertices_mm, triangles):
        """Build the tree over (m, 3) vertex indices; cost is linear after a sort."""
        corners = np.asarray(vertices_mm, float)[np.asarray(triangles)]
        corners = np.ascontiguousarray(corners[np.argsort(_morton(corners[:, :, :2].mean(axis=1)), kind="stable")])
        leaves = 1
        while leaves * LEAF_TRIANGLES < len(corners):
            leaves *= 2
        return cls(triangles_mm=frozen(corners, (None, 3, 3), "triangles_mm"),
                   nodes=frozen(_upper_planes(corners, leaves), (2 * leaves - 1, 8), "nodes"))


def drop_tips_mm(mesh, xy_mm, radius_mm, corner_radius_mm):
    """Lowest safe tip heights.

    Args:
        mesh: DropMesh.
        xy_mm: (n, 2) where the cutter stands; neighbours in the array should be neighbours in space.
        radius_mm: cutter radius R > 0.
        corner_radius_mm: rc, 0 (flat) to R (ball).
    Returns:
        (n,) tip z; -inf where nothing lies beneath the cutter.
    """
    xy = np.ascontiguousarray(xy_mm, dtype=float)
    return _drop_all(mesh.triangles_mm, mesh.nodes, xy, float(radius_mm), float(corner_radius_mm))


def _morton(centers):
    """(m,) interleaved 16-bit keys of plane points, so that neighbours come close in memory."""
    low, span = centers.min(axis=0), max(np.ptp(centers, axis=0).max(), 1e-30)
    cell = ((centers - low) / span * 65535).astype(np.uint64)
    return _spread_bits(cell[:, 0]) | (_spread_bits(cell[:, 1]) << np.uint64(1))


def _spread_bits(v):
    """Insert a zero between each two bits of 16-bit numbers."""
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        v = (v | (v << np.uint64(shift))) & np.uint64(mask)
    return v


@njit(cache=True)
def _upper_planes(corners, leaves):
    """Box, top and a least-squares plane lifted until it lies above, for every node of the tree."""
    m = corners.shape[0]
    nodes = np.empty((2 * leaves - 1, 8))
    for k in range(2 * leaves - 1):
        depth = int(math.floor(math.log2(k + 1) + 1e-12))
        width = leaves >> depth
        first = (k + 1 - (1 << depth)) * width * LEAF_TRIANGLES
        last = min(m, first + width * LEAF_TRIANGLES)
        if first >= m:
            nodes[k] = np.array([1e30, -1e30, 1e30, -1e30, -np.inf, 0.0, 0.0, -np.inf])
            continue
        xl, xh, yl, yh, zh = np.inf, -np.inf, np.inf, -np.inf, -np.inf
        mx = my = mz = 0.0
        for t in range(first, last):
            for v in range(3):
                x, y, z = corners[t, v, 0], corners[t, v, 1], corners[t, v, 2]
                xl, xh, yl, yh, zh = min(xl, x), max(xh, x), min(yl, y), max(yh, y), max(zh, z)
                mx += x
                my += y
                mz += z
        n = 3.0 * (last - first)
        mx, my, mz = mx / n, my / n, mz / n
        xx = xy = yy = xz = yz = 0.0
        for t in range(first, last):
            for v in range(3):
                x, y, z = corners[t, v, 0] - mx, corners[t, v, 1] - my, corners[t, v, 2] - mz
                xx += x * x
                xy += x * y
                yy += y * y
                xz += x * z
                yz += y * z
        ridge = 1e-4 * (xx + yy) + 1e-12
        det = (xx + ridge) * (yy + ridge) - xy * xy
        a = ((yy + ridge) * xz - xy * yz) / det
        b = ((xx + ridge) * yz - xy * xz) / det
        if a * a + b * b > 25.0:
            a = b = 0.0
        c = -np.inf
        for t in range(first, last):
            for v in range(3):
                c = max(c, corners[t, v, 2] - a * corners[t, v, 0] - b * corners[t, v, 1])
        nodes[k] = np.array([xl, xh, yl, yh, zh, a, b, c])
    return nodes


@njit(cache=True, inline="always")
def _bottom(d, R, rc):
    """Height of the cutter's bottom at distance d <= R from the axis."""
    e = d - (R - rc)
    if e <= 0.0:
        return 0.0
    return rc - math.sqrt(max(rc * rc - e * e, 0.0))


@njit(cache=True)
def _node_bound(node, x, y, R, rc):
    """Upper bound of the tip height that anything in the node can ask for."""
    xl, xh, yl, yh = node[0] - x, node[1] - x, node[2] - y, node[3] - y
    dx, dy = max(xl, -xh, 0.0), max(yl, -yh, 0.0)
    near2 = dx * dx + dy * dy
    if near2 > R * R:
        return -np.inf
    flat_top = node[4] - _bottom(math.sqrt(near2), R, rc)
    a, b = node[5], node[6]
    g = math.sqrt(a * a + b * b)
    px = py = 0.0
    if g > 1e-14:                       # where the cutter would touch the plane
        k = (R - rc) / g + rc / math.sqrt(1.0 + g * g)
        px, py = a * k, b * k
    px, py = min(max(px, xl), xh), min(max(py, yl), yh)
    d = math.sqrt(px * px + py * py)
    if d > 0.98 * R:                    # stay where p has a finite slope
        px, py = px * 0.98 * R / d, py * 0.98 * R / d
        d = 0.98 * R
    e = d - (R - rc)
    gx, gy, p = a, b, 0.0
    if e > 0.0:
        q = math.sqrt(rc * rc - e * e)
        p = rc - q
        gx -= e / q * px / d
        gy -= e / q * py / d
    bound = node[7] + a * (x + px) + b * (y + py) - p
    bound += _rise(gx, xl - px, xh - px, R, rc == R) + _rise(gy, yl - py, yh - py, R, rc == R)
    return min(bound, flat_top)


@njit(cache=True, inline="always")
def _rise(slope, low, high, R, is_ball):
    """Largest slope*s (minus s²/2R for the strongly convex ball) for low <= s <= high."""
    if is_ball:
        s = min(max(slope * R, low), high)
        return slope * s - 0.5 * s * s / R
    return max(slope * low, slope * high)


@njit(cache=True)
def _edge_tip(ax, ay, az, bx, by, bz, R, rc):
    """Tip height that a straight edge asks for; coordinates relative to the axis."""
    ux, uy = bx - ax, by - ay
    length2 = ux * ux + uy * uy
    if length2 < 1e-24:
        d2 = min(ax * ax + ay * ay, bx * bx + by * by)
        return max(az, bz) - _bottom(math.sqrt(d2), R, rc) if d2 <= R * R else -np.inf
    length = math.sqrt(length2)
    ux, uy, slope = ux / length, uy / length, (bz - az) / length
    foot = -(ax * ux + ay * uy)
    q = ax * uy - ay * ux
    if abs(q) > R:
        return -np.inf
    w = math.sqrt(R * R - q * q)
    low, high = max(0.0, foot - w), min(length, foot + w)
    if low > high:
        return -np.inf
    if rc == R:
        s = min(max(foot + w * slope / math.sqrt(1.0 + slope * slope), low), high)
        t = s - foot
        return az + slope * s + math.sqrt(max(w * w - t * t, 0.0)) - R
    if rc == 0.0:
        return max(az + slope * low, az + slope * high)
    for _ in range(60):                 # concave in s: bisect its derivative
        s = 0.5 * (low + high)
        t = s - foot
        d = math.sqrt(q * q + t * t)
        e = d - (R - rc)
        drop = 0.0
        if e > 0.0:
            drop = e / math.sqrt(max(rc * rc - e * e, 1e-18)) * t / d
        if slope - drop > 0.0:
            low = s
        else:
            high = s
        if high - low < 1e-12:
            break
    t = 0.5 * (low + high) - foot
    return az + slope * (t + foot) - _bottom(min(math.sqrt(q * q + t * t), R), R, rc)


@njit(cache=True)
def _triangle_tip(T, x, y, R, rc):
    """Tip height that one triangle asks for: facet contact, else its edges (their ends included)."""
    ax, ay, az = T[0, 0] - x, T[0, 1] - y, T[0, 2]
    bx, by, bz = T[1, 0] - x, T[1, 1] - y, T[1, 2]
    cx, cy, cz = T[2, 0] - x, T[2, 1] - y, T[2, 2]
    e1x, e1y, e1z, e2x, e2y, e2z = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    nz = e1x * e2y - e1y * e2x
    if abs(nz) > 1e-14:
        a = -(e1y * e2z - e1z * e2y) / nz
        b = -(e1z * e2x - e1x * e2z) / nz
        g = math.sqrt(a * a + b * b)
        px = py = 0.0
        if g > 1e-14:
            k = (R - rc) / g + rc / math.sqrt(1.0 + g * g)
            px, py = a * k, b * k
        rx, ry = px - ax, py - ay
        u, v = (rx * e2y - ry * e2x) / nz, (e1x * ry - e1y * rx) / nz
        if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
            return az + a * rx + b * ry - (rc - rc / math.sqrt(1.0 + g * g))
    best = _edge_tip(ax, ay, az, bx, by, bz, R, rc)
    best = max(best, _edge_tip(bx, by, bz, cx, cy, cz, R, rc))
    return max(best, _edge_tip(cx, cy, cz, ax, ay, az, R, rc))


@njit(cache=True)
def _drop_one(T, nodes, x, y, R, rc, start, stack, bounds):
    """Branch and bound, nearer bound first; returns the tip and the triangle it rests on."""
    first_leaf = (nodes.shape[0] - 1) // 2
    best, owner = -np.inf, start
    if start >= 0:
        best = _triangle_tip(T[start], x, y, R, rc)
    top = 1
    stack[0], bounds[0] = 0, np.inf
    while top > 0:
        top -= 1
        if bounds[top] <= best:
            continue
        k = stack[top]
        if k >= first_leaf:
            first = (k - first_leaf) * LEAF_TRIANGLES
            for t in range(first, min(T.shape[0], first + LEAF_TRIANGLES)):
                tip = _triangle_tip(T[t], x, y, R, rc)
                if tip > best:
                    best, owner = tip, t
            continue
        left, right = 2 * k + 1, 2 * k + 2
        bl, br = _node_bound(nodes[left], x, y, R, rc), _node_bound(nodes[right], x, y, R, rc)
        if bl > br:
            left, right, bl, br = right, left, br, bl
        if bl > best:
            stack[top], bounds[top] = left, bl
            top += 1
        if br > best:
            stack[top], bounds[top] = right, br
            top += 1
    return best, owner


@njit(cache=True, parallel=True)
def _drop_all(T, nodes, xy, R, rc):
    n = xy.shape[0]
    tips = np.empty(n)
    chunk = 512
    for block in prange((n + chunk - 1) // chunk):
        stack, bounds = np.empty(STACK, np.int64), np.empty(STACK)
        owner = -1
        for i in range(block * chunk, min(n, block * chunk + chunk)):
            tips[i], owner = _drop_one(T, nodes, xy[i, 0], xy[i, 1], R, rc, owner, stack, bounds)
    return tips
