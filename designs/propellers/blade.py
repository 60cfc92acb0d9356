r"""The blade: radial laws through a table, sections wrapped on cylinders, one exact surface round the whole loop.

Frame: X along the shaft, downstream; Z along the generator line of blade 1; propeller centre at 0.

    phi = atan(P / (2 pi r))      pitch angle of the nose-tail line
    X     = rake + r skew tan(phi) + xi sin(phi) - n cos(phi)       the back looks upstream
    Theta = skew + (xi cos(phi) + n sin(phi)) / r                   grows towards the trailing edge
    Y, Z  = -+ r sin(Theta), r cos(Theta)                           upper sign: right-handed

xi = (x/c - 1/2) c from the middle of the chord towards the trailing edge, n the section's ordinate towards the back.
Skew is positive towards the trailing edge, rake downstream; r skew tan(phi) is the rake that skew brings with it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from cuspline.designs.propellers.sections import TrailingEdge, loop_angle, section_loop, stations
from cuspline.splines.closed_splines import periodic_spline
from cuspline.splines.fairing import fair_spline
from cuspline.splines.nurbs import NurbsSurface
from cuspline.splines.spline_interpolation import interpolated
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

DEGREE = 5
NOSE, TAIL = 0.30, 0.26         # loop angle on either side of an edge that counts as that edge
FINEST, WIDEST, GROWTH = 0.008, 0.09, 1.2       # spacing of the loop's knots, from the edges inward
SPANS = 44                      # of the blade's surface from below the hub to the tip
FIT_MM = 7e-4                   # how far the surface may be from the laws, up to FIT_SIZE_MM across; above, in
FIT_SIZE_MM, FIT_MOST = 304.8, 2.0      # proportion to the size, but no more than so many times
REFINEMENTS = (1.0, 1.5, 2.25, 3.4)
EDGE_SHARE = 0.02               # of the chord: what counts as an edge in words
TIP_SHARE = 0.02                # of the radius: what counts as the tip
CLOSED = 1e-9                   # chord / diameter below which the tip has none


@dataclass(frozen=True, eq=False, kw_only=True)
class PropellerTable:
    """What a propeller designer gives; columns over the radius, r/R rising, the last 1."""

    name: str
    blades: int
    diameter_mm: float
    is_right_handed: bool
    r_R: np.ndarray             # (n,)
    chord_D: np.ndarray         # (n,) of the diameter; 0 at the last radius: the tip is rounded off
    pitch_D: np.ndarray
    skew_rad: np.ndarray        # NaN at a tip without chord: goes on as it comes
    rake_D: np.ndarray
    thickness_D: np.ndarray
    camber_c: np.ndarray        # of the chord
    shape: object               # FormAndMeanLine or OffsetShapes
    edge: TrailingEdge

    def __post_init__(self):
        if self.r_R[-1] != 1.0 or (np.diff(self.r_R) <= 0).any():
            raise DesignError(f"propeller {self.name}: radii r/R must rise and end at 1, they are {self.r_R.tolist()}")
        for name in ("chord_D", "pitch_D", "thickness_D"):
            low = getattr(self, name)[:-1] <= 0
            if low.any() or len(getattr(self, name)) != len(self.r_R):
                raise DesignError(f"propeller {self.name}: {name} must be positive at every radius inside the tip, it "
                                  f"is not at r/R {self.r_R[:-1][low].tolist()}")
        if self.blades < 3 or self.diameter_mm <= 0:
            raise DesignError(f"propeller {self.name}: {self.blades} blades, diameter {self.diameter_mm:g} mm: "
                              "it needs at least 3 blades and a positive diameter")

    @property
    def radius_mm(self):
        return self.diameter_mm / 2

    @property
    def hand(self):
        """Sign of Y over sin(Theta): -1 right-handed, +1 left-handed (formula above)."""
        return -1.0 if self.is_right_handed else 1.0

    @property
    def has_round_tip(self):
        return self.chord_D[-1] < CLOSED


@dataclass(frozen=True, eq=False, kw_only=True)
class RadialLaws:
    """Fair laws over r/R through the table's values; lengths in mm.

    At a tip without chord the outline is round: with w = sqrt(1 - r/R), chord = w C, thickness = w T and
    camber / chord = w G, so that camber falls with chord squared and the face keeps a finite hollow.
    """

    table: PropellerTable
    chord: BSpline              # C, of the diameter
    thickness: BSpline          # T, of the diameter
    camber: BSpline             # G, of the chord
    pitch: BSpline
    skew: BSpline
    rake: BSpline

    def taper(self, rho):
        """w, or 1 where the tip has a chord."""
        return np.sqrt(np.maximum(1 - rho, 0.0)) if self.table.has_round_tip else np.ones_like(rho)

    def chord_mm(self, rho):
        return self.table.diameter_mm * self.taper(rho) * self.chord(rho)

    def thickness_share(self, rho):
        """Greatest thickness over chord."""
        return self.thickness(rho) / self.chord(rho)

    def camber_share(self, rho):
        """Greatest camber over chord."""
        return self.taper(rho) * self.camber(rho)

    def pitch_mm(self, rho):
        return self.table.diameter_mm * self.pitch(rho)


def radial_laws(table, innermost):
    """RadialLaws of a table, going on smoothly down to the radius `innermost`, r/R."""
    r, domain = table.r_R, (min(innermost, table.r_R[0]), 1.0)
    inside = r < 1 if table.has_round_tip else np.ones(len(r), bool)
    taper = np.sqrt(1 - r[inside]) if table.has_round_tip else np.ones(len(r))

    def law(values, known, divisor=1.0):
        known = known & np.isfinite(values)
        return fair_spline(r[known], values[known] / (divisor if np.ndim(divisor) == 0 else divisor[known[inside]]),
                           domain=domain)

    everywhere = np.ones(len(r), bool)
    return RadialLaws(table=table, chord=law(table.chord_D, inside, taper),
                      thickness=law(table.thickness_D, inside, taper), camber=law(table.camber_c, inside, taper),
                      pitch=law(table.pitch_D, everywhere), skew=law(table.skew_rad, everywhere),
                      rake=law(table.rake_D, everywhere))


@dataclass(frozen=True, eq=False, kw_only=True)
class Blade:
    """Blade 1 of a propeller: its definition, and the surface that holds it.

    The surface runs over u, the loop angle, from TAIL - pi to TAIL + pi, and v from 0 at the innermost
    radius to 1 at the tip.
    """

    laws: RadialLaws
    innermost: float            # r/R at v = 0
    surface: NurbsSurface
    fit_error_mm: float         # measured between the interpolated places

    @property
    def table(self):
        return self.laws.table

    @property
    def outward(self):
        """+1 where Su x Sv points out of the material (right-handed), -1 where into it."""
        return -self.table.hand

    @property
    def v_of_tip(self):
        """Parameter v above which a round tip has faces of its own; 1 where the tip has a chord."""
        return float(self.v_at(1 - TIP_SHARE)) if self.table.has_round_tip else 1.0

    def rho_at(self, v):
        """r/R at the parameter v."""
        return rho_at(v, self.innermost, self.table.has_round_tip)

    def v_at(self, rho):
        """Parameter v of radii r/R."""
        share = (1 - np.asarray(rho, float)) / (1 - self.innermost)
        return 1 - (np.sqrt(share) if self.table.has_round_tip else share)

    def points_mm(self, sigma, rho):
        return blade_points_mm(self.laws, sigma, rho)

    @property
    def columns(self):
        """Where the faces of the loop begin and end: ((name, first u, last u), ...)."""
        return (("face", TAIL - np.pi, -NOSE), ("leading edge", -NOSE, NOSE), ("back", NOSE, np.pi - TAIL),
                ("trailing edge", np.pi - TAIL, np.pi + TAIL))


def blade_points_mm(laws, sigma, rho):
    """(n, 3) points of the blade's definition at loop angles and radii r/R, (n,) each."""
    table = laws.table
    chord, r = laws.chord_mm(rho), table.radius_mm * rho
    s, n = section_loop(table.shape, table.edge, sigma, rho, laws.thickness_share(rho), laws.camber_share(rho))
    return wrapped(table, r, laws.pitch_mm(rho), laws.skew(rho), table.diameter_mm * laws.rake(rho),
                   (s - 0.5) * chord, n * chord)


def wrapped(table, r_mm, pitch_mm, skew_rad, rake_mm, xi_mm, n_mm):
    """(n, 3) places of section points on cylinders (formula above)."""
    phi = fixed.arctan2(pitch_mm, 2 * np.pi * r_mm)
    x = rake_mm + skew_rad * pitch_mm / (2 * np.pi) + xi_mm * fixed.sin(phi) - n_mm * fixed.cos(phi)
    turn = skew_rad + (xi_mm * fixed.cos(phi) + n_mm * fixed.sin(phi)) / r_mm
    return np.stack([x, table.hand * r_mm * fixed.sin(turn), r_mm * fixed.cos(turn)], axis=-1)


def about_x(turn_rad):
    """(3, 3) rotation about X, from Y towards Z: rows are turned by `points @ about_x(turn).T`."""
    return np.array([[1, 0, 0], [0, fixed.cos(turn_rad), -fixed.sin(turn_rad)], [0, fixed.sin(turn_rad), fixed.cos(turn_rad)]])


def rho_at(v, innermost, has_round_tip):
    """r/R at v; a round tip is approached with a level tangent."""
    return 1 - (1 - innermost) * ((1 - v) ** 2 if has_round_tip else 1 - v)


def blade_of(table, innermost):
    """Blade of a table from the radius `innermost` outward.

    Raises:
        DesignError: the laws run to nothing, or the surface does not close in on them.
    """
    laws = radial_laws(table, innermost)
    _refuse_bad_laws(laws, innermost)
    allowed = FIT_MM * min(max(1.0, table.diameter_mm / FIT_SIZE_MM), FIT_MOST)
    for refinement in REFINEMENTS:
        surface = _interpolated(laws, innermost, refinement)
        error, u, v = _fit_error_mm(laws, innermost, surface)
        if error < allowed:
            return Blade(laws=laws, innermost=innermost, surface=surface, fit_error_mm=error)
    where = _misfit_in_words(laws, u, rho_at(v, innermost, table.has_round_tip))
    raise DesignError(f"propeller {table.name}: the blade's surface stays {error:.5f} mm off its definition, "
                      f"{allowed:.5f} mm are allowed, {where}")


def _misfit_in_words(laws, u, rho):
    """Where the surface does not close in on its definition, how thin the blade is there, and what mends it."""
    table, at = laws.table, np.array([rho])
    chord, thick = float(laws.chord_mm(at)[0]), float((laws.thickness_share(at) * laws.chord_mm(at))[0])
    x = float(stations(np.array([u]), table.edge)[0][0])
    near = table.r_R[np.argmin(np.abs(table.r_R - rho))]
    place = f"at r/R = {rho:.3f}, {100 * x:.2f} % of the chord"
    size = f"the section there is {thick:.3f} mm thick on a chord of {chord:.2f} mm"
    bevel = table.edge.bevel_chord_share if table.edge.kind == "anti-singing" else 0.0
    if EDGE_SHARE < 1 - x < 2 * bevel:
        return (f"{place}: {size}, and the anti-singing bevel bends off it too sharply; lengthen it "
                f"(bevel_chord_share, now {bevel:g}) or let it leave more (bevel_leaves, now {table.edge.bevel_leaves:g})")
    if min(x, 1 - x) < EDGE_SHARE:
        share = table.edge.thickness_share
        own = "as the section table has it" if share is None else f"now {share:g}"
        what, mend = (("trailing", f"raise trailing_edge_share ({own})") if x > 0.5 else
                      ("leading", "raise the edges' thickness (edge_share, or the section table's first stations)"))
        return (f"{place}: {size}, and its {what} edge is too thin for it; {mend}, or the thickness near "
                f"r/R = {near:g} (t0 in the table, thickness_scale)")
    return (f"{place}: {size}, and the table's columns change too sharply near r/R = {near:g}; smooth them there, "
            "or give more radii")


def _refuse_bad_laws(laws, innermost):
    rho = np.linspace(innermost, 1.0, 200)
    for name, values in (("chord", laws.chord(rho)), ("thickness", laws.thickness(rho)), ("pitch", laws.pitch(rho))):
        if (values <= 0).any():
            raise DesignError(f"propeller {laws.table.name}: the {name} law through the table runs to nothing at r/R = "
                              f"{rho[np.argmax(values <= 0)]:.3f}; give radii there")


def loop_angles(shape, edge, refinement):
    """Rising loop angles of the knots, one turn: those of the section's own laws, finer towards the edges, and the
    ends of the columns."""
    half = np.pi / 2
    steps = np.cumsum(np.minimum(FINEST * np.cumprod(np.r_[1.0, np.full(199, GROWTH)]), WIDEST) / refinement)
    steps = np.r_[steps[steps < half], half]
    own = loop_angle(fixed.sin(np.unique(shape.knots) / 2) ** 2, 1.0, edge)
    nose, tail = np.array([NOSE]), np.array([np.pi - TAIL])
    side = np.array([0.0, np.pi])
    for more in (nose, tail, own, steps, np.pi - steps):      # what comes first stays
        gap = 0.35 * np.minimum(np.interp(np.minimum(more, np.pi - more), steps, np.diff(steps, prepend=0.0)), 1.0)
        far = np.array([abs(side - a).min() > g for a, g in zip(more, gap)], bool)
        side = np.sort(np.r_[side, more[far]])
    whole = np.r_[-side[-2:0:-1], side]
    return np.sort(np.where(whole < TAIL - np.pi - 1e-9, whole + 2 * np.pi, whole))


def _interpolated(laws, innermost, refinement):
    sigma = loop_angles(laws.table.shape, laws.table.edge, refinement)
    v = np.linspace(0.0, 1.0, round(SPANS * refinement) + 1)
    grid_u, grid_v = (g.ravel() for g in np.meshgrid(sigma, v, indexing="ij"))
    points = blade_points_mm(laws, grid_u, rho_at(grid_v, innermost, laws.table.has_round_tip))
    points = points.reshape(len(sigma), len(v), 3)
    around = periodic_spline(sigma, points, 2 * np.pi)
    along = interpolated(v, around.c.transpose(1, 0, 2), DEGREE)
    poles = along.c.transpose(1, 0, 2)
    return NurbsSurface(degree_u=DEGREE, degree_v=DEGREE, knots_u=around.t, knots_v=along.t,
                        poles=np.concatenate([poles, np.ones((*poles.shape[:2], 1))], axis=-1))


def _fit_error_mm(laws, innermost, surface):
    """Largest distance from the definition between the interpolated places, and its parameters u, v.

    Along v, whose splines end freely, it is looked for in thirds.
    """
    u, v = (g.ravel() for g in np.meshgrid(_between(surface.knots_u, (0.0, 1 / 2)),
                                           _between(surface.knots_v, (1 / 6, 1 / 2, 5 / 6)), indexing="ij"))
    wanted = blade_points_mm(laws, u, rho_at(v, innermost, laws.table.has_round_tip))
    off = np.linalg.norm(surface.derivatives(u, v)[:, 0] - wanted, axis=1)
    row = int(off.argmax())
    return float(off[row]), float(u[row]), float(v[row])


def _between(knots, shares):
    """Places at shares of the way from every knot to the next."""
    at = np.unique(knots)
    return (at[:-1, None] + np.diff(at)[:, None] * np.asarray(shares)).ravel()
