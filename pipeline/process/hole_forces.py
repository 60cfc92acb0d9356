r"""Torque, thrust and power of drills and taps, by the specific cutting force that makers publish (docs/formulas.md 11).

       drill   M = k f sin κ (D² - d²) / 8      F = 0.63 k f sin κ (D - d) / 2      κ  half of the point's angle
       tap     M = k p² D / 8                                                       p  pitch

D is the drill's diameter, f its feed a turn, d the hole that an earlier drill has made there; of a spot drill D is no wider than
its point at the end of its way.  Mean figures for sharp edges, as in whole stock: a way through air at the feed counts too.
"""

from dataclasses import asdict, dataclass

import numpy as np

from cuspline.program.program import Kind
from cuspline.values import fixed_math as fixed

THRUST = 0.63             # of the force along the cut on the edges: share that pushes back, chisel edge included
ALONG = 1 - 1e-6          # cosine of a way down the axis
SAME_PLACE_MM, SAME_AXIS = 0.01, 1e-4


@dataclass(frozen=True, kw_only=True)
class HoleLoad:
    """Of one operation that drills or taps: the largest of its strokes."""

    name: str
    tool: int
    does: str                   # drill or tap
    diameter_mm: float
    holes: int                  # places
    rpm: float
    feed_mm_per_turn: float
    torque_n_m: float
    axial_n: float | None       # None: of taps nothing is known
    power_kw: float
    row: int                    # of PostedMoves: where the torque is largest

    def as_dict(self, line):
        """For verify.json, rounded; `line` of the largest torque."""
        tidy = {k: round(v, 4) if isinstance(v, float) else v for k, v in asdict(self).items() if k != "row"}
        return {**{k: v for k, v in tidy.items() if v is not None}, "line": line}


def hole_loads(posted, tools, force):
    """HoleLoad of every operation that drills or taps, in the order of the program.

    Args:
        posted: PostedMoves.   tools: {number: cutters.Tool} as they are, not as simulated.
        force: shop.hole_forces.HoleForce, or None: nothing is known, () comes back.
    """
    if force is None:
        return ()
    strokes, made = _strokes(posted, tools), {}
    loads = [_stroke_load(posted, tools[int(posted.tool[row])].cutter, row, key, made, force) for row, key in strokes]
    numbers = np.array([posted.operation[row] for row, _ in strokes])
    out = []
    for number in dict.fromkeys(numbers.tolist()):
        mine = [k for k in np.flatnonzero(numbers == number).tolist() if loads[k] is not None]
        if mine:
            out.append(_largest(posted, tools, [(*strokes[k], loads[k]) for k in mine]))
    return tuple(out)


def _strokes(posted, tools):
    """[(row, place)] of the moves down an axis at the feed by drills and taps; a place is an axis and where it stands."""
    boring = [n for n, tool in tools.items() if tool.cutter.drills or tool.cutter.type == "tap"]
    way = posted.end_mm - posted.start_mm
    length = np.sqrt((way * way).sum(axis=1))
    down = -(way * posted.end_axis).sum(axis=1)
    rows = np.flatnonzero((posted.kind == Kind.FEED) & np.isin(posted.tool, boring) & (down > ALONG * length) & (down > 0)
                          & (np.abs(posted.spindle_rpm) > 0))
    return [(row, _place(posted.end_mm[row], posted.end_axis[row])) for row in rows.tolist()]


def _place(end_mm, axis):
    """The line that a stroke runs on, alike for strokes on the same line."""
    beside = end_mm - float((end_mm * axis).sum()) * axis
    return tuple(np.round(np.r_[beside / SAME_PLACE_MM, axis / SAME_AXIS]).astype(np.int64).tolist())


def _stroke_load(posted, cutter, row, place, made, force):
    """(torque in Nm, thrust in N or None) of a stroke; None: nothing is known of it.   made: {place: [(diameter, its end)]}."""
    turn = float(posted.feed_mm_per_min[row] / abs(posted.spindle_rpm[row]))
    if cutter.type == "tap":
        return None if force.tap_n_per_mm2 is None else (tap_torque_n_m(cutter, force.tap_n_per_mm2), None)
    way = posted.end_mm[row] - posted.start_mm[row]
    wide = drilled_diameter_mm(cutter, float(np.sqrt((way * way).sum())))
    depth = float((posted.end_mm[row] * posted.end_axis[row]).sum()) + cutter.point_height_mm
    before = max((d for d, low in made.get(place, ()) if low <= depth + SAME_PLACE_MM and d < wide), default=0.0)
    if cutter.type == "drill":
        made.setdefault(place, []).append((wide, depth))
    return drill_load(cutter, wide, before, turn, force.drill_n_per_mm2)


def drilled_diameter_mm(cutter, way_mm):
    """How wide a drill cuts at the end of a way; a spot drill no wider than its point is there."""
    if cutter.type != "spot_drill":
        return cutter.diameter_mm
    return min(cutter.diameter_mm, 2 * way_mm * cutter.cone_slope)


def drill_load(cutter, diameter_mm, before_mm, feed_mm_per_turn, force_n_per_mm2):
    """(torque in Nm, thrust in N) of a drill that widens a hole to a diameter; before_mm: the hole's, 0 where there is none."""
    steep = float(fixed.sin(np.radians(cutter.point_angle_deg) / 2))
    along = force_n_per_mm2 * feed_mm_per_turn * steep
    return (along * (diameter_mm * diameter_mm - before_mm * before_mm) / 8000.0,
            THRUST * along * (diameter_mm - before_mm) / 2)


def tap_torque_n_m(cutter, force_n_per_mm2):
    """Torque of a tap, all of its chamfer in the cut."""
    return force_n_per_mm2 * cutter.pitch_mm * cutter.pitch_mm * cutter.diameter_mm / 8000.0


def _largest(posted, tools, strokes):
    """HoleLoad of one operation's strokes (row, place, (torque, thrust))."""
    row, _, (torque, _) = max(strokes, key=lambda stroke: stroke[2][0])
    rpm, tool = abs(float(posted.spindle_rpm[row])), tools[int(posted.tool[row])]
    thrusts = [thrust for _, _, (_, thrust) in strokes if thrust is not None]
    return HoleLoad(name=posted.operation_name(row), tool=tool.number, does="tap" if tool.cutter.type == "tap" else "drill",
                    diameter_mm=tool.cutter.diameter_mm, holes=len({place for _, place, _ in strokes}), rpm=rpm,
                    feed_mm_per_turn=float(posted.feed_mm_per_min[row]) / rpm, torque_n_m=torque,
                    axial_n=max(thrusts, default=None), row=row,
                    power_kw=max(load[0] * abs(float(posted.spindle_rpm[k])) for k, _, load in strokes) * 2 * np.pi / 60 / 1000)
