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
