"""Deep and threaded holes with a level bottom that a program drills: what the drill's point leaves is no excess, but listed."""

import numpy as np

from cuspline.design.drill_points import drill_point, drill_points, is_deep
from cuspline.program.program import Kind
from cuspline.surfaces.holes import ends_on_level, holes_of

UPWARD = 1.0 - 1e-6         # of unit vectors along a setup's Z
BESIDE_MM = 0.01            # of a hole's axis, and of its radius, that a drill comes down
DEEP_MM = 0.02              # above the bottom, that a drill's tip may stop


def drilled_points(posted, frame, faces, tools, threaded=()):
    """DrillPoint of every upward hole with a level bottom, deep or threaded, that a drill of its diameter comes down to.

    Args:
        posted: PostedMoves.   frame: the setup's Frame.   faces: all brep.Face values, part coordinates.
        tools: {number: Tool}.   threaded: surfaces.threaded_walls.ThreadedWall values.
    """
    drills = {n: t.cutter.radius_mm for n, t in tools.items() if t.cutter.type == "drill" and not t.cutter.has_flat_bottom}
    rows = np.flatnonzero(np.isin(posted.tool, list(drills)) & (posted.kind == Kind.FEED))
    if not len(rows):
        return ()
    ends, radii = posted.end_mm[rows], np.array([drills[n] for n in posted.tool[rows].tolist()])
    out = []
    for hole in holes_of(faces):
        wall = hole.walls[0]
        if (frame.rotation[:, 2] * hole.axis).sum() < UPWARD or wall.kind != "cylinder":
            continue
        foot = frame.into((hole.point_mm + wall.low_mm * hole.axis)[None])[0]
        off = ends - foot
        is_there = (np.abs(off[:, :2]).max(axis=1) < BESIDE_MM) & (off[:, 2] < DEEP_MM)
        is_left = is_deep(hole, wall) or drill_points([w for w in threaded if w.wall.faces == wall.faces])
        if is_left and (is_there & (np.abs(radii - wall.low_radius_mm) < BESIDE_MM)).any() and ends_on_level(hole, wall):
            out.append(drill_point(hole, wall))
    return tuple(out)
