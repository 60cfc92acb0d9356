"""The stock as a height field: a function of (n, 2) places that gives the height of material there, mm.

A box, any mesh, and what earlier moves have left of either.
"""

import math

import numpy as np

from cuspline.program import Kind, Plane
from cuspline.toolpaths.dropcutter import DropMesh, drop_tips_mm

CHORD_MM = 1e-3         # arcs count as chords that lie this close to them
POINT_MM = 1e-9         # radius of the probe that reads a mesh's height
LONGEST_MM = 4.0        # moves are split for the tree: long ones have loose bounds


def box_stock(min_mm, max_mm):
    """Height field of a box; -inf beside it."""
    low, high = np.array(min_mm, float), np.array(max_mm, float)

    def height_mm(xy_mm):
        inside = ((xy_mm >= low[:2]) & (xy_mm <= high[:2])).all(axis=1)
        return np.where(inside, high[2], -np.inf)

    return height_mm


def mesh_stock(mesh):
    """Height field of a DropMesh seen from above; -inf beside it."""
    return lambda xy_mm: drop_tips_mm(mesh, xy_mm, POINT_MM, 0.0)


def stock_after(moves, radius_mm, corner_radius_mm, height_mm):
    """Height field that moves leave of another one.

    The cutter's bottom stands p(d) above its tip.  min over the path of z + p(d) is minus the
    drop-cutter's max over S of S_z - p(d) on the path turned upside down: its moves are the edges of
    flat triangles, and the answer is exact over straight moves (arcs: CHORD_MM).

    Args:
        moves: program.Moves; rapids cut too.
        radius_mm, corner_radius_mm: the cutter, 0 (flat) to radius (ball).
        height_mm: height field before.
    """
    points = _chords(moves)
    if len(points) == 0:
        return height_mm
    corners = (points * np.array([1.0, 1.0, -1.0]))[:, [0, 1, 1]]
    path = DropMesh.from_triangles(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))

    def left_mm(xy_mm):
        return np.minimum(height_mm(xy_mm), -drop_tips_mm(path, xy_mm, radius_mm, corner_radius_mm))

    return left_mm


def _chords(moves):
    """(m, 2, 3) straight pieces of all moves."""
    pieces = [points_of_move(moves, k) for k in range(len(moves))]
    return np.concatenate([np.zeros((0, 2, 3)), *[np.stack([p[:-1], p[1:]], axis=1) for p in pieces]])


def points_of_move(moves, k):
    """(n, 3) points along one move, its ends included."""
    start, end = moves.end_mm[k - 1] if k else moves.start_mm, moves.end_mm[k]
    if moves.kind[k] in (Kind.RAPID, Kind.FEED):
        n = max(1, math.ceil(np.linalg.norm(end - start) / LONGEST_MM))
        return start + np.linspace(0.0, 1.0, n + 1)[:, None] * (end - start)
    return arc_points(start, end, moves.center_mm[k], Plane(moves.plane[k]), moves.kind[k] == Kind.ARC_CCW, CHORD_MM)


def arc_points(start, end, center, plane, is_left, chord_mm):
    """(n, 3) points along an arc or helix whose chords lie within `chord_mm` of it; equal ends: a full turn."""
    a, b, c = plane.axes
    radius = math.hypot(start[a] - center[a], start[b] - center[b])
    first = math.atan2(start[b] - center[b], start[a] - center[a])
    sweep = (math.atan2(end[b] - center[b], end[a] - center[a]) - first) * (1 if is_left else -1) % (2 * math.pi)
    sweep = sweep if sweep > 1e-9 else 2 * math.pi
    n = max(1, math.ceil(sweep / (2 * math.acos(max(1 - chord_mm / radius, -1.0)))))
    share = np.linspace(0.0, 1.0, n + 1)
    angle = first + (1 if is_left else -1) * share * sweep
    points = np.empty((n + 1, 3))
    points[:, a], points[:, b] = center[a] + radius * np.cos(angle), center[b] + radius * np.sin(angle)
    points[:, c] = start[c] + share * (end[c] - start[c])
    points[0], points[-1] = start, end
    return points
