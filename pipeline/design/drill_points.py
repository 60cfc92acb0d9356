r"""What a drill's point leaves at the level bottom of a hole that is drilled: no flat cutter comes there, or a thread ends above.

    |        |
    |        |      full diameter down to here
    |\      /|
    |_\ __ /_|      stays: the drill's point touches the floor
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed

SIDES = 32                  # of the cone
POINT_DEG = 118.0           # the sharpest point that drills for metal usually have
DEEP = 3.0                  # diameters: in deeper holes a level bottom is left as the drill leaves it
HEIGHT_SHARE = float(1.0 / fixed.tan(math.radians(POINT_DEG) / 2))      # of the hole's radius


@dataclass(frozen=True, kw_only=True)
class DrillPoint:
    """The funnel that stays in one hole; part coordinates, mm."""

    foot_mm: tuple[float, float, float]     # middle of the hole's flat bottom
    axis: tuple[float, float, float]        # unit, out of the hole
    radius_mm: float                        # of the hole

    why = "what a drill's point leaves at a level bottom"

    @property
    def height_mm(self):
        return HEIGHT_SHARE * self.radius_mm

    def triangles(self):
        """((n, 3) corners, (m, 3)) of the funnel's upper side."""
        axis = np.array(self.axis)
        across = np.eye(3)[np.abs(axis).argmin()]
        u = np.cross(axis, across)
        u /= fixed.length(u)
        turn = 2 * np.pi * np.arange(SIDES) / SIDES
        # flat sides lie within the cone: their corners stand out, so that no place of the cone is left out
        rim = np.outer(fixed.cos(turn), u) + np.outer(fixed.sin(turn), np.cross(axis, u))
        foot, k = np.array(self.foot_mm), np.arange(SIDES)
        return (np.vstack([foot, foot + self.height_mm * axis + self.radius_mm / fixed.cos(math.pi / SIDES) * rim]),
                np.column_stack([np.zeros(SIDES, int), 1 + k, 1 + (k + 1) % SIDES]))


def drill_point(hole, wall):
    """The DrillPoint at a wall's lower end.   hole, wall: surfaces.holes values."""
    return DrillPoint(foot_mm=tuple((hole.point_mm + wall.low_mm * hole.axis).tolist()), axis=tuple(hole.axis.tolist()),
                      radius_mm=wall.low_radius_mm)


def is_deep(hole, wall):
    """Whether nobody mills a wall's level bottom."""
    return hole.walls[-1].high_mm - wall.low_mm > DEEP * 2 * wall.low_radius_mm


def drill_points(walls):
    """DrillPoint of every wall that ends on a level floor and gets a thread which ends above the point.

    Args:
        walls: surfaces.threaded_walls.ThreadedWall values.
    """
    return tuple(drill_point(w.hole, w.wall) for w in walls if w.ends_flat and w.below_mm > HEIGHT_SHARE * w.wall.low_radius_mm)
