"""The metric of passes against the exact step on planes, cylinders, spheres, saddles and over edges."""

import math

import numpy as np
import pytest

from cuspline.scallop.stepover import stepover_for_scallop_mm
from cuspline.toolpaths.freeform.scallop_metric import contact_jumps, scallop_metric
from cuspline.values.errors import ToolpathError

STEP_MM, R, H = 0.05, 6.0, 0.01


def contacts(slope, bend, size=1.0):
    """Ball R on z = slope x + the quadric with curvatures `bend` along x and y: S = (x, y) - R n."""
    x = np.arange(-size, size + STEP_MM / 2, STEP_MM)
    xx, yy = np.meshgrid(x, x)
    p, q = xx.copy(), yy.copy()
    for _ in range(400):
        fx, fy = slope - bend[0] * p, -bend[1] * q
        w = np.sqrt(1 + fx * fx + fy * fy)
        p, q = p + 0.4 * (xx + R * fx / w - p), q + 0.4 * (yy + R * fy / w - q)
    s = np.stack([p, q, slope * p - 0.5 * bend[0] * p * p - 0.5 * bend[1] * q * q], axis=-1)
    fx, fy = slope - bend[0] * p, -bend[1] * q
    n = np.stack([-fx, -fy, np.ones_like(fx)], axis=-1)
    return s, n / np.linalg.norm(n, axis=-1, keepdims=True)


def steps(metric):
    """Tip steps in plan along x and y at the middle."""
    k = metric.shape[0] // 2
    return metric[k, k, 0] ** -0.5, metric[k, k, 2] ** -0.5


def test_step_is_exact_on_a_flat():
    got = steps(scallop_metric(*contacts(0.0, (0, 0)), STEP_MM, radius_mm=R, scallop_mm=H))
    exact = stepover_for_scallop_mm(R, H, 0.0)[0]
    np.testing.assert_allclose(got, exact, rtol=1e-8)


@pytest.mark.parametrize("slope", [0.5, 2.0])
def test_step_up_a_slope_shrinks_in_plan_with_its_cosine(slope):
    got = steps(scallop_metric(*contacts(slope, (0, 0)), STEP_MM, radius_mm=R, scallop_mm=H))
    flat = stepover_for_scallop_mm(R, H, 0.0)[0]
    np.testing.assert_allclose(got, (flat / math.hypot(1, slope), flat), rtol=1e-8)


@pytest.mark.parametrize("bend", [(0.1, 0.02), (0.2, -0.1), (-0.12, -0.05), (0.0, -0.14)])
@pytest.mark.parametrize("scallop", [0.001, 0.01, 0.03])
def test_step_on_a_bent_surface_is_the_exact_one_of_two_rolled_circles(bend, scallop):
    metric = scallop_metric(*contacts(0.0, bend), STEP_MM, radius_mm=R, scallop_mm=scallop)
    exact = [stepover_for_scallop_mm(R, scallop, k)[0] * (1 + R * k) for k in bend]      # of the tip in plan
    # the part of order scallop times curvature is not in a metric: 0.3 % at 0.03 mm
    np.testing.assert_allclose(steps(metric), exact, rtol=0.004 + 0.2 * scallop)


def test_the_metric_turns_with_the_part():
    s, n = contacts(0.4, (0.1, -0.1))
    turned = scallop_metric(*(np.swapaxes(a, 0, 1)[..., [1, 0, 2]] for a in (s, n)), STEP_MM, radius_mm=R, scallop_mm=H)
    plain = scallop_metric(s, n, STEP_MM, radius_mm=R, scallop_mm=H)
    np.testing.assert_allclose(turned, np.swapaxes(plain, 0, 1)[..., [2, 1, 0]], rtol=1e-8)


def over_an_edge():
    """Ball over the roof's edge at x = 0 of two planes falling with slope 1: it rolls where |x| < R sin 45°."""
    x = np.arange(-8, 8 + STEP_MM / 2, STEP_MM)
    xx, yy = np.meshgrid(x, x[:20])
    reach = R * math.sqrt(0.5)
    px = np.sign(xx) * np.maximum(np.abs(xx) - reach, 0.0)
    s = np.stack([px, yy, -np.abs(px)], axis=-1)
    sine = np.clip(xx / R, -math.sqrt(0.5), math.sqrt(0.5))
    return s, np.stack([sine, np.zeros_like(sine), np.sqrt(1 - sine ** 2)], axis=-1)


def test_rolling_over_an_edge_takes_steps_of_half_a_radius_across_and_plain_ones_along():
    metric = scallop_metric(*over_an_edge(), STEP_MM, radius_mm=R, scallop_mm=H)
    across, along = metric[10, 160, 0] ** -0.5, metric[10, 160, 2] ** -0.5
    assert across == pytest.approx(0.5 * R, rel=1e-3)
    assert along == pytest.approx(stepover_for_scallop_mm(R, H, 0.0)[0], rel=1e-6)


def in_a_groove():
    """Ball in a right-angled groove of planes: the contact jumps from flank to flank at x = 0."""
    x = np.arange(-4, 4 + STEP_MM / 2, STEP_MM) + 0.3 * STEP_MM
    xx, yy = np.meshgrid(x, x[:20])
    side, leg = np.where(xx > 0, 1.0, -1.0), R * math.sqrt(0.5)
    px = xx + side * leg
    s = np.stack([px, yy, np.abs(px)], axis=-1)
    return s, np.stack([-side * math.sqrt(0.5), np.zeros_like(xx), np.full_like(xx, math.sqrt(0.5))], axis=-1)


def test_a_jump_of_the_contact_adds_no_width():
    s, n = in_a_groove()
    metric = scallop_metric(s, n, STEP_MM, radius_mm=R, scallop_mm=H)
    flank = stepover_for_scallop_mm(R, H, 0.0)[0] * math.sqrt(0.5)
    np.testing.assert_allclose(metric[10, :, 0] ** -0.5, flank, rtol=1e-8)
    jumps = contact_jumps(s, n, radius_mm=R)
    assert jumps[..., 0].sum() == 20 and not jumps[..., 1].any()


def test_a_bull_nose_on_a_slope_steps_by_its_effective_radius():
    rc, slope = 1.0, 0.4
    s, n = contacts(slope, (0, 0))
    metric = scallop_metric(s, n, STEP_MM, radius_mm=R, corner_radius_mm=rc, scallop_mm=0.002)
    sine = slope / math.hypot(1, slope)
    effective = rc + (R - rc) / sine                   # docs/formulas.md 5: across a feed up the slope
    up, level = steps(metric)
    assert level == pytest.approx(math.sqrt(8 * 0.002 * effective), rel=0.002)
    assert up * math.hypot(1, slope) == pytest.approx(math.sqrt(8 * 0.002 * rc), rel=0.002)


def test_a_sharp_corner_is_refused():
    with pytest.raises(ToolpathError, match="ball or a bull-nose"):
        scallop_metric(*contacts(0.0, (0, 0)), STEP_MM, radius_mm=R, corner_radius_mm=0.0, scallop_mm=H)
