r"""Exact signed distance of a point to what a tilted, turning cutter sweeps in one sub-step, and bounds for many.

The distance F to the cutter's body is convex (see outlines.py).  Seen from the cutter, the point moves along a
curve x(t) whose acceleration is at most

    M = 2 w v + (w² + w³) D        w turning, v tip's way, D distance from the tip, for one sub-step

so f(t) = F(x(t)) has f'' >= -M: on an interval of width h its tangents, each tilted by M h / 2, bound it from
below.  All lengths in mm; distances are negative inside.

A sub-step is row k of the array g of all, see tilted_pieces.py: a row taken out of it would cost more than many a bound.
"""

import math

from cuspline.stock.outlines import (
    CENTER_Z,
    DIRECTION_R,
    DIRECTION_Z,
    FROM_R,
    FROM_Z,
    IS_ARC,
    LINE_LENGTH,
    RADIUS,
    START_R,
    START_Z,
    TO_R,
    TO_Z,
    outline_distance,
)
from cuspline.stock.tilted_pieces import AXIS, AXIS_WAY, LENGTH, TIP, TURN, WAY
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z

CLOSE_MM = 4e-10          # the least distance along a sub-step is found to this
WAITING = 64              # more intervals than can wait at once: every one is halved at the latest at 1e-15
WIDEST_RAD = 1.5          # nodes whose axes turn by more are always looked into
NEAR_END = 0.1            # an interval is never split nearer to its ends than this share
MIDDLE_TIP, FRAME_U, FRAME_V, FRAME_W, MIDDLE_AXIS = range(0, 15, 3)        # columns of a tree's node, see tilted_tree.py
LOW_0, HIGH_0, LOW_1, HIGH_1, LOW_2, HIGH_2 = range(15, 33, 3)
WIDEST, TOUCH, HEIGHT_0, HEIGHT_1, HEIGHT_2, IS_FILLED = 33, 34, 37, 38, 39, 40
LEFT, RIGHT, F_LEFT, F_RIGHT, SLOPE_LEFT, SLOPE_RIGHT = range(6)            # of an interval that waits
SMOOTH = 0.05             # how far f may be from a parabola for its slopes to be interpolated


@njit(error_model="numpy", inline="always")
def _off_tip(px, py, pz, g, k, t):
    """A point less the tip at the share t of a sub-step."""
    return px - g[k, TIP + X] - t * g[k, WAY + X], py - g[k, TIP + Y] - t * g[k, WAY + Y], pz - g[k, TIP + Z] - t * g[k, WAY + Z]


@njit(error_model="numpy", inline="always")
def _seen_from_axis(px, py, pz, g, k, t):
    """A point as the cutter at the share t of a sub-step sees it: its axis (3) and by what that was stretched to a unit,
    height above the tip, way from the axis (3) and its length."""
    x, y, z = _off_tip(px, py, pz, g, k, t)
    ax, ay = g[k, AXIS + X] + t * g[k, AXIS_WAY + X], g[k, AXIS + Y] + t * g[k, AXIS_WAY + Y]
    az = g[k, AXIS + Z] + t * g[k, AXIS_WAY + Z]
    stretch = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
    ax, ay, az = ax * stretch, ay * stretch, az * stretch
    up = x * ax + y * ay + z * az
    ex, ey, ez = x - up * ax, y - up * ay, z - up * az
    return ax, ay, az, stretch, up, ex, ey, ez, math.sqrt(ex * ex + ey * ey + ez * ez)


@njit(error_model="numpy")
def pose_distance(px, py, pz, g, k, t, outline, first, last):
    """Signed distance of a point to the cutter at the share t of a sub-step, and its derivative by t."""
    ax, ay, az, stretch, up, ex, ey, ez, r = _seen_from_axis(px, py, pz, g, k, t)
    d, nr, nz = outline_distance(r, up, outline, first, last)
    if r < 1e-12:
        return d, -nz * (ax * g[k, WAY + X] + ay * g[k, WAY + Y] + az * g[k, WAY + Z])
    ex, ey, ez = ex / r, ey / r, ez / r
    way = (nr * ex + nz * ax) * g[k, WAY + X] + (nr * ey + nz * ay) * g[k, WAY + Y] + (nr * ez + nz * az) * g[k, WAY + Z]
    turn = (ex * g[k, AXIS_WAY + X] + ey * g[k, AXIS_WAY + Y] + ez * g[k, AXIS_WAY + Z]) * stretch
    return d, (nz * r - nr * up) * turn - way


@njit(error_model="numpy")
def _lowest_possible(l, r, fl, fr, sl, sr, M):
    """Lower bound of f on [l, r] from both ends, and where the tangents cross."""
    tilt = 0.5 * M * (r - l)
    sl, sr = sl - tilt, sr + tilt
    if sl >= 0.0:
        return fl, l
    if sr <= 0.0:
        return fr, r
    t = (fl - fr + sr * r - sl * l) / (sr - sl)
    return fl + sl * (t - l), t


@njit(error_model="numpy")
def _split_at(l, r, fl, fr, sl, sr, crossing):
    """Where to look next in [l, r]: at the least of a parabola where f is one, else where the tangents cross."""
    w, t = r - l, crossing
    if sl < 0.0 < sr and abs(fr - fl - 0.5 * (sl + sr) * w) < SMOOTH * (sr - sl) * w:
        t = l - sl * w / (sr - sl)
    return min(max(t, l + NEAR_END * w), r - NEAR_END * w)


@njit(error_model="numpy")
def _wait(waiting, i, l, r, fl, fr, sl, sr):
    waiting[i, LEFT], waiting[i, RIGHT], waiting[i, F_LEFT] = l, r, fl
    waiting[i, F_RIGHT], waiting[i, SLOPE_LEFT], waiting[i, SLOPE_RIGHT] = fr, sl, sr


@njit(error_model="numpy", inline="always")
def _ball_on_line(px, py, pz, g, k, up, radius):
    """`substep_distance` of a whole ball, an outline of one arc its middle `up` over the tip, on a sub-step that does not turn."""
    x, y, z = _off_tip(px, py, pz, g, k, 0.0)
    x, y, z = x - up * g[k, AXIS + X], y - up * g[k, AXIS + Y], z - up * g[k, AXIS + Z]
    wx, wy, wz = g[k, WAY + X], g[k, WAY + Y], g[k, WAY + Z]
    square = wx * wx + wy * wy + wz * wz
    t = min(max((x * wx + y * wy + z * wz) / square, 0.0), 1.0) if square > 0.0 else 0.5
    x, y, z = x - t * wx, y - t * wy, z - t * wz
    return math.sqrt(x * x + y * y + z * z) - radius, t


@njit(error_model="numpy")
def substep_distance(px, py, pz, g, k, outline, first, last, best, waiting):
    """Least of `pose_distance` over a sub-step, and where it is; if it is not below `best`, anything from `best` on."""
    if last - first == 1 and g[k, TURN] == 0.0:
        return _ball_on_line(px, py, pz, g, k, outline[first, CENTER_Z], outline[first, RADIUS])
    fm, sm = pose_distance(px, py, pz, g, k, 0.5, outline, first, last)
    x, y, z = _off_tip(px, py, pz, g, k, 0.5)
    w = g[k, TURN]
    M = 2.0 * w * g[k, LENGTH] + w * w * (1.0 + w) * (math.sqrt(x * x + y * y + z * z) + 0.5 * g[k, LENGTH])
    if fm - 0.5 * abs(sm) - 0.125 * M >= best or g[k, LENGTH] + w == 0.0:
        return fm, 0.5
    f0, s0 = pose_distance(px, py, pz, g, k, 0.0, outline, first, last)
    f1, s1 = pose_distance(px, py, pz, g, k, 1.0, outline, first, last)
    least, at = (fm, 0.5) if fm <= min(f0, f1) else (f0, 0.0) if f0 <= f1 else (f1, 1.0)
    _wait(waiting, 0, 0.0, 0.5, f0, fm, s0, sm)
    _wait(waiting, 1, 0.5, 1.0, fm, f1, sm, s1)
    top = 2
    while top > 0:
        top -= 1
        l, r, fl = waiting[top, LEFT], waiting[top, RIGHT], waiting[top, F_LEFT]
        fr, sl, sr = waiting[top, F_RIGHT], waiting[top, SLOPE_LEFT], waiting[top, SLOPE_RIGHT]
        low, t = _lowest_possible(l, r, fl, fr, sl, sr, M)
        if low >= min(least, best) - CLOSE_MM or r - l < 1e-15 or top > WAITING - 2:
            continue
        t = _split_at(l, r, fl, fr, sl, sr, t)
        f, s = pose_distance(px, py, pz, g, k, t, outline, first, last)
        if f < least:
            least, at = f, t
        left, right = (top + 1, top) if s > 0.0 else (top, top + 1)      # downhill first
        _wait(waiting, left, l, t, fl, f, sl, s)
        _wait(waiting, right, t, r, f, fr, s, sr)
        top += 2
    return least, at


@njit(error_model="numpy")
def slope_along(px, py, pz, nx, ny, nz, g, k, t, outline, first, last):
    """Derivative of the distance to the cutter at the share t of a sub-step, as the point moves along n."""
    ax, ay, az, _, up, ex, ey, ez, r = _seen_from_axis(px, py, pz, g, k, t)
    _, gr, gz = outline_distance(r, up, outline, first, last)
    beside = (ex * nx + ey * ny + ez * nz) / r if r > 1e-12 else 0.0
    return gr * beside + gz * (ax * nx + ay * ny + az * nz)


@njit(error_model="numpy")
def _clamped(x, low, high):
    return min(max(x, low), high)


@njit(error_model="numpy")
def _most(slope, low, high):
    """Largest slope * x on [low, high]."""
    return slope * high if slope > 0.0 else slope * low


@njit(error_model="numpy")
def _between(nodes, row, i, share):
    """A corner's coordinate at a height between two of a node's boxes."""
    return nodes[row, i] + share * (nodes[row, i + 6] - nodes[row, i])


@njit(error_model="numpy")
def _bulge(rc, zc, nr, nz, height, theta, outline, first, last):
    r"""How far the support of the body can rise over its tangent when the normal turns by up to theta.

    A normal at the angle g from the axis has support h(g), and h'' + h = rho, the outline's radius of curvature
    (0 at a corner, a jump of its length at a line).  The tangent T = h0 + z (cos g - cos g0), which an axis point
    at height z makes, has T'' + T = A, A the way along the normal from that point to the contact (rc, zc).  So

        h - T = B sin(g - g0) + integral of (rho - A) sin(g - s) ds

    with B how far the normal passes the point by.  A ball's rho is A, and B is 0 at its centre: nothing rises.
    """
    A, B = rc * nr + (zc - height) * nz, rc * nz - (zc - height) * nr
    before = behind = widest = 0.0
    for k in range(first, last):
        if outline[k, IS_ARC] == 0.0:
            dr, dz = outline[k, DIRECTION_R], outline[k, DIRECTION_Z]
            sine, near = dz * nz + dr * nr, dz * nr - dr * nz
            if near > 0.0 and abs(sine) < theta:
                left = theta - abs(sine)
                if abs(sine) < 1e-9:         # the contact is on the line: what lies to its either side
                    done = (rc - outline[k, START_R]) * dr + (zc - outline[k, START_Z]) * dz
                    done = min(max(done, 0.0), outline[k, LINE_LENGTH])
                    behind += done * left
                    before += (outline[k, LINE_LENGTH] - done) * left
                elif sine > 0.0:
                    behind += outline[k, LINE_LENGTH] * left
                else:
                    before += outline[k, LINE_LENGTH] * left
        elif outline[k, RADIUS] > widest:
            c0, c1 = outline[k, FROM_R] * nz - outline[k, FROM_Z] * nr, nr * outline[k, TO_Z] - nz * outline[k, TO_R]
            if ((c0 >= -theta or outline[k, FROM_R] * nr + outline[k, FROM_Z] * nz < 0.0)
                    and (c1 >= -theta or outline[k, TO_R] * nr + outline[k, TO_Z] * nz < 0.0)):
                widest = outline[k, RADIUS]
    return abs(B) * theta + max(before, behind) + 0.5 * max(widest - A, 0.0) * theta * theta


@njit(error_model="numpy")
def poses_distance(px, py, pz, nodes, row, outline, first, last):
    r"""Lower bound of `pose_distance` over all poses of a tree node (see tilted_tree.py for its columns).

    The node's middle cutter, shifted inside the node's box to where it would touch first, has distance d and
    gradient n.  The plane across n that touches a cutter of the node lies, to first order, as far as the
    point Q of its axis where the normal at the contact meets it moves along n, so

        f >= d - n.(Q' - Q) - what the support can rise over its tangent (see _bulge)

    Q is at the height of that meeting, as near as z0 <= z <= z2 allows.  All that is lost grows with the square of the
    node's size.  Everything is reckoned in the node's frame.
    """
    x, y, z = px - nodes[row, MIDDLE_TIP + X], py - nodes[row, MIDDLE_TIP + Y], pz - nodes[row, MIDDLE_TIP + Z]
    pu = x * nodes[row, FRAME_U + X] + y * nodes[row, FRAME_U + Y] + z * nodes[row, FRAME_U + Z]
    pv = x * nodes[row, FRAME_V + X] + y * nodes[row, FRAME_V + Y] + z * nodes[row, FRAME_V + Z]
    pw = x * nodes[row, FRAME_W + X] + y * nodes[row, FRAME_W + Y] + z * nodes[row, FRAME_W + Z]
    u = _clamped(pu - nodes[row, TOUCH + X], nodes[row, LOW_1 + X], nodes[row, HIGH_1 + X])
    v = _clamped(pv - nodes[row, TOUCH + Y], nodes[row, LOW_1 + Y], nodes[row, HIGH_1 + Y])
    w = _clamped(pw - nodes[row, TOUCH + Z], nodes[row, LOW_1 + Z], nodes[row, HIGH_1 + Z])
    pu, pv, pw = pu - u, pv - v, pw - w
    au, av, aw = nodes[row, MIDDLE_AXIS + X], nodes[row, MIDDLE_AXIS + Y], nodes[row, MIDDLE_AXIS + Z]
    up = pu * au + pv * av + pw * aw
    eu, ev, ew = pu - up * au, pv - up * av, pw - up * aw
    r = math.sqrt(eu * eu + ev * ev + ew * ew)
    d, nr, nz = outline_distance(r, up, outline, first, last)
    share = nr / r if r > 1e-12 else 0.0     # on the axis all gradients round it count as one
    nu, nv, nw = share * eu + nz * au, share * ev + nz * av, share * ew + nz * aw
    height = _clamped(up - nz * r / nr, nodes[row, HEIGHT_0], nodes[row, HEIGHT_2]) if nr > 1e-12 else nodes[row, HEIGHT_1]
    i, z0, z1 = ((LOW_0, nodes[row, HEIGHT_0], nodes[row, HEIGHT_1]) if height <= nodes[row, HEIGHT_1]
                 else (LOW_1, nodes[row, HEIGHT_1], nodes[row, HEIGHT_2]))
    k = (height - z0) / (z1 - z0)
    u0, u1 = _between(nodes, row, i, k) - u, _between(nodes, row, i + 3, k) - u
    v0, v1 = _between(nodes, row, i + 1, k) - v, _between(nodes, row, i + 4, k) - v
    w0, w1 = _between(nodes, row, i + 2, k) - w, _between(nodes, row, i + 5, k) - w
    if nodes[row, WIDEST] > WIDEST_RAD:                # what follows holds for less than a quarter turn
        return -math.inf
    low = d - _most(nu, u0, u1) - _most(nv, v0, v1) - _most(nw, w0, w1)
    if nodes[row, WIDEST] > 0.0:
        low -= _bulge(r - d * nr, up - d * nz, nr, nz, height, nodes[row, WIDEST], outline, first, last)
    return low
