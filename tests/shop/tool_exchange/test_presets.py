"""Presets of foreign libraries: kept on import, in millimetres, and what the plan makes of them."""

import pytest
from eight_operations import Block, design
from foreign_libraries import freecad_bit, freecad_library, fusion_library, fusion_tool, inch

from cuspline.app import catalogue
from cuspline.planning.context import PlanningContext
from cuspline.planning.strategies.pocket import Pocket
from cuspline.planning.strategies.tap import Tap
from cuspline.planning.tapping import speed_rpm
from cuspline.shop.presets import Preset
from cuspline.shop.tool_exchange.importing import import_tools
from cuspline.values.errors import PlanError

SHOP = catalogue.find_library(None)
MACHINE = catalogue.find_machine("mill_3axis")


def with_presets(tool, *rows):
    return {**tool, "start-values": {"presets": list(rows)}}


def read(folder, tool):
    return import_tools(fusion_library(folder / "shop.json", tool)).rows[0]


def test_a_fusion_preset_keeps_speed_feed_depths_and_coolant(tmp_path):
    row = {"name": "Al", "material": {"category": "all", "query": "Aluminium 6061"}, "n": 9000, "n_ramp": 9000, "f_z": 0.05,
           "v_c": 282.74, "v_f": 1350.0, "v_f_plunge": 405.0, "v_f_leadIn": 1350.0, "ramp-angle": 2, "stepdown": 1.5,
           "use-stepdown": True,
           "stepover": 4.0, "use-stepover": False, "tool-coolant": "disabled", "guid": "g", "expressions": {"x": "y"}}
    got = read(tmp_path, with_presets(fusion_tool(), row))
    wanted = Preset(name="Al", material="Aluminium 6061", spindle_rpm=9000, feed_per_tooth_mm=0.05, plunge_share=0.3, ramp_deg=2,
                    stepdown_mm=1.5, coolant="off")
    assert got.tool.presets == (wanted,)
    assert "start-values.presets.expressions" in got.dropped and not any("guid" in d and "preset" in d for d in got.dropped)


def test_an_inch_preset_comes_in_millimetres_and_metres_a_minute(tmp_path):
    """Feeds of a tool in inches are inches a minute and a tooth, v_c is feet a minute."""
    row = {"name": "Al", "n": 0, "v_c": 1000.0, "f_z": 0.002, "stepover": 0.1, "use-stepover": True, "tool-coolant": "through tool"}
    got = read(tmp_path, with_presets(inch(fusion_tool()), row))
    preset = got.tool.presets[0]
    assert (preset.cutting_speed_m_per_min, preset.feed_per_tooth_mm, preset.stepover_mm) == pytest.approx((304.8, 0.0508, 2.54))
    assert preset.coolant is None and "start-values.presets.tool-coolant (through tool)" in got.dropped


def test_a_drills_feed_is_that_of_a_turn(tmp_path):
    same = {"DC": 6.0, "SFDM": 6.0, "shoulder-length": None, "shoulder-diameter": None, "SIG": 118.0, "NOF": 2}
    by_turn = read(tmp_path, with_presets(fusion_tool("drill", **same), {"name": "a", "n": 4000, "f_n": 0.1, "v_f_plunge": 400.0}))
    by_feed = read(tmp_path, with_presets(fusion_tool("drill", **same), {"name": "a", "n": 4000, "v_f_plunge": 400.0}))
    assert by_turn.tool.presets == by_feed.tool.presets == (Preset(name="a", spindle_rpm=4000, feed_per_tooth_mm=0.05),)


def test_a_preset_that_says_nothing_is_listed_and_a_freecad_bit_keeps_its_own(tmp_path):
    got = read(tmp_path, with_presets(fusion_tool(), {"name": "empty", "n": 0}, "text"))
    assert got.tool.presets is None and {"start-values.presets.0", "start-values.presets.1"} <= set(got.dropped)
    bit = {**freecad_bit(), "presets": [{"name": "alu", "material_hint": {"uuid": "u", "name": "Aluminum 6061"},
                                         "op_type_hint": "profile", "surface_speed": 400.0, "chipload": 0.05,
                                         "vert_feed_ratio": 0.4, "notes": None}]}
    holder = {"holder": "ER16 collet chuck", "holders": [t.holder for t in SHOP.tools], "stick_out_mm": 45.0}
    rows = import_tools(freecad_library(tmp_path, bit, freecad_bit(Chipload="0.02 mm")), **holder).rows
    assert rows[0].tool.presets == (Preset(name="alu", material="Aluminum 6061", use="contour", cutting_speed_m_per_min=400,
                                           feed_per_tooth_mm=0.05, plunge_share=0.4),)
    assert rows[1].tool.presets == (Preset(name="Chipload", feed_per_tooth_mm=0.02),)
    assert "presets.material_hint.uuid" in rows[0].dropped


@pytest.fixture(scope="module")
def work_with():
    """Function of (Preset values of a tool, an operation's fields) to (PlanningContext, the tool)."""
    part = design(Block())

    def made(*presets, number=3, operation=None, **says):
        tools = tuple(t.model_copy(update={"presets": presets or None}) if t.number == number else t for t in SHOP.tools)
        work = PlanningContext(part, part.setups[0], MACHINE, SHOP.model_copy(update={"tools": tools}))
        return work.of(operation or Pocket(**says), ()), work.magazine.number(number)

    return made


@pytest.fixture(scope="module")
def speeds_of(work_with):
    """Function of (Preset values of T3, an operation's fields) to (rpm, feed of roughing with T3, coolant's preset)."""
    def asked(*presets, **says):
        work, tool = work_with(*presets, **says)
        return (*work.speeds(tool, is_rough=True), getattr(work.preset(tool, True), "name", None))

    return asked


MINE = Preset(name="mine", material="Aluminium-6061", spindle_rpm=5000, feed_per_tooth_mm=0.06)
OTHER = Preset(name="other", material="brass_c360", spindle_rpm=3000, feed_per_tooth_mm=0.02)


def test_the_preset_for_the_jobs_material_is_used_and_no_other_unless_it_is_asked_for(speeds_of):
    plain = speeds_of()
    assert speeds_of(OTHER) == plain and plain[2] is None
    assert speeds_of(OTHER, MINE) == (5000, 5000 * 0.06 * 3, "mine")
    assert speeds_of(OTHER, MINE, preset="other") == (3000, 3000 * 0.02 * 3, "other")


def test_depths_and_ramps_of_a_preset_are_used_where_the_operation_is_silent(work_with):
    deep = MINE.model_copy(update={"stepdown_mm": 1.25, "stepover_mm": 900.0, "ramp_deg": 90.0})
    work, tool = work_with(deep)
    assert (work.stepdown_mm(tool), work.ramp_deg(tool)) == (1.25, 44.9)
    assert work.of_preset("stepover_mm", tool) == tool.cutter.radius_mm          # no wider than a shop may ask for
    work, tool = work_with(deep, stepdown_mm=0.5, ramp_deg=2.0)
    assert (work.stepdown_mm(tool), work.ramp_deg(tool)) == (0.5, 2.0)
    work, tool = work_with(MINE)
    assert work.stepdown_mm(tool) == work.material.stepdown_share * tool.cutter.diameter_mm
    assert (work.ramp_deg(tool), work.of_preset("stepdown_mm", tool)) == (work.practice.ramp_deg, None)


def test_a_tap_runs_by_its_preset_in_steps_of_ten(work_with):
    work, tool = work_with(Preset(name="aluminium_6061", spindle_rpm=1234.0), number=next(
        t.number for t in SHOP.tools if t.cutter.type == "tap"), operation=Tap())
    assert speed_rpm(work, tool) == 1230.0
    work, _ = work_with(Preset(name="aluminium_6061", spindle_rpm=1234.0), number=tool.number, operation=Tap(spindle_rpm=900.0))
    assert speed_rpm(work, tool) == 900.0


def test_what_an_operation_states_goes_before_its_preset(speeds_of):
    assert speeds_of(MINE, spindle_rpm=4000)[:2] == (4000, 4000 * 0.06 * 3)
    assert speeds_of(MINE, feed_mm_per_min=321.0)[:2] == (5000, 321.0)


def test_a_preset_is_for_the_stage_or_kind_that_it_names(speeds_of):
    finish, pocket = (MINE.model_copy(update={"name": u, "use": u}) for u in ("finish", "pocket"))
    assert speeds_of(finish)[2] is None and speeds_of(MINE, pocket)[2] == "pocket"


def test_a_preset_that_no_tool_has_is_refused_with_those_there_are(speeds_of):
    with pytest.raises(PlanError, match="pocket: no tool has a preset 'fast'; there are mine, other"):
        speeds_of(MINE, OTHER, preset="fast")
    with pytest.raises(PlanError, match="the library's tools have none: import one"):
        speeds_of(preset="fast")
