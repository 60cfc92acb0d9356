"""Tool-centre-point control: tilted operations as tip and rotaries, read back through whatever zero and tool there are."""

import re

import numpy as np
import pytest
from known_machines import FIVE_AXIS
from known_tilted import (
    BALL,
    FLAT,
    assert_ends_are_read,
    blocks,
    machine,
    off_lines,
    operation,
    position,
    program,
    read,
    rolling,
    text_of,
    upright,
)

from cuspline.app.catalogue import reader_of
from cuspline.posts.writers import linuxcnc
from cuspline.program.program import Kind
from cuspline.values.errors import PostError, ReadError

ROUNDING_MM = 1e-4          # four decimals of a length
ROUNDING_RAD = 2e-7         # five of a degree


def tip(name, word="M428", **control):
    return machine(name, tip_control=word, **control)


def cuts(posted):
    return np.flatnonzero(posted.kind == Kind.FEED)


def first_at(posted):
    """The row that ends where the planned plunge does."""
    return int(np.nanargmin(np.linalg.norm(posted.end_mm - rolling().end_mm[1], axis=1)))


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_the_tip_keeps_to_its_lines_and_the_axis_is_the_planned_one(name):
    mill, moves = tip(name), rolling()
    posted = read(mill, text_of(mill, operation("finish", moves)))
    assert posted.remarks == () and posted.ended
    assert_ends_are_read(posted, moves, ROUNDING_MM, ROUNDING_RAD, end=-1)
    low = cuts(posted)[posted.start_mm[cuts(posted), 2] < 4]
    before_arc = low[posted.end_mm[low, 0] < moves.end_mm[int(np.flatnonzero(moves.kind > Kind.FEED)[0]) - 1, 0] - 1]
    off = off_lines(posted.end_mm[before_arc], moves.starts_mm[1:], moves.end_mm[1:])
    assert len(before_arc) > 50 and off.max() < ROUNDING_MM


@pytest.mark.parametrize("name", ("mill_trunnion_ac", "mill_head_head"))
def test_the_same_text_cuts_the_same_with_another_zero_and_another_tool(name):
    mill = tip(name)
    text = text_of(mill, operation("finish", rolling()))
    x, y, z = mill.wcs_origin_mm
    here = read(mill, text)
    moved = mill.model_copy(update={"wcs_origin_mm": (x + 3.0, y - 2.0, z + 4.0)})
    there = read(moved, text)
    longer = reader_of(mill)(text, work_offsets={"G54": mill.wcs_origin_mm}, tool_lengths={7: BALL.length_mm + 5.0})
    begin = first_at(here)
    for other in (there, longer):
        assert len(other) == len(here) and np.abs(other.end_mm[begin:-2] - here.end_mm[begin:-2]).max() < 1e-9
        assert np.abs(other.end_axis - here.end_axis).max() < 1e-12
        assert np.nanmax(np.abs(other.machine_end_mm - here.machine_end_mm)) > 2
    solved = machine(name)
    text = text_of(solved, operation("finish", rolling()))
    off = reader_of(solved)(text, work_offsets={"G54": moved.wcs_origin_mm}, tool_lengths={7: BALL.length_mm + 5.0})
    assert np.nanmin(np.linalg.norm(off.end_mm - rolling().end_mm[6], axis=1)) > 0.1


def test_it_takes_fewer_blocks_than_joints_do():
    count = lambda mill: len(blocks(text_of(mill, operation("finish", rolling()))))
    assert count(tip("mill_trunnion_ac")) < 0.85 * count(machine("mill_trunnion_ac"))


def test_by_the_output_it_reads_the_same():
    by_word, by_output = (text_of(tip("mill_trunnion_ac", word), operation("finish", rolling())) for word in ("M428", "M68"))
    assert "M428\n" in by_word and "M68 E3 Q1\nM66 E0 L0\n" in by_output and "M428" not in by_output
    one, other = read(machine("mill_trunnion_ac"), by_word), read(machine("mill_trunnion_ac"), by_output)
    assert len(one) == len(other) and np.nanmax(np.abs(one.end_mm - other.end_mm)) == 0


@pytest.mark.parametrize("word", (None, "M428"))
def test_the_post_says_how_long_the_joints_take_where_rotaries_turn(word):
    """LinuxCNC brings every block with rotary words nearly to rest: several times what the tip's feed would take."""
    both = program(operation("rough", upright(), FLAT), operation("finish", rolling()))
    made = linuxcnc.post(both, tip("mill_trunnion_ac", word))
    noted = [int(n) for n in re.findall(r"ABOUT (\d+) S", made.text)]
    assert set(made.joint_s) == {2} and noted == [round(made.joint_s[2])] and 6 < made.joint_s[2] < 11
    assert linuxcnc.post(program(position(25.0, 70.0)), tip("mill_trunnion_ac", word)).joint_s == {}


@pytest.mark.parametrize("name", ("mill_trunnion_ac", "mill_head_head"))
def test_every_joint_keeps_within_its_speed(name):
    mill = tip(name)
    posted = read(mill, text_of(mill, operation("finish", rolling())))
    rows = cuts(posted)
    rows = rows[rows > cuts(posted)[0] + 1]
    chain = mill.kinematics
    joints = np.hstack([posted.machine_end_mm, np.radians(posted.rotary_deg)])
    run = np.linalg.norm(posted.end_mm[rows] - posted.start_mm[rows], axis=1)
    seconds = 60 * run / np.where(posted.feed_mm_per_min[rows] > 0, posted.feed_mm_per_min[rows], np.inf)
    moving = run > 1e-6
    speed = np.abs(joints[rows] - joints[rows - 1])[moving] / seconds[moving, None]
    assert (speed <= chain.speed).all()


def test_rotaries_are_stated_and_the_control_is_off_for_all_else():
    mill = tip("mill_trunnion_ac")
    text = text_of(mill, operation("rough", upright(), FLAT), operation("finish", rolling()), operation("again", upright()))
    lines = blocks(text)
    on, off = lines.index("M428"), lines.index("M429")
    assert lines.count("M428") == 1 and lines[on - 1] == lines[off - 1] == "G4 P0.05"
    assert not any(re.match(r"G53|M6|T|G43|G0", line) for line in lines[on:off])
    assert lines[off + 1:off + 3] == ["G53 G0 Z0", "G53 G0 C0 A0"]
    assert all(w in lines[on + 1] for w in "XYZ") and lines[on + 1].startswith("G1")
    assert read(mill, text).remarks == ()


def test_inches_leave_the_rotaries_as_they_are():
    by_unit = {unit: text_of(tip("mill_trunnion_ac", units=unit), operation("finish", rolling())) for unit in ("mm", "inch")}
    turned = lambda text: [re.findall("[AC][-0-9.]+", line) for line in blocks(text)]
    assert turned(by_unit["mm"]) == turned(by_unit["inch"])
    one, other = (read(machine("mill_trunnion_ac", units=unit), text) for unit, text in by_unit.items())
    assert one.end_mm[-5] == pytest.approx(other.end_mm[-5], abs=2 * ROUNDING_MM)
    assert one.feed_mm_per_min[cuts(one)[50]] == pytest.approx(other.feed_mm_per_min[cuts(other)[50]], rel=0.02)


def test_a_wrong_length_is_named_and_moves_the_tip_along_its_axis():
    mill = tip("mill_trunnion_ac")
    right = text_of(mill, operation("finish", rolling()))
    lengths = {7: BALL.length_mm, 3: BALL.length_mm + 4.0}
    posted, meant = (reader_of(mill)(text, work_offsets={"G54": mill.wcs_origin_mm}, tool_lengths=lengths)
                     for text in (right.replace("G43 H7", "G43 H3"), right))
    assert {r.kind for r in posted.remarks} == {"wrong_length_offset"}
    begin = first_at(meant)
    off = posted.end_mm[begin:-3] - meant.end_mm[begin:-3]
    assert np.abs(off - 4.0 * meant.end_axis[begin:-3]).max() < 1e-9


def test_without_the_switch_the_text_is_refused():
    mill = tip("mill_trunnion_ac")
    text = text_of(mill, operation("finish", rolling())).replace("M428\n", "")
    with pytest.raises(ReadError, match="turns rotary axes under G94 without tool-centre-point control"):
        read(mill, text)


def test_a_post_that_has_not_the_word_refuses_the_machine():
    with pytest.raises(PostError, match="tip_control G43.4 is no word of the post linuxcnc, which knows M428 and M68"):
        linuxcnc.post(program(operation("rough", upright(), FLAT)), tip("mill_trunnion_ac", "G43.4"))


HEAD = "G21\nG17 G90 G91.1 G94 G40 G49 G80 G92.1\nG64 P0.01\nG54\nT7 M6\nG43 H7\nG53 G0 X0 Y0 Z0 A-30 C20\n"


@pytest.mark.parametrize("text, message", [
    ("M428\nG1 X0 Y0 Z5 F100\nG53 G0 Z0\nM2", "G53 under tool-centre-point control"),
    ("M428\nG1 X0 Y0 Z5 F100\nT3 M6\nM2", "M6 under tool-centre-point control"),
    ("M428\nG49\nM2", "G49 under tool-centre-point control"),
    ("M68 E3 Q1\nG1 X0 Y0 Z5 F100\nM2", "a move while M68 E3 changes the kinematics"),
    ("M68 E0 Q1\nM2", "M68 for anything but the kinematics"), ("M66 E0 L0\nM2", "M66 that waits for no change"),
    ("G55\nM428\nG1 X5 F100\nM2", "nobody knows where X Y Z stands"),
    ("M428\nG1 X0 Y0 Z5 F100\nG2 X2 Y0 I1 J0\nM2", "an arc while a rotary axis is off 0")])
def test_what_controls_do_differently_under_it_is_refused(text, message):
    with pytest.raises(ReadError, match=message):
        read(machine("mill_trunnion_ac"), HEAD + text + "\n")


def test_it_needs_rotary_axes_and_a_tool_length():
    with pytest.raises(ReadError, match="without rotary axes"):
        read(machine("mill_3axis"), HEAD.replace(" A-30 C20", "") + "M428\nM2\n")
    with pytest.raises(ReadError, match="without a tool length"):
        read(machine("mill_trunnion_ac"), HEAD.replace("G43 H7\n", "") + "M428\nM2\n")


def test_switching_stands_still():
    """On and off again where everything is known: the tip is where it was, and in between it is the true one."""
    mill = machine("mill_trunnion_ac")
    text = HEAD + "G0 X10 Y20\nG0 Z40\nG93\nG1 X11 Y20 Z40 F20\nG94\nM428\nG1 A-30 F100\nM429\nG93\nG1 X12 Y20 Z40 F20\nM2\n"
    posted = read(mill, text)
    rows = cuts(posted)
    joints = np.array([[*np.add(mill.wcs_origin_mm, (11, 20, 40 + BALL.length_mm)), *np.radians([20, -30])]])
    true = mill.kinematics.forward(joints, BALL.length_mm)[0][0] - mill.wcs_origin_mm
    middle = rows[len(rows) // 2]
    assert posted.end_mm[rows[0]] == pytest.approx(posted.start_mm[rows[1]], abs=1e-9)
    assert np.linalg.norm(posted.end_mm[rows] - true, axis=1).min() < 1e-9 and posted.end_mm[middle] == pytest.approx(true, abs=1.1)
