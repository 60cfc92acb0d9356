r"""Slots under a neck: measures of T-slots and dovetail slots in the cross-section, cutters that fit, the way in and out.

        neck            T        __|   |__      dovetail   \     /
     __|    |__             high|  neck   |              /  neck  \
    |  ceilings |               |_________|             /__________\
    |___floor___|                  wide                    wide (at the floor)
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.kernel.brep import edge_points, edges_of_faces
from cuspline.planning.contouring import HIGH_MM, STANDS_MM, stock_over
from cuspline.planning.freeform_finishing import SAME_MM
from cuspline.program.program import MoveWriter
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import CutterDoesNotFit, PlanError

IN_SIZE_MM = 0.004          # a cutter no narrower, or lower, than the slot by this makes it in size
LEVEL = 1e-6                # of a normal
LEAN_RAD = 1e-4             # between a dovetail cutter's side and the slot's
NECK_MM = 0.1               # between the cutter's neck and the slot's
BESIDE_MM = 2.0             # of the cutter from the part where it comes down
PLACES = 5                  # along each edge
LOOK_MM = 2.0               # between places along the neck that are looked at


@dataclass(frozen=True, eq=False, kw_only=True)
class Undercut:
    """One slot; places in plan."""

    begin: np.ndarray           # (2,) middle line, where the cutter comes in
    end: np.ndarray             # (2,)
    is_through: bool            # the far end is open too
    wide_mm: float              # at the floor
    high_mm: float              # of the part under the neck
    neck_mm: float              # width of the neck
    low_mm: float               # of the floor
    lean_rad: float             # of its sides to Z; 0: a T

    @property
    def way(self):
        return (self.end - self.begin) / fixed.length(self.end - self.begin)


def undercut(work):
    """The operation: ([PlannedOperation], (n,) bool of the samples that it makes).

    Args:
        work: PlanningContext of an operation with the fields of strategies.t_slot.TSlot.
    Raises:
        PlanError, CutterDoesNotFit: faces that are no such slot, no cutter of its form, no neck yet, no open end.
    """
    slot = _slot(work)
    tool = _cutter(work, slot)
    _refuse_uncut_neck(work, slot)
    rpm, feed = work.speeds(tool, is_rough=True)
    count = 1 if slot.lean_rad else math.ceil((slot.high_mm - IN_SIZE_MM) / tool.cutter.flute_length_mm - 1e-9)
    heights = [slot.low_mm + (slot.high_mm - tool.cutter.flute_length_mm) * k / max(count - 1, 1) for k in range(count)]
    moves = _moves(work, tool, slot, heights, feed)
    facts = {"wide_mm": round(slot.wide_mm, 6), "high_mm": round(slot.high_mm, 6), "neck_mm": round(slot.neck_mm, 6),
             "heights_mm": [round(z, 6) for z in heights], "candidates": []}
    made = work.measured(work.operation.title, tool, rpm, moves, facts)
    return [made], np.isin(work.samples.face, work.wanted)


def _slot(work):
    """The Undercut of the operation's faces.

    Raises:
        PlanError: they are not one.
    """
    normals = {i: work.faces[i].middle.normal[0] for i in work.wanted if work.faces[i].kind == "plane"}
    floors = [i for i, n in normals.items() if n[2] > 1.0 - LEVEL]
    ceilings = [i for i, n in normals.items() if n[2] < LEVEL - 1.0]
    sides = [i for i, n in normals.items() if -1.0 + LEVEL < n[2] < LEVEL]
    across = _across(work, [normals[i] for i in sides])
    points = {i: _points(work.faces[i]) for i in (*floors, *ceilings, *sides)}
    if not floors:
        raise _no_slot(work, "it has no floor")
    low = min(float(points[i][:, 2].min()) for i in floors)
    lean = float(fixed.arcsin(min(max(-normals[sides[0]][2], 0.0), 1.0)))
    if any(abs(float(fixed.arcsin(min(max(-normals[i][2], 0.0), 1.0))) - lean) > LEAN_RAD for i in sides):
        raise _no_slot(work, "its sides lean by different angles")
    if lean == 0.0 and not ceilings:
        raise _no_slot(work, "nothing of it faces down")
    along = np.array([-across[1], across[0]])
    aside = lambda p: p[:, 0] * across[0] + p[:, 1] * across[1]
    ahead = lambda p: p[:, 0] * along[0] + p[:, 1] * along[1]
    foot = {i: aside(points[i][points[i][:, 2] < points[i][:, 2].min() + SAME_MM]).mean() for i in sides}
    left, right = min(foot.values()), max(foot.values())
    middle = (left + right) / 2
    over = np.concatenate([np.abs(aside(points[i]) - middle) for i in (ceilings or sides)])
    high = max(float(points[i][:, 2].max()) for i in (ceilings or sides)) - low
    ends = [float(f(np.concatenate([ahead(points[i]) for i in sides]))) for f in (np.min, np.max)]
    places = [middle * across + s * along for s in ends]
    return _entered(work, places, {"wide_mm": right - left, "neck_mm": 2 * float(over.min()), "high_mm": high, "low_mm": low,
                                   "lean_rad": lean})


def _entered(work, places, sizes):
    """The Undercut with its open end first."""
    is_open = [_is_open(work, a, (a - b) / fixed.length(a - b), sizes) for a, b in (places, places[::-1])]
    if not any(is_open):
        raise _no_slot(work, "no end of it is open: the cutter comes in from beside the part")
    begin, end = places if is_open[0] else places[::-1]
    return Undercut(begin=begin, end=end, is_through=all(is_open), **sizes)


def _is_open(work, end, out, sizes):
    beside = end + out * (sizes["wide_mm"] / 2 + BESIDE_MM)
    tip = work.dropper(sizes["wide_mm"] / 2, 0.0, 0.0).tips_mm(beside[None])[0]
    stock = stock_over(work, beside[None], sizes["wide_mm"] / 2)[0]
    return bool(max(tip, stock) < sizes["low_mm"] + HIGH_MM)


def _across(work, normals):
    """(2,) unit direction in plan, square to both sides.

    Raises:
        PlanError: there are no two sides that face each other.
    """
    flat = [n[:2] / fixed.length(n[:2]) for n in normals]
    if len(flat) < 2 or not any(float((flat[0] * n).sum()) < LEVEL - 1.0 for n in flat[1:]):
        raise _no_slot(work, "no two straight sides of it face each other")
    return flat[0]


def _no_slot(work, why):
    return PlanError(f"{work.operation.title}: the faces {work.face_names} are no T-slot and no dovetail slot: {why}; name its "
                     "floor, both sides and what faces down beside the neck")


def _points(face):
    return np.vstack([edge_points(edge, PLACES)[0] for (_, edge), *_ in edges_of_faces([face])])


def _cutter(work, slot):
    """The widest cutter of the slot's form that goes in, with room for its neck.

    Raises:
        CutterDoesNotFit: there is none; says of each why.
    """
    why = []
    for tool in work.tools("dovetail" if slot.lean_rad else "side"):
        said = _why_not(tool, slot)
        if not said:
            return tool
        why.append(f"T{tool.number} {said}")
    raise CutterDoesNotFit(f"{work.operation.title}: no cutter makes a slot of {slot.wide_mm:.3f} x {slot.high_mm:.3f} mm under a "
                           f"neck of {slot.neck_mm:.3f} mm ({'; '.join(why)}): add one to the file of --cutters")


def _why_not(tool, slot):
    """Why a tool does not make a slot; "" where it does."""
    c = tool.cutter
    aside = max(slot.wide_mm - c.diameter_mm, 0.0) / 2
    if tool.head is not None:
        return "is on an angle head"
    if c.diameter_mm > slot.wide_mm + IN_SIZE_MM:
        return f"is wider than {slot.wide_mm:.3f} mm"
    if aside > c.radius_mm:
        return "is too narrow to reach both sides in two passes"
    if slot.lean_rad and abs(math.radians(c.taper_deg) - slot.lean_rad) > LEAN_RAD:
        return f"leans by {c.taper_deg:g} degrees, the sides by {math.degrees(slot.lean_rad):g}"
    if slot.lean_rad and c.flute_length_mm < slot.high_mm - IN_SIZE_MM:
        return f"has flutes of {c.flute_length_mm:g} mm"
    if not slot.lean_rad and c.flute_length_mm > slot.high_mm + IN_SIZE_MM:
        return f"is higher than {slot.high_mm:.3f} mm"
    if c.neck_diameter_mm / 2 + aside > slot.neck_mm / 2 - NECK_MM:
        return f"has a neck of {c.neck_diameter_mm:g} mm, too thick beside the slot's"
    return ""


def _refuse_uncut_neck(work, slot):
    """
    Raises:
        PlanError: stock stands where the cutter's neck is to go.
    """
    count = max(2, math.ceil(float(fixed.length(slot.end - slot.begin)) / LOOK_MM))
    places = slot.begin + np.linspace(0.0, 1.0, count)[:, None] * (slot.end - slot.begin)
    high = stock_over(work, places, slot.neck_mm / 2 - NECK_MM)
    if (high > slot.low_mm + slot.high_mm + STANDS_MM).any():
        x, y, z = work.in_part((*places[int(high.argmax())], slot.low_mm + slot.high_mm))
        raise PlanError(f"{work.operation.title}: stock stands in the neck at ({x:.3f}, {y:.3f}, {z:.3f}): cut a plain slot there "
                        "before (slot)")


def _moves(work, tool, slot, heights_mm, feed):
    """In along one side and out along the other, a level at a time."""
    radius, way = tool.cutter.radius_mm, slot.way
    left = np.array([-way[1], way[0]])
    aside = max(slot.wide_mm - tool.cutter.diameter_mm, 0.0) / 2
    begin = slot.begin - (max(radius, slot.wide_mm / 2) + BESIDE_MM) * way
    end = slot.end + (max(radius, slot.wide_mm / 2) + BESIDE_MM if slot.is_through else 0.0) * way
    writer = MoveWriter((*(begin - aside * left), work.clearance_z_mm))
    for z in heights_mm:
        writer.rapid((*(begin - aside * left), writer.here_mm[2]))
        writer.rapid((*(begin - aside * left), min(z + work.practice.approach_mm, work.clearance_z_mm)))
        writer.feed((*(begin - aside * left), z), feed)
        for place in (end - aside * left, end + aside * left, begin + aside * left):
            writer.feed((*place, z), feed)
        writer.rapid((*writer.here_mm[:2], work.clearance_z_mm))
    return writer.moves()
