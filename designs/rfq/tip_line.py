r"""The tip line of a whole vane: cells put one behind the other, their joints blended, and a spline through it all.

    each cell's own tip       ___                ___
                             /   \__  step      /
    the vane's               ‾‾‾‾   ‾‾\________/       from mid-cell to mid-cell value, slope and bend meet in the mean

Two neighbouring cells have their own a, m and L, so their tips meet with a small step.  Half of it is given to each,
over the half cell beside the joint (over no more than the neighbour's half where a segment is much longer); in mid-cell
the tip is the cell's own.  x is the table's Z, mm from the wall where the beam enters.
"""

from dataclasses import dataclass, replace
from typing import Callable

import numpy as np
from scipy.optimize import brentq

from cuspline.designs.rfq.eight_term import EightTerm
from cuspline.designs.rfq.potential import MATCHING_ROOT, Transition, TwoTerm, equipotential_matcher_mm, thin_matcher_mm
from cuspline.splines.spline_interpolation import interpolated, natural
from cuspline.toolpaths.vane.circular_tip import CircularTip, greville_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

DEGREE = 5
JOINT_KNOTS = 3                 # of one place: the blend is smooth to the second derivative there
SPANS_A_HALF_CELL = 4           # knot spans to begin with
FIT_MM = 1e-4                   # from the blended line and radius; the B-rep's poles are the spline's own
FIT_ROUNDS = 5                  # doublings of a segment's spans
LOOKS_A_SPAN = 12               # between two knots, at which the fit is measured
LOOKS_A_VANE = 20001            # at which a vane is asked for what cannot be: 65 um apart on 1.3 m
LEAST_VANE_MM = 1.0             # a shorter one is a slip of from_mm and to_mm
MATCHING = "matching section"
THIN_POWER = 1.5                # of the sine in the thin-vane formula
LEAST_SHARE = 1e-3              # of the matching section's length: no vane stands nearer to the wall
FALLS_AT = 2001                 # places at which a matching section is asked whether it falls
ROUNDING_SHARE = 1e-9           # of an aperture: what arithmetic leaves
MUCH_LONGER = 1.5               # than its neighbour: then the blend reaches only as far as the neighbour's
DIFFERENCE = 1 / 400            # of a segment: step of the differences that give slope and bend at its ends


@dataclass(frozen=True, kw_only=True)
class Segment:
    """One cell's own tip; functions of (n,) mm from its beginning."""

    name: str                   # "cell 36", "matching section"
    start_mm: float
    length_mm: float
    aperture_mm: Callable       # distance of the crest from the axis
    radius_mm: float            # transverse radius of the tip
    spans: int = SPANS_A_HALF_CELL

    def ends(self):
        """((value, slope, bend) at the beginning, the same at the end)."""
        h = DIFFERENCE * self.length_mm
        rows = []
        for at in (0.0, self.length_mm):
            f = self.aperture_mm(at + h * np.arange(-3, 4))
            slope = fixed.matmul(f, [-1, 9, -45, 0, 45, -9, 1]) / (60 * h)
            bend = fixed.matmul(f, [2, -27, 270, -490, 270, -27, 2]) / (180 * h * h)
            rows.append(np.array([f[3], slope, bend]))
        return rows


@dataclass(frozen=True, eq=False, kw_only=True)
class TipLine:
    """Aperture r(x) and transverse radius R(x) of one vane, blended."""

    segments: tuple[Segment, ...]
    from_mm: float              # the vane begins
    to_mm: float                # and ends here, x of the table

    def __post_init__(self):
        ends = [s.ends() for s in self.segments]
        jumps = [b[0] - a[1] for a, b in zip(ends, ends[1:])]
        steps = [b.radius_mm - a.radius_mm for a, b in zip(self.segments, self.segments[1:])]
        none, lengths = np.zeros(3), [s.length_mm for s in self.segments]
        reach = lambda own, other: own / 2 if own <= MUCH_LONGER * other else other / 2
        object.__setattr__(self, "reaches_mm", [        # of the blends at each segment's beginning and end
            (reach(own, before), reach(own, behind))
            for before, own, behind in zip([lengths[0], *lengths], lengths, [*lengths[1:], lengths[-1]])])
        object.__setattr__(self, "_before", [none, *(-j / 2 for j in jumps)])      # what a segment's beginning gives
        object.__setattr__(self, "_behind", [*(j / 2 for j in jumps), none])
        object.__setattr__(self, "_radius_before", [0.0, *(-s / 2 for s in steps)])
        object.__setattr__(self, "_radius_behind", [*(s / 2 for s in steps), 0.0])

    def segment_at(self, x_mm):
        """(n,) or scalar: number of the segment that holds each x; beyond the ends the nearest."""
        starts = [s.start_mm for s in self.segments]
        return np.clip(np.searchsorted(starts, x_mm, side="right") - 1, 0, len(starts) - 1)

    def _by_segment(self, x_mm, at):
        """Values of a function (segment number, its segment, local z) of the segment that holds each x."""
        x, owner = np.asarray(x_mm, float), self.segment_at(x_mm)
        out = np.empty(len(x))
        for k in np.unique(owner):
            rows = owner == k
            out[rows] = at(k, self.segments[k], x[rows] - self.segments[k].start_mm)
        return out

    def own_aperture_mm(self, x_mm):
        """(n,) what the cell's own potential gives, without blending."""
        return self._by_segment(x_mm, lambda k, s, z: s.aperture_mm(z))

    def aperture_mm(self, x_mm):
        """(n,) distance of the crest from the beam axis."""
        def at(k, s, z):
            before, behind = self.reaches_mm[k]
            return (s.aperture_mm(z) + _blend(self._before[k], 1 - z / before, -before)
                    + _blend(self._behind[k], 1 - (s.length_mm - z) / behind, behind))
        return self._by_segment(x_mm, at)

    def radius_mm(self, x_mm):
        """(n,) transverse radius of the tip."""
        def at(k, s, z):
            before, behind = self.reaches_mm[k]
            return (s.radius_mm + _blend(np.array([self._radius_before[k], 0, 0]), 1 - z / before, -before)
                    + _blend(np.array([self._radius_behind[k], 0, 0]), 1 - (s.length_mm - z) / behind, behind))
        return self._by_segment(x_mm, at)

    def cell_at(self, x_mm):
        """Name of the segment that holds x."""
        return self.segments[int(self.segment_at(x_mm))].name

    def largest_blend(self):
        """(mm, name of the segment): how far at most the blended tip lies from the cell's own."""
        worst = max(((self._blend_of(k), k) for k in range(len(self.segments))), default=(0.0, 0))
        return worst[0], self.segments[worst[1]].name

    def _blend_of(self, k):
        s = self.segments[k]
        x = s.start_mm + s.length_mm * np.linspace(0.0, 1.0 - 1e-12, 101)
        x = x[(x >= self.from_mm) & (x <= self.to_mm)]
        return float(np.abs(self.aperture_mm(x) - self.own_aperture_mm(x)).max(initial=0.0))


def _blend(gives, share, reach_mm):
    """Quintic that leaves nothing at share 0 and value, slope, bend as given at share 1; nothing below 0.

    Args:
        gives: (3,) value, slope, bend by x.
        share: (n,) from where the blend begins (0) to the joint (1).
        reach_mm: x over share; negative toward the cell's beginning.
    """
    value, slope, bend = gives[0], gives[1] * reach_mm, gives[2] * reach_mm * reach_mm
    c0, c1 = value, slope - 3 * value
    c2 = (bend - 6 * c0 - 6 * c1) / 2
    t = np.clip(share, 0.0, None)
    return t * t * t * (c0 + c1 * (t - 1) + c2 * (t - 1) ** 2)


# segments of a table --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, kw_only=True)
class TipLaws:
    """What the cells' tips follow."""

    law: str                    # "two_term" or "eight_term"
    matcher: str                # "thin" or "equipotential": the matching section's profile
    radius_of: Callable         # function (r0_mm of a cell) -> transverse radius of its tip


def tip_line(table, laws, *, vane, entry_aperture_mm, from_mm, to_mm):
    """The tip line of one vane.

    Args:
        table: CellTable.   laws: TipLaws.
        vane: "x" begins the first accelerating cell at its narrowest, "y" at its widest.
        entry_aperture_mm: the vane begins where the matching section has opened to this.
        from_mm, to_mm: cut to this range of the table's Z.
    Raises:
        DesignError: a cell whose tip cannot be; names it.
    """
    segments, first, radius_of, matcher = [], 0.0, laws.radius_of, laws.matcher
    matching, place = table.of_kind("matching"), 0.0
    sign = 1 if vane == "x" else -1
    if matching:
        place = sum(c.length_mm for c in matching)
        r0 = matching[-1].aperture_mm
        follows = matcher == "thin" and not follows_thin_formula(table)
        aperture = through_apertures(table) if follows else _matcher(matcher, place, r0)
        segments.append(Segment(name=MATCHING, start_mm=0.0, length_mm=place, radius_mm=radius_of(r0),
                                aperture_mm=aperture, spans=4 * SPANS_A_HALF_CELL))
        first = _opening_of(aperture, place, r0, entry_aperture_mm) if follows else _opening_mm(
            place, r0, entry_aperture_mm)
    last = None
    for cell in table.cells:
        if cell.kind == "accelerating":
            last = _named(cell, lambda: TwoTerm(aperture_mm=cell.aperture_mm, modulation=cell.modulation,
                                                length_mm=cell.length_mm))
            tip = last if laws.law == "two_term" else _named(cell, lambda: EightTerm.fitted(last, radius_of(last.r0_mm)))
            aperture, radius = _of(tip, sign), radius_of(last.r0_mm)
            sign = -sign
        elif cell.kind == "transition":
            tip = Transition(aperture_mm=last.aperture_mm, modulation=last.modulation, r0_mm=cell.aperture_mm,
                             length_mm=cell.length_mm)
            aperture, radius = _of(tip, sign), radius_of(cell.aperture_mm)
        elif cell.kind == "straight":
            aperture, radius = (lambda z, a=cell.aperture_mm: np.full_like(z, a)), radius_of(cell.aperture_mm)
        else:
            continue
        segments.append(Segment(name=f"cell {cell.number}", start_mm=place, length_mm=cell.length_mm,
                                aperture_mm=aperture, radius_mm=radius))
        place += cell.length_mm
    low, high = max(from_mm, first), min(to_mm, place)
    if high - low < LEAST_VANE_MM:
        raise DesignError(f"the vane reaches from {first:.3f} to {place:.3f} mm of the table; from_mm {low:g} and "
                          f"to_mm {high:g} leave nothing of it")
    return TipLine(segments=tuple(segments), from_mm=low, to_mm=high)


def _of(tip, sign):
    return lambda z: tip.tip_mm(z, sign)


def _named(cell, make):
    try:
        return make()
    except DesignError as error:
        raise DesignError(f"cell {cell.number}: {error}") from None


def _matcher(kind, length_mm, r0_mm):
    """Aperture of the matching section; the thin-vane formula where the equipotential has no root."""
    thin = lambda z: thin_matcher_mm(np.maximum(z, LEAST_SHARE * length_mm), length_mm, r0_mm)
    if kind == "thin":
        return thin
    # from the first root on the two are blended in their logarithms, over a sixth of the section
    low, high = MATCHING_ROOT + 0.01, MATCHING_ROOT + 0.01 + 1 / 6
    z = length_mm * np.linspace(low, 1.02, 161)
    mirrored = np.where(z > length_mm, 2 * length_mm - z, z)        # even about its end
    ratio = fixed.log(equipotential_matcher_mm(mirrored, length_mm, r0_mm) / thin(mirrored))
    spline = interpolated(z, ratio, DEGREE)

    def aperture(at):
        at = np.asarray(at, float)
        share = np.clip((at / length_mm - low) / (high - low), 0.0, 1.0)
        rise = share * share * share * (10 - 15 * share + 6 * share ** 2)
        return thin(at) * fixed.exp(rise * spline(np.clip(at, z[0], z[-1])))

    return aperture


def follows_thin_formula(table):
    """Whether the matching cells' own apertures are the thin-vane formula's, within what the table's digits leave open."""
    ends, apertures = _matching_ends(table)
    length, r0 = ends[-1], apertures[-1]
    angle = np.pi * ends / (2 * length)
    slope = 1.5 * apertures * np.pi / (2 * length) * np.abs(fixed.cos(angle)) / fixed.sin(angle)
    printed = 2 * table.half("a") + slope * 2 * table.half("L") * np.arange(1, len(ends) + 1)
    return bool((np.abs(apertures - thin_matcher_mm(ends, length, r0)) <= printed + ROUNDING_SHARE * apertures).all())


def _matching_ends(table):
    """((n,) ends, (n,) apertures there) of the matching cells."""
    cells = table.of_kind("matching")
    return np.cumsum([c.length_mm for c in cells]), np.array([c.aperture_mm for c in cells])


def through_apertures(table):
    """Function z (n,) -> aperture (n,) through the matching cells' own apertures at their ends.

        a = r0 / sin(pi z / 2 L)^p

    with p a natural spline of ln sin through the values that the table asks for: constant where it follows a power,
    1.5 for the thin-vane formula.  Level at the end, as the cells behind go on.

    Raises:
        DesignError: an aperture that does not lie below the one before and above r0, or between two of which the line
            would not fall; names the cell.
    """
    cells = table.of_kind("matching")
    ends, apertures = _matching_ends(table)
    length, r0 = float(ends[-1]), float(apertures[-1])
    for before, cell in zip(cells, cells[1:]):
        if not cell.aperture_mm < before.aperture_mm:
            raise DesignError(f"{table.name}, cell {cell.number}: its aperture {cell.aperture_mm:.4f} mm is not below the "
                              f"{before.aperture_mm:.4f} mm of matching cell {before.number}: the section narrows towards "
                              "the beam; correct column a")
    depth = lambda z: fixed.log(fixed.sin(np.pi * np.clip(z, LEAST_SHARE * length, length) / (2 * length)))
    at = depth(ends[:-1])
    powers = -fixed.log(apertures[:-1] / r0) / at if len(at) else np.zeros(0)
    if len(at) < 2:
        power = lambda s: np.full_like(s, powers[0] if len(powers) else THIN_POWER)
    else:
        spline = natural(at, powers)
        power = lambda s: spline(np.maximum(s, at[0]))      # nearer to the wall the first cell's power goes on
    aperture = lambda z: r0 * fixed.exp(-depth(np.asarray(z, float)) * power(depth(np.asarray(z, float))))
    z = length * np.linspace(LEAST_SHARE, 1.0, FALLS_AT)
    rises = np.flatnonzero(np.diff(aperture(z)) > 0)
    if len(rises):
        cell = cells[int(np.searchsorted(ends, z[rises[0]]))]
        raise DesignError(f"{table.name}, cell {cell.number}: no smooth line falls through its aperture "
                          f"{cell.aperture_mm:.4f} mm and those of its neighbours; correct column a")
    return aperture


def _opening_of(aperture, length_mm, r0_mm, aperture_mm):
    """Where a falling matching section has the given aperture; where it begins if it never is so wide."""
    if aperture_mm <= r0_mm:
        raise DesignError(f"entry_aperture_mm {aperture_mm:g} must exceed r0 = {r0_mm:.4f} mm")
    wide = lambda z: float(aperture(np.array([z]))[0]) - aperture_mm
    low = LEAST_SHARE * length_mm
    return low if wide(low) <= 0 else float(brentq(wide, low, length_mm, xtol=1e-12))


def _opening_mm(length_mm, r0_mm, aperture_mm):
    """Where the thin matching section has the given aperture."""
    if aperture_mm <= r0_mm:
        raise DesignError(f"entry_aperture_mm {aperture_mm:g} must exceed r0 = {r0_mm:.4f} mm")
    return 2 * length_mm / np.pi * fixed.arcsin(fixed.power(r0_mm / aperture_mm, 2 / 3))


# the spline -----------------------------------------------------------------------------------------------


def fitted_tip(line, axis_z_mm, flank_half_angle_rad, half_width_mm):
    """CircularTip of a tip line, base at z = 0 and the beam axis at z = axis_z_mm.

    Centre height and radius are interpolated at the Greville abscissae of one knot row, so that a B-rep with these
    poles has x as its parameter; spans are halved until both are closer than FIT_MM everywhere.

    Args:
        line: TipLine.
        half_width_mm: the flanks reach down to where they are so wide.
    """
    spans = [s.spans for s in line.segments]
    for _ in range(FIT_ROUNDS):
        knots = _knots(line, spans)
        greville = greville_mm(knots, DEGREE)
        radius = line.radius_mm(greville)
        values = np.column_stack([axis_z_mm - line.aperture_mm(greville) - radius, radius])
        splines = interpolated(greville, values, DEGREE, knots)
        looks = _looks(knots)
        exact = np.column_stack([axis_z_mm - line.aperture_mm(looks) - line.radius_mm(looks), line.radius_mm(looks)])
        miss = np.abs(splines(looks) - exact).max(axis=1)
        worst = np.zeros(len(spans))
        np.maximum.at(worst, line.segment_at(looks), miss)
        if worst.max() < FIT_MM:
            return _tip(knots, splines.c, flank_half_angle_rad, half_width_mm)
        spans = [2 * n if w >= FIT_MM else n for n, w in zip(spans, worst)]
    raise DesignError(f"the tip line at x = {looks[miss.argmax()]:.3f} mm ({line.cell_at(looks[miss.argmax()])}) is "
                      f"not smooth enough for a spline: it is missed by {miss.max() * 1e3:.3f} um")


def _tip(knots, poles, angle, half_width_mm):
    tip = CircularTip(degree=DEGREE, knots_mm=knots, center_poles_mm=poles[:, 0], radius_poles_mm=poles[:, 1],
                      flank_half_angle_rad=angle, foot_z_mm=0.0)
    y, z = tip.tangency_mm(_looks(knots))
    return replace(tip, foot_z_mm=float((z - (half_width_mm - y) / fixed.tan(angle)).min()))


def _knots(line, spans):
    """Clamped knots from one end of the vane to the other: three of them at joints and where blends begin."""
    rows = [np.repeat(line.from_mm, DEGREE + 1)]
    for segment, count, (before, behind) in zip(line.segments, spans, line.reaches_mm):
        half = segment.length_mm / 2
        breaks = np.unique(np.round([0.0, before, half, 2 * half - behind, 2 * half], 9)) + segment.start_mm
        for low, high in zip(breaks[:-1], breaks[1:]):
            low, high = max(low, line.from_mm), min(high, line.to_mm)
            if high - low < 1e-6:
                continue
            count_here = max(1, round(count * (high - low) / half))
            rows.append(low + (high - low) * np.arange(1, count_here) / count_here)
            rows.append(np.repeat(high, JOINT_KNOTS))
    rows[-1] = np.repeat(line.to_mm, DEGREE + 1)
    return np.concatenate(rows)


def _looks(knots):
    """Places between the knots."""
    breaks = np.unique(knots)
    share = (np.arange(LOOKS_A_SPAN) + 0.5) / LOOKS_A_SPAN
    return (breaks[:-1, None] + share * np.diff(breaks)[:, None]).ravel()


# what cannot be -------------------------------------------------------------------------------------------


def refuse_impossible(line, other, half_width_mm, flank_deg, axis_z_mm):
    """Vanes that meet their neighbours, or whose body is narrower than their tip.

    Args:
        line: TipLine of the vane;  other: of the vanes beside it.
        half_width_mm, flank_deg, axis_z_mm: body, flanks and height of the beam axis.
    Raises:
        DesignError: names the cell.
    """
    x = np.linspace(line.from_mm, line.to_mm, LOOKS_A_VANE)
    r, R = line.aperture_mm(x), line.radius_mm(x)
    widest = int(np.argmax(R))
    if R[widest] * fixed.cos(np.radians(flank_deg)) >= half_width_mm:
        raise DesignError(f"{line.cell_at(x[widest])}: the tip of radius {R[widest]:.4f} mm is wider than the body of "
                          f"{2 * half_width_mm:g} mm: raise thickness_mm or lower rho_mm")
    low = int(np.argmin(r))
    if r[low] <= 0:
        raise DesignError(f"{line.cell_at(x[low])}: the tip crosses the beam axis: lower the modulation or raise a")
    # two circles at right angles: centres r + R from the axis each
    gap = fixed.hypot(r + R, other.aperture_mm(x) + other.radius_mm(x)) - R - other.radius_mm(x)
    near = int(np.argmin(gap))
    if gap[near] <= 0:
        raise DesignError(f"{line.cell_at(x[near])}: neighbouring vanes run into each other (gap {gap[near]:.4f} mm at "
                          f"x = {x[near]:.3f} mm): lower rho_mm or the modulation")
