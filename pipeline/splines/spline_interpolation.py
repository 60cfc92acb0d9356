"""Splines through values, the same to the last bit everywhere: SciPy's interpolation asks LAPACK, this does not."""

import numpy as np
from scipy.interpolate import BSpline

from cuspline.values import fixed_math as fixed


def interpolated(sites, values, degree, knots=None):
    """Spline through values.

    Args:
        sites: (n,) rising.
        values: (n, ...).
        degree: odd, where `knots` is None.
        knots: (n + degree + 1,); None: every site but the (degree - 1) / 2 next to each end ("not a knot").
    Returns:
        scipy BSpline.
    Raises:
        ZeroDivisionError: a site lies outside its basis function (Schoenberg and Whitney).

    >>> x = np.linspace(0.0, 1.0, 9)
    >>> bool(abs(interpolated(x, x * x * x, 3)(0.3) - 0.027) < 1e-14)
    True
    """
    sites, values = np.asarray(sites, float), np.asarray(values, float)
    if knots is None:
        skipped = (degree + 1) // 2
        knots = np.r_[[sites[0]] * (degree + 1), sites[skipped:-skipped], [sites[-1]] * (degree + 1)]
    rows = BSpline.design_matrix(sites, knots, degree)
    poles = fixed.solve_banded(rows.indices[::degree + 1], rows.data.reshape(-1, degree + 1),
                               values.reshape(len(values), -1))
    return BSpline(knots, poles.reshape(values.shape), degree)


def natural(sites, values):
    """Cubic spline through values without bend at its ends; a straight line through two.

    Args:
        sites: (n,) rising, n >= 2.
        values: (n,).

    >>> bool(abs(natural([0.0, 1.0, 3.0], [1.0, 2.0, 4.0])(2.2) - 3.2) < 1e-14)
    True
    """
    sites = np.asarray(sites, float)
    if len(sites) == 2:
        return interpolated(sites, values, 1)
    knots = np.r_[[sites[0]] * 4, sites[1:-1], [sites[-1]] * 4]
    basis = BSpline(knots, np.eye(len(sites) + 2), 3)
    rows = np.vstack([basis(sites), basis(sites[[0, -1]], 2)])
    return BSpline(knots, fixed.solve(rows, np.r_[values, 0.0, 0.0]), 3)
