"""Bounds of a mesh under level discs: never below the disc's own rest, and no answer changes by them."""

import numpy as np
import pytest

from cuspline.toolpaths.drop import dropcutter
from cuspline.toolpaths.drop.disc_tops import CELLS_A_RADIUS
from cuspline.toolpaths.drop.dropcutter import BOUNDED_ROWS, DropMesh, drop_tips_mm, is_held_above


def triangles(rng, size_mm, are_walls=False):
    corners = rng.uniform(-20, 20, (150, 1, 3)) + rng.normal(0, size_mm, (150, 3, 3))
    if are_walls:
        corners[:, 2, :2] = corners[:, 1, :2]
    return DropMesh.from_triangles(corners.reshape(-1, 3), np.arange(450).reshape(-1, 3))


@pytest.mark.parametrize("size_mm, are_walls", [(0.2, False), (2.0, False), (15.0, False), (5.0, True)])
@pytest.mark.parametrize("radius_mm", [0.5, 4.0, 60.0])
def test_no_bound_lies_below_a_disc_at_rest_and_every_answer_is_the_trees(size_mm, are_walls, radius_mm):
    rng = np.random.default_rng(7)
    mesh, xy = triangles(rng, size_mm, are_walls), rng.uniform(-90, 90, (BOUNDED_ROWS, 2))
    tips = drop_tips_mm(mesh, xy, radius_mm, 0.0)
    assert (mesh.tops_under(radius_mm).over(xy) >= tips).all()
    heights = np.where(np.isfinite(tips), tips, 0.0) + rng.choice([-1e-6, 0.0, 1e-6, 3.0], len(xy))
    held = is_held_above(mesh, xy, radius_mm, 0.0, heights)
    assert held.any() and np.array_equal(held, dropcutter._held(mesh, xy, radius_mm, 0.0, heights))


def test_over_a_plane_that_leans_the_bound_is_a_few_cells_high():
    """z = x / 2: a disc of radius 8 rests at (x + 8) / 2, the bound is no more than two cells farther up the slope."""
    corners = np.array([[-50.0, -50, -25], [50, -50, 25], [50, 50, 25], [-50, 50, -25]])
    mesh = DropMesh.from_triangles(corners, [[0, 1, 2], [0, 2, 3]])
    xy = np.random.default_rng(3).uniform(-30, 30, (500, 2))
    above = mesh.tops_under(8.0).over(xy) - (xy[:, 0] + 8.0) / 2
    assert above.min() >= 0 and above.max() <= 3 * (8.0 / CELLS_A_RADIUS) / 2
