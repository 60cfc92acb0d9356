"""Depths of cutters that turn as they move, against exact faces: closed forms, brute force, and how near the bounds come."""

import math

import cadquery as cq
import numpy as np
import pytest
from leaning_surface import HALF_MM, poles_mm, solid

from cuspline.kernel import brep
from cuspline.replay.leaning_loads import _put_depths
from cuspline.shop.cutters import Cutter
from cuspline.stock.tilted_pieces import AXIS, AXIS_WAY, LENGTH, TIP, TURN, WAY
from cuspline.toolpaths.gouge.leaning_depths import FaceBoxes, body_outline
from cuspline.values.errors import ToolpathError

TOLERANCE_MM = 0.0005
COMMON = dict(name="t", flutes=2, flute_length_mm=22.0, neck_diameter_mm=4.0, reach_mm=30.0, shank_diameter_mm=10.0,
              overall_length_mm=80.0)
FORMS = {"bull nose": dict(type="bull_nose", diameter_mm=10, corner_radius_mm=1.0),
         "flat": dict(type="flat", diameter_mm=10, corner_radius_mm=0.0),
         "lens": dict(type="lens", diameter_mm=10, corner_radius_mm=1, tip_radius_mm=40.0),
         "tapered ball": dict(type="tapered_ball", diameter_mm=6, corner_radius_mm=3, taper_deg=5.0),
         "barrel": dict(type="apt", diameter_mm=10, corner_radius_mm=30.0, tip_angle_deg=20.0, taper_deg=0.0,
                        corner_center_radius_mm=-25.0, corner_center_height_mm=16.0)}


def outline_of(form):
    return body_outline(Cutter(**COMMON, **FORMS[form]))


def substeps(tips, axes):
    """Between neighbouring rows (n, 3) of tips and axes."""
    g = np.zeros((len(tips) - 1, 14))
    g[:, TIP:WAY], g[:, WAY:AXIS] = tips[:-1], np.diff(tips, axis=0)
    g[:, AXIS:AXIS_WAY], g[:, AXIS_WAY:LENGTH] = axes[:-1], np.diff(axes, axis=0)
    chord = np.linalg.norm(g[:, AXIS_WAY:LENGTH], axis=1)
    g[:, LENGTH], g[:, TURN] = np.linalg.norm(g[:, WAY:AXIS], axis=1), chord / np.sqrt(1 - chord ** 2 / 4)
    return g


def depths_by_sampling(g, outline, places, times=41):
    """(n,) deepest of places (m, 3) in the cutter at times of each sub-step."""
    found = []
    for row in g:
        deepest = -np.inf
        for t in np.linspace(0.0, 1.0, times):
            axis = row[AXIS:AXIS_WAY] + t * row[AXIS_WAY:LENGTH]
            axis = axis / np.linalg.norm(axis)
            off = places - (row[TIP:WAY] + t * row[WAY:AXIS])
            up = off @ axis
            out = np.linalg.norm(off - up[:, None] * axis, axis=1)
            distance = np.empty(len(out))
            _put_depths(out, up, outline, distance)
            deepest = max(deepest, -distance.min())
        found.append(deepest)
    return np.array(found)


def on_saddle(count):
    """(n, 3) places on the saddle's top."""
    s = np.linspace(-1, 1, count)
    b = np.stack([(1 - s) ** 2 / 4, (1 - s * s) / 2, (1 + s) ** 2 / 4])
    return np.einsum("ia,jb,ijk->abk", b, b, poles_mm("saddle")).reshape(-1, 3)


@pytest.fixture(scope="module")
def saddle():
    return FaceBoxes.of_solid(brep.the_solid(solid("saddle")), 0.02)


@pytest.fixture(scope="module")
def block():
    return FaceBoxes.of_solid(brep.the_solid(cq.Workplane().box(60, 60, 20, centered=(True, True, False)).val()), 0.02)


def leaned(lead_rad, bearing_rad=0.0):
    return np.column_stack([np.sin(lead_rad) * np.cos(bearing_rad), np.sin(lead_rad) * np.sin(bearing_rad), np.cos(lead_rad)])


@pytest.mark.parametrize("form", ["bull nose", "lens", "tapered ball"])
def test_depth_in_a_plane_is_what_the_outline_s_support_says(block, form):
    """The plane stands 0.01 above the lowest place where the cutter leans most or least of all its way: at an end."""
    cutter, lead = Cutter(**COMMON, **FORMS[form]), np.radians([12.0, 13.5])
    axes = leaned(lead)
    low = -cutter.profile.support(np.pi - lead)[0]
    tips = np.column_stack([[-4.0, -3.0], [1.0, 1.5], 20.0 - low - 0.01])
    depth, share, place = block.depths(substeps(tips, axes), outline_of(form), TOLERANCE_MM)
    t = np.linspace(0, 1, 2001)
    axis = axes[0] + t[:, None] * (axes[1] - axes[0])
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    true = (20.0 - (tips[0, 2] + t * (tips[1, 2] - tips[0, 2]) - cutter.profile.support(np.pi - np.arccos(axis[:, 2]))[0])).max()
    assert -1e-6 < depth[0] - true < TOLERANCE_MM
    assert place[0, 2] == pytest.approx(20.0, abs=1e-9) and 0.0 <= share[0] <= 1.0


def test_a_sharp_corner_pushed_in_is_as_deep_as_the_wedge_that_is_cut_off_is_thick(block):
    """A corner leaning by L whose edge is p below the plane: places of the plane are p / (sin L + cos L) deep at the most."""
    lead, pushed_mm = math.radians(12.0), 0.01
    tips = np.array([[-4.0, 1.0, 20.0 + 5.0 * math.sin(lead) - pushed_mm], [-3.0, 1.5, 20.0 + 5.0 * math.sin(lead) - pushed_mm]])
    depth, _, _ = block.depths(substeps(tips, np.tile(leaned(lead), (2, 1))), outline_of("flat"), TOLERANCE_MM)
    assert -1e-6 < depth[0] - pushed_mm / (math.sin(lead) + math.cos(lead)) < TOLERANCE_MM


@pytest.mark.parametrize("form", FORMS)
def test_no_place_on_a_saddle_is_deeper_than_the_bound_nor_much_less_deep(saddle, form):
    """Against 121 x 121 places at 41 times; these miss what lies between them by their spacing squared over the radii."""
    rng = np.random.default_rng(3)
    at, turn = rng.uniform(-0.5, 0.5, (4, 2)) * 2 * HALF_MM * 0.5, rng.uniform(0, 2 * np.pi, 4)
    outline, places = outline_of(form), on_saddle(121)
    for (x, y), bearing in zip(at, turn):
        height = 10.0 + 3 * (x / 16) ** 2 - 3 * (y / 12) ** 2
        tips = np.array([[x, y, height], [x + 0.6, y - 0.3, height - 0.05]])
        g = substeps(tips, leaned(np.radians([14.0, 15.2]), bearing + np.array([0.0, 0.05])))
        depth, _, _ = saddle.depths(g, outline, TOLERANCE_MM)
        true = depths_by_sampling(g, outline, places)
        assert true[0] < depth[0] < max(1.02 * true[0], 0.0) + 0.01


def test_a_cutter_that_only_touches_is_proven_clean_and_a_skin_is_left_out(block):
    outline, lead = outline_of("bull nose"), math.radians(8.0)
    low = math.cos(lead) - 1.0 - 4.0 * math.sin(lead)
    tips = np.column_stack([np.linspace(-20, 20, 9), np.linspace(3, -2, 9), np.full(9, 20.0 - low)])
    g = substeps(tips, np.tile(leaned(lead), (9, 1)))
    depth, _, _ = block.depths(g, outline, TOLERANCE_MM)
    assert depth.max() < TOLERANCE_MM
    g[:, TIP + 2] -= 0.02
    assert block.depths(g, outline, TOLERANCE_MM)[0].min() > 0.02
    assert block.depths(g, outline, TOLERANCE_MM, 0.02)[0].max() < TOLERANCE_MM


def test_over_an_edge_what_the_face_does_not_have_is_not_met(block):
    """The face's plane goes on beyond its edge; the cutter beside it stands in that plane, and touches the edge alone."""
    outline, lead = outline_of("bull nose"), math.radians(8.0)
    tips = np.array([[-30.0 - 5.2, -2.0, 18.0], [-30.0 - 5.2, 3.0, 18.0]])
    depth, _, _ = block.depths(substeps(tips, np.tile(leaned(-lead), (2, 1))), outline, TOLERANCE_MM)
    assert depth[0] < TOLERANCE_MM


def test_a_tolerance_finer_than_borders_are_known_to_is_refused(block):
    with pytest.raises(ToolpathError, match="finer than"):
        block.depths(np.zeros((1, 14)), outline_of("flat"), 1e-5)
