"""LinuxCNC's interpreter executes the sub-programs of templated passes as our reader reads them."""

import pytest
from known_passes import LENGTHS, ZERO, machine, program

from cuspline.posts._restart import restart_points, restarted
from cuspline.posts.linuxcnc import post

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
    for part in post(program(), machine(program_store_bytes=950)).texts:
        assert judged(part).ended
