"""Clean-up passes: closer passes round places where a check has found more left than the finish allows.

The check measures on the exact faces what the posted program leaves; its places come back here and are cut again with
the largest ball that touches them: the plan's own balls first, then smaller ones of the library.  What no upright one comes to,
since its shank or holder is in the way, is cut with the tool axis of the operation that finished the face.
"""

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from cuspline.planning.context import path_tolerance_mm, ridge_for_step_mm
from cuspline.planning.freeform_finishing import (
    ASIDE_MM,
    HANGS,
    LATERAL_SHARE,
    NODES_A_STEP,
    flat_step_mm,
    link_rules,
    wall_paths_at,
)
from cuspline.planning.leaning_finishing import leaned, middle_tolerance_mm
from cuspline.planning.tool_depth import too_short
from cuspline.program.program import Moves
from cuspline.toolpaths.five_axis.tool_axes import FastestAxis, ToolAxis
from cuspline.toolpaths.freeform.parallel_passes import parallel_curves
from cuspline.toolpaths.freeform.plane_curves import PlaneCurve
from cuspline.toolpaths.freeform.tip_field import tip_field
from cuspline.toolpaths.freeform.tip_paths import PathRules, tip_paths
from cuspline.values import fixed_math as fixed
from cuspline.values.clusters import clusters_of
from cuspline.values.errors import PlanError, ToolpathError

BEYOND_STEPS = 0.75         # of the finish's own step: passes run that far beyond a place
GROUP_STEPS = 6.0           # places nearer to each other than that are cut together
TOUCH_SHARE = 0.5           # of the cusp: a ball held off its place by less than this and a ridge of CLOSER leave less than it
NEIGHBOURS = 9              # of a place, itself among them, whose balls are compared
TOGETHER = 0.3              # of the places' distance: balls nearer to each other than this stand in a fillet as round as they are
THIN_STEPS = 0.25           # of a step: middles nearer than this are one
LONE_STEPS = 0.1            # that a pass through a single place is long
CLOSER = 0.25               # of the finish's ridge in the first round, the square of it in the second


def clean_up(work, operations, places_mm, left_mm, number):
    """Operations that cut places again, closer.

    Args:
        work: PlanningContext.
        operations: PlannedOperation values so far.
        places_mm: (n, 3) points of the faces wanted, part as it lies in its setup.
        left_mm: the most that stands there.
        number: of the round, from 1.
    Returns:
        (list of PlannedOperation, (n,) bool: places that some ball touches).
    """
    ridge_mm = float(fixed.power(CLOSER, number)) * ridge_for_step_mm("clean-up", work.finish.scallop_mm, work.finish)
    foot = work.closest.closest_points(places_mm)
    open_, added = np.ones(len(places_mm), bool), []
    for tool, how in _ways(work, operations):
        mine = open_ & _touched(how, tool, foot, left_mm)
        moves, is_cut = _moves(how, tool, foot.point_mm[mine], foot.normal[mine], ridge_mm, left_mm)
        if moves is not None:
            open_[np.flatnonzero(mine)[is_cut]] = False
            rpm, _ = how.speeds(tool, is_rough=False)
            facts = {"allowance_mm": 0.0, "scallop_mm": work.finish.scallop_mm, "ridge_for_step_mm": round(ridge_mm, 6),
                     "stepover_mm": round(flat_step_mm(tool, ridge_mm), 6), "places": int(is_cut.sum()),
                     "segment_tolerance_mm": path_tolerance_mm(work.finish), "candidates": []}
            name = f"clean-up {number}"
            if how.tool_axis is not None:
                name, facts["tool_axis"] = f"{name} leaning", how.operation.tool_axis.model_dump(mode="json")
            added.append(how.measured(name, tool, rpm, moves, facts))
        if not open_.any():
            break
    return added, ~open_


def _ways(work, operations):
    """(Tool, PlanningContext) one after the other as they are tried: balls that may clean up, upright, then along tool axes."""
    balls = _balls(work, operations)
    upright = work if work.tool_axis is None else work.of(work.operation.model_copy(update={"tool_axis": None}), operations)
    yield from ((tool, upright) for tool in balls)
    for operation in _leaning(work):
        leaning = work.of(operation, operations)
        yield from ((tool, leaning) for tool in balls)


def _leaning(work):
    """Operations of the setup along whose tool axes a ball may clean up."""
    return [o for o in work.setup.operations if isinstance(o.tool_axis, ToolAxis) and not isinstance(o.tool_axis, FastestAxis)]


def _balls(work, operations):
    """Balls that may clean up: those that finish already, then what the library has below them; largest first."""
    finishing = {o.tool.number for o in operations if o.tool.cutter.type == "ball" and o.tool.head is None}
    used = {t.number: t for t in work.library.tools if t.number in finishing}
    largest = max((t.cutter.radius_mm for t in used.values()), default=math.inf)
    others = [t for t in work.library.of_type("ball") if t.number not in used and t.cutter.radius_mm <= largest]
    by_size = lambda tools: sorted(tools, key=lambda t: (-t.cutter.radius_mm, t.number))
    return by_size(used.values()) + by_size(others)


def _touched(work, tool, foot, left_mm):
    """(n,) bool: the ball touches the place, with nothing else in its way and its holder clear; one that leans its own faces,
    whatever is in the way of its holder upright."""
    if work.tool_axis is not None:
        return np.isin(foot.face, work.wanted) & _fits(work, tool, foot)
    return _fits(work, tool, foot) & (_missing_mm(work, tool, foot, left_mm) <= 0)


def squarely_touched(work, operations, places_mm, left_mm):
    """How squarely some ball that may clean up touches places of a part.

    Args:
        work, operations, places_mm, left_mm: see `clean_up`.
    Returns:
        (n,) cosine between normal and tool axis; -inf: no ball touches it.
    """
    foot = work.closest.closest_points(places_mm)
    is_touched = np.zeros(len(places_mm), bool)
    for tool in _balls(work, operations):
        is_touched |= _touched(work, tool, foot, left_mm)
    return np.where(is_touched, foot.normal[:, 2], -np.inf)


def why_out_of_reach(work, operations, places_mm, left_mm):
    """In words, why no ball cleans up places (n, 3): the stick-out that would do, where that is all that is missing."""
    foot = work.closest.closest_points(places_mm)
    short = []
    for tool in _balls(work, operations):
        fits = _fits(work, tool, foot)
        if fits.any():
            short.append((float(_missing_mm(work, tool, foot, left_mm)[fits].max()), -int(fits.sum()), tool))
    leaning = ", ".join(dict.fromkeys(o.title for o in _leaning(work)))
    also = f"; along the tool axis of {leaning} none comes there either" if leaning else ""
    if not short:
        return f"no ball of the library touches these places: other faces keep it off{also}"
    missing, _, tool = min(short, key=lambda row: (row[1], row[0]))
    if missing <= 0.0:
        return f"no pass of T{tool.number} {tool.cutter.name} comes about there{also}"
    return (f"T{tool.number} {tool.cutter.name} {'upright ' if leaning else ''}is {too_short(tool, missing)}: a stick-out of "
            f"{tool.stick_out_mm + missing:.1f} mm would do, or flutes so much longer where its neck is in the way: set it in the "
            f"file of --cutters{also}")


def _tips_mm(tool, foot):
    return foot.point_mm + tool.cutter.radius_mm * (foot.normal - (0.0, 0.0, 1.0))


def _missing_mm(work, tool, foot, left_mm):
    """(n,) stick-out that a ball lacks at places."""
    return work.missing_mm(tool, _tips_mm(tool, foot), left_mm)


def _fits(work, tool, foot):
    """(n,) bool: the ball alone touches the place.

    It is dropped beside the place: on an upright wall it would stand on the wall's top.  By a hair, or by as little as it may be
    held off: over the wall's rim, where that leans out.  Where it is held up it is off the place by little on a wall, by all of
    that on level ground.
    """
    radius, up, tips = tool.cutter.radius_mm, foot.normal[:, 2], _tips_mm(tool, foot)
    held_mm, fits = TOUCH_SHARE * work.finish.scallop_mm, np.zeros(len(tips), bool)
    dropper = work.dropper(radius, radius, 0.0)
    for aside_mm in (ASIDE_MM, held_mm):
        beside = tips[:, :2] + aside_mm * foot.normal[:, :2]
        lifted = np.maximum(dropper.tips_mm(beside) - tips[:, 2], 0.0)
        off_mm = np.sqrt(radius ** 2 + 2.0 * radius * up * lifted + lifted ** 2) - radius
        fits |= off_mm <= held_mm
    return fits & (up > -HANGS)


def _moves(work, tool, places_mm, normals, ridge_mm, left_mm):
    """(Moves round places, group by group, None where none come about; (n,) bool: places they are for)."""
    is_cut = np.zeros(len(places_mm), bool)
    if not len(places_mm):
        return None, is_cut
    finish, radius = work.finish, tool.cutter.radius_mm
    wide = flat_step_mm(tool, ridge_for_step_mm("clean-up", finish.scallop_mm, finish))
    step, tolerance = flat_step_mm(tool, ridge_mm), middle_tolerance_mm(work, tool)
    rules = PathRules(tolerance_mm=tolerance, lateral_mm=LATERAL_SHARE * step, bridge_mm=0.0)
    _, feed = work.speeds(tool, is_rough=False)
    dropper, beyond, moves = work.dropper_with(tool, 0.0), BEYOND_STEPS * wide, []
    for group in clusters_of(places_mm, GROUP_STEPS * wide):
        tips = places_mm[group] + radius * normals[group]
        low, high = tips.min(axis=0) - beyond, tips.max(axis=0) + beyond
        tree = cKDTree(places_mm[group])
        near = lambda points: tree.query(points)[0] <= beyond
        field = tip_field(dropper, work.wanted, (low + radius, high - radius), step / NODES_A_STEP, may_be_empty=True)
        paths = _from_above(field, near, ridge_mm, rules, step)
        paths += _round_walls(work, field, tips[:, 2] - radius, normals[group], near, step, tolerance)
        paths += _along_fillets(work, field, places_mm[group], tips, rules, step)
        if not paths:
            continue
        link = link_rules(work, tool, field, tolerance, step, feed, work.practice.rough_allowance_mm + left_mm)
        with suppress(PlanError, ToolpathError):        # the tool is in the way however it leans: the next one is tried
            moves.append(leaned(work, [paths], link, tool).moves)
            is_cut[group] = True
    return Moves.joined(moves) if moves else None, is_cut


def _from_above(field, near, ridge_mm, rules, step_mm):
    """Parallel passes over the nodes whose contacts lie near."""
    seeds = field.is_inside.copy()
    seeds[seeds] = near(field.contact_mm[seeds])
    if not seeds.any():
        return []
    region = field.narrowed(seeds, step_mm / 2)
    return tip_paths(parallel_curves(region, 0.0, ridge_mm), region, rules)


def _along_fillets(work, field, places_mm, middles_mm, rules, step_mm):
    """Passes whose ball stands in a fillet as round as itself: at all its places in the same middle, which no other pass comes by.

    Args:
        places_mm, middles_mm: (n, 3) places and the ball's middles where it touches them.
    """
    fall_together = _fall_together(places_mm, middles_mm)
    if not fall_together.any():
        return []
    _, first = np.unique(np.floor(middles_mm[fall_together] / (THIN_STEPS * step_mm)), axis=0, return_index=True)
    curves = [PlaneCurve(xy_mm=line[:, :2]) for line in _chained(middles_mm[fall_together][np.sort(first)], step_mm)]
    anywhere = replace(field, wanted=tuple(range(len(work.faces))), rest_mm=np.zeros(field.rest_mm.shape),
                       is_inside=np.ones(field.is_inside.shape, bool))
    return tip_paths(curves, anywhere, rules)


def _fall_together(places_mm, middles_mm):
    """(n,) bool: the ball's middles lie much nearer to each other than some of the places round each."""
    count = min(NEIGHBOURS, len(places_mm))
    if count < 2:
        return np.zeros(len(places_mm), bool)
    apart, near = cKDTree(places_mm).query(places_mm, count)
    apart, near = apart[:, 1:], near[:, 1:]
    of_middles = np.linalg.norm(middles_mm[near] - middles_mm[:, None], axis=2)
    return (of_middles < TOGETHER * apart).any(axis=1)


def _chained(points_mm, gap_mm):
    """[(k, 3)] points (n, 3) in rows from neighbour to neighbour within a gap in plan; a lone one goes a bit on, as do those that
    stand one above another in an upright fillet."""
    left, lines = np.ones(len(points_mm), bool), []
    while left.any():
        start = np.flatnonzero(left)
        at = int(start[((points_mm[start] - points_mm[start].mean(axis=0)) ** 2).sum(axis=1).argmax()])
        line = []
        while at >= 0:
            left[at] = False
            line.append(points_mm[at])
            away = np.where(left, np.sqrt(((points_mm[:, :2] - points_mm[at, :2]) ** 2).sum(axis=1)), np.inf)
            at = int(away.argmin()) if away.min(initial=np.inf) <= gap_mm else -1
        is_lone = np.ptp(np.array(line)[:, :2], axis=0).max() < LONE_STEPS * gap_mm
        lines.append(np.array([line[0], line[0] + (LONE_STEPS * gap_mm, 0.0, 0.0)] if is_lone else line))
    return lines


def _round_walls(work, field, tips_z_mm, normals, near, step_mm, tolerance_mm):
    """Waterlines at the heights of the places that stand steeper than the setup's limit."""
    steep = normals[:, 2] < fixed.cos(math.radians(work.operation.waterline_deg))
    if not steep.any():
        return []
    low, high = tips_z_mm[steep].min() - step_mm, tips_z_mm[steep].max() + step_mm
    heights = np.linspace(high, low, math.ceil((high - low) / step_mm) + 1)
    return wall_paths_at(work, field, heights, tolerance_mm, step_mm, near)
