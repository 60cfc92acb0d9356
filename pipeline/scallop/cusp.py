"""Cusp and step of any cutter of revolution, its axis inclined or not, from its exact silhouette.

A cutter that runs straight along the feed leaves the silhouette that it shows in that direction.  Where the
silhouettes of two passes cross stands the cusp:

    normal n             \\    /\\    /          the step is the width of the silhouette at the cusp's
      │                   \\__/  \\__/           height above the surface, be it flat, a ridge or a hollow
      └── across o      pass i   pass i+1

The touching point of the silhouette with outward direction u is the cutter's own touching point with u, so
`CutterProfile.support` answers for balls, tori, cones, dovetails and lenses alike.

The axis keeps lead and tilt from pass to pass, as five axes hold them.  In three axes the tilt turns by the angle
between two neighbouring normals: with one value for both passes the step is off by that share, never for a ball.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.amounts import counted
from cuspline.values.errors import CutterDoesNotFit, PlanError

BISECTIONS, SECANTS = 46, 40
FACET_RAD = 1e-7            # half the turn over which the touching point's middle is looked for
FIT_TURNS = np.geomspace(1e-4, np.pi / 2, 40)
FIT_SHARE = 1e-9            # of the cutter's diameter, that rounding may press it into a hollow


@dataclass(frozen=True, kw_only=True)
class Stance:
    """How the axis stands to the surface: unit, tip to holder, in (feed, across, normal)."""

    lead_rad: float = 0.0       # inclined along the feed
    tilt_rad: float = 0.0       # inclined across it, toward +across

    @property
    def axis(self):
        return np.array([fixed.sin(self.lead_rad) * fixed.cos(self.tilt_rad), fixed.sin(self.tilt_rad),
                         fixed.cos(self.lead_rad) * fixed.cos(self.tilt_rad)])


def stance_of(axis, normal, feed):
    """The Stance of an axis over a surface.

    Args:
        axis, normal: (3,) unit.
        feed: (3,) direction of the pass, unit, at right angles to the normal; across = normal x feed.
    """
    across = np.cross(normal, feed)
    return Stance(lead_rad=float(fixed.arctan2(fixed.matmul(axis, feed), fixed.matmul(axis, normal))),
                  tilt_rad=float(fixed.arcsin(np.clip(fixed.matmul(axis, across), -1, 1))))


def cutter_stepover_mm(profile, scallop_mm, curvature_per_mm, stance=Stance()):
    """Widest stepover at which a cutter leaves cusps of the given height.

    Args:
        profile: cutter_profile.CutterProfile.
        scallop_mm: height wanted, scalar > 0.
        curvature_per_mm: scalar or (n,) normal curvature across the feed; positive on a ridge, negative in a hollow.
        stance: Stance.
    Returns:
        (n,) chord between neighbouring contact points; at most the cutter's whole width.
    Raises:
        CutterDoesNotFit: the silhouette is flatter than a hollow; `.rows` lists where.
    Source: docs/formulas.md 5; checked against the envelope of two passes found by brute force.

    >>> from cuspline.shop.cutter_profile import apt_profile
    >>> cutter_stepover_mm(apt_profile(6, 3, 0, 3, 0, 0, 10), 0.01, [0.0, 0.1, -0.1]).round(3)     # ball of radius 3
    array([0.489, 0.429, 0.585])
    """
    k = np.atleast_1d(np.asarray(curvature_per_mm, float))
    shown = _silhouette(profile, stance)
    _refuse_tight_hollows(shown, k)
    right, left = (_reach_along_surface(shown, np.full(len(k), scallop_mm), k, side) for side in (1, -1))
    width = right - left
    return _chord_mm(width, k)


def _chord_mm(along_mm, k):
    """Chord of an arc of curvature k: sin(k s / 2) / (k / 2); s where it is straight."""
    half = k * along_mm / 2
    return along_mm * np.where(half == 0.0, 1.0, fixed.sin(half) / np.where(half == 0.0, 1.0, half))


def cutter_scallop_mm(profile, stepover_mm, curvature_per_mm, stance=Stance()):
    """Cusp height at a given stepover: the inverse of `cutter_stepover_mm`.

    Args:
        stepover_mm: chord between neighbouring contact points, scalar > 0.
    Raises:
        CutterDoesNotFit: as there.  PlanError: the passes lie farther apart than the cutter is wide.
    """
    k = np.atleast_1d(np.asarray(curvature_per_mm, float))
    shown = _silhouette(profile, stance)
    _refuse_tight_hollows(shown, k)
    highest = np.minimum(*(_heights(shown.points(np.full(len(k), side)), k) for side in (np.pi / 2, -np.pi / 2)))

    def too_wide_mm(root):      # the step grows with the cusp's root
        width = np.subtract(*(_reach_along_surface(shown, root * root, k, side) for side in (1, -1)))
        return _chord_mm(width, k) - stepover_mm

    low, high = np.zeros(len(k)), np.sqrt(highest)
    short, wide = np.full(len(k), -stepover_mm), too_wide_mm(high)
    if (wide < -1e-12 * stepover_mm).any():
        raise PlanError(f"passes {stepover_mm:.4g} mm apart leave material standing between them: this cutter's "
                        f"silhouette is {(wide + stepover_mm).min():.4g} mm wide there")
    for _ in range(SECANTS):        # Illinois: a secant whose standing end is halved
        root = high - wide * (high - low) / np.where(wide > short, wide - short, 1.0)
        off = too_wide_mm(root)
        low, short, high, wide = (np.where(off < 0, root, low), np.where(off < 0, off, short / 2),
                                  np.where(off < 0, high, root), np.where(off < 0, wide / 2, off))
        if (np.abs(off) <= 1e-13 * stepover_mm).all():
            break
    return root * root


def effective_radius_mm(radius_mm, corner_radius_mm, lead_rad):
    """Radius across the feed of a toroidal cutter inclined along it: its silhouette's at the contact.

    >>> float(effective_radius_mm(10.0, 2.0, np.radians(30)).round(9)), effective_radius_mm(10.0, 2.0, 0.0)
    (18.0, inf)
    """
    sine = abs(fixed.sin(lead_rad))
    return corner_radius_mm + (radius_mm - corner_radius_mm) / sine if sine > 0 else np.inf


def wedge_scallop_mm(stepover_mm, left_rad, right_rad):
    """Triangular cusp on a flat of a cutter that touches with a sharp edge.

    Args:
        left_rad, right_rad: angles from the surface to the two flanks of the edge.  A flat end mill whose axis leans
            t across the feed: t and pi/2 - t.  A dovetail of that lean: t and pi/2 - t + its taper.

    >>> round(wedge_scallop_mm(1.0, np.radians(30), np.radians(60)), 6)         # sin 30 cos 30
    0.433013
    """
    return float(stepover_mm * fixed.sin(left_rad) * fixed.sin(right_rad) / fixed.sin(left_rad + right_rad))


def wedge_stepover_mm(scallop_mm, left_rad, right_rad):
    """Stepover at which a sharp edge leaves triangular cusps of the given height."""
    return float(scallop_mm * fixed.sin(left_rad + right_rad) / (fixed.sin(left_rad) * fixed.sin(right_rad)))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Silhouette:
    """What a cutter shows along the feed, seen from its contact point."""

    profile: object
    stance: Stance
    contact_mm: np.ndarray      # (2,) across, normal

    def points(self, turn_rad):
        """(m, 2) touching points (across, normal) of planes: 0 presses from below, +pi/2 from +across."""
        return _projected(self.profile, self.stance, turn_rad)[0] - self.contact_mm


def _silhouette(profile, stance):
    """The silhouette; the contact is the middle of what lies lowest."""
    points, _ = _projected(profile, stance, np.array([-FACET_RAD, FACET_RAD]))
    _, far = _projected(profile, stance, np.zeros(1))
    return _Silhouette(profile=profile, stance=stance, contact_mm=np.array([points[:, 0].mean(), -far[0]]))


def _projected(profile, stance, turn):
    """Touching points (m, 2) in across and normal, and the planes' distances (m,) from the tip.

    With the axis' part in the plane, m long at the angle lean from the normal, a plane's own angle to it is
    turn + lean; sines and cosines of that keep their digits where the plane is nearly square to the axis.
    """
    along, across, up = stance.axis
    m, lean = fixed.hypot(across, up), fixed.arctan2(across, up)
    sine, cosine = fixed.sin(turn + lean), fixed.cos(turn + lean)
    square = fixed.hypot(along, m * sine)
    far, point = profile.support(fixed.arctan2(square, -m * cosine))
    r = point[:, 0] / np.maximum(square, 1e-300)
    on_axis, beside = point[:, 1] * m - r * cosine * along ** 2, r * sine
    return np.column_stack([on_axis * fixed.sin(lean) + beside * fixed.cos(lean),
                            on_axis * fixed.cos(lean) - beside * fixed.sin(lean)]), far


def _heights(points, k):
    """(n,) height of points over a surface of curvature k, in a form that keeps its digits on flats."""
    o, n = points.T
    root = np.sqrt(np.maximum(1 + 2 * k * n + k * k * (o * o + n * n), 0.0))
    return (2 * n + k * (o * o + n * n)) / (root + 1)


def _reach_along_surface(silhouette, height, k, side):
    """(n,) arc along the surface from the contact to below where the silhouette has the height; signed."""
    low, high = np.zeros(len(k)), np.full(len(k), np.pi / 2)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        above = _heights(silhouette.points(side * middle), k) >= height
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    # a flat facet or an edge: all of it has one direction, the height lies somewhere along it
    start, end = (silhouette.points(side * turn) for turn in (low, high))
    low, high = np.zeros(len(k)), np.ones(len(k))
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        above = _heights(start + middle[:, None] * (end - start), k) >= height
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    o, n = (start + high[:, None] * (end - start)).T
    bend = np.maximum(np.abs(k), 1e-12)
    return fixed.arctan2(bend * o, 1 + k * n) / bend


def _refuse_tight_hollows(silhouette, k):
    turns = np.concatenate([-FIT_TURNS, FIT_TURNS])
    points = silhouette.points(turns)
    heights = _heights(np.repeat(points, len(k), axis=0), np.tile(k, len(turns))).reshape(len(turns), len(k))
    tight = np.flatnonzero((k < 0) & (heights.min(axis=0) < -FIT_SHARE * 2 * silhouette.profile.largest_radius_mm))
    if len(tight):
        raise CutterDoesNotFit(
            f"{counted(len(tight), 'point')} on surface that is concave across the feed (radius {-1 / k[tight].min():.3f} mm "
            "and up), which this cutter's silhouette does not fit; choose a smaller one or incline it more along "
            "the feed", rows=tight)
