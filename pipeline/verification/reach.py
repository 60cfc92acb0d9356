"""Which points of a design a ball could finish at all, standing upright."""

import numpy as np

from cuspline.stock.tree import morton_order
from cuspline.toolpaths.drop.dropcutter import DropMesh, is_held_above

TOLERANCE_MM = 0.005      # a ball smaller by this must fit: curvature equal to the ball's is reachable
LEVEL = -1e-6             # normals below this point downward
REACHABLE, DOWNWARD, TOO_NARROW = 0, 1, 2
REASONS = ("reachable", "faces downward", "too narrow for the smallest ball")


def drop_mesh(vertices_mm, triangles):
    """The design's triangles, ready for `why_unreachable`."""
    return DropMesh.from_triangles(vertices_mm, triangles)


def why_unreachable_leaning(closest, points_mm, normals, ball_radius_mm):
    """(n,) REACHABLE or TOO_NARROW for a ball that may come from any side: it must fit where it touches.

    Args:
        closest: surfaces.projection.ClosestTree of all faces; points (n, 3) and normals in its frame.
    """
    free = closest.closest_points(points_mm + ball_radius_mm * normals).distance_mm
    return np.where(free < ball_radius_mm - TOLERANCE_MM, TOO_NARROW, REACHABLE)


def why_unreachable(mesh, points_mm, normals, ball_radius_mm):
    """(n,) REACHABLE, DOWNWARD or TOO_NARROW for a ball of the given radius.

    The ball's centre stands at point + radius * normal; the point is reachable when a ball
    smaller by TOLERANCE_MM, dropped there, rests no higher.
    """
    center = points_mm + ball_radius_mm * normals
    small = ball_radius_mm - TOLERANCE_MM
    order = morton_order(np.column_stack([center[:, :2], np.zeros(len(center))]))
    held = np.empty(len(center), bool)
    held[order] = is_held_above(mesh, center[order, :2], small, small, center[order, 2] - small)
    return np.where(normals[:, 2] < LEVEL, DOWNWARD, np.where(held, TOO_NARROW, REACHABLE))
