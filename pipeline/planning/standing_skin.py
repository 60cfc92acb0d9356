"""Where a casting's skin still stands: triangles of the part, small enough that each has it or has it not."""

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.known import Known

PATCH_MM = 3.0              # side of these triangles: much narrower than what a position leaves to others
RAY = 1.5                   # of what counts as skin: it is not asked how much more stands
CORNER = 0.9                # of the way from a triangle's middle to its corners: the places that are asked
PLACES = 4                  # of a triangle: its middle, three near its corners
NOWHERE = -1


class StandingSkin:
    """Triangles of a part in pieces of PATCH_MM, and on which of them more than so much stock stands before each setup.

    A piece is asked at one place where it still has its skin, of the last setup's cut alone; at its others once that is gone.
    """

    def __init__(self, corners_mm, least_mm):
        """Corners (m, 3, 3), part coordinates, counter-clockwise seen from outside; least_mm: no more than that is none."""
        self._corners_mm = halved_until(corners_mm, PATCH_MM)
        a, b, c = np.moveaxis(self._corners_mm, 1, 0)
        normals = np.cross(b - a, c - a)
        self._normals = normals / fixed.lengths(normals)[:, None]
        self._least_mm, self._known = least_mm, Known()

    def corners_on(self, piece):
        """(k, 3, 3) corners of the pieces on which a stock.workpiece.Workpiece has it, part coordinates."""
        return self._corners_mm[self._place_on(piece) != NOWHERE]

    def _place_on(self, piece):
        """(n,) a place of each triangle that has it, else NOWHERE."""
        def made():
            if piece.before is None:
                found, gone = np.full(len(self._normals), NOWHERE, np.int8), np.arange(len(self._normals))
            else:
                found = self._place_on(piece.before).copy()
                rows = np.flatnonzero(found != NOWHERE)
                gone = rows[~self._stands(piece.last_cut_leaves_mm, rows, found[rows])]
                found[gone] = NOWHERE
            for place in range(PLACES):
                rows = gone[found[gone] == NOWHERE]
                stands = self._stands(lambda *asked: piece.deviations(*asked)[0], rows, np.full(len(rows), place))
                found[rows[stands]] = place
            return found

        return self._known.once(piece, made)

    def _stands(self, deviations_of, rows, place):
        """(k,) bool of places (k,) of triangles `rows` (k,), by a function of points, normals and the longest ray."""
        corners = self._corners_mm[rows]
        middles, corner = corners.mean(axis=1), corners[np.arange(len(rows)), np.maximum(place - 1, 0)]
        points = np.where((place == 0)[:, None], middles, CORNER * corner + (1.0 - CORNER) * middles)
        return deviations_of(points, self._normals[rows], RAY * self._least_mm) > self._least_mm


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
