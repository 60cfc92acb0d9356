"""Least distance of two bodies of convex pieces, and proof that they keep apart while the joints between them run: kernels only.

Two convex sets are as far apart as the origin is from the set of their differences.  Its nearest point is closed in on from
corners of that set (Gilbert, Johnson, Keerthi); whatever direction is at hand, the least value along it is a lower bound of the
distance, so what is called clear is clear however far the search got.
"""

import math
from typing import NamedTuple

import numpy as np

from cuspline.shop.kinematics import cross, turned
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import FROM, TO, X, Y, Z, put

ROUNDING_MM = 1e-9          # taken off every bound
ROUNDS = 64                 # of one search; its bound holds after any number
ROUGHLY = 0.05              # of a distance beyond the margin: how closely it is searched for
CLOSE_MM = 1e-4             # at the margin
STACK = 512
INSIDE = 1e-12              # mm: nearer to the origin, the pieces overlap
RADIUS = 3                  # column of a sphere: middle and radius
ORIGIN = 3                  # row of a pose: three of the rotation, then where the body's origin stands
ROOT = 0                    # of a tree: the sphere round all of it
FLAT = 1e-14                # of a triangle's sides squared: below, it has no inside
PROVEN = 0.6                # of a distance beyond the margin, where only that it is clear is asked
MOST_PIECES = 500           # of an obstacle, by which it is told how deep a body is in it
SPANS = 128                 # stretches of a block that may wait


class Pieces(NamedTuple):
    """Convex pieces of one body in the coordinates of its link, in a tree of spheres."""

    points: np.ndarray      # (p, 3) corners, piece after piece
    first: np.ndarray       # (k + 1,) row of `points` at which each piece begins
    nodes: np.ndarray       # (2 leaves - 1, 4) spheres; a radius below 0: empty
    leaves: int


class Between(NamedTuple):
    """Joints that stand between an obstacle and a body, from the obstacle."""

    columns: np.ndarray     # (j,) of joints
    is_rotary: np.ndarray   # (j,)
    direction: np.ndarray   # (j, 3)
    pivot: np.ndarray       # (j, 3)


@njit
def pose(between, joints, out):
    """The body seen from the obstacle, rows of the rotation and then the origin, into out (4, 3)."""
    for k in range(3):
        put_constant(out[k], 0.0)
        out[k, k] = 1.0
    put_constant(out[ORIGIN], 0.0)
    for n in range(len(between.columns) - 1, -1, -1):
        u, value = between.direction[n], joints[between.columns[n]]
        if not between.is_rotary[n]:
            for k in range(3):
                out[ORIGIN, k] += value * u[k]
            continue
        p, s, c = between.pivot[n], fixed.sin(value), fixed.cos(value)
        for k in range(3):
            out[X, k], out[Y, k], out[Z, k] = turned(out[X, k], out[Y, k], out[Z, k], u, s, c)
        x, y, z = turned(out[ORIGIN, X] - p[X], out[ORIGIN, Y] - p[Y], out[ORIGIN, Z] - p[Z], u, s, c)
        out[ORIGIN, X], out[ORIGIN, Y], out[ORIGIN, Z] = x + p[X], y + p[Y], z + p[Z]


@njit(inline="always")
def put_constant(row, value):
    """Write one value to all of a row."""
    for k in range(len(row)):
        row[k] = value


@njit
def motion(between, q0, q1, sphere):
    """No point of a body within a sphere goes farther, seen from the obstacle, while the joints run evenly from q0 to q1."""
    x, y, z, r, total = sphere[X], sphere[Y], sphere[Z], sphere[RADIUS], 0.0
    for n in range(len(between.columns) - 1, -1, -1):
        a, b, u = q0[between.columns[n]], q1[between.columns[n]], between.direction[n]
        way, middle = abs(b - a), 0.5 * (a + b)
        if between.is_rotary[n]:
            p = between.pivot[n]
            dx, dy, dz = x - p[X], y - p[Y], z - p[Z]
            along = dx * u[X] + dy * u[Y] + dz * u[Z]
            way *= math.sqrt(max(dx * dx + dy * dy + dz * dz - along * along, 0.0)) + r
            x, y, z = turned(dx, dy, dz, u, fixed.sin(middle), fixed.cos(middle))
            x, y, z = x + p[X], y + p[Y], z + p[Z]
        else:
            x, y, z = x + middle * u[X], y + middle * u[Y], z + middle * u[Z]
        total += way
        r += 0.5 * way
    return total


@njit(inline="always")
def _placed(m, p):
    return _dot(m[X], p) + m[ORIGIN, X], _dot(m[Y], p) + m[ORIGIN, Y], _dot(m[Z], p) + m[ORIGIN, Z]


@njit(inline="always")
def _dot(a, b):
    return a[X] * b[X] + a[Y] * b[Y] + a[Z] * b[Z]


@njit
def _extreme(solid, piece, x, y, z):
    """Row of the corner of a piece that lies farthest against a direction."""
    best, found = math.inf, -1
    for k in range(solid.first[piece], solid.first[piece + 1]):
        p = solid.points[k]
        along = p[X] * x + p[Y] * y + p[Z] * z
        if along < best:
            best, found = along, k
    return found


@njit
def _difference(body, a, solid, b, m, v, out):
    """Corner of the differences that lies farthest against v, into out; returns v . out, the least of all."""
    row = _extreme(body, a, m[X, X] * v[X] + m[Y, X] * v[Y] + m[Z, X] * v[Z], m[X, Y] * v[X] + m[Y, Y] * v[Y] + m[Z, Y] * v[Z],
                   m[X, Z] * v[X] + m[Y, Z] * v[Y] + m[Z, Z] * v[Z])
    other = solid.points[_extreme(solid, b, -v[X], -v[Y], -v[Z])]
    x, y, z = _placed(m, body.points[row])
    out[X], out[Y], out[Z] = x - other[X], y - other[Y], z - other[Z]
    return _dot(out, v)


@njit
def _nearest(corners, count, kept, v):
    """Nearest point to the origin of the hull of 1 .. 4 corners into v; which corners it hangs on into kept (4,)."""
    best = math.inf
    for i in range(count):
        best = _put_if_nearer(corners, i, i, i, 0.0, 0.0, best, kept, v)
        for j in range(i + 1, count):
            best = _over_side(corners, i, j, best, kept, v)
            for k in range(j + 1, count):
                best = _over_triangle(corners, i, j, k, best, kept, v)


@njit
def _put_if_nearer(corners, i, j, k, s, t, best, kept, v):
    """The point at shares s toward j and t toward k, where it is nearer to the origin than the best; its square."""
    r = 1.0 - s - t
    x = r * corners[i, X] + s * corners[j, X] + t * corners[k, X]
    y = r * corners[i, Y] + s * corners[j, Y] + t * corners[k, Y]
    z = r * corners[i, Z] + s * corners[j, Z] + t * corners[k, Z]
    square = x * x + y * y + z * z
    if square >= best:
        return best
    v[X], v[Y], v[Z] = x, y, z
    put_constant(kept, False)
    kept[i] = kept[j] = kept[k] = True
    return square


@njit
def _over_side(corners, i, j, best, kept, v):
    """The same between two corners."""
    square = along = 0.0
    for k in range(3):
        side = corners[j, k] - corners[i, k]
        square, along = square + side * side, along - corners[i, k] * side
    if 0.0 < along < square:
        return _put_if_nearer(corners, i, j, i, along / square, 0.0, best, kept, v)
    return best


@njit
def _over_triangle(corners, i, j, k, best, kept, v):
    """The same within three."""
    d00 = d01 = d11 = d20 = d21 = 0.0
    for n in range(3):
        p, q, a = corners[j, n] - corners[i, n], corners[k, n] - corners[i, n], -corners[i, n]
        d00, d01, d11, d20, d21 = d00 + p * p, d01 + p * q, d11 + q * q, d20 + a * p, d21 + a * q
    whole = d00 * d11 - d01 * d01
    if whole <= FLAT * d00 * d11:
        return best
    s, t = (d11 * d20 - d01 * d21) / whole, (d00 * d21 - d01 * d20) / whole
    if s > 0.0 and t > 0.0 and s + t < 1.0:
        return _put_if_nearer(corners, i, j, k, s, t, best, kept, v)
    return best


@njit
def _holds_origin(corners):
    """Whether the origin lies within four corners: on the inner side of every face."""
    for n in range(4):
        a, b, c, d = corners[n], corners[(n + 1) & 3], corners[(n + 2) & 3], corners[(n + 3) & 3]
        x, y, z = cross(b - a, c - a)
        inner = x * (d[X] - a[X]) + y * (d[Y] - a[Y]) + z * (d[Z] - a[Z])
        own = -(x * a[X] + y * a[Y] + z * a[Z])
        if inner == 0.0 or own * inner < 0.0:
            return False
    return True


@njit
def piece_distance(body, a, solid, b, m, margin):
    """(proven lower bound, distance of two points that were found) of two convex pieces; neither above 0 where they overlap."""
    v, corners, kept, w = np.empty(3), np.empty((5, 3)), np.zeros(5, np.bool_), np.empty(3)
    _difference(body, a, solid, b, m, np.ones(3), v)
    count, low = 0, -math.inf
    for _ in range(ROUNDS):
        length = math.sqrt(_dot(v, v))
        if length < INSIDE:
            return min(low, 0.0), 0.0
        low = max(low, _difference(body, a, solid, b, m, v, w) / length)
        if length - low <= max(ROUGHLY * (low - margin), CLOSE_MM) or _has(corners, count, w):
            break
        put(corners[count], w)
        if count == 3 and _holds_origin(corners):
            return min(low, 0.0), 0.0
        _nearest(corners, count + 1, kept, v)
        count = _gathered(corners, count + 1, kept)
    return low - ROUNDING_MM, math.sqrt(_dot(v, v))


@njit
def _has(corners, count, w):
    """Whether a corner is one of the first `count`."""
    for k in range(count):
        if corners[k, X] == w[X] and corners[k, Y] == w[Y] and corners[k, Z] == w[Z]:
            return True
    return False


@njit
def _gathered(corners, count, kept):
    """Corners that are kept moved to the front; how many."""
    n = 0
    for k in range(count):
        if kept[k]:
            put(corners[n], corners[k])
            n += 1
    return n


@njit
def distance(body, solid, m, margin, cap, share):
    """(proven lower bound, distance found) of two bodies; beyond `cap` they are not told apart.

    Nearer spheres first; one that is beyond the margin by this share of what the best found is, is taken at its word: a share
    of 1 finds the least distance, a smaller one proves that much of it sooner, or that it is below the margin.  The sphere round
    a long piece, a spindle's, says little: the piece itself is held against the obstacle's spheres.
    """
    middle = Pieces(np.empty((1, 3)), np.array([0, 1]), solid.nodes[:1], 1)
    here, there, bounds, top = np.zeros(STACK, np.int64), np.zeros(STACK, np.int64), np.empty(STACK), 1
    bounds[0] = _sphere_bound(body.nodes[ROOT], solid.nodes[ROOT], m)
    least, best = math.inf, math.inf
    while top > 0:
        top -= 1
        i, j = here[top], there[top]
        if bounds[top] >= min(best, margin + share * max(best - margin, 0.0), cap):
            least = min(least, bounds[top])
            continue
        ends_here, ends_there = i >= body.leaves - 1, j >= solid.leaves - 1
        if ends_here and ends_there:
            low, found = piece_distance(body, i - body.leaves + 1, solid, j - solid.leaves + 1, m, margin)
            least, best = min(least, low), min(best, found)
            if best <= 0.0 or (best < margin and share < 1.0):
                return (least if best <= 0.0 else -math.inf), best
            continue
        divides_body = ends_there or (not ends_here and body.nodes[i, RADIUS] >= solid.nodes[j, RADIUS])
        a, b, da, db = (2 * i + 1, j, 1, 0) if divides_body else (i, 2 * j + 1, 0, 1)
        first = _sphere_bound(body.nodes[a], solid.nodes[b], m)
        second = _sphere_bound(body.nodes[a + da], solid.nodes[b + db], m)
        swap = 1 if second > first else 0               # the farther one waits below
        for side in range(2):
            k = swap if side == 0 else 1 - swap
            bound = second if k == 1 else first
            if ends_here and bound < min(best, cap):
                put(middle.points[0], solid.nodes[b + k * db, :RADIUS])
                low, _ = piece_distance(body, i - body.leaves + 1, middle, 0, m, margin)
                bound = max(bound, low - solid.nodes[b + k * db, RADIUS])
            if bound < math.inf:
                here[top], there[top], bounds[top] = a + k * da, b + k * db, bound
                top += 1
    return least, best


@njit(inline="always")
def _sphere_bound(u, s, m):
    """Points of two spheres are no nearer to each other; inf where one is empty."""
    if u[RADIUS] < 0.0 or s[RADIUS] < 0.0:
        return math.inf
    x, y, z = _placed(m, u)
    return math.sqrt((x - s[X]) ** 2 + (y - s[Y]) ** 2 + (z - s[Z]) ** 2) - u[RADIUS] - s[RADIUS] - ROUNDING_MM


@njit
def over_blocks(body, solid, between, starts, ends, margin, cap, tolerance, is_clear):
    """Whether a body keeps the margin to an obstacle over whole blocks of joints (n, m); what it does not is put into is_clear.

    A distance vouches for the blocks that follow as far as it lasts.
    """
    m, sphere, left = np.empty((4, 3)), body.nodes[ROOT], -math.inf
    for i in range(len(starts)):
        if i > 0:
            left -= motion(between, ends[i - 1], starts[i], sphere)
        way = motion(between, starts[i], ends[i], sphere)
        if left - way < margin:
            pose(between, starts[i], m)
            left, _ = distance(body, solid, m, margin, cap, PROVEN)
        if left - way < margin:
            is_clear[i] = _over_block(body, solid, between, starts[i], ends[i], margin, cap, tolerance, m)
            left = -math.inf
        left -= way


@njit
def _over_block(body, solid, between, q0, q1, margin, cap, tolerance, m):
    """The same of one block: halved until each stretch is proven by its middle, or is too near."""
    spans, top = np.empty((SPANS, 2)), 1
    spans[top - 1, FROM], spans[top - 1, TO] = 0.0, 1.0
    while top > 0:
        top -= 1
        low, high = spans[top, FROM], spans[top, TO]
        a, b, middle = q0 + low * (q1 - q0), q0 + high * (q1 - q0), 0.5 * (low + high)
        slack = 0.5 * motion(between, a, b, body.nodes[ROOT])
        pose(between, q0 + middle * (q1 - q0), m)
        bound, found = distance(body, solid, m, margin, cap, PROVEN)
        if bound - slack >= margin:
            continue
        if found < margin or slack <= tolerance or top + 2 > SPANS:
            return False
        spans[top, FROM], spans[top, TO] = middle, high
        spans[top + 1, FROM], spans[top + 1, TO] = low, middle
        top += 2
    return True


@njit
def overlap(body, solid, m, directions):
    """How deep two bodies are in each other: of their worst pieces, the least way out along any of the directions (d, 3).

    Directions count twice, as the obstacle has them and as the body has them.  Of very many pieces some stand for all.
    """
    worst, v, w = 0.0, np.empty(3), np.empty(3)
    for a in range(len(body.first) - 1):
        for b in range(0, len(solid.first) - 1, 1 + (len(solid.first) - 2) // MOST_PIECES):
            least = math.inf
            for k in range(2 * len(directions)):
                d = directions[k // 2]
                v[X], v[Y], v[Z] = d[X], d[Y], d[Z]
                if k % 2 == 1:
                    v[X], v[Y], v[Z] = _dot(m[X], d), _dot(m[Y], d), _dot(m[Z], d)
                least = min(least, -_difference(body, a, solid, b, m, v, w))
                if least <= worst:
                    break
            worst = max(worst, least)
    return worst


@njit
def gaps(body, solid, between, starts, ends, poses, directions, margin, out):
    """Least distance at some poses of each block of joints (n, m) into out (n,); negative: so deep in each other."""
    m = np.empty((4, 3))
    for i in range(len(starts)):
        out[i] = math.inf
        for k in range(poses):
            pose(between, starts[i] + k / (poses - 1) * (ends[i] - starts[i]), m)
            _, gap = distance(body, solid, m, margin, math.inf, 1.0)
            out[i] = min(out[i], gap if gap > 0.0 else -overlap(body, solid, m, directions))


@njit
def is_convex(vertices, triangles, slack_mm):
    """Whether no vertex (v, 3) stands out beyond the plane of any triangle (t, 3) by more than the slack."""
    n = np.empty(3)
    for t in range(len(triangles)):
        a, b, c = vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]]
        n[X], n[Y], n[Z] = cross(b - a, c - a)
        size = math.sqrt(n[X] * n[X] + n[Y] * n[Y] + n[Z] * n[Z])
        level = a[X] * n[X] + a[Y] * n[Y] + a[Z] * n[Z] + slack_mm * size
        for v in range(len(vertices)):
            if size > 0.0 and vertices[v, X] * n[X] + vertices[v, Y] * n[Y] + vertices[v, Z] * n[Z] > level:
                return False
    return True


@njit
def spheres(points, first):
    """(k, 4) middle of the box round each piece, and how far its corners are from there."""
    out = np.empty((len(first) - 1, 4))
    for i in range(len(out)):
        piece = points[first[i]:first[i + 1]]
        for c in range(3):
            out[i, c] = 0.5 * (piece[:, c].min() + piece[:, c].max())
        far = 0.0
        for k in range(len(piece)):
            far = max(far, _apart(piece[k], out[i]))
        out[i, RADIUS] = far
    return out


@njit
def tree_of(found, leaves):
    """(2 leaves - 1, 4) nodes over the spheres of pieces (k, 4): each holds the two below it."""
    nodes = np.full((2 * leaves - 1, 4), -1.0)
    for i in range(len(found)):
        put(nodes[leaves - 1 + i], found[i])
    for k in range(leaves - 2, -1, -1):
        _put_round_both(nodes[2 * k + 1], nodes[2 * k + 2], nodes[k])
    return nodes


@njit
def _apart(a, b):
    """Distance of two points."""
    return math.sqrt((a[X] - b[X]) ** 2 + (a[Y] - b[Y]) ** 2 + (a[Z] - b[Z]) ** 2)


@njit
def _put_round_both(a, b, out):
    """A sphere that holds two; a radius below 0: there is none."""
    apart = _apart(a, b)
    if b[RADIUS] < 0.0 or a[RADIUS] >= 0.0 and apart + b[RADIUS] <= a[RADIUS]:
        put(out, a)
    elif a[RADIUS] < 0.0 or apart + a[RADIUS] <= b[RADIUS]:
        put(out, b)
    else:
        radius = 0.5 * (apart + a[RADIUS] + b[RADIUS])
        for c in range(3):
            out[c] = a[c] + (b[c] - a[c]) * ((radius - a[RADIUS]) / apart)
        out[RADIUS] = radius
