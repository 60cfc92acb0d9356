"""A small program of two tools, with lines, an arc in each plane, a helix and a full circle, that every post writes."""

import math

import numpy as np
from known_tools import tool

from cuspline.program.program import MoveWriter, Operation, Plane, Program

CLEARANCE_MM = 30.0
FLAT, BALL = tool("flat", 10, number=3), tool("ball", 6, number=7)


def changed(machine, **control):
    return machine.model_copy(update={"control": machine.control.model_copy(update=control)})


def circle_point(plane, center, radius, angle_deg):
    point = np.array(center, float)
    a, b, _ = plane.axes
    point[a] += radius * math.cos(math.radians(angle_deg))
    point[b] += radius * math.sin(math.radians(angle_deg))
    return point


def roughing():
    """Lines, an arc in each plane, a helix, a full circle."""
    w = MoveWriter((5, 5, CLEARANCE_MM))
    w.rapid((5, 5, 12))
    w.feed((5, 5, 1 / 3), 300)
    w.feed((20, 5, 1 / 3), 1200)
    for plane, is_clockwise in ((Plane.XY, False), (Plane.ZX, True), (Plane.YZ, False)):
        center = w.here_mm - circle_point(plane, (0, 0, 0), 7.77, 200)
        w.arc(circle_point(plane, center, 7.77, 95 if is_clockwise else 290), center, plane, is_clockwise, 900)
    center = w.here_mm + (4, 0, 0)
    w.arc(center + (0, 4, -0.25), center, Plane.XY, True, 800)
    w.arc(w.here_mm, center, Plane.XY, False, 800)
    w.rapid((*w.here_mm[:2], CLEARANCE_MM))
    return w.moves()


def finishing():
    w = MoveWriter((0, -2.5, CLEARANCE_MM))
    w.rapid((0, -2.5, 5))
    w.feed((0, -2.5, -1e-6), 150)
    w.feed((10, -2.5, 0), 700.55)
    w.feed((10, -2.5, 2), 700.55)
    w.rapid((10, -2.5, CLEARANCE_MM))
    return w.moves()


def operation(name, tool_, moves, rpm=8000.0, coolant="flood"):
    return Operation(name=name, tool=tool_, spindle_rpm=rpm, coolant=coolant, moves=moves)


def program(*operations, header=("PART (SMALL)", "Units and zero in the header")):
    return Program(name="small", setup="setup-1", wcs="G55", wcs_in_words="corner", clearance_z_mm=CLEARANCE_MM,
                   header=header, operations=operations or (operation("rough", FLAT, roughing()),
                                                            operation("finish", BALL, finishing(), 12000, "mist")))


def one(*steps, start=(0, 0, CLEARANCE_MM)):
    """A program of one operation: each step calls a MoveWriter; a retract at the end."""
    w = MoveWriter(start)
    for name, *arguments in steps:
        getattr(w, name)(*arguments)
    w.rapid((*w.here_mm[:2], CLEARANCE_MM))
    return program(operation("cut", FLAT, w.moves()))
