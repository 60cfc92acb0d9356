"""Drop heights against closed forms and against every triangle on its own."""

import math

import numpy as np
import pytest

from cuspline.toolpaths.dropcutter import DropMesh, _triangle_tip, drop_tips_mm

EXACT_MM = 1e-9         # rounding of coordinates below 100 mm
CUTTERS = pytest.mark.parametrize("R, rc", [(5.0, 5.0), (5.0, 1.2), (5.0, 0.0)], ids=["ball", "bull nose", "flat"])


def bottom(d, R, rc):
    """Height of the cutter's bottom at a distance from its axis."""
    e = np.maximum(d - (R - rc), 0.0)
    return rc - np.sqrt(np.maximum(rc * rc - e * e, 0.0))


def mesh_of(*triangles):
    corners = np.array(triangles, float)
    return DropMesh.from_triangles(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def height_field(z, size=30.0, count=60):
    """Triangles over a square grid round the origin."""
    x = np.linspace(-size, size, count + 1)
    xx, yy = np.meshgrid(x, x, indexing="ij")
    vertices = np.column_stack([xx.ravel(), yy.ravel(), z(xx.ravel(), yy.ravel())])
    i, j = (a.ravel() for a in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    a, b, c, d = i * (count + 1) + j, (i + 1) * (count + 1) + j, (i + 1) * (count + 1) + j + 1, i * (count + 1) + j + 1
    return vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def positions(count, size, seed=1):
    return np.random.default_rng(seed).uniform(-size, size, (count, 2))


@CUTTERS
@pytest.mark.parametrize("slope_deg", [0.0, 25.0, 70.0])
def test_on_a_plane_the_tip_stands_over_it_by_the_cutters_shape(R, rc, slope_deg):
    g = math.tan(math.radians(slope_deg))
    mesh = DropMesh.from_triangles(*height_field(lambda x, y: g * x))
    xy = positions(200, 20)
    # the tip rests where the corner's normal is the plane's: R - rc outward, then rc about the corner
    exact = g * xy[:, 0] + (R - rc) * g + rc * (math.sqrt(1 + g * g) - 1)
    np.testing.assert_allclose(drop_tips_mm(mesh, xy, R, rc), exact, atol=1e-8)      # 70 degrees: 3 mm up per mm


@CUTTERS
def test_on_a_corner_the_tip_stands_over_it_by_the_bottom_there(R, rc):
    peak = (3.0, -2.0, 7.0)
    mesh = mesh_of((peak, (3.001, -2.0, -90.0), (3.0, -1.999, -90.0)))
    angle = np.linspace(0, 6, 40)
    d = np.linspace(0, R * 0.999, 40)
    xy = np.column_stack([3 - d * np.abs(np.cos(angle)), -2 - d * np.abs(np.sin(angle))])
    np.testing.assert_allclose(drop_tips_mm(mesh, xy, R, rc), 7.0 - bottom(d, R, rc), atol=EXACT_MM)


@CUTTERS
@pytest.mark.parametrize("slope", [0.0, 0.6, -2.0])
def test_on_a_straight_edge_the_tip_rests_on_its_highest_contact(R, rc, slope):
    # a knife edge along x; brute force over its points, dense enough for the maximum to be flat
    low, high = -40.0, 40.0
    mesh = mesh_of(((low, 0, slope * low), (high, 0, slope * high), (0.0, 1e-7, -1e3)))
    q = np.linspace(-0.98 * R, 0.98 * R, 41)
    share = np.sin(np.linspace(-np.pi / 2, np.pi / 2, 20001))       # of the chord, its ends included
    exact = [(slope * s - bottom(np.minimum(np.hypot(s, b), R), R, rc)).max()
             for b in q for s in [share * np.sqrt(R * R - b * b)]]
    tips = drop_tips_mm(mesh, np.column_stack([np.zeros(41), q]), R, rc)
    np.testing.assert_allclose(tips, exact, atol=1e-6)      # a maximum missed by half a spacing of 0.4 um


@CUTTERS
def test_on_a_cone_the_tip_stands_on_its_flank(R, rc):
    # fine mesh of z = 20 - rho: the chord error of 720 facets is rho (1 - cos(pi/720)) = 0.3 um
    n, rim = 720, 40.0
    a = np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = np.column_stack([rim * np.cos(a), rim * np.sin(a), np.full(n, 20 - rim)])
    vertices = np.vstack([ring, [[0, 0, 20]]])
    mesh = DropMesh.from_triangles(vertices, np.column_stack([np.arange(n), (np.arange(n) + 1) % n, np.full(n, n)]))
    xy = positions(100, 15)
    rho = np.hypot(*xy.T)
    k = (R - rc) + rc / math.sqrt(2)                # the contact lies this far inward
    flank = 20 - rho + (R - rc) + rc * (math.sqrt(2) - 1)
    apex = np.where(rho <= R, 20 - bottom(np.minimum(rho, R), R, rc), -np.inf)
    np.testing.assert_allclose(drop_tips_mm(mesh, xy, R, rc), np.where(rho >= k, flank, apex), atol=4e-4)


def test_a_ball_on_a_sphere_stands_off_by_the_sum_of_radii_and_the_error_falls_with_the_square():
    R, rc, radius = 5.0, 5.0, 40.0
    xy = positions(200, 15)
    exact = np.sqrt((radius + R) ** 2 - (xy ** 2).sum(axis=1)) - R
    errors = []
    for count in (40, 80, 160):
        z = lambda x, y: np.sqrt(np.maximum(radius ** 2 - x * x - y * y, 0))
        tips = drop_tips_mm(DropMesh.from_triangles(*height_field(z, 25.0, count)), xy, R, rc)
        errors.append(np.abs(tips - exact).max())
    assert errors[2] < 0.01
    assert 3 < errors[0] / errors[1] < 5 and 3 < errors[1] / errors[2] < 5


@CUTTERS
@pytest.mark.parametrize("seed", range(4))
def test_the_tree_gives_what_all_triangles_give_one_by_one(R, rc, seed):
    rng = np.random.default_rng(seed)
    centers = rng.uniform(-15, 15, (300, 1, 3))
    triangles = centers + rng.normal(0, 3, (300, 3, 3)) * (1, 1, 0.5 if seed % 2 else 3)
    triangles[:40, :, 0] = triangles[:40, :1, 0]            # upright ones too
    mesh = mesh_of(*triangles)
    xy = np.vstack([positions(300, 18, seed), triangles[:50, 0, :2]])
    brute = np.array([max(_triangle_tip(t, x, y, R, rc) for t in triangles) for x, y in xy])
    np.testing.assert_allclose(drop_tips_mm(mesh, xy, R, rc), brute, atol=EXACT_MM)


@CUTTERS
@pytest.mark.parametrize("seed", range(3))
def test_one_triangle_gives_what_its_points_give_one_by_one(R, rc, seed):
    rng = np.random.default_rng(seed)
    triangle = rng.normal(0, 6, (3, 3))
    share = np.linspace(0, 1, 601)
    u, v = (a.ravel() for a in np.meshgrid(share, share))
    u, v = u[u + v <= 1 + 1e-12], v[u + v <= 1 + 1e-12]
    points = triangle[0] + u[:, None] * (triangle[1] - triangle[0]) + v[:, None] * (triangle[2] - triangle[0])
    for x, y in positions(20, 8, seed):
        d = np.hypot(points[:, 0] - x, points[:, 1] - y)
        tips = points[:, 2] - bottom(np.minimum(d, R), R, rc)
        brute = tips[d <= R].max(initial=-np.inf)
        ours = drop_tips_mm(mesh_of(triangle), np.array([[x, y]]), R, rc)[0]
        if np.isfinite(brute):
            # samples lie up to 0.03 mm apart: the rim of a flat or a ball's equator is met that much later
            assert brute - 1e-9 <= ours <= brute + 0.2


def test_beside_the_mesh_nothing_holds_the_cutter():
    mesh = mesh_of(((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    assert drop_tips_mm(mesh, np.array([[20.0, 20.0]]), 5.0, 5.0)[0] == -np.inf


def test_the_order_of_triangles_and_positions_does_not_matter():
    vertices, triangles = height_field(lambda x, y: np.sin(x) * np.cos(y / 2) * 3, 20.0, 30)
    xy = positions(300, 15)
    shuffle = np.random.default_rng(5).permutation
    order = shuffle(len(xy))
    a = drop_tips_mm(DropMesh.from_triangles(vertices, triangles), xy, 5.0, 1.2)
    b = drop_tips_mm(DropMesh.from_triangles(vertices, shuffle(triangles)), xy[order], 5.0, 1.2)
    np.testing.assert_allclose(b, a[order], atol=EXACT_MM)


def test_building_and_dropping_leave_their_inputs_alone():
    vertices, triangles = height_field(lambda x, y: x * 0)
    before = vertices.copy()
    mesh = DropMesh.from_triangles(vertices, triangles)
    drop_tips_mm(mesh, positions(10, 5), 5.0, 0.0)
    np.testing.assert_array_equal(vertices, before)
    with pytest.raises(ValueError):
        mesh.nodes[0, 0] = 1.0
