"""Rational B-spline surfaces held in arrays, evaluated at many points by one compiled kernel.

Homogeneous poles (x w, y w, z w, w); derivatives of the rational surface by the quotient rule.
Agrees with OCCT's own evaluation (tests/splines/test_nurbs.py).
"""

from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit
from cuspline.values.rows import W, X, Y, Z
from cuspline.values.threads import in_blocks

CHUNK = 256              # points a thread takes at a time
SERIAL_ROWS = 2000       # below this, starting threads costs more than it saves

POINT, DU, DV, DUU, DUV, DVV = range(6)         # rows of derivatives: S, Su, Sv, Suu, Suv, Svv


@dataclass(frozen=True, eq=False, kw_only=True)
class NurbsSurface:
    """A clamped rational B-spline surface, millimetres, part coordinates."""

    degree_u: int
    degree_v: int
    knots_u: np.ndarray         # flat, clamped
    knots_v: np.ndarray
    poles: np.ndarray           # (nu, nv, 4) homogeneous

    def __post_init__(self):
        for name, shape in (("knots_u", (None,)), ("knots_v", (None,)), ("poles", (None, None, 4))):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name))

    @property
    def domain(self):
        """(u low, u high, v low, v high)."""
        return (self.knots_u[self.degree_u], self.knots_u[-1 - self.degree_u],
                self.knots_v[self.degree_v], self.knots_v[-1 - self.degree_v])

    def points(self, u, v):
        """(n, 3) points at parameters (n,), (n,); outside the domain they are taken at its border."""
        u = np.clip(np.ascontiguousarray(u, float), *self.domain[:2])
        v = np.clip(np.ascontiguousarray(v, float), *self.domain[2:])
        out = np.empty((len(u), 3))
        in_blocks(_point_rows, len(u), CHUNK, self.degree_u, self.degree_v, self.knots_u, self.knots_v, self.poles, u, v,
                  out, serial_rows=SERIAL_ROWS)
        return out

    def derivatives(self, u, v):
        """Point and derivatives up to second order.

        Args:
            u, v: (n,) parameters; outside the domain they are taken at its border.
        Returns:
            (n, 6, 3): S, Su, Sv, Suu, Suv, Svv.
        """
        u = np.clip(np.ascontiguousarray(u, float), *self.domain[:2])
        v = np.clip(np.ascontiguousarray(v, float), *self.domain[2:])
        out = np.empty((len(u), 6, 3))
        in_blocks(_derive_rows, len(u), CHUNK, self.degree_u, self.degree_v, self.knots_u, self.knots_v, self.poles, u, v,
                  out, serial_rows=SERIAL_ROWS)
        return out


@dataclass(frozen=True, eq=False, kw_only=True)
class LocalShape:
    """Point, unit normal and principal curvatures, one row each.

    Curvature is positive on a ridge and negative in a hollow, seen from the normal's side.
    """

    point_mm: np.ndarray            # (n, 3)
    normal: np.ndarray              # (n, 3) unit
    curvature_low_per_mm: np.ndarray     # (n,) the most hollow principal curvature
    curvature_high_per_mm: np.ndarray    # (n,)
    is_regular: np.ndarray          # (n,) bool: false at a degenerate pole


def local_shape(derivatives, flip=False):
    """First and second fundamental forms out of `NurbsSurface.derivatives`.

    Args:
        derivatives: (n, 6, 3).
        flip: the face is reversed: its outward normal is -(Su × Sv).
    """
    s, su, sv, suu, suv, svv = np.moveaxis(derivatives, 1, 0)
    cross = np.cross(su, sv)
    length = np.linalg.norm(cross, axis=1)
    scale = np.linalg.norm(su, axis=1) * np.linalg.norm(sv, axis=1)
    regular = length > 1e-9 * np.maximum(scale, 1e-30)
    normal = cross / np.where(regular, length, 1.0)[:, None] * (-1.0 if flip else 1.0)
    dot = lambda a, b: np.einsum("ij,ij->i", a, b)
    E, F, G = dot(su, su), dot(su, sv), dot(sv, sv)
    L, M, N = dot(suu, normal), dot(suv, normal), dot(svv, normal)
    det = np.where(regular, E * G - F * F, 1.0)
    mean = (E * N - 2 * F * M + G * L) / (2 * det)
    gauss = (L * N - M * M) / det
    spread = np.sqrt(np.maximum(mean * mean - gauss, 0.0))
    # L, M, N > 0 where the surface bends toward the normal: a hollow, hence the minus sign
    return LocalShape(point_mm=s, normal=normal, is_regular=regular,
                      curvature_low_per_mm=np.where(regular, -(mean + spread), 0.0),
                      curvature_high_per_mm=np.where(regular, -(mean - spread), 0.0))


def principal_directions(derivatives, flip=False):
    """Tangent directions of the principal curvatures.

    Args:
        derivatives, flip: as for `local_shape`.
    Returns:
        (n, 3) unit direction of the most hollow curvature, (n, 3) that of the other, square to it and to the normal.
        Any pair where both curvatures are equal; NaN at a degenerate pole.
    """
    s, su, sv, suu, suv, svv = np.moveaxis(derivatives, 1, 0)
    normal = np.where(local_shape(derivatives).is_regular[:, None], np.cross(su, sv), np.nan)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    first = su / np.linalg.norm(su, axis=1, keepdims=True).clip(1e-300)
    second = np.cross(normal, first)
    dot = lambda a, b: np.einsum("ij,ij->i", a, b)
    # su = a first, sv = b first + c second: the second form in this frame of unit vectors
    a, b, c = dot(su, first), dot(sv, first), dot(sv, second)
    L, M, N = dot(suu, normal), dot(suv, normal), dot(svv, normal)
    p, q = L / a ** 2, (M - b / a * L) / (a * c)
    r = (N - 2 * b / a * M + (b / a) ** 2 * L) / c ** 2
    turn = fixed.arctan2(2 * q, p - r) / 2 + (np.pi / 2 if flip else 0.0)
    hollow = fixed.cos(turn)[:, None] * first + fixed.sin(turn)[:, None] * second
    return hollow, np.cross(normal, hollow)


@njit
def _span(knots, degree, count, t):
    """Index i with knots[i] <= t < knots[i+1], the last span closed on the right."""
    if t >= knots[count]:
        return count - 1
    low, high = degree, count
    while high - low > 1:
        middle = (low + high) // 2
        if t < knots[middle]:
            high = middle
        else:
            low = middle
    return low


@njit
def _basis(knots, degree, span, t, out):
    """Basis functions and their first and second derivatives into out (3, degree+1) (Cox-de Boor)."""
    ndu = np.zeros((degree + 1, degree + 1))
    left, right = np.zeros(degree + 1), np.zeros(degree + 1)
    ndu[0, 0] = 1.0
    for j in range(1, degree + 1):
        left[j], right[j] = t - knots[span + 1 - j], knots[span + j] - t
        saved = 0.0
        for r in range(j):
            ndu[j, r] = right[r + 1] + left[j - r]
            ratio = ndu[r, j - 1] / ndu[j, r]
            ndu[r, j] = saved + right[r + 1] * ratio
            saved = left[j - r] * ratio
        ndu[j, j] = saved
    out[:] = 0.0
    for r in range(degree + 1):
        out[0, r] = ndu[r, degree]
    a = np.zeros((2, degree + 1))
    for r in range(degree + 1):
        now, nxt = 0, 1
        a[:] = 0.0
        a[0, 0] = 1.0
        factor = 1.0
        for k in range(1, min(2, degree) + 1):
            rk, pk = r - k, degree - k
            d = 0.0
            if r >= k:
                a[nxt, 0] = a[now, 0] / ndu[pk + 1, rk]
                d = a[nxt, 0] * ndu[rk, pk]
            first = 1 if rk >= -1 else -rk
            last = k - 1 if r - 1 <= pk else degree - r
            for j in range(first, last + 1):
                a[nxt, j] = (a[now, j] - a[now, j - 1]) / ndu[pk + 1, rk + j]
                d += a[nxt, j] * ndu[rk + j, pk]
            if r <= pk:
                a[nxt, k] = -a[now, k - 1] / ndu[pk + 1, r]
                d += a[nxt, k] * ndu[r, pk]
            factor *= degree - k + 1
            out[k, r] = d * factor
            now, nxt = nxt, now


@njit
def _values(knots, degree, span, t, left, right, out):
    """Basis functions alone into out (degree + 1,); left, right (degree + 1,): work."""
    out[0] = 1.0
    for j in range(1, degree + 1):
        left[j], right[j] = t - knots[span + 1 - j], knots[span + j] - t
        saved = 0.0
        for r in range(j):
            ratio = out[r] / (right[r + 1] + left[j - r])
            out[r] = saved + right[r + 1] * ratio
            saved = left[j - r] * ratio
        out[j] = saved


@njit
def _point_rows(pu, pv, U, V, poles, u, v, out, first, last):
    """Rows first..last-1 of the points."""
    bu, bv, most = np.empty(pu + 1), np.empty(pv + 1), max(pu, pv) + 1
    left, right = np.empty(most), np.empty(most)
    for q in range(first, last):
        iu, iv = _span(U, pu, len(poles), u[q]), _span(V, pv, poles.shape[1], v[q])
        _values(U, pu, iu, u[q], left, right, bu)
        _values(V, pv, iv, v[q], left, right, bv)
        x = y = z = w = 0.0
        for i in range(pu + 1):
            for j in range(pv + 1):
                share = bu[i] * bv[j]
                x += share * poles[iu - pu + i, iv - pv + j, X]
                y += share * poles[iu - pu + i, iv - pv + j, Y]
                z += share * poles[iu - pu + i, iv - pv + j, Z]
                w += share * poles[iu - pu + i, iv - pv + j, W]
        out[q, X], out[q, Y], out[q, Z] = x / w, y / w, z / w


@njit
def _derive_rows(pu, pv, U, V, poles, u, v, out, first, last):
    """Rows first..last-1 of the derivatives."""
    bu, bv = np.empty((3, pu + 1)), np.empty((3, pv + 1))
    h = np.empty((6, 4))
    for q in range(first, last):
        iu, iv = _span(U, pu, len(poles), u[q]), _span(V, pv, poles.shape[1], v[q])
        _basis(U, pu, iu, u[q], bu)
        _basis(V, pv, iv, v[q], bv)
        h[:] = 0.0
        for i in range(pu + 1):
            for b in range(4):
                r0 = r1 = r2 = 0.0
                for j in range(pv + 1):
                    p = poles[iu - pu + i, iv - pv + j, b]
                    r0 += bv[0, j] * p
                    r1 += bv[1, j] * p
                    r2 += bv[2, j] * p
                h[POINT, b] += bu[0, i] * r0
                h[DU, b] += bu[1, i] * r0
                h[DV, b] += bu[0, i] * r1
                h[DUU, b] += bu[2, i] * r0
                h[DUV, b] += bu[1, i] * r1
                h[DVV, b] += bu[0, i] * r2
        w, wu, wv, wuu, wuv, wvv = h[POINT, W], h[DU, W], h[DV, W], h[DUU, W], h[DUV, W], h[DVV, W]
        for b in range(3):
            s = h[POINT, b] / w
            su, sv = (h[DU, b] - wu * s) / w, (h[DV, b] - wv * s) / w
            out[q, POINT, b], out[q, DU, b], out[q, DV, b] = s, su, sv
            out[q, DUU, b] = (h[DUU, b] - 2.0 * wu * su - wuu * s) / w
            out[q, DUV, b] = (h[DUV, b] - wu * sv - wv * su - wuv * s) / w
            out[q, DVV, b] = (h[DVV, b] - 2.0 * wv * sv - wvv * s) / w
