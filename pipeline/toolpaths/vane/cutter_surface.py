"""The vane that transverse arcs really cut: the envelope of the ball whose centre sweeps the cutter surface.

The centre runs over c(x, t) = (x, g sin t, h + g cos t), g(x) the arc's radius and h(x) its centre's height, both with
the register in them.  Its unit normal n_c is along (-(g' + h' cos t), sin t, cos t); the ball touches s = c - Rc n_c.
On the flanks n_c is the same all the way down.  Where general and matching section meet, the arcs jump: within a
ball's radius the neighbour may reach lower than the map says.  Where the envelope turns back on itself (the ball is
larger than a hollow of the cutter surface allows) the true cut is deeper than s: those places are marked.

Source: docs/formulas.md 1 (Crandall and Stovall): "s = c - Rc n_c", n_c by differentiating along and across.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.splines.spline_interpolation import interpolated
from cuspline.toolpaths.vane.transverse_arcs import STEEP_SLOPE, arc_steps, center_ranges_mm, contacts_mm, crest_slope
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen

ROUND = 25                  # angles from the crest to the tangency
PROJECTIONS = 6             # each leaves the square of the error before
LEAST_NODES = 8             # of a section's splines: a shorter section gets rows closer than the pitch


@dataclass(frozen=True, eq=False, kw_only=True)
class CutMap:
    """What a ball leaves of a tip, on the side of +y; the other side is its mirror image.

    Columns run from the crest to the tangency, the last is the flank (the same all the way down, taken at its top).
    """

    place_mm: np.ndarray        # (n, k, 3) on the design, under s_actual; the tip's frame
    deviation_mm: np.ndarray    # (n, k) of s_actual along the normal there, positive: left; NaN beyond the tip's ends
    is_folded: np.ndarray       # (n, k) bool: the envelope turns back; more is cut there
    is_matching: np.ndarray     # (n,) bool
    center_x_mm: np.ndarray     # (n,) plane of each row's arc

    def __post_init__(self):
        n, k = self.deviation_mm.shape
        for name, shape, dtype in (("place_mm", (n, k, 3), float), ("deviation_mm", (n, k), float),
                                   ("is_folded", (n, k), bool), ("is_matching", (n,), bool), ("center_x_mm", (n,), float)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))

    def stretches_beyond_mm(self, limit_mm, margin_mm):
        """((first, last), ...): planes whose arcs leave more than the limit anywhere, and a margin; those that meet are one.

        A stretch that holds the first or the last row goes on without end: the map does not say what lies beyond.
        """
        beyond = np.flatnonzero(np.fmax.reduce(self.deviation_mm, axis=1) > limit_mm)
        edges = np.r_[-np.inf, self.center_x_mm[1:-1], np.inf]
        found = []
        for run in np.split(beyond, np.flatnonzero(np.diff(beyond) > 1) + 1) if len(beyond) else ():
            first, last = edges[run[0]] - margin_mm, edges[run[-1]] + margin_mm
            if found and first <= found[-1][1]:
                first = found.pop()[0]
            found.append((float(first), float(last)))
        return tuple(found)


def cut_map(tip, ball_radius_mm, register_mm, pitch_mm):
    """What the passes leave, cusps apart.

    Args:
        tip: CircularTip.   ball_radius_mm: of the tool, and what the data were reckoned for.
        register_mm: tool-radius register.
        pitch_mm: of the rows along the tip, at most; a section (general, matching) that only one of them meets is
            left out.
    Returns:
        CutMap; its rows are exact but for their splines along the tip.
    """
    whole, (low, high) = center_ranges_mm(tip, ball_radius_mm)
    if low >= high:                                 # the tip is shorter than the ball's lean
        low, high = whole
    rows, count = [], max(int(np.ceil((high - low) / pitch_mm)), LEAST_NODES)
    centers = np.linspace(low, high, count + 1)
    steep = np.abs(crest_slope(tip, contacts_mm(tip, ball_radius_mm, centers))) > STEEP_SLOPE
    for part in np.split(np.arange(count + 1), np.flatnonzero(np.diff(steep)) + 1):
        if len(part) > 1:
            nodes = np.linspace(*centers[part[[0, -1]]], LEAST_NODES) if len(part) < LEAST_NODES else centers[part]
            rows.append((*_part(tip, ball_radius_mm, register_mm, nodes), nodes))
    place, deviation, folded, matching, center_x = (np.concatenate(column) for column in zip(*rows))
    return CutMap(place_mm=place, deviation_mm=deviation, is_folded=folded, is_matching=matching, center_x_mm=center_x)


def _part(tip, ball_radius_mm, register_mm, center_x_mm):
    """(places, deviations, folds, matching) of planes that belong to one section."""
    steps = arc_steps(tip, ball_radius_mm, center_x_mm)
    g = interpolated(center_x_mm, steps.radius_mm + steps.swell * register_mm, 3)
    h = interpolated(center_x_mm, steps.c_mm + steps.lift * register_mm, 3)
    turn = np.r_[np.linspace(0.0, tip.half_arc_rad, ROUND), tip.half_arc_rad][None]
    x, sine, cosine = center_x_mm[:, None], fixed.sin(turn), fixed.cos(turn)
    centers = np.stack([x + 0 * turn, g(x) * sine, h(x) + g(x) * cosine], axis=-1)
    normal = np.stack([-(g(x, 1) + h(x, 1) * cosine), sine + 0 * x, cosine + 0 * x], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    places = centers - ball_radius_mm * normal
    folded = np.zeros(turn.shape[1:] + center_x_mm.shape, bool).T
    folded[1:] = (np.diff(places, axis=0) * np.diff(centers, axis=0)).sum(axis=-1) <= 0
    feet, deviation = tip_deviation_mm(tip, places[:, :-1])
    flank_feet, flank = flank_deviation_mm(tip, places[:, -1:])
    places, deviation = np.concatenate([feet, flank_feet], axis=1), np.concatenate([deviation, flank], axis=1)
    low, high = tip.range_mm
    deviation[(places[..., 0] < low) | (places[..., 0] > high)] = np.nan
    return places, deviation, folded, steps.is_matching


def tip_deviation_mm(tip, points_mm):
    """Feet (..., 3) on the tip's arc surface and signed distances (...,) of points (..., 3) near it, positive outside.

    Newton along the gradient of hypot(y, z - z0) - R to the foot, then the distance from the foot.
    """
    def gradient(p):
        arm = p[..., 2] - tip.center_z_mm(p[..., 0])
        out = fixed.hypot(p[..., 1], arm)
        slope = -arm / out * tip.center_slope(p[..., 0]) - tip.radius_slope(p[..., 0])
        return out - tip.radius_mm(p[..., 0]), np.stack([slope, p[..., 1] / out, arm / out], axis=-1)
    return _distance(points_mm, gradient)


def flank_deviation_mm(tip, points_mm):
    """Feet (..., 3) on the flank on the side of +y and signed distances (...,) of points (..., 3), positive outside."""
    cosine, sine = fixed.cos(tip.flank_half_angle_rad), fixed.sin(tip.flank_half_angle_rad)

    def gradient(p):
        y, z = tip.tangency_mm(p[..., 0])
        slope = -(tip.radius_slope(p[..., 0]) + sine * tip.center_slope(p[..., 0]))
        return ((p[..., 1] - y) * cosine + (p[..., 2] - z) * sine,
                np.stack([slope, np.full_like(slope, cosine), np.full_like(slope, sine)], axis=-1))
    return _distance(points_mm, gradient)


def _distance(points_mm, gradient):
    """Foot and signed distance: walks to the foot on the level set 0 and squares the arm up to the normal there."""
    foot = np.array(points_mm, float)
    for _ in range(PROJECTIONS):
        value, slope = gradient(foot)
        square = (slope ** 2).sum(axis=-1)
        normal = slope / np.sqrt(square)[..., None]
        arm = points_mm - foot
        aside = arm - (arm * normal).sum(axis=-1)[..., None] * normal       # slide along the surface under the point
        foot = foot + aside - (value / square)[..., None] * slope
    _, slope = gradient(foot)
    normal = slope / np.linalg.norm(slope, axis=-1, keepdims=True)
    return foot, ((points_mm - foot) * normal).sum(axis=-1)
