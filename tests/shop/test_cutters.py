"""Shapes of cutters: closed-form volumes and areas, consistency, the stack above the flutes, units of a file."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from known_tools import tool
from pydantic import ValidationError

from cuspline.app.catalogue import POSTS, find_library
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.replay.replay import columns_in, surely_cut
from cuspline.shop.cutter_profile import apt_profile, lens_profile, tangent_corner
from cuspline.shop.cutters import Cutter, HolderSegment, Tool, library_from_json
from cuspline.stock.outlines import outline_distance, outline_pieces
from cuspline.stock.swept import swept_paths
from cuspline.values.errors import InputError

PI = np.pi


def cutter(type_, diameter=10.0, **more):
    corner = {"ball": diameter / 2, "tapered_ball": diameter / 2, "flat": 0.0}.get(type_, 1.0)
    values = {"corner_radius_mm": corner, "flutes": 2, "flute_length_mm": 20.0, "neck_diameter_mm": 2.0,
              "reach_mm": 30.0, "shank_diameter_mm": 10.0, "overall_length_mm": 90.0, **more}
    return Cutter(name=type_, type=type_, diameter_mm=diameter, **values)


SHAPES = {"ball": cutter("ball"), "bull": cutter("bull_nose"), "flat": cutter("flat"),
          "dovetail": cutter("dovetail", taper_deg=8.0),
          "sharp dovetail": cutter("dovetail", corner_radius_mm=0.0, taper_deg=10),
          "tapered ball": cutter("tapered_ball", taper_deg=6.0), "lens": cutter("lens", tip_radius_mm=40.0),
          # the arc of radius 60 touches the side line 4 degrees above its equator
          "barrel": cutter("apt", 2 * (60 / np.cos(np.radians(4)) + 10 * np.tan(np.radians(4)) - 55),
                           corner_radius_mm=60.0, taper_deg=-4.0, tip_angle_deg=0.0,
                           corner_center_radius_mm=-55.0, corner_center_height_mm=10.0),
          "drill": cutter("drill", corner_radius_mm=0.0, point_angle_deg=118.0),
          "chamfer mill": cutter("chamfer_mill", corner_radius_mm=0.0, point_angle_deg=90.0, tip_diameter_mm=2.0),
          "chamfer": cutter("apt", 2.0, corner_radius_mm=0.0, taper_deg=45.0, tip_angle_deg=0.0,
                            corner_center_radius_mm=1.0, corner_center_height_mm=0.0)}


def cap_volume(r, height):
    return PI * height ** 2 * (r - height / 3)


def frustum(r0, r1, h):
    return PI * h * (r0 * r0 + r0 * r1 + r1 * r1) / 3


# shapes -------------------------------------------------------------------------------------------------


def test_a_ball_is_half_a_sphere_and_a_cylinder():
    p = SHAPES["ball"].profile
    assert p.volume_mm3 == pytest.approx(2 / 3 * PI * 125 + PI * 25 * 15, rel=1e-14)
    assert p.area_mm2 == pytest.approx(2 * PI * 25 + 10 * PI * 15, rel=1e-14)


def test_a_flat_end_mill_is_a_cylinder():
    p = SHAPES["flat"].profile
    assert p.volume_mm3 == pytest.approx(PI * 25 * 20) and p.area_mm2 == pytest.approx(PI * 25 + PI * 10 * 20)


def test_a_bull_noses_corner_is_a_quarter_of_a_torus_by_pappus():
    p, rc, a = SHAPES["bull"].profile, 1.0, 4.0
    quarter, middle = PI * rc * rc / 4, a + 4 * rc / (3 * PI)      # area and centroid of the quarter disk
    assert p.volume_mm3 == pytest.approx(PI * a * a * rc + 2 * PI * middle * quarter + PI * 25 * 19, rel=1e-14)
    arc, centroid = PI / 2 * rc, a + 2 * rc / PI
    assert p.area_mm2 == pytest.approx(PI * a * a + 2 * PI * centroid * arc + PI * 10 * 19, rel=1e-14)


def test_a_tapered_ball_is_a_cap_and_a_cone_that_touch():
    c, beta = SHAPES["tapered ball"], np.radians(6)
    height = 5 * (1 - np.sin(beta))
    top = 5 * np.cos(beta) + (20 - height) * np.tan(beta)
    p = c.profile
    assert p.volume_mm3 == pytest.approx(cap_volume(5, height) + frustum(5 * np.cos(beta), top, 20 - height), rel=1e-13)
    assert p.area_mm2 == pytest.approx(
        2 * PI * 5 * height + PI * (5 * np.cos(beta) + top) * (20 - height) / np.cos(beta), rel=1e-13)
    assert c.largest_radius_mm == pytest.approx(top) and not c.is_undercutting


def test_a_drill_is_a_cone_and_a_cylinder_and_a_chamfer_mill_has_a_flat():
    high = 5 / np.tan(np.radians(59))
    p = SHAPES["drill"].profile
    assert p.volume_mm3 == pytest.approx(frustum(0, 5, high) + PI * 25 * (20 - high), rel=1e-13)
    assert p.volume_mm3 == pytest.approx(apt_profile(*SHAPES["drill"].apt).volume_mm3, rel=1e-13)
    assert SHAPES["drill"].drills and SHAPES["drill"].plunges and not SHAPES["drill"].is_undercutting
    assert SHAPES["chamfer mill"].profile.volume_mm3 == pytest.approx(frustum(1, 5, 4) + PI * 25 * 16, rel=1e-13)
    columns = columns_in(SHAPES["chamfer mill"])
    np.testing.assert_allclose(columns[1:, 2], columns[1:, 0] - 1.0, atol=1e-12)       # all within the cone of 90 degrees
    assert columns[-1, 0] == 5.0 and np.diff(columns[1:, 2]).max() < 0.0501


def test_points_that_cannot_be_are_refused():
    for wrong, why in (({"point_angle_deg": None}, "needs point_angle_deg"), ({"tip_diameter_mm": 1.0}, "has no tip_diameter_mm"),
                       ({"point_angle_deg": 118.0, "flute_length_mm": 2.0}, "the cone of the point"),
                       ({"point_angle_deg": 118.0, "corner_radius_mm": 1.0}, "has corner_radius_mm 0")):
        with pytest.raises(ValidationError, match=why):
            cutter("drill", **{"corner_radius_mm": 0.0, "point_angle_deg": 118.0, **wrong})


def test_a_sharp_dovetail_is_a_cone_widest_at_the_bottom():
    c = SHAPES["sharp dovetail"]
    top = 5 - 20 * np.tan(np.radians(10))
    assert c.profile.volume_mm3 == pytest.approx(frustum(5, top, 20), rel=1e-13)
    assert c.largest_radius_mm == 5 and c.profile.top_radius_mm == pytest.approx(top)


def test_a_lens_is_a_cap_a_torus_corner_and_a_cylinder():
    p = SHAPES["lens"].profile
    join, height = p.end_mm[0], p.start_mm[-1, 1]
    e, f = 4.0, 40 - np.sqrt(39 ** 2 - 16)
    assert p.start_mm[-1] == pytest.approx((5.0, f))
    assert np.hypot(join[0], join[1] - 40) == pytest.approx(40)
    assert np.hypot(join[0] - e, join[1] - f) == pytest.approx(1)
    z = np.linspace(join[1], height, 200_001)
    corner = np.trapezoid(PI * (e + np.sqrt(np.maximum(1 - (z - f) ** 2, 0))) ** 2, z)
    assert p.volume_mm3 == pytest.approx(cap_volume(40, join[1]) + corner + PI * 25 * (20 - height), rel=1e-8)


@pytest.mark.parametrize("shape", SHAPES)
def test_volume_and_area_are_those_of_a_finely_broken_outline(shape):
    p = SHAPES[shape].profile
    r, z = p.points(1e-7).T
    volume = (PI * np.diff(z) * (r[1:] ** 2 + r[1:] * r[:-1] + r[:-1] ** 2) / 3).sum()
    area = (PI * (r[1:] + r[:-1]) * np.hypot(np.diff(r), np.diff(z))).sum()
    assert p.volume_mm3 == pytest.approx(volume, rel=1e-6) and p.area_mm2 == pytest.approx(area, rel=1e-6)
    assert p.largest_radius_mm == pytest.approx(r.max(), abs=1e-6) and p.height_mm == pytest.approx(20)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_plane_pressed_against_the_cutter_touches_its_farthest_point(shape):
    p = SHAPES[shape].profile
    angle = np.linspace(0, PI, 301)
    far, point = p.support(angle)
    outline = p.points(1e-6)
    brute = (outline @ np.vstack([np.sin(angle), np.cos(angle)])).max(axis=0)
    np.testing.assert_allclose(far, brute, atol=2e-6)
    np.testing.assert_allclose(np.einsum("ij,ji->i", point, np.vstack([np.sin(angle), np.cos(angle)])), far, atol=1e-12)


def test_dovetails_and_barrels_undercut_and_no_other_type_does():
    assert {n for n, c in SHAPES.items() if c.is_undercutting} == {"dovetail", "sharp dovetail", "barrel"}


@given(d=st.floats(2, 40), share=st.floats(0.05, 0.9), alpha=st.floats(0, 0.4), beta=st.floats(-0.3, 0.6))
def test_the_tangent_corner_leaves_one_line_and_joins_the_other_without_a_kink(d, share, alpha, beta):
    r = share * d / 4
    e, f = tangent_corner(d, r, alpha, beta)
    p = apt_profile(d, r, e, f, alpha, beta, f - r * np.sin(beta) + 1e-3)
    first, last = p.arc_angles_rad[p.is_arc][0]
    assert first == pytest.approx(alpha - PI / 2, abs=1e-6) and last == pytest.approx(-beta, abs=1e-6)
    assert [bool(a) for a in p.is_arc] == [False, True, False]


@pytest.mark.parametrize("values, message", [
    (dict(d=10, r=2, e=3, f=5, alpha=0, beta=0, h=20), "misses the bottom line by 3 mm"),
    (dict(d=10, r=2, e=1, f=2, alpha=0, beta=0, h=20), "misses the side line by 2 mm"),
    (dict(d=10, r=0, e=4, f=0, alpha=0, beta=0, h=20), "sharp corner is where the lines cross: e = 5"),
    (dict(d=10, r=2, e=3, f=2, alpha=0, beta=0, h=1), "above the height of 1 mm"),
    (dict(d=4, r=0, e=2, f=0, alpha=0, beta=-0.5, h=20), "crosses the tool axis")])
def test_an_apt_shape_that_cannot_be_says_why(values, message):
    with pytest.raises(ValueError, match=message):
        apt_profile(**values)


def test_a_lens_whose_arcs_cannot_join_is_refused():
    with pytest.raises(ValueError, match="0 < corner_radius_mm < diameter_mm/2 < tip_radius_mm"):
        lens_profile(10, 4, 1, 20)


@pytest.mark.parametrize("type_, more, message", [
    ("dovetail", {}, "dovetail cutter needs taper_deg"), ("ball", {"taper_deg": 3.0}, "ball cutter has no taper_deg"),
    ("dovetail", {"taper_deg": -3.0}, "taper_deg > 0"), ("lens", {}, "lens cutter needs tip_radius_mm"),
    ("tapered_ball", {"taper_deg": 3.0, "corner_radius_mm": 2.0}, "has corner_radius_mm 5.0"),
    ("dovetail", {"taper_deg": 10.0, "neck_diameter_mm": 8.0}, "must not exceed the 2.9.* mm of the flutes"),
    ("ball", {"shaft_segments": [{"height_mm": 3, "lower_diameter_mm": 2, "upper_diameter_mm": 9}]}, "3 mm high"),
    ("apt", {"taper_deg": 0.0, "tip_angle_deg": 0.0, "corner_center_radius_mm": 1.0, "corner_center_height_mm": 1.0},
     "misses the side line")])
def test_measures_that_do_not_go_together_are_refused(type_, more, message):
    with pytest.raises(ValidationError, match=message):
        cutter(type_, **more)


# stack ----------------------------------------------------------------------------------------------------


def test_a_conical_neck_is_cut_off_where_the_holder_begins():
    neck = (HolderSegment(height_mm=10, lower_diameter_mm=4, upper_diameter_mm=8),)
    c = cutter("ball", neck_diameter_mm=4.0, shaft_segments=neck)
    holder = tool("ball", 10).holder
    short = Tool(number=1, cutter=c, holder=holder, stick_out_mm=25.0)
    np.testing.assert_allclose(short.non_cutting_frusta()[0], (20, 2, 25, 3))
    long = Tool(number=1, cutter=c, holder=holder, stick_out_mm=40.0)
    np.testing.assert_allclose(long.non_cutting_frusta()[:2], [(20, 2, 30, 4), (30, 5, 40, 5)])


def test_stick_out_and_holder_are_never_guessed():
    t = tool("ball", 10).model_dump()
    for field in ("stick_out_mm", "holder"):
        with pytest.raises(ValidationError, match=field):
            Tool(**{k: v for k, v in t.items() if k != field})


# simulation -----------------------------------------------------------------------------------------------


def test_a_tapered_ball_read_from_a_program_is_simulated():
    t = Tool(number=4, cutter=SHAPES["tapered ball"], holder=tool("ball", 10).holder, stick_out_mm=45.0)
    posted = read_program("G21 G54\nT4 M6\nG43 H4\nG0 X0 Y0 Z5\nG1 X9 F100\nM2\n", work_offsets={"G54": (0, 0, 0)},
                          tool_lengths={4: t.length_mm})
    paths = swept_paths(posted, {4: t})
    assert [p.tool.number for p in paths] == [4] and paths[0].is_height_field


# files ----------------------------------------------------------------------------------------------------


def saved(tmp_path, *tools):
    path = tmp_path / "mine.json"
    path.write_text(json.dumps({"tools": list(tools)}))
    return path


def without_units(value):
    if isinstance(value, list):
        return [without_units(v) for v in value]
    if not isinstance(value, dict):
        return value
    return {k.removesuffix("_mm"): without_units(v) for k, v in value.items()}


def in_inches(value):
    if isinstance(value, list):
        return [in_inches(v) for v in value]
    if not isinstance(value, dict):
        return value
    return {k.removesuffix("_mm"): v / 25.4 if k.endswith("_mm") else in_inches(v) for k, v in value.items()}


def test_every_tool_of_a_file_may_have_its_own_unit(tmp_path):
    shop = [t.model_dump(mode="json") for t in find_library(None).tools[:3]]
    path = saved(tmp_path, {"unit": "inch", **in_inches(shop[0])}, {"unit": "mm", **without_units(shop[1])}, shop[2])
    for read, wanted in zip(library_from_json(path).tools, find_library(None).tools):
        assert read.cutter.diameter_mm == pytest.approx(wanted.cutter.diameter_mm, rel=1e-15)
        np.testing.assert_allclose(read.non_cutting_frusta(), wanted.non_cutting_frusta(), rtol=1e-14)
        assert read.cutter.flutes == wanted.cutter.flutes


@pytest.mark.parametrize("change, message", [
    ({"unit": "cm"}, "tools.0.unit: 'cm' is no unit"), ({"unit": "inch"}, "stick_out_mm: this tool is in inches")])
def test_a_unit_that_cannot_be_meant_is_refused(tmp_path, change, message):
    shop = tool("ball", 10).model_dump(mode="json")
    del shop["cutter"], shop["holder"]
    with pytest.raises(InputError, match=message):
        library_from_json(saved(tmp_path, {**shop, **change}))


def test_the_shops_file_is_written_as_it_was_read():
    raw = json.loads((POSTS / "tools" / "tools.json").read_text())
    assert [t.model_dump(mode="json") for t in find_library(None).tools] == raw["tools"]


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_reads_back_as_it_was_written(tmp_path, shape):
    t = Tool(number=1, cutter=SHAPES[shape], holder=tool("ball", 10).holder, stick_out_mm=45.0)
    assert library_from_json(saved(tmp_path, t.model_dump(mode="json"))).tools[0] == t


@pytest.mark.parametrize("name", SHAPES)
def test_what_is_surely_cut_lies_in_the_cutter(name):
    """The replay takes a plain column for cutters it does not know: no point of it may stand outside them."""
    cutter = SHAPES[name]
    a, rc = surely_cut(cutter)
    outline = outline_pieces(cutter.profile, name)
    z = np.linspace(0.0, cutter.profile.height_mm, 400)
    r = a + np.sqrt(np.maximum(rc ** 2 - np.maximum(rc - z, 0.0) ** 2, 0.0))
    assert max(outline_distance(x, y, outline, 0, len(outline))[0] for x, y in zip(r, z)) < 1e-9


@pytest.mark.parametrize("name", SHAPES)
def test_points_on_the_outline_are_on_it(name):
    """Rounding puts some of them outside one piece's plane and inside the piece itself: none may come out far away."""
    profile = SHAPES[name].profile
    outline, t = outline_pieces(profile, name), np.linspace(0.0, 1.0, 301)[:, None]
    turn = profile.arc_angles_rad[:, :1] + t.T * np.diff(profile.arc_angles_rad, axis=1)
    for k in range(len(profile.start_mm)):
        points = profile.start_mm[k] + t * (profile.end_mm[k] - profile.start_mm[k])
        if profile.is_arc[k]:
            points = profile.center_mm[k] + profile.arc_radius_mm[k] * np.column_stack([np.cos(turn[k]), np.sin(turn[k])])
        far = [outline_distance(abs(r), z, outline, 0, len(outline))[0] for r, z in points]
        assert np.abs(far).max() < 1e-12
