"""Which points of a design a ball could finish at all, standing upright."""

import numpy as np

from cuspline.stock.tree import morton_order
from cuspline.surfaces.holes import PARALLEL
from cuspline.toolpaths.drop.dropcutter import DropMesh, is_held_above

TOLERANCE_MM = 0.005      # a ball smaller by this must fit: curvature equal to the ball's is reachable
DRILLED_MM = 2e-3         # so far from a drill's surface a point is one that it makes
LEDGE = 0.5               # of a normal along the axis: no wall of a hole has so much
LEVEL = -1e-6             # normals below this point downward
REACHABLE, DOWNWARD, TOO_NARROW, AT_FOOT = 0, 1, 2, 3
REASONS = ("reachable", "faces downward", "too narrow for the smallest ball", "reachable by a cutter of the program alone")
FINISHABLE = (REACHABLE, AT_FOOT)


def drop_mesh(vertices_mm, triangles):
    """The design's triangles, ready for `why_unreachable`."""
    return DropMesh.from_triangles(vertices_mm, triangles)


def upper(vertices_mm, triangles):
    """The triangles (m, 3) of a closed solid on which something that comes from above can rest: those that do not look down.

    Where an edge or a corner carries it, one of the faces that meet there looks up.  They are half of them.
    """
    a, b, c = (vertices_mm[triangles[:, k]] for k in range(3))
    u, v = b - a, c - a
    normal_z = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    return triangles[normal_z >= LEVEL * np.sqrt((u * u).sum(axis=1) * (v * v).sum(axis=1))]


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


def is_drilled(points_mm, normals, holes, drills):
    """(n,) bool: points that a drill touches as deep down in a hole as its point leaves the part whole.

    Args:
        points_mm, normals: (n, 3) in the setup's WCS.   holes: surfaces.holes.Hole values of the part there.
        drills: shop.cutters.Cutter values that the program takes.
    """
    found = np.zeros(len(points_mm), bool)
    for hole in holes:
        for up in (hole, hole.turned_up()) if hole.is_through else (hole,):
            if up.axis[2] < 1.0 - PARALLEL:
                continue
            for wall in (w for w in up.walls if w.kind == "cylinder"):
                for drill in drills:
                    if abs(drill.radius_mm - wall.low_radius_mm) < DRILLED_MM:
                        found |= _touches(points_mm - up.point_mm, normals, up, wall, drill)
    return found


def _touches(places, normals, hole, wall, drill):
    """(n,) bool: places (n, 3) from a hole's point on the surface of a drill in it; a ledge round its side is none of it."""
    slope = drill.point_height_mm / drill.radius_mm
    tip = max(wall.low_mm - drill.point_height_mm, hole.lowest_tip_mm(wall, drill.radius_mm, slope))
    away = np.sqrt((places[:, :2] ** 2).sum(axis=1))
    high = places[:, 2] - tip
    aside = -DRILLED_MM if drill.has_flat_bottom else DRILLED_MM        # the rim of a ledge may be beside it: rounded words
    side = (np.abs(away - drill.radius_mm) < DRILLED_MM) & (high > drill.point_height_mm - aside)
    side &= np.abs(normals[:, 2]) < LEDGE
    point = (away < drill.radius_mm + aside) & (np.abs(high - slope * away) < DRILLED_MM * (1.0 + slope))
    return (side | point) & (places[:, 2] < wall.high_mm + DRILLED_MM)
