r"""A ball of changing radius rolls round a blade's root, touching the blade and a surface of revolution.

                  blade
           n  ^  /
              | / p1                 C(u) = S(u, v) + r(u) n(u, v),  dist(C, hub) = r(u)   gives v(u)
        C  o--|*                     p1 = S, p2 = foot of C on the hub
           |  /
        ___*_/______ hub             fillet: what all balls together leave standing
           p2

The balls' envelope touches ball u along a circle in the plane square to C', centred r r' / |C'| behind C; it passes
through both contacts, and its arc between them is square to both normals, so the fillet is tangent to blade and hub
for any smooth r(u).  The arcs are rational quadratic; their homogeneous poles are interpolated along u.

A place x of the arc bounds what the balls sweep only while the balls just before and behind leave it free:
f(u) = |x - C|^2 - r^2 has its least value 0 there, so

    1 - ((x - C) . C'' + r'^2 + r r'') / |C'|^2  >  0         (half of f'' over |C'|^2)

Where it falls to 0 the ball turns round the edge tighter than its own radius and the envelope turns over.  What the
balls leave standing goes on from there with a sharp ridge between two flanks: no fillet, whatever is done with it.
Frame: the axis of revolution is X.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from cuspline.splines.closed_splines import periodic_spline
from cuspline.splines.nurbs import NurbsSurface, local_shape
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z

DEGREE = 5
SITES = 400                 # of a curved profile, from which its feet are sought
SCAN = 48                   # places in v between which the contact is bracketed
LOOKS_A_SPAN, LOOKS_ACROSS = 4, 17      # at a fillet between its knots, and from blade to hub
STEPS = 60                  # of the bracketed Newton iteration
ARC_KNOTS = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
WIDEST_ARC_RAD = np.radians(170.0)      # beyond, the ball is wedged between blade and hub


@dataclass(frozen=True, eq=False, kw_only=True)
class Revolved:
    """A surface of revolution about X, by its radius over x."""

    profile: BSpline            # degree >= 3, clamped
    half_angle_rad: float | None    # a cone (0: a cylinder); None: a curved profile

    @property
    def ends_mm(self):
        return self.profile.t[0], self.profile.t[-1]

    def foot(self, points):
        """Closest points in the half planes of some points, going on beyond its ends.

        Args:
            points: (n, 3).
        Returns:
            (n,) x of the foot, (n,) polar angle from Y to Z, (n, 3) outward normal there, (n,) signed distance.
        """
        x, rho = points[:, 0], fixed.hypot(points[:, 1], points[:, 2])
        first, second = self.profile.derivative(), self.profile.derivative(2)
        t = x.copy() if self.half_angle_rad is not None else self._nearest_site(x, rho)
        for _ in range(30):
            radius, slope = self.profile(t), first(t)
            step = ((t - x) + (radius - rho) * slope) / np.maximum(1 + slope ** 2 + (radius - rho) * second(t), 0.1)
            t = t - step
            if np.abs(step).max() < 1e-13 * max(1.0, np.abs(t).max()):
                break
        radius, slope = self.profile(t), first(t)
        angle = fixed.arctan2(points[:, 2], points[:, 1])
        root = np.sqrt(1 + slope ** 2)
        normal = np.stack([-slope, fixed.cos(angle), fixed.sin(angle)], axis=1) / root[:, None]
        return t, angle, normal, ((x - t) * -slope + (rho - radius)) / root

    def _nearest_site(self, x, rho):
        """(n,) x of the nearest of SITES places of the profile, or the points' own where they lie beyond its ends."""
        sites = np.linspace(*self.ends_mm, SITES)
        _, row = cKDTree(np.column_stack([sites, self.profile(sites)])).query(np.column_stack([x, rho]))
        return np.where((x < sites[0]) | (x > sites[-1]), x, sites[row])

    def points(self, angle, x):
        """(n, 3) points of the surface."""
        radius = self.profile(x)
        return np.stack([x, radius * fixed.cos(angle), radius * fixed.sin(angle)], axis=1)

    def hollow_radius_mm(self, x):
        """(n,) radius of curvature of the profile where it is hollow seen from outside; inf elsewhere."""
        slope, bend = self.profile.derivative()(x), self.profile.derivative(2)(x)
        curvature = bend / fixed.power(1 + slope ** 2, 1.5)
        return np.where(curvature > 0, 1 / np.maximum(curvature, 1e-300), np.inf)


@dataclass(frozen=True, eq=False, kw_only=True)
class Rolling:
    """Balls at parameters u, one row each."""

    u: np.ndarray               # (n,)
    radius_mm: np.ndarray       # (n,)
    v: np.ndarray               # (n,) of the contact on the blade; NaN: the ball finds no place
    center_mm: np.ndarray       # (n, 3)
    contact_mm: np.ndarray      # (n, 3) p1
    blade_normal: np.ndarray    # (n, 3) out of the blade
    foot_mm: np.ndarray         # (n, 3) p2
    foot_angle: np.ndarray      # (n,) polar angle, without jumps
    hub_normal: np.ndarray      # (n, 3)
    motion_mm: np.ndarray       # (n, 3) dC/du
    radius_slope: np.ndarray    # (n,) dr/du
    hollow_mm: np.ndarray       # (n,) tightest hollow of the blade at p1, inf on ridges

    def turned(self, turn):
        """The balls turned by a (3, 3) rotation about X."""
        vectors = ("center_mm", "contact_mm", "blade_normal", "foot_mm", "hub_normal", "motion_mm")
        angle = self.foot_angle + fixed.arctan2(turn[2, 1], turn[1, 1])
        return replace(self, foot_angle=angle, **{name: fixed.matmul(getattr(self, name), turn.T) for name in vectors})


def rolled(surface, outward, hub, law, u, v_range):
    """Where the ball touches.

    Args:
        surface: NurbsSurface of the blade, closed along u.
        outward: +1 where Su x Sv points out of the blade, -1 where into it.
        hub: Revolved.
        law: function u (n,) -> radius mm (n,), its derivative (n,).
        u: (n,).
        v_range: (low, high), from inside the hub outward.
    Returns:
        Rolling; rows where the ball finds no place hold NaN.
    """
    u = np.asarray(u, float)
    radius, radius_slope = law(u)
    v = _contact_parameters(surface, outward, hub, radius, u, v_range)
    found = np.isfinite(v)
    d = surface.derivatives(u, np.where(found, v, v_range[1]))
    s, su, sv = d[:, 0], d[:, 1], d[:, 2]
    n, nu, nv = _normals(d, outward)
    center = s + radius[:, None] * n
    x, angle, hub_normal, _ = hub.foot(center)
    dot = lambda a, b: np.einsum("ij,ij->i", a, b)
    cu = su + radius[:, None] * nu + radius_slope[:, None] * n
    cv = sv + radius[:, None] * nv
    motion = cu - cv * ((dot(hub_normal, cu) - radius_slope) / dot(hub_normal, cv))[:, None]
    hollow = -local_shape(d, outward < 0).curvature_low_per_mm
    blank = lambda a: np.where(found.reshape(-1, *[1] * (a.ndim - 1)), a, np.nan)
    return Rolling(u=u, radius_mm=radius, v=v, center_mm=blank(center), contact_mm=blank(s), blade_normal=n,
                   foot_mm=blank(hub.points(angle, x)), foot_angle=np.unwrap(angle), hub_normal=hub_normal,
                   motion_mm=motion, radius_slope=radius_slope,
                   hollow_mm=np.where(hollow > 0, 1 / np.maximum(hollow, 1e-300), np.inf))


def _contact_parameters(surface, outward, hub, radius, u, v_range):
    """v at which the ball rests on blade and hub: the outermost place, by Newton steps inside a bracket."""
    def excess(v, rows=slice(None)):
        d = surface.derivatives(u[rows], v)
        n, _, nv = _normals(d, outward)
        _, _, normal, distance = hub.foot(d[:, 0] + radius[rows, None] * n)
        return distance - radius[rows], np.einsum("ij,ij->i", normal, d[:, 2] + radius[rows, None] * nv)

    v = np.linspace(*v_range, SCAN)
    grid_u, grid_v = np.meshgrid(np.arange(len(u)), v, indexing="ij")
    below = excess(grid_v.ravel(), grid_u.ravel())[0].reshape(grid_v.shape) < 0
    rising = below[:, :-1] & ~below[:, 1:]
    last = SCAN - 2 - np.argmax(rising[:, ::-1], axis=1)
    low, high = v[last], v[last + 1]
    at = (low + high) / 2
    for _ in range(STEPS):
        value, slope = excess(at)
        low, high = np.where(value < 0, at, low), np.where(value < 0, high, at)
        newton = at - value / np.where(slope == 0, 1.0, slope)
        inside = (newton > low) & (newton < high)
        nearer = np.where(inside, newton, (low + high) / 2)
        if np.abs(nearer - at).max() < 1e-15:
            break
        at = nearer
    return np.where(rising.any(axis=1), at, np.nan)


def _normals(d, outward):
    """Unit normals out of the blade and their derivatives along u and v."""
    su, sv, suu, suv, svv = (d[:, k] for k in range(1, 6))
    cross = outward * np.cross(su, sv)
    length = np.linalg.norm(cross, axis=1)[:, None]
    n = cross / length

    def derived(change):
        change = outward * change / length
        return change - n * np.einsum("ij,ij->i", n, change)[:, None]

    return n, derived(np.cross(suu, sv) + np.cross(su, suv)), derived(np.cross(suv, sv) + np.cross(su, svv))


def envelope_room(rolling, period):
    """(n,) least value over each ball's arc of the condition above: 1 on a straight way, 0 where it turns over.

    Args:
        rolling: Rolling all the way round, parameters rising.
        period: of the parameter.
    """
    dot = lambda a, b: np.einsum("ij,ij->i", a, b)
    along = periodic_spline(rolling.u, np.column_stack([rolling.motion_mm, rolling.radius_slope]), period)
    bend = along.derivative()(rolling.u)
    bend, radius_bend = bend[:, :3], bend[:, 3]
    speed2, middle = dot(rolling.motion_mm, rolling.motion_mm), arc_centers_mm(rolling)
    a, b = rolling.contact_mm - middle, rolling.foot_mm - middle
    # the arc's farthest place along C'' is where the arc points its way, or one of its ends
    aa, ab, pa, pb = dot(a, a), dot(a, b), dot(a, bend), dot(b, bend)
    points_in = (pa * aa >= pb * ab) & (pb * aa >= pa * ab)
    inside = np.sqrt(np.maximum(pa * pa + pb * pb - 2 * pa * pb * ab / aa, 0.0) / np.maximum(1 - (ab / aa) ** 2, 1e-12))
    farthest = np.where(points_in, inside, np.maximum(pa, pb)) + dot(middle - rolling.center_mm, bend)
    return 1 - (farthest + rolling.radius_slope ** 2 + rolling.radius_mm * radius_bend) / speed2


@njit
def deepest_inside(places, centers, radii):
    """How deep the deepest of some places lies inside any of some balls (negative: outside all), and its row.

    Args:
        places: (n, 3).   centers: (m, 3).   radii: (m,).
    """
    deepest, found = -math.inf, -1
    for i in range(len(places)):
        for j in range(len(centers)):
            dx, dy, dz = places[i, X] - centers[j, X], places[i, Y] - centers[j, Y], places[i, Z] - centers[j, Z]
            least = radii[j] - deepest
            if least > 0 and dx * dx + dy * dy + dz * dz < least * least:
                deepest, found = radii[j] - math.sqrt(dx * dx + dy * dy + dz * dz), i
    return deepest, found


# the fillet ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, kw_only=True)
class Fillet:
    """The surface between blade and hub and its borders on both."""

    surface: NurbsSurface       # u as on the blade; across it 0 at the blade, 1 at the hub
    on_blade: BSpline           # u -> v of the blade (1,)
    on_hub: BSpline             # u -> polar angle, x (2,)
    rolling: Rolling            # at the knots


@dataclass(frozen=True, kw_only=True)
class FilletErrors:
    """Measured between the knots, against the ball found anew there."""

    blade_border_mm: float      # fillet's border from the blade's contact
    hub_border_mm: float
    ball_mm: float              # distance of the fillet from the ball it should touch
    blade_angle_deg: float      # between the fillet's normal and the blade's
    hub_angle_deg: float
    ball_angle_deg: float       # between the fillet's normal and the way to the ball's centre; 180: it has turned over


def arc_centers_mm(rolling):
    """(n, 3) middles of the circles along which the balls touch their envelope."""
    speed2 = np.einsum("ij,ij->i", rolling.motion_mm, rolling.motion_mm)
    return rolling.center_mm - (rolling.radius_mm * rolling.radius_slope / speed2)[:, None] * rolling.motion_mm


def arc_poles(rolling):
    """(n, 3, 4) homogeneous poles of the arcs from blade to hub."""
    middle = arc_centers_mm(rolling)
    a, b = rolling.contact_mm - middle, rolling.foot_mm - middle
    size2 = np.einsum("ij,ij->i", a, a)
    half = np.sqrt((1 + np.einsum("ij,ij->i", a, b) / size2) / 2)       # cosine of half the arc
    corner = middle + (a + b) / (2 * half ** 2)[:, None]
    one = np.ones(len(half))
    return np.stack([np.column_stack([rolling.contact_mm, one]), np.column_stack([corner * half[:, None], half]),
                     np.column_stack([rolling.foot_mm, one])], axis=1)


def fillet_of(rolling, period):
    """Fillet through arcs at rising parameters round one whole turn."""
    poles = arc_poles(rolling)
    around = periodic_spline(rolling.u, poles, period)
    turn = rolling.foot_angle
    borders = periodic_spline(rolling.u, np.column_stack([rolling.v, turn, rolling.foot_mm[:, 0]]), period)
    surface = NurbsSurface(degree_u=DEGREE, degree_v=2, knots_u=around.t, knots_v=ARC_KNOTS, poles=around.c)
    return Fillet(surface=surface, on_blade=BSpline(borders.t, borders.c[:, :1], DEGREE),
                  on_hub=BSpline(borders.t, borders.c[:, 1:], DEGREE), rolling=rolling)


def fillet_room(fillet, outward, period):
    """As `envelope_room`, of the surface as it is built, looked at between its knots.

    Args:
        fillet: Fillet.
        outward: as for `rolled`.
        period: of the parameter.
    Returns:
        (n,) parameters u, (n,) least value across.
    """
    knots, across = np.unique(fillet.surface.knots_u), np.linspace(0.0, 1.0, LOOKS_ACROSS)
    u = (knots[:-1, None] + np.diff(knots)[:, None] * (np.arange(LOOKS_A_SPAN) + 0.5) / LOOKS_A_SPAN).ravel()
    way = periodic_spline(fillet.rolling.u, fillet.rolling.center_mm, period)
    d = fillet.surface.derivatives(np.repeat(u, len(across)), np.tile(across, len(u)))
    to_center = np.repeat(way(u), len(across), axis=0) - d[:, 0]
    dot = lambda a, b: np.einsum("ij,ij->i", a, b)
    size = np.sqrt(dot(d[:, 2], d[:, 2]) * dot(to_center, to_center))
    room = -outward * dot(np.cross(d[:, 1], d[:, 2]), to_center) / size
    speed = np.linalg.norm(way.derivative()(u), axis=1)
    return u, room.reshape(len(u), -1).min(axis=1) / speed


def fillet_errors(derivatives, flip, between):
    """FilletErrors of a fillet's surface.

    Args:
        derivatives: function of u, t, (n,) each -> (n, 6, 3), as `NurbsSurface.derivatives`.
        flip: its normal out of the material is -(Su x Sv).
        between: Rolling at other parameters than the fillet's knots.
    """
    count, across = len(between.u), np.linspace(0.0, 1.0, 9)
    shape = local_shape(derivatives(np.repeat(between.u, len(across)), np.tile(across, count)), flip)
    places, normals = (a.reshape(count, len(across), 3) for a in (shape.point_mm, shape.normal))
    to_center = between.center_mm[:, None] - places
    far = np.linalg.norm(to_center, axis=2)
    return FilletErrors(
        blade_border_mm=_longest(places[:, 0] - between.contact_mm),
        hub_border_mm=_longest(places[:, -1] - between.foot_mm),
        ball_mm=float(np.abs(far - between.radius_mm[:, None]).max()),
        blade_angle_deg=_widest_deg(normals[:, 0], between.blade_normal),
        hub_angle_deg=_widest_deg(normals[:, -1], between.hub_normal),
        ball_angle_deg=_widest_deg(normals.reshape(-1, 3), (to_center / far[..., None]).reshape(-1, 3)))


def _longest(vectors):
    return float(np.linalg.norm(vectors, axis=1).max())


def _widest_deg(a, b):
    """Largest angle between unit vectors, exact where it is small too."""
    return float(np.degrees(2 * fixed.arcsin(np.minimum(np.linalg.norm(a - b, axis=1) / 2, 1.0)).max()))
