"""Where a face's surface turns over: a cuspidal edge, across which Su x Sv changes its sign.

Neither the kernel's check nor a mesh's closure sees it: both sides lie on the same tangent plane, one over the other.

            ____________
           (____________      seen from the side: the normal of the part between the two turns shows inward
    ________________)
"""

import numpy as np

REGULAR = ("plane", "cylinder", "cone", "sphere", "torus")      # cannot
HALVINGS = 10               # of the way between two samples whose normals oppose each other: no bend turns so fast,
#                             and nearer to the edge rounding would turn the normals anyhow
OPPOSED = -0.9              # cosine of the normals on either side in the end: opposite at a fold, but not at a crease
A_SPAN, LEAST = 3, 13       # samples between two knots, and along the whole face
SHRUNK = 0.5                # of the median |Su x Sv| of its line: round lesser least values it is looked at again
CLOSER = np.linspace(-1.0, 1.0, 9)      # of the way to the neighbours, where it is


def folds_of(face):
    """Places inside a face where its surface turns over.

    Args:
        face: brep.Face.
    Returns:
        (n, 3) mm; sampled between all knots, so only a fold far smaller than a span can hide.
    """
    if face.kind in REGULAR:
        return np.zeros((0, 3))
    low_u, high_u, low_v, high_v = face.regular_domain
    nurbs = face.nurbs
    u, v = _sites(nurbs.knots_u, low_u, high_u), _sites(nurbs.knots_v, low_v, high_v)
    cross = _crosses(face, *(g.ravel() for g in np.meshgrid(u, v, indexing="ij"))).reshape(len(u), len(v), 3)
    pairs = np.concatenate([_opposed_neighbours(u, v, cross), _opposed_nearby(face, u, v, cross)])
    if not len(pairs):
        return np.zeros((0, 3))
    at = _turned_at(face, pairs[:, :2], pairs[:, 2:])
    at = at[face.is_inside(*at.T)]
    return nurbs.derivatives(*at.T)[:, 0]


def _sites(knots, low, high):
    """Rising places between all knots."""
    breaks = np.unique(np.clip(knots, low, high))
    count = max(A_SPAN, -(-LEAST // (len(breaks) - 1)))
    share = (np.arange(count) + 0.5) / count
    return (breaks[:-1, None] + np.diff(breaks)[:, None] * share).ravel()


def _crosses(face, u, v):
    """(n, 3) Su x Sv."""
    d = face.nurbs.derivatives(u, v)
    return np.cross(d[:, 1], d[:, 2])


def _dot(a, b):
    return np.einsum("...k,...k->...", a, b)


def _opposed_neighbours(u, v, cross):
    """(n, 4) rows u, v, u', v' of neighbouring samples whose normals oppose each other."""
    i, j = np.nonzero(_dot(cross[:-1], cross[1:]) < 0)
    k, m = np.nonzero(_dot(cross[:, :-1], cross[:, 1:]) < 0)
    return np.concatenate([np.stack([u[i], v[j], u[i + 1], v[j]], axis=1),
                           np.stack([u[k], v[m], u[k], v[m + 1]], axis=1)])


def _opposed_nearby(face, u, v, cross):
    """The same where |Su x Sv| shrinks between samples: round such a sample the surface is looked at more closely."""
    size = np.sqrt(_dot(cross, cross))
    line = np.maximum(np.median(size, axis=0), np.median(size, axis=1)[:, None])
    walled = np.pad(size, 1, constant_values=np.inf)
    around = np.min([walled[2:, 1:-1], walled[:-2, 1:-1], walled[1:-1, 2:], walled[1:-1, :-2]], axis=0)
    at = np.argwhere((size <= around) & (size < SHRUNK * line))
    if not len(at):
        return np.zeros((0, 4))
    i, j = at.T
    reach = lambda sites, k: np.diff(sites, prepend=sites[0], append=sites[-1])[np.stack([k, k + 1])].max(axis=0)
    a, b = (g.ravel() for g in np.meshgrid(CLOSER, CLOSER, indexing="ij"))
    near_u = np.clip(u[i, None] + a * reach(u, i)[:, None], u[0], u[-1])
    near_v = np.clip(v[j, None] + b * reach(v, j)[:, None], v[0], v[-1])
    near = _crosses(face, near_u.ravel(), near_v.ravel()).reshape(*near_u.shape, 3)
    k, m = np.nonzero(_dot(near, cross[i, j][:, None]) < 0)
    return np.stack([u[i[k]], v[j[k]], near_u[k, m], near_v[k, m]], axis=1)


def _turned_at(face, a, b):
    """(m, 2) parameters, of the pairs (n, 2) that close in on a fold."""
    a, b = a.copy(), b.copy()
    at_a, at_b = _crosses(face, *a.T), _crosses(face, *b.T)
    for _ in range(HALVINGS):
        middle = (a + b) / 2
        at = _crosses(face, *middle.T)
        turns = _dot(at, at_a) < 0
        b[turns], at_b[turns] = middle[turns], at[turns]
        a[~turns], at_a[~turns] = middle[~turns], at[~turns]
    size = np.sqrt(_dot(at_a, at_a) * _dot(at_b, at_b))
    return a[(size > 0) & (_dot(at_a, at_b) < OPPOSED * size)]
