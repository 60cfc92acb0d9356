"""Where a lowered cutter rests and what it touches there, one row a position."""

from dataclasses import dataclass

import numpy as np

from cuspline.values.arrays import frozen
from cuspline.values.errors import ToolpathError

NO_FACE = -1


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
    """
    arm = contact_mm[:, :2] - xy_mm
    distance = np.linalg.norm(arm, axis=1)
    flat = radius_mm - corner_radius_mm
    share = np.minimum(flat / np.maximum(distance, 1e-300), 1.0)
    center = np.column_stack([xy_mm + arm * share[:, None], tip_z_mm + corner_radius_mm])
    normal = center - contact_mm
    length = np.linalg.norm(normal, axis=1)
    on_sharp = (corner_radius_mm == 0.0) & (distance >= flat * (1 - 1e-9))
    normal[on_sharp] = np.column_stack([-arm[on_sharp], np.zeros(on_sharp.sum())])
    length[on_sharp] = distance[on_sharp]
    is_flat = (distance < flat) | (length == 0.0)
    normal[is_flat], length[is_flat] = (0.0, 0.0, 1.0), 1.0
    return normal / length[:, None]
