"""Our reader against LinuxCNC's interpreter, move by move."""

from pathlib import Path

import numpy as np

from cuspline.posts.readers.rs274_reader import read_program
from cuspline.program.program import Kind
from cuspline.values.errors import ReadError

from .interpreter import interpret, tool_lengths_from_table, tool_radii_from_table

END_MM = 1e-9           # the interpreter counts in inches: twelve digits are left of a metre
CENTER_MM = 1e-7        # a centre by R, near a half circle, has half the digits of its words
FEED_RELATIVE = 1e-9


def assert_same_moves(program_path, tool_table_path, work_offset, wcs="G54", left_over_mm=(0.0, 0.0, 0.0)):
    """The interpreter accepts a program and makes the moves that our reader reads.

    Args:
        tool_table_path: LinuxCNC tool table in mm, such as outputs/<design>/tools.tbl.
        work_offset: (x, y, z) machine coordinates of the WCS origin, mm.
        left_over_mm: shift by G92 that the interpreter starts with, and the reader knows nothing of.
    Returns:
        PostedMoves as read.
    Raises:
        AssertionError: names the first line that differs, or the interpreter's error.
        ReadError: our reader refuses the program.
    """
    tools, offsets = tool_lengths_from_table(tool_table_path), {wcs: tuple(work_offset)}
    radii = tool_radii_from_table(tool_table_path)
    moves = read_program(Path(program_path).read_text(), work_offsets=offsets, tool_lengths=tools, tool_radii=radii)
    truth = interpret(program_path, tool_lengths=tools, work_offsets=offsets, left_over_mm=left_over_mm, tool_radii=radii)
    assert truth.error == "", f"LinuxCNC refuses {program_path}, line {truth.error_line}: {truth.error}"
    assert truth.ended == moves.ended, f"{program_path}: only one of the two reached M2"
    assert len(moves) == len(truth.kind), f"{program_path}: {len(moves)} moves, LinuxCNC makes {len(truth.kind)}"
    for name, difference, allowed in differences(moves, truth):
        bad = np.flatnonzero(difference > allowed)
        assert not len(bad), (f"{program_path} line {moves.line[bad[0]]}: {name} differs by "
                              f"{difference[bad[0]]:.3g} from LinuxCNC's; {len(bad)} moves differ")
    return moves


def differences(moves, truth):
    """(name, (n,) absolute difference, what is allowed) of each column; unknown places do not differ."""
    is_arc = moves.kind >= Kind.ARC_CW
    feed_scale = np.maximum(truth.feed_mm_per_min, 1.0)
    yield "line", np.abs(moves.line - truth.line), 0
    yield "kind", np.abs(moves.kind - truth.kind), 0
    yield "plane", np.abs(moves.plane - truth.plane) * is_arc, 0
    yield "turns", np.abs(moves.turns - truth.turns), 0
    yield "tool", np.abs(moves.tool - truth.tool), 0
    yield "end", _largest_mm(moves.end_mm - truth.end_mm), END_MM
    yield "machine position", _largest_mm(moves.machine_end_mm - truth.machine_end_mm), END_MM
    yield "arc centre", _largest_mm(moves.center_mm - truth.center_mm), CENTER_MM
    yield "feed", np.abs(moves.feed_mm_per_min - truth.feed_mm_per_min) / feed_scale, FEED_RELATIVE


def _largest_mm(difference_mm):
    return np.nan_to_num(np.abs(difference_mm), nan=0.0).max(axis=1, initial=0.0)


def verdicts(text, folder, *, tool_lengths, work_offsets):
    """(our reader's error, LinuxCNC's error) on one text; "" where it is accepted."""
    path = Path(folder) / "program.ngc"
    path.write_text(text)
    truth = interpret(path, tool_lengths=tool_lengths, work_offsets=work_offsets)
    try:
        read_program(text, work_offsets=work_offsets, tool_lengths=tool_lengths)
    except ReadError as error:
        return str(error), truth.error
    return "", truth.error
