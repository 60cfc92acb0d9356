"""Finishing with an axis that turns: the passes of an upright ball, leaned, and the whole tool clear of the part.

Balls lean by any tool axis; a bull nose or flat cutter by lead and tilt, on the passes of the ball that stands for it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from cuspline.planning.clearing_axes import (
    OPEN_SHARE,
    SPACING,
    Blocked,
    ClearingSwing,
    RotaryUse,
    clearing_facts,
    in_words,
    looked_at,
    reaching_cutter,
    split,
)
from cuspline.planning.context import MESH_DEFLECTION_MM, Left, path_tolerance_mm
from cuspline.planning.corner_gouges import refuse_gouges
from cuspline.planning.smoothed_axes import SmoothingSwing, smoothing_facts
from cuspline.planning.tool_depth import CLEARANCES_MM, HOLDER_CLEARANCE_MM
from cuspline.planning.trailing_passes import without_plunges
from cuspline.program.program import Kind, Moves, tilt_rad
from cuspline.replay.clearance import SAGITTA_MM, ToolMoves, shank_and_holder, tool_segments
from cuspline.shop.rotary_way import shortest_way
from cuspline.stock.tilted_pieces import straight_pieces
from cuspline.toolpaths.five_axis.clear_axes import AxisSearch
from cuspline.toolpaths.five_axis.leaning_moves import Ground, LeaningRules, angles_between, leaning
from cuspline.toolpaths.five_axis.tool_axes import ClearingAxis
from cuspline.toolpaths.freeform.tip_links import moves_of_tip_paths
from cuspline.toolpaths.gouge.leaning_depths import FaceBoxes, body_outline
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import PlanError, PostError
from cuspline.values.rows import X, Y, Z

BULGE_SHARE = 0.2           # of the path tolerance, for what the ball's middle leaves its line while the axis turns
TOUCHING_SHARES = 2.0       # of it: a ball nearer to the part is in the cut
FACE_BOXES_MM = 0.05        # how thick pieces of faces may be, they are halved where a cutter touches
IN_FACES_SHARE = 0.5        # of what flutes may be in the part: how closely they are held against its faces
ROUNDED_MM = 1e-3           # as well as a clearance is told
LEAST_MM = 1e-12           # an arm shorter than this has no direction
LEANING = 1e-3             # between the face's normal and the ball's: it is on the face's edge
HIGH_MM = 1e-6              # below the approach height, that is rounding
FITS_MM = 0.01              # a ball that meets other faces by less fits
SMOOTHED_SHARES = (1.0, 0.5, 0.25)      # of what an axis may be smoothed by, one after the other
SHANK, HOLDER = range(2)    # neck and shank; the holder and all above it
LIFTED = {True: "lifted where the axis changes sides", False: "lifted: the axis changes sides between passes"}
SPARES_MM = (0.05, 0.2, 0.5)    # that a turned axis keeps beyond the margin at its stations, for the moves between them


def middle_tolerance_mm(work, tool):
    """What the path of a ball's middle may deviate: with a turning axis part of it is kept for what it leaves its line.

    A corner leaves it toward the material as well.
    """
    kept = 0.0 if work.tool_axis is None else BULGE_SHARE * (1.0 if work.corner_of(tool.cutter) is None else 2.0)
    return path_tolerance_mm(work.finish) * (1.0 - kept)


class ToolInTheWay(PlanError):
    """A tool would run into the part, or into a fixture, beside its ball."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Leaned:
    """Moves of an operation with the axis that it asks for."""

    moves: Moves
    facts: dict                 # for plan.json
    left: object = None         # context.Left: what no axis clears; None: nothing


def leaned(work, runs, link, tool):
    """Moves of an operation with the axis that it asks for.

    Where the rotaries of the machine would come to the end of their range in the cut, every pass is left for the clearance
    height: there they may go back.

    Args:
        work: PlanningContext.   runs: lists of TipPath, one after the other.   link: TipLinkRules.   tool: Tool.
    Returns:
        Leaned; moves as they are laid where the axis stands.
    Raises:
        PlanError: the tool would run into the part beside the ball; `.rows`.
    """
    if work.tool_axis is None:
        return Leaned(moves=_laid(runs, link), facts={})
    rules = _rules(work, link, tool)
    if isinstance(work.tool_axis, ClearingAxis):
        return _clearing(work, runs, link, tool, rules)
    if work.tool_axis.smooth_deg is not None and rules.corner is None:
        return _smoothed(work, runs, link, tool, rules)
    turned_round = {}
    if rules.corner is not None and work.tool_axis.toward is not None and not link.is_one_way:
        runs, link, count = without_plunges(work, runs, link, _laid, rules, tool)
        turned_round = {"turned_round": count} if count else {}
    try:
        moves, facts, _ = _turned(work, runs, link, tool, rules)
    except ToolInTheWay:
        if link.behind_rad is None:
            raise
        moves, facts, _ = _turned(work, runs, replace(link, behind_rad=None), tool, rules)     # on ramps along its passes
    return Leaned(moves=moves, facts={**facts, **turned_round})


def _smoothed(work, runs, link, tool, rules):
    """Leaned of axes evened out for the rotaries, by less where the tool would come too near, until both hold."""
    use = _rotary_use(work, link)
    for share in SMOOTHED_SHARES:
        most_rad = share * math.radians(work.tool_axis.smooth_deg)
        try:
            moves, facts, found = _turned(work, runs, link, tool, replace(
                rules, swing=SmoothingSwing(use, tool.cutter.radius_mm, most_rad)))
            return Leaned(moves=moves, facts={**facts, "smoothed": smoothing_facts(found.turns)})
        except ToolInTheWay:
            continue
    moves, facts, _ = _turned(work, runs, link, tool, rules)
    return Leaned(moves=moves, facts=facts)


def as_laid(work, runs, link, tool):
    """Leaning of runs, nothing of it looked at."""
    return leaning(_laid(runs, link), _rules(work, link, tool))


def _rules(work, link, tool):
    """LeaningRules of an operation."""
    tolerance, radius = path_tolerance_mm(work.finish), link.field.dropper.radius_mm
    return LeaningRules(
        tool_axis=work.tool_axis, radius_mm=radius, bulge_mm=BULGE_SHARE * tolerance, corner=work.corner_of(tool.cutter),
        ground=_Faces(work, radius + link.field.dropper.allowance_mm + TOUCHING_SHARES * tolerance))


def _laid(runs, link):
    """Moves of the upright tool."""
    return Moves.joined([moves_of_tip_paths(paths, link) for paths in runs if paths])


def _turned(work, runs, link, tool, rules):
    """(Moves, facts, Leaning) of runs, proven clear."""
    found = leaning(_laid(runs, link), rules)
    is_lifted = _rewinds_in_cut(work, found.moves)
    if is_lifted:
        found = leaning(_laid(runs, _lifting(link)), rules)
    moves = lifted(work, found, tool)
    if rules.corner is not None:
        refuse_gouges(work, found, rules, tool)
    _refuse_contact(work, moves, tool)
    links = {"links": "lifted: the rotaries go back between passes"} if is_lifted else {}
    return moves, {**_facts(work, found, tool), **_rotary_facts(found, _rotary_use(work, link), tool), **links}, found


def _lifting(link):
    """The same, every pass left for the clearance height."""
    return replace(link, surface_link_mm=0.0, hop_mm=0.0)


def _clearing(work, runs, link, tool, rules):
    """Leaned of an axis that clears what is in the way.

    As it is laid; if not every run can be cut so, passes are cut where the axis must change sides or nothing clears it; if not
    every run of them can, every piece is left lengthwise for the clearance height; if a move between two clear places is not
    clear, all keep off by more.
    """
    refused, looks = None, {}
    for spare in SPARES_MM:
        try:
            moves, facts, found = _turned(work, runs, link, tool, replace(rules, swing=_swing(work, tool, link, spare)))
            return Leaned(moves=moves, facts={**facts, "clearing": clearing_facts(found.turns)})
        except Blocked as error:
            refused = error
            break
        except ToolInTheWay as error:
            refused = error
    for goes_on, links in ((True, link), (False, _lifting(link))):
        for spare in SPARES_MM:
            swing = _swing(work, tool, link, spare)
            looks[spare] = looks.get(spare) or looked_at(runs, swing, rules)
            cut = split(looks[spare], rules, goes_on)
            left = _left(work, cut, tool, swing)
            if not any(cut.paths):
                raise PlanError(f"{work.operation.title}: {left.why}")
            turning = replace(rules, swing=ClearingSwing(swing.search, swing.axis, swing.use, OPEN_SHARE))
            try:
                moves, facts, found = _turned(work, cut.paths, replace(links, lead_radius_mm=0.0), tool, turning)
                return Leaned(moves=moves, left=left, facts={
                    "links": LIFTED[goes_on], **facts, "clearing": clearing_facts(found.turns, left)})
            except (Blocked, ToolInTheWay) as error:
                refused = error
    where = f"{work.operation.title}: " if isinstance(refused, Blocked) else ""
    raise PlanError(f"{where}{refused}", rows=refused.rows)


def _swing(work, tool, link, spare_mm):
    """ClearingSwing of an operation: margins as `_refuse_contact` holds them, and something to spare between two stations."""
    into, keep = margins_mm(work)
    limit = work.tool_axis.limit_deg
    search = AxisSearch.of_tool(
        work.obstacle_tree, tool, into_mm=into - ROUNDED_MM, keep_mm=keep + spare_mm,
        limit_rad=math.pi if limit is None else math.radians(limit))
    search = search.with_beside(work.standing, tool, CLEARANCES_MM + spare_mm)
    return ClearingSwing(search, work.tool_axis, _rotary_use(work, link))


def _rotary_use(work, link):
    """RotaryUse of the operation's feed."""
    clamped = lambda axes: work.setup.clamped_frame.turn_into(work.setup.turn.turn_out(axes))
    return RotaryUse(chain=work.machine.kinematics, clamped=clamped, feed_mm_per_s=link.feed_mm_per_min / 60.0)


def _left(work, cut, tool, swing):
    """context.Left of a Split: the samples nearest to blocked stations, as far as the ball alone fits there."""
    if cut.blocked is None:
        return None
    nearest = cKDTree(cut.contact_mm).query(work.samples.point_mm)[1]
    radius, samples = tool.cutter.radius_mm, work.samples
    fits = work.closest.closest_points(samples.point_mm + radius * samples.normal).distance_mm >= radius - FITS_MM
    rows = cut.is_blocked[nearest] & fits
    area = float(work.samples.area_mm2[rows].sum())
    place = work.in_part(cut.contact_mm[cut.is_blocked][0])
    reaching = reaching_cutter(swing, cut.blocked, tool)
    return Left(rows=rows, area_mm2=area, reaching=reaching, why=(
        f"T{tool.number} {tool.cutter.name}: no axis within {work.tool_axis.up_to_deg:g} degrees of the standard direction clears "
        f"shank and holder on {area:.2f} mm², as at {place}; {in_words(reaching)}"))


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


def _facts(work, found, tool):
    """For plan.json."""
    m = found.moves
    turns = angles_between(np.vstack([m.axis[:1], m.axis[:-1]]), m.axis)
    lean = tilt_rad(m.axis[found.is_cut])
    length = np.sqrt(((m.end_mm - m.starts_mm) ** 2).sum(axis=1))
    return {"tool_axis": work.operation.tool_axis.model_dump(mode="json"),
            "lean_deg": [round(float(np.degrees(v)), 3) for v in (lean.min(), lean.max())],
            "largest_turn_deg": round(float(np.degrees(turns[found.is_cut].max(initial=0.0))), 3),
            "held_at_limit_mm": round(float(length[found.is_held & found.is_cut].sum()), 3),
            "normal_error": normal_error(tool.cutter)}


def _rotary_facts(found, use, tool):
    """For plan.json: what the cut asks of the rotaries at its feed, looked at over a share of the radius.

    A share above 1 says that the feed is lowered there; a reversal is a rotary that turns round within a run.
    """
    radius, m, middles = tool.cutter.radius_mm, found.moves, found.middle_mm
    edges = np.flatnonzero(np.diff(np.concatenate([[False], found.is_cut, [False]]).astype(int))).reshape(-1, 2)
    axes, shares, reversals = np.vstack([m.axis[:1], m.axis]), [0.0], 0
    for first, end in edges:
        run = middles[first:end + 1]
        at = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(run, axis=0) ** 2).sum(axis=1)))])
        even = np.linspace(0.0, at[-1], max(math.ceil(at[-1] / (SPACING * radius)), 1) + 1)
        mean = np.column_stack([np.interp(even, at, axes[first:end + 1, k]) for k in (X, Y, Z)])
        share, turned_round = use.of(mean / np.sqrt((mean * mean).sum(axis=1))[:, None], even)
        shares.append(share)
        reversals += turned_round
    most = max(shares)
    return {"rotary_share": round(most, 3) if math.isfinite(most) else None, "rotary_reversals": reversals}


def normal_error(cutter):
    """What an error of the normal by one degree does, for plan.json: the tip of a ball moves by R delta, along the surface but
    for R delta²/2; so does what touches with its corner of radius rc, turned about the corner's middle.

    >>> from types import SimpleNamespace
    >>> normal_error(SimpleNamespace(radius_mm=4.0, corner_radius_mm=4.0))
    {'tip_mm_per_degree': 0.069813, 'depth_mm_at_one_degree': 0.000609}
    """
    return {"tip_mm_per_degree": round(math.radians(cutter.radius_mm), 6),
            "depth_mm_at_one_degree": round(float(cutter.corner_radius_mm * (1.0 - fixed.cos(math.radians(1.0)))), 6)}


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
        foot, rolling, at_edge = self._standing(middles_mm)
        return np.where(at_edge[:, None], foot.normal, rolling)

    def beyond_mm(self, middles_mm, normals):
        foot, _, at_edge = self._standing(middles_mm)
        return np.where(at_edge, foot.distance_mm - ((middles_mm - foot.point_mm) * normals).sum(axis=1), 0.0)

    def _standing(self, middles_mm):
        """(ClosestPoints, (n, 3) from there to the middles, (n,) bool: the ball rolls over an outer edge)."""
        foot = self.faces.closest_points(middles_mm)
        arm = middles_mm - foot.point_mm
        rolling = arm / np.maximum(np.sqrt((arm * arm).sum(axis=1)), LEAST_MM)[:, None]
        at_edge = np.sqrt(((rolling - foot.normal) ** 2).sum(axis=1)) > LEANING
        beside = self.neighbours.beside(foot.point_mm[at_edge], self.wanted[foot.face[at_edge]])
        at_edge[at_edge] = ~np.isin(beside, self.wanted)
        return foot, rolling, at_edge


def margins_mm(work):
    """(how deep flutes may come where they touch by design, (2,) how far off neck and shank, and the holder, must stay)."""
    into = MESH_DEFLECTION_MM + path_tolerance_mm(work.finish) + SAGITTA_MM + ROUNDED_MM
    return into, work.practice.rough_allowance_mm + MESH_DEFLECTION_MM + np.array([0.0, HOLDER_CLEARANCE_MM])


def _refuse_contact(work, moves, tool):
    """The ball is on the part by design; its flutes may touch no more than it does, shank, holder and spindle head nothing."""
    axes = np.vstack([moves.axis[:1], moves.axis])
    way = ToolMoves(start_tips_mm=moves.starts_mm, end_tips_mm=moves.end_mm, start_axes=axes[:-1], end_axes=axes[1:])
    into, keep = margins_mm(work)
    part = work.obstacle_tree, "the part or what holds it"
    standing = work.standing, "what roughing has left standing"
    shank, holder = shank_and_holder(tool)
    for what, segments, (tree, of_what), margin in (
            ("neck or shank", shank, part, keep[SHANK]), ("holder", holder, part, keep[HOLDER]),
            ("neck or shank", shank, standing, CLEARANCES_MM[SHANK]), ("holder", holder, standing, CLEARANCES_MM[HOLDER]),
            ("flutes", tool_segments(tool), part, -into)):          # what takes longest last
        if tree is None or not len(segments) or what == "flutes" and not _in_faces(work, way, tool, into).any():
            continue
        clear = tree.certified_clearance(segments, way, margin, tolerance_mm=ROUNDED_MM)
        bad = np.flatnonzero(~clear.is_clear)
        if len(bad):
            worst = bad[np.argmin(clear.clearance_mm[bad])]
            place = work.in_part(clear.place_mm[worst])
            raise ToolInTheWay(
                f"{work.operation.title}: with its axis so {clear.clearance_mm[worst]:.3f} mm are left between the {what} of "
                f"T{tool.number} {tool.cutter.name} and {of_what} ({margin:.3f} wanted) "
                f"at {place}, and too little in {len(bad) - 1} other moves: lean it less, or the other way, leave these faces "
                "out, or take a slimmer or longer tool", rows=bad)


def _in_faces(work, way, tool, into_mm):
    """(n,) bool: moves whose flutes may come deeper into the part's exact faces; all of them where fixtures stand beside it.

    A ball or corner that turns on a face is proven there in few steps; against triangles every stretch of its turn is one.
    """
    if work.fixtures:
        return np.ones(len(way.start_axes), bool)
    profile = tool.cutter.profile
    pieces = straight_pieces(way.start_tips_mm, way.end_tips_mm, way.start_axes, way.end_axes,
                             float(fixed.hypot(profile.largest_radius_mm, profile.height_mm)))
    boxes = work.once("face boxes", lambda: FaceBoxes.of_solid(work.solid, FACE_BOXES_MM))
    depth, _, _ = boxes.depths(pieces.geometry, body_outline(tool.cutter), IN_FACES_SHARE * into_mm)
    deep = np.zeros(len(way.start_axes), bool)
    deep[pieces.row[depth + pieces.error_mm > into_mm]] = True
    return deep


def lifted(work, found, tool):
    """Moves at the approach height and above, higher by what a leaning holder reaches below the ball."""
    m, r, is_ball = found.moves, found.ball_radius_mm, tool.cutter.type == "ball"
    frusta = tool_segments(tool, with_flutes=not is_ball)
    ends = np.vstack([frusta[:, :2], frusta[:, 2:4]])           # height above the tip, radius
    level = np.sqrt(np.maximum(1.0 - m.axis[:, 2] ** 2, 0.0))
    axes, tips = np.vstack([m.axis[:1], m.axis]), np.vstack([m.start_mm, m.end_mm])
    if is_ball:
        below = (ends[:, 1] * level[:, None] - (ends[:, 0] - r) * m.axis[:, 2:]).max() - r
        lowest = tips[:, 2] + r * axes[:, 2] - r
    else:
        lowest = found.middle_mm[:, 2] - r
        below = (lowest[1:, None] - tips[1:, 2:] + ends[:, 1] * level[:, None] - ends[:, 0] * m.axis[:, 2:]).max()
    if below <= 0.0:
        return m
    approach = work.clearance_z_mm - work.clearance_mm + work.practice.approach_mm
    tips[:, 2] += np.where(lowest >= approach - HIGH_MM, below, 0.0)
    return type(m)(**{**m.__dict__, "start_mm": tips[0], "end_mm": tips[1:]})
