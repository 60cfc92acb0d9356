"""What swept a place first: sub-steps of tools in true order, asked at points.

A timed forest is the arrays of a forest of tilted_tree.py and two more:

    number (m,)    place of each sub-step in the order in which the program is run, over all its tools
    least (k,)     the least number under each node

A branch is left out where its least number is no earlier than what is asked for, and where its bound is farther than
the reach: so the earliest sub-step is found as the nearest one is.
"""

import numpy as np

from cuspline.stock.contact_bounds import seen_from, step_bound
from cuspline.stock.tilted import posed_forest
from cuspline.stock.tilted_kernels import WAITING, poses_distance, substep_distance
from cuspline.stock.tilted_tree import BEHIND_LAST, FIRST_LINE, FIRST_NODE, FIRST_SUBSTEP, IS_FILLED, LEAF, LEAVES, SUBSTEPS
from cuspline.stock.tree import CHUNK, SLACK_MM, least_under, work
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z
from cuspline.values.threads import in_blocks

NEVER = np.iinfo(np.int64).max
FAR_MM = 1e9


def timed_forest(paths, numbers):
    """PosedPaths as one argument of the kernels here.

    Args:
        paths: PosedPath values.   numbers: of each path's sub-steps, (m,) in the path's own order.
    """
    least = [least_under(n, p.leaves, LEAF) for p, n in zip(paths, numbers)]
    stack = lambda arrays: np.concatenate([np.zeros(0, np.int64), *arrays]).astype(np.int64)
    return (*posed_forest(paths), stack(numbers), stack(least))


def first_within(points_mm, reach_mm, timed, before):
    """(n,) number of the first sub-step that comes within a reach of each point, before a number; NEVER: none does.

    Args:
        points_mm: (n, 3).   reach_mm: (n,); negative: so deep inside the one sub-step.
        timed: of `timed_forest`.   before: (n,) numbers.
    """
    return _asked(_first_within, points_mm, reach_mm, timed, before, np.int64)


def is_within(points_mm, reach_mm, timed, before):
    """(n,) bool: some sub-step before a number comes within a reach of each point, see `first_within`."""
    return _asked(_is_within, points_mm, reach_mm, timed, before, np.bool_)


def nearest_before(points_mm, timed, before):
    """(n,) least signed distance to sub-steps before a number, and (n,) the number of the nearest; 1e9, NEVER: none."""
    found = np.full(len(points_mm), NEVER)
    d = _asked(_nearest_before, points_mm, np.full(len(points_mm), FAR_MM), timed, before, float, found)
    return d, found


def _asked(kernel, points_mm, reach_mm, timed, before, dtype, *more):
    points = for_kernel(np.asarray(points_mm, float).reshape(-1, 3))
    out = np.empty(len(points), dtype)
    in_blocks(kernel, len(points), CHUNK, points, np.asarray(reach_mm, float), timed, np.asarray(before, np.int64), *more, out)
    return out


@njit(error_model="numpy")
def _searched(px, py, pz, reach, timed, before, goal, stack, bounds, waiting):
    """Of sub-steps earlier than `before` and within `reach`: distance and number of the one that is sought, FAR_MM, NEVER.

    goal: 0 the earliest, 1 any, 2 the nearest.
    """
    geometry, nodes, outlines, trees, grown, touches, number, least = timed
    found, nearest = NEVER, FAR_MM
    for k in range(len(trees)):
        base, start, count, leaves = trees[k, FIRST_NODE], trees[k, FIRST_SUBSTEP], trees[k, SUBSTEPS], trees[k, LEAVES]
        first, last, by = trees[k, FIRST_LINE], trees[k, BEHIND_LAST], grown[k]
        top = 1
        stack[0] = 0
        while top > 0:
            top -= 1
            node = stack[top]
            if least[base + node] >= before or nodes[base + node, IS_FILLED] == 0.0:
                continue
            if poses_distance(px, py, pz, nodes, base + node, outlines, first, last) - by - SLACK_MM > reach:
                continue
            if node < leaves - 1:
                left = 2 * node + 1
                early, late = (left, left + 1) if least[base + left] <= least[base + left + 1] else (left + 1, left)
                stack[top], stack[top + 1] = late, early
                top += 2
                continue
            t0 = (node - leaves + 1) * LEAF
            pu, pv, pw, across, tilt = seen_from(px, py, pz, nodes, base + node)
            for piece in range(start + t0, start + min(t0 + LEAF, count)):
                if number[piece] >= before:
                    continue
                if step_bound(pu, pv, pw, across, tilt, nodes, base + node, touches, piece) - by - SLACK_MM > reach:
                    continue
                d = substep_distance(px, py, pz, geometry, piece, outlines, first, last, reach + by + SLACK_MM, waiting)[0] - by
                if d > reach:
                    continue
                found, nearest = number[piece], d
                if goal == 0:
                    before = found
                elif goal == 1:
                    return nearest, found
                else:
                    reach = d
    return nearest, found


@njit(error_model="numpy")
def nearest_within(px, py, pz, reach, timed, before, stack, bounds, waiting):
    """Signed distance of a point to the nearest sub-step before a number, if it is within a reach; else 1e9."""
    d, _ = _searched(px, py, pz, reach, timed, before, 2, stack, bounds, waiting)
    return d


@njit(error_model="numpy")
def _first_within(points, reach, timed, before, out, first, last):
    (stack, bounds), waiting = work(), np.empty((WAITING, 6))
    for i in range(first, last):
        out[i] = _searched(points[i, X], points[i, Y], points[i, Z], reach[i], timed, before[i], 0, stack, bounds, waiting)[1]


@njit(error_model="numpy")
def _is_within(points, reach, timed, before, out, first, last):
    (stack, bounds), waiting = work(), np.empty((WAITING, 6))
    for i in range(first, last):
        out[i] = _searched(points[i, X], points[i, Y], points[i, Z], reach[i], timed, before[i], 1, stack, bounds,
                           waiting)[1] != NEVER


@njit(error_model="numpy")
def _nearest_before(points, reach, timed, before, found, out, first, last):
    (stack, bounds), waiting = work(), np.empty((WAITING, 6))
    for i in range(first, last):
        out[i], found[i] = _searched(points[i, X], points[i, Y], points[i, Z], reach[i], timed, before[i], 2, stack, bounds,
                                     waiting)
