"""Indexed positions: planned upright each in its own frame, posted for every machine, read back and seen from there again."""

from dataclasses import replace

import numpy as np
import pytest
from known_machines import FIVE_AXIS
from known_tools import tool

from cuspline.app.catalogue import find_machine, reader_of
from cuspline.posts.writers import linuxcnc
from cuspline.program.arcs import straightened
from cuspline.program.positions import by_position
from cuspline.program.program import Kind, MoveWriter, Operation, Plane, Program
from cuspline.values.errors import PostError, ReadError
from cuspline.values.frames import Frame

BALL, LEVEL_MM, ROUNDING_MM = tool("ball", 6, number=7), 30.0, 3e-4
ZERO = (2.0, -3.0, 1.0)
TILTS = {"upright": 0.0, "forward": -35.0}
FRAMES = {name: Frame.of_axes(ZERO, (1.0, 0.0, 0.0), (0.0, np.sin(np.radians(a)), np.cos(np.radians(a))))
          for name, a in TILTS.items()}


def passes():
    """Down, along, round an arc and up, as seen from a position."""
    w = MoveWriter((-8, 0, LEVEL_MM))
    w.rapid((-8, 0, 4))
    w.feed((-8, 0, 1), 200)
    w.feed((6, 0, 1), 600)
    w.arc((9, 3, 1), (6, 3, 1), Plane.XY, False, 600)
    w.rapid((9, 3, LEVEL_MM))
    return w.moves()


def leaning(moves, frame, held):
    """The same seen from the clamping."""
    moves, _ = straightened(moves, 5e-4)
    into = lambda p: held.into(frame.out(p))
    return replace(moves, start_mm=into(moves.start_mm), end_mm=into(moves.end_mm),
                   axis=held.turn_into(frame.turn_out(np.tile((0.0, 0.0, 1.0), (len(moves), 1)))))


def text_of(mill):
    held = FRAMES["upright"]
    operations = [Operation(name="top", tool=BALL, spindle_rpm=8000.0, coolant="off", moves=passes()),
                  Operation(name="leaning", tool=BALL, spindle_rpm=8000.0, coolant="off", level_mm=LEVEL_MM,
                            moves=leaning(passes(), FRAMES["forward"], held))]
    program = Program(name="two", setup="setup-1", wcs="G54", wcs_in_words="", clearance_z_mm=LEVEL_MM, header=(),
                      operations=tuple(operations))
    return linuxcnc.post(program, mill).text


def read(mill, text):
    moves = reader_of(mill)(text, work_offsets={"G54": mill.wcs_origin_mm}, tool_lengths={7: BALL.length_mm})
    return by_position(moves, list(FRAMES.values()), FRAMES["upright"])


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_both_positions_see_the_moves_that_they_were_planned_with(name):
    mill = find_machine(name)
    found = read(mill, text_of(mill))
    top, front = found.moves
    for seen, planned in ((top, passes()), (front, straightened(passes(), 5e-4)[0])):
        cutting = seen.end_mm[seen.kind != Kind.RAPID]
        assert len(cutting) >= len(planned) - 2
        near = np.linalg.norm(cutting[:, None] - planned.end_mm[None], axis=2).min(axis=0)
        assert near[planned.kind != Kind.RAPID].max() < ROUNDING_MM
        assert (seen.start_axis == (0, 0, 1)).all() and (seen.end_axis == (0, 0, 1)).all()
        height = cutting[:, 2][1:]
        assert np.abs(height - 1.0).max() < ROUNDING_MM             # all along, not at ends alone
    assert (found.turning.kind == Kind.RAPID).all() and set(found.leads_to.tolist()) <= {0, 1} and 1 in found.leads_to


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_between_two_positions_the_tool_is_at_the_top_and_comes_down_where_it_begins(name):
    mill = find_machine(name)
    lines = text_of(mill).splitlines()
    turn = max(k for k, line in enumerate(lines) if line.startswith("G53 G0 ") and "Z" not in line)
    assert "G53 G0 Z" in lines[turn - 1] and any(letter in lines[turn] for letter in "ABC")


def test_rotary_words_that_are_off_by_a_thousandth_of_a_degree_are_no_position():
    mill = find_machine("mill_trunnion_ac")
    text = text_of(mill)
    assert "A-35" in text
    with pytest.raises(ReadError, match="line .*a cutting move with its tool axis along .* none of the positions"):
        read(mill, text.replace("A-35", "A-35.001"))


def test_a_position_that_the_program_leaves_out_is_told():
    mill = find_machine("mill_trunnion_ac")
    text = text_of(mill)
    cut = text[:text.index("(OPERATION 2")] + "G53 G0 Z0\nM5\nM9\nM2\n"
    with pytest.raises(ReadError, match="never points the tool along .* as position 2 requires"):
        read(mill, cut)


def test_an_operation_that_begins_below_its_own_clearance_plane_is_refused():
    low = leaning(passes(), FRAMES["forward"], FRAMES["upright"])
    operation = Operation(name="leaning", tool=BALL, spindle_rpm=8000.0, coolant="off", level_mm=LEVEL_MM + 1, moves=low)
    program = Program(name="two", setup="setup-1", wcs="G54", wcs_in_words="", clearance_z_mm=LEVEL_MM, header=(),
                      operations=(operation,))
    with pytest.raises(PostError, match="starts at Z30.000, below the clearance height Z31.000"):
        linuxcnc.post(program, find_machine("mill_trunnion_ac"))
