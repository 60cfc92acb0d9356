"""How deep a cutter of any convex outline, turning as it moves, cuts into exact faces: proven, sub-step by sub-step.

Boxes of a part's faces and stretches of a sub-step are halved where their bound (leaning_bounds.py) owes most, the largest
bound first, until that stands within the tolerance of the deepest place known, as `move_depths` does for an upright one.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.stock.outlines import CENTER_R, CENTER_Z, IS_ARC, RADIUS, START_R, START_Z, outline_pieces
from cuspline.stock.tilted_pieces import LENGTH, TURN
from cuspline.stock.tree import morton_order
from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, IS_RATIONAL, OFFSET, POINT, derive, scale_derivatives
from cuspline.surfaces.trims import CHORD_MM
from cuspline.toolpaths.contact.leaf_rows import HALF_S, HALF_T, KIND, MIDDLE_S, MIDDLE_T, PATCH, REACH_S, REACH_T, STATE
from cuspline.toolpaths.drop.exact_drop import ExactPart
from cuspline.toolpaths.drop.patch_bounds import BORDER, EVERYWHERE, FACE, conversions
from cuspline.toolpaths.drop.patch_search import in_trim
from cuspline.toolpaths.gouge.depth_tree import outside_trim, thin_pieces
from cuspline.toolpaths.gouge.leaning_bounds import (
    BOX_X,
    BOX_Z,
    FIRST_POSE,
    HALF,
    LAST_POSE,
    MIDDLE,
    MIDDLE_POSE,
    OUTWARD_MM,
    distance_out,
    is_growing,
    least_of_box,
    least_of_piece,
    most_support,
    put_inward,
    put_pose,
)
from cuspline.toolpaths.gouge.move_depths import (
    BOUND,
    BOX_ALPHA,
    BOX_BETA,
    BOX_S,
    BOX_T,
    FINEST_MM,
    MOST_BOXES,
    SMALLEST_MM,
    T_FROM,
    T_TO,
    pop,
    push,
    settled,
)
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.errors import ToolpathError
from cuspline.values.rows import X, Y, Z, put
from cuspline.values.threads import in_blocks

LOOKING_DOWN_TOO = -2.0         # faces that look anywhere: no normal's z is less
MOST_PIECES = 600_000
COARSER = 4.0
OF_S, OF_T, OF_TIME = 7, 8, 9   # of a box, behind what `move_depths` has: how much its bound owes to its size in each
NODE = 7                        # instead of OF_S of a node: how much it owes to its box
COLUMNS = 10
ROOT = TOP = 0                  # the node and the box that a search begins with; the largest of a heap
CHUNK = 64                      # sub-steps a thread takes at a time
SERIAL_ROWS = 128


@dataclass(frozen=True, eq=False, kw_only=True)
class FaceBoxes:
    """Faces and edges of a part, whichever way they look, as thin pieces in a tree of turned boxes; millimetres."""

    arrays: tuple       # the part's arrays, nodes (2 leaves - 1, 15), leaf of each piece (m,), pieces (m, 4)

    @classmethod
    def of_solid(cls, solid, thickness_mm):
        """Of a TopoDS_Solid.   thickness_mm: of a piece's control hull along its normal, at most."""
        tree = ExactPart.of_solid(solid, upward=LOOKING_DOWN_TOO).arrays
        most = tree.patch[:, [DEGREE_U, DEGREE_V]].max() + 1
        matrices = np.zeros((most, most, most))
        for n in range(most):
            matrices[n, :n + 1, :n + 1] = conversions(n)
        while True:
            leaf, piece, points, first, _ = thin_pieces(tree, matrices, float(thickness_mm), np.array(EVERYWHERE), MOST_PIECES)
            if len(leaf) < MOST_PIECES:
                break
            thickness_mm *= COARSER
        order = morton_order(np.add.reduceat(points, first[:-1], axis=0) / np.diff(first)[:, None])
        leaves = 1
        while leaves < len(order):
            leaves *= 2
        nodes = _boxes(points, first, order, _area_normals(tree, points, first, leaf), leaves)
        arrays = nodes, leaf[order].copy(), piece[order].copy()
        for a in arrays:
            a.setflags(write=False)
        return cls(arrays=(tree, *arrays))

    def depths(self, substeps, cutter_outline, tolerance_mm, skin_mm=0.0):
        """How deep a place of the part lies inside the cutter at most, at any time of each sub-step.

        The depth of a place is its distance from the cutter's surface; the bound stands as near to it as that of `move_depths`.

        Args:
            substeps: (n, 14), see stock/tilted_pieces.py; neighbours one after the other.
            cutter_outline: (k, 10) of its convex body, see stock/outlines.py.
            tolerance_mm: >= FINEST_MM.   skin_mm: of the cutter, that is left out.
        Returns:
            (n,) upper bound of the depth, >= 0; (n,) where along the sub-step, 0..1, and (n, 3) which place of the part is the
            deepest known (NaN where none was found inside the cutter).
        """
        if not tolerance_mm >= FINEST_MM:
            raise ToolpathError(f"a depth tolerance of {tolerance_mm} mm is finer than the {FINEST_MM} mm that borders of "
                                "faces are known to: request more than that")
        g, outline = for_kernel(substeps), for_kernel(cutter_outline)
        depth, share, place = np.full(len(g), -np.inf), np.full(len(g), 0.5), np.full((len(g), 3), np.nan)
        body = outline, _lever_mm(outline), is_growing(outline), float(skin_mm)
        in_blocks(_depths_of_substeps, len(g), CHUNK, self.arrays, body, g, tolerance_mm - CHORD_MM, depth, share, place,
                  serial_rows=SERIAL_ROWS)
        # a place that the trim's chords leave out lies that near to an edge
        return np.maximum(depth + CHORD_MM, 0.0), share, place


def body_outline(cutter):
    """(k, 10) outline of all of a shop.cutters.Cutter that cuts.

    Raises:
        SimulationError: a concave one.
    """
    return outline_pieces(cutter.profile, cutter.name)


def _lever_mm(outline):
    """Farthest place of a body from its tip: of an arc, its centre and radius together."""
    own = fixed.hypot(outline[:, START_R], outline[:, START_Z])
    arcs = outline[outline[:, IS_ARC] != 0.0]
    return float(max(own.max(), (fixed.hypot(arcs[:, CENTER_R], arcs[:, CENTER_Z]) + arcs[:, RADIUS]).max(initial=0.0)))


@njit
def _area_normals(tree, points, first, leaf):
    """(m, 3) normals of pieces, as long as their area, out of the material; 0 of edges."""
    out = np.zeros((len(leaf), 3))
    for k in range(len(leaf)):
        tag = tree.tags[leaf[k]]
        if tag[KIND] != FACE:
            continue
        dv, sign, low = tree.patch[tag[PATCH], DEGREE_V], tree.sign[tag[PATCH]], first[k]
        p, q = points[first[k + 1] - 1] - points[low], points[low + dv] - points[first[k + 1] - 1 - dv]
        out[k, X] = 0.5 * sign * (p[Y] * q[Z] - p[Z] * q[Y])
        out[k, Y] = 0.5 * sign * (p[Z] * q[X] - p[X] * q[Z])
        out[k, Z] = 0.5 * sign * (p[X] * q[Y] - p[Y] * q[X])
    return out


@njit(error_model="numpy")
def _boxes(points, first, order, normals, leaves):
    """(2 leaves - 1, 15) boxes over pieces in their order: middle, half sides (-1: empty), axes, the last the mean normal."""
    nodes = np.full((2 * leaves - 1, 15), -1.0)
    width = leaves
    while width >= 1:
        span = leaves // width
        for i in range(width):
            low, high = i * span, min((i + 1) * span, len(order))
            if low >= high:
                continue
            node = nodes[width - 1 + i]
            _put_axes(points, first, order, normals, low, high, node)
            for a in range(3):
                least, most = math.inf, -math.inf
                for j in range(low, high):
                    for p in range(first[order[j]], first[order[j] + 1]):
                        along = (node[BOX_X + 3 * a] * points[p, X] + node[BOX_X + 3 * a + Y] * points[p, Y]
                                 + node[BOX_X + 3 * a + Z] * points[p, Z])
                        least, most = min(least, along), max(most, along)
                node[HALF + a] = 0.5 * (most - least) + OUTWARD_MM
                for k in range(3):
                    node[MIDDLE + k] = (0.0 if a == 0 else node[MIDDLE + k]) + 0.5 * (least + most) * node[BOX_X + 3 * a + k]
        width //= 2
    return nodes


@njit(error_model="numpy")
def _put_axes(points, first, order, normals, low, high, node):
    """Directions of a box over pieces low..high-1: the mean normal last, the way that they reach farthest across it first."""
    x = y = z = 0.0
    for j in range(low, high):
        x, y, z = x + normals[order[j], X], y + normals[order[j], Y], z + normals[order[j], Z]
    size = math.sqrt(x * x + y * y + z * z)
    if not size > 0.0:
        x, y, z, size = 0.0, 0.0, 1.0, 1.0
    x, y, z = x / size, y / size, z / size
    start, far, ux, uy, uz = first[order[low]], 0.0, 0.0, 0.0, 0.0
    for j in range(low, high):
        for p in range(first[order[j]], first[order[j] + 1]):
            dx, dy, dz = points[p, X] - points[start, X], points[p, Y] - points[start, Y], points[p, Z] - points[start, Z]
            h = dx * x + dy * y + dz * z
            dx, dy, dz = dx - h * x, dy - h * y, dz - h * z
            d = dx * dx + dy * dy + dz * dz
            if d > far:
                far, ux, uy, uz = d, dx, dy, dz
    if far > 0.0:
        size = math.sqrt(far)
        ux, uy, uz = ux / size, uy / size, uz / size
    elif abs(x) < 0.6:
        size = math.sqrt(y * y + z * z)
        ux, uy, uz = 0.0, z / size, -y / size
    else:
        size = math.sqrt(x * x + z * z)
        ux, uy, uz = -z / size, 0.0, x / size
    for k, v in enumerate((ux, uy, uz, y * uz - z * uy, z * ux - x * uz, x * uy - y * ux, x, y, z)):
        node[BOX_X + k] = v


@njit(error_model="numpy")
def _depths_of_substeps(faces, body, g, tolerance, depth, share, place, first_row, last_row):
    """Fill in rows first_row..last_row-1."""
    space = (np.empty((MOST_BOXES + 8, COLUMNS)), np.empty(MOST_BOXES + 8, np.int64), np.empty(MOST_BOXES + 8, np.int64),
             np.empty((6, 3)), (np.empty((3, 6)), np.empty((3, 6))), np.empty(3), np.empty(3))
    for i in range(first_row, last_row):
        depth[i], share[i] = depth_of_substep(faces, body, g, i, tolerance, space, place[i])


@njit(error_model="numpy")
def depth_of_substep(faces, body, g, i, tolerance, space, place):
    """(upper bound of a sub-step's depth, where along it the deepest place known is deepest); that place into `place`."""
    part, nodes, leaf_of, pieces = faces
    boxes, ids, order, o, (whole, _), _, _ = space
    leaves = (len(nodes) + 1) // 2
    _, lever, _, _ = body
    reach = g[i, LENGTH] + g[i, TURN] * lever
    lower, upper, share = 0.0, -math.inf, 0.5
    ids[ROOT], boxes[ROOT, BOUND], boxes[ROOT, T_FROM], boxes[ROOT, T_TO] = ROOT, math.inf, 0.0, 1.0
    boxes[ROOT, NODE], boxes[ROOT, OF_TIME] = math.inf, 0.0
    _put_poses(g, i, 0.0, 1.0, whole)
    order[TOP], filled, live = ROOT, 1, 1
    while live > 0:
        slot = order[TOP]
        bound = boxes[slot, BOUND]
        if bound <= settled(lower, tolerance) or filled + 2 > MOST_BOXES:           # the largest is good enough: all are
            upper = max(upper, bound)
            break
        pop(boxes, order, live)
        live -= 1
        k = ids[slot]
        if k < 0 and _size(part.rows[-1 - k], boxes[slot]) + (boxes[slot, T_TO] - boxes[slot, T_FROM]) * reach < SMALLEST_MM:
            upper = max(upper, bound)                                               # too small to halve: counts as cut
            continue
        for side in range(2):
            new = slot if side == 1 else filled
            if side == 0:
                put(boxes[new], boxes[slot])
                ids[new] = k
            if not _halve(part, nodes, leaves, leaf_of, pieces, boxes[new], ids, new, side):
                continue
            b = boxes[new]
            if ids[new] >= 0:
                _look_at_node(nodes, ids[new], body, g, i, b, settled(lower, tolerance), space)
            else:
                deep, when = _look_at_piece(part, -1 - ids[new], body, g, i, b, settled(lower, tolerance), space)
                if deep > lower:
                    lower, share = deep, when
                    put(place, o[POINT])
            b[BOUND] = min(b[BOUND], bound)
            if b[BOUND] > settled(lower, tolerance):
                push(boxes, order, live, new)
                live += 1
                filled += side == 0
            else:
                upper = max(upper, b[BOUND])
    return max(upper, lower), share


@njit(inline="always")
def _size(row, b):
    return 2.0 * max(row[REACH_S] * b[BOX_ALPHA], row[REACH_T] * b[BOX_BETA])


@njit(error_model="numpy")
def _halve(part, nodes, leaves, leaf_of, pieces, b, ids, slot, side):
    """One half of a box, in place: of the stretch or of the faces, whichever its bound owes more to; False: nothing is in it."""
    k = ids[slot]
    if k >= 0:
        if b[OF_TIME] > b[NODE]:
            _halve_time(b, side)
            return True
        child = 2 * k + 1 + side
        if nodes[child, HALF] < 0.0:
            return False
        ids[slot] = child
        if child >= leaves - 1:
            p = child - leaves + 1
            ids[slot] = -1 - leaf_of[p]
            for a in range(4):
                b[BOX_S + a] = pieces[p, a]
        return True
    row = part.rows[-1 - k]
    owed = max(b[OF_S], b[OF_T])
    if b[OF_TIME] > owed:
        _halve_time(b, side)
        return True
    along_s = b[OF_S] > b[OF_T] if owed > 0.0 else row[REACH_S] * b[BOX_ALPHA] >= row[REACH_T] * b[BOX_BETA]
    if along_s:
        b[BOX_S] += (side - 0.5) * b[BOX_ALPHA]
        b[BOX_ALPHA] *= 0.5
    else:
        b[BOX_T] += (side - 0.5) * b[BOX_BETA]
        b[BOX_BETA] *= 0.5
    return True


@njit(inline="always")
def _halve_time(b, side):
    middle = 0.5 * (b[T_FROM] + b[T_TO])
    if side == 0:
        b[T_TO] = middle
    else:
        b[T_FROM] = middle


@njit(inline="always", error_model="numpy")
def _put_poses(g, i, t0, t1, poses):
    put_pose(g, i, 0.5 * (t0 + t1), poses[MIDDLE_POSE])
    put_pose(g, i, t0, poses[FIRST_POSE])
    put_pose(g, i, t1, poses[LAST_POSE])


@njit(inline="always", error_model="numpy")
def _poses_of(g, i, b, both):
    """(3, 6) of a box's stretch; those of the whole sub-step are at hand."""
    whole, poses = both
    if b[T_FROM] == 0.0 and b[T_TO] == 1.0:
        return whole
    _put_poses(g, i, b[T_FROM], b[T_TO], poses)
    return poses


@njit(error_model="numpy")
def _look_at_node(nodes, k, body, g, i, b, enough, space):
    """Bound of a node's faces over a stretch, and what it owes, into the box b."""
    _, _, _, _, both, n, _ = space
    outline, lever, grows, skin = body
    poses, turn = _poses_of(g, i, b, both), g[i, TURN] * (b[T_TO] - b[T_FROM])
    away = distance_out(outline, poses[MIDDLE_POSE], nodes[k, MIDDLE + X], nodes[k, MIDDLE + Y], nodes[k, MIDDLE + Z], n)
    radius = math.sqrt(nodes[k, HALF + X] ** 2 + nodes[k, HALF + Y] ** 2 + nodes[k, HALF + Z] ** 2)
    b[BOUND] = radius + 0.5 * (g[i, LENGTH] * (b[T_TO] - b[T_FROM]) + turn * lever) - away - skin + OUTWARD_MM
    if b[BOUND] <= enough:                  # far off, however it is turned
        return
    most, b[OF_TIME] = most_support(outline, poses, turn, lever, grows, n)
    least, b[NODE] = least_of_box(nodes, k, n)
    b[BOUND] = most - least - skin + OUTWARD_MM
    if b[BOUND] > enough:
        for a in range(3):
            n[a] = -nodes[k, BOX_Z + a]
        most, _ = most_support(outline, poses, turn, lever, grows, n)
        least, _ = least_of_box(nodes, k, n)
        b[BOUND] = min(b[BOUND], most - least - skin + OUTWARD_MM)


@njit(error_model="numpy")
def _look_at_piece(part, leaf, body, g, i, b, enough, space):
    """Bound of a piece over a stretch, and what it owes, into the box b; (depth of its middle, when), the place into o."""
    _, _, _, o, both, n, other = space
    outline, lever, grows, skin = body
    row, tag = part.rows[leaf], part.tags[leaf]
    s, t, hs, ht = (row[MIDDLE_S] + row[HALF_S] * b[BOX_S], row[MIDDLE_T] + row[HALF_T] * b[BOX_T],
                    row[HALF_S] * b[BOX_ALPHA], row[HALF_T] * b[BOX_BETA])
    crosses = tag[KIND] == FACE and tag[STATE] == BORDER
    if crosses and outside_trim(part, leaf, s, t, hs, ht):
        b[BOUND] = -math.inf
        return 0.0, 0.5
    p = part.patch[tag[PATCH]]
    derive(part.coefficients, p[OFFSET], p[DEGREE_U], p[DEGREE_V], p[IS_RATIONAL] != 0, s, t, o)
    scale_derivatives(o, hs, ht)
    poses = _poses_of(g, i, b, both)
    turn, when = g[i, TURN] * (b[T_TO] - b[T_FROM]), 0.5 * (b[T_FROM] + b[T_TO])
    deep = -skin - distance_out(outline, poses[MIDDLE_POSE], o[POINT, X], o[POINT, Y], o[POINT, Z], n)
    most, b[OF_TIME] = most_support(outline, poses, turn, lever, grows, n)
    least, b[OF_S], b[OF_T] = least_of_piece(o, row, b[BOX_ALPHA], b[BOX_BETA], n)
    b[BOUND] = most - least - skin + OUTWARD_MM
    if b[BOUND] <= enough:
        return 0.0, when
    if tag[KIND] == FACE and put_inward(o, part.sign[tag[PATCH]], other):
        most, _ = most_support(outline, poses, turn, lever, grows, other)
        least, _, _ = least_of_piece(o, row, b[BOX_ALPHA], b[BOX_BETA], other)
        b[BOUND] = min(b[BOUND], most - least - skin + OUTWARD_MM)
    if crosses and not in_trim(part, tag[PATCH], s, t):
        if b[OF_S] + b[OF_T] + b[OF_TIME] < b[BOUND] - enough:      # too deep is what the face does not have: find its border
            b[OF_S] = b[OF_T] = b[OF_TIME] = 0.0
        deep = 0.0
    return deep, when
