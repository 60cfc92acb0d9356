"""Where the machine stands still, how near rapids come, what a cutter is asked to take: states of a shop, not of geometry."""

from functools import partial

import numpy as np
import pytest
from known_programs import arc, feed, program, rapid, tool

from cuspline.app import catalogue
from cuspline.program.posted import Stop
from cuspline.program.program import Plane
from cuspline.replay.replay import replay
from cuspline.replay.scene import FoundStock, Surroundings
from cuspline.stock.shapes import BoxShape
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.values.frames import Frame

LOW, HIGH = (-20.0, -10.0, -20.0), (20.0, 10.0, 0.0)
HOME = Frame.shift((0.0, 0.0, 0.0))
MILL = catalogue.find_machine("mill_3axis")
NOSE_MM = -300.0              # of the spindle in machine coordinates with the tip at Z0
LIMITS = {"slot_depth_mm": None}        # a cutter of which the library says nothing
OVER = [rapid(-30, 0, 5), feed(-30, 0, -1), feed(0, 0, -1)]
AWAY = [feed(30, 0, -1), rapid(30, 0, 300)]


def run(moves, stops=(), tools=None, machine=MILL, pitch_mm=0.25, **changes):
    """Findings of moves from (-30, 0, 50), with stops (word, moves before)."""
    end = np.array([m[1] for m in moves], float)
    posted = program((-30, 0, 50), moves, machine_end_mm=np.column_stack([np.full((len(end), 2), -50.0), end[:, 2] + NOSE_MM]),
                     stops=tuple(Stop(row=row, line=1000 + k, word=word) for k, (word, row) in enumerate(stops)), **changes)
    tools = tools or {1: tool("flat", 10, limits=LIMITS)}
    billet = Workpiece(blank=BoxShape(min_mm=LOW, max_mm=HIGH))
    stock = FoundStock(min_mm=LOW, max_mm=HIGH, pitch_mm=pitch_mm, standing_before=lambda row: partial(
        billet.after(HOME, swept_paths(posted.first(row), tools)).standing_mm, HOME))
    return replay(posted, tools, stock, around=Surroundings(machine=machine)).findings


def told(findings):
    return [(f.kind, f.line) for f in findings]


# standing still --------------------------------------------------------------------------------------

def test_a_tool_change_below_the_height_of_the_machine_is_told_with_what_is_missing():
    low = run([*OVER, feed(30, 0, -1), rapid(30, 0, 5)], [("M5", 5), ("M6", 5)])
    assert told(low) == [("tool_change_low", 1001)]
    assert low[0].amount_mm == pytest.approx(0 - (5 + NOSE_MM)) and low[0].place_mm == (30.0, 0.0, 5.0)
    assert run([*OVER, *AWAY], [("M5", 5), ("M6", 5)]) == ()
    lower = MILL.model_copy(update={"tool_change_z_mm": 5 + NOSE_MM})
    assert run([*OVER, feed(30, 0, -1), rapid(30, 0, 5)], [("M6", 5)], machine=lower) == ()


def test_a_tool_change_before_any_move_stands_nobody_knows_where():
    assert told(run([*OVER, *AWAY], [("M6", 0)])) == [("tool_change_low", 1000)]


def test_the_height_of_a_tool_change_is_where_the_reference_leads():
    axis = lambda low, high: MILL.model_copy(update={"z": MILL.z.model_copy(update={"min_mm": low, "max_mm": high})})
    assert [axis(*z).tool_change_height_mm for z in ((-400.0, 0.0), (-400.0, -10.0), (-400.0, 5.0))] == [0.0, -10.0, 0.0]
    assert MILL.model_copy(update={"tool_change_z_mm": -120.0}).tool_change_height_mm == -120.0


@pytest.mark.parametrize("word", ["M0", "M1", "M2", "M30"])
def test_a_stop_near_the_work_is_told_and_one_high_above_is_not(word):
    low = run([*OVER, feed(30, 0, -1), rapid(30, 0, 5)], [(word, 5)])
    assert told(low) == [("stop_low", 1000)] and low[0].amount_mm == pytest.approx(MILL.stop_clearance_mm - 5)
    assert run([*OVER, feed(30, 0, -1), rapid(30, 0, MILL.stop_clearance_mm)], [(word, 5)]) == ()


@pytest.mark.parametrize("word", ["M2", "M30"])
def test_a_program_that_ends_in_the_cut_is_told_with_its_depth(word):
    found = run(OVER, [(word, 3)])
    assert told(found) == [("ends_in_cut", 1000)] and found[0].amount_mm == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("word", ["M5", "M4"])
def test_a_spindle_stopped_or_turned_back_in_the_cut_is_told_and_in_the_air_it_is_not(word):
    found = run([*OVER, *AWAY], [("M3", 0), (word, 3), ("M3", 3)])
    assert told(found)[0] == ("no_spindle", 1001) and found[0].amount_mm == pytest.approx(1.0, abs=1e-6)
    assert run([*OVER, *AWAY], [("M3", 0), (word, 4), ("M3", 4)]) == ()         # beside the billet
    lifted = [*OVER, feed(0, 0, -0.98), *AWAY]                      # just above the floor, but within the slot
    assert told(run(lifted, [("M3", 0), (word, 4)])) == [("no_spindle", 1001)]
    assert run([*OVER, rapid(0, 0, 0.02), rapid(0, 0, 300)], [("M3", 0), (word, 4)]) == ()


def test_a_spindle_that_goes_on_as_before_is_nothing():
    assert run([*OVER, *AWAY], [("M3", 0), ("M3", 3)]) == ()


# rapids ----------------------------------------------------------------------------------------------

@pytest.mark.parametrize("over_mm", [0.0, 0.2, 0.49])
def test_a_rapid_nearer_above_raw_stock_than_the_machine_asks_is_told_with_what_is_missing(over_mm):
    found = run([rapid(-30, 0, over_mm), rapid(30, 0, over_mm), rapid(30, 0, 300)])
    assert told(found) == [("rapid_too_low", 11)]
    assert found[0].amount_mm == pytest.approx(MILL.rapid_clearance_mm - over_mm, abs=2e-4)      # touches count within 1e-4
    assert run([rapid(-30, 0, 0.51), rapid(30, 0, 0.51), rapid(30, 0, 300)]) == ()


def test_a_rapid_down_to_raw_stock_is_told_and_straight_up_out_of_the_cut_is_not():
    assert told(run([rapid(0, 0, 50), rapid(0, 0, 0.1), rapid(0, 0, 300)])) == [("rapid_too_low", 11)]
    assert run([*OVER, rapid(0, 0, 0.3), rapid(0, 0, 300)]) == ()


def test_a_rapid_that_rises_by_nothing_is_as_level_as_it_looks():
    found = run([rapid(-30, 0, 0.05), rapid(30, 0, 0.051), rapid(30, 0, 300)])
    assert told(found) == [("rapid_too_low", 11)] and found[0].amount_mm == pytest.approx(0.45, abs=0.01)


def test_a_rapid_through_the_stock_is_not_also_too_low():
    assert told(run([rapid(-30, 0, -0.5), rapid(30, 0, -0.5), rapid(30, 0, 300)])) == [("rapid_through_stock", 11)]


# what a cutter takes ---------------------------------------------------------------------------------

def test_a_cutter_that_does_not_cut_at_its_centre_sunk_into_solid_is_told():
    sunk = [rapid(0, 0, 1), feed(0, 0, -1.4), feed(30, 0, -1.4), rapid(30, 0, 300)]
    found = run(sunk)
    assert told(found) == [("plunge", 11)] and found[0].amount_mm == pytest.approx(1.4)
    cuts = tool("flat", 10, limits={"is_centre_cutting": True})
    assert run(sunk, tools={1: cuts}) == ()
    fast = run(sunk, tools={1: cuts}, feed_mm_per_min=np.array([0.0, 4000.0, 500.0, 0.0]))      # 0.25 mm a tooth
    assert told(fast) == [("plunge", 11)]


def test_a_plunge_in_small_steps_is_as_deep_as_all_of_them():
    steps = [move for z in np.arange(-0.04, -1.4001, -0.04) for move in (feed(0, 0, z), rapid(0, 0, z + 1))]
    found = run([rapid(0, 0, 1), *steps, rapid(0, 0, 300)])
    assert [f.kind for f in found] == ["plunge"] and found[0].amount_mm == pytest.approx(1.4)


@pytest.mark.parametrize("deg,is_told", [(3.0, False), (9.0, False), (15.0, True), (40.0, True)])
def test_a_ramp_into_solid_may_be_as_steep_as_the_cutter_takes(deg, is_told):
    length = 1.4 / np.tan(np.radians(deg))
    found = run([rapid(-10, 0, 0.6), feed(-10, 0, 0), feed(-10 + length, 0, -1.4), feed(-10, 0, -1.4), feed(40, 0, -1.4),
                 rapid(40, 0, 300)])
    assert [f.kind for f in found] == (["plunge"] if is_told else [])


def test_a_helix_is_a_ramp_wound_up():
    turns = [arc((side, 0, -0.35 * (k + 1)), (0, 0, -0.35 * k), Plane.XY) for k, side in enumerate((-5, 5, -5, 5))]
    way = [rapid(5, 0, 0.6), feed(5, 0, 0), *turns, feed(30, 0, -1.4), rapid(30, 0, 300)]
    assert run(way) == ()
    narrow = [arc((side, 0, -0.35 * (k + 1)), (0, 0, -0.35 * k), Plane.XY) for k, side in enumerate((-0.2, 0.2, -0.2, 0.2))]
    assert "plunge" in [f.kind for f in run([rapid(0.2, 0, 0.6), feed(0.2, 0, 0), *narrow, feed(30, 0, -1.4), rapid(30, 0, 300)])]


@pytest.mark.parametrize("pitch_mm", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("type_", ["flat", "ball"])
def test_a_slot_deeper_than_the_cutter_takes_is_told_with_its_depth(type_, pitch_mm):
    """Of a flat cutter the amount is the slot's depth; of a ball what its round leaves is missing: (R²π/2 + (h - R) D) / D."""
    deep = 8.0
    true = deep if type_ == "flat" else (np.pi * 25 / 2 + 3 * 10) / 10
    way = lambda z: [rapid(-30, 0, 5), feed(-30, 0, z), feed(30, 0, z), rapid(30, 0, 300)]
    found = run(way(-deep), tools={1: tool(type_, 10, limits=LIMITS)}, pitch_mm=pitch_mm)
    assert told(found) == [("overload", 12)]
    assert found[0].amount_mm == pytest.approx(true, rel=1.5 * pitch_mm / 10)       # a strip of nodes more or less
    assert run(way(-2.5), tools={1: tool(type_, 10, limits=LIMITS)}, pitch_mm=pitch_mm) == ()
    assert run(way(-deep), tools={1: tool(type_, 10, limits={"slot_depth_mm": 9.5})}, pitch_mm=pitch_mm) == ()


@pytest.mark.parametrize("pitch_mm", [0.25, 1.0])
def test_a_thin_layer_off_a_high_wall_is_light_wherever_the_nodes_stand(pitch_mm):
    """0.1 mm off a wall of 18 mm: as a slot 0.18 mm deep; a strip of nodes alone would make it 1.8 mm at a pitch of 1."""
    tools = {1: tool("flat", 10, limits={"slot_depth_mm": 1.0}, flute=19.0)}
    for shift in np.arange(0.0, 1.0, 0.2):
        way = [rapid(-30, -14.9 + shift, 5), feed(-30, -14.9 + shift, -18), feed(30, -14.9 + shift, -18), rapid(30, -14.9, 300)]
        before = [rapid(-30, -15 + shift, 5), feed(-30, -15 + shift, -18), feed(30, -15 + shift, -18), rapid(30, -15 + shift, 50)]
        found = run([*before, *way], tools=tools, pitch_mm=pitch_mm)
        assert 16 not in [f.line for f in found if f.kind == "overload"]


def test_one_heavy_place_in_a_long_light_pass_is_told():
    """A lump 5 mm high, 8 mm long, in the way of a pass that is otherwise over ridges: a ball's slot of 3.93 mm."""
    tools = {1: tool("ball", 10, limits={"slot_depth_mm": 3.0})}
    face = [move for y in range(-10, 11, 4) for x0, x1 in ((-30, -9), (9, 30)) for move in (
        rapid(x0, y, 5), feed(x0, y, -2.5), feed(x1, y, -2.5), rapid(x1, y, 5))]
    deeper = [(kind, (x, y, z - 2.5 if z < 0 else z), c, p) for kind, (x, y, z), c, p in face]
    long = [rapid(-30, 0, 5), feed(-30, 0, -5), feed(30, 0, -5), rapid(30, 0, 300)]
    found = [f for f in run([*face, *deeper, *long], tools=tools) if f.kind == "overload"]
    assert [f.line for f in found] == [10 + len(face) + len(deeper) + 2]
    assert found[0].amount_mm == pytest.approx(np.pi * 25 / 2 / 10, rel=0.04)       # a strip of nodes


@pytest.mark.parametrize("aside_mm, wanted", [(0.0, []), (1e-14, []), (0.5, ["overload"])])
def test_a_drill_goes_straight_down_but_for_rounding(aside_mm, wanted):
    """Joints of an indexed position, turned back, are off by the last bits: the cross bore of a fork was refused for it."""
    drill = next(t for t in catalogue.find_library(None).tools if t.cutter.type == "drill" and t.cutter.diameter_mm == 10)
    hole = [rapid(0, 0, 5), feed(aside_mm, -aside_mm, -15), rapid(aside_mm, -aside_mm, 300)]
    found = run(hole, tools={1: drill.model_copy(update={"number": 1})})
    assert [f.kind for f in found if f.kind == "overload"] == wanted


@pytest.mark.parametrize("short_mm", [0.5, 1.0, 1.9])
def test_chips_of_a_drill_are_not_those_of_the_move_after_it(short_mm):
    """A short way down through the air by 4 mm follows a counterbore of 10 mm: behind a rapid begins a bin of its own."""
    drill = next(t for t in catalogue.find_library(None).tools if t.cutter.type == "drill" and t.cutter.diameter_mm == 10)
    tools = {1: drill.model_copy(update={"number": 1}), 2: tool("flat", 4, number=2, limits={"slot_depth_mm": 1.0})}
    hole = [rapid(0, 0, 0.5), feed(0, 0, -3), rapid(0, 0, 50)]
    after = [rapid(10, 0, 50), rapid(10, 0, 5), feed(10, 0, 5 - short_mm), rapid(10, 0, 5), rapid(-30, 0, 5), feed(-30, 0, -0.5),
             feed(-15, 0, -0.5), rapid(-15, 0, 300)]
    found = run([*hole, *after], tools=tools, tool=[1] * len(hole) + [2] * len(after))
    assert [f for f in found if f.kind == "overload"] == []
