"""A mesh with so much more on all sides: what a casting or a forging near to its part's form stands proud of it."""

import numpy as np

from cuspline.values import fixed_math as fixed

FLAT = 1e-4                 # of its longest side: a triangle that is less high is a sliver
LONGEST = 3.0               # times the thickness, that an outer edge moves at the most: its faces are then thinner there


def skin_round(vertices_mm, triangles, thickness_mm):
    """(v, 3) vertices moved outward so that every triangle beside them moves out by the thickness or a little more.

    Each goes along the mean of the normals round it, weighted by the angles of the corners; at an outer edge farther than
    the thickness, up to LONGEST times.  Where inner corners are tighter than the thickness, or gaps
    narrower than two of it, the skin crosses itself.

    Args:
        vertices_mm: (v, 3).   triangles: (t, 3) of a closed mesh, counter-clockwise seen from outside.   thickness_mm: > 0.
    """
    corners = vertices_mm[triangles]
    sides = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(sides[:, 0], sides[:, 1])
    area, longest = _lengths(normal), _lengths(sides.reshape(-1, 3)).reshape(-1, 3).max(axis=1)
    has_plane = area > FLAT * longest ** 2          # slivers at poles have none to speak of
    normal *= np.where(has_plane, 1.0 / np.maximum(area, 1e-300), 0.0)[:, None]
    mean = np.zeros_like(vertices_mm)
    for k in range(3):
        ahead, back = sides[:, k], -sides[:, k - 1]
        angle = fixed.arctan2(_lengths(np.cross(ahead, back)), (ahead * back).sum(axis=1))
        np.add.at(mean, triangles[:, k], angle[:, None] * normal)
    mean /= np.maximum(_lengths(mean), 1e-300)[:, None]
    least = np.ones(len(vertices_mm))
    for k in range(3):
        np.minimum.at(least, triangles[has_plane, k], (mean[triangles[has_plane, k]] * normal[has_plane]).sum(axis=1))
    return vertices_mm + thickness_mm * mean / np.maximum(least, 1.0 / LONGEST)[:, None]


def _lengths(vectors):
    """(n,) of vectors (n, 3)."""
    return np.sqrt(np.einsum("nc,nc->n", vectors, vectors))
