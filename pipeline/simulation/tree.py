"""Bounding trees over pieces of path, one per cutter, and the near-first search in them.

A tree is an implicit binary heap over pieces in Morton order.  A node is a row of eight numbers:

    0..3   xl, xh, yl, yh     rectangle round the tips
    4      lowest tip
    5..7   sx, sy, c          every tip has z >= c + sx x + sy y  (0, 0, lowest in wide nodes)

A forest is a tuple of arrays that numba takes as one argument:

    geometry (m, 12), nodes (k, 8), trees (t, 4) first node, first piece, pieces, leaves; tools (t, 2) a, rc
"""

import math

import numpy as np
from numba import njit, prange

from cuspline.simulation.distance_kernels import node_distance, piece_distance
from cuspline.simulation.height_kernels import node_height, piece_height

LEAF = 3                  # pieces in a leaf
PLANE_SPAN = 4096         # nodes over more pieces carry no plane
SLACK_MM = 1e-10          # a node is left out only if it is farther by this: rounding of its bound
CHUNK = 64                # points answered one after the other, each helped by the one before
DEPTH = 128               # more than the depth of any tree


def morton_order(points):
    """(n,) order of points (n, 3) along a Z-curve: neighbours in it are neighbours in space."""
    points = np.asarray(points, dtype=float)
    if not len(points):
        return np.zeros(0, np.int64)
    low = points.min(axis=0)
    scale = (2**21 - 1) / max(float((points.max(axis=0) - low).max()), 1e-9)
    key = np.zeros(len(points), dtype=np.uint64)
    for k, column in enumerate(((points - low) * scale).astype(np.uint64).T):
        key |= _spread(column) << np.uint64(k)
    return np.argsort(key, kind="stable")


def _spread(bits):
    """Two zero bits between every two of 21 bits."""
    for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
                        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249)):
        bits = (bits | (bits << np.uint64(shift))) & np.uint64(mask)
    return bits


def build_nodes(geometry):
    """Nodes (2 leaves - 1, 8) over pieces in their given order, and the number of leaves."""
    leaves = 1
    while leaves * LEAF < len(geometry):
        leaves *= 2
    return _fill_nodes(np.ascontiguousarray(geometry), leaves), leaves


@njit(cache=True)
def _lowest_over_plane(g, sx, sy):
    """Least z - sx x - sy y over a piece."""
    best = min(g[2] - sx * g[0] - sy * g[1], g[5] - sx * g[3] - sy * g[4])
    if g[11] != 0.0 and g[10] < 0.0:                      # the belly of an arc that hangs down
        s = sx if g[6] == 0.0 else sy
        root = math.sqrt(1.0 + s * s)
        k = int(g[6])
        touch = g[7] + g[9] * s / root
        if g[k] < touch < g[3 + k]:
            fixed = sy * g[1] if k == 0 else sx * g[0]
            best = min(best, g[8] - s * g[7] - g[9] * root - fixed)
    return best


@njit(cache=True)
def _slope_of(geometry, first, last):
    """Least-squares slope (sx, sy) of the lower ends of pieces; 0, 0 where it is undefined or steep."""
    n = mx = my = mz = 0.0
    for t in range(first, last):
        for k in (0, 3):
            mx, my, mz, n = mx + geometry[t, k], my + geometry[t, k + 1], mz + geometry[t, k + 2], n + 1.0
    mx, my, mz = mx / n, my / n, mz / n
    xx = xy = yy = xz = yz = 0.0
    for t in range(first, last):
        for k in (0, 3):
            x, y, z = geometry[t, k] - mx, geometry[t, k + 1] - my, geometry[t, k + 2] - mz
            xx, xy, yy, xz, yz = xx + x * x, xy + x * y, yy + y * y, xz + x * z, yz + y * z
    ridge = 1e-4 * (xx + yy) + 1e-12
    xx, yy = xx + ridge, yy + ridge
    det = xx * yy - xy * xy
    sx, sy = (yy * xz - xy * yz) / det, (xx * yz - xy * xz) / det
    if not sx * sx + sy * sy < 100.0:
        return 0.0, 0.0
    return sx, sy


@njit(cache=True)
def _fill_nodes(geometry, leaves):
    nodes = np.empty((2 * leaves - 1, 8))
    m, width = len(geometry), leaves
    while width >= 1:
        span = leaves // width * LEAF
        for i in range(width):
            node, first, last = nodes[width - 1 + i], i * span, min((i + 1) * span, m)
            node[:] = 0.0
            node[0], node[1], node[2], node[3], node[4] = math.inf, -math.inf, math.inf, -math.inf, math.inf
            for t in range(first, last):
                g = geometry[t]
                node[0], node[1] = min(node[0], g[0], g[3]), max(node[1], g[0], g[3])
                node[2], node[3] = min(node[2], g[1], g[4]), max(node[3], g[1], g[4])
                node[4] = min(node[4], g[2], g[5])
            if first < last and span <= PLANE_SPAN:
                node[5], node[6] = _slope_of(geometry, first, last)
            node[7] = math.inf
            for t in range(first, last):
                node[7] = min(node[7], _lowest_over_plane(geometry[t], node[5], node[6]))
        width //= 2
    return nodes


@njit(cache=True)
def nearest_piece(px, py, pz, forest, hint, stack, bounds):
    """Least signed distance of a point to anything swept, and the piece it belongs to (-1: nothing)."""
    geometry, nodes, trees, tools = forest
    best, found = math.inf, -1
    for pick in range(2):                    # first the hint alone, then all trees
        for k in range(len(trees)):
            first, count, leaves = trees[k, 1], trees[k, 2], trees[k, 3]
            a, rc = tools[k, 0], tools[k, 1]
            if pick == 0:
                if first <= hint < first + count:
                    best, found = piece_distance(px, py, pz, geometry[hint], a, rc), hint
                continue
            if count == 0:
                continue
            top = 1
            stack[0], bounds[0] = 0, -math.inf
            while top > 0:
                top -= 1
                if bounds[top] - SLACK_MM >= best:
                    continue
                node = stack[top]
                if node >= leaves - 1:
                    t0 = (node - leaves + 1) * LEAF
                    for t in range(first + t0, first + min(t0 + LEAF, count)):
                        d = piece_distance(px, py, pz, geometry[t], a, rc)
                        if d < best:
                            best, found = d, t
                    continue
                left = 2 * node + 1
                b0 = _bound_distance(px, py, pz, nodes[trees[k, 0] + left], a, rc)
                b1 = _bound_distance(px, py, pz, nodes[trees[k, 0] + left + 1], a, rc)
                near, far = (left, left + 1) if b0 <= b1 else (left + 1, left)
                stack[top], bounds[top] = far, max(b0, b1)
                stack[top + 1], bounds[top + 1] = near, min(b0, b1)
                top += 2
    return best, found


@njit(cache=True)
def _bound_distance(px, py, pz, node, a, rc):
    return node_distance(px, py, pz, node, a, rc) if node[0] <= node[1] else math.inf


@njit(cache=True)
def lowest_piece(x, y, forest, top_mm, hint, stack, bounds):
    """Height left over (x, y), at most top_mm, and the piece that left it (-1: uncut)."""
    geometry, nodes, trees, tools = forest
    best, found = top_mm, -1
    for pick in range(2):
        for k in range(len(trees)):
            first, count, leaves = trees[k, 1], trees[k, 2], trees[k, 3]
            a, rc = tools[k, 0], tools[k, 1]
            if pick == 0:
                if first <= hint < first + count:
                    z = piece_height(x, y, geometry[hint], a, rc)
                    if z < best:
                        best, found = z, hint
                continue
            if count == 0:
                continue
            top = 1
            stack[0], bounds[0] = 0, -math.inf
            while top > 0:
                top -= 1
                if bounds[top] - SLACK_MM >= best:
                    continue
                node = stack[top]
                if node >= leaves - 1:
                    t0 = (node - leaves + 1) * LEAF
                    for t in range(first + t0, first + min(t0 + LEAF, count)):
                        z = piece_height(x, y, geometry[t], a, rc)
                        if z < best:
                            best, found = z, t
                    continue
                left = 2 * node + 1
                b0 = _bound_height(x, y, nodes[trees[k, 0] + left], a, rc)
                b1 = _bound_height(x, y, nodes[trees[k, 0] + left + 1], a, rc)
                near, far = (left, left + 1) if b0 <= b1 else (left + 1, left)
                stack[top], bounds[top] = far, max(b0, b1)
                stack[top + 1], bounds[top + 1] = near, min(b0, b1)
                top += 2
    return best, found


@njit(cache=True)
def _bound_height(x, y, node, a, rc):
    return node_height(x, y, node, a, rc) if node[0] <= node[1] else math.inf


@njit(cache=True, parallel=True)
def distances(points, forest):
    """Signed distance (n,) and piece (n,) of points (n, 3)."""
    n = len(points)
    out, piece = np.empty(n), np.empty(n, np.int64)
    for c in prange((n + CHUNK - 1) // CHUNK):
        stack, bounds, hint = np.empty(DEPTH, np.int64), np.empty(DEPTH), -1
        for i in range(c * CHUNK, min(n, (c + 1) * CHUNK)):
            d, hint = nearest_piece(points[i, 0], points[i, 1], points[i, 2], forest, hint, stack, bounds)
            out[i], piece[i] = d, hint
    return out, piece


@njit(cache=True, parallel=True)
def heights(xy, forest, top_mm):
    """Stock height (n,) and piece (n,) over xy (n, 2)."""
    n = len(xy)
    out, piece = np.empty(n), np.empty(n, np.int64)
    for c in prange((n + CHUNK - 1) // CHUNK):
        stack, bounds, hint = np.empty(DEPTH, np.int64), np.empty(DEPTH), -1
        for i in range(c * CHUNK, min(n, (c + 1) * CHUNK)):
            z, hint = lowest_piece(xy[i, 0], xy[i, 1], forest, top_mm, hint, stack, bounds)
            out[i], piece[i] = z, hint
    return out, piece
