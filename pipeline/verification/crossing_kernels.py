"""Triangles that cross each other, and how often a point is enclosed by a closed mesh: compiled.

Boxes stand in a complete binary tree over the triangles in the order of `simulation.tree.halved_order`; node k has the
children 2 k + 1 and 2 k + 2.
"""

import numpy as np

from cuspline.values.compiled import njit
from cuspline.values.rows import HIGH_X, HIGH_Y, HIGH_Z, LOW_X, LOW_Y, LOW_Z, A, B, C, X, Y, Z, put

LEAF = 4                # triangles in a box at the bottom
BEHIND = 6              # column of the tree, behind a box: the row behind its last triangle
FIRST, SECOND = range(2)    # of a pair
THIN = 1e-12            # of a volume over the cube of the longest side: below, it is none


@njit
def boxes_of(corners):
    """(n, 6) boxes, low and high corner, of triangles (n, 3, 3)."""
    boxes = np.empty((len(corners), 6))
    for i in range(len(corners)):
        for k in range(3):
            a, b, c = corners[i, A, k], corners[i, B, k], corners[i, C, k]
            boxes[i, k], boxes[i, HIGH_X + k] = min(a, min(b, c)), max(a, max(b, c))
    return boxes


@njit
def tree_over(boxes, levels):
    """(2^levels - 1, 7) boxes over boxes (n, 6), and the row behind the last; leaf k holds LEAF from k LEAF onward."""
    tree = np.empty((2 ** levels - 1, 7))
    tree[:, :3], tree[:, 3:] = np.inf, -np.inf
    first = 2 ** (levels - 1) - 1
    for i in range(len(boxes)):
        node = first + i // LEAF
        for k in range(3):
            tree[node, k], tree[node, HIGH_X + k] = (min(tree[node, k], boxes[i, k]),
                                                     max(tree[node, HIGH_X + k], boxes[i, HIGH_X + k]))
        tree[node, BEHIND] = i + 1
    for node in range(first - 1, -1, -1):
        for k in range(3):
            tree[node, k] = min(tree[2 * node + 1, k], tree[2 * node + 2, k])
            tree[node, HIGH_X + k] = max(tree[2 * node + 1, HIGH_X + k], tree[2 * node + 2, HIGH_X + k])
        tree[node, BEHIND] = max(tree[2 * node + 1, BEHIND], tree[2 * node + 2, BEHIND])
    return tree


@njit(inline="always")
def _are_apart(a, b):
    return (a[LOW_X] > b[HIGH_X] or a[LOW_Y] > b[HIGH_Y] or a[LOW_Z] > b[HIGH_Z] or b[LOW_X] > a[HIGH_X]
            or b[LOW_Y] > a[HIGH_Y] or b[LOW_Z] > a[HIGH_Z])


@njit
def crossing_pairs(corners, ids, boxes, tree, limit):
    """Pairs of triangles that cross.

    Args:
        corners: (n, 3, 3) in the order of the tree.
        ids: (n, 3) of the corners, the same where places are the same.
        boxes: of the triangles.   tree: over them.
        limit: how many are wanted at most.
    Returns:
        (m, 2) rows of triangles, (m, 3) the middle of what both share.
    """
    pairs, places = np.empty((limit, 2), np.int64), np.empty((limit, 3))
    first, found, stack = (len(tree) + 1) // 2 - 1, 0, np.empty(64, np.int64)
    place = np.empty(3)
    for i in range(len(corners)):
        stack[0], height = 0, 1
        while height > 0:
            height -= 1
            node = stack[height]
            if tree[node, BEHIND] <= i + 1 or _are_apart(boxes[i], tree[node]):
                continue                        # what stands before has asked already
            if node < first:
                stack[height], stack[height + 1] = 2 * node + 1, 2 * node + 2
                height += 2
                continue
            start = (node - first) * LEAF
            for j in range(max(start, i + 1), min(start + LEAF, len(corners))):
                if not _are_apart(boxes[i], boxes[j]) and _crosses(corners[i], corners[j], ids[i], ids[j], place):
                    pairs[found, FIRST], pairs[found, SECOND] = i, j
                    put(places[found], place)
                    found += 1
                    if found == limit:
                        return pairs, places
    return pairs[:found], places[:found]


@njit
def _crosses(a, b, ids_a, ids_b, place):
    """Whether two triangles cross, those with a common side never; the middle of what they share into place (3,)."""
    common, count = 0, 0
    place[:] = 0.0
    for k in range(3):
        if _is_in(ids_a[k], ids_b):
            common += 1
            place += a[k]
    if common > 1:
        return False
    for k in range(3):
        m = (k + 1) % 3
        if not _is_in(ids_a[k], ids_b) and not _is_in(ids_a[m], ids_b):
            count += _pierces(a[k], a[m], b, place)
        if not _is_in(ids_b[k], ids_a) and not _is_in(ids_b[m], ids_a):
            count += _pierces(b[k], b[m], a, place)
    place /= max(count + common, 1)
    return count > 0


@njit(inline="always")
def _is_in(one, ids):
    return one == ids[A] or one == ids[B] or one == ids[C]


@njit
def _volume(a, b, c, d):
    """Six times the volume of a tetrahedron, signed."""
    x0, x1, x2 = b[X] - a[X], b[Y] - a[Y], b[Z] - a[Z]
    y0, y1, y2 = c[X] - a[X], c[Y] - a[Y], c[Z] - a[Z]
    z0, z1, z2 = d[X] - a[X], d[Y] - a[Y], d[Z] - a[Z]
    return x0 * (y1 * z2 - y2 * z1) - x1 * (y0 * z2 - y2 * z0) + x2 * (y0 * z1 - y1 * z0)


@njit
def _pierces(p, q, t, place):
    """Whether the way from p to q passes through a triangle or one of its sides; where, is added to place."""
    below, above = _volume(t[A], t[B], t[C], p), _volume(t[A], t[B], t[C], q)
    if not below * above < 0:
        return False
    size = 0.0
    for k in range(3):
        size = max(size, abs(q[k] - p[k]), abs(t[B, k] - t[A, k]), abs(t[C, k] - t[A, k]))
    thin = THIN * size * size * size
    if abs(below) < thin or abs(above) < thin:
        return False
    u, v, w = _volume(p, q, t[A], t[B]), _volume(p, q, t[B], t[C]), _volume(p, q, t[C], t[A])
    if not ((u > -thin and v > -thin and w > -thin) or (u < thin and v < thin and w < thin)):
        return False
    share = below / (below - above)
    for k in range(3):
        place[k] += p[k] + share * (q[k] - p[k])
    return True


@njit
def enclosures(points, direction, corners):
    """(n,) how often each point is enclosed by a closed mesh: 1 inside, 0 outside, else it crosses itself.

    Args:
        points: (n, 3).
        direction: (3,) of the rays; one that runs along no side.
        corners: (m, 3, 3), counter-clockwise seen from outside.
    """
    count = np.zeros(len(points), np.int64)
    ahead = np.empty(3)
    for i in range(len(points)):
        p = points[i]
        for k in range(3):
            ahead[k] = p[k] + direction[k]
        for j in range(len(corners)):
            t = corners[j]
            u = _volume(p, ahead, t[A], t[B])
            v = _volume(p, ahead, t[B], t[C])
            if u * v <= 0:
                continue
            w = _volume(p, ahead, t[C], t[A])
            if u * w <= 0:
                continue
            # the ray's line passes through the triangle: ahead of the point, and outward or inward?
            below, above = _volume(t[A], t[B], t[C], p), _volume(t[A], t[B], t[C], ahead)
            if below / (below - above) > 0:
                count[i] += 1 if above > below else -1
    return count


def levels_over(count):
    """How many levels a tree over so many triangles has."""
    return (-(-count // LEAF) - 1 if count > LEAF else 0).bit_length() + 1
