"""What can still stand between the nodes of the replay's z-map: bounds over whole cells, and their refinement.

Over a rectangle a straight piece leaves no more than at its highest corner: the height it leaves is convex in (x, y).
A cell's bound is the lowest such value of any piece so far.  Where it does not clear what moves above, the cell is
quartered; each part asks all earlier pieces for the one that took away most of it, and for the exact height in its
middle, which shows a contact if there is one.
"""

import math

import numpy as np

from cuspline.replay.clearance_kernels import BOTTOM, BOTTOM_RADIUS, GROW, TOP_RADIUS, swept_distance
from cuspline.stock.height_kernels import piece_height
from cuspline.stock.level_arcs import level_cover, line_beside
from cuspline.stock.path_pieces import ARC, CENTER_U, CENTER_V, FORM, IN_YZ, LEVEL_ARC, RADIUS, SIDE, X0, X1, Y0, Y1, Z0, Z1
from cuspline.stock.tree import CORNER_RADIUS, FLAT_RADIUS
from cuspline.values.compiled import njit
from cuspline.values.rows import FROM, TO, X_HIGH, X_LOW, Y_HIGH, Y_LOW, X, Y, Z

FIRST_NODE, FIRST_PIECE, PIECES, LEAVES = range(4)              # columns of trees
LOWEST = 4                                                      # of a node, behind its rectangle: its lowest tip
CELL_X, CELL_Y, CELL_HALF_X, CELL_HALF_Y, CELL_TOP = range(5)   # of a part of a cell
AMOUNT, AT_X, AT_Y, AT_Z = range(4)                             # of the worst contacts
CELL_MM = 0.0005          # parts of cells are not quartered below it, half of what a shank may rub: a thinner fin can
                          # stay unseen, and is counted
CLEAR_CELL_MM = 0.02      # the same where only the least clearance is looked for
DEPTH_MM = 0.02           # how much deeper than the depth found a contact can be, while the budget lasts
DEEP_MM = 0.1             # a contact deeper than this is wrong, whatever the rest: it is told within SHARE of its depth
SHARE = 0.03
LEAST_MM = 0.01           # how far the proven least clearance can lie below one that is attained,
LEAST_SHARE = 0.01        # or this share of it: of a clearance of many millimetres nobody asks for hundredths
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
def worth_less(attained):
    """Clearance below which a holder says more than one attained has said."""
    return min(attained - LEAST_MM, attained * (1.0 - LEAST_SHARE))


@njit
def bulge(g):
    """How much higher inside a cell than at its corners an arc above its centre can leave the stock; 0 for others."""
    if g[FORM] != ARC or g[SIDE] < 0.0:
        return 0.0
    dx, dy, dz = g[X1] - g[X0], g[Y1] - g[Y0], g[Z1] - g[Z0]
    return g[RADIUS] - math.sqrt(max(g[RADIUS] * g[RADIUS] - 0.25 * (dx * dx + dy * dy + dz * dz), 0.0))


@njit
def node_height(x, y, node, a, rc):
    """No piece under a node (xl, xh, yl, yh and height of its lowest tip) leaves less over (x, y)."""
    ex, ey = max(node[X_LOW] - x, x - node[X_HIGH], 0.0), max(node[Y_LOW] - y, y - node[Y_HIGH], 0.0)
    d = math.sqrt(ex * ex + ey * ey)
    if d > a + rc:
        return math.inf
    beyond = max(d - a, 0.0)
    return node[LOWEST] + rc - math.sqrt(max(rc * rc - beyond * beyond, 0.0))


@njit
def _standing(x, y, g):
    """Tip on an arc above its centre that stands still where the arc is lowest over (x, y), to first order."""
    k = int(g[IN_YZ])
    u = min(max(x if k == 0 else y, g[k]), g[X1 + k])
    z = g[CENTER_V] + math.sqrt(max(g[RADIUS] * g[RADIUS] - (u - g[CENTER_U]) * (u - g[CENTER_U]), 0.0))
    return (u, g[Y0], z) if k == 0 else (g[X0], u, z)


@njit
def _covered(x, y, hx, hy, g, a, rc, spare):
    """No point of the rectangle keeps more height than this after the piece; inf: not all of it is passed over."""
    if g[FORM] == LEVEL_ARC:
        return level_cover(x, y, hx, hy, g, a, rc, spare)
    if g[FORM] == ARC and g[SIDE] > 0.0:
        spare[:] = 0.0
        spare[X0], spare[Y0], spare[Z0] = _standing(x, y, g)
        spare[X1], spare[Y1], spare[Z1] = spare[X0], spare[Y0], spare[Z0]
        g = spare
    return max(max(piece_height(x - hx, y - hy, g, a, rc), piece_height(x + hx, y - hy, g, a, rc)),
               max(piece_height(x - hx, y + hy, g, a, rc), piece_height(x + hx, y + hy, g, a, rc)))


@njit
def part_distance(x, y, hx, hy, top, line, part):
    """(lower bound, attained) distance of a moving upright part to a rectangle of stock of one height."""
    bound, _, _, _, got = swept_distance(x - line[X0], y - line[Y0], top - line[Z0], part, line[X1] - line[X0],
                                         line[Y1] - line[Y0], line[Z1] - line[Z0], hx, hy, CLOSE_MM)
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
        node0, piece0, count, leaves = trees[k, FIRST_NODE], trees[k, FIRST_PIECE], trees[k, PIECES], trees[k, LEAVES]
        a, rc = tools[k, FLAT_RADIUS], tools[k, CORNER_RADIUS]
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
    dx, dy = g[X1] - g[X0], g[Y1] - g[Y0]
    square, t = dx * dx + dy * dy, 0.0
    low = min(g[Z0], g[Z1])
    if square > 1e-18:
        t = min(max(((x - g[X0]) * dx + (y - g[Y0]) * dy) / square, 0.0), 1.0)
        low = g[Z0] + t * (g[Z1] - g[Z0])
    ex, ey = x - g[X0] - t * dx, y - g[Y0] - t * dy
    if not is_upright or END < t < 1.0 - END:       # the ends of an arc are exact, the chord between them is not
        low += bulge(g)
    return ex * ex + ey * ey <= room * room and z >= low + rc - CLOSE_MM


@njit
def _is_in_one(way, radius, before, forest, orders, firsts, work):
    """Whether a column of this radius stays in what ONE earlier piece has swept, on a way of (6,) x y z x y z.

    Over a line or a hanging arc that is convex, so both ends of the way decide; under an arc above its centre lies
    its chord, lifted; for a level arc stands a line beside it.
    """
    geometry, nodes, trees, tools = forest
    stack, _, spare = work
    x, y = 0.5 * (way[X0] + way[X1]), 0.5 * (way[Y0] + way[Y1])
    reach = 0.5 * math.sqrt((way[X1] - way[X0]) ** 2 + (way[Y1] - way[Y0]) ** 2)
    is_upright = way[X0] == way[X1] and way[Y0] == way[Y1]
    for k in range(len(trees)):
        node0, piece0, count, leaves = trees[k, FIRST_NODE], trees[k, FIRST_PIECE], trees[k, PIECES], trees[k, LEAVES]
        rc = tools[k, CORNER_RADIUS]
        room = tools[k, FLAT_RADIUS] + rc - radius
        if room < 0.0:
            continue
        waiting, stack[0] = 1, 0
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            row = nodes[node0 + node]
            if (firsts[node0 + node] >= before or row[LOWEST] + rc > min(way[Z0], way[Z1]) + CLOSE_MM
                    or row[X_LOW] - room > min(way[X0], way[X1]) or row[X_HIGH] + room < max(way[X0], way[X1])
                    or row[Y_LOW] - room > min(way[Y0], way[Y1]) or row[Y_HIGH] + room < max(way[Y0], way[Y1])):
                continue
            if node < leaves - 1:
                stack[waiting], stack[waiting + 1] = 2 * node + 1, 2 * node + 2
                waiting += 2
                continue
            t0 = (node - leaves + 1) * LEAF
            for t in range(piece0 + t0, piece0 + min(t0 + LEAF, count)):
                g, less = geometry[t], 0.0
                if orders[t] < before and g[FORM] == LEVEL_ARC:
                    less = line_beside(g, x, y, reach, spare)
                    g = spare
                if (orders[t] < before and room >= less and _holds(way[X0], way[Y0], way[Z0], room - less, g, rc, is_upright)
                        and _holds(way[X1], way[Y1], way[Z1], room - less, g, rc, is_upright)):
                    return True
    return False


@njit
def runs_in_swept(line, part, wanted, before, forest, orders, firsts, space):
    """Whether a part keeps its distance because every stretch of its way lies in what one earlier piece has swept.

    A way retraced over other corner points is halved at these: down to STRETCH_MM, where what may be missing of the
    distance (a shank rubs) bridges them.
    """
    work, spans = space
    radius, up = max(part[BOTTOM_RADIUS], part[TOP_RADIUS]) + part[GROW] + wanted, part[BOTTOM] - wanted
    way, spans[0, FROM], spans[0, TO], waiting = np.empty(6), 0.0, 1.0, 1
    length = math.sqrt((line[X1] - line[X0]) ** 2 + (line[Y1] - line[Y0]) ** 2 + (line[Z1] - line[Z0]) ** 2)
    while waiting > 0:
        waiting -= 1
        first, last = spans[waiting, FROM], spans[waiting, TO]
        for k in range(3):
            lift = up if k == 2 else 0.0
            way[k] = line[k] + first * (line[X1 + k] - line[k]) + lift
            way[X1 + k] = line[k] + last * (line[X1 + k] - line[k]) + lift
        if _is_in_one(way, radius, before, forest, orders, firsts, work):
            continue
        if (last - first) * length <= STRETCH_MM:
            return False
        middle = 0.5 * (first + last)
        spans[waiting, FROM], spans[waiting, TO] = middle, last
        spans[waiting + 1, FROM], spans[waiting + 1, TO] = first, middle
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
    cells[0, CELL_X], cells[0, CELL_Y], cells[0, CELL_HALF_X], cells[0, CELL_HALF_Y] = x, y, hx, hy
    cells[0, CELL_TOP] = bound
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
            spot[X], spot[Y], spot[Z] = x, y, height
            enough = min(enough, max(worth_less(got), wanted) if got >= wanted else got - DEPTH_MM)
        if lower >= enough:
            proven = min(proven, lower)
        elif 2.0 * max(hx, hy) <= (CELL_MM if lower < wanted else CLEAR_CELL_MM):
            proven, doubt = min(proven, lower), doubt or lower < wanted
        else:
            nx, ny = (2, 1) if hx > 1.5 * hy else ((1, 2) if hy > 1.5 * hx else (2, 2))
            for j in range(ny):
                for i in range(nx):
                    part_of = cells[waiting]
                    part_of[CELL_X], part_of[CELL_HALF_X] = x + (2 * i - nx + 1) * hx / nx, hx / nx
                    part_of[CELL_Y], part_of[CELL_HALF_Y] = y + (2 * j - ny + 1) * hy / ny, hy / ny
                    part_of[CELL_TOP] = bound
                    waiting += 1
    return proven, least, doubt and least >= wanted, budget
