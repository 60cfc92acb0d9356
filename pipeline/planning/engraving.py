r"""Engraving: the tip along lines that are laid on faces from above, at a depth below where the cutter would rest.

    rest    ___V___      the cutter dropped on the faces: its tip, without a gouge
    depth      V         the same, lower by depth_mm
"""

import math
from dataclasses import replace

import numpy as np

from cuspline.design.engravings import Engraving
from cuspline.kernel.lettering import lines_of, spread, text_outlines
from cuspline.planning.context import path_tolerance_mm
from cuspline.program.program import Moves, MoveWriter
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import CutterDoesNotFit, PlanError

CHORD_SHARE = 0.3           # of the path tolerance, that chords of curves take
SPACING_MM = 0.4            # of places along a line at which it is laid on faces that are not level
FLAT_MM = 1e-6              # heights that are one
NEEDLE_MM = 0.01            # radius of what finds the face under a pointed cutter
HEIGHT_MM = 5.0             # of text
TYPES = ("chamfer_mill", "ball")
BESIDE_MM = 1e-3            # a place on the border of its faces


def engraved(work):
    """The operation: ([PlannedOperation], (n,) bool: no samples, for no face is finished).

    Args:
        work: PlanningContext of an operation with the fields of strategies.engrave.Engrave.
    Raises:
        PlanError, CutterDoesNotFit: lines beside the faces, a groove deeper than the cutter's point, or a cutter that does not fit.
    """
    operation = work.operation
    if sum(o.title.lower() == operation.title.lower() for o in work.setup.operations) > 1:
        raise PlanError(f"{operation.title}: another operation of {work.setup.name} is called so, and a groove is found by its "
                        "operation's name: give both a name of their own")
    lines, facts = _lines(work)
    tool = _cutter(work)
    rpm, feed = work.speeds(tool, is_rough=False)
    tips = [_laid(work, tool.cutter, line) for line in lines]
    told = Engraving(setup=work.setup.name, operation=operation.title, depth_mm=operation.depth_mm,
                     width_mm=round(tool.cutter.groove_width_mm(operation.depth_mm), 6), within_mm=work.finish.profile_tolerance_mm,
                     lines=tuple(tuple(map(tuple, work.setup.turn.out(t).round(6).tolist())) for t in tips))
    facts = {"depth_mm": operation.depth_mm, "width_mm": told.width_mm, "lines": len(tips), **facts, "candidates": []}
    moves = Moves.joined([_one_line(work, line, feed) for line in tips])
    made = replace(work.measured(operation.title, tool, rpm, moves, facts), engraving=told)
    return [made], np.zeros(len(work.samples.area_mm2), bool)


def _lines(work):
    """([(n, 2) in the setup's plan], facts)."""
    operation, tolerance = work.operation, CHORD_SHARE * path_tolerance_mm(work.finish)
    if operation.lines is not None:
        return [np.array(line, float) for line in operation.lines], {}
    if operation.borders_of is not None:
        return [line[:, :2] for face in work.faces_named(operation.borders_of) for line in lines_of(face.shape, tolerance)], {}
    found, font = text_outlines(operation.text, operation.height_mm or HEIGHT_MM, tolerance, operation.font_path)
    turn = math.radians(operation.angle_deg or 0.0)
    c, s = float(fixed.cos(turn)), float(fixed.sin(turn))
    place = np.array(operation.at or (0.0, 0.0))
    return [place + np.column_stack([c * x - s * y, s * x + c * y]) for x, y in (line.T for line in found)], {"font": font}


def _cutter(work):
    """The pointed cutter or ball that makes the narrowest groove of that depth."""
    depth, tools = work.operation.depth_mm, work.tools(*TYPES)
    able = [(width, t.number) for t in tools if (width := t.cutter.groove_width_mm(depth)) is not None]
    if not able:
        said = ", ".join(f"T{t.number}" for t in tools)
        raise CutterDoesNotFit(f"{work.operation.title}: no cutter engraves {depth:g} mm deep, the points of {said} are less high: "
                               "a wider one, or a lower depth_mm")
    return next(t for t in tools if t.number == min(able)[1])


def _laid(work, cutter, line):
    """(n, 3) tips along a line (n, 2), depth_mm below where the cutter would rest.

    Raises:
        PlanError: a place beside the faces, or where other faces stand in the way.
    """
    ball = cutter.radius_mm if cutter.type == "ball" else None
    dropper = work.dropper(ball or NEEDLE_MM, ball or NEEDLE_MM, 0.0)
    places = spread(line, SPACING_MM)
    rest = dropper.tips_mm(places)
    _refuse_beside(work, places, rest)
    if np.ptp(rest) < FLAT_MM:
        places, rest = line, dropper.tips_mm(line)
    keep = np.r_[True, (np.abs(np.diff(places, axis=0)) > FLAT_MM).any(axis=1)]
    return np.column_stack([places, rest - work.operation.depth_mm])[keep]


def _refuse_beside(work, places, rest):
    """Each place is on one of the operation's faces."""
    away = work.closest_of(tuple(work.wanted)).closest_points(np.column_stack([places, rest])).distance_mm
    if (away > work.operation.depth_mm + BESIDE_MM).any():
        row = int(away.argmax())
        x, y, z = work.in_part((*places[row], rest[row]))
        raise PlanError(f"{work.operation.title}: the line is {away[row]:.3f} mm beside its faces near ({x:.3f}, {y:.3f}, {z:.3f}):"
                        " move it, or name the face there too")


def _one_line(work, tips, feed):
    """Down, along, up."""
    writer = MoveWriter((*tips[0, :2], work.clearance_z_mm))
    top = tips[0, 2] + work.operation.depth_mm + work.practice.approach_mm
    writer.rapid((*tips[0, :2], min(float(top), work.clearance_z_mm)))
    writer.feed(tips[0], work.practice.plunge_share * feed)
    for tip in tips[1:]:
        writer.feed(tip, feed)
    writer.rapid((*writer.here_mm[:2], work.clearance_z_mm))
    return writer.moves()
