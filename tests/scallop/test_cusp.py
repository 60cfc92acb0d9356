"""Cusps of inclined cutters: against the envelope of two passes by brute force, closed forms and source tables."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cuspline.scallop.cusp import (
    Stance,
    cutter_scallop_mm,
    cutter_stepover_mm,
    effective_radius_mm,
    stance_of,
    wedge_scallop_mm,
    wedge_stepover_mm,
)
from cuspline.scallop.stepover import stepover_for_scallop_mm
from cuspline.shop.cutter_profile import apt_profile, lens_profile, tangent_corner
from cuspline.values.errors import CutterDoesNotFit, PlanError

INCH_MM = 25.4


def rounded(d, r, taper_deg=0.0, h=30.0):
    beta = np.radians(taper_deg)
    return apt_profile(d, r, *tangent_corner(d, r, 0.0, beta), 0.0, beta, h)


def tapered_ball(r, taper_deg, h):
    beta = np.radians(taper_deg)
    return apt_profile(2 * r * (1 - np.sin(beta)) / np.cos(beta), r, 0.0, r, 0.0, beta, h)


BALL = apt_profile(12, 6, 0, 6, 0, 0, 30)
CUTTERS = {"ball": BALL, "bull": rounded(20, 2), "flat": rounded(10, 0.0), "dovetail": rounded(20, 0.0, -15.0, 12.0),
           "rounded dovetail": rounded(20, 0.5, -15.0, 12.0), "tapered ball": tapered_ball(1.5, 10.0, 20.0),
           "lens": lens_profile(10, 30.0, 1.0, 20.0)}


# brute force --------------------------------------------------------------------------------------------


def outline_of(profile, count=4_000):
    """(m, 2) radii and heights close together along the outline."""
    outline = profile.points(1e-7)
    length = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(outline, axis=0).T))])
    at = np.sort(np.concatenate([length, np.linspace(0, length[-1], count)]))
    return np.column_stack([np.interp(at, length, outline[:, k]) for k in (0, 1)])


def crossings(outline, axis, origin, way):
    """Lengths along a ray in the plane across the feed at which it meets the outlines of the cutter's circles.

    Every circle shows as an ellipse, which the ray meets at the roots of A cos + B sin = c.  Where the axis lies in
    that plane the circles show as chords, and their ends as the cutter's own outline.
    """
    r, z = outline.T
    side = np.array([way[1], -way[0]])
    if abs(axis[0]) < 1e-12:
        square = np.array([axis[2], -axis[1]])
        up, out = z[:, None] * axis[1:], r[:, None] * square
        shown = np.vstack([(up - out)[::-1], up + out])
        off, along = (shown - origin) @ side, (shown - origin) @ way
        k = np.flatnonzero((off[:-1] <= 0) != (off[1:] <= 0))
        return along[k] - off[k] * (along[k + 1] - along[k]) / (off[k + 1] - off[k])
    first = np.cross(axis, (0.0, 0.0, 1.0)) if abs(axis[2]) < 0.9 else np.cross(axis, (1.0, 0.0, 0.0))
    first /= np.linalg.norm(first)
    e1, e2 = r[:, None] * first[1:], r[:, None] * np.cross(axis, first)[1:]
    middle = z[:, None] * axis[1:] - origin
    a, b, c = e1 @ side, e2 @ side, -middle @ side
    size = np.hypot(a, b)
    hit = (np.abs(c) <= size) & (size > 0)
    turn, open_ = np.arctan2(b[hit], a[hit]), np.arccos(np.clip(c[hit] / size[hit], -1, 1))
    at = np.concatenate([turn + open_, turn - open_])[:, None]
    twice = lambda rows: np.concatenate([rows[hit], rows[hit]])
    return (twice(middle) + np.cos(at) * twice(e1) + np.sin(at) * twice(e2)) @ way


def brute_scallop_mm(profile, stance, stepover, k):
    """Height of the crossing of two passes' traces, both found ray by ray over the surface."""
    outline, axis = outline_of(profile), stance.axis
    r, z = outline.T
    sine = np.hypot(axis[0], axis[1])
    low = (z * axis[2] - r * sine).argmin()
    height = z[low] * axis[2] - r[low] * sine
    contact = np.array([z[low] * axis[1] + (r[low] * axis[1] * axis[2] / sine if sine > 1e-10 else 0.0), height])

    def trace(x):
        if k < 0:
            return -1 / k - crossings(outline, axis, contact - (0, 1 / k), np.array([np.sin(x), -np.cos(x)])).max()
        if k == 0:
            return crossings(outline, axis, contact + (x, 0), np.array([0.0, 1.0])).min()
        return crossings(outline, axis, contact - (0, 1 / k), np.array([np.sin(x), np.cos(x)])).min() - 1 / k

    step = stepover if k == 0 else 2 * np.arcsin(stepover * abs(k) / 2)
    low, high = 0.0, step
    for _ in range(30):
        x = (low + high) / 2
        low, high = (x, high) if trace(x) < trace(x - step) else (low, x)
    return trace(low)


@pytest.mark.parametrize("name", CUTTERS)
@pytest.mark.parametrize("lead, tilt", [(0, 0), (15, 0), (0, 25), (20, -15)])
def test_the_step_leaves_the_cusp_that_the_envelope_of_two_passes_has(name, lead, tilt):
    stance, profile, scallop = Stance(lead_rad=np.radians(lead), tilt_rad=np.radians(tilt)), CUTTERS[name], 0.02
    for k in (0.0, 0.02, -0.005):
        if k < 0 and lead == tilt == 0 and name in ("bull", "flat", "dovetail", "rounded dovetail"):
            continue                                # flat across the feed: they fit no hollow
        step = cutter_stepover_mm(profile, scallop, k, stance)[0]
        if step < profile.largest_radius_mm:        # wider: the flat bottom alone reaches over to the next pass
            assert brute_scallop_mm(profile, stance, step, k) == pytest.approx(scallop, rel=2e-4), k


@settings(max_examples=12, deadline=None)
@given(name=st.sampled_from(sorted(CUTTERS)), lead=st.floats(0.05, 0.9), tilt=st.floats(-0.7, 0.7),
       k=st.floats(-0.004, 0.2), scallop=st.floats(1e-4, 0.05))
def test_step_and_cusp_are_each_others_inverse(name, lead, tilt, k, scallop):
    stance = Stance(lead_rad=lead, tilt_rad=tilt)
    try:
        step = cutter_stepover_mm(CUTTERS[name], scallop, k, stance)[0]
    except CutterDoesNotFit:
        return
    assert cutter_scallop_mm(CUTTERS[name], step, k, stance)[0] == pytest.approx(scallop, rel=1e-7)


# closed forms ---------------------------------------------------------------------------------------------


@given(lead=st.floats(0, 1.2), tilt=st.floats(-1.2, 1.2), k=st.floats(-0.15, 1.0))
@settings(max_examples=15, deadline=None)
def test_a_balls_step_is_the_known_relation_however_its_axis_leans(lead, tilt, k):
    half = apt_profile(12, 6, 0, 6, 0, 0, 6)        # no cylinder above it that would meet a hollow's other side
    step = cutter_stepover_mm(half, 0.01, k, Stance(lead_rad=lead, tilt_rad=tilt))
    # the other relation takes a radius of 1e9 mm for a flat
    np.testing.assert_allclose(step, stepover_for_scallop_mm(6.0, 0.01, k), rtol=1e-8)


@pytest.mark.parametrize("radius, step, scallop", [(0.5, 0.05, 0.000625), (0.031, 0.01, 0.000406)])
def test_check_numbers_of_the_sources_in_inches(radius, step, scallop):
    ball = apt_profile(2 * radius * INCH_MM, radius * INCH_MM, 0, radius * INCH_MM, 0, 0, 50)
    assert cutter_scallop_mm(ball, step * INCH_MM, 0.0)[0] / INCH_MM == pytest.approx(scallop, abs=5e-7)


@pytest.mark.parametrize("diameter, step, scallop", [(2, 0.05, 0.0003125488434), (3, 0.5, 0.02098005423),
                                                     (4, 0.2, 0.002501564456), (6, 0.5, 0.01043)])
def test_table_of_exact_cusps_on_a_flat(diameter, step, scallop):
    # h = R - sqrt(R² - s²/4); the last from a published example (machinecalcs.com), to its digits
    ball = apt_profile(diameter, diameter / 2, 0, diameter / 2, 0, 0, 50)
    assert cutter_scallop_mm(ball, step, 0.0)[0] == pytest.approx(scallop, rel=1e-9 if diameter < 6 else 1e-3)


@pytest.mark.parametrize("lead", [3.0, 10.0, 45.0, 90.0])
def test_small_cusps_of_an_inclined_torus_follow_its_effective_radius(lead):
    bull, stance = CUTTERS["bull"], Stance(lead_rad=np.radians(lead))
    effective = effective_radius_mm(10.0, 2.0, np.radians(lead))
    assert effective == pytest.approx(2 + 8 / np.sin(np.radians(lead)))
    steps = [(h, cutter_stepover_mm(bull, h, 0.0, stance)[0]) for h in (1e-3, 1e-4, 1e-5)]
    errors = [abs(step / np.sqrt(8 * h * effective) - 1) for h, step in steps]
    assert errors[-1] < 1e-4 and errors[0] / errors[1] == pytest.approx(10, rel=0.2)      # the difference is of order h


def test_a_torus_that_stands_upright_steps_by_its_flat_and_two_corners():
    # flat of 16 mm and two arcs of radius 2
    assert cutter_stepover_mm(CUTTERS["bull"], 0.01, 0.0)[0] == pytest.approx(16 + 2 * np.sqrt(0.01 * 3.99), rel=1e-9)


@pytest.mark.parametrize("slope", [5.0, 30.0, 60.0])
def test_a_flat_end_mill_on_a_slope_leaves_triangles_of_sine_times_cosine(slope):
    t = np.radians(slope)
    step = cutter_stepover_mm(CUTTERS["flat"], 0.02, 0.0, Stance(tilt_rad=t))[0]
    assert step == pytest.approx(0.02 / (np.sin(t) * np.cos(t)), rel=1e-9)
    assert wedge_scallop_mm(step, t, np.pi / 2 - t) == pytest.approx(0.02, rel=1e-9)


@pytest.mark.parametrize("lean", [20.0, 60.0, 89.0])
def test_a_dovetails_cusp_is_the_triangle_of_its_cone_and_bottom(lean):
    t, taper = np.radians(lean), np.radians(15.0)
    step = cutter_stepover_mm(CUTTERS["dovetail"], 0.02, 0.0, Stance(tilt_rad=t))[0]
    assert step == pytest.approx(wedge_stepover_mm(0.02, t, np.pi / 2 - t + taper), rel=1e-9)


def test_a_dovetail_that_lies_across_the_feed_leaves_steps_of_its_taper():
    # axis in the surface: one flank upright, the other rising by the taper: h = s tan(taper)
    assert wedge_scallop_mm(1.0, np.pi / 2, np.radians(15)) == pytest.approx(np.tan(np.radians(15)))


def test_a_tapered_balls_tip_cuts_as_its_ball_until_the_cone_takes_part():
    tapered, ball = CUTTERS["tapered ball"], apt_profile(3, 1.5, 0, 1.5, 0, 0, 20)
    assert cutter_stepover_mm(tapered, 0.02, 0.0)[0] == pytest.approx(cutter_stepover_mm(ball, 0.02, 0.0)[0], rel=1e-12)
    high = 2.0                     # above 1.5 (1 - sin 10 deg) the flank is the cone
    beta = np.radians(10)
    half = 1.5 * np.cos(beta) + (high - 1.5 * (1 - np.sin(beta))) * np.tan(beta)
    assert cutter_stepover_mm(tapered, high, 0.0)[0] == pytest.approx(2 * half, rel=1e-9)


def test_a_stance_is_read_from_axis_normal_and_feed():
    normal, feed = np.array([0.0, -0.6, 0.8]), np.array([1.0, 0.0, 0.0])
    found = stance_of(np.array([0.0, 0.0, 1.0]), normal, feed)          # three axes on a slope across the feed
    assert (found.lead_rad, abs(found.tilt_rad)) == pytest.approx((0.0, np.arcsin(0.6)))
    uphill = stance_of(np.array([0.0, 0.0, 1.0]), np.array([-0.6, 0.0, 0.8]), np.array([0.8, 0.0, 0.6]))
    assert (abs(uphill.lead_rad), uphill.tilt_rad) == pytest.approx((np.arcsin(0.6), 0.0))


# refusals -------------------------------------------------------------------------------------------------


def test_a_silhouette_flatter_than_the_hollow_is_refused_with_its_rows():
    bull, leaning = CUTTERS["bull"], Stance(lead_rad=np.radians(30))        # effective radius 18
    with pytest.raises(CutterDoesNotFit, match="1 point on surface that is concave.*radius 17.000") as error:
        cutter_stepover_mm(bull, 0.01, [0.0, -1 / 19, -1 / 17], leaning)
    assert error.value.rows.tolist() == [2]
    with pytest.raises(CutterDoesNotFit):
        cutter_stepover_mm(CUTTERS["flat"], 0.01, -1e-4)


def test_passes_that_do_not_meet_are_refused():
    with pytest.raises(PlanError, match="12 mm wide"):
        cutter_scallop_mm(BALL, 12.5, 0.0)
