"""Stepover, scallop and segment length against the check numbers of docs/formulas.md 4 and docs/formulas.md 5."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cuspline.scallop.stepover import scallop_for_stepover_mm, segment_length_mm, stepover_for_scallop_mm
from cuspline.values.errors import CutterDoesNotFit

INCH_MM = 25.4
# cusp on a flat by ball diameter (rows) and stepover (columns), all mm: h = R - sqrt(R² - (s/2)²) in ten digits.
# Published examples agree with the table: D = 6, s = 0.5 leaves 0.01043 (machinecalcs.com); D = 0.5 in, s = 0.05 in
# leaves 0.001253 in (calcady.com)
FLAT_STEPOVERS_MM = (0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1)
FLAT_CUSPS_MM = {
    2: (0.0003125488434, 0.001250782228, 0.005012562893, 0.01131400334, 0.03175416345, 0.08348486101, 0.1339745962),
    3: (0.0002083478029, 0.0008335649435, 0.00333704529, 0.00751884434, 0.02098005423, 0.05431677052, 0.08578643763),
    4: (0.000156256104, 0.0006250976868, 0.002501564456, 0.005632932482, 0.0156865167, 0.04040820577, 0.0635083269),
    6: (0.0001041684752, 0.0004166956059, 0.001667129887, 0.003752346684,
         0.01043481422, 0.02678625054, 0.04196010845),
    8: (7.812576295e-05, 0.000312512208, 0.001250195374, 0.002813489465, 0.007820144332, 0.02005025157, 0.0313730334),
    10: (6.250039063e-05, 0.0002500062503, 0.00100010002, 0.002250506478,
         0.00625391114, 0.01602568225, 0.02506281447),
    12: (5.208355939e-05, 0.0002083369504, 0.0008333912117, 0.00187529306,
         0.005210595859, 0.01334818116, 0.02086962845),
    16: (3.906259537e-05, 0.0001562515259, 0.000625024416, 0.001406373618,
         0.00390720414, 0.01000625782, 0.01564028866),
    20: (3.125004883e-05, 0.0001250007813, 0.0005000125006, 0.001125063288,
         0.003125488434, 0.008003202563, 0.01250782228),
}
curvatures = st.floats(-0.09, 0.5)          # hollows down to 11.1 mm under balls up to 10 mm


@pytest.mark.parametrize("radius, step, scallop", [(0.5, 0.05, 0.000625), (0.031, 0.01, 0.000406)])
def test_check_numbers_of_the_scallop_on_a_flat(radius, step, scallop):
    found = scallop_for_stepover_mm(radius * INCH_MM, step * INCH_MM, 0.0)[0] / INCH_MM
    assert found == pytest.approx(scallop, abs=5e-7)        # inches, as printed
    assert stepover_for_scallop_mm(radius * INCH_MM, found * INCH_MM, 0.0)[0] / INCH_MM == pytest.approx(step, rel=1e-9)


@pytest.mark.parametrize("diameter", FLAT_CUSPS_MM)
def test_cusps_on_a_flat_are_those_of_the_table(diameter):
    steps, cusps = np.array(FLAT_STEPOVERS_MM), np.array(FLAT_CUSPS_MM[diameter])
    found = [scallop_for_stepover_mm(diameter / 2, s, 0.0)[0] for s in steps]
    np.testing.assert_allclose(found, cusps, rtol=2e-8)         # a flat is taken as a radius of 1e9 mm: R / 1e9
    back = [stepover_for_scallop_mm(diameter / 2, h, 0.0)[0] for h in cusps]
    np.testing.assert_allclose(back, steps, rtol=2e-8)


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
        step = np.sqrt(8 * h * r * rho / (rho + side * r))
        assert stepover_for_scallop_mm(r, h, curvature)[0] == pytest.approx(step, rel=1e-5)


def test_halving_the_stepover_quarters_the_scallop():
    coarse, fine = (scallop_for_stepover_mm(5.0, s, [0.0, 0.05, -0.05]) for s in (0.1, 0.05))
    np.testing.assert_allclose(coarse / fine, 4, rtol=1e-3)


def test_a_hollow_tighter_than_the_ball_is_refused_with_its_rows_and_radius():
    with pytest.raises(CutterDoesNotFit, match="2 points where the surface is concave with radius 4.000 mm") as error:
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
    with pytest.raises(CutterDoesNotFit, match="ball radius 6.0 mm where the surface is concave with radius 5.9 mm"):
        segment_length_mm(5.9, 6.0, 0.0025)
