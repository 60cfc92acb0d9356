"""Which faces a point on a triangle mesh belongs to: inside one face, or on an edge between two."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from cuspline.toolpaths.contact.contacts import NO_FACE
from cuspline.values.arrays import frozen

SAME_VERTEX_MM = 1e-6       # faces tessellate their common edge from the same points, to the kernel's precision
ON_EDGE_MM = 1e-7           # contacts are computed to far less
INNER = -2                  # both sides of the edge are the same face


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshRims:
    """Triangles with the face of each and the face beyond each of their edges and corners."""

    triangles_mm: np.ndarray    # (m, 3, 3) corners
    face: np.ndarray            # (m,)
    edge_beside: np.ndarray     # (m, 3) face beyond corner k -> k + 1; INNER, or NO_FACE where the mesh ends
    corner_beside: np.ndarray   # (m, 3) another face at corner k; INNER where there is none

    @classmethod
    def of(cls, triangles_mm, face):
        """Which faces meet at the edges and corners of triangles.

        Args:
            triangles_mm: (m, 3, 3) corners.
            face: (m,) index of the face of each triangle.
        """
        corners, face = frozen(triangles_mm, (None, 3, 3), "triangles_mm"), np.asarray(face, int)
        vertex = _merged(corners.reshape(-1, 3)).reshape(-1, 3)
        edge = _beside_edges(vertex, frozen(face, (len(corners),), "face", int))
        return cls(triangles_mm=corners, face=frozen(face, (None,), "face", int),
                   edge_beside=frozen(edge, (None, 3), "edge_beside", int),
                   corner_beside=frozen(_beside_corners(vertex, edge, face), (None, 3), "corner_beside", int))

    def at(self, points_mm, triangle):
        """(face (n,), face beside (n,), is_edge (n,)) of points on triangles; triangle < 0: NO_FACE."""
        t = np.maximum(triangle, 0)
        corners, n = self.triangles_mm[t], len(t)
        points_mm = np.where((triangle < 0)[:, None], corners[:, 0], points_mm)
        along = np.roll(corners, -1, axis=1) - corners
        arm = points_mm[:, None] - corners
        share = np.clip((arm * along).sum(axis=2) / np.maximum((along ** 2).sum(axis=2), 1e-300), 0.0, 1.0)
        on_edge = np.linalg.norm(arm - share[..., None] * along, axis=2) < ON_EDGE_MM
        on_corner = np.linalg.norm(arm, axis=2) < ON_EDGE_MM
        beside = np.full(n, INNER)
        for hit, across in ((on_corner, self.corner_beside[t]), (on_edge, self.edge_beside[t])):
            for k in range(3):
                take = hit[:, k] & (across[:, k] != INNER)
                beside[take] = across[take, k]
        beside[triangle < 0] = INNER
        is_edge = beside != INNER
        return (np.where(triangle < 0, NO_FACE, self.face[t]), np.where(is_edge, beside, NO_FACE), is_edge)


def _merged(points):
    """(n,) number of each distinct point."""
    distinct, number = np.unique(points, axis=0, return_inverse=True)
    pairs = cKDTree(distinct).query_pairs(SAME_VERTEX_MM, output_type="ndarray")
    n = len(distinct)
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return connected_components(links, directed=False)[1][number.ravel()]


def _beside_edges(vertex, face):
    """(m, 3) face on the other side of each edge."""
    m = len(vertex)
    ends = np.sort(np.stack([vertex, np.roll(vertex, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    owner = np.repeat(face, 3)
    order = np.lexsort((owner, ends[:, 1], ends[:, 0]))
    key = ends[order]
    first = np.flatnonzero(np.r_[True, (np.diff(key, axis=0) != 0).any(axis=1)])
    group = np.repeat(np.arange(len(first)), np.diff(np.r_[first, 3 * m]))
    last = np.r_[first[1:], 3 * m] - 1
    low, high = owner[order[first]][group], owner[order[last]][group]       # owners rise within a group
    mine = owner[order]
    beside = np.where(mine == low, high, low)
    beside = np.where(low == high, np.where((last - first)[group] > 0, INNER, NO_FACE), beside)
    out = np.empty(3 * m, int)
    out[order] = np.where(key[:, 0] == key[:, 1], INNER, beside)       # a triangle at a pole has an edge of no length
    return out.reshape(m, 3)


def _beside_corners(vertex, edge_beside, face):
    """(m, 3) another face that meets in each corner."""
    count = vertex.max() + 1
    owner, spot = np.repeat(face, 3), vertex.ravel()
    low, high = np.full(count, np.iinfo(int).max), np.full(count, -1)
    np.minimum.at(low, spot, owner)
    np.maximum.at(high, spot, owner)
    other = np.where(owner == low[spot], high[spot], low[spot])
    ends_here = np.zeros(count, bool)
    free = edge_beside == NO_FACE
    ends_here[vertex[free]] = ends_here[np.roll(vertex, -1, axis=1)[free]] = True
    inner = np.where(ends_here[spot], NO_FACE, INNER)
    return np.where(low[spot] == high[spot], inner, other).reshape(-1, 3)
