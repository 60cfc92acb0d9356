"""What can still stand between the nodes of the replay's z-map: bounds over whole cells, and their refinement.

Over a rectangle a straight piece leaves no more than at its highest corner: the height it leaves is convex in (x, y).
A cell's bound is the lowest such value of any piece so far.  Where it does not clear what moves above, the cell is
quartered; each part asks all earlier pieces for the one that took away most of it, and for the exact height in its
middle, which shows a contact if there is one.
"""

import math

import numpy as np

from cuspline.replay.clearance_kernels import swept_distance
from cuspline.stock.height_kernels import piece_height
from cuspline.values.compiled import njit

CELL_MM = 0.0005          # parts of cells are not quartered below it, half of what a shank may rub: a thinner fin can
                          # stay unseen, and is counted
CLEAR_CELL_MM = 0.02      # the same where only the least clearance is looked for
DEPTH_MM = 0.02           # how much deeper than the depth found a contact can be, while the budget lasts
DEEP_MM = 0.1             # a contact deeper than this is wrong, whatever the rest: it is told within SHARE of its depth
SHARE = 0.03
LEAST_MM = 0.01           # how far the proven least clearance can lie below one that is attained
LEAF = 4                  # pieces in a leaf of the trees of earlier pieces
DEPTH = 128               # more than twice the depth of any tree
CLOSE_MM = 1e-9
STRETCH_MM = 0.001        # of a way in what was swept: no shorter ones are looked at
END = 1e-9                # share of a piece within which a tip stands at its end
BUDGET = 4000             # parts of cells looked at for one piece; what is left then counts as undecided
SEEN_BUDGET = 200         # the same where a node shows a contact and its depth is looked for, or the move is undecided


@njit
def beyond(wanted, missing):
    """Distance below which a contact says more than one of which so much is missing (below 0: none) has said."""
    return wanted - max(missing, 0.0) * (1.0 + SHARE if missing > DEEP_MM else 1.0)


@njit
def bulge(g):
    """How much higher inside a cell than at its corners an arc above its centre can leave the stock; 0 for others."""
    if g[11] == 0.0 or g[10] < 0.0:
        return 0.0
    dx, dy, dz = g[3] - g[0], g[4] - g[1], g[5] - g[2]
    return g[9] - math.sqrt(max(g[9] * g[9] - 0.25 * (dx * dx + dy * dy + dz * dz), 0.0))


@njit
def node_height(x, y, node, a, rc):
    """No piece under a node (xl, xh, yl, yh and height of its lowest tip) leaves less over (x, y)."""
    ex, ey = max(node[0] - x, x - node[1], 0.0), max(node[2] - y, y - node[3], 0.0)
    d = math.sqrt(ex * ex + ey * ey)
    if d > a + rc:
        return math.inf
    beyond = max(d - a, 0.0)
    return node[4] + rc - math.sqrt(max(rc * rc - beyond * beyond, 0.0))


@njit
def _standing(x, y, g):
    """Tip on an arc above its centre that stands still where the arc is lowest over (x, y), to first order."""
    k = int(g[6])
    u = min(max(x if k == 0 else y, g[k]), g[3 + k])
    z = g[8] + math.sqrt(max(g[9] * g[9] - (u - g[7]) * (u - g[7]), 0.0))
    return (u, g[1], z) if k == 0 else (g[0], u, z)


@njit
def _covered(x, y, hx, hy, g, a, rc, spare):
    """No point of the rectangle keeps more height than this after the piece; inf: not all of it is passed over."""
    if g[11] != 0.0 and g[10] > 0.0:
        spare[:] = 0.0
        spare[0], spare[1], spare[2] = _standing(x, y, g)
        spare[3], spare[4], spare[5] = spare[0], spare[1], spare[2]
        g = spare
    return max(max(piece_height(x - hx, y - hy, g, a, rc), piece_height(x + hx, y - hy, g, a, rc)),
               max(piece_height(x - hx, y + hy, g, a, rc), piece_height(x + hx, y + hy, g, a, rc)))


@njit
def part_distance(x, y, hx, hy, top, line, part):
    """(lower bound, attained) distance of a moving upright part to a rectangle of stock of one height."""
    bound, _, _, _, got = swept_distance(x - line[0], y - line[1], top - line[2], part, line[3] - line[0],
                                         line[4] - line[1], line[5] - line[2], hx, hy, CLOSE_MM)
    return bound, got


@njit
def earlier_cover(x, y, hx, hy, bound, before, line, part, enough, forest, orders, firsts, work):
    """What earlier pieces leave over a rectangle.

    Args:
        bound: known upper bound over the rectangle, at most the stock's top.
        before: only pieces with a smaller order count.   enough: distance at which the search may end.
        orders, firsts: order of each piece, and the least under each node.
    Returns:
        (upper bound, exact height in the middle unless it ended early, whether it ended early).
    """
    geometry, nodes, trees, tools = forest
    stack, bounds, spare = work
    height = bound                           # if no piece leaves less, the bound is what is left
    for k in range(len(trees)):
        node0, piece0, count, leaves = trees[k, 0], trees[k, 1], trees[k, 2], trees[k, 3]
        a, rc = tools[k, 0], tools[k, 1]
        waiting, stack[0], bounds[0] = 1, 0, -math.inf
        while waiting > 0:
            waiting -= 1
            if bounds[waiting] >= bound:
                continue
            node = stack[waiting]
            if node >= leaves - 1:
                t0 = (node - leaves + 1) * LEAF
                for t in range(piece0 + t0, piece0 + min(t0 + LEAF, count)):
                    if orders[t] >= before:
                        continue
                    middle = piece_height(x, y, geometry[t], a, rc)
                    height = min(height, middle)
                    if middle >= bound:
                        continue
                    cover = _covered(x, y, hx, hy, geometry[t], a, rc, spare)
                    if cover < bound:
                        bound = cover
                        if part_distance(x, y, hx, hy, bound, line, part)[0] >= enough:
                            return bound, height, True
                continue
            left = 2 * node + 1
            b0 = b1 = math.inf
            if firsts[node0 + left] < before:
                b0 = node_height(x, y, nodes[node0 + left], a, rc)
            if firsts[node0 + left + 1] < before:
                b1 = node_height(x, y, nodes[node0 + left + 1], a, rc)
            near, far = (left, left + 1) if b0 <= b1 else (left + 1, left)
            stack[waiting], bounds[waiting] = far, max(b0, b1)
            stack[waiting + 1], bounds[waiting + 1] = near, min(b0, b1)
            waiting += 2
    return bound, height, False


@njit
def _holds(x, y, z, room, g, rc, is_upright):
    """Whether a column from a point upward, its radius less by `room`, lies in what one piece swept (sufficient)."""
    dx, dy = g[3] - g[0], g[4] - g[1]
    square, t = dx * dx + dy * dy, 0.0
    low = min(g[2], g[5])
    if square > 1e-18:
        t = min(max(((x - g[0]) * dx + (y - g[1]) * dy) / square, 0.0), 1.0)
        low = g[2] + t * (g[5] - g[2])
    ex, ey = x - g[0] - t * dx, y - g[1] - t * dy
    if not is_upright or END < t < 1.0 - END:       # the ends of an arc are exact, the chord between them is not
        low += bulge(g)
    return ex * ex + ey * ey <= room * room and z >= low + rc - CLOSE_MM


@njit
def _is_in_one(way, radius, before, forest, orders, firsts, stack):
    """Whether a column of this radius stays in what ONE earlier piece has swept, on a way of (6,) x y z x y z.

    Over a line or a hanging arc that is convex, so both ends of the way decide; under an arc above its centre lies
    its chord, lifted.
    """
    geometry, nodes, trees, tools = forest
    is_upright = way[0] == way[3] and way[1] == way[4]
    for k in range(len(trees)):
        node0, piece0, count, leaves = trees[k, 0], trees[k, 1], trees[k, 2], trees[k, 3]
        rc = tools[k, 1]
        room = tools[k, 0] + rc - radius
        if room < 0.0:
            continue
        waiting, stack[0] = 1, 0
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            row = nodes[node0 + node]
            if (firsts[node0 + node] >= before or row[4] + rc > min(way[2], way[5]) + CLOSE_MM
                    or row[0] - room > min(way[0], way[3]) or row[1] + room < max(way[0], way[3])
                    or row[2] - room > min(way[1], way[4]) or row[3] + room < max(way[1], way[4])):
                continue
            if node < leaves - 1:
                stack[waiting], stack[waiting + 1] = 2 * node + 1, 2 * node + 2
                waiting += 2
                continue
            t0 = (node - leaves + 1) * LEAF
            for t in range(piece0 + t0, piece0 + min(t0 + LEAF, count)):
                g = geometry[t]
                if (orders[t] < before and _holds(way[0], way[1], way[2], room, g, rc, is_upright)
                        and _holds(way[3], way[4], way[5], room, g, rc, is_upright)):
                    return True
    return False


@njit
def runs_in_swept(line, part, wanted, before, forest, orders, firsts, space):
    """Whether a part keeps its distance because every stretch of its way lies in what one earlier piece has swept.

    A way retraced over other corner points is halved at these: down to STRETCH_MM, where what may be missing of the
    distance (a shank rubs) bridges them.
    """
    stack, spans = space[0][0], space[1]
    radius, up = max(part[1], part[3]) + part[4] + wanted, part[0] - wanted
    way, spans[0, 0], spans[0, 1], waiting = np.empty(6), 0.0, 1.0, 1
    length = math.sqrt((line[3] - line[0]) ** 2 + (line[4] - line[1]) ** 2 + (line[5] - line[2]) ** 2)
    while waiting > 0:
        waiting -= 1
        first, last = spans[waiting, 0], spans[waiting, 1]
        for k in range(3):
            lift = up if k == 2 else 0.0
            way[k] = line[k] + first * (line[3 + k] - line[k]) + lift
            way[3 + k] = line[k] + last * (line[3 + k] - line[k]) + lift
        if _is_in_one(way, radius, before, forest, orders, firsts, stack):
            continue
        if (last - first) * length <= STRETCH_MM:
            return False
        middle = 0.5 * (first + last)
        spans[waiting, 0], spans[waiting, 1] = middle, last
        spans[waiting + 1, 0], spans[waiting + 1, 1] = first, middle
        waiting += 2
    return True


@njit
def search_space():
    """Scratch arrays of the searches: over pieces, and over parts of cells."""
    return (np.empty(DEPTH, np.int64), np.empty(DEPTH), np.zeros(12)), np.empty((256, 5))


@njit
def refine(x, y, hx, hy, bound, sure, before, line, part, wanted, enough, forest, orders, firsts, space, spot, budget):
    """Quarters one cell until it is cleared, shows a contact, or is smaller than CELL_MM.

    Args:
        sure: height that the stock had everywhere here before the first move.
        wanted: distance below which there is a contact.   enough: distance beyond which nothing matters, >= wanted.
        spot: (3,) takes the place of the least distance attained.
    Returns:
        (proven lower bound, least attained distance or inf, whether something below `wanted` stays possible
        though none was found, budget left).
    """
    work, cells = space
    least, proven, doubt, waiting = math.inf, math.inf, False, 1
    cells[0, 0], cells[0, 1], cells[0, 2], cells[0, 3], cells[0, 4] = x, y, hx, hy, bound
    while waiting > 0:
        waiting -= 1
        x, y, hx, hy, bound = cells[waiting]
        lower, _ = part_distance(x, y, hx, hy, bound, line, part)
        if lower >= enough:
            proven = min(proven, lower)
            continue
        if budget <= 0:
            proven, doubt = min(proven, lower), doubt or lower < wanted
            continue
        budget -= 1
        bound, height, early = earlier_cover(x, y, hx, hy, bound, before, line, part, enough, forest, orders, firsts,
                                             work)
        lower, _ = part_distance(x, y, hx, hy, bound, line, part)
        if early or lower >= enough:
            proven = min(proven, lower)
            continue
        height = min(height, sure)
        _, got = part_distance(x, y, 0.0, 0.0, height, line, part)
        if got < least:
            least = got
            spot[0], spot[1], spot[2] = x, y, height
            enough = min(enough, max(got - LEAST_MM, wanted) if got >= wanted else got - DEPTH_MM)
        if lower >= enough:
            proven = min(proven, lower)
        elif 2.0 * max(hx, hy) <= (CELL_MM if lower < wanted else CLEAR_CELL_MM):
            proven, doubt = min(proven, lower), doubt or lower < wanted
        else:
            nx, ny = (2, 1) if hx > 1.5 * hy else ((1, 2) if hy > 1.5 * hx else (2, 2))
            for j in range(ny):
                for i in range(nx):
                    part_of = cells[waiting]
                    part_of[0], part_of[2] = x + (2 * i - nx + 1) * hx / nx, hx / nx
                    part_of[1], part_of[3] = y + (2 * j - ny + 1) * hy / ny, hy / ny
                    part_of[4] = bound
                    waiting += 1
    return proven, least, doubt and least >= wanted, budget
