"""Roughing, rest roughing from the stock that it really leaves, and a semi-finish where both leave too much."""

import numpy as np

from cuspline.planning.context import FINISH_DEPTH_SHARE, KEEP_OUT_MM, PLUNGE_SHARE, RAMP_RAD, ROUGH_ALLOWANCE_MM
from cuspline.planning.cutter_choice import choose_rest_roughing, choose_roughing, leftover_rows, roughing_tools
from cuspline.toolpaths.drop.dropcutter import DropMesh
from cuspline.toolpaths.roughing.level_clearing import ClearingRules, clear, engagement_of_rad
from cuspline.toolpaths.roughing.stock_fields import stock_after

RADIAL_SHARE = 0.45         # of the diameter: largest radial depth of cut
REST_THRESHOLD_MM = 0.5     # rest roughing leaves alone what stands less than this above the allowance
LEFT_PERCENTILE = 99.5      # of the places finished: what roughing leaves there


def roughed(shop, ball, is_reached, semi_finish):
    """The operations before the finish.

    Args:
        shop: Shop.
        ball: the finishing Tool; what it may take follows from its diameter.
        is_reached: (n,) bool, sample points that it finishes.
        semi_finish: function () -> PlannedOperation.
    Returns:
        list of PlannedOperation.
    """
    low, high = shop.stock_min_mm, shop.stock_max_mm
    rows = leftover_rows(shop.samples)
    rows = rows[is_reached[rows]]
    limit = FINISH_DEPTH_SHARE * ball.cutter.diameter_mm
    tools = roughing_tools(shop.library, shop.mesh, shop.samples, low, high, ROUGH_ALLOWANCE_MM)
    first, candidates = choose_roughing(tools, ROUGH_ALLOWANCE_MM)
    operation, stock, left = _cleared(shop, "rough", first.tool, candidates, shop.stock_mm, rows, 0.0)
    operations = [operation]
    if left > limit:
        smaller, candidates = choose_rest_roughing(tools, first, left)
        if smaller is not None:
            operation, stock, left = _cleared(shop, "rest rough", smaller.tool, candidates, stock, rows,
                                              REST_THRESHOLD_MM)
            operations.append(operation)
    if left > limit:
        operations.append(semi_finish())
    return operations


def _cleared(shop, name, tool, candidates, stock, rows, threshold_mm):
    """One clearing: (operation, stock after it, what it leaves at the sample rows)."""
    cutter = tool.cutter
    rpm, feed = shop.speeds(tool, is_rough=True)
    d = cutter.diameter_mm
    rules = ClearingRules(
        mesh=shop.mesh, radius_mm=d / 2, corner_radius_mm=cutter.corner_radius_mm, allowance_mm=ROUGH_ALLOWANCE_MM,
        stepdown_mm=shop.material.stepdown_share * d, engagement_rad=engagement_of_rad(RADIAL_SHARE * d, d / 2),
        stock_mm=stock, stock_min_mm=shop.stock_min_mm, stock_max_mm=shop.stock_max_mm, ramp_rad=RAMP_RAD,
        clearance_z_mm=shop.clearance_z_mm, feed_mm_per_min=feed, ramp_feed_mm_per_min=PLUNGE_SHARE * feed,
        rapid_mm_per_min=min(a.rapid_mm_per_min for a in shop.machine.axes), threshold_mm=threshold_mm,
        keep_out=(*(f.box_mm for f in shop.fixtures if f.is_box), *shop.beyond_reach(d / 2)),
        keep_clear=tuple(DropMesh.from_triangles(*f.mesh) for f in shop.fixtures if not f.is_box), keep_out_mm=KEEP_OUT_MM)
    clearing = clear(rules)
    after = stock_after(clearing.moves, d / 2, cutter.corner_radius_mm, stock)
    points, normals = shop.samples.point_mm[rows], shop.samples.normal[rows]
    left = np.maximum(after(points[:, :2]) - points[:, 2], 0.0) * np.abs(normals[:, 2])
    left = float(np.percentile(left, LEFT_PERCENTILE)) if len(rows) else 0.0
    facts = {"allowance_mm": ROUGH_ALLOWANCE_MM, "stepdown_mm": rules.stepdown_mm, "stepover_mm": RADIAL_SHARE * d,
             "engagement_deg": round(float(np.degrees(rules.engagement_rad)), 1),
             "largest_engagement_deg": round(float(np.degrees(clearing.largest_engagement_rad)), 1),
             "levels": len(clearing.levels_mm), "removed_mm3": round(clearing.removed_mm3, 1),
             "given_up_mm3": round(clearing.left_mm3, 1), "leaves_mm": round(left, 3),
             "candidates": [c.as_dict() for c in candidates]}
    return shop.operation(name, tool, rpm, clearing.moves, facts), after, left
