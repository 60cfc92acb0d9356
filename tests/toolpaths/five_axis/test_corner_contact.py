"""A leaning bull nose or flat cutter: where its tip is, how wide it cuts, and that it gouges where its bend says so."""

import math

import numpy as np
import pytest
from leaning_surface import HALF_MM, solid

from cuspline.kernel import brep
from cuspline.planning.corner_gouges import bottom_depths_mm, least_bend_per_mm
from cuspline.scallop.cusp import Stance, cutter_scallop_mm, effective_radius_mm
from cuspline.scallop.stepover import stepover_for_scallop_mm
from cuspline.shop.cutter_profile import apt_profile
from cuspline.shop.cutters import Cutter
from cuspline.surfaces.projection import ClosestTree
from cuspline.toolpaths.five_axis.corner_contact import CornerContact
from cuspline.values.errors import ToolpathError

RNG = np.random.default_rng(7)


def corner(radius=5.0, corner_radius=1.0, lead_deg=12.0, tilt_deg=0.0):
    return CornerContact(radius_mm=radius, corner_radius_mm=corner_radius, lead_rad=math.radians(lead_deg),
                         tilt_rad=math.radians(tilt_deg))


def posed(c, normals, feeds):
    """Axes, and tips from contacts, at the corner's own lead and tilt."""
    ahead = np.cos(c.lead_rad) * normals + np.sin(c.lead_rad) * feeds
    axes = np.cos(c.tilt_rad) * ahead + np.sin(c.tilt_rad) * np.cross(feeds, normals)
    return axes, c.ball_radius_mm * normals + c.tips_off(normals, axes)


@pytest.mark.parametrize("corner_radius", [0.0, 0.8, 2.0])
@pytest.mark.parametrize("lead, tilt", [(5.0, 0.0), (-20.0, 0.0), (10.0, 15.0), (0.0, -30.0)])
def test_it_touches_the_plane_at_its_contact_and_nowhere_enters_it(corner_radius, lead, tilt):
    """The farthest the cutter reaches against the normal is the contact: by the profile's own support."""
    c = corner(corner_radius=corner_radius, lead_deg=lead, tilt_deg=tilt)
    normals = RNG.normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    feeds = np.cross(normals, (0.3, -0.2, 0.9))
    feeds /= np.linalg.norm(feeds, axis=1)[:, None]
    axes, tips = posed(c, normals, feeds)
    profile = apt_profile(10, corner_radius, 5 - corner_radius, corner_radius, 0, 0, 20)
    below = -(axes * normals).sum(axis=1)
    far, _ = profile.support(np.arccos(below))              # of the plane against the normal, from the tip
    assert np.abs((tips * normals).sum(axis=1) - far).max() < 1e-9
    middle = tips + corner_radius * axes
    assert np.abs(np.linalg.norm(middle - corner_radius * normals, axis=1) - (5 - corner_radius)).max() < 1e-9


FORMS = {"lens": (dict(type="lens", diameter_mm=10, corner_radius_mm=1, tip_radius_mm=40.0), 4.0, (40.0, 0.0)),
         "rim of a lens": (dict(type="lens", diameter_mm=10, corner_radius_mm=1, tip_radius_mm=40.0), 25.0, (1.0, 4.0)),
         "tapered ball": (dict(type="tapered_ball", diameter_mm=6, corner_radius_mm=3, taper_deg=5.0), 30.0, (3.0, 0.0)),
         "barrel": (dict(type="apt", diameter_mm=10, corner_radius_mm=30.0, tip_angle_deg=20.0, taper_deg=0.0,
                         corner_center_radius_mm=-25.0, corner_center_height_mm=16.0), 80.0, (30.0, -25.0))}


@pytest.mark.parametrize("form", FORMS)
def test_of_any_form_it_touches_with_the_arc_that_its_lean_presses_on_the_plane(form):
    """The contact is the profile's own support there; across the feed it is as round as that arc and its middle say."""
    shape, lead_deg, (arc, out) = FORMS[form]
    cutter = Cutter(**{**dict(name="t", flutes=2, flute_length_mm=22.0, neck_diameter_mm=4.0, reach_mm=30.0,
                              shank_diameter_mm=10.0, overall_length_mm=80.0), **shape})
    c = CornerContact.of(cutter, math.radians(lead_deg), 0.0)
    normals, feeds = np.array([[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]]), np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6]])
    axes, tips = posed(c, normals, feeds)
    far, place = cutter.profile.support(np.full(2, np.pi - math.radians(lead_deg)))
    assert np.abs((tips * normals).sum(axis=1) - far).max() < 1e-9
    assert np.abs((-tips * axes).sum(axis=1) - place[:, 1]).max() < 1e-9           # the contact's height above the tip
    assert c.corner_radius_mm == pytest.approx(arc) and c.across_mm == pytest.approx(
        arc + out / math.sin(math.radians(lead_deg)))


def test_no_place_of_a_barrel_is_looked_for_where_the_barrel_is_not():
    """Its arc is not round the axis: half way down its lean the circle is far beyond the tip."""
    shape, _, _ = FORMS["barrel"]
    cutter = Cutter(name="t", flutes=2, flute_length_mm=24.0, neck_diameter_mm=4.0, reach_mm=30.0, shank_diameter_mm=10.0,
                    overall_length_mm=80.0, **shape)
    c, lean = CornerContact.of(cutter, math.radians(75.0), 0.0), math.radians(75.0)
    places = c.bottom_mm(36, 8)
    far, _ = cutter.profile.support(np.array([np.pi - lean]))
    normal = np.array([math.sin(lean), 0.0, math.cos(lean)])            # of a wall, the axis along Z
    assert len(places) > 200 and (places @ normal).min() >= -far[0] - 1e-9
    assert places[:, 2].min() >= 0.0 and np.hypot(*places[:, :2].T).max() <= 5.0 + 1e-9


@pytest.mark.parametrize("lead, radius, step", [(5, 9.7148, 0.17632), (10, 4.8914, 0.12511), (20, 2.4987, 0.08942)])
def test_across_the_feed_it_is_as_round_as_its_effective_radius(lead, radius, step):
    """R 0.875 in, insert 0.031 in; the steps for 0.0004 in."""
    c = corner(0.875, 0.031, lead)
    assert c.across_mm == pytest.approx(radius, abs=5e-5) == effective_radius_mm(0.875, 0.031, c.lead_rad)
    assert stepover_for_scallop_mm(c.across_mm, 0.0004, 0.0)[0] == pytest.approx(step, abs=1e-5)


@pytest.mark.parametrize("lead, tilt", [(12.0, 0.0), (12.0, 8.0), (6.0, -6.0)])
def test_a_tilt_across_narrows_what_it_cuts_as_its_silhouette_says(lead, tilt):
    c = corner(lead_deg=lead, tilt_deg=tilt)
    profile, step = apt_profile(10, 1, 4, 1, 0, 0, 20), 0.3
    exact = cutter_scallop_mm(profile, step, 0.0, Stance(lead_rad=c.lead_rad, tilt_rad=c.tilt_rad))[0]
    assert step ** 2 / (8 * c.across_mm) == pytest.approx(exact, rel=0.03)


def test_one_that_stands_along_the_normal_is_refused():
    with pytest.raises(ToolpathError, match="leans by 0.5 degrees from the normal: give it a lead_deg of 1 or more"):
        corner(lead_deg=0.5)


@pytest.fixture(scope="module")
def saddle():
    """Closest points of all faces, of the top alone, and contacts on it: z = 10 + 3 s² - 3 t²."""
    faces = brep.faces_of(brep.the_solid(solid("saddle")))
    top = [f for f in faces if f.middle.normal[0, 2] > 0.9]
    s, t = RNG.uniform(-0.7, 0.7, (2, 60))
    places = np.column_stack([HALF_MM[0] * s, HALF_MM[1] * t, 10 + 3 * s ** 2 - 3 * t ** 2])
    normals = np.column_stack([-6 * s / HALF_MM[0], 6 * t / HALF_MM[1], np.ones(60)])
    return ClosestTree.of_faces(faces), ClosestTree.of_faces(top), places, normals / np.linalg.norm(normals, axis=1)[:, None]


@pytest.mark.parametrize("along_x, lead, fits", [(True, 12.0, True), (False, 12.0, True), (False, 4.0, False)])
def test_a_cutter_too_flat_for_the_hollow_across_its_feed_gouges(saddle, along_x, lead, fits):
    """The hollow runs along x, of radius 43 mm and up; R 5 at 4 degrees is as flat as R 58 across its feed, at 12 as R 20."""
    part, top, places, normals = saddle
    c = corner(lead_deg=lead)
    feeds = np.cross(np.array([0.0, 1.0, 0.0]) if along_x else np.array([-1.0, 0.0, 0.0]), normals)
    feeds /= np.linalg.norm(feeds, axis=1)[:, None]
    axes, tips = posed(c, normals, feeds)
    bend = least_bend_per_mm(top, places, normals, axes, c)
    depth = bottom_depths_mm(part, places + tips, axes, c)
    assert (bend > 0).all() == fits and (depth < 1e-6).all() == fits
    if not fits:
        assert (bend < 0).mean() > 0.5 and depth.max() > 0.003


def test_depths_of_a_bottom_pushed_in_are_those_of_the_push(saddle):
    part, _, places, normals = saddle
    c = corner(lead_deg=20.0)
    feeds = np.cross(np.array([0.0, 1.0, 0.0]), normals)
    feeds /= np.linalg.norm(feeds, axis=1)[:, None]
    axes, tips = posed(c, normals, feeds)
    depth = bottom_depths_mm(part, places + tips - 0.1 * normals, axes, c)
    assert depth.max() < 0.1 + 1e-4 and np.median(depth) > 0.07
