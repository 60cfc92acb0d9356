"""Whether a bull nose or flat cutter that leans cuts into the part beside its contact: by its bend there, and all of its bottom.

At a contact the cutter is bent by 1/rc toward where it leans, by 1/R_e square to that; the part by what its face says.  Where
their sum bends inward in any direction the cutter gouges at once.  Farther off, places all over the bottom are held against
the exact faces.
"""

import numpy as np

from cuspline.planning.context import ROUNDING_MM, path_tolerance_mm
from cuspline.splines.nurbs import local_shape, principal_directions
from cuspline.values.amounts import counted
from cuspline.values.errors import CutterDoesNotFit

AZIMUTHS, RINGS = 24, 2                 # places on the bottom
LEVEL = 1e-9                            # of what is square to an axis
SQUARE = 0.999                          # cosine of the angle to a face's normal: the nearest place is no edge
MOST_ROWS = 4000                        # looked at, evenly taken of all in the cut
FLAT_CORNER_MM = 1e-3                   # a sharp corner counts as bent so tightly


def refuse_gouges(work, found, rules, tool):
    """No row of a leaning corner cutter in the cut gouges.

    Args:
        work: PlanningContext.   found: Leaning.   rules: LeaningRules with a corner.   tool: Tool.
    Raises:
        CutterDoesNotFit: where it does; `.rows`.
    """
    in_cut = np.flatnonzero(found.is_cut)
    rows = in_cut[:: max(1, -(-len(in_cut) // MOST_ROWS))]
    normals, axes = found.normal[rows + 1], found.moves.axis[rows]
    contacts = found.middle_mm[rows + 1] - rules.radius_mm * normals
    where = f"{work.operation.title}: T{tool.number} {tool.cutter.name} leaning so"
    help_ = "incline it more along the feed, or take a smaller cutter or a ball"
    bend = least_bend_per_mm(work.closest_of(tuple(work.wanted)), contacts, normals, axes, rules.corner)
    bad = np.flatnonzero(bend < 0.0)
    if len(bad):
        raise CutterDoesNotFit(f"{where} is flatter than the face beside {counted(len(bad), 'contact')} of {len(rows)} looked at, "
                               f"as at {work.in_part(contacts[bad[np.argmin(bend[bad])]])}: {help_}", rows=rows[bad])
    depth = bottom_depths_mm(work.closest, found.moves.end_mm[rows], axes, rules.corner)
    bad = np.flatnonzero(depth > path_tolerance_mm(work.finish) + ROUNDING_MM)
    if len(bad):
        worst = bad[np.argmax(depth[bad])]
        raise CutterDoesNotFit(f"{where} would cut {depth[worst]:.4f} mm into the part beside its contact at "
                               f"{work.in_part(contacts[worst])}, and in {len(bad) - 1} of {len(rows)} other places looked at: "
                               f"{help_}", rows=rows[bad])


def least_bend_per_mm(faces, contacts_mm, normals, axes, corner):
    """(n,) bend of cutter and part together, in the direction in which it is least; below 0: the cutter gouges there.

    Args:
        faces: ClosestTree of the faces cut.   contacts_mm, normals, axes: (n, 3).   corner: CornerContact.
    """
    foot = faces.closest_points(contacts_mm)
    derivatives = faces.patches.derivatives(foot.face, foot.u, foot.v)
    shape = local_shape(derivatives, flip=False)
    first, second = principal_directions(derivatives, flip=False)
    side = np.where((shape.normal * normals).sum(axis=1) < 0.0, -1.0, 1.0)         # of the patch's own normal
    low, high = side * shape.curvature_low_per_mm, side * shape.curvature_high_per_mm
    ahead = axes - (axes * normals).sum(axis=1)[:, None] * normals
    ahead = ahead / np.maximum(np.sqrt((ahead * ahead).sum(axis=1)), LEVEL)[:, None]
    c, s = ((ahead * d).sum(axis=1) for d in (first, second))
    tight, wide = 1.0 / max(corner.corner_radius_mm, FLAT_CORNER_MM), 1.0 / corner.radius_aside_mm
    along, across, mixed = low * c * c + high * s * s + tight, low * s * s + high * c * c + wide, (high - low) * c * s
    mean, half = (along + across) / 2, (along - across) / 2
    return np.where(shape.is_regular, mean - np.sqrt(half * half + mixed * mixed), wide)


def bottom_depths_mm(part, tips_mm, axes, corner):
    """(n,) how deep places of a cutter's bottom lie in the part at most; beside its edges nothing is said.

    Args:
        part: ClosestTree of all faces.   tips_mm, axes: (n, 3).   corner: CornerContact.
    """
    bottom = corner.bottom_mm(AZIMUTHS, RINGS)
    x = np.cross(axes, np.where(np.abs(axes[:, :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    x = x / np.sqrt((x * x).sum(axis=1))[:, None]
    y = np.cross(axes, x)
    depth = np.zeros(len(axes))
    for place in bottom:
        points = tips_mm + place[0] * x + place[1] * y + place[2] * axes
        near = part.closest_points(points)
        inward = -((points - near.point_mm) * near.normal).sum(axis=1)
        depth = np.maximum(depth, np.where(inward > SQUARE * near.distance_mm, inward, 0.0))       # a sharp edge has no side
    return depth
