"""Distances on metric grids against closed forms, and the order at which they converge."""

import math

import numpy as np
import pytest

from cuspline.toolpaths.freeform.fast_marching import _selling, metric_distance, seed_distance
from cuspline.values.errors import ToolpathError

SIZE_MM = 10.0


def grid(count):
    x = np.linspace(0.0, SIZE_MM, count + 1)
    return x, *np.meshgrid(x, x)


def constant(shape, matrix):
    return np.broadcast_to([matrix[0, 0], matrix[0, 1], matrix[1, 1]], (*shape, 3)).copy()


def stretched(ratio, angle_rad):
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    turn = np.array([[c, -s], [s, c]])
    return turn @ np.diag([ratio ** 2, 1.0]) @ turn.T


def distance(metric, x, curves, inside=None, **options):
    inside = np.ones(metric.shape[:2], bool) if inside is None else inside
    start = seed_distance(metric, inside, x, x, curves, walls=options.get("walls"))
    return metric_distance(metric, inside, x[1] - x[0], start, **options)


def hill(x, y, radius):
    """Metric of a sphere's cap seen from above, its top at (5, 5)."""
    x, y = x - 5, y - 5
    z = np.sqrt(radius ** 2 - x * x - y * y)
    return np.stack([1 + (x / z) ** 2, x * y / z ** 2, 1 + (y / z) ** 2], axis=-1)


@pytest.mark.parametrize("ratio", [1.0, 5.0, 30.0])
def test_a_matrix_is_the_sum_of_its_weighted_whole_numbered_directions(ratio):
    for angle in np.linspace(0.05, 3.0, 23):
        m = stretched(ratio, angle)
        w, e = _selling(m[0, 0], m[0, 1], m[1, 1])
        np.testing.assert_allclose(np.einsum("k,ki,kj->ij", w, e, e), m, atol=1e-9 * ratio ** 2)
        assert (w >= 0).all()


@pytest.mark.parametrize("ratio, nodes", [(1.0, 1e-5), (3.0, 0.06), (10.0, 0.7), (30.0, 2.5)])
@pytest.mark.parametrize("angle", [0.0, 0.35, 1.1])
def test_distance_from_a_line_is_right_to_a_part_of_its_stencil(ratio, nodes, angle):
    x, xx, yy = grid(120)
    m = stretched(ratio, angle)
    across = np.array([-math.sin(0.5), math.cos(0.5)])
    along, middle = np.array([math.cos(0.5), math.sin(0.5)]), np.array([5.0, 5.0])
    scale = 1.0 / math.sqrt(across @ np.linalg.inv(m) @ across)
    exact = scale * np.abs((xx - 5) * across[0] + (yy - 5) * across[1])
    # where the shortest way to the line stays on the grid
    way = np.linalg.inv(m) @ across / (across @ np.linalg.inv(m) @ across)
    offset = (xx - 5) * across[0] + (yy - 5) * across[1]
    foot = np.stack([xx - way[0] * offset, yy - way[1] * offset])
    owned = ((foot > 1.5) & (foot < 8.5)).all(axis=0)
    phi = distance(constant(xx.shape, m), x, [np.array([middle - 30 * along, middle + 30 * along])])
    assert owned.sum() > 300
    # the first nodes take in some from behind the line, as far away as the stencil is long
    np.testing.assert_allclose(phi[owned], exact[owned], atol=nodes * scale * (x[1] - x[0]))


@pytest.mark.parametrize("ratio", [1.0, 10.0, 30.0])
def test_distance_from_a_point_converges_under_a_stretched_metric(ratio):
    m, errors = stretched(ratio, 0.4), []
    for count in (80, 160, 320):
        x, xx, yy = grid(count)
        v = np.stack([xx - 5.03, yy - 4.97], axis=-1)
        exact = np.sqrt(np.einsum("...i,ij,...j", v, m, v))
        phi = distance(constant(xx.shape, m), x, [np.array([[5.03, 4.97]])])
        errors.append(np.abs(phi - exact).mean() / exact.mean())
    assert errors[2] < 5e-3
    assert errors[2] < 0.5 * errors[0]          # at a point first order, and better away from it


def test_distance_on_a_sphere_is_of_second_order():
    errors = []
    for count in (50, 100, 200):
        x, xx, yy = grid(count)
        t = np.linspace(0, 2 * np.pi, 1441)
        circle = np.column_stack([5 + 2 * np.cos(t), 5 + 2 * np.sin(t)])
        phi = distance(hill(xx, yy, 8.0), x, [circle])
        r = np.hypot(xx - 5, yy - 5)
        exact = 8 * np.abs(np.arcsin(r / 8) - math.asin(2 / 8))
        far = (r > 3.0) & (r < 4.9)
        errors.append(np.abs(phi - exact)[far].max())
    assert errors[2] < 1e-3
    assert errors[0] / errors[1] > 3.0 and errors[1] / errors[2] > 3.0


def test_the_step_between_levels_is_right_to_one_percent_on_a_sphere():
    x, xx, yy = grid(100)
    t = np.linspace(0, 2 * np.pi, 1441)
    phi = distance(hill(xx, yy, 8.0), x, [np.column_stack([5 + 2 * np.cos(t), 5 + 2 * np.sin(t)])])
    gy, gx = np.gradient(phi, x[1])
    m = hill(xx, yy, 8.0)
    a, b, c = np.moveaxis(m, -1, 0)
    steep = np.sqrt((c * gx ** 2 - 2 * b * gx * gy + a * gy ** 2) / (a * c - b * b))
    r = np.hypot(xx - 5, yy - 5)
    assert np.abs(steep - 1)[(r > 2.5) & (r < 4.8)].max() < 0.01


def test_ways_go_round_an_island():
    x, xx, yy = grid(200)
    inside = np.hypot(xx - 5, yy - 5) > 2.0
    metric = constant(xx.shape, np.eye(2))
    seed = np.array([5.0, 0.5])
    phi = distance(metric, x, [seed[None]], inside)
    # tangent, arc round the island, tangent
    tangent = math.sqrt(4.5 ** 2 - 4)
    exact = 2 * tangent + 2.0 * (math.pi - 2 * math.acos(2 / 4.5))
    assert phi[np.argmin(np.abs(x - 9.5)), 100] == pytest.approx(exact, rel=0.01)
    assert np.isinf(phi[100, 100])


def test_nothing_comes_through_a_wall():
    x, xx, yy = grid(50)
    walls = np.zeros((51, 51, 2), bool)
    walls[:, 25, 0] = True
    phi = distance(constant(xx.shape, stretched(6.0, 0.7)), x, [np.array([[1.0, 0.0], [1.0, 10.0]])], walls=walls)
    assert np.isfinite(phi[:, :26]).all() and np.isinf(phi[:, 26:]).all()


def test_the_grid_turned_by_a_quarter_gives_the_same_distances():
    x, xx, yy = grid(60)
    m = stretched(4.0, 0.3)
    curve = np.array([[2.0, 1.0], [6.0, 7.0], [9.0, 7.5]])
    plain = distance(constant(xx.shape, m), x, [curve])
    turned = distance(constant(xx.shape, m[::-1, ::-1]), x, [curve[:, ::-1]])
    np.testing.assert_allclose(turned, plain.T, atol=1e-9)


def test_the_front_stops_where_it_may():
    x, xx, yy = grid(50)
    phi = distance(constant(xx.shape, np.eye(2)), x, [np.array([[0.0, 0.0], [0.0, 10.0]])], farthest=3.05)
    assert np.isfinite(phi[:, :16]).all() and np.isinf(phi[:, 17:]).all()


def test_a_seed_off_the_region_and_a_metric_that_is_none_are_refused():
    x, xx, yy = grid(20)
    with pytest.raises(ToolpathError, match="no seed"):
        distance(constant(xx.shape, np.eye(2)), x, [np.array([[40.0, 40.0]])])
    with pytest.raises(ToolpathError, match="not positive"):
        distance(constant(xx.shape, np.diag([1.0, -1.0])), x, [np.array([[4.0, 4.0]])])
