"""Finishing with a ball whose axis turns: the passes of the upright one, leaned, and the whole tool clear of the part."""

from dataclasses import replace

import numpy as np

from cuspline.planning.context import MESH_DEFLECTION_MM, path_tolerance_mm
from cuspline.program.program import Kind, tilt_rad
from cuspline.replay.clearance import SAGITTA_MM, ToolMoves, tool_segments
from cuspline.shop.rotary_way import shortest_way
from cuspline.toolpaths.five_axis.leaning_moves import Ground, LeaningRules, angles_between, leaning
from cuspline.values.errors import PlanError, PostError

BULGE_SHARE = 0.2           # of the path tolerance, for what the ball's middle leaves its line while the axis turns
TOUCHING_SHARES = 2.0       # of it: a ball nearer to the part is in the cut
ROUNDED_MM = 1e-3           # as well as a clearance is told
LEAST_MM = 1e-12           # an arm shorter than this has no direction
LEANING = 1e-3             # between the face's normal and the ball's: it is on the face's edge
HIGH_MM = 1e-6              # below the approach height, that is rounding


def middle_tolerance_mm(work):
    """What the path of a ball's middle may deviate: with a turning axis part of it is kept for what it leaves its line."""
    return path_tolerance_mm(work.finish) * (1.0 - (BULGE_SHARE if work.tool_axis is not None else 0.0))


def leaned(work, lay, link, tool):
    """Moves of an operation with the axis that it asks for, and what plan.json says of it.

    Where the rotaries of the machine would come to the end of their range in the cut, every pass is left for the clearance
    height: there they may go back.

    Args:
        work: PlanningContext.   lay: function (TipLinkRules) -> Moves of the upright tool.   link: TipLinkRules.   tool: Tool.
    Returns:
        (Moves, dict); as they are laid and nothing where the axis stands.
    Raises:
        PlanError: the tool would run into the part beside the ball; `.rows`.
    """
    if work.tool_axis is None:
        return lay(link), {}
    tolerance, radius = path_tolerance_mm(work.finish), tool.cutter.radius_mm
    rules = LeaningRules(
        tool_axis=work.tool_axis, radius_mm=radius, bulge_mm=BULGE_SHARE * tolerance,
        ground=_Faces(work, radius + link.field.dropper.allowance_mm + TOUCHING_SHARES * tolerance))
    found = leaning(lay(link), rules)
    is_lifted = _rewinds_in_cut(work, found.moves)
    if is_lifted:
        found = leaning(lay(replace(link, surface_link_mm=0.0, hop_mm=0.0)), rules)
    moves = lifted(work, found, tool)
    _refuse_contact(work, moves, tool)
    links = {"links": "lifted: the rotaries go back between passes"} if is_lifted else {}
    return moves, {**_facts(work, found), **links}


def _rewinds_in_cut(work, moves):
    """Whether the machine's rotaries cannot follow without a rewind in the cut."""
    clamped = work.setup.clamped_frame.turn_into(work.setup.turn.turn_out(np.vstack([moves.axis[:1], moves.axis])))
    off_cut = np.concatenate([[True], moves.kind == Kind.RAPID])
    try:
        way = shortest_way(work.machine.kinematics, clamped, off_cut=off_cut)
    except PostError as error:
        raise PlanError(f"{work.operation.title} on {work.machine.name}: {error}, or give it a limit_deg",
                        rows=error.rows) from None
    return bool((~off_cut[way.rewinds]).any())


def _facts(work, found):
    """For plan.json."""
    m = found.moves
    turns = angles_between(np.vstack([m.axis[:1], m.axis[:-1]]), m.axis)
    lean = tilt_rad(m.axis[found.is_cut])
    length = np.sqrt(((m.end_mm - m.starts_mm) ** 2).sum(axis=1))
    return {"tool_axis": work.operation.tool_axis.model_dump(mode="json"),
            "lean_deg": [round(float(np.degrees(v)), 3) for v in (lean.min(), lean.max())],
            "largest_turn_deg": round(float(np.degrees(turns[found.is_cut].max(initial=0.0))), 3),
            "held_at_limit_mm": round(float(length[found.is_held & found.is_cut].sum()), 3)}


class _Faces(Ground):
    """The exact faces of the part; the axis leans by the normals of those that are to be cut.

    Over an outer edge of these the ball rolls on while the axis stays as it is at the edge; over an edge between two of them it
    turns as the ball does.
    """

    def __init__(self, work, touching_mm):
        self.part, self.wanted, self.touching_mm = work.closest, np.array(work.wanted), touching_mm
        self.faces, self.neighbours = work.closest_of(tuple(work.wanted)), work.edge_neighbours

    def is_touched(self, middles_mm):
        return self.part.closest_points(middles_mm).distance_mm <= self.touching_mm

    def normals(self, middles_mm):
        foot = self.faces.closest_points(middles_mm)
        arm = middles_mm - foot.point_mm
        rolling = arm / np.maximum(np.sqrt((arm * arm).sum(axis=1)), LEAST_MM)[:, None]
        at_edge = np.sqrt(((rolling - foot.normal) ** 2).sum(axis=1)) > LEANING
        beside = self.neighbours.beside(foot.point_mm[at_edge], self.wanted[foot.face[at_edge]])
        at_edge[at_edge] = ~np.isin(beside, self.wanted)
        return np.where(at_edge[:, None], foot.normal, rolling)


def _refuse_contact(work, moves, tool):
    """The ball is on the part by design; its flutes may touch no more than it does, shank, holder and spindle head nothing."""
    axes = np.vstack([moves.axis[:1], moves.axis])
    way = ToolMoves(start_tips_mm=moves.starts_mm, end_tips_mm=moves.end_mm, start_axes=axes[:-1], end_axes=axes[1:])
    into = MESH_DEFLECTION_MM + path_tolerance_mm(work.finish) + SAGITTA_MM + ROUNDED_MM
    keep = work.practice.rough_allowance_mm + MESH_DEFLECTION_MM
    for what, segments, margin in (
            ("flutes", tool_segments(tool), -into),
            ("shank or holder", tool_segments(tool, work.machine.spindle_head, with_flutes=False), keep)):
        clear = work.clearance_tree.certified_clearance(segments, way, margin, tolerance_mm=ROUNDED_MM)
        bad = np.flatnonzero(~clear.is_clear)
        if len(bad):
            worst = bad[np.argmin(clear.clearance_mm[bad])]
            place = work.in_part(clear.place_mm[worst])
            raise PlanError(
                f"{work.operation.title}: with its axis so the {what} of T{tool.number} {tool.cutter.name} come to "
                f"{clear.clearance_mm[worst]:.3f} mm of the part ({margin:.3f} wanted) at {place}, and in {len(bad) - 1} other "
                "moves: lean it less, or the other way, leave these faces out, or take a slimmer or longer tool", rows=bad)


def lifted(work, found, tool):
    """Moves at the approach height and above, higher by what a leaning holder reaches below the ball."""
    m, r = found.moves, tool.cutter.radius_mm
    frusta = tool_segments(tool, work.machine.spindle_head, with_flutes=False)
    ends = np.vstack([frusta[:, :2], frusta[:, 2:4]])           # height above the tip, radius
    level = np.sqrt(np.maximum(1.0 - m.axis[:, 2] ** 2, 0.0))
    below = (ends[:, 1] * level[:, None] - (ends[:, 0] - r) * m.axis[:, 2:]).max() - r
    if below <= 0.0:
        return m
    approach = work.clearance_z_mm - work.clearance_mm + work.practice.approach_mm
    axes, tips = np.vstack([m.axis[:1], m.axis]), np.vstack([m.start_mm, m.end_mm])
    lowest = tips[:, 2] + r * axes[:, 2] - r
    tips[:, 2] += np.where(lowest >= approach - HIGH_MM, below, 0.0)
    return type(m)(**{**m.__dict__, "start_mm": tips[0], "end_mm": tips[1:]})
