"""Machine files: chains, rotaries and bodies; what is refused; older files stay as they were."""

import json

import pytest
from known_machines import FIVE_AXIS
from pydantic import ValidationError

from cuspline.app.catalogue import MACHINES, find_machine, machine_names
from cuspline.shop.machines import Body, Cylinder, Machine, StepBody, machine_from_toml

MILL = find_machine("mill_trunnion_ac").model_dump()
LATER = {"a", "b", "c", "chain", "spindle_direction", "upward", "bodies"}


def changed(**values):
    return Machine.model_validate({**MILL, **values})


def rotary(letter, **values):
    return {letter: {**MILL[letter], **values}}


def test_three_axis_machines_are_written_out_without_what_came_later():
    for machine in (m for m in map(find_machine, machine_names()) if not m.rotaries):
        assert not LATER & machine.model_dump().keys() and "direction" not in machine.model_dump()["x"]
        assert Machine.model_validate(machine.model_dump(mode="json")) == machine


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_a_machine_is_what_it_was_after_writing_and_reading(name):
    machine = find_machine(name)
    again = Machine.model_validate(json.loads(machine.model_dump_json()))
    assert again == machine and again.kinematics.letters == machine.kinematics.letters
    assert len(machine.rotaries) == 2 and len(machine.bodies) >= 3


@pytest.mark.parametrize("name", ("mill_haas_5axis", "mill_heidenhain_5axis", "mill_siemens_5axis"))
def test_other_controls_have_a_machine_with_rotary_tables(name):
    machine = find_machine(name)
    assert machine.rotaries == ("C", "A") and set(machine.kinematics.turned) == {"A", "C"} and machine.control.tip_control


def test_what_stands_before_the_bed_moves_the_part():
    moves_part = {name: set(find_machine(name).kinematics.turned) for name in FIVE_AXIS}
    assert moves_part == {
        "mill_head_head": set(), "mill_table_table": {"A", "B", "Y"}, "mill_head_table": {"C", "Y"}, "mill_a_on_b": {"A", "B", "Z"},
        "mill_trunnion_ac": {"A", "C"}, "mill_head_table_bc": {"C", "X"}}


@pytest.mark.parametrize("values, message", [
    ({"chain": ("C", "A", "bed", "Y", "X")}, "chain must hold each of A, C, X, Y, Z, bed once"),
    ({"chain": ("C", "A", "bed", "Y", "X", "Z", "B")}, "chain must hold each of"),
    ({"b": MILL["a"], "chain": ("B", "C", "A", "bed", "X", "Y", "Z")}, "at most two that move together"),
    (rotary("c", direction=(1, 0, 0)), "C and A turn about parallel axes"),
    (rotary("a", direction=(0, 0, 1)), "C and A turn about parallel axes"),
    ({"spindle_direction": (1, 0, 0)}, "A turns about the tool's own axis and never leans it"),
    ({"y": {**MILL["y"], "direction": (1, 0, 0)}}, "X, Y and Z move in one plane"),
    (rotary("a", min_deg=30, max_deg=-120), "max_deg -120.0 must exceed min_deg 30.0"),
    (rotary("a", max_deg=None), "min_deg and max_deg go together"),
    (rotary("a", min_deg=-9000, max_deg=9000), "a range of more than 40 turns"),
    (rotary("a", direction=(0, 0, 0)), "its direction has no length"),
    ({"bodies": ({**MILL["bodies"][0], "link": "B"},)}, "body trunnion moves with B, which is not in the chain"),
    ({"bodies": ({**MILL["bodies"][0], "shape": {"low_mm": (0, 0, 0), "high_mm": (1, 1, 0)}},)}, "high_mm must exceed low_mm")])
def test_what_is_no_machine_is_refused_in_words(values, message):
    with pytest.raises(ValidationError, match=message):
        changed(**values)


def test_a_spindle_that_leans_needs_rotaries():
    with pytest.raises(ValidationError, match="without rotary axes the spindle points along Z"):
        Machine.model_validate({**find_machine("mill_3axis").model_dump(), "spindle_direction": (0, 1, 0)})


def test_a_body_out_of_a_step_file_is_seen_from_the_machines_file(tmp_path):
    text = (MACHINES / "mill_trunnion_ac.toml").read_text()
    (tmp_path / "mill.toml").write_text(text + '\n[[bodies]]\nname = "cover"\nlink = "bed"\nshape = { step = "cover.step" }\n')
    *others, cover = machine_from_toml(tmp_path / "mill.toml").bodies
    assert cover == Body(name="cover", link="bed", shape=StepBody(step=str(tmp_path / "cover.step")))
    assert isinstance(others[1].shape, Cylinder)


def test_a_horizontal_machine_says_which_way_is_up():
    assert find_machine("mill_a_on_b").upward == "Y" and find_machine("mill_head_head").upward == "Z"
