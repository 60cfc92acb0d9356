"""Fair splines through tables: as smooth as the table's own rounding allows, so that curvature does not ripple.

Among all quintic splines that keep within the rounding of the given values, nearly the one of least
bending, the integral of the squared third (or second) derivative.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from cuspline.values import fixed_math as fixed

DEGREE = 5
STEPS = 14              # of the bisection for the stiffness, over STIFFNESS
STIFFNESS = (-12.0, 8.0)        # decimal logarithm of the weight of the bending


@dataclass(frozen=True, eq=False, kw_only=True)
class Held:
    """Derivatives that a fair spline keeps exactly; None: free."""

    # orders of those that vanish at the low and at the high end of the domain: ((1, 3), ()) makes the spline even about its
    # low end, ((0, 2, 4), ()) odd
    zero_derivatives: tuple = ((), ())
    slope_at_start: float | None = None     # first derivative at the low end of the domain
    slopes: np.ndarray | None = None        # (n,) first derivatives at the values' places; NaN: free


def fair_spline(x, y, within=0.0, *, domain=None, sites=None, held=Held(), bending=3):
    """Quintic spline through values, smoothed as far as their rounding allows.

    Args:
        x: (n,) rising.
        y: (n,) or (n, m) values.
        within: how far the spline may pass from a value; 0: through all of them.
        domain: (low, high) that the spline spans; None: that of x.
        sites: (k,) rising knots, the ends of the domain among them; None: the values' places and their middles.
        held: Held.
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
    knots = np.r_[[sites[0]] * DEGREE, sites, [sites[-1]] * DEGREE]
    rows, values = _end_conditions(knots, held, y.shape[1:])
    if held.slopes is not None:
        told = np.isfinite(held.slopes)
        rows = np.vstack([rows, BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE).derivative()(x[told])])
        values = np.concatenate([values, np.asarray(held.slopes, float)[told]])
    through = BSpline.design_matrix(x, knots, DEGREE).toarray()
    energy = _energy(knots, sites, bending)
    exact = _Constrained(energy, np.vstack([rows, through]), np.concatenate([values, y]))
    if within == 0.0:
        return BSpline(knots, exact.least(1.0), DEGREE)
    bound, best = _Constrained(energy, rows, values, through, y), None
    soft, stiff = STIFFNESS
    for _ in range(STEPS):
        middle = (soft + stiff) / 2
        found = bound.least(fixed.power(10.0, middle))
        if np.abs(fixed.matmul(through, found) - y).max() <= within:
            soft, best = middle, found
        else:
            stiff = middle
    # no room left by the end conditions or by too few knots: as near to the values as can be
    return BSpline(knots, exact.least(1.0) if best is None else best, DEGREE)


def _end_conditions(knots, held, tail):
    """Rows and right sides of the conditions at the ends of the domain."""
    unit = BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE)
    rows = [unit.derivative(k)(end) if k else unit(end)
            for end, orders in zip((knots[0], knots[-1]), held.zero_derivatives) for k in orders]
    values = [np.zeros(tail)] * len(rows)
    if held.slope_at_start is not None:
        rows.append(unit.derivative()(knots[0]))
        values.append(np.full(tail, held.slope_at_start))
    return np.array(rows).reshape(-1, unit.c.shape[0]), np.array(values).reshape(-1, *tail)


def _energy(knots, sites, order):
    """(n, n) integral of the products of two basis functions' derivatives, exact by Gauss points in every span."""
    nodes, weights = fixed.gauss_points(DEGREE)
    half = np.diff(sites) / 2
    places = (sites[:-1] + half)[:, None] + half[:, None] * nodes
    derived = BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE).derivative(order)(places.ravel())
    weighted = (half[:, None] * weights).ravel()[:, None] * derived
    return fixed.matmul(derived.T, weighted) * fixed.power(sites[-1] - sites[0], 2 * order - 1)


class _Constrained:
    """Coefficients c of least stiffness c'Ac/2 + |Bc - y|^2/2 that keep rows @ c = values; rows may be dependent."""

    def __init__(self, energy, rows, values, through=None, y=None):
        size, self._tail = len(energy), values.shape[1:]
        flat = values.reshape(len(values), int(np.prod(self._tail)))
        self._free, self._start = fixed.null_space_and_particular(rows.reshape(-1, size), flat)
        self._energy = fixed.matmul(fixed.matmul(self._free.T, energy), self._free)
        self._force = fixed.matmul(self._free.T, fixed.matmul(energy, self._start))
        self._pull, self._miss = 0.0, 0.0
        if through is not None:
            seen = fixed.matmul(through, self._free)
            self._pull = fixed.matmul(seen.T, seen)
            self._miss = fixed.matmul(seen.T, y.reshape(len(y), -1) - fixed.matmul(through, self._start))

    def least(self, stiffness):
        step = fixed.least_squares(stiffness * self._energy + self._pull, self._miss - stiffness * self._force)
        return (self._start + fixed.matmul(self._free, step)).reshape(-1, *self._tail)
