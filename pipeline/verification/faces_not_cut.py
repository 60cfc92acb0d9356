"""Faces that a setup names and most of which is not cut, and gaps beside what is: no cutter of the program gets there."""

import numpy as np
from scipy.spatial import cKDTree

from cuspline.values import fixed_math as fixed
from cuspline.verification.foot_of_walls import SQUARE, between_walls
from cuspline.verification.reach import DRILLED_MM, TOO_NARROW
from cuspline.verification.reporter import MISSED, MISSED_MM2, allowed_mm
from cuspline.verification.residuals import LIMIT_MM

ROUND, OTHER = 0.95, 0.5    # most of a face's area: of fillets and hollows, and of others
GAP_RADII = 1.5             # of the smallest ball, from where it has room: farther than its foot beside a wall or a corner
UPWARD = 0.99               # of a unit normal along the axis: a floor
LEVEL = 0.5                 # cosine between a face's normal and the axis: below it the face is a wall


def point_left_mm(holes, drills):
    """{number of a hole's flat bottom in the solid's order: how much a drill's point leaves of it}, where one made the hole.

    Args:
        holes: surfaces.holes.Hole values.   drills: shop.cutters.Cutter values that the program takes.
    """
    made = lambda hole, drill: any(w.kind == "cylinder" and abs(drill.radius_mm - w.low_radius_mm) < DRILLED_MM for w in hole.walls)
    return {i: drill.point_height_mm for hole in holes for drill in drills if made(hole, drill) for i in hole.floor}


def faces_not_cut(found, faces, ball_radius_mm, finish, left_mm, axis, distance_mm):
    """What is not cut of such faces, in connected groups: [(k,) index into the samples].

    A fillet or an inner corner that comes out rounder than drawn is none: there a cutter went along both faces beside
    it, and what it leaves is less than its radius.  Nor is the flat bottom of a hole that keeps the point of its drill.

    Args:
        found: residuals.Residuals of the faces after all setups.   faces: brep.Face values that its samples speak of.
        ball_radius_mm: smallest ball of the shop.   finish: design.Finish.
        left_mm: {index of a face: what may stand of it}.   axis: (3,) the setup's Z.
        distance_mm: function of points (n, 3) to their distances (n,) from all that is cut away.
    """
    samples, d = found.samples, found.deviation_mm
    missed = np.zeros(len(samples), bool)
    for k, face in enumerate(faces):
        rows = np.flatnonzero((samples.face == k) & ~found.is_top)
        area, off = samples.weight_mm2[rows].sum(), rows[~found.is_reachable[rows]]
        is_round = -face.middle.curvature_low_per_mm[0] * ball_radius_mm >= 1.0
        least = (ROUND if is_round else OTHER) * area
        if area < MISSED_MM2 or samples.weight_mm2[off].sum() < least:
            continue
        if d[rows].max() <= left_mm.get(k, -np.inf) + allowed_mm(finish):
            continue
        is_wall = abs(float((face.middle.normal[0] * axis).sum())) < LEVEL
        # along a wall's normal all of an inner corner that stays round stands; from what is cut that is no farther than its radius
        high = distance_mm(samples.points_mm[off]) if is_wall and not is_round else d[off]
        stands = min(ball_radius_mm, LIMIT_MM) if is_wall or is_round else MISSED * allowed_mm(finish)
        left = off[high >= stands]
        missed[left] = samples.weight_mm2[left].sum() >= least
    return found.groups(missed)


def gaps(found, faces, ball_radius_mm, finish, axis):
    """Gaps for which every cutter was too wide, between upright walls, or in a floor of which most may be cut, in connected groups:
    [(k,) index into the samples].

    Args:
        as for `faces_not_cut`.
    """
    samples, in_gap = found.samples, np.zeros(len(found.samples), bool)
    is_left = (found.deviation_mm > MISSED * allowed_mm(finish)) & (found.reach == TOO_NARROW) & ~found.is_top
    upright = np.flatnonzero(is_left & (np.abs(fixed.matmul(samples.normals, np.asarray(axis))) < SQUARE))
    facing = upright[between_walls(samples.points_mm[upright], samples.normals[upright], 2.0 * ball_radius_mm, found.spacing_mm)]
    in_gap[facing] = samples.weight_mm2[facing].sum() >= MISSED_MM2
    for k, face in enumerate(faces):
        if face.kind != "plane" or float((face.middle.normal[0] * axis).sum()) < UPWARD:
            continue
        left, near = (np.flatnonzero((samples.face == k) & rows) for rows in (is_left, found.is_reachable))
        if samples.weight_mm2[left].sum() < MISSED_MM2 or not len(near):
            continue
        away = cKDTree(samples.points_mm[near]).query(samples.points_mm[left])[0]
        far = left[away > GAP_RADII * ball_radius_mm]
        in_gap[far] |= samples.weight_mm2[far].sum() >= MISSED_MM2
    return found.groups(in_gap)
