"""Passes of even scallop height: level lines one apart, side by side over the region, along a seed or a border.

Left to themselves they are the lines of scallop_field.py, which bend so that they need not kink; from a seed or a
border, those of the distance from it in the metric of scallop_metric.py.  The passes are phi = 1/2, 3/2, 5/2 ...
so that every place lies within 1/2 of a pass.  Where fronts meet head-on or at a sharp angle the next line
starts too far behind: there, and only there, extra pieces are laid along the ridge between the passes.

    front from the left   |   |   |  .  |   |   |   front from the right
                                     ^ extra piece where the gap is wider than one
"""

import math

import numpy as np
from scipy import ndimage

from cuspline.toolpaths.freeform.pass_gaps import gap_pieces
from cuspline.toolpaths.freeform.scallop_field import even_levels
from cuspline.toolpaths.freeform.scallop_region import borders, length_mm, lines_at
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import ToolpathError

CORNER_DEG = 40.0       # a border that turns more than this is two sides


def constant_scallop_curves(ground, seed=None):
    """Passes of even scallop height, side by side.

    Args:
        ground: Ground, from `ground_of`.
        seed: (m, 2) curve that the passes follow, mm; None: passes run the way that makes them short, gaps counted.
    Returns:
        list of PlaneCurve: the passes in order of level, then the pieces that close gaps.
        Scallops are within 7 % of the wanted height nearly everywhere, reach 8 % more where passes kink, as far as
        the grid resolves it (seven nodes from pass to pass: within 10 %), and are lower beside gap pieces, borders
        and hollows out of reach.  A height that nothing may exceed is met by asking for 1 / 1.1 of it.
    Raises:
        ToolpathError: the seed misses the region.
    """
    if seed is not None:
        return level_curves(ground, ground.distance([np.asarray(seed, float)]))
    return level_curves(ground, even_levels(ground, [ground.distance([longest_side(ground)])]))


def boundary_curves(ground):
    """Passes along all borders of the region, islands too, inward; as `constant_scallop_curves`."""
    return level_curves(ground, ground.distance(borders(ground)))


def level_curves(ground, phi):
    """Level lines of a distance half a pass from its seed and one apart, and the pieces that close gaps."""
    curves = level_lines(ground, phi)
    return curves + gap_pieces(ground, curves)


def level_lines(ground, phi):
    """Level lines of phi (ny, nx) half a pass from its least and one apart, evened so that the last is no nearer."""
    reached = ground.is_inside & np.isfinite(phi)
    if not reached.any():
        raise ToolpathError("the seed does not reach the region; move it onto the region")
    deepest = phi[reached].max()
    count = max(math.ceil(deepest - 0.02), 1)
    return [c for k in range(count) for c in lines_at(ground, phi, (k + 0.5) * deepest / count)]


def longest_side(ground):
    """(m, 2) the longest stretch of border between two corners of the part; all of it where there are none."""
    line = max(borders(ground), key=length_mm)[:-1]
    reach = min(12, len(line) // 8)
    seen = np.column_stack([ground.at(ground.touched_mm[..., k], line) for k in range(2)])
    lead, lag = seen - np.roll(seen, reach, axis=0), np.roll(seen, -reach, axis=0) - seen
    turn = np.abs(fixed.arctan2(lead[:, 0] * lag[:, 1] - lead[:, 1] * lag[:, 0], (lead * lag).sum(axis=1)))
    peak = turn >= ndimage.maximum_filter1d(turn, 2 * reach + 1, mode="wrap") - 1e-12
    corners = np.flatnonzero(peak & (turn > math.radians(CORNER_DEG)))
    if len(corners) < 2:
        return np.vstack([line, line[:1]])
    ends = np.append(corners[1:], corners[0] + len(line))
    sides = [np.take(line, np.arange(a, b + 1), axis=0, mode="wrap") for a, b in zip(corners, ends)]
    return max(sides, key=length_mm)
