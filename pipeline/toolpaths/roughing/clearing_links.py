r"""Where the cutter stands free on a level, and the shortest way there between what is still uncut.

A place is free when neither the part with its allowance nor uncut stock lies within the cutter's
radius.  Ways run over free nodes and are then pulled straight as far as the straight line is free.
"""

import heapq
import math

import numpy as np

from cuspline.toolpaths.roughing.engagement import value_at
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y

FAR_NODES = 2.0             # from the tool's place to the first node of a way
SIGHT_NODES = 0.5           # a straight line is looked at this often


@njit
def is_free_line(standing, x0, y0, x1, y1):
    """The straight line keeps to where the standing field is not negative; grid coordinates."""
    n = max(1, math.ceil(math.hypot(x1 - x0, y1 - y0) / SIGHT_NODES))
    for k in range(1, n):
        if value_at(standing, x0 + (x1 - x0) * k / n, y0 + (y1 - y0) * k / n) < 0.0:
            return False
    return True


@njit
def way_to_nearest(standing, x, y, wanted, longest):
    """Free nodes one after the other to the wanted node that is nearest along them.

    Args:
        standing: (ny, nx) >= 0 where the cutter stands free.
        x, y: where it is, grid coordinates.
        wanted: (ny, nx) bool.
        longest: no way of more nodes is looked for.
    Returns:
        (k, 2) grid coordinates, the wanted node last; empty where no way leads there.
    """
    ny, nx = standing.shape
    cost, before = np.full(ny * nx, np.inf), np.full(ny * nx, -1)
    heap = [(0.0, -1)]
    heap.pop()
    for j in range(max(0, math.ceil(y - FAR_NODES)), min(ny, math.floor(y + FAR_NODES) + 1)):
        for i in range(max(0, math.ceil(x - FAR_NODES)), min(nx, math.floor(x + FAR_NODES) + 1)):
            d = math.hypot(i - x, j - y)
            if standing[j, i] >= 0.0 and d <= FAR_NODES and is_free_line(standing, i, j, x, y):
                cost[j * nx + i] = d
                heapq.heappush(heap, (d, j * nx + i))
    while len(heap) > 0:
        d, at = heapq.heappop(heap)
        if d > cost[at]:
            continue
        j, i = at // nx, at % nx
        if d > longest:
            break
        if wanted[j, i]:
            return _traced(before, at, nx)
        for dj in range(-1, 2):
            for di in range(-1, 2):
                jj, ii = j + dj, i + di
                if not (0 <= jj < ny and 0 <= ii < nx) or standing[jj, ii] < 0.0:
                    continue
                further = d + math.sqrt(dj * dj + di * di)
                if further < cost[jj * nx + ii] - 1e-9:
                    cost[jj * nx + ii], before[jj * nx + ii] = further, at
                    heapq.heappush(heap, (further, jj * nx + ii))
    return np.empty((0, 2))


@njit
def _traced(before, at, nx):
    count, k = 0, at
    while k >= 0:
        count, k = count + 1, before[k]
    out, k = np.empty((count, 2)), at
    for n in range(count - 1, -1, -1):
        out[n, X], out[n, Y] = k % nx, k // nx
        k = before[k]
    return out


@njit
def pulled_straight(standing, way):
    """The same way with every point left out that a free straight line can do without."""
    kept = np.zeros(len(way), np.bool_)
    kept[0] = kept[-1] = True
    here = 0
    while here < len(way) - 1:
        there = here + 1
        step = 2
        while here + step < len(way) and is_free_line(standing, way[here, X], way[here, Y],
                                                      way[here + step, X], way[here + step, Y]):
            there = here + step
            step *= 2
        while there + 1 < len(way) and is_free_line(standing, way[here, X], way[here, Y],
                                                    way[there + 1, X], way[there + 1, Y]):
            there += 1
        kept[there] = True
        here = there
    return way[kept]


@njit
def upstream(wanted, near, x, y):
    """The farthest wanted node back along the material: a pass that begins there takes all of the strip.

    Args:
        wanted: (ny, nx) bool nodes beside material.
        near: (ny, nx, 2) nearest material of every node; the pass keeps it on the right.
        x, y: a wanted node.
    """
    ny, nx = wanted.shape
    seen = np.zeros((ny, nx), np.bool_)
    i, j = int(x), int(y)
    bx, by = 0.0, 0.0
    while True:
        seen[j, i] = True
        ax, ay = near[j, i, X] - i, near[j, i, Y] - j
        length = math.hypot(ax, ay)
        if length > 0.0:
            bx, by = ay / length, -ax / length          # against the heading of the pass
        best, ti, tj = 0.3, -1, -1
        for dj in range(-2, 3):
            for di in range(-2, 3):
                jj, ii = j + dj, i + di
                if (di == 0 and dj == 0) or not (0 <= jj < ny and 0 <= ii < nx) or not wanted[jj, ii] or seen[jj, ii]:
                    continue
                along = (di * bx + dj * by) / math.hypot(di, dj)
                if along > best:
                    best, ti, tj = along, ii, jj
        if ti < 0:
            return i, j
        i, j = ti, tj


@njit
def nearest_node(wanted, x, y):
    """x, y of the wanted node nearest to a place; -1, -1 where none is wanted."""
    ny, nx = wanted.shape
    best, bi, bj = math.inf, -1, -1
    for j in range(ny):
        for i in range(nx):
            if wanted[j, i] and (i - x) * (i - x) + (j - y) * (j - y) < best:
                best, bi, bj = (i - x) * (i - x) + (j - y) * (j - y), i, j
    return bi, bj
