"""Finishing on any part: passes over the region where the ball touches the faces wanted, walls by waterlines.

The region is seen from above.  Where the faces stand steeper than the setup's limit a level step says little
about the cusp: there the ball goes round at constant height instead.
"""

import math

import numpy as np

from cuspline import fixed_math as fixed
from cuspline.brep import bounding_box_mm
from cuspline.errors import PlanError
from cuspline.planning.shop import (
    APPROACH_MM, CLEARANCE_MM, FINISH_DEPTH_SHARE, PLUNGE_SHARE, ROUGH_ALLOWANCE_MM, finite, path_tolerance_mm,
    ridge_for_step_mm)
from cuspline.planning.stepover import stepover_for_scallop_mm
from cuspline.program import Moves
from cuspline.surfaces.curvature import sample_faces
from cuspline.toolpaths.level_passes import boundary_curves, constant_scallop_curves
from cuspline.toolpaths.parallel_passes import parallel_curves
from cuspline.toolpaths.profile_passes import planes_across, smallest_step
from cuspline.toolpaths.scallop_ground import ground_of
from cuspline.toolpaths.spiral_passes import spiral_curve
from cuspline.toolpaths.stock_fields import swept_by_lines
from cuspline.toolpaths.tip_field import tip_field
from cuspline.toolpaths.tip_links import TipLinkRules, moves_of_tip_paths
from cuspline.toolpaths.tip_paths import PathRules, tip_paths
from cuspline.toolpaths.touch_up import region_left
from cuspline.toolpaths.wall_passes import wall_paths
from cuspline.toolpaths.waterline import waterlines

NODES_A_STEP = 5.0          # grid nodes between neighbouring passes on level ground
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
HOP_RADII = 6.0             # links over what lies between
RUN_OVER_RADII = 0.5        # over an edge the ball rolls no farther: it falls by 0.13 of its radius, whatever stands there
OVERLAP_STEPS = 1.5         # of neighbouring regions cut in different ways, or with different cutters


def finish(shop, name, tool, allowance_mm, scallop_mm, candidates):
    """Passes over all faces wanted with one ball.

    Args:
        shop: Shop.
        name: of the operation.
        tool: the ball.
        allowance_mm: material to leave.
        scallop_mm: largest cusp.
        candidates: what else was looked at, for plan.json.
    """
    left_mm = ROUGH_ALLOWANCE_MM + FINISH_DEPTH_SHARE * tool.cutter.diameter_mm if allowance_mm == 0.0 else TERRACE_MM
    return _operation(shop, name, tool, allowance_mm, scallop_mm, candidates, left_mm, lambda field: field)


def rest(shop, before, tool, candidates):
    """Passes of a smaller ball where the finishing operations before leave more than the cusp.

    Args:
        before: PlannedOperation values of larger balls without allowance.
    Returns:
        PlannedOperation, or None where nothing is left.
    """
    scallop_mm = shop.design.finish.scallop_mm
    step = flat_step_mm(tool, ridge_for_step_mm("rest finish", scallop_mm, shop.design.finish))
    swept = [operation.swept_mm for operation in before]
    region = lambda field: region_left(field, swept, TOUCH_UP_SHARE * scallop_mm, OVERLAP_STEPS * step)
    left_mm = before[-1].tool.cutter.radius_mm
    return _operation(shop, "rest finish", tool, 0.0, scallop_mm, candidates, left_mm, region, swept)


def _operation(shop, name, tool, allowance_mm, scallop_mm, candidates, left_mm, cut, before=()):
    """One operation over the region that `cut` makes of the whole one; None where nothing of it is left."""
    tolerance, ridge_mm = path_tolerance_mm(shop.design.finish), ridge_for_step_mm(name, scallop_mm, shop.design.finish)
    if allowance_mm > 0.0:
        tolerance, ridge_mm = SEMI_TOLERANCE_MM, scallop_mm - SEMI_TOLERANCE_MM
    step = flat_step_mm(tool, ridge_mm)
    field = cut(_field(shop, tool, allowance_mm, step / NODES_A_STEP))
    if field is None:
        return None
    rules = PathRules(tolerance_mm=tolerance, lateral_mm=LATERAL_SHARE * step, bridge_mm=BRIDGE_STEPS * step)
    gentle = _gentle(field, math.radians(shop.setup.steep_deg), OVERLAP_STEPS * step)
    curves = _curves(shop.setup, gentle, tool, ridge_mm) if gentle is not None else []
    paths = tip_paths(curves, gentle, rules) if curves else []
    walls = _wall_paths(shop, field, tool, ridge_mm, tolerance, step)
    touched = []
    if paths and allowance_mm == 0.0:
        touched = _touch_up(gentle, [*paths, *walls], before, scallop_mm, ridge_mm, step, rules)
    paths += touched
    if not paths and not walls:
        raise PlanError(f"{name}: T{tool.number} {tool.cutter.name} touches none of the faces {shop.setup.faces}: "
                        "choose other faces or a smaller ball")
    rpm, feed = shop.speeds(tool, is_rough=False)
    link = link_rules(shop, field, tolerance, step, feed, left_mm)
    moves = Moves.joined([moves_of_tip_paths(some, link) for some in (walls, paths) if some])
    facts = {"allowance_mm": allowance_mm, "scallop_mm": scallop_mm, "segment_tolerance_mm": tolerance,
             "ridge_for_step_mm": round(ridge_mm, 6), "stepover_mm": round(step, 6), "strategy": shop.setup.strategy,
             "passes": len(paths), "wall_passes": len(walls), "touch_ups": len(touched),
             "grid_mm": round(field.pitch_mm, 6),
             "region_mm2": round(float(field.is_inside.sum()) * field.pitch_mm ** 2, 1), "links": shop.setup.passes,
             "min_concave_radius_mm": finite(shop.hollow.radius_mm),
             "min_concave_place_mm": shop.in_part(shop.hollow.place_mm),
             "candidates": [c.as_dict() for c in candidates]}
    return shop.operation(name, tool, rpm, moves, facts)


def _touch_up(field, paths, before, scallop_mm, ridge_mm, step_mm, rules):
    """More passes where all that is planned leaves more than the cusp: closer ones, across what is left."""
    more, cutter = [], field.dropper
    for closer in TOUCH_UP_RIDGES:
        mine = swept_by_lines([p.tips_mm for p in [*paths, *more]], cutter.radius_mm, cutter.corner_radius_mm)
        left = region_left(field, [mine, *before], TOUCH_UP_SHARE * scallop_mm, TOUCH_UP_STEPS * step_mm)
        if left is None:
            break
        more += tip_paths(parallel_curves(left, 0.0, closer * ridge_mm), left, rules)
    return more


def flat_step_mm(tool, ridge_mm):
    """Step on a flat that leaves a ridge of that height."""
    return float(stepover_for_scallop_mm(tool.cutter.radius_mm, ridge_mm, 0.0)[0])


def _field(shop, tool, allowance_mm, pitch_mm):
    """Where the ball touches the faces wanted."""
    boxes = [bounding_box_mm(shop.faces[i].shape) for i in shop.wanted]
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    run_over = run_over_mm(NODES_A_STEP * pitch_mm, tool.cutter.radius_mm)
    dropper = shop.dropper_of(tool.cutter.radius_mm, allowance_mm)
    return tip_field(dropper, shop.wanted, (low[:2], high[:2]), pitch_mm, run_over)


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


def _curves(setup, field, tool, ridge_mm):
    """Passes seen from above, by the setup's strategy."""
    if setup.strategy == "parallel":
        return parallel_curves(field, math.radians(setup.pass_angle_deg), PARALLEL_SHARE * ridge_mm)
    ground = ground_of(field, radius_mm=tool.cutter.radius_mm, scallop_mm=LEVEL_SHARE * ridge_mm)
    if setup.strategy == "spiral":
        return [spiral_curve(ground)]
    return (boundary_curves if setup.strategy == "boundary" else constant_scallop_curves)(ground)


def _wall_paths(shop, field, tool, ridge_mm, tolerance_mm, step_mm):
    """Waterline passes round what stands steeper than the setup's limit, from the top."""
    steep_rad = math.radians(shop.setup.steep_deg)
    samples = sample_faces(shop.faces, shop.wanted, across_axis=2)          # curvature along the steepest way up
    normal, radius = samples.normal[:, 2], tool.cutter.radius_mm
    steep = (normal < fixed.cos(steep_rad)) & (normal > -HANGS) & (samples.across_per_mm * radius > -0.98)
    if not steep.any():
        return []
    return wall_paths_at(shop, field, _wall_heights(samples, steep, field.dropper, ridge_mm), tolerance_mm, step_mm)


def wall_paths_at(shop, field, heights, tolerance_mm, step_mm, near=None):
    """Waterlines at tip heights, where the ball touches faces wanted that are steeper than the setup's limit.

    `near`: function contacts (n, 3) -> (n,) bool that keeps them to some places; None: everywhere.
    """
    radius, steep_rad = field.dropper.radius_mm, math.radians(shop.setup.steep_deg)
    low, high = field.node_xy_mm[0, 0], field.node_xy_mm[-1, -1]
    offset, limit = radius + field.dropper.allowance_mm, fixed.cos(max(steep_rad - WALL_OVERLAP_RAD, 0.0))

    def gap(xy, z):
        """How far the ball reaches into the part: its height over a place jumps at walls, this does not."""
        return offset - shop.closest.signed_distances_mm(np.column_stack([xy, z + radius]))

    def touches(tips):
        centers = tips + np.array([0.0, 0.0, radius])
        foot = shop.closest.closest_points(centers)
        arm = centers - foot.point_mm
        leans = arm[:, 2] < limit * foot.distance_mm
        wanted = np.isin(foot.face, shop.wanted) & leans & (foot.normal[:, 2] < limit)    # not over a level face's rim
        aside = tips[:, :2] + ASIDE_MM * arm[:, :2] / np.maximum(np.linalg.norm(arm[:, :2], axis=1), 1e-9)[:, None]
        wanted &= field.dropper.tips_mm(aside) <= tips[:, 2] + tolerance_mm               # nothing hangs over it
        return wanted if near is None else wanted & near(foot.point_mm)

    lines = waterlines(field.dropper.tips_mm, heights, low, high, pitch_mm=WALL_GRID_STEPS * step_mm,
                       chord_mm=tolerance_mm / 2, gap_at=gap)
    return wall_paths(lines, touches, step_mm)


def _wall_heights(samples, steep, dropper, ridge_mm):
    """Tip heights of the waterlines, as far apart as the cusp allows on the steep samples."""
    radius, offset = dropper.radius_mm, dropper.radius_mm + dropper.allowance_mm
    normal, bend = samples.normal[steep, 2], samples.across_per_mm[steep]
    tips = samples.point_mm[steep, 2] + offset * normal - radius
    chord = stepover_for_scallop_mm(radius, ridge_mm, bend)
    allowed = chord * np.sqrt(1.0 - normal ** 2) * np.minimum(1.0 + radius * bend, 1.0)
    step_at = smallest_step(tips, allowed, margin_mm=float(allowed.min()), elsewhere_mm=float(allowed.max()))
    return planes_across(float(tips.min()), float(tips.max()), step_at)


def link_rules(shop, field, tolerance_mm, step_mm, feed, left_mm):
    """How the ball gets from path to path; `left_mm` is what earlier operations may have left on the part."""
    radius = field.dropper.radius_mm
    return TipLinkRules(
        field=field, stock=shop.dropper_of(radius, left_mm), clearance_z_mm=shop.clearance_z_mm,
        approach_z_mm=shop.clearance_z_mm - CLEARANCE_MM + APPROACH_MM, feed_mm_per_min=feed,
        plunge_mm_per_min=PLUNGE_SHARE * feed, tolerance_mm=tolerance_mm, surface_link_mm=LINK_STEPS * step_mm,
        hop_mm=HOP_RADII * radius, lead_radius_mm=min(2.0, radius), is_one_way=shop.setup.passes == "one-way")
