r"""What a run of moves does to the stock, measured apart from how it was planned.

The stock stands on a fine grid of heights.  The cutter walks along every move in steps; before each
step the cells that it takes away ahead of it span its engaged arc.  Heights are exact at the nodes,
angles good to a step and a node over the radius, and a bin.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Kind
from cuspline.toolpaths.roughing.level_fields import PlaneGrid
from cuspline.toolpaths.roughing.stock_fields import points_of_move
from cuspline.values.compiled import njit

BINS = 60                   # of the front half, 3 degrees each
GAP = 2                     # empty bins between marked ones that count as engaged: a thin chip misses cells
STEP_NODES = 3.0
SLOPE_FLAT_RAD = 1e-4       # moves that fall by less are level moves


@dataclass(frozen=True, eq=False, kw_only=True)
class CutMeasures:
    """What was met on the way; arrays of grid heights are (ny, nx)."""

    engaged_rad: np.ndarray         # (n,) largest arc in material of every move; 0 in air
    fall_rad: np.ndarray            # (n,) how steeply a move falls while its bottom is in material; 0 elsewhere
    rapid_depth_mm: np.ndarray      # (n,) deepest a rapid stands in the stock; 0 in air
    grid: PlaneGrid
    stock_mm: np.ndarray            # (ny, nx) heights after all moves

    @property
    def largest_level_engagement_rad(self):
        """Over the moves that do not fall in material: ramps and helices are judged by their slope."""
        return float(self.engaged_rad[self.fall_rad == 0].max(initial=0.0))

    @property
    def steepest_fall_rad(self):
        return float(self.fall_rad.max(initial=0.0))

    @property
    def deepest_rapid_mm(self):
        return float(self.rapid_depth_mm.max(initial=0.0))


def measure_cuts(moves, radius_mm, corner_radius_mm, stock_mm, min_mm, max_mm, pitch_mm, skin_mm, ramp_depth_mm):
    """Walk along moves through a stock.

    Args:
        moves: program.Moves, tool axis upright.
        radius_mm, corner_radius_mm: the cutter, 0 (flat) to radius (ball).
        stock_mm: function (n, 2) places -> (n,) heights.
        min_mm, max_mm: corners of a box round the stock.
        pitch_mm: of the grid and of the steps along moves.
        skin_mm: thinner material does not count; falls and rapids may graze that much sideways.
        ramp_depth_mm: arcs in material no deeper than this are not engagement: the floor that a helix leaves to
            its last turn.
    """
    grid = PlaneGrid.over(np.asarray(min_mm, float)[:2], np.asarray(max_mm, float)[:2], pitch_mm)
    heights = grid.sampled(stock_mm)
    engaged, fall, rapid = (np.zeros(len(moves)) for _ in range(3))
    for k in range(len(moves)):
        points = points_of_move(moves, k).copy()
        points[:, :2] = (points[:, :2] - grid.low_mm) / pitch_mm
        engaged[k], fall[k], rapid[k] = _walk(heights, points, radius_mm / pitch_mm, radius_mm, corner_radius_mm,
                                              pitch_mm, skin_mm, ramp_depth_mm, moves.kind[k] == Kind.RAPID)
    return CutMeasures(engaged_rad=engaged, fall_rad=fall, rapid_depth_mm=rapid, grid=grid, stock_mm=heights)


@njit
def _bottom(d, radius, corner):
    e = d - (radius - corner)
    return 0.0 if e <= 0.0 else corner - math.sqrt(max(corner * corner - e * e, 0.0))


@njit
def _lower(heights, x0, y0, x, y, z, heading, nodes, radius, corner, pitch, skin, thin, bins):
    """Lower all cells under the cutter on its way from (x0, y0) to (x, y) at height z.

    Marks the bins of the front half that lose some.

    Returns the largest depth taken farther inside the cutter than the skin.
    """
    deepest = 0.0
    bins[:] = False
    ux, uy = x - x0, y - y0
    square = ux * ux + uy * uy
    for j in range(max(0, math.ceil(min(y0, y) - nodes)), min(heights.shape[0], math.floor(max(y0, y) + nodes) + 1)):
        i0, i1 = max(0, math.ceil(min(x0, x) - nodes)), min(heights.shape[1], math.floor(max(x0, x) + nodes) + 1)
        for i in range(i0, i1):
            t = 0.0 if square == 0.0 else min(max(((i - x0) * ux + (j - y0) * uy) / square, 0.0), 1.0)
            d = math.hypot(i - x0 - t * ux, j - y0 - t * uy)
            if d > nodes or heights[j, i] <= z:
                continue
            bottom = z + _bottom(d * pitch, radius, corner)
            taken = heights[j, i] - bottom
            if taken <= 0.0:
                continue
            heights[j, i] = bottom
            if taken > skin:
                angle = (math.atan2(j - y, i - x) - heading + math.pi) % (2 * math.pi) - math.pi
                if abs(angle) <= math.pi / 2 and taken > skin + thin:
                    bins[min(BINS - 1, int((angle / math.pi + 0.5) * BINS))] = True
                if d * pitch <= radius - skin:
                    deepest = max(deepest, taken)
    return deepest


@njit
def _arc_of(bins):
    """Angle of the marked bins, gaps of up to GAP bins counted in."""
    count, last = 0, -BINS
    for k in range(BINS):
        if bins[k]:
            count += k - last if k - last <= GAP + 1 else 1
            last = k
    return count * math.pi / BINS


@njit
def _walk(heights, points, nodes, radius, corner, pitch, skin, thin, is_rapid):
    """(largest engaged arc, steepest fall in material, deepest rapid) along one polyline, lowering the heights."""
    engaged, fall, rapid = 0.0, 0.0, 0.0
    bins = np.zeros(BINS, np.bool_)
    for p in range(len(points) - 1):
        dx, dy, dz = points[p + 1, 0] - points[p, 0], points[p + 1, 1] - points[p, 1], points[p + 1, 2] - points[p, 2]
        flat = math.hypot(dx, dy)
        slope = math.atan2(-dz, flat * pitch) if flat > 0.0 or dz != 0.0 else 0.0
        heading = math.atan2(dy, dx)
        steps = max(1, math.ceil(max(flat, abs(dz) / pitch) / STEP_NODES))
        for k in range(1, steps + 1):
            x, y = points[p, 0] + dx * k / steps, points[p, 1] + dy * k / steps
            # a rising step is taken at its end, a falling one too: heights are good to a step's rise
            z = points[p, 2] + dz * k / steps
            taken = _lower(heights, x - dx / steps, y - dy / steps, x, y, z, heading, nodes, radius, corner, pitch,
                           skin, thin, bins)
            if flat > 0.0:
                engaged = max(engaged, _arc_of(bins))
            if taken > 0.0 and is_rapid:
                rapid = max(rapid, taken)
            if taken > 0.0 and slope > SLOPE_FLAT_RAD:
                fall = max(fall, slope)
    return engaged, fall, rapid
