"""Bounding trees over pieces of path, one per cutter, and the near-first search in them.

A tree has eight children a node, over runs of pieces in the order of `halved_order`; the last nodes' children are
single pieces.  All children of a node stand together, one column each, so that their bounds come out of one sweep
over 64 numbers:

    X_LOW, X_HIGH, Y_LOW, Y_HIGH    rectangle round the tips
    LOWEST                          tip
    SLOPE_X, SLOPE_Y, RISE          sx, sy, c: every tip has z >= c + sx x + sy y  (0, 0, lowest where nodes are wide)

A forest is a tuple of arrays that numba takes as one argument:

    geometry (m, 12), blocks (k, 8, 8) number and child, trees (t, 5) first block, first piece, pieces, levels of blocks,
    blocks of the second level (level l > 0 has eight times more than the one above); tools (t, 2) a, rc

A search works in a stack and in bounds, the last BLOCK of which hold a block and what comes of it (see `work`).
"""

import math

import numpy as np

from cuspline.stock.distance_kernels import child_distances, piece_distance
from cuspline.stock.height_kernels import child_heights, piece_height
from cuspline.stock.path_pieces import ARC, CENTER_U, CENTER_V, FORM, IN_YZ, LEVEL_ARC, RADIUS, SIDE, X0, X1, Y0, Y1, Z0, Z1
from cuspline.values.compiled import njit
from cuspline.values.rows import X_HIGH, X_LOW, Y_HIGH, Y_LOW, X, Y, Z
from cuspline.values.threads import in_blocks

WIDTH = 8                 # children of a node
PLANE_SPAN = 4096         # nodes over more pieces carry no plane
STEEPEST = 10.0           # slope of a plane
SLACK_MM = 1e-10          # a node is left out only if it is farther by this: rounding of its bound
FAR_MM = 1e9              # where children stand that hold nothing
CHUNK = 64                # points answered one after the other, each helped by the one before
DEPTH = 128               # more open nodes than any tree leaves
LEVEL_BITS = 5            # of an open node's number: its level
BLOCK = 9 * WIDTH
LOWEST, SLOPE_X, SLOPE_Y, RISE = range(4, 8)                                # rows of a block, behind the rectangle
FIRST_BLOCK, FIRST_PIECE, PIECES, LEVELS, SECOND_LEVEL = range(5)           # columns of trees
FLAT_RADIUS, CORNER_RADIUS = range(2)                                       # of tools


def morton_order(points):
    """(n,) order of points (n, 3) along a Z-curve: neighbours in it are neighbours in space."""
    points = np.asarray(points, dtype=float)
    if not len(points):
        return np.zeros(0, np.int64)
    low = points.min(axis=0)
    scale = (2**21 - 1) / max(float((points.max(axis=0) - low).max()), 1e-9)
    key = np.zeros(len(points), dtype=np.uint64)
    for k, column in enumerate(((points - low) * scale).astype(np.uint64).T):
        key |= _spread(column) << np.uint64(k)
    return np.argsort(key, kind="stable")


def least_under(values, leaves, leaf):
    """(2 leaves - 1,) least value under each node of a binary tree over values (n,); behind the last one nothing is less.

    Args:
        values: int64 or float, `leaf` of them a leaf, in its order.   leaves: a power of two.
    """
    level = np.full(leaves * leaf, np.iinfo(np.int64).max if values.dtype == np.int64 else 1e300, values.dtype)
    level[:len(values)] = values
    level = level.reshape(leaves, leaf).min(axis=1)
    out = np.empty(2 * leaves - 1, values.dtype)
    while len(level) > 1:
        out[len(level) - 1:2 * len(level) - 1] = level
        level = level.reshape(-1, 2).min(axis=1)
    out[0] = level[0]
    return out


def _spread(bits):
    """Two zero bits between every two of 21 bits."""
    for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
                        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249)):
        bits = (bits | (bits << np.uint64(shift))) & np.uint64(mask)
    return bits


def halved_order(points, run):
    """(n,) order of points (n, 3) in which runs of `run`, times any power of two, are halves of the run twice as long.

    Each is cut across its longest side: tighter boxes than along a Z-curve, whose runs jump.
    """
    rows = np.empty((len(points), 4))
    rows[:, :3], rows[:, 3] = points, np.arange(len(points))
    _halve(rows, run)
    return rows[:, 3].astype(np.int64)


@njit
def _halve(rows, run):
    span = run
    while span < len(rows):
        span *= 2
    todo, spans, top = np.zeros(64, np.int64), np.full(64, span), 1
    while top > 0:                                         # one half to its end before the other: stays in the cache
        top -= 1
        lo, span = todo[top], spans[top]
        hi, middle = min(lo + span, len(rows)), lo + span // 2
        if middle < hi:
            _part_at(rows, lo, hi - 1, middle, _longest_side(rows, lo, hi))
            if span > 2 * run:
                todo[top], spans[top] = middle, span // 2
                top += 1
        if span > 2 * run:
            todo[top], spans[top] = lo, span // 2
            top += 1


@njit
def _longest_side(rows, lo, hi):
    xl, xh, yl, yh, zl, zh = math.inf, -math.inf, math.inf, -math.inf, math.inf, -math.inf
    for t in range(lo, hi):
        xl, xh = min(xl, rows[t, X]), max(xh, rows[t, X])
        yl, yh = min(yl, rows[t, Y]), max(yh, rows[t, Y])
        zl, zh = min(zl, rows[t, Z]), max(zh, rows[t, Z])
    if xh - xl >= max(yh - yl, zh - zl):
        return 0
    return 1 if yh - yl >= zh - zl else 2


@njit
def _part_at(rows, lo, hi, middle, axis):
    """Reorders rows lo..hi so that what comes before `middle` lies no farther along the axis than what follows."""
    while lo < hi:
        pivot, i, j = rows[(lo + hi) // 2, axis], lo, hi
        while i <= j:
            while rows[i, axis] < pivot:
                i += 1
            while rows[j, axis] > pivot:
                j -= 1
            if i <= j:
                for k in range(4):
                    rows[i, k], rows[j, k] = rows[j, k], rows[i, k]
                i, j = i + 1, j - 1
        if middle <= j:
            hi = j
        elif middle >= i:
            lo = i
        else:
            return


def build_blocks(geometry):
    """Blocks (k, 8, 8) over pieces in their given order, the levels of blocks and the blocks of the second level."""
    levels = 1
    while WIDTH ** levels < len(geometry):
        levels += 1
    second = -(-len(geometry) // WIDTH ** (levels - 1))
    blocks = np.empty((1 + sum(second * WIDTH ** k for k in range(levels - 1)), WIDTH, WIDTH))
    _fill_blocks(geometry, levels, second, blocks)
    return blocks, levels, second


@njit
def _lowest_over_plane(g, sx, sy):
    """Least z - sx x - sy y over a piece."""
    best = min(g[Z0] - sx * g[X0] - sy * g[Y0], g[Z1] - sx * g[X1] - sy * g[Y1])
    if g[FORM] == LEVEL_ARC:                                         # its place farthest up the slope
        s = math.sqrt(sx * sx + sy * sy)
        if ((g[X0] - g[CENTER_U]) * sy - (g[Y0] - g[CENTER_V]) * sx >= 0.0
                and sx * (g[Y1] - g[CENTER_V]) - sy * (g[X1] - g[CENTER_U]) >= 0.0):
            best = min(best, g[Z0] - sx * g[CENTER_U] - sy * g[CENTER_V] - s * g[RADIUS])
    elif g[FORM] == ARC and g[SIDE] < 0.0:                      # the belly of an arc that hangs down
        s = sx if g[IN_YZ] == 0.0 else sy
        root = math.sqrt(1.0 + s * s)
        k = int(g[IN_YZ])
        touch = g[CENTER_U] + g[RADIUS] * s / root
        if g[k] < touch < g[X1 + k]:
            fixed = sy * g[Y0] if k == 0 else sx * g[X0]
            best = min(best, g[CENTER_V] - s * g[CENTER_U] - g[RADIUS] * root - fixed)
    return best


@njit
def _slope_of(n, mx, my, mz, xx, xy, yy, xz, yz):
    """Least-squares slope (sx, sy) out of n points' sums and sums of products; 0, 0 where it is steep."""
    mx, my, mz = mx / n, my / n, mz / n
    xx, xy, yy, xz, yz = xx - n * mx * mx, xy - n * mx * my, yy - n * my * my, xz - n * mx * mz, yz - n * my * mz
    ridge = 1e-4 * (xx + yy) + 1e-12
    xx, yy = xx + ridge, yy + ridge
    det = xx * yy - xy * xy
    if not det > 0.0:
        return 0.0, 0.0
    sx, sy = (yy * xz - xy * yz) / det, (xx * yz - xy * xz) / det
    if not sx * sx + sy * sy < STEEPEST * STEEPEST:
        return 0.0, 0.0
    return sx, sy


@njit(error_model="numpy")
def _fill_blocks(geometry, levels, second, blocks):
    m, span, row = len(geometry), 1, len(blocks)
    for level in range(levels - 1, -1, -1):                # from the pieces up
        count = second * WIDTH ** (level - 1) if level > 0 else 1
        row -= count
        for i in range(count * WIDTH):
            _fill_node(geometry, i * span, min((i + 1) * span, m), span <= PLANE_SPAN, blocks[row + i // WIDTH], i % WIDTH)
        span *= WIDTH


@njit(error_model="numpy")
def _fill_node(geometry, first, last, has_plane, block, j):
    block[X_LOW, j], block[X_HIGH, j], block[Y_LOW, j], block[Y_HIGH, j] = FAR_MM, FAR_MM, FAR_MM, FAR_MM
    block[LOWEST, j], block[SLOPE_X, j], block[SLOPE_Y, j], block[RISE, j] = FAR_MM, 0.0, 0.0, FAR_MM
    if first >= last:                                      # nobody there: far above everything
        return
    x0, y0, z0 = geometry[first, X0], geometry[first, Y0], geometry[first, Z0]
    xl, xh, yl, yh, low = math.inf, -math.inf, math.inf, -math.inf, math.inf
    mx = my = mz = xx = xy = yy = xz = yz = 0.0
    for t in range(first, last):
        g = geometry[t]
        xl, xh = min(xl, g[X0], g[X1]), max(xh, g[X0], g[X1])
        yl, yh = min(yl, g[Y0], g[Y1]), max(yh, g[Y0], g[Y1])
        low = min(low, g[Z0], g[Z1])
        if has_plane and last - first > 1:
            for k in (0, 3):
                x, y, z = g[k] - x0, g[k + 1] - y0, g[k + 2] - z0
                mx, my, mz = mx + x, my + y, mz + z
                xx, xy, yy, xz, yz = xx + x * x, xy + x * y, yy + y * y, xz + x * z, yz + y * z
    sx = sy = 0.0
    if last - first == 1:
        g = geometry[first]
        x, y, z = g[X1] - x0, g[Y1] - y0, g[Z1] - z0
        square = x * x + y * y
        if z * z < STEEPEST * STEEPEST * square:
            sx, sy = x * z / square, y * z / square
    elif has_plane:
        sx, sy = _slope_of(2.0 * (last - first), mx, my, mz, xx, xy, yy, xz, yz)
    c = math.inf
    if sx == 0.0 and sy == 0.0:
        c = low
    else:
        for t in range(first, last):
            c = min(c, _lowest_over_plane(geometry[t], sx, sy))
    block[X_LOW, j], block[X_HIGH, j], block[Y_LOW, j], block[Y_HIGH, j] = xl, xh, yl, yh
    block[LOWEST, j], block[SLOPE_X, j], block[SLOPE_Y, j], block[RISE, j] = low, sx, sy, c


@njit
def work():
    """Stack and bounds of one search."""
    return np.empty(DEPTH, np.int64), np.empty(DEPTH + BLOCK)


@njit
def open_root(stack, bounds):
    """Put the root on the stack; how many nodes are there."""
    stack[0], bounds[0] = 0, -math.inf
    return 1


@njit
def piece_of(code, tree):
    """The piece that an open node is, or -1: it has a block."""
    is_piece = code & (2 ** LEVEL_BITS - 1) == tree[LEVELS]
    return tree[FIRST_PIECE] + (code >> LEVEL_BITS) if is_piece else -1


@njit
def block_of(code, tree):
    """Row of an open node's block: levels stand one after the other, the root's first."""
    level = code & (2 ** LEVEL_BITS - 1)
    if level == 0:
        return tree[FIRST_BLOCK]
    above = tree[SECOND_LEVEL] * ((1 << 3 * (level - 1)) - 1) // (WIDTH - 1)                 # 1 << 3: WIDTH
    return tree[FIRST_BLOCK] + 1 + above + (code >> LEVEL_BITS)


@njit
def push_children(code, limit, top, stack, bounds):
    """Put the children whose bound is below the limit on the stack, the nearest last; new height of the stack."""
    level, node = code & (2 ** LEVEL_BITS - 1), code >> LEVEL_BITS
    nearest, least = -1, limit
    for j in range(WIDTH):
        b = bounds[DEPTH + 8 * WIDTH + j]
        nearest, least = j if b < least else nearest, b if b < least else least
    if nearest < 0:
        return top
    for j in range(WIDTH):
        b = bounds[DEPTH + 8 * WIDTH + j]
        stack[top], bounds[top] = (node * WIDTH + j) << LEVEL_BITS | (level + 1), b
        top += (b < limit) & (j != nearest)                # no branch, which would be guessed wrong
    stack[top], bounds[top] = (node * WIDTH + nearest) << LEVEL_BITS | (level + 1), least
    return top + 1


@njit
def nearest_in(k, px, py, pz, forest, least, before, enough, best, stack, bounds):
    """Least signed distance of a point to what tree k has swept, below `best`, and its piece (-1: none is).

    One that is no more than `enough` ends the search, whatever is nearer.  Nodes whose `least` (blocks, WIDTH) number is no
    earlier than `before` are left out; an array without rows leaves out none.
    """
    geometry, blocks, trees, tools = forest
    tree, a, rc, found = trees[k], tools[k, FLAT_RADIUS], tools[k, CORNER_RADIUS], -1
    top = open_root(stack, bounds) if tree[PIECES] > 0 else 0
    while top > 0:
        top -= 1
        if bounds[top] - SLACK_MM >= best:
            continue
        code = stack[top]
        t = piece_of(code, tree)
        if t >= 0:
            d = piece_distance(px, py, pz, geometry[t], a, rc)
            if d < best:
                best, found = d, t
                if best <= enough:
                    return best, found
            continue
        block = block_of(code, tree)
        child_distances(px, py, pz, blocks[block], a, rc, bounds[DEPTH:])
        if len(least) > 0:
            for j in range(WIDTH):
                if least[block, j] >= before:
                    bounds[DEPTH + 8 * WIDTH + j] = math.inf
        top = push_children(code, best + SLACK_MM, top, stack, bounds)
    return best, found


@njit
def tree_of(piece, trees):
    """Which tree a piece of the forest is in; -1: there is no such piece."""
    for k in range(len(trees)):
        if trees[k, FIRST_PIECE] <= piece < trees[k, FIRST_PIECE] + trees[k, PIECES]:
            return k
    return -1


@njit
def one_piece_distance(px, py, pz, piece, forest):
    """Signed distance of a point to what is swept along one piece of the forest; inf: there is no such piece."""
    geometry, _, trees, tools = forest
    k = tree_of(piece, trees)
    if k < 0:
        return math.inf
    return piece_distance(px, py, pz, geometry[piece], tools[k, FLAT_RADIUS], tools[k, CORNER_RADIUS])


@njit
def nearest_piece(px, py, pz, forest, hint, stack, bounds, best):
    """Least signed distance of a point to anything swept, and the piece it belongs to (-1: nothing below `best`).

    Most of the simulation's time: by `nearest_in` it takes 8 % longer.
    """
    geometry, blocks, trees, tools = forest
    found = -1
    for pick in range(2):                    # first the hint alone, then all trees
        for k in range(len(trees)):
            tree = trees[k]
            a, rc, first, count = tools[k, FLAT_RADIUS], tools[k, CORNER_RADIUS], tree[FIRST_PIECE], tree[PIECES]
            if pick == 0:
                if first <= hint < first + count:
                    d = piece_distance(px, py, pz, geometry[hint], a, rc)
                    if d < best:
                        best, found = d, hint
                continue
            top = open_root(stack, bounds) if count > 0 else 0
            while top > 0:
                top -= 1
                if bounds[top] - SLACK_MM >= best:
                    continue
                code = stack[top]
                t = piece_of(code, tree)
                if t >= 0:
                    d = piece_distance(px, py, pz, geometry[t], a, rc)
                    if d < best:
                        best, found = d, t
                    continue
                child_distances(px, py, pz, blocks[block_of(code, tree)], a, rc, bounds[DEPTH:])
                top = push_children(code, best + SLACK_MM, top, stack, bounds)
    return best, found


@njit
def lowest_piece(x, y, forest, top_mm, hint, stack, bounds):
    """Height left over (x, y), at most top_mm, and the piece that left it (-1: uncut)."""
    geometry, blocks, trees, tools = forest
    best, found = top_mm, -1
    for pick in range(2):
        for k in range(len(trees)):
            tree = trees[k]
            a, rc, first, count = tools[k, FLAT_RADIUS], tools[k, CORNER_RADIUS], tree[FIRST_PIECE], tree[PIECES]
            if pick == 0:
                if first <= hint < first + count:
                    z = piece_height(x, y, geometry[hint], a, rc)
                    if z < best:
                        best, found = z, hint
                continue
            top = open_root(stack, bounds) if count > 0 else 0
            while top > 0:
                top -= 1
                if bounds[top] >= best:                    # as low as that is not lower: flat bottoms are many
                    continue
                code = stack[top]
                t = piece_of(code, tree)
                if t >= 0:
                    z = piece_height(x, y, geometry[t], a, rc)
                    if z < best:
                        best, found = z, t
                    continue
                child_heights(x, y, blocks[block_of(code, tree)], a, rc, bounds[DEPTH:])
                top = push_children(code, best, top, stack, bounds)
    return best, found


def distances(points, forest):
    """Signed distance (n,) and piece (n,) of points (n, 3)."""
    out, piece = np.empty(len(points)), np.empty(len(points), np.int64)
    in_blocks(_distances, len(points), CHUNK, points, forest, out, piece)
    return out, piece


@njit
def _distances(points, forest, out, piece, first, last):
    (stack, bounds), hint = work(), -1
    for i in range(first, last):
        d, hint = nearest_piece(points[i, X], points[i, Y], points[i, Z], forest, hint, stack, bounds, math.inf)
        out[i], piece[i] = d, hint


def heights(xy, forest, top_mm):
    """Stock height (n,) and piece (n,) over xy (n, 2)."""
    out, piece = np.empty(len(xy)), np.empty(len(xy), np.int64)
    in_blocks(_heights, len(xy), CHUNK, xy, forest, top_mm, out, piece)
    return out, piece


@njit
def _heights(xy, forest, top_mm, out, piece, first, last):
    (stack, bounds), hint = work(), -1
    for i in range(first, last):
        z, hint = lowest_piece(xy[i, X], xy[i, Y], forest, top_mm, hint, stack, bounds)
        out[i], piece[i] = z, hint
