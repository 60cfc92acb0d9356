"""Tree over thin pieces of a part's upper faces and edges: a box, a direction N and the height of all below it along N.

The leaves of `patch_tree` are halved until their control hulls are thin.  A node holds

    X_LOW to Z_HIGH   NORMAL: N, unit, N_z >= 0   TOPMOST: c, N . S <= c for all S below   SLANT: |N_xy|

A piece is PART_S, PART_T, PART_HS, PART_HT of its leaf's own box, in units of that box's half sides.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, OF_FACE, OFFSET, U_HIGH, U_LOW, V_HIGH, V_LOW
from cuspline.toolpaths.contact.leaf_rows import HALF_S, HALF_T, KIND, MIDDLE_S, MIDDLE_T, PATCH, REACH_S, REACH_T, SHAPE, STATE
from cuspline.toolpaths.drop.patch_bounds import (
    BORDER,
    EVERYWHERE,
    FACE,
    HULL_MM,
    MOST_HALVINGS,
    OUTSIDE,
    bernstein,
    box_state,
    conversions,
    is_beside,
)
from cuspline.toolpaths.drop.patch_tree import CURVED, grow_tree
from cuspline.toolpaths.gouge.depth_bounds import NORMAL, SLANT, TOPMOST
from cuspline.values.compiled import njit
from cuspline.values.rows import W, X, Y, Z, put

MOST_PIECES = 600_000     # a part that asks for more has them
COARSER = 4.0               # times as thick
PART_S, PART_T, PART_HS, PART_HT = range(4)
UP = 1e-9                   # weight of the upward direction where a piece has none of its own


@dataclass(frozen=True, eq=False, kw_only=True)
class DepthTree:
    """What the kernels of `move_depths` read, millimetres, tool axis +z."""

    arrays: tuple       # the part's arrays, then nodes (k, 11), first (k,), leaf of each piece (m,), pieces (m, 4)

    @classmethod
    def of_part(cls, part, thickness_mm, within_mm=EVERYWHERE):
        """Of an exact_drop.ExactPart.

        Args:
            thickness_mm: of a piece's control hull along its normal, at most; thinner pieces answer faster near a
                contact and slower elsewhere.
            within_mm: (low x, high x, low y, high y): what lies beside it is left out where more is there; no cutter comes about.
        """
        tree = part.arrays
        most = tree.patch[:, [DEGREE_U, DEGREE_V]].max() + 1
        matrices = np.zeros((most, most, most))
        for n in range(most):
            matrices[n, :n + 1, :n + 1] = conversions(n)
        within = np.array(within_mm, float)
        while True:
            leaf, piece, points, first_point, normal = thin_pieces(tree, matrices, float(thickness_mm), within, MOST_PIECES)
            if not len(leaf):
                within = np.array(EVERYWHERE)
            elif len(leaf) < MOST_PIECES:
                break
            else:
                thickness_mm *= COARSER
        corners, two = _corners(points, first_point), 2 * np.arange(len(leaf) + 1)
        first = grow_tree(corners, two)[1]
        nodes = fill_nodes(first, points, first_point, normal)
        for a in (nodes, first, leaf, piece):
            a.setflags(write=False)
        return cls(arrays=(tree, nodes, first, leaf, piece))

    @property
    def memory_bytes(self):
        """Size of what comes on top of the part's own."""
        return sum(a.nbytes for a in self.arrays[1:])


@njit
def _corners(points, first_point):
    """(2 m, 3) least and largest coordinates of each piece's hull."""
    out = np.empty((2 * (len(first_point) - 1), 3))
    for k in range(len(first_point) - 1):
        for a in range(3):
            column = points[first_point[k]:first_point[k + 1], a]
            out[2 * k, a], out[2 * k + 1, a] = column.min(), column.max()
    return out


@njit
def _longer(a):
    out = np.empty((2 * len(a),) + a.shape[1:], a.dtype)
    put(out.reshape(-1), a.reshape(-1))
    return out


@njit(error_model="numpy")
def thin_pieces(tree, matrices, thickness, within, most):
    """Halve every leaf that reaches into a box (low x, high x, low y, high y) until it is thin.

    Returns:
        leaf (m,), piece (m, 4), hull points (h, 3), first hull point of each piece (m + 1,), normals (m, 3) times the
        piece's area; m stops at `most`.
    """
    coefficients, patches, spans, kinds, signs, rows, tags = tree[:7]
    leaf, piece, normal = np.empty(1024, np.int64), np.empty((1024, 4)), np.empty((1024, 3))
    points, first_point = np.empty((16384, 3)), np.zeros(1025, np.int64)
    stack, depth = np.empty((2 * MOST_HALVINGS + 64, 4)), np.empty(2 * MOST_HALVINGS + 64, np.int64)
    count = 0
    n = np.empty(3)
    for k in range(len(rows)):
        p = patches[tags[k, PATCH]]
        du, dv = p[DEGREE_U], p[DEGREE_V]
        mu, mv = matrices[du, :du + 1, :du + 1], matrices[dv, :dv + 1, :dv + 1]
        b = np.empty((du + 1, dv + 1, 4))
        hull = np.empty((du + 1, dv + 1, 3))
        size = (du + 1) * (dv + 1)
        put(stack[0], np.array([0.0, 0.0, 1.0, 1.0]))
        depth[0] = 0
        top = 1
        while top > 0:
            top -= 1
            si, ti, alpha, beta = stack[top]
            level = depth[top]
            s, t = rows[k, MIDDLE_S] + rows[k, HALF_S] * si, rows[k, MIDDLE_T] + rows[k, HALF_T] * ti
            hs, ht = rows[k, HALF_S] * alpha, rows[k, HALF_T] * beta
            if tags[k, STATE] == BORDER and level > 0 and outside_trim(tree, k, s, t, hs, ht):
                continue
            bernstein(coefficients, p[OFFSET], du, dv, s, hs, t, ht, mu, mv, b)
            for i in range(du + 1):
                for j in range(dv + 1):
                    for a in range(3):
                        hull[i, j, a] = b[i, j, a] / b[i, j, W]
            if level == 0 and is_beside(hull, within):
                continue
            area = _area_normal(hull, signs[tags[k, PATCH]], tags[k, KIND] == FACE, n)
            if tags[k, SHAPE] == CURVED and level < MOST_HALVINGS:
                bend_s, bend_t, thick = _bends(hull, n, tags[k, KIND] == FACE)
                if thick > thickness:
                    if bend_s > bend_t:
                        axis = 0
                    elif bend_t > bend_s:
                        axis = 1
                    else:
                        axis = 0 if rows[k, REACH_S] * alpha >= rows[k, REACH_T] * beta else 1
                    for side in (-1.0, 1.0):
                        stack[top, PART_S], stack[top, PART_T], stack[top, PART_HS], stack[top, PART_HT] = si, ti, alpha, beta
                        stack[top, axis] += side * 0.5 * stack[top, PART_HS + axis]
                        stack[top, PART_HS + axis] *= 0.5
                        depth[top] = level + 1
                        top += 1
                    continue
            if count == len(leaf):
                leaf, piece, normal = _longer(leaf), _longer(piece), _longer(normal)
                more = np.empty(2 * count + 1, np.int64)
                put(more, first_point[:count + 1])
                first_point = more
            n[Z] = max(n[Z], 0.0)               # what looks down is bounded from above all the same
            _to_unit(n)
            used = first_point[count]
            while used + size > len(points):
                points = _longer(points)
            leaf[count] = k
            piece[count, PART_S], piece[count, PART_T], piece[count, PART_HS], piece[count, PART_HT] = si, ti, alpha, beta
            for a in range(3):
                normal[count, a] = n[a] * max(area, 1e-12)
            put(points[used:used + size].reshape(-1), hull.reshape(-1))
            count += 1
            first_point[count] = used + size
            if count >= most:
                top = 0
        if count >= most:
            break
    used = first_point[count]
    return (leaf[:count].copy(), piece[:count].copy(), points[:used].copy(), first_point[:count + 1].copy(),
            normal[:count].copy())


@njit
def outside_trim(tree, leaf, s, t, hs, ht):
    """Does a box of a leaf's patch lie outside its face's trim?"""
    patch = tree.tags[leaf, PATCH]
    span = tree.span[patch]
    u0, v0 = 0.5 * (span[U_LOW] + span[U_HIGH]), 0.5 * (span[V_LOW] + span[V_HIGH])
    hu, hv = 0.5 * (span[U_HIGH] - span[U_LOW]), 0.5 * (span[V_HIGH] - span[V_LOW])
    return box_state(tree.trims, tree.patch[patch, OF_FACE], u0 + hu * (s - hs), u0 + hu * (s + hs),
                     v0 + hv * (t - ht), v0 + hv * (t + ht)) == OUTSIDE


@njit(error_model="numpy")
def _area_normal(hull, sign, is_face, n):
    """Unit normal of a piece into n (3,), out of the material; its area.  Of an edge: square to it, as far up as can be."""
    a, b = len(hull) - 1, hull.shape[1] - 1
    area = 0.0
    if is_face:
        p, q = hull[a, b] - hull[0, 0], hull[0, b] - hull[a, 0]
        n[X] = 0.5 * sign * (p[Y] * q[Z] - p[Z] * q[Y])
        n[Y] = 0.5 * sign * (p[Z] * q[X] - p[X] * q[Z])
        n[Z] = 0.5 * sign * (p[X] * q[Y] - p[Y] * q[X])
        area = math.sqrt(n[X] * n[X] + n[Y] * n[Y] + n[Z] * n[Z])
    else:
        d = hull[a, 0] - hull[0, 0]
        square = d[X] * d[X] + d[Y] * d[Y] + d[Z] * d[Z]
        n[X], n[Y], n[Z] = -d[X] * d[Z], -d[Y] * d[Z], d[X] * d[X] + d[Y] * d[Y]
        if not n[Z] > 1e-12 * square:
            n[X] = n[Y] = n[Z] = 0.0
    _to_unit(n)
    return area


@njit(error_model="numpy")
def _to_unit(n):
    """n (3,) made a unit vector; upward where it has no length."""
    length = math.sqrt(n[X] * n[X] + n[Y] * n[Y] + n[Z] * n[Z])
    if length > 1e-30:
        n[X], n[Y], n[Z] = n[X] / length, n[Y] / length, n[Z] / length
    else:
        n[X], n[Y], n[Z] = 0.0, 0.0, 1.0


@njit(error_model="numpy")
def _bends(hull, n, is_face):
    """How much the hull bends along s and along t, and how thick it is along n; an edge: how far from straight."""
    nu, nv = len(hull), hull.shape[1]
    bend_s = bend_t = 0.0
    low, high = np.inf, -np.inf
    if not is_face:
        for i in range(1, nu - 1):
            d = hull[i - 1, 0] - 2.0 * hull[i, 0] + hull[i + 1, 0]
            bend_s = max(bend_s, (nu - 1) * math.sqrt(d[X] * d[X] + d[Y] * d[Y] + d[Z] * d[Z]))
        return bend_s, 0.0, bend_s
    for i in range(nu):
        for j in range(nv):
            z = n[X] * hull[i, j, X] + n[Y] * hull[i, j, Y] + n[Z] * hull[i, j, Z]
            low, high = min(low, z), max(high, z)
            if 0 < i < nu - 1:
                d = hull[i - 1, j] - 2.0 * hull[i, j] + hull[i + 1, j]
                bend_s = max(bend_s, (nu - 1) * abs(n[X] * d[X] + n[Y] * d[Y] + n[Z] * d[Z]))
            if 0 < j < nv - 1:
                d = hull[i, j - 1] - 2.0 * hull[i, j] + hull[i, j + 1]
                bend_t = max(bend_t, (nv - 1) * abs(n[X] * d[X] + n[Y] * d[Y] + n[Z] * d[Z]))
    return bend_s, bend_t, high - low


@njit(error_model="numpy")
def fill_nodes(first, points, first_point, normal):
    """(k, 11) rows of all nodes."""
    nodes = np.empty((len(first), 11))
    sums = np.zeros((len(first), 3))
    stack = np.empty(256, np.int64)
    for k in range(len(first) - 1, -1, -1):         # children stand behind their parents
        row = nodes[k]
        if first[k] < 0:
            p = -1 - first[k]
            put(sums[k], normal[p])
            for a in range(3):
                column = points[first_point[p]:first_point[p + 1], a]
                row[2 * a], row[2 * a + 1] = column.min() - HULL_MM, column.max() + HULL_MM
        else:
            a, b = first[k], first[k] + 1
            for i in range(3):
                sums[k, i] = sums[a, i] + sums[b, i]
                row[2 * i] = min(nodes[a, 2 * i], nodes[b, 2 * i])
                row[2 * i + 1] = max(nodes[a, 2 * i + 1], nodes[b, 2 * i + 1])
        x, y, z = sums[k, X], sums[k, Y], sums[k, Z] + UP
        length = math.sqrt(x * x + y * y + z * z)
        x, y, z = x / length, y / length, z / length
        c, top = -np.inf, 1
        stack[0] = k
        while top > 0:
            top -= 1
            j = stack[top]
            if first[j] >= 0:
                stack[top], stack[top + 1] = first[j], first[j] + 1
                top += 2
                continue
            p = -1 - first[j]
            for i in range(first_point[p], first_point[p + 1]):
                c = max(c, x * points[i, X] + y * points[i, Y] + z * points[i, Z])
        row[NORMAL + X], row[NORMAL + Y], row[NORMAL + Z] = x, y, z
        row[TOPMOST], row[SLANT] = c + HULL_MM, math.sqrt(x * x + y * y)
    return nodes
