"""How deep one straight move cuts into a tree of sub-patches, bounded from above by branch and bound over place and time.

The tips of a stretch of the move run linearly from a to b.  For everything below the plane z = p x + q y + r the
depth is that of a cutter which stands still in the middle, over a rectangle enlarged by half the stretch, under the
plane raised by the larger of p x + q y - z at a and b: the same second-order bound as for a standing cutter.  What
stays above the deepest point known by more than the tolerance is halved, the stretch or the box, whichever is longer.
"""

import math

import numpy as np
from numba import njit

from cuspline.surfaces.patches import derive, scale_derivatives
from cuspline.toolpaths.patch_bounds import BORDER, FACE, OUTSIDE, box_state, cone_box
from cuspline.toolpaths.patch_contacts import bottom, on_rim
from cuspline.toolpaths.patch_search import can_meet, fill_plane, in_trim
from cuspline.toolpaths.patch_tree import LEVEL

STACK = 4096
SMALLEST_MM = 1e-6          # boxes and stretches end here: what is left open then counts as cut
MOST_BOXES = 40_000         # of one move; what is left open then counts as cut
SHORT = 1.0 / 16.0          # of the radius: shorter stretches are halved within leaves only, where depths are known
OUTWARD_MM = 1e-9           # added to every bound: rounding of coordinates below a metre


@njit(cache=True, inline="always", error_model="numpy")
def _rise(slope, low, high, R, is_ball):
    if is_ball:
        s = min(max(slope * R, low), high)
        return slope * s - 0.5 * s * s / R
    return max(slope * low, slope * high)


@njit(cache=True, error_model="numpy")
def stretch_bound(nodes, k, ax, ay, az, bx, by, bz, R, rc):
    """Upper bound of how deep a tip running from a to b cuts into what node k holds; -inf where it passes beside."""
    mx, my, ex, ey = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * abs(bx - ax), 0.5 * abs(by - ay)
    xl, xh, yl, yh = nodes[k, 0] - mx, nodes[k, 1] - mx, nodes[k, 2] - my, nodes[k, 3] - my
    # beside the line of the move, then beside the enlarged rectangle
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    if length > 0.0:
        nx, ny = (by - ay) / length, (ax - bx) / length
        if abs(0.5 * (nx * (xl + xh) + ny * (yl + yh))) - 0.5 * (abs(nx) * (xh - xl) + abs(ny) * (yh - yl)) > R:
            return -np.inf
    xl, xh, yl, yh = xl - ex, xh + ex, yl - ey, yh + ey
    dx, dy = max(xl, -xh, 0.0), max(yl, -yh, 0.0)
    near2 = dx * dx + dy * dy
    if near2 > R * R:
        return -np.inf
    top = nodes[k, 4] - min(az, bz) - bottom(math.sqrt(near2), R, rc)
    a, b = nodes[k, 5], nodes[k, 6]
    raised = nodes[k, 7] + max(a * ax + b * ay - az, a * bx + b * by - bz)
    px = (R - rc) * nodes[k, 10] + rc * nodes[k, 8]
    py = (R - rc) * nodes[k, 11] + rc * nodes[k, 9]
    px, py = min(max(px, xl), xh), min(max(py, yl), yh)
    d2 = px * px + py * py
    if d2 > 0.998 * R * R:              # stay where the bottom has a finite slope
        s = 0.999 * R / math.sqrt(d2)
        px, py, d2 = px * s, py * s, d2 * s * s
    gx, gy, p = a, b, 0.0
    d = math.sqrt(d2)
    e = d - (R - rc)
    if e > 0.0 and rc > 0.0:
        q = math.sqrt(max(rc * rc - e * e, 1e-300))
        p = rc - q
        gx -= e / (q * d) * px
        gy -= e / (q * d) * py
    bound = raised + a * px + b * py - p + _rise(gx, xl - px, xh - px, R, rc == R) \
        + _rise(gy, yl - py, yh - py, R, rc == R)
    if rc < R:                          # the plane alone: highest over the whole cutter
        g = a * nodes[k, 10] + b * nodes[k, 11]
        bound = min(bound, raised + (R - rc) * g + rc * (math.sqrt(1.0 + g * g) - 1.0))
        if rc == 0.0:
            bound = min(bound, raised + on_rim(a, b, xl, xh, yl, yh, R))
    return min(bound, top) + OUTWARD_MM


@njit(cache=True)
def gouge_scratch():
    """What one thread needs for `gouge_of_move`."""
    return np.empty((STACK, 7)), np.empty(STACK, np.int64), np.empty((6, 3)), np.empty(8), np.zeros((1, 12))


@njit(cache=True, error_model="numpy")
def gouge_of_move(tree, start, end, R, rc, tolerance, scratch):
    """(bound of the depth >= 0, where along the move 0..1 the deepest point known is).

    Args:
        tree: as `patch_search.drop_one`.
        start, end: (3,) tips.
        tolerance: the bound exceeds the true depth by no more, but where the halvings end.
        scratch: of `gouge_scratch`.
    """
    rows, tags, nodes, first = tree[5], tree[6], tree[7], tree[8]
    boxes, ids, o, normals, plane = scratch
    vx, vy, vz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    reach = math.sqrt(vx * vx + vy * vy)
    lower, upper, worst, looser = 0.0, 0.0, 0.5, 0.5
    ids[0] = 0
    boxes[0, 1], boxes[0, 2] = 0.0, 1.0
    boxes[0, 0] = stretch_bound(nodes, 0, start[0], start[1], start[2], end[0], end[1], end[2], R, rc)
    top, count = 1, 0
    while top > 0:
        top -= 1
        bound, t0, t1 = boxes[top, 0], boxes[top, 1], boxes[top, 2]
        if bound <= lower + tolerance:
            upper = max(upper, bound)
            continue
        count += 1
        tm = 0.5 * (t0 + t1)
        half = 0.5 * (t1 - t0) * reach
        rise = 0.5 * (t1 - t0) * abs(vz)
        k = ids[top]
        si, ti, alpha, beta = 0.0, 0.0, 1.0, 1.0
        is_node = k >= 0 and first[k] >= 0
        if is_node:
            size = max(0.5 * max(nodes[k, 1] - nodes[k, 0], nodes[k, 3] - nodes[k, 2]), SHORT * R)
            leaf = -1
        else:
            leaf = -1 - first[k] if k >= 0 else -1 - k
            if k < 0:
                si, ti, alpha, beta = boxes[top, 3], boxes[top, 4], boxes[top, 5], boxes[top, 6]
            bound, tip, at = _look_at_box(tree, leaf, si, ti, alpha, beta, k >= 0, start, end, t0, t1, R, rc, bound,
                                          lower, o, normals, plane)
            if tip > lower:
                lower, worst = tip, at
            if bound <= lower + tolerance:
                upper = max(upper, bound)
                continue
            size = max(rows[leaf, 4] * alpha, rows[leaf, 5] * beta)
        if size + half < SMALLEST_MM and rise < SMALLEST_MM or top + 4 > STACK or count > MOST_BOXES:
            if bound > upper:
                upper, looser = bound, tm
            continue
        if half + rise > size:                                  # halve the stretch
            for j in range(2):
                u0, u1 = (t0, tm) if j == 0 else (tm, t1)
                boxes[top, 0] = bound
                if is_node:
                    boxes[top, 0] = min(bound, stretch_bound(
                        nodes, k, start[0] + u0 * vx, start[1] + u0 * vy, start[2] + u0 * vz,
                        start[0] + u1 * vx, start[1] + u1 * vy, start[2] + u1 * vz, R, rc))
                boxes[top, 1], boxes[top, 2] = u0, u1
                boxes[top, 3], boxes[top, 4], boxes[top, 5], boxes[top, 6] = si, ti, alpha, beta
                ids[top] = k if is_node else -1 - leaf
                if boxes[top, 0] <= lower + tolerance:
                    upper = max(upper, boxes[top, 0])
                else:
                    top += 1
        elif is_node:
            a = first[k]
            x0, y0, z0 = start[0] + t0 * vx, start[1] + t0 * vy, start[2] + t0 * vz
            x1, y1, z1 = start[0] + t1 * vx, start[1] + t1 * vy, start[2] + t1 * vz
            ba = stretch_bound(nodes, a, x0, y0, z0, x1, y1, z1, R, rc)
            bb = stretch_bound(nodes, a + 1, x0, y0, z0, x1, y1, z1, R, rc)
            order = (a + 1, a) if ba > bb else (a, a + 1)
            for j in range(2):                                  # the more promising one on top
                b = ba if order[j] == a else bb
                if b <= lower + tolerance:
                    upper = max(upper, b)
                    continue
                ids[top], boxes[top, 0], boxes[top, 1], boxes[top, 2] = order[j], b, t0, t1
                top += 1
        else:
            split_t = rows[leaf, 5] * beta > rows[leaf, 4] * alpha
            for side in (-1.0, 1.0):
                ids[top] = -1 - leaf
                boxes[top, 0], boxes[top, 1], boxes[top, 2] = bound, t0, t1
                boxes[top, 3], boxes[top, 4], boxes[top, 5], boxes[top, 6] = si, ti, alpha, beta
                if split_t:
                    boxes[top, 4], boxes[top, 6] = ti + side * 0.5 * beta, 0.5 * beta
                else:
                    boxes[top, 3], boxes[top, 5] = si + side * 0.5 * alpha, 0.5 * alpha
                top += 1
    if upper > lower + tolerance:
        worst = looser
    return max(upper, lower), worst


@njit(cache=True, error_model="numpy")
def _look_at_box(tree, leaf, si, ti, alpha, beta, is_whole, start, end, t0, t1, R, rc, bound, known, o, normals, plane):
    """(bound, depth at the box's middle, where along the move) of one box of a leaf; `known` or less counts as none."""
    row, tag = tree[5][leaf], tree[6][leaf]
    patch, kind, state = tag[0], tag[1], tag[2]
    s, t, hs, ht = row[0] + row[1] * si, row[2] + row[3] * ti, row[1] * alpha, row[3] * beta
    if kind == FACE and state == BORDER and not is_whole:
        span = tree[2][patch]
        u0, v0 = 0.5 * (span[0] + span[1]), 0.5 * (span[2] + span[3])
        hu, hv = 0.5 * (span[1] - span[0]), 0.5 * (span[3] - span[2])
        if box_state(tree[9], tree[1][patch, 0], u0 + hu * (s - hs), u0 + hu * (s + hs),
                     v0 + hv * (t - ht), v0 + hv * (t + ht)) == OUTSIDE:
            return -np.inf, 0.0, t0
    p = tree[1][patch]
    derive(tree[0], p[1], p[2], p[3], p[4] != 0, s, t, o)
    scale_derivatives(o, hs, ht)
    ax, ay, az = start[0] + t0 * (end[0] - start[0]), start[1] + t0 * (end[1] - start[1]), \
        start[2] + t0 * (end[2] - start[2])
    bx, by, bz = start[0] + t1 * (end[0] - start[0]), start[1] + t1 * (end[1] - start[1]), \
        start[2] + t1 * (end[2] - start[2])
    x, y, mx, my = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * abs(bx - ax), 0.5 * abs(by - ay)
    bend = 0.5 * (row[6] * alpha * alpha + 2.0 * row[7] * alpha * beta + row[8] * beta * beta)
    dx, dy = o[0, 0] - x, o[0, 1] - y
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    if length > 0.0:                                # beside the line of the move
        nx, ny = (by - ay) / length, (ax - bx) / length
        if abs(nx * dx + ny * dy) - abs(nx * o[1, 0] + ny * o[1, 1]) - abs(nx * o[2, 0] + ny * o[2, 1]) - bend \
                > R + OUTWARD_MM:
            return -np.inf, 0.0, t0
    near = math.sqrt(dx * dx + dy * dy)
    if near > 0.0:                                  # no nearer to the axis than this, seen from the middle
        nx, ny = dx / near, dy / near
        near = max(near - abs(nx * o[1, 0] + ny * o[1, 1]) - abs(nx * o[2, 0] + ny * o[2, 1]) - bend
                   - 0.5 * abs(nx * (bx - ax) + ny * (by - ay)) - OUTWARD_MM, 0.0)
    if near > R:
        return -np.inf, 0.0, t0
    tip, at = 0.0, 0.5
    for k in range(3):                              # the middle of the box at both ends and in the middle
        g = 0.5 * k
        d = math.sqrt((o[0, 0] - ax - g * (bx - ax)) ** 2 + (o[0, 1] - ay - g * (by - ay)) ** 2)
        if d <= R:
            depth = o[0, 2] - bottom(d, R, rc) - az - g * (bz - az)
            if depth > tip:
                tip, at = depth, g
    if tip > known:
        if kind == FACE and state == BORDER and not in_trim(tree, patch, s, t):
            tip = 0.0
    ex = abs(o[1, 0]) + abs(o[2, 0]) + bend
    ey = abs(o[1, 1]) + abs(o[2, 1]) + bend
    nx = ny = nz = 0.0
    if kind == FACE:
        if tag[3] == LEVEL:                         # else its edges are under the cutter as well
            if abs(dx) > ex + mx + OUTWARD_MM or abs(dy) > ey + my + OUTWARD_MM:
                return -np.inf, tip, t0 + at * (t1 - t0)
        sign = tree[4][patch]
        nx = sign * (o[1, 1] * o[2, 2] - o[1, 2] * o[2, 1])
        ny = sign * (o[1, 2] * o[2, 0] - o[1, 0] * o[2, 2])
        nz = sign * (o[1, 0] * o[2, 1] - o[1, 1] * o[2, 0])
        n = math.sqrt(nx * nx + ny * ny + nz * nz)
        sine = 2.0
        if n > 0.0:
            turn = (row[6] * row[5] + row[4] * row[7]) * alpha + (row[7] * row[5] + row[4] * row[8]) * beta
            nx, ny, nz, sine = nx / n, ny / n, nz / n, turn * alpha * beta / n
        if sine < 1.0:
            if nz + sine <= 0.0:
                return -np.inf, tip, t0 + at * (t1 - t0)
            cone_box(nx, ny, nz, sine, 1.0, normals)
            hx, hy = ex + mx + OUTWARD_MM, ey + my + OUTWARD_MM
            if not can_meet(normals, o[0, 0] - hx, o[0, 0] + hx, o[0, 1] - hy, o[0, 1] + hy, x, y, R, rc):
                return -np.inf, tip, t0 + at * (t1 - t0)
        else:
            nz = 0.0
    fill_plane(o, row, alpha, beta, nx, ny, nz, kind, ex, ey, bend, plane)
    bound = min(bound, stretch_bound(plane, 0, ax, ay, az, bx, by, bz, R, rc),
                plane[0, 4] - bottom(near, R, rc) - min(az, bz) + OUTWARD_MM)
    return bound, tip, t0 + at * (t1 - t0)
