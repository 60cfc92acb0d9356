"""Tilted programs on LinuxCNC: its kinematics put the tool where it is meant, its motion keeps to tolerance and time."""

import re

import numpy as np
import pytest
from known_machines import FIVE_AXIS
from known_tilted import BALL, machine, off_lines, operation, read, rolling, text_of

from cuspline.posts.writers.joint_words import LEANING_BLEND_SHARE, SolvedMoves
from cuspline.program.program import Kind

from .linuxcnc import controller, kinematics
from .linuxcnc.kinematics import A, C

MM, DEGREES = 1e-3, 1e-3
EXACT_MM = 1e-9         # two computations of one pose
TIME = 0.05             # share by which the estimate may be off


def driven(mill, text, folder):
    (folder / "program.ngc").write_text(text)
    run = controller.drive(folder / "program.ngc", tool_lengths={BALL.number: BALL.length_mm},
                           work_offsets={"G54": mill.wcs_origin_mm}, machine=mill)
    assert run.is_finished and run.errors == ()
    return run


def lines_of(text):
    """(lines that cut, lines of the tilted operation's moves), from 1."""
    lines = text.splitlines()
    cut = [k for k, line in enumerate(lines, 1) if re.search(r" F[\d.]", line)]
    return cut, range(lines.index("G93") + 1, lines.index("G94") + 1)


@pytest.mark.controller
@pytest.mark.parametrize("name", FIVE_AXIS)
def test_every_servo_cycle_is_within_the_path_tolerance_of_the_plan(name, tmp_path):
    mill, moves = machine(name), rolling()
    text = text_of(mill, operation("finish", moves))
    run = driven(mill, text, tmp_path)
    cut, _ = lines_of(text)
    at = np.isin(run.line, cut)
    joints = np.hstack([run.position_mm, np.radians(run.turned_deg)])[at]
    tips = mill.kinematics.forward(joints, BALL.length_mm)[0] - mill.wcs_origin_mm
    straight = np.flatnonzero(moves.kind == Kind.FEED)
    before_arc = tips[tips[:, 0] < moves.end_mm[straight[-1], 0] - 0.5]
    off = off_lines(before_arc[::5], moves.starts_mm[straight], moves.end_mm[straight])
    assert len(before_arc) > 1000 and 0.1 * mill.control.path_tolerance_mm < off.max() <= mill.control.path_tolerance_mm


@pytest.mark.controller
@pytest.mark.parametrize("feed_share", [1.0, 0.2])
@pytest.mark.parametrize("name", FIVE_AXIS)
def test_the_time_is_what_the_joints_let_it_be(name, feed_share, tmp_path):
    mill, moves = machine(name), rolling()
    finish = operation("finish", moves.with_feed(feed_share * moves.feed_mm_per_min))
    text = text_of(mill, finish)
    run = driven(mill, text, tmp_path)
    _, own = lines_of(text)
    estimate = SolvedMoves(finish, mill).driven_s(LEANING_BLEND_SHARE * mill.control.path_tolerance_mm)
    assert estimate == pytest.approx(np.isin(run.line, own).sum() * controller.SERVO_PERIOD_S, rel=TIME)


@pytest.mark.kinematics
def test_linuxcncs_kinematics_put_the_tool_where_the_plan_meant_it(tmp_path):
    """The words of the text through its module for this trunnion, at the end of every move."""
    mill, moves = machine("mill_trunnion_ac"), rolling()
    finish = operation("finish", moves)
    at, words = dict.fromkeys("XYZAC", 0.0), []
    for line in text_of(mill, finish).splitlines():
        if re.match(r"(G53 )?(G0 |G1 )?[XYZAC][-\d]", line) and line != "G53 G0 Z0":
            at |= {c: float(v) for c, v in re.findall(r"([XYZAC])([-\d.]+)", line)}
            words.append([at[c] for c in "XYZAC"])
    solved, words = SolvedMoves(finish, mill), np.array(words)
    ends = np.append(solved.run.first[1:-1], len(solved.run.joints)) - 1         # last block of each move
    nearest = words[[np.argmin(np.abs(words - np.r_[solved.words_mm[k], solved.run.degrees[k][::-1]]).max(axis=1)) for k in ends]]
    joints = np.zeros((len(ends), 9))
    joints[:, :3] = nearest[:, :3] + mill.wcs_origin_mm + [0, 0, BALL.length_mm]
    joints[:, 3:5] = nearest[:, 3:]
    pivot = mill.c.pivot_mm
    pins = {"x-rot-point": pivot[0], "y-rot-point": pivot[1], "z-rot-point": pivot[2], "tool-offset": BALL.length_mm}
    poses = kinematics.poses_of(kinematics.built_host(tmp_path), "xyzac-trt-kins", pins, joints)
    tips = poses[:, :3] - [0, 0, BALL.length_mm] - mill.wcs_origin_mm
    assert np.linalg.norm(tips - moves.end_mm, axis=1).max() < MM
    tilt, turn = np.radians(poses[:, A]), np.radians(poses[:, C])
    axes = np.column_stack([np.sin(turn) * np.sin(tilt), np.cos(turn) * np.sin(tilt), np.cos(tilt)])
    assert np.degrees(np.linalg.norm(axes - moves.axis, axis=1).max()) < DEGREES


@pytest.mark.kinematics
def test_under_tip_control_the_reader_moves_the_joints_as_linuxcnc_does(tmp_path):
    """Its module for this trunnion, asked where the tool is while the joints stand as the reader says: at the tip of the text."""
    mill = machine("mill_trunnion_ac", tip_control="M428")
    posted = read(mill, text_of(mill, operation("finish", rolling())))
    cut = np.flatnonzero(posted.kind == Kind.FEED)
    joints = np.zeros((len(cut), 9))
    joints[:, :3], joints[:, 3:5] = posted.machine_end_mm[cut], posted.rotary_deg[cut][:, ::-1]
    pivot = mill.c.pivot_mm
    pins = {"x-rot-point": pivot[0], "y-rot-point": pivot[1], "z-rot-point": pivot[2], "tool-offset": BALL.length_mm}
    poses = kinematics.poses_of(kinematics.built_host(tmp_path), "xyzac-trt-kins", pins, joints)
    tips = poses[:, :3] - [0, 0, BALL.length_mm] - mill.wcs_origin_mm
    assert len(cut) > 100 and np.abs(tips - posted.end_mm[cut]).max() < EXACT_MM
