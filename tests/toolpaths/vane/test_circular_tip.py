"""The vane tip's closed forms: straight, conical and parabolic tips, tangency, normals square to the surface."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from cuspline.toolpaths.vane.circular_tip import CircularTip
from cuspline.values.errors import DesignError

ALPHA = np.radians(12.0)


def tip_of(center, radius, alpha=ALPHA, low=0.0, high=40.0, spans=5):
    """The tip whose centre and radius are the given polynomials of x, held exactly by a quintic spline."""
    knots = np.r_[np.full(5, low), np.linspace(low, high, spans + 1), np.full(5, high)]
    greville = np.array([knots[i + 1:i + 6].mean() for i in range(len(knots) - 6)])
    poles = [np.linalg.solve(BSpline.design_matrix(greville, knots, 5).toarray(), f(greville))
             for f in (center, radius)]
    return CircularTip(degree=5, knots_mm=knots, center_poles_mm=poles[0], radius_poles_mm=poles[1],
                       flank_half_angle_rad=alpha, foot_z_mm=-20.0)


PARABOLIC = tip_of(lambda x: 3.0 + 0.02 * (x - 20) ** 2, lambda x: 4.0 + 0.05 * x)
X = np.linspace(0.5, 39.5, 31)


def test_a_straight_tip_is_a_cylinder():
    tip = tip_of(lambda x: np.full_like(x, 7.0), lambda x: np.full_like(x, 4.0))
    points, normals = tip.point_mm(X, 0.6), tip.normal(X, 0.6)
    assert np.abs(np.hypot(points[:, 1], points[:, 2] - 7.0) - 4.0).max() < 1e-12
    assert np.abs(normals - [0.0, np.sin(0.6), np.cos(0.6)]).max() < 1e-12


def test_polynomials_and_their_derivatives_are_exact():
    tip = PARABOLIC
    assert np.abs(tip.center_z_mm(X) - 3.0 - 0.02 * (X - 20) ** 2).max() < 1e-12
    assert np.abs(tip.center_slope(X) - 0.04 * (X - 20)).max() < 1e-12
    assert np.abs(tip.center_bend_per_mm(X) - 0.04).max() < 1e-11
    assert np.abs(tip.radius_mm(X) - 4.0 - 0.05 * X).max() < 1e-12
    assert np.abs(tip.radius_slope(X) - 0.05).max() < 1e-12
    assert np.abs(tip.crest_z_mm(X) - 7.0 - 0.02 * (X - 20) ** 2 - 0.05 * X).max() < 1e-12


def test_a_cone_has_one_normal_along_every_ruling():
    """R = x tan β about a level axis: the normal leans back by β at every turn."""
    beta = np.arctan(0.05)
    tip = tip_of(lambda x: np.full_like(x, 2.0), lambda x: 4.0 + 0.05 * x)
    for turn in (-1.1, 0.0, 0.7):
        wanted = [-np.sin(beta), np.cos(beta) * np.sin(turn), np.cos(beta) * np.cos(turn)]
        assert np.abs(tip.normal(X, turn) - wanted).max() < 1e-12


@pytest.mark.parametrize("turn", [-1.2, -0.3, 0.0, 0.9])
def test_normals_stand_square_on_the_surface(turn):
    step = 1e-5
    along = (PARABOLIC.point_mm(X + step, turn) - PARABOLIC.point_mm(X - step, turn)) / (2 * step)
    round_ = (PARABOLIC.point_mm(X, turn + step) - PARABOLIC.point_mm(X, turn - step)) / (2 * step)
    normal = PARABOLIC.normal(X, turn)
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-14
    assert np.abs(np.einsum("ij,ij->i", normal, along)).max() < 1e-8       # differences of 1e-5: 1e-10 and rounding
    assert np.abs(np.einsum("ij,ij->i", normal, round_)).max() < 1e-8
    assert (normal[:, 2] * np.cos(turn) > 0).all()


def test_arc_and_flank_meet_in_a_tangent():
    tip = PARABOLIC
    y, z = tip.tangency_mm(X)
    end = tip.point_mm(X, tip.half_arc_rad)
    assert np.abs(np.column_stack([y, z]) - end[:, 1:]).max() < 1e-12
    assert np.abs(tip.flank_point_mm(X, z) - end).max() < 1e-12
    assert np.abs(tip.flank_normal(X) - tip.normal(X, tip.half_arc_rad)).max() < 1e-12


def test_flank_normals_stand_square_on_the_flank():
    step, z = 1e-5, PARABOLIC.tangency_mm(X)[1] - 3.0
    along = (PARABOLIC.flank_point_mm(X + step, z) - PARABOLIC.flank_point_mm(X - step, z)) / (2 * step)
    down = PARABOLIC.flank_point_mm(X, z - 1.0) - PARABOLIC.flank_point_mm(X, z)
    normal = PARABOLIC.flank_normal(X)
    assert np.abs(np.einsum("ij,ij->i", normal, along)).max() < 1e-8
    assert np.abs(np.einsum("ij,ij->i", normal, down)).max() < 1e-12
    assert np.abs(np.degrees(np.arctan2(down[:, 1], -down[:, 2])) - 12.0).max() < 1e-9


def test_parallel_sides_meet_the_arc_beside_its_centre():
    tip = tip_of(lambda x: 0.1 * x, lambda x: np.full_like(x, 4.0), alpha=0.0)
    y, z = tip.tangency_mm(X)
    assert np.abs(y - 4.0).max() < 1e-12 and np.abs(z - 0.1 * X).max() < 1e-12
    assert np.abs(tip.flank_normal(X) - [0.0, 1.0, 0.0]).max() < 1e-12


def test_what_lies_beyond_the_ends_is_taken_at_the_ends():
    assert PARABOLIC.range_mm == (0.0, 40.0)
    assert np.array_equal(PARABOLIC.center_z_mm([-5.0, 60.0]), PARABOLIC.center_z_mm([0.0, 40.0]))


def test_impossible_tips_are_refused():
    with pytest.raises(DesignError, match="radius falls to"):
        tip_of(lambda x: 0 * x, lambda x: 1.0 - 0.05 * x)
    with pytest.raises(DesignError, match="half-angle 95"):
        tip_of(lambda x: 0 * x, lambda x: 0 * x + 1.0, alpha=np.radians(95.0))
    with pytest.raises(ValueError, match="knots"):
        CircularTip(degree=5, knots_mm=np.arange(8.0), center_poles_mm=[0.0, 0.0], radius_poles_mm=[1.0, 1.0],
                    flank_half_angle_rad=0.0, foot_z_mm=0.0)


def test_arrays_are_copied_and_read_only():
    poles = np.ones(10)
    tip = CircularTip(degree=5, knots_mm=PARABOLIC.knots_mm, center_poles_mm=poles, radius_poles_mm=poles,
                      flank_half_angle_rad=0.0, foot_z_mm=0.0)
    poles[:] = 5.0
    assert tip.center_poles_mm.max() == 1.0
    with pytest.raises(ValueError):
        tip.radius_poles_mm[0] = 2.0


def test_a_part_of_a_tip_is_the_same_tip():
    tip = tip_of(lambda x: 30.0 + np.sin(0.7 * x), lambda x: 4.0 + 0.3 * np.cos(0.4 * x), spans=23)
    low, high = tip.range_mm
    a, b = low + 0.31 * (high - low), low + 0.77 * (high - low)
    part, x = tip.between(a, b), np.linspace(a, b, 501)
    assert part.range_mm == pytest.approx((a, b), abs=1e-12)
    for name in ("center_z_mm", "radius_mm", "center_slope", "radius_slope", "center_bend_per_mm",
                 "radius_bend_per_mm"):
        assert np.allclose(getattr(part, name)(x), getattr(tip, name)(x), atol=1e-9, rtol=0), name
    assert tip.between(low - 5, high + 5) is tip
    with pytest.raises(ValueError, match="no tip between"):
        tip.between(high + 1, high + 2)
