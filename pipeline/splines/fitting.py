"""A smooth surface as a B-spline far closer than any tolerance: interpolation of high degree between its knots."""

import numpy as np
from scipy.interpolate import BSpline

from cuspline.splines.nurbs import NurbsSurface
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

DEGREE = 11
CLOSE_MM = 1e-11        # between the places interpolated; second derivatives then hold to about 1e-9
ROUNDS = 5              # halvings of all spans


def fitted(points_at, breaks_u, breaks_v):
    """NurbsSurface through a surface that is smooth between the given breaks.

    Args:
        points_at: function (u (n,), v (n,)) -> (n, 3) mm.
        breaks_u, breaks_v: rising parameters.
    Raises:
        DesignError: it does not close in: the surface is not smooth between its breaks.
    """
    for _ in range(ROUNDS):
        surface = _interpolated(points_at, breaks_u, breaks_v)
        u, v = (g.ravel() for g in np.meshgrid(_places(breaks_u, 0.37), _places(breaks_v, 0.61), indexing="ij"))
        if np.abs(surface.derivatives(u, v)[:, 0] - points_at(u, v)).max() < CLOSE_MM:
            return surface
        breaks_u, breaks_v = (np.sort(np.r_[b, (b[1:] + b[:-1]) / 2]) for b in (breaks_u, breaks_v))
    raise DesignError("a surface of the part is not smooth enough to be held as a B-spline: heal it, or build it anew")


def _places(breaks, shift):
    """Parameters between the interpolated ones, in every span."""
    share = (np.arange(DEGREE) + shift) / DEGREE
    return (breaks[:-1, None] + share * np.diff(breaks)[:, None]).ravel()


def _interpolated(points_at, breaks_u, breaks_v):
    (ku, u, mu), (kv, v, mv) = (_direction(b) for b in (breaks_u, breaks_v))
    uu, vv = (g.ravel() for g in np.meshgrid(u, v, indexing="ij"))
    values = points_at(uu, vv).reshape(len(u), len(v), 3)
    poles = fixed.solve(mu, values.reshape(len(u), -1)).reshape(values.shape)
    poles = fixed.solve(mv, poles.transpose(1, 0, 2).reshape(len(v), -1))
    poles = poles.reshape(len(v), len(u), 3).transpose(1, 0, 2)
    return NurbsSurface(degree_u=DEGREE, degree_v=DEGREE, knots_u=ku, knots_v=kv,
                        poles=np.concatenate([poles, np.ones((*poles.shape[:2], 1))], axis=-1))


def _direction(breaks):
    """Knots, interpolated parameters (Chebyshev-Lobatto in every span, ends shared) and collocation matrix."""
    knots = np.r_[breaks[0], np.repeat(breaks, DEGREE), breaks[-1]]
    share = (1 - fixed.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)) / 2
    places = np.r_[[a + s * (b - a) for a, b in zip(breaks[:-1], breaks[1:]) for s in share[:-1]], breaks[-1]]
    return knots, places, BSpline.design_matrix(places, knots, DEGREE).toarray()
