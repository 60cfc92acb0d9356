"""Functions whose every bit is fixed: right to some units in the last place, against mpmath, NumPy and SciPy."""

import mpmath
import numpy as np
import pytest
from scipy import sparse
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.ndimage import gaussian_filter
from scipy.special import iv, ivp

from cuspline.splines.spline_interpolation import interpolated, natural
from cuspline.toolpaths.freeform.blur import blurred
from cuspline.toolpaths.freeform.grid_cholesky import Factors, dissected
from cuspline.values import fixed_math as fixed

RNG = np.random.default_rng(5)
WIDE = np.concatenate([RNG.uniform(-7, 7, 300), RNG.normal(size=100) * 1e-5, RNG.uniform(-1e5, 1e5, 100)])
SHARES = np.concatenate([RNG.uniform(-1, 1, 300), 1 - RNG.uniform(0, 1e-9, 20), RNG.normal(size=50) * 1e-9])
SIZES = 10.0 ** RNG.uniform(-8, 8, 300)
BASES = RNG.uniform(0.01, 50, 200)


def units_off(got, exact):
    """Largest distance in units of the last place."""
    rows = zip(np.ravel(got).tolist(), exact)
    return max(float(abs(mpmath.mpf(g) - e) / mpmath.mpf(float(np.spacing(abs(float(e)))))) for g, e in rows if e != 0)


@pytest.mark.parametrize("name, exact, values, most", [
    ("sin", mpmath.sin, (WIDE,), 1.5), ("cos", mpmath.cos, (WIDE,), 1.5), ("tan", mpmath.tan, (WIDE,), 3.0),
    ("arctan", mpmath.atan, (RNG.normal(size=300) * SIZES,), 1.5), ("arcsin", mpmath.asin, (SHARES,), 2.5),
    ("arccos", mpmath.acos, (SHARES,), 2.5), ("arctan2", mpmath.atan2, (RNG.normal(size=300), RNG.normal(size=300)), 2.0),
    ("exp", mpmath.exp, (RNG.uniform(-30, 30, 300),), 1.5), ("log", mpmath.log, (SIZES,), 2.5),
    ("log", mpmath.log, (1 + RNG.normal(size=200) * 1e-3,), 2.5), ("cbrt", mpmath.cbrt, (SIZES,), 1.5),
    ("power", mpmath.power, (BASES, np.full(200, 1.5)), 8.0), ("power", mpmath.power, (BASES, np.full(200, -0.25)), 8.0),
    ("tanh", mpmath.tanh, (RNG.normal(size=300),), 10.0)])
def test_functions_are_right_to_some_units_in_the_last_place(name, exact, values, most):
    with mpmath.workprec(200):
        wanted = [exact(*(mpmath.mpf(float(v)) for v in row)) for row in zip(*values)]
        assert units_off(getattr(fixed, name)(*values), wanted) < most


@pytest.mark.parametrize("seen", [lambda a: a, lambda a: np.moveaxis(a, 1, 0), lambda a: a[::2, ::3]],
                         ids=["whole", "turned", "some"])
def test_lengths_are_those_of_numpy_to_the_last_bit(seen):
    vectors = np.random.default_rng(3).normal(size=(40, 50, 3)) * 10.0 ** np.random.default_rng(4).integers(-9, 9, (40, 50, 1))
    vectors[3, 4], vectors[6, 9, 1] = np.inf, np.nan
    assert np.array_equal(fixed.lengths(seen(vectors)), np.linalg.norm(seen(vectors), axis=-1), equal_nan=True)


def test_special_values():
    assert fixed.sin(0.0) == 0.0 and fixed.cos(0.0) == 1.0 and fixed.sin(np.pi / 2) == 1.0 and fixed.cos(np.pi) == -1.0
    assert fixed.arctan2(0.0, -1.0) == np.pi and fixed.arctan2(-0.0, -1.0) == -np.pi and fixed.arctan2(0.0, 0.0) == 0.0
    assert fixed.arctan2(np.inf, np.inf) == np.pi / 4 and fixed.arctan2(1.0, 0.0) == np.pi / 2
    assert fixed.exp(1000.0) == np.inf and fixed.exp(-1000.0) == 0.0 and fixed.log(0.0) == -np.inf
    assert fixed.hypot(3e200, 4e200) == pytest.approx(5e200, rel=1e-15) and fixed.hypot(3e-200, -4e-200) == pytest.approx(5e-200)
    assert fixed.hypot(0.0, 0.0) == 0.0 and fixed.hypot(-np.inf, 1.0) == np.inf and np.isnan(fixed.hypot(np.nan, 1.0))
    assert fixed.power(-2.0, 3.0) == -8.0 and fixed.power(2.0, -2.0) == 0.25 and fixed.power(0.0, 0.3) == 0.0
    for name in ("sin", "cos", "tan", "arctan", "exp", "log", "arcsin", "arccos", "tanh", "cbrt"):
        assert np.isnan(getattr(fixed, name)(np.nan)), name
    assert np.isnan(fixed.sin(np.inf)) and np.isnan(fixed.arcsin(1.1)) and np.isnan(fixed.log(-1.0))


@pytest.mark.parametrize("order", [0, 1, 2, 6])
def test_bessel_functions_agree_with_scipy(order):
    x = np.linspace(0.01, 30.0, 60)
    assert fixed.bessel_i(order, x) == pytest.approx(iv(order, x), rel=1e-13)
    assert fixed.bessel_i_slope(order, x) == pytest.approx(ivp(order, x), rel=1e-12)


def test_systems_agree_with_lapack():
    a, b = RNG.normal(size=(40, 40)), RNG.normal(size=(40, 3))
    assert fixed.solve(a, b) == pytest.approx(np.linalg.solve(a, b), abs=1e-10)
    assert fixed.solve(a, b[:, 0]) == pytest.approx(np.linalg.solve(a, b[:, 0]), abs=1e-10)
    assert fixed.least_squares(a[:, :9], b) == pytest.approx(np.linalg.lstsq(a[:, :9], b)[0], abs=1e-12)
    u, s, v = fixed.singular_values(a[:, :5])
    assert (u * s) @ v.T == pytest.approx(a[:, :5], abs=1e-13) and s == pytest.approx(np.linalg.svd(a[:, :5])[1], abs=1e-12)
    assert fixed.matmul(a, b) == pytest.approx(a @ b, abs=1e-12) and fixed.length(a) == pytest.approx(np.linalg.norm(a))
    three = RNG.normal(size=(7, 3, 3))
    assert fixed.determinant(three) == pytest.approx(np.linalg.det(three), abs=1e-13)
    with pytest.raises(ZeroDivisionError):
        fixed.solve(np.zeros((3, 3)), np.ones(3))


def test_rows_that_hang_on_each_other_leave_the_same_freedom():
    rows = RNG.normal(size=(6, 11))
    free, start = fixed.null_space_and_particular(np.vstack([rows, 2 * rows[:2] - rows[3]]),
                                                  np.r_[np.ones(6), 1.0, 1.0][:, None])
    assert free.shape == (11, 5) and free.T @ free == pytest.approx(np.eye(5), abs=1e-13)
    assert rows @ free == pytest.approx(np.zeros((6, 5)), abs=1e-13) and rows @ start == pytest.approx(np.ones((6, 1)))
    assert start == pytest.approx(np.linalg.lstsq(rows, np.ones((6, 1)))[0], abs=1e-13)         # the shortest


@pytest.mark.parametrize("degree", [3, 5])
def test_splines_agree_with_scipys(degree):
    x, y = np.sort(RNG.random(40)), RNG.normal(size=(40, 2))
    at = np.linspace(x[0], x[-1], 301)
    wanted = make_interp_spline(x, y, degree)
    assert interpolated(x, y, degree)(at) == pytest.approx(wanted(at), rel=1e-6, abs=1e-7 * np.abs(wanted.c).max())
    assert interpolated(x, y, degree)(x) == pytest.approx(y, abs=1e-9 * np.abs(wanted.c).max())


def test_natural_splines_agree_with_scipys():
    x, y = np.sort(RNG.random(9)), RNG.normal(size=9)
    at = np.linspace(x[0], x[-1], 101)
    assert natural(x, y)(at) == pytest.approx(CubicSpline(x, y, bc_type="natural")(at), abs=1e-10)


@pytest.mark.parametrize("mode", ["reflect", "constant"])
def test_blurred_masks_agree_with_scipys(mode):
    mask = RNG.random((30, 20)) > 0.5
    assert blurred(mask, 2.0, mode) == pytest.approx(gaussian_filter(mask.astype(float), 2.0, mode=mode), abs=1e-14)


def grid_matrix(ny, nx, keep):
    """Differences between neighbouring nodes of a grid with random weights, held at a hair."""
    number = np.full((ny, nx), -1)
    at = np.argwhere(keep)
    number[tuple(at.T)] = np.arange(len(at))
    pairs = [(number[:, :-1], number[:, 1:]), (number[:-1], number[1:]), (number[:-1, :-1], number[1:, 1:])]
    a, b = (np.concatenate([p[k].ravel() for p in pairs]) for k in (0, 1))
    a, b = a[(a >= 0) & (b >= 0)], b[(a >= 0) & (b >= 0)]
    w = RNG.uniform(0.1, 2, len(a))
    off = sparse.coo_matrix((np.r_[-w, -w], (np.r_[a, b], np.r_[b, a])), (len(at), len(at))).tocsr()
    return (off + sparse.diags(1e-6 - np.asarray(off.sum(axis=1)).ravel())).tocsc(), at


def test_grid_factors_solve_and_stay_sparse():
    keep = np.ones((40, 55), bool)
    keep[10:20, 10:30] = False
    matrix, at = grid_matrix(*keep.shape, keep)
    factors, right = Factors.of(matrix, at), RNG.normal(size=len(at))
    assert matrix @ factors.solve(right) == pytest.approx(right, abs=1e-8)      # values up to 1e6
    assert sorted(dissected(at)) == list(range(len(at)))
    assert len(factors.row) < 31 / 4 * len(at) * np.log2(len(at))      # George's bound for a square grid
    with pytest.raises(ZeroDivisionError):
        Factors.of(-matrix, at)
