"""Finishing on any part: passes over the region where the ball touches the faces wanted, walls by waterlines.

The region is seen from above.  Where the faces stand steeper than the setup's limit a level step says little
about the cusp: there the ball goes round at constant height instead.
"""

import math
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from cuspline.kernel.brep import bounding_box_mm
from cuspline.planning.context import FinishingStage, finite, path_tolerance_mm, ridge_for_step_mm
from cuspline.planning.cutter_choice import ROUND
from cuspline.planning.leaning_choice import compared, fastest
from cuspline.planning.leaning_cusps import cusps_mm
from cuspline.planning.leaning_finishing import as_laid, leaned, middle_tolerance_mm
from cuspline.planning.tip_orders import other_orders
from cuspline.scallop.stepover import scallop_for_stepover_mm, stepover_for_scallop_mm
from cuspline.splines.nurbs import local_shape
from cuspline.surfaces.curvature import sample_faces
from cuspline.surfaces.patches import PatchSet
from cuspline.surfaces.sampling import samples_of_faces
from cuspline.toolpaths.five_axis.tool_axes import LeadTilt
from cuspline.toolpaths.freeform.clean_up_passes import region_left
from cuspline.toolpaths.freeform.iso_scallop_passes import boundary_curves, constant_scallop_curves
from cuspline.toolpaths.freeform.parallel_passes import parallel_curves
from cuspline.toolpaths.freeform.scallop_metric import Across
from cuspline.toolpaths.freeform.scallop_region import ground_of
from cuspline.toolpaths.freeform.spiral_passes import spiral_curve
from cuspline.toolpaths.freeform.tip_field import tip_field
from cuspline.toolpaths.freeform.tip_links import RAMP_SHARE, TipLinkRules
from cuspline.toolpaths.freeform.tip_paths import PathRules, tip_paths
from cuspline.toolpaths.freeform.wall_passes import wall_paths
from cuspline.toolpaths.freeform.waterline import DropHeights, waterlines
from cuspline.toolpaths.roughing.stock_fields import swept_by_lines
from cuspline.toolpaths.sections.profile_passes import planes_across, smallest_step
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import NotOnePass, PlanError

NODES_A_STEP = 5.0          # grid nodes between neighbouring passes on level ground
MANY_NODES, MANY_LINES = 3.0, 100       # the same of so many parallel lines: of a region so wide the borders, which a coarse
                            # grid sees worse and lays lines for, are a small share; where lines run and end is dropped exactly
LATERAL_SHARE = 0.02        # of a step, that a move may leave its curve in plan
BRIDGE_STEPS = 4.0          # gaps in the region up to so many steps are crossed without lifting
WALL_GRID_STEPS = 1.5       # steps between the grid lines on which waterlines are looked for
WALL_OVERLAP_RAD = math.radians(3.0)        # wall passes reach that much beyond the limit of steepness
ASIDE_MM = 2e-3             # from a wall, where nothing else holds the cutter up
HANGS = 1e-3                # an overhang by more than this cannot be cut from above
SEMI_TOLERANCE_MM = 0.01    # of a path that leaves an allowance
TERRACE_MM = 3.0            # what roughing leaves on its steps before a semi-finish
LEVEL_SHARE = 1 / 1.15      # of the ridge: level lines hold it within 8 % (level_passes), and more hides between nodes
PARALLEL_SHARE = 0.92       # of the ridge: what is found between the nodes of the grid
TOUCH_UP_RIDGES = (0.5, 0.25)   # of the ridge, one round after the other
TOUCH_UP_SHARE = 0.9        # of the cusp: what is left in so many places between the nodes may be a little more
TOUCH_UP_STEPS = 0.6        # how far the touch-up reaches beyond
LINK_STEPS = 3.0            # links along the surface are no longer than that
RAMP_ABOVE, HIGHEST_RAMP_MM = 5.0, 0.045        # path tolerances above its path, where a leaning cutter's ramp ends: it comes back
                            # against its pass, and would lead the other way where it touches
STEEPEST_BEHIND_RAD = math.radians(40.0)
ENTRY_RADII = 2.0           # round an entry, within which a leaning cutter may stand over stock
HOP_RADII = 6.0             # links over what lies between
FLAT_STEP_SHARE = 0.1       # of its radius: how closely a flat cutter's waterlines are looked for
MAY_TOUCH_STEPS = 0.5       # steps from place to place by which it is told where the cutter may touch a wall
TURNS_MORE = 2.0            # times as much as the curvature in its middle says a face turns over a spacing
TOUCHING_MM = 0.02         # a bull nose or flat cutter nearer to a face than that touches it
RIM_STEPS = 3               # until the nearest place of a bull nose's corner stands still
TERRACE_SHARE = 0.8         # of its flutes a flat cutter goes deep beside an upright wall
RUN_OVER_RADII = 0.5        # over an edge the ball rolls no farther: it falls by 0.13 of its radius, whatever stands there
LEVEL = 1 - 1e-9            # of a unit normal's z: level ground
BELOW_MM = 0.01             # walls that stand on nothing a flat cutter goes: it still touches them
ON_GROUND_MM = 1e-3         # of level ground: a wall stands on it
SAME_MM = 1e-6              # heights that are the same
COARSER = 3.0               # times the pitch: a grid that tells within which box something is left
COMMON_PLANE_ROUNDS = 3     # of laying passes anew until their cusps are as asked
WELL_USED = 0.92            # of the cusp allowed: nearer to it nothing is laid anew
COMMON_PLANE_AIM = 0.97     # of it, that is aimed for
COMMON_PLANE_CHANGE = (0.3, 2.0)        # of the height that passes are laid for, in one round
WIDEST_RADII = 1.0          # of a leaning cutter's radius: beyond, its silhouette is no longer the circle at its contact
ROLL_OVER_SHARE = 0.7       # of its radius, that a ball which stands for such a cutter goes over outer edges
RAPID_APPROACHES = 1.5      # times the approach, that a rapid keeps from what may stand, on all sides
OVERLAP_STEPS = 1.5         # of neighbouring regions cut in different ways, or with different cutters


def finish(work, stage, tool, candidates):
    """Passes over all faces wanted with one ball.

    Args:
        work: PlanningContext.
        stage: FinishingStage.
        tool: the ball.
        candidates: what else was looked at, for plan.json.
    """
    practice = work.practice
    left_mm = (practice.rough_allowance_mm + practice.finish_depth_share * tool.cutter.diameter_mm if stage.allowance_mm == 0.0
               else TERRACE_MM)
    return _operation(work, stage, tool, candidates, left_mm, (lambda field: field, None))


def rest(work, before, tool, candidates):
    """Passes of a smaller ball where the finishing operations before leave more than the cusp.

    Args:
        before: PlannedOperation values of larger balls without allowance.
    Returns:
        PlannedOperation, or None where nothing is left.
    """
    scallop_mm = work.finish.scallop_mm
    step = flat_step_mm(tool, ridge_for_step_mm("rest finish", scallop_mm, work.finish))
    swept = [operation.swept_mm for operation in before]
    region = lambda field: region_left(field, swept, TOUCH_UP_SHARE * scallop_mm, OVERLAP_STEPS * step)
    left_mm = before[-1].tool.cutter.radius_mm
    stage = FinishingStage(name="rest finish", allowance_mm=0.0, scallop_mm=scallop_mm)
    return _operation(work, stage, tool, candidates, left_mm, (region, None), (swept, None))


def passes_over(work, tool, candidates, swept=(), is_done=None):
    """One operation as it is listed, on the stock that stands.

    Args:
        work: PlanningContext of an operation with `curves` and `pattern`.
        tool: ball, bull nose, or tapered ball.
        candidates: what else was looked at, for plan.json.
        swept: height fields of what cutters swept before; with them only the region where they leave too much.
        is_done: see `region_left`.
    Returns:
        PlannedOperation, or None where nothing is left.
    """
    operation, scallop_mm = work.operation, work.finish.scallop_mm
    if tool.cutter.corner_radius_mm == 0.0 and work.corner_of(tool.cutter) is None:
        raise PlanError(f"{operation.title}: T{tool.number} {tool.cutter.name} has a sharp corner: on faces that are not level "
                        "it leaves steps, no cusps; take a ball or bull nose, or the operations floor and waterline")
    cut, box = lambda field: field, None
    if swept or is_done is not None:
        step = _step_mm(work, tool, ridge_for_step_mm(operation.title, scallop_mm, work.finish))
        cut = lambda field: region_left(field, swept, TOUCH_UP_SHARE * scallop_mm, OVERLAP_STEPS * step, is_done)
        if operation.steepest_deg < 90.0:           # a position among others, that see most of the faces better
            box = _box_left(work, tool, COARSER * step, cut)
            if box is None:
                return None
    stage = FinishingStage(name=operation.title, allowance_mm=operation.allowance_mm, scallop_mm=scallop_mm)
    return _operation(work, stage, tool, candidates, work.standing_mm(tool), (cut, box), (swept, is_done))


def with_fastest(work, plan):
    """`leaning_choice.fastest` for the cusp of an operation."""
    return fastest(work, ridge_for_step_mm(work.operation.title, work.finish.scallop_mm, work.finish), WIDEST_RADII, plan)


def _box_left(work, tool, step_mm, cut):
    """((2,), (2,)) lowest and highest x, y within which `cut` leaves something of a coarse region; None: nowhere."""
    field = _field(work, tool, work.operation.allowance_mm, step_mm, may_be_empty=True)
    field = _gentle(field, math.radians(work.operation.steepest_deg), 0.0) if field.is_inside.any() else None
    left = field and cut(field)
    if left is None:
        return None
    at = left.node_xy_mm[left.is_inside]
    return at.min(axis=0) - field.pitch_mm, at.max(axis=0) + field.pitch_mm


def walls_alone(work, tool, candidates):
    """Waterlines alone, round the faces that are steeper than the operation's limit.

    Returns:
        PlannedOperation, or None where no face is so steep.
    """
    operation, finish = work.operation, work.finish
    tolerance, ridge_mm = middle_tolerance_mm(work, tool), ridge_for_step_mm(operation.title, finish.scallop_mm, finish)
    if operation.allowance_mm > 0.0:
        tolerance, ridge_mm = SEMI_TOLERANCE_MM, max(finish.scallop_mm, 2 * SEMI_TOLERANCE_MM) - SEMI_TOLERANCE_MM
    is_flat = tool.cutter.corner_radius_mm == 0.0 and work.corner_of(tool.cutter) is None
    step = FLAT_STEP_SHARE * tool.cutter.radius_mm if is_flat else _step_mm(work, tool, ridge_mm)
    field = _field(work, tool, operation.allowance_mm, step, may_be_empty=True)
    walls = _wall_paths(work, field, tool, ridge_mm, tolerance, step)
    if not walls:
        return None
    rpm, feed = work.speeds(tool, is_rough=False)
    link = link_rules(work, tool, field, tolerance, step, feed, work.standing_mm(tool))
    made = leaned(work, [walls], link, tool)
    facts = {"allowance_mm": operation.allowance_mm, "scallop_mm": finish.scallop_mm, "segment_tolerance_mm": tolerance,
             "ridge_for_step_mm": round(ridge_mm, 6), "strategy": operation.kind, "wall_passes": len(walls),
             "levels": len({p.tips_mm[0, 2] for p in walls}), "links": operation.passes,
             "candidates": [c.as_dict() for c in candidates], **made.facts}
    return work.measured(operation.title, tool, rpm, made.moves, facts, made.left)


def _operation(work, stage, tool, candidates, left_mm, where, before=((), None)):
    """One operation; None where nothing of its region is left.

    `where`: the function that makes the region of the whole one, and the box that holds it, None: not known.
    `before`: height fields and what is done, as for `region_left`.
    """
    cut, box = where
    name, allowance_mm, scallop_mm = stage.name, stage.allowance_mm, stage.scallop_mm
    tolerance, ridge_mm = middle_tolerance_mm(work, tool), ridge_for_step_mm(name, scallop_mm, work.finish)
    if allowance_mm > 0.0:
        tolerance, ridge_mm = SEMI_TOLERANCE_MM, scallop_mm - SEMI_TOLERANCE_MM
    if (widest := work.operation.stepover_mm) is not None:
        ridge_mm = min(ridge_mm, float(scallop_for_stepover_mm(_across_mm(work, tool), widest, 0.0)[0]))
    step = _step_mm(work, tool, ridge_mm)
    field = cut(_field(work, tool, allowance_mm, step, box is not None, box))
    if field is not None and work.operation.steepest_deg < 90.0:
        field = _gentle(field, math.radians(work.operation.steepest_deg), 0.0)
    if field is None:
        return None
    rules = PathRules(tolerance_mm=tolerance, lateral_mm=LATERAL_SHARE * step, bridge_mm=BRIDGE_STEPS * step)
    gentle = _gentle(field, math.radians(work.operation.waterline_deg), OVERLAP_STEPS * step)
    walls = _wall_paths(work, field, tool, ridge_mm, tolerance, step) if work.operation.steepest_deg == 90.0 else []
    rpm, feed = work.speeds(tool, is_rough=False)
    link = link_rules(work, tool, field, tolerance, step, feed, left_mm)

    def passes(asked_mm):
        """(TipPaths, how many touch up, facts of the pattern) for cusps of that height."""
        curves, pattern = _curves(work.operation, gentle, _seen_as(work, tool.cutter), asked_mm)
        paths, touched = tip_paths(curves, gentle, rules) if curves else [], []
        if paths and allowance_mm == 0.0 and field.across is None:
            touched = _touch_up(gentle, [*paths, *walls], before, scallop_mm, asked_mm, step, rules)
        if not paths and not walls:
            raise PlanError(f"{name}: T{tool.number} {tool.cutter.name} touches none of the faces {work.face_names}: "
                            "choose other faces or a smaller ball")
        return [*paths, *touched], len(touched), pattern

    if field.across is None:
        paths, touched, pattern = passes(ridge_mm)
    else:
        paths, touched, pattern = _by_common_plane(
            passes, lambda paths: cusps_mm(
                as_laid(work, [walls, paths], link, tool), work.corner_of(tool.cutter), tool.cutter, step), tool.cutter, ridge_mm)
    made = leaned(work, [walls, paths], link, tool)
    if isinstance(work.tool_axis, LeadTilt):
        pattern = {**pattern, "compared": compared(work, ridge_mm, WIDEST_RADII)}
    facts = {"allowance_mm": allowance_mm, "scallop_mm": scallop_mm, "segment_tolerance_mm": tolerance,
             "ridge_for_step_mm": round(ridge_mm, 6), "stepover_mm": round(step, 6), **pattern,
             "passes": len(paths), "wall_passes": len(walls), "touch_ups": touched,
             "grid_mm": round(field.pitch_mm, 6),
             "region_mm2": round(float(field.is_inside.sum()) * field.pitch_mm ** 2, 1), "links": work.operation.passes,
             **({} if link.bearing is None else {"bearing": link.bearing}),
             "min_concave_radius_mm": finite(work.hollow.radius_mm),
             "min_concave_place_mm": work.in_part(work.hollow.place_mm),
             "candidates": [c.as_dict() for c in candidates], **made.facts}
    planned = work.measured(name, tool, rpm, made.moves, facts, made.left)
    return replace(planned, orders=other_orders(work, planned, (walls, paths), link))


def _by_common_plane(passes, cusps_of, cutter, ridge_mm):
    """What `passes` gives as far apart as the cusps on the common planes of neighbouring contacts allow.

    Args:
        passes: function of a cusp's height to (TipPaths, touch-ups, facts).   cusps_of: function of TipPaths, see `cusps_mm`.
        cutter: that leans.   ridge_mm: the cusp that is kept.
    """
    asked, kept = ridge_mm, None
    for number in range(COMMON_PLANE_ROUNDS):
        paths, touched, pattern = passes(asked)
        cusps, places = cusps_of(paths)
        most = float(cusps.max(initial=0.0))
        if most <= ridge_mm and (kept is None or most > kept[0]):
            told = {"cusp_mm": round(most, 6), "looked_at": len(cusps), "rounds": number + 1, "ridge_laid_mm": round(asked, 6)}
            kept = most, paths, touched, {**pattern, "common_plane": told}
        if most == 0.0 or WELL_USED * ridge_mm <= most <= ridge_mm:
            break
        asked *= float(np.clip(COMMON_PLANE_AIM * ridge_mm / most, *COMMON_PLANE_CHANGE))
    if kept is None:
        raise PlanError(f"passes of {cutter.name} leave cusps of {most:.4f} mm on the common planes of their contacts, as at "
                        f"{np.round(places[cusps.argmax()], 3).tolist() if len(places) else 'any place'}, {ridge_mm:.4f} mm are "
                        "allowed: take a ball, or a larger lead_deg")
    return kept[1:]


def _curves(operation, field, cutter, ridge_mm):
    """(passes in plan, what plan.json says of their pattern): along the borders where no one pass covers the region."""
    if field is None:
        return [], {"strategy": operation.pattern}
    try:
        return operation.curves(field, cutter, ridge_mm), {"strategy": operation.pattern}
    except NotOnePass as error:
        return pattern_curves("boundary", field, cutter, ridge_mm), {
            "strategy": "boundary", "instead_of": f"{operation.pattern}: {error}"}


def _touch_up(field, paths, before, scallop_mm, ridge_mm, step_mm, rules):
    """More passes where all that is planned leaves more than the cusp: closer ones, across what is left."""
    more, cutter, (swept, is_done) = [], field.dropper, before
    for closer in TOUCH_UP_RIDGES:
        mine = swept_by_lines([p.tips_mm for p in [*paths, *more]], cutter.radius_mm, cutter.corner_radius_mm)
        left = region_left(field, [*swept, mine], TOUCH_UP_SHARE * scallop_mm, TOUCH_UP_STEPS * step_mm, is_done)
        if left is None:
            break
        more += tip_paths(parallel_curves(left, 0.0, closer * ridge_mm), left, rules)
    return more


def flat_step_mm(tool, ridge_mm):
    """Step on a flat that leaves a ridge of that height; of a bull nose as if it were its corner's ball."""
    radius_mm = tool.cutter.radius_mm if tool.cutter.type in ROUND else tool.cutter.corner_radius_mm
    return float(stepover_for_scallop_mm(radius_mm, ridge_mm, 0.0)[0])


def _step_mm(work, tool, ridge_mm):
    """The same of a tool that may lean."""
    corner = work.corner_of(tool.cutter)
    if corner is None:
        return flat_step_mm(tool, ridge_mm)
    return min(float(stepover_for_scallop_mm(corner.across_mm, ridge_mm, 0.0)[0]), WIDEST_RADII * corner.radius_mm)


def _across_mm(work, tool):
    """Radius of what a tool cuts across its feed, as far as its step goes by that."""
    corner = work.corner_of(tool.cutter)
    return tool.cutter.corner_radius_mm if corner is None else corner.across_mm


def _seen_as(work, cutter):
    """The cutter that passes are laid for: of one that leans and touches with its corner the ball that stands for it."""
    corner = work.corner_of(cutter)
    if corner is None:
        return cutter
    radius = corner.ball_radius_mm
    return cutter.model_copy(update={"type": "ball", "diameter_mm": 2 * radius, "corner_radius_mm": radius})


def _field(work, tool, allowance_mm, step_mm, may_be_empty=False, box=None):
    """Where the ball touches the faces wanted; `box`: ((2,), (2,)) of places that are looked at, all of them unless given."""
    low, high = work.box_of_wanted if box is None else box
    pitch_mm = step_mm / (MANY_NODES if _are_many_lines(work.operation, low, high, step_mm) else NODES_A_STEP)
    corner = work.corner_of(tool.cutter)
    if corner is not None:
        ball = corner.ball_radius_mm
        found = tip_field(work.dropper(ball, ball, allowance_mm), work.wanted, (low, high), pitch_mm,
                          ROLL_OVER_SHARE * ball, may_be_empty)
        return replace(found, across=Across(radius_mm=corner.across_mm, widest_mm=WIDEST_RADII * corner.radius_mm))
    run_over = run_over_mm(step_mm, tool.cutter.radius_mm)
    return tip_field(work.dropper_with(tool, allowance_mm), work.wanted, (low, high), pitch_mm, run_over, may_be_empty)


def _are_many_lines(operation, low, high, step_mm):
    """Whether an operation lays more than MANY_LINES parallel passes over a box between (2,) corners, whatever their bearing."""
    is_parallel = getattr(operation, "strategy", operation.kind) == "parallel"
    return is_parallel and float(np.subtract(high, low)[:2].max()) > MANY_LINES * step_mm


def run_over_mm(step_mm, radius_mm):
    """How far the ball rolls over an outer edge: the last pass, up to a step before that, still cuts the edge clean.

    A wide step would let it fall into the stock behind the edge by its whole radius, where no pass before has been.

    >>> run_over_mm(0.5, 3.0), run_over_mm(2.5, 3.0)
    (0.75, 1.5)
    """
    return max(min(OVERLAP_STEPS * step_mm, RUN_OVER_RADII * radius_mm), 0.5 * step_mm)


def _gentle(field, steep_rad, overlap_mm):
    """The part of a region that is cut as seen from above: the rest, but for an overlap, is left to the wall passes."""
    steep = field.is_inside & ~(field.normal[..., 2] >= fixed.cos(steep_rad))
    if not steep.any():
        return field
    seeds = field.is_inside & ~steep
    return field.narrowed(seeds, overlap_mm) if seeds.any() else None


def pattern_curves(pattern, field, cutter, ridge_mm, angle_rad=0.0):
    """Passes seen from above, in plan.

    Args:
        pattern: parallel, constant_scallop, boundary or spiral.
        field: TipField.   cutter: shop.cutters.Cutter.   ridge_mm: largest cusp.   angle_rad: of parallel passes.
    """
    if pattern == "parallel":
        return parallel_curves(field, angle_rad, PARALLEL_SHARE * ridge_mm)
    corner_mm = None if cutter.type in ROUND else cutter.corner_radius_mm
    ground = ground_of(field, radius_mm=cutter.radius_mm, scallop_mm=LEVEL_SHARE * ridge_mm, corner_radius_mm=corner_mm)
    if pattern == "spiral":
        return [spiral_curve(ground)]
    return (boundary_curves if pattern == "boundary" else constant_scallop_curves)(ground)


def _wall_paths(work, field, tool, ridge_mm, tolerance_mm, step_mm):
    """Waterline passes round what stands steeper than the operation's limit, from the top."""
    steep_rad = math.radians(work.operation.waterline_deg)
    samples = sample_faces(work.faces, work.wanted, across_axis=2)          # curvature along the steepest way up
    corner = field.dropper.corner_radius_mm
    normal = samples.normal[:, 2]
    steep = (normal < fixed.cos(steep_rad)) & (normal > -HANGS) & (samples.across_per_mm * corner > -0.98)
    if not steep.any():
        return []
    heights = ([*_wall_heights(samples, steep, field, ridge_mm),
                *_feet(work, samples.point_mm[steep, 2], field.dropper, tolerance_mm)] if corner > 0.0 else
               _terraces(samples, steep, tool, ridge_mm, _lowest_mm(work, samples, steep, tolerance_mm)))
    return wall_paths_at(work, field, heights, tolerance_mm, step_mm)


def wall_paths_at(work, field, heights, tolerance_mm, step_mm, near=None):
    """Waterlines at tip heights, where the cutter touches faces wanted that are steeper than the operation's limit.

    `near`: function contacts (n, 3) -> (n,) bool that keeps them to some places; None: everywhere.
    """
    dropper, steep_rad = field.dropper, math.radians(work.operation.waterline_deg)
    corner, flat = dropper.corner_radius_mm, dropper.radius_mm - dropper.corner_radius_mm
    low, high = field.node_xy_mm[0, 0], field.node_xy_mm[-1, -1]
    offset, limit = corner + dropper.allowance_mm, fixed.cos(max(steep_rad - WALL_OVERLAP_RAD, 0.0))
    beside_mm = ASIDE_MM + tolerance_mm / 2         # a line's chords run so far into the wall
    may_touch = _may_touch(work, limit, MAY_TOUCH_STEPS * step_mm, dropper.radius_mm + dropper.allowance_mm)

    def gap(xy, z):
        """How far the ball reaches into the part: its height over a place jumps at walls, this does not."""
        return offset - work.closest.signed_distances_mm(np.column_stack([xy, z + corner]))

    def touches(tips):
        wanted = may_touch(tips[:, :2], tips[:, 2] + corner, np.zeros(len(tips)))
        wanted[wanted] = touches_exactly(tips[wanted])
        return wanted

    def touches_exactly(tips):
        middles = tips + np.array([0.0, 0.0, corner])
        if flat == 0.0:
            foot = work.closest.closest_points(middles)
            arm = middles - foot.point_mm
            wanted = np.isin(foot.face, work.wanted) & (arm[:, 2] < limit * foot.distance_mm)
        else:                   # the corner's middle on the side where the faces wanted are nearest
            walls = work.closest_of(tuple(work.wanted))
            foot = walls.closest_points(middles)
            for _ in range(RIM_STEPS):
                toward = (foot.point_mm - middles) * (1.0, 1.0, 0.0)
                centers = middles + flat * toward / np.maximum(np.linalg.norm(toward, axis=1), 1e-9)[:, None]
                foot = walls.closest_points(centers)
            arm = middles - foot.point_mm
            wanted = foot.distance_mm <= offset + TOUCHING_MM
        wanted &= foot.normal[:, 2] < limit                                               # not over a level face's rim
        aside = tips[:, :2] + beside_mm * arm[:, :2] / np.maximum(np.linalg.norm(arm[:, :2], axis=1), 1e-9)[:, None]
        wanted &= dropper.tips_mm(aside) <= tips[:, 2] + tolerance_mm                     # nothing hangs over it
        return wanted if near is None else wanted & near(foot.point_mm)

    drops = DropHeights(tips_at=dropper.tips_mm, gap_at=gap if flat == 0.0 else None,
                        near_at=lambda xy, z, within_mm: may_touch(xy, z + corner, within_mm))
    lines = waterlines(drops, heights, low, high, pitch_mm=WALL_GRID_STEPS * step_mm, chord_mm=tolerance_mm / 2)
    return wall_paths(lines, touches, step_mm)


def _may_touch(work, limit, spacing_mm, reach_mm):
    """Function of plan positions (n, 2), heights of the corner's middle (n,) and mm (n,): whether the cutter may touch faces
    wanted that are steeper than `limit` (their normal's z) anywhere within so many mm of there: (n,) bool.

    Places of the faces stand for all within the spacing, as far as the normal may turn within it.
    """
    tree = work.once(("steep places", tuple(work.wanted), limit, spacing_mm), lambda: _steep_places(work, limit, spacing_mm))

    def may_touch(xy, middle_z, within_mm):
        away, _ = tree.query(np.column_stack([xy, middle_z]))
        return away <= reach_mm + spacing_mm + TOUCHING_MM + within_mm

    return may_touch


def _steep_places(work, limit, spacing_mm):
    """cKDTree of places of the faces wanted that may be so steep within the spacing."""
    wanted = [work.faces[i] for i in work.wanted]
    samples = samples_of_faces(wanted, spacing_mm)
    patches = PatchSet.of_faces(wanted)
    shape = local_shape(patches.derivatives(samples.face, samples.u, samples.v))
    bend = np.maximum(np.abs(shape.curvature_low_per_mm), np.abs(shape.curvature_high_per_mm))
    turn = np.minimum(TURNS_MORE * bend * spacing_mm, np.pi)
    return cKDTree(samples.point_mm[~(fixed.arccos(np.clip(samples.normal[:, 2], -1.0, 1.0)) + turn < fixed.arccos(limit))])


def _wall_heights(samples, steep, field, ridge_mm):
    """Tip heights of the waterlines, as far apart as the cusp allows on the steep samples."""
    radius, offset = field.dropper.corner_radius_mm, field.dropper.corner_radius_mm + field.dropper.allowance_mm
    normal, bend = samples.normal[steep, 2], samples.across_per_mm[steep]
    tips = samples.point_mm[steep, 2] + offset * normal - radius
    cuts_mm, widest_mm = (radius, np.inf) if field.across is None else (field.across.radius_mm, field.across.widest_mm)
    chord = np.minimum(stepover_for_scallop_mm(cuts_mm, ridge_mm, bend), widest_mm)
    allowed = chord * np.sqrt(1.0 - normal ** 2) * np.minimum(1.0 + radius * bend, 1.0)
    step_at = smallest_step(tips, allowed, margin_mm=float(allowed.min()), elsewhere_mm=float(allowed.max()))
    return planes_across(float(tips.min()), float(tips.max()), step_at)


def _feet(work, walls_z_mm, dropper, tolerance_mm):
    """Tip heights on the level ground at the foot of walls: passes from above come near it, but not along it."""
    level = _level_heights(work)
    low, high = walls_z_mm.min() - dropper.corner_radius_mm, walls_z_mm.max()
    return [z + dropper.allowance_mm + tolerance_mm / 2 for z in sorted(level) if low < z < high]


def _level_heights(work):
    """Set of heights at which the part has level ground."""
    return {round(float(f.middle.point_mm[0, 2]) / SAME_MM) * SAME_MM for f in work.faces
            if f.kind == "plane" and f.middle.normal[0, 2] > LEVEL}


def _lowest_mm(work, samples, steep, tolerance_mm):
    """Lowest tip of a flat cutter beside walls: on no level ground at their foot, and below those that stand on nothing, at whose
    lower edge a strip would stay.  The foot of upright walls is their own: samples stand above it."""
    upright = np.unique(samples.face[steep & (np.abs(samples.normal[:, 2]) < HANGS)])
    feet = [float(bounding_box_mm(work.faces[i].shape)[0][2]) for i in upright]
    low = min([float(samples.point_mm[steep, 2].min()), *feet])
    stands = any(abs(z - low) <= ON_GROUND_MM for z in _level_heights(work))
    return low + tolerance_mm / 2 if stands or low not in feet else low - BELOW_MM


def _terraces(samples, steep, tool, ridge_mm, low):
    """Tip heights of a flat cutter down to `low`: on a wall that leans it leaves steps, on an upright one nothing above its tip."""
    normal, z = np.maximum(samples.normal[steep, 2], 0.0), samples.point_mm[steep, 2]
    highest = TERRACE_SHARE * tool.cutter.flute_length_mm
    allowed = np.minimum(ridge_mm / np.maximum(normal, ridge_mm / highest), highest)
    if float(z.max()) - low <= float(allowed.min()):
        return np.array([low])
    step_at = smallest_step(z, allowed, margin_mm=float(allowed.min()), elsewhere_mm=float(allowed.max()))
    return np.append(planes_across(low, float(z.max()), step_at), low)


def link_rules(work, tool, field, tolerance_mm, step_mm, feed, left_mm):
    """How the ball gets from path to path; `left_mm` is what earlier operations may have left on the part.

    A ball's arc over an edge would lead a leaning flat bottom into it, and on a link along the surface it would turn round its
    contact, unless it leans toward one direction however it is fed: what touches with its corner comes and goes along its axis.
    A position among others, above which other directions'
    material stands high, goes down by rapids between it.
    """
    radius = field.dropper.radius_mm if field.across is None else tool.cutter.radius_mm
    return TipLinkRules(
        field=field, stock=work.dropper(field.dropper.radius_mm, field.dropper.corner_radius_mm, left_mm),
        clearance_z_mm=work.clearance_z_mm,
        approach_z_mm=work.clearance_z_mm - work.clearance_mm + work.practice.approach_mm, feed_mm_per_min=feed,
        plunge_mm_per_min=work.practice.plunge_share * feed, tolerance_mm=tolerance_mm,
        surface_link_mm=0.0 if field.across and work.tool_axis.toward is None else LINK_STEPS * step_mm,
        hop_mm=HOP_RADII * radius, lead_radius_mm=0.0 if field.across else work.lead_radius_mm(radius),
        is_one_way=work.operation.passes == "one-way",
        steepest_rad=tool.cutter.steepest_rad, bearing=getattr(work.operation, "bearing", None),
        behind_rad=_behind_rad(work, tool.cutter), behind_toward=_lead_in_plan(work),
        ramp_above_mm=0.0 if field.across is None else min(RAMP_ABOVE * path_tolerance_mm(work.finish), HIGHEST_RAMP_MM),
        standing=None if field.across is None else lambda xy: work.standing_round_mm(xy, ENTRY_RADII * radius),
        rapids=None if work.operation.steepest_deg == 90.0 else work.dropper(
            field.dropper.radius_mm, field.dropper.corner_radius_mm, left_mm + RAPID_APPROACHES * work.practice.approach_mm))


def _behind_rad(work, cutter):
    """Slope at which a cutter that leads one way comes down onto its passes from behind; None: it does not."""
    corner = work.corner_of(cutter)
    if corner is None or corner.lead_rad <= 0.0:
        return None
    return min(RAMP_SHARE * cutter.steepest_rad + corner.lead_rad, STEEPEST_BEHIND_RAD)


def _lead_in_plan(work):
    """Unit direction in plan that the operation's axis leads toward however it is fed; None: there is none."""
    toward = getattr(work.tool_axis, "toward", None)
    size = 0.0 if toward is None else float(fixed.hypot(*toward[:2]))
    return (toward[0] / size, toward[1] / size) if size > 0.0 else None
