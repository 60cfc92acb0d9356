"""Cells of a face, moved out by a height, proven to lie in what was cut, or halved: see excess_proof.py.

A piece of path sweeps a convex volume; of an arc that bulges upward its tangent is taken, which sweeps less.
Signed distance to a convex volume is convex: over a parallelogram it is largest in a corner, and so is every weighted
mean of several such distances.  A mean that is nowhere positive has no point outside all of the volumes:

      piece a   \\    / piece b        over a ridge the one distance rises as the other falls: their mean hardly
                 \\  /                 changes, and a cell may be as wide as its sagitta allows
       _ _ _ _ _ _\\/_ _ _ _ _ _  cell
                  ridge
"""

import math

import numpy as np

from cuspline.stock.distance_kernels import piece_distance
from cuspline.stock.tree import nearest_piece, work
from cuspline.surfaces.face_pieces import ACROSS, INSIDE, OUTSIDE, trim_state
from cuspline.surfaces.offset_pieces import offset_of_piece
from cuspline.surfaces.trims import is_inside
from cuspline.values.compiled import njit
from cuspline.values.rows import put
from cuspline.values.threads import in_blocks

FLOOR_MM = 0.005          # cells no longer than this are not halved
ABOVE, FLOOR = 0, 1       # why a cell was given up: its middle is not cut away; it is as small as they get
NEAR = 12                 # pieces of path remembered from cell to cell
ROOM = 160                # cells given up in one root
ROOTS = 16                # a thread proves at a time
BEYOND = 1.5              # pieces are looked for this far out at corners
LIFT_MM = 1.0
DEEPEST = 48              # halvings
STEEP = 0.05              # an arc whose tangent is steeper than 1 in this is taken for the one place that is nearest


@njit
def _straightened(g, rc, px, py, pz, out):
    """A piece of path for which a distance is convex: the piece, or a tangent of an arc that bulges upward."""
    put(out, g)
    if g[11] == 0.0 or g[10] < 0.0:
        return
    k = int(g[6])
    du, dv = (px if k == 0 else py) - g[7], max(pz - rc - g[8], 0.0)
    rho = math.sqrt(du * du + dv * dv)
    u = min(max(g[7] + (du * g[9] / rho if rho > 0.0 else 0.0), g[k]), g[3 + k])
    rise = math.sqrt(max(g[9] * g[9] - (u - g[7]) * (u - g[7]), 0.0))
    out[11] = 0.0
    if rise < STEEP * g[9]:
        out[k], out[3 + k] = u, u
        out[2], out[5] = g[8] + rise, g[8] + rise
        return
    slope = (g[7] - u) / rise
    out[2], out[5] = g[8] + rise + slope * (g[k] - u), g[8] + rise + slope * (g[3 + k] - u)


@njit
def _tool_of(piece, forest):
    trees = forest[2]
    for k in range(len(trees)):
        if trees[k, 1] <= piece < trees[k, 1] + trees[k, 2]:
            return k
    return 0


@njit
def _remembered(piece, near):
    """Put a piece among those remembered (count first, then the place of the oldest); False: it was there."""
    for i in range(near[0]):
        if near[2 + i] == piece:
            return False
    if near[0] < NEAR:
        near[2 + near[0]] = piece
        near[0] += 1
    else:
        near[2 + near[1]] = piece
        near[1] = (near[1] + 1) % NEAR
    return True


@njit
def _corner_distances(cell, near, forest, line, corners):
    """Distances of a cell's four corners to the pieces remembered that reach into it: (NEAR, 4) filled, how many."""
    geometry, tools = forest[0], forest[3]
    reach, count = 0.0, 0
    for i in range(2):
        a = cell[3 + 3 * i:6 + 3 * i]
        reach += math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    for i in range(near[0]):
        piece = near[2 + i]
        tool = _tool_of(piece, forest)
        flat, rc = tools[tool, 0], tools[tool, 1]
        _straightened(geometry[piece], rc, cell[0], cell[1], cell[2], line)
        if piece_distance(cell[0], cell[1], cell[2], line, flat, rc) > reach:
            continue
        for j in range(4):
            s, t = (1.0 if j & 1 else -1.0), (1.0 if j & 2 else -1.0)
            corners[count, j] = piece_distance(cell[0] + s * cell[3] + t * cell[6], cell[1] + s * cell[4] + t * cell[7],
                                               cell[2] + s * cell[5] + t * cell[8], line, flat, rc)
        count += 1
    return count


@njit
def _largest_of_mean(x, y, share):
    most = -math.inf
    for j in range(4):
        most = max(most, x[j] + share * (y[j] - x[j]))
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
            share, most = _best_share(corners[i], corners[k])
            if most < least:
                least = most
                put(mean, corners[i] + share * (corners[k] - corners[i]))
    for k in range(count):
        if least <= enough:
            return least
        share, most = _best_share(mean, corners[k])
        if most < least:
            least = most
            put(mean, mean + share * (corners[k] - mean))
    return least


@njit
def _into(frame, cell):
    """Middle and half sides of a cell (9,) seen from a frame: rotation (3, 3) over origin (3,)."""
    x, y, z = cell[0] - frame[3, 0], cell[1] - frame[3, 1], cell[2] - frame[3, 2]
    for i in range(3):
        for k in range(3):
            cell[3 * i + k] = x * frame[0, k] + y * frame[1, k] + z * frame[2, k]
        if i < 2:
            x, y, z = cell[3 * i + 3], cell[3 * i + 4], cell[3 * i + 5]


@njit
def _searched(cell, forest, near, search, corner):
    """Remember the piece nearest to a place by a cell (corner 0..3, middle 4); its distance, and whether it is new."""
    s, t = (BEYOND if corner & 1 else -BEYOND), (BEYOND if corner & 2 else -BEYOND)
    if corner == 4:
        s, t = 0.0, 0.0
    hint = near[2] if near[0] > 0 else -1
    d, piece = nearest_piece(cell[0] + s * cell[3] + t * cell[6], cell[1] + s * cell[4] + t * cell[7],
                             cell[2] + s * cell[5] + t * cell[8], forest, hint, search[0], search[1], math.inf)
    return d, piece >= 0 and _remembered(piece, near)


@njit
def _is_cut(cell, near, forest, search, line, corners, mean):
    """(a proof that the whole cell is cut away was found, distance of its middle if that is positive, else 0)."""
    enough = -cell[9]
    count = _corner_distances(cell, near, forest, line, corners)
    if least_largest(corners, count, enough, mean) <= enough:
        return True, 0.0
    d, more = _searched(cell, forest, near, search, 4)
    if d > 0.0:
        return False, d
    for corner in range(4):
        more |= _searched(cell, forest, near, search, corner)[1]
    if not more:
        return False, 0.0
    count = _corner_distances(cell, near, forest, line, corners)
    return least_largest(corners, count, enough, mean) <= enough, 0.0


@njit
def _is_deep_in_one(cell, near, forest, search, line, corners, mean):
    """Whether the cell is proven by the piece nearest to a place above it.

    All cutters with a flat bottom that stand over a cell are as near, those that end beside it, too; higher up they
    are not.
    """
    if not cell[9] < math.inf:
        return False
    cell[2] += LIFT_MM
    more = _searched(cell, forest, near, search, 4)[1]
    cell[2] -= LIFT_MM
    count = _corner_distances(cell, near, forest, line, corners) if more else 0
    return count > 0 and least_largest(corners, count, -cell[9], mean) <= -cell[9]


@njit
def _state(trims, face, span, box, place):
    """Trim state of a cell; its middle's parameters into place (2,)."""
    u0, u1, v0, v1 = span[0], span[1], span[2], span[3]
    around = ((u0 + u1 + box[0] * (u1 - u0)) / 2, (u0 + u1 + box[1] * (u1 - u0)) / 2,
              (v0 + v1 + box[2] * (v1 - v0)) / 2, (v0 + v1 + box[3] * (v1 - v0)) / 2)
    place[0], place[1] = (around[0] + around[1]) / 2, (around[2] + around[3]) / 2
    return trim_state(trims, face, around)


@njit
def _cuts_second(cell, box):
    """Whether the second of a cell's sides is to be halved: the longer one, in parameters where none has a length."""
    a = cell[3] * cell[3] + cell[4] * cell[4] + cell[5] * cell[5]
    b = cell[6] * cell[6] + cell[7] * cell[7] + cell[8] * cell[8]
    return b > a if a + b > 0.0 else box[3] - box[2] > box[1] - box[0]


@njit
def _prove_root(surface, trims, frame, forest, patch, root, height_mm, floor_mm, room, out):
    """Cells looked at, cells given up, written to out (ROOM, 7): box, reason, whether its middle is on the face, area.

    More than ROOM given up: the rest was not looked at.
    """
    coefficients, patches, span, _, _, sign = surface
    row = patches[patch]
    room_of_cell, near, line, corners, mean, place = room
    near[0], near[1] = 0, 0
    search = work()
    todo, deep = np.empty((DEEPEST + 2, 4)), np.zeros(DEEPEST + 2, np.int64)
    whole, cell = np.zeros(DEEPEST + 2, np.bool_), np.empty(10)
    put(todo[0], root)
    top, cells, given = 1, 0, 0
    while top > 0 and given <= ROOM:
        top -= 1
        box, depth = todo[top].copy(), deep[top]
        state = INSIDE if whole[top] else _state(trims, row[0], span[patch], box, place)
        if state == OUTSIDE:
            continue
        cells += 1
        offset_of_piece(coefficients, row, sign[row[0]], height_mm, box, room_of_cell, cell)
        second = _cuts_second(cell, box)
        _into(frame, cell)
        proven, above = False, 0.0
        if cell[9] < math.inf:
            proven, above = _is_cut(cell, near, forest, search, line, corners, mean)
        if proven:
            continue
        on_face = state == INSIDE
        if not on_face and above > 0.0:
            on_face = is_inside(trims, row[0], place[0], place[1])
        a = math.sqrt(cell[3] * cell[3] + cell[4] * cell[4] + cell[5] * cell[5])
        b = math.sqrt(cell[6] * cell[6] + cell[7] * cell[7] + cell[8] * cell[8])
        small = 2.0 * max(a, b) <= floor_mm or depth >= DEEPEST
        if small and above == 0.0 and _is_deep_in_one(cell, near, forest, search, line, corners, mean):
            continue
        if small or (above > 0.0 and on_face):
            if given < ROOM:
                put(out[given], box)
                out[given, 4] = ABOVE if above > 0.0 and on_face else FLOOR
                out[given, 5], out[given, 6] = state == ACROSS, 4.0 * a * b
            given += 1
            continue
        low = 2 if second else 0
        middle = (box[low] + box[low + 1]) / 2
        for half in range(2):
            put(todo[top], box)
            todo[top, low + 1 - half] = middle
            deep[top], whole[top] = depth + 1, state == INSIDE
            top += 1
    return cells, given


def prove_roots(surface, trims, frame, forest, patch, boxes, height_mm):
    """Prove roots, cells (n, 4) of patches (n,), to be cut away at a height above the face.

    Args:
        surface: PatchSet.arrays.   trims: TrimSet.arrays.   frame: (4, 3) rotation over origin, see frames.Frame.
        forest: of swept.forest_of, WCS.
        height_mm: above the face.
    Returns:
        cells looked at (n,), cells given up (n,): more than ROOM where a root must be halved and proven anew, and those
        (n, ROOM, 7): box, ABOVE or FLOOR, 1 across the border, area if flat.
    """
    n = len(patch)
    cells, given, out = np.empty(n, np.int64), np.empty(n, np.int64), np.empty((n, ROOM, 7))
    in_blocks(_prove_roots, n, ROOTS, surface, trims, frame, forest, patch, boxes, height_mm, FLOOR_MM, cells, given, out)
    return cells, given, out


@njit
def _prove_roots(surface, trims, frame, forest, patch, boxes, height_mm, floor_mm, cells, given, out, first, last):
    widest = 0
    for k in range(len(surface[1])):
        widest = max(widest, surface[1][k, 2], surface[1][k, 3])
    room = (np.empty((widest + 1, widest + 1, 4)), np.empty(NEAR + 2, np.int64), np.empty(12), np.empty((NEAR, 4)),
            np.empty(4), np.empty(2))
    for k in range(first, last):
        cells[k], given[k] = _prove_root(surface, trims, frame, forest, patch[k], boxes[k], height_mm, floor_mm, room,
                                         out[k])
