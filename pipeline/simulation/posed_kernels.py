r"""Exact signed distance of a point to what a tilted, turning cutter sweeps in one sub-step, and bounds for many.

The distance F to the cutter's body is convex (see outlines.py).  Seen from the cutter, the point moves along a
curve x(t) whose acceleration is at most

    M = 2 w v + (w² + w³) D        w turning, v tip's way, D distance from the tip, for one sub-step

so f(t) = F(x(t)) has f'' >= -M: on an interval of width h its tangents, each tilted by M h / 2, bound it from
below.  All lengths in mm; distances are negative inside.
"""

import math

import numpy as np
from numba import njit

from cuspline.simulation.outlines import outline_distance

CLOSE_MM = 1e-9           # the least distance along a sub-step is found to this
WAITING = 64              # more intervals than can wait at once: every one is halved at the latest at 1e-15
NEAR_END = 0.1            # an interval is never split nearer to its ends than this share
SMOOTH = 0.05             # how far f may be from a parabola for its slopes to be interpolated


@njit(cache=True)
def pose_distance(px, py, pz, g, t, outline, first, last):
    """Signed distance of a point to the cutter at the share t of a sub-step, and its derivative by t."""
    x, y, z = px - g[0] - t * g[3], py - g[1] - t * g[4], pz - g[2] - t * g[5]
    ax, ay, az = g[6] + t * g[9], g[7] + t * g[10], g[8] + t * g[11]
    stretch = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
    ax, ay, az = ax * stretch, ay * stretch, az * stretch
    up = x * ax + y * ay + z * az
    ex, ey, ez = x - up * ax, y - up * ay, z - up * az
    r = math.sqrt(ex * ex + ey * ey + ez * ez)
    d, nr, nz = outline_distance(r, up, outline, first, last)
    if r < 1e-12:
        return d, -nz * (ax * g[3] + ay * g[4] + az * g[5])
    ex, ey, ez = ex / r, ey / r, ez / r
    way = (nr * ex + nz * ax) * g[3] + (nr * ey + nz * ay) * g[4] + (nr * ez + nz * az) * g[5]
    turn = (ex * g[9] + ey * g[10] + ez * g[11]) * stretch
    return d, (nz * r - nr * up) * turn - way


@njit(cache=True)
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


@njit(cache=True)
def _split_at(l, r, fl, fr, sl, sr, crossing):
    """Where to look next in [l, r]: at the least of a parabola where f is one, else where the tangents cross."""
    w, t = r - l, crossing
    if sl < 0.0 < sr and abs(fr - fl - 0.5 * (sl + sr) * w) < SMOOTH * (sr - sl) * w:
        t = l - sl * w / (sr - sl)
    return min(max(t, l + NEAR_END * w), r - NEAR_END * w)


@njit(cache=True)
def substep_distance(px, py, pz, g, outline, first, last, best, waiting):
    """Least of `pose_distance` over a sub-step; where that is not below `best`, anything from `best` on."""
    fm, sm = pose_distance(px, py, pz, g, 0.5, outline, first, last)
    x, y, z = px - g[0] - 0.5 * g[3], py - g[1] - 0.5 * g[4], pz - g[2] - 0.5 * g[5]
    w = g[13]
    M = 2.0 * w * g[12] + w * w * (1.0 + w) * (math.sqrt(x * x + y * y + z * z) + 0.5 * g[12])
    if fm - 0.5 * abs(sm) - 0.125 * M >= best or g[12] + w == 0.0:
        return fm
    f0, s0 = pose_distance(px, py, pz, g, 0.0, outline, first, last)
    f1, s1 = pose_distance(px, py, pz, g, 1.0, outline, first, last)
    best = min(best, f0, fm, f1)
    waiting[0, 0], waiting[0, 1], waiting[0, 2], waiting[0, 3], waiting[0, 4], waiting[0, 5] = 0.0, 0.5, f0, fm, s0, sm
    waiting[1, 0], waiting[1, 1], waiting[1, 2], waiting[1, 3], waiting[1, 4], waiting[1, 5] = 0.5, 1.0, fm, f1, sm, s1
    top = 2
    while top > 0:
        top -= 1
        l, r, fl, fr, sl, sr = waiting[top]
        low, t = _lowest_possible(l, r, fl, fr, sl, sr, M)
        if low >= best - CLOSE_MM or r - l < 1e-15 or top > WAITING - 2:
            continue
        t = _split_at(l, r, fl, fr, sl, sr, t)
        f, s = pose_distance(px, py, pz, g, t, outline, first, last)
        best = min(best, f)
        left, right = (top + 1, top) if s > 0.0 else (top, top + 1)      # downhill first
        waiting[left, 0], waiting[left, 1], waiting[left, 2] = l, t, fl
        waiting[left, 3], waiting[left, 4], waiting[left, 5] = f, sl, s
        waiting[right, 0], waiting[right, 1], waiting[right, 2] = t, r, f
        waiting[right, 3], waiting[right, 4], waiting[right, 5] = fr, s, sr
        top += 2
    return best


@njit(cache=True)
def _clamped(x, low, high):
    return min(max(x, low), high)


@njit(cache=True)
def _most(slope, low, high):
    """Largest slope * x on [low, high]."""
    return slope * high if slope > 0.0 else slope * low


@njit(cache=True)
def poses_distance(px, py, pz, node, outline, first, last, z0, z1):
    r"""Lower bound of `pose_distance` over all poses of a tree node (see posed_tree.py for its columns).

    The node's middle cutter, shifted inside the node's box to where it would touch first, has distance d and
    gradient n.  A cutter of the node arises from that one by a shift and a turn by at most theta about any
    point Q of its axis.  F is convex, so with y = P - Q and the axis point Q' of the other cutter

        F >= d - n.(Q' - Q) - theta |y across n| - theta² / 2 (y along n)

    Q is chosen where the line through P along n meets the axis, as near as z0 <= z <= z1 allows: then y has
    nothing across n but what Q' - Q adds, and all that is lost grows with the square of the node's size.
    """
    x, y, z = px - node[0], py - node[1], pz - node[2]
    bx, by, bz = x - node[28], y - node[29], z - node[30]
    u = _clamped(bx * node[6] + by * node[7] + bz * node[8], node[15], node[18])
    v = _clamped(bx * node[9] + by * node[10] + bz * node[11], node[16], node[19])
    w = _clamped(bx * node[12] + by * node[13] + bz * node[14], node[17], node[20])
    x -= u * node[6] + v * node[9] + w * node[12]
    y -= u * node[7] + v * node[10] + w * node[13]
    z -= u * node[8] + v * node[11] + w * node[14]
    ax, ay, az = node[3], node[4], node[5]
    up = x * ax + y * ay + z * az
    ex, ey, ez = x - up * ax, y - up * ay, z - up * az
    r = math.sqrt(ex * ex + ey * ey + ez * ez)
    d, nr, nz = outline_distance(r, up, outline, first, last)
    share = nr / r if r > 1e-12 else 0.0
    nr = nr if r > 1e-12 else 0.0
    nx, ny, nw = share * ex + nz * ax, share * ey + nz * ay, share * ez + nz * az
    height = _clamped(up - nz / share, z0, z1) if share > 1e-12 else z0
    k = (height - z0) / (z1 - z0)
    nu = nx * node[6] + ny * node[7] + nw * node[8]
    nv = nx * node[9] + ny * node[10] + nw * node[11]
    nw = nx * node[12] + ny * node[13] + nw * node[14]
    u0, u1 = node[15] + k * (node[21] - node[15]) - u, node[18] + k * (node[24] - node[18]) - u
    v0, v1 = node[16] + k * (node[22] - node[16]) - v, node[19] + k * (node[25] - node[19]) - v
    w0, w1 = node[17] + k * (node[23] - node[17]) - w, node[20] + k * (node[26] - node[20]) - w
    theta = node[27]
    low = d - _most(nu, u0, u1) - _most(nv, v0, v1) - _most(nw, w0, w1)
    if theta == 0.0:
        return low
    eu, ev, ew = max(u1, -u0), max(v1, -v0), max(w1, -w0)
    far = math.sqrt(eu * eu + ev * ev + ew * ew)
    across = abs(r * nz - (up - height) * nr) + far
    along = max(r * nr + (up - height) * nz + far, 0.0)
    return low - theta * (across + 0.5 * theta * along)
