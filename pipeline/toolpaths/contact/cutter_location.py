r"""Cutter locations from the surface: where the tip stands when the cutter touches at a contact.

A cutter is a profile revolved about its axis, tip at (r, z) = (0, 0), as elements from the tip outward and upward:

    z          │ side line       LINE: r0, z0, r1, z1
    │          │                 ARC:  rc, zc, radius, angle0, angle1 (from +r toward +z, rising)
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
from cuspline.values.threads import in_blocks

LINE, ARC = 0, 1
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
    for k in range(elements.shape[0]):
        e = elements[k]
        if e[0] == LINE:
            ends = (e[1], e[2], e[3], e[4])
        else:
            angle = fixed.arctan2(axial, radial)
            first = e[1] + e[3] * fixed.cos(e[4]), e[2] + e[3] * fixed.sin(e[4])
            last = e[1] + e[3] * fixed.cos(e[5]), e[2] + e[3] * fixed.sin(e[5])
            if e[4] <= angle <= e[5]:
                first = last = e[1] + e[3] * radial, e[2] + e[3] * axial
            ends = (first[0], first[1], last[0], last[1])
        for j in range(0, 4, 2):
            reach = ends[j] * radial + ends[j + 1] * axial
            if best == -np.inf or reach > best + TIE * (1.0 + abs(best)):
                best, r, z = reach, ends[j], ends[j + 1]
    e = elements[elements.shape[0] - 1]
    if e[0] == LINE:
        top_r, top_z, along_r, along_z = e[3], e[4], e[3] - e[1], e[4] - e[2]
    else:
        top_r, top_z = e[1] + e[3] * fixed.cos(e[5]), e[2] + e[3] * fixed.sin(e[5])
        along_r, along_z = -fixed.sin(e[5]), fixed.cos(e[5])
    past = (radial * along_r + axial * along_z) / fixed.hypot(along_r, along_z)
    if past > BEYOND and r == top_r and z == top_z:
        return np.nan, np.nan
    return r, z


@njit(error_model="numpy")
def _tip(elements, contact, normal, axis, allowance, out):
    along = normal[0] * axis[0] + normal[1] * axis[1] + normal[2] * axis[2]
    hx, hy, hz = normal[0] - along * axis[0], normal[1] - along * axis[1], normal[2] - along * axis[2]
    across = np.sqrt(hx * hx + hy * hy + hz * hz)
    r, z = profile_point(elements, across, -along)
    share = r / across if across > LEVEL else 0.0
    out[0] = contact[0] + allowance * normal[0] + share * hx - z * axis[0]
    out[1] = contact[1] + allowance * normal[1] + share * hy - z * axis[1]
    out[2] = contact[2] + allowance * normal[2] + share * hz - z * axis[2]


@njit
def _tips(elements, contact, normal, axis, allowance, out, first, last):
    for k in range(first, last):
        _tip(elements, contact[k], normal[k], axis[k], allowance, out[k])
