r"""Blade sections as one smooth closed loop, whatever they are described by.

The loop angle sigma runs from the trailing edge over the face (pressure side) to the leading edge, 0, and back over
the back (suction side):

            back, sigma > 0
         .-'''''''----.____
    0  (                    ''''---.  +-pi        x/c = sin^2(sigma/2): 0 leading, 1 trailing edge
         '-.__________..----''''
            face, sigma < 0

Lengths are shares of the chord, ordinates positive towards the back.  Thickness is closed smoothly at blunt ends: over
the distance s from an end of half-thickness h it grows as h tanh(2 s / h)^(1/2), which osculates a circle of radius h
at the very end, or as the fourth root: a flat end with rounded corners.
"""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import BSpline

from cuspline.splines.fairing import DEGREE, Held, fair_spline
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError
from cuspline.values.input_files import text_of

DATA = Path(__file__).parents[1] / "data"
SQUARE = 0.0025             # 1 - x/c below which a square end is laid off evenly across
BEVEL_SHARPNESS = 12.0      # of the knuckle of an anti-singing bevel
ROUNDING = 0.5e-4           # of the published ordinates
END_POWER = 12              # of x/c, by which another edge thickness fades towards the leading edge
SLOPE_OFF = 0.03            # of the camber: how far its slopes may add up to something else between two stations
CLOSE = 0.03                # theta between knots of shapes that change over the radius
FLAT = 1e-4                 # sin(theta) below which slopes are taken by their limit
ODD, EVEN = (0, 2, 4), (1, 3)


@dataclass(frozen=True, kw_only=True)
class TrailingEdge:
    """How the trailing edge ends: round, square (flat, corners rounded), or bevelled on the back and round."""

    kind: Literal["round", "square", "anti-singing"] = "round"
    thickness_share: float | None = None    # of the section's greatest thickness; None: as the section table has it
    bevel_chord_share: float = 0.06         # length of the anti-singing bevel
    bevel_leaves: float = 0.5               # share of the thickness that it leaves at the end


def stations(sigma, edge):
    """x/c and 1 - x/c, (n,) each, of loop angles; each exact where it is small."""
    lead, rest = fixed.sin(sigma / 2) ** 2, fixed.cos(sigma / 2) ** 2
    if edge.kind == "square":       # 1 - x ~ (pi - sigma)^4: the loop crosses the flat end evenly
        return (lead * (rest + SQUARE * (1 + rest)) / (rest + SQUARE),
                rest * rest * (1 + SQUARE) / (rest + SQUARE))
    return lead, rest


def loop_angle(x_c, side, edge):
    """(n,) loop angle at stations x/c of a side, +1 back, -1 face (inverse of `stations`)."""
    far = 1 - np.asarray(x_c, float)
    if edge.kind == "square":
        half = far / (1 + SQUARE) / 2
        far = half + np.sqrt(half * half + 2 * half * SQUARE)
    return side * 2 * fixed.arctan2(np.sqrt(1 - far), np.sqrt(far))


@dataclass(frozen=True, eq=False, kw_only=True)
class FormAndMeanLine:
    """One thickness form and one mean line for all radii; thickness is laid off square to the mean line."""

    half_thickness: BSpline     # over theta, odd at 0: share of the greatest thickness
    camber: BSpline             # over theta, even: share of the greatest camber
    ordinates: tuple            # the table's own: x/c, half-thickness, camber, slope of the camber, (n,) each

    def half(self, theta, rho):
        return self.half_thickness(theta)

    def middle(self, theta, rho, thickness, camber):
        """Ordinate of the mean line, shares of the chord, and its slope."""
        slope = _slope(self.camber, theta)
        return camber * self.camber(theta), camber * slope

    has_round_nose = True

    @property
    def knots(self):
        return self.half_thickness.t


@dataclass(frozen=True, eq=False, kw_only=True)
class OffsetShapes:
    """Half-thickness and mean ordinate of face and back, shares of the greatest thickness, changing over the radius.

    Thickness is laid off square to the chord, as face and back are given.
    """

    knots: np.ndarray           # over theta
    half_laws: BSpline          # over r/R: coefficients (k,)
    middle_laws: BSpline
    has_round_nose: bool        # thickness is 0 at the leading edge itself
    ordinates: tuple            # the table's own: r/R (m,); m arrays each of x/c, face, back

    def half(self, theta, rho):
        return self._at(self.half_laws, theta, rho)

    def middle(self, theta, rho, thickness, camber):
        return thickness * self._at(self.middle_laws, theta, rho), np.zeros_like(theta)

    def _at(self, laws, theta, rho):
        basis = BSpline.design_matrix(np.clip(theta, 0.0, np.pi), self.knots, DEGREE)
        return np.asarray(basis.multiply(laws(rho)).sum(axis=1)).ravel()


def section_loop(shape, edge, sigma, rho, thickness, camber):
    """Points of section loops.

    Args:
        shape: FormAndMeanLine or OffsetShapes.
        edge: TrailingEdge.
        sigma, rho: (n,) loop angle, rad; radius r/R.
        thickness, camber: (n,) greatest thickness and camber, shares of the chord.
    Returns:
        (n,) distance from the leading edge along the nose-tail line, (n,) ordinate towards the back; shares of the
        chord.
    """
    x, far = stations(sigma, edge)
    theta = 2 * fixed.arctan2(np.sqrt(x), np.sqrt(far))
    side = np.where(fixed.sin(sigma) < 0, -1.0, 1.0)
    tail = thickness * shape.half(np.full_like(theta, np.pi), rho)
    half = thickness * shape.half(theta, rho)
    if edge.thickness_share is not None:
        half = half + (thickness * edge.thickness_share / 2 - tail) * fixed.power(x, END_POWER)
        tail = thickness * edge.thickness_share / 2
    middle, slope = shape.middle(theta, rho, thickness, camber)
    if edge.kind == "anti-singing":
        taken = tail * (1 - edge.bevel_leaves) * _knuckle(1 - far / edge.bevel_chord_share)
        half, middle, tail = half - taken, middle - taken, tail * edge.bevel_leaves
    half = half * fixed.power(fixed.tanh(2 * far / tail), 0.25 if edge.kind == "square" else 0.5)
    if not shape.has_round_nose:
        half = half * np.sqrt(fixed.tanh(2 * x / (thickness * shape.half(np.zeros_like(theta), rho))))
    root = np.sqrt(1 + slope * slope)
    return x - side * half * slope / root, middle + side * half / root


def _knuckle(z):
    """Smooth bevel: 0 before its knuckle at z = 0, 1 at z = 1."""
    rounded = lambda y: np.maximum(y, 0.0) + fixed.log(1.0 + fixed.exp(-np.abs(y)))
    return rounded(BEVEL_SHARPNESS * z) / rounded(BEVEL_SHARPNESS)


def _slope(mean, theta):
    """d(mean)/d(x/c) of a mean line that is even over theta at both ends."""
    sine = fixed.sin(theta)
    flat = np.abs(sine) < FLAT
    limit = mean.derivative(2)(theta) / fixed.cos(theta)
    return 2 * np.where(flat, limit, mean.derivative()(theta) / np.where(flat, 1.0, sine))


# tables ----------------------------------------------------------------------------------------


def table(path):
    """{column: (n,) float64} of a CSV whose comment lines start with #; an empty field is NaN.

    Raises:
        InputError: no such file, or no text.  DesignError: a field that is no number; names it.
    """
    text = text_of(path, "propeller table")
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    if not rows:
        raise DesignError(f"propeller table {path} has no rows")
    if None in rows[0]:
        raise DesignError(f"propeller table {path}, row 1: it has more fields than there are columns")
    return {name: np.array([_number(row[name], path, name, k) for k, row in enumerate(rows, 1)]) for name in rows[0]}


def _number(text, path, column, row):
    if not (text and text.strip()):
        return float("nan")
    try:
        value = float(text)
    except ValueError:
        raise DesignError(f"propeller table {path}, row {row}, column {column}: {text!r} is no number") from None
    if not np.isfinite(value):
        raise DesignError(f"propeller table {path}, row {row}, column {column}: {text.strip()!r} is no value a blade "
                          "can have; give the number, or in the tip's row leave the field empty")
    return value


def naca66_a08():
    """Modified NACA 66 thickness (its leading-edge radius imposed) on the a = 0.8 mean line."""
    return sections_of(DATA / "propeller_naca66mod_a08.csv")


def sections_of(path):
    """FormAndMeanLine of a table on disk.

    Args:
        path: CSV with the columns
            x_c                 stations, rising from 0 at the leading to 1 at the trailing edge, at least 6
            half_thickness_t0   half-thickness over the greatest thickness: 0 at the nose, 0.5 where it is greatest
            camber_f0           camber over the greatest camber: 0 at both ends, 1 where it is greatest
            camber_slope_f0     d(camber_f0)/d(x_c); empty where it is not known, the column may be missing
            nose_radius         in the first row: radius of the nose times chord over (greatest thickness)^2; the column
                                may be missing: then the ordinate next to the nose says it
    Raises:
        DesignError: no such columns, or entries that no section can have; names the row.
    """
    rows = table(path)
    wanted = ("x_c", "half_thickness_t0", "camber_f0")
    if missing := [c for c in wanted if c not in rows]:
        raise DesignError(f"propeller table {path} has no column {', '.join(missing)}; it has {', '.join(rows)}")
    x, half, camber = (rows[c] for c in wanted)
    slope = rows.get("camber_slope_f0", np.full(len(x), np.nan))
    _refuse_no_section(path, x, half, camber, slope)
    nose = rows.get("nose_radius", np.full(len(x), np.nan))[0]
    if np.isnan(nose):
        nose = half[1] * half[1] / (2 * x[1])           # of the parabola through it
    elif not nose > 0:
        raise DesignError(f"propeller table {path}, row 1: nose_radius {nose:g} must be above 0")
    return form_and_mean_line(x, half, camber, slope, float(nose))


def _refuse_no_section(path, x, half, camber, slope):
    """Complain of the first row that cannot be meant."""
    def refuse(row, text):
        raise DesignError(f"propeller table {path}, row {row + 1}: {text}")

    for name, values in (("x_c", x), ("half_thickness_t0", half), ("camber_f0", camber)):
        if np.isnan(values).any():
            refuse(int(np.isnan(values).argmax()), f"{name} is empty")
    if len(x) < 6 or x[0] != 0 or x[-1] != 1 or (np.diff(x) <= 0).any():
        row = int((np.diff(x) <= 0).argmax()) + 1 if (np.diff(x) <= 0).any() else len(x) - 1
        refuse(row, f"x_c {x[row]:g}: stations must rise from 0 to 1, at least 6; there are {len(x)}")
    if half[0] != 0 or (half[1:] <= 0).any():
        row = 0 if half[0] != 0 else int((half[1:] <= 0).argmax()) + 1
        refuse(row, f"half_thickness_t0 {half[row]:g}: it is 0 at the nose and above 0 from there on; an edge that ends "
               "in nothing cannot be rounded")
    for name, values, most in (("half_thickness_t0", half, 0.5), ("camber_f0", np.abs(camber), 1.0)):
        row = int(values.argmax())
        if abs(values[row] / most - 1) > SLOPE_OFF:
            refuse(row, f"{name} {values[row]:g} is the greatest, it must be {most:g}: divide by the greatest "
                   f"{'thickness' if most < 1 else 'camber'}")
    if camber[0] != 0 or camber[-1] != 0:
        refuse(0 if camber[0] != 0 else len(x) - 1, "camber_f0 must be 0 at both ends")
    off = np.abs(np.diff(camber) - np.diff(x) * (slope[1:] + slope[:-1]) / 2)
    if (off > SLOPE_OFF).any():
        row = int((off > SLOPE_OFF).argmax()) + 1
        refuse(row, f"camber_slope_f0 {slope[row]:g} and the row before say that the camber changes by "
               f"{np.diff(x)[row - 1] * (slope[row] + slope[row - 1]) / 2:.4f}, camber_f0 changes by "
               f"{np.diff(camber)[row - 1]:.4f}: the slope is d(camber_f0)/d(x_c)")


def form_and_mean_line(x_c, half_thickness, camber, camber_slope, leading_radius, rounding=ROUNDING):
    """FormAndMeanLine through tabulated ordinates.

    Args:
        x_c: (n,) rising from 0 to 1.
        half_thickness: (n,) shares of the greatest thickness; 0 at x/c = 0.
        camber: (n,) shares of the greatest camber; 0 at both ends.
        camber_slope: (n,) d(camber)/d(x/c), kept exactly: by it thickness is laid off; NaN where it is not told.
        leading_radius: radius of the nose times chord / (greatest thickness)^2; along the mean line.
        rounding: how far the ordinates may be off.
    """
    theta = 2 * fixed.arcsin(np.sqrt(x_c))
    inside = (x_c > 0) & (x_c < 1)
    along = np.where(inside, camber_slope * np.sqrt(x_c * (1 - x_c)), np.nan)      # dx/dtheta = sin(theta) / 2
    return FormAndMeanLine(
        half_thickness=fair_spline(theta, half_thickness, rounding, held=Held(zero_derivatives=(ODD, EVEN),
                                   slope_at_start=np.sqrt(leading_radius / 2))),
        camber=fair_spline(theta, camber, rounding, held=Held(zero_derivatives=((0, *EVEN), (0, *EVEN)), slopes=along),
                           sites=np.interp(np.arange(3 * len(theta) - 2) / 3, np.arange(len(theta)), theta)),
        ordinates=(x_c, half_thickness, camber, camber_slope))


def offset_shapes(radii, x_c, face, back, thickness, rounding=ROUNDING):
    """OffsetShapes through the ordinates of face and back.

    Args:
        radii: (m,) r/R, rising.
        x_c, face, back: m arrays of stations, rising from 0 to 1, and ordinates there, any one unit.
        thickness: (m,) greatest thickness in that unit.
        rounding: how far the ordinates may be off, share of the thickness.
    """
    sites = _spread(np.concatenate([2 * fixed.arcsin(np.sqrt(x)) for x in x_c]))
    nose = max(abs(b[0] - f[0]) / t for f, b, t in zip(face, back, thickness))
    is_round = nose <= rounding
    halves, middles = [], []
    for x, low, high, t in zip(x_c, face, back, thickness):
        theta = 2 * fixed.arcsin(np.sqrt(x))
        halves.append(fair_spline(theta, (high - low) / 2 / t, rounding, sites=sites,
                                  held=Held(zero_derivatives=(ODD if is_round else EVEN, EVEN))))
        middles.append(fair_spline(theta, (high + low) / 2 / t, rounding, sites=sites,
                                   held=Held(zero_derivatives=(EVEN, EVEN))))
    laws = lambda splines: fair_spline(radii, np.array([s.c for s in splines]), bending=2)
    return OffsetShapes(knots=halves[0].t, half_laws=laws(halves), middle_laws=laws(middles),
                        has_round_nose=bool(is_round),
                        ordinates=(np.asarray(radii), x_c, [f / t for f, t in zip(face, thickness)],
                                   [b / t for b, t in zip(back, thickness)]))


def _spread(angles):
    """Rising angles from 0 to pi, none closer to the next than CLOSE."""
    kept = [0.0]
    for angle in np.sort(angles):
        if angle - kept[-1] >= CLOSE and np.pi - angle >= CLOSE:
            kept.append(angle)
    return np.r_[kept, np.pi]


def b_series_offsets(blades, thickness_share_of_edges):
    """Ordinates of the Wageningen B-screw sections.

    Args:
        blades: number of blades.
        thickness_share_of_edges: thickness of both edges before they are rounded, share of the greatest.
    Returns:
        (m,) r/R; m arrays each: x/c, face, back; shares of the greatest thickness, from the pitch line.
    """
    under, over = table(DATA / "propeller_bseries_v1.csv"), table(DATA / "propeller_bseries_v2.csv")
    plan, tag = table(DATA / "propeller_bseries_planform.csv"), "Z3" if blades == 3 else "Z4to7"
    known = plan["r_R"] < 1
    peak = fair_spline(plan["r_R"][known], plan[f"b_c_{tag}"][known], bending=2, domain=(0.15, 1.0))
    columns = [name for name in under if name != "r_R"]
    share = np.array([float(name.split("=")[1]) for name in columns])[::-1]         # 1 at the leading edge
    order = np.argsort(under["r_R"], kind="stable")
    radii, x_c, face, back = under["r_R"][order], [], [], []
    for k in order:
        v1, v2 = (np.array([t[name][k] for name in columns])[::-1] for t in (under, over))
        top = peak(under["r_R"][k])
        x_c.append(np.where(share > 0, top * (1 - share), top - share * (1 - top)))
        face.append(v1 * (1 - thickness_share_of_edges))
        back.append((v1 + v2) * (1 - thickness_share_of_edges) + thickness_share_of_edges)
    return radii, x_c, face, back
