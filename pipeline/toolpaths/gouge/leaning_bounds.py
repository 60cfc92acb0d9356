r"""Upper bounds of how deep a piece of a part lies inside a cutter of any convex outline that turns as it moves.

A convex body is held in by its touching planes: with the tip at C and the axis a, of a point S it is true that

    depth = min over unit n of  phi(n) - n . S,     phi(n) = n . C + H(n . a),     H: the outline's support

Any one n bounds the depth over a box of the face and a stretch of the move by max phi - min n . S.  Along a stretch phi is
the largest of n . (places of the cutter), each of which bends by no more than K = (w² + w³) D, w the turn and D the place's
distance from the tip; so phi stays below the larger of its ends and K dt² / 8 more.  Two n are looked at: out of the cutter at
its nearest place to the box's middle, and into the part, square to the face there.  Where cutter and face touch both miss
by the second order of box and stretch only, turn or not.
"""

import math

from cuspline.stock.outlines import (
    CENTER_R,
    CENTER_Z,
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
    outline_distance,
    touching_point,
)
from cuspline.stock.tilted_pieces import AXIS, AXIS_WAY, TIP, WAY
from cuspline.surfaces.patches import DS, DSS, DST, DT, DTT, POINT
from cuspline.toolpaths.contact.leaf_rows import REACH_SSS, REACH_SST, REACH_STT, REACH_TTT
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z

AT_TIP, AT_AXIS = 0, 3                  # of a pose (6,)
MIDDLE, HALF, BOX_X, BOX_Y, BOX_Z = range(0, 15, 3)     # of a node (15,): a box's middle, half sides, directions
MIDDLE_POSE, FIRST_POSE, LAST_POSE = range(3)           # of a stretch
SMALL_MM = 1e-5                         # what turning adds to a bound is not looked at more closely below an eighth of this
OUTWARD_MM = 1e-9                       # added to every bound: rounding of coordinates below a metre
ON_AXIS_MM = 1e-12                      # nearer to the axis a place has no direction from it


@njit(inline="always", error_model="numpy")
def put_pose(g, i, t, pose):
    """Tip and axis at a share of a sub-step (see stock/tilted_pieces.py) into pose (6,)."""
    x, y = g[i, AXIS + X] + t * g[i, AXIS_WAY + X], g[i, AXIS + Y] + t * g[i, AXIS_WAY + Y]
    z = g[i, AXIS + Z] + t * g[i, AXIS_WAY + Z]
    size = math.sqrt(x * x + y * y + z * z)
    pose[AT_AXIS + X], pose[AT_AXIS + Y], pose[AT_AXIS + Z] = x / size, y / size, z / size
    for k in range(3):
        pose[AT_TIP + k] = g[i, TIP + k] + t * g[i, WAY + k]


@njit(error_model="numpy")
def distance_out(outline, pose, x, y, z, n):
    """Signed distance of a place to the cutter at a pose, the unit direction out of it there into n (3,)."""
    ax, ay, az = pose[AT_AXIS + X], pose[AT_AXIS + Y], pose[AT_AXIS + Z]
    x, y, z = x - pose[AT_TIP + X], y - pose[AT_TIP + Y], z - pose[AT_TIP + Z]
    h = x * ax + y * ay + z * az
    x, y, z = x - h * ax, y - h * ay, z - h * az
    rho = math.sqrt(x * x + y * y + z * z)
    d, nr, nz = outline_distance(rho, h, outline, 0, len(outline))
    if rho > ON_AXIS_MM:
        x, y, z = x / rho, y / rho, z / rho
    elif abs(ax) < 0.6:                     # any direction square to the axis: x cross axis
        size = math.sqrt(az * az + ay * ay)
        x, y, z = 0.0, -az / size, ay / size
    else:
        size = math.sqrt(az * az + ax * ax)
        x, y, z = az / size, 0.0, -ax / size
    n[X], n[Y], n[Z] = nr * x + nz * ax, nr * y + nz * ay, nr * z + nz * az
    return d


@njit(inline="always", error_model="numpy")
def _support(outline, pose, nx, ny, nz):
    """(phi of a unit n at a pose, n across the axis, n along it)."""
    ax, ay, az = pose[AT_AXIS + X], pose[AT_AXIS + Y], pose[AT_AXIS + Z]
    c = nx * ax + ny * ay + nz * az
    x, y, z = nx - c * ax, ny - c * ay, nz - c * az
    s = math.sqrt(x * x + y * y + z * z)
    best = -math.inf
    for k in range(len(outline)):           # the corners, and arcs whose own n this is
        best = max(best, s * outline[k, START_R] + c * outline[k, START_Z])
        if outline[k, IS_ARC] != 0.0 and outline[k, FROM_R] * c >= outline[k, FROM_Z] * s \
                and s * outline[k, TO_Z] >= c * outline[k, TO_R]:
            best = max(best, s * outline[k, CENTER_R] + c * outline[k, CENTER_Z] + outline[k, RADIUS])
    return best + nx * pose[AT_TIP + X] + ny * pose[AT_TIP + Y] + nz * pose[AT_TIP + Z], s, c


@njit(inline="always", error_model="numpy")
def _lever_within(outline, s, c, turn, lever):
    """How far from the tip what touches may lie while the axis turns, places lying ever farther from it along the outline."""
    if s - 2.0 * turn * c <= 0.0:
        return lever
    r, h, _ = touching_point(s - 2.0 * turn * c, c + 2.0 * turn * s, outline, 0, len(outline))     # atan(2 w) > w
    return min(lever, math.sqrt(r * r + h * h))


@njit(error_model="numpy")
def most_support(outline, poses, turn, lever, grows, n):
    """(largest phi(n) over a stretch, how much of that is the stretch's).

    Args:
        poses: (3, 6) in the middle of the stretch, where it begins and ends.   turn: rad over the stretch at its fastest rate.
        lever: farthest place of the cutter from its tip.   grows: whether places lie farther from it all along the outline.
    """
    first, s, c = _support(outline, poses[FIRST_POSE], n[X], n[Y], n[Z])
    last, _, _ = _support(outline, poses[LAST_POSE], n[X], n[Y], n[Z])
    if grows and turn * turn * lever > SMALL_MM:
        lever = _lever_within(outline, s, c, turn, lever)
    more = (turn * turn + turn * turn * turn) * lever / 8.0
    return max(first, last) + more, abs(first - last) + more


@njit(inline="always", error_model="numpy")
def least_of_box(node, k, n):
    """(least n . S over a node's box, how much of that is the box's)."""
    away = 0.0
    for a in range(3):
        away += node[k, HALF + a] * abs(n[X] * node[k, BOX_X + 3 * a] + n[Y] * node[k, BOX_X + 3 * a + Y]
                                        + n[Z] * node[k, BOX_X + 3 * a + Z])
    return n[X] * node[k, MIDDLE + X] + n[Y] * node[k, MIDDLE + Y] + n[Z] * node[k, MIDDLE + Z] - away, away


@njit(inline="always", error_model="numpy")
def _along(o, row, n):
    return n[X] * o[row, X] + n[Y] * o[row, Y] + n[Z] * o[row, Z]


@njit(error_model="numpy")
def least_of_piece(o, row, alpha, beta, n):
    """(least n . S over a box of a leaf, how much of that is its s and its t).

    Args:
        o: (6, 3) point and derivatives in the box's middle, per half side of the box.
        row: of the leaf.   alpha, beta: half sides of the box in units of the leaf's.
    """
    cubic_s = row[REACH_SSS] * alpha * alpha * alpha + 3.0 * row[REACH_SST] * alpha * alpha * beta
    cubic_t = row[REACH_TTT] * beta * beta * beta + 3.0 * row[REACH_STT] * alpha * beta * beta
    cross = abs(_along(o, DST, n))
    of_s = abs(_along(o, DS, n)) + 0.5 * (max(-_along(o, DSS, n), 0.0) + cross) + cubic_s / 6.0
    of_t = abs(_along(o, DT, n)) + 0.5 * (max(-_along(o, DTT, n), 0.0) + cross) + cubic_t / 6.0
    return _along(o, POINT, n) - of_s - of_t, of_s, of_t


@njit(error_model="numpy")
def put_inward(o, sign, n):
    """Unit direction into the part, square to the face in a box's middle, into n (3,); False where there is none."""
    x = -sign * (o[DS, Y] * o[DT, Z] - o[DS, Z] * o[DT, Y])
    y = -sign * (o[DS, Z] * o[DT, X] - o[DS, X] * o[DT, Z])
    z = -sign * (o[DS, X] * o[DT, Y] - o[DS, Y] * o[DT, X])
    size = math.sqrt(x * x + y * y + z * z)
    if not size > 0.0:
        return False
    n[X], n[Y], n[Z] = x / size, y / size, z / size
    return True


def is_growing(outline):
    """Whether places lie ever farther from the tip along an outline's pieces (k, 10), its closing disk left out."""
    for row in outline[:-1]:
        if row[IS_ARC] == 0.0:
            if row[START_R] * row[DIRECTION_R] + row[START_Z] * row[DIRECTION_Z] < -OUTWARD_MM:
                return False
        elif min(row[CENTER_Z] * r - row[CENTER_R] * z for r, z in (row[FROM_R:TO_R], row[TO_R:])) < -OUTWARD_MM:
            return False
    return True
