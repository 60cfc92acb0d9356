"""Stepover, scallop and segment length against the check numbers of FORMULAS 3 and 4."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cuspline.errors import CutterDoesNotFit
from cuspline.planning.stepover import scallop_for_stepover_mm, segment_length_mm, stepover_for_scallop_mm

INCH_MM = 25.4
curvatures = st.floats(-0.09, 0.5)          # hollows down to 11.1 mm under balls up to 10 mm


@pytest.mark.parametrize("radius, step, scallop", [(0.5, 0.05, 0.000625), (0.031, 0.01, 0.000406)])
def test_check_numbers_of_the_scallop_on_a_flat(radius, step, scallop):
    found = scallop_for_stepover_mm(radius * INCH_MM, step * INCH_MM, 0.0)[0] / INCH_MM
    assert found == pytest.approx(scallop, abs=5e-7)        # inches, as printed
    assert stepover_for_scallop_mm(radius * INCH_MM, found * INCH_MM, 0.0)[0] / INCH_MM == pytest.approx(step, rel=1e-9)


@given(radius=st.floats(0.5, 10), scallop=st.floats(1e-4, 0.02), curvature=curvatures)
def test_stepover_and_scallop_are_each_others_inverse(radius, scallop, curvature):
    step = stepover_for_scallop_mm(radius, scallop, curvature)
    # h is a small difference of lengths near the radius: 1e-14 of it
    np.testing.assert_allclose(scallop_for_stepover_mm(radius, step[0], curvature), scallop, rtol=1e-6, atol=1e-12)


@given(radius=st.floats(0.5, 10), scallop=st.floats(1e-4, 0.02), curvature=curvatures)
def test_two_circles_rolled_on_a_third_cross_at_the_scallop_height(radius, scallop, curvature):
    if abs(curvature) < 1e-4:
        return              # the circle about the far centre loses the digits that the formula keeps
    rho = 1 / curvature     # centre of the surface's circle at the origin, its top (or bottom) at |rho|
    half = np.arcsin(stepover_for_scallop_mm(radius, scallop, curvature)[0] / (2 * abs(rho)))
    center = (abs(rho) + radius * np.sign(rho)) * np.array([np.sin(half), np.cos(half)])
    # the ridge stands on the axis of symmetry, at a ball radius from the centre
    ridge = abs(rho) + scallop * np.sign(rho)
    assert np.hypot(center[0], center[1] - ridge) == pytest.approx(radius, rel=1e-9)


@pytest.mark.parametrize("curvature", [1e-4, 1e-6, 1e-8, 1e-9, 1e-12, 0.0])
def test_nearly_flat_is_nearly_the_flat_formula(curvature):
    for sign in (1, -1):
        step = stepover_for_scallop_mm(5.0, 0.01, sign * curvature)[0]
        # s = s0 / sqrt(1 + k r) to first order
        assert step == pytest.approx(2 * np.sqrt(0.01 * 9.99) * (1 - sign * curvature * 2.5), rel=1e-6)
        assert scallop_for_stepover_mm(5.0, step, sign * curvature)[0] == pytest.approx(0.01, rel=1e-6)


def test_small_scallops_follow_the_first_order_formula():
    rho, r, h = 20.0, 5.0, 1e-5
    for curvature, side in ((1 / rho, 1), (-1 / rho, -1)):
        assert stepover_for_scallop_mm(r, h, curvature)[0] == pytest.approx(np.sqrt(8 * h * r * rho / (rho + side * r)), rel=1e-5)


def test_halving_the_stepover_quarters_the_scallop():
    coarse, fine = (scallop_for_stepover_mm(5.0, s, [0.0, 0.05, -0.05]) for s in (0.1, 0.05))
    np.testing.assert_allclose(coarse / fine, 4, rtol=1e-3)


def test_a_hollow_tighter_than_the_ball_is_refused_with_its_rows_and_radius():
    with pytest.raises(CutterDoesNotFit, match="2 points lie in a hollow of radius 4.000 mm") as error:
        stepover_for_scallop_mm(6.0, 0.01, np.array([0.1, -0.25, 0.0, -0.2]))
    assert error.value.rows.tolist() == [1, 3]


def test_a_ball_that_nearly_fills_the_groove_steps_at_most_across_it():
    # radius 5 in a groove of 5.004: one pass leaves less than the scallop everywhere
    step = stepover_for_scallop_mm(5.0, 0.01, -1 / 5.004)
    assert np.isfinite(step).all() and 5.0 < step[0] <= 2 * 5.004


# segments ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rho, length", [(10.0, 0.282799), (-10.0, 0.565663)])
def test_check_numbers_of_the_segment_length(rho, length):
    assert segment_length_mm(rho, 6.0, 0.0025) == pytest.approx(length, abs=1e-6)


@given(rho=st.floats(6.5, 1e4), r=st.floats(0.5, 6), deviation=st.floats(1e-4, 0.01))
def test_the_chord_of_the_centre_path_deviates_by_what_was_asked(rho, r, deviation):
    for signed in (rho, -rho):
        path = abs(signed - r)
        half = segment_length_mm(signed, r, deviation) / 2
        assert half * half / (path + np.sqrt(path * path - half * half)) == pytest.approx(deviation, rel=1e-6)


def test_segments_shrink_to_nothing_as_the_hollow_closes_round_the_ball():
    lengths = [segment_length_mm(6 + gap, 6.0, 0.0025) for gap in (1.0, 0.1, 0.01)]
    assert lengths == sorted(lengths, reverse=True)
    with pytest.raises(CutterDoesNotFit, match="ball radius 6.0 mm in a hollow of radius 5.9 mm"):
        segment_length_mm(5.9, 6.0, 0.0025)
