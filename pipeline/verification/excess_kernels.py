"""Cells of a face, moved out by a height, proven to lie in what was cut, or halved: see excess_proof.py.

A piece of path sweeps a convex volume; of an arc that bulges upward its tangent is taken, which sweeps less; for a level
one stands a line beside it, and what it may be off, sideways only, is taken from the cutter's flat radius.  A sub-step
of any convex cutter whose axis keeps its direction sweeps a convex volume too (stock/outlines.py); both kinds come in one
world (stock/rays.py).
Signed distance to a convex volume is convex: over a parallelogram it is largest in a corner, and so is every weighted
mean of several such distances.  What a cutter sweeps whose axis turns is convex but for a little, which is added in
the corners (`_bulge`).  A mean that is nowhere positive has no point outside all of the volumes:

      piece a   \\    / piece b        over a ridge the one distance rises as the other falls: their mean hardly
                 \\  /                 changes, and a cell may be as wide as its sagitta allows
       _ _ _ _ _ _\\/_ _ _ _ _ _  cell
                  ridge
"""

import math

import numpy as np

from cuspline.stock.distance_kernels import piece_distance
from cuspline.stock.level_arcs import line_beside
from cuspline.stock.path_pieces import CENTER_U, CENTER_V, FORM, IN_YZ, LEVEL_ARC, LINE, RADIUS, SIDE, X1, Z0, Z1
from cuspline.stock.rays import UPRIGHT_ARRAYS, nearest, scratch
from cuspline.stock.tilted_pieces import LENGTH, TIP, TURN, UNEVEN, WAY
from cuspline.stock.tilted_tree import one_distance
from cuspline.stock.tree import CORNER_RADIUS, FLAT_RADIUS, tree_of
from cuspline.surfaces.enclosures import S_HIGH, S_LOW, T_HIGH, T_LOW
from cuspline.surfaces.face_pieces import ACROSS, INSIDE, OUTSIDE, trim_state
from cuspline.surfaces.offset_pieces import MIDDLE, OFF_BY, SHIFT, SIDE_S, SIDE_T, offset_of_piece
from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, OF_FACE, U_HIGH, U_LOW, V_HIGH, V_LOW, U, V
from cuspline.surfaces.trims import is_inside
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z, put
from cuspline.values.threads import in_blocks

FLOOR_MM = 0.005          # cells no longer than this are not halved
ABOVE, FLOOR = 0, 1       # why a cell was given up: its middle is not cut away; it is as small as they get
REASON, ON_BORDER, AREA = range(4, 7)   # columns of a cell given up, behind its rectangle
COUNT, OLDEST, REMEMBERED = range(3)    # of the pieces remembered: how many, the place of the oldest, the first of them
ORIGIN = 3                              # row of a frame, below its rotation
NEAR = 12                 # pieces of path remembered from cell to cell
ROOM = 160                # cells given up in one root
ROOTS = 16                # a thread proves at a time
BEYOND = 1.5              # pieces are looked for this far out at corners
LIFT_MM = 1.0
THIN = 16.0               # sides of a cell: beyond this ratio the longer one is halved
DEEPEST = 48              # halvings
JUNG = 0.62               # of a set's width, that its points stray from their mean at most (sqrt(3/8))
STEEP = 0.05              # an arc whose tangent is steeper than 1 in this is taken for the one place that is nearest
GEOMETRY = 0              # of `world`, and of a forest in it: rows of the pieces
MORE = 12                 # of a line that stands for a piece, behind its own numbers: how far sideways the piece may be off, mm


@njit
def _straightened(g, rc, px, py, pz, reach, out):
    """A piece of path for which a distance is convex: the piece, a tangent of an arc that bulges upward, a line beside a level one.

    It serves for what lies within `reach` of the place, and farther away by more.
    """
    put(out, g)
    out[MORE] = 0.0
    if g[FORM] == LEVEL_ARC:
        out[MORE] = line_beside(g, px, py, reach, out)
        return
    if g[FORM] == LINE or g[SIDE] < 0.0:
        return
    k = int(g[IN_YZ])
    du, dv = (px if k == 0 else py) - g[CENTER_U], max(pz - rc - g[CENTER_V], 0.0)
    rho = math.sqrt(du * du + dv * dv)
    u = min(max(g[CENTER_U] + (du * g[RADIUS] / rho if rho > 0.0 else 0.0), g[k]), g[X1 + k])
    rise = math.sqrt(max(g[RADIUS] * g[RADIUS] - (u - g[CENTER_U]) * (u - g[CENTER_U]), 0.0))
    out[FORM] = LINE
    if rise < STEEP * g[RADIUS]:
        out[k], out[X1 + k] = u, u
        out[Z0], out[Z1] = g[CENTER_V] + rise, g[CENTER_V] + rise
        return
    slope = (g[CENTER_U] - u) / rise
    out[Z0], out[Z1] = g[CENTER_V] + rise + slope * (g[k] - u), g[CENTER_V] + rise + slope * (g[X1 + k] - u)


@njit
def _remembered(piece, near):
    """Put a piece among those remembered (count first, then the place of the oldest); False: it was there."""
    for i in range(near[COUNT]):
        if near[REMEMBERED + i] == piece:
            return False
    if near[COUNT] < NEAR:
        near[REMEMBERED + near[COUNT]] = piece
        near[COUNT] += 1
    else:
        near[REMEMBERED + near[OLDEST]] = piece
        near[OLDEST] = (near[OLDEST] + 1) % NEAR
    return True


@njit
def _convex_distance(x, y, z, piece, line, tool, world, search):
    """Convex distance to a piece: of the `line` that stands for it, or of the sub-step that it is."""
    behind = len(world[GEOMETRY])
    if piece < behind:
        return piece_distance(x, y, z, line, tool[FLAT_RADIUS] - line[MORE], tool[CORNER_RADIUS])
    return one_distance(x, y, z, piece - behind, world[UPRIGHT_ARRAYS:], math.inf, search[2])[0]


@njit
def _half_side(cell, side):
    return math.sqrt(cell[side + X] * cell[side + X] + cell[side + Y] * cell[side + Y] + cell[side + Z] * cell[side + Z])


@njit
def _bulge(g, first, last, width, away):
    r"""How far the distance to a sub-step whose axis turns may be above the mean of corners, found at shares first .. last of it.

    Seen from the tool, points y at turns d stand at Rot(-d) y.  Taken at the mean turn the mean point is where the mean of them
    is, but for sum(w d (y - mean y)), at most half the spread of d times JUNG the spread of y; for d²/2 |y|, d² at most a
    quarter of its spread squared; and for turns that do not run evenly.

    Args:
        g: (14,) the sub-step.   width: of the cell, mm.   away: of its farthest place from the tip.
    """
    turn, span = g[TURN], (last - first) * g[TURN]
    spread = width + (last - first) * g[LENGTH]
    return 0.5 * span * JUNG * spread + 0.125 * span * span * away + 2.0 * UNEVEN * (0.5 * turn) ** 3 * (1.0 + turn) * away


@njit
def _posed_corners(x, y, z, cell, piece, world, search, out):
    """Distances (4,) of a cell's corners to a sub-step, no mean of them below the distance within."""
    forest, first, last = world[UPRIGHT_ARRAYS:], math.inf, -math.inf
    for j in range(4):
        s, t = (1.0 if j & 1 else -1.0), (1.0 if j & 2 else -1.0)
        out[j], at = one_distance(x + s * cell[SIDE_S + X] + t * cell[SIDE_T + X], y + s * cell[SIDE_S + Y] + t * cell[SIDE_T + Y],
                                  z + s * cell[SIDE_S + Z] + t * cell[SIDE_T + Z], piece, forest, math.inf, search[2])
        first, last = min(first, at), max(last, at)
    g = forest[GEOMETRY][piece]
    if g[TURN] > 0.0:
        reach = _half_side(cell, SIDE_S) + _half_side(cell, SIDE_T)
        dx, dy, dz = x - g[TIP + X] - 0.5 * g[WAY + X], y - g[TIP + Y] - 0.5 * g[WAY + Y], z - g[TIP + Z] - 0.5 * g[WAY + Z]
        more = _bulge(g, first, last, 2.0 * reach, math.sqrt(dx * dx + dy * dy + dz * dz) + reach + 0.5 * g[LENGTH])
        for j in range(4):
            out[j] += more


@njit
def _made_convex(piece, x, y, z, reach, world, line):
    """Radii of the tool of an upright piece, and what stands for it near a place into line; zeros for others."""
    geometry, tools = world[GEOMETRY], world[3]
    if piece >= len(geometry):
        return np.zeros(2)
    tool = tools[tree_of(piece, world[2])]
    _straightened(geometry[piece], tool[CORNER_RADIUS], x, y, z, reach, line)
    return tool


@njit
def _corner_distances(cell, near, world, search, line, corners):
    """Distances of a cell's four corners to the pieces remembered that reach into it: (NEAR, 4) filled, how many."""
    reach, count = _half_side(cell, SIDE_S) + _half_side(cell, SIDE_T), 0
    x, y, z = cell[MIDDLE + X] + cell[SHIFT + X], cell[MIDDLE + Y] + cell[SHIFT + Y], cell[MIDDLE + Z] + cell[SHIFT + Z]
    for i in range(near[COUNT]):
        piece = near[REMEMBERED + i]
        tool = _made_convex(piece, x, y, z, reach, world, line)
        if _convex_distance(x, y, z, piece, line, tool, world, search) > reach:
            continue
        if piece >= len(world[GEOMETRY]):
            _posed_corners(x, y, z, cell, piece - len(world[GEOMETRY]), world, search, corners[count])
            count += 1
            continue
        for j in range(4):
            s, t = (1.0 if j & 1 else -1.0), (1.0 if j & 2 else -1.0)
            corners[count, j] = _convex_distance(x + s * cell[SIDE_S + X] + t * cell[SIDE_T + X],
                                                 y + s * cell[SIDE_S + Y] + t * cell[SIDE_T + Y],
                                                 z + s * cell[SIDE_S + Z] + t * cell[SIDE_T + Z], piece,
                                                 line, tool, world, search)
        count += 1
    return count


@njit
def _largest_of_mean(x, y, share):
    most = -math.inf
    for j in range(4):
        most = max(most, x[j] + share * (y[j] - x[j]))
    return most


@njit
def _least_of_means(x, y):
    """A number that the largest of no mean of x and y (4,) is below."""
    most = -math.inf
    for j in range(4):
        most = max(most, min(x[j], y[j]))
    return most


@njit
def _best_share(x, y):
    """Share of y in a mean of x and y (4,) that makes its largest number least: where two of its four lines meet."""
    best, least = 0.0, _largest_of_mean(x, y, 0.0)
    for i in range(4):
        for j in range(i):
            turn = (y[i] - x[i]) - (y[j] - x[j])
            if turn == 0.0:
                continue
            share = (x[j] - x[i]) / turn
            if 0.0 < share < 1.0:
                most = _largest_of_mean(x, y, share)
                if most < least:
                    best, least = share, most
    return best, least


@njit
def least_largest(corners, count, enough, mean):
    """Largest number of a good mean of rows (count, 4): single rows, pairs, then pairs with more rows mixed in.

    Args:
        enough: to stop at.   mean: (4,) filled.
    """
    least = math.inf
    for k in range(count):
        most = max(corners[k, 0], corners[k, 1], corners[k, 2], corners[k, 3])
        if most < least:
            least = most
            put(mean, corners[k])
    for i in range(count):
        for k in range(i):
            if least <= enough:
                return least
            if _least_of_means(corners[i], corners[k]) >= least:
                continue
            share, most = _best_share(corners[i], corners[k])
            if most < least:
                least = most
                for j in range(4):
                    mean[j] = corners[i, j] + share * (corners[k, j] - corners[i, j])
    for k in range(count):
        if least <= enough:
            return least
        if _least_of_means(mean, corners[k]) >= least:
            continue
        share, most = _best_share(mean, corners[k])
        if most < least:
            least = most
            for j in range(4):
                mean[j] += share * (corners[k, j] - mean[j])
    return least


@njit
def _into(frame, cell):
    """Middle, half sides and shift of a cell (12,) seen from a frame: rotation (3, 3) over origin (3,)."""
    x, y, z = (cell[MIDDLE + X] - frame[ORIGIN, X], cell[MIDDLE + Y] - frame[ORIGIN, Y],
               cell[MIDDLE + Z] - frame[ORIGIN, Z])
    for i in range(4):
        for k in range(3):
            cell[3 * i + k] = x * frame[X, k] + y * frame[Y, k] + z * frame[Z, k]
        if i < 3:
            x, y, z = cell[3 * i + 3], cell[3 * i + 4], cell[3 * i + 5]


@njit
def _searched(cell, world, near, search, corner):
    """Remember the piece nearest to a place by a cell (corner 0..3, middle 4); its distance, and whether it is new."""
    s, t = (BEYOND if corner & 1 else -BEYOND), (BEYOND if corner & 2 else -BEYOND)
    if corner == 4:
        s, t = 0.0, 0.0
    hint = near[REMEMBERED] if near[COUNT] > 0 else -1
    d, piece, _ = nearest(cell[MIDDLE + X] + s * cell[SIDE_S + X] + t * cell[SIDE_T + X],
                          cell[MIDDLE + Y] + s * cell[SIDE_S + Y] + t * cell[SIDE_T + Y],
                          cell[MIDDLE + Z] + s * cell[SIDE_S + Z] + t * cell[SIDE_T + Z], world, hint, search)
    return d, piece >= 0 and _remembered(piece, near)


@njit
def _is_cut(cell, near, world, search, line, corners, mean):
    """(a proof that the whole cell is cut away was found, distance of its middle if that is positive, else 0)."""
    enough = -cell[OFF_BY]
    count = _corner_distances(cell, near, world, search, line, corners)
    if least_largest(corners, count, enough, mean) <= enough:
        return True, 0.0
    d, more = _searched(cell, world, near, search, 4)
    if d > 0.0:
        return False, d
    for corner in range(4):
        more |= _searched(cell, world, near, search, corner)[1]
    if not more:
        return False, 0.0
    count = _corner_distances(cell, near, world, search, line, corners)
    return least_largest(corners, count, enough, mean) <= enough, 0.0


@njit
def _is_deep_in_one(cell, near, world, search, line, corners, mean):
    """Whether the cell is proven by the piece nearest to a place above it.

    All cutters with a flat bottom that stand over a cell are as near, those that end beside it, too; higher up they
    are not.
    """
    if not cell[OFF_BY] < math.inf:
        return False
    cell[MIDDLE + Z] += LIFT_MM
    more = _searched(cell, world, near, search, 4)[1]
    cell[MIDDLE + Z] -= LIFT_MM
    count = _corner_distances(cell, near, world, search, line, corners) if more else 0
    return count > 0 and least_largest(corners, count, -cell[OFF_BY], mean) <= -cell[OFF_BY]


@njit
def _state(trims, face, span, box, place):
    """Trim state of a cell; its middle's parameters into place (2,)."""
    u0, u1, v0, v1 = span[U_LOW], span[U_HIGH], span[V_LOW], span[V_HIGH]
    around = ((u0 + u1 + box[S_LOW] * (u1 - u0)) / 2, (u0 + u1 + box[S_HIGH] * (u1 - u0)) / 2,
              (v0 + v1 + box[T_LOW] * (v1 - v0)) / 2, (v0 + v1 + box[T_HIGH] * (v1 - v0)) / 2)
    place[U], place[V] = (around[S_LOW] + around[S_HIGH]) / 2, (around[T_LOW] + around[T_HIGH]) / 2
    return trim_state(trims, face, around)


@njit
def _sags(cell, near, world, search, line):
    """How far the distance to the nearest piece remembered sags below a straight line along each side of a cell."""
    x, y, z = cell[MIDDLE + X] + cell[SHIFT + X], cell[MIDDLE + Y] + cell[SHIFT + Y], cell[MIDDLE + Z] + cell[SHIFT + Z]
    best, least, reach = -1, math.inf, _half_side(cell, SIDE_S) + _half_side(cell, SIDE_T)
    for i in range(near[COUNT]):
        piece = near[REMEMBERED + i]
        tool = _made_convex(piece, x, y, z, reach, world, line)
        d = _convex_distance(x, y, z, piece, line, tool, world, search)
        if d < least:
            best, least = piece, d
    if best < 0:
        return 0.0, 0.0
    tool = _made_convex(best, x, y, z, reach, world, line)
    s = t = -least
    for end in (-1.0, 1.0):
        s += 0.5 * _convex_distance(x + end * cell[SIDE_S + X], y + end * cell[SIDE_S + Y],
                                    z + end * cell[SIDE_S + Z], best, line, tool, world, search)
        t += 0.5 * _convex_distance(x + end * cell[SIDE_T + X], y + end * cell[SIDE_T + Y],
                                    z + end * cell[SIDE_T + Z], best, line, tool, world, search)
    return s, t


@njit
def _cuts_second(cell, box, near, world, search, line):
    """Whether the second of a cell's sides is to be halved.

    The one along which the distance to the nearest piece sags more, across a pass; the longer one where the face itself is
    farther from flat, or that is thin already; in parameters where none has a length.
    """
    a, b = _half_side(cell, SIDE_S), _half_side(cell, SIDE_T)
    if a + b == 0.0:
        return box[T_HIGH] - box[T_LOW] > box[S_HIGH] - box[S_LOW]
    if cell[OFF_BY] < math.inf and max(a, b) < THIN * min(a, b):
        s, t = _sags(cell, near, world, search, line)
        if max(s, t) > cell[OFF_BY]:
            return t > s
    return b > a


@njit
def _prove_root(surface, trims, frame, world, patch, root, height_mm, floor_mm, room, out):
    """Cells looked at, cells given up, written to out (ROOM, 7): box, reason, whether its middle is on the face, area.

    More than ROOM given up: the rest was not looked at.
    """
    coefficients, patches, span, _, _, sign = surface
    row = patches[patch]
    room_of_cell, near, line, corners, mean, place = room
    near[COUNT], near[OLDEST] = 0, 0
    search = scratch()
    todo, deep = np.empty((DEEPEST + 2, 4)), np.zeros(DEEPEST + 2, np.int64)
    whole, cell, box = np.zeros(DEEPEST + 2, np.bool_), np.empty(13), np.empty(4)
    put(todo[0], root)
    top, cells, given = 1, 0, 0
    while top > 0 and given <= ROOM:
        top -= 1
        depth = deep[top]
        put(box, todo[top])
        state = INSIDE if whole[top] else _state(trims, row[OF_FACE], span[patch], box, place)
        if state == OUTSIDE:
            continue
        cells += 1
        offset_of_piece(coefficients, row, sign[row[OF_FACE]], height_mm, box, room_of_cell, cell)
        _into(frame, cell)
        proven, above = False, 0.0
        if cell[OFF_BY] < math.inf:
            proven, above = _is_cut(cell, near, world, search, line, corners, mean)
        if proven:
            continue
        on_face = state == INSIDE
        if not on_face and above > 0.0:
            on_face = is_inside(trims, row[OF_FACE], place[U], place[V])
        a, b = _half_side(cell, SIDE_S), _half_side(cell, SIDE_T)
        small = 2.0 * max(a, b) <= floor_mm or depth >= DEEPEST
        if small and above == 0.0 and _is_deep_in_one(cell, near, world, search, line, corners, mean):
            continue
        if small or (above > 0.0 and on_face):
            if given < ROOM:
                put(out[given], box)
                out[given, REASON] = ABOVE if above > 0.0 and on_face else FLOOR
                out[given, ON_BORDER], out[given, AREA] = state == ACROSS, 4.0 * a * b
            given += 1
            continue
        low = 2 if _cuts_second(cell, box, near, world, search, line) else 0
        middle = (box[low] + box[low + 1]) / 2
        for half in range(2):
            put(todo[top], box)
            todo[top, low + 1 - half] = middle
            deep[top], whole[top] = depth + 1, state == INSIDE
            top += 1
    return cells, given


def prove_roots(surface, trims, frame, world, patch, boxes, height_mm):
    """Prove roots, cells (n, 4) of patches (n,), to be cut away at a height above the face.

    Args:
        surface: PatchSet.arrays.   trims: TrimSet.arrays.   frame: (4, 3) rotation over origin, see frames.Frame.
        world: of swept.world_of, WCS.
        height_mm: above the face.
    Returns:
        cells looked at (n,), cells given up (n,): more than ROOM where a root must be halved and proven anew, and those
        (n, ROOM, 7): box, ABOVE or FLOOR, 1 across the border, area if flat.
    """
    n = len(patch)
    cells, given, out = np.empty(n, np.int64), np.empty(n, np.int64), np.empty((n, ROOM, 7))
    in_blocks(_prove_roots, n, ROOTS, surface, trims, frame, world, patch, boxes, height_mm, FLOOR_MM, cells, given, out)
    return cells, given, out


@njit
def _prove_roots(surface, trims, frame, world, patch, boxes, height_mm, floor_mm, cells, given, out, first, last):
    widest = 0
    for k in range(len(surface.patch)):
        widest = max(widest, surface.patch[k, DEGREE_U], surface.patch[k, DEGREE_V])
    room = (np.empty((widest + 1, widest + 1, 4)), np.empty(NEAR + 2, np.int64), np.empty(MORE + 1), np.empty((NEAR, 4)),
            np.empty(4), np.empty(2))
    for k in range(first, last):
        cells[k], given[k] = _prove_root(surface, trims, frame, world, patch[k], boxes[k], height_mm, floor_mm, room,
                                         out[k])
