r"""Forces on the cutter out of what its edge meets: elements of the edge, tooth by tooth, all round (docs/formulas.md 11).

       along the cut   F_t = F sin θ        F = (K h + K_e) b     b  length of the element, h  thickness of its chip
       square to it    F_n = F cos θ                              θ  between force and normal
       radial F_n cos σ, axial F_n sin σ    σ = asin(1 - z/r) on a ball: the edge's normal over the horizontal

The cutter turns clockwise seen from its holder, its teeth are straight and evenly spaced.  Mean figures for sharp edges: worn
ones take up to WORN times as much.
"""

from dataclasses import dataclass, fields

import numpy as np

from cuspline.process.engagement import ALONG, FIRST, LAST, OUT, RADIUS, UP, edge_of
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen

ROUND = 48                # positions of a turn, at least
WORN = 3.0                # times the force of a sharp edge
CARBIDE_N_PER_MM2 = 600_000.0       # Young's modulus of solid carbide
CORE_SHARE = 0.8          # of the diameter: a round bar as stiff as the flutes
BLOCK = 256               # places worked out together


@dataclass(frozen=True, eq=False, kw_only=True)
class Forces:
    """On the cutter at the places of an Engagement; one row each."""

    radial_n: np.ndarray        # (n,) largest in a turn, across the axis
    axial_n: np.ndarray         # (n,) largest, towards the spindle
    torque_n_m: np.ndarray      # (n,) largest
    power_kw: np.ndarray        # (n,) mean
    deflection_mm: np.ndarray   # (n,) of the tip across the axis, under the largest force there, spindle and holder stiff

    def __post_init__(self):
        n = len(self.radial_n)
        for f in fields(self):
            object.__setattr__(self, f.name, frozen(getattr(self, f.name), (n,), f.name))


def forces(posted, tools, met, material):
    """Forces of a program's cutting moves.

    Args:
        posted: PostedMoves.   tools: {number: cutters.Tool}.
        met: engagement.Engagement of them.   material: shop.cutting_forces.CuttingForce.
    """
    tool_of, out = posted.tool[met.row], np.zeros((4, len(met.row)))
    bending = np.zeros(len(met.row))
    for number in np.unique(tool_of).tolist():
        tool = tools[number]
        mine = np.flatnonzero(tool_of == number)
        rpm = np.abs(posted.spindle_rpm[met.row[mine]])
        teeth = rpm * tool.cutter.flutes
        per_tooth = np.divide(posted.feed_mm_per_min[met.row[mine]], teeth, out=np.zeros(len(mine)), where=teeth > 0)
        bending[mine] = bending_mm_per_n(tool)
        for begin in range(0, len(mine), BLOCK):
            part = slice(begin, begin + BLOCK)
            some = mine[part]
            out[:, some] = _of_places(edge_of(tool.cutter, met.look)[1], tool.cutter.flutes, (met.arcs[some], met.ends_mm[some]),
                                      met.feed[some], per_tooth[part], rpm[part], material)
    return Forces(radial_n=out[0], axial_n=out[1], torque_n_m=out[2], power_kw=out[3], deflection_mm=out[0] * bending)


def _of_places(rings, flutes, cut, feed, per_tooth, rpm, material):
    """(4, n) radial, axial, torque and power of places of one cutter; `cut`: their arcs and ends."""
    arcs, ends = cut[0][:, :len(rings)], cut[1]
    width = _element_mm(rings[:, ALONG], np.isfinite(arcs[:, :, 0, FIRST]), ends)
    positions = flutes * -(-ROUND // flutes)
    turn = 2 * np.pi * (np.arange(positions) + 0.5) / positions - np.pi
    cosine, sine = fixed.cos(turn), fixed.sin(turn)
    level = np.sqrt(feed[:, 0] * feed[:, 0] + feed[:, 1] * feed[:, 1])
    thick = (rings[:, OUT, None] * cosine)[None] * level[:, None, None] + (rings[:, UP] * feed[:, 2:])[:, :, None]
    with np.errstate(invalid="ignore"):
        inside = ((arcs[..., FIRST, None] <= turn) & (turn <= arcs[..., LAST, None])).any(axis=2)
    chip = np.maximum(thick, 0.0) * per_tooth[:, None, None]
    force = np.where(inside, (material.force_n_per_mm2 * chip + material.edge_n_per_mm) * width[:, :, None], 0.0)
    angle = np.radians(material.force_angle_deg)
    along, square = force * fixed.sin(angle), force * fixed.cos(angle)
    radial = (square * rings[:, OUT, None]).sum(axis=1)
    axial = _all_teeth((square * -rings[:, UP, None]).sum(axis=1), flutes)
    tangential = along.sum(axis=1)
    torque = _all_teeth((along * rings[:, RADIUS, None]).sum(axis=1), flutes) / 1000
    x = _all_teeth(-tangential * sine - radial * cosine, flutes)
    y = _all_teeth(tangential * cosine - radial * sine, flutes)
    power = torque.mean(axis=1) * 2 * np.pi * rpm / 60 / 1000
    return np.array([np.sqrt(x * x + y * y).max(axis=1), axial.max(axis=1), torque.max(axis=1), power])


def _element_mm(along, cuts, ends):
    """(n, rings) length of edge that each ring stands for: half way to its neighbours, the outer ones in the cut to its ends."""
    half = (along[1:] + along[:-1]) / 2
    low, high = np.tile(np.r_[along[0], half], (len(ends), 1)), np.tile(np.r_[half, along[-1]], (len(ends), 1))
    some = np.flatnonzero(cuts.any(axis=1))
    first, last = cuts[some].argmax(axis=1), len(along) - 1 - cuts[some, ::-1].argmax(axis=1)
    low[some, first], high[some, last] = ends[some, 0], ends[some, 1]
    return np.where(cuts, np.maximum(high - low, 0.0), 0.0)


def _all_teeth(of_one, flutes):
    """(n, positions / flutes) sum over teeth that stand evenly round."""
    return of_one.reshape(len(of_one), flutes, -1).sum(axis=1)


def bending_mm_per_n(tool):
    """Deflection of a tool's tip under a force across its axis there, mm/N, as a beam held in its holder.

    Flutes count as a bar of CORE_SHARE of their diameter, all of solid carbide.
    Source: sum of x³/(3 E I) over the tool's sections, x from the tip; I = pi d⁴/64.
    """
    c = tool.cutter
    sections = [(0.0, CORE_SHARE * c.radius_mm, c.flute_length_mm, CORE_SHARE * c.radius_mm)]
    sections += [tuple(row) for row in tool.non_cutting_frusta().tolist() if row[0] < tool.stick_out_mm - 1e-9]
    total = 0.0
    for begin, r0, end, r1 in sections:
        thin = min(r0, r1)                                  # of a cone: no stiffer than its thin end
        total += (_cube(end) - _cube(begin)) / (3 * CARBIDE_N_PER_MM2 * np.pi * _cube(thin) * thin / 4)
    return float(total)


def _cube(x):
    return x * x * x


def limits_of(machine, tool):
    """[(what, unit, field of Forces, limit, where it is stated)] that machine and tool state; none: nothing is checked."""
    spindle = None if machine is None else machine.spindle
    known = [("power", "kW", "power_kw", getattr(spindle, "power_kw", None), "the machine's spindle"),
             ("torque", "Nm", "torque_n_m", getattr(spindle, "torque_n_m", None), "the machine's spindle"),
             ("axial force", "N", "axial_n", getattr(spindle, "axial_n", None), "the machine's spindle"),
             ("force across the axis", "N", "radial_n", tool.cutter.bending_n, "the cutter")]
    return [row for row in known if row[3] is not None]
