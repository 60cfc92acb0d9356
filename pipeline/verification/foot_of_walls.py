"""Places that no ball gets to, and that flat or bull nose cutters of the program make: along the foot of upright walls.

    ║        │      seen from above: a place p of a floor, beside a wall; the cutter, a disc of radius R, reaches it if its
    ║   p────c      middle c lies no farther than R (a bull nose's flat: R - rc) from p, and the disc, let down there, rests on
    ║     R  │      the floor.  Of a wall's place there is one such c: R out along its normal.

What came out in size was made, whoever says that it cannot be.  Where stock stands, a cutter a little larger than the posted
one must fit, so that what an inner corner keeps of a cutter that runs a tolerance beside the wall is no excess.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from cuspline.stock.swept import upright_paths
from cuspline.toolpaths.drop.dropcutter import is_held_above
from cuspline.values import fixed_math as fixed
from cuspline.verification.reach import AT_FOOT, FINISHABLE, REACHABLE, TOO_NARROW

MADE_SHARE = 0.1            # of what is allowed: what stands no higher came out in size
LARGER_MM = 0.05            # by which a posted cutter is taken larger
FREE_MM = 0.01              # by which it may then stand in the triangles of the part; beside a wall it stands lower by this
SQUARE = 1e-6               # of a normal: level or upright within this
FINISHED_SHARE = 0.5        # of a face's area in size, that cutters with upright sides made: it is theirs
CUTTER_SHARE = 0.05         # the same of one cutter that has finished some of it
FACING = 0.9                # cosine between the normals of two walls that face each other, but for its sign
WAYS = 32                   # directions from a place in which the cutter's middle is looked for


@dataclass(frozen=True, eq=False, kw_only=True)
class _Made:
    """Which of some faces are level or upright and were finished by cutters with upright sides."""

    is_level: np.ndarray        # (f,) bool
    is_upright: np.ndarray      # (f,) bool
    by: np.ndarray              # (f, c) bool: by which of the cutters' paths


def with_own_cutters(residuals, cut, drops, ball_radius_mm, allowed_mm, gap_of):
    """(n,) the reach of Residuals once cutters of the program count too: AT_FOOT where they made it or could, and no ball does.

    Args:
        residuals: residuals.Residuals of a clamping, whose reach is that of balls.   cut: its workpiece.Cut.
        drops: DropMesh of the design in its WCS.   ball_radius_mm: of the shop's smallest ball.
        allowed_mm: deviation of a finished place.
        gap_of: function of points (n, 3), part coordinates: how far the next place lies that was cut, below 0 within.
    """
    found, d = residuals.samples, residuals.deviation_mm
    reach = np.where((residuals.reach != REACHABLE) & (d <= MADE_SHARE * allowed_mm), AT_FOOT, residuals.reach)
    paths = [p for p in upright_paths(cut.paths) if p.flat_radius_mm > 0.0]
    rows = np.flatnonzero((reach == TOO_NARROW) & (d > allowed_mm))
    if not paths or not len(rows):
        return reach
    normals = cut.frame.turn_into(found.normals)
    in_size = residuals.is_own & np.isin(reach, FINISHABLE) & (d <= allowed_mm)
    made = _made(found, normals, np.where(in_size, residuals.row, -1), paths)
    rows = rows[(made.is_level | made.is_upright)[found.face[rows]]]
    rows, beside = _at_walls(found, normals, rows, made, ball_radius_mm + 2 * residuals.spacing_mm)
    if not len(rows):
        return reach
    stands = gap_of(found.points_mm[rows]) > allowed_mm
    rows, beside = rows[stands], beside[stands]
    by = made.by[found.face[rows]] | made.by[beside]
    for k, path in enumerate(paths):
        mine = rows[by[:, k] & (reach[rows] == TOO_NARROW)]
        reach[mine[_fits(path, drops, cut.frame.into(found.points_mm[mine]), normals[mine])]] = AT_FOOT
    return reach


def _made(samples, normals, rows, paths):
    """_Made of the faces of samples; `rows`: of PostedMoves that made each place in size, -1 none; normals in the WCS."""
    faces = int(samples.face.max()) + 1
    up = np.abs(normals[:, 2])
    all_of = lambda holds: np.bincount(samples.face[~holds], minlength=faces) == 0
    area = np.bincount(samples.face, np.where(rows >= 0, samples.weight_mm2, 0.0), faces)
    share = np.array([np.bincount(samples.face, np.where(np.isin(rows, p.row), samples.weight_mm2, 0.0), faces) for p in paths])
    share = share / np.maximum(area, 1e-300)
    theirs = share.sum(axis=0) >= FINISHED_SHARE
    return _Made(is_level=all_of(normals[:, 2] > 1.0 - SQUARE) & theirs, is_upright=all_of(up < SQUARE) & theirs,
                 by=(share >= CUTTER_SHARE).T & theirs[:, None])


def _at_walls(samples, normals, rows, made, near_mm):
    """Places at the foot of an upright wall that are themselves level or upright, and the face (m,) that meets theirs there."""
    kept, faces = [], []
    for is_mine, is_other, other in ((made.is_level, made.is_upright, np.abs(normals[:, 2]) < 1.0 - SQUARE),
                                     (made.is_upright, made.is_level, np.abs(normals[:, 2]) > SQUARE)):
        mine, others = rows[is_mine[samples.face[rows]]], np.flatnonzero(other)
        if len(mine) and len(others):
            far, near = cKDTree(samples.points_mm[others]).query(samples.points_mm[mine])
            face = samples.face[others[near]]
            good = (far < near_mm) & is_other[face]
            kept.append(mine[good])
            faces.append(face[good])
    none = np.zeros(0, np.int64)
    return np.concatenate([none, *kept]), np.concatenate([none, *faces])


def _fits(path, drops, places, normals):
    """(n,) bool: a cutter as large as a path's and LARGER_MM more touches places (n, 3) of level or upright faces."""
    corner, radius = path.corner_radius_mm, path.flat_radius_mm + path.corner_radius_mm + LARGER_MM
    level = normals[:, 2] > 0.5
    turn = 2 * np.pi * np.arange(WAYS) / WAYS
    around = np.column_stack([fixed.cos(turn), fixed.sin(turn)])
    middle = np.where(level[:, None, None], places[:, None, :2] + (radius - corner) * around,
                      places[:, None, :2] + radius * normals[:, None, :2])
    tip = places[:, 2] + np.where(level, FREE_MM, -corner - FREE_MM)
    held = is_held_above(drops, middle.reshape(-1, 2), radius - FREE_MM, corner, np.repeat(tip, WAYS))
    return ~held.reshape(len(places), WAYS).all(axis=1)


def between_walls(points_mm, normals, wide_mm, apart_mm):
    """(n,) bool of points on upright walls: others of them face them across less than a width.

    Args:
        points_mm, normals: (n, 3) in one frame.   apart_mm: about how far points lie from one another.
    """
    found = np.zeros(len(points_mm), bool)
    if not len(points_mm):
        return found
    tree, steps = cKDTree(points_mm), math.ceil(wide_mm / apart_mm)
    for across_mm in np.linspace(wide_mm / steps, wide_mm, steps):
        away, near = tree.query(points_mm + across_mm * normals, distance_upper_bound=apart_mm)
        rows = np.flatnonzero(np.isfinite(away))
        ahead = ((points_mm[near[rows]] - points_mm[rows]) * normals[rows]).sum(axis=1)
        found[rows] |= ((normals[near[rows]] * normals[rows]).sum(axis=1) < -FACING) & (ahead < wide_mm)
    return found
