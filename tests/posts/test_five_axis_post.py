"""Tilted operations posted for every machine and read back through its joints: where the plan meant the tool to be."""

import dataclasses
import re

import numpy as np
import pytest
from known_machines import FIVE_AXIS, leaning
from known_tilted import (
    BALL,
    CLEARANCE_MM,
    FLAT,
    assert_ends_are_read,
    blocks,
    machine,
    off_lines,
    operation,
    program,
    read,
    rolling,
    text_of,
    upright,
)

from cuspline.posts.writers import linuxcnc
from cuspline.posts.writers.program_files import posted
from cuspline.program.program import Kind, MoveWriter, Plane
from cuspline.values.errors import PostError, ReadError

ROUNDING_MM = 2e-4          # four decimals of a length, five of a degree 300 mm from a rotary
ROUNDING_RAD = 2e-7
SWEEP_MM = 1e-4             # how closely the reader follows the joints


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_what_is_read_back_is_what_was_planned(name):
    """Ends and axes within rounding; everything between within half the path tolerance of the planned lines."""
    mill, moves = machine(name), rolling()
    posted = read(mill, text_of(mill, operation("finish", moves)))
    assert posted.remarks == () and posted.ended
    assert_ends_are_read(posted, moves, ROUNDING_MM, ROUNDING_RAD)
    straight = moves.kind <= Kind.FEED
    last = int(np.flatnonzero(~straight)[0])
    before_arc = np.flatnonzero(posted.kind == Kind.FEED)[:-1]
    near_start = posted.end_mm[before_arc, 0] < moves.end_mm[last - 1, 0] - 1.0
    off = off_lines(posted.end_mm[before_arc][near_start], moves.starts_mm[1:last], moves.end_mm[1:last])
    assert 0 < off.max() < 0.5 * mill.control.path_tolerance_mm + ROUNDING_MM


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_the_reader_follows_the_joints_all_the_way(name):
    """One block that bends by millimetres, against the joints run densely."""
    mill = machine(name)
    chain = mill.kinematics
    angles = np.radians({"mill_head_table_bc": [[20, 30], [80, 70]], "mill_trunnion_ac": [[20, -10], [80, -40]]}.get(
        name, [[5, 10], [40, 50]]))
    tips = np.array(mill.wcs_origin_mm) + [[40.0, 0, 10], [45.0, 25, 20]]
    joints = chain.placed(tips, angles, BALL.length_mm)
    word = lambda q: " ".join(f"{c}{v:.6f}" for c, v in zip(
        chain.letters, [*(q[:3] - mill.wcs_origin_mm - [0, 0, BALL.length_mm]), *np.degrees(q[3:])]))
    text = (f"G21\nG17 G90 G91.1 G94 G40 G49 G80 G92.1\nG64 P0.001 Q0\nG54\nT7 M6\nG43 H7\nG53 G0 Z0\nG0 {word(joints[0])}\nG93\n"
            f"G1 {word(joints[1])} F2\nG94\nM2\n")
    posted = read(mill, text)
    cut = np.flatnonzero(posted.kind == Kind.FEED)
    dense = chain.forward(joints[0] + np.linspace(0, 1, 4001)[:, None] * (joints[1] - joints[0]), BALL.length_mm)[0]
    line = tips - mill.wcs_origin_mm
    assert off_lines(posted.end_mm[cut], line[:1], line[1:]).max() > 0.2           # it does bend
    assert off_lines(dense - mill.wcs_origin_mm, posted.start_mm[cut], posted.end_mm[cut]).max() < SWEEP_MM
    length = np.linalg.norm(np.diff(dense, axis=0), axis=1).sum()
    assert np.linalg.norm(posted.end_mm[cut] - posted.start_mm[cut], axis=1).sum() == pytest.approx(length, rel=1e-4)
    minutes = (np.linalg.norm(posted.end_mm[cut] - posted.start_mm[cut], axis=1) / posted.feed_mm_per_min[cut]).sum()
    assert minutes == pytest.approx(0.5) and posted.rotary_deg[-1] == pytest.approx(np.degrees(angles[1]), abs=1e-6)


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_every_joint_keeps_within_its_speed_and_acceleration(name):
    """Under G93: positions and times as they stand in the text."""
    mill = machine(name, decimals_mm=6, decimals_deg=7)
    chain, at, joints, seconds, is_cut = mill.kinematics, {}, [], [], []
    for line in blocks(text_of(mill, operation("finish", rolling()))):
        words = dict(re.findall(r"([XYZABCF])([-\d.]+)", line))
        if not line.startswith(("G64", "G53 G0 Z")) and words.keys() & set("XYZABC"):
            at |= {c: float(v) for c, v in words.items() if c != "F"}
            if set(chain.letters) <= at.keys():
                joints.append([at[c] if c in "XYZ" else np.radians(at[c]) for c in chain.letters])
                is_cut.append("F" in words)
                seconds.append(60 / float(words["F"]) if "F" in words else 1.0)
    speed = np.diff(joints, axis=0) / np.array(seconds[1:])[:, None]
    cut = np.array(is_cut[1:])
    assert (np.abs(speed[cut]) <= chain.speed * 1.001).all()
    linked = cut[1:] & cut[:-1]
    middle = (np.array(seconds[2:]) + np.array(seconds[1:-1])) / 2
    assert linked.sum() > 50 and (np.abs(np.diff(speed, axis=0))[linked] <= 1.01 * chain.acceleration * middle[linked, None]).all()


def test_the_tip_runs_at_its_feed_where_the_joints_allow_it():
    mill = machine("mill_table_table", decimals_mm=6, decimals_deg=7)
    moves = rolling()
    slow = moves.with_feed(np.where(moves.kind == Kind.RAPID, 0.0, 60.0))
    posted = read(mill, text_of(mill, operation("finish", slow)))
    cut = np.flatnonzero(posted.kind == Kind.FEED)
    length = np.linalg.norm(posted.end_mm[cut] - posted.start_mm[cut], axis=1)
    whole, minutes = (np.bincount(posted.line[cut], v) for v in (length, length / posted.feed_mm_per_min[cut]))
    of_blocks = whole[whole > 0] / minutes[whole > 0]
    assert len(of_blocks) > 50 and np.abs(of_blocks - 60.0).max() < 0.01        # in a block it runs a little unevenly:
    assert np.abs(posted.feed_mm_per_min[cut] - 60.0).max() < 1.0               # joints run evenly, not the tip


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_a_block_shorter_than_its_last_digit_is_no_faster_than_the_others(name):
    """Two nanometres on, now and then over the border between two numbers: posted as 0.0001 mm, they had F31369522 under G93."""
    w = MoveWriter((0, 0, CLEARANCE_MM))
    for k in range(400):
        w.feed((0.0171 * k, 0.0093 * k, 4.0), 600)
        w.feed(w.here_mm + 2e-6, 600)
    w.rapid((*w.here_mm[:2], CLEARANCE_MM))
    moves = w.moves()
    posted = read(machine(name), text_of(machine(name), operation(
        "finish", dataclasses.replace(moves, axis=leaning(15.0, np.zeros(len(moves)))))))
    assert posted.feed_mm_per_min[posted.kind == Kind.FEED].max() < 600 * 1.1


def test_an_upright_program_differs_by_the_rotaries_set_to_zero_alone():
    plain, mill = machine("mill_3axis"), machine("mill_trunnion_ac")
    as_small = plain.model_copy(update={"control": mill.control})
    three = blocks(text_of(as_small, operation("rough", upright(), FLAT), operation("finish", upright())))
    five = blocks(text_of(mill, operation("rough", upright(), FLAT), operation("finish", upright())))
    assert [line for line in five if line != "G53 G0 C0 A0"] == three and five.count("G53 G0 C0 A0") == 3
    posted = read(mill, "\n".join(five) + "\n")
    loaded = posted.tool > 0
    assert posted.is_upright.all() and (posted.rotary_deg[loaded] == 0).all()
    assert np.isfinite(posted.end_mm[loaded, 2]).all() and np.isfinite(posted.start_mm[loaded, 2]).all()


def test_the_rotaries_are_stated_after_every_tool_change_and_turn_at_the_top():
    mill = machine("mill_trunnion_ac")
    lines = blocks(text_of(mill, operation("rough", upright(), FLAT), operation("finish", rolling()),
                           operation("again", upright())))
    turns = [k for k, line in enumerate(lines) if line.startswith("G53 G0") and re.search("[AC]", line)]
    assert len(turns) == 4 and lines[turns[0] + 1] == "T3 M6"       # at first nobody knows where they stand
    for k in turns:
        after_change = lines[k - 1] == "G43 H3" or lines[k - 1] == "G43 H7"
        assert (after_change and {"A", "C"} <= set(lines[k])) or lines[k - 1] == "G53 G0 Z0"
    assert lines[turns[-1]] == "G53 G0 C0 A0"


def test_rotary_words_are_degrees_in_inches_too():
    in_mm, in_inches = (blocks(text_of(machine("mill_trunnion_ac", units=unit), operation("finish", rolling())))
                        for unit in ("mm", "inch"))
    turned = lambda lines: [re.findall("[AC][-0-9.]+", line) for line in lines]
    assert turned(in_mm) == turned(in_inches) and sum(map(len, turned(in_mm))) > 100
    mill = machine("mill_trunnion_ac", units="inch")
    posted = read(mill, "\n".join(in_inches) + "\n")
    assert np.nanmin(np.linalg.norm(posted.end_mm - rolling().end_mm[5], axis=1)) < ROUNDING_MM


def test_a_program_solved_for_another_machine_cuts_elsewhere():
    """Sign of A wrong, pivot 0.1 mm off, another zero: the text is read through the machine that there is."""
    mill, moves = machine("mill_trunnion_ac"), rolling()
    changed = lambda **values: mill.model_copy(update={"a": mill.a.model_copy(update=values)})
    def off(meant):
        posted = read(mill, text_of(meant, operation("finish", moves)))
        return np.nanmin(np.linalg.norm(posted.end_mm - moves.end_mm[6], axis=1))
    assert off(mill) < ROUNDING_MM
    assert off(changed(direction=(-1.0, 0.0, 0.0), min_deg=-30.0, max_deg=120.0)) > 1.0
    assert 0.01 < off(changed(offset_mm=(0.0, 0.1, 0.0))) < 0.1
    assert 0.01 < off(mill.model_copy(update={"wcs_origin_mm": (0.0, 0.1, -450.0)})) < 0.2


def test_a_rotary_that_winds_up_its_range_is_refused_by_the_move():
    w = MoveWriter((10, 0, CLEARANCE_MM))
    for k in range(1, 120):
        w.feed((10 + 0.1 * k, 0, 0), 500)
    w.rapid((*w.here_mm[:2], CLEARANCE_MM))
    moves = dataclasses.replace(w.moves(), axis=leaning(15.0, np.r_[np.linspace(0, 1190, len(w) - 1), 1190]))
    with pytest.raises(PostError, match=r"operation finish: row \d\d+: the rotaries come to the end of their range in the cut"):
        text_of(machine("mill_head_table_bc"), operation("finish", moves))


def test_a_joint_beyond_its_limit_is_refused_by_the_move_the_axis_and_the_value():
    mill = machine("mill_trunnion_ac")
    moves = rolling()
    high = dataclasses.replace(moves, axis=leaning(np.where(np.arange(len(moves)) == 6, 125.0, 20.0), 0.0))
    with pytest.raises(PostError, match=r"operation finish: row 6: A would stand at -12\d\.\d+ degrees, its range is"):
        text_of(mill, operation("finish", high))


def test_a_post_that_knows_no_rotaries_refuses_a_machine_that_has_them():
    class Three(linuxcnc._LinuxCNC):
        knows_rotaries = False

    with pytest.raises(PostError, match="mill_trunnion_ac has the rotary axes C and A, and the post .* writes no rotary words"):
        posted(program(operation("rough", upright(), FLAT)), machine("mill_trunnion_ac"), Three())


HEAD = "G21\nG17 G90 G91.1 G94 G40 G49 G80 G92.1\nG64 P0.01\nG54\nT7 M6\nG43 H7\nG53 G0 Z0\n"


@pytest.mark.parametrize("text, message", [
    ("G0 X0 Y0 Z5\nG1 X1 F100\nM2", "a cutting move while nobody knows where C A stands"),
    ("G0 X0 Y0 Z5 C0\nG1 X1 F100\nM2", "a cutting move while nobody knows where A stands"),
    ("G0 X0 Y0 Z5 A10 C0\nG93\nG1 X1 F9\nG2 X2 Y0 I0.5 J0 A20 F9\nM2", "an arc while a rotary axis turns"),
    ("G0 X0 Y0 Z5 B0\nM2", "uses B")])
def test_what_a_machine_with_rotaries_cannot_know_is_refused(text, message):
    with pytest.raises(ReadError, match=message):
        read(machine("mill_trunnion_ac"), HEAD + text + "\n")


@pytest.mark.parametrize("plane, arc", [("G17", "G2 X2 Y0 Z-3 I1 J0 P2"), ("G18", "G3 X2 Z5 I1 K0"), ("G19", "G2 Y4 Z5 J2 K0")])
def test_an_arc_while_the_part_stands_turned_is_that_arc_turned(plane, arc):
    mill = machine("mill_trunnion_ac")
    rows = lambda angles: HEAD + f"G0 X0 Y0 Z5 {angles}\n{plane}\n{arc} F100\nM2\n"
    there, here = read(mill, rows("A10 C20")), read(mill, rows("A0 C0"))
    turned, flat = there.kind > Kind.RAPID, here.kind > Kind.RAPID
    frame, begins, center = mill.kinematics.linear_axes(np.radians([20.0, 10.0])), here.start_mm[flat], here.center_mm[flat]
    seen = frame.into(there.end_mm[turned]) - frame.into(there.start_mm[turned][:1]) + begins
    axes = list(Plane(here.plane[flat][0]).axes[:2])
    off = np.linalg.norm((seen - center)[:, axes], axis=1) - np.linalg.norm((begins - center)[:, axes])
    way = np.linalg.norm(there.end_mm[turned] - there.start_mm[turned], axis=1).sum()
    assert np.abs(off).max() < 1e-9 and np.abs(seen[-1:] - here.end_mm[flat]).max() < 1e-9
    assert way == pytest.approx(np.hypot(np.pi * 3, 8) if plane == "G17" else np.pi * (1 if plane == "G18" else 2), rel=1e-3)
    assert there.feed_mm_per_min[turned] == pytest.approx(100.0, rel=1e-3)


def test_a_machine_without_rotaries_takes_no_rotary_words():
    with pytest.raises(ReadError, match="uses A"):
        read(machine("mill_3axis"), HEAD + "G0 X0 A10\nM2\n")
