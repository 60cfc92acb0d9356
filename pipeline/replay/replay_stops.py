"""Where the machine stands still: tool changes, stops, the end, and the spindle switched while the flutes touch."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cuspline.stock.swept import CLOSED_UPWARD
from cuspline.values import fixed_math as fixed

TOUCHING_MM = 0.01        # flutes nearer to the stock than this touch it: cusps, rounding and chords lie far below
HEIGHT_MM = 1e-3          # missing of a height by less than a control shows is nothing
RINGS, SPOKES = 64, 128   # places asked under a tool
SENSE = {"M3": 1, "M4": -1, "M5": 0, "M6": 0}


@dataclass(frozen=True, eq=False, kw_only=True)
class Standing:
    """What a tool that stands still may meet."""

    tools: dict                     # number -> cutters.Tool
    machine: object                 # machines.Machine; None: no heights are asked for
    highest_mm: float               # of stock and fixtures before the first move, WCS
    hanging_mm: dict                # number -> how far a tool reaches below the place that is called its tip, of those that do
    stock_before: Callable | None   # see scene.FoundStock.standing_before; None: nothing is asked of contacts
    within_mm: Callable | None      # see scene.FoundStock: asked first, it costs little


def stop_findings(report, standing):
    """Findings of all stops of a program.

    Args:
        report: replay_checks.Reporter of its moves.   standing: Standing.
    Yields:
        Finding values: tool_change_low, stop_low, ends_in_cut, no_spindle.
    """
    posted, sense = report.posted, 0
    for stop in posted.stops:
        before, sense = sense, SENSE.get(stop.word, sense)
        found = _finding(report, standing, stop, before != 0 and sense != before)
        if found is not None:
            yield replace(found, line=stop.line)


def _finding(report, standing, stop, is_switched):
    posted, row, machine = report.posted, stop.row - 1, standing.machine
    if stop.word == "M6" and machine is not None:
        return _low_change(report, stop, machine)
    if row < 0 or not np.isfinite(posted.end_mm[row, 2]):
        return None
    tip, tool = posted.end_mm[row], standing.tools.get(int(posted.tool[row]))
    low = tip[2] - standing.hanging_mm.get(int(posted.tool[row]), 0.0)
    asked = stop.word in ("M0", "M1", "M2", "M30") or is_switched
    depth = -np.inf
    if (asked and tool is not None and standing.stock_before is not None and np.isfinite(tip).all()
            and low < _highest_near_mm(standing, tool, tip)):
        depth = depth_in_stock_mm(tool, tip, low, standing.stock_before(stop.row))
    if stop.word in ("M2", "M30") and depth >= 0:
        return report.finding("ends_in_cut", row, depth, tip, f"the program ends with the tool {depth:.3f} mm below the "
                              "stock that it touches: retract to the top of the machine before the end")
    if is_switched and depth >= 0:
        return report.finding("no_spindle", row, depth, tip, f"the spindle is switched by {stop.word} with the tool "
                              f"{depth:.3f} mm below the stock that it touches: retract first, then stop it")
    if stop.word in ("M0", "M1", "M2", "M30") and machine is not None:
        return _low_stop(report, stop, machine, low, standing.highest_mm)
    return None


def _highest_near_mm(standing, tool, tip):
    """Height above which a standing tool surely touches no stock."""
    if standing.within_mm is None:
        return standing.highest_mm
    near = standing.within_mm(tip[None, :2], tool.cutter.largest_radius_mm + TOUCHING_MM)[0]
    return min(standing.highest_mm, float(near) + TOUCHING_MM)


def _low_change(report, stop, machine):
    """A tool change below what the machine asks for, or nobody knows where."""
    posted, row, wanted = report.posted, stop.row - 1, machine.tool_change_height_mm
    nose = posted.machine_end_mm[row, 2] if row >= 0 else stop.nose_z_mm
    missing = wanted - nose
    if missing <= HEIGHT_MM:
        return None
    known = np.isfinite(missing)
    text = (f"the tool is changed with the spindle nose at machine Z{nose:.3f}, this machine requires Z{wanted:.3f} or higher"
            if known else "the tool is changed where nobody knows how high the spindle stands")
    place = posted.end_mm[row] if row >= 0 else (np.nan,) * 3
    found = report.finding("tool_change_low", max(row, 0), missing if known else 0.0, place,
                           f"{text}: retract before M6 (G53 G0 Z0, or G91 G28 Z0.)") if len(posted) else None
    return found


def _low_stop(report, stop, machine, low, highest_mm):
    """A stop or an end too near to the work, and below the tool change."""
    posted, row = report.posted, stop.row - 1
    missing = highest_mm + machine.stop_clearance_mm - low
    is_up = posted.machine_end_mm[row, 2] >= machine.tool_change_height_mm - HEIGHT_MM
    if missing <= HEIGHT_MM or is_up:
        return None
    return report.finding("stop_low", row, missing, posted.end_mm[row], f"{stop.word} stops with the tip {low - highest_mm:.3f} "
                          f"mm above stock and fixtures, {machine.stop_clearance_mm:g} mm are required: retract first")


def depth_in_stock_mm(tool, tip_mm, low_mm, heights):
    """How far a standing tool reaches below the highest stock that it touches, mm >= 0; -inf where it touches none.

    Args:
        tool: cutters.Tool.   tip_mm: (3,) WCS.   low_mm: height of its lowest place.
        heights: function of places (n, 2) to heights (n,) of the stock; -inf where there is none.
    """
    cutter = tool.cutter
    radius, turn = cutter.largest_radius_mm, 2 * np.pi * np.arange(SPOKES) / SPOKES
    rings = np.concatenate([np.linspace(0.0, 1.0, RINGS) * radius, [radius + TOUCHING_MM]])
    xy = tip_mm[:2] + rings[:, None, None] * np.column_stack([fixed.cos(turn), fixed.sin(turn)])
    top = heights(xy.reshape(-1, 2)).reshape(len(rings), SPOKES)
    is_upright = tool.head is None and cutter.type in CLOSED_UPWARD
    bottom = low_mm + (_bottom_mm(rings, radius, cutter.corner_radius_mm) if is_upright else np.zeros(len(rings)))
    touches = top > bottom[:, None] - TOUCHING_MM
    return max(float(top[touches].max() - low_mm), 0.0) if touches.any() else -np.inf


def _bottom_mm(rings, radius, corner):
    """Height of a ball's, bull nose's or flat cutter's bottom over its tip."""
    out = np.clip(rings - (radius - corner), 0.0, corner)
    return corner - np.sqrt(corner * corner - out * out)
