"""Splines through values, the same to the last bit everywhere: SciPy's interpolation asks LAPACK, this does not."""

import numpy as np
from scipy.interpolate import BSpline

from cuspline import fixed_math as fixed


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
