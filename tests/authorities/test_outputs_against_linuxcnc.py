"""The default part's posted programs on LinuxCNC: read alike, driven within the stated tolerance and time."""

import json

import pytest

from cuspline.app.catalogue import find_machine
from cuspline.design.job import read_tools

from .linuxcnc.comparison import assert_same_moves
from .linuxcnc.controller import run_on_controller

MM_PER_INCH = 25.4
SLACK_MM = 1e-4             # arcs whose rounded ends differ in radius
FINISHING = "(OPERATION 2"  # and all after it
ROUGHING_SLACK_MM = 0.015  # LinuxCNC blends short arcs and blocks of roughing wider than asked; the allowance is 0.3 mm
TIME_SHARE = 0.15           # the estimate knows no servo cycles


@pytest.mark.linuxcnc
def test_linuxcnc_makes_the_moves_of_the_program_in_mm(default_part):
    machine = find_machine("mill_3axis")
    moves = assert_same_moves(default_part / "setup-1.ngc", default_part / "tools.tbl", machine.wcs_origin_mm)
    assert moves.ended and len(moves) > 1000


@pytest.mark.linuxcnc
def test_linuxcnc_makes_the_moves_of_the_program_in_inches(default_part_in_inches, tmp_path):
    machine = find_machine("mill_3axis_inch")
    in_mm = tmp_path / "tools.tbl"
    in_mm.write_text("".join(f"T{n} P{n} Z{t.length_mm}\n" for n, t in read_tools(default_part_in_inches).items()))
    moves = assert_same_moves(default_part_in_inches / "setup-1.ngc", in_mm, machine.wcs_origin_mm)
    assert moves.ended and len(moves) > 1000


def test_the_tool_table_in_inches_holds_the_same_lengths(default_part_in_inches):
    rows = [line.split() for line in (default_part_in_inches / "tools.tbl").read_text().splitlines()]
    lengths = {int(r[0][1:]): float(r[2][1:]) * MM_PER_INCH for r in rows}
    wanted = {n: t.length_mm for n, t in read_tools(default_part_in_inches).items()}
    assert lengths == pytest.approx(wanted, abs=2e-5)       # six decimals of an inch


@pytest.mark.controller
def test_the_controller_leaves_the_narrow_part_by_no_more_than_the_error_bound_counts(default_part):
    """Half of its passes end in a corner to the next one, where blends meet a servo cycle."""
    machine = find_machine("mill_3axis")
    tools = {n: t.length_mm for n, t in read_tools(default_part).items()}
    run = run_on_controller(default_part / "setup-1.ngc", tools, machine)
    lines = (default_part / "setup-1.ngc").read_text().splitlines()
    finishing = next(k for k, line in enumerate(lines, 1) if line.startswith(FINISHING))
    counted = json.loads((default_part / "verify.json").read_text())["error_bounds_mm"]["path_tolerance_mm"]
    assert run.is_finished and run.distance_mm[run.line >= finishing].max() <= counted == machine.control.path_tolerance_mm


@pytest.mark.controller
def test_the_controller_keeps_the_path_tolerance_and_the_predicted_time(wide_default_part):
    machine = find_machine("mill_3axis")
    tools = {n: t.length_mm for n, t in read_tools(wide_default_part).items()}
    run = run_on_controller(wide_default_part / "setup-1.ngc", tools, machine)
    assert run.is_finished and run.errors == ()
    operations = json.loads((wide_default_part / "plan.json").read_text())["setups"][0]["operations"]
    lines = (wide_default_part / "setup-1.ngc").read_text().splitlines()
    finishing = next(k for k, line in enumerate(lines, 1) if line.startswith(FINISHING))
    predicted_s = sum(o["time_s"] for o in operations)
    print(f"deviation {run.deviation_mm:.6f} mm at line {run.deviation_line}, moving {run.moving_s:.1f} s, "
          f"predicted {predicted_s:.1f} s, ratio {run.moving_s / predicted_s:.4f}")
    assert run.distance_mm[run.line >= finishing].max() <= machine.control.path_tolerance_mm + SLACK_MM
    assert run.deviation_mm <= machine.control.path_tolerance_mm + ROUGHING_SLACK_MM
    assert run.end_gap_mm < 1e-9
    assert run.moving_s == pytest.approx(predicted_s, rel=TIME_SHARE)
