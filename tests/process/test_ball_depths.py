"""Closed forms of the depth of cut against the source's numbers and brute force over the removed cross-section."""

import numpy as np
import pytest

from cuspline.process.ball_depths import (
    edge_in_cut_mm,
    edge_radius_mm,
    edge_speed_m_per_min,
    inclined_depth_mm,
    inclined_lowest_radius_mm,
    instant_depth_mm,
    largest_depth_mm,
    layer_radius_mm,
    level_depth_mm,
    outer_boundary_mm,
    relieving_layer_mm,
    relieving_radial_step_mm,
    relieving_step_mm,
    slotting_angle_rad,
    slotting_depth_mm,
    transition_depth_mm,
)

deg = np.radians


def removed_heights(r, t, step, psi_deg, parts=1201):
    """(lowest, highest) height over the tip of the removed cross-section, by a fine grid over it."""
    psi, side = deg(abs(psi_deg)), np.sign(psi_deg) or 1.0
    along, up = np.meshgrid(np.linspace(-r, r, parts), np.linspace(0, t, parts))
    cut = (along ** 2 + (up - r) ** 2 <= r * r) & ((along - side * step) ** 2 + (up - r) ** 2 >= r * r)
    height = r + along * np.sin(psi) + (up - r) * np.cos(psi)
    return height[cut].min(), height[cut].max()


def test_the_largest_depths_of_the_source():
    """Step-down, step-up, inclined, plane to slope: the numbers, worked out by hand from sines of 30 degrees."""
    half, root = 0.5, np.sqrt(3) / 2
    for t, wanted in ((8, 10 - 2 * root - (np.sqrt(96) - 2) * half), (4, 10 * (1 - root) + 2 * half),
                      (1, (2 + np.sqrt(19)) * half - root)):
        assert largest_depth_mm(10.0, t, 2.0, deg(30)) == pytest.approx(wanted, abs=1e-12)
    assert largest_depth_mm(10.0, [8, 4, 1], 2.0, deg(30)) == pytest.approx([4.3690, 2.3397, 2.3134], abs=5e-5)
    assert largest_depth_mm(10.0, 4.0, [12.0, 3.0], deg(-30)) == pytest.approx([8.8038, 8.2141], abs=5e-5)
    assert outer_boundary_mm(10.0, 4.0, deg(-30)) == pytest.approx(10 - 6 * root + 8 * half, abs=1e-12)
    assert largest_depth_mm(10.0, 4.0, 3.0, [0.0, deg(90)]) == pytest.approx([4.0, 14.0])


def test_the_tool_of_the_source_at_25_degrees():
    r, t, step, psi = 5.41, 1.0, 0.5, deg(25)
    assert largest_depth_mm(r, t, step, [psi, -psi]) == pytest.approx([0.7182, 2.3363], abs=6e-5)
    assert inclined_depth_mm(r, t, psi) == pytest.approx(2.2307, abs=5e-5)
    lowest = edge_radius_mm(r, edge_in_cut_mm(r, t, step, np.array([psi, -psi]))[0])
    assert lowest == pytest.approx([0.0, 2.057], abs=5e-4)
    assert inclined_lowest_radius_mm(r, psi) == pytest.approx(2.286, abs=5e-4)


def test_plane_to_slope_is_deeper_than_either():
    found = [1.0, float(transition_depth_mm(4.0, 1.0, deg(68))), float(inclined_depth_mm(4.0, 1.0, deg(68)))]
    assert found == pytest.approx([1.0, 5.892, 3.3904], abs=5e-4)
    assert [depth > 3.5 for depth in found] == [False, True, False]


@pytest.mark.parametrize("r, t, step, psi_deg", [(10, 4, 2, 30), (10, 8, 2, 30), (10, 1, 2, 30), (10, 4, 3, -30),
                                                 (5.41, 1, 0.5, 25), (5.41, 1, 0.5, -25), (10, 4, 12, -30),
                                                 (3, 0.5, 1.5, 60), (3, 0.5, 1.5, -60),
                                                 (3, 1, 0.8, 0), (3, 0.1, 0.4, 10)])
def test_the_edge_in_the_cut_is_that_of_brute_force(r, t, step, psi_deg):
    assert edge_in_cut_mm(r, t, step, deg(psi_deg)) == pytest.approx(removed_heights(r, t, step, psi_deg), abs=0.004 * r)


def test_the_source_never_says_less_than_the_exact_depth():
    rng = np.random.default_rng(3)
    t, step, psi = rng.uniform(0.02, 0.9, 4000), rng.uniform(0.01, 0.5, 4000), rng.uniform(-1.3, 1.3, 4000)
    plain = step < 2 * layer_radius_mm(1.0, t)
    low, high = edge_in_cut_mm(1.0, t, step, psi)
    reach = np.where(t < 1 - np.cos(psi), low, 0)      # in step-down the source counts from the tip where that cuts
    known = largest_depth_mm(1.0, t, step, psi)
    assert (known - (high - np.where(psi < 0, low, reach)))[plain].min() > -1e-9


def test_the_tip_leaves_the_cut_at_the_limits_of_the_source():
    r, psi = 10.0, deg(30)
    limit = float(relieving_layer_mm(r, psi))
    assert edge_in_cut_mm(r, [limit - 1e-6, limit + 1e-6], 2.0, psi)[0].tolist() == [pytest.approx(0, abs=0.2), 0.0]
    assert edge_in_cut_mm(r, limit - 1e-6, 2.0, psi)[0] > 0
    assert relieving_step_mm(r, -psi) == pytest.approx(10.0)
    at = edge_in_cut_mm(r, 4.0, [9.999, 10.001], -psi)[0]
    assert at[0] > 0 and at[1] == 0
    assert relieving_radial_step_mm(r, [-psi, deg(60)]) == pytest.approx([10 * np.sin(2 * psi), 10.0])


def test_slotting_and_the_level_plane_solve_the_general_equation():
    r, phi = 5.0, deg(np.linspace(95, 175, 9))
    inside = np.sin(phi) > 1.0 / r
    assert instant_depth_mm(r, 0.0, 1.0, phi)[inside] == pytest.approx(slotting_depth_mm(r, 1.0, phi)[inside], abs=1e-9)
    assert slotting_angle_rad(r, 1.0) == pytest.approx(np.arcsin(0.2))
    assert slotting_depth_mm(r, 1.0, slotting_angle_rad(r, 1.0)) == pytest.approx(r, abs=1e-9)
    first = level_depth_mm(r, 1.0, 0.6, phi)
    assert instant_depth_mm(r, 0.6, 0.0, phi)[first < 1] == pytest.approx(first[first < 1], abs=1e-9) and (first < 1).sum() > 3


@pytest.mark.parametrize("psi_deg", [20, -20])
def test_the_instant_depth_lies_on_the_pass_before(psi_deg):
    r, step, phi = 4.0, 0.5, deg(np.linspace(91, 179, 30))
    a_r, a_a = step * np.cos(deg(psi_deg)), step * np.sin(deg(psi_deg))
    depth = instant_depth_mm(r, a_r, a_a, phi)
    some = np.isfinite(depth)
    u = np.sqrt(2 * r * depth - depth ** 2)
    # the edge's place across the feed and its height, against the middle of the ball one pass before
    away = np.hypot(-u * np.abs(np.cos(phi)) - a_r, depth - r - a_a)
    assert some.any() and away[some] == pytest.approx(r, abs=1e-9)


def test_the_speed_at_the_edge():
    assert edge_speed_m_per_min(edge_radius_mm(5.0, [1.0, 5.0]), 7957.747) == pytest.approx([150.0, 250.0], abs=1e-3)
