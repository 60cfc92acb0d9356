r"""Bounds for points at the side of a tilted cutter that cuts: cheap, and the sharper the smaller a node is.

The touching plane of a body with normal m, |m| not 1, is m.x = g(m), g the body's support; a point p is at least

    (m.p - g(m)) / |m|

away, for every m.  With u v w a node's frame, w out of the material, and m = -w + a u + b v, all bodies of the node
together have

    g(m) <= -c + a xu + |a| hu + b xv + |b| hv + (Ru a² + Rv b²) / 2       for -A <= a <= A', |b| <= B

where c, and the rectangle xu +- hu, xv +- hv, hold what touches the planes across w.  The best a and b for a point
follow from how far it lies beside the rectangle: the bound rises as the distance to an arc does, then, from A, A'
and B on, straight.

A body of revolution has the support  rho |m| + e |m'| + f (m.axis)  where an arc of radius rho about (e, f) touches, m'
being m less its way along the axis: rho = 0 at a corner, e = 0 on a ball.  With u along the meridian and s the
sine of the angle from axis to w, |m'| is the length of (s + a, b), and so

    |m'| <= s + a + b² / 2 (s + a)        Ru = rho, Rv = rho + e / (s + a)

Meridians that lie askew by a sine q mix a and b: b² <= b² (1 + q/k) + a² (q² + q k), any k.  No flat of the outline may
touch within the tilts: there a body does not bend, it jumps.

Between the ends of a sub-step: the support of a body that moves and turns is the largest of those of its points, whose
second derivatives are no less than -D (w² + w³), D their distance from the tip: no pose reaches farther than both
ends by more than an eighth of that.
"""

import math

from cuspline.stock.outlines import (
    CENTER_R,
    DIRECTION_R,
    DIRECTION_Z,
    FROM_R,
    FROM_Z,
    IS_ARC,
    RADIUS,
    START_R,
    START_Z,
    TO_R,
    TO_Z,
    touching_point,
)
from cuspline.stock.tilted_kernels import FRAME_U, FRAME_V, FRAME_W, MIDDLE_TIP
from cuspline.stock.tilted_pieces import AXIS, AXIS_WAY, TIP, TURN, WAY
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z

(FACE, AT_U, AT_V, HALF_U, HALF_V, RADIUS_U, BEND, ACROSS, SINE, BACK_U, MOST_U, MOST_V,      # columns of a tree's node
 OFF_UU, OFF_UV, OFF_VV) = range(41, 56)
BEGIN, TO_END = 0, 3      # of touches, in the leaf's frame: what touches where a sub-step begins, and the way to its end
TILT = 0.3                # the most that m tilts
LONGEST = 1.1             # no m is longer: sqrt(1 + 2 TILT²)
BACK_SHARE = 0.3          # toward the axis m tilts by this share of the sine of the angle between it and w,
ASIDE_SHARE = 0.25        # aside by so much that askew meridians take no more than this share of it
LEAST_SHARE = 0.02        # of the smaller radius in the larger one, as far as mixing goes
NEAR_MM = 1e-3            # how far off sub-steps are that are about as near as the nearest


@njit(error_model="numpy", inline="always")
def facing_distance(px, py, pz, nodes, row):
    """Lower bound of `pose_distance` over all poses of a tree node; whether it is as sharp as it can be, no tilt at its end.

    Last a number that is the smaller, the likelier the node holds the nearest pose: how far the point is from the node's
    middle, in terms of how the node spreads and the bodies bend.
    """
    x, y, z = px - nodes[row, MIDDLE_TIP + X], py - nodes[row, MIDDLE_TIP + Y], pz - nodes[row, MIDDLE_TIP + Z]
    pu = x * nodes[row, FRAME_U + X] + y * nodes[row, FRAME_U + Y] + z * nodes[row, FRAME_U + Z]
    pv = x * nodes[row, FRAME_V + X] + y * nodes[row, FRAME_V + Y] + z * nodes[row, FRAME_V + Z]
    pw = x * nodes[row, FRAME_W + X] + y * nodes[row, FRAME_W + Y] + z * nodes[row, FRAME_W + Z]
    du, dv, radius_u = pu - nodes[row, AT_U], pv - nodes[row, AT_V], nodes[row, RADIUS_U]
    is_back = du <= 0.0
    u, v = max(abs(du) - nodes[row, HALF_U], 0.0), max(abs(dv) - nodes[row, HALF_V], 0.0)
    most = nodes[row, BACK_U] if is_back else nodes[row, MOST_U]
    a = min(u / radius_u, most)
    radius_v = nodes[row, BEND] + nodes[row, ACROSS] / (nodes[row, SINE] - (a if is_back else 0.0))
    b = min(v / radius_v, nodes[row, MOST_V])
    up = nodes[row, FACE] - pw
    low = up + a * (u - 0.5 * radius_u * a) + b * (v - 0.5 * radius_v * b)
    is_sharp = a < most and b < nodes[row, MOST_V]
    off = nodes[row, OFF_UU] * du * du + nodes[row, OFF_UV] * du * dv + nodes[row, OFF_VV] * dv * dv
    return low - 0.5 * max(low, 0.0) * (a * a + b * b), is_sharp, off        # less than over |m|, without a root


@njit(error_model="numpy", inline="always")
def seen_from(px, py, pz, nodes, row):
    """A point in a leaf's frame, and the radius across and the least tilt along u that hold for its sub-steps there."""
    x, y, z = px - nodes[row, MIDDLE_TIP + X], py - nodes[row, MIDDLE_TIP + Y], pz - nodes[row, MIDDLE_TIP + Z]
    pu = x * nodes[row, FRAME_U + X] + y * nodes[row, FRAME_U + Y] + z * nodes[row, FRAME_U + Z]
    pv = x * nodes[row, FRAME_V + X] + y * nodes[row, FRAME_V + Y] + z * nodes[row, FRAME_V + Z]
    pw = x * nodes[row, FRAME_W + X] + y * nodes[row, FRAME_W + Y] + z * nodes[row, FRAME_W + Z]
    back = nodes[row, BACK_U] if pu < nodes[row, AT_U] else 0.0
    return pu, pv, pw, nodes[row, BEND] + nodes[row, ACROSS] / (nodes[row, SINE] - back), -back


@njit(error_model="numpy", inline="always")
def step_bound(pu, pv, pw, radius_v, least, nodes, row, touches, k):
    """Lower bound of the distance of a point, as its leaf sees it, to sub-step k: of both ends, for one m."""
    u, v, radius_u = pu - touches[k, BEGIN + X], pv - touches[k, BEGIN + Y], nodes[row, RADIUS_U]
    eu, ev, ew = touches[k, TO_END + X], touches[k, TO_END + Y], touches[k, TO_END + Z]
    qu, qv = eu / radius_u, ev / radius_v
    t = min(max((u * qu + v * qv - ew) / (eu * qu + ev * qv + 1e-300), 0.0), 1.0)
    a = min(max((u - t * eu) / radius_u, least), nodes[row, MOST_U])
    b = min(max((v - t * ev) / radius_v, -nodes[row, MOST_V]), nodes[row, MOST_V])
    low = touches[k, BEGIN + Z] - pw + a * (u - 0.5 * radius_u * a) + b * (v - 0.5 * radius_v * b) + min(ew - a * eu - b * ev, 0.0)
    return low - 0.5 * max(low, 0.0) * (a * a + b * b)


@njit(error_model="numpy")
def _angle(nr, nz):
    """Of a normal, from the axis downward."""
    return fixed.arctan2(nr, -nz)


@njit(error_model="numpy")
def bends(low, high, outline):
    """Where normals are low..high (rad) from the axis: largest radius of the outline, farthest way from the axis to the middle of
    that radius; inf: a plane is among them."""
    radius = beside = before = 0.0
    for k in range(len(outline)):
        if outline[k, IS_ARC] == 0.0:
            begin = end = _angle(outline[k, DIRECTION_Z], -outline[k, DIRECTION_R])
            if low <= begin <= high:
                return math.inf, math.inf
        else:
            begin, end = _angle(outline[k, FROM_R], outline[k, FROM_Z]), _angle(outline[k, TO_R], outline[k, TO_Z])
            if begin <= high and low <= end:
                radius, beside = max(radius, outline[k, RADIUS]), max(beside, outline[k, CENTER_R])
        if k > 0 and before <= high and low <= begin and begin - before > 1e-9:             # a corner
            beside = max(beside, outline[k, START_R])
        before = end
    return radius, beside


@njit(error_model="numpy")
def _reach(high, outline):
    """Distance from the tip within which a body touches planes whose normals are up to `high` from the axis."""
    widest = 0.0
    for k in range(len(outline)):
        widest = max(widest, outline[k, START_R])
        if outline[k, IS_ARC] != 0.0:
            widest = max(widest, outline[k, CENTER_R] + outline[k, RADIUS])
    _, z, _ = touching_point(fixed.sin(high), -fixed.cos(high), outline, 0, len(outline))
    return math.sqrt(widest * widest + max(z * z, outline[0, START_Z] * outline[0, START_Z]))


@njit(error_model="numpy")
def _settle(node, outline, nearest, farthest, askew, is_along):
    """Fills in radii and how far m may tilt.

    nearest..farthest: angles of the axes to w.   askew: largest sine of a meridian to u; is_along: none points back.
    """
    wide = math.sqrt(2.0) * TILT
    radius, beside = bends(max(nearest - wide, 0.0), farthest + wide, outline)
    node[SINE] = 1.0
    if beside <= 1e-9:
        node[RADIUS_U] = node[BEND] = max(radius, 1e-9)
        node[BACK_U] = node[MOST_U] = node[MOST_V] = TILT
        return
    sine = min(fixed.sin(nearest), fixed.sin(farthest))
    back, aside = min(BACK_SHARE * sine, TILT), TILT
    if askew * aside > ASIDE_SHARE * sine:
        aside = ASIDE_SHARE * sine / askew
    left = sine - askew * aside                            # of the way of m across the axis
    if not left > back:
        return
    radius, beside = bends(fixed.arcsin((left - back) / (1.0 + wide)), farthest + wide, outline)
    if not beside < math.inf:
        return
    across = max(beside, 1e-9) / (left - back)
    share = min(math.sqrt(max(radius, LEAST_SHARE * across) / across), 1.0)
    node[RADIUS_U], node[BEND] = max(radius + across * askew * (askew + share), 1e-9), radius
    node[ACROSS], node[SINE] = beside * (1.0 + askew / share), left
    node[BACK_U], node[MOST_U], node[MOST_V] = back, TILT if is_along else back, aside


@njit(error_model="numpy")
def face(node, geometry, outline, first, last, touches):
    """Fills in what touches planes across the node's w, over sub-steps first..last, and how far such bounds hold; of a leaf also
    `touches`, which has no rows otherwise."""
    node[BACK_U] = node[MOST_U] = node[MOST_V] = 0.0
    node[RADIUS_U] = node[BEND] = node[SINE] = 1.0
    ul, uh, vl, vh, lowest = math.inf, -math.inf, math.inf, -math.inf, math.inf
    su = sv = suu = suv = svv = 0.0
    least, most, askew, turn, is_along = 1.0, -1.0, 0.0, 0.0, True
    for t in range(first, last):
        turn = max(turn, geometry[t, TURN])
        for end in range(2):
            ax = geometry[t, AXIS + X] + end * geometry[t, AXIS_WAY + X]
            ay = geometry[t, AXIS + Y] + end * geometry[t, AXIS_WAY + Y]
            az = geometry[t, AXIS + Z] + end * geometry[t, AXIS_WAY + Z]
            x = geometry[t, TIP + X] + end * geometry[t, WAY + X] - node[MIDDLE_TIP + X]
            y = geometry[t, TIP + Y] + end * geometry[t, WAY + Y] - node[MIDDLE_TIP + Y]
            z = geometry[t, TIP + Z] + end * geometry[t, WAY + Z] - node[MIDDLE_TIP + Z]
            au = node[FRAME_U + X] * ax + node[FRAME_U + Y] * ay + node[FRAME_U + Z] * az
            av = node[FRAME_V + X] * ax + node[FRAME_V + Y] * ay + node[FRAME_V + Z] * az
            aw = node[FRAME_W + X] * ax + node[FRAME_W + Y] * ay + node[FRAME_W + Z] * az
            nr = math.sqrt(au * au + av * av)
            least, most, is_along = min(least, aw), max(most, aw), is_along and au > 0.0
            askew = max(askew, abs(av) / nr if nr > 1e-9 else 1.0)
            r, up, _ = touching_point(nr, -aw, outline, 0, len(outline))
            share = r / nr if nr > 1e-9 else 0.0                 # of the way across the axis, towards -w
            u = node[FRAME_U + X] * x + node[FRAME_U + Y] * y + node[FRAME_U + Z] * z + au * (up + share * aw)
            v = node[FRAME_V + X] * x + node[FRAME_V + Y] * y + node[FRAME_V + Z] * z + av * (up + share * aw)
            w = node[FRAME_W + X] * x + node[FRAME_W + Y] * y + node[FRAME_W + Z] * z + aw * up - share * nr * nr
            if len(touches) > 0:
                touches[t, 3 * end + X], touches[t, 3 * end + Y], touches[t, 3 * end + Z] = u, v, w
            su, sv, suu, suv, svv = su + u, sv + v, suu + u * u, suv + u * v, svv + v * v
            ul, uh, vl, vh, lowest = min(ul, u), max(uh, u), min(vl, v), max(vh, v), min(lowest, w)
    nearest = fixed.arctan2(math.sqrt(max(1.0 - most * most, 0.0)), most)
    farthest = fixed.arctan2(math.sqrt(max(1.0 - least * least, 0.0)), least)
    _settle(node, outline, nearest, farthest, askew, is_along)
    node[AT_U], node[HALF_U], node[AT_V], node[HALF_V] = 0.5 * (ul + uh), 0.5 * (uh - ul), 0.5 * (vl + vh), 0.5 * (vh - vl)
    n = 2.0 * (last - first)
    suu, suv, svv = suu / n - su / n * su / n, suv / n - su / n * sv / n, svv / n - sv / n * sv / n
    suu, svv = suu + NEAR_MM * node[RADIUS_U], svv + NEAR_MM * (node[BEND] + node[ACROSS] / node[SINE])
    whole = suu * svv - suv * suv
    node[OFF_UU], node[OFF_UV], node[OFF_VV] = svv / whole, -2.0 * suv / whole, suu / whole
    more = 0.125 * LONGEST * _reach(min(farthest + 2.0 * TILT + turn, math.pi), outline) * turn * turn * (1.0 + turn)
    node[FACE] = lowest - more
    for t in range(first, first + min(len(touches), last - first)):
        for c in range(BEGIN + X, BEGIN + 3):
            touches[t, TO_END + c] -= touches[t, c]
        touches[t, BEGIN + Z] -= more
