"""Bounding tree over the sub-steps of tilted, turning cutters, and the near-first search in it.

A tree is an implicit binary heap over sub-steps, halved again and again across their longest side.  A node is a row
of 56 numbers:

    MIDDLE_TIP      (3)
    FRAME_U, _V, _W (3 each) its frame, unit vectors u v w; w along the normal that it leaves on the part, towards the holder
    MIDDLE_AXIS     (3) in the frame
    LOW_0, HIGH_0   (3 each) corners of the box round the points of the axes at height z0, from the middle pose's
    LOW_1 .. HIGH_2 (3 each) the same at heights z1, z2
    WIDEST          largest angle between an axis and the middle one
    TOUCH           (3) from the middle tip to where the cutter touches a plane whose normal is w, from above, in the frame
    HEIGHT_0, _1, _2    z0, z1, z2: the normal at that contact meets the axis at z1
    IS_FILLED       1, or 0 where the node holds nothing
    and those of contact_bounds.py

A forest is a tuple of arrays that numba takes as one argument:

    geometry (m, 14), nodes (k, 56), outlines (o, 10),
    trees (t, 6)   first node, first sub-step, sub-steps, leaves, first line of the outline, behind the last one
    grown (t,)     how far the cutter's surface lies out
    touches (m, 6) of contact_bounds.py
"""

import math

import numpy as np

from cuspline.stock.contact_bounds import face, facing_distance, seen_from, step_bound
from cuspline.stock.outlines import touching_point
from cuspline.stock.tilted_kernels import (
    FRAME_U,
    FRAME_V,
    FRAME_W,
    HEIGHT_0,
    HEIGHT_1,
    HEIGHT_2,
    IS_FILLED,
    LOW_0,
    MIDDLE_AXIS,
    TOUCH,
    WIDEST,
    poses_distance,
    slope_along,
    substep_distance,
)
from cuspline.stock.tilted_pieces import AXIS, AXIS_WAY, TURN, WAY
from cuspline.stock.tree import SLACK_MM
from cuspline.values import fixed_math as fixed
from cuspline.values.borrowed import borrowed
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z, put
from cuspline.values.threads import in_blocks

LEAF = 8                  # sub-steps in a leaf
NODES = 32                # of a level that a thread fills in at a time
INHERIT = 1e-3            # weight of the parent's frame where a node's own points leave it open
BESIDE = 20.0             # mm, z0 and z2 of a node are this far from z1, where the cutter goes on so far
KEPT_SHARE = 1.5          # a point keeps the sub-steps that are within this many times its distance,
KEPT_LEAST_MM = 2e-5      # and this
COLUMNS = 56
ABOVE_MM = 1.0            # a point higher than this over a node's touching plane is better asked about by the other bound
COUNT, SUMS = 0, 1        # columns of moments; behind the sums of the six, products
FIRST_NODE, FIRST_SUBSTEP, SUBSTEPS, LEAVES, FIRST_LINE, BEHIND_LAST = range(6)     # of trees
ROUND = 0.5               # ratio of a contact's radii of curvature that still counts as round


def leaves_for(count):
    """Leaves of a tree over so many sub-steps: a power of two."""
    leaves = 1
    while leaves * LEAF < count:
        leaves *= 2
    return leaves


def build_nodes(geometry, outline, lowest, highest):
    """Nodes (2 leaves - 1, 56) over sub-steps in their given order, touches (m, 6) of these, and the number of leaves.

    Args:
        geometry: (m, 14).   outline: (o, 10).
        lowest, highest: heights over the tip within which normals at contacts are looked for on the axis.
    """
    leaves = leaves_for(len(geometry))
    nodes, touches = np.zeros((2 * leaves - 1, COLUMNS)), np.zeros((len(geometry), 6))
    moments = _moments(np.ascontiguousarray(geometry), leaves)
    width = 1
    while width <= leaves:
        in_blocks(_fill_level, width, NODES, nodes, touches, moments, np.ascontiguousarray(geometry), outline, width, leaves,
                  float(lowest), float(highest))
        width *= 2
    return nodes, touches, leaves


@njit(error_model="numpy")
def _moments(geometry, leaves):
    """(2 leaves - 1, 28) sums over both ends of all sub-steps: count, tip and axis, products of the six."""
    out = np.zeros((2 * leaves - 1, 28))
    q = np.empty(6)
    for t in range(len(geometry)):
        g, node = geometry[t], out[leaves - 1 + t // LEAF]
        for end in range(2):
            for k in range(3):
                q[k], q[3 + k] = g[k] + end * g[WAY + k], g[AXIS + k] + end * g[AXIS_WAY + k]
            node[COUNT] += 1.0
            c = 7
            for i in range(6):
                node[SUMS + i] += q[i]
                for j in range(i, 6):
                    node[c] += q[i] * q[j]
                    c += 1
    for node in range(leaves - 2, -1, -1):
        out[node] = out[2 * node + 1] + out[2 * node + 2]
    return out


@njit(error_model="numpy")
def _spread_at(moment, z, out):
    """Covariance (3, 3) of the axis points at height z over the tips."""
    n = moment[COUNT]
    for i in range(3):
        for j in range(i, 3):
            total = 0.0
            for a, b, weight in ((i, j, 1.0), (i, j + 3, z), (j, i + 3, z), (i + 3, j + 3, z * z)):
                c = 7 + a * 6 - a * (a - 1) // 2 + b - a
                total += weight * (moment[c] / n - moment[SUMS + a] / n * moment[SUMS + b] / n)
            out[i, j] = out[j, i] = total


@njit(error_model="numpy")
def _thinnest(C, w):
    """Direction in which a covariance is least, sought from w on: powers of its adjugate."""
    for _ in range(6):
        x = ((C[Y, Y] * C[Z, Z] - C[Y, Z] ** 2) * w[X] + (C[X, Z] * C[Y, Z] - C[X, Y] * C[Z, Z]) * w[Y]
             + (C[X, Y] * C[Y, Z] - C[X, Z] * C[Y, Y]) * w[Z])
        y = ((C[X, Z] * C[Y, Z] - C[X, Y] * C[Z, Z]) * w[X] + (C[X, X] * C[Z, Z] - C[X, Z] ** 2) * w[Y]
             + (C[X, Y] * C[X, Z] - C[Y, Z] * C[X, X]) * w[Z])
        z = ((C[X, Y] * C[Y, Z] - C[X, Z] * C[Y, Y]) * w[X] + (C[X, Y] * C[X, Z] - C[Y, Z] * C[X, X]) * w[Y]
             + (C[X, X] * C[Y, Y] - C[X, Y] ** 2) * w[Z])
        length = math.sqrt(x * x + y * y + z * z)
        if not length > 0.0:
            return
        w[X], w[Y], w[Z] = x / length, y / length, z / length


@njit(error_model="numpy")
def _touch(w, axis, outline, out):
    """Where the cutter touches a plane with normal w from above, from the tip, into `out`.

    Returns at what height the normal there meets the axis, and the outline's radius of curvature there over the way
    along the normal to the axis.
    """
    nz = -(w[X] * axis[X] + w[Y] * axis[Y] + w[Z] * axis[Z])
    ex, ey, ez = -w[X] - nz * axis[X], -w[Y] - nz * axis[Y], -w[Z] - nz * axis[Z]
    nr = math.sqrt(ex * ex + ey * ey + ez * ez)
    r, z, bend = touching_point(nr, nz, outline, 0, len(outline))
    share = r / nr if nr > 1e-9 else 0.0
    out[X], out[Y], out[Z] = share * ex + z * axis[X], share * ey + z * axis[Y], share * ez + z * axis[Z]
    return (z - r * nz / nr, bend * nr / max(r, 1e-9)) if nr > 1e-9 else (math.inf, 1.0)


@njit(error_model="numpy")
def _frame(node, axis, moment, before, outline, lowest, highest):
    """Fills the frame: w settles where the axis points that the contact normals meet spread least."""
    C, w, touch = np.empty((3, 3)), before.copy(), np.empty(3)
    for _ in range(3):
        z = min(max(_touch(w, axis, outline, touch)[0], lowest), highest)
        _spread_at(moment, z, C)
        size = INHERIT * (C[X, X] + C[Y, Y] + C[Z, Z]) + 1e-12
        for i in range(3):
            for j in range(3):
                C[i, j] += size * ((i == j) - before[i] * before[j])
        _thinnest(C, w)
        if w[X] * axis[X] + w[Y] * axis[Y] + w[Z] * axis[Z] < 0.0:
            w *= -1.0
    z, ratio = _touch(w, axis, outline, touch)
    z = min(max(z, lowest), highest)
    node[HEIGHT_0], node[HEIGHT_1], node[HEIGHT_2] = max(z - BESIDE, lowest - 1.0), z, z + BESIDE
    a = np.zeros(3)
    a[np.argmin(np.abs(w))] = 1.0
    a -= w * (a[X] * w[X] + a[Y] * w[Y] + a[Z] * w[Z])
    a /= math.sqrt(a[X] * a[X] + a[Y] * a[Y] + a[Z] * a[Z])
    b = np.array([w[Y] * a[Z] - w[Z] * a[Y], w[Z] * a[X] - w[X] * a[Z], w[X] * a[Y] - w[Y] * a[X]])
    aa = ab = bb = 0.0
    for i in range(3):
        for j in range(3):
            aa, ab, bb = aa + a[i] * C[i, j] * a[j], ab + a[i] * C[i, j] * b[j], bb + b[i] * C[i, j] * b[j]
    turn = 0.5 * fixed.arctan2(2.0 * ab, aa - bb)
    if ratio < ROUND:                        # u along the cutter's meridian: off along v does not pull along u
        turn = fixed.arctan2(b[X] * axis[X] + b[Y] * axis[Y] + b[Z] * axis[Z],
                             a[X] * axis[X] + a[Y] * axis[Y] + a[Z] * axis[Z])
    cosine, sine = fixed.cos(turn), fixed.sin(turn)
    for k in range(3):
        node[FRAME_U + k], node[FRAME_V + k], node[FRAME_W + k] = (cosine * a[k] + sine * b[k],
                                                                   cosine * b[k] - sine * a[k], w[k])
    for c in range(3):
        along = node[FRAME_U + 3 * c:FRAME_V + 3 * c]
        node[MIDDLE_AXIS + c] = along[X] * axis[X] + along[Y] * axis[Y] + along[Z] * axis[Z]
        node[TOUCH + c] = along[X] * touch[X] + along[Y] * touch[Y] + along[Z] * touch[Z]


@njit(error_model="numpy")
def _enclose(node, axis, geometry, first, last):
    """Fills boxes and largest angle over sub-steps first..last."""
    for box in range(LOW_0, WIDEST, 6):
        node[box:box + 3], node[box + 3:box + 6] = math.inf, -math.inf
    widest = 0.0                                     # chord from the middle axis, squared
    for t in range(first, last):
        g = geometry[t]
        bend = 0.125 * g[TURN] * g[TURN]             # how far a unit axis leaves the chord of its ends
        for end in range(2):
            chord = 0.0
            for k in range(3):
                off = g[AXIS + k] + end * g[AXIS_WAY + k] - axis[k]
                chord += off * off
            widest = max(widest, chord)
            for c in range(3):
                tip = turn = 0.0
                for k in range(3):
                    tip += node[FRAME_U + 3 * c + k] * (g[k] + end * g[WAY + k] - node[k])
                    turn += node[FRAME_U + 3 * c + k] * (g[AXIS + k] + end * g[AXIS_WAY + k] - axis[k])
                for i in range(3):
                    box, z = LOW_0 + 6 * i + c, node[HEIGHT_0 + i]
                    node[box] = min(node[box], tip + z * turn - abs(z) * bend)
                    node[box + 3] = max(node[box + 3], tip + z * turn + abs(z) * bend)
    angle = 2.0 * fixed.arcsin(min(1.0, 0.5 * math.sqrt(widest)))
    node[WIDEST] = angle if angle < 0.5 * math.pi else math.pi


@njit(error_model="numpy")
def _fill_level(nodes, touches, moments, geometry, outline, width, leaves, lowest, highest, low, high):
    """Nodes low..high-1 of one level; the level above is there."""
    span = leaves // width * LEAF
    for i in range(low, high):
        node, moment = nodes[width - 1 + i], moments[width - 1 + i]
        first, last = i * span, min((i + 1) * span, len(geometry))
        if first >= last:
            continue
        put(node, moment[1:4] / moment[COUNT])
        axis = moment[4:7] / moment[COUNT]
        length = math.sqrt(axis[X] ** 2 + axis[Y] ** 2 + axis[Z] ** 2)
        axis = axis / length if length > 1e-9 else geometry[first, AXIS:AXIS_WAY] / 1.0
        before = nodes[(width - 2 + i) // 2, FRAME_W:MIDDLE_AXIS] if width > 1 else axis
        _frame(node, axis, moment, before, outline, lowest, highest)
        _enclose(node, axis, geometry, first, last)
        face(node, geometry, outline, first, last, touches if width == leaves else touches[:0])
        node[IS_FILLED] = 1.0


@njit(error_model="numpy")
def tree_of(piece, trees):
    """Number of the tree that holds a sub-step."""
    for k in range(len(trees)):
        if trees[k, FIRST_SUBSTEP] <= piece < trees[k, FIRST_SUBSTEP] + trees[k, SUBSTEPS]:
            return k
    return -1


@njit(error_model="numpy")
def one_distance(px, py, pz, piece, forest, best, waiting):
    """`substep_distance` of one sub-step of the forest, to the grown cutter."""
    geometry, _, outlines, trees, grown, _ = forest
    k = tree_of(piece, trees)
    d, t = substep_distance(px, py, pz, geometry, piece, outlines, trees[k, FIRST_LINE], trees[k, BEHIND_LAST],
                            best + grown[k], waiting)
    return d - grown[k], t


@njit(error_model="numpy")
def one_slope(px, py, pz, n, piece, t, forest):
    """Derivative of the distance to the cutter at the share t of a sub-step, as the point moves along n (3,)."""
    geometry, _, outlines, trees, _, _ = forest
    k = tree_of(piece, trees)
    return slope_along(px, py, pz, n[X], n[Y], n[Z], geometry, piece, t, outlines, trees[k, FIRST_LINE],
                       trees[k, BEHIND_LAST])


@njit
def worth_keeping(best):
    """How far a ray from here may still run before it meets the surface, if it is not too slanting."""
    return KEPT_SHARE * abs(best) + KEPT_LEAST_MM


@njit(error_model="numpy")
def nearest_substep(px, py, pz, forest, best, hint, keep, kept, stack, bounds, waiting):
    """Least signed distance to anything swept, if it is below `best`, the sub-step it belongs to (-1: none), where.

    Last comes a reach, at most `keep`: all sub-steps nearer than this are in kept[1:], kept[0] of them.  The nearer the
    point is to the surface, the smaller it is; -inf where there was no room, or `keep` was.
    """
    geometry, nodes, outlines, trees, grown, touches = forest
    geometry, nodes, outlines, stack = borrowed(geometry), borrowed(nodes), borrowed(outlines), borrowed(stack)
    touches, bounds, waiting, kept = borrowed(touches), borrowed(bounds), borrowed(waiting), borrowed(kept)
    found, at = -1, 0.5
    kept[0] = 0
    keep = min(keep, worth_keeping(best))
    if hint >= 0:
        d, t = one_distance(px, py, pz, hint, forest, max(best, keep), waiting)
        if d < keep:
            kept[0], kept[1] = 1, hint
        if d < best:
            best, found, at = d, hint, t
            keep = min(keep, worth_keeping(best))
    for k in range(len(trees)):
        base, start, count, leaves, first, last = trees[k]
        by = grown[k]
        top = 1
        stack[0], bounds[0] = 0, -math.inf
        while top > 0:
            top -= 1
            limit = max(best, keep)
            if bounds[top] - SLACK_MM >= limit:
                continue
            node = stack[top]
            if node >= leaves - 1:
                t0 = (node - leaves + 1) * LEAF
                pu, pv, pw, across, least = seen_from(px, py, pz, nodes, base + node)
                for piece in range(start + t0, start + min(t0 + LEAF, count)):
                    if piece == hint:
                        continue
                    if step_bound(pu, pv, pw, across, least, nodes, base + node, touches, piece) - by - SLACK_MM >= max(best, keep):
                        continue
                    d, t = substep_distance(px, py, pz, geometry, piece, outlines, first, last,
                                            max(best, keep) + by, waiting)
                    if d - by < keep:
                        if kept[0] + 1 == len(kept):
                            kept[0], keep = 0, -math.inf
                        else:
                            kept[0] += 1
                            kept[kept[0]] = piece
                    if d - by < best:
                        best, found, at = d - by, piece, t
                        keep = min(keep, worth_keeping(best))
                continue
            row = base + 2 * node + 1
            b0, g0 = _node_bound(px, py, pz, nodes, row, outlines, first, last, limit + by)
            b1, g1 = _node_bound(px, py, pz, nodes, row + 1, outlines, first, last, limit + by)
            top = _open_children(node, b0 - by, b1 - by, g0 <= g1, limit, top, stack, bounds)
    return best, found, at, keep


@njit(error_model="numpy", inline="always")
def _node_bound(px, py, pz, nodes, row, outlines, first, last, limit):
    """Least distance that a sub-step under a node can have to a cutter that has not grown, as sharp as `limit` asks for, and how
    far its middle is off, see `facing_distance`; inf where it holds none."""
    if nodes[row, IS_FILLED] == 0.0:
        return math.inf, math.inf
    low, is_sharp, guess = facing_distance(px, py, pz, nodes, row)
    if low >= limit or is_sharp and low > -ABOVE_MM:
        return low, guess
    return poses_distance(px, py, pz, nodes, row, outlines, first, last), guess


@njit(error_model="numpy", inline="always")
def _open_children(node, b0, b1, is_left_first, limit, top, stack, bounds):
    """Opens the children of a node that may hold less than the limit, the likelier one last; how many nodes are open then."""
    left, right = 2 * node + 1, 2 * node + 2
    if is_left_first:
        left, right, b0, b1 = right, left, b1, b0
    if b0 - SLACK_MM < limit:
        stack[top], bounds[top] = left, b0
        top += 1
    if b1 - SLACK_MM < limit:
        stack[top], bounds[top] = right, b1
        top += 1
    return top


@njit(error_model="numpy")
def holding_substep(px, py, pz, forest, limit, stack, bounds, waiting):
    """A sub-step nearer than `limit` to a point: its signed distance, which it is (-1: there is none), and where.

    The deepest of the first leaf that holds one, which need not be the deepest of all: where many of them run through a
    place, this is much sooner found.
    """
    geometry, nodes, outlines, trees, grown, touches = forest
    geometry, nodes, outlines, stack = borrowed(geometry), borrowed(nodes), borrowed(outlines), borrowed(stack)
    touches, bounds, waiting = borrowed(touches), borrowed(bounds), borrowed(waiting)
    found, at = -1, 0.5
    for k in range(len(trees)):
        base, start, count, leaves, first, last = trees[k]
        by, top = grown[k], 1
        stack[0], bounds[0] = 0, -math.inf
        while top > 0:
            top -= 1
            node = stack[top]
            if node < leaves - 1:
                row = base + 2 * node + 1
                b0, g0 = _node_bound(px, py, pz, nodes, row, outlines, first, last, limit + by)
                b1, g1 = _node_bound(px, py, pz, nodes, row + 1, outlines, first, last, limit + by)
                top = _open_children(node, b0 - by, b1 - by, g0 <= g1, limit, top, stack, bounds)
                continue
            t0 = (node - leaves + 1) * LEAF
            pu, pv, pw, across, least = seen_from(px, py, pz, nodes, base + node)
            for piece in range(start + t0, start + min(t0 + LEAF, count)):
                if step_bound(pu, pv, pw, across, least, nodes, base + node, touches, piece) - by - SLACK_MM >= limit:
                    continue
                d, t = substep_distance(px, py, pz, geometry, piece, outlines, first, last, limit + by, waiting)
                if d - by < limit:
                    limit, found, at = d - by, piece, t
            if found >= 0:
                return limit, found, at
    return limit, found, at
