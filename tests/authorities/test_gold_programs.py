"""The accepted gold programs of our posts are programs that LinuxCNC executes as our reader reads them."""

from pathlib import Path

import pytest

from .linuxcnc.comparison import assert_same_moves
from .linuxcnc.interpreter import write_tool_table

pytestmark = pytest.mark.linuxcnc

GOLD = Path(__file__).parent.parent / "gold"


@pytest.mark.parametrize("unit", ["mm", "inch"])
def test_a_gold_program_runs_as_it_is_read(tmp_path, unit):
    table = tmp_path / "tool.tbl"
    write_tool_table(table, {3: 100.0, 7: 120.0})
    assert_same_moves(GOLD / f"small_program_{unit}.ngc", table, (101.5, -20.25, -300.125), "G55")
