"""Fair splines through tables: as smooth as the table's own rounding allows, so that curvature does not ripple.

Among all quintic splines that keep within the rounding of the given values, nearly the one of least
bending, the integral of the squared third (or second) derivative.
"""

import numpy as np
from scipy.interpolate import BSpline

DEGREE = 5
STEPS = 40              # of the bisection for the stiffness


def fair_spline(x, y, within=0.0, *, domain=None, sites=None, zero_derivatives=((), ()), slope_at_start=None,
                bending=3):
    """Quintic spline through values, smoothed as far as their rounding allows.

    Args:
        x: (n,) rising.
        y: (n,) or (n, m) values.
        within: how far the spline may pass from a value; 0: through all of them.
        domain: (low, high) that the spline spans; None: that of x.
        sites: (k,) rising knots, the ends of the domain among them; None: the values' places and their middles.
        zero_derivatives: orders of the derivatives that vanish at the low and at the high end of the domain:
            ((1, 3), ()) makes it even about its low end, ((0, 2, 4), ()) odd.
        slope_at_start: first derivative at the low end of the domain; None: free.
        bending: order of the derivative that is kept small, 2 or 3.
    Returns:
        scipy BSpline.

    >>> x = np.linspace(0.0, 1.0, 6)
    >>> bool(abs(fair_spline(x, x ** 2)(0.33) - 0.33 ** 2) < 1e-9)
    True
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    if sites is None:
        sites = np.unique(x if domain is None else np.r_[domain[0], x[(x > domain[0]) & (x < domain[1])], domain[1]])
        sites = np.sort(np.r_[sites, (sites[1:] + sites[:-1]) / 2])
    low, high, inner = sites[0], sites[-1], sites
    knots = np.r_[[low] * DEGREE, inner, [high] * DEGREE]
    rows, values = _end_conditions(knots, low, high, zero_derivatives, slope_at_start, y.shape[1:])
    through = BSpline.design_matrix(x, knots, DEGREE).toarray()
    energy = _energy(knots, inner, bending)
    if within == 0.0:
        return BSpline(knots, _least(energy, np.vstack([rows, through]), np.concatenate([values, y])), DEGREE)
    soft, stiff = -12.0, 8.0        # decimal logarithm of the weight of the bending
    best = None
    for _ in range(STEPS):
        middle = (soft + stiff) / 2
        found = _least(10.0 ** middle * energy + through.T @ through, rows, values, through.T @ y)
        if np.abs(through @ found - y).max() <= within:
            soft, best = middle, found
        else:
            stiff = middle
    if best is None:                # the end conditions or the sites leave no room: go through the values
        best = _least(energy, np.vstack([rows, through]), np.concatenate([values, y]))
    return BSpline(knots, best, DEGREE)


def _end_conditions(knots, low, high, zero_derivatives, slope_at_start, tail):
    """Rows and right sides of the conditions at the ends of the domain."""
    unit = BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE)
    rows = [unit.derivative(k)(end) if k else unit(end)
            for end, orders in zip((low, high), zero_derivatives) for k in orders]
    values = [np.zeros(tail)] * len(rows)
    if slope_at_start is not None:
        rows.append(unit.derivative()(low))
        values.append(np.full(tail, slope_at_start))
    return np.array(rows).reshape(-1, unit.c.shape[0]), np.array(values).reshape(-1, *tail)


def _energy(knots, sites, order):
    """(n, n) integral of the products of two basis functions' derivatives, exact by Gauss points in every span."""
    nodes, weights = np.polynomial.legendre.leggauss(DEGREE)
    half = np.diff(sites) / 2
    places = (sites[:-1] + half)[:, None] + half[:, None] * nodes
    derived = BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE).derivative(order)(places.ravel())
    return derived.T @ ((half[:, None] * weights).ravel()[:, None] * derived) * (sites[-1] - sites[0]) ** (2 * order - 1)


def _least(energy, rows, values, pull=0.0):
    """Coefficients c of least c'Ac/2 - pull'c that keep rows @ c = values; (rows may repeat themselves)."""
    flat = values.reshape(len(values), int(np.prod(values.shape[1:])))
    particular = np.linalg.lstsq(rows, flat, rcond=None)[0] if len(rows) else np.zeros((len(energy), flat.shape[1]))
    free = _null_space(rows, len(energy))
    wanted = np.reshape(pull, (-1, flat.shape[1])) if np.ndim(pull) else 0.0
    inner = free.T @ energy @ free
    step = np.linalg.lstsq(inner, free.T @ (wanted - energy @ particular), rcond=1e-15)[0]
    return (particular + free @ step).reshape(-1, *values.shape[1:])


def _null_space(rows, size):
    if not len(rows):
        return np.eye(size)
    _, strength, basis = np.linalg.svd(rows)
    return basis[(strength > 1e-12 * strength[0]).sum():].T
