"""The root: hub profile, how the fillet's radius goes round it, and whether a ball of it fits.

What does not fit is refused by name, with the station and the largest radius that would fit there.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from cuspline.designs.propellers.blade import about_x
from cuspline.designs.propellers.sections import stations
from cuspline.splines.fairing import fair_spline
from cuspline.surfaces.rolling_ball import (
    WIDEST_ARC_RAD,
    Revolved,
    arc_poles,
    deepest_inside,
    envelope_room,
    fillet_of,
    fillet_room,
    rolled,
)
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

END_MARGIN_SHARE = 0.002    # of the hub's length, kept free at its ends
OUTERMOST_CONTACT = 0.6     # blade parameter v above which a fillet is no fillet any more
TOUCHING_MM = 1e-3          # how far a ball may seem to dip into sampled blades
CLOSEST_SHARE = 0.002       # of the spacing of the blades: least land between two fillets
JUMP = 5.0                  # feet that move so much faster than their balls leap across a hollow
SLICES = 240                # of the hub, in which the width of the root is measured
HALVINGS = 12               # of the search for the largest radius
BELOW_LARGEST = 0.95        # of the largest that fits, taken where a radius was left to the design
ONE_SHARE = 0.8             # of what all stations must shrink by, that one alone may shrink by instead
BALLS_A_SPAN = 3            # of the blade's spans round the loop
LEAST_ROOM = 0.003          # of the envelope (1: straight, 0: it turns over); known within 0.003
ARC_SHARES = np.linspace(0.0, 1.0, 9)       # of an arc, where it is held against all other balls
TURNS_OVER = "rolls round the root's edge tighter than its own radius, so that its surface turns over"
STATION_WORDS = ("the trailing edge", "the face", "the leading edge", "the back")     # of `radius_round_root`
SIDE_SITES = 33             # of the line half way between two roots
RUN_OUT = 0.25              # of the root's length, within which it turns straight beyond it
LAND = 0.2                  # share of the free land that it must keep to a root


@dataclass(frozen=True, eq=False, kw_only=True)
class RadiusLaw:
    """Radius of the fillet round the root, level at its stations, smooth (C3) between them."""

    angle: np.ndarray           # (k,) rising loop angles in -pi..pi
    radius_mm: np.ndarray       # (k,)

    def __call__(self, u):
        """(n,) radius, (n,) its derivative."""
        span = np.diff(np.r_[self.angle, self.angle[0] + 2 * np.pi])
        at = np.mod(u - self.angle[0], 2 * np.pi) + self.angle[0]
        row = np.searchsorted(self.angle, at, side="right") - 1
        t = (at - self.angle[row]) / span[row]
        rise = np.roll(self.radius_mm, -1)[row] - self.radius_mm[row]
        return (self.radius_mm[row] + rise * fixed.power(t, 4) * (35 - 84 * t + 70 * t ** 2 - 20 * fixed.power(t, 3)),
                rise * 140 * fixed.power(t * (1 - t), 3) / span[row])

    def scaled(self, share):
        return RadiusLaw(angle=self.angle, radius_mm=share * self.radius_mm)

    def scaled_at(self, station, share):
        """The same with the radius of one station alone changed."""
        only = np.where(np.arange(len(self.angle)) == station, share, 1.0)
        return RadiusLaw(angle=self.angle, radius_mm=only * self.radius_mm)

    def nearest_station(self, u):
        return int(np.argmin(np.abs(np.remainder(self.angle - u + np.pi, 2 * np.pi) - np.pi)))


def radius_round_root(leading_edge_mm, face_mm, trailing_edge_mm, back_mm):
    """RadiusLaw by its values at the edges and in the middle of face and back."""
    return RadiusLaw(angle=np.array([-np.pi, -np.pi / 2, 0.0, np.pi / 2]),
                     radius_mm=np.array([trailing_edge_mm, face_mm, leading_edge_mm, back_mm]))


def straight_hub(fore_mm, aft_mm, radius_mm, half_angle_rad=0.0):
    """Revolved between two x, of a radius at x = 0, growing downstream for a positive angle."""
    x = np.linspace(fore_mm, aft_mm, 4)
    return Revolved(profile=BSpline(np.repeat([fore_mm, aft_mm], 4), radius_mm + fixed.tan(half_angle_rad) * x, 3),
                    half_angle_rad=float(half_angle_rad))


def curved_hub(x_mm, radius_mm):
    """Revolved through points of a profile, (n,) each, x rising."""
    if (np.asarray(radius_mm) <= 0).any() or (np.diff(x_mm) <= 0).any() or len(x_mm) < 3:
        raise DesignError("the hub's profile needs at least 3 points, x rising, radii positive")
    return Revolved(profile=fair_spline(x_mm, radius_mm, bending=2), half_angle_rad=None)


def balls_round_root(blade):
    """(n,) rising loop angles of the balls that a fillet is built from."""
    knots = np.unique(blade.surface.knots_u)
    return (knots[:-1, None] + np.diff(knots)[:, None] * np.arange(BALLS_A_SPAN) / BALLS_A_SPAN).ravel()


def rolled_round_root(blade, hub, law):
    """Rolling round the root of a blade, or a refusal in words.

    Args:
        blade: Blade.
        hub: Revolved.
        law: RadiusLaw.
    Raises:
        DesignError: a ball does not fit; names blade, station, reason and the largest radius that fits there.
    """
    rolling = _rolled(blade, hub, law)
    found = obstacle(blade, hub, rolling)
    if found is None:
        return rolling
    reason, row = found
    asked = float(rolling.radius_mm[row])
    raise DesignError(f"propeller {blade.table.name}, blade 1 (all {blade.table.blades} are alike), root at "
                      f"{station_in_words(blade, rolling.u[row])}: a fillet of radius {asked:.3f} mm {reason}; "
                      f"{_advice(blade, hub, law, asked, float(rolling.u[row]))}")


def fitting(blade, hub, law):
    """The law where its balls fit; else the same with that one station smaller which is in the way, or with all stations alike
    where one alone does not do: a little below the largest that fit, in whole hundredths.

    Args:
        as of `rolled_round_root`.
    Raises:
        DesignError: no radius fits.
    """
    rolling = _rolled(blade, hub, law)
    found = obstacle(blade, hub, rolling)
    if found is None:
        return law
    share, station, alone = _largest_shares(blade, hub, law, float(rolling.u[found[1]]))
    if not share and not alone:
        rolled_round_root(blade, hub, law)      # refuses it in words
    smaller = law.scaled_at(station, BELOW_LARGEST * alone) if alone >= ONE_SHARE * share else law.scaled(BELOW_LARGEST * share)
    hundredths = np.floor(100.0 * smaller.radius_mm) / 100.0
    return replace(law, radius_mm=np.where(smaller.radius_mm < law.radius_mm, hundredths, law.radius_mm))


def _largest_shares(blade, hub, law, u):
    """(share of all radii alike that fits; the station nearest to a loop angle; share of its radius alone that fits)."""
    station = law.nearest_station(u)
    return (_largest_share(blade, hub, law.scaled), station,
            _largest_share(blade, hub, lambda share: law.scaled_at(station, share)))


def _advice(blade, hub, law, asked, u):
    """The largest radius that fits: of all stations scaled alike, and of the nearest station alone where that helps."""
    share, station, alone = _largest_shares(blade, hub, law, u)
    if not share:
        return "no radius fits: the roots themselves do not"
    alone = _floored(alone * float(law.radius_mm[station]))
    return (f"the largest radius that fits there is {_floored(share * asked)} mm (all radii scaled alike)"
            + (f", or {alone} mm at {STATION_WORDS[station]} alone" if float(alone) > 0 else ""))


def _floored(radius_mm):
    return f"{np.floor(1e3 * radius_mm) / 1e3:.3f}"


def _rolled(blade, hub, law):
    return rolled(blade.surface, blade.outward, hub, law, balls_round_root(blade), (0.0, OUTERMOST_CONTACT))


def obstacle(blade, hub, rolling):
    """Why a ball does not fit and at which row, or None."""
    low, high = hub.ends_mm
    margin = END_MARGIN_SHARE * (high - low)
    if np.isnan(rolling.v).any():
        return "finds no place where it touches both blade and hub", int(np.argmax(np.isnan(rolling.v)))
    x = rolling.foot_mm[:, 0]
    arc = fixed.arccos(np.clip(np.einsum("ij,ij->i", rolling.blade_normal, rolling.hub_normal), -1, 1))
    speed = np.linalg.norm(rolling.motion_mm, axis=1)
    hub_hollow = hub.hollow_radius_mm(x)
    step = lambda p: np.linalg.norm(np.roll(p, -1, axis=0) - p, axis=1)
    for reason, excess in (
            (f"reaches over the hub's fore end at x = {low:.2f} mm", low + margin - x),
            (f"reaches over the hub's aft end at x = {high:.2f} mm", x - high + margin),
            ("does not fit into the blade's own concave side", rolling.radius_mm - rolling.hollow_mm),
            ("does not fit into the concave profile of the hub", rolling.radius_mm - hub_hollow),
            ("does not fit into the concave profile of the hub",
             step(rolling.foot_mm) - JUMP * step(rolling.center_mm)),
            ("is wedged between blade and hub, which are almost one on the other", arc - WIDEST_ARC_RAD),
            ("changes faster along the root than its ball moves", np.abs(rolling.radius_slope) - 0.95 * speed),
            ("climbs the blade almost to the tip", rolling.v - 0.98 * OUTERMOST_CONTACT),
            (TURNS_OVER, LEAST_ROOM - envelope_room(rolling, 2 * np.pi))):
        if (excess > 0).any():
            return reason, int(np.argmax(excess))
    return (_turning_over(blade, rolling) or _crowded_by_neighbour(blade, rolling) or _crossing_itself(rolling)
            or _dipping_into_blades(blade, rolling) or _cut_by_other_balls(blade, rolling)
            or _leaving_no_land(blade, hub, rolling))


def _turning_over(blade, rolling):
    """The surface through the balls' arcs, looked at between the balls."""
    u, room = fillet_room(fillet_of(rolling, 2 * np.pi), blade.outward, 2 * np.pi)
    if room.min() >= LEAST_ROOM:
        return None
    return TURNS_OVER, int(np.argmin(np.abs(rolling.u - u[room.argmin()])))


def root_width(rolling):
    """How the root with its fillet lies on the hub.

    Returns:
        (SLICES,) x between its ends; (SLICES,) lowest and highest polar angle there.
    """
    x, angle = rolling.foot_mm[:, 0], rolling.foot_angle
    nx, nangle = np.r_[x[1:], x[0]], np.r_[angle[1:], angle[0]]
    span = x.max() - x.min()
    at = x.min() + span * (1 - fixed.cos(np.pi * (np.arange(SLICES) + 0.5) / SLICES)) / 2
    crosses = (np.minimum(x, nx) <= at[:, None]) & (at[:, None] < np.maximum(x, nx))
    share = (at[:, None] - x) / np.where(nx == x, 1.0, nx - x)
    cut = angle + share * (nangle - angle)
    return at, np.where(crosses, cut, np.inf).min(axis=1), np.where(crosses, cut, -np.inf).max(axis=1)


def _crowded_by_neighbour(blade, rolling):
    at, low, high = root_width(rolling)
    room = 2 * np.pi / blade.table.blades * (1 - CLOSEST_SHARE)
    worst = int(np.argmax(high - low))
    if high[worst] - low[worst] <= room:
        return None
    middle = (high[worst] + low[worst]) / 2
    near = np.abs(rolling.foot_mm[:, 0] - at[worst])
    row = int(np.argmin(near + 1e3 * (rolling.foot_angle < middle)))
    return f"runs into that of the next blade at x = {at[worst]:.2f} mm on the hub", row


def _crossing_itself(rolling):
    """The fillet's border on the hub as a polygon: no two sides may cross."""
    p = np.column_stack([rolling.foot_angle * np.median(fixed.hypot(*rolling.foot_mm[:, 1:].T)), rolling.foot_mm[:, 0]])
    q = np.roll(p, -1, axis=0)
    side = lambda a, b, c: ((b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1])
                            - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0]))
    a, b, c, d = p[:, None], q[:, None], p[None], q[None]
    cross = (side(a, b, c) * side(a, b, d) < 0) & (side(c, d, a) * side(c, d, b) < 0)
    if not cross.any():
        return None
    return "crosses itself on the hub", int(np.argwhere(cross)[0, 0])


def _dipping_into_blades(blade, rolling):
    """No ball may reach into the blade elsewhere, or into its neighbours: sampled, so only ever too kind."""
    knots = np.unique(blade.surface.knots_u)
    u, v = (g.ravel() for g in np.meshgrid(np.sort(np.r_[knots, (knots[1:] + knots[:-1]) / 2]),
                                           np.linspace(np.nanmin(rolling.v), OUTERMOST_CONTACT, 60), indexing="ij"))
    points = blade.surface.derivatives(u, v)[:, 0]
    # of each column only what stands out of the fillet's contact
    at = np.interp(u, np.r_[rolling.u, rolling.u[0] + 2 * np.pi], np.r_[rolling.v, rolling.v[0]])
    points = points[v >= at]
    for turn, whose in ((0, "its own blade"), (1, "the next blade"), (-1, "the blade before")):
        near, _ = cKDTree(fixed.matmul(points, about_x(2 * np.pi * turn / blade.table.blades).T)).query(rolling.center_mm)
        inside = rolling.radius_mm - near
        if inside.max() > TOUCHING_MM:
            return f"reaches {inside.max():.3f} mm into {whose}", int(np.argmax(inside))
    return None


def _cut_by_other_balls(blade, rolling):
    """No ball, its own neighbours' or another blade's, may reach past the arc of any other: sampled."""
    poles, share = arc_poles(rolling), ARC_SHARES[:, None]
    weights = np.stack([(1 - share) ** 2, 2 * share * (1 - share), share ** 2], axis=1)[..., 0]
    arcs = np.einsum("ts,nsc->ntc", weights, poles)
    places = (arcs[..., :3] / arcs[..., 3:]).reshape(-1, 3)
    for turn, whose in ((0, "of its own root"), (1, "of the next blade"), (-1, "of the blade before")):
        depth, row = deepest_inside(places, fixed.matmul(rolling.center_mm, about_x(2 * np.pi * turn / blade.table.blades).T),
                                    rolling.radius_mm)
        if depth > TOUCHING_MM:
            return f"is cut {depth:.3f} mm deep by the ball at another place {whose}", row // len(ARC_SHARES)
    return None


def half_way_line(hub, rolling, blades):
    """The line along which neighbouring sectors of the hub meet.

    Returns:
        scipy BSpline of the polar angle half way between the sides of blade 1's root over x, from end to end of the
        hub; how far it stays clear of the root on either side, rad (negative: it runs into it).
    """
    at, low, high = root_width(rolling)
    land = max(float((2 * np.pi / blades - (high - low)).min()), 0.0)
    along = fair_spline(at[::12], ((low + high) / 2)[::12], LAND / 2 * land, bending=2)
    fore, aft = hub.ends_mm
    reach = RUN_OUT * (at[-1] - at[0])

    def beyond(x):      # outside the root it turns straight, so that a long hub is not wound round
        edge = np.clip(x, along.t[0], along.t[-1])
        return along(edge) + along.derivative()(edge) * reach * fixed.tanh((x - edge) / reach)

    x = np.unique(np.r_[np.linspace(fore, aft, SIDE_SITES), at[::24]])
    found = fair_spline(x, beyond(x), LAND / 4 * land, domain=(fore, aft), bending=2)
    half = np.pi / blades
    return found, float(min((low - found(at) + half).min(), (found(at) + half - high).min()))


def _leaving_no_land(blade, hub, rolling):
    line, clear = half_way_line(hub, rolling, blade.table.blades)
    if clear > 0:
        return None
    x, angle = rolling.foot_mm[:, 0], rolling.foot_angle
    return "leaves too little of the hub between neighbouring blades", int(np.argmax(np.abs(angle - line(x))))


def _largest_share(blade, hub, law_of):
    """Largest share for which the law that a function gives fits; 0: none does."""
    fits = lambda share: obstacle(blade, hub, _rolled(blade, hub, law_of(share))) is None
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def station_in_words(blade, angle):
    """The station of a loop angle as a designer says it."""
    angle = (angle + np.pi) % (2 * np.pi) - np.pi
    x, _ = stations(np.array([angle]), blade.table.edge)
    if x[0] < 0.003:
        return "the leading edge"
    if x[0] > 0.997:
        return "the trailing edge"
    return f"{100 * x[0]:.1f} % of the chord on the {'back' if angle > 0 else 'face'}"
