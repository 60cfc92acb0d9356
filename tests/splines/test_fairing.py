"""Fair splines keep to the table's rounding and do not ripple; pieces of closed splines are exact."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from cuspline.splines.closed_splines import periodic_spline, piece, surface_piece
from cuspline.splines.fairing import Held, fair_spline
from cuspline.splines.nurbs import NurbsSurface

ROUNDING = 0.5e-4


def rounded_table(count=26):
    x = np.linspace(0.0, np.pi, count)
    return x, np.round(np.sin(x) + 0.2 * np.cos(2 * x), 4)


def turns_of_third_derivative(spline):
    third = spline.derivative(3)(np.linspace(0.0, np.pi, 2001))
    return int(np.sum(np.diff(np.sign(np.diff(third))) != 0))


def test_a_fair_spline_keeps_within_the_rounding_and_ripples_less_than_one_through_the_values():
    x, y = rounded_table()
    fair, stiff = fair_spline(x, y, ROUNDING), make_interp_spline(x, y, 5)
    assert np.abs(fair(x) - y).max() <= ROUNDING
    true = lambda q: np.sin(q) + 0.2 * np.cos(2 * q)
    q = np.linspace(0.2, np.pi - 0.2, 500)
    second = -np.sin(q) - 0.8 * np.cos(2 * q)
    assert np.abs(fair(q) - true(q)).max() < 2 * ROUNDING
    assert np.abs(fair.derivative(2)(q) - second).max() < 0.4 * np.abs(stiff.derivative(2)(q) - second).max()
    assert turns_of_third_derivative(fair) < turns_of_third_derivative(stiff)


def test_without_rounding_it_goes_through_every_value():
    x, y = rounded_table(9)
    assert np.abs(fair_spline(x, y)(x) - y).max() < 1e-12
    both = fair_spline(x, np.column_stack([y, -2 * y]))
    assert np.abs(both(x) - np.column_stack([y, -2 * y])).max() < 1e-12


def test_end_conditions_hold_and_the_table_still_fits():
    x = np.linspace(0.0, np.pi, 20)
    odd = fair_spline(x, np.sin(x / 2), 1e-6, held=Held(zero_derivatives=((0, 2, 4), (1, 3)), slope_at_start=0.5))
    assert abs(odd(0.0)) < 1e-12 and abs(odd.derivative(2)(0.0)) < 1e-9 and abs(odd.derivative()(np.pi)) < 1e-9
    assert odd.derivative()(0.0) == pytest.approx(0.5, abs=1e-10)
    assert np.abs(odd(x) - np.sin(x / 2)).max() <= 1e-6


def test_periodic_interpolation_is_of_sixth_order():
    q, errors = np.linspace(0, 2 * np.pi, 1999), []
    for count in (24, 48):
        t = np.linspace(0, 2 * np.pi, count, endpoint=False)
        errors.append(np.abs(periodic_spline(t, np.exp(np.sin(t)), 2 * np.pi)(q) - np.exp(np.sin(q))).max())
    assert errors[0] / errors[1] > 40


def test_pieces_of_splines_and_surfaces_are_the_same_curve():
    t = np.sort(np.random.default_rng(3).uniform(0, 2 * np.pi, 30))
    whole = periodic_spline(t, np.column_stack([np.cos(t), np.sin(3 * t), t * 0]), 2 * np.pi)
    part, q = piece(whole, t[0] + 0.3, t[0] + 2.0), np.linspace(t[0] + 0.3, t[0] + 2.0, 77)
    assert np.abs(part(q) - whole(q)).max() < 1e-12 and part.t[0] == t[0] + 0.3 and part.t[-1] == t[0] + 2.0
    poles = np.random.default_rng(4).uniform(0.5, 1.5, (9, 8, 4))
    u, v = np.r_[[0.0] * 3, np.linspace(0, 1, 7), [1.0] * 3], np.r_[[0.0] * 3, np.linspace(0, 1, 6), [1.0] * 3]
    surface = NurbsSurface(degree_u=3, degree_v=3, knots_u=u, knots_v=v, poles=poles)
    cut = surface_piece(surface, 0.21, 0.8, 0.4, 1.0)
    a, b = np.random.default_rng(5).uniform((0.21, 0.4), (0.8, 1.0), (50, 2)).T
    assert np.abs(cut.derivatives(a, b)[:, :3] - surface.derivatives(a, b)[:, :3]).max() < 1e-10
