r"""A bull nose or flat cutter that leans touches with its corner: where its tip is then, and how wide it cuts.

           \  axis          the corner's middle lies rc out of the contact along the normal n, the cutter's middle R - rc from
            \               there toward where n leans away from the axis a: u = (n - cos(t) a) / sin(t)
      ____   \
      \  O \__\  O = contact + rc n + (R - rc) u,  tip = O - rc a
       \__/ contact

A ball about the contact's normal stands for it while passes are laid: its middle is that of the passes, its radius may be any.
Across a feed from which the lean turns aside by b the cutter is as round as R_e cos²b + rc sin²b, R_e = rc + (R - rc) / sin t.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.errors import ToolpathError

FLAT_BALL_SHARE = 0.1       # of a flat cutter's radius: the ball that stands for it
BENDS = (0.0, 0.5, 1.0, 1.5)    # of the lean, places on the corner: at 1 it touches
LEAST_LEAN_RAD = math.radians(1.0)      # from the normal: nearer to it the whole bottom touches


@dataclass(frozen=True, kw_only=True)
class CornerContact:
    """A cutter that touches with its corner, and the ball that stands for it."""

    radius_mm: float            # R
    corner_radius_mm: float     # rc, 0 of a flat cutter
    lead_rad: float
    tilt_rad: float

    def __post_init__(self):
        if self.lean_rad < LEAST_LEAN_RAD:
            raise ToolpathError(f"a cutter with a flat bottom leans by {math.degrees(self.lean_rad):.3g} degrees from the normal: "
                                f"give it a lead_deg of {math.degrees(LEAST_LEAN_RAD):g} or more, or take a ball")

    @property
    def ball_radius_mm(self):
        """Of the ball whose middle the passes give."""
        return self.corner_radius_mm if self.corner_radius_mm > 0.0 else FLAT_BALL_SHARE * self.radius_mm

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
        return self.corner_radius_mm + (self.radius_mm - self.corner_radius_mm) / float(fixed.sin(self.lean_rad))

    @property
    def across_mm(self):
        """Radius of what it cuts, across the feed."""
        aside = float(fixed.sin(self.tilt_rad)) ** 2 / float(fixed.sin(self.lean_rad)) ** 2        # sin² of the lean's bearing
        return self.radius_aside_mm * (1.0 - aside) + self.corner_radius_mm * aside

    def tips_off(self, normals, axes):
        """(n, 3) from the ball's middle to the tip.   normals, axes: (n, 3) unit."""
        across = normals - (normals * axes).sum(axis=1)[:, None] * axes
        size = np.sqrt((across * across).sum(axis=1))[:, None]
        toward = np.where(size > 1e-9, across / np.maximum(size, 1e-9), 0.0)
        ball, corner = self.ball_radius_mm, self.corner_radius_mm
        return (corner - ball) * normals + (self.radius_mm - corner) * toward - corner * axes

    def bottom_mm(self, azimuths, rings):
        """(k, 3) places of the bottom, the axis along Z, from the tip: most round where it touches.

        Args:
            azimuths: how many round the axis.   rings: on the level bottom.
        """
        turn = np.linspace(0.0, 2 * np.pi, azimuths, endpoint=False)
        bend = self.lean_rad * np.array(BENDS)
        flat, corner = self.radius_mm - self.corner_radius_mm, self.corner_radius_mm
        r = np.concatenate([flat + corner * fixed.sin(bend), flat * np.linspace(0.0, 1.0, rings, endpoint=False)])
        z = np.concatenate([corner * (1.0 - fixed.cos(bend)), np.zeros(rings)])
        r, turn = (a.ravel() for a in np.meshgrid(r, turn))
        return np.column_stack([r * fixed.cos(turn), r * fixed.sin(turn), np.tile(z, azimuths)])
