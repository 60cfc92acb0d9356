"""The replay: history of the stock, and each thing that can go wrong on the way."""

from types import SimpleNamespace

import numpy as np
import pytest
from known_programs import arc, feed, program, rapid, tool

from cuspline.program.program import Plane
from cuspline.replay.replay import replay
from cuspline.replay.scene import FinishedDesign, Fixture, FoundStock, Surroundings
from cuspline.stock.swept import stock_height_mm, swept_paths
from cuspline.values.errors import SimulationError

LOW, HIGH = (-20.0, -10.0, -20.0), (20.0, 10.0, 0.0)
SLOT = [rapid(-30, 0, 5), feed(-30, 0, -3), feed(30, 0, -3), rapid(30, 0, 5)]
AXIS = SimpleNamespace(min_mm=-100.0, max_mm=100.0)
NO_HEAD = {"spindle_head": (), "table_z_mm": -500.0, "rapid_clearance_mm": 0.0}


def run(moves, start=(-30, 0, 50), tools=None, changes=None, design=FinishedDesign(), **around):
    posted = program(start, moves, **(changes or {}))
    stock = FoundStock(min_mm=LOW, max_mm=HIGH, pitch_mm=0.5)
    return replay(posted, tools or {1: tool("ball", 6)}, stock, design=design, around=Surroundings(**around))


def kinds(result):
    return [f.kind for f in result.findings]


def test_a_good_slot_has_no_finding_and_the_exact_height():
    result = run(SLOT, machine=SimpleNamespace(axes=(AXIS,) * 3, **NO_HEAD))
    paths = swept_paths(program((-30, 0, 50), SLOT), {1: tool("ball", 6)})
    assert kinds(result) == []
    assert np.abs(result.final_z_mm.ravel() - stock_height_mm(paths, result.zmap.xy_mm, 0.0)).max() < 2e-6


def test_events_fall_and_rebuild_the_final_stock():
    result = run(SLOT + [feed(30, 2, -3), feed(-30, 1, -5)])
    z = np.zeros(result.zmap.nx * result.zmap.ny)
    for cell, height in zip(result.event_cell, result.event_z_mm):
        assert height < z[cell]
        z[cell] = height
    assert (z.reshape(result.final_z_mm.shape) == result.final_z_mm).all()
    assert (np.diff(result.event_row) >= 0).all()


def test_rapid_through_stock_is_found_and_over_the_cut_slot_is_not():
    across = run([*SLOT[:3], rapid(-30, 0, -3)])
    assert kinds(across) == []
    through = run([*SLOT, rapid(0, 8, 5), rapid(0, 8, -1.5), rapid(0, 8, 5)])
    assert kinds(through) == ["rapid_through_stock"]
    found = through.findings[0]
    assert abs(found.amount_mm - 1.5) < 1e-6 and found.line == 15 and found.operation == "finish"


def test_order_matters_for_rapids():
    early = run([rapid(-30, 0, -3), rapid(30, 0, -3), feed(-30, 0, -3)])
    assert kinds(early) == ["rapid_through_stock"]


def test_holder_one_mm_too_low_is_found():
    """Stock top 0, tip -15: the holder's nose must be 1 mm clear of the stock beside the slot."""
    slot = [rapid(-30, 0, 5), feed(-30, 0, -15), feed(30, 0, -15)]
    good = run(slot, tools={1: tool("flat", 10, stick_out=16.1, flute=15.5)})
    bad = run(slot, tools={1: tool("flat", 10, stick_out=15.6, flute=15.5)})
    assert kinds(good) == [] and abs(good.holder_clearance_mm - 1.1) < 1e-9
    assert kinds(bad) == ["holder_contact"]
    assert abs(bad.findings[0].amount_mm - 0.4) < 1e-9


def test_holder_is_held_against_the_finished_design_too():
    design = np.full((41, 81), np.nan)
    design[20, 40] = 3.0
    moves = [rapid(-30, 0, 5), feed(-30, 0, 0), feed(30, 0, 0)]
    assert kinds(run(moves, tools={1: tool("ball", 6, stick_out=20.5)})) == []
    short = run(moves, tools={1: tool("ball", 6, stick_out=3.5, flute=3.0)}, design=FinishedDesign(top_mm=design))
    assert "holder_contact" in kinds(short)


def test_shank_wider_than_its_slot_is_found():
    slot = [rapid(-30, 0, 5), feed(-30, 0, -10), feed(30, 0, -10)]
    assert kinds(run(slot, tools={1: tool("flat", 6, flute=12.0)})) == []
    assert kinds(run(slot, tools={1: tool("flat", 6, flute=8.0)})) == ["shank_contact"]


def test_deep_plunge_lets_the_neck_into_its_own_hole():
    hole = [rapid(0, 0, 5), feed(0, 0, -18), rapid(0, 0, 5)]
    assert kinds(run(hole, start=(0, 0, 50), tools={1: tool("flat", 6, flute=10.0)})) == []


def test_fixture_is_met_by_any_part_on_any_move():
    clamp = Fixture(name="clamp", min_mm=(-22, 6, -20), max_mm=(-16, 12, 8))
    assert kinds(run(SLOT, fixtures=[clamp])) == []
    over = [*SLOT, rapid(-18, 9, 5)]
    result = run(over, fixtures=[clamp])
    assert kinds(result) == ["fixture_contact"] and abs(result.findings[0].amount_mm - 3.0) < 1e-6
    tall = Fixture(name="vice", min_mm=(-22, 12, -20), max_mm=(-16, 25, 45))
    assert kinds(run(SLOT, fixtures=[tall])) == ["fixture_contact"]             # the holder: 45 - 3 < 45
    low = Fixture(name="jaw", min_mm=(40, 6, -20), max_mm=(46, 12, -15))
    told = [run(over, fixtures=both).findings[0].advice for both in ([low, clamp], [clamp, low])]
    assert told == 2 * ["clamp: move it, lift the path over it, or take a longer tool"]


@pytest.mark.parametrize("column,value,kind", [
    ("spindle_rpm", 0.0, "no_spindle"), ("length_offset_on", False, "no_length_offset")])
def test_spindle_and_length_offset_must_be_on_for_cutting(column, value, kind):
    states = np.full(4, value)
    assert kinds(run(SLOT, changes={column: states})) == [kind]
    good = {"spindle_rpm": np.array([0, 8000, 8000, 0.0]), "length_offset_on": np.array([0, 1, 1, 1], bool)}
    assert kinds(run(SLOT, changes=good)) == []


def test_travel_is_checked_at_ends_and_within_arcs():
    machine = SimpleNamespace(axes=(AXIS, AXIS, SimpleNamespace(min_mm=-100.0, max_mm=11.0)), **NO_HEAD)
    hill = [rapid(-10, 0, 5), arc((10, 0, 5), (0, 0, 5), Plane.ZX, clockwise=False), rapid(10, 0, 8)]
    turns = [run([hill[0], arc((10, 0, 5), (0, 0, 5), Plane.ZX, clockwise=c), hill[2]],
                 changes={"ended": True}, machine=machine) for c in (True, False)]
    over = [[f.amount_mm for f in r.findings if f.kind == "travel_exceeded"] for r in turns]
    assert sorted(over) == [[], [4.0]]


def test_unknown_start_must_be_above_everything():
    start = (np.nan, np.nan, np.nan)
    assert kinds(run([rapid(np.nan, np.nan, 20), rapid(-30, 0, 20), *SLOT], start=start)) == []
    low = run([rapid(np.nan, np.nan, -2), rapid(-30, 0, 5), *SLOT], start=start)
    assert set(kinds(low)) == {"unknown_start"}
    assert "unknown_start" in kinds(run([rapid(-30, 0, np.nan), rapid(-30, 0, 5), *SLOT], start=start))


def test_a_program_must_end():
    assert kinds(run(SLOT, changes={"ended": False})) == ["not_ended"]


def test_neighbouring_moves_make_one_finding():
    moves = [feed(x, 0, -3) for x in np.linspace(-30, 30, 50)]
    result = run([rapid(-30, 0, 5), *moves], changes={"spindle_rpm": np.zeros(51)})
    assert kinds(result) == ["no_spindle"] and "50 moves" in result.findings[0].advice


# tilted axes ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side, toward", [("start_axis", 0.8), ("end_axis", -0.8)])
def test_a_tilted_axis_is_judged_as_it_leans(side, toward):
    """Judged as upright, a leaning tool would show no contact where its holder meets the stock."""
    axis = np.tile((0.0, 0.0, 1.0), (4, 1))
    axis[2] = (toward, 0.0, 0.6)
    short = {1: tool("ball", 6, stick_out=21.0)}
    assert kinds(run(SLOT, tools=short)) == []
    leaning = run(SLOT, tools=short, changes={side: axis})
    assert kinds(leaning) == ["holder_contact"] and leaning.findings[0].line == 12


def test_a_tool_on_a_head_is_refused_as_soon_as_it_leaves_its_heads_axis():
    hung = {1: tool("ball", 6).model_copy(update={"head": SimpleNamespace(axis=(1.0, 0.0, 0.0))})}
    with pytest.raises(SimulationError, match="line 10: the axis of T1 leans 90.000 degrees .* in 3 more"):
        run(SLOT, tools=hung)
