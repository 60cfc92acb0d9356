"""Drops a cutter onto the exact faces and edges of a part, and says which faces meet on the edges it touches."""

from dataclasses import dataclass

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.GeomAdaptor import GeomAdaptor_Curve
from scipy.spatial import cKDTree

from cuspline.kernel import brep
from cuspline.surfaces.creases import proud_curves
from cuspline.toolpaths.contact.contacts import NO_FACE, TipContacts, cutter_normals
from cuspline.toolpaths.drop import exact_drop
from cuspline.toolpaths.drop.droppers import Dropper, checked_cutter
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen

SPACING_MM = 0.1            # of points on edges
MOST_POINTS = 5000          # on one edge
LEANING = 1e-3              # between the face's normal and the cutter's
LOOKED_AT = 12              # nearest chords looked through for an edge of the face touched


@dataclass(frozen=True, eq=False, kw_only=True)
class EdgeNeighbours:
    """Short chords along the edges of some faces, each with the faces on both sides (the same on a seam)."""

    tree: cKDTree               # of their middles
    half_mm: np.ndarray         # (n, 3) from the middle to the end
    sides: np.ndarray           # (n, 2)

    @classmethod
    def of_faces(cls, faces):
        """From `brep.Face` values; face indices count in this order."""
        lines, sides = [np.zeros((1, 3))], [np.zeros((0, 2), int)]
        for (first, edge), *others in brep.edges_of_faces(faces):
            length = GCPnts_AbscissaPoint.Length_s(BRepAdaptor_Curve(edge))
            lines.append(brep.edge_points(edge, min(int(length / SPACING_MM) + 3, MOST_POINTS))[0])
            sides.append(np.tile((first, others[-1][0] if others else first), (len(lines[-1]) - 1, 1)))
        for k, face in enumerate(faces):
            for curve, low, high in proud_curves(face):
                line = GeomAdaptor_Curve(curve, low, high)
                count = min(int(GCPnts_AbscissaPoint.Length_s(line) / SPACING_MM) + 3, MOST_POINTS)
                along = [line.Value(low + (high - low) * n / (count - 1)) for n in range(count)]
                lines.append(np.array([(p.X(), p.Y(), p.Z()) for p in along]))
                sides.append(np.full((count - 1, 2), k))
        middles, halves = (np.vstack([(line[1:] + way * line[:-1]) / 2 for line in lines]) for way in (1, -1))
        return cls(tree=cKDTree(middles), half_mm=frozen(halves, (None, 3), "half_mm"),
                   sides=frozen(np.vstack(sides), (None, 2), "sides", int))

    def beside(self, points_mm, face):
        """(n,) the face on the other side of the edge of `face` (n,) nearest to each point."""
        count = min(LOOKED_AT, self.tree.n)
        near = self.tree.query(points_mm, k=count)[1].reshape(len(points_mm), count)
        half, sides = self.half_mm[near], self.sides[near]
        arm = points_mm[:, None] - self.tree.data[near]
        share = np.clip((arm * half).sum(axis=2) / np.maximum((half ** 2).sum(axis=2), 1e-300), -1.0, 1.0)
        fits = (sides == face[:, None, None]).any(axis=2)
        away = np.where(fits, fixed.lengths(arm - share[..., None] * half), np.inf)
        sides = sides[np.arange(len(face)), away.argmin(axis=1)]
        other = np.where(sides[:, 0] == face, sides[:, 1], sides[:, 0])
        return np.where(fits.any(axis=1), other, NO_FACE)


class ExactDropper(Dropper):
    """Drops onto the exact surfaces; nothing is tessellated."""

    def __init__(self, part, neighbours, radius_mm, corner_radius_mm, allowance_mm=0.0):
        """
        Args:
            part: exact_drop.ExactPart or PartNear.
            neighbours: EdgeNeighbours of the same faces.
            radius_mm, corner_radius_mm: R > 0 and rc, 0 (flat) to R (ball).
            allowance_mm: material to leave, >= 0.
        """
        self.radius_mm, self.corner_radius_mm, self.allowance_mm = checked_cutter(
            radius_mm, corner_radius_mm, allowance_mm)
        self._part, self._neighbours = part, neighbours
        self._grown = self.radius_mm + self.allowance_mm, self.corner_radius_mm + self.allowance_mm

    @classmethod
    def of_faces(cls, faces, radius_mm, corner_radius_mm, allowance_mm=0.0):
        """From all `brep.Face` values of a part."""
        return cls(exact_drop.ExactPart.of_faces(faces), EdgeNeighbours.of_faces(faces), radius_mm, corner_radius_mm,
                   allowance_mm)

    def tips_mm(self, xy_mm):
        part = self._part.under(np.asarray(xy_mm, float), self._grown[0])
        return exact_drop.drop_tips_mm(part, xy_mm, *self._grown) + self.allowance_mm

    def contacts(self, xy_mm):
        xy = np.ascontiguousarray(xy_mm, float)
        c = exact_drop.drop_contacts(self._part.under(xy, self._grown[0]), xy, *self._grown)
        held = c.face >= 0
        contact, normal, is_edge = (np.array(column) for column in (c.contact_mm, c.normal, c.is_edge))
        if self._grown[1] > 0:      # on a face the cutter lies against it; what it only leans on is the face's edge
            cutter = cutter_normals(xy[held], c.tip_z_mm[held], contact[held], *self._grown)
            leans = fixed.lengths(cutter - normal[held]) > LEANING
            normal[held] = np.where(leans[:, None], cutter, normal[held])
            is_edge[held] |= leans
        contact[~held] = normal[~held] = np.nan
        beside = np.full(len(held), NO_FACE)
        beside[is_edge] = self._neighbours.beside(contact[is_edge], c.face[is_edge])
        return TipContacts(tip_z_mm=c.tip_z_mm + self.allowance_mm, contact_mm=contact, normal=normal, face=c.face,
                           beside=beside, is_edge=is_edge)
