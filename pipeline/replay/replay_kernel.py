"""The moves in their true order on a z-map: every change of the stock, every contact, one pass.

The z-map holds exact heights at its nodes, and for each cell between them a proven upper bound (replay_stock).
Before a piece cuts, what must not touch (neck, shank, holder; on rapids the flutes) is held against the stock
as it then stands: against the bounds; where these do not clear it, against the nodes; where these show no contact,
between them.  Every part counts as going on upward: a height field below it cannot tell the difference.
"""

import math

import numpy as np

from cuspline.replay.clearance_kernels import BOTTOM, BOTTOM_RADIUS, GROW, TOP_RADIUS
from cuspline.replay.replay_stock import (
    AMOUNT,
    AT_X,
    AT_Y,
    AT_Z,
    BUDGET,
    DEPTH_MM,
    LEAST_MM,
    SEEN_BUDGET,
    SHARE,
    beyond,
    bulge,
    part_distance,
    refine,
    runs_in_swept,
    search_space,
    worth_less,
)
from cuspline.stock.distance_kernels import corner_distance
from cuspline.stock.height_kernels import piece_height
from cuspline.stock.level_arcs import MOST_WAYS, chord_count, chord_room, chords_within, level_cover, level_sagitta
from cuspline.stock.path_pieces import ARC, FORM, LEVEL_ARC, LINE, RADIUS, SIDE, X0, X1, Y0, Y1, Z0, Z1
from cuspline.stock.tree import CORNER_RADIUS, FLAT_RADIUS
from cuspline.values.compiled import njit
from cuspline.values.rows import HIGH_X, HIGH_Y, HIGH_Z, LOW_X, LOW_Y, X, Y, Z, put

RUBBING_MM = 0.001        # a shank as wide as its flutes may rub so much on the stock that these have just cut
TILE = 8                  # cells along the side of a tile whose highest bound is kept: where a piece cuts no lower it
                          # is left alone
REFRESH = 256             # pieces after which the highest of the tiles is looked up again: it only falls
FAR_MM = 50.0             # clearances beyond this are not measured
NOISE_MM = 1e-6           # heights closer than this are the same
NEAR_SHARE = 0.5          # of LEAST_MM, that a chord of a level arc may seem nearer to the stock than the arc
STRETCH_SHARE = 1.0       # of the radius: so far ahead a neck is held against what its flutes' shadow is to take
RAPID, SHANK, HOLDER, FIXTURE, LOW = range(5)
UNCUT = 5                 # kind of part: the neck above the flutes, against what stood before these cut below it
CUTTER, KIND = range(2)         # columns of kinds
PROVEN, ATTAINED = range(2)     # of the least distance
ROW, CELL, HEIGHT = range(3)    # arrays of events
FIRST = 0                       # of a piece's ways


@njit
def chord(g, out):
    """A piece as a straight line that lies nowhere above it; of a level arc its chord."""
    put(out, g)
    out[FORM] = LINE
    if g[FORM] == ARC and g[SIDE] < 0.0:
        dx, dy, dz = g[X1] - g[X0], g[Y1] - g[Y0], g[Z1] - g[Z0]
        half = 0.25 * (dx * dx + dy * dy + dz * dz)
        sagitta = g[RADIUS] - math.sqrt(max(g[RADIUS] * g[RADIUS] - half, 0.0))
        out[Z0] -= sagitta
        out[Z1] -= sagitta


@njit
def lowered(line, by_mm, out):
    """A rapid's straight way lowered by the height it is to keep; where it leads up, it may begin in the cut."""
    put(out, line)
    rise = line[Z1] - line[Z0]
    across = math.sqrt((line[X1] - line[X0]) ** 2 + (line[Y1] - line[Y0]) ** 2)
    if rise > 0.0 and across < by_mm:
        out[Z1] -= min(by_mm, rise)
    else:
        out[Z0] -= max(by_mm - max(rise, 0.0), 0.0)
        out[Z1] -= by_mm


@njit
def ways_of(g, corners, ways):
    """Straight lines that a piece runs along, into ways (MOST_WAYS, 12): how many; level arcs as chords within SAGITTA_MM."""
    chord(g, ways[FIRST])
    count = chords_within(g, corners) if g[FORM] == LEVEL_ARC else 1
    for k in range(count if count > 1 else 0):
        put(ways[k], ways[FIRST])
        ways[k, X0], ways[k, Y0], ways[k, X1], ways[k, Y1] = corners[k, X], corners[k, Y], corners[k + 1, X], corners[k + 1, Y]
    return count


@njit
def chords(geometry):
    """(k, 6) ends of the straight lines of all pieces, see `ways_of`, and the piece (k,) that each is of."""
    corners, ways, count = chord_room(), np.empty((MOST_WAYS, 12)), 0
    for p in range(len(geometry)):
        count += chord_count(geometry[p])
    lines, of, k = np.empty((count, 6)), np.empty(count, np.int64), 0
    for p in range(len(geometry)):
        for way in range(ways_of(geometry[p], corners, ways)):
            put(lines[k], ways[way, :6])
            of[k] = p
            k += 1
    return lines, of


@njit
def _tile_top(bounds, tj, ti):
    """Highest bound of a tile."""
    top = -math.inf
    for j in range(tj * TILE, min((tj + 1) * TILE, len(bounds))):
        for i in range(ti * TILE, min((ti + 1) * TILE, bounds.shape[1])):
            top = max(top, bounds[j, i])
    return top


@njit
def _cells(low, high, lines):
    """First and last + 1 cell that a stretch meets."""
    origin, pitch, count = lines[0], lines[1] - lines[0], len(lines) - 1
    first = max(0, min(int(math.floor((low - origin) / pitch)), count - 1) if high >= origin else 0)
    last = min(count, int(math.floor((high - origin) / pitch)) + 1) if low <= lines[count] else first
    return first, max(last, first)


@njit
def _keep_worst(table, row, amount, x, y, z):
    if amount > table[row, AMOUNT]:
        table[row, AMOUNT], table[row, AT_X], table[row, AT_Y], table[row, AT_Z] = amount, x, y, z


@njit
def _fixture_depth(line, part, box):
    """How deep a moving upright part enters a box, from above or beside; negative: clear."""
    hx, hy = 0.5 * (box[HIGH_X] - box[LOW_X]), 0.5 * (box[HIGH_Y] - box[LOW_Y])
    return -part_distance(0.5 * (box[LOW_X] + box[HIGH_X]), 0.5 * (box[LOW_Y] + box[HIGH_Y]), hx, hy, box[HIGH_Z], line,
                          part)[0]


@njit
def _doubtful_cells(line, part, enough, stock, highest, doubtful):
    """Cells whose bounds leave a part nearer than `enough`: their number, and the least distance of the others."""
    _, bounds, _, tiles, xs, ys = stock
    xl, xh, yl, yh = min(line[X0], line[X1]), max(line[X0], line[X1]), min(line[Y0], line[Y1]), max(line[Y0], line[Y1])
    radius = max(part[BOTTOM_RADIUS], part[TOP_RADIUS]) + part[GROW]
    low, grow = min(line[Z0], line[Z1]) + part[BOTTOM] - part[GROW], radius + enough
    if low - highest >= enough:
        return 0, min(low - highest, FAR_MM)
    i0, i1 = _cells(xl - grow, xh + grow, xs)
    j0, j1 = _cells(yl - grow, yh + grow, ys)
    count, clear = 0, FAR_MM
    for tj in range(j0 // TILE, (j1 + TILE - 1) // TILE):
        for ti in range(i0 // TILE, (i1 + TILE - 1) // TILE):
            gx = max(xs[ti * TILE] - xh, xl - xs[min((ti + 1) * TILE, len(xs) - 1)], 0.0)
            gy = max(ys[tj * TILE] - yh, yl - ys[min((tj + 1) * TILE, len(ys) - 1)], 0.0)
            d = corner_distance(math.sqrt(gx * gx + gy * gy) - radius, low - tiles[tj, ti])
            if d >= enough:
                clear = min(clear, d)
                continue
            for j in range(max(j0, tj * TILE), min(j1, (tj + 1) * TILE)):
                for i in range(max(i0, ti * TILE), min(i1, (ti + 1) * TILE)):
                    d = low - bounds[j, i]
                    if d < enough:
                        hx, hy = 0.5 * (xs[i + 1] - xs[i]), 0.5 * (ys[j + 1] - ys[j])
                        d, _ = part_distance(xs[i] + hx, ys[j] + hy, hx, hy, bounds[j, i], line, part)
                    if d >= enough:
                        clear = min(clear, d)
                    else:
                        doubtful[count] = j * bounds.shape[1] + i
                        count += 1
    return count, clear


@njit
def _at_nodes(line, part, doubtful, count, stock, spot):
    """Least distance at the corners of cells that are nodes; `spot` takes its place."""
    z, bounds, _, _, xs, ys = stock
    best = math.inf
    for k in range(count):
        j0, i0 = doubtful[k] // bounds.shape[1], doubtful[k] % bounds.shape[1]
        for j in range(j0, min(j0 + 2, len(z))):
            for i in range(i0, min(i0 + 2, z.shape[1])):
                if xs[i] > xs[i0 + 1] or ys[j] > ys[j0 + 1]:
                    continue
                _, d = part_distance(xs[i], ys[j], 0.0, 0.0, z[j, i], line, part)
                if d < best:
                    best = d
                    spot[X], spot[Y], spot[Z] = xs[i], ys[j], z[j, i]
    return best


@njit
def _against_stock(line, part, wanted, enough, before, stock, highest, past, doubtful, space, spot, budget):
    """One part over one piece: (proven lower bound, least attained or inf, whether contact stays possible unseen)."""
    forest, orders, firsts = past
    count, proven = _doubtful_cells(line, part, enough, stock, highest, doubtful)
    if count == 0:
        return proven, math.inf, False
    best = _at_nodes(line, part, doubtful, count, stock, spot)
    is_seen = best < wanted
    deeper = max(DEPTH_MM, SHARE * (wanted - best))
    enough = min(enough, best - deeper) if is_seen else min(enough, max(wanted, worth_less(best)))
    if enough == wanted and runs_in_swept(line, part, wanted, before, forest, orders, firsts, space):
        return min(proven, enough), best, False
    _, bounds, sure, _, xs, ys = stock
    doubt, left, here = False, SEEN_BUDGET if is_seen else BUDGET, np.empty(3)
    for k in range(count):
        j, i = doubtful[k] // bounds.shape[1], doubtful[k] % bounds.shape[1]
        hx, hy = 0.5 * (xs[i + 1] - xs[i]), 0.5 * (ys[j + 1] - ys[j])
        lower, got, unsure, left = refine(xs[i] + hx, ys[j] + hy, hx, hy, bounds[j, i], sure[j, i], before, line, part,
                                          wanted, enough, forest, orders, firsts, space, here, left)
        proven, doubt = min(proven, lower), doubt or unsure
        if got < best:
            best = got
            put(spot, here)
            if best < wanted:
                enough = min(enough, best - DEPTH_MM)
    return proven, best, doubt and best >= wanted


@njit
def _depth_in_box(g, part, box, touch, room):
    """As `_fixture_depth` over a piece: of a level arc its chord with the part grown, where that is clear by `touch`, else all."""
    _, corners, ways, grown, _ = room
    line, sagitta = ways[FIRST], level_sagitta(g)
    chord(g, line)
    if sagitta == 0.0:
        return _fixture_depth(line, part, box)
    put(grown, part)
    grown[GROW] += sagitta
    deepest = _fixture_depth(line, grown, box)
    if deepest > -touch:
        deepest = -math.inf
        for k in range(ways_of(g, corners, ways)):
            deepest = max(deepest, _fixture_depth(ways[k], part, box))
    return deepest


@njit
def _on_its_ways(g, part, wanted, enough, near, before, stock, highest, past, doubtful, room, spot, budget):
    """As `_against_stock` over a piece: of a level arc a chord with the part grown clears what is between its ends, or is halved.

    Grown by no more than `near` it also says how near the part comes, where that is no contact.
    """
    space, corners, ways, grown, here = room
    line, sagitta = ways[FIRST], level_sagitta(g)
    chord(g, line)
    if sagitta == 0.0:
        return _against_stock(line, part, wanted, enough, before, stock, highest, past, doubtful, space, spot, budget)
    put(grown, part)
    whole = chords_within(g, corners)
    proven, best, doubt = FAR_MM, math.inf, False
    first, count = 0, whole                            # chords from `first` on, as many of them as are looked at as one
    while first < whole:
        line[X0], line[Y0] = corners[first, X], corners[first, Y]
        line[X1], line[Y1] = corners[first + count, X], corners[first + count, Y]
        if count > 1:
            grown[GROW] = part[GROW] + sagitta * (count / whole) ** 2
            cells, lower = _doubtful_cells(line, grown, enough, stock, highest, doubtful)
            got, unsure = math.inf, False
            if cells > 0 and grown[GROW] - part[GROW] <= near:
                lower, got, unsure = _against_stock(line, grown, wanted, enough, before, stock, highest, past, doubtful, space,
                                                    here, budget)
                cells = 1 if unsure or got < wanted else 0
            if cells > 0:
                count //= 2
                continue
        else:
            lower, got, unsure = _against_stock(line, part, wanted, enough, before, stock, highest, past, doubtful, space, here,
                                                budget)
        proven, doubt = min(proven, lower), doubt or unsure
        if got < best:
            best = got
            put(spot, here)
            enough = min(enough, best - DEPTH_MM) if best < wanted else max(wanted, min(enough, worth_less(best)))
        first += count
        while count < whole and first % (2 * count) == 0:
            count *= 2
    return proven, best, doubt and best >= wanted


@njit
def _gap(x, low, high):
    return max(low - x, x - high, 0.0)


@njit
def _cut(g, a, rc, row, is_rapid, touch, stock, heights, rapids, events, count, spare):
    """Lowers nodes and bounds by one piece; gives the events (grown when full) and their number."""
    _, bounds, _, tiles, xs, ys = stock
    radius, low = a + rc, min(g[Z0], g[Z1])
    i0, i1 = _cells(min(g[X0], g[X1]) - radius, max(g[X0], g[X1]) + radius, xs)
    j0, j1 = _cells(min(g[Y0], g[Y1]) - radius, max(g[Y0], g[Y1]) + radius, ys)
    if i0 == i1 or j0 == j1:
        return events, count
    for tj in range(j0 // TILE, (j1 - 1) // TILE + 1):
        for ti in range(i0 // TILE, (i1 - 1) // TILE + 1):
            if tiles[tj, ti] > low and tiles[tj, ti] > low + _rise(g, a, rc, tj, ti, bounds.shape, xs, ys) - NOISE_MM:
                events, count, tiles[tj, ti] = _cut_tile(tj, ti, g, a, rc, row, is_rapid, touch, stock, heights, rapids,
                                                         events, count, spare)
    return events, count


@njit
def _rise(g, a, rc, tj, ti, cells, xs, ys):
    """How far above its tip a piece's cutter is at least, over all of a tile; inf: it does not come there."""
    dx = max(xs[ti * TILE] - max(g[X0], g[X1]), min(g[X0], g[X1]) - xs[min((ti + 1) * TILE, cells[1])], 0.0)
    dy = max(ys[tj * TILE] - max(g[Y0], g[Y1]), min(g[Y0], g[Y1]) - ys[min((tj + 1) * TILE, cells[0])], 0.0)
    beside = math.sqrt(dx * dx + dy * dy) - a
    if beside <= 0.0:
        return 0.0
    return rc - math.sqrt(rc * rc - beside * beside) if beside < rc else math.inf


@njit
def _cut_tile(tj, ti, g, a, rc, row, is_rapid, touch, stock, heights, rapids, events, count, spare):
    """`_cut` within one tile, and its highest bound then; nodes on its far sides belong to the tiles there."""
    z, bounds, _, tiles, xs, ys = stock
    j0, j1 = tj * TILE, min((tj + 1) * TILE, len(bounds))
    i0, i1 = ti * TILE, min((ti + 1) * TILE, bounds.shape[1])
    low, more, top = min(g[Z0], g[Z1]), bulge(g), tiles[tj, ti]
    thin_rc = max(rc - touch, 0.0)
    thin_a = a - (touch - (rc - thin_rc))
    mx, my = 0.5 * (g[X0] + g[X1]), 0.5 * (g[Y0] + g[Y1])
    reach = a + rc + NOISE_MM + 0.5 * math.sqrt((g[X1] - g[X0]) * (g[X1] - g[X0]) + (g[Y1] - g[Y0]) * (g[Y1] - g[Y0]))
    if _gap(mx, xs[i0], xs[i1]) ** 2 + _gap(my, ys[j0], ys[j1]) ** 2 > reach * reach:
        return events, count, top
    for j in range(j0, j1 + 1):
        now, before = heights[j % 2], heights[(j + 1) % 2]
        for i in range(i0, i1 + 1):
            h = math.inf
            if (xs[i] - mx) * (xs[i] - mx) + (ys[j] - my) * (ys[j] - my) <= reach * reach:
                h = piece_height(xs[i], ys[j], g, a, rc)
            now[i - i0] = h
            if j > j0 and i > i0:
                k = i - i0
                highest = max(max(h, now[k - 1]), max(before[k], before[k - 1])) + more
                if g[FORM] == LEVEL_ARC and highest < bounds[j - 1, i - 1]:
                    hx, hy = 0.5 * (xs[i] - xs[i - 1]), 0.5 * (ys[j] - ys[j - 1])
                    highest = level_cover(xs[i] - hx, ys[j] - hy, hx, hy, g, a, rc, spare)
                bounds[j - 1, i - 1] = min(bounds[j - 1, i - 1], max(highest, low))
            is_own = (i < i1 or i1 == bounds.shape[1]) and (j < j1 or j1 == len(bounds))
            if not is_own or i >= z.shape[1] or j >= len(z) or h >= z[j, i] - NOISE_MM:
                continue
            if is_rapid:
                lifted = g.copy()
                for k in (2, 5, 8):
                    lifted[k] += touch
                if piece_height(xs[i], ys[j], lifted, thin_a, thin_rc) < z[j, i]:
                    _keep_worst(rapids, row, z[j, i] - h, xs[i], ys[j], h)
            z[j, i] = h
            if count == len(events[HEIGHT]):
                events = _with_room(events, count)
            events[ROW][count], events[CELL][count], events[HEIGHT][count] = row, j * z.shape[1] + i, h
            count += 1
    return events, count, _tile_top(bounds, tj, ti)


@njit
def _with_room(events, count):
    """The same events in arrays of more than twice the length."""
    room = 2 * count + 1024
    rows, cells, heights = np.empty(room, np.int32), np.empty(room, np.int32), np.empty(room)
    put(rows, events[ROW][:count])
    put(cells, events[CELL][:count])
    put(heights, events[HEIGHT][:count])
    return rows, cells, heights


@njit
def _stretch_end(first, geometry, cutter, is_rapid, length):
    """The piece behind a stretch of pieces of one cutter at the feed, about so long; one rapid is a stretch."""
    p, way = first + 1, 0.0
    while p < len(geometry) and cutter[p] == cutter[first] and not is_rapid[p] and not is_rapid[first]:
        g = geometry[p - 1]
        way += math.sqrt((g[X1] - g[X0]) ** 2 + (g[Y1] - g[Y0]) ** 2 + (g[Z1] - g[Z0]) ** 2)
        if way >= length:
            break
        p += 1
    return p


@njit
def _meet_uncut(first, end, part, geometry, row, stock, highest, past, doubtful, room, spot, uncut):
    """What a neck meets above the flutes, that stood before a stretch of pieces.

    A height field is cut from above, flutes cut no higher than they are long: piece by piece a neck no wider than they are would
    never meet what their shadow has taken from the map before it.  No flute of the stretch comes above those of its highest
    piece.
    """
    _, _, ways, _, _ = room
    line, above, top = ways[FIRST], part.copy(), -math.inf
    for p in range(first, end):
        top = max(top, max(geometry[p, Z0], geometry[p, Z1]))
    for p in range(first, end):
        chord(geometry[p], line)
        above[BOTTOM] = part[BOTTOM] + top - min(line[Z0], line[Z1])
        enough = min(-RUBBING_MM, beyond(0.0, uncut[row[p], AMOUNT]))
        _, got, _ = _on_its_ways(geometry[p], above, -RUBBING_MM, enough, 0.0, first, stock, highest, past, doubtful, room, spot,
                                 SEEN_BUDGET)
        if got < -RUBBING_MM:
            _keep_worst(uncut, row[p], -got, spot[X], spot[Y], spot[Z])


@njit
def run(geometry, row, cutter, is_rapid, cutters, parts, kinds, wanted, touch, low_mm, boxes, z, bounds, sure, lines,
        past, worst, least, events):
    """Replays all pieces in order.

    Args:
        geometry, row, cutter, is_rapid: (m, ...) pieces, their rows, which cutter, whether rapid.
        cutters: (t, 2) a, rc.   parts: (c, 5) segments without upper end, see clearance_kernels.
        kinds: (c, 2) cutter of each part, and RAPID (the flutes, thinner by what they may touch), SHANK, HOLDER or UNCUT.
        wanted: (3,) distance to the stock that each kind is to keep.   touch: what may be missing of it, mm.
        low_mm: height that rapids keep above the stock.
        boxes: (f, 6) fixtures.   z: (ny, nx), lowered in place.
        bounds, sure: heights that the stock of each cell does not exceed, lowered in place, and reaches at first.
        lines: x of the grid's lines, and y: the nodes' and the stock's far sides.
        past: (forest, orders, firsts) of all pieces, see replay_stock.
        worst: (5, rows, 4) of rapid, shank, holder, fixture and rapid too low, takes amount (-inf: none), x, y, z.
        least: (5,) takes the least distance of a holder proven, attained, and its place.
        events: row (int32), cell (int32), height, each (b,): those before the first move.
    Returns:
        events of the same form, each (e,), those before the first; rows (rows,) where a contact between the nodes is not excluded.
    """
    xs, ys = lines
    tiles = np.empty(((len(bounds) + TILE - 1) // TILE, (bounds.shape[1] + TILE - 1) // TILE))
    stock = z, bounds, sure, tiles, xs, ys
    doubtful, space = np.empty(bounds.size, np.int64), search_space()
    (_, _, spare), _ = space
    room = space, chord_room(), np.empty((MOST_WAYS, 12)), np.empty(5), np.empty(3)
    for tj in range(len(tiles)):
        for ti in range(tiles.shape[1]):
            tiles[tj, ti] = _tile_top(bounds, tj, ti)
    spot, heights = np.empty(3), np.empty((2, TILE + 1))
    unsure = np.zeros(worst.shape[1], np.bool_)
    count, line, highest, low, seen = len(events[HEIGHT]), np.empty(12), math.inf, np.empty(12), 0
    uncut = np.full(worst.shape[1:], -math.inf)
    for p in range(len(geometry)):
        if p % REFRESH == 0:
            highest = tiles.max()
        a, rc = cutters[cutter[p], FLAT_RADIUS], cutters[cutter[p], CORNER_RADIUS]
        if p == seen:
            seen = _stretch_end(p, geometry, cutter, is_rapid, STRETCH_SHARE * (a + rc))
            for c in range(len(parts)):
                if kinds[c, KIND] == UNCUT and kinds[c, CUTTER] == cutter[p] and not is_rapid[p]:
                    _meet_uncut(p, seen, parts[c], geometry, row, stock, highest, past, doubtful, room, spot, uncut)
        chord(geometry[p], line)
        for c in range(len(parts)):
            if kinds[c, CUTTER] != cutter[p]:
                continue
            part, kind = parts[c], kinds[c, KIND]
            for f in range(len(boxes)):
                depth = _depth_in_box(geometry[p], part, boxes[f], touch, room)
                if kind == RAPID:                # thinner than the flutes by the touch, all round
                    depth += touch
                _keep_worst(worst[FIXTURE], row[p], depth, line[X1], line[Y1], boxes[f, HIGH_Z])
            if kind == RAPID and not is_rapid[p]:
                continue
            if kind == UNCUT:
                continue
            may_rub = kind == SHANK and wanted[kind] == 0.0
            limit = wanted[kind] - (0.0 if kind == RAPID else (RUBBING_MM if may_rub else touch))
            enough = max(limit, worth_less(least[ATTAINED])) if kind == HOLDER else limit
            if kind != RAPID and worst[kind, row[p], AMOUNT] > 0.0:     # this move touches already: how much deeper?
                enough = min(enough, beyond(wanted[kind], worst[kind, row[p], AMOUNT]))
            near = NEAR_SHARE * LEAST_MM if kind == HOLDER else 0.0
            proven, got, in_doubt = _on_its_ways(geometry[p], part, limit, enough, near, p, stock, highest, past, doubtful, room,
                                                 spot, SEEN_BUDGET if unsure[row[p]] else BUDGET)
            if kind == HOLDER:
                least[PROVEN] = min(least[PROVEN], proven)
                if got < least[ATTAINED]:
                    least[ATTAINED] = got
                    put(least[2:], spot)
            unsure[row[p]] |= in_doubt
            if got < limit:
                amount = wanted[kind] - got
                if kind == RAPID:
                    amount = spot[Z] - piece_height(spot[X], spot[Y], geometry[p], a, rc)
                _keep_worst(worst[kind], row[p], amount, spot[X], spot[Y], spot[Z])
            elif kind == RAPID and low_mm > 0.0:
                lowered(line, low_mm, low)
                _, got, _ = _against_stock(low, part, -touch, -touch, p, stock, highest, past, doubtful, space, spot,
                                           SEEN_BUDGET)
                if got < -touch:
                    _keep_worst(worst[LOW], row[p], spot[Z] - piece_height(spot[X], spot[Y], low, a, rc), spot[X],
                                spot[Y], spot[Z])
        events, count = _cut(geometry[p], a, rc, row[p], is_rapid[p], touch, stock, heights, worst[RAPID], events,
                             count, spare)
    for r in range(len(uncut)):
        if uncut[r, AMOUNT] > max(worst[SHANK, r, AMOUNT], 0.0):
            put(worst[SHANK, r], uncut[r])
    return (events[ROW][:count], events[CELL][:count], events[HEIGHT][:count]), unsure
