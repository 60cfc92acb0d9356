"""A small dome, roughed upright and finished by a ball that leans along its passes; posted for a five-axis machine, read back."""

import cadquery as cq
import numpy as np
from known_tilted import machine
from known_tools import tool

from cuspline.app.catalogue import reader_of
from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep
from cuspline.posts.writers import linuxcnc
from cuspline.program.program import Kind, Moves, Operation, Program

HALF_MM, TOP_MM, RADIUS_MM = 4.0, 8.0, 25.0         # of the block's side; of the dome
CENTER = np.array([0.0, 0.0, TOP_MM - RADIUS_MM])
SAFE_MM = 30.0
BALL, FLAT = tool("ball", 6, number=7), tool("flat", 10, number=3)
TOOLS = {t.number: t for t in (BALL, FLAT)}
FINISH = Finish(scallop_mm=0.02, profile_tolerance_mm=0.01, gouge_mm=0.01)
STOCK = StockBox(min_mm=(-HALF_MM, -HALF_MM, 0), max_mm=(HALF_MM, HALF_MM, TOP_MM + 0.3))
SETUP = Setup(name="setup-1", wcs_in_words="middle of the base", faces=("dome",))
LEAD_RAD = np.radians(10.0)
FEED = 800.0


def solid():
    block = cq.Workplane().box(2 * HALF_MM, 2 * HALF_MM, 4 * TOP_MM, centered=(True, True, False))
    return brep.the_solid(block.intersect(cq.Workplane().sphere(RADIUS_MM).translate(tuple(CENTER))).val())


def dome_of(part):
    return [f for f in brep.faces_of(part) if f.middle.normal[0, 2] > 0.9]


def contacts(y_mm, step_mm=0.8):
    """Points and outward normals (n, 3) of one pass along x, a little beyond the block."""
    x = np.linspace(-HALF_MM - 0.5, HALF_MM + 0.5, int(np.ceil((2 * HALF_MM + 1) / step_mm)) + 1)
    z = np.sqrt(RADIUS_MM ** 2 - x ** 2 - y_mm ** 2)
    normals = np.column_stack([x, np.full_like(x, y_mm), z]) / RADIUS_MM
    return CENTER + RADIUS_MM * normals, normals


def leaning_along(normals, lead_rad=LEAD_RAD):
    """Axes that lean from the normals by the lead, along x."""
    feed = np.cross(np.cross(normals, (1.0, 0.0, 0.0)), normals)
    feed /= np.linalg.norm(feed, axis=1)[:, None]
    return np.cos(lead_rad) * normals + np.sin(lead_rad) * feed


def finishing(stepover_mm=0.6, lead_rad=LEAD_RAD, change=lambda number, tips, axes: (tips, axes), low_return=None):
    """Moves of all passes.

    Args:
        change: answers with tips and axes of a pass, by its number, instead of the planned ones.
        low_return: number of a pass after which the ball goes back by a rapid below the dome's top.
    """
    rows, r = [], BALL.cutter.radius_mm
    ys = np.linspace(-HALF_MM, HALF_MM, int(np.ceil(2 * HALF_MM / stepover_mm)) + 1)
    for number, y in enumerate(ys):
        points, normals = contacts(y)
        axes = leaning_along(normals, lead_rad)
        tips, axes = change(number, points + r * (normals - axes), axes)
        above = lambda tip: (*tip[:2], SAFE_MM)
        rows += [(Kind.RAPID, above(tips[0]), axes[0]), (Kind.RAPID, (*tips[0][:2], TOP_MM + 2.0), axes[0])]
        rows += [(Kind.FEED, tip, axis) for tip, axis in zip(tips, axes)]
        if number == low_return:
            rows += [(Kind.RAPID, (*tip[:2], TOP_MM - 0.6), axes[-1]) for tip in (tips[-1], tips[0])]
            rows.append((Kind.RAPID, above(tips[0]), axes[-1]))
        else:
            rows.append((Kind.RAPID, above(tips[-1]), axes[-1]))
    return _moves((0.0, 0.0, SAFE_MM), rows)


def roughing(left_mm=0.2, stepover_mm=4.0):
    """Upright passes of a flat cutter that leave a little."""
    rows, r = [], FLAT.cutter.radius_mm
    xs = np.linspace(-HALF_MM - r - 1, HALF_MM + r + 1, 24)
    for y in np.arange(-HALF_MM, HALF_MM + 0.1, stepover_mm):
        near = np.maximum(np.hypot(xs, y) - r, 0.0)
        z = CENTER[2] + np.sqrt(RADIUS_MM ** 2 - np.minimum(near, 12.0) ** 2) + left_mm
        rows += [(Kind.RAPID, (xs[0], y, SAFE_MM), (0, 0, 1)), (Kind.FEED, (xs[0], y, z[0]), (0, 0, 1))]
        rows += [(Kind.FEED, (*p,), (0, 0, 1)) for p in zip(xs, np.full_like(xs, y), z)]
        rows.append((Kind.RAPID, (xs[-1], y, SAFE_MM), (0, 0, 1)))
    return _moves((0.0, 0.0, SAFE_MM), rows)


def _moves(start, rows):
    kind, end, axis = (list(column) for column in zip(*rows))
    n = len(rows)
    axis = np.array(axis, float)
    return Moves(start_mm=start, kind=kind, end_mm=np.array(end, float), center_mm=np.full((n, 3), np.nan),
                 plane=np.zeros(n), axis=axis / np.linalg.norm(axis, axis=1)[:, None],
                 feed_mm_per_min=np.where(np.array(kind) == Kind.RAPID, 0.0, FEED))


def text_of(mill, moves, ball=BALL):
    """The whole program as text."""
    operation = lambda name, tool_, m: Operation(name=name, tool=tool_, spindle_rpm=9000.0, coolant="off", moves=m)
    return linuxcnc.post(Program(name="dome", setup="setup-1", wcs="G54", wcs_in_words="middle of the base", header=("DOME",),
                                 clearance_z_mm=SAFE_MM, operations=(operation("rough", FLAT, roughing()),
                                                                     operation("finish", ball, moves))), mill).text


def read(mill, text, tools=TOOLS):
    """PostedMoves, as the control that knows these tools makes them."""
    return reader_of(mill)(text, work_offsets={"G54": mill.wcs_origin_mm},
                           tool_lengths={t.number: t.length_mm for t in tools.values()})


def trunnion(**pivots):
    """The trunnion; `pivots`: of its rotaries, where they are not as its file says."""
    mill = machine("mill_trunnion_ac")
    changed = {name: mill.model_dump()[name] | {"pivot_mm": at} for name, at in pivots.items()}
    return type(mill).model_validate({**mill.model_dump(), **changed}) if changed else mill
