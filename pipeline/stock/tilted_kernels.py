r"""Exact signed distance of a point to what a tilted, turning cutter sweeps in one sub-step, and bounds for many.

The distance F to the cutter's body is convex (see outlines.py).  Seen from the cutter, the point moves along a
curve x(t) whose acceleration is at most

    M = 2 w v + (w² + w³) D        w turning, v tip's way, D distance from the tip, for one sub-step

so f(t) = F(x(t)) has f'' >= -M: on an interval of width h its tangents, each tilted by M h / 2, bound it from
below.  All lengths in mm; distances are negative inside.
"""

import math

from cuspline.stock.outlines import outline_distance
from cuspline.values.compiled import njit

CLOSE_MM = 4e-10          # the least distance along a sub-step is found to this
WAITING = 64              # more intervals than can wait at once: every one is halved at the latest at 1e-15
WIDEST_RAD = 1.5          # nodes whose axes turn by more are always looked into
NEAR_END = 0.1            # an interval is never split nearer to its ends than this share
SMOOTH = 0.05             # how far f may be from a parabola for its slopes to be interpolated


@njit(error_model="numpy", inline="always")
def _seen_from_axis(px, py, pz, g, t):
    """A point as the cutter at the share t of a sub-step sees it: its axis (3) and by what that was stretched to a unit,
    height above the tip, way from the axis (3) and its length."""
    x, y, z = px - g[0] - t * g[3], py - g[1] - t * g[4], pz - g[2] - t * g[5]
    ax, ay, az = g[6] + t * g[9], g[7] + t * g[10], g[8] + t * g[11]
    stretch = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
    ax, ay, az = ax * stretch, ay * stretch, az * stretch
    up = x * ax + y * ay + z * az
    ex, ey, ez = x - up * ax, y - up * ay, z - up * az
    return ax, ay, az, stretch, up, ex, ey, ez, math.sqrt(ex * ex + ey * ey + ez * ez)


@njit(error_model="numpy")
def pose_distance(px, py, pz, g, t, outline, first, last):
    """Signed distance of a point to the cutter at the share t of a sub-step, and its derivative by t."""
    ax, ay, az, stretch, up, ex, ey, ez, r = _seen_from_axis(px, py, pz, g, t)
    d, nr, nz = outline_distance(r, up, outline, first, last)
    if r < 1e-12:
        return d, -nz * (ax * g[3] + ay * g[4] + az * g[5])
    ex, ey, ez = ex / r, ey / r, ez / r
    way = (nr * ex + nz * ax) * g[3] + (nr * ey + nz * ay) * g[4] + (nr * ez + nz * az) * g[5]
    turn = (ex * g[9] + ey * g[10] + ez * g[11]) * stretch
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
def _wait(waiting, k, l, r, fl, fr, sl, sr):
    waiting[k, 0], waiting[k, 1], waiting[k, 2] = l, r, fl
    waiting[k, 3], waiting[k, 4], waiting[k, 5] = fr, sl, sr


@njit(error_model="numpy")
def substep_distance(px, py, pz, g, outline, first, last, best, waiting):
    """Least of `pose_distance` over a sub-step, and where it is; if it is not below `best`, anything from `best` on."""
    fm, sm = pose_distance(px, py, pz, g, 0.5, outline, first, last)
    x, y, z = px - g[0] - 0.5 * g[3], py - g[1] - 0.5 * g[4], pz - g[2] - 0.5 * g[5]
    w = g[13]
    M = 2.0 * w * g[12] + w * w * (1.0 + w) * (math.sqrt(x * x + y * y + z * z) + 0.5 * g[12])
    if fm - 0.5 * abs(sm) - 0.125 * M >= best or g[12] + w == 0.0:
        return fm, 0.5
    f0, s0 = pose_distance(px, py, pz, g, 0.0, outline, first, last)
    f1, s1 = pose_distance(px, py, pz, g, 1.0, outline, first, last)
    least, at = (fm, 0.5) if fm <= min(f0, f1) else (f0, 0.0) if f0 <= f1 else (f1, 1.0)
    _wait(waiting, 0, 0.0, 0.5, f0, fm, s0, sm)
    _wait(waiting, 1, 0.5, 1.0, fm, f1, sm, s1)
    top = 2
    while top > 0:
        top -= 1
        l, r, fl, fr, sl, sr = waiting[top]
        low, t = _lowest_possible(l, r, fl, fr, sl, sr, M)
        if low >= min(least, best) - CLOSE_MM or r - l < 1e-15 or top > WAITING - 2:
            continue
        t = _split_at(l, r, fl, fr, sl, sr, t)
        f, s = pose_distance(px, py, pz, g, t, outline, first, last)
        if f < least:
            least, at = f, t
        left, right = (top + 1, top) if s > 0.0 else (top, top + 1)      # downhill first
        _wait(waiting, left, l, t, fl, f, sl, s)
        _wait(waiting, right, t, r, f, fr, s, sr)
        top += 2
    return least, at


@njit(error_model="numpy")
def slope_along(px, py, pz, nx, ny, nz, g, t, outline, first, last):
    """Derivative of the distance to the cutter at the share t of a sub-step, as the point moves along n."""
    ax, ay, az, _, up, ex, ey, ez, r = _seen_from_axis(px, py, pz, g, t)
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
        o = outline[k]
        if o[0] == 0.0:
            sine, near = o[4] * nz + o[3] * nr, o[4] * nr - o[3] * nz
            if near > 0.0 and abs(sine) < theta:
                left = theta - abs(sine)
                if abs(sine) < 1e-9:         # the contact is on the line: what lies to its either side
                    done = min(max((rc - o[1]) * o[3] + (zc - o[2]) * o[4], 0.0), o[5])
                    behind += done * left
                    before += (o[5] - done) * left
                elif sine > 0.0:
                    behind += o[5] * left
                else:
                    before += o[5] * left
        elif o[5] > widest:
            c0, c1 = o[6] * nz - o[7] * nr, nr * o[9] - nz * o[8]
            if (c0 >= -theta or o[6] * nr + o[7] * nz < 0.0) and (c1 >= -theta or o[8] * nr + o[9] * nz < 0.0):
                widest = o[5]
    return abs(B) * theta + max(before, behind) + 0.5 * max(widest - A, 0.0) * theta * theta


@njit(error_model="numpy")
def poses_distance(px, py, pz, node, outline, first, last):
    r"""Lower bound of `pose_distance` over all poses of a tree node (see tilted_tree.py for its columns).

    The node's middle cutter, shifted inside the node's box to where it would touch first, has distance d and
    gradient n.  The plane across n that touches a cutter of the node lies, to first order, as far as the
    point Q of its axis where the normal at the contact meets it moves along n, so

        f >= d - n.(Q' - Q) - what the support can rise over its tangent (see _bulge)

    Q is at the height of that meeting, as near as z0 <= z <= z2 allows.  All that is lost grows with the square of the
    node's size.  Everything is reckoned in the node's frame.
    """
    x, y, z = px - node[0], py - node[1], pz - node[2]
    pu = x * node[3] + y * node[4] + z * node[5]
    pv = x * node[6] + y * node[7] + z * node[8]
    pw = x * node[9] + y * node[10] + z * node[11]
    u = _clamped(pu - node[34], node[21], node[24])
    v = _clamped(pv - node[35], node[22], node[25])
    w = _clamped(pw - node[36], node[23], node[26])
    pu, pv, pw = pu - u, pv - v, pw - w
    au, av, aw = node[12], node[13], node[14]
    up = pu * au + pv * av + pw * aw
    eu, ev, ew = pu - up * au, pv - up * av, pw - up * aw
    r = math.sqrt(eu * eu + ev * ev + ew * ew)
    d, nr, nz = outline_distance(r, up, outline, first, last)
    share = nr / r if r > 1e-12 else 0.0     # on the axis all gradients round it count as one
    nu, nv, nw = share * eu + nz * au, share * ev + nz * av, share * ew + nz * aw
    height = _clamped(up - nz * r / nr, node[37], node[39]) if nr > 1e-12 else node[38]
    i, z0, z1 = (15, node[37], node[38]) if height <= node[38] else (21, node[38], node[39])
    k = (height - z0) / (z1 - z0)
    u0, u1 = node[i] + k * (node[i + 6] - node[i]) - u, node[i + 3] + k * (node[i + 9] - node[i + 3]) - u
    v0, v1 = node[i + 1] + k * (node[i + 7] - node[i + 1]) - v, node[i + 4] + k * (node[i + 10] - node[i + 4]) - v
    w0, w1 = node[i + 2] + k * (node[i + 8] - node[i + 2]) - w, node[i + 5] + k * (node[i + 11] - node[i + 5]) - w
    if node[33] > WIDEST_RAD:                # what follows holds for less than a quarter turn
        return -math.inf
    low = d - _most(nu, u0, u1) - _most(nv, v0, v1) - _most(nw, w0, w1)
    if node[33] > 0.0:
        low -= _bulge(r - d * nr, up - d * nz, nr, nz, height, node[33], outline, first, last)
    return low
