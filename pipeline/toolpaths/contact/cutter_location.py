r"""Cutter locations from the surface: where the tip stands when the cutter touches at a contact.

A cutter is a profile revolved about its axis, tip at (r, z) = (0, 0), as elements from the tip outward and upward:

    z          │ side line       KIND LINE: R0, Z0, R1, Z1
    │          │                 KIND ARC:  CENTER_R, CENTER_Z, RADIUS, ANGLE_0, ANGLE_1 (from +r toward +z, rising)
    │         ╱ corner arc
    0───────-‾  bottom line
    0          r

The part's normal n at the contact meets the cutter's outward normal -n: the touching point of the profile is the one
furthest in the direction (|n across the axis|, -n along the axis).  tip = contact + r e - z a, with e the unit of n
across.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.compiled import njit
from cuspline.values.errors import ToolpathError
from cuspline.values.rows import X, Y, Z
from cuspline.values.threads import in_blocks

LINE, ARC = 0, 1
KIND, CENTER_R, CENTER_Z, RADIUS, ANGLE_0, ANGLE_1 = range(6)       # columns of an element that is an arc
R0, Z0, R1, Z1 = range(1, 5)                                        # of one that is a line
CHUNK, SERIAL_ROWS = 1024, 8000
TIE = 1e-12             # ends of a line that a direction meets at equal reach: the lower one touches
LEVEL = 1e-9            # sine of the slope below which a contact counts as level: it then lies under the tip
BEYOND = 1e-9           # sine above which a direction looks past the profile's upper end


@dataclass(frozen=True, eq=False, kw_only=True)
class CutterLocations:
    """Tips and axes along one pass, one row each, in the frame of the contacts."""

    tip_mm: np.ndarray          # (n, 3) CL points
    axis: np.ndarray            # (n, 3) unit, tip towards holder
    contact_mm: np.ndarray      # (n, 3) the CC points they came from

    def __post_init__(self):
        n = len(self.tip_mm)
        for name in ("tip_mm", "axis", "contact_mm"):
            object.__setattr__(self, name, frozen(getattr(self, name), (n, 3), name))

    def __len__(self):
        return len(self.tip_mm)


def line_element(r0_mm, z0_mm, r1_mm, z1_mm):
    """(6,) element: a straight stretch of the profile."""
    return np.array([LINE, r0_mm, z0_mm, r1_mm, z1_mm, 0.0])


def arc_element(center_r_mm, center_z_mm, radius_mm, angle0_rad, angle1_rad):
    """(6,) element: an arc bulging outward, angles from +r toward +z, the first below the second."""
    return np.array([ARC, center_r_mm, center_z_mm, radius_mm, angle0_rad, angle1_rad])


def profile_elements(profile):
    """(k, 6) elements of a `cutter_profile.CutterProfile`."""
    rows = zip(profile.start_mm, profile.end_mm, profile.center_mm, profile.arc_radius_mm, profile.arc_angles_rad)
    return np.array([arc_element(*center, radius, *angles) if radius > 0 else line_element(*start, *end)
                     for start, end, center, radius, angles in rows])


def cutter_locations(elements, contact_mm, normal, axis=(0.0, 0.0, 1.0), allowance_mm=0.0):
    """Tips of any convex cutter that touches at the given contacts.

    Args:
        elements: (k, 6) profile, rows of `line_element` and `arc_element` from the tip upward.
        contact_mm: (n, 3) CC points.
        normal: (n, 3) unit, out of the material.
        axis: (3,) or (n, 3) unit, tip towards holder.
        allowance_mm: left on the surface, scalar.
    Returns:
        CutterLocations.
    Raises:
        ToolpathError: normals that no point of the profile can meet (undercut from this axis); `.rows` lists them.
    """
    contact, normal = (for_kernel(a).reshape(-1, 3) for a in (contact_mm, normal))
    axes = for_kernel(np.broadcast_to(np.asarray(axis, float), contact.shape))
    tips = np.empty_like(contact)
    in_blocks(_tips, len(contact), CHUNK, for_kernel(elements), contact, normal, axes,
              float(allowance_mm), tips, serial_rows=SERIAL_ROWS)
    lost = np.flatnonzero(np.isnan(tips[:, 0]))
    if len(lost):
        raise ToolpathError(f"{len(lost)} of {len(contact)} contacts face away from the cutter (first: row {lost[0]} "
                            f"at {np.round(contact[lost[0]], 3).tolist()}): tilt the axis, choose a cutter that "
                            "reaches under, or leave them out", rows=lost)
    return CutterLocations(tip_mm=tips, axis=axes, contact_mm=contact)


@njit(error_model="numpy")
def profile_point(elements, radial, axial):
    """(r, z) of the profile furthest in a unit direction (radial >= 0, axial); NaN: it looks past the upper end."""
    best, r, z = -np.inf, 0.0, 0.0
    for k in range(len(elements)):
        e = elements[k]
        if e[KIND] == LINE:
            ends = (e[R0], e[Z0], e[R1], e[Z1])
        else:
            angle = fixed.arctan2(axial, radial)
            first = e[CENTER_R] + e[RADIUS] * fixed.cos(e[ANGLE_0]), e[CENTER_Z] + e[RADIUS] * fixed.sin(e[ANGLE_0])
            last = e[CENTER_R] + e[RADIUS] * fixed.cos(e[ANGLE_1]), e[CENTER_Z] + e[RADIUS] * fixed.sin(e[ANGLE_1])
            if e[ANGLE_0] <= angle <= e[ANGLE_1]:
                first = last = e[CENTER_R] + e[RADIUS] * radial, e[CENTER_Z] + e[RADIUS] * axial
            ends = (first[0], first[1], last[0], last[1])
        for j in range(0, 4, 2):
            reach = ends[j] * radial + ends[j + 1] * axial
            if best == -np.inf or reach > best + TIE * (1.0 + abs(best)):
                best, r, z = reach, ends[j], ends[j + 1]
    e = elements[len(elements) - 1]
    if e[KIND] == LINE:
        top_r, top_z, along_r, along_z = e[R1], e[Z1], e[R1] - e[R0], e[Z1] - e[Z0]
    else:
        top_r, top_z = e[CENTER_R] + e[RADIUS] * fixed.cos(e[ANGLE_1]), e[CENTER_Z] + e[RADIUS] * fixed.sin(e[ANGLE_1])
        along_r, along_z = -fixed.sin(e[ANGLE_1]), fixed.cos(e[ANGLE_1])
    past = (radial * along_r + axial * along_z) / fixed.hypot(along_r, along_z)
    if past > BEYOND and r == top_r and z == top_z:
        return np.nan, np.nan
    return r, z


@njit(error_model="numpy")
def _tip(elements, contact, normal, axis, allowance, out):
    along = normal[X] * axis[X] + normal[Y] * axis[Y] + normal[Z] * axis[Z]
    hx, hy, hz = normal[X] - along * axis[X], normal[Y] - along * axis[Y], normal[Z] - along * axis[Z]
    across = np.sqrt(hx * hx + hy * hy + hz * hz)
    r, z = profile_point(elements, across, -along)
    share = r / across if across > LEVEL else 0.0
    out[X] = contact[X] + allowance * normal[X] + share * hx - z * axis[X]
    out[Y] = contact[Y] + allowance * normal[Y] + share * hy - z * axis[Y]
    out[Z] = contact[Z] + allowance * normal[Z] + share * hz - z * axis[Z]


@njit
def _tips(elements, contact, normal, axis, allowance, out, first, last):
    for k in range(first, last):
        _tip(elements, contact[k], normal[k], axis[k], allowance, out[k])
