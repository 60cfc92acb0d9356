"""Nearest point of trimmed faces to a point: a bounding tree over pieces of patches and of edges, Newton at its leaves.

A leaf is bounded by its box and by a second box along its middle's normal and tangents; what cannot come nearer than
the best point so far is passed over.  The distance to a piece has one minimum when the point is nearer than the piece's
smallest radius of curvature: one Newton run finds it.  Otherwise the piece is halved until each part is proven convex
in the squared distance, or proven to hold nothing nearer.
"""

import numpy as np

from cuspline.surfaces.enclosures import _add, _dot, _largest_over_piece, _quotients, _recentred, _scaled, shifted
from cuspline.surfaces.face_pieces import INSIDE
from cuspline.surfaces.patches import derive, patch_at
from cuspline.surfaces.trims import is_inside
from cuspline.values.compiled import njit
from cuspline.values.rows import put

CHUNK = 256             # points that a thread takes at a time, each beginning with the leaf of the one before
STACK = 128             # open nodes: twice the depth of a tree of 2^60 leaves
STARTS = 9              # Newton runs on a stretch of an edge that may hold several minima
STEPS = 30              # Newton steps at a leaf
LAST = 1e-7             # a Newton step this small in local parameters is the last, taken along the tangents
STOPPED = 1e-15         # a step this small in local parameters ends the iteration
NOWHERE = -1
PARTS = 400             # parts of one leaf looked at for one point: only at a centre of curvature it takes more
DEPTH = 40
SAME = 1.0 - 1e-12      # share of a squared distance below which a part may still hold a nearer point


@njit(error_model="numpy")
def _box_distance(boxes, k, x, y, z):
    """Squared distance of a point to box k of (n, 6): low, high."""
    dx = max(boxes[k, 0] - x, 0.0, x - boxes[k, 3])
    dy = max(boxes[k, 1] - y, 0.0, y - boxes[k, 4])
    dz = max(boxes[k, 2] - z, 0.0, z - boxes[k, 5])
    return dx * dx + dy * dy + dz * dz


@njit(error_model="numpy")
def nearest(tree, patches, trims, q, face, ignore_trim, first_leaf, out, d, stack, reach, parts, work, best):
    """Nearest point to q.

    Args:
        tree: (node boxes, children, order, leaf boxes, leaf geometry, leaf rows, curves): see `projection.ClosestTree`.
        patches, trims: arrays of PatchSet and TrimSet.
        face: only this face, or NOWHERE for all.
        ignore_trim: take every point of the pieces.
        first_leaf: leaf looked at before all others, or NOWHERE.
        out: (5,) filled: x, y, z, u, v (u and v NaN on an edge's curve).
        d, stack, reach, parts, work: (6, 3), (STACK,) int, (STACK,), (DEPTH, 4), (degrees + 1, 4): work.
        best: largest squared distance looked for.
    Returns:
        (squared distance, leaf); (best, NOWHERE) if nothing is nearer.
    """
    nodes, children, order, boxes = tree[0], tree[1], tree[2], tree[3]
    x, y, z = q[0], q[1], q[2]
    found = NOWHERE
    if first_leaf >= 0:
        best, found = _visit(tree, patches, trims, q, face, ignore_trim, first_leaf, out, d, parts, work, best, found)
    stack[0], reach[0], top = 0, _box_distance(nodes, 0, x, y, z), 1
    while top > 0:
        top -= 1
        if reach[top] >= best:
            continue
        node = stack[top]
        left, right = children[node, 0], children[node, 1]
        if left < 0:
            for k in range(-left - 1, right):
                leaf = order[k]
                if leaf != first_leaf and _box_distance(boxes, leaf, x, y, z) < best:
                    best, found = _visit(tree, patches, trims, q, face, ignore_trim, leaf, out, d, parts, work, best,
                                         found)
            continue
        dl, dr = _box_distance(nodes, left, x, y, z), _box_distance(nodes, right, x, y, z)
        if dl < dr:
            stack[top], reach[top], stack[top + 1], reach[top + 1] = right, dr, left, dl
        else:
            stack[top], reach[top], stack[top + 1], reach[top + 1] = left, dl, right, dr
        top += 2
    return best, found


@njit(error_model="numpy")
def _visit(tree, patches, trims, q, face, ignore_trim, leaf, out, d, parts, work, best, found):
    geometry, rows = tree[4], tree[5]
    if face >= 0 and rows[leaf, 0] != face or ignore_trim and rows[leaf, 2] < 0:
        return best, found
    rx, ry, rz = q[0] - geometry[leaf, 0], q[1] - geometry[leaf, 1], q[2] - geometry[leaf, 2]
    nx, ny, nz = geometry[leaf, 3], geometry[leaf, 4], geometry[leaf, 5]
    ex, ey, ez = geometry[leaf, 19], geometry[leaf, 20], geometry[leaf, 21]
    up, along = rx * nx + ry * ny + rz * nz, rx * ex + ry * ey + rz * ez
    aside = rx * (ny * ez - nz * ey) + ry * (nz * ex - nx * ez) + rz * (nx * ey - ny * ex)
    off, beside = max(abs(up) - geometry[leaf, 6], 0.0), max(abs(along) - geometry[leaf, 22], 0.0)
    across = max(abs(aside) - geometry[leaf, 23], 0.0)
    if off * off + beside * beside + across * across >= best:
        return best, found
    if rows[leaf, 2] < 0:
        is_simple = _is_simple_stretch(geometry[leaf], rx, ry, rz)
    else:
        is_simple = _is_simple(geometry[leaf], up, along, aside, rx * rx + ry * ry + rz * rz)
    s = rx * geometry[leaf, 7] + ry * geometry[leaf, 8] + rz * geometry[leaf, 9]
    t = rx * geometry[leaf, 10] + ry * geometry[leaf, 11] + rz * geometry[leaf, 12]
    box = geometry[leaf, 15:19]
    hs, ht = (box[1] - box[0]) / 2, (box[3] - box[2]) / 2
    ms, mt = (box[0] + box[1]) / 2, (box[2] + box[3]) / 2
    if rows[leaf, 2] < 0:
        for k in range(1 if is_simple else STARTS):
            a = min(max(s, -1.0), 1.0) if k == 0 else -1.0 + 2.0 * k / STARTS
            value = _on_curve(tree[6], rows[leaf, 1], rows[leaf, 3], q, ms + a * hs, box, d)
            if value < best:
                best, found = value, leaf
                out[0], out[1], out[2], out[3], out[4] = d[0, 0], d[0, 1], d[0, 2], np.nan, np.nan
        return best, found
    inside = ignore_trim or rows[leaf, 2] == INSIDE
    a, b = ms + min(max(s, -1.0), 1.0) * hs, mt + min(max(t, -1.0), 1.0) * ht
    before = best
    best = _take(patches, trims, rows[leaf, 0], rows[leaf, 1], q, a, b, box, inside, out, d, best)
    if not is_simple:
        best = _by_parts(patches, trims, rows[leaf, 0], rows[leaf, 1], q, box, inside, out, d, parts, work, best)
    if best < before:
        found = leaf
    return best, found


@njit(error_model="numpy")
def _is_simple(g, up, along, aside, square):
    """Every perpendicular from a point to the piece is a shortest one: there is one at most.

    It is where its length along the normal, times the curvature to that side, stays below one.

    Args:
        up, along, aside: way from the piece's middle to the point, in the piece's normal and tangents.
        square: of that way.
    """
    slack = abs(along) * g[25] + abs(aside) * g[26] + g[27]
    less = up * (1.0 - 0.5 * (g[25] * g[25] + g[26] * g[26]))
    if (max(up, less) + slack) * g[24] < 1.0 and (slack - min(up, less)) * g[13] < 1.0:
        return True
    return (np.sqrt(square) + g[14]) * max(g[13], g[24]) < 1.0


@njit(error_model="numpy")
def _is_simple_stretch(g, rx, ry, rz):
    """The same of a stretch of an edge: the way to the point along the curvature stays shorter than the radius."""
    toward = rx * g[10] + ry * g[11] + rz * g[12]
    far = np.sqrt(rx * rx + ry * ry + rz * rz)
    return min(toward + far * g[24] + g[14] * g[13], (far + g[14]) * g[13]) < 1.0


@njit(error_model="numpy")
def _take(patches, trims, face, patch, q, s, t, box, inside, out, d, best):
    """One Newton run; the place into out where it is nearer than best and within the trim.  Returns the new best."""
    value, s, t = _on_patch(patches, patch, q, s, t, box, d)
    if value < best:
        span = patches[2]
        u = (span[patch, 0] + span[patch, 1] + s * (span[patch, 1] - span[patch, 0])) / 2
        v = (span[patch, 2] + span[patch, 3] + t * (span[patch, 3] - span[patch, 2])) / 2
        if inside or is_inside(trims, face, u, v):
            out[0], out[1], out[2], out[3], out[4] = d[0, 0], d[0, 1], d[0, 2], u, v
            return value
    return best


@njit(error_model="numpy")
def _by_parts(patches, trims, face, patch, q, box, inside, out, d, parts, work, best):
    """Halve a piece until its parts are convex in the squared distance or hold nothing nearer."""
    row, top = patches[1][patch], 1
    put(parts[0], box)
    center = np.empty(3)
    for _ in range(PARTS):
        if top == 0:
            break
        top -= 1
        part = parts[top].copy()
        shifted(patches[0], row, part, work)
        _recentred(work, row[2], row[3], center)
        S, Ss, St, Sss, Sst, Stt = _quotients(work, row[2], row[3], row[4] != 0)
        r = (_add(S[0], (center[0] - q[0], 0.0, 0.0, 0.0)), _add(S[1], (center[1] - q[1], 0.0, 0.0, 0.0)),
             _add(S[2], (center[2] - q[2], 0.0, 0.0, 0.0)))
        f = _dot(r, r)
        if f[0] - abs(f[1]) - abs(f[2]) - f[3] >= best * SAME:
            continue
        hss, hst = _add(_dot(Ss, Ss), _dot(r, Sss)), _add(_dot(Ss, St), _dot(r, Sst))
        htt = _add(_dot(St, St), _dot(r, Stt))
        is_convex = _largest_over_piece(_scaled(-1.0, hss), _scaled(-1.0, hst), _scaled(-1.0, htt)) < 0.0
        ms, mt = (part[0] + part[1]) / 2, (part[2] + part[3]) / 2
        best = _take(patches, trims, face, patch, q, ms, mt, part, inside, out, d, best)
        if is_convex or top + 2 > DEPTH:
            continue
        put(parts[top], part)
        put(parts[top + 1], part)
        if abs(hss[1]) + abs(hss[2]) + hss[3] + abs(hss[0]) > abs(htt[1]) + abs(htt[2]) + htt[3] + abs(htt[0]):
            parts[top, 1], parts[top + 1, 0] = ms, ms
        else:
            parts[top, 3], parts[top + 1, 2] = mt, mt
        top += 2
    return best


@njit(error_model="numpy")
def _on_patch(patches, patch, q, s, t, box, d):
    """Local minimum of the squared distance over a rectangle of a patch: (value, s, t), the point in d[0].

    Newton with the full second derivatives where they are positive definite, Gauss-Newton elsewhere; a parameter that
    rests on the rectangle's border stays there while the slope pushes outward.
    """
    coefficients, row = patches[0], patches[1][patch]
    offset, du, dv, is_rational = row[1], row[2], row[3], row[4] != 0
    derive(coefficients, offset, du, dv, is_rational, s, t, d)
    rx, ry, rz = d[0, 0] - q[0], d[0, 1] - q[1], d[0, 2] - q[2]
    value = rx * rx + ry * ry + rz * rz
    for _ in range(STEPS):
        gs, gt = rx * d[1, 0] + ry * d[1, 1] + rz * d[1, 2], rx * d[2, 0] + ry * d[2, 1] + rz * d[2, 2]
        E = d[1, 0] * d[1, 0] + d[1, 1] * d[1, 1] + d[1, 2] * d[1, 2]
        F = d[1, 0] * d[2, 0] + d[1, 1] * d[2, 1] + d[1, 2] * d[2, 2]
        G = d[2, 0] * d[2, 0] + d[2, 1] * d[2, 1] + d[2, 2] * d[2, 2]
        a = E + rx * d[3, 0] + ry * d[3, 1] + rz * d[3, 2]
        b = F + rx * d[4, 0] + ry * d[4, 1] + rz * d[4, 2]
        c = G + rx * d[5, 0] + ry * d[5, 1] + rz * d[5, 2]
        held_s = (s <= box[0] and gs > 0.0) or (s >= box[1] and gs < 0.0)
        held_t = (t <= box[2] and gt > 0.0) or (t >= box[3] and gt < 0.0)
        if held_s and held_t:
            break
        if not (a > 0.0 and c > 0.0 and a * c - b * b > 1e-12 * a * c):
            a, b, c = E + 1e-300, F, G + 1e-300
            if a * c - b * b <= 1e-12 * a * c:
                b = 0.0
        if held_s:
            ps, pt = 0.0, -gt / c
        elif held_t:
            ps, pt = -gs / a, 0.0
        else:
            det = a * c - b * b
            ps, pt = (b * gt - c * gs) / det, (b * gs - a * gt) / det
        if abs(ps) < LAST and abs(pt) < LAST and box[0] <= s + ps <= box[1] and box[2] <= t + pt <= box[3]:
            s, t = s + ps, t + pt           # quadratic convergence: what is left is below rounding
            rx, ry, rz = (rx + ps * d[1, 0] + pt * d[2, 0], ry + ps * d[1, 1] + pt * d[2, 1],
                          rz + ps * d[1, 2] + pt * d[2, 2])
            value = rx * rx + ry * ry + rz * rz
            break
        # Newton's direction cut off at the rectangle may climb: the slope scaled by each tangent's own length does not
        moved = done = False
        for attempt in range(2):
            if attempt == 1:
                ps, pt = (0.0 if held_s else -gs / (E + 1e-300)), (0.0 if held_t else -gt / (G + 1e-300))
            share = 1.0
            for _ in range(30):
                s1, t1 = min(max(s + share * ps, box[0]), box[1]), min(max(t + share * pt, box[2]), box[3])
                if abs(s1 - s) <= STOPPED and abs(t1 - t) <= STOPPED:
                    break
                derive(coefficients, offset, du, dv, is_rational, s1, t1, d)
                x, y, z = d[0, 0] - q[0], d[0, 1] - q[1], d[0, 2] - q[2]
                next_value = x * x + y * y + z * z
                if next_value < value:
                    done = abs(s1 - s) < 1e-9 and abs(t1 - t) < 1e-9
                    rx, ry, rz, value, s, t, moved = x, y, z, next_value, s1, t1, True
                    break
                if abs(s1 - s) < 1e-8 and abs(t1 - t) < 1e-8:      # down to rounding: either place is as good
                    break
                share *= 0.25
            if moved:
                break
        if done or not moved:
            break
    derive_point(d, q, rx, ry, rz)
    return value, s, t


@njit(error_model="numpy")
def derive_point(d, q, rx, ry, rz):
    """The kept place as a point into d[0] (the last trial may have been a worse one)."""
    d[0, 0], d[0, 1], d[0, 2] = q[0] + rx, q[1] + ry, q[2] + rz


@njit(error_model="numpy")
def _curve_at(curves, offset, degree, s, d):
    """Point, first and second derivative of a rational polynomial curve into d[0..2]."""
    w = w1 = w2 = 0.0
    for b in range(4):
        k = 3 - b
        p = p1 = p2 = 0.0
        for i in range(degree, -1, -1):
            p2 = p2 * s + p1
            p1 = p1 * s + p
            p = p * s + curves[offset + 4 * i + k]
        p2 = 2.0 * p2
        if k == 3:
            w, w1, w2 = p, p1, p2
            continue
        p = p / w
        p1 = (p1 - w1 * p) / w
        p2 = (p2 - 2.0 * w1 * p1 - w2 * p) / w
        d[0, k], d[1, k], d[2, k] = p, p1, p2


@njit(error_model="numpy")
def _on_curve(curves, offset, degree, q, s, box, d):
    """Local minimum of the squared distance over a stretch of a curve; the point in d[0]."""
    value = np.inf
    low, high, before = box[0], box[1], 0.0
    for _ in range(STEPS):
        _curve_at(curves, offset, degree, s, d)
        rx, ry, rz = d[0, 0] - q[0], d[0, 1] - q[1], d[0, 2] - q[2]
        now = rx * rx + ry * ry + rz * rz
        g = rx * d[1, 0] + ry * d[1, 1] + rz * d[1, 2]
        E = d[1, 0] * d[1, 0] + d[1, 1] * d[1, 1] + d[1, 2] * d[1, 2]
        if now > value:                                 # too far: halfway back
            s1 = (s + before) / 2
        else:
            value, before = now, s
            h = E + rx * d[2, 0] + ry * d[2, 1] + rz * d[2, 2]
            s1 = min(max(s - g / (h if h > 0.1 * E else E + 1e-300), low), high)
        if abs(s1 - s) <= 1e-13:
            break
        s = s1
    _curve_at(curves, offset, degree, before, d)
    rx, ry, rz = d[0, 0] - q[0], d[0, 1] - q[1], d[0, 2] - q[2]
    return rx * rx + ry * ry + rz * rz


@njit(error_model="numpy")
def _finish(tree, patches, trims, leaf, beside, out, d, stack, reach, parts, work, point, uv, normal):
    """Parameters and outward normal; an edge's are those of the nearest point of the face that it borders.

    Returns the face, and a leaf of it beside the edge (before: of the last point on one, or NOWHERE).
    """
    face = tree[5][leaf, 0]
    point[0], point[1], point[2] = out[0], out[1], out[2]
    if out[3] != out[3]:
        begin = beside if beside >= 0 and tree[5][beside, 0] == face else NOWHERE
        _, beside = nearest(tree, patches, trims, point, face, True, begin, out, d, stack, reach, parts, work, np.inf)
    uv[0], uv[1] = out[3], out[4]
    _normal(patches, face, uv[0], uv[1], d, normal)
    return face, beside


@njit(error_model="numpy")
def _normal(patches, face, u, v, d, normal):
    row, breaks, sign = patches[3][face], patches[4], patches[5][face]
    i = j = 0
    while i < row[1] - 1 and u >= breaks[row[3] + i + 1]:
        i += 1
    while j < row[2] - 1 and v >= breaks[row[4] + j + 1]:
        j += 1
    k = row[0] + i * row[2] + j
    p, span = patches[1][k], patches[2][k]
    s, t = (2.0 * u - span[0] - span[1]) / (span[1] - span[0]), (2.0 * v - span[2] - span[3]) / (span[3] - span[2])
    derive(patches[0], p[1], p[2], p[3], p[4] != 0, s, t, d)
    nx, ny, nz = (d[1, 1] * d[2, 2] - d[1, 2] * d[2, 1], d[1, 2] * d[2, 0] - d[1, 0] * d[2, 2],
                  d[1, 0] * d[2, 1] - d[1, 1] * d[2, 0])
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    normal[0], normal[1], normal[2] = sign * nx / length, sign * ny / length, sign * nz / length


@njit(error_model="numpy")
def project_rows(tree, patches, trims, points, face, distance, foot, owner, uv, normal, is_edge, first, last):
    """Rows first..last-1."""
    out, d, parts = np.empty(5), np.empty((6, 3)), np.empty((DEPTH, 4))
    stack, reach = np.empty(STACK, np.int64), np.empty(STACK)
    degree = 1
    for k in range(patches[1].shape[0]):
        degree = max(degree, patches[1][k, 2], patches[1][k, 3])
    work = np.empty((degree + 1, degree + 1, 4))
    leaf = beside = NOWHERE
    for k in range(first, last):
        begin = leaf if leaf >= 0 and (face[k] < 0 or tree[5][leaf, 0] == face[k]) else NOWHERE
        value, leaf = nearest(tree, patches, trims, points[k], face[k], False, begin, out, d, stack, reach, parts, work,
                              np.inf)
        if leaf < 0:
            distance[k], owner[k], is_edge[k] = np.inf, NOWHERE, False
            foot[k], uv[k], normal[k] = np.nan, np.nan, np.nan
            continue
        is_edge[k] = tree[5][leaf, 2] < 0
        owner[k], beside = _finish(tree, patches, trims, leaf, beside, out, d, stack, reach, parts, work, foot[k], uv[k],
                                   normal[k])
        distance[k] = np.sqrt(value)


@njit(error_model="numpy")
def refine_one(patches, face, q, uv, foot, box, d):
    """Newton across the patches of a face from (u, v) = uv; the answer into uv and foot."""
    row, spans = patches[3][face], patches[2]
    box[0], box[1], box[2], box[3] = -1.0, 1.0, -1.0, 1.0
    for _ in range(STEPS):
        k = patch_at(patches, face, uv[0], uv[1])
        span = spans[k]
        s = (2.0 * uv[0] - span[0] - span[1]) / (span[1] - span[0])
        t = (2.0 * uv[1] - span[2] - span[3]) / (span[3] - span[2])
        value, s, t = _on_patch(patches, k, q, min(max(s, -1.0), 1.0), min(max(t, -1.0), 1.0), box, d)
        foot[0], foot[1], foot[2] = d[0, 0], d[0, 1], d[0, 2]
        u, v = (span[0] + span[1] + s * (span[1] - span[0])) / 2, (span[2] + span[3] + t * (span[3] - span[2])) / 2
        uv[0], uv[1] = u, v
        # on a side shared with a neighbour: go on there
        i, j = (k - row[0]) // row[2], (k - row[0]) % row[2]
        cross_u = 1 if s >= 1.0 and i + 1 < row[1] else (-1 if s <= -1.0 and i > 0 else 0)
        cross_v = 1 if t >= 1.0 and j + 1 < row[2] else (-1 if t <= -1.0 and j > 0 else 0)
        if cross_u == 0 and cross_v == 0:
            return value
        beside = k + cross_u * row[2] + cross_v
        other = spans[beside]
        a = -1.0 * cross_u if cross_u != 0 else s
        b = -1.0 * cross_v if cross_v != 0 else t
        next_value, a, b = _on_patch(patches, beside, q, a, b, box, d)
        if not next_value < value:
            return value
        foot[0], foot[1], foot[2] = d[0, 0], d[0, 1], d[0, 2]
        uv[0] = (other[0] + other[1] + a * (other[1] - other[0])) / 2
        uv[1] = (other[2] + other[3] + b * (other[3] - other[2])) / 2
        if abs(a) < 1.0 and abs(b) < 1.0:
            return next_value
    return value


@njit(error_model="numpy")
def refine_rows(patches, face, points, uv, foot, first, last):
    """Rows first..last-1 of `refine_one`."""
    box, d = np.empty(4), np.empty((6, 3))
    for k in range(first, last):
        refine_one(patches, face[k], points[k], uv[k], foot[k], box, d)
