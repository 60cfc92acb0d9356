r"""A cutter that leans touches with one arc of its outline: where its tip is then, and how wide it cuts.

           \  axis          of a bull nose: the corner's middle lies rc out of the contact along the normal n, the cutter's
            \               middle R - rc from there toward where n leans away from the axis a: u = (n - cos(t) a) / sin(t)
      ____   \
      \  O \__\  O = contact + rc n + (R - rc) u,  tip = O - rc a
       \__/ contact

Of any outline: an arc of radius rc about (e, f) in (r, z) touches, O = contact + rc n + e u, tip = O - f a.  A lens has e = 0, a
barrel e < 0; a sharp corner rc = 0.
A ball about the contact's normal stands for it while passes are laid: its middle is that of the passes, its radius may be any.
Across a feed from which the lean turns aside by b the cutter is as round as R_e cos²b + rc sin²b, R_e = rc + e / sin t.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.errors import ToolpathError

FLAT_BALL_SHARE = 0.1       # of a flat cutter's radius: the ball that stands for it
BENDS = (0.0, 0.5, 1.0, 1.5)    # of the lean, places on the corner: at 1 it touches
OUTLINE_SHARE = 0.02        # of a cutter's radius: how closely its outline is looked at
SAME_MM, SAME_RAD = 1e-6, 1e-9
LEAST_LEAN_RAD = math.radians(1.0)      # from the normal: nearer to it the whole bottom touches


@dataclass(frozen=True, kw_only=True)
class CornerContact:
    """A cutter that touches with an arc of its outline, its corner, and the ball that stands for it."""

    radius_mm: float            # R
    corner_radius_mm: float     # rc, 0 of a flat cutter
    lead_rad: float
    tilt_rad: float
    aside_rad: float = 0.0      # from the feed to the direction that lead and tilt count from
    center_mm: tuple | None = None      # (e, f) of the arc; None: (R - rc, rc)
    outline_mm: tuple = ()      # of (r, z), places of the whole outline that are looked at beside the contact

    def __post_init__(self):
        if self.lean_rad < LEAST_LEAN_RAD:
            raise ToolpathError(f"a cutter that is no ball leans by {math.degrees(self.lean_rad):.3g} degrees from the normal: "
                                f"give it a lead_deg of {math.degrees(LEAST_LEAN_RAD):g} or more, or take a ball")

    @classmethod
    def of(cls, cutter, lead_rad, tilt_rad, aside_rad=0.0):
        """Of a shop.cutters.Cutter at its lean.

        Raises:
            ToolpathError: it hardly leans, or touches with what is no cutting edge below its flutes' end.
        """
        own = cls(radius_mm=cutter.radius_mm, corner_radius_mm=cutter.corner_radius_mm, lead_rad=lead_rad, tilt_rad=tilt_rad,
                  aside_rad=aside_rad)
        if cutter.type in ("ball", "bull_nose", "flat"):
            return own
        profile = cutter.profile
        place = profile.support(np.array([np.pi - own.lean_rad]))[1][0]
        if place[1] > profile.height_mm - SAME_MM:
            raise ToolpathError(f"leaning by {math.degrees(own.lean_rad):.3g} degrees it touches where its flutes end: lean it "
                                "less")
        radius, center = _arc_at(profile, place)
        return replace(own, radius_mm=profile.largest_radius_mm, corner_radius_mm=radius, center_mm=center, outline_mm=tuple(
            map(tuple, profile.points(OUTLINE_SHARE * own.radius_mm).tolist())))

    @property
    def ball_radius_mm(self):
        """Of the ball whose middle the passes give."""
        return self.corner_radius_mm if 0.0 < self.corner_radius_mm <= self.radius_mm else FLAT_BALL_SHARE * self.radius_mm

    @property
    def _center_mm(self):
        """(e, f) of the arc that touches."""
        return self.center_mm or (self.radius_mm - self.corner_radius_mm, self.corner_radius_mm)

    @property
    def lean_rad(self):
        """Between axis and normal.

        >>> corner = CornerContact(radius_mm=5.0, corner_radius_mm=1.0, lead_rad=0.3, tilt_rad=0.0)
        >>> round(corner.lean_rad, 9)
        0.3
        """
        return float(fixed.arccos(fixed.cos(self.lead_rad) * fixed.cos(self.tilt_rad)))

    @property
    def radius_aside_mm(self):
        """Radius square to the direction in which the axis leans, at the contact: R_e."""
        return self.corner_radius_mm + self._center_mm[0] / float(fixed.sin(self.lean_rad))

    @property
    def across_mm(self):
        """Radius of what it cuts, across the feed."""
        ahead = float(fixed.sin(self.lead_rad) * fixed.cos(self.tilt_rad))
        right = float(fixed.sin(self.tilt_rad))
        turned = right * float(fixed.cos(self.aside_rad)) + ahead * float(fixed.sin(self.aside_rad))
        aside = turned ** 2 / float(fixed.sin(self.lean_rad)) ** 2                                 # sin² of the lean's bearing
        return self.radius_aside_mm * (1.0 - aside) + self.corner_radius_mm * aside

    def tips_off(self, normals, axes):
        """(n, 3) from the ball's middle to the tip.   normals, axes: (n, 3) unit."""
        across = normals - (normals * axes).sum(axis=1)[:, None] * axes
        size = np.sqrt((across * across).sum(axis=1))[:, None]
        toward = np.where(size > 1e-9, across / np.maximum(size, 1e-9), 0.0)
        (out, up), above = self._center_mm, self.corner_radius_mm - self.ball_radius_mm
        return above * normals + out * toward - up * axes

    def bottom_mm(self, azimuths, rings):
        """(k, 3) places of the bottom, the axis along Z, from the tip: most round where it touches.

        Args:
            azimuths: how many round the axis.   rings: on the level bottom.
        """
        turn = np.linspace(0.0, 2 * np.pi, azimuths, endpoint=False)
        if self.outline_mm:
            r, z = np.array(self.outline_mm).T
        else:
            bend, (out, up), corner = self.lean_rad * np.array(BENDS), self._center_mm, self.corner_radius_mm
            level = out * np.linspace(0.0, 1.0, rings, endpoint=False)
            r = np.concatenate([out + corner * fixed.sin(bend), level])
            z = np.concatenate([up - corner * fixed.cos(bend), np.zeros(rings)])
        r, turn = (a.ravel() for a in np.meshgrid(r, turn))
        return np.column_stack([r * fixed.cos(turn), r * fixed.sin(turn), np.tile(z, azimuths)])


def _arc_at(profile, place):
    """(radius, (e, f)) of the arc of a CutterProfile on which a place (r, z) lies; of a sharp corner (0, place)."""
    angles = profile.arc_angles_rad
    for center, radius, (first, last) in zip(profile.center_mm, profile.arc_radius_mm, angles):
        if radius > 0.0:
            off = place - center
            at = float(fixed.arctan2(off[1], off[0]))
            if abs(float(fixed.length(off)) - radius) < SAME_MM and first - SAME_RAD <= at <= last + SAME_RAD:
                return float(radius), (float(center[0]), float(center[1]))
    return 0.0, (float(place[0]), float(place[1]))
