"""A vane as its controller lays it out: rough both ways and finish climb by arcs across, after the billet is cleared.

The main program of these passes is data and calls (pipeline/toolpaths/vane/arc_templates.py).  They are exact in the mid-plane;
what they make of the rest is computed and told (pipeline/toolpaths/vane/cutter_surface.py), and the verdict measures it.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import Field

from cuspline.design.operations import Operation, ToolWish
from cuspline.planning import section_finishing
from cuspline.planning.context import FinishingStage, finite, ridge_for_step_mm
from cuspline.planning.cutter_choice import ball_reach, choose_ball, choose_side_cutter
from cuspline.planning.roughing import roughed
from cuspline.planning.tool_depth import clear_tips_mm
from cuspline.replay.scene import Fixture
from cuspline.toolpaths.vane.arc_templates import BESIDE_MM, RegisterValues, stroke_ends, templated_passes
from cuspline.toolpaths.vane.circular_tip import CircularTip
from cuspline.toolpaths.vane.cutter_surface import cut_map
from cuspline.toolpaths.vane.side_cutter import refuse_interference, with_wheel
from cuspline.toolpaths.vane.transverse_arcs import arc_steps, center_x_of_contact_mm, stretches
from cuspline.values.errors import CutterDoesNotFit, PlanError

ROUGH_RIDGE_MM = 0.05       # of the rough passes
RESTART_STEPS = 50          # a restart point every so many; even, so that each begins clockwise
MAP_PITCH_RADII = 0.05      # along the vane, of the map that extremes are taken from
MAP_ROWS = 500              # of it that plan.json shows
BOX_ROUNDING_MM = 1e-6
LOOKED_AT = 8               # planes apart, of those whose strokes are asked for what is in their way
PLACES_A_STROKE = 9         # at even shares of each of their three pieces


class TransverseArcs(Operation):
    """On a vane: its controller's arcs across, after the stock is cleared: rough both ways, finish climb."""

    kind = "transverse_arcs"
    is_mended = False           # leaves what one arc a plane cannot cut, and says where; `sections` holds it
    why_not_mended = "transverse arcs leave what one arc in a plane cannot cut; sections hold it"
    picture = """
          .-.  .-.  .-.     one arc a plane, the planes an
        _/   \\/   \\/   \\_   even interval apart in the ball's centre"""

    passes: Literal["zig-zag", "one-way"] = Field(default="zig-zag", description="of roughing")
    allowance_mm: float = Field(default=0.254, gt=0, le=5, description="what the rough passes leave; the register is larger than "
                                "the ball by it")
    cutter: Literal["ball", "side"] = Field(default="ball",
                                            description="a ball, or a side-and-face cutter on an angle head, its axis "
                                            "along the vane")
    ball_mm: float | None = Field(default=None, gt=0,
                                  description="diameter of the finishing ball, or the width of a side-and-face cutter's teeth; "
                                  "left out: the largest that fits")
    rest: Literal["none", "sections"] = Field(default="none", description="where one arc a plane leaves more than the finish "
                                              "allows: nothing, or a ball along sections of the true surface")
    section_plane: Literal["YZ"] = "YZ"

    @property
    def wish(self):
        return None if self.ball_mm is None else ToolWish(type="ball", diameter_mm=self.ball_mm)

    def plan(self, work):
        return _operations(work)


def _operations(work):
    """(operations, (n,) bool which samples are reached) of a vane.

    Raises:
        PlanError: the design is no vane, lies another way in this setup, or its billet is wider than its body.
        CutterDoesNotFit: no ball fits, or the tip line's valley is tighter than it.
    """
    vane = _vane(work)
    is_side = work.operation.cutter == "side"
    balls = work.library if is_side else work.finishing_library
    ball, candidates, reach = choose_ball(balls, work.samples, work.hollow.radius_mm, work.mesh,
                                          work.practice.rough_allowance_mm, work.finishing_work())
    made = roughed(work, ball, reach.is_reached, lambda: None)
    tool, is_reached = ball, reach.is_reached
    if is_side:
        asked = work.operation.ball_mm
        tool, candidates = choose_side_cutter(work.library, work.hollow.radius_mm, asked and asked - 2 * work.plating_mm)
        is_reached = ball_reach(work.samples, work.mesh, tool.cutter.corner_radius_mm).is_reached
    allowance, has_rest = work.operation.allowance_mm, work.operation.rest == "sections"
    ridge_mm = ridge_for_step_mm("finish", work.finish.scallop_mm, work.finish)
    left_out = ()
    if has_rest and not is_side:
        vane, left_out = _clear_part(work, vane, tool)
    made.append(_passes(work, vane, "rough passes", tool, allowance, ROUGH_RIDGE_MM, {}))
    radius = tool.cutter.corner_radius_mm
    found = cut_map(vane.tip.between(*vane.within_mm), radius, radius, MAP_PITCH_RADII * radius)
    facts = {"candidates": [c.as_dict() for c in candidates], "plating_mm": work.plating_mm,
             "min_concave_radius_mm": finite(work.hollow.radius_mm),
             "min_concave_place_mm": work.in_part(work.hollow.place_mm),
             "cut_map": map_facts(found, vane.tip.half_arc_rad)}
    made.append(_passes(work, vane, "finish", tool, 0.0, ridge_mm, facts))
    if has_rest:
        left = found.stretches_beyond_mm(work.finish.scallop_mm - ridge_mm, made[-1].facts["stepover_mm"])
        made += _rest(work, (ball, reach), left, left_out)
    return made, is_reached


def _rest(work, ball_and_reach, left, left_out):
    """Sections where the arcs' map and their cusps together leave more than the finish, and where no arcs go."""
    ball, reach = ball_and_reach
    semi = FinishingStage(name="rest semi-finish", allowance_mm=work.operation.allowance_mm,
                          scallop_mm=work.semi_scallop_mm)
    finish = FinishingStage(name="rest finish", allowance_mm=0.0, scallop_mm=work.finish.scallop_mm)
    return [section_finishing.finish(work, stage, ball, (), reach, within)
            for stage, within in ((semi, left_out), (finish, (*left, *left_out))) if within]


def _clear_part(work, vane, tool):
    """The same _Vane as far as arcs go with holder and fixtures clear, and ((first, last), ...) planes beside that.

    An arc's plane is square to the vane, where it opens steeply its strokes go down far beside what they touch.  The
    longest run of planes that are clear is kept; every LOOKED_AT-th is asked, and the runs between two of them.

    Raises:
        CutterDoesNotFit: no plane is clear.
    """
    radius = tool.cutter.corner_radius_mm
    along, steps = _planes(work, vane, tool, ridge_for_step_mm("finish", work.finish.scallop_mm, work.finish))
    planes = np.concatenate([s.planes for s in along])
    asked = np.unique(np.r_[0:len(planes):LOOKED_AT, len(planes) - 1])
    y, z = stroke_ends(steps, asked, radius, vane.tip.flank_half_angle_rad, vane.half_mm)
    share = np.linspace(0.0, 1.0, PLACES_A_STROKE)
    between = lambda ends: (ends[:, :-1, None] + np.diff(ends, axis=1)[..., None] * share).reshape(len(asked), -1)
    tips = np.stack([np.broadcast_to(planes[asked, None], between(y).shape), between(y), between(z) - radius], axis=-1)
    is_clear = _are_clear(work, tool, tips.reshape(-1, 3)).reshape(len(asked), -1).all(axis=1)
    if is_clear.all():
        return vane, ()
    runs = [run for run in np.split(asked, np.flatnonzero(np.diff(is_clear)) + 1) if is_clear[np.searchsorted(asked, run[0])]]
    if not runs:
        raise CutterDoesNotFit(f"{work.operation.title}: nowhere along the vane do arcs of T{tool.number} {tool.cutter.name} keep "
                               "holder and fixtures clear: take a tool with more stick-out, a smaller ball or lower fixtures, or "
                               "the strategy sections")
    kept = max(runs, key=lambda run: planes[run[-1]] - planes[run[0]])
    first, last = float(planes[kept[0]]), float(planes[kept[-1]])
    x = np.linspace(*vane.within_mm, MAP_ROWS)
    center = center_x_of_contact_mm(vane.tip, radius, x)
    inside = x[(center >= first) & (center <= last)]
    margin = float(np.diff(planes[asked]).max())
    left_out = [stretch for stretch, is_cut in (((-np.inf, first + margin), kept[0] > 0),
                                                ((last - margin, np.inf), kept[-1] < len(planes) - 1)) if is_cut]
    return replace(vane, within_mm=(float(inside.min()), float(inside.max()))), tuple(left_out)


def _are_clear(work, tool, tips_mm):
    """(n,) bool: holder and shank are clear of part and stock, and all of the tool of the fixtures' boxes."""
    clear = tips_mm[:, 2] >= clear_tips_mm(tool, work.mesh, tips_mm[:, :2], work.practice.rough_allowance_mm)
    for fixture in work.fixtures:
        low, high = fixture.box_mm
        aside = np.maximum(np.maximum(low[:2] - tips_mm[:, :2], tips_mm[:, :2] - high[:2]), 0.0)
        near = np.linalg.norm(aside, axis=1) < tool.cutter.radius_mm + work.practice.keep_out_mm
        clear &= ~near | (tips_mm[:, 2] >= high[2] + work.practice.keep_out_mm)
    return clear


@dataclass(frozen=True, eq=False, kw_only=True)
class _Vane:
    """What a setup cuts of a vane."""

    tip: CircularTip            # in the frame of the setup's moves
    half_mm: float              # half width of the body
    within_mm: tuple            # (first, last) x of the faces that this setup cuts


def _vane(work):
    """_Vane of a setup."""
    tip, setup = work.design.guide_of(CircularTip), work.setup
    if tip is None:
        raise PlanError(f"{setup.name}: transverse arcs follow a vane's tip, and {work.design.name} says none "
                        "(a CircularTip among Design.guides): choose another strategy")
    if np.abs(setup.turn.rotation - np.eye(3)).max() > 1e-9:
        raise PlanError(f"{setup.name}: transverse arcs need the vane along the machine's X, its tip up: wcs_x is "
                        f"{setup.wcs_x}, wcs_z {setup.wcs_z}; make them (1, 0, 0) and (0, 0, 1)")
    half = float(max(-work.box[0][1], work.box[1][1]))
    wide = float(max(-work.stock_min_mm[1], work.stock_max_mm[1]))
    if wide > half + BESIDE_MM - BOX_ROUNDING_MM:
        raise PlanError(f"{setup.name}: transverse arcs go down beside the body, {half:.3f} mm from the mid-plane, and "
                        f"the stock reaches {wide:.3f} mm: let it be at most {BESIDE_MM:g} mm wider on either side")
    return _Vane(tip=tip, half_mm=half, within_mm=_range_mm(work))


def _range_mm(work):
    """(first, last) x of the faces that this setup cuts."""
    return tuple(work.box_of_wanted[:, 0])


def _passes(work, vane, name, tool, over_mm, ridge_mm, facts):
    """One operation over a vane.

    The register is larger than the ball, or the disc's teeth, by `over_mm`.
    """
    radius, tip = tool.cutter.corner_radius_mm, vane.tip
    along, steps = _planes(work, vane, tool, ridge_mm)
    rpm, feed = work.speeds(tool, is_rough=False)
    registers = RegisterValues(
        flank_rad=tip.flank_half_angle_rad, tool_radius_mm=radius + over_mm, ball_radius_mm=0.0 if tool.head else radius,
        half_width_mm=vane.half_mm, clearance_z_mm=work.clearance_z_mm, feed_mm_per_min=feed,
        slow_mm_per_min=work.practice.plunge_share * feed)
    passes = templated_passes(along, steps, registers, restart_steps=RESTART_STEPS, is_rough=over_mm > 0)
    if tool.head is not None:
        passes = with_wheel(passes, tool)
        facts = {**facts, "head": tool.head.name, "wheel_mm": round(tool.wheel_mm, 6)}
        boxes = [Fixture(name=f.name, min_mm=tuple(f.box_mm[0]), max_mm=tuple(f.box_mm[1])) for f in work.fixtures]
        refuse_interference(passes.moves(), tool, boxes, work.machine.spindle_head)
    intervals = [float(s.interval_mm) for s in along]
    facts = {"allowance_mm": over_mm if over_mm > 0 else 0.0, "scallop_mm": ridge_mm,
             "register_mm": round(radius + over_mm, 6),
             "ridge_for_step_mm": round(ridge_mm, 6), "stepover_mm": round(max(intervals), 6),
             "stepover_min_mm": round(min(intervals), 6), "passes": len(steps), "section_plane": "YZ",
             "matching_passes": int(steps.is_matching.sum()), "restart_points": len(passes.restarts),
             "strategy": work.operation.kind, "links": "zig-zag" if over_mm > 0 else "one-way", **facts}
    return work.measured_passes(name, tool, rpm, passes, facts)


def _planes(work, vane, tool, ridge_mm):
    """Stretches of arcs over a vane, and their steps."""
    radius = tool.cutter.corner_radius_mm
    along = stretches(vane.tip, radius, ridge_mm, work.machine.control.resolution_mm, vane.within_mm)
    return along, arc_steps(vane.tip, radius, np.concatenate([s.planes for s in along]))


def map_facts(found, half_arc_rad):
    """The deviation map as plan.json shows it: extremes by section, and rows enough to draw."""
    rows = np.unique(np.linspace(0, len(found.deviation_mm) - 1, MAP_ROWS).round().astype(int))
    shown = lambda row: [None if np.isnan(d) else round(float(d), 6) for d in row]
    facts = {"half_arc_deg": round(float(np.degrees(half_arc_rad)), 6),
             "x_mm": found.place_mm[rows, 0, 0].round(4).tolist(),
             "deviation_mm": [shown(row) for row in found.deviation_mm[rows]],
             "columns": "crest to tangency at even angles, then the flank", "folded": int(found.is_folded.sum())}
    for name, mine in (("general", ~found.is_matching), ("matching", found.is_matching)):
        if mine.any():
            deviation, place = found.deviation_mm[mine], found.place_mm[mine]
            low, high = (np.unravel_index(f(deviation), deviation.shape) for f in (np.nanargmin, np.nanargmax))
            facts[name] = {"lowest_mm": round(float(deviation[low]), 6),
                           "lowest_place_mm": place[low].round(4).tolist(),
                           "highest_mm": round(float(deviation[high]), 6),
                           "highest_place_mm": place[high].round(4).tolist()}
    return facts
