"""Connected groups of points, by a grid: deterministic and fast."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

NEIGHBOURS = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)
                       if (i, j, k) > (0, 0, 0)])


def clusters_of(points_mm, cell_mm):
    """Index arrays of groups of points (n, 3); points in the same or neighbouring cells belong together.

    Groups come in the order of their first point.
    """
    if not len(points_mm):
        return []
    cells, owner = np.unique(np.floor(np.asarray(points_mm) / cell_mm).astype(np.int64), axis=0, return_inverse=True)
    index = {tuple(c): k for k, c in enumerate(cells.tolist())}
    links = [(k, index[other]) for k, c in enumerate(cells.tolist())
             for other in map(tuple, (np.array(c) + NEIGHBOURS).tolist()) if other in index]
    a, b = np.array(links, dtype=np.int64).reshape(-1, 2).T
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(len(cells), len(cells)))
    label = connected_components(graph, directed=False)[1][owner.ravel()]
    order = np.argsort(label, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
    return sorted(groups, key=lambda g: g[0])
