"""Least distance of a tool of convex revolved segments to triangles: branch and bound, kernels only.

A segment is a row (BOTTOM, BOTTOM_RADIUS, TOP, TOP_RADIUS, GROW): a frustum from height z0 to z1 above the tip, grown
by a ball (a ball's end is a point, a bull nose's corner a disc of no height).  Its signed distance is convex, so the
value at the middle of a box or triangle minus what its gradient can lose from there is a lower bound, and a sharp one:
what is lost beyond it shrinks with the square of the box.

The same holds while the tool is pushed along a straight line, or anywhere in a box, without turning: what it
sweeps is convex again, and its distance is the least over the way, which is convex in the point.

A place is a row of 17: the frame's three unit rows SIDE_X, SIDE_Y and AXIS, the TIP, the WAY (in that frame), half
widths HALF_X, HALF_Y of the box across the axis.  A node is a row of 15: MIDDLE and HALF sides of a box, its directions
BOX_X, BOX_Y, BOX_Z.
"""

import math

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import FROM, TO, A, B, C, X, Y, Z, put

BOTTOM, BOTTOM_RADIUS, TOP, TOP_RADIUS, GROW = range(5)                         # columns of a segment
SIDE_X, SIDE_Y, AXIS, TIP, WAY, HALF_X, HALF_Y = 0, 3, 6, 9, 12, 15, 16         # of a place
MIDDLE, HALF, BOX_X, BOX_Y, BOX_Z = range(0, 15, 3)                             # of a node
CORNER_A, CORNER_B, CORNER_C = range(0, 9, 3)                                   # of a part of a triangle
NEAREST = 3               # of `workspace`: the nearest point found
LEAF = 4                  # triangles in a leaf
ROUNDING_MM = 1e-9        # taken off every bound
STACK = 256               # more than twice the depth of any tree
PARTS = 96                # halvings of one triangle that may wait
COARSE = 0.25             # of what a pose may prove beyond the margin: how roughly it is looked at
AHEAD = 0.9               # of the last distance: how far ahead the next pose is looked at
CUTS = 40                 # tangents along the way at most; the bound holds after any number of them


@njit
def segment_distance(rho, z, row):
    """Signed distance to a grown frustum in (rho, z), and its slopes along both."""
    z0, r0, z1, r1 = row[BOTTOM], row[BOTTOM_RADIUS], row[TOP], row[TOP_RADIUS]
    ex, ez = r1 - r0, z1 - z0
    square = ex * ex + ez * ez
    below, above = z0 - z, z - z1
    if ez > 0.0:
        length = math.sqrt(square)
        nr, nz = ez / length, -ex / length
        side = (rho - r0) * nr + (z - z0) * nz
        if side <= 0.0 and below <= 0.0 and above <= 0.0:
            if side >= below and side >= above:
                return side - row[GROW], nr, nz
            if below >= above:
                return below - row[GROW], 0.0, -1.0
            return above - row[GROW], 0.0, 1.0
    near_r, near_z = min(rho, r0), z0
    best = (rho - near_r) * (rho - near_r) + below * below
    r = min(rho, r1)
    d2 = (rho - r) * (rho - r) + above * above
    if d2 < best:
        best, near_r, near_z = d2, r, z1
    if square > 0.0:
        t = min(max(((rho - r0) * ex + (z - z0) * ez) / square, 0.0), 1.0)
        r, h = r0 + t * ex, z0 + t * ez
        d2 = (rho - r) * (rho - r) + (z - h) * (z - h)
        if d2 < best:
            best, near_r, near_z = d2, r, h
    d = math.sqrt(best)
    if d < 1e-13:
        return d - row[GROW], 0.0, 0.0
    return d - row[GROW], (rho - near_r) / d, (z - near_z) / d


@njit
def _at(x, y, z, row, hx, hy):
    """Distance and gradient of a point to a segment that may stand anywhere within hx, hy across its axis."""
    x, y = math.copysign(max(abs(x) - hx, 0.0), x), math.copysign(max(abs(y) - hy, 0.0), y)
    rho = math.sqrt(x * x + y * y)
    d, gr, gz = segment_distance(rho, z, row)
    if rho > 0.0:
        return d, gr * x / rho, gr * y / rho, gz
    return d, 0.0, 0.0, gz


@njit
def swept_distance(x, y, z, row, vx, vy, vz, hx, hy, close):
    """Lower bound at a point (tool's frame) with the gradient that carries it to other points; the value attained.

    For every point Q: least distance over the way >= bound + gradient . (Q - P), exactly at P within `close`.
    """
    f0, x0, y0, z0 = _at(x, y, z, row, hx, hy)
    s0 = -(x0 * vx + y0 * vy + z0 * vz)
    if s0 >= 0.0:
        return f0, x0, y0, z0, f0
    f1, x1, y1, z1 = _at(x - vx, y - vy, z - vz, row, hx, hy)
    s1 = -(x1 * vx + y1 * vy + z1 * vz)
    if s1 <= 0.0:
        return f1, x1, y1, z1, f1
    lo, hi, best = 0.0, 1.0, min(f0, f1)
    share = bound = 0.0
    for k in range(CUTS):
        share = s1 / (s1 - s0)               # of the left tangent, so that both together do not depend on t
        bound = share * (f0 - s0 * lo) + (1.0 - share) * (f1 - s1 * hi)
        if best - bound <= close or hi - lo < 1e-15:
            break
        t = (f0 - f1 + s1 * hi - s0 * lo) / (s1 - s0)
        if k % 4 == 3:
            t = 0.5 * (lo + hi)
        t = min(max(t, lo), hi)
        f, gx, gy, gz = _at(x - t * vx, y - t * vy, z - t * vz, row, hx, hy)
        s = -(gx * vx + gy * vy + gz * vz)
        best = min(best, f)
        if s < 0.0:
            lo, f0, s0, x0, y0, z0 = t, f, s, gx, gy, gz
        elif s > 0.0:
            hi, f1, s1, x1, y1, z1 = t, f, s, gx, gy, gz
        else:
            return f, gx, gy, gz, f
    rest = 1.0 - share
    return bound, share * x0 + rest * x1, share * y0 + rest * y1, share * z0 + rest * z1, best


@njit
def _local(p, x, y, z):
    x, y, z = x - p[TIP + X], y - p[TIP + Y], z - p[TIP + Z]
    return (p[SIDE_X + X] * x + p[SIDE_X + Y] * y + p[SIDE_X + Z] * z,
            p[SIDE_Y + X] * x + p[SIDE_Y + Y] * y + p[SIDE_Y + Z] * z,
            p[AXIS + X] * x + p[AXIS + Y] * y + p[AXIS + Z] * z)


@njit
def box_bound(node, place, segments, close):
    """No point of the box is nearer to the tool at its place than this."""
    x, y, z = _local(place, node[MIDDLE + X], node[MIDDLE + Y], node[MIDDLE + Z])
    vx, vy, vz, hx, hy = place[WAY + X], place[WAY + Y], place[WAY + Z], place[HALF_X], place[HALF_Y]
    least = math.inf
    for k in range(len(segments)):
        d, gx, gy, gz, _ = swept_distance(x, y, z, segments[k], vx, vy, vz, hx, hy, close)
        wx = gx * place[SIDE_X + X] + gy * place[SIDE_Y + X] + gz * place[AXIS + X]
        wy = gx * place[SIDE_X + Y] + gy * place[SIDE_Y + Y] + gz * place[AXIS + Y]
        wz = gx * place[SIDE_X + Z] + gy * place[SIDE_Y + Z] + gz * place[AXIS + Z]
        reach = (abs(wx * node[BOX_X + X] + wy * node[BOX_X + Y] + wz * node[BOX_X + Z]) * node[HALF + X]
                 + abs(wx * node[BOX_Y + X] + wy * node[BOX_Y + Y] + wz * node[BOX_Y + Z]) * node[HALF + Y]
                 + abs(wx * node[BOX_Z + X] + wy * node[BOX_Z + Y] + wz * node[BOX_Z + Z]) * node[HALF + Z])
        least = min(least, d - reach)
    return least - ROUNDING_MM


@njit
def triangle_distance(corners, place, row, best, floor, least, tolerance, parts, point):
    """(attained, lower bound of what was left out) over one triangle; `point` takes the world's nearest point.

    Halved across its longest side, nearest halves first, until nothing can be nearer than `best` by the tolerance.
    """
    for v in range(3):
        x, y, z = _local(place, corners[v, X], corners[v, Y], corners[v, Z])
        parts[0, 3 * v], parts[0, 3 * v + 1], parts[0, 3 * v + 2] = x, y, z
    vx, vy, vz, hx, hy = place[WAY + X], place[WAY + Y], place[WAY + Z], place[HALF_X], place[HALF_Y]
    waiting, close = 1, 0.1 * tolerance
    while waiting > 0:
        waiting -= 1
        ax, ay, az = parts[waiting, CORNER_A + X], parts[waiting, CORNER_A + Y], parts[waiting, CORNER_A + Z]
        bx, by, bz = parts[waiting, CORNER_B + X], parts[waiting, CORNER_B + Y], parts[waiting, CORNER_B + Z]
        cx, cy, cz = parts[waiting, CORNER_C + X], parts[waiting, CORNER_C + Y], parts[waiting, CORNER_C + Z]
        mx, my, mz = (ax + bx + cx) / 3.0, (ay + by + cy) / 3.0, (az + bz + cz) / 3.0
        d, gx, gy, gz, got = swept_distance(mx, my, mz, row, vx, vy, vz, hx, hy, close)
        if got < best:
            best = got
            for k in range(3):
                point[k] = place[TIP + k] + place[k] * mx + place[SIDE_Y + k] * my + place[AXIS + k] * mz
            if best < floor:
                return best, -math.inf
        bound = d - ROUNDING_MM + min(gx * (ax - mx) + gy * (ay - my) + gz * (az - mz),
                                      gx * (bx - mx) + gy * (by - my) + gz * (bz - mz),
                                      gx * (cx - mx) + gy * (cy - my) + gz * (cz - mz))
        if bound >= best - tolerance or waiting + 2 > len(parts):
            least = min(least, bound)
            continue
        ab = (ax - bx) ** 2 + (ay - by) ** 2 + (az - bz) ** 2
        bc = (bx - cx) ** 2 + (by - cy) ** 2 + (bz - cz) ** 2
        ca = (cx - ax) ** 2 + (cy - ay) ** 2 + (cz - az) ** 2
        if bc >= ab and bc >= ca:
            ax, ay, az, bx, by, bz, cx, cy, cz = bx, by, bz, cx, cy, cz, ax, ay, az
        elif ca >= ab:
            ax, ay, az, bx, by, bz, cx, cy, cz = cx, cy, cz, ax, ay, az, bx, by, bz
        hxm, hym, hzm = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (az + bz)
        nearer = gx * (ax - bx) + gy * (ay - by) + gz * (az - bz) < 0.0     # a's half has the lower tangent
        for half in range(2):
            row_of = parts[waiting + half]
            row_of[CORNER_B + X], row_of[CORNER_B + Y], row_of[CORNER_B + Z] = hxm, hym, hzm
            row_of[CORNER_C + X], row_of[CORNER_C + Y], row_of[CORNER_C + Z] = cx, cy, cz
            if (half == 1) == nearer:
                row_of[CORNER_A + X], row_of[CORNER_A + Y], row_of[CORNER_A + Z] = ax, ay, az
            else:
                row_of[CORNER_A + X], row_of[CORNER_A + Y], row_of[CORNER_A + Z] = bx, by, bz
        waiting += 2
    return best, least


@njit
def least_distance(mesh, place, segments, cap, floor, tolerance, hint, work):
    """Least signed distance of the tool at one place to all triangles.

    Args:
        mesh: (triangles (t, 3, 3), nodes (k, 15) middle, half sides and axes, leaves).
        place: (17,), see above.   segments: (k, 5).
        cap: what is farther does not matter.   floor: an attained distance below it ends the search.
        tolerance: how much nearer than the result a point may be left out.
        hint: triangle to look at first, or -1.
        work: from `workspace()`.
    Returns:
        (proven lower bound, attained distance (cap: none nearer), its triangle or -1); work[3] takes its point.
        Where the search ended at the floor the lower bound is -inf.
    """
    triangles, nodes, leaves = mesh
    stack, bounds, parts, point, trial = work
    best, least, found = cap, math.inf, -1
    if hint >= 0:
        for k in range(len(segments)):
            got, least = triangle_distance(triangles[hint], place, segments[k], best, floor, least, tolerance, parts, trial)
            if got < best:
                best, found = got, hint
                put(point, trial)
                if best < floor:
                    return -math.inf, best, found
    close = 0.1 * tolerance
    top, stack[0], bounds[0] = 1, 0, -math.inf
    while top > 0:
        top -= 1
        if bounds[top] >= best - tolerance:
            least = min(least, bounds[top])
            continue
        node = stack[top]
        if node >= leaves - 1:
            t0 = (node - leaves + 1) * LEAF
            for t in range(t0, min(t0 + LEAF, len(triangles))):
                if t == hint:
                    continue
                for k in range(len(segments)):
                    got, least = triangle_distance(triangles[t], place, segments[k], best, floor, least, tolerance, parts,
                                           trial)
                    if got < best:
                        best, found = got, t
                        put(point, trial)
                        if best < floor:
                            return -math.inf, best, found
            continue
        left = 2 * node + 1
        b0, b1 = box_bound(nodes[left], place, segments, close), math.inf
        if nodes[left + 1, HALF + X] >= 0.0:
            b1 = box_bound(nodes[left + 1], place, segments, close)
        near, far = (left, left + 1) if b0 <= b1 else (left + 1, left)
        stack[top], bounds[top] = far, max(b0, b1)
        stack[top + 1], bounds[top + 1] = near, min(b0, b1)
        top += 2
    return min(least, best), best, found


@njit
def workspace():
    """Scratch arrays of `least_distance`."""
    return np.empty(STACK, np.int64), np.empty(STACK), np.empty((PARTS, 9)), np.zeros(3), np.zeros(3)


@njit
def _frame_of(triangles, first, last, node):
    """Axes of a box into node[6:15]: the mean normal of some triangles, and the way they reach farthest across it."""
    nx = ny = nz = 0.0
    for t in range(first, last):
        a, b = triangles[t, B] - triangles[t, A], triangles[t, C] - triangles[t, A]
        nx, ny, nz = nx + a[Y] * b[Z] - a[Z] * b[Y], ny + a[Z] * b[X] - a[X] * b[Z], nz + a[X] * b[Y] - a[Y] * b[X]
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length < 1e-300:
        nx, ny, nz, length = 0.0, 0.0, 1.0, 1.0
    nx, ny, nz = nx / length, ny / length, nz / length
    place = np.zeros(17)
    set_place(place, 0.0, 0.0, 0.0, nx, ny, nz)
    mu = mv = uu = uv = vv = 0.0
    for turn in range(2):                    # the mean first, then the spread about it
        for t in range(first, last):
            for c in range(3):
                x, y, z = triangles[t, c]
                u = place[SIDE_X + X] * x + place[SIDE_X + Y] * y + place[SIDE_X + Z] * z
                v = place[SIDE_Y + X] * x + place[SIDE_Y + Y] * y + place[SIDE_Y + Z] * z
                if turn == 0:
                    mu, mv = mu + u / (3.0 * (last - first)), mv + v / (3.0 * (last - first))
                else:
                    uu, uv, vv = uu + (u - mu) ** 2, uv + (u - mu) * (v - mv), vv + (v - mv) ** 2
    angle = 0.5 * fixed.arctan2(2.0 * uv, uu - vv)
    c, s = fixed.cos(angle), fixed.sin(angle)
    for k in range(3):
        node[BOX_X + k], node[BOX_Y + k] = c * place[k] + s * place[SIDE_Y + k], c * place[SIDE_Y + k] - s * place[k]
        node[BOX_Z + k] = place[AXIS + k]


@njit
def build_nodes(triangles, leaves):
    """(2 leaves - 1, 15) boxes over triangles in their given order: middle, half sides (-1: empty), axes."""
    nodes = np.full((2 * leaves - 1, 15), -1.0)
    width = leaves
    while width >= 1:
        span = leaves // width * LEAF
        for i in range(width):
            first, last = i * span, min((i + 1) * span, len(triangles))
            if first >= last:
                continue
            node, middle = nodes[width - 1 + i], np.zeros(3)
            _frame_of(triangles, first, last, node)
            for a in range(3):
                low, high = math.inf, -math.inf
                for t in range(first, last):
                    for v in range(3):
                        along = (node[BOX_X + 3 * a] * triangles[t, v, X] + node[BOX_X + Y + 3 * a] * triangles[t, v, Y]
                                 + node[BOX_X + Z + 3 * a] * triangles[t, v, Z])
                        low, high = min(low, along), max(high, along)
                node[HALF + a] = 0.5 * (high - low)
                for k in range(3):
                    middle[k] += 0.5 * (low + high) * node[6 + 3 * a + k]
            put(node, middle)
        width //= 2
    return nodes


@njit
def set_place(place, tx, ty, tz, ax, ay, az):
    """A place of a tool that stands still."""
    place[:] = 0.0
    if abs(ax) < 0.6:
        ux, uy, uz = 0.0, az, -ay            # ex x axis
    else:
        ux, uy, uz = -az, 0.0, ax            # ey x axis
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    place[SIDE_X + X], place[SIDE_X + Y], place[SIDE_X + Z] = ux / length, uy / length, uz / length
    ux, uy, uz = place[SIDE_X + X], place[SIDE_X + Y], place[SIDE_X + Z]
    place[SIDE_Y + X], place[SIDE_Y + Y], place[SIDE_Y + Z] = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
    place[AXIS + X], place[AXIS + Y], place[AXIS + Z] = ax, ay, az
    place[TIP + X], place[TIP + Y], place[TIP + Z] = tx, ty, tz


@njit
def set_way(place, wx, wy, wz):
    """Lets the tool of a place move straight by a vector of the world."""
    for k in range(3):
        place[WAY + k] = place[3 * k] * wx + place[3 * k + 1] * wy + place[3 * k + 2] * wz


@njit
def distances(mesh, tips, axes, segments, cap, tolerance):
    """Proven lower bounds (n,), attained distances (n,) and nearest points (n, 3) of poses; each helps the next."""
    n = len(tips)
    lower, got, points, work = np.empty(n), np.empty(n), np.full((n, 3), math.nan), workspace()
    place, hint = np.zeros(17), -1
    for i in range(n):
        set_place(place, tips[i, X], tips[i, Y], tips[i, Z], axes[i, X], axes[i, Y], axes[i, Z])
        lower[i], got[i], found = least_distance(mesh, place, segments, cap, -math.inf, tolerance, hint, work)
        if found >= 0:
            hint = found
            points[i] = work[NEAREST]
    return lower, got, points


@njit
def _pose(t, tip0, tip1, axis0, axis1, turn, place):
    """The pose at a share of a move: tip along a line, axis evenly along the great circle."""
    a, b = 1.0 - t, t
    if turn > 1e-12:
        s = fixed.sin(turn)
        a, b = fixed.sin((1.0 - t) * turn) / s, fixed.sin(t * turn) / s
    x, y, z = a * axis0[X] + b * axis1[X], a * axis0[Y] + b * axis1[Y], a * axis0[Z] + b * axis1[Z]
    length = math.sqrt(x * x + y * y + z * z)
    set_place(place, tip0[X] + t * (tip1[X] - tip0[X]), tip0[Y] + t * (tip1[Y] - tip0[Y]),
              tip0[Z] + t * (tip1[Z] - tip0[Z]), x / length, y / length, z / length)


@njit
def turn_of(axis0, axis1):
    """Angle between two unit vectors, rad."""
    x, y, z = axis0[X] - axis1[X], axis0[Y] - axis1[Y], axis0[Z] - axis1[Z]
    if x == 0.0 and y == 0.0 and z == 0.0:
        return 0.0
    return 2.0 * fixed.arcsin(min(0.5 * math.sqrt(x * x + y * y + z * z), 1.0))


@njit
def _over_move(mesh, segments, tip0, tip1, axis0, axis1, turn, lever, margin, cap, tolerance, hint, place, work, spans,
               spot):
    """(distance, is clear, hint) of one move, halved until every stretch is decided.

    A stretch is swept straight with the axis of its middle; turning moves no point of the tool farther from that
    than half the turn times the lever.
    """
    lower, waiting = cap, 1
    spans[0, FROM], spans[0, TO] = 0.0, 1.0
    while waiting > 0:
        waiting -= 1
        lo, hi = spans[waiting, FROM], spans[waiting, TO]
        middle, width = 0.5 * (lo + hi), hi - lo
        slack = 0.5 * width * turn * lever
        _pose(middle, tip0, tip1, axis0, axis1, turn, place)
        for k in range(3):
            place[TIP + k] -= 0.5 * width * (tip1[k] - tip0[k])
        set_way(place, width * (tip1[X] - tip0[X]), width * (tip1[Y] - tip0[Y]), width * (tip1[Z] - tip0[Z]))
        bound, got, found = least_distance(mesh, place, segments, cap + slack, margin + slack, tolerance, hint, work)
        if found >= 0:
            hint = found
            put(spot, work[NEAREST])
        if bound - slack >= margin:
            lower = min(lower, bound - slack)
            continue
        if slack > tolerance and got >= margin - slack:      # the tool as it really stands in the middle
            _pose(middle, tip0, tip1, axis0, axis1, turn, place)
            _, got, found = least_distance(mesh, place, segments, margin, margin, tolerance, hint, work)
            if got < margin:
                hint = found
                put(spot, work[NEAREST])
        if got < margin or slack <= tolerance:
            return got, False, hint
        spans[waiting, FROM], spans[waiting, TO] = middle, hi
        spans[waiting + 1, FROM], spans[waiting + 1, TO] = lo, middle
        waiting += 2
    return lower, True, hint


@njit
def _motion(tip0, tip1, axis0, axis1, lever):
    """No point of the tool goes farther than this from one pose to the next."""
    d = tip1 - tip0
    return math.sqrt(d[X] * d[X] + d[Y] * d[Y] + d[Z] * d[Z]) + lever * turn_of(axis0, axis1)


@njit
def _motions(tips0, tips1, axes0, axes1, lever):
    """(n,) how far a point of the tool can go in each move, and from the end of the move before to its start."""
    n = len(tips0)
    moves, gaps = np.empty(n), np.zeros(n)
    for i in range(n):
        moves[i] = _motion(tips0[i], tips1[i], axes0[i], axes1[i], lever)
        if i > 0:
            gaps[i] = _motion(tips1[i - 1], tips0[i], axes1[i - 1], axes0[i], lever)
    return moves, gaps


@njit
def certify(mesh, tips0, tips1, axes0, axes1, segments, lever, margin, cap, tolerance, lower, is_clear, places):
    """One part of a tool over moves: a pose vouches for the moves before and after it, as far as its distance lasts.

    `lower`, `is_clear` and `places` hold what other parts have shown, and take what this one shows.
    """
    place, work, spans, spot, hint = np.zeros(17), workspace(), np.empty((128, 2)), np.full(3, math.nan), -1
    coarse = max(tolerance, COARSE * (cap - margin))
    motion, gap = _motions(tips0, tips1, axes0, axes1, lever)
    i, n, left, trust = 0, len(tips0), -math.inf, 0.0        # left: proven distance where move i starts
    while i < n:
        if not is_clear[i]:                  # another part has been found too near
            left -= motion[i]
        elif left - motion[i] >= margin:
            left -= motion[i]
            if left < lower[i]:
                lower[i] = left
                put(places[i], spot)
        else:
            j, way = i, 0.0                  # a pose ahead, if the last distance promises that it reaches back to here
            while j + 1 < n and way + motion[j] + gap[j + 1] <= trust:
                way += motion[j] + gap[j + 1]
                j += 1
            set_place(place, tips0[j, X], tips0[j, Y], tips0[j, Z], axes0[j, X], axes0[j, Y], axes0[j, Z])
            left, got, found = least_distance(mesh, place, segments, cap, margin, coarse, hint, work)
            spot[:] = math.nan
            if found >= 0:
                hint = found
                put(spot, work[NEAREST])
            if j > i:
                trust = AHEAD * (left - margin)
                if left - way < margin:
                    trust, left = 0.0, -math.inf
                    continue
                for k in range(i, j):
                    if left - way < lower[k] and is_clear[k]:
                        lower[k] = left - way
                        put(places[k], spot)
                    way -= motion[k] + gap[k + 1]
                i = j
                continue
            trust = AHEAD * (left - margin)
            if got < margin:
                lower[i], is_clear[i], left = got, False, -math.inf
                put(places[i], spot)
            elif left - motion[i] >= margin:
                continue
            else:
                bound, is_clear[i], hint = _over_move(
                    mesh, segments, tips0[i], tips1[i], axes0[i], axes1[i], turn_of(axes0[i], axes1[i]), lever, margin,
                    cap, tolerance, hint, place, work, spans, spot)
                left = -math.inf
                if bound < lower[i] or not is_clear[i]:
                    lower[i] = bound
                    put(places[i], spot)
        i += 1
        if i < n:
            left -= gap[i]
