r"""Holes reamed: a drill a little under their diameter, then a reamer down to the end of the wall and up, both at the feed.

        |:    :|   what the drill leaves on the diameter: least_stock_mm to most_stock_mm
        |:    :|   the reamer ends where the wall ends, break_through_mm below where the hole is open there
"""

import numpy as np

from cuspline.planning import feeds
from cuspline.planning.drilling import (
    SAME_MM,
    Bore,
    Drilled,
    bores_of,
    drilled_by,
    in_words,
    is_drilled,
    made_with,
    operation_of,
    refuse_short,
    retract_mm,
    tip_mm,
    upright_holes,
    walls_of,
)
from cuspline.planning.strategies.drill import Drill
from cuspline.program.drilling import DrillCycle, drilled, shortest_way
from cuspline.shop.fits import UP_TO_MM, limits_mm
from cuspline.values.errors import CamError, CutterDoesNotFit

DRILLED = "H10"             # what drills keep: closer limits ask for a reamer
SPEED_SHARE = 0.5           # of drilling's cutting speed
STANDS_MM = 0.05            # over the end of the wall: less is none


def reamed_holes(work):
    """The operations of a ream operation: ([PlannedOperation], (n,) bool of the samples that it reaches).

    Args:
        work: PlanningContext of an operation with the fields of strategies.ream.Ream.
    Raises:
        PlanError, CutterDoesNotFit: a face that is no wall of a hole, a hole that no reamer fits, or no drill before it.
    """
    bores = bores_of(work)
    holes = [_reamed(work, bore) for bore in bores]
    before, made = {}, []
    for one in holes:
        if not _is_open(work, one):
            drill = _drill_before(work, one)
            before.setdefault(drill.tool.number, []).append(drill)
    for mine in before.values():
        asked = Drill(name=f"{work.operation.title} drill"[:40], break_through_mm=work.operation.break_through_mm,
                      retract_mm=work.operation.retract_mm, coolant=work.operation.coolant)
        made.append(operation_of(work.on(asked, work.wanted, [*work.planned, *made]), mine, number=len(before)))
    by_tool = {}
    for one in holes:
        by_tool.setdefault(one.tool.number, []).append(one)
    made += [_operation(work, mine, len(by_tool)) for mine in by_tool.values()]
    reached = np.zeros(len(work.samples.area_mm2), bool)
    for one in holes:
        reached |= is_drilled(work.samples, one.bore, one.tip_mm)
    return made, reached


def reamable_faces(work, operation, wanted):
    """Which of some faces a reamer is asked for by their dimension, and the library has what makes them.

    Args:
        work: PlanningContext.   operation: the strategies.ream.Ream that would do it.   wanted: indices of faces.
    Returns:
        (indices of walls, of other faces that are made with them, [(faces, why they cannot be reamed)]).
    """
    walls, others, refused = [], [], []
    found = [(hole, wall) for hole in upright_holes(work) for wall in walls_of(hole, wanted) if _asks_for_a_reamer(work, wall)]
    work = work.on(operation, wanted, work.planned) if found else work
    for hole, wall in found:
        bore = Bore(hole=hole, wall=wall, place_mm=work.in_part(hole.mouth_mm))
        try:
            one = _reamed(work, bore)
            _refuse_outside(work, one)
            drill = None if _is_open(work, one) else _drill_before(work, one).tool
        except CamError as error:
            refused.append((wall.faces, str(error)))
            continue
        walls += wall.faces
        others += made_with(work, bore, drill) if drill is not None else []
    return walls, [i for i in others if i in set(wanted)], refused


def _asks_for_a_reamer(work, wall):
    """Whether a wall's diameter has closer limits than a drill keeps."""
    limits = work.diameter_limits_mm(wall)
    if limits is None or 2 * wall.low_radius_mm > UP_TO_MM[-1]:
        return False
    low, high = limits_mm(2 * wall.low_radius_mm, DRILLED)
    return limits[1] - limits[0] < high - low


def _refuse_outside(work, one):
    """A reamer whose own diameter is outside the limits."""
    (low, high), cutter = work.diameter_limits_mm(one.bore.wall), one.tool.cutter
    if not low <= cutter.diameter_mm <= high:
        raise CutterDoesNotFit(f"{work.operation.title}: T{one.tool.number} {cutter.name} does not come within {low:g} to {high:g} "
                               f"mm, the dimension of the hole at {in_words(one.bore.place_mm)}")


def _reamed(work, bore):
    """Drilled of a reamer: the one nearest to the hole's diameter, within what the finish allows."""
    over, under = work.finish.gouge_mm, work.finish.profile_tolerance_mm
    reamers = work.tools("reamer")
    fits = [t for t in reamers if -under - SAME_MM <= t.cutter.radius_mm - bore.radius_mm <= over + SAME_MM]
    if not fits:
        there = ", ".join(f"{t.cutter.diameter_mm:g}" for t in reamers)
        raise CutterDoesNotFit(f"{work.operation.title}: no reamer makes the hole of diameter {2 * bore.radius_mm:.6g} mm at "
                               f"{in_words(bore.place_mm)}; there are {there} mm: add one to the file of --cutters, or give it to "
                               "bore")
    tool = min(fits, key=lambda t: (round(abs(t.cutter.radius_mm - bore.radius_mm), 6), t.number))
    tip = tip_mm(work, bore, tool)
    refuse_short(work, bore, tool, tip)
    return Drilled(bore=bore, tool=tool, tip_mm=tip)


def _is_open(work, one):
    """Whether a hole is there before: nothing stands in its middle above the wall's end."""
    return float(work.stock_mm(np.array([one.bore.xy_mm]))[0]) <= one.bore.low_z_mm + STANDS_MM


def _drill_before(work, one):
    """Drilled of the largest drill that leaves the reamer what it needs.

    Raises:
        CutterDoesNotFit: there is none.
    """
    operation, d = work.operation, one.tool.cutter.diameter_mm
    drills = work.on(Drill(), work.wanted, work.planned).tools("drill")
    fits = [t for t in drills if operation.least_stock_mm - SAME_MM <= d - t.cutter.diameter_mm <= operation.most_stock_mm + SAME_MM
            and not t.cutter.has_flat_bottom]
    if not fits:
        raise CutterDoesNotFit(
            f"{operation.title}: before T{one.tool.number} {one.tool.cutter.name} a drill of {d - operation.most_stock_mm:.6g} to "
            f"{d - operation.least_stock_mm:.6g} mm is needed, and the tool library has none: add one, drill the hole before, "
            "or raise most_stock_mm")
    return drilled_by(work, one.bore, fits[0])


def _operation(work, made, number):
    """The PlannedOperation of the holes of one reamer; `number`: of reamers in the operation."""
    operation, tool = work.operation, made[0].tool
    (speed, share), preset = work.material.drilling, work.preset(tool, False)
    speed = operation.cutting_speed_m_per_min or (preset and preset.cutting_speed_m_per_min) or SPEED_SHARE * speed
    rpm = operation.spindle_rpm or (preset and preset.spindle_rpm) or feeds.spindle_rpm(tool.cutter, speed, work.machine.spindle)
    feed = operation.feed_mm_per_min or feeds.cutting_feed_mm_per_min(tool.cutter, rpm, share / tool.cutter.flutes, work.machine)
    retract = np.array([retract_mm(work, d.bore, tool) for d in made])
    if operation.stays_low:
        retract[:] = retract.max()
    order = shortest_way(np.array([d.bore.xy_mm for d in made])).tolist()
    moves, cycles = drilled([DrillCycle(kind="ream", xy_mm=made[k].bore.xy_mm, bottom_z_mm=float(made[k].tip_mm),
                                        retract_z_mm=float(retract[k]), stays_low=operation.stays_low, feed_mm_per_min=feed,
                                        first=0, end=0) for k in order], work.clearance_z_mm, feed)
    name = operation.title if number == 1 else f"{operation.title} {tool.cutter.diameter_mm:g}"
    facts = {"holes": len(made), "diameter_mm": tool.cutter.diameter_mm, "cycle": "ream",
             "retract_z_mm": round(float(retract.max()), 6), "candidates": []}
    return work.measured_holes(name, tool, rpm, moves, cycles, facts)
