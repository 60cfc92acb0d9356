r"""Holes tapped rigidly: which tap, how deep, at which speed.

    |  |  mouth
    |  |  full thread, as deep as stated; the chamfer's threads below it are not full
    |\/|  tip
    |  |  a pitch at least to the end of the wall
     \/   of a blind hole; of a through one the chamfer comes out below
"""

import math

import numpy as np

from cuspline.planning.context import THIN_MM
from cuspline.planning.drilling import SAME_MM, SHARE, Bore, bores_of, in_words, stock_over
from cuspline.planning.tool_depth import missing_stick_out_mm
from cuspline.program.drilling import DrillCycle, drilled, shortest_way
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm
from cuspline.values.errors import CutterDoesNotFit, PlanError

SPEED_SHARE = 0.15          # of drilling: high-speed steel, and a spindle that must turn round at the bottom
STEP_RPM = 10               # of the speed, so that the pitch times it has one decimal
CLEAR_PITCHES = 1.0         # between tip and the end of a blind hole
ABOVE_PITCHES = 3.0         # over the mouth: until then feed and spindle run together
SAME_SHARE = 1e-4           # of a pitch that is the same


def threads_of(work):
    """[(Bore, ThreadedWall)] of every wall among the operation's faces.

    Raises:
        PlanError: a face that is no wall of an upright hole, or one of which no thread is stated.
    """
    by_face = {i: one for one in work.threaded for i in one.wall.faces}
    found = []
    for bore in bores_of(work):
        one = by_face.get(bore.wall.faces[0])
        if one is None:
            raise PlanError(f"{work.operation.title}: no thread is stated of the hole at {in_words(bore.place_mm)}: name its faces "
                            'among the design\'s threads, as {"m6": Thread(size="M6", depth_mm=12)}')
        found.append((bore, one))
    return found


def tapped_holes(work):
    """The operations of a tap operation: ([PlannedOperation], (n,) bool of the samples on its walls).

    Args:
        work: PlanningContext of an operation with the fields of strategies.tap.Tap.
    Raises:
        PlanError, CutterDoesNotFit: a hole without a thread, no tap of its size and hand, a hole too shallow for it, a control
            that does not tap.
    """
    title = work.operation.title
    if not work.machine.control.rigid_tapping:
        raise PlanError(f"{title}: {work.machine.name} does not tap (rigid_tapping = false in its file): mill the threads "
                        "(thread_mill), or choose another machine")
    if work.setup.indexed and not work.machine.is_along_z_turned:
        raise PlanError(f"{title}: {work.machine.name} does not tap in an indexed position, where its tool is along no Z of the "
                        "control: mill the threads (thread_mill), or give them a setup of their own")
    threads, by_tool = threads_of(work), {}
    for bore, one in threads:
        tool = _tap_for(work, one)
        by_tool.setdefault(tool.number, (tool, []))[1].append((bore, one, _tip_mm(work, bore, one, tool)))
    made = [_operation(work, tool, mine, len(by_tool)) for tool, mine in by_tool.values()]
    return made, np.isin(work.samples.face, [i for bore, _ in threads for i in bore.wall.faces])


def _tap_for(work, one):
    """The tap of a thread's diameter, pitch and hand."""
    form, hand = one.thread.form, one.thread.hand
    same = lambda a, b: abs(a - b) < SAME_SHARE * form.pitch_mm
    fits = [t for t in work.library.of_type("tap") if work.is_asked(t) and t.cutter.hand == hand
            and same(t.cutter.diameter_mm, form.nominal_mm) and same(t.cutter.pitch_mm, form.pitch_mm)]
    if not fits:
        there = ", ".join(t.cutter.name for t in work.library.of_type("tap")) or "none"
        raise CutterDoesNotFit(f"{work.operation.title}: no tap cuts the thread {one.in_words}; taps there are: {there}: add one "
                               "to the file of --cutters, or mill the thread (thread_mill)")
    return max(fits, key=lambda t: (-t.cutter.chamfer_mm, t.cutter.flute_length_mm, -t.number))


def _tip_mm(work, bore, one, tool):
    """Height of the tip at the bottom.

    Raises:
        CutterDoesNotFit: the hole is too shallow for the tap's chamfer, or the tap is too short.
        PlanError: material of the part stands in its way.
    """
    cutter, title = tool.cutter, work.operation.title
    tip = bore.high_z_mm - one.depth_mm - cutter.chamfer_mm
    least = bore.low_z_mm + CLEAR_PITCHES * cutter.pitch_mm
    if one.is_open:
        radius = SHARE * cutter.body.radius_mm
        least = max(float(drop_tips_mm(work.mesh, np.array([bore.xy_mm]), r, 0.0)[0]) for r in (THIN_MM, radius))
    if tip < least - SAME_MM:
        raise CutterDoesNotFit(f"{title}: thread {one.in_words}, {one.depth_mm:.3f} mm deep, takes the tip of T{tool.number} "
                               f"{cutter.name} {least - tip:.3f} mm too far down: a chamfer of {cutter.chamfer_mm:g} mm and a "
                               "stay below it; deepen the hole, state less depth_mm, take a tap with a shorter chamfer, or mill "
                               "the thread")
    missing = max(one.depth_mm + cutter.chamfer_mm - cutter.reach_mm,
                  missing_stick_out_mm(tool, np.array([[*bore.xy_mm, tip]]), work.mesh, 0.0))
    if missing > SAME_MM:
        raise CutterDoesNotFit(f"{title}: T{tool.number} {cutter.name} is {missing:.3f} mm too short for the thread "
                               f"{one.in_words}: take a longer tap, or more stick-out")
    return tip


def speed_rpm(work, tool):
    """Speed of a tap, in steps of STEP_RPM, no faster than the machine feeds: the operation's, its preset's, the material's."""
    spindle, wish, preset = work.machine.spindle, work.operation.spindle_rpm, work.preset(tool, False)
    speed = work.operation.cutting_speed_m_per_min
    if wish is None and speed is None and preset is not None:
        wish, speed = preset.spindle_rpm, preset.cutting_speed_m_per_min
    wanted = wish or (speed or SPEED_SHARE * work.material.drilling[0]) * 1000.0 / (math.pi * tool.cutter.diameter_mm)
    most = min(spindle.max_rpm, tool.cutter.max_rpm or math.inf, work.machine.max_feed_mm_per_min / tool.cutter.pitch_mm)
    rpm = min(max(wanted, spindle.min_rpm), most)
    return float(math.ceil(spindle.min_rpm) if rpm < spindle.min_rpm + STEP_RPM else STEP_RPM * math.floor(rpm / STEP_RPM + 1e-9))


def _operation(work, tool, mine, number):
    """The PlannedOperation of one tap; `mine`: (Bore, ThreadedWall, height of the tip)."""
    operation, pitch = work.operation, tool.cutter.pitch_mm
    rpm = speed_rpm(work, tool)
    feed, sign = rpm * pitch, mine[0][1].thread.sign
    order = shortest_way(np.array([bore.xy_mm for bore, _, _ in mine]))
    cycles = [_cycle(work, *mine[k], sign * pitch, feed) for k in order.tolist()]
    moves, cycles = drilled(cycles, work.clearance_z_mm, feed)
    name = operation.title if number == 1 else f"{operation.title} {mine[0][1].thread.form.name}"
    facts = {"holes": len(mine), "thread": mine[0][1].thread.in_words, "pitch_mm": pitch,
             "tap_drill_mm": round(mine[0][1].thread.form.tap_drill_mm, 6),
             "depth_mm": round(max(one.depth_mm for _, one, _ in mine), 6), "candidates": []}
    return work.measured_taps(name, tool, rpm, moves, cycles, facts)


def _cycle(work, bore: Bore, one, tip_mm, pitch_mm, feed):
    """The DrillCycle of one hole."""
    above = work.operation.retract_mm or max(work.practice.approach_mm, ABOVE_PITCHES * abs(pitch_mm))
    top = max(float(stock_over(work, bore, SHARE * bore.radius_mm).max()), bore.high_z_mm)
    return DrillCycle(kind="tap", xy_mm=bore.xy_mm, bottom_z_mm=tip_mm, retract_z_mm=min(top + above, work.clearance_z_mm),
                      pitch_mm=pitch_mm, feed_mm_per_min=feed, first=0, end=0)
