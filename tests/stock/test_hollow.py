"""Stock with undercuts as a solid: closed forms, where its surface lies, and what grown cutters leave."""

import numpy as np
import pytest
from known_programs import feed, program, tool

from cuspline.kernel.solids import mesh_of
from cuspline.stock.hollow import CASES, HollowStock
from cuspline.stock.swept import signed_distance_mm, swept_paths

LOW, HIGH = np.array([0.0, 0.0, 0.0]), np.array([20.0, 12.0, 10.0])
RADIUS_MM = 2.5


@pytest.fixture(scope="module")
def bored():
    """A flat cutter that lies along X goes right through the block along its own axis."""
    moves = [feed(22, 6, 5)]
    posted = program((-22, 6, 5), moves, start_axis=np.array([[-1.0, 0, 0]]), end_axis=np.array([[-1.0, 0, 0]]))
    paths = swept_paths(posted, {1: tool("flat", 2 * RADIUS_MM, flute=25.0)})
    return paths, HollowStock(paths, LOW, HIGH, 0.5)


@pytest.mark.parametrize("grown_mm", [0.0, 0.3, -0.4])
def test_a_bore_is_a_hole_of_its_cutters_size(bored, grown_mm):
    """The lattice's facets lie inside the bore by half a sagitta of an edge's length on average."""
    paths, stock = bored
    solid, radius = stock.solid(grown_mm), RADIUS_MM + grown_mm
    longest = np.sqrt(3) * stock.edge_mm
    bore = np.pi * radius ** 2 * 20
    assert solid.genus() == 1
    assert 0 <= solid.volume() - (20 * 12 * 10 - bore) < 2 * np.pi * radius * 20 * longest ** 2 / (8 * radius)
    vertices, _ = mesh_of(solid)
    inner = ((vertices > LOW + 1e-6) & (vertices < HIGH - 1e-6)).all(axis=1)
    assert inner.sum() > 500
    assert np.abs(signed_distance_mm(paths, vertices[inner]) - grown_mm).max() < 1.1e-5        # MET_MM, rounding of the solid


def test_half_the_edge_leaves_a_quarter_of_the_error(bored):
    """About: how the bore runs through the cubes changes with their size, but first order would be 2, third 8."""
    paths, coarse = bored
    want = 20 * 12 * 10 - np.pi * RADIUS_MM ** 2 * 20
    off = [s.solid(0.0).volume() - want for s in (coarse, HollowStock(paths, LOW, HIGH, 0.25))]
    assert 3.0 < off[0] / off[1] < 6.0


def test_what_is_all_cut_away_is_nothing_and_what_nothing_cuts_is_the_whole_box(bored):
    paths, stock = bored
    assert HollowStock(paths, np.array([5.0, 5.5, 4.5]), np.array([6.0, 6.5, 5.5]), 0.2).solid(0.0).is_empty()
    beside = HollowStock(paths, np.array([0.0, 0, 9.0]), HIGH, 0.4).solid(0.0)
    assert beside.volume() == pytest.approx(20 * 12)


def test_every_tetrahedron_is_parted_by_triangles_that_look_away_from_the_stock():
    corners = np.array([(c % 2, c // 2 % 2, c // 4) for c in range(8)], float)
    for way, cases in zip(((1, 3), (1, 5), (2, 3), (2, 6), (4, 5), (4, 6)), CASES):
        own = corners[[0, *way, 7]]
        for mask in range(1, 15):
            is_stock = np.array([mask >> i & 1 for i in range(4)], bool)
            out = own[~is_stock].mean(axis=0) - own[is_stock].mean(axis=0)
            for triangle in cases[mask][cases[mask][:, 0] >= 0]:
                a, b, c = (corners[triangle % 8] + corners[triangle // 8]) / 2
                assert np.cross(b - a, c - a) @ out > 0
