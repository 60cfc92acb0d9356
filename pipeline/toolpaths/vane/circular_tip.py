r"""A vane tip: a circle in every transverse plane, straight flanks tangent to it; centre and radius are splines of x.

    z ▲  toward the beam            (y² + (z - z0(x))²) = R(x)²
      │      ___
      │    /  ·  \     crest z0 + R          · (0, z0), the arc's centre
      │   (Y,Z)   \    tangency: Y = R cos α, Z = z0 + R sin α
      │  /         \   flanks, α from the vertical (0: parallel)
      │ /___________\  foot_z_mm
      └──────────────────► y            x runs along the vane

Source: docs/formulas.md 1 (Crandall and Stovall); the flanks' angle is ours.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.interpolate import BSpline

from cuspline.splines.nurbs import local_shape
from cuspline.splines.spline_interpolation import interpolated
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import DesignError

LOOKS_A_SPAN, LOOKS_ROUND = 24, 19      # places between knots and round half the arc at which hollows are looked for
SIDE_RAD = np.radians(30.0)             # beyond this from the crest the arc counts as side
LEAST_MM = 1e-6     # a clipped tip begins at a knot that is nearer than this
PARTS = ("crest", "sides")               # whose hollows are told apart
RISE = 1e-9         # knots closer together than this are one knot, mm


def greville_mm(knots_mm, degree):
    """(n,) Greville abscissae of clamped knots (n + degree + 1,): as poles of x they make x the parameter."""
    means = sliding_window_view(knots_mm[1:-1], degree).mean(axis=1)
    means[0], means[-1] = knots_mm[0], knots_mm[-1]
    return means


@dataclass(frozen=True, eq=False, kw_only=True)
class CircularTip:
    """The tip of one vane, part coordinates, millimetres; x along the vane, y across, +z out toward the beam.

    Centre height z0 and radius R are scalar B-splines of x on one clamped knot row.  Every function of x takes
    (n,) mm within `range_mm` and takes what lies outside at the nearer end.
    """

    name: ClassVar[str] = "tip"     # of what plan.json says of it

    degree: int                     # quintic as built
    knots_mm: np.ndarray            # (n + degree + 1,) flat, clamped, in x
    center_poles_mm: np.ndarray     # (n,) of z0
    radius_poles_mm: np.ndarray     # (n,) of R
    flank_half_angle_rad: float     # 0: parallel sides; above: the vane widens away from the beam
    foot_z_mm: float                # the flanks reach down to here

    def __post_init__(self):
        for name in ("knots_mm", "center_poles_mm", "radius_poles_mm"):
            object.__setattr__(self, name, frozen(getattr(self, name), (None,), name))
        count, k = len(self.center_poles_mm), self.degree
        if len(self.radius_poles_mm) != count or len(self.knots_mm) != count + k + 1:
            raise ValueError(f"{count} centre poles of degree {k} need as many radius poles "
                             f"({len(self.radius_poles_mm)}) and {count + k + 1} knots ({len(self.knots_mm)})")
        ends = np.r_[self.knots_mm[:k + 1] - self.knots_mm[0], self.knots_mm[-k - 1:] - self.knots_mm[-1]]
        if np.abs(ends).max() > RISE or (np.diff(self.knots_mm) < 0).any():
            raise ValueError("knots must rise and be clamped: the first and the last degree + 1 times")
        if not 0 <= self.flank_half_angle_rad < np.pi / 2:
            raise DesignError(f"flank half-angle {np.degrees(self.flank_half_angle_rad):g} deg: it is 0 (parallel "
                              "sides) or above, below 90")
        if self.radius_poles_mm.min() <= 0:
            raise DesignError(f"the tip's radius falls to {self.radius_poles_mm.min():.4g} mm: it must stay above 0")

    def facts(self, where=lambda place_mm: ""):
        """For plan.json: range, foot, and the tightest hollow of crest and sides with its place; see `Design.guide_of`."""
        rows = {"range_mm": [round(x, 6) for x in self.range_mm], "foot_z_mm": round(self.foot_z_mm, 6)}
        for name, (radius, place) in zip(PARTS, self.tightest_hollows()):
            rows[f"{name}_concave_radius_mm"] = round(float(radius), 6) if np.isfinite(radius) else None
            rows[f"{name}_concave_place_mm"] = [round(float(x), 4) for x in place]
            rows[f"{name}_concave_where"] = where(place)
        return rows

    @property
    def range_mm(self):
        """(first, last) x of the tip."""
        return float(self.knots_mm[0]), float(self.knots_mm[-1])

    def between(self, low_mm, high_mm):
        """The same tip from x = low to high alone; itself where that is all of it.

        The splines lie in the space of the clipped knots, so interpolating them there gives them back.
        """
        first, last = self.range_mm
        low, high, k = max(low_mm, first), min(high_mm, last), self.degree
        if high - low < LEAST_MM:
            raise ValueError(f"no tip between {low_mm:g} and {high_mm:g} mm: it goes from {first:g} to {last:g} mm")
        if low - first < LEAST_MM and last - high < LEAST_MM:
            return self
        inner = self.knots_mm[(self.knots_mm > low + LEAST_MM) & (self.knots_mm < high - LEAST_MM)]
        knots = np.r_[[low] * (k + 1), inner, [high] * (k + 1)]
        greville = np.clip(greville_mm(knots, k), low, high)
        clipped = lambda poles: interpolated(greville, BSpline(self.knots_mm, poles, k)(greville), k, knots).c
        return replace(self, knots_mm=knots, center_poles_mm=clipped(self.center_poles_mm),
                       radius_poles_mm=clipped(self.radius_poles_mm))

    @cached_property
    def _splines(self):
        """((z0, z0', z0''), (R, R', R'')) as scipy splines."""
        rows = []
        for poles in (self.center_poles_mm, self.radius_poles_mm):
            spline = BSpline(self.knots_mm, poles, self.degree)
            rows.append((spline, spline.derivative(), spline.derivative(2)))
        return tuple(rows)

    def _at(self, which, order, x_mm):
        return self._splines[which][order](np.clip(np.asarray(x_mm, float), *self.range_mm))

    def center_z_mm(self, x_mm):
        """(n,) z0, height of the arc's centre."""
        return self._at(0, 0, x_mm)

    def center_slope(self, x_mm):
        """(n,) z0' = dz0/dx."""
        return self._at(0, 1, x_mm)

    def center_bend_per_mm(self, x_mm):
        """(n,) z0''."""
        return self._at(0, 2, x_mm)

    def radius_mm(self, x_mm):
        """(n,) R, the arc's radius."""
        return self._at(1, 0, x_mm)

    def radius_slope(self, x_mm):
        """(n,) R' = dR/dx."""
        return self._at(1, 1, x_mm)

    def radius_bend_per_mm(self, x_mm):
        """(n,) R''."""
        return self._at(1, 2, x_mm)

    def crest_z_mm(self, x_mm):
        """(n,) z0 + R, the tip line in the mid-plane."""
        return self.center_z_mm(x_mm) + self.radius_mm(x_mm)

    def hollow_per_mm(self, x_mm, turn_rad):
        """(n,) the most hollow principal curvature of the arc: negative in a hollow, as everywhere."""
        x, turn = np.broadcast_arrays(np.asarray(x_mm, float), np.asarray(turn_rad, float))
        sine, cosine, none, one = fixed.sin(turn), fixed.cos(turn), np.zeros(x.shape), np.ones(x.shape)
        R, R1, R2 = self.radius_mm(x), self.radius_slope(x), self.radius_bend_per_mm(x)
        rows = [(x, R * sine, self.center_z_mm(x) + R * cosine),
                (none, R * cosine, -R * sine), (one, R1 * sine, self.center_slope(x) + R1 * cosine),
                (none, -R * sine, -R * cosine), (none, R1 * cosine, -R1 * sine),
                (none, R2 * sine, self.center_bend_per_mm(x) + R2 * cosine)]
        shape = local_shape(np.stack([np.stack(row, axis=-1) for row in rows], axis=1), flip=True)
        return shape.curvature_low_per_mm

    def tightest_hollows(self):
        """((radius_mm, (3,) place) along the crest, the same on the arc's sides), inf where nothing is hollow.

        The first one is the valley of the tip line, that limits the cutter at first sight; the second one what the
        sides add to that.  Found by looking, not proven: `curvature.tightest_hollow` proves it on the B-rep.
        """
        breaks = np.unique(self.knots_mm)
        share = np.linspace(0.0, 1.0, LOOKS_A_SPAN, endpoint=False)
        x = np.r_[(breaks[:-1, None] + share * np.diff(breaks)[:, None]).ravel(), breaks[-1]]
        sides = np.repeat(np.linspace(SIDE_RAD, self.half_arc_rad, LOOKS_ROUND), len(x))
        found = []
        for along, turn in ((x, np.zeros(len(x))), (np.tile(x, LOOKS_ROUND), sides)):
            curvature = self.hollow_per_mm(along, turn)
            k = int(curvature.argmin())
            radius = -1.0 / curvature[k] if curvature[k] < 0 else np.inf
            found.append((float(radius), self.point_mm(along[k:k + 1], turn[k:k + 1])[0]))
        return tuple(found)

    @property
    def half_arc_rad(self):
        """The arc runs from minus this to plus this, seen from its centre, 0 at the crest."""
        return np.pi / 2 - self.flank_half_angle_rad

    def point_mm(self, x_mm, turn_rad):
        """(n, 3) points of the arc.

        Args:
            x_mm: (n,).
            turn_rad: (n,) or scalar, angle round the arc's centre from the crest toward +y.
        """
        x, turn = np.broadcast_arrays(np.asarray(x_mm, float), np.asarray(turn_rad, float))
        radius = self.radius_mm(x)
        return np.stack([x, radius * fixed.sin(turn), self.center_z_mm(x) + radius * fixed.cos(turn)], axis=-1)

    def normal(self, x_mm, turn_rad):
        """(n, 3) unit normals of the arc, out of the material.

        Source: docs/formulas.md 1, gradient (-(z - z0) z0' - R R', y, z - z0) over R.
        """
        x, turn = np.broadcast_arrays(np.asarray(x_mm, float), np.asarray(turn_rad, float))
        gradient = np.stack([-fixed.cos(turn) * self.center_slope(x) - self.radius_slope(x),
                             fixed.sin(turn), fixed.cos(turn)], axis=-1)
        return gradient / np.linalg.norm(gradient, axis=-1, keepdims=True)

    def tangency_mm(self, x_mm):
        """(n,) Y and (n,) Z where arc and flank meet, on the side of +y."""
        radius, angle = self.radius_mm(x_mm), self.flank_half_angle_rad
        return radius * fixed.cos(angle), self.center_z_mm(x_mm) + radius * fixed.sin(angle)

    def flank_point_mm(self, x_mm, z_mm):
        """(n, 3) points of the flank on the side of +y at heights between foot and tangency."""
        x, z = np.broadcast_arrays(np.asarray(x_mm, float), np.asarray(z_mm, float))
        y, top = self.tangency_mm(x)
        return np.stack([x, y + (top - z) * fixed.tan(self.flank_half_angle_rad), z], axis=-1)

    def flank_normal(self, x_mm):
        """(n, 3) unit normals of the flank on the side of +y: the same all the way down."""
        angle, rise = self.flank_half_angle_rad, self.radius_slope(x_mm)
        # y = Y + (Z - z) tan α, so dy/dx = R' cos α + (z0' + R' sin α) tan α = R'/cos α + z0' tan α
        widening = rise / fixed.cos(angle) + self.center_slope(x_mm) * fixed.tan(angle)
        normal = np.stack([-widening, np.ones_like(widening), np.full_like(widening, fixed.tan(angle))], axis=-1)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)
