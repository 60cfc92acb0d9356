"""Coolants by the machine's own M-codes: written, read back, and what is wrong refused by name."""

import pytest
from small_program import BALL, FLAT, changed, finishing, operation, program, roughing

from cuspline.app import catalogue
from cuspline.planning.strategies.facing import Facing
from cuspline.shop.machines import CoolantCodes, Machine
from cuspline.shop.materials import Material, known_materials
from cuspline.values.coolants import BITS, FLOOD, HIGH_PRESSURE
from cuspline.values.errors import InputError, PostError, ReadError
from cuspline.values.input_files import checked

OWN = {"high_pressure": {"on": "M88", "off": "M89"}, "air": {"on": "M83"}}
NAMES = ("linuxcnc", "fanuc", "haas", "grbl", "siemens", "heidenhain", "pmac")
EVERY = pytest.mark.parametrize("name", NAMES)
ZERO = {"G54": (0.0, 0.0, 0.0)}
LENGTHS = {t.number: t.length_mm for t in (BALL, FLAT)}


def with_codes(name, **own):
    machine = catalogue.find_machine({"linuxcnc": "mill_3axis"}.get(name, f"mill_{name}"))
    return changed(machine, coolants={kind: CoolantCodes(**codes) for kind, codes in own.items()})


def written(machine, *coolants):
    operations = [operation(f"cut {k}", BALL, finishing() if k else roughing(), coolant=c) for k, c in enumerate(coolants)]
    return catalogue.find_post(machine.control.post).post(program(*operations), machine).texts


def read(text, machine):
    reader = catalogue.reader_of(machine)
    return reader(text, work_offsets=ZERO, tool_lengths=LENGTHS, **catalogue.coolants_taken(reader, machine))


@EVERY
def test_own_codes_go_out_and_come_back_as_the_coolant_that_was_asked_for(name):
    machine = with_codes(name, **OWN)
    text, = written(machine, "high_pressure", "air", "flood")
    moves = read(text, machine)
    cuts = {name: set(moves.coolant[(moves.operation == k) & (moves.kind > 0)].tolist()) for k, name in enumerate(moves.operations)}
    assert list(cuts.values()) == [{HIGH_PRESSURE}, {BITS["air"]}, {FLOOD}]
    assert "M88" in text and "M89" in text and "M83" in text
    assert "COOLANT HIGH PRESSURE M88" in text and "COOLANT AIR M83" in text and "COOLANT FLOOD" not in text


@EVERY
def test_a_coolant_without_a_code_is_refused_by_name(name):
    with pytest.raises(PostError, match="states no M-code of the coolant high_pressure: write .control.coolants.high_pressure."):
        written(with_codes(name), "high_pressure")


@EVERY
def test_codes_of_the_machine_are_unknown_to_another_and_one_left_running_is_found(name):
    machine = with_codes(name, **OWN)
    text, = written(machine, "high_pressure")
    with pytest.raises(ReadError, match="M88"):
        read(text, with_codes(name))
    spoilt = "\n".join(line.replace("M89", "M9") for line in text.splitlines()) + "\n"
    with pytest.raises(ReadError, match="ends while the coolant high_pressure runs"):
        read(spoilt, machine)


def test_programs_without_own_codes_are_what_they_were():
    for name in NAMES:
        assert written(with_codes(name), "mist" if name != "haas" else "flood", "off") == written(
            with_codes(name, high_pressure=OWN["high_pressure"]), "mist" if name != "haas" else "flood", "off")


@pytest.mark.parametrize("coolants, words", [
    ({"high_pressure": {"on": "M30"}}, "M30 is a word for something else"),
    ({"high_pressure": {"on": "M88"}, "air": {"on": "M88"}}, "M88 says two things"),
    ({"high_pressure": {"on": "M88", "off": "M88"}}, "M88 says two things"),
    ({"fog": {"on": "M88"}}, "fog"), ({"air": {"on": "88"}}, "air")])
def test_a_machine_file_that_cannot_be_meant_is_refused(coolants, words):
    said = catalogue.find_machine("mill_3axis").model_dump()
    said["control"]["coolants"] = coolants
    with pytest.raises(InputError, match=words):
        checked(Machine, said, "machine")


def test_a_code_that_the_control_takes_for_something_else_is_refused():
    machine = with_codes("linuxcnc", high_pressure={"on": "M68", "off": "M69"})
    with pytest.raises(PostError, match="M68 is no coolant on this control"):
        read("G21\nM2\n", machine)


def test_operations_and_materials_know_five_coolants():
    for name in BITS:
        assert checked(Facing, {"coolant": name}, "operation").coolant == name
        assert checked(Material, {**known_materials()["brass_c360"].model_dump(), "coolant": name}, "material").coolant == name
    with pytest.raises(InputError, match="coolant"):
        checked(Facing, {"coolant": "fog"}, "operation")


def test_cutter_locations_know_no_coolant_of_a_machine_s_own():
    with pytest.raises(PostError, match="know the coolants off, mist and flood alone, not air"):
        written(catalogue.find_machine("mill_apt"), "air")
