"""Pieces of patches moved out along their normals: flat parallelograms, and how far off them the true ones can be."""

import numpy as np

from cuspline.surfaces.enclosures import (
    BY_S,
    BY_T,
    MID,
    REST,
    _add,
    _cross,
    _derived,
    _dot,
    _inverse,
    _inverse_root,
    _less,
    _mul,
    _recentred,
    _scaled,
    _times,
    _vector,
    shifted,
)
from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, IS_RATIONAL
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z

MIDDLE, SIDE_S, SIDE_T, SHIFT, OFF_BY = 0, 3, 6, 9, 12      # columns of `offset_of_piece`, the first four are vectors


@njit(error_model="numpy")
def _centred(work, du, dv, k):
    """Form of component k whose middle lies between its lowest and highest place: even powers are never negative."""
    c, a, b, r = _derived(work, du, dv, k, 0, 0)
    for i in range(0, du + 1, 2):
        for j in range(2 if i == 0 else 0, dv + 1, 2):
            c += work[i, j, k] / 2
            r -= abs(work[i, j, k]) / 2
    return c, a, b, r


@njit(error_model="numpy")
def _tangents(work, du, dv, is_rational):
    """Forms of S (about its middle), Ss, St."""
    p = _centred(work, du, dv, 0), _centred(work, du, dv, 1), _centred(work, du, dv, 2)
    ps, pt = _vector(work, du, dv, 1, 0), _vector(work, du, dv, 0, 1)
    if not is_rational:
        return p, ps, pt
    i = _inverse(_derived(work, du, dv, 3, 0, 0))
    p = _times(i, p)
    return (p, _times(i, _less(ps, _derived(work, du, dv, 3, 1, 0), p)),
            _times(i, _less(pt, _derived(work, du, dv, 3, 0, 1), p)))


@njit(error_model="numpy")
def offset_of_piece(coefficients, patch, sign, by_mm, box, work, out):
    """A piece moved along its normals: every point of it is middle + shift + s a + t b + r, s and t in [-1, 1], |r| <= rest.

    Args:
        patch: row of PatchSet.patch; sign: of its face.
        by_mm: distance out of the material.
        box: (4,) s low, s high, t low, t high.
        work: (degree u + 1, degree v + 1, 4) or larger.
        out: (13,) filled: middle, a, b, shift, rest; rest is inf where nothing bounds it (a pole).  a and b of a piece with a
            pole are those of the surface itself.
    """
    du, dv = patch[DEGREE_U], patch[DEGREE_V]
    shifted(coefficients, patch, box, work)
    _recentred(work, du, dv, out)
    S, Ss, St = _tangents(work, du, dv, patch[IS_RATIONAL] != 0)
    N = _cross(Ss, St)
    per_length = _scaled(sign * by_mm, _inverse_root(_dot(N, N)))
    rest, bounded = 0.0, per_length[REST] < np.inf and S[X][REST] + S[Y][REST] + S[Z][REST] < np.inf
    for k in range(3):
        x = _add(S[k], _mul(N[k], per_length)) if bounded else S[k]
        out[SHIFT + k] = S[k][MID]
        out[k] += x[MID] - S[k][MID]
        out[SIDE_S + k], out[SIDE_T + k] = x[BY_S], x[BY_T]
        rest += x[REST] * x[REST]
    out[OFF_BY] = np.sqrt(rest) if bounded else np.inf
