"""Roughing, rest roughing from the stock that it really leaves, and a semi-finish where both leave too much."""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from cuspline.design.operations import Clearing
from cuspline.planning.cutter_choice import (
    choose_rest_roughing,
    choose_roughing,
    leftover_rows,
    missing_when_roughing_mm,
    roughing_tools,
)
from cuspline.planning.level_finishing import UPRIGHT
from cuspline.planning.tool_depth import clear_tips_mm
from cuspline.toolpaths.drop.dropcutter import DropMesh
from cuspline.toolpaths.roughing.level_clearing import ClearingRules, clear, engagement_of_rad
from cuspline.toolpaths.roughing.stock_fields import stock_after
from cuspline.values.errors import NothingToCut

SCRAP_MM = 0.02             # a clearing that nowhere takes off more is left out
LOOKED_AT = 500             # places of it, before all are
SURE_SHARE = 0.95           # of its deepest slot, that a ball takes at once: what stands is known at samples only
LAYER_SHARE = 0.8           # of it, that one takes in each of several layers
RAPIDS_OF_A_LIFT = 3        # up, across, down
HELPS_SHARE = 0.5           # of what a ball would meet: a smaller one that clears before it leaves no more
LEFT_PERCENTILE = 99.5      # of the places finished: what roughing leaves there


@dataclass(frozen=True, eq=False, kw_only=True)
class RoughingStage:
    """What a clearing is called, and what it leaves."""

    name: str
    allowance_mm: float
    threshold_mm: float = 0.0           # what stands less than this above the allowance is left alone
    over_floors_mm: float | None = None     # left on level floors; None: the allowance, as on all else
    is_rough: bool = True               # by its speed and feed
    counts_stops: bool = False          # ways on a level are held against lifts that start and stop, not against their rapids alone
    within: object = None               # function (n, 2) -> (n,) lowest tips that a border of its own allows; None: it has none


def roughed(work, ball, is_reached, semi_finish):
    """The operations before the finish.

    In a hole hardly wider than the ball no helix has room: what stands beside its upright walls, along which passes do not come
    down layer by layer either, is taken by a smaller one.

    Args:
        work: PlanningContext.
        ball: the finishing Tool; what it may take follows from its diameter.
        is_reached: (n,) bool, sample points that it finishes.
        semi_finish: function () -> PlannedOperation.
    Returns:
        list of PlannedOperation.
    """
    low, high = work.stock_min_mm, work.stock_max_mm
    rows = leftover_rows(work.samples)
    rows = rows[is_reached[rows]]
    practice = work.practice
    limit, allowance = practice.finish_depth_share * ball.cutter.diameter_mm, practice.rough_allowance_mm
    tools = roughing_tools(work.library, work.mesh, work.samples, low, high, allowance)
    first, candidates = choose_roughing(tools, allowance)
    stage = RoughingStage(name="rough", allowance_mm=allowance)
    rest = RoughingStage(name="rest rough", allowance_mm=allowance, threshold_mm=practice.rest_threshold_mm)
    operation, stock, left = cleared(work, stage, first.tool, candidates, work.stock_mm, rows, Clearing())
    operations = [operation]
    if left > limit and operation is not None:
        smaller, candidates = choose_rest_roughing(tools, first, left)
        if smaller is not None:
            operation, stock, left = cleared(work, rest, smaller.tool, candidates, stock, rows, Clearing())
            operations.append(operation)
    if _is_too_deep(work, ball, stock, rows):
        operation, stock, left = cleared(work, rest, ball, (), stock, rows, Clearing())
        operations.append(operation)
    upright = rows[~np.isin(work.samples.face[rows], list(work.samples.leaning_faces(UPRIGHT)))]
    for tool in (t for t in work.library.of_type("ball") if t.cutter.diameter_mm < ball.cutter.diameter_mm):
        if not _is_too_deep(work, ball, stock, upright):
            break
        operation, after, left_after = cleared(work, rest, tool, (), stock, rows, Clearing())
        if _met_mm(work, ball, after, upright) <= HELPS_SHARE * _met_mm(work, ball, stock, upright):
            operations.append(operation)
            stock, left = after, left_after
    if left > limit:
        operations += _in_layers(work, semi_finish(), _met_mm(work, ball, stock, rows))
    return [o for o in operations if o is not None]


def _in_layers(work, passes, met_mm):
    """Operations that end with the given one: where it would cut too deep a slot, the same passes come before, lifted."""
    slot_mm = passes.tool.cutter.deepest_slot_mm if passes is not None else math.inf
    if passes is None or passes.passes is not None or met_mm <= SURE_SHARE * slot_mm:
        return [passes]
    count = math.ceil(met_mm / (LAYER_SHARE * slot_mm))
    return [*(_lifted(work, passes, met_mm * k / count) for k in range(count - 1, 0, -1)), passes]


def _lifted(work, operation, by_mm):
    """The same passes so much higher: what is left under them is the next layer's."""
    moves, up = operation.moves, np.array([0.0, 0.0, by_mm])
    lifted = replace(moves, start_mm=moves.start_mm + up, end_mm=moves.end_mm + up, center_mm=moves.center_mm + up)
    return work.measured(f"{operation.name} {by_mm:.1f} mm above", operation.tool, operation.rpm, lifted,
                         {**operation.facts, "lifted_mm": round(by_mm, 3)})


def before_passes(work, ball, is_reached):
    """What a ball must clear before its own passes: [], or the one operation that takes what stands deeper than it cuts a slot.

    Args:
        work: PlanningContext of an operation that lists no clearing for its ball.
        ball: its Tool.   is_reached: (n,) bool, sample points that it finishes.
    """
    rows = leftover_rows(work.samples, is_reached)
    if ball.cutter.type != "ball" or not _is_too_deep(work, ball, work.stock_mm, rows):
        return []
    practice = work.practice
    stage = RoughingStage(name="rest rough", allowance_mm=practice.rough_allowance_mm, threshold_mm=practice.rest_threshold_mm)
    operation, _, _ = cleared(work, stage, ball, (), work.stock_mm, rows, Clearing())
    return [] if operation is None else [operation]


def led_up_to(work, passes, is_reached):
    """The passes of a smaller ball, and before them what it must clear in a gap that no larger cutter enters.

    Args:
        work: PlanningContext after all that is cut before.   passes: its PlannedOperation.   is_reached: (n,) bool, what it adds.
    """
    before = before_passes(work, passes.tool, is_reached)
    return [*before, *_over_slots(work.of(work.operation, [*work.planned, *before]), passes, is_reached)]


def _over_slots(work, passes, is_reached):
    """The passes, before them the same lifted where the ball meets level ground under more than it cuts a slot: what it could not
    clear, for no level has room."""
    rows = leftover_rows(work.samples, is_reached & (work.samples.normal[:, 2] > 1.0 - UPRIGHT))
    return _in_layers(work, passes, _met_mm(work, passes.tool, work.stock_mm, rows))


def standing_mm(work, rows):
    """Heights (k,) of the stock over sample rows (k,), mm along Z."""
    points = work.samples.point_mm[rows]
    return work.stock_mm(points[:, :2]) - points[:, 2]


def before_floors(work, tool, rows):
    """What a cutter must clear before it finishes level faces: ([] or the one operation, heights of the stock after it).

    Args:
        work: PlanningContext of a floor operation.   tool: its Tool.   rows: of the samples on the level faces.
    """
    practice = work.practice
    limit = max(practice.finish_depth_share * tool.cutter.diameter_mm, practice.rough_allowance_mm + practice.rest_threshold_mm)
    if not len(rows) or float(np.percentile(standing_mm(work, rows), LEFT_PERCENTILE)) <= limit:
        return [], work.stock_mm
    stage = RoughingStage(name="rest rough", allowance_mm=practice.rough_allowance_mm, threshold_mm=practice.rest_threshold_mm)
    operation, stock, _ = cleared(work, stage, tool, (), work.stock_mm, rows, Clearing())
    return [] if operation is None else [operation], stock


def _is_too_deep(work, ball, stock, rows):
    return _met_mm(work, ball, stock, rows) > ball.cutter.deepest_slot_mm


def _met_mm(work, ball, stock, rows):
    """How deep a ball would sink into a height field to touch sample rows: what stands in a hole shows here."""
    tips = work.samples.point_mm[rows] + ball.cutter.radius_mm * (work.samples.normal[rows] - (0.0, 0.0, 1.0))
    met = np.maximum(stock(tips[:, :2]) - tips[:, 2], 0.0)
    return float(np.percentile(met, LEFT_PERCENTILE)) if len(rows) else 0.0


def cleared(work, stage, tool, candidates, stock, rows, asked):
    """One clearing.

    Args:
        work: PlanningContext.   stage: RoughingStage.   candidates: for plan.json.
        tool: flat or bull nose; a ball is led as a flat cutter of its diameter, within which it stays.
        stock: height field of what stands.   rows: sample rows at which what it leaves is told.
        asked: design.operations.Clearing with stepdown, stepover and ramp, silent where the shop's count.
    Returns:
        (PlannedOperation or None where nothing is to be removed, height field after it, what it leaves at the sample rows).
    """
    cutter, practice = tool.cutter, work.practice
    rpm, feed = work.speeds(tool, is_rough=stage.is_rough)
    d, is_ball = cutter.diameter_mm, cutter.type == "ball"
    radial = asked.stepover_mm or work.of_preset("stepover_mm", tool) or practice.radial_share * d
    stepdown = work.stepdown_mm(tool, asked)
    rules = ClearingRules(
        mesh=_lowered(work.mesh, stage), radius_mm=d / 2, corner_radius_mm=0.0 if is_ball else cutter.corner_radius_mm,
        ridge_mm=cutter.corner_radius_mm,
        allowance_mm=stage.allowance_mm, stepdown_mm=stepdown, engagement_rad=engagement_of_rad(radial, d / 2),
        stock_mm=stock, stock_min_mm=work.stock_min_mm, stock_max_mm=work.stock_max_mm,
        ramp_rad=math.radians(work.ramp_deg(tool, asked)),
        clearance_z_mm=work.clearance_z_mm, feed_mm_per_min=feed, ramp_feed_mm_per_min=practice.plunge_share * feed,
        rapid_mm_per_min=min(a.rapid_mm_per_min for a in work.machine.axes), threshold_mm=stage.threshold_mm,
        lift_s=_stops_s(work.machine) if stage.counts_stops else 0.0,
        keep_out=(*(f.box_mm for f in work.fixtures if f.is_box), *work.beyond_reach(d / 2)),
        keep_clear=tuple(DropMesh.from_triangles(*f.mesh) for f in work.fixtures if not f.is_box),
        keep_out_mm=practice.keep_out_mm, lowest_mm=_higher_of(_lowest_of(work, tool, stage.allowance_mm), stage.within),
        flutes_mm=cutter.flute_length_mm, relief_mm=cutter.radius_mm - cutter.neck_diameter_mm / 2)
    try:
        clearing = clear(rules)
    except NothingToCut:                # a casting near to its shape: the finish takes it, or a semi-finish before
        return None, stock, _left_mm(work, stock, rows)
    after = stock_after(clearing.moves, d / 2, cutter.corner_radius_mm, stock)
    if not _takes(clearing.lowered_xy_mm, stock, after):
        return None, stock, _left_mm(work, stock, rows)
    left = _left_mm(work, after, rows)
    facts = {"allowance_mm": stage.allowance_mm, "stepdown_mm": rules.stepdown_mm, "stepover_mm": radial,
             "engagement_deg": round(float(np.degrees(rules.engagement_rad)), 1),
             "largest_engagement_deg": round(float(np.degrees(clearing.largest_engagement_rad)), 1),
             "levels": len(clearing.levels_mm), "removed_mm3": round(clearing.removed_mm3, 1),
             "given_up_mm3": round(clearing.left_mm3, 1), "leaves_mm": round(left, 3),
             "candidates": [c.as_dict() for c in candidates]}
    return work.measured(stage.name, tool, rpm, clearing.moves, facts), after, left


def _stops_s(machine):
    """What rapids up, across and down take to start and to stop, beside their lengths at full speed."""
    return RAPIDS_OF_A_LIFT * max(a.rapid_mm_per_min / 60 / a.acceleration_mm_per_s2 for a in machine.axes)


def _takes(xy_mm, stock, after):
    """Whether a height field lies lower than another at one of these places at least.

    Clearing is laid out for a flat cutter; beside a blank that is near to the part a rounded corner may meet nothing.
    """
    few = xy_mm[::max(1, len(xy_mm) // LOOKED_AT)]
    return any((after(places) < stock(places) - SCRAP_MM).any() for places in (few, xy_mm))


def _lowest_of(work, tool, allowance_mm):
    """Function (n, 2) -> (n,) lowest tips that a tool's holder allows; None where it is nowhere in the way."""
    if missing_when_roughing_mm(tool, work.mesh, work.stock_min_mm, work.stock_max_mm, allowance_mm) == 0.0:
        return None
    return partial(clear_tips_mm, tool, work.mesh, stock_mm=allowance_mm)


def _lowered(mesh, stage):
    """A DropMesh of the part, so much lower that levels come as near to its floors as the stage says."""
    if stage.over_floors_mm is None:
        return mesh
    down = stage.allowance_mm + ClearingRules.margin_mm - stage.over_floors_mm
    corners = mesh.corners_mm - np.array([0.0, 0.0, down])
    return DropMesh.from_triangles(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def _higher_of(*bounds):
    """Function (n, 2) -> (n,) of the highest of some such functions; None where all are None."""
    given = [b for b in bounds if b is not None]
    return (lambda xy_mm: np.max([bound(xy_mm) for bound in given], axis=0)) if given else None


def _left_mm(work, stock, rows):
    """What a height field leaves at sample rows, along their normals."""
    points, normals = work.samples.point_mm[rows], work.samples.normal[rows]
    left = np.maximum(stock(points[:, :2]) - points[:, 2], 0.0) * np.abs(normals[:, 2])
    return float(np.percentile(left, LEFT_PERCENTILE)) if len(rows) else 0.0
