"""What the text alone shows: modes relied on, limits of machine and tool, the path tolerance; nothing is simulated."""

from dataclasses import replace

import numpy as np

from cuspline.program.program import Kind
from cuspline.replay.replay_checks import Reporter
from cuspline.values import fixed_math as fixed
from cuspline.values.amounts import counted
from cuspline.values.errors import ReadError
from cuspline.values.units import MM

CHIP_FACTOR = 2.0         # times the starting value of a material: makers' tables differ by less
RELATIVE = 1e-6           # a limit is exceeded only by more than this: rounding of inch feeds
FAR = 10.0                # times a machine's travel: what goes farther beyond it is not simulated


def text_findings(posted, tools, *, setup, machine, finish, material):
    """Findings of one clamping's program that need no simulation.

    Args:
        posted: PostedMoves.   tools: dict of tool number -> cutters.Tool.
        setup: design.Setup.   machine: machines.Machine.   finish: design.Finish.
        material: shop.materials.Material; None: not known, no feed per tooth is asked.
    Returns:
        tuple of Finding.
    """
    report = Reporter(posted, setup.name, setup.frame)
    remarks = [report.finding(r.kind, r.row, r.amount_mm, posted.end_mm[r.row], r.advice) for r in posted.remarks]
    return (*remarks, *_path_tolerances(report, machine, finish), *_speeds(report, tools, machine),
            *_feeds(report, machine), *_chip_loads(report, tools, material), *_deep_holes(report, tools))


def tolerances_mm(posted, machine):
    """(n,) how far the control may leave the path; inf where the text has not bounded it.

    Args:
        machine: machines.Machine whose parameters stand where the text leaves it to them; None: inf there.
    """
    own = np.inf if machine is None else machine.control.path_tolerance_mm
    return np.where(np.isnan(posted.path_tolerance_mm), own, posted.path_tolerance_mm)


def path_tolerance_mm(posted, machine):
    """The largest of all cutting moves."""
    return float(tolerances_mm(posted, machine)[posted.kind != Kind.RAPID].max(initial=0.0))


def increments_mm(machine):
    """How far the axes may stand from where they are sent, by half of the smallest step of each; 0: not stated."""
    return 0.0 if machine is None else 0.5 * float(fixed.length(np.array([axis.increment_mm for axis in machine.axes])))


def refuse_what_cannot_be_simulated(posted, tools, setup, machine, stock):
    """Refuse a program without moves or tools, or one that goes so far that no machine of this size can be meant.

    Args:
        tools: those that there are, by number.   stock: a value of design.stock.
    Raises:
        ReadError: no move at all; a cutting move without a tool; a place, or the radius of an arc, FAR times as large
            as the travel.
    """
    if not len(posted):
        raise ReadError("the program has no move: write the moves, or leave the setup out")
    _refuse_row(posted, (posted.kind != Kind.RAPID) & ~np.isin(posted.tool, list(tools)),
                lambda row: f"a cutting move, but T{posted.tool[row]} is none of the tools" if posted.tool[row] else
                "a cutting move, but no tool was changed in, T and M6 are missing")
    low, high = stock.shape.box_in(setup.frame)
    for k, (name, axis) in enumerate(zip("XYZ", machine.axes)):
        travel = axis.max_mm - axis.min_mm
        at, tip = posted.machine_end_mm[:, k], posted.end_mm[:, k]
        beyond = np.fmax(np.fmax(axis.min_mm - at, at - axis.max_mm), np.fmax(low[k] - tip, tip - high[k]) - travel)
        _refuse_row(posted, beyond > FAR * travel, lambda row: f"{name}{tip[row]:g} mm is {beyond[row]:g} mm beyond "
                    f"what {machine.name} can reach, whose travel is {travel:g} mm")
    radius = _arc_radii_mm(posted)
    longest = max(axis.max_mm - axis.min_mm for axis in machine.axes)
    _refuse_row(posted, radius > FAR * max(longest, machine.control.arc_max_radius_mm),
                lambda row: f"an arc of radius {radius[row]:g} mm")


def _refuse_row(posted, is_wrong, what):
    rows = np.flatnonzero(is_wrong)
    if len(rows):
        line, call = posted.line[rows[0]], posted.call_line[rows[0]]
        called = f", called in line {call}" if call else ""
        raise ReadError(f"line {line}{called}: {what(rows[0])}: correct the program", rows=[line])


def _arc_radii_mm(posted):
    """(n,) 0 on lines."""
    radii = np.zeros(len(posted))
    for plane in np.unique(posted.plane):
        first, second, _ = ((0, 1, 2), (2, 0, 1), (1, 2, 0))[plane]
        rows = np.flatnonzero((posted.kind > Kind.FEED) & (posted.plane == plane))
        way = posted.end_mm[rows] - posted.center_mm[rows]
        radii[rows] = np.sqrt(way[:, first] * way[:, first] + way[:, second] * way[:, second])
    return radii


def _path_tolerances(report, machine, finish):
    """One finding each tolerance that is set; the finish allows the depth of a gouge."""
    posted = report.posted
    tolerance = np.where(report.is_rapid, 0.0, tolerances_mm(posted, machine))
    for value in np.unique(tolerance[np.isfinite(tolerance) & (tolerance > finish.gouge_mm * (1 + RELATIVE))]):
        rows = np.flatnonzero(tolerance == value)
        yield report.finding("path_tolerance", rows[0], value, posted.end_mm[rows[0]],
                             f"the control may leave the path by {value:g} mm in {counted(len(rows), 'move')} from here, "
                             f"{finish.gouge_mm:g} mm are allowed: tighten G64 P and Q before them, or what the control's "
                             "own parameters allow and the machine's file states")


def _speeds(report, tools, machine):
    """One finding each S word that machine or cutter do not allow; its line is the word's."""
    posted, spindle = report.posted, machine.spindle
    speed = np.abs(posted.spindle_rpm)
    said = {n: t.cutter.max_rpm for n, t in tools.items() if t.cutter.max_rpm is not None}
    allowed = np.array([said.get(n, np.inf) for n in posted.tool.tolist()])
    wrong = (speed > 0) & ((speed < spindle.min_rpm) | (speed > np.fmin(allowed, spindle.max_rpm)))
    first = {}
    for row in np.flatnonzero(wrong).tolist():
        first.setdefault((int(posted.speed_line[row]), int(posted.tool[row])), row)
    for (line, number), row in first.items():
        top = min(spindle.max_rpm, said.get(number, np.inf))
        advice = f"T{number} on {machine.name} runs {spindle.min_rpm:g} to {top:g} rpm: correct the S word"
        found = report.finding("spindle_out_of_range", row, 0.0, posted.end_mm[row], advice)
        yield replace(found, line=line or found.line, amount=float(speed[row]), unit="rpm")


def _feeds(report, machine):
    """Feeds that the machine, or one of its axes along the move, does not run; by more than the post rounds."""
    posted = report.posted
    feed = np.where(report.is_rapid, 0.0, posted.feed_mm_per_min)
    limit = np.minimum(machine.max_feed_mm_per_min, _axis_limits_mm_per_min(posted, machine))
    rounding = 0.5 * MM[machine.control.units] / 10 ** machine.control.decimals_feed
    wrong = np.where(feed > limit * (1 + RELATIVE) + rounding, feed, 0.0)
    for f in report.merged("feed_out_of_range", wrong, posted.end_mm, ~report.is_rapid,
                           f"{machine.name} runs at most {machine.max_feed_mm_per_min:g} mm/min, its axes along this "
                           "move perhaps less: correct the F word"):
        yield replace(f, amount=f.amount_mm, amount_mm=0.0, unit="mm/min")


def _axis_limits_mm_per_min(posted, machine):
    """(n,) speed along the move at which the first axis runs as fast as it can; of an arc any axis may."""
    way = np.abs(np.nan_to_num(posted.end_mm - posted.start_mm))
    length = np.sqrt((way * way).sum(axis=1))
    share = way / np.where(length > 0, length, 1.0)[:, None]
    share[posted.kind > Kind.FEED] = 1.0
    fastest = np.array([axis.rapid_mm_per_min for axis in machine.axes])
    return (fastest / np.maximum(share, 1e-12)).min(axis=1)


def _chip_loads(report, tools, material):
    """Feeds per tooth far beyond the material's."""
    if material is None:
        return
    posted, share = report.posted, material.feed_per_tooth_share
    cutters = {n: t.cutter for n, t in tools.items() if t.cutter.type != "tap"}         # whose pitch is its feed
    teeth, allowed = (np.array([value(cutters[n]) if n in cutters else np.inf for n in posted.tool.tolist()])
                      for value in (lambda c: c.flutes, lambda c: CHIP_FACTOR * share * c.diameter_mm))
    speed = np.abs(posted.spindle_rpm)
    chip = posted.feed_mm_per_min / np.where(speed > 0, speed, 1.0) / teeth
    chip[report.is_rapid | (speed == 0)] = 0.0
    yield from report.merged("chip_load", np.where(chip > allowed * (1 + RELATIVE), chip, 0.0), posted.end_mm,
                             ~report.is_rapid, f"so much a tooth breaks the cutter, {material.name} takes {share:g} of the "
                             f"diameter, {CHIP_FACTOR:g} times that is allowed: lower F, or raise S")


def _deep_holes(report, tools):
    """Drills that go down at the feed farther than they may without coming up."""
    posted = report.posted
    longest = np.array([tools[n].cutter.longest_peck_mm if n in tools else np.inf for n in posted.tool.tolist()])
    if not np.isfinite(longest).any():
        return
    way = np.nan_to_num(posted.end_mm - posted.start_mm)
    down = -(way * posted.end_axis).sum(axis=1)
    is_down = (posted.kind == Kind.FEED) & (down > 0) & np.isfinite(longest)
    so_far = np.cumsum(np.where(is_down, down, 0.0))
    run = np.where(is_down, so_far - np.maximum.accumulate(np.where(is_down, 0.0, so_far)), 0.0)
    yield from report.merged("deep_hole", np.where(run > longest * (1 + RELATIVE), run, 0.0), posted.end_mm, is_down,
                             "so far down at the feed a drill chokes on its chips: drill in pecks (G83, G73), or state unpecked_mm "
                             "of a drill that is cooled through its inside")
