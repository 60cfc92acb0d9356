r"""Slots: the middle line between two facing walls, run down by ramps or level by level, then both walls.

       ______________________
      (  .______________.    |     one end open: levels, from beside the stock
       \____________________ |     both closed: to and fro, down by a ramp
"""

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from cuspline.planning.context import path_tolerance_mm
from cuspline.planning.contouring import CURVE_SHARE, LOOK_SHARE, SLOT_SHARE, STANDS_MM, over_mm, refuse_blocked, stock_over
from cuspline.planning.pocketing import BESIDE_MM, NAME, alike, floors_and_walls, said_of_walls
from cuspline.planning.strategies.contour import Contour
from cuspline.planning.tool_depth import missing_stick_out_mm
from cuspline.program.program import Moves, MoveWriter
from cuspline.toolpaths.prismatic.plan_elements import PlanChain, PlanElement
from cuspline.toolpaths.prismatic.upright_walls import upright_walls
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import CutterDoesNotFit, PlanError

IN_SIZE_MM = 0.004          # a cutter no narrower than the slot by this makes it in size
WIDEST = 1.8                # cutters: a wider slot is a pocket
PARALLEL = 1e-9
NEAR_MM = 0.05              # steps in which the ends of the middle line are looked for


@dataclass(frozen=True, eq=False, kw_only=True)
class Middle:
    """The middle line of one slot, between the ends of its walls."""

    start: np.ndarray           # (2,)
    end: np.ndarray             # (2,)
    width_mm: float
    low_mm: float               # of its floor
    faces: tuple[int, int]      # of its two walls

    @property
    def way(self):
        return (self.end - self.start) / fixed.length(self.end - self.start)


def slotted(work):
    """The operations of a slot: ([PlannedOperation], (n,) bool of the samples that it reaches).

    Args:
        work: PlanningContext of an operation with the fields of strategies.slot.Slot.
    Raises:
        PlanError, CutterDoesNotFit: no two walls face each other, no cutter as wide as they are, or a little less.
    """
    levels, faces = floors_and_walls(work, needs_floor=False)        # the neck of a T-slot has none
    walls = upright_walls(work.faces, faces, CURVE_SHARE * path_tolerance_mm(work.finish)) if faces else []
    middles = middles_of(walls)
    if not middles:
        raise PlanError(f"{work.operation.title}: no two straight walls of {work.face_names} face each other: it is for straight "
                        "slots; give others to pocket")
    tool = _cutter(work, middles)
    made = [_along_middles(work, tool, middles)]
    if any(m.width_mm - tool.cutter.diameter_mm > IN_SIZE_MM for m in middles):
        mine = alike(work.operation, Contour(name=f"{work.operation.title} walls"[:NAME], tool=tool.number,
                                             **said_of_walls(work.operation)))
        more, _ = mine.plan(work.on(mine, faces, [*work.planned, *made]))
        made += more
    return made, work.reached_with(tool)[0] & np.isin(work.samples.face, [*levels, *faces])


def middles_of(walls):
    """Middle values of the pairs of straight UprightWalls that face each other, the air between them; nearest pairs first."""
    lines = [w for w in walls if w.element.center is None]
    pairs = [m for a, b in combinations(lines, 2) if (m := _between(a, b)) is not None]
    out, taken = [], set()
    for middle in sorted(pairs, key=lambda m: m.width_mm / fixed.length(m.end - m.start)):
        if not taken & set(middle.faces):
            out.append(middle)
            taken |= set(middle.faces)
    return out


def _between(a, b):
    """Middle of two walls, or None: they do not face each other side by side, or are wider apart than long."""
    d, e = a.element.heading(0.0), b.element.heading(0.0)
    if float((d * e).sum()) > -1.0 + PARALLEL:
        return None
    left = a.element.left(0.0)
    width = float(((b.element.start - a.element.start) * left).sum())
    along = sorted(float(((p - a.element.start) * d).sum()) for p in (b.element.start, b.element.end))
    low, high = max(0.0, along[0]), min(a.element.length_mm, along[1])
    if width <= 0 or high - low < width / 2:
        return None
    at = lambda s: a.element.start + s * d + width / 2 * left
    return Middle(start=at(low), end=at(high), width_mm=width, low_mm=max(a.low_mm, b.low_mm), faces=(a.face, b.face))


def _cutter(work, middles):
    """The largest flat cutter that goes into all slots, and is wide enough for them.

    Raises:
        CutterDoesNotFit: there is none; says of each why.
    """
    least, most, why = min(m.width_mm for m in middles), max(m.width_mm for m in middles), []
    for tool in work.tools("flat"):
        d = tool.cutter.diameter_mm
        tips = np.array([(*m.start, m.low_mm) for m in middles] + [(*m.end, m.low_mm) for m in middles])
        missing = missing_stick_out_mm(tool, tips, work.mesh, 0.0)
        if d > least + IN_SIZE_MM / 2:
            why.append(f"T{tool.number} is wider than {least:.3f} mm")
        elif WIDEST * d < most:
            why.append(f"T{tool.number} is too narrow for {most:.3f} mm")
        elif missing > 0:
            why.append(f"T{tool.number} is {missing:.3f} mm too short")
        else:
            return tool
    raise CutterDoesNotFit(f"{work.operation.title}: no flat cutter makes the slot ({'; '.join(why)}): add one to the file of "
                           "--cutters, or give wide ones to pocket")


def _along_middles(work, tool, middles):
    """The operation that runs along the middles."""
    operation, cutter = work.operation, tool.cutter
    rpm, feed = work.speeds(tool, is_rough=True)
    stepdown = min(work.stepdown_mm(tool), SLOT_SHARE * cutter.deepest_slot_mm)
    ramp = math.radians(min(work.ramp_deg(tool), math.degrees(cutter.steepest_rad)))
    made = []
    for middle in middles:
        ends, opens = zip(*(_reach(work, tool, middle, sign) for sign in (-1.0, 1.0)))
        path = PlanChain(elements=(PlanElement(start=ends[0], end=ends[1]),), is_closed=False)
        top = float(stock_over(work, path.places(LOOK_SHARE * cutter.radius_mm), cutter.radius_mm).max())
        if top <= middle.low_mm + STANDS_MM:
            continue
        refuse_blocked(work, tool, path, middle.low_mm)
        if any(opens):
            line = ends if opens[0] else ends[::-1]
            made.append(_level_by_level(work, line, (top, middle.low_mm), stepdown, feed))
        else:
            turn = min(stepdown, path.length_mm * float(fixed.tan(ramp)))
            made.append(_to_and_fro(work, tool, ends, (top, middle.low_mm), (turn, feed)))
    if not made:
        raise PlanError(f"{operation.title}: nothing stands in the slots: leave the operation out, or give the walls to contour")
    facts = {"stepdown_mm": round(stepdown, 6), "slots": len(made), "widths_mm": sorted({round(m.width_mm, 6) for m in middles}),
             "candidates": []}
    return work.measured(operation.title, tool, rpm, Moves.joined(made), facts)


def _reach(work, tool, middle, sign):
    """((2,) how far the cutter may run at one end of the middle, whether that is beside the stock)."""
    radius, way = tool.cutter.radius_mm, sign * middle.way
    end = middle.end if sign > 0 else middle.start
    far = radius + BESIDE_MM
    steps = np.arange(-radius, far + NEAR_MM, NEAR_MM)
    places = end + steps[:, None] * way
    tight = middle.width_mm - tool.cutter.diameter_mm
    dropper = work.dropper(radius - 0.01 if tight < 2 * left_at_end_mm(work) else radius + left_at_end_mm(work), 0.0, 0.0)
    held = dropper.tips_mm(places) > middle.low_mm + 1e-3
    if held.all():
        raise CutterDoesNotFit(f"{work.operation.title}: T{tool.number} {tool.cutter.name} finds no room at the end of the slot "
                               f"near {work.in_part((*end, middle.low_mm))}: choose a smaller one")
    last = int(held.argmax()) - 1 if held.any() else len(steps) - 1
    place = places[max(last, 0)]
    is_open = not held.any() and bool((stock_over(work, place[None], radius) <= middle.low_mm + STANDS_MM).all())
    return place, is_open


def left_at_end_mm(work):
    """What the walls' pass takes off."""
    asked = work.operation.allowance_mm
    return work.practice.rough_allowance_mm if asked is None else asked


def _level_by_level(work, line, heights_mm, stepdown_mm, feed):
    """Each level from the open end, beside the stock."""
    (top, low), (begin, end) = heights_mm, line
    writer = MoveWriter((*begin, work.clearance_z_mm))
    for z in np.linspace(top, low, math.ceil((top - low) / stepdown_mm - 1e-9) + 1)[1:].tolist():
        writer.rapid((*begin, work.clearance_z_mm))
        writer.rapid((*begin, min(z + work.practice.approach_mm, work.clearance_z_mm)))
        writer.feed((*begin, z), feed)
        writer.feed((*end, z), feed)
        writer.rapid((*end, work.clearance_z_mm))
    return writer.moves()


def _to_and_fro(work, tool, ends, heights_mm, how):
    """Down evenly along the line, and once along it at the bottom."""
    (top, low), (turn_mm, feed) = heights_mm, how
    over = max(top, over_mm(work, ends[0], tool.cutter.radius_mm)) + work.practice.approach_mm
    writer = MoveWriter((*ends[0], work.clearance_z_mm))
    writer.rapid((*ends[0], min(over, work.clearance_z_mm)))
    writer.feed((*ends[0], top), work.practice.plunge_share * feed)
    count = math.ceil((top - low) / turn_mm - 1e-9)
    for k in range(1, count + 2):
        z = top + (low - top) * min(k / count, 1.0)
        writer.feed((*ends[k % 2], z), feed)
    writer.rapid((*writer.here_mm[:2], work.clearance_z_mm))
    return writer.moves()
