r"""Stock with undercuts as a closed solid: where the distance to what was cut crosses a value on the edges of a lattice.

Every cube of the lattice is parted into six tetrahedra that stand round its diagonal from the lowest to the highest corner,
so that cubes side by side agree on their common face:

    6───────7      corners of a cube are numbered x + 2 y + 4 z; a tetrahedron is a way from 0 to 7 along three sides,
    │╲      │      here 0 - 1 - 3 - 7.  Its edges lead from a corner to one that has more of the three bits: in seven
    4───────5      directions, numbered by those bits.

A distance is 1-Lipschitz: nodes of a coarse grid say of the lattice's vertices round them that no surface is near, and on
which side they lie.  Only the others are asked.
"""

from itertools import permutations

import numpy as np

from cuspline.kernel import solids
from cuspline.stock import rays
from cuspline.stock.swept import in_morton_order, signed_distance_mm, world_of
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit

NODE_EDGES = 4.0          # of the lattice, between nodes of the coarse grid
FAR_EDGES = 1.75          # no edge is longer
BORDER = 2                # layers of the lattice beyond the stock's box; the outermost counts as cut
MET_MM = 1e-5             # how well the surface is met
CORNERS, DIRECTIONS = 8, 7


def _cases():
    """(6, 16, 2, 3) edges that the triangles of a tetrahedron cross, as lower corner + 8 x higher corner; -1: no triangle.

    By the tetrahedron, and by which of its corners are stock (bits); triangles counter-clockwise from outside the stock.
    """
    out = np.full((6, 16, 2, 3), -1)
    for k, way in enumerate(permutations(range(3))):
        corners = [0, 1 << way[0], (1 << way[0]) + (1 << way[1]), 7]
        for mask in range(1, 15):
            order = [i for i in range(4) if mask >> i & 1] + [i for i in range(4) if not mask >> i & 1]
            edge = lambda a, b, at=order: min(corners[at[a]], corners[at[b]]) + CORNERS * max(corners[at[a]], corners[at[b]])
            stock = bin(mask).count("1")
            triangles = {1: [[(0, 1), (0, 2), (0, 3)]], 3: [[(0, 3), (1, 3), (2, 3)]],
                         2: [[(0, 2), (0, 3), (1, 3)], [(0, 2), (1, 3), (1, 2)]]}[stock]
            turn = 1 if _is_even(order) == _is_even(way) else -1
            for t, triangle in enumerate(triangles):
                out[k, mask, t] = [edge(*e) for e in triangle][::turn]
    return out


def _is_even(order):
    """Whether a permutation is even."""
    return sum(a > b for i, a in enumerate(order) for b in order[i + 1:]) % 2 == 0


CASES = _cases()
WAYS = np.array([[0, 1 << a, (1 << a) + (1 << b), 7] for a, b, _ in permutations(range(3))])        # corners of the tetrahedra


class HollowStock:
    """What paths have left of a box, for any cutters grown or shrunk alike: the distances are asked once."""

    def __init__(self, paths, min_mm, max_mm, edge_mm):
        """paths: SweptPath and PosedPath values.   min_mm, max_mm: (3,) of the box.   edge_mm: of the lattice's cubes."""
        self.paths, self.edge_mm, self.box = paths, edge_mm, (min_mm, max_mm)
        self.low = min_mm - BORDER * edge_mm
        self.shape = np.ceil((max_mm - min_mm) / edge_mm).astype(int) + 2 * BORDER + 1
        self.values = self._bounds_mm()                     # (nx, ny, nz); nearer to 0 than they are where not exact
        self.is_exact = np.zeros(self.shape, bool)

    def solid(self, grown_mm):
        """Manifold of the stock that the cutters, grown by so much, leave in the box."""
        self._ask_near(grown_mm)
        is_stock = np.zeros(self.shape, bool)
        inner = (slice(1, -1),) * 3
        is_stock[inner] = self.values[inner] > grown_mm
        corners = _triangles(is_stock)
        if not len(corners):
            return solids.united([])
        edges, triangles = np.unique(corners, return_inverse=True)
        met = self._crossings_mm(edges, grown_mm, is_stock)
        stock = solids.solid_of(met, triangles.reshape(-1, 3), "the stock with its undercuts")
        return stock ^ solids.box(*self.box)

    def _bounds_mm(self):
        """Signed distances of all vertices, nearer to 0 than they are: what the nearest node of the coarse grid lets say."""
        step = NODE_EDGES * self.edge_mm
        count = np.ceil((self.shape - 1) * self.edge_mm / step).astype(int) + 1
        nodes = [first + step * np.arange(n) for first, n in zip(self.low, count)]
        known = signed_distance_mm(self.paths, np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, 3))
        near = [np.rint(np.arange(n) / NODE_EDGES).astype(int) for n in self.shape]
        square = [(self.edge_mm * (np.arange(n) - NODE_EDGES * k)) ** 2 for n, k in zip(self.shape, near)]
        off = np.sqrt(square[0][:, None, None] + square[1][:, None] + square[2])
        known = known.reshape(count)[np.ix_(*near)]
        return np.copysign(np.maximum(np.abs(known) - off, 0.0), known)

    def _ask_near(self, grown_mm):
        """Asks vertices that may be next to the surface for their distances."""
        asked = np.argwhere(~self.is_exact & (np.abs(self.values - grown_mm) <= FAR_EDGES * self.edge_mm))
        self.values[tuple(asked.T)] = signed_distance_mm(self.paths, self._places_mm(asked))
        self.is_exact[tuple(asked.T)] = True

    def _places_mm(self, indices):
        """(n, 3) of vertices by their indices (n, 3)."""
        return self.low + self.edge_mm * indices

    def _crossings_mm(self, edges, grown_mm, is_stock):
        """(n, 3) places on edges (n,) of `_triangles` where the surface crosses them; in the outermost layer their middles."""
        begin = np.column_stack(np.unravel_index(edges // DIRECTIONS, self.shape))
        end = begin + (edges % DIRECTIONS + 1)[:, None] // (1, 2, 4) % 2
        swap = ~is_stock[tuple(begin.T)]
        begin[swap], end[swap] = end[swap], begin[swap]
        is_outer = ((end == 0) | (end == self.shape - 1)).any(axis=1)
        start, way = self._places_mm(begin), self._places_mm(end) - self._places_mm(begin)
        share, some = np.full(len(edges), 0.5), np.flatnonzero(~is_outer)
        values = [self.values[tuple(k[some].T)] - grown_mm for k in (begin, end)]
        share[some] = _met(self.paths, start[some], way[some], values, grown_mm)
        return start + share[:, None] * way


def _met(paths, start_mm, way_mm, values_mm, grown_mm):
    """(n,) shares of ways (n, 3) from stock to what is cut at which the distance becomes `grown_mm`; it begins and ends with
    `values_mm` more (two of (n,))."""
    length, world = np.sqrt((way_mm * way_mm).sum(axis=1)), world_of(paths)
    unit = way_mm / length[:, None]
    ask = lambda order: (rays.crossings(for_kernel(start_mm[order]), for_kernel(unit[order]), length[order],
                                        [v[order] for v in values_mm], float(grown_mm), MET_MM, world),)
    return in_morton_order(start_mm, ask)[0] / length


def _triangles(is_stock):
    """(n, 3) edges that the corners of the surface's triangles lie on: vertex x 7 + direction - 1, vertices in their order."""
    out = np.empty((_surface(is_stock, CASES, WAYS, np.empty((0, 3), np.int64)), 3), np.int64)
    _surface(is_stock, CASES, WAYS, out)
    return out


@njit
def _surface(is_stock, cases, ways, out):
    """Number of triangles; as many as there is room for are written."""
    nx, ny, nz = is_stock.shape
    count = 0
    for i in range(nx - 1):
        for j in range(ny - 1):
            for k in range(nz - 1):
                inside = 0
                for c in range(CORNERS):
                    inside += is_stock[i + c % 2, j + c // 2 % 2, k + c // 4] << c
                if inside == 0 or inside == 255:
                    continue
                for w in range(len(ways)):
                    mask = 0
                    for c in range(4):
                        mask += (inside >> ways[w, c] & 1) << c
                    for t in range(2):
                        if cases[w, mask, t, 0] < 0:
                            break
                        if count < len(out):
                            for e in range(3):
                                begin, end = cases[w, mask, t, e] % CORNERS, cases[w, mask, t, e] // CORNERS
                                vertex = ((i + begin % 2) * ny + j + begin // 2 % 2) * nz + k + begin // 4
                                out[count, e] = vertex * DIRECTIONS + end - begin - 1
                        count += 1
    return count
