"""The moves in their true order on a z-map: every change of the stock, every contact, one pass.

The z-map holds exact heights at its nodes.  Before a piece cuts, what must not touch (neck,
shank, holder) is measured against the stock as it then stands and against the finished design.
All of these parts count as upright cylinders without upper end: a height field below them
cannot tell the difference.
"""

import math

import numpy as np
from numba import njit

from cuspline.simulation.distance_kernels import corner_distance, least_along_line, piece_distance
from cuspline.simulation.height_kernels import piece_height

TILE = 8                  # nodes along the side of a tile whose highest node is kept
REFRESH = 256             # pieces after which the tiles are looked up again: heights only fall
FAR_MM = 50.0             # clearances beyond this are not measured
NOISE_MM = 1e-6           # heights closer than this are the same


@njit(cache=True)
def _chord(g, out):
    """A piece as a straight line that lies nowhere above it."""
    out[:] = g
    out[11] = 0.0
    if g[11] != 0.0 and g[10] < 0.0:
        dx, dy, dz = g[3] - g[0], g[4] - g[1], g[5] - g[2]
        half = 0.25 * (dx * dx + dy * dy + dz * dz)
        sagitta = g[9] - math.sqrt(max(g[9] * g[9] - half, 0.0))
        out[2] -= sagitta
        out[5] -= sagitta


@njit(cache=True)
def _tile_tops(z, design, tiles):
    for j in range(len(tiles)):
        for i in range(tiles.shape[1]):
            top = -math.inf
            for n in range(j * TILE, min((j + 1) * TILE, len(z))):
                for m in range(i * TILE, min((i + 1) * TILE, z.shape[1])):
                    top = max(top, z[n, m], design[n, m])
            tiles[j, i] = top


@njit(cache=True)
def _span(low, high, origin, pitch, count):
    """First and last + 1 node between two coordinates."""
    first = max(0, int(math.ceil((low - origin) / pitch - 1e-9)))
    return first, min(count, int(math.floor((high - origin) / pitch + 1e-9)) + 1)


@njit(cache=True)
def _least_clearance(line, radius, lift, enough, z, design, tiles, x0, y0, pitch):
    """(clearance, x, y, z) of an upright cylinder along a line; the search stops looking beyond `enough`."""
    best, bx, by, bz = enough, math.nan, math.nan, math.nan
    xl, xh, yl, yh = min(line[0], line[3]), max(line[0], line[3]), min(line[1], line[4]), max(line[1], line[4])
    low, grow = min(line[2], line[5]) + lift, radius + enough
    i0, i1 = _span(xl - grow, xh + grow, x0, pitch, z.shape[1])
    j0, j1 = _span(yl - grow, yh + grow, y0, pitch, z.shape[0])
    for tj in range(j0 // TILE, (j1 + TILE - 1) // TILE):
        for ti in range(i0 // TILE, (i1 + TILE - 1) // TILE):
            gx = max(x0 + ti * TILE * pitch - xh, xl - x0 - ((ti + 1) * TILE - 1) * pitch, 0.0)
            gy = max(y0 + tj * TILE * pitch - yh, yl - y0 - ((tj + 1) * TILE - 1) * pitch, 0.0)
            if corner_distance(math.sqrt(gx * gx + gy * gy) - radius, low - tiles[tj, ti]) >= best:
                continue
            for j in range(max(j0, tj * TILE), min(j1, (tj + 1) * TILE)):
                for i in range(max(i0, ti * TILE), min(i1, (ti + 1) * TILE)):
                    top = max(z[j, i], design[j, i])
                    if low - top >= best:
                        continue
                    x, y = x0 + i * pitch, y0 + j * pitch
                    d = piece_distance(x, y, top - lift, line, radius, 0.0)
                    if d < best:
                        best, bx, by, bz = d, x, y, top
    return best, bx, by, bz


@njit(cache=True)
def _keep_worst(table, row, amount, x, y, z):
    if amount > table[row, 0]:
        table[row, 0], table[row, 1], table[row, 2], table[row, 3] = amount, x, y, z


@njit(cache=True)
def _fixture_depth(line, a, rc, lift, box):
    """How deep a moving upright cutter or cylinder enters a box, from above or beside; negative: clear."""
    hx, hy = 0.5 * (box[3] - box[0]), 0.5 * (box[4] - box[1])
    d = least_along_line(0.5 * (box[0] + box[3]), 0.5 * (box[1] + box[4]), box[5] - lift, hx, hy, line, a, rc)
    return rc - d


@njit(cache=True)
def _cut(g, a, rc, row, is_rapid, touch, z, x0, y0, pitch, rapids, events, count):
    """Lowers the z-map by one piece; gives the events (grown when full) and their number."""
    radius = a + rc
    i0, i1 = _span(min(g[0], g[3]) - radius, max(g[0], g[3]) + radius, x0, pitch, z.shape[1])
    j0, j1 = _span(min(g[1], g[4]) - radius, max(g[1], g[4]) + radius, y0, pitch, z.shape[0])
    low = min(g[2], g[5])
    thin_rc = max(rc - touch, 0.0)
    thin_a = a - (touch - (rc - thin_rc))
    for j in range(j0, j1):
        for i in range(i0, i1):
            if z[j, i] - low <= NOISE_MM:
                continue
            x, y = x0 + i * pitch, y0 + j * pitch
            h = piece_height(x, y, g, a, rc)
            if h >= z[j, i] - NOISE_MM:
                continue
            if is_rapid:
                lifted = g.copy()
                for k in (2, 5, 8):
                    lifted[k] += touch
                if piece_height(x, y, lifted, thin_a, thin_rc) < z[j, i]:
                    _keep_worst(rapids, row, z[j, i] - h, x, y, h)
            z[j, i] = h
            if count == len(events):
                bigger = np.empty((2 * count, 3))
                bigger[:count] = events
                events = bigger
            events[count, 0], events[count, 1], events[count, 2] = row, j * z.shape[1] + i, h
            count += 1
    return events, count


@njit(cache=True)
def run(geometry, row, cutter, is_rapid, cutters, cylinders, clearance, touch, boxes, z, design, x0, y0, pitch, rows):
    """Replays all pieces in order.

    Args:
        geometry, row, cutter, is_rapid: (m, ...) pieces, their rows, which cutter, whether rapid.
        cutters: (t, 2) a, rc.   cylinders: (c, 4) cutter, lift, radius, 1 if holder.
        clearance: (2,) wanted round shank and holder.   touch: what a rapid may touch, mm.
        boxes: (f, 6) fixtures.   z, design: (ny, nx); z is lowered in place.   rows: number of rows.
    Returns:
        events (e, 3) row, cell, height; worst (4, rows, 4) of rapid, shank, holder and fixture:
        amount (-inf: none), x, y, z; least holder clearance (4,).
    """
    worst = np.full((4, rows, 4), -math.inf)
    least = np.array([FAR_MM, math.nan, math.nan, math.nan])
    tiles = np.empty(((z.shape[0] + TILE - 1) // TILE, (z.shape[1] + TILE - 1) // TILE))
    events, count, line = np.empty((1024, 3)), 0, np.empty(12)
    for p in range(len(geometry)):
        if p % REFRESH == 0:
            _tile_tops(z, design, tiles)
        _chord(geometry[p], line)
        a, rc = cutters[cutter[p], 0], cutters[cutter[p], 1]
        for f in range(len(boxes)):
            _keep_worst(worst[3], row[p], _fixture_depth(line, a, rc, 0.0, boxes[f]), line[3], line[4], boxes[f, 5])
        for c in range(len(cylinders)):
            if cylinders[c, 0] != cutter[p]:
                continue
            lift, radius, holder = cylinders[c, 1], cylinders[c, 2], int(cylinders[c, 3])
            for f in range(len(boxes)):
                _keep_worst(worst[3], row[p], _fixture_depth(line, radius, 0.0, lift, boxes[f]),
                            line[3], line[4], boxes[f, 5])
            enough = max(clearance[1], least[0]) if holder == 1 else clearance[0]
            d, x, y, top = _least_clearance(line, radius, lift, enough, z, design, tiles, x0, y0, pitch)
            if holder == 1 and d < least[0]:
                least[0], least[1], least[2], least[3] = d, x, y, top
            if d < clearance[holder] - NOISE_MM:
                _keep_worst(worst[1 + holder], row[p], clearance[holder] - d, x, y, top)
        events, count = _cut(geometry[p], a, rc, row[p], is_rapid[p], touch, z, x0, y0, pitch,
                             worst[0], events, count)
    return events[:count].copy(), worst, least
