"""One continuous pass over a region without islands: each turn drifts from one offset of the border to the next.

Every point of a loop climbs the distance from the border, square to the loops, by the share of the turn that
is behind it: after a turn it stands on the next loop.  The first and the last turn are whole loops.
"""

import math

import numpy as np

from cuspline.toolpaths.freeform.pass_gaps import FARTHEST, WIDEST, too_far
from cuspline.toolpaths.freeform.plane_curves import PlaneCurve
from cuspline.toolpaths.freeform.scallop_region import borders, lines_at
from cuspline.values.errors import NotOnePass

TRIES = 6               # of a finer pitch, until the spiral's own kinks hold the height too
CLIMBS = 8              # Newton steps of a point to its level
FLATTEST = 0.3          # where fronts meet the distance has no slope to climb: steps are no longer than for that


def spiral_curve(ground, is_inward=True):
    """A spiral of even pitch over the region.

    Args:
        ground: Ground, from `scallop_ground.ground_of`.
        is_inward: from the border to the middle; else outward.
    Returns:
        PlaneCurve, open; no place lies farther from it than scallops of 1.08 the wanted height allow, as far as the
        grid resolves it.  Where the border has corners the whole pitch is finer for their sake.
    Raises:
        NotOnePass: the region has islands, or offsets of its border part into several loops, or no pitch holds the height.
    """
    rims = borders(ground)
    if len(rims) != 1:
        raise NotOnePass(f"the region has {len(rims)} borders, and a spiral goes round one; split the region at its "
                            "islands, or let the passes follow the borders")
    phi = ground.distance(rims)
    deepest = float(phi[ground.is_inside & np.isfinite(phi)].max())
    turns = max(math.ceil(deepest), 1)
    for _ in range(TRIES):
        line = _spiral(ground, phi, deepest, turns)
        height, seen = too_far(ground, ground.left_by([line], FARTHEST), WIDEST)
        if not seen.any():
            return PlaneCurve(xy_mm=line if is_inward else line[::-1])
        turns = max(math.ceil(turns * min(height[ground.is_inside].max() / WIDEST, 1.25)), turns + 1)
    raise NotOnePass(f"a spiral of {turns} turns still leaves scallops of {(height[seen].max() / WIDEST) ** 2:.2f} "
                        "times the height allowed; let the passes follow the borders")


def _spiral(ground, phi, deepest, turns):
    """(m, 2) first loop, drifting turns, last loop."""
    loops = [_loop(ground, phi, (k + 0.5) * deepest / turns) for k in range(turns)]
    slope = _climb_per_level(ground, phi)
    here, parts = loops[0][0], []
    for k, loop in enumerate(loops):
        ring = _from_nearest(loop, here)
        if k == 0 or k == turns - 1:
            parts.append(ring)
        if k < turns - 1:
            share = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))]
            parts.append(_climbed(ground, phi, slope, ring, (k + 0.5 + share / share[-1]) * deepest / turns))
        here = parts[-1][-1]
    line = np.vstack(parts)
    return line[np.r_[True, np.linalg.norm(np.diff(line, axis=0), axis=1) > 1e-3 * ground.step_mm]]


def _loop(ground, phi, level):
    """(m + 1, 2) the one closed line at a level, counterclockwise."""
    found = lines_at(ground, phi, level)
    closed = [c for c in found if c.is_closed]
    if len(found) != 1 or not closed:
        raise NotOnePass(f"{level:.1f} passes from its border the region parts into {len(found)} loops, and "
                            "a spiral follows one; split the region there, or let the passes follow the borders")
    line = closed[0].line_mm
    area = (line[:-1, 0] * line[1:, 1] - line[1:, 0] * line[:-1, 1]).sum()
    return line if area > 0 else line[::-1]


def _from_nearest(loop, place):
    """The closed loop begun next to a place."""
    first = int(np.argmin(((loop[:-1] - place) ** 2).sum(axis=1)))
    return np.vstack([loop[first:-1], loop[:first + 1]])


def _climb_per_level(ground, phi):
    """(ny, nx, 2) way in plan, square to the level lines in the metric, that raises the distance by one."""
    gy, gx = np.gradient(np.where(np.isfinite(phi), phi, 0.0), ground.step_mm)
    xx, xy, yy = np.moveaxis(np.where(ground.is_open[..., None], ground.metric, (1.0, 0.0, 1.0)), -1, 0)
    det = xx * yy - xy * xy
    wx, wy = (yy * gx - xy * gy) / det, (xx * gy - xy * gx) / det
    return np.stack([wx, wy], axis=-1) / np.maximum(wx * gx + wy * gy, FLATTEST)[..., None]


def _climbed(ground, phi, slope, points, levels):
    """Points moved square to the level lines to levels of their own."""
    known, at = np.where(np.isfinite(phi), phi, 0.0), points.copy()
    for _ in range(CLIMBS):
        rise = np.clip(levels - ground.at(known, at), -0.5, 0.5)
        at = at + rise[:, None] * np.column_stack([ground.at(slope[..., k], at) for k in range(2)])
    return at
