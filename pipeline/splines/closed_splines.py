"""Closed curves and surfaces as splines: periodic interpolation, pieces with clamped ends, pieces of surfaces."""

import numpy as np
from scipy.interpolate import BSpline

from cuspline.splines.nurbs import NurbsSurface
from cuspline.values import fixed_math as fixed

SAME = 1e-12        # parameters closer than this are one


def periodic_spline(sites, values, period, degree=5):
    """Spline of period `period` through values, with its knots at their places.

    Args:
        sites: (n,) rising, within one period.
        values: (n, ...).
        degree: odd.
    Returns:
        scipy BSpline, clamped at sites[0] and sites[0] + period.

    >>> t = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)
    >>> bool(abs(periodic_spline(t, np.sin(t), 2 * np.pi)(1.0) - np.sin(1.0)) < 1e-7)
    True
    """
    sites, values = np.asarray(sites, float), np.asarray(values, float)
    n = len(sites)
    around = np.arange(-degree, n + degree + 1)
    knots = sites[around % n] + period * (around // n)
    spread = BSpline.design_matrix(sites, knots, degree).toarray()
    basis = spread[:, :n].copy()
    basis[:, :degree] += spread[:, n:]
    poles = fixed.solve(basis, values.reshape(n, -1)).reshape(values.shape)
    return piece(BSpline(knots, np.concatenate([poles, poles[:degree]]), degree), sites[0], sites[0] + period)


def piece(spline, low, high):
    """The same spline between two parameters, its ends clamped there."""
    for end in (low, high):
        for _ in range(spline.k - int(np.sum(np.abs(spline.t - end) < SAME))):
            spline = spline.insert_knot(end)
    first = int(np.searchsorted(spline.t, low + SAME)) - spline.k
    last = int(np.searchsorted(spline.t, high - SAME)) + spline.k
    knots = np.r_[low, np.clip(spline.t[first:last], low, high), high]
    return BSpline(knots, spline.c[first - 1:first - 1 + len(knots) - spline.k - 1], spline.k)


def surface_piece(surface, u_low, u_high, v_low, v_high):
    """The same NurbsSurface between parameters, exact."""
    along = piece(BSpline(surface.knots_u, surface.poles, surface.degree_u), u_low, u_high)
    across = piece(BSpline(surface.knots_v, along.c.transpose(1, 0, 2), surface.degree_v), v_low, v_high)
    return NurbsSurface(degree_u=surface.degree_u, degree_v=surface.degree_v, knots_u=along.t, knots_v=across.t,
                        poles=across.c.transpose(1, 0, 2))
