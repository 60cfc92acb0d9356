"""Nearest point of trimmed faces to a point: a bounding tree over pieces of patches and of edges, Newton at its leaves.

A leaf is bounded by its box and by a second box along its middle's normal and tangents; what cannot come nearer than
the best point so far is passed over.  The distance to a piece has one minimum when the point is nearer than the piece's
smallest radius of curvature: one Newton run finds it.  Otherwise the piece is halved until each part is proven convex
in the squared distance, or proven to hold nothing nearer; of cylinders, cones and circles a closed form says it.
"""

import numpy as np

from cuspline.surfaces.enclosures import (
    BY_S,
    BY_T,
    MID,
    REST,
    S_HIGH,
    S_LOW,
    T_HIGH,
    T_LOW,
    _add,
    _dot,
    _largest_over_piece,
    _quotients,
    _recentred,
    _scaled,
    shifted,
)
from cuspline.surfaces.face_pieces import INSIDE
from cuspline.surfaces.patches import (
    BREAKS_U,
    BREAKS_V,
    DEGREE_U,
    DEGREE_V,
    DS,
    DSS,
    DST,
    DT,
    DTT,
    FIRST_PATCH,
    IS_RATIONAL,
    OFFSET,
    POINT,
    SPANS_U,
    SPANS_V,
    U_HIGH,
    U_LOW,
    V_HIGH,
    V_LOW,
    U,
    V,
    derive,
    patch_at,
)
from cuspline.surfaces.projection_tree import (
    BEND_CHANGE,
    BENDS,
    CURVATURE,
    CURVATURE_TOWARD,
    DUAL_S,
    DUAL_T,
    FARTHEST,
    LEAF_DEGREE,
    LEAF_FACE,
    LEAF_PATCH,
    LEAF_STATE,
    LEFT,
    MIDDLE,
    NORMAL,
    NORMALS_ACROSS,
    NORMALS_ALONG,
    RECTANGLE,
    RIGHT,
    TANGENT,
    THICKNESS,
    TINY_MM,
    WAY_TO_MIDDLE,
    WIDTH_ACROSS,
    WIDTH_ALONG,
)
from cuspline.surfaces.round_pieces import RADIUS, least_square
from cuspline.surfaces.trims import is_inside
from cuspline.values.compiled import njit
from cuspline.values.rows import HIGH_X, HIGH_Y, HIGH_Z, LOW_X, LOW_Y, LOW_Z, X, Y, Z, put

CHUNK = 256             # points that a thread takes at a time, each beginning with the leaf of the one before
STACK = 128             # open nodes: twice the depth of a tree of 2^60 leaves
STARTS = 9              # Newton runs on a stretch of an edge that may hold several minima
STEPS = 30              # Newton steps at a leaf
LAST = 1e-7             # a Newton step this small in local parameters is the last, taken along the tangents
STOPPED = 1e-15         # a step this small in local parameters ends the iteration
NOWHERE = -1
AT_U, AT_V = 3, 4       # of an answer, behind its point
PARTS = 400             # parts of one leaf looked at for one point: only at a centre of curvature it takes more
DEPTH = 40
SAME = 1.0 - 1e-12      # share of a squared distance below which a part may still hold a nearer point


@njit(error_model="numpy")
def _box_distance(boxes, k, x, y, z):
    """Squared distance of a point to box k of (n, 6): low, high."""
    dx = max(boxes[k, LOW_X] - x, 0.0, x - boxes[k, HIGH_X])
    dy = max(boxes[k, LOW_Y] - y, 0.0, y - boxes[k, HIGH_Y])
    dz = max(boxes[k, LOW_Z] - z, 0.0, z - boxes[k, HIGH_Z])
    return dx * dx + dy * dy + dz * dz


@njit(error_model="numpy")
def nearest(tree, patches, trims, q, face, ignore_trim, first_leaf, out, d, stack, reach, parts, work, best):
    """Nearest point to q.

    Args:
        tree: `projection_tree.TreeArrays`.   patches, trims: arrays of PatchSet and TrimSet.
        face: only this face, or NOWHERE for all.
        ignore_trim: take every point of the pieces.
        first_leaf: leaf looked at before all others, or NOWHERE.
        out: (5,) filled: x, y, z, u, v (u and v NaN on an edge's curve).
        d, stack, reach, parts, work: (6, 3), (STACK,) int, (STACK,), (DEPTH, 4), (degrees + 1, 4): work.
        best: largest squared distance looked for.
    Returns:
        (squared distance, leaf); (best, NOWHERE) if nothing is nearer.
    """
    nodes, children, order, boxes = tree.nodes, tree.children, tree.order, tree.boxes
    x, y, z = q[X], q[Y], q[Z]
    found = NOWHERE
    if first_leaf >= 0:
        best, found = _visit(tree, patches, trims, q, face, ignore_trim, first_leaf, out, d, parts, work, best, found)
    stack[0], reach[0], top = 0, _box_distance(nodes, 0, x, y, z), 1
    while top > 0:
        top -= 1
        if reach[top] >= best:
            continue
        node = stack[top]
        left, right = children[node, LEFT], children[node, RIGHT]
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
    geometry, rows = tree.geometry, tree.rows
    if face >= 0 and rows[leaf, LEAF_FACE] != face or ignore_trim and rows[leaf, LEAF_STATE] < 0:
        return best, found
    rx, ry, rz = q[X] - geometry[leaf, MIDDLE + X], q[Y] - geometry[leaf, MIDDLE + Y], q[Z] - geometry[leaf, MIDDLE + Z]
    nx, ny, nz = geometry[leaf, NORMAL + X], geometry[leaf, NORMAL + Y], geometry[leaf, NORMAL + Z]
    ex, ey, ez = geometry[leaf, TANGENT + X], geometry[leaf, TANGENT + Y], geometry[leaf, TANGENT + Z]
    up, along = rx * nx + ry * ny + rz * nz, rx * ex + ry * ey + rz * ez
    aside = rx * (ny * ez - nz * ey) + ry * (nz * ex - nx * ez) + rz * (nx * ey - ny * ex)
    off, beside = max(abs(up) - geometry[leaf, THICKNESS], 0.0), max(abs(along) - geometry[leaf, WIDTH_ALONG], 0.0)
    across = max(abs(aside) - geometry[leaf, WIDTH_ACROSS], 0.0)
    if off * off + beside * beside + across * across >= best:
        return best, found
    if rows[leaf, LEAF_STATE] < 0:
        is_simple = _is_simple_stretch(geometry[leaf], rx, ry, rz)
    else:
        is_simple = geometry[leaf, FARTHEST] < TINY_MM or _is_simple(geometry[leaf], up, along, aside, rx * rx + ry * ry + rz * rz)
    is_round, least = tree.round[leaf, RADIUS] > 0.0 and not is_simple, 0.0
    if is_round:
        least = least_square(tree.round[leaf], q, d[POINT])
        if least >= best * SAME:
            return best, found
        if rows[leaf, LEAF_STATE] < 0:
            out[X], out[Y], out[Z], out[AT_U], out[AT_V] = d[POINT, X], d[POINT, Y], d[POINT, Z], np.nan, np.nan
            return least, leaf
    s = rx * geometry[leaf, DUAL_S + X] + ry * geometry[leaf, DUAL_S + Y] + rz * geometry[leaf, DUAL_S + Z]
    t = rx * geometry[leaf, DUAL_T + X] + ry * geometry[leaf, DUAL_T + Y] + rz * geometry[leaf, DUAL_T + Z]
    box = geometry[leaf, RECTANGLE:TANGENT]
    hs, ht = (box[S_HIGH] - box[S_LOW]) / 2, (box[T_HIGH] - box[T_LOW]) / 2
    ms, mt = (box[S_LOW] + box[S_HIGH]) / 2, (box[T_LOW] + box[T_HIGH]) / 2
    if rows[leaf, LEAF_STATE] < 0:
        for k in range(1 if is_simple else STARTS):
            a = min(max(s, -1.0), 1.0) if k == 0 else -1.0 + 2.0 * k / STARTS
            value = _on_curve(tree.curves, rows[leaf, LEAF_PATCH], rows[leaf, LEAF_DEGREE], q, ms + a * hs, box, d)
            if value < best:
                best, found = value, leaf
                out[X], out[Y], out[Z], out[AT_U], out[AT_V] = d[POINT, X], d[POINT, Y], d[POINT, Z], np.nan, np.nan
        return best, found
    inside = ignore_trim or rows[leaf, LEAF_STATE] == INSIDE
    a, b = ms + min(max(s, -1.0), 1.0) * hs, mt + min(max(t, -1.0), 1.0) * ht
    before = best
    best = _take(patches, trims, rows[leaf, LEAF_FACE], rows[leaf, LEAF_PATCH], q, a, b, box, inside, out, d, best)
    if not is_simple and not (is_round and least >= best * SAME):
        best = _by_parts(patches, trims, rows[leaf, LEAF_FACE], rows[leaf, LEAF_PATCH], q, box, inside, out, d, parts,
                         work, best)
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
    lean_along, lean_across = g[NORMALS_ALONG], g[NORMALS_ACROSS]
    slack = abs(along) * lean_along + abs(aside) * lean_across + g[WAY_TO_MIDDLE]
    less = up * (1.0 - 0.5 * (lean_along * lean_along + lean_across * lean_across))
    if (max(up, less) + slack) * g[CURVATURE_TOWARD] < 1.0 and (slack - min(up, less)) * g[CURVATURE] < 1.0:
        return True
    return (np.sqrt(square) + g[FARTHEST]) * max(g[CURVATURE], g[CURVATURE_TOWARD]) < 1.0


@njit(error_model="numpy")
def _is_simple_stretch(g, rx, ry, rz):
    """The same of a stretch of an edge: the way to the point along the curvature stays shorter than the radius."""
    toward = rx * g[BENDS + X] + ry * g[BENDS + Y] + rz * g[BENDS + Z]
    far = np.sqrt(rx * rx + ry * ry + rz * rz)
    return min(toward + far * g[BEND_CHANGE] + g[FARTHEST] * g[CURVATURE], (far + g[FARTHEST]) * g[CURVATURE]) < 1.0


@njit(error_model="numpy")
def _take(patches, trims, face, patch, q, s, t, box, inside, out, d, best):
    """One Newton run; the place into out where it is nearer than best and within the trim.  Returns the new best."""
    value, s, t = _on_patch(patches, patch, q, s, t, box, d)
    if value < best:
        span = patches.span
        u = (span[patch, U_LOW] + span[patch, U_HIGH] + s * (span[patch, U_HIGH] - span[patch, U_LOW])) / 2
        v = (span[patch, V_LOW] + span[patch, V_HIGH] + t * (span[patch, V_HIGH] - span[patch, V_LOW])) / 2
        if inside or is_inside(trims, face, u, v):
            out[X], out[Y], out[Z], out[AT_U], out[AT_V] = d[POINT, X], d[POINT, Y], d[POINT, Z], u, v
            return value
    return best


@njit(error_model="numpy")
def _by_parts(patches, trims, face, patch, q, box, inside, out, d, parts, work, best):
    """Halve a piece until its parts are convex in the squared distance or hold nothing nearer."""
    row, top = patches.patch[patch], 1
    put(parts[0], box)
    center = np.empty(3)
    for _ in range(PARTS):
        if top == 0:
            break
        top -= 1
        part = parts[top].copy()
        shifted(patches.coefficients, row, part, work)
        _recentred(work, row[DEGREE_U], row[DEGREE_V], center)
        S, Ss, St, Sss, Sst, Stt = _quotients(work, row[DEGREE_U], row[DEGREE_V], row[IS_RATIONAL] != 0)
        r = (_add(S[X], (center[X] - q[X], 0.0, 0.0, 0.0)), _add(S[Y], (center[Y] - q[Y], 0.0, 0.0, 0.0)),
             _add(S[Z], (center[Z] - q[Z], 0.0, 0.0, 0.0)))
        f = _dot(r, r)
        if f[MID] - abs(f[BY_S]) - abs(f[BY_T]) - f[REST] >= best * SAME:
            continue
        hss, hst = _add(_dot(Ss, Ss), _dot(r, Sss)), _add(_dot(Ss, St), _dot(r, Sst))
        htt = _add(_dot(St, St), _dot(r, Stt))
        is_convex = _largest_over_piece(_scaled(-1.0, hss), _scaled(-1.0, hst), _scaled(-1.0, htt)) < 0.0
        ms, mt = (part[S_LOW] + part[S_HIGH]) / 2, (part[T_LOW] + part[T_HIGH]) / 2
        best = _take(patches, trims, face, patch, q, ms, mt, part, inside, out, d, best)
        if is_convex or top + 2 > DEPTH:
            continue
        put(parts[top], part)
        put(parts[top + 1], part)
        if (abs(hss[BY_S]) + abs(hss[BY_T]) + hss[REST] + abs(hss[MID]) > abs(htt[BY_S]) + abs(htt[BY_T]) + htt[REST]
                + abs(htt[MID])):
            parts[top, S_HIGH], parts[top + 1, S_LOW] = ms, ms
        else:
            parts[top, T_HIGH], parts[top + 1, T_LOW] = mt, mt
        top += 2
    return best


@njit(error_model="numpy")
def _on_patch(patches, patch, q, s, t, box, d):
    """Local minimum of the squared distance over a rectangle of a patch: (value, s, t), the point in d[0].

    Newton with the full second derivatives where they are positive definite, Gauss-Newton elsewhere; a parameter that
    rests on the rectangle's border stays there while the slope pushes outward.
    """
    coefficients, row = patches.coefficients, patches.patch[patch]
    offset, du, dv, is_rational = row[OFFSET], row[DEGREE_U], row[DEGREE_V], row[IS_RATIONAL] != 0
    derive(coefficients, offset, du, dv, is_rational, s, t, d)
    rx, ry, rz = d[POINT, X] - q[X], d[POINT, Y] - q[Y], d[POINT, Z] - q[Z]
    value = rx * rx + ry * ry + rz * rz
    for _ in range(STEPS):
        gs, gt = rx * d[DS, X] + ry * d[DS, Y] + rz * d[DS, Z], rx * d[DT, X] + ry * d[DT, Y] + rz * d[DT, Z]
        E = d[DS, X] * d[DS, X] + d[DS, Y] * d[DS, Y] + d[DS, Z] * d[DS, Z]
        F = d[DS, X] * d[DT, X] + d[DS, Y] * d[DT, Y] + d[DS, Z] * d[DT, Z]
        G = d[DT, X] * d[DT, X] + d[DT, Y] * d[DT, Y] + d[DT, Z] * d[DT, Z]
        a = E + rx * d[DSS, X] + ry * d[DSS, Y] + rz * d[DSS, Z]
        b = F + rx * d[DST, X] + ry * d[DST, Y] + rz * d[DST, Z]
        c = G + rx * d[DTT, X] + ry * d[DTT, Y] + rz * d[DTT, Z]
        held_s = (s <= box[S_LOW] and gs > 0.0) or (s >= box[S_HIGH] and gs < 0.0)
        held_t = (t <= box[T_LOW] and gt > 0.0) or (t >= box[T_HIGH] and gt < 0.0)
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
        if (abs(ps) < LAST and abs(pt) < LAST and box[S_LOW] <= s + ps <= box[S_HIGH]
                and box[T_LOW] <= t + pt <= box[T_HIGH]):
            s, t = s + ps, t + pt           # quadratic convergence: what is left is below rounding
            rx, ry, rz = (rx + ps * d[DS, X] + pt * d[DT, X], ry + ps * d[DS, Y] + pt * d[DT, Y],
                          rz + ps * d[DS, Z] + pt * d[DT, Z])
            value = rx * rx + ry * ry + rz * rz
            break
        # Newton's direction cut off at the rectangle may climb: the slope scaled by each tangent's own length does not
        moved = done = False
        for attempt in range(2):
            if attempt == 1:
                ps, pt = (0.0 if held_s else -gs / (E + 1e-300)), (0.0 if held_t else -gt / (G + 1e-300))
            share = 1.0
            for _ in range(30):
                s1, t1 = (min(max(s + share * ps, box[S_LOW]), box[S_HIGH]),
                          min(max(t + share * pt, box[T_LOW]), box[T_HIGH]))
                if abs(s1 - s) <= STOPPED and abs(t1 - t) <= STOPPED:
                    break
                derive(coefficients, offset, du, dv, is_rational, s1, t1, d)
                x, y, z = d[POINT, X] - q[X], d[POINT, Y] - q[Y], d[POINT, Z] - q[Z]
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
    d[POINT, X], d[POINT, Y], d[POINT, Z] = q[X] + rx, q[Y] + ry, q[Z] + rz


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
        d[POINT, k], d[DS, k], d[DT, k] = p, p1, p2


@njit(error_model="numpy")
def _on_curve(curves, offset, degree, q, s, box, d):
    """Local minimum of the squared distance over a stretch of a curve; the point in d[0]."""
    value = np.inf
    low, high, before = box[S_LOW], box[S_HIGH], 0.0
    for _ in range(STEPS):
        _curve_at(curves, offset, degree, s, d)
        rx, ry, rz = d[POINT, X] - q[X], d[POINT, Y] - q[Y], d[POINT, Z] - q[Z]
        now = rx * rx + ry * ry + rz * rz
        g = rx * d[DS, X] + ry * d[DS, Y] + rz * d[DS, Z]
        E = d[DS, X] * d[DS, X] + d[DS, Y] * d[DS, Y] + d[DS, Z] * d[DS, Z]
        if now > value:                                 # too far: halfway back
            s1 = (s + before) / 2
        else:
            value, before = now, s
            h = E + rx * d[DT, X] + ry * d[DT, Y] + rz * d[DT, Z]
            s1 = min(max(s - g / (h if h > 0.1 * E else E + 1e-300), low), high)
        if abs(s1 - s) <= 1e-13:
            break
        s = s1
    _curve_at(curves, offset, degree, before, d)
    rx, ry, rz = d[POINT, X] - q[X], d[POINT, Y] - q[Y], d[POINT, Z] - q[Z]
    return rx * rx + ry * ry + rz * rz


@njit(error_model="numpy")
def _finish(tree, patches, trims, leaf, beside, out, d, stack, reach, parts, work, point, uv, normal):
    """Parameters and outward normal; an edge's are those of the nearest point of the face that it borders.

    Returns the face, and a leaf of it beside the edge (before: of the last point on one, or NOWHERE).
    """
    face = tree.rows[leaf, LEAF_FACE]
    point[X], point[Y], point[Z] = out[X], out[Y], out[Z]
    if out[AT_U] != out[AT_U]:
        begin = beside if beside >= 0 and tree.rows[beside, LEAF_FACE] == face else NOWHERE
        _, beside = nearest(tree, patches, trims, point, face, True, begin, out, d, stack, reach, parts, work, np.inf)
    uv[U], uv[V] = out[AT_U], out[AT_V]
    _normal(patches, face, uv[U], uv[V], d, normal)
    return face, beside


@njit(error_model="numpy")
def _normal(patches, face, u, v, d, normal):
    row, breaks, sign = patches.face[face], patches.breaks, patches.sign[face]
    i = j = 0
    while i < row[SPANS_U] - 1 and u >= breaks[row[BREAKS_U] + i + 1]:
        i += 1
    while j < row[SPANS_V] - 1 and v >= breaks[row[BREAKS_V] + j + 1]:
        j += 1
    k = row[FIRST_PATCH] + i * row[SPANS_V] + j
    p, span = patches.patch[k], patches.span[k]
    s, t = ((2.0 * u - span[U_LOW] - span[U_HIGH]) / (span[U_HIGH] - span[U_LOW]),
            (2.0 * v - span[V_LOW] - span[V_HIGH]) / (span[V_HIGH] - span[V_LOW]))
    derive(patches.coefficients, p[OFFSET], p[DEGREE_U], p[DEGREE_V], p[IS_RATIONAL] != 0, s, t, d)
    nx, ny, nz = (d[DS, Y] * d[DT, Z] - d[DS, Z] * d[DT, Y], d[DS, Z] * d[DT, X] - d[DS, X] * d[DT, Z],
                  d[DS, X] * d[DT, Y] - d[DS, Y] * d[DT, X])
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    normal[X], normal[Y], normal[Z] = sign * nx / length, sign * ny / length, sign * nz / length


@njit(error_model="numpy")
def project_rows(tree, patches, trims, points, face, distance, foot, owner, uv, normal, is_edge, first, last):
    """Rows first..last-1."""
    out, d, parts = np.empty(5), np.empty((6, 3)), np.empty((DEPTH, 4))
    stack, reach = np.empty(STACK, np.int64), np.empty(STACK)
    degree = 1
    for k in range(len(patches.patch)):
        degree = max(degree, patches.patch[k, DEGREE_U], patches.patch[k, DEGREE_V])
    work = np.empty((degree + 1, degree + 1, 4))
    leaf = beside = NOWHERE
    for k in range(first, last):
        begin = leaf if leaf >= 0 and (face[k] < 0 or tree.rows[leaf, LEAF_FACE] == face[k]) else NOWHERE
        value, leaf = nearest(tree, patches, trims, points[k], face[k], False, begin, out, d, stack, reach, parts, work,
                              np.inf)
        if leaf < 0:
            distance[k], owner[k], is_edge[k] = np.inf, NOWHERE, False
            foot[k], uv[k], normal[k] = np.nan, np.nan, np.nan
            continue
        is_edge[k] = tree.rows[leaf, LEAF_STATE] < 0
        owner[k], beside = _finish(tree, patches, trims, leaf, beside, out, d, stack, reach, parts, work, foot[k], uv[k],
                                   normal[k])
        distance[k] = np.sqrt(value)


@njit(error_model="numpy")
def refine_one(patches, face, q, uv, foot, box, d):
    """Newton across the patches of a face from (u, v) = uv; the answer into uv and foot."""
    row, spans = patches.face[face], patches.span
    box[S_LOW], box[S_HIGH], box[T_LOW], box[T_HIGH] = -1.0, 1.0, -1.0, 1.0
    for _ in range(STEPS):
        k = patch_at(patches, face, uv[U], uv[V])
        span = spans[k]
        s = (2.0 * uv[U] - span[U_LOW] - span[U_HIGH]) / (span[U_HIGH] - span[U_LOW])
        t = (2.0 * uv[V] - span[V_LOW] - span[V_HIGH]) / (span[V_HIGH] - span[V_LOW])
        value, s, t = _on_patch(patches, k, q, min(max(s, -1.0), 1.0), min(max(t, -1.0), 1.0), box, d)
        foot[X], foot[Y], foot[Z] = d[POINT, X], d[POINT, Y], d[POINT, Z]
        u, v = ((span[U_LOW] + span[U_HIGH] + s * (span[U_HIGH] - span[U_LOW])) / 2,
                (span[V_LOW] + span[V_HIGH] + t * (span[V_HIGH] - span[V_LOW])) / 2)
        uv[U], uv[V] = u, v
        # on a side shared with a neighbour: go on there
        i, j = (k - row[FIRST_PATCH]) // row[SPANS_V], (k - row[FIRST_PATCH]) % row[SPANS_V]
        cross_u = 1 if s >= 1.0 and i + 1 < row[SPANS_U] else (-1 if s <= -1.0 and i > 0 else 0)
        cross_v = 1 if t >= 1.0 and j + 1 < row[SPANS_V] else (-1 if t <= -1.0 and j > 0 else 0)
        if cross_u == 0 and cross_v == 0:
            return value
        beside = k + cross_u * row[SPANS_V] + cross_v
        other = spans[beside]
        a = -1.0 * cross_u if cross_u != 0 else s
        b = -1.0 * cross_v if cross_v != 0 else t
        next_value, a, b = _on_patch(patches, beside, q, a, b, box, d)
        if not next_value < value:
            return value
        foot[X], foot[Y], foot[Z] = d[POINT, X], d[POINT, Y], d[POINT, Z]
        uv[U] = (other[U_LOW] + other[U_HIGH] + a * (other[U_HIGH] - other[U_LOW])) / 2
        uv[V] = (other[V_LOW] + other[V_HIGH] + b * (other[V_HIGH] - other[V_LOW])) / 2
        if abs(a) < 1.0 and abs(b) < 1.0:
            return next_value
    return value


@njit(error_model="numpy")
def refine_rows(patches, face, points, uv, foot, first, last):
    """Rows first..last-1 of `refine_one`."""
    box, d = np.empty(4), np.empty((6, 3))
    for k in range(first, last):
        refine_one(patches, face[k], points[k], uv[k], foot[k], box, d)
