"""Pieces of passes where passes lie too far apart: along the ridges between fronts that met."""

import math

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from cuspline.toolpaths.freeform.scallop_region import evened
from cuspline.values import fixed_math as fixed

HIGHEST = 1.08          # of the wanted scallop: where passes kink they may reach that; beyond, a piece is laid
WIDEST = 0.5 * math.sqrt(HIGHEST)       # from any place to the nearest pass
GAP_SEEN = 0.985        # of the widest gap allowed: how far beyond its worst place a piece that fills it reaches
FARTHEST = 2.0          # gaps wider than that are as good as untouched
JOINED = 1.2            # steps between the ends of two pieces that are cut as one
ROUNDS = 12             # of filling; each one halves what branches are left


def gap_pieces(ground, curves):
    """Short passes along the ridges of the places that lie too far from every pass, until none does."""
    pieces, fresh = [], [c.line_mm for c in curves]
    left = np.full(ground.is_inside.shape, np.inf)
    for _ in range(ROUNDS):
        left = np.minimum(left, ground.left_by(fresh, FARTHEST))
        height, seen = too_far(ground, left, WIDEST * GAP_SEEN)
        label, count = ndimage.label(seen, np.ones((3, 3), int))
        worst = ndimage.maximum(height, label, np.arange(1, count + 1))
        wide = np.flatnonzero(np.atleast_1d(worst) > WIDEST) + 1
        boxes = ndimage.find_objects(label)
        new = [c for k in wide if (c := _spine(ground, height, label, boxes[k - 1], k)) is not None]
        if not new:
            break
        pieces += new
        fresh = [c.line_mm for c in new]
    return joined(ground, pieces)


def joined(ground, pieces):
    """Pieces whose ends lie next to each other as one, the nearest first; what lies between is cut too."""
    lines = [c.line_mm for c in pieces]
    ends = np.array([p for line in lines for p in (line[0], line[-1])]).reshape(-1, 2)
    typical = fixed.power(np.median(fixed.determinant(_matrices(ground.metric[ground.is_cut]))), -0.25)
    pairs = cKDTree(ends).query_pairs(JOINED * typical, output_type="ndarray") if len(ends) else np.zeros((0, 2), int)
    way = ends[pairs[:, 1]] - ends[pairs[:, 0]]
    here = np.column_stack([ground.at(ground.metric[..., k], ends[pairs].mean(axis=1)) for k in range(3)])
    apart = np.einsum("ni,nij,nj->n", way, _matrices(here), way)
    partner = {}
    group = list(range(len(lines)))

    def root(k):
        while group[k] != k:
            k = group[k]
        return k

    for k in np.argsort(apart, kind="stable"):
        a, b = map(int, pairs[k])
        if apart[k] > JOINED ** 2 or a in partner or b in partner or root(a // 2) == root(b // 2):
            continue
        partner[a], partner[b] = b, a
        group[root(a // 2)] = root(b // 2)
    return [c for chain in _chains(len(lines), partner) if (c := evened(
        np.vstack([lines[e // 2] if e % 2 == 0 else lines[e // 2][::-1] for e in chain]), ground.step_mm)) is not None]


def _chains(count, partner):
    """Lists of the ends (two to a piece, 2 k and 2 k + 1) by which each chain of pieces is entered."""
    chains, seen = [], set()
    for end in range(2 * count):
        if end in partner or end // 2 in seen:
            continue
        chain = [end]
        while (across := partner.get(chain[-1] ^ 1)) is not None:
            chain.append(across)
        seen.update(e // 2 for e in chain)
        chains.append(chain)
    return chains


def _matrices(metric):
    xx, xy, yy = metric.T
    return np.moveaxis(np.array([[xx, xy], [xy, yy]]), -1, 0)


def too_far(ground, left, widest):
    """Distances with their ridges, and the nodes to be cut that lie farther from every pass than the widest allowed."""
    height = _with_ridges(np.minimum(left, FARTHEST))
    return height, ground.is_cut & (height > widest)


def _with_ridges(left):
    """Distances, raised at the nodes beside a ridge to what the slopes of both sides reach between them."""
    out = left.copy()
    ny, nx = left.shape
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        rows = lambda k: slice(k * di, ny - (3 - k) * di)
        cols = lambda k: slice(k * dj, nx - (3 - k) * dj) if dj >= 0 else slice(3 - k, nx - k)
        low_a, a, b, low_b = (left[rows(k), cols(k)] for k in range(4))
        rise, fall = a - low_a, b - low_b
        with np.errstate(invalid="ignore", divide="ignore"):
            t = (b - a + fall) / (rise + fall)
            peak = np.where((rise > 0) & (fall > 0) & (t > 0) & (t < 1), a + rise * t, 0.0)
        for k in (1, 2):
            np.maximum(out[rows(k), cols(k)], peak, out=out[rows(k), cols(k)])
    return out


def _spine(ground, heights, label, box, k):
    """Longest way along the ridge of one gap."""
    mine = label[box] == k
    rows, cols = np.nonzero(mine)
    height = heights[box][mine]
    node = np.full(mine.shape, -1)
    node[mine] = np.arange(len(rows))
    if len(rows) > 1:
        ends = _far_apart(mine, node, height)
        rows, cols = rows[ends], cols[ends]
    xy = np.column_stack([ground.x_mm[box[1]][cols], ground.y_mm[box[0]][rows]])
    if len(xy) == 1:
        xy = xy + 0.5 * ground.step_mm * np.array([[-1.0, 0.0], [1.0, 0.0]])
    return evened(xy, ground.step_mm)


def _far_apart(mine, node, height):
    """Indices along the way between the two nodes of a gap that lie farthest apart, kept to its ridge."""
    cost = fixed.power(height.max() / height, 16)
    a, b, w = [], [], []
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = node[:mine.shape[0] - di, max(0, -dj):mine.shape[1] - max(0, dj)]
        there = node[di:, max(0, dj):mine.shape[1] + min(0, dj)]
        both = (here >= 0) & (there >= 0)
        a.append(here[both])
        b.append(there[both])
        w.append(math.hypot(di, dj) * 0.5 * (cost[a[-1]] + cost[b[-1]]))
    n = len(height)
    graph = coo_matrix((np.concatenate(w), (np.concatenate(a), np.concatenate(b))), (n, n)).tocsr()
    start = int(np.argmax(height))
    for _ in range(2):
        away, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
        start = int(np.argmax(np.where(np.isfinite(away), away, -1.0)))
    way = [start]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return np.array(way)
