"""Tilted programs on LinuxCNC: its kinematics put the tool where it is meant, its motion keeps to tolerance and time."""

import re

import numpy as np
import pytest
from known_machines import FIVE_AXIS, JUDGED
from known_tilted import BALL, machine, off_lines, operation, read, rolling, text_of

from cuspline.posts.writers.joint_words import LEANING_BLEND_SHARE, SolvedMoves
from cuspline.posts.writers.tip_words import TipMoves
from cuspline.program.arcs import Arc
from cuspline.program.program import Kind, Plane

from .linuxcnc import controller, kinematics, spindles

MM, DEGREES = 1e-3, 1e-3
EXACT_MM = 1e-9         # two computations of one pose
TIME = 0.05             # share by which the estimate may be off


def driven(mill, text, folder, spindle=None):
    (folder / "program.ngc").write_text(text)
    run = controller.drive(folder / "program.ngc", tool_lengths={BALL.number: BALL.length_mm},
                           work_offsets={"G54": mill.wcs_origin_mm}, machine=mill, spindle=spindle)
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


def meant(run, moves):
    """What the plan says of the end of every block of a JointRun: (n, 3) tips on lines and arcs, (n, 3) axes on great circles."""
    first, starts, before = np.searchsorted(run.move, np.arange(len(moves) + 1)), moves.starts_mm, np.roll(moves.axis, 1, axis=0)
    before[0] = moves.axis[0]
    tips, axes = np.empty((len(run.move), 3)), np.empty((len(run.move), 3))
    for k, (move, row, share) in enumerate(zip(run.move, run.path.row, run.path.share)):
        rows = run.path.row[first[move]:first[move + 1]]
        whole = (row - rows[0] + share) / (rows[-1] - rows[0] + 1) if len(rows) else share
        begin, end = starts[move], moves.end_mm[move]
        arc = moves.kind[move] >= Kind.ARC_CW
        tips[k] = Arc(begin, end, moves.center_mm[move], Plane(moves.plane[move]), moves.kind[move]).at(whole) if arc else (
            begin + whole * (end - begin))
        axes[k] = on_great_circle(before[move], moves.axis[move], whole)
    return tips, axes


def on_great_circle(a, b, share):
    angle = np.arccos(np.clip(a @ b, -1, 1))
    return a if angle < 1e-7 else (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)


def words_of(text, letters, begins):
    """(n, m) words of every block with a feed, in force; `begins`: line from which they count."""
    at, rows = {}, []
    for k, line in enumerate(text.splitlines()):
        if not line.startswith(("(", "G53 G0 Z0", "G4", "G64")):
            at |= {c: float(v) for c, v in re.findall(rf"([{letters}])(-?[\d.]+)", line)}
            if k > begins and " F" in line:
                rows.append([at[c] for c in letters])
    return np.array(rows)


def native(name):
    """A preset under tip control whose words are those of LinuxCNC's module for it: A on B counts as the tool turns there."""
    mill = machine(name, tip_control="M68")
    if name != "mill_a_on_b":
        return mill
    a, b = (axis.model_copy(update={"direction": tuple(-v for v in axis.direction)}) for axis in (mill.a, mill.b))
    return mill.model_copy(update={"a": a, "b": b})


@pytest.mark.controller
@pytest.mark.kinematics
@pytest.mark.parametrize("name", ("mill_trunnion_ac", "mill_a_on_b"))
def test_under_tip_control_its_motion_keeps_to_tolerance_and_time(name, tmp_path):
    """Its own module switched on: tip and, at every block's end, cutting edge within the path tolerance; 5 % of the time."""
    mill, moves = native(name), rolling()
    finish, tolerance_mm = operation("finish", moves), mill.control.path_tolerance_mm
    text, spindle = text_of(mill, finish), spindles.spindle_of(mill)
    assert spindle.is_native
    run, laid = driven(mill, text, tmp_path, spindle), TipMoves(finish, mill)
    lines = text.splitlines()
    own = [k for k, line in enumerate(lines, 1) if k > lines.index("M68 E3 Q1") + 3 and " F" in line]       # behind the way in
    assert len(own) == len(laid.run.move) - 1
    joints = np.hstack([run.position_mm, np.radians(run.turned_deg)])
    cut = np.isin(run.line, np.array(own)[laid.run.is_feed[1:]])
    tips, axes = mill.kinematics.forward(joints[cut], BALL.length_mm)
    tips -= mill.wcs_origin_mm
    straight = np.flatnonzero(moves.kind <= Kind.FEED)
    before_arc = tips[tips[:, 0] < moves.end_mm[straight[-2], 0] - 0.5]
    off = off_lines(before_arc[::3], moves.starts_mm[straight], moves.end_mm[straight])
    assert len(before_arc) > 500 and 0.05 * tolerance_mm < off.max() <= tolerance_mm
    edge_mm = np.hypot(BALL.cutter.radius_mm, BALL.cutter.flute_length_mm)
    ends = zip(laid.words_mm[laid.run.is_feed], laid.axes[laid.run.is_feed])
    assert max(edge_mm * turned_off(tips, axes, *end) for end in ends) <= tolerance_mm
    estimate = laid.driven_s(LEANING_BLEND_SHARE * tolerance_mm)
    assert estimate == pytest.approx(np.isin(run.line, own).sum() * controller.SERVO_PERIOD_S, rel=TIME)


def turned_off(tips, axes, tip, axis):
    """Angle (rad) from an axis to that with which sampled tips pass nearest to a place."""
    way = np.diff(tips, axis=0)
    share = np.clip(((tip - tips[:-1]) * way).sum(axis=1) / np.maximum((way ** 2).sum(axis=1), 1e-30), 0, 1)[:, None]
    off = np.linalg.norm(tips[:-1] + share * way - tip, axis=1)
    near = np.flatnonzero(off < off.min() + 1e-3)
    return np.linalg.norm(axes[near] + share[near] * (axes[near + 1] - axes[near]) - axis, axis=1).min()


@pytest.mark.kinematics
@pytest.mark.parametrize("tip", (None, "M428"))
@pytest.mark.parametrize("name", JUDGED)
def test_linuxcncs_kinematics_put_the_tool_where_the_plan_meant_it_at_every_block(name, tip, tmp_path):
    """The words of the text through its module for this machine's rotaries: tip within 1 um, axis within 0.001 degrees."""
    mill, moves = machine(name, tip_control=tip), rolling()
    finish = operation("finish", moves)
    text = text_of(mill, finish)
    run = (TipMoves if tip else SolvedMoves)(finish, mill).run
    words = words_of(text, "XYZ" + "".join(mill.rotaries), text.splitlines().index(tip or "G93") + (1 if tip else 0))
    blocks = run.is_feed if not tip else np.arange(len(run.move)) > 0
    assert len(words) == blocks.sum() > 70
    degrees = {c: words[:, 3 + k] for k, c in enumerate(mill.rotaries)}
    nose = words[:, :3] + mill.wcs_origin_mm + [0, 0, BALL.length_mm]
    tips, axes = spindles.tool_in_part(kinematics.built_host(tmp_path), mill, nose, degrees, BALL.length_mm)
    tips = words[:, :3] if tip else tips - mill.wcs_origin_mm        # under tip control X Y Z are the module's own pose
    plan_tips, plan_axes = meant(run, moves)
    assert np.linalg.norm(tips - plan_tips[blocks], axis=1).max() < MM
    assert np.degrees(np.linalg.norm(axes - plan_axes[blocks], axis=1).max()) < DEGREES


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
