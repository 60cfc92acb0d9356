"""Upper bounds of how deep a piece of a part lies inside a moving cutter, along whatever direction is nearest out.

The cutter with its tip at C holds what lies within rc of its core: the column of radius a = R - rc from height C_z + rc
up to C_z + top, without end (top = inf) where the cutter counts as closed upward.  It is convex, so the depth of a point
S is the least over its supporting planes:

    depth(D) = min over unit n of  H(n) - n . D,    D = S - C,    H(n) = a |n_xy| + rc + (rc or, where n_z > 0, top) n_z

Any one n (and any mean of several, with the same mean of their H) therefore bounds the depth of all S and C at
once by H(n) + max(-n . S) + max(n . C).  A bound needs no exact n: one that points out of the cutter near the deepest
point makes it close, to second order in the sizes of piece and move.  That is all these functions look for.
"""

import math

import numpy as np

from cuspline.surfaces.patches import DS, DT, POINT
from cuspline.toolpaths.contact.leaf_rows import (
    KIND,
    REACH_S,
    REACH_SS,
    REACH_SSS,
    REACH_SST,
    REACH_ST,
    REACH_STT,
    REACH_T,
    REACH_TT,
    REACH_TTT,
    SHAPE,
)
from cuspline.toolpaths.drop.patch_bounds import FACE, HX_HIGH, HX_LOW, cone_box
from cuspline.toolpaths.drop.patch_tree import LEVEL
from cuspline.values.compiled import njit
from cuspline.values.rows import X_HIGH, X_LOW, Y_HIGH, Y_LOW, Z_HIGH, Z_LOW, X, Y, Z

NORMAL, TOPMOST, SLANT = 6, 9, 10       # columns of a node, behind its box, see depth_tree
SIGMA, TAU, THETA = range(3)            # where in a box and a stretch, -1..1
OUTWARD_MM = 1e-9       # added to every bound: rounding of coordinates below a metre
UPRIGHT = 0.02          # N_z below which a node's N says nothing about heights
SWEEPS = 8


@njit(inline="always", error_model="numpy")
def depth_at(x, y, z, R, rc, top):
    """Depth of a point at (x, y, z) from the tip; negative outside: minus the distance."""
    a = R - rc
    d = math.sqrt(x * x + y * y)
    e, f = d - a, max(rc - z, z - top)
    if e > 0.0 and f > 0.0:
        return rc - math.sqrt(e * e + f * f)
    return rc - max(e, f)


@njit(inline="always", error_model="numpy")
def _least(tips, low, high, x, y, z):
    """Least of (x, y, z) . tip over rows low..high."""
    best = np.inf
    for i in range(low, high + 1):
        best = min(best, x * tips[i, X] + y * tips[i, Y] + z * tips[i, Z])
    return best


@njit(inline="always", error_model="numpy")
def _most(m, low, high):
    return m * high if m > 0.0 else m * low


@njit(error_model="numpy")
def node_depth(nodes, k, tips, low, high, box, R, rc, top, enough):
    """Upper bound of the depth of what node k holds in a cutter whose tip runs through rows low..high of `tips`.

    Args:
        nodes: see depth_tree.   tips: (n, 3).
        box: (6,) least and largest x, y, z of these tips.
        top: of the cutter's core
        enough: no closer bound is looked for once this is reached.
    """
    a = R - rc
    xl, xh, yl, yh = (nodes[k, X_LOW] - box[X_HIGH], nodes[k, X_HIGH] - box[X_LOW], nodes[k, Y_LOW] - box[Y_HIGH],
                      nodes[k, Y_HIGH] - box[Y_LOW])
    zh = nodes[k, Z_HIGH] - box[Z_LOW]
    dx, dy = max(xl, -xh, 0.0), max(yl, -yh, 0.0)
    zl = nodes[k, 4] - box[5]
    middle = min(max(0.5 * (rc + top), zl), zh)
    depth = depth_at(dx, dy, middle, R, rc, top) + OUTWARD_MM
    if depth <= enough:
        return depth
    x, y, z, c, h = nodes[k, NORMAL + X], nodes[k, NORMAL + Y], nodes[k, NORMAL + Z], nodes[k, TOPMOST], nodes[k, SLANT]
    c_mid = c - _least(tips, low, high, x, y, z)
    depth = min(depth, a * h + rc - rc * z + c_mid + OUTWARD_MM)
    if depth <= enough:
        return depth
    reach = rc + a / h if h > 1e-9 else rc
    px, py = min(max(-reach * x, xl), xh), min(max(-reach * y, yl), yh)
    is_flat = z > UPRIGHT
    for turn in range(2):
        pz = min(zh, (c_mid - x * px - y * py) / z) if is_flat else zh
        if zl > top:                            # over the core: as near to it as the node's box reaches
            pz = zl
        d = math.sqrt(px * px + py * py)
        e, f = max(d - a, 0.0), max(rc - pz, 0.0) + min(top - pz, 0.0)
        g = math.sqrt(e * e + f * f)
        if rc > 0.0 and g > 1e-9:
            s = e / (d * g) if e > 0.0 else 0.0
            nx, ny, nz = px * s, py * s, -f / g
            support = a * e / g + rc + (rc if f >= 0.0 else top) * nz
        else:                                   # a mean of the side's plane and the bottom's
            ux, uy = (px / d, py / d) if d > 1e-9 else (1.0, 0.0)
            share = 1.0
            if is_flat:
                s = -(x * ux + y * uy) / z
                share = s / (1.0 + s) if s > 0.0 else 0.0
            nx, ny, nz = share * ux, share * uy, share - 1.0
            support = share * R
        w = -nz / z if is_flat and nz <= 0.0 else max(-(nx * x + ny * y + nz * z), 0.0)
        mx, my, mz = -nx - w * x, -ny - w * y, -nz - w * z
        bound = (support + w * c + _most(mx, nodes[k, X_LOW], nodes[k, X_HIGH])
                 + _most(my, nodes[k, Y_LOW], nodes[k, Y_HIGH]) + _most(mz, nodes[k, Z_LOW], nodes[k, Z_HIGH])
                 - _least(tips, low, high, -nx, -ny, -nz))
        depth = min(depth, bound + OUTWARD_MM)
        if depth <= enough or turn == 1:
            break
        step = g * z * z if is_flat and nz <= 0.0 else g      # Newton's step along the plane
        qx, qy = min(max(px + mx * step, xl), xh), min(max(py + my * step, yl), yh)
        if qx == px and qy == py:
            break
        px, py = qx, qy
    return depth


@njit(inline="always", error_model="numpy")
def _along(o, row, nx, ny, nz):
    return nx * o[row, X] + ny * o[row, Y] + nz * o[row, Z]


@njit(inline="always", error_model="numpy")
def _piece_value(o, x, y, z, vx, vy, vz, cubic, nx, ny, nz, support):
    """The bound that n gives over a piece and a stretch."""
    return (support - nx * x - ny * y - nz * z + abs(_along(o, 1, nx, ny, nz)) + abs(_along(o, 2, nx, ny, nz))
            + abs(nx * vx + ny * vy + nz * vz) + max(-_along(o, 3, nx, ny, nz), 0.0) * 0.5
            + abs(_along(o, 4, nx, ny, nz)) + max(-_along(o, 5, nx, ny, nz), 0.0) * 0.5 + cubic + OUTWARD_MM)


@njit(error_model="numpy")
def piece_depth(o, row, tag, sign, alpha, beta, middle, half, R, rc, top, bound, normals, at):
    """Upper bound of the depth over a box of a leaf and a stretch of a move.

    Args:
        o: (6, 3) point and derivatives in the box's middle, per half side of the box.
        row, tag: of the leaf (see patch_tree).   alpha, beta: half sides of the box in units of the leaf's.
        middle, half: (3,) tip in the middle of the stretch, from there to its end.
        top: of the cutter's core   bound: known so far.
        normals: (8,) scratch.
        at: (3,) filled: sigma, tau, theta (-1..1) of a likely deepest point.
    Returns:
        the bound; -inf if the deepest point of the face cannot lie inside the box: then its edges hold it.
    """
    a = R - rc
    x, y, z = o[POINT, X] - middle[X], o[POINT, Y] - middle[Y], o[POINT, Z] - middle[Z]
    vx, vy, vz = half[X], half[Y], half[Z]
    cubic = (row[REACH_SSS] * alpha ** 3 + 3.0 * row[REACH_SST] * alpha * alpha * beta
             + 3.0 * row[REACH_STT] * alpha * beta * beta + row[REACH_TTT] * beta ** 3) / 6.0
    at[SIGMA] = at[TAU] = at[THETA] = 0.0
    n = 0.0
    if tag[KIND] == FACE:
        nx = sign * (o[DS, Y] * o[DT, Z] - o[DS, Z] * o[DT, Y])
        ny = sign * (o[DS, Z] * o[DT, X] - o[DS, X] * o[DT, Z])
        nz = sign * (o[DS, X] * o[DT, Y] - o[DS, Y] * o[DT, X])
        n = math.sqrt(nx * nx + ny * ny + nz * nz)
    if n > 0.0:
        turn = ((row[REACH_SS] * row[REACH_T] + row[REACH_S] * row[REACH_ST]) * alpha
                + (row[REACH_ST] * row[REACH_T] + row[REACH_S] * row[REACH_TT]) * beta)
        nx, ny, nz, sine = nx / n, ny / n, nz / n, turn * alpha * beta / n
        h = math.sqrt(nx * nx + ny * ny)
        if nz >= 0.0 or top < np.inf:
            bound = min(bound, _piece_value(o, x, y, z, vx, vy, vz, cubic, -nx, -ny, -nz,
                                            a * h + rc - (rc if nz >= 0.0 else top) * nz))
        if sine < 1.0 and not _may_hold_deepest(o, row, tag, alpha, beta, x, y, z, vx, vy, vz, nx, ny, nz, h, sine,
                                                R, rc, top, bound, normals):
            return -np.inf
    if a > 0.0:                                 # beside a wall: the plane of the cutter's side at the nearest point
        ux, uy = _nearest_to_axis(o, x, y, vx, vy, at)
        bound = min(bound, _piece_value(o, x, y, z, vx, vy, vz, cubic, ux, uy, 0.0, R))
    # the deepest point of the linear part: nearest to the cutter's core, one unknown after the other
    ss, tt = _along(o, 1, o[DS, X], o[DS, Y], o[DS, Z]), _along(o, 2, o[DT, X], o[DT, Y], o[DT, Z])
    vv = vx * vx + vy * vy + vz * vz
    s = t = w = 0.0
    px, py, pz = x, y, z
    for _ in range(SWEEPS):
        d = math.sqrt(px * px + py * py)
        e, f = max(d - a, 0.0), max(rc - pz, 0.0) + min(top - pz, 0.0)
        if e + abs(f) < 1e-9:
            break
        m = e / d if e > 0.0 else 0.0
        rx, ry, rz = px * m, py * m, -f
        before = s, t, w
        if ss > 0.0:
            q = min(max(s - (rx * o[DS, X] + ry * o[DS, Y] + rz * o[DS, Z]) / ss, -1.0), 1.0) - s
            rx, ry, rz, s = rx + q * o[DS, X], ry + q * o[DS, Y], rz + q * o[DS, Z], s + q
        if tt > 0.0:
            q = min(max(t - (rx * o[DT, X] + ry * o[DT, Y] + rz * o[DT, Z]) / tt, -1.0), 1.0) - t
            rx, ry, rz, t = rx + q * o[DT, X], ry + q * o[DT, Y], rz + q * o[DT, Z], t + q
        if vv > 0.0:
            w = min(max(w + (rx * vx + ry * vy + rz * vz) / vv, -1.0), 1.0)
        px, py, pz = (x + s * o[DS, X] + t * o[DT, X] - w * vx, y + s * o[DS, Y] + t * o[DT, Y] - w * vy,
                      z + s * o[DS, Z] + t * o[DT, Z] - w * vz)
        if abs(s - before[SIGMA]) + abs(t - before[TAU]) + abs(w - before[THETA]) < 1e-3:
            break
    d = math.sqrt(px * px + py * py)
    e, f = max(d - a, 0.0), max(rc - pz, 0.0) + min(top - pz, 0.0)
    g = math.sqrt(e * e + f * f)
    if g > 1e-9 and rc > 0.0:
        at[SIGMA], at[TAU], at[THETA] = s, t, w
        m = e / (d * g) if e > 0.0 else 0.0
        return min(bound, _piece_value(o, x, y, z, vx, vy, vz, cubic, px * m, py * m, -f / g,
                                       a * e / g + rc - (rc if f >= 0.0 else top) * f / g))
    if top < np.inf:
        bound = min(bound, _piece_value(o, x, y, z, vx, vy, vz, cubic, 0.0, 0.0, 1.0, rc + top))
    # inside the core: the mean of the side's plane and the bottom's under which one unknown drops out
    ux, uy = (px / d, py / d) if d > 1e-9 else (1.0, 0.0)
    for k in range(5):
        share = float(k)
        if k > 1:
            if k == 2:
                side, down = -(ux * o[DS, X] + uy * o[DS, Y]), o[DS, Z]
            elif k == 3:
                side, down = -(ux * o[DT, X] + uy * o[DT, Y]), o[DT, Z]
            else:
                side, down = ux * vx + uy * vy, -vz
            if not side * down < 0.0:
                continue
            share = down / (down - side)
        bound = min(bound, _piece_value(o, x, y, z, vx, vy, vz, cubic, share * ux, share * uy, share - 1.0, share * R))
    return bound


@njit(error_model="numpy")
def _nearest_to_axis(o, x, y, vx, vy, at):
    """Direction from the axis to the linear part's point nearest to it; its sigma, tau, theta into `at`."""
    ss, tt = o[DS, X] * o[DS, X] + o[DS, Y] * o[DS, Y], o[DT, X] * o[DT, X] + o[DT, Y] * o[DT, Y]
    vv = vx * vx + vy * vy
    s = t = w = 0.0
    for _ in range(SWEEPS):
        before = s, t, w
        if ss > 0.0:
            q = min(max(s - (x * o[DS, X] + y * o[DS, Y]) / ss, -1.0), 1.0) - s
            x, y, s = x + q * o[DS, X], y + q * o[DS, Y], s + q
        if tt > 0.0:
            q = min(max(t - (x * o[DT, X] + y * o[DT, Y]) / tt, -1.0), 1.0) - t
            x, y, t = x + q * o[DT, X], y + q * o[DT, Y], t + q
        if vv > 0.0:
            q = min(max(w + (x * vx + y * vy) / vv, -1.0), 1.0) - w
            x, y, w = x - q * vx, y - q * vy, w + q
        if abs(s - before[SIGMA]) + abs(t - before[TAU]) + abs(w - before[THETA]) < 1e-3:
            break
    at[SIGMA], at[TAU], at[THETA] = s, t, w
    d = math.sqrt(x * x + y * y)
    return (x / d, y / d) if d > 1e-9 else (1.0, 0.0)


@njit(error_model="numpy")
def _may_hold_deepest(o, row, tag, alpha, beta, x, y, z, vx, vy, vz, nx, ny, nz, h, sine, R, rc, top, bound, normals):
    """Can a deepest point of a face, not on its border, lie in a box with these normals, at most `bound` deep?

    There the cutter, taken smaller all round by the depth, touches the face squarely: its axis stands at
    S_xy + a' h + r' n_xy, h the horizontal direction of the normal n, r' = rc - depth (a' = a), or 0 (a' = R - depth).
    A point as deep as half the cutter's height, or as its radius, is deepest whatever the face's normal there.
    """
    if bound >= min(R, 0.5 * (rc + top)):
        return True
    a = R - rc
    bend = (0.5 * (row[REACH_SS] * alpha * alpha + 2.0 * row[REACH_ST] * alpha * beta + row[REACH_TT] * beta * beta)
            + OUTWARD_MM)
    d = math.sqrt(x * x + y * y)
    if d > 0.0:
        ux, uy = x / d, y / d
        near = (d - abs(ux * o[DS, X] + uy * o[DS, Y]) - abs(ux * o[DT, X] + uy * o[DT, Y]) - abs(ux * vx + uy * vy)
                - bend)
        farthest = a + rc * min(h + sine, 1.0)
        if tag[SHAPE] == LEVEL:                     # as deep all over: where the side is no nearer than the bottom
            farthest = min(a, R - (z - abs(vz))) + OUTWARD_MM
        if near > farthest:
            return False
    cone_box(nx, ny, nz, sine, 1.0, normals)
    least = max(rc - max(bound, 0.0), 0.0)
    narrow = a - max(bound - rc, 0.0)
    for k in range(2):
        q, v = (x, vx) if k == 0 else (y, vy)
        wide = abs(o[DS, k]) + abs(o[DT, k]) + abs(v) + bend
        n0, n1, h0, h1 = normals[2 * k], normals[2 * k + 1], normals[HX_LOW + 2 * k], normals[HX_HIGH + 2 * k]
        if q + wide + max(rc * n1, least * n1) + max(a * h1, narrow * h1) < 0.0 \
                or q - wide + min(rc * n0, least * n0) + min(a * h0, narrow * h0) > 0.0:
            return False
    return True
