r"""Passes over a vane tip as a controller lays them: an arc in each transverse plane, flanks to either side.

    z ▲        .-'''-.   centre of the ball: arc of radius |T - C| + r about C, a step apart in x
      │      .'  ___  '.
      │     /  /  ·C \  \    T = (Y, Z)   tangency of the finished section
      │    /  T       T  \   r            the tool-radius register: the controller adds it
      │   |  /         \  |
      │  /  /___________\  \ A            half width of the body, where the flanks end
      └──────────────────────► y

A step is at a constant interval in the CENTRE's x; the contacts under it in the mid-plane and on the FLANK are found by
iteration, and the arc is the one that meets the true offset at the crest and along the flanks: exact there, and nearly
so between (cutter_surface.py says by how much).  At the vane's ends the ball rolls over the end's edge until it has
passed the last contact of crest and flanks.

Where the tip runs steeply (the radial matching section) the register would act along z, not along the normal.  There a
step has two numbers more, swell and lift: radius |T - C| + r swell, centre C + r lift, so that crest and flanks follow
the offset for any register, to first order:

    swell + lift = sqrt(1 + s²),   swell + lift sin α = sqrt(1 + s² sin² α)   s the slope, α the flanks' angle

Source: docs/formulas.md 1 (Crandall and Stovall, whose arc is the section at the contact, lowered); that it meets the flanks
too is ours, from the support function of the offset's section.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.scallop.stepover import stepover_for_scallop_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import CutterDoesNotFit
from cuspline.values.roots import rising_roots

STEEP_SLOPE = 0.3           # steeper is matching section: the register would be 4 % short along the normal
BRACKET_SAMPLES = 20_001    # of the tip line: a bracket for every contact, and the check that the ball fits
LOOKS_ROUND = 7             # angles round the arc at which the step is chosen
LEAST_SPREAD = 0.02         # of centres against contacts, where a valley is nearly as tight as the ball: a step > 0


@dataclass(frozen=True, eq=False, kw_only=True)
class ArcSteps:
    """One row a transverse plane; the tip's frame, mm."""

    center_x_mm: np.ndarray     # (n,) the ball's centre
    contact_x_mm: np.ndarray    # (n,) where it touches the crest
    y_mm: np.ndarray            # (n,) Y, tangency of arc and flank
    z_mm: np.ndarray            # (n,) Z
    c_mm: np.ndarray            # (n,) C, height of the arc's centre
    swell: np.ndarray           # (n,) register's share in the arc's radius; 1 in the general section
    lift: np.ndarray            # (n,) register's share in the centre's height; 0 in the general section
    is_matching: np.ndarray     # (n,) bool: steep

    def __post_init__(self):
        n = len(self.center_x_mm)
        for name in ("center_x_mm", "contact_x_mm", "y_mm", "z_mm", "c_mm", "swell", "lift"):
            object.__setattr__(self, name, frozen(getattr(self, name), (n,), name))
        object.__setattr__(self, "is_matching", frozen(self.is_matching, (n,), "is_matching", bool))

    def __len__(self):
        return len(self.center_x_mm)

    @property
    def radius_mm(self):
        """(n,) |T - C|: of the arc before the register is added."""
        return fixed.hypot(self.y_mm, self.z_mm - self.c_mm)

    def centers_mm(self, register_mm, turn_rad):
        """(n, k, 3) centres of the ball on the arc, at angles (k,) or (n, k) from the crest toward +y."""
        turn = np.broadcast_to(turn_rad, (len(self), np.shape(turn_rad)[-1]))
        radius = (self.radius_mm + self.swell * register_mm)[:, None]
        height = (self.c_mm + self.lift * register_mm)[:, None]
        x = np.broadcast_to(self.center_x_mm[:, None], turn.shape)
        return np.stack([x, radius * fixed.sin(turn), height + radius * fixed.cos(turn)], axis=-1)


def crest_slope(tip, x_mm):
    """(n,) slope of the tip line."""
    return tip.center_slope(x_mm) + tip.radius_slope(x_mm)


def crest_bend_per_mm(tip, x_mm):
    """(n,) second derivative of the tip line."""
    return tip.center_bend_per_mm(x_mm) + tip.radius_bend_per_mm(x_mm)


@dataclass(frozen=True, kw_only=True)
class _Line:
    """A line along the tip that a ball rolls on: crest, or flank seen along its own normal in the transverse plane."""

    slope: object               # function x -> rise over run
    bend: object                # its derivative
    square: float               # of the normal's part in the transverse plane, before scaling: n_x = -slope / root

    def center_x_mm(self, ball_radius_mm, x_mm):
        slope = self.slope(x_mm)
        return x_mm - ball_radius_mm * slope / np.sqrt(self.square + slope ** 2)

    def turning_per_mm(self, x_mm):
        """-dn_x/dx: one over the radius of a valley in the plane of the normal."""
        return self.bend(x_mm) * self.square / fixed.power(self.square + self.slope(x_mm) ** 2, 1.5)


def _crest(tip):
    return _Line(slope=lambda x: crest_slope(tip, x), bend=lambda x: crest_bend_per_mm(tip, x), square=1.0)


def _flank(tip):
    sine, cosine = fixed.sin(tip.flank_half_angle_rad), fixed.cos(tip.flank_half_angle_rad)
    return _Line(slope=lambda x: (tip.radius_slope(x) + sine * tip.center_slope(x)) / cosine,
                 bend=lambda x: (tip.radius_bend_per_mm(x) + sine * tip.center_bend_per_mm(x)) / cosine,
                 square=1.0 / cosine ** 2)


def center_x_of_contact_mm(tip, ball_radius_mm, x_mm):
    """(n,) x of the ball's centre while it touches the crest at x: x + Rc n_x."""
    return _crest(tip).center_x_mm(ball_radius_mm, x_mm)


def center_ranges_mm(tip, ball_radius_mm, within_mm=None):
    """x of the ball's centre, (first, last) twice: to cut crest and flanks from end to end; while it touches both.

    `within_mm`: (first, last) x of what is cut; None: the whole tip.
    """
    within = np.array(within_mm or tip.range_mm)
    ends = np.array([line.center_x_mm(ball_radius_mm, within) for line in (_crest(tip), _flank(tip))])
    first, last = ends.T.tolist()
    return (min(first), max(last)), (max(first), min(last))


def contacts_mm(tip, ball_radius_mm, center_x_mm):
    """Where the ball touches the crest while its centre stands at x: safeguarded Newton in the mid-plane.

    Args:
        tip: CircularTip.
        ball_radius_mm: Rc > 0.
        center_x_mm: (n,); centres beyond those over the tip's ends count as over the ends.
    Returns:
        (n,) xs with xs + Rc n_x(xs) = xc.
    Raises:
        CutterDoesNotFit: a valley of the tip line is tighter than the ball: the map from xs to xc turns back there.
    Source: docs/formulas.md 1.
    """
    return _contacts_mm(_crest(tip), "the tip line", tip.range_mm, ball_radius_mm, center_x_mm)


def _contacts_mm(line, name, range_mm, ball_radius_mm, center_x_mm):
    target, table = np.asarray(center_x_mm, float), np.linspace(*range_mm, BRACKET_SAMPLES)
    _refuse_tight_valley(line, name, ball_radius_mm, table)
    centers = line.center_x_mm(ball_radius_mm, table)
    target = np.clip(target, centers[0], centers[-1])
    after = np.clip(np.searchsorted(centers, target), 1, len(table) - 1)
    return rising_roots(lambda x: line.center_x_mm(ball_radius_mm, x) - target,
                        lambda x: 1.0 - ball_radius_mm * line.turning_per_mm(x), table[after - 1], table[after])


def _refuse_tight_valley(line, name, ball_radius_mm, x):
    turning = line.turning_per_mm(x)
    worst = int(turning.argmax())
    if turning[worst] * ball_radius_mm >= 1.0:
        raise CutterDoesNotFit(
            f"transverse arcs: ball radius {ball_radius_mm:.3f} mm, but the valley of {name} at x = {x[worst]:.3f} mm "
            f"has a radius of {1 / turning[worst]:.3f} mm; choose a smaller ball",
            rows=np.flatnonzero(turning * ball_radius_mm >= 1.0))


def arc_steps(tip, ball_radius_mm, center_x_mm):
    """The controller's numbers at each transverse plane.

    Args:
        tip: CircularTip.   ball_radius_mm: Rc, which the mid-plane is exact for.
        center_x_mm: (n,) planes.
    Returns:
        ArcSteps.
    Raises:
        CutterDoesNotFit: see `contacts_mm`.
    """
    xs = contacts_mm(tip, ball_radius_mm, center_x_mm)
    steep, angle = np.abs(crest_slope(tip, xs)) > STEEP_SLOPE, tip.flank_half_angle_rad
    secant = _secant(ball_radius_mm, center_x_mm - xs)
    ball_z = tip.crest_z_mm(xs) + ball_radius_mm / secant           # over the crest, exactly
    reach, flank = _beside_the_flank(tip, ball_radius_mm, np.asarray(center_x_mm, float))
    g = (reach - ball_z * fixed.sin(angle)) / (1.0 - fixed.sin(angle))    # the arc that meets both
    lift = np.where(steep, (secant - flank) / (1.0 - fixed.sin(angle)), 0.0)
    swell = np.where(steep, secant - lift, 1.0)
    radius, c = g - ball_radius_mm * swell, ball_z - g - ball_radius_mm * lift
    return ArcSteps(center_x_mm=center_x_mm, contact_x_mm=xs, y_mm=radius * fixed.cos(angle),
                    z_mm=c + radius * fixed.sin(angle), c_mm=c, swell=swell, lift=lift, is_matching=steep)


def _beside_the_flank(tip, ball_radius_mm, center_x_mm):
    """How far out the ball's centre stands square to the flank, (n,), and 1 over its normal's part in the plane."""
    line, sine, cosine = _flank(tip), fixed.sin(tip.flank_half_angle_rad), fixed.cos(tip.flank_half_angle_rad)
    xf = _contacts_mm(line, "the flanks", tip.range_mm, ball_radius_mm, center_x_mm)
    flank = _secant(ball_radius_mm, center_x_mm - xf)
    y, z = tip.tangency_mm(xf)
    return y * cosine + z * sine + ball_radius_mm / flank, flank


def _secant(ball_radius_mm, ahead_mm):
    """(n,) 1 over the part of the contact's normal in the plane, by how far the centre stands ahead of the contact."""
    return 1.0 / np.sqrt(1.0 - (ahead_mm / ball_radius_mm) ** 2)


def widest_interval_mm(tip, ball_radius_mm, ridge_mm, x_mm):
    """(n,) interval in the centre's x at which neighbouring arcs leave ridges of the given height round contacts x.

    Looked at round the arc: the crest is not always the worst place, for on the arc's sides the surface runs less
    steeply but no flatter.

    Source: docs/formulas.md 5; contacts a chord apart along the surface lie chord · cos(slope) apart in x, centres
    1 + Rc κ times that.
    """
    turns = np.linspace(0.0, tip.half_arc_rad, LOOKS_ROUND)
    slope, bend = crest_slope(tip, x_mm)[:, None] * fixed.cos(turns), crest_bend_per_mm(tip, x_mm)[:, None] * fixed.cos(turns)
    ridge = -bend / fixed.power(1.0 + slope ** 2, 1.5)
    tightest = -(1.0 - LEAST_SPREAD) / ball_radius_mm
    chord = stepover_for_scallop_mm(ball_radius_mm, ridge_mm, np.maximum(ridge, tightest).ravel())
    spread = np.minimum(1.0 + ball_radius_mm * ridge, 1.0)
    return (chord.reshape(ridge.shape) / np.sqrt(1.0 + slope ** 2) * np.maximum(spread, LEAST_SPREAD)).min(axis=1)


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Planes at one interval; the last one may stand closer to the one before."""

    first_mm: float
    interval_mm: float
    planes: tuple[float, ...]


def stretches(tip, ball_radius_mm, ridge_mm, resolution_mm, within_mm=None):
    """Stretches of constant interval from end to end of the tip: matching sections finer than the general one.

    Args:
        ridge_mm: highest ridge between neighbouring arcs.
        resolution_mm: intervals are whole multiples of it, so that a controller that counts makes no error.
        within_mm: (first, last) x of what is cut; None: the whole tip.
    Returns:
        tuple of Stretch, in x.
    """
    x = np.linspace(*(within_mm or tip.range_mm), BRACKET_SAMPLES)
    _refuse_tight_valley(_crest(tip), "the tip line", ball_radius_mm, x)
    allowed = widest_interval_mm(tip, ball_radius_mm, ridge_mm, x)
    center, ends = center_x_of_contact_mm(tip, ball_radius_mm, x), center_ranges_mm(tip, ball_radius_mm, within_mm)[0]
    bounds = [0, *(np.flatnonzero(np.diff(np.abs(crest_slope(tip, x)) > STEEP_SLOPE)) + 1), len(x) - 1]
    made, start = [], _on_grid(ends[0], resolution_mm)
    for a, b in zip(bounds[:-1], bounds[1:]):
        is_last = b == len(x) - 1
        end = ends[1] if is_last else float(center[b])
        interval = max(np.floor(allowed[a:b + 1].min() / resolution_mm), 1.0) * resolution_mm
        count = max(int(np.ceil((end - start) / interval - 1e-9)), 1)
        planes = start + interval * np.arange(count)
        made.append(Stretch(first_mm=start, interval_mm=interval, planes=tuple(planes.tolist())))
        start = end if is_last else _on_grid(planes[-1] + interval, resolution_mm)
    return (*made, Stretch(first_mm=start, interval_mm=made[-1].interval_mm, planes=(start,)))


def _on_grid(value, resolution_mm):
    return float(np.ceil(value / resolution_mm - 1e-9) * resolution_mm)
