"""LinuxCNC's interpreter executes the sub-programs of templated passes as our reader reads them."""

import numpy as np
import pytest
from known_passes import LENGTHS, ZERO, machine, program
from known_tools import on_a_head
from known_vanes import CLEARANCE_MM, passes, steep_tip, vane_program

from cuspline.posts.restart import restart_points, restarted
from cuspline.posts.writers.linuxcnc import post, tool_table
from cuspline.program.program import Operation, Program
from cuspline.toolpaths.vane.side_cutter import with_wheel

from .linuxcnc.comparison import assert_same_moves
from .linuxcnc.interpreter import write_tool_table

pytestmark = pytest.mark.linuxcnc


@pytest.fixture
def judged(tmp_path):
    """Compares one text with LinuxCNC's interpreter; returns the moves."""
    write_tool_table(tmp_path / "tool.tbl", LENGTHS)

    def judge(text):
        (tmp_path / "program.ngc").write_text(text)
        return assert_same_moves(tmp_path / "program.ngc", tmp_path / "tool.tbl", ZERO["G55"], "G55")
    return judge


@pytest.mark.parametrize("units", ["mm", "inch"])
def test_linuxcnc_expands_the_calls_as_they_are_read(judged, units):
    moves = judged(post(program(), machine(units=units)).text)
    assert moves.ended and (moves.kind == 2).sum() == 24


def test_linuxcnc_takes_every_restart_and_every_file_of_a_set(judged):
    text = post(program(), machine()).text
    for point in restart_points(text):
        assert judged(restarted(text, point)).ended
    for part in post(program(), machine(program_store_bytes=1110)).texts:
        assert judged(part).ended


def test_linuxcnc_cuts_a_vane_of_calls_move_by_move_as_the_long_hand_says(judged):
    """General and matching section, rough both ways and finish: the interpreter's moves are those of the program."""
    told = vane_program(steep_tip())
    compact, long_hand = (judged(post(told, machine(sub_programs=is_compact)).text) for is_compact in (True, False))
    for k, operation in enumerate(told.operations):
        rows = [m.operation == k for m in (compact, long_hand)]
        arcs = [m.end_mm[r & (m.kind >= 2)] for m, r in zip((compact, long_hand), rows)]
        planned = operation.moves.end_mm[operation.moves.kind >= 2]
        assert arcs[0].shape == arcs[1].shape == planned.shape
        assert np.abs(arcs[0] - planned).max() < 4e-4 and np.abs(arcs[1] - planned).max() < 1e-4
    assert len(post(told, machine()).text) < 0.6 * len(post(told, machine(sub_programs=False)).text)


def test_linuxcnc_takes_a_heads_x_from_our_tool_table(tmp_path):
    """The disc hangs beside the spindle: the machine's X is off by that, the part's is not."""
    tool, control = on_a_head(), machine().control
    p = with_wheel(passes(steep_tip(), tool.cutter.corner_radius_mm, ball_radius_mm=0.0)[0], tool)
    finish = Operation(name="finish", tool=tool, spindle_rpm=800.0, coolant="flood", moves=p.moves(), passes=p)
    told = Program(name="disc", setup="setup-1", wcs="G55", wcs_in_words="end", clearance_z_mm=CLEARANCE_MM,
                   header=("DISC",), operations=(finish,))
    (tmp_path / "tools.tbl").write_text(tool_table([tool], control))
    (tmp_path / "program.ngc").write_text(post(told, machine()).text)
    moves = assert_same_moves(tmp_path / "program.ngc", tmp_path / "tools.tbl", ZERO["G55"], "G55")
    cutting = moves.kind > 0
    assert np.abs((moves.machine_end_mm - moves.end_mm)[cutting] - ZERO["G55"] - tool.offset_mm).max() < 1e-9
    assert tool.offset_mm[0] == 60.0
