"""The mould block: every variant is a valid solid of the exact volume, bad parameters are named."""

import math

import numpy as np
import pytest
from annotated_types import Ge, Gt, Le, Lt
from pydantic import ValidationError

from cuspline.designs.z_profile import ZProfile, design, profile_knots
from cuspline.kernel.brep import bounding_box_mm, faces_of, select_faces, the_solid, volume_mm3

VARIANTS = {
    "default": {}, "YZ": {"section_plane": "YZ"}, "up": {"sweep_slope_deg": 12},
    "down": {"sweep_slope_deg": -3, "height_mm": 50}, "up YZ": {"section_plane": "YZ", "sweep_slope_deg": 8},
    "down YZ": {"section_plane": "YZ", "sweep_slope_deg": -6, "height_mm": 50},
    "lofted": {"far_scale": 0.85}, "lofted YZ": {"section_plane": "YZ", "far_scale": 0.8},
    "gentle": {"slope_deg": 30, "slope_length_mm": 15, "step_mm": 6, "length_mm": 160},
    "tall ellipse": {"ellipse_a_mm": 20, "ellipse_b_mm": 26},
}
NUMBERS = [n for n, f in ZProfile.model_fields.items() if f.annotation is float]


def profile_area_mm2(p):
    """Area under the profile, element by element in closed form; the spline by Gauss on its cubic."""
    k, a, e = profile_knots(p), math.radians(p.slope_deg), math.radians(p.ellipse_deg)
    under_arc = lambda r, angle: r * r * (angle + math.sin(angle) * math.cos(angle)) / 2      # 0..angle off the top
    convex = under_arc(p.convex_radius_mm, a) + k["convex_end"][0] * (p.height_mm - p.convex_radius_mm)
    trapezoid = lambda m, n: (k[n][0] - k[m][0]) * (k[m][1] + k[n][1]) / 2
    r = p.concave_radius_mm
    concave = r * math.sin(a) * (k["floor"][1] + r) - under_arc(r, a)
    ellipse = (p.ellipse_a_mm * p.ellipse_b_mm * (e + math.sin(e) * math.cos(e)) / 2
               + p.ellipse_a_mm * math.sin(e) * (k["top"][1] - p.ellipse_b_mm))
    return (convex + trapezoid("convex_end", "slope_end") + concave + trapezoid("floor", "foot") + ellipse
            + under_spline(p, k, e) + trapezoid("spline_end", "land_end"))


def under_spline(p, k, e):
    """A cubic over 0..1 whose derivatives' coordinates add up to its extent in both directions."""
    start, end = np.array(k["ellipse_end"]), np.array(k["spline_end"])
    slope = p.ellipse_b_mm * math.sin(e) / (p.ellipse_a_mm * math.cos(e))
    reach = np.abs(end - start).sum()
    t0, t1 = np.array((1, -slope)) / (1 + slope), np.array((1.0, 0.0))
    b = np.array([start, start + t0 * reach / 3, end - t1 * reach / 3, end])
    node, weight = np.polynomial.legendre.leggauss(6)
    t = (node[:, None] + 1) / 2
    up = (1 - t) ** 3 * b[0] + 3 * t * (1 - t) ** 2 * b[1] + 3 * t * t * (1 - t) * b[2] + t ** 3 * b[3]
    speed = 3 * ((1 - t) ** 2 * (b[1] - b[0]) + 2 * t * (1 - t) * (b[2] - b[1]) + t * t * (b[3] - b[2]))
    return float((weight / 2) @ (up[:, 1] * speed[:, 0]))


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_is_one_valid_solid_with_its_profile_faces(name):
    d = design(ZProfile(**VARIANTS[name]))
    faces = faces_of(the_solid(d.solid))
    assert len(select_faces(faces, d.predicates[0])) == 8
    low, high = bounding_box_mm(the_solid(d.solid))
    assert (low >= np.array(d.stock.min_mm) - 1e-6).all() and (high <= np.array(d.stock.max_mm) + 1e-6).all()


@pytest.mark.parametrize("name", VARIANTS)
def test_the_volume_is_the_exact_integral_of_the_profile(name):
    p = ZProfile(**VARIANTS[name])
    area, rise = profile_area_mm2(p), math.tan(math.radians(p.sweep_slope_deg))
    exact = area * p.width_mm * (1 + p.far_scale) / 2 + p.length_mm * rise * p.width_mm ** 2 / 2
    assert volume_mm3(the_solid(design(p).solid)) == pytest.approx(exact, rel=1e-7)


def test_the_profile_holds_every_kind_of_element():
    d = design(ZProfile())
    kinds = sorted(f.kind for f in select_faces(faces_of(the_solid(d.solid)), d.predicates[0]))
    assert kinds.count("cylinder") == 2 and kinds.count("plane") == 4 and kinds.count("extrusion") == 2


def test_planes_zx_and_yz_give_the_same_part_turned():
    zx, yz = (volume_mm3(the_solid(design(ZProfile(section_plane=s)).solid)) for s in ("ZX", "YZ"))
    assert zx == pytest.approx(yz, rel=1e-9)


def test_the_same_parameters_give_the_same_design():
    a, b = design(ZProfile()), design(ZProfile())
    assert a.predicates == b.predicates and a.setups == b.setups and a.stock == b.stock
    assert volume_mm3(the_solid(a.solid)) == volume_mm3(the_solid(b.solid))


# parameters -------------------------------------------------------------------------------------------


def limits(name):
    """(low, high) of a field."""
    rules = ZProfile.model_fields[name].metadata
    low = next(getattr(r, "ge", getattr(r, "gt", None)) for r in rules if isinstance(r, (Ge, Gt)))
    high = next(getattr(r, "le", getattr(r, "lt", None)) for r in rules if isinstance(r, (Le, Lt)))
    return low, high


@pytest.mark.parametrize("name", NUMBERS)
def test_a_value_outside_its_range_is_refused_by_name(name):
    low, high = limits(name)
    for value in (low - 1e-3 * max(1.0, abs(low)), high + 1e-3 * max(1.0, abs(high)), math.nan, math.inf, -math.inf):
        with pytest.raises(ValidationError) as error:
            ZProfile(**{name: value})
        assert error.value.errors()[0]["loc"] == (name,)


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("end", [0, 1])
def test_a_value_at_the_end_of_its_range_is_built_or_refused_with_a_number(name, end):
    try:
        p = ZProfile(**{name: limits(name)[end]})
    except ValidationError as error:
        assert any(c.isdigit() for c in error.errors()[0]["msg"])
        return
    the_solid(design(p).solid)


@pytest.mark.parametrize("bad", [{"section_plane": "XY"}, {"lenght_mm": 120}, {"width_mm": "wide"}])
def test_unknown_names_and_wrong_kinds_are_refused_by_name(bad):
    with pytest.raises(ValidationError) as error:
        ZProfile(**bad)
    assert error.value.errors()[0]["loc"] == tuple(bad)


def test_a_profile_longer_than_the_block_is_refused_with_the_length_it_needs():
    with pytest.raises(ValidationError, match=r"needs 139\.99 mm and 2 mm of land, length_mm is 120"):
        ZProfile(floor_length_mm=45)


def test_a_profile_that_runs_into_the_base_is_refused_with_its_height():
    with pytest.raises(ValidationError, match=r"comes down to -?\d+\.\d\d mm above the base"):
        ZProfile(sweep_slope_deg=-15)


def test_loft_and_slope_together_are_refused():
    with pytest.raises(ValidationError, match="exclude each other"):
        ZProfile(far_scale=0.9, sweep_slope_deg=3)


def test_parameters_cannot_be_changed_afterwards():
    with pytest.raises(ValidationError):
        ZProfile().width_mm = 3.0


def test_every_parameter_has_its_unit_and_a_line_of_explanation():
    for name, field in ZProfile.model_fields.items():
        assert field.description, name
        if field.annotation is float:
            assert name.endswith(("_mm", "_deg", "_scale")), name
