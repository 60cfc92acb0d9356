"""Tilted operations for five-axis machines: planned, posted, read back."""

import dataclasses

import numpy as np
from known_machines import leaning
from known_tools import tool

from cuspline.app.catalogue import find_machine, reader_of
from cuspline.posts.writers import linuxcnc
from cuspline.program.program import Kind, MoveWriter, Operation, Plane, Program

BALL, FLAT = tool("ball", 6, number=7), tool("flat", 10, number=3)
CLEARANCE_MM = 30.0
LENGTHS = {7: BALL.length_mm, 3: FLAT.length_mm + 4.0}      # as the control has them: the flat cutter 4 mm longer
ROUNDING_MM = 2e-4          # four decimals of a length, five of a degree 300 mm from a rotary
ROUNDING_RAD = 2e-7


def machine(name, **control):
    found = find_machine(name)
    return found.model_copy(update={"control": found.control.model_copy(update=control)}) if control else found


def rolling():
    """Over a wavy line and round an arc, the axis leaning by 10 to 25 degrees while it turns by 140."""
    w = MoveWriter((0, -2.5, CLEARANCE_MM))
    w.rapid((0, -2.5, 5))
    w.feed((0, -2.5, 0), 300)
    for k in range(1, 9):
        w.feed((2.5 * k, -2.5 + np.sin(k), np.cos(k)), 900)
    x, y, z = w.here_mm
    w.arc((x + 5, y + 5, z), (x + 5, y, z), Plane.XY, True, 800)
    w.rapid((*w.here_mm[:2], CLEARANCE_MM))
    moves, tilt = w.moves(), np.linspace(10, 25, len(w) - 2)
    return dataclasses.replace(moves, axis=leaning([10, 10, *tilt], [0, 0, *np.linspace(0, 140, len(tilt))]))


def upright():
    w = MoveWriter((5, 5, CLEARANCE_MM))
    w.rapid((5, 5, 2))
    w.feed((20, 5, 0), 500)
    w.arc((30, 15, 0), (20, 15, 0), Plane.XY, False, 500)
    w.rapid((*w.here_mm[:2], CLEARANCE_MM))
    return w.moves()


def operation(name, moves, tool_=BALL):
    return Operation(name=name, tool=tool_, spindle_rpm=8000.0, coolant="off", moves=moves)


def position(tilt_deg, azimuth_deg, level_mm=20.0):
    """An operation in an indexed position: a triangle at height 0 along its axis, from and to its level."""
    axis = leaning(tilt_deg, azimuth_deg)[0]
    across = np.cross(axis, (0.3, 0.2, 0.1))
    across /= np.linalg.norm(across)
    ahead = np.cross(axis, across)
    w = MoveWriter(5 * across + level_mm * axis)
    w.feed(5 * across, 200)
    for a, b in ((5, 8), (-4, 6), (5, 0)):
        w.feed(a * across + b * ahead, 700)
    w.rapid(5 * across + level_mm * axis)
    moves = dataclasses.replace(w.moves(), axis=np.tile(axis, (len(w), 1)))
    return dataclasses.replace(operation("side", moves), level_mm=level_mm)


def random_leaning(seed):
    """Up to three operations: an upright one, one that leans and turns, one in an indexed position."""
    rng = np.random.default_rng(seed)
    made = [_turning(rng), position(rng.uniform(5, 55), rng.uniform(-170, 170)), operation("upright", upright())]
    return tuple(made[k] for k in rng.permutation(3)[:rng.integers(1, 4)])


def _turning(rng):
    """Lines in a box of 60 mm, the axis leaning by up to 40 degrees, at most 10 degrees from one to the next."""
    w = MoveWriter((*rng.uniform(-30, 30, 2), CLEARANCE_MM))
    for _ in range(8):
        w.feed((*rng.uniform(-30, 30, 2), rng.uniform(-15, 15)), float(rng.integers(100, 2000)))
    w.rapid((*w.here_mm[:2], CLEARANCE_MM))
    tilt, azimuth = 20.0 + np.cumsum(rng.uniform(-2, 2, len(w))), rng.uniform(-180, 180) + np.cumsum(rng.uniform(-9, 9, len(w)))
    return operation("turning", dataclasses.replace(w.moves(), axis=leaning(tilt, azimuth)))


def program(*operations):
    return Program(name="small", setup="setup-1", wcs="G54", wcs_in_words="corner", clearance_z_mm=CLEARANCE_MM,
                   header=("SMALL",), operations=operations)


def assert_ends_are_read(posted, moves, within_mm, within_rad, end=None):
    """Every planned end but the first (up to row `end`) is one that the reader found, with the axis that was planned."""
    for k in range(1, len(moves))[:end]:
        near = np.linalg.norm(posted.end_mm - moves.end_mm[k], axis=1)
        hit = np.nanargmin(np.where(np.linalg.norm(posted.end_axis - moves.axis[k], axis=1) < 1e-3, near, np.inf))
        assert near[hit] < within_mm and np.abs(posted.end_axis[hit] - moves.axis[k]).max() < within_rad


def read_with_tools(mill, text, lengths=LENGTHS):
    """PostedMoves of a text by its own reader."""
    return reader_of(mill)(text, work_offsets={"G54": mill.wcs_origin_mm}, tool_lengths=lengths)


def assert_plan_is_read(posted, moves, mill):
    """Ends, axes, and the lines between: within half the path tolerance where joints are solved, else within rounding."""
    assert posted.remarks == () and posted.ended
    assert_ends_are_read(posted, moves, ROUNDING_MM, ROUNDING_RAD)
    arc = int(np.flatnonzero(moves.kind > Kind.FEED)[0])
    cut = np.flatnonzero((posted.kind == Kind.FEED) & (posted.end_mm[:, 0] < moves.end_mm[arc - 1, 0] - 1))
    allowed = ROUNDING_MM + (0.5 * mill.control.path_tolerance_mm if mill.control.tip_control is None else 0.0)
    assert len(cut) > 50 and off_lines(posted.end_mm[cut], moves.starts_mm[1:arc], moves.end_mm[1:arc]).max() < allowed


def assert_position_is_read(posted, side, number):
    """Every end of an indexed operation, its axis held, its four cuts at their feeds."""
    assert posted.remarks == () and posted.ended
    for end, axis in zip(side.moves.end_mm, side.moves.axis):
        near = np.linalg.norm(posted.end_mm - end, axis=1)
        hit = np.nanargmin(np.where(np.linalg.norm(posted.end_axis - axis, axis=1) < 1e-4, near, np.inf))
        assert near[hit] < ROUNDING_MM
    cut = (posted.kind == Kind.FEED) & (posted.operation == number)
    assert np.abs(posted.feed_mm_per_min[cut] - [200, 700, 700, 700]).max() < 1e-6


def assert_holds_for_any_zero_and_tool(mill, text):
    """A text of `rolling` cuts the same where the part stands elsewhere and the tool is shorter."""
    here = read_with_tools(mill, text)
    x, y, z = mill.wcs_origin_mm
    there = read_with_tools(mill.model_copy(update={"wcs_origin_mm": (x - 2, y + 1, z + 3)}), text, {7: BALL.length_mm - 6})
    begin = int(np.nanargmin(np.linalg.norm(here.end_mm - rolling().end_mm[1], axis=1)))
    assert np.abs(here.end_mm - there.end_mm)[begin:-2].max() < 1e-9


def text_of(mill, *operations):
    return linuxcnc.post(program(*operations), mill).text


def read(mill, text):
    return reader_of(mill)(text, work_offsets={"G54": mill.wcs_origin_mm},
                           tool_lengths={t.number: t.length_mm for t in (BALL, FLAT)})


def blocks(text):
    return [line for line in text.splitlines() if not line.startswith("(")]


def off_lines(points, starts, ends):
    """(n,) distance of points to the nearest of some lines."""
    d = ends - starts
    t = np.clip(((points[:, None] - starts) * d).sum(axis=2) / np.maximum((d * d).sum(axis=1), 1e-300), 0, 1)
    return np.linalg.norm(points[:, None] - starts - t[..., None] * d, axis=2).min(axis=1)
