"""Drills and taps against their makers' own worked figures, holes that are widened, limits."""

from types import SimpleNamespace

import numpy as np
import pytest
from known_programs import feed, program, rapid

from cuspline.app import catalogue
from cuspline.process.cut_of_operations import with_holes
from cuspline.process.hole_forces import drill_load, drilled_diameter_mm, hole_loads, tap_torque_n_m
from cuspline.shop.cutters import Cutter
from cuspline.shop.hole_forces import HoleForce, hole_force_of, known_hole_forces
from cuspline.shop.materials import known_materials
from cuspline.values.frames import Frame
from cuspline.verification.process_findings import hole_findings

ALUMINIUM = known_hole_forces()["aluminium_6061"]
HERE = "setup-1", Frame.of_axes((0, 0, 0), (1, 0, 0), (0, 0, 1))


def drill(diameter, angle=118.0, type_="drill", **fields):
    return Cutter(name=f"{type_} {diameter}", type=type_, diameter_mm=diameter, corner_radius_mm=0, flutes=2, flute_length_mm=60,
                  neck_diameter_mm=0.7 * diameter, reach_mm=60, shank_diameter_mm=diameter, overall_length_mm=110,
                  **{"point_angle_deg": angle, **fields})


def tap(diameter, pitch):
    return drill(diameter, type_="tap", point_angle_deg=None, pitch_mm=pitch, hand="right", chamfer_threads=3)


def tool(number, cutter):
    return SimpleNamespace(number=number, cutter=cutter)


def holes(places, depth, tool_number=1):
    """Strokes down to a depth from 2 mm above."""
    return program((0, 0, 50), [move for x in places for move in (rapid(x, 0, 2), feed(x, 0, -depth), rapid(x, 0, 2))], tool_number)


def test_the_makers_example():
    """ISCAR rotating tools 2017, page 601: 22 mm, 0.15 mm a turn, 2200 N/mm², flat: 20 Nm, 2286 N."""
    torque, thrust = drill_load(drill(22, 180.0), 22.0, 0.0, 0.15, 2200.0)
    assert torque == pytest.approx(20.0, abs=0.05) and thrust == pytest.approx(2286.0, abs=1.0)


def test_a_tap_is_near_another_makers_formula():
    """Yamawa 2021, page 639: M8 x 1.25 in a hole of 6.8 mm, spiral flutes (K 1.15), Ck 60 (4000 N/mm²); lubero.de 2500 N/mm²."""
    theirs = np.tan(np.radians(30.0)) * 4000 * 1.15 * (8 - 6.8) ** 2 * (8 + 2 * 6.8) / 24000
    assert tap_torque_n_m(tap(8, 1.25), 2500.0) == pytest.approx(theirs, rel=0.15)


def test_every_row_is_of_a_known_material():
    assert set(known_hole_forces()) <= set(known_materials())
    own = HoleForce(material="brass_c360", drill_n_per_mm2=1.0, source="our own")
    assert hole_force_of("brass_c360", (own,)) is own and hole_force_of("bronze_nial") is None


def test_a_widened_hole_takes_less_by_its_ring():
    small, wide = tool(1, drill(5.0)), tool(2, drill(10.0))
    first, second = holes([0, 20], 30), holes([0, 20], 30, 2)
    both = program((0, 0, 50), [rapid(0, 0, 2), feed(0, 0, -30), rapid(0, 0, 2), rapid(0, 0, 2), feed(0, 0, -30), rapid(0, 0, 2)],
                   tool=np.array([1, 1, 1, 2, 2, 2]), operation=np.array([0, 0, 0, 1, 1, 1]), operations=("pilot", "drill"))
    alone, = hole_loads(second, {2: wide}, ALUMINIUM)
    pilot, after = hole_loads(both, {1: small, 2: wide}, ALUMINIUM)
    assert hole_loads(first, {1: small}, ALUMINIUM)[0].torque_n_m == pilot.torque_n_m
    assert after.torque_n_m == pytest.approx(0.75 * alone.torque_n_m) and after.axial_n == pytest.approx(0.5 * alone.axial_n)
    assert alone.holes == 2 and alone.power_kw == pytest.approx(alone.torque_n_m * 2 * np.pi * alone.rpm / 60000)


def test_a_spot_drill_cuts_as_wide_as_its_point_goes():
    spot = drill(10.0, 90.0, "spot_drill")
    assert drilled_diameter_mm(spot, 2.0) == pytest.approx(4.0) and drilled_diameter_mm(spot, 9.0) == 10.0


def test_what_is_not_known_is_not_stated():
    posted = holes([0], 10)
    assert hole_loads(posted, {1: tool(1, tap(6, 1.0))}, known_hole_forces()["titanium_6al4v"]) == ()
    assert hole_loads(posted, {1: tool(1, drill(5.0))}, None) == ()
    assert hole_loads(posted, {1: SimpleNamespace(number=1, cutter=SimpleNamespace(type="flat", drills=False))}, ALUMINIUM) == ()


def test_beyond_what_the_spindle_stands_is_found_by_line():
    posted, tools = holes([0, 20], 30), {1: tool(1, drill(10.0))}
    loads = hole_loads(posted, tools, ALUMINIUM)
    mill = catalogue.find_machine("mill_3axis")
    stands = lambda **limits: mill.model_copy(update={"spindle": mill.spindle.model_copy(update=limits)})
    tools[1].cutter = tools[1].cutter.model_copy(update={"bending_n": 1.0})          # across its axis: no matter of a drill's
    assert hole_findings(posted, tools, stands(torque_n_m=2 * loads[0].torque_n_m), loads, HERE) == ()
    torque, axial = hole_findings(posted, tools, stands(torque_n_m=0.5 * loads[0].torque_n_m, axial_n=1.0), loads, HERE)
    assert torque.kind == axial.kind == "process_limit" and "drill a smaller hole first" in torque.advice
    assert torque.line == posted.line[1] and axial.unit == "N"


def test_what_is_stated_is_not_said_to_be_unseen():
    posted, tools = holes([0], 30), {1: tool(1, drill(10.0))}
    found = SimpleNamespace(unseen=(1,))
    document = {"operations": [], "forces": "", "not_checked": "1 operation: finish."}
    loads = hole_loads(posted, tools, ALUMINIUM)
    assert "not_checked" not in with_holes(document, posted, found, loads, ())
    assert with_holes(document, posted, found, (), ())["not_checked"].startswith("1 operation: finish.")
    row = {"name": "finish"}
    assert with_holes({"operations": [row]}, posted, SimpleNamespace(unseen=()), (), (1,))["operations"] == []
