"""Leaves and tree for closest points: pieces of faces that turn little, stretches of edges, boxes over them."""

from typing import NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool

from cuspline.kernel.brep import edges_of_faces
from cuspline.surfaces import round_pieces
from cuspline.surfaces.edge_curves import curve_spans
from cuspline.surfaces.enclosures import (
    BOUND,
    BY_S,
    BY_T,
    MID,
    REACH,
    REST,
    VALUE,
    _add,
    _cross,
    _dot,
    _likely_length,
    _middle_length,
    _mul,
    _quotients,
    _reach,
    _recentred,
    _scaled,
    curvature_of_piece,
    shifted,
)
from cuspline.surfaces.face_pieces import ACROSS, OUTSIDE, halves, side_to_cut, trim_states, whole_patches
from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, IS_RATIONAL
from cuspline.values.compiled import njit
from cuspline.values.rows import HIGH_X, X, Y, Z, put

TURN = 0.35             # of the normal from the middle of a piece to its side, radians: then it is a leaf
STRETCH = 1.0           # change of a tangent's length from the middle to the side, as a share: Newton still converges
EXTRA = 3               # halvings more for pieces across a border, or whose curvature has a loose bound
LOOSE = 1.5             # times the middle's curvature
LEVEL_PER_MM = 1e-3     # curvature that does not matter
TINY_MM = 1e-6          # a piece so small is a leaf, however it bends: at a pole none is ever flat
ROUNDS = 24             # halvings at most
LEAF_ITEMS = 2
SLACK_MM = 1e-9         # boxes and slabs are wider by this: rounding
MIDDLE, NORMAL, THICKNESS, DUAL_S, DUAL_T = 0, 3, 6, 7, 10                  # columns of a leaf's geometry, see `measure`
CURVATURE, FARTHEST, RECTANGLE, TANGENT, WIDTH_ALONG, WIDTH_ACROSS = 13, 14, 15, 19, 22, 23
CURVATURE_TOWARD, NORMALS_ALONG, NORMALS_ACROSS, WAY_TO_MIDDLE = range(24, 28)
BENDS, BEND_CHANGE = 10, 24                                     # of a stretch of an edge
LEAF_FACE, LEAF_PATCH, LEAF_STATE, LEAF_DEGREE = range(4)       # of its row: the patch of an edge is an offset into its curves
LEFT, RIGHT = range(2)                                          # children of a node
IN_S, IN_T, IS_LOOSE = range(3)                                 # how much a piece bends, see `measure`


class TreeArrays(NamedTuple):
    """A `projection.ClosestTree` as kernels take it."""

    nodes: np.ndarray
    children: np.ndarray
    order: np.ndarray
    boxes: np.ndarray
    geometry: np.ndarray
    rows: np.ndarray
    curves: np.ndarray
    round: np.ndarray


def leaves(faces, patches, trims):
    """Boxes (k, 6), geometry (k, 28), rows (k, 4), what is round (k, 17: `round_pieces`) and curve coefficients (c,)."""
    parts = [_with_round(face, patches, f, *_face_leaves(patches, trims, f)) for f, face in enumerate(faces)]
    curve_parts, coefficients = _edge_leaves(faces)
    parts += curve_parts
    boxes, geometry, rows, rounds = (np.concatenate(column) for column in zip(*parts))
    return boxes, geometry, rows, rounds, coefficients


def _with_round(face, patches, index, boxes, geometry, rows):
    return boxes, geometry, rows, round_pieces.of_face(face, patches, index, rows[:, LEAF_PATCH], geometry[:, RECTANGLE:TANGENT])


def _face_leaves(patches, trims, face):
    patch, box = whole_patches(patches, face)
    extra = np.zeros(len(patch), np.int64)
    size = patches.patch[patch][:, 2:4].max(axis=0) + 1
    work, done = np.empty((*size, 4)), []
    for level in range(ROUNDS + 1):
        state = trim_states(patches, trims, patch, box)
        patch, box, extra, state = (a[state != OUTSIDE] for a in (patch, box, extra, state))
        if not len(patch):
            break
        boxes, geometry, bend = np.empty((len(patch), 6)), np.empty((len(patch), 28)), np.empty((len(patch), 3))
        measure(patches.coefficients, patches.patch, patch, box, work, boxes, geometry, bend)
        is_flat = (bend[:, :2].max(axis=1) < TURN) & np.isfinite(boxes).all(axis=1)
        is_open = (state == ACROSS) | ~(bend[:, 2] < LOOSE)
        extra = extra + (is_flat & is_open)
        is_tiny = (boxes[:, HIGH_X:] - boxes[:, :HIGH_X]).max(axis=1) < TINY_MM
        ready = (is_flat & (~is_open | (extra > EXTRA))) | is_tiny | (level == ROUNDS)
        rows = np.column_stack([np.full(len(patch), face), patch, state, np.zeros(len(patch), np.int64)])
        done.append((boxes[ready], geometry[ready], rows[ready]))
        go = ~ready
        patch, box = halves(patch[go], box[go], side_to_cut(box[go], bend[go, 0], bend[go, 1]))
        extra = np.concatenate([extra[go], extra[go]])
    if not done:
        return np.empty((0, 6)), np.empty((0, 28)), np.empty((0, 4), np.int64)
    return tuple(np.concatenate(column) for column in zip(*done))


@njit(error_model="numpy")
def measure(coefficients, rows, patch, box, work, boxes, geometry, bend):
    """What the search asks of pieces.

    Args:
        boxes: (n, 6) filled: low and high corners.
        geometry: (n, 28) filled: middle (3), normal there (3), half thickness along it, duals of both tangents in units
            of the piece's half sides (3 + 3), largest curvature against the normal, largest distance from the middle,
            the local rectangle (4), a tangent direction (3), half widths along it and across it (2), largest curvature
            towards the normal, what of any normal lies along and across that tangent (2), the largest way from any place
            to the middle along its own normal.
        bend: (n, 3) filled: how much the piece bends towards the sides in s and in t, below TURN for a leaf; how many
            times the middle's curvature the bound on all is.
    """
    out = np.empty(9)
    for k in range(len(box)):
        row = rows[patch[k]]
        g = geometry[k]
        curvature_of_piece(coefficients, row, -1.0, box[k], work, out)
        g[CURVATURE], most = max(out[BOUND], 0.0), abs(out[VALUE])
        curvature_of_piece(coefficients, row, 1.0, box[k], work, out)
        g[CURVATURE_TOWARD], g[FARTHEST] = max(out[BOUND], 0.0), out[REACH]
        bend[k, IS_LOOSE] = max(g[CURVATURE], g[CURVATURE_TOWARD]) / (max(most, abs(out[VALUE])) + LEVEL_PER_MM)
        shifted(coefficients, row, box[k], work)
        _recentred(work, row[DEGREE_U], row[DEGREE_V], g[MIDDLE:NORMAL])
        S, Ss, St, Sss, Sst, Stt = _quotients(work, row[DEGREE_U], row[DEGREE_V], row[IS_RATIONAL] != 0)
        for c in range(3):
            boxes[k, c], boxes[k, HIGH_X + c] = g[c] - _reach(S[c]) - SLACK_MM, g[c] + _reach(S[c]) + SLACK_MM
        _frame(S, Ss, St, g)
        put(g[RECTANGLE:TANGENT], box[k])
        ls, lt = _middle_length(Ss) + 1e-300, _middle_length(St) + 1e-300
        n = g[NORMAL:THICKNESS]
        turn_s, turn_t = _along(n, Sss) / ls + _along(n, Sst) / lt, _along(n, Sst) / ls + _along(n, Stt) / lt
        run_s = _likely_length(Sss) / ls + _likely_length(Sst) / lt
        run_t = _likely_length(Sst) / ls + _likely_length(Stt) / lt
        # the longer of two sides that turn alike is cut first
        bend[k, IN_S] = max(turn_s, run_s * (TURN / STRETCH)) * (1.0 + 1e-6 * ls / (ls + lt))
        bend[k, IN_T] = max(turn_t, run_t * (TURN / STRETCH)) * (1.0 + 1e-6 * lt / (ls + lt))


@njit(error_model="numpy")
def _along(n, a):
    """Likely size of a vector of forms along a direction."""
    return (abs(n[X] * a[X][MID] + n[Y] * a[Y][MID] + n[Z] * a[Z][MID])
            + abs(n[X] * a[X][BY_S] + n[Y] * a[Y][BY_S] + n[Z] * a[Z][BY_S])
            + abs(n[X] * a[X][BY_T] + n[Y] * a[Y][BY_T] + n[Z] * a[Z][BY_T]))


@njit(error_model="numpy")
def _extent(n0, n1, n2, a):
    """Largest absolute value of a vector of forms about its middle along a direction."""
    return (abs(n0 * a[X][BY_S] + n1 * a[Y][BY_S] + n2 * a[Z][BY_S])
            + abs(n0 * a[X][BY_T] + n1 * a[Y][BY_T] + n2 * a[Z][BY_T]) + abs(n0) * a[X][REST] + abs(n1) * a[Y][REST]
            + abs(n2) * a[Z][REST]) + SLACK_MM


@njit(error_model="numpy")
def _frame(S, Ss, St, g):
    """Normal and how it turns, half thickness and dual tangents of a piece into its geometry row."""
    N = _cross(Ss, St)
    length = _middle_length(N)
    E, F, G = _dot(Ss, Ss)[MID], _dot(Ss, St)[MID], _dot(St, St)[MID]
    det = E * G - F * F
    sound = length > 0.0 and det > 1e-14 * E * G
    slow = np.sqrt(max(E, G))
    for c in range(3):
        g[NORMAL + c] = N[c][MID] / length if sound else 0.0
        g[DUAL_S + c] = (G * Ss[c][MID] - F * St[c][MID]) / det if sound else 0.0
        g[DUAL_T + c] = (E * St[c][MID] - F * Ss[c][MID]) / det if sound else 0.0
        g[TANGENT + c] = (Ss[c][MID] if E >= G else St[c][MID]) / slow if sound else 0.0
    g[THICKNESS], g[WIDTH_ALONG], g[WIDTH_ACROSS] = np.inf, np.inf, np.inf
    g[NORMALS_ALONG], g[NORMALS_ACROSS], g[WAY_TO_MIDDLE] = np.inf, np.inf, np.inf
    if sound:
        nx, ny, nz = g[NORMAL + X], g[NORMAL + Y], g[NORMAL + Z]
        ex, ey, ez = g[TANGENT + X], g[TANGENT + Y], g[TANGENT + Z]
        ax, ay, az = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
        g[THICKNESS], g[WIDTH_ALONG], g[WIDTH_ACROSS] = _extent(nx, ny, nz, S), _extent(ex, ey, ez, S), _extent(ax, ay, az, S)
        least = length - _extent(nx, ny, nz, N)
        if least > 0.0:                     # a shorter normal is a larger share of one
            way = _dot(S, N)
            g[NORMALS_ALONG], g[NORMALS_ACROSS] = _extent(ex, ey, ez, N) / least, _extent(ax, ay, az, N) / least
            g[WAY_TO_MIDDLE] = (abs(way[MID]) + _reach(way)) / least


# edges -------------------------------------------------------------------------------------------------


def _edge_leaves(faces):
    """[(boxes, geometry, rows, what is round)] of all edges but seams, and their curves' coefficients."""
    coefficients, parts, offset = [], [], 0
    for uses in edges_of_faces(faces):
        if any(BRep_Tool.IsClosed_s(edge, faces[index].shape) for index, edge in uses):
            continue
        face, edge = uses[0]
        for powers in curve_spans(edge):
            boxes, geometry, rows = _stretches(powers, face, offset)
            parts.append((boxes, geometry, rows, round_pieces.of_edge(edge, powers, geometry[:, RECTANGLE:TANGENT])))
            coefficients.append(powers.ravel())
            offset += powers.size
    return parts, np.concatenate(coefficients) if coefficients else np.zeros(0)


def _stretches(powers, face, offset):
    """Leaves of one span of a curve."""
    degree = len(powers) - 1
    row, flat = np.array([[face, 0, degree, 0, 1]]), powers.ravel()
    box, work, done = np.array([[-1.0, 1.0, 0.0, 0.0]]), np.empty((degree + 1, 1, 4)), []
    for level in range(ROUNDS + 1):
        boxes, geometry, bend = np.empty((len(box), 6)), np.empty((len(box), 28)), np.empty(len(box))
        _measure_curve(flat, row, box, work, boxes, geometry, bend)
        ready = (bend < TURN) & np.isfinite(boxes).all(axis=1) | (level == ROUNDS)
        rows = np.tile([face, offset, -1, degree], (int(ready.sum()), 1))
        done.append((boxes[ready], geometry[ready], rows))
        _, box = halves(np.zeros(int((~ready).sum()), int), box[~ready], np.zeros(int((~ready).sum()), int))
        if not len(box):
            break
    return tuple(np.concatenate(column) for column in zip(*done))


@njit(error_model="numpy")
def _measure_curve(coefficients, row, box, work, boxes, geometry, bend):
    """As `measure`, for stretches of a curve: one tangent, no normal; BENDS and BEND_CHANGE the curvature vector in the
    middle and the most that it changes by."""
    for k in range(len(box)):
        g = geometry[k]
        shifted(coefficients, row[0], box[k], work)
        _recentred(work, row[0, DEGREE_U], 0, g[MIDDLE:NORMAL])
        S, Ss, _, Sss, _, _ = _quotients(work, row[0, DEGREE_U], 0, True)
        length = _middle_length(Ss)
        slow, fast, far = length, 0.0, 0.0
        g[NORMAL:CURVATURE], g[TANGENT:WIDTH_ALONG], g[WIDTH_ALONG:24] = 0.0, 0.0, np.inf
        for c in range(3):
            boxes[k, c], boxes[k, HIGH_X + c] = g[c] - _reach(S[c]) - SLACK_MM, g[c] + _reach(S[c]) + SLACK_MM
            g[DUAL_S + c] = Ss[c][MID] / (length * length + 1e-300)
            fast, far = fast + (abs(Sss[c][MID]) + _reach(Sss[c])) ** 2, far + _reach(S[c]) ** 2
            slow -= _reach(Ss[c])
        g[CURVATURE] = np.sqrt(fast) / (slow * slow) if slow > 0.0 else np.inf
        g[FARTHEST] = np.sqrt(far)
        _curvature_vector(Ss, Sss, g)
        bend[k] = _likely_length(Sss) / (length + 1e-300)
        put(g[RECTANGLE:TANGENT], box[k])


@njit(error_model="numpy")
def _curvature_vector(Ss, Sss, g):
    """(Ss² Sss - (Ss . Sss) Ss) / Ss⁴ of a curve's stretch into its geometry row."""
    E, along = _dot(Ss, Ss), _dot(Ss, Sss)
    square = _mul(E, E)
    least, change = square[MID] - _reach(square), 0.0
    g[BEND_CHANGE] = np.inf
    for c in range(3):
        form = _add(_mul(E, Sss[c]), _scaled(-1.0, _mul(along, Ss[c])))
        g[BENDS + c] = form[MID] / (square[MID] + 1e-300)
        change += (_reach(form) + abs(g[BENDS + c]) * _reach(square)) ** 2
    if least > 0.0:
        g[BEND_CHANGE] = np.sqrt(change) / least


# tree --------------------------------------------------------------------------------------------------


@njit
def grown(boxes):
    """Nodes (m, 6), children (m, 2) and order (k,) of a tree over boxes, halved at the median of the longer way."""
    count = len(boxes)
    order, middle = np.arange(count), (boxes[:, :3] + boxes[:, 3:]) / 2
    nodes, children = np.empty((2 * count + 1, 6)), np.empty((2 * count + 1, 2), np.int64)
    todo = [(0, 0, count)]
    made = 1
    while len(todo) > 0:
        node, first, end = todo.pop()
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        mid_low, mid_high = np.full(3, np.inf), np.full(3, -np.inf)
        for k in order[first:end]:
            for c in range(3):
                low[c], high[c] = min(low[c], boxes[k, c]), max(high[c], boxes[k, HIGH_X + c])
                mid_low[c], mid_high[c] = min(mid_low[c], middle[k, c]), max(mid_high[c], middle[k, c])
        put(nodes[node, :3], low)
        put(nodes[node, 3:], high)
        if end - first <= LEAF_ITEMS:
            children[node, LEFT], children[node, RIGHT] = -1 - first, end
            continue
        axis = np.argmax(mid_high - mid_low)
        run = order[first:end]
        put(run, run[np.argsort(middle[run, axis], kind="mergesort")])
        half = (first + end) // 2
        children[node, LEFT], children[node, RIGHT] = made, made + 1
        todo.append((made, first, half))
        todo.append((made + 1, half, end))
        made += 2
    return nodes[:made], children[:made], order
