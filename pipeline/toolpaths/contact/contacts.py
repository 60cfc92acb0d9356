"""Where a lowered cutter rests and what it touches there, one row a position."""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.compiled import njit
from cuspline.values.errors import ToolpathError
from cuspline.values.rows import X, Y, Z
from cuspline.values.threads import in_blocks

NO_FACE = -1
BLOCK = 4096                # rows a thread takes at a time


@dataclass(frozen=True, eq=False, kw_only=True)
class TipContacts:
    """Lowest gouge-free tips and their contacts, part frame; misses hold -inf, NaN and NO_FACE."""

    tip_z_mm: np.ndarray        # (n,) tip height, -inf where nothing lies beneath
    contact_mm: np.ndarray      # (n, 3) point of the part that is touched
    normal: np.ndarray          # (n, 3) unit, from the contact into the cutter
    face: np.ndarray            # (n,) index of the touched face
    beside: np.ndarray          # (n,) on an edge: the face on its other side (the same on a seam), else NO_FACE
    is_edge: np.ndarray         # (n,) the contact lies on an edge or a corner of its face

    def __post_init__(self):
        put = lambda name, shape, dtype=float: object.__setattr__(
            self, name, frozen(getattr(self, name), shape, name, dtype))
        put("tip_z_mm", (None,))
        n = len(self.tip_z_mm)
        for name in ("contact_mm", "normal"):
            put(name, (n, 3))
        for name in ("face", "beside"):
            put(name, (n,), np.int64)
        put("is_edge", (n,), bool)

    def __len__(self):
        return len(self.tip_z_mm)

    def touches(self, faces):
        """(n,) bool: one of the faces is touched, or an edge of which both sides are among them."""
        mine = np.isin(self.face, list(faces))
        return mine & (~self.is_edge | np.isin(self.beside, list(faces)))

    def touches_rim(self, faces):
        """(n,) bool: an edge is touched that borders one of the faces, on whichever side."""
        faces = list(faces)
        return self.is_edge & (np.isin(self.face, faces) | np.isin(self.beside, faces))


def checked_radii_mm(radius_mm, corner_radius_mm):
    """Cutter radius R and corner radius rc as floats.

    Raises:
        ToolpathError: they are no cutter's.
    """
    R, rc = float(radius_mm), float(corner_radius_mm)
    if not (0.0 < R < np.inf and 0.0 <= rc <= R):
        raise ToolpathError(f"no cutter has radius {R} mm and corner radius {rc} mm: the corner radius runs from 0 "
                            "(flat) to the radius (ball); correct the tool library")
    return R, rc


def cutter_normals(xy_mm, tip_z_mm, contact_mm, radius_mm, corner_radius_mm):
    """(n, 3) unit normals of a cutter's bottom at its contacts, from the contact into the cutter.

    On the flat of the bottom they point up; on the corner (ball: everywhere) to the centre of the
    corner's circle.  A sharp corner (rc = 0) has no one normal: there they point level to the axis
    when the contact lies on its circle.

    Args:
        xy_mm: (n, 2) of the axis.   tip_z_mm: (n,).   contact_mm: (n, 3).
        radius_mm, corner_radius_mm: R > 0 and rc, 0 (flat) to R (ball).
    """
    xy, tips, contact = for_kernel(xy_mm).reshape(-1, 2), for_kernel(tip_z_mm), for_kernel(contact_mm).reshape(-1, 3)
    normals = np.empty(contact.shape)
    in_blocks(_normal_rows, len(contact), BLOCK, xy, tips, contact, float(radius_mm), float(corner_radius_mm), normals)
    return normals


@njit(error_model="numpy")
def _normal_rows(xy, tips, contact, R, rc, normals, first, end):
    flat = R - rc
    for i in range(first, end):
        ax, ay = contact[i, X] - xy[i, X], contact[i, Y] - xy[i, Y]
        distance = math.sqrt(ax * ax + ay * ay)
        if rc == 0.0 and distance >= flat * (1 - 1e-9):
            nx, ny, nz, length = -ax, -ay, 0.0, distance
        else:
            share = min(flat / max(distance, 1e-300), 1.0)
            nx, ny = xy[i, X] + ax * share - contact[i, X], xy[i, Y] + ay * share - contact[i, Y]
            nz = tips[i] + rc - contact[i, Z]
            length = math.sqrt(nx * nx + ny * ny + nz * nz)
        if distance < flat or length == 0.0:
            nx, ny, nz, length = 0.0, 0.0, 1.0, 1.0
        normals[i, X], normals[i, Y], normals[i, Z] = nx / length, ny / length, nz / length
