"""The accepted gold programs of our posts are programs that LinuxCNC executes as our reader reads them."""

from pathlib import Path

import pytest

from .linuxcnc.comparison import assert_same_moves
from .linuxcnc.interpreter import write_tool_table

pytestmark = pytest.mark.linuxcnc

GOLD = Path(__file__).parent.parent / "gold"


UNITS = pytest.mark.parametrize("unit", ["mm", "inch"])
ORIGIN_MM, SHIFT_MM = (101.5, -20.25, -300.125), (7.0, -3.0, 12.5)


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "tool.tbl"
    write_tool_table(path, {3: 100.0, 7: 120.0})
    return path


@UNITS
def test_a_gold_program_runs_as_it_is_read(table, unit):
    assert_same_moves(GOLD / f"small_program_{unit}.ngc", table, ORIGIN_MM, "G55")


@UNITS
def test_a_shift_that_a_program_before_has_left_does_not_reach_a_gold_program(table, tmp_path, unit):
    gold = GOLD / f"small_program_{unit}.ngc"
    assert_same_moves(gold, table, ORIGIN_MM, "G55", left_over_mm=SHIFT_MM)
    without = tmp_path / gold.name
    without.write_text(gold.read_text().replace(" G92.1", ""))
    with pytest.raises(AssertionError, match=r"end differs by 12\.5"):
        assert_same_moves(without, table, ORIGIN_MM, "G55", left_over_mm=SHIFT_MM)
