"""The cutting part of a cutter of revolution: its outline in (r, z) from the tip to where the flutes end.

    z                   ____
    │              ..../       an outline is a chain of lines and arcs; every arc turns counter-clockwise
    │         ___/             (outward and up), so that the body it bounds is convex where it cuts
    └────────'────────── r     r: distance from the axis, z: height above the tip
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen

SAME_MM = 1e-9          # shorter pieces are left out, ends this close are joined


@dataclass(frozen=True, eq=False, kw_only=True)
class CutterProfile:
    """Lines and arcs from the tip upward, one row each; a line's center is NaN."""

    start_mm: np.ndarray        # (n, 2) r, z
    end_mm: np.ndarray          # (n, 2)
    center_mm: np.ndarray       # (n, 2)

    def __post_init__(self):
        n = len(self.start_mm)
        for name in ("start_mm", "end_mm", "center_mm"):
            object.__setattr__(self, name, frozen(getattr(self, name), (n, 2), name))
        gaps = np.abs(self.start_mm[1:] - self.end_mm[:-1])
        if n == 0 or gaps.max(initial=0.0) > 10 * SAME_MM:
            raise ValueError("the parts of an outline must join")

    @cached_property
    def is_arc(self):
        """(n,) bool."""
        return np.isfinite(self.center_mm[:, 0])

    @cached_property
    def arc_radius_mm(self):
        """(n,) 0 for lines."""
        return np.where(self.is_arc, fixed.hypot(*(self.start_mm - np.nan_to_num(self.center_mm)).T), 0.0)

    @cached_property
    def arc_angles_rad(self):
        """(n, 2) first and last angle of each arc from the r direction toward z; last >= first; 0 for lines."""
        c = np.where(self.is_arc[:, None], self.center_mm, self.start_mm)
        first, last = (fixed.arctan2(p[:, 1] - c[:, 1], p[:, 0] - c[:, 0]) for p in (self.start_mm, self.end_mm))
        return np.where(self.is_arc[:, None], np.column_stack([first, last + 2 * np.pi * (last < first - 1e-12)]), 0.0)

    @property
    def largest_radius_mm(self):
        """The widest place of the cutting part."""
        first, last = self.arc_angles_rad.T
        equator = self.is_arc & (first <= 0) & (last >= 0)
        arcs = np.where(equator, np.nan_to_num(self.center_mm[:, 0]) + self.arc_radius_mm, 0.0)
        return float(max(self.start_mm[:, 0].max(), self.end_mm[:, 0].max(), arcs.max()))

    @property
    def top_radius_mm(self):
        """Radius where the flutes end."""
        return float(self.end_mm[-1, 0])

    @property
    def height_mm(self):
        """Tip to where the flutes end."""
        return float(self.end_mm[-1, 1])

    @property
    def is_undercutting(self):
        """Whether somewhere it is narrower above than below: then it cuts under what its own top stands beside."""
        return self.largest_radius_mm > self.top_radius_mm + SAME_MM

    @property
    def volume_mm3(self):
        """Volume under the outline turned about the axis: pi times the integral of r² dz."""
        r0, r1 = self.start_mm[:, 0], self.end_mm[:, 0]
        lines = (self.end_mm[:, 1] - self.start_mm[:, 1]) * (r0 * r0 + r0 * r1 + r1 * r1) / 3
        a, rho = np.nan_to_num(self.center_mm[:, 0]), self.arc_radius_mm

        def arcs(t):
            s = fixed.sin(t)
            return rho * (a * a * s + a * rho * (t + s * fixed.cos(t)) + rho ** 2 * (s - s * s * s / 3))

        first, last = self.arc_angles_rad.T
        return float(np.pi * np.where(self.is_arc, arcs(last) - arcs(first), lines).sum())

    @property
    def area_mm2(self):
        """Area of the outline turned about the axis, its bottom included, its open top not."""
        length = fixed.hypot(*(self.end_mm - self.start_mm).T)
        lines = (self.start_mm[:, 0] + self.end_mm[:, 0]) * length
        a, rho, (first, last) = np.nan_to_num(self.center_mm[:, 0]), self.arc_radius_mm, self.arc_angles_rad.T
        arcs = 2 * rho * (a * (last - first) + rho * (fixed.sin(last) - fixed.sin(first)))
        return float(np.pi * np.where(self.is_arc, arcs, lines).sum())

    def support(self, angle_rad):
        """What touches first when the cutter is pressed against a plane.

        Args:
            angle_rad: (m,) angle between the axis (tip to holder) and the plane's direction away from the cutter's
                middle, 0 to pi: pi presses the tip, pi/2 the side.
        Returns:
            (m,) distance of the plane from the tip's origin, (m, 2) the outline's point (r, z) that touches it.
        """
        outward = np.column_stack([fixed.sin(angle_rad), fixed.cos(angle_rad)])
        points = [np.broadcast_to(p, outward.shape) for p in (*self.start_mm, self.end_mm[-1])]
        turn = fixed.arctan2(outward[:, 1], outward[:, 0])
        for c, rho, (first, last) in zip(self.center_mm, self.arc_radius_mm, self.arc_angles_rad):
            if rho > 0:
                on = np.clip(turn, first, last)[:, None]
                points.append(c + rho * np.hstack([fixed.cos(on), fixed.sin(on)]))
        points = np.stack(points)
        far = np.einsum("kmi,mi->km", points, outward)
        best, rows = far.argmax(axis=0), np.arange(len(outward))
        return far[best, rows], points[best, rows]

    def points(self, sagitta_mm):
        """(k, 2) outline as a polyline, no farther than the sagitta from it."""
        rows = [self.start_mm[:1]]
        for end, c, rho, (first, last) in zip(self.end_mm, self.center_mm, self.arc_radius_mm, self.arc_angles_rad):
            if rho > 0:
                step = 2 * fixed.arccos(np.clip(1 - sagitta_mm / rho, -1, 1))
                t = np.linspace(first, last, int(np.ceil((last - first) / step)) + 1)[1:-1, None]
                rows.append(c + rho * np.hstack([fixed.cos(t), fixed.sin(t)]))
            rows.append(end[None])
        return np.vstack(rows)


def chain(*pieces):
    """CutterProfile of (start, end, center or None) pieces; those without length are left out."""
    kept = [p for p in pieces if fixed.hypot(p[1][0] - p[0][0], p[1][1] - p[0][1]) > SAME_MM]
    nan = (np.nan, np.nan)
    return CutterProfile(start_mm=[p[0] for p in kept], end_mm=[p[1] for p in kept],
                         center_mm=[nan if p[2] is None else p[2] for p in kept])


def apt_profile(d, r, e, f, alpha, beta, h):
    """Outline of the seven-parameter cutter of APT (CUTTER/d,r,e,f,alpha,beta,h).

    A line from the tip rises at alpha from the r direction; a line through where it crosses r = d/2 leans beta
    outward from the axis; a circle of radius r about (e, f) rounds the corner between them.

    Args:
        d, r, e, f, h: mm.
        alpha, beta: radians; 0 <= alpha < pi/2, |beta| < pi/2; beta < 0 leans inward (a dovetail).
    Raises:
        ValueError: the circle meets one of the lines nowhere, or above the height: which, and by how much.
    Source: ISO 4343 CUTTER; S. Engin, Y. Altintas, Int. J. Machine Tools Manuf. 41 (2001) 2195 (general end mill).
    """
    corner = np.array([d / 2, d / 2 * fixed.tan(alpha)])
    if r == 0:
        if fixed.hypot(*(corner - (e, f))) > 1e-6:
            raise ValueError(f"a sharp corner is where the lines cross: e = {corner[0]:.6g}, f = {corner[1]:.6g} mm")
        low = high = corner
    else:
        low = _crossing(np.zeros(2), np.array([fixed.cos(alpha), fixed.sin(alpha)]), (e, f), r, "bottom line", +1)
        high = _crossing(corner, np.array([fixed.sin(beta), fixed.cos(beta)]), (e, f), r, "side line", -1)
    if h < high[1] - SAME_MM:
        raise ValueError(f"the corner reaches {high[1]:.6g} mm up, above the height of {h:.6g} mm")
    top = high + (h - high[1]) * np.array([fixed.tan(beta), 1.0])
    if high[1] < low[1] - SAME_MM:
        raise ValueError("the side line meets the corner circle below the bottom line")
    if low[0] < -SAME_MM or min(high[0], top[0]) <= 0:
        raise ValueError("the outline crosses the tool axis")
    return chain((np.zeros(2), low, None), (low, high, (e, f)), (high, top, None))


def _crossing(origin, direction, center, radius, name, side):
    """Where a line of unit direction meets a circle: the last place (+1) or the first (-1); touching counts."""
    to = np.asarray(center) - origin
    along, off = fixed.matmul(to, direction), abs(direction[0] * to[1] - direction[1] * to[0])
    if off > radius + 1e-6:
        raise ValueError(f"the corner circle misses the {name} by {off - radius:.6g} mm")
    return origin + (along + side * np.sqrt(max(radius * radius - off * off, 0.0)) * (off < radius - 1e-6)) * direction


def tangent_corner(d, r, alpha, beta):
    """(e, f): center of the circle of radius r that touches both lines of `apt_profile`.

    >>> tangent_corner(10.0, 2.0, 0.0, 0.0)
    (3.0, 2.0)
    """
    lines = np.array([[-fixed.sin(alpha), fixed.cos(alpha)], [fixed.cos(beta), -fixed.sin(beta)]])
    reach = d / 2 * (fixed.cos(beta) - fixed.tan(alpha) * fixed.sin(beta)) - r
    e, f = fixed.solve(lines, [r, reach])
    return float(e), float(f)


def side_profile(d, corner_radius, h):
    """Outline of a circular side cutter with radiused teeth: a disc, both of its rims rounded; mm.

    Raises:
        ValueError: the rims do not fit into its width.
    """
    if not 0 < 2 * corner_radius <= h + SAME_MM or not corner_radius < d / 2:
        raise ValueError("a side-and-face cutter has 0 < 2 corner_radius_mm <= flute_length_mm, its width, and "
                         "corner_radius_mm < diameter_mm/2")
    e, rim = d / 2 - corner_radius, d / 2
    low, high = corner_radius, max(h - corner_radius, corner_radius)
    return chain((np.zeros(2), (e, 0.0), None), ((e, 0.0), (rim, low), (e, low)), ((rim, low), (rim, high), None),
                 ((rim, high), (e, high + corner_radius), (e, high)))


def lens_profile(d, tip_radius, corner_radius, h):
    """Outline of a lens cutter: a large tip radius, rounded into the side by a small one; mm.

    Raises:
        ValueError: the two arcs cannot join.
    """
    if not 0 < corner_radius < d / 2 < tip_radius:
        raise ValueError("a lens cutter has 0 < corner_radius_mm < diameter_mm/2 < tip_radius_mm")
    e = d / 2 - corner_radius
    f = tip_radius - np.sqrt((tip_radius - corner_radius) ** 2 - e * e)
    join = np.array([0.0, tip_radius]) + tip_radius / (tip_radius - corner_radius) * np.array([e, f - tip_radius])
    if h < f - SAME_MM:
        raise ValueError(f"the corner reaches {f:.6g} mm up, above the height of {h:.6g} mm")
    return chain((np.zeros(2), join, (0.0, tip_radius)), (join, (d / 2, f), (e, f)), ((d / 2, f), (d / 2, h), None))


def point_profile(d, tip_d, point_height, h):
    """Outline of a drill or chamfer mill: a flat of diameter tip_d, 0 for none, a cone up to d, a cylinder; mm."""
    tip, shoulder = (tip_d / 2, 0.0), (d / 2, point_height)
    return chain(((0.0, 0.0), tip, None), (tip, shoulder, None), (shoulder, (d / 2, max(h, point_height)), None))
