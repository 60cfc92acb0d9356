"""Where a casting's skin still stands: triangles of the part, small enough that each has it or has it not."""

import numpy as np

from cuspline.values import fixed_math as fixed

PATCH_MM = 3.0              # side of these triangles: much narrower than what a position leaves to others
RAY = 1.5                   # of what counts as skin: it is not asked how much more stands
CORNER = 0.9                # of the way from a triangle's middle to its corners: the places that are asked


def under_skin(corners_mm, piece, frame, least_mm):
    """Triangles of the part on which more than `least_mm` of stock stands at some place.

    Args:
        corners_mm: (m, 3, 3) as they lie in the frame, counter-clockwise seen from outside.
        piece: stock.workpiece.Workpiece, what earlier setups leave.   frame: Frame seen from the part.
    Returns:
        (k, 3, 3) corners; of an uncut casting all, as they are, else in pieces of PATCH_MM.
    """
    if not piece.cuts:
        return corners_mm
    corners = halved_until(corners_mm, PATCH_MM)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals, middles = normals / fixed.lengths(normals)[:, None], corners.mean(axis=1)
    stands = np.zeros(len(corners), bool)
    for places in (middles, *(CORNER * corners[:, k] + (1.0 - CORNER) * middles for k in range(3))):
        left = np.flatnonzero(~stands)
        off = piece.deviations(frame.out(places[left]), frame.turn_out(normals[left]), RAY * least_mm)[0]
        stands[left] = off > least_mm
    return corners[stands]


def halved_until(corners_mm, longest_mm):
    """(k, 3, 3) triangles with area, of triangles (m, 3, 3) halved across their longest sides until none is longer."""
    done = []
    while len(corners_mm):
        sides = fixed.lengths((np.roll(corners_mm, -1, axis=1) - corners_mm).reshape(-1, 3)).reshape(-1, 3)
        order = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(corners_mm, order[:, :, None], axis=1), 1, 0)
        has_area, is_long = fixed.lengths(np.cross(b - a, c - a)) > 0, sides.max(axis=1) > longest_mm
        done.append(corners_mm[has_area & ~is_long])
        a, b, c = (v[has_area & is_long] for v in (a, b, c))
        middle = (a + b) / 2
        corners_mm = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done)
