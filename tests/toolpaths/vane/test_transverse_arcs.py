"""Transverse arcs over a vane tip: exact in the mid-plane, told by three numbers a step, their cut computed."""

import numpy as np
import pytest
from known_vanes import BALL_MM, HALF_MM, RESOLUTION_MM, RIDGE_MM, passes, planes, steep_tip, tip_of, wavy_tip

from cuspline.program.pass_templates import Call, Restart
from cuspline.program.program import Kind
from cuspline.toolpaths.vane.arc_templates import OVERRUN_MM, stroke_ends
from cuspline.toolpaths.vane.cutter_surface import cut_map, flank_deviation_mm, tip_deviation_mm
from cuspline.toolpaths.vane.transverse_arcs import (
    STEEP_SLOPE,
    center_x_of_contact_mm,
    contacts_mm,
    crest_slope,
    widest_interval_mm,
)
from cuspline.values.errors import CutterDoesNotFit


@pytest.fixture(scope="module")
def wavy():
    return wavy_tip()


@pytest.fixture(scope="module")
def steep():
    return steep_tip()


# the iteration ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("ball_mm", [0.5, 3.0, 12.0, 23.0])
def test_the_contact_under_a_centre_is_found_to_rounding(wavy, ball_mm):
    x = np.linspace(*wavy.range_mm, 1237)
    centers = center_x_of_contact_mm(wavy, ball_mm, x)
    assert np.abs(contacts_mm(wavy, ball_mm, centers) - x).max() < 1e-8 * ball_mm


def test_on_a_constant_slope_the_contact_is_known():
    slope = 0.25
    tip = tip_of(lambda x: 30.0 + slope * x)
    centers = np.array([10.0, 17.5, 30.0])
    wanted = centers + BALL_MM * slope / np.hypot(1, slope)
    assert contacts_mm(tip, BALL_MM, centers) == pytest.approx(wanted, abs=1e-10)


def test_a_ball_larger_than_the_valley_is_refused_with_its_place(wavy):
    said = r"valley of the tip line at x = .* has a radius of 3\d\.\d+ mm"
    with pytest.raises(CutterDoesNotFit, match=said) as caught:
        contacts_mm(wavy, 45.0, np.array([20.0]))
    assert len(caught.value.rows)


def test_intervals_are_constant_and_whole_steps_of_the_control(wavy):
    along, steps = planes(wavy)
    assert len(along) == 2 and len(along[1].planes) == 1
    assert np.abs(np.diff(along[0].planes) - along[0].interval_mm).max() < 1e-10
    assert abs(along[0].interval_mm / RESOLUTION_MM - round(along[0].interval_mm / RESOLUTION_MM)) < 1e-6
    assert np.diff(steps.center_x_mm).max() <= along[0].interval_mm + 1e-9
    ends = center_x_of_contact_mm(wavy, BALL_MM, np.array(wavy.range_mm))
    assert steps.center_x_mm[0] - ends[0] < RESOLUTION_MM and steps.center_x_mm[-1] == pytest.approx(ends[1])


def test_on_a_level_tip_the_interval_is_the_flat_stepover():
    level = tip_of(lambda x: 30.0 + 0 * x)
    flat = 2 * np.sqrt(2 * BALL_MM * RIDGE_MM - RIDGE_MM ** 2)
    assert widest_interval_mm(level, BALL_MM, RIDGE_MM, np.array([5.0, 20.0])) == pytest.approx([flat, flat], rel=1e-7)


# the numbers of a step --------------------------------------------------------------------------------


def test_the_ball_touches_the_crest_in_every_plane(wavy, steep):
    """Beyond the last contact it rolls over the edge of the vane's end."""
    for tip in (wavy, steep):
        _, steps = planes(tip)
        center = steps.centers_mm(BALL_MM, np.zeros(1))[:, 0]
        edge = np.abs(steps.contact_x_mm[:, None] - tip.range_mm).min(axis=1) < 1e-9
        crest = tip.point_mm(steps.contact_x_mm, 0.0)
        assert np.abs(center - crest - BALL_MM * tip.normal(steps.contact_x_mm, 0.0))[~edge].max() < 1e-9
        assert np.abs(np.linalg.norm(center - crest, axis=1) - BALL_MM).max() < 1e-9
        assert edge.sum() < 0.1 * len(steps)


def test_the_ball_touches_the_flanks_in_every_plane(wavy, steep):
    for tip in (wavy, steep):
        _, steps = planes(tip)
        center = steps.centers_mm(BALL_MM, np.array([tip.half_arc_rad]))[:, 0]
        feet, far = flank_deviation_mm(tip, center)
        inner = (feet[:, 0] > tip.range_mm[0] + 0.01) & (feet[:, 0] < tip.range_mm[1] - 0.01)
        assert np.abs(far[inner] - BALL_MM).max() < 1e-6 and inner.mean() > 0.85


def test_three_numbers_are_the_tangency_and_the_centre_of_an_arc_whose_flanks_lean_as_the_tips(wavy):
    _, steps = planes(wavy)
    sine = np.sin(wavy.flank_half_angle_rad)
    assert not steps.is_matching.any()
    assert np.abs(steps.radius_mm - wavy.radius_mm(steps.contact_x_mm)).max() < 0.01
    assert np.abs(steps.y_mm - steps.radius_mm * np.cos(wavy.flank_half_angle_rad)).max() < 1e-12
    assert np.abs(steps.z_mm - steps.c_mm - steps.radius_mm * sine).max() < 1e-12


def test_only_the_steep_section_has_five_numbers(steep):
    _, steps = planes(steep)
    slope = np.abs(crest_slope(steep, steps.contact_x_mm))
    assert 0 < steps.is_matching.sum() < len(steps)
    assert np.array_equal(steps.is_matching, slope > STEEP_SLOPE)
    assert (steps.swell[~steps.is_matching] == 1).all() and (steps.lift[~steps.is_matching] == 0).all()
    assert np.abs((steps.swell + steps.lift - np.hypot(1, slope))[steps.is_matching]).max() < 1e-12


def long_hand(tip, steps, register_mm):
    """Foot, tangency, tangency, foot of the ball's tip in each plane: reckoned afresh, clockwise."""
    angle = np.pi / 2 - tip.half_arc_rad
    g = np.hypot(steps.y_mm, steps.z_mm - steps.c_mm) + steps.swell * register_mm
    h = steps.c_mm + steps.lift * register_mm
    y, z = g * np.cos(angle), h + g * np.sin(angle)
    foot = HALF_MM + OVERRUN_MM + register_mm * np.cos(angle)
    down = z - (foot - y) / np.tan(angle)
    rows = [np.column_stack([steps.center_x_mm, s * a + 0 * y, b]) for s, a, b in
            ((-1, foot, down), (-1, y, z), (1, y, z), (1, foot, down))]
    return np.stack(rows, axis=1) - (0, 0, BALL_MM), g, h - BALL_MM


@pytest.mark.parametrize("register_mm", [BALL_MM, BALL_MM + 0.254, BALL_MM - 0.0508])
def test_the_expanded_finish_is_the_long_hand_finish(wavy, steep, register_mm):
    for tip in (wavy, steep):
        told, steps = passes(tip, register_mm)
        moves = told.moves()
        points, g, h = long_hand(tip, steps, register_mm)
        arcs = np.flatnonzero(moves.kind == Kind.ARC_CW)
        assert len(arcs) == len(steps) and not (moves.kind == Kind.ARC_CCW).any()
        for at, column in ((-2, 0), (-1, 1), (0, 2), (1, 3)):
            assert np.abs(moves.end_mm[arcs + at] - points[:, column]).max() < 1e-9
        assert np.abs(moves.center_mm[arcs, 2] - h).max() < 1e-9
        radius = np.linalg.norm(moves.end_mm[arcs, 1:] - moves.center_mm[arcs, 1:], axis=1)
        assert np.abs(radius - g).max() < 1e-9


def test_rough_passes_run_both_ways_and_stay_down_between(wavy):
    told, steps = passes(wavy, BALL_MM + 0.254, is_rough=True)
    moves = told.moves()
    arcs = moves.kind[moves.kind >= Kind.ARC_CW]
    assert len(arcs) == len(steps)
    assert (arcs[:50:2] == Kind.ARC_CW).all() and (arcs[1:50:2] == Kind.ARC_CCW).all()
    # only restart points lift: up, across and down, and once up at the end
    assert (moves.kind == Kind.RAPID).sum() <= 3 * len(told.restarts) + 1
    points, *_ = long_hand(wavy, steps, BALL_MM + 0.254)
    at = np.flatnonzero(moves.kind >= Kind.ARC_CW)
    assert np.abs(moves.end_mm[at[::2]][:25] - points[::2, 2][:25]).max() < 1e-9
    assert np.abs(moves.end_mm[at[1::2]][:25] - points[1::2, 1][:25]).max() < 1e-9


def test_the_main_program_is_three_numbers_a_step_and_a_coordinate_now_and_then(wavy):
    told, steps = passes(wavy)
    calls = [i for i in told.items if isinstance(i, Call)]
    assert len(calls) == len(steps) + 1 and {len(c.arguments) for c in calls[:-1]} == {3}
    restarts = [i for i in told.items if isinstance(i, Restart)]
    assert [r.number for r in restarts] == list(range(1, len(restarts) + 1))
    assert len(restarts) == int(np.ceil((len(steps) - 1) / 50)) + 1


# the vane really cut ----------------------------------------------------------------------------------


def test_distances_are_those_along_the_normal(wavy):
    rng = np.random.default_rng(3)
    x, turn, off = rng.uniform(5, 35, 400), rng.uniform(-1.3, 1.3, 400), rng.uniform(-0.3, 0.3, 400)
    points = wavy.point_mm(x, turn) + off[:, None] * wavy.normal(x, turn)
    assert np.abs(tip_deviation_mm(wavy, points)[1] - off).max() < 1e-10
    assert np.abs(tip_deviation_mm(wavy, points)[0] - wavy.point_mm(x, turn)).max() < 1e-8
    points = wavy.flank_point_mm(x, 33.0) + off[:, None] * wavy.flank_normal(x)
    assert np.abs(flank_deviation_mm(wavy, points)[1] - off).max() < 1e-10


def test_a_level_tip_is_cut_exactly():
    found = cut_map(tip_of(lambda x: 30.0 + 0 * x), BALL_MM, BALL_MM, 0.2)
    assert np.nanmax(np.abs(found.deviation_mm)) < 1e-12


def test_stretches_beyond_a_limit_hold_all_rows_beyond_it_and_their_margins(steep):
    found = cut_map(steep, BALL_MM, BALL_MM, 0.05)
    worst = np.fmax.reduce(found.deviation_mm, axis=1)
    for limit in (0.001, 0.004, 0.05):
        within = np.array(found.stretches_beyond_mm(limit, 0.3))
        inside = ((found.center_x_mm[:, None] >= within[:, 0]) & (found.center_x_mm[:, None] <= within[:, 1])).any(axis=1)
        assert inside[worst > limit].all() and (within[1:, 0] > within[:-1, 1]).all()
        near = np.abs(found.center_x_mm[inside][:, None] - found.center_x_mm[worst > limit]).min(axis=1)
        assert near.max() <= 0.3 + 1e-9
        assert (within[0, 0] == -np.inf) == (worst[0] > limit)      # steep from its first row on: so is what lies before
    assert found.stretches_beyond_mm(10.0, 0.3) == ()


def test_on_a_constant_slope_the_error_grows_with_its_square_and_the_ball():
    """To leading order Rc s² / 2 (1 - cos t)(cos t - sin α) is left: most half way between crest and flank in cos t."""
    worst = {}
    for slope in (0.05, 0.1):
        for ball_mm in (2.0, 4.0):
            found = cut_map(tip_of(lambda x: 30.0 + slope * x), ball_mm, ball_mm, 0.2)
            worst[slope, ball_mm] = np.nanmax(found.deviation_mm[20:-20])
            assert worst[slope, ball_mm] == pytest.approx(
                ball_mm * slope ** 2 * (1 - np.sin(np.radians(10.0))) ** 2 / 8, rel=0.03)
            assert np.abs(found.deviation_mm[20:-20, [0, -1]]).max() < 1e-9    # crest and flanks
    assert worst[0.1, 2.0] / worst[0.05, 2.0] == pytest.approx(4, rel=0.03)
    assert worst[0.1, 4.0] / worst[0.1, 2.0] == pytest.approx(2, rel=1e-3)


def test_in_the_matching_section_crest_and_flanks_are_true(steep):
    found = cut_map(steep, BALL_MM, BALL_MM, 0.05)
    mine = found.deviation_mm[found.is_matching]
    assert np.nanmax(np.abs(mine[:, 0])) < 2e-5
    inner = found.is_matching & (found.place_mm[:, -1, 0] > steep.range_mm[0] + BALL_MM)
    assert np.nanmax(np.abs(found.deviation_mm[inner, -1])) < 1e-3
    assert np.nanmax(mine[:, 1:-1]) > 0.02      # the shoulders are left


def test_the_register_takes_its_amount_along_the_normal_from_crest_and_flanks(steep):
    nominal, smaller = (cut_map(steep, BALL_MM, BALL_MM - less, 0.05) for less in (0.0, 0.05))
    less = nominal.deviation_mm - smaller.deviation_mm
    mine = nominal.is_matching & (nominal.place_mm[:, -1, 0] > steep.range_mm[0] + BALL_MM)
    assert np.nanmax(np.abs(less[mine][:, [0, -1]] - 0.05)) < 5e-4


def test_a_short_vane_across_the_border_of_the_sections_has_both_in_its_map(steep):
    x = np.linspace(*steep.range_mm, 20001)
    border = x[np.flatnonzero(np.abs(crest_slope(steep, x)) > STEEP_SLOPE)[-1]]
    found = cut_map(steep.between(border - 2.0, border + 2.0), BALL_MM, BALL_MM, 0.6)
    assert found.is_matching.any() and not found.is_matching.all()
    assert np.nanmax(np.abs(found.deviation_mm[:, 0])) < 2e-5


@pytest.mark.parametrize("tip", [wavy_tip, steep_tip])
def test_a_stroke_goes_where_its_program_goes(tip):
    made, steps = passes(tip())
    moves = made.moves()
    rows = np.array([0, 7, len(steps) - 1])
    y, z = stroke_ends(steps, rows, BALL_MM, tip().flank_half_angle_rad, HALF_MM)
    for k, row in enumerate(rows):
        mine = np.abs(moves.end_mm[:, 0] - steps.center_x_mm[row]) < 1e-6
        there = moves.end_mm[mine & (moves.kind != Kind.RAPID)]
        assert np.abs(there[:, 1:] - np.column_stack([y[k], z[k] - BALL_MM])).max() < 1e-9
