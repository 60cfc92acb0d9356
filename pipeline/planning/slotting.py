r"""Slots: the middle line between two facing walls, run down by ramps or level by level, then both walls.

       ______________________
      (  .______________.    |     one end open: levels, from beside the stock
       \____________________ |     both closed: to and fro, down by a ramp
                                   ring: round and round, down by a helix
"""

import math
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from cuspline.planning.context import path_tolerance_mm
from cuspline.planning.contouring import CURVE_SHARE, LOOK_SHARE, SLOT_SHARE, STANDS_MM, over_mm, refuse_blocked, stock_over
from cuspline.planning.pocketing import BESIDE_MM, NAME, alike, floors_and_walls, said_of_walls
from cuspline.planning.strategies.contour import Contour
from cuspline.planning.tool_depth import missing_stick_out_mm
from cuspline.program.program import Moves, MoveWriter, Plane
from cuspline.toolpaths.prismatic.plan_elements import SAME_MM, PlanChain, PlanElement
from cuspline.toolpaths.prismatic.upright_walls import upright_walls
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import CutterDoesNotFit, PlanError

IN_SIZE_MM = 0.004          # a cutter no narrower than the slot by this makes it in size
WIDEST = 1.8                # cutters: a wider slot is a pocket
PARALLEL = 1e-9
RING_PLACES = 16            # where a cutter's reach into a ring is looked at
TURN_RAD = 1e-6             # of a full turn that may be missing
NEAR_MM = 0.05              # steps in which the ends of the middle line are looked for


@dataclass(frozen=True, eq=False, kw_only=True)
class Middle:
    """The middle line of one slot: a line between the ends of its walls, or the circle of a ring."""

    path: PlanChain
    width_mm: float
    low_mm: float               # of its floor
    faces: tuple[int, ...]      # of its walls

    @property
    def places(self):
        """(n, 2) its ends; of a ring all round."""
        return self.path.places(self.path.length_mm / RING_PLACES if self.path.is_closed else self.path.length_mm)


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
        raise PlanError(f"{work.operation.title}: no two straight walls of {work.face_names} face each other, nor two circles "
                        "about one axis: it is for straight slots and rings; give others to pocket")
    tool = _cutter(work, middles)
    made = [_along_middles(work, tool, middles)]
    if any(m.width_mm - tool.cutter.diameter_mm > IN_SIZE_MM for m in middles):
        mine = alike(work.operation, Contour(name=f"{work.operation.title} walls"[:NAME], tool=tool.number,
                                             **said_of_walls(work.operation)))
        more, _ = mine.plan(work.on(mine, faces, [*work.planned, *made]))
        made += more
    return made, work.reached_with(tool)[0] & np.isin(work.samples.face, [*levels, *faces])


def middles_of(walls):
    """Middle values of the pairs of straight or round UprightWalls that face each other, the air between; nearest pairs first."""
    lines = [w for w in walls if w.element.center is None]
    pairs = [m for a, b in combinations(lines, 2) if (m := _between(a, b)) is not None] + _rings(walls)
    out, taken = [], set()
    for middle in sorted(pairs, key=lambda m: m.width_mm / m.path.length_mm):
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
    path = PlanChain(elements=(PlanElement(start=at(low), end=at(high)),), is_closed=False)
    return Middle(path=path, width_mm=width, low_mm=max(a.low_mm, b.low_mm), faces=(a.face, b.face))


def _rings(walls):
    """Middle values of full circles about one axis: of each hollow one and each round one within it, at the same heights."""
    hollow, round_ = ([c for c in _circles(walls) if c[0].element.is_left is side] for side in (True, False))
    found = []
    for outer, inner in product(hollow, round_):
        a, b = outer[0].element, inner[0].element
        width = a.radius_mm - b.radius_mm
        low, high = max(outer[0].low_mm, inner[0].low_mm), min(outer[0].high_mm, inner[0].high_mm)
        if fixed.length(a.center - b.center) < SAME_MM and width > 0 and low < high:
            way = np.array([(a.radius_mm + b.radius_mm) / 2, 0.0])
            ends = (a.center + way, a.center - way)
            halves = tuple(PlanElement(start=p, end=q, center=a.center, is_left=True) for p, q in (ends, ends[::-1]))
            found.append(Middle(path=PlanChain(elements=halves, is_closed=True), width_mm=width, low_mm=low,
                                faces=tuple({w.face for w in (*outer, *inner)})))
    return found


def _circles(walls):
    """[[UprightWall]] of arcs that make up a full circle each."""
    groups = []
    for wall in (w for w in walls if w.element.center is not None):
        e = wall.element
        is_of = lambda o: (fixed.length(o.center - e.center) < SAME_MM and abs(o.radius_mm - e.radius_mm) < SAME_MM
                           and o.is_left == e.is_left)
        group = next((g for g in groups if is_of(g[0].element)), None)
        if group is None:
            groups.append([wall])
        else:
            group.append(wall)
    return [g for g in groups if sum(w.element.sweep_rad for w in g) > 2 * math.pi - TURN_RAD]


def _cutter(work, middles):
    """The largest flat cutter that goes into all slots, and is wide enough for them.

    Raises:
        CutterDoesNotFit: there is none; says of each why.
    """
    least, most, why = min(m.width_mm for m in middles), max(m.width_mm for m in middles), []
    for tool in work.tools("flat"):
        d = tool.cutter.diameter_mm
        tips = np.array([(*place, m.low_mm) for m in middles for place in m.places])
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
        path, opens = (middle.path, (False,)) if middle.path.is_closed else _as_far_as_it_may(work, tool, middle)
        top = float(stock_over(work, path.places(LOOK_SHARE * cutter.radius_mm), cutter.radius_mm).max())
        if top <= middle.low_mm + STANDS_MM:
            continue
        refuse_blocked(work, tool, path, middle.low_mm)
        if any(opens):
            line = path if opens[0] else path.reversed()
            made.append(_level_by_level(work, line.elements[0], (top, middle.low_mm), stepdown, feed))
        else:
            turn = min(stepdown, path.length_mm * float(fixed.tan(ramp)))
            made.append(_down_along(work, tool, path, (top, middle.low_mm), (turn, feed)))
    if not made:
        raise PlanError(f"{operation.title}: nothing stands in the slots: leave the operation out, or give the walls to contour")
    facts = {"stepdown_mm": round(stepdown, 6), "slots": len(made), "widths_mm": sorted({round(m.width_mm, 6) for m in middles}),
             "candidates": []}
    return work.measured(operation.title, tool, rpm, Moves.joined(made), facts)


def _as_far_as_it_may(work, tool, middle):
    """(PlanChain of a straight middle as far as the cutter may run, whether each of its ends is beside the stock)."""
    (begin, first), (end, last) = (_reach(work, tool, middle, sign) for sign in (-1.0, 1.0))
    return PlanChain(elements=(PlanElement(start=begin, end=end),), is_closed=False), (first, last)


def _reach(work, tool, middle, sign):
    """((2,) how far the cutter may run at one end of the middle, whether that is beside the stock)."""
    line, = middle.path.elements
    radius, way, end = tool.cutter.radius_mm, sign * line.heading(0.0), line.end if sign > 0 else line.start
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
    (top, low), begin, end = heights_mm, line.start, line.end
    writer = MoveWriter((*begin, work.clearance_z_mm))
    for z in np.linspace(top, low, math.ceil((top - low) / stepdown_mm - 1e-9) + 1)[1:].tolist():
        writer.rapid((*begin, work.clearance_z_mm))
        writer.rapid((*begin, min(z + work.practice.approach_mm, work.clearance_z_mm)))
        writer.feed((*begin, z), feed)
        writer.feed((*end, z), feed)
        writer.rapid((*end, work.clearance_z_mm))
    return writer.moves()


def _down_along(work, tool, path, heights_mm, how):
    """Down evenly along a line, to and fro, or round and round a ring; and once along it at the bottom."""
    (top, low), (turn_mm, feed), begin = heights_mm, how, path.elements[0].start
    over = max(top, over_mm(work, begin, tool.cutter.radius_mm)) + work.practice.approach_mm
    writer = MoveWriter((*begin, work.clearance_z_mm))
    writer.rapid((*begin, min(over, work.clearance_z_mm)))
    writer.feed((*begin, top), work.practice.plunge_share * feed)
    count = math.ceil((top - low) / turn_mm - 1e-9)
    for k in range(count + 1):
        there = path if path.is_closed or k % 2 == 0 else path.reversed()
        for share, e in enumerate(there.elements, 1):
            z = top + (low - top) * min((k + share / len(there.elements)) / count, 1.0)
            if e.center is None:
                writer.feed((*e.end, z), feed)
            else:
                writer.arc((*e.end, z), (*e.center, writer.here_mm[2]), Plane.XY, not e.is_left, feed)
    writer.rapid((*writer.here_mm[:2], work.clearance_z_mm))
    return writer.moves()
