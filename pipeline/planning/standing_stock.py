"""Stock that stands beside the faces of an operation, higher than roughing leaves it, as triangles that holders must clear.

Where a wall leans outward every level of roughing ends at the wall's foot of that level: a stair stands on it, as wide as the
wall leans over one level.  Faces of the operation are left out: what stands there is cut before a shank comes by.
"""

import numpy as np
from scipy.ndimage import maximum_filter

from cuspline.replay.clearance import ClearanceTree
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm
from cuspline.values.rows import X, Y

NODE_MM = 0.25              # between the places at which heights are looked up
MOST_NODES = 400            # of them along a side
NEEDLE_MM = 0.05            # that finds the part below
MORE_MM = 0.05              # than roughing leaves: then it counts
BEYOND_MM = 1.0             # round the stock: there it ends


def standing_tree(work):
    """What stands before an operation, seen along the setup's Z.

    Args:
        work: PlanningContext of the operation.
    Returns:
        ClearanceTree of the tops of the stock, nowhere lower than these, higher by up to a node beside a step; None: nothing
        stands higher than roughing leaves it.
    """
    xy = _nodes(work)
    base = float(work.stock_min_mm[2])
    tops = np.maximum(work.stock_mm(xy.reshape(-1, 2)).reshape(xy.shape[:2]), base)
    triangles = _triangles(_is_beside(work, np.dstack([xy, tops]).reshape(-1, 3), base).reshape(tops.shape))
    high = maximum_filter(tops, size=3)         # a step between two places is as far out as the farther one
    return ClearanceTree.of_triangles(np.dstack([xy, high]).reshape(-1, 3), triangles) if len(triangles) else None


def _nodes(work):
    """(nx, ny, 2) even places over the stock."""
    low, high = np.array(work.stock_min_mm[:2]) - BEYOND_MM, np.array(work.stock_max_mm[:2]) + BEYOND_MM
    step = max(NODE_MM, float((high - low).max()) / MOST_NODES)
    lines = [low[k] + step * np.arange(int((high[k] - low[k]) / step) + 2) for k in (X, Y)]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)


def _is_beside(work, places_mm, base_mm):
    """(n,) bool: more stands there than roughing leaves, and on no face of the operation."""
    most = work.practice.rough_allowance_mm + MORE_MM
    part = drop_tips_mm(work.mesh, places_mm[:, :2], NEEDLE_MM, NEEDLE_MM)
    counts = places_mm[:, 2] > np.maximum(part, base_mm) + most         # no nearer to the part than straight down
    foot = work.closest.closest_points(places_mm[counts])
    counts[counts] = (foot.distance_mm > most) & ~np.isin(foot.face, work.wanted)
    return counts


def _triangles(counts):
    """(t, 3) of the cells of a grid with a corner that counts."""
    number = np.arange(counts.size).reshape(counts.shape)
    cell = counts[:-1, :-1] | counts[1:, :-1] | counts[:-1, 1:] | counts[1:, 1:]
    a, b, c, d = (part[cell] for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    return np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
