"""A mesh with so much more on all sides: what a casting or a forging near to its part's form stands proud of it."""

import numpy as np

from cuspline.values import fixed_math as fixed

LONGEST = 3.0               # times the thickness, that an outer edge moves at the most: its faces are then thinner there


def skin_round(vertices_mm, triangles, thickness_mm):
    """(v, 3) vertices moved outward so that every triangle beside them moves out by the thickness or a little more.

    Each goes along the mean of the normals round it, weighted by the angles of the corners; at an outer edge farther than
    the thickness, up to LONGEST times.  Inner corners rounder than the thickness stay whole; others cross themselves.

    Args:
        vertices_mm: (v, 3).   triangles: (t, 3) of a closed mesh, counter-clockwise seen from outside.   thickness_mm: > 0.
    """
    corners = vertices_mm[triangles]
    sides = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(sides[:, 0], sides[:, 1])
    normal /= np.maximum(_lengths(normal), 1e-300)[:, None]
    mean = np.zeros_like(vertices_mm)
    for k in range(3):
        ahead, back = sides[:, k], -sides[:, k - 1]
        angle = fixed.arctan2(_lengths(np.cross(ahead, back)), (ahead * back).sum(axis=1))
        np.add.at(mean, triangles[:, k], angle[:, None] * normal)
    mean /= np.maximum(_lengths(mean), 1e-300)[:, None]
    least = np.ones(len(vertices_mm))
    for k in range(3):
        np.minimum.at(least, triangles[:, k], (mean[triangles[:, k]] * normal).sum(axis=1))
    return vertices_mm + thickness_mm * mean / np.maximum(least, 1.0 / LONGEST)[:, None]


def _lengths(vectors):
    """(n,) of vectors (n, 3)."""
    return np.sqrt(np.einsum("nc,nc->n", vectors, vectors))
