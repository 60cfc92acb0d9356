r"""Roughing from any stock to any part: each level cleared with a bounded engagement, never a full slot.

On a level the tip may be where the drop-cutter, grown by the allowance, rests no higher than the
level, and not in corners or channels tighter than the least turn.  Passes are steered along what is
left of the stock (engagement.py); between them the cutter stays down where a free way leads to the
next place to cut.  It comes in beside the stock or over cleared ground, else down a helix.

    levels: coarse ones down to every flat shelf of the part, then, from below upward, fine ones
    between them that take the steps off the slopes
"""

import math

import numpy as np

from cuspline.toolpaths.drop.dropcutter import drop_tips_mm, is_held_above
from cuspline.toolpaths.roughing.cleared_area import LevelGround
from cuspline.toolpaths.roughing.clearing_moves import FIT_MM, ClearingWriter
from cuspline.toolpaths.roughing.clearing_rules import Clearing, ClearingRules, engagement_of_rad, refuse_bad
from cuspline.toolpaths.roughing.level_fields import PlaneGrid, inner_distance, level_distance_mm, nearest_seed
from cuspline.toolpaths.roughing.level_runs import LevelRuns
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import NothingToCut, ToolpathError

__all__ = ["Clearing", "ClearingRules", "clear", "engagement_of_rad"]

PITCH_SHARE = 1 / 40        # of the diameter: nodes of the plane fields
COARSEST_SHARE = 1 / 20     # the same on parts that are large for the cutter
MANY_NODES = 400_000        # of a grid that is large
THIN_SHARE = 1 / 320        # of the diameter: thinner material does not count as engaged
WALL_MARGIN_MM = 0.02       # kept to the side of the allowance: the mesh's deviation
INSETS = (1.0, 3.0, 9.0)    # times FIT_MM: tried one after the other until no arc or line gouges
SHELF_AREA_MM2 = 1.0        # smaller flat facets do not make a level
SHELF_NORMAL = 1 - 1e-6
ROUNDING_MM = 1e-9          # of a tip that stands on a level
HIDDEN_NODES = 0.75         # a fin between nodes shows in one of them as ground cleared by less than this


def clear(rules):
    """Clear the stock down to the part and its allowance, level by level.

    Raises:
        NothingToCut: there is nothing to remove.
        ToolpathError: the bounds cannot be used, or a path would cut into the allowance whatever is kept back from it.
    """
    refuse_bad(rules)
    job = _Job(rules)
    for level, above in job.levels():
        job.cut_level(level, above)
    if job.writer.is_empty:
        raise NothingToCut("roughing found nothing to remove: the stock is within the allowance of the part; "
                            "leave the operation out")
    return job.result()


def _pitch_mm(rules):
    """Of the plane fields: fine for the cutter, coarser where that takes more nodes than it is worth."""
    d, (x, y) = 2 * rules.radius_mm, (np.asarray(rules.stock_max_mm) - rules.stock_min_mm)[:2]
    return float(np.clip(math.sqrt((x + d) * (y + d) / MANY_NODES), d * PITCH_SHARE, d * COARSEST_SHARE))


class _Job:
    """The fields of one clearing while its levels are cut; grid arrays are (ny, nx)."""

    def __init__(self, rules):
        self.rules, r = rules, rules.radius_mm
        pitch = _pitch_mm(rules)
        reach = r + rules.lead_mm + 2 * pitch
        self.thin_mm = 2 * r * THIN_SHARE
        self.hidden_mm = HIDDEN_NODES * pitch + 2 * FIT_MM
        self.grid = PlaneGrid.over(np.asarray(rules.stock_min_mm)[:2] - reach,
                                   np.asarray(rules.stock_max_mm)[:2] + reach, pitch)
        self.tips = self.grid.sampled(self.tip_mm)
        self.stock = self.grid.sampled(rules.stock_mm)
        self.stock_before, self.sure_stock = self.stock.copy(), self.stock.copy()
        self.cleared = []           # (level, distance to what is cleared there)
        self.bored = []             # (level, (centre x, centre y, radius) of a helix down to it)
        self.writer = ClearingWriter(rules)
        self.done, self.most, self.left_mm3 = [], 0.0, 0.0
        self.forced = self._forced_levels()

    def tip_mm(self, xy_mm):
        """(n,) lowest tips that keep allowance, margins and a distance from what else stands there."""
        rules, a = self.rules, self.rules.allowance_mm
        tips = drop_tips_mm(rules.mesh, xy_mm, rules.radius_mm + a + WALL_MARGIN_MM, rules.corner_radius_mm + a)
        tips = tips + a + rules.margin_mm
        for low, high in rules.keep_out:
            tips = np.where(self._is_beside(xy_mm, low, high), np.maximum(tips, high[2] + rules.keep_out_mm), tips)
        for mesh in rules.keep_clear:
            highest = drop_tips_mm(mesh, xy_mm, rules.radius_mm + rules.keep_out_mm, 0.0)
            tips = np.maximum(tips, highest + rules.keep_out_mm)
        return tips if rules.lowest_mm is None else np.maximum(tips, rules.lowest_mm(xy_mm))

    def is_free_at(self, xy_mm, level):
        """(n,) bool: `tip_mm` is no higher than a level; costs far less."""
        rules, a = self.rules, self.rules.allowance_mm
        held = is_held_above(rules.mesh, xy_mm, rules.radius_mm + a + WALL_MARGIN_MM, rules.corner_radius_mm + a,
                             level - a - rules.margin_mm + ROUNDING_MM)
        for low, high in rules.keep_out:
            if high[2] + rules.keep_out_mm > level:
                held |= self._is_beside(xy_mm, low, high)
        for mesh in rules.keep_clear:
            held |= is_held_above(mesh, xy_mm, rules.radius_mm + rules.keep_out_mm, 0.0,
                                  level - rules.keep_out_mm + ROUNDING_MM)
        if rules.lowest_mm is not None:
            held |= rules.lowest_mm(xy_mm) > level + ROUNDING_MM
        return ~held

    def _is_beside(self, xy_mm, low, high):
        """(n,) bool: the cutter would come within the distance to keep of a box, seen from above."""
        beside = np.maximum(np.maximum(np.asarray(low)[:2] - xy_mm, xy_mm - np.asarray(high)[:2]), 0.0)
        return fixed.hypot(*beside.T) < self.rules.radius_mm + self.rules.keep_out_mm

    def levels(self):
        """(level, level above) in cutting order."""
        top = float(self.rules.stock_max_mm[2])
        for gap_top, gap_bottom in zip([top, *self.forced], self.forced):
            count = max(1, math.ceil((gap_top - gap_bottom) / self.rules.stepdown_mm - 1e-9))
            coarse = np.linspace(gap_top, gap_bottom, count + 1)
            for above, level in zip(coarse[:-1], coarse[1:]):
                yield float(level), float(above)
                fine = math.ceil((above - level) / self.rules.fine_step_mm - 1e-9)
                for k in range(fine - 1, 0, -1):
                    yield float(above - (above - level) * k / fine), float(above)

    def _forced_levels(self):
        """Flat shelves with their allowance, and the lowest place to go, from above downward."""
        rules, bottom = self.rules, float(self.rules.stock_min_mm[2])
        t = rules.mesh.corners_mm
        cross = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        area = np.linalg.norm(cross, axis=1)
        flat = np.abs(cross[:, 2]) > SHELF_NORMAL * np.maximum(area, 1e-12)
        heights, which = np.unique(t[flat][:, 0, 2].round(3), return_inverse=True)
        areas = np.bincount(which, area[flat] / 2, minlength=len(heights))
        radius = rules.radius_mm / self.grid.pitch_mm
        near = nearest_seed(np.isfinite(self.stock), np.zeros(self.stock.shape, bool), radius + 2)[1] < radius
        lowest = max(bottom, float(self.tips[near].min()))
        shelves = heights[areas > SHELF_AREA_MM2] + rules.allowance_mm + rules.margin_mm + 1e-6
        inside = shelves[(shelves > lowest + 1e-3) & (shelves < rules.stock_max_mm[2] - 1e-3)]
        return [*sorted(map(float, inside), reverse=True), lowest]

    def cut_level(self, level, above):
        """All passes of one level; with a wider berth round the part where arcs would touch it."""
        material = self._material(level)
        if not (material > self.thin_mm).any():
            return
        inside = self._inside(level)
        for inset in INSETS:
            ground = self._ground(material, inside, inset * FIT_MM, above)
            cut = LevelRuns(ground, self.grid, self.rules, self.writer, level, (self.sure_stock, self.bored))
            runs = cut.made()
            if all(self.writer.keeps_allowance(run, level) for run in runs):
                break
        else:
            raise ToolpathError(f"roughing at z = {level:.3f} mm: the path cuts into the allowance; "
                                "rough these faces with another `tool`, or with a larger `allowance_mm`")
        self.left_mm3 += cut.left_mm2 * (above - level)
        if runs:
            self.writer.write_level(runs, level)
            self.bored += [(level, run.helix_mm) for run in runs if run.helix_mm is not None]
            self._lower(ground.material * self.grid.pitch_mm, level)
            self.most = max(self.most, cut.most)

    def _material(self, level):
        """(ny, nx) distance to what is cleared at a level, mm, positive in material."""
        material = -level_distance_mm(self.grid, self.stock_before <= level, lambda xy: self.rules.stock_mm(xy) <= level)
        for lower, field in self.cleared:
            if lower <= level:
                material = np.minimum(material, field)
        return material

    def _inside(self, level):
        """(ny, nx) distance to where the tip may be and turn, nodes, positive there."""
        turn = self.rules.turn_mm / self.grid.pitch_mm
        is_free = self.tips <= level + ROUNDING_MM      # on a flat floor all tips are the level, but for rounding
        inside = level_distance_mm(self.grid, is_free, lambda xy: self.is_free_at(xy, level)) / self.grid.pitch_mm
        return turn + inner_distance(inside, turn)

    def _ground(self, material_mm, inside, inset_mm, above):
        """LevelGround of a level under one `above`: where the neck comes by later, it leaves less than the neck is slimmer."""
        rules, pitch = self.rules, self.grid.pitch_mm
        neck_passes = above - self.forced[-1] > rules.flutes_mm
        leaves_mm = min(rules.threshold_mm, rules.relief_mm - inset_mm - self.hidden_mm) if neck_passes else rules.threshold_mm
        shallow_mm = max(leaves_mm, 2 * self.thin_mm)
        return LevelGround(material_mm / pitch, inside - inset_mm / pitch, rules.radius_mm / pitch,
                           self.thin_mm / pitch, self.hidden_mm / pitch, shallow_mm / pitch)

    def _lower(self, material_mm, level):
        """Take a level that has been cut off the stock."""
        self.cleared.append((level, material_mm))
        is_sure = material_mm <= -self.hidden_mm
        ridges = np.minimum(self.sure_stock, level + self.rules.highest_ridge_mm)
        self.sure_stock = np.where(is_sure, ridges, self.sure_stock)
        self.stock = np.where(material_mm <= self.thin_mm, np.minimum(self.stock, level), self.stock)
        self.done.append(level)

    def result(self):
        moves = self.writer.moves()
        was = np.isfinite(self.stock_before)
        taken = self.stock_before[was] - self.stock[was]
        lowered = self.grid.xy_mm[was.ravel()][taken > 0]
        return Clearing(moves=moves, levels_mm=tuple(self.done), largest_engagement_rad=self.most,
                        removed_mm3=float(taken.sum() * self.grid.pitch_mm ** 2), lowered_xy_mm=lowered,
                        left_mm3=self.left_mm3)
