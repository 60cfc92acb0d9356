"""Drilled holes as posted: LinuxCNC's interpreter makes the moves that the reader reads."""

import subprocess
from pathlib import Path

import pytest
from known_tools import tool

import cuspline.posts
from cuspline.posts.writers.linuxcnc import post, tool_table
from cuspline.program.drilling import DrillCycle, drilled
from cuspline.program.program import Operation, Program
from cuspline.shop.machines import machine_from_toml

from .linuxcnc.comparison import assert_same_moves
from .linuxcnc.interpreter import RS274, write_parameters

pytestmark = pytest.mark.linuxcnc
MACHINE = machine_from_toml(Path(cuspline.posts.__file__).parent / "machines" / "mill_3axis.toml")
KINDS = {"drill": {}, "dwell": {"dwell_s": 0.25}, "peck": {"peck_mm": 1.7}, "chip_break": {"peck_mm": 2.2}, "ream": {}}


@pytest.mark.parametrize("sign", [1, -1], ids=["right-hand", "left-hand"])
def test_posted_threads_are_tapped_as_they_are_read(tmp_path, sign):
    t = tool("flat", 6, number=3)
    holes = [DrillCycle(kind="tap", xy_mm=(x, 2.0), bottom_z_mm=-5.25, retract_z_mm=3.0, pitch_mm=sign * 0.75, first=0, end=0,
                        feed_mm_per_min=300.0) for x in (1.0, 11.0)]
    moves, cycles = drilled(holes, 20.0, 300.0)
    operation = Operation(name="tap", tool=t, spindle_rpm=400.0, coolant="off", moves=moves, cycles=cycles)
    program = Program(name="plate", setup="setup-1", wcs="G54", wcs_in_words="corner", operations=(operation,), clearance_z_mm=20.0,
                      header=())
    (tmp_path / "plate.ngc").write_text(post(program, MACHINE).text)
    (tmp_path / "tools.tbl").write_text(tool_table([t], MACHINE.control))
    read = assert_same_moves(tmp_path / "plate.ngc", tmp_path / "tools.tbl", MACHINE.wcs_origin_mm)
    assert set(read.pitch_mm.tolist()) == {0.0, sign * 0.75}
    said = listing(tmp_path)
    assert said.count("START_SPEED_FEED_SYNC(0.750000") == 2 == said.count("RIGID_TAP"), said
    assert ("START_SPINDLE_CLOCKWISE" in said) == (sign > 0) and ("COUNTERCLOCKWISE" in said) == (sign < 0)


def listing(folder):
    """The interpreter's own listing of a program in millimetres."""
    write_parameters(folder / "inch.var", {"G54": MACHINE.wcs_origin_mm}, scale=1 / 25.4)
    (folder / "inch.tbl").write_text("T3 P1 Z1.0\n")
    command = [RS274, "-g", "-n", "2", "-t", "inch.tbl", "-v", "inch.var", "plate.ngc"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL).stdout


@pytest.mark.parametrize("stays_low", [False, True], ids=["G98", "G99"])
def test_posted_holes_are_drilled_as_they_are_read(tmp_path, stays_low):
    t, operations = tool("flat", 6, number=3), []
    for kind, more in KINDS.items():
        holes = [DrillCycle(kind=kind, xy_mm=(x, y), bottom_z_mm=-5.25 - x / 7, retract_z_mm=3.0, stays_low=stays_low,
                            first=0, end=0, feed_mm_per_min=200.0, **more) for x, y in ((1.0, 2.0), (11.0, 2.0), (11.0, 12.3456))]
        moves, cycles = drilled(holes, 20.0, 200.0)
        operations.append(Operation(name=kind, tool=t, spindle_rpm=900.0, coolant="off", moves=moves, cycles=cycles))
    program = Program(name="plate", setup="setup-1", wcs="G54", wcs_in_words="corner", operations=tuple(operations),
                      clearance_z_mm=20.0, header=())
    (tmp_path / "plate.ngc").write_text(post(program, MACHINE).text)
    (tmp_path / "tools.tbl").write_text(tool_table([t], MACHINE.control))
    read = assert_same_moves(tmp_path / "plate.ngc", tmp_path / "tools.tbl", MACHINE.wcs_origin_mm)
    assert read.operations == tuple(KINDS)
