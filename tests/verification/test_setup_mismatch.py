"""The step between clampings that have finished the same place."""

from dataclasses import replace

import numpy as np
import pytest

from cuspline.verification.residuals import Residuals
from cuspline.verification.samples import Samples
from cuspline.verification.setup_mismatch import joints

LENGTH_MM, OVERLAP_MM, LEFT_MM = 100.0, (40.0, 60.0), 2.0


def samples():
    """A strip along x, half a millimetre from sample to sample."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(0.25, LENGTH_MM, 0.5), np.arange(0.25, 10, 0.5)))
    n = len(x)
    return Samples(points_mm=np.column_stack([x, y, 0 * x]), normals=np.tile((0, 0, 1.0), (n, 1)),
                   weight_mm2=np.full(n, 0.25), face=np.zeros(n, int), is_border=np.zeros(n, bool))


def alone(cut, height):
    """Residuals after a clamping that finished where `cut`, to the given height."""
    at = samples()
    n = len(at)
    return Residuals(samples=at, deviation_mm=np.where(cut(at.points_mm[:, 0]), height(at.points_mm), LEFT_MM),
                     reach=np.zeros(n, int), row=np.zeros(n, int), is_own=np.ones(n, bool), is_top=np.zeros(n, bool),
                     spacing_mm=0.5)


CUSP_MM, RIDGES_MM = 0.004, 2.0
GROOVE_MM = CUSP_MM * (0.5 / RIDGES_MM) ** 2        # a groove's bottom lies up to half a sample beside the next one


def cusps(points, phase=0.0):
    return CUSP_MM * (2 * np.mod((points[:, 0] + phase) / RIDGES_MM, 1.0) - 1) ** 2


def left(height=cusps):
    return alone(lambda x: x < OVERLAP_MM[1], height)


def right(height):
    return alone(lambda x: x > OVERLAP_MM[0], height)


def between(*alone):
    """Joints of clampings a, b, ..., each with every sample on faces of its own."""
    repeated = [replace(a, samples=Samples.joined([a.samples] * len(alone)), **{
        name: np.tile(getattr(a, name), len(alone)) for name in ("deviation_mm", "reach", "row", "is_own", "is_top")})
        for a in alone]
    return joints("abc"[:len(alone)], repeated, [len(samples())] * len(alone), finished_mm=0.02, fade_mm=3.5)


def test_a_step_is_found_through_the_cusps():
    found = between(left(), right(lambda p: cusps(p, 0.3) + 0.0015))
    assert found[0] == [] and found[1][0]["with"] == "a"
    assert found[1][0]["area_mm2"] == pytest.approx((20 - 2 * 4) * 10, abs=10)      # 4 mm of border are none
    assert found[1][0]["step_mean_mm"] == pytest.approx(0.0015, abs=2e-4)
    assert found[1][0]["step_max_mm"] == pytest.approx(0.0015, abs=GROOVE_MM)


def test_a_turned_part_steps_most_at_the_end_of_the_overlap():
    tilt = lambda p: cusps(p) - 1e-4 * (p[:, 0] - 40)
    found = between(left(), right(tilt))[1][0]
    assert found["step_mean_mm"] == pytest.approx(-0.001, abs=1e-6)
    assert found["step_max_mm"] == pytest.approx(-0.0015, abs=2e-4) and found["place_mm"][0] > 52


def test_where_the_last_pass_fades_out_there_is_no_joint():
    fading = lambda p: cusps(p) + np.maximum(p[:, 0] - 58.5, 0) ** 2 / 20
    found = between(left(fading), right(cusps))[1][0]
    assert abs(found["step_max_mm"]) < 1e-4


def test_clampings_that_share_no_place_have_no_joint():
    apart = alone(lambda x: x > 70, cusps)
    assert between(left(), apart) == [[], []]


def test_three_clampings_are_compared_pair_by_pair():
    everything = alone(lambda x: x > 0, cusps)
    found = between(left(), right(cusps), everything)
    assert [[j["with"] for j in js] for js in found] == [[], ["a"], ["a", "b"]]
