"""Speeds and feeds out of files: presets of a tool, overrides of an operation and of the command line, the sources in the plan."""

import json

import pytest

from cuspline.app import catalogue
from cuspline.app.request import Request
from cuspline.designs.h13_test import BALL, H13Test, design
from cuspline.planning.context import PlanningContext
from cuspline.planning.strategies.parallel import Parallel
from cuspline.shop.cutters import Tool, ToolLibrary
from cuspline.values.errors import InputError, PlanError

FOOT_MM, INCH_MM = 304.8, 25.4
PROPELLER_SHOP = {"steel_17_4ph": (225, 6.4), "titanium_6al4v": (160, 5.2), "inconel_718": (70, 2.5)}     # ft/min, in/min
FACE = {"faces": ("plane",), "tool": BALL.number}


def preset(name, speed_ft_per_min, feed_in_per_min):
    return {"name": name, "cutting_speed_m_per_min": speed_ft_per_min * FOOT_MM / 1000,
            "feed_mm_per_min": feed_in_per_min * INCH_MM, "source": "propeller shop's figures"}


H13 = {"name": "steel_h13_48hrc", "spindle_rpm": 5000, "feed_per_tooth_mm": 0.127, "coolant": "off", "source": "L. Xu 1996"}
ROWS = [*(preset(name, *figures) for name, figures in PROPELLER_SHOP.items()), H13, {**H13, "name": "slow", "spindle_rpm": 2500}]


def ball(tmp_path, rows):
    """The ball as it comes back out of a library file with these presets."""
    file = tmp_path / "own.json"
    file.write_text(json.dumps({"tools": [{**BALL.model_dump(mode="json"), "presets": rows}]}))
    tool, = catalogue.find_library(str(file)).tools
    return tool


def work(tool, operation, material="steel_h13_48hrc"):
    """What planning has at hand for an operation on the H13 block."""
    made = design(H13Test())
    made = type(made)(**{**made.__dict__, "material": material})
    return PlanningContext(made, made.setups[0], catalogue.find_machine("mill_3axis"), ToolLibrary(tools=(tool,))).of(operation, [])


@pytest.mark.parametrize("material", PROPELLER_SHOP)
def test_the_propeller_shop_s_presets_are_run_as_they_stand(tmp_path, material):
    tool = ball(tmp_path, ROWS)
    feet, inches = PROPELLER_SHOP[material]
    rpm, feed = work(tool, Parallel(**FACE), material).speeds(tool, is_rough=False)
    assert rpm == pytest.approx(feet * FOOT_MM / (3.14159265 * 10.82), rel=1e-3) and feed == pytest.approx(inches * INCH_MM)


def test_the_hard_milling_presets_give_1270_mm_a_minute_and_another_preset_is_asked_for_by_name(tmp_path):
    tool = ball(tmp_path, ROWS)
    assert work(tool, Parallel(**FACE)).speeds(tool, False) == (5000, pytest.approx(1270))
    assert work(tool, Parallel(preset="slow", **FACE)).speeds(tool, False) == (2500, pytest.approx(635))
    assert work(tool, Parallel(feed_per_tooth_mm=0.1, **FACE)).speeds(tool, False) == (5000, pytest.approx(1000))
    with pytest.raises(PlanError, match="no tool has a preset 'fast'; there are inconel_718, slow, .*"):
        work(tool, Parallel(preset="fast", **FACE)).speeds(tool, False)


def test_the_plan_says_where_every_figure_comes_from(tmp_path):
    tool = ball(tmp_path, ROWS)
    mine = work(tool, Parallel(spindle_rpm=4000, **FACE))
    said = mine._cutting_data(tool, mine.preset(tool, is_rough=False))
    assert said == {"speed": "spindle_rpm of the operation", "feed": f"preset steel_h13_48hrc of T{tool.number}: L. Xu 1996",
                    "coolant": f"preset steel_h13_48hrc of T{tool.number}: L. Xu 1996"}
    plain = work(BALL, Parallel(**FACE))._cutting_data(BALL, None)
    assert plain["speed"].startswith("material steel_h13_48hrc: 40-80: Tungaloy")


def test_a_tool_without_presets_is_written_as_before_and_an_empty_preset_is_refused(tmp_path):
    assert "presets" not in BALL.model_dump() and Tool(**ball(tmp_path, ROWS).model_dump()) == ball(tmp_path, ROWS)
    with pytest.raises(InputError, match="preset 'x' has neither speed, feed, depth nor coolant"):
        ball(tmp_path, [{"name": "x", "source": "y"}])


def test_the_command_line_goes_before_what_operations_say():
    order = Request(design="h13_test", parameters=("layer_mm=0.5", "operation.spindle_rpm=4000", "operation.plane.coolant=air",
                                                   "operation.step-up.feed_per_tooth_mm=0.1")).order()
    plane, step_up, inclined = order.design.setups[0].operations
    assert [o.spindle_rpm for o in (plane, step_up, inclined)] == [4000] * 3 and order.design.parameters.layer_mm == 0.5
    assert (plane.coolant, step_up.coolant) == ("air", "off") and step_up.feed_per_tooth_mm == 0.1


@pytest.mark.parametrize("given, words", [
    ("operation.spindel_rpm=1", "operations know no 'spindel_rpm'"),
    ("operation.plan.coolant=off", "no operation is called 'plan'"),
    ("operation.coolant=fog", "coolant"), ("operation.spindle_rpm=-1", "spindle_rpm")])
def test_what_no_operation_knows_is_refused(given, words):
    with pytest.raises(InputError, match=words):
        Request(design="h13_test", parameters=(given,)).order()
