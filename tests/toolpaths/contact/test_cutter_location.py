"""Tips from contacts: every cutter on plane, sphere, cylinder, cone and torus touches there and nowhere cuts in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cuspline.shop.cutter_profile import apt_profile, chain, lens_profile, tangent_corner
from cuspline.splines.nurbs import NurbsSurface
from cuspline.surfaces.patches import PatchSet
from cuspline.toolpaths.contact.cutter_location import SERIAL_ROWS, cutter_locations, profile_elements
from cuspline.toolpaths.contact.forward_offset import SERIAL_POINTS, forward_tips
from cuspline.values.errors import ToolpathError

MM = 1e-9
WALL = np.sin(np.radians(11.0))     # a cutter that widens upward by 10° finishes no steeper wall
Z = np.array([0.0, 0.0, 1.0])


def round_end(radius, corner, height=30.0):
    return apt_profile(2 * radius, corner, radius - corner, corner, 0.0, 0.0, height)


def tapered_ball(radius=2.0, half_angle=np.radians(8.0), height=30.0):
    join = radius * np.array([np.cos(half_angle), 1 - np.sin(half_angle)])
    top = join + (height - join[1]) * np.array([np.tan(half_angle), 1.0])
    return chain(((0.0, 0.0), join, (0.0, radius)), (join, top, None))


def apt(d=12.0, r=1.5, alpha=np.radians(5.0), beta=np.radians(10.0), h=25.0):
    return apt_profile(d, r, *tangent_corner(d, r, alpha, beta), alpha, beta, h)


CUTTERS = {
    "ball": round_end(6.0, 6.0), "bull-nose": round_end(5.0, 1.0), "flat": round_end(5.0, 0.0),
    "tapered ball": tapered_ball(), "dovetail": apt(16.0, 0.5, 0.0, -np.radians(30.0), 9.0),
    "sharp dovetail": apt_profile(16.0, 0.0, 8.0, 0.0, 0.0, -np.radians(30.0), 9.0),
    "lens": lens_profile(10.0, 25.0, 1.0, 12.0), "general": apt(),
}


# convex bodies: points with normals, and the distance of any point from the surface (positive in the air) ---


def on_plane(t):
    n = np.array([0.3, -0.5, 0.9]) / np.linalg.norm([0.3, -0.5, 0.9])
    a, b = np.cross(n, Z), np.cross(n, np.cross(n, Z))
    return 40 * (t[:, :1] * a + t[:, 1:] * b), np.tile(n, (len(t), 1)), lambda p: p @ n


def on_sphere(t):
    up, turn = np.arcsin(0.02 + 0.97 * t[:, 0]), 2 * np.pi * t[:, 1]
    n = np.column_stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
    return 20 * n, n, lambda p: np.linalg.norm(p, axis=-1) - 20


def on_cylinder(t):
    turn = np.pi * (0.01 + 0.98 * t[:, 0])
    n = np.column_stack([np.cos(turn), 0 * turn, np.sin(turn)])
    return 15 * n + [0, 30, 0] * t[:, 1:], n, lambda p: np.linalg.norm(p[..., [0, 2]], axis=-1) - 15


def on_cone(t):
    """Upright, half angle 25°, apex at 60 mm: its side climbs steeply."""
    half, z, turn = np.radians(25.0), 40 * t[:, 0], 2 * np.pi * t[:, 1]
    r = (60 - z) * np.tan(half)
    n = np.column_stack([np.cos(half) * np.cos(turn), np.cos(half) * np.sin(turn), np.full_like(turn, np.sin(half))])
    side = lambda p: (np.linalg.norm(p[..., :2], axis=-1) - (60 - p[..., 2]) * np.tan(half)) * np.cos(half)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z]), n, side


def on_torus(t):
    """The outer half: there it is convex."""
    turn, tube = 2 * np.pi * t[:, 0], np.pi / 2 * (0.01 + 0.98 * t[:, 1])
    n = np.column_stack([np.cos(tube) * np.cos(turn), np.cos(tube) * np.sin(turn), np.sin(tube)])
    ring = 40 * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    return ring + 8 * n, n, lambda p: np.hypot(np.linalg.norm(p[..., :2], axis=-1) - 40, p[..., 2]) - 8


BODIES = {"plane": on_plane, "sphere": on_sphere, "cylinder": on_cylinder, "cone": on_cone, "torus": on_torus}


def surface_of(profile, tip, axis, toward):
    """Points all over a standing cutter; one meridian runs toward a given direction."""
    x = toward - (toward @ axis) * axis
    x = x / np.linalg.norm(x) if np.linalg.norm(x) > 1e-9 else np.cross(axis, [0.6, 0.64, 0.48])
    turn = np.arange(24) * np.pi / 12
    x = x / np.linalg.norm(x)
    around = np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * np.cross(axis, x)
    outline = profile.points(1e-3)
    return tip + outline[:, None, :1] * around + outline[:, None, 1:] * axis


def check(profile, body, axis):
    contact, normal, distance = BODIES[body](np.random.default_rng(4).uniform(0, 1, (40, 2)))
    axes = np.broadcast_to(axis, contact.shape)
    gentle = np.einsum("ij,ij->i", normal, axes) > WALL
    contact, normal, axes = contact[gentle], normal[gentle], axes[gentle]
    assert len(contact) > 20
    made = cutter_locations(profile_elements(profile), contact, normal, axes)
    for tip, a, c, n in zip(made.tip_mm, made.axis, contact, normal):
        assert distance(surface_of(profile, tip, a, -n)).min() > -MM
        # the plane that touches the cutter from the material's side passes through the contact, by the profile's rule
        reach, _ = profile.support(np.array([np.arccos(-n @ a)]))
        assert (c - tip) @ -n == pytest.approx(reach[0], abs=MM)
        height = (c - tip) @ a
        assert -MM <= height <= profile.height_mm + MM
    return made


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("name", CUTTERS)
def test_a_standing_cutter_touches_at_the_contact_and_cuts_into_nothing(name, body):
    check(CUTTERS[name], body, Z)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("name", CUTTERS)
def test_a_tilted_cutter_touches_at_the_contact_and_cuts_into_nothing(name, body):
    _, normal, _ = BODIES[body](np.random.default_rng(4).uniform(0, 1, (40, 2)))
    wild = np.random.default_rng(5).normal(size=normal.shape)
    axes = normal + 0.9 * wild / np.linalg.norm(wild, axis=1)[:, None]       # never level with the surface
    check(CUTTERS[name], body, axes / np.linalg.norm(axes, axis=1)[:, None])


@pytest.mark.parametrize("radius, corner", [(6.0, 6.0), (5.0, 1.0), (5.0, 0.0)])
def test_closed_forms_of_the_three_common_cutters(radius, corner):
    contact, n, _ = on_sphere(np.random.default_rng(1).uniform(0, 1, (50, 2)))
    tips = cutter_locations(profile_elements(round_end(radius, corner)), contact, n).tip_mm
    level = n * [1, 1, 0] / np.linalg.norm(n[:, :2], axis=1)[:, None]
    np.testing.assert_allclose(tips, (20 + corner) * n + (radius - corner) * level - corner * Z, rtol=0, atol=MM)


def test_on_a_level_floor_the_contact_lies_under_the_tip():
    for profile in CUTTERS.values():
        made = cutter_locations(profile_elements(profile), [[1.0, 2.0, 3.0]], [Z])
        np.testing.assert_allclose(made.tip_mm, [[1, 2, 3]], atol=MM)


def test_an_allowance_lifts_along_the_normal():
    contact, normal, _ = on_cone(np.random.default_rng(2).uniform(0, 1, (9, 2)))
    for profile in CUTTERS.values():
        e = profile_elements(profile)
        lifted, bare = (cutter_locations(e, contact, normal, allowance_mm=a).tip_mm for a in (0.3, 0.0))
        np.testing.assert_allclose(lifted - bare, 0.3 * normal, atol=MM)


@given(seed=st.integers(0, 2 ** 32 - 1), name=st.sampled_from(sorted(CUTTERS)))
def test_tips_turn_and_shift_with_the_part(seed, name):
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    contact, normal, _ = on_torus(rng.uniform(0, 1, (5, 2)) * [1, 0.4] + [0, 0.5])
    e, shift = profile_elements(CUTTERS[name]), rng.normal(size=3) * 50
    here = cutter_locations(e, contact, normal).tip_mm
    there = cutter_locations(e, contact @ turn.T + shift, normal @ turn.T, turn @ Z).tip_mm
    np.testing.assert_allclose(there, here @ turn.T + shift, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", [n for n in CUTTERS if "dovetail" not in n])
def test_contacts_that_look_down_are_refused_with_their_rows(name):
    down = np.array([0.6, 0.0, -0.8])
    with pytest.raises(ToolpathError, match="1 of 2 contacts face away.*row 1") as error:
        cutter_locations(profile_elements(CUTTERS[name]), np.zeros((2, 3)), [Z, down])
    assert error.value.rows.tolist() == [1]


def test_a_dovetail_reaches_under_by_its_angle_and_no_further():
    lean = np.radians(30.0)
    e = profile_elements(CUTTERS["sharp dovetail"])
    under = lambda angle: np.array([[np.cos(angle), 0.0, -np.sin(angle)]])
    for angle in (0.0, lean - 1e-6, lean):
        np.testing.assert_allclose(cutter_locations(e, np.zeros((1, 3)), under(angle)).tip_mm, [[8, 0, 0]], atol=MM)
    with pytest.raises(ToolpathError):
        cutter_locations(e, np.zeros((1, 3)), under(lean + 1e-6))


def test_many_rows_in_parallel_equal_few():
    contact, normal, _ = on_cone(np.random.default_rng(1).uniform(0, 1, (SERIAL_ROWS + 1, 2)))
    e = profile_elements(CUTTERS["general"])
    many = cutter_locations(e, contact, normal).tip_mm
    np.testing.assert_array_equal(many[-9:], cutter_locations(e, contact[-9:], normal[-9:]).tip_mm)


# whole grids -------------------------------------------------------------------------------------------


def random_patch(seed, rational):
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 50, 8), np.linspace(0, 30, 7), indexing="ij")
    w = rng.uniform(0.5, 2, x.shape) if rational else np.ones_like(x)
    xyz = np.stack([x, y, 0 * x], axis=-1) + rng.normal(size=(8, 7, 3))
    knots = lambda n, p: np.r_[[0.0] * p, np.linspace(0, 1, n - p + 1), [1.0] * p]
    return NurbsSurface(degree_u=3, degree_v=2, knots_u=knots(8, 3), knots_v=knots(7, 2),
                        poles=np.concatenate([xyz * w[..., None], w[..., None]], axis=-1))


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("is_reversed", [False, True])
@pytest.mark.parametrize("radius, corner", [(6.0, 6.0), (5.0, 1.0), (5.0, 0.0)])
def test_grids_of_tips_are_those_of_single_contacts(radius, corner, is_reversed, rational):
    surface = random_patch(7, rational)
    poles = surface.poles[:, ::-1] if is_reversed else surface.poles       # mirrored in v: outward is -(Su × Sv)
    surface = NurbsSurface(degree_u=3, degree_v=2, knots_u=surface.knots_u, knots_v=surface.knots_v, poles=poles)
    patches = PatchSet.of_surfaces([random_patch(8, False), surface], [False, is_reversed])
    u, v = np.linspace(0, 1, 41), np.random.default_rng(0).uniform(0, 1, 60)
    tips = forward_tips(patches, 1, u, v, radius, corner, allowance_mm=0.1).reshape(-1, 3)
    uu, vv = (a.ravel() for a in np.meshgrid(u, v, indexing="ij"))
    d = patches.derivatives(1, uu, vv)
    n = np.cross(d[:, 1], d[:, 2]) * (-1 if is_reversed else 1)
    n /= np.linalg.norm(n, axis=1)[:, None]
    up = n[:, 2] > 1e-6
    made = cutter_locations(profile_elements(round_end(radius, corner)), d[up, 0], n[up], allowance_mm=0.1)
    np.testing.assert_allclose(tips[up], made.tip_mm, rtol=0, atol=MM)
    assert up.mean() > 0.9 and np.isnan(tips[n[:, 2] < -1e-6]).all()


def test_many_rows_of_a_grid_in_parallel_equal_few():
    patches = PatchSet.of_surfaces([random_patch(7, True)])
    u, v = np.linspace(0, 1, 200), np.linspace(0, 1, SERIAL_POINTS // 200 + 1)
    alone = forward_tips(patches, 0, u[:3], v, 5.0, 1.0)
    np.testing.assert_array_equal(forward_tips(patches, 0, u, v, 5.0, 1.0)[:3], alone)
