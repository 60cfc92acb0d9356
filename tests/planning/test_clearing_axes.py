"""Passes whose axis turns out of the way: beside a wall, in a channel between two twisted walls, down a blade's sides."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from standing_walls import FLOOR_MM, UPRIGHT, Standing, design, mill

from cuspline.app.catalogue import find_library
from cuspline.design import StockSkin
from cuspline.design.fixtures import FixtureBox
from cuspline.design.stock import settled
from cuspline.kernel import brep
from cuspline.planning.clean_up import clean_up, why_out_of_reach
from cuspline.planning.clearing_axes import RotaryUse
from cuspline.planning.context import PlanningContext
from cuspline.planning.leaning_finishing import normal_error
from cuspline.planning.plan import plan_setup
from cuspline.planning.tool_depth import HOLDER_CLEARANCE_MM
from cuspline.program.program import Kind, tilt_rad
from cuspline.replay.clearance import ToolMoves, shank_and_holder, tool_segments
from cuspline.shop.machines import Body, Box
from cuspline.shop.practice import Practice
from cuspline.toolpaths.five_axis.clear_axes import AxisSearch
from cuspline.toolpaths.five_axis.even_turns import even_angles
from cuspline.toolpaths.five_axis.tool_axes import ClearingAxis, LeadTilt
from cuspline.values.errors import CutterDoesNotFit, PlanError

LIBRARY = find_library(None)


def planned(part, machine="mill_trunnion_ac", fixtures=()):
    """Its finishing operation alone, on a stock that stands over the part by less than roughing leaves."""
    left = settled(StockSkin(skin_mm=0.2), brep.the_solid(part.solid), Practice())
    finish = part.setups[0].operations[1]
    setup = part.setups[0].model_copy(update={"operations": (finish,), "fixtures": fixtures})
    return plan_setup(replace(part, stock=left), setup, mill(machine) if isinstance(machine, str) else machine, LIBRARY)


@cache
def beside_the_wall():
    return planned(design(Standing(form="wall", tall_mm=48.0)))


@cache
def in_the_channel():
    """70 mm deep, a tool 42 mm out of its holder: far inside nothing clears it."""
    return planned(design(Standing(form="channel", tall_mm=70.0, floor_mm=20.0), ClearingAxis(up_to_deg=15.0)))


def spare_mm(plan):
    """How far shank, holder and spindle head keep off the part over every move, by the proof of whole moves."""
    operation, work = plan.operations[-1], plan.context
    moves, tool = operation.moves, operation.tool
    axes = np.vstack([moves.axis[:1], moves.axis])
    way = ToolMoves(start_tips_mm=moves.starts_mm, end_tips_mm=moves.end_mm, start_axes=axes[:-1], end_axes=axes[1:])
    rest = tool_segments(tool, with_flutes=False)
    found = work.clearance_tree.certified_clearance(rest, way, work.practice.rough_allowance_mm)
    return found.clearance_mm.min() if found.is_clear.all() else -math.inf


def test_an_upright_tool_is_too_short_and_a_clearing_one_leans_no_more_than_it_must():
    """Tilted straight away from the wall, no point of the holder's outline may be nearer to it than wanted."""
    with pytest.raises(CutterDoesNotFit, match="neck, shank or holder would touch"):
        planned(design(Standing(form="wall", tall_mm=48.0), LeadTilt()))
    plan = beside_the_wall()
    operation, keep = plan.operations[-1], plan.context.practice.rough_allowance_mm + 0.01 + HOLDER_CLEARANCE_MM
    tool = operation.tool
    z0, r0, z1, r1, _ = next(row for row in tool_segments(tool, with_flutes=False) if row[0] >= tool.stick_out_mm)
    share, angle = np.linspace(0, 1, 200)[:, None], np.radians(np.arange(0, 30, 0.01))
    r, z = r0 + share * (r1 - r0), z0 + share * (z1 - z0) - 4.0
    beside, above = 4.0 - (r * np.cos(angle) - z * np.sin(angle)), z * np.cos(angle) + r * np.sin(angle) - 44.0
    is_met = np.hypot(np.maximum(beside, 0.0), np.maximum(above, 0.0)) < keep
    least = np.degrees(angle[is_met.any(axis=0)].max())
    clearing = operation.facts["clearing"]
    assert least < clearing["largest_deg"] < least + 0.5          # 0.05 mm in hand
    assert operation.facts["links"] == "zig-zag" and operation.facts["largest_turn_deg"] <= 2.001
    assert "left_mm2" not in clearing and spare_mm(plan) > plan.context.practice.rough_allowance_mm


def test_clean_up_passes_lean_where_the_operation_that_finished_the_face_does_and_only_there():
    """Far from the wall a place is cut upright, beside it along the operation's axis; with one that stands it is left."""
    plan = beside_the_wall()
    work, floor = plan.context, np.array([[x, y, FLOOR_MM] for x in (-10.8, -10.0, 8.0, 9.0) for y in (-1.0, 0.0, 1.0)])
    (upright, leaning), touched = clean_up(work, plan.operations, floor, 0.1, 1)
    assert touched.all() and (upright.moves.axis == (0, 0, 1)).all()
    assert (upright.name, leaning.name) == ("clean-up 1", "clean-up 1 leaning")
    most = plan.operations[-1].facts["clearing"]["largest_deg"]
    assert 5.0 < np.degrees(tilt_rad(leaning.moves.axis)).max() < most + 0.5
    for made, of in ((upright, floor[6:]), (leaning, floor[:6])):
        radius = made.tool.cutter.radius_mm
        axes, tips = np.vstack([made.moves.axis[:1], made.moves.axis]), np.vstack([made.moves.start_mm, made.moves.end_mm])
        middles = tips + radius * axes
        share = np.linspace(0.0, 1.0, 50)[:, None, None]
        along = (middles[:-1] + share * np.diff(middles, axis=0)).reshape(-1, 3)
        left = np.linalg.norm(along[:, None] - of, axis=2).min(axis=0) - radius
        assert -work.finish.gouge_mm < left.min() and left.max() < work.finish.scallop_mm
    standing = work.setup.operations[0].model_copy(update={"tool_axis": None})
    held = PlanningContext(work.design, work.setup.model_copy(update={"operations": (standing,)}), work.machine, LIBRARY)
    (alone,), touched = clean_up(held, plan.operations, floor, 0.1, 1)
    assert touched.tolist() == [False] * 6 + [True] * 6 and (alone.moves.axis == (0, 0, 1)).all()
    why, where_it_leans = (why_out_of_reach(c, plan.operations, floor[:6], 0.1) for c in (held, work))
    assert " is " in why and "upright" not in why
    also = f"; along the tool axis of {plan.operations[-1].name} none comes there either"
    assert where_it_leans == why.replace(" is ", " upright is ", 1) + also


def test_far_from_the_wall_the_axis_stands():
    moves = beside_the_wall().operations[-1].moves
    far = (moves.kind == Kind.FEED) & (moves.end_mm[:, 0] > 12.0)
    assert far.sum() > 10 and np.abs(moves.axis[far] - (0, 0, 1)).max() < 1e-9


def test_a_bearing_goes_on_as_it_was_where_a_pass_crosses_a_floor_from_fillet_to_fillet():
    """Toward the normal is to the left on one side and to the right on the other: along the floor the axis leans one way."""
    plan = planned(design(Standing(form="channel", foot_mm=5.0), ClearingAxis(around=UPRIGHT)))
    facts = plan.operations[-1].facts
    assert facts["clearing"]["largest_deg"] > 20.0 and facts["largest_turn_deg"] < 2.001
    assert "left_mm2" not in facts["clearing"] and spare_mm(plan) > plan.context.practice.rough_allowance_mm


def test_holder_and_shank_keep_off_the_stairs_that_roughing_leaves_on_walls_beside_the_floor():
    """Brute force: poses of the cut against points of the stock as roughing leaves it, which stands up to 0.9 mm off the walls."""
    part = design(Standing(form="channel", foot_mm=5.0))
    plan = plan_setup(part, part.setups[0], mill(), LIBRARY)
    rough, finish = plan.operations
    work, moves, tool = plan.context.of(part.setups[0].operations[1], (rough,)), finish.moves, finish.tool
    x, y = np.meshgrid(np.arange(-30, 30, 0.1), np.arange(-14, 14, 0.1), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), work.stock_mm(np.column_stack([x.ravel(), y.ravel()]))])
    foot = work.closest.closest_points(points)
    stairs = points[(foot.distance_mm > 0.4) & (points[:, 2] > FLOOR_MM + 10.0)]
    assert len(stairs) > 1000 and foot.distance_mm.max() > 0.8
    for rows, keep in zip(shank_and_holder(tool), (0.0, HOLDER_CLEARANCE_MM)):
        for tip, axis in zip(moves.end_mm[::3], moves.axis[::3]):
            arm = stairs - tip
            high = arm @ axis
            off = np.sqrt(np.maximum((arm * arm).sum(axis=1) - high * high, 0.0))
            for z0, r0, z1, r1, _ in rows:
                share = np.clip((high - z0) / (z1 - z0), 0.0, 1.0)
                out = np.maximum(off - (r0 + share * (r1 - r0)), 0.0)
                assert np.hypot(out, np.maximum(np.maximum(z0 - high, high - z1), 0.0)).min() >= keep


def test_what_no_axis_clears_is_not_cut_but_listed_with_the_cutter_that_would():
    plan = in_the_channel()
    operation, account = plan.operations[-1], plan.accounts[-1].as_dict()
    clearing = operation.facts["clearing"]
    assert 0.0 < clearing["left_mm2"] <= account["area_left_mm2"] + 0.01 and "no axis within 15 degrees" in account["why"]
    left = operation.left.rows
    places = plan.context.samples.point_mm[left]
    cut = operation.moves.end_mm[operation.moves.end_mm[:, 2] < FLOOR_MM + 8.0] + 4.0 * operation.moves.axis[
        operation.moves.end_mm[:, 2] < FLOOR_MM + 8.0] - (0.0, 0.0, 4.0)
    away = np.sqrt(((places[:, None, :2] - cut[None, :, :2]) ** 2).sum(axis=2)).min(axis=1)
    assert np.median(away) > 0.5                    # nothing runs over the middle of what is left out
    reached_by = clearing["reached_by"]
    assert reached_by["stick_out_mm"] > operation.tool.stick_out_mm or reached_by["diameter_mm"] < 8.0
    assert spare_mm(plan) > plan.context.practice.rough_allowance_mm


def test_the_cutter_that_is_named_reaches_what_was_left():
    """The tool with that stick-out, as the shop would make it, over the samples that were left, every axis within 15 degrees."""
    plan = in_the_channel()
    operation, work = plan.operations[-1], plan.context
    named, tool = operation.facts["clearing"]["reached_by"], operation.tool
    assert named["diameter_mm"] == 8.0
    cutter = tool.cutter.model_copy(update={"overall_length_mm": 200.0})
    longer = tool.model_copy(update={"stick_out_mm": named["stick_out_mm"], "cutter": cutter})
    some = np.flatnonzero(operation.left.rows)
    normals = work.samples.normal[some]
    middles, keep = work.samples.point_mm[some] + 4.0 * normals, work.practice.rough_allowance_mm + 0.01
    angles = [AxisSearch.of_tool(work.obstacle_tree, t, into_mm=0.03, keep_mm=keep)
              .over_both_rad(middles, normals, normals, math.radians(15.0))[0] for t in (tool, longer)]
    reached = [np.isfinite(a).mean() for a in angles]
    assert len(some) > 5 and reached[1] > 0.9 > reached[0], reached


def test_down_the_sides_of_a_blade_an_upright_axis_turns_only_where_it_must():
    plan = planned(design(Standing(form="blade", tall_mm=46.0), ClearingAxis(around=UPRIGHT), scallop_mm=0.3))
    facts = plan.operations[-1].facts
    assert 0.0 < facts["clearing"]["turned_mm"] < 0.5 * facts["length_mm"] and facts["lean_deg"][0] == 0.0
    assert spare_mm(plan) > plan.context.practice.rough_allowance_mm


def test_a_turn_that_sets_in_at_once_is_evened_out_until_the_rotaries_follow():
    """A wall's end comes up beside the pass: the least angle jumps; over more stations the same rise asks for less speed."""
    plan = beside_the_wall()
    facts = plan.operations[-1].facts
    assert facts["rotary_share"] <= 1.0 and facts["rotary_reversals"] <= 2 * facts["passes"]
    along = 0.5 * np.arange(200)
    least = np.where((along > 40) & (along < 60), 0.3, 0.0)
    use = RotaryUse(chain=mill().kinematics, clamped=lambda axes: axes, feed_mm_per_s=20.0)
    axes = lambda angles: np.column_stack([np.sin(0.2 + angles), 0 * angles, np.cos(0.2 + angles)])
    shares = [use.of(axes(even_angles(least, window)), along)[0] for window in (0, 4, 16, 64)]
    assert shares[0] > 1.0 > shares[-1] and shares == sorted(shares, reverse=True)
    assert use.of(axes(even_angles(least, 16)), along)[1] == 1


def test_a_fixture_and_a_rib_of_the_table_are_kept_off_as_the_part_is():
    """A clamp beside the far end of the floor, taller than the wall: there the tool leans away, and stands without the clamp.  What
    the table carries in the same place, by the machine's file, is the same; on the cradle it would swing away."""
    low, high = np.array([(35.0, -8.0, 0.0), (41.0, 8.0, 60.0)])
    clamp = FixtureBox(name="clamp", min_mm=tuple(low), max_mm=tuple(high))
    part, plain = design(Standing(form="wall", tall_mm=30.0)), mill()
    low, high = (part.setups[0].frame.into(c[None])[0] + plain.wcs_origin_mm for c in (low, high))

    def near_deg(fixtures=(), link=None):
        rib = () if link is None else (Body(name="rib", link=link, shape=Box(low_mm=tuple(low), high_mm=tuple(high))),)
        machine = plain.model_copy(update={"bodies": (*plain.bodies, *rib)})
        moves = planned(part, machine, fixtures).operations[-1].moves
        near = (moves.kind == Kind.FEED) & (moves.end_mm[:, 2] < FLOOR_MM + 4.0) & (moves.end_mm[:, 0] > 23.0)
        return np.degrees(np.arccos(np.clip(moves.axis[near, 2], -1, 1)))

    assert near_deg().max() < 0.5 and near_deg(link="A").max() < 0.5
    assert near_deg((clamp,)).min() > 5.0 and near_deg(link="C") == pytest.approx(near_deg((clamp,)), abs=1e-6)


def test_nothing_that_clears_is_an_error_that_says_so():
    part = design(Standing(form="channel", tall_mm=70.0, floor_mm=12.0), ClearingAxis(up_to_deg=3.0))
    with pytest.raises(PlanError, match="finish: T8 ball 8 mm: no axis within 3 degrees .* clears shank and holder"):
        planned(part)


def test_an_error_of_the_normal_moves_the_tip_by_the_radius_times_it():
    planned_ = beside_the_wall().operations[-1]
    facts = planned_.facts["normal_error"]
    assert facts == normal_error(planned_.tool.cutter)
    assert facts["tip_mm_per_degree"] == pytest.approx(4.0 * math.radians(1.0), abs=1e-6)
