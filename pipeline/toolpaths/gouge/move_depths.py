"""How deep straight moves cut into a part, proven: runs of moves together first, then what is left, each for itself.

A run of moves goes down the tree of `depth_tree` as one.  What is proven within the tolerance for the whole
run is done with; the rest of the tree is kept for its two halves, down to single moves.  A single move's rest is
halved, nodes, pieces of faces and stretches of the move, the one with the largest bound first, until that bound
stands within the tolerance of the deepest point known.
"""

import numpy as np

from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, DS, IS_RATIONAL, OFFSET, derive, position, scale_derivatives
from cuspline.surfaces.trims import CHORD_MM
from cuspline.toolpaths.contact.leaf_rows import HALF_S, HALF_T, KIND, MIDDLE_S, MIDDLE_T, PATCH, REACH_S, REACH_T, STATE
from cuspline.toolpaths.drop.exact_drop import checked_radii_mm
from cuspline.toolpaths.drop.patch_bounds import BORDER, FACE
from cuspline.toolpaths.drop.patch_search import in_trim
from cuspline.toolpaths.gouge.depth_bounds import SIGMA, TAU, THETA, depth_at, node_depth, piece_depth
from cuspline.toolpaths.gouge.depth_tree import outside_trim
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.errors import ToolpathError
from cuspline.values.rows import FROM, TO, X_HIGH, X_LOW, Y_HIGH, Y_LOW, Z_HIGH, Z_LOW, X, Y, Z, put
from cuspline.values.threads import in_blocks

BOUND, T_FROM, T_TO, BOX_S, BOX_T, BOX_ALPHA, BOX_BETA = range(7)       # of a box of a piece and a stretch of the move
FIRST_MOVE, LAST_MOVE, AT_LEVEL = range(3)      # of a part of a run that waits
MIDDLE, HALF = range(2)                         # of a stretch: the tip in its middle, from there to its end
FINEST_MM = 1e-4        # tolerance
RUN = 16                # moves that go down the tree together at most
RUN_SHARE = 0.5         # of the radius: no run is longer
LEVELS = 6              # 2 ** (LEVELS - 2) >= RUN
MOST_KEPT = 2048        # nodes kept for the halves of a run
MOST_BOXES = 30_000     # of one move; what is left open then counts as cut
SMALLEST_MM = 1e-7      # boxes and stretches end here: what is left open then counts as cut
DEEP_SHARE = 0.02       # deep gouges are known to this share of their depth
CHUNK = 16              # runs a thread takes at a time
SERIAL_RUNS = 32


def move_depths(tree, start_mm, end_mm, radius_mm, corner_radius_mm, tolerance_mm, height_mm=np.inf):
    """How deep a point of the part's upper faces lies inside the cutter at most, at any place along straight moves.

    The depth of a point is its distance from the cutter's surface (the cutter closed upward unless it has a height),
    whatever the direction.  The bound stands within the tolerance of the true depth, within half of it where the bound exceeds the
    tolerance, within DEEP_SHARE of the depth where that is more; except where MOST_BOXES do not settle it: there what
    is open counts as cut, the safe side.

    Args:
        tree: DepthTree.
        start_mm, end_mm: (n, 3) tips, finite; moves that follow one another are best given so.
        radius_mm, corner_radius_mm: R > 0 and rc, 0 (flat) to R (ball).
        tolerance_mm: >= FINEST_MM.
        height_mm: of a cutter that ends above as it does below, with a corner of the same radius: >= 2 rc.
    Returns:
        (n,) upper bound of the depth, >= 0; (n,) where along the move, 0..1, and (n, 3) which point of the part is the
        deepest known (NaN where none was found inside the cutter).
    Raises:
        ToolpathError: radii or a tolerance that cannot be.
    """
    R, rc = checked_radii_mm(radius_mm, corner_radius_mm)
    if not tolerance_mm >= FINEST_MM:
        raise ToolpathError(f"a depth tolerance of {tolerance_mm} mm is finer than the {FINEST_MM} mm that borders of "
                            "faces are known to: request more than that")
    start, end = for_kernel(start_mm), for_kernel(end_mm)
    depth, share, place = np.full(len(start), -np.inf), np.full(len(start), 0.5), np.full((len(start), 3), np.nan)
    runs = _runs(start, end, RUN_SHARE * R)
    part, rest = tree.arrays[0], tree.arrays[1:]
    in_blocks(_depths_of_runs, len(runs) - 1, CHUNK, part, rest, start, end, runs, R, rc, float(height_mm) - rc,
              tolerance_mm - CHORD_MM, depth, share, place, serial_rows=SERIAL_RUNS - 1)
    # a point that the trim's chords leave out lies that near to an edge
    return np.maximum(depth + CHORD_MM, 0.0), share, place


@njit
def _runs(start, end, longest):
    """First row of each run, and the number of rows."""
    out = np.empty(len(start) + 1, np.int64)
    count, length, rows = 0, 0.0, 0
    for i in range(len(start)):
        own = 0.0
        joins = rows > 0 and rows < RUN
        for k in range(3):
            own = max(own, abs(end[i, k] - start[i, k]))
            if i > 0 and end[i - 1, k] != start[i, k]:
                joins = False
        if not joins or length + own > longest:
            out[count] = i
            count, length, rows = count + 1, 0.0, 0
        length, rows = length + own, rows + 1
    out[count] = len(start)
    return out[:count + 1].copy()


@njit(error_model="numpy")
def _depths_of_runs(part, rest, start, end, runs, R, rc, core, tolerance, depth, share, place, first_run, last_run):
    """Fill in runs first_run..last_run-1."""
    nodes, first, _, _ = rest
    kept, counts = np.empty((LEVELS, MOST_KEPT), np.int64), np.zeros(LEVELS, np.int64)
    todo = np.empty((2 * LEVELS, 3), np.int64)          # first and last move, level
    tips, box = np.empty((RUN + 1, 3)), np.empty(6)
    heap = heap_space()
    for run in range(first_run, last_run):
        base = runs[run]
        count = runs[run + 1] - base
        put(tips[0], start[base])
        for i in range(count):
            put(tips[i + 1], end[base + i])
        todo[0, FIRST_MOVE], todo[0, LAST_MOVE], todo[0, AT_LEVEL] = 0, count, 1
        kept[0, 0], counts[0] = 0, 1
        top = 1
        while top > 0:
            top -= 1
            low, high, level = todo[top]
            _fill_box(tips, low, high, box)
            most = _rest_of_run(nodes, first, tips, low, high, box, R, rc, core, tolerance, kept[level - 1],
                                counts[level - 1], kept[level], counts, level)
            for i in range(base + low, base + high):
                depth[i] = max(depth[i], most)
            if counts[level] == 0:
                continue
            if high - low == 1:
                i = base + low
                depth[i] = max(depth[i], depth_of_move(part, rest, start[i], end[i], R, rc, core, tolerance, kept[level],
                                                       counts[level], heap, share, place, i))
                continue
            middle = (low + high) // 2
            todo[top, FIRST_MOVE], todo[top, LAST_MOVE], todo[top, AT_LEVEL] = middle, high, level + 1
            todo[top + 1, FIRST_MOVE], todo[top + 1, LAST_MOVE], todo[top + 1, AT_LEVEL] = low, middle, level + 1
            top += 2


@njit(inline="always")
def _fill_box(tips, low, high, box):
    for k in range(3):
        least, most = tips[low, k], tips[low, k]
        for i in range(low + 1, high + 1):
            least, most = min(least, tips[i, k]), max(most, tips[i, k])
        box[2 * k], box[2 * k + 1] = least, most


@njit(error_model="numpy")
def _rest_of_run(nodes, first, tips, low, high, box, R, rc, core, tolerance, given, count, kept, counts, level):
    """Largest bound of what is proven within the tolerance; what is not goes into `kept`, counts[level] nodes."""
    size = max(box[X_HIGH] - box[X_LOW], box[Y_HIGH] - box[Y_LOW], box[Z_HIGH] - box[Z_LOW])
    most, used = -np.inf, 0
    stack = np.empty(128, np.int64)
    for j in range(count):
        stack[0] = given[j]
        top = 1
        while top > 0:
            top -= 1
            k = stack[top]
            bound = node_depth(nodes, k, tips, low, high, box, R, rc, core, tolerance)
            if bound <= tolerance:
                most = max(most, bound)
                continue
            wide = max(nodes[k, X_HIGH] - nodes[k, X_LOW], nodes[k, Y_HIGH] - nodes[k, Y_LOW])
            room = used + top + (count - j) + 2 < len(kept) and top + 2 < len(stack)
            if first[k] >= 0 and wide > size and room:
                stack[top], stack[top + 1] = first[k] + 1, first[k]
                top += 2
            else:
                kept[used] = k
                used += 1
    counts[level] = used
    return most


@njit
def heap_space():
    """What one thread needs for `depth_of_move`: boxes (columns BOUND to BOX_BETA), what each is of, and scratch."""
    return (np.empty((MOST_BOXES + 8, 7)), np.empty(MOST_BOXES + 8, np.int64), np.empty(MOST_BOXES + 8, np.int64),
            np.empty((6, 3)), np.empty(8), np.empty(3), np.empty((2, 3)), np.empty(6), np.empty((2, 3)), np.empty(3))


@njit(inline="always")
def push(boxes, order, count, slot):
    """Let a box sink into the heap of numbers `order`, largest bound on top."""
    i = count
    while i > 0:
        above = (i - 1) // 2
        if boxes[order[above], BOUND] >= boxes[slot, BOUND]:
            break
        order[i] = order[above]
        i = above
    order[i] = slot


@njit(inline="always")
def pop(boxes, order, count):
    """Number of the box on top; the heap then holds count - 1."""
    best, last = order[0], order[count - 1]
    count -= 1
    i = 0
    while 2 * i + 1 < count:
        k = 2 * i + 1
        if k + 1 < count and boxes[order[k + 1], BOUND] > boxes[order[k], BOUND]:
            k += 1
        if boxes[order[k], BOUND] <= boxes[last, BOUND]:
            break
        order[i] = order[k]
        i = k
    order[i] = last
    return best


@njit(error_model="numpy")
def depth_of_move(part, rest, start, end, R, rc, core, tolerance, given, count, heap, share, place, row):
    """Upper bound of one move's depth in the nodes `given`; share[row] and place[row] are filled if one is found."""
    rows = part.rows
    nodes, first, leaf_of, pieces = rest
    boxes, ids, order, o, normals, at, tips, tip_box, middle_half, point = heap
    length = max(abs(end[X] - start[X]), abs(end[Y] - start[Y]), abs(end[Z] - start[Z]))
    lower, upper = 0.0, -np.inf
    filled = live = 0
    for j in range(count + 1):                          # the last round: all that come of boxes taken from the heap
        if j < count:
            k = given[j]
            _stretch(start, end, 0.0, 1.0, tips, tip_box)
            bound = node_depth(nodes, k, tips, 0, 1, tip_box, R, rc, core, tolerance)
            if bound <= tolerance:                      # clean as a whole
                upper = max(upper, bound)
                continue
            ids[filled] = k
            boxes[filled, BOUND], boxes[filled, T_FROM], boxes[filled, T_TO] = bound, 0.0, 1.0
            push(boxes, order, live, filled)
            filled, live = filled + 1, live + 1
            continue                                    # all that is given first
        while live > 0:
            slot = order[0]
            bound = boxes[slot, BOUND]
            if bound <= settled(lower, tolerance) or filled + 2 > MOST_BOXES:      # the largest is good enough: all are
                upper = max(upper, bound)
                break
            pop(boxes, order, live)
            live -= 1
            k, t0, t1 = ids[slot], boxes[slot, T_FROM], boxes[slot, T_TO]
            si, ti, alpha, beta = boxes[slot, BOX_S], boxes[slot, BOX_T], boxes[slot, BOX_ALPHA], boxes[slot, BOX_BETA]
            tm, stretch = 0.5 * (t0 + t1), (t1 - t0) * length
            if k >= 0 and first[k] < 0:                 # a leaf of the tree: from now on a piece
                p = -1 - first[k]
                leaf = leaf_of[p]
                ids[slot] = -1 - leaf
                boxes[slot, BOX_S], boxes[slot, BOX_T], boxes[slot, BOX_ALPHA], boxes[slot, BOX_BETA] = pieces[p]
                bound, depth = _look(part, leaf, start, end, boxes[slot], R, rc, core, lower, heap)
                if depth > lower:
                    lower, share[row] = depth, at[THETA]
                    put(place[row], point)
                boxes[slot, BOUND] = bound
                if bound > settled(lower, tolerance):
                    push(boxes, order, live, slot)
                    live += 1
                else:
                    upper = max(upper, bound)
                continue                                # halved when its turn comes again
            if k >= 0:
                size = max(nodes[k, X_HIGH] - nodes[k, X_LOW], nodes[k, Y_HIGH] - nodes[k, Y_LOW],
                           nodes[k, Z_HIGH] - nodes[k, Z_LOW])
            else:
                size = 2.0 * max(rows[-1 - k, REACH_S] * alpha, rows[-1 - k, REACH_T] * beta)
                if size + stretch < SMALLEST_MM:        # too small to halve: counts as cut
                    upper = max(upper, bound)
                    continue
            for side in range(2):
                new = slot if side == 1 else filled
                b = boxes[new]
                b[BOUND], b[T_FROM], b[T_TO] = bound, t0, t1
                b[BOX_S], b[BOX_T], b[BOX_ALPHA], b[BOX_BETA] = si, ti, alpha, beta
                child = k
                if stretch > size:
                    b[T_FROM], b[T_TO] = (t0, tm) if side == 0 else (tm, t1)
                elif k >= 0:
                    child = first[k] + side
                elif rows[-1 - k, REACH_S] * alpha >= rows[-1 - k, REACH_T] * beta:
                    b[BOX_S], b[BOX_ALPHA] = si + (side - 0.5) * alpha, 0.5 * alpha
                else:
                    b[BOX_T], b[BOX_BETA] = ti + (side - 0.5) * beta, 0.5 * beta
                ids[new] = child
                if child >= 0:
                    _stretch(start, end, b[T_FROM], b[T_TO], tips, tip_box)
                    b[BOUND] = min(bound, node_depth(nodes, child, tips, 0, 1, tip_box, R, rc, core,
                                                     settled(lower, tolerance)))
                else:
                    b[BOUND], depth = _look(part, -1 - child, start, end, b, R, rc, core, lower, heap)
                    if depth > lower:
                        lower, share[row] = depth, at[THETA]
                        put(place[row], point)
                if b[BOUND] > settled(lower, tolerance):
                    push(boxes, order, live, new)
                    live += 1
                    if side == 0:
                        filled += 1
                else:
                    upper = max(upper, b[BOUND])
    return max(upper, lower)


@njit(inline="always")
def settled(lower, tolerance):
    """What is bounded by this needs no closer look: clean, or close enough to the deepest point known."""
    return max(tolerance, lower + max(0.5 * tolerance, DEEP_SHARE * lower))


@njit(inline="always")
def _stretch(start, end, t0, t1, tips, box):
    for k in range(3):
        tips[FROM, k] = start[k] + t0 * (end[k] - start[k])
        tips[TO, k] = start[k] + t1 * (end[k] - start[k])
    _fill_box(tips, 0, 1, box)


@njit(error_model="numpy")
def _look(part, leaf, start, end, b, R, rc, core, known, heap):
    """(bound of a box of a leaf and a stretch, depth of a point found in it); that point and where along the move it
    is deepest go into the scratch if it is deeper than known."""
    _, _, _, o, normals, at, _, _, middle_half, point = heap
    row, tag = part.rows[leaf], part.tags[leaf]
    s, t, hs, ht = (row[MIDDLE_S] + row[HALF_S] * b[BOX_S], row[MIDDLE_T] + row[HALF_T] * b[BOX_T],
                    row[HALF_S] * b[BOX_ALPHA], row[HALF_T] * b[BOX_BETA])
    crosses = tag[KIND] == FACE and tag[STATE] == BORDER
    if crosses and outside_trim(part, leaf, s, t, hs, ht):
        return -np.inf, 0.0
    p = part.patch[tag[PATCH]]
    derive(part.coefficients, p[OFFSET], p[DEGREE_U], p[DEGREE_V], p[IS_RATIONAL] != 0, s, t, o)
    scale_derivatives(o, hs, ht)
    for k in range(3):
        middle_half[MIDDLE, k] = start[k] + 0.5 * (b[T_FROM] + b[T_TO]) * (end[k] - start[k])
        middle_half[HALF, k] = 0.5 * (b[T_TO] - b[T_FROM]) * (end[k] - start[k])
    bound = piece_depth(o, row, tag, part.sign[tag[PATCH]], b[BOX_ALPHA], b[BOX_BETA], middle_half[MIDDLE],
                        middle_half[HALF], R, rc, core, b[BOUND], normals, at)
    if bound <= known:
        return bound, 0.0
    best, spare = known, o[DS]                  # the derivatives are done with: their row takes points
    sigma, tau, theta = at[SIGMA], at[TAU], at[THETA]
    for turn in range(2):                       # the likely deepest point, and the middle
        if turn == 1:
            sigma = tau = 0.0
        u, v = s + hs * sigma, t + ht * tau
        position(part.coefficients, p[OFFSET], p[DEGREE_U], p[DEGREE_V], p[IS_RATIONAL] != 0, u, v, spare)
        deepest, when = best, -1.0
        for k in range(4):
            w = theta if k == 3 else k - 1.0
            depth = depth_at(spare[X] - middle_half[MIDDLE, X] - w * middle_half[HALF, X],
                             spare[Y] - middle_half[MIDDLE, Y] - w * middle_half[HALF, Y],
                             spare[Z] - middle_half[MIDDLE, Z] - w * middle_half[HALF, Z], R, rc, core)
            if depth > deepest:
                deepest, when = depth, 0.5 * (b[T_FROM] + b[T_TO]) + 0.5 * w * (b[T_TO] - b[T_FROM])
        if deepest > best and not (crosses and not in_trim(part, tag[PATCH], u, v)):
            best = deepest
            at[THETA] = when
            point[X], point[Y], point[Z] = spare[X], spare[Y], spare[Z]
    return bound, best if best > known else 0.0
