"""Taps where the tool leans and stands: in a plane of the control, or as joints of a machine that turns the part."""

import dataclasses

import numpy as np
import pytest
from known_tilted import LENGTHS, ROUNDING_MM, machine, program, read_with_tools
from positioned_mills import ON_MACHINES, leaning_frame, mill
from tapped_holes import tap

from cuspline.app import catalogue
from cuspline.program.drilling import DrillCycle, drilled
from cuspline.program.program import Kind, Operation
from cuspline.values.errors import PostError

RPM, LEVEL_MM = 500.0, 20.0
HOLES = ((10, 5, -9), (-4, 5, -9), (-4, 9, -11.5))


def position(sign=1, kind="tap"):
    """(Operation of three holes along a leaning axis, Frame whose Z it is)."""
    frame = leaning_frame()
    own = {"pitch_mm": float(sign)} if kind == "tap" else {"dwell_s": 0.5}
    holes = [DrillCycle(kind=kind, xy_mm=(x, y), bottom_z_mm=z, retract_z_mm=3.0, first=0, end=0, feed_mm_per_min=RPM, **own)
             for x, y, z in HOLES]
    moves, cycles = drilled(holes, LEVEL_MM, RPM)
    moves = dataclasses.replace(moves, start_mm=frame.out(moves.start_mm[None])[0], end_mm=frame.out(moves.end_mm),
                                axis=np.tile(frame.rotation[:, 2], (len(moves), 1)))
    return Operation(name="side", tool=tap(sign, 1.0), spindle_rpm=RPM, coolant="off", moves=moves, cycles=cycles,
                     level_mm=LEVEL_MM), frame


def text_of(m, operation):
    return catalogue.find_post(m.control.post).post(program(operation), m).text


def read(m, operation):
    return read_with_tools(m, text_of(m, operation), LENGTHS | {operation.tool.number: operation.tool.length_mm})


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("control, name", ON_MACHINES)
def test_a_tap_goes_down_its_axis_and_back_by_its_pitch(control, name, sign):
    m, (operation, frame) = mill(control, name), position(sign)
    posted = read(m, operation)
    tied = np.flatnonzero(posted.pitch_mm)
    assert np.abs(posted.pitch_mm[tied] - sign).max() < 1e-9 and (posted.kind[tied] == Kind.FEED).all() and len(tied) == 6
    wanted = np.array([(x, y, end) for x, y, z in HOLES for end in (z, 3.0)])
    assert np.abs(frame.into(posted.end_mm[tied]) - wanted).max() < ROUNDING_MM
    assert np.abs(posted.feed_mm_per_min[tied] / RPM - 1).max() < 1e-6
    assert (posted.spindle_rpm[tied] == RPM * sign).all()
    assert np.abs(frame.turn_into(posted.end_axis[tied]) - (0, 0, 1)).max() < 1e-5
    across = (np.abs(np.diff(frame.into(posted.end_mm)[tied[1]:tied[2], :2], axis=0)).max(axis=1) > 0.1).nonzero()[0]
    assert (frame.into(posted.end_mm)[tied[1] + 1, 2] > 3.0) and len(across)       # up before it goes across
    assert not posted.remarks and posted.ended


@pytest.mark.parametrize("control, name", ON_MACHINES)
def test_a_dwell_at_the_bottom_stays(control, name):
    m = mill(control, name)
    text, (dwelling, _) = text_of(m, position(kind="dwell")[0]), position(kind="dwell")
    without = text_of(m, dataclasses.replace(dwelling, cycles=()))
    more = len(text.splitlines()) - len(without.splitlines())
    assert more >= 3
    assert np.abs(read(m, dwelling).end_mm[-1] - read(m, dataclasses.replace(dwelling, cycles=())).end_mm[-1]).max() < ROUNDING_MM


@pytest.mark.parametrize("control, tip", [("linuxcnc", None), ("linuxcnc", "M428"), ("fanuc, joints", None)])
def test_where_no_z_of_the_control_is_along_the_tool_no_tap_is_posted(control, tip):
    m = mill(control, "mill_head_head")
    m = m.model_copy(update={"control": m.control.model_copy(update={"tip_control": tip})})
    assert not m.is_along_z_turned
    with pytest.raises(PostError, match=r"operation side: .*mill the thread"):
        text_of(m, position()[0])


def test_machines_say_where_they_tap():
    assert all(mill(c, m).is_along_z_turned for c, m in ON_MACHINES)
    assert not machine("mill_trunnion_ac", tip_control="M428").is_along_z_turned and machine("mill_3axis").is_along_z_turned
