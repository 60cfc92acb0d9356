"""Bounding tree over the sub-steps of tilted, turning cutters, and the near-first search in it.

A tree is an implicit binary heap over sub-steps in Morton order.  A node is a row of 32 numbers:

    0..5     its middle pose: tip, axis
    6..14    its frame, three unit vectors u v w; w along the normal that it leaves on the part, towards the holder
    15..20   box round the points of the axes at height z0 over the tips, from the middle pose's: low u v w, high u v w
    21..26   the same at height z1
    27       largest angle between an axis and the middle one
    28..30   from the middle tip to where the cutter touches a plane whose normal is w, from above
    31       1, or 0 where the node holds nothing

A forest is a tuple of arrays that numba takes as one argument:

    geometry (m, 14), nodes (k, 32), outlines (o, 10),
    trees (t, 6)   first node, first sub-step, sub-steps, leaves, first outline piece, behind the last one
    tools (t, 3)   z0, z1, how far the cutter's surface is grown
"""

import math

import numpy as np
from numba import njit, prange

from cuspline.simulation.outlines import touching_point
from cuspline.simulation.posed_kernels import poses_distance, substep_distance
from cuspline.simulation.tree import SLACK_MM

LEAF = 4                  # sub-steps in a leaf
INHERIT = 1e-3            # weight of the parent's frame where a node's own points leave it open
COLUMNS = 32


def build_nodes(geometry, outline, z0, z1):
    """Nodes (2 leaves - 1, 32) over sub-steps in their given order, and the number of leaves."""
    leaves = 1
    while leaves * LEAF < len(geometry):
        leaves *= 2
    nodes = np.zeros((2 * leaves - 1, COLUMNS))
    moments = _moments(np.ascontiguousarray(geometry), leaves)
    width = 1
    while width <= leaves:
        _fill_level(nodes, moments, np.ascontiguousarray(geometry), outline, width, leaves, float(z0), float(z1))
        width *= 2
    return nodes, leaves


@njit(cache=True)
def _moments(geometry, leaves):
    """(2 leaves - 1, 28) sums over both ends of all sub-steps: count, tip and axis, products of the six."""
    out = np.zeros((2 * leaves - 1, 28))
    q = np.empty(6)
    for t in range(len(geometry)):
        g, node = geometry[t], out[leaves - 1 + t // LEAF]
        for end in range(2):
            for k in range(3):
                q[k], q[3 + k] = g[k] + end * g[3 + k], g[6 + k] + end * g[9 + k]
            node[0] += 1.0
            c = 7
            for i in range(6):
                node[1 + i] += q[i]
                for j in range(i, 6):
                    node[c] += q[i] * q[j]
                    c += 1
    for node in range(leaves - 2, -1, -1):
        out[node] = out[2 * node + 1] + out[2 * node + 2]
    return out


@njit(cache=True)
def _spread_at(moment, z, out):
    """Covariance (3, 3) of the axis points at height z over the tips."""
    n = moment[0]
    for i in range(3):
        for j in range(i, 3):
            total = 0.0
            for a, b, weight in ((i, j, 1.0), (i, j + 3, z), (j, i + 3, z), (i + 3, j + 3, z * z)):
                c = 7 + a * 6 - a * (a - 1) // 2 + b - a
                total += weight * (moment[c] / n - moment[1 + a] / n * moment[1 + b] / n)
            out[i, j] = out[j, i] = total


@njit(cache=True)
def _thinnest(C, w):
    """Direction in which a covariance is least, sought from w on: powers of its adjugate."""
    for _ in range(6):
        x = ((C[1, 1] * C[2, 2] - C[1, 2] ** 2) * w[0] + (C[0, 2] * C[1, 2] - C[0, 1] * C[2, 2]) * w[1]
             + (C[0, 1] * C[1, 2] - C[0, 2] * C[1, 1]) * w[2])
        y = ((C[0, 2] * C[1, 2] - C[0, 1] * C[2, 2]) * w[0] + (C[0, 0] * C[2, 2] - C[0, 2] ** 2) * w[1]
             + (C[0, 1] * C[0, 2] - C[1, 2] * C[0, 0]) * w[2])
        z = ((C[0, 1] * C[1, 2] - C[0, 2] * C[1, 1]) * w[0] + (C[0, 1] * C[0, 2] - C[1, 2] * C[0, 0]) * w[1]
             + (C[0, 0] * C[1, 1] - C[0, 1] ** 2) * w[2])
        length = math.sqrt(x * x + y * y + z * z)
        if not length > 0.0:
            return
        w[0], w[1], w[2] = x / length, y / length, z / length


@njit(cache=True)
def _touch(w, axis, outline, out):
    """Where the cutter touches a plane with normal w from above, from the tip; its height along -w's axis crossing."""
    nz = -(w[0] * axis[0] + w[1] * axis[1] + w[2] * axis[2])
    ex, ey, ez = -w[0] - nz * axis[0], -w[1] - nz * axis[1], -w[2] - nz * axis[2]
    nr = math.sqrt(ex * ex + ey * ey + ez * ez)
    r, z = touching_point(nr, nz, outline, 0, len(outline))
    share = r / nr if nr > 1e-9 else 0.0
    out[0], out[1], out[2] = share * ex + z * axis[0], share * ey + z * axis[1], share * ez + z * axis[2]
    return z - r * nz / nr if nr > 1e-9 else math.inf


@njit(cache=True)
def _frame(node, moment, before, outline, z0, z1):
    """Fills the frame: w settles where the axis points that the contact normals meet spread least."""
    C, w, axis = np.empty((3, 3)), before.copy(), node[3:6]
    for _ in range(3):
        z = min(max(_touch(w, axis, outline, node[28:31]), z0), z1)
        _spread_at(moment, z, C)
        size = INHERIT * (C[0, 0] + C[1, 1] + C[2, 2]) + 1e-12
        for i in range(3):
            for j in range(3):
                C[i, j] += size * ((i == j) - before[i] * before[j])
        _thinnest(C, w)
        if w[0] * axis[0] + w[1] * axis[1] + w[2] * axis[2] < 0.0:
            w *= -1.0
    _touch(w, axis, outline, node[28:31])
    a = np.zeros(3)
    a[np.argmin(np.abs(w))] = 1.0
    a -= w * (a[0] * w[0] + a[1] * w[1] + a[2] * w[2])
    a /= math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    b = np.array([w[1] * a[2] - w[2] * a[1], w[2] * a[0] - w[0] * a[2], w[0] * a[1] - w[1] * a[0]])
    aa = ab = bb = 0.0
    for i in range(3):
        for j in range(3):
            aa, ab, bb = aa + a[i] * C[i, j] * a[j], ab + a[i] * C[i, j] * b[j], bb + b[i] * C[i, j] * b[j]
    turn = 0.5 * math.atan2(2.0 * ab, aa - bb)
    node[6:9] = math.cos(turn) * a + math.sin(turn) * b
    node[9:12] = math.cos(turn) * b - math.sin(turn) * a
    node[12:15] = w


@njit(cache=True)
def _enclose(node, geometry, first, last, z0, z1):
    """Fills boxes and largest angle over sub-steps first..last."""
    node[15:18], node[21:24] = math.inf, math.inf
    node[18:21], node[24:27] = -math.inf, -math.inf
    for t in range(first, last):
        g = geometry[t]
        bend = 0.125 * g[13] * g[13]             # how far a unit axis leaves the chord of its ends
        for end in range(2):
            chord = 0.0
            for k in range(3):
                off = g[6 + k] + end * g[9 + k] - node[3 + k]
                chord += off * off
            angle = 2.0 * math.asin(min(1.0, 0.5 * math.sqrt(chord)))
            node[27] = max(node[27], angle if angle < 0.5 * math.pi else math.pi)
            for c in range(3):
                tip = turn = 0.0
                for k in range(3):
                    tip += node[6 + 3 * c + k] * (g[k] + end * g[3 + k] - node[k])
                    turn += node[6 + 3 * c + k] * (g[6 + k] + end * g[9 + k] - node[3 + k])
                low, high = tip + z0 * turn - z0 * bend, tip + z0 * turn + z0 * bend
                node[15 + c], node[18 + c] = min(node[15 + c], low), max(node[18 + c], high)
                low, high = tip + z1 * turn - z1 * bend, tip + z1 * turn + z1 * bend
                node[21 + c], node[24 + c] = min(node[21 + c], low), max(node[24 + c], high)


@njit(cache=True, parallel=True)
def _fill_level(nodes, moments, geometry, outline, width, leaves, z0, z1):
    """Nodes of one level; the level above is there."""
    span = leaves // width * LEAF
    for i in prange(width):
        node, moment = nodes[width - 1 + i], moments[width - 1 + i]
        first, last = i * span, min((i + 1) * span, len(geometry))
        if first >= last:
            continue
        node[0:6] = moment[1:7] / moment[0]
        length = math.sqrt(node[3] ** 2 + node[4] ** 2 + node[5] ** 2)
        node[3:6] = node[3:6] / length if length > 1e-9 else geometry[first, 6:9]
        before = nodes[(width - 2 + i) // 2, 12:15] if width > 1 else node[3:6]
        _frame(node, moment, before, outline, z0, z1)
        _enclose(node, geometry, first, last, z0, z1)
        node[31] = 1.0


@njit(cache=True)
def tree_of(piece, trees):
    """Number of the tree that holds a sub-step."""
    for k in range(len(trees)):
        if trees[k, 1] <= piece < trees[k, 1] + trees[k, 2]:
            return k
    return -1


@njit(cache=True)
def one_distance(px, py, pz, piece, forest, best, waiting):
    """`substep_distance` of one sub-step of the forest, to the grown cutter."""
    geometry, _, outlines, trees, tools = forest
    k = tree_of(piece, trees)
    by = tools[k, 2]
    return substep_distance(px, py, pz, geometry[piece], outlines, trees[k, 4], trees[k, 5], best + by, waiting) - by


@njit(cache=True)
def nearest_substep(px, py, pz, forest, best, hint, stack, bounds, waiting):
    """Least signed distance to anything swept, where that is below `best`, and the sub-step it belongs to (-1: none)."""
    geometry, nodes, outlines, trees, tools = forest
    found = -1
    if hint >= 0:
        d = one_distance(px, py, pz, hint, forest, best, waiting)
        if d < best:
            best, found = d, hint
    for k in range(len(trees)):
        base, start, count, leaves, first, last = trees[k]
        z0, z1, by = tools[k]
        top = 1
        stack[0], bounds[0] = 0, -math.inf
        while top > 0:
            top -= 1
            if bounds[top] - SLACK_MM >= best:
                continue
            node = stack[top]
            if node >= leaves - 1:
                t0 = (node - leaves + 1) * LEAF
                for t in range(start + t0, start + min(t0 + LEAF, count)):
                    if t == hint:
                        continue
                    d = substep_distance(px, py, pz, geometry[t], outlines, first, last, best + by, waiting) - by
                    if d < best:
                        best, found = d, t
                continue
            left = 2 * node + 1
            b0 = _bound(px, py, pz, nodes[base + left], outlines, first, last, z0, z1, by)
            b1 = _bound(px, py, pz, nodes[base + left + 1], outlines, first, last, z0, z1, by)
            near, far = (left, left + 1) if b0 <= b1 else (left + 1, left)
            if max(b0, b1) - SLACK_MM < best:
                stack[top], bounds[top] = far, max(b0, b1)
                top += 1
            if min(b0, b1) - SLACK_MM < best:
                stack[top], bounds[top] = near, min(b0, b1)
                top += 1
    return best, found


@njit(cache=True)
def _bound(px, py, pz, node, outlines, first, last, z0, z1, by):
    return poses_distance(px, py, pz, node, outlines, first, last, z0, z1) - by if node[31] != 0.0 else math.inf
