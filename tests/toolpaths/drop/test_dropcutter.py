"""Drop heights against closed forms and against every triangle on its own."""

import math

import numpy as np
import pytest

from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_contacts, drop_tips_mm, is_held_above
from cuspline.values.errors import ToolpathError

EXACT_MM = 1e-9         # rounding of coordinates below 100 mm
CUTTERS = pytest.mark.parametrize("R, rc", [(5.0, 5.0), (5.0, 1.2), (5.0, 0.0)], ids=["ball", "bull nose", "flat"])

ALL_CUTTERS = pytest.mark.parametrize(
    "R, rc", [(5.0, 5.0), (5.0, 1.2), (5.0, 0.0), (5.0, 1e-6), (5.0, 4.9999), (0.3, 0.1)],
    ids=["ball", "bull nose", "flat", "barely rounded", "nearly a ball", "small"])


def bottom(d, R, rc):
    """Height of the cutter's bottom at a distance from its axis."""
    e = np.maximum(d - (R - rc), 0.0)
    return rc - np.sqrt(np.maximum(rc * rc - e * e, 0.0))


def mesh_of(*triangles):
    corners = np.array(triangles, float)
    return DropMesh.from_triangles(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def soup(seed):
    """300 triangles in all directions, 40 of them upright."""
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-15, 15, (300, 1, 3)) + rng.normal(0, 3, (300, 3, 3)) * (1, 1, 0.5 if seed % 2 else 3)
    triangles[:40, :, 0] = triangles[:40, :1, 0]
    return triangles


def needle_box():
    """A closed box of 16 mm, 6 high, whose top is cut into needles between two opposite edges."""
    far = np.concatenate([np.linspace(-8, 8, 40), -8 + 1e-5 * np.arange(1, 20)])
    far.sort()
    n = len(far)
    one, other = (np.column_stack([far, np.full(n, y), 6 + slope * far]) for y, slope in ((-8.0, 0.05), (8.0, -0.1)))
    vertices = np.vstack([one, other, one * (1, 1, 0), other * (1, 1, 0)])
    i = np.arange(n - 1)
    quads = [(i, i + 1, i + n + 1, i + n), (i + 2 * n, i + 3 * n, i + 3 * n + 1, i + 2 * n + 1),
             (i, i + 2 * n, i + 2 * n + 1, i + 1), (i + n, i + n + 1, i + 3 * n + 1, i + 3 * n)]
    ends = [([0], [n], [3 * n], [2 * n]), ([n - 1], [3 * n - 1], [4 * n - 1], [2 * n - 1])]
    return vertices, np.vstack([np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
                                for a, b, c, d in quads + ends])


def tips_of_each(triangles, x, y, R, rc):
    """(m,) tip height that each triangle asks for by itself: free maximum on its plane, else its edges bisected."""
    local = triangles - (x, y, 0.0)
    tips = np.max([edge_tips(local[:, i], local[:, (i + 1) % 3], R, rc) for i in range(3)], axis=0)
    u, v = local[:, 1] - local[:, 0], local[:, 2] - local[:, 0]
    n = np.cross(u, v)
    flat = np.abs(n[:, 2]) > 1e-12
    a, b = -n[flat, 0] / n[flat, 2], -n[flat, 1] / n[flat, 2]
    g = np.hypot(a, b)
    reach = rc / np.hypot(1, g) + (R - rc) / np.where(g > 0, g, np.inf)
    p = np.column_stack([a, b]) * reach[:, None] - local[flat, 0, :2]
    s = (p[:, 0] * v[flat, 1] - p[:, 1] * v[flat, 0]) / n[flat, 2]
    t = (u[flat, 0] * p[:, 1] - u[flat, 1] * p[:, 0]) / n[flat, 2]
    height = local[flat, 0, 2] + s * u[flat, 2] + t * v[flat, 2] - (rc - rc / np.hypot(1, g))
    tips[flat] = np.maximum(tips[flat], np.where((s >= 0) & (t >= 0) & (s + t <= 1), height, -np.inf))
    return tips


def edge_tips(a, b, R, rc):
    """(m,) highest z - bottom(d) on segments relative to the axis: the concave function's slope bisected."""
    length = np.hypot(*(b - a)[:, :2].T)
    safe = np.maximum(length, 1e-300)
    u = (b - a) / safe[:, None]
    foot, q = -(a[:, :2] * u[:, :2]).sum(axis=1), a[:, 0] * u[:, 1] - a[:, 1] * u[:, 0]
    w = np.sqrt(np.maximum((R - q) * (R + q), 0))
    low, high = np.maximum(foot - w, 0), np.minimum(foot + w, length)
    upright = length < 1e-12
    met = (np.abs(q) <= R) & (low <= high) & ~upright

    def height(s):
        d = np.minimum(np.hypot(q, s - foot), R)
        e = np.maximum(d - (R - rc), 0)
        return a[:, 2] + u[:, 2] * s - (rc - np.sqrt(np.minimum(R - d, rc) * (rc + e)) if rc else 0)

    ends = np.maximum(height(low), height(high))
    for _ in range(70 if rc else 0):
        s = (low + high) / 2
        d = np.minimum(np.hypot(q, s - foot), R)
        e = np.maximum(d - (R - rc), 0)
        steep = e / np.sqrt(np.maximum(np.minimum(R - d, rc) * (rc + e), 1e-300))
        rising = u[:, 2] > steep * (s - foot) / np.maximum(d, 1e-300)
        low, high = np.where(rising, s, low), np.where(rising, high, s)
    d = np.hypot(a[:, 0], a[:, 1])
    corner = np.where(d <= R, np.maximum(a[:, 2], b[:, 2]) - bottom(np.minimum(d, R), R, rc), -np.inf)
    return np.where(upright, corner, np.where(met, np.maximum(ends, height((low + high) / 2)), -np.inf))


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


@ALL_CUTTERS
@pytest.mark.parametrize("seed", range(3))
def test_the_tree_gives_what_all_triangles_give_one_by_one(R, rc, seed):
    triangles = soup(seed)
    xy = np.vstack([positions(70, 18, seed), triangles[:50:2, 0, :2], positions(5, 0.1, seed) + 60])
    brute = np.array([tips_of_each(triangles, x, y, R, rc).max() for x, y in xy])
    tips = drop_tips_mm(mesh_of(*triangles), xy, R, rc)
    assert (tips[-5:] == -np.inf).all()
    np.testing.assert_allclose(tips, brute, rtol=0, atol=EXACT_MM)


@ALL_CUTTERS
def test_the_contact_lies_on_its_triangle_and_holds_the_tip(R, rc):
    triangles = soup(5)
    xy = np.vstack([positions(700, 20, 5), [[90.0, 0.0]]])
    mesh = mesh_of(*triangles)
    rest = drop_contacts(mesh, xy, R, rc)
    np.testing.assert_array_equal(rest.tip_z_mm, drop_tips_mm(mesh, xy, R, rc))
    held = rest.triangle >= 0
    assert not held[-1] and np.isnan(rest.contact_mm[-1]).all() and held.sum() > 450
    np.testing.assert_array_equal(held, np.isfinite(rest.tip_z_mm))
    contact, t = rest.contact_mm[held], triangles[rest.triangle[held]]
    share = [np.linalg.lstsq((c[1:] - c[0]).T, p - c[0], rcond=None)[0] for c, p in zip(t, contact)]
    on_plane = [c[0] + s @ (c[1:] - c[0]) for c, s in zip(t, share)]
    np.testing.assert_allclose(on_plane, contact, atol=1e-9)
    assert all(min(*s, 1 - s.sum()) > -1e-6 for s in share)
    d = np.hypot(*(contact[:, :2] - xy[held]).T)
    assert d.max() < R + 1e-9
    # at the rim the bottom is upright: rounding of d by 1e-15 mm counts sqrt(2 R 1e-15) = 1e-7 mm
    np.testing.assert_allclose(contact[:, 2] - bottom(np.minimum(d, R), R, rc), rest.tip_z_mm[held], atol=5e-7)


@ALL_CUTTERS
def test_few_positions_and_many_give_the_same(R, rc):
    mesh = mesh_of(*soup(2))
    xy = positions(3000, 18, 8)
    few = np.concatenate([drop_tips_mm(mesh, part, R, rc) for part in np.array_split(xy, 30)])
    np.testing.assert_allclose(drop_tips_mm(mesh, xy, R, rc), few, rtol=0, atol=EXACT_MM)


@ALL_CUTTERS
@pytest.mark.parametrize("count", [200, 3000])
def test_what_is_held_above_a_height_is_what_the_tips_say(R, rc, count):
    mesh, xy = mesh_of(*soup(3)), positions(count, 22, 6)
    tips = drop_tips_mm(mesh, xy, R, rc)
    for z in (-8.0, 0.0, 6.0, tips[7], np.sin(np.arange(count))):
        np.testing.assert_array_equal(is_held_above(mesh, xy, R, rc, z), tips > z)


@pytest.mark.parametrize("count", [1, 2, 3, 5, 64, 65, 129])
def test_any_number_of_triangles_finds_its_place_in_the_tree(count):
    triangles = soup(7)[100:100 + count]
    rest = drop_contacts(mesh_of(*triangles), triangles.mean(axis=1)[:, :2], 1e-3, 0.0)
    each = [tips_of_each(triangles, *c.mean(axis=0)[:2], 1e-3, 0.0) for c in triangles]
    np.testing.assert_allclose(rest.tip_z_mm, np.max(each, axis=1), rtol=0, atol=EXACT_MM)
    assert sorted(mesh_of(*triangles).original) == list(range(count))


@ALL_CUTTERS
@pytest.mark.parametrize("turned", [False, True])
def test_a_block_with_walls_underside_and_slivers_gives_what_its_triangles_give(R, rc, turned):
    # closed box with a top in long needles 1e-5 mm wide at one end; the other orientation as well
    vertices, triangles = needle_box()
    corners = vertices[triangles[:, ::-1] if turned else triangles]
    xy = positions(100, 14, 3)
    brute = np.array([tips_of_each(corners, x, y, R, rc).max() for x, y in xy])
    np.testing.assert_allclose(drop_tips_mm(mesh_of(*corners), xy, R, rc), brute, rtol=0, atol=EXACT_MM)


@pytest.mark.parametrize("z", [(3, 3, 3), (3, -2, 0), (3, 3, 2.9)], ids=["point", "upright needle", "two corners"])
@ALL_CUTTERS
def test_triangles_that_are_a_point_in_plan_hold_the_cutter_by_their_top(z, R, rc):
    triangle = np.column_stack([[1, 1, 1], [1, 1, 1], z])
    xy = np.array([[1.0, 1.0], [3.0, 1.0], [1.0, -3.5], [6.5, 1.0]])
    d = np.array([0, 2, 4.5, 5.5])
    exact = np.where(d <= R, 3 - bottom(np.minimum(d, R), R, rc), -np.inf)
    np.testing.assert_allclose(drop_tips_mm(mesh_of(triangle), xy, R, rc), exact, atol=EXACT_MM)


@pytest.mark.parametrize("R, rc", [(0.0, 0.0), (5.0, 6.0), (5.0, -1.0), (np.nan, 0.0), (np.inf, 0.0)])
def test_a_cutter_that_is_none_is_refused(R, rc):
    with pytest.raises(ToolpathError, match="radius"):
        drop_tips_mm(mesh_of(((0, 0, 0), (1, 0, 0), (0, 1, 0))), np.zeros((1, 2)), R, rc)


def test_an_empty_mesh_and_corners_or_positions_that_are_no_numbers_are_refused():
    with pytest.raises(ToolpathError, match="no triangle"):
        DropMesh.from_triangles(np.zeros((3, 3)), np.zeros((0, 3), int))
    with pytest.raises(ToolpathError, match="row 0"):
        mesh_of(((0, 0, np.nan), (1, 0, 0), (0, 1, 0)))
    with pytest.raises(ToolpathError, match="position 1"):
        drop_tips_mm(mesh_of(((0, 0, 0), (1, 0, 0), (0, 1, 0))), np.array([[0, 0], [np.nan, 0]]), 5.0, 5.0)


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
