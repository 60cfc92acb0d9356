r"""What lies left and right of a cutter and above it, and the way to turn the axis that follows.

      left | right       in the way on the left alone: tilt to the right; on the right alone: to the left;
           o             on both sides: incline along the feed.  Left and right part at the plane of axis and feed.
     _____ V ____
"""

import math
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from cuspline.replay.clearance import tool_segments
from cuspline.replay.clearance_kernels import (
    BOX_X,
    GROW,
    HALF,
    LEAF,
    MIDDLE,
    NEAREST,
    TIP,
    TOP,
    box_bound,
    least_distance,
    set_place,
    triangle_distance,
    workspace,
)
from cuspline.toolpaths.five_axis.clear_axes import turned
from cuspline.toolpaths.five_axis.clear_axis_kernels import CLOSE_MM
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.rows import A, B, C, X, Y, Z
from cuspline.values.threads import in_blocks

BLOCK = 512
ROUNDS = 40                 # of shrinking a ball: each finds a point that it still holds
SETTLED_MM = 1e-6


class Way(IntEnum):
    """Where the axis turns to come clear."""

    STAY = 0
    TILT_RIGHT = 1
    TILT_LEFT = 2
    INCLINE = 3


@dataclass(frozen=True, eq=False, kw_only=True)
class Beside:
    """What meets a tool, or comes nearer to it than wanted; one row each pose."""

    cutter_left: np.ndarray     # (n,) bool: something meets its cutting part, seen along the feed on the left
    cutter_right: np.ndarray
    above_left: np.ndarray      # the same of neck, shank, holder and spindle head
    above_right: np.ndarray

    @property
    def way(self):
        """(n,) of Way."""
        left, right = self.cutter_left | self.above_left, self.cutter_right | self.above_right
        return np.where(left & right, Way.INCLINE, np.where(left, Way.TILT_RIGHT, np.where(right, Way.TILT_LEFT, Way.STAY)))


def beside(search, cutter, middles_mm, axes, feeds):
    """What lies beside and above tools.

    Args:
        search: AxisSearch.   cutter: (c, 5) its cutting part, grown by what that must keep off (`cutting_part`).
        middles_mm: (n, 3) of the ball.   axes, feeds: (n, 3).
    Returns:
        Beside; nothing that meets a tool is overlooked, and what is told is nearer than CLOSE_MM beyond what is wanted.
    """
    right = np.cross(feeds, axes)
    above = search.segments[search.segments[:, TOP] > cutter[:, TOP].max() + 1e-9]
    found = np.empty((4, len(middles_mm)), bool)
    for row, segments, side in ((0, cutter, -right), (1, cutter, right), (2, above, -right), (3, above, right)):
        in_blocks(_met_rows, len(middles_mm), BLOCK, search.tree.arrays, for_kernel(middles_mm), for_kernel(axes), for_kernel(side),
                  search.radius_mm, for_kernel(segments), found[row])
    return Beside(cutter_left=found[0], cutter_right=found[1], above_left=found[2], above_right=found[3])


def cutting_part(tool, into_mm):
    """(c, 5) segments of a tool's flutes, the ball too, that may come so deep."""
    rest = len(tool_segments(tool, with_flutes=False))
    found = np.array(tool_segments(tool)[:-rest])
    found[:, GROW] -= into_mm
    return found


def turned_by_rule(search, cutter, middles_mm, axes, feeds, most_rad):
    """The rule followed: which way, how far, and whether that clears the whole tool, its ball too.

    Returns:
        (n,) Way, (n,) angles (inf: not by that way, inclined ahead or back), and (n, 3) axes, NaN where none clears.
    """
    whole = replace(search, segments=np.vstack([cutter, search.segments]))
    way = beside(search, cutter, middles_mm, axes, feeds).way
    ahead = feeds - (feeds * axes).sum(axis=1)[:, None] * axes
    ahead = ahead / np.sqrt((ahead * ahead).sum(axis=1))[:, None]
    right = np.cross(ahead, axes)
    first = np.select([(way == Way.TILT_RIGHT)[:, None], (way == Way.TILT_LEFT)[:, None]], [right, -right], ahead)
    angles = whole.angles_rad(middles_mm, axes, first, most_rad)
    back = whole.angles_rad(middles_mm, axes, -first, np.where(way == Way.INCLINE, most_rad, -1.0))
    first = np.where((back < angles)[:, None], -first, first)
    angles = np.minimum(angles, back)
    turn = np.where(np.isfinite(angles), angles, 0.0)
    return way, angles, np.where(np.isfinite(angles)[:, None], turned(axes, first, turn), np.nan)


def largest_ball_mm(tree, contacts_mm, normals, up_to_mm, into_mm=0.0):
    """Radius of the largest ball that touches at contacts and meets nothing else.

    Args:
        tree: ClearanceTree.   contacts_mm, normals: (n, 3).   up_to_mm: no larger is asked for.
        into_mm: so deep it may come elsewhere.
    Returns:
        (n,) mm.
    """
    found = np.empty(len(contacts_mm))
    in_blocks(_largest_balls, len(found), BLOCK, tree.arrays, for_kernel(contacts_mm), for_kernel(normals), float(up_to_mm),
              float(into_mm), found)
    return found


@njit
def _largest_balls(mesh, contacts, normals, most, into, found, first, last):
    place, work, point_like = np.zeros(17), workspace(), np.zeros((1, 5))
    for i in range(first, last):
        p, n, radius = contacts[i], normals[i], most
        for _ in range(ROUNDS):
            set_place(place, p[X] + radius * n[X], p[Y] + radius * n[Y], p[Z] + radius * n[Z], n[X], n[Y], n[Z])
            _, got, triangle = least_distance(mesh, place, point_like, radius - into, -math.inf, CLOSE_MM, -1, work)
            if triangle < 0 or got >= radius - into:
                break
            x, y, z = work[NEAREST][X] - p[X], work[NEAREST][Y] - p[Y], work[NEAREST][Z] - p[Z]
            rise = x * n[X] + y * n[Y] + z * n[Z]
            if rise <= SETTLED_MM:
                break
            smaller = (x * x + y * y + z * z) / (2.0 * rise)
            if smaller >= radius - SETTLED_MM:
                break
            radius = smaller
        found[i] = radius


@njit
def _clipped(triangle, place, side, out):
    """Triangles (0, 1 or 2) of the part of one on a side of the tool's axis, into out (2, 3, 3)."""
    corners, count = np.empty((4, 3)), 0
    for v in range(3):
        w = (v + 1) % 3
        h0 = h1 = 0.0
        for k in range(3):
            h0 += (triangle[v, k] - place[TIP + k]) * side[k]
            h1 += (triangle[w, k] - place[TIP + k]) * side[k]
        if h0 >= 0.0:
            for k in range(3):
                corners[count, k] = triangle[v, k]
            count += 1
        if (h0 >= 0.0) != (h1 >= 0.0):
            share = h0 / (h0 - h1)
            for k in range(3):
                corners[count, k] = triangle[v, k] + share * (triangle[w, k] - triangle[v, k])
            count += 1
    for t in range(count - 2):
        for k in range(3):
            out[t, A, k], out[t, B, k], out[t, C, k] = corners[A, k], corners[t + 1, k], corners[t + 2, k]
    return max(count - 2, 0)


@njit
def _reaches(node, place, side):
    """Whether a box has anything on the side of the tool's axis."""
    h = reach = 0.0
    for k in range(3):
        h += (node[MIDDLE + k] - place[TIP + k]) * side[k]
    for a in range(3):
        along = 0.0
        for k in range(3):
            along += node[BOX_X + 3 * a + k] * side[k]
        reach += abs(along) * node[HALF + a]
    return h + reach >= -1e-9


@njit
def _is_met(mesh, place, segments, side, work, pieces):
    """Whether a triangle's part on the side meets the tool, or cannot be told from one that does within CLOSE_MM."""
    triangles, nodes, leaves = mesh
    stack, _, parts, point, trial = work
    top, stack[0] = 1, 0
    while top > 0:
        top -= 1
        node = stack[top]
        if nodes[node, HALF] < 0.0 or not _reaches(nodes[node], place, side) or box_bound(
                nodes[node], place, segments, 0.1 * CLOSE_MM) >= 0.0:
            continue
        if node < leaves - 1:
            stack[top], stack[top + 1] = 2 * node + 1, 2 * node + 2
            top += 2
            continue
        t0 = (node - leaves + 1) * LEAF
        for t in range(t0, min(t0 + LEAF, len(triangles))):
            for piece in range(_clipped(triangles[t], place, side, pieces)):
                for k in range(len(segments)):
                    got, least = triangle_distance(pieces[piece], place, segments[k], CLOSE_MM, 0.0, math.inf, CLOSE_MM, parts,
                                                   trial)
                    if got < 0.0 or least < 0.0:
                        return True
    return False


@njit
def _met_rows(mesh, middles, axes, sides, radius, segments, found, first, last):
    place, work, pieces = np.zeros(17), workspace(), np.empty((2, 3, 3))
    for i in range(first, last):
        m, a = middles[i], axes[i]
        set_place(place, m[X] - radius * a[X], m[Y] - radius * a[Y], m[Z] - radius * a[Z], a[X], a[Y], a[Z])
        found[i] = _is_met(mesh, place, segments, sides[i], work, pieces)
