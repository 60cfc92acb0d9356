"""One cutter that can be lowered onto one part: what every free-form pass asks of it.

An allowance is kept by growing the cutter: a cutter of radius R + a and corner rc + a that touches
the part leaves the true one a away from it, its tip a higher.
"""

from abc import ABC, abstractmethod

import numpy as np

from cuspline.toolpaths.contact.contacts import TipContacts, checked_radii_mm, cutter_normals
from cuspline.toolpaths.contact.mesh_rims import MeshRims
from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_contacts, drop_tips_mm
from cuspline.values.errors import ToolpathError


class Dropper(ABC):
    """A cutter with an allowance over a part; positions (n, 2) in, answers row by row, part frame.

    Neighbours among the positions should be neighbours in space: the search starts from the last contact.
    """

    radius_mm: float            # R of the true cutter
    corner_radius_mm: float     # rc of the true cutter: 0 flat, R ball
    allowance_mm: float         # material to leave

    @abstractmethod
    def tips_mm(self, xy_mm):
        """(n,) lowest tip heights that keep the allowance; -inf where nothing lies beneath."""

    @abstractmethod
    def contacts(self, xy_mm):
        """TipContacts of the same positions; contacts lie on the part, the allowance away from the cutter."""


class MeshDropper(Dropper):
    """Drops onto triangles: exact on the mesh, as good as the mesh on the part."""

    def __init__(self, mesh, face_of_triangle, radius_mm, corner_radius_mm, allowance_mm=0.0):
        """
        Args:
            mesh: DropMesh.
            face_of_triangle: (m,) index of the face each triangle (in the order given to DropMesh) belongs to.
            radius_mm, corner_radius_mm: R > 0 and rc, 0 (flat) to R (ball).
            allowance_mm: material to leave, >= 0.
        """
        self.radius_mm, self.corner_radius_mm, self.allowance_mm = checked_cutter(
            radius_mm, corner_radius_mm, allowance_mm)
        self._mesh = mesh
        self._rims = MeshRims.of(mesh.corners_mm[np.argsort(mesh.original, kind="stable")], face_of_triangle)
        self._grown = self.radius_mm + self.allowance_mm, self.corner_radius_mm + self.allowance_mm

    @classmethod
    def of(cls, planning_mesh, radius_mm, corner_radius_mm, allowance_mm=0.0):
        """From a brep.PlanningMesh."""
        mesh = DropMesh.from_triangles(planning_mesh.vertices_mm, planning_mesh.triangles)
        return cls(mesh, planning_mesh.face_of_triangle, radius_mm, corner_radius_mm, allowance_mm)

    def tips_mm(self, xy_mm):
        return drop_tips_mm(self._mesh, xy_mm, *self._grown) + self.allowance_mm

    def contacts(self, xy_mm):
        xy = np.ascontiguousarray(xy_mm, dtype=float)
        rest = drop_contacts(self._mesh, xy, *self._grown)
        face, beside, is_edge = self._rims.at(rest.contact_mm, rest.triangle)
        normal = np.full((len(xy), 3), np.nan)
        held = rest.triangle >= 0
        normal[held] = cutter_normals(xy[held], rest.tip_z_mm[held], rest.contact_mm[held], *self._grown)
        return TipContacts(tip_z_mm=rest.tip_z_mm + self.allowance_mm, contact_mm=rest.contact_mm, normal=normal,
                           face=face, beside=beside, is_edge=is_edge)


def checked_cutter(radius_mm, corner_radius_mm, allowance_mm):
    """(R, rc, allowance) as floats.

    Raises:
        ToolpathError: not a cutter, or an allowance below zero.
    """
    if not allowance_mm >= 0.0:
        raise ToolpathError(f"an allowance of {allowance_mm} mm cannot be left: it must not be below 0")
    return *checked_radii_mm(radius_mm, corner_radius_mm), float(allowance_mm)
