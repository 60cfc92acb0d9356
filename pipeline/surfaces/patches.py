"""Every face of a part as polynomial patches in power form, flat arrays for compiled kernels.

A face's B-spline surface is cut at its knots.  On each knot span the homogeneous coordinates are
polynomials of local parameters s, t in [-1, 1]; about the middle of the span powers stay well conditioned
up to the degrees a kernel uses.  Evaluation is Horner's rule: no basis functions, no knot search inside.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z
from cuspline.values.threads import in_blocks

CHUNK = 512             # points a thread takes at a time
SERIAL_ROWS = 4000      # below this, starting threads costs more than it saves
OF_FACE, OFFSET, DEGREE_U, DEGREE_V, IS_RATIONAL = range(5)         # columns of PatchSet.patch
U_LOW, U_HIGH, V_LOW, V_HIGH = range(4)                             # of PatchSet.span
FIRST_PATCH, SPANS_U, SPANS_V, BREAKS_U, BREAKS_V = range(5)        # of PatchSet.face
U, V = range(2)                                                     # of a place on a face
POINT, DS, DT, DSS, DST, DTT = range(6)                             # rows of what `derive` gives


class PatchArrays(NamedTuple):
    """A PatchSet as kernels take it."""

    coefficients: np.ndarray
    patch: np.ndarray
    span: np.ndarray
    face: np.ndarray
    breaks: np.ndarray
    sign: np.ndarray


@dataclass(frozen=True, eq=False, kw_only=True)
class PatchSet:
    """Polynomial patches of faces 0..f-1, millimetres.

    The coefficient of s^i t^j, homogeneous component k (x w, y w, z w, w), of patch q stands at
    coefficients[patch[q, 1] + (i (degree_v + 1) + j) 4 + k].
    """

    coefficients: np.ndarray    # (c,)
    patch: np.ndarray           # (p, 5) int: face, offset, degree u, degree v, is rational
    span: np.ndarray            # (p, 4) u low, u high, v low, v high
    face: np.ndarray            # (f, 5) int: first patch, spans u, spans v, first break u, first break v
    breaks: np.ndarray          # (b,) knots of all faces, each once, u's then v's
    sign: np.ndarray            # (f,) outward normal = sign (Su × Sv)

    @classmethod
    def of_faces(cls, faces):
        """Patches of `brep.Face` values, in their order (face index = place in the sequence)."""
        return cls.of_surfaces([f.nurbs for f in faces], [f.is_reversed for f in faces])

    @classmethod
    def of_surfaces(cls, surfaces, reversed_ones=None):
        """Patches of NurbsSurface values; `reversed_ones` tells whose outward normal is -(Su × Sv)."""
        turned = [False] * len(surfaces) if reversed_ones is None else list(reversed_ones)
        coefficients, patch, span, face, breaks = [], [], [], [], []
        at = patches = knots = 0
        for k, surface in enumerate(surfaces):
            bu, bv, powers = _powers(surface)
            nu, nv = powers.shape[:2]
            size = powers[0, 0].size
            face.append((patches, nu, nv, knots, knots + len(bu)))
            offsets = at + size * np.arange(nu * nv)
            rational = int(np.ptp(surface.poles[..., 3]) > 1e-14 * surface.poles[..., 3].max())
            row = np.ones(nu * nv, np.int64)
            patch.append(np.column_stack([k * row, offsets, surface.degree_u * row, surface.degree_v * row,
                                          rational * row]))
            i, j = np.divmod(np.arange(nu * nv), nv)
            span.append(np.column_stack([bu[i], bu[i + 1], bv[j], bv[j + 1]]))
            coefficients.append(powers.ravel())
            breaks += [bu, bv]
            at, patches, knots = at + powers.size, patches + nu * nv, knots + len(bu) + len(bv)
        stack = lambda rows, empty: np.concatenate(rows) if rows else np.zeros(empty)
        return cls(coefficients=frozen(stack(coefficients, 0), (None,), "coefficients"),
                   patch=frozen(stack(patch, (0, 5)), (None, 5), "patch", np.int64),
                   span=frozen(stack(span, (0, 4)), (None, 4), "span"),
                   face=frozen(np.reshape(face, (-1, 5)), (None, 5), "face", np.int64),
                   breaks=frozen(stack(breaks, 0), (None,), "breaks"),
                   sign=frozen(np.where(turned, -1.0, 1.0), (None,), "sign"))

    @property
    def arrays(self):
        """PatchArrays."""
        return PatchArrays(self.coefficients, self.patch, self.span, self.face, self.breaks, self.sign)

    def domain(self, face):
        """(u low, u high, v low, v high) of a face."""
        first, nu, nv, bu, bv = self.face[face]
        return self.breaks[bu], self.breaks[bu + nu], self.breaks[bv], self.breaks[bv + nv]

    def derivatives(self, face, u, v):
        """Point and derivatives up to second order, with respect to the face's own parameters.

        Args:
            face: (n,) face indices, or one for all.
            u, v: (n,) parameters of the face's `nurbs`; outside the domain they are taken at its border.
        Returns:
            (n, 6, 3): S, Su, Sv, Suu, Suv, Svv.
        """
        u, v = for_kernel(u), for_kernel(v)
        faces = for_kernel(np.broadcast_to(face, u.shape), np.int64)
        out = np.empty((len(u), 6, 3))
        in_blocks(_derive_rows, len(u), CHUNK, self.arrays, faces, u, v, out, serial_rows=SERIAL_ROWS)
        return out


def _powers(surface):
    """Breaks in u and v, and (nu, nv, degree u + 1, degree v + 1, 4) power coefficients of a NurbsSurface."""
    bu, mu = span_powers(surface.knots_u, surface.degree_u, surface.poles.shape[0])
    bv, mv = span_powers(surface.knots_v, surface.degree_v, surface.poles.shape[1])
    poles = surface.poles / surface.poles[..., 3].max()
    half = np.einsum("aip,pqk->aiqk", mu, poles)
    return bu, bv, np.ascontiguousarray(np.einsum("bjq,aiqk->abijk", mv, half))


def span_powers(knots, degree, count):
    """Breaks (m + 1,) and (m, degree + 1, count): power coefficients about each span's middle of every basis function.

    The k-th power's coefficient is the k-th derivative in the middle times (half the span)^k / k!.
    """
    breaks = np.unique(knots[degree:count + 1])
    middles, halves = (breaks[1:] + breaks[:-1]) / 2, np.diff(breaks) / 2
    basis = BSpline(knots, np.eye(count), degree)
    rows = [basis(middles, nu=k) * (fixed.power(halves, k) / math.factorial(k))[:, None] for k in range(degree + 1)]
    return breaks, np.stack(rows, axis=1)


@njit(inline="always")
def find_span(breaks, first, count, x):
    """Index 0..count-1 of the span that holds x; the outermost ones take what lies outside."""
    low, high = 0, count
    while high - low > 1:
        middle = (low + high) // 2
        if x < breaks[first + middle]:
            high = middle
        else:
            low = middle
    return low


@njit
def patch_at(arrays, face, u, v):
    """Patch index that holds (u, v) of a face."""
    row, breaks = arrays.face[face], arrays.breaks
    return (row[FIRST_PATCH] + find_span(breaks, row[BREAKS_U], row[SPANS_U], u) * row[SPANS_V]
            + find_span(breaks, row[BREAKS_V], row[SPANS_V], v))


@njit(error_model="numpy")
def position(coefficients, offset, du, dv, is_rational, s, t, out):
    """Point of a patch into out (3,)."""
    x = y = z = w = 0.0
    for i in range(du, -1, -1):
        c = offset + (i * (dv + 1) + dv) * 4
        a, b, d, e = 0.0, 0.0, 0.0, 0.0
        for _ in range(dv + 1):
            a, b, d = a * t + coefficients[c], b * t + coefficients[c + 1], d * t + coefficients[c + 2]
            e = e * t + coefficients[c + 3]
            c -= 4
        x, y, z, w = x * s + a, y * s + b, z * s + d, w * s + e
    if is_rational:
        x, y, z = x / w, y / w, z / w
    out[X], out[Y], out[Z] = x, y, z


@njit(error_model="numpy")
def derive(coefficients, offset, du, dv, is_rational, s, t, out):
    """Point and derivatives with respect to the local s, t into out (6, 3): S, Ss, St, Sss, Sst, Stt."""
    size = 4 if is_rational else 3
    w = ws = wt = wss = wst = wtt = 0.0
    for b in range(size):
        k = size - 1 - b                # the weight first: the quotients need it
        r = rs = rss = rt = rst = rtt = 0.0
        for i in range(du, -1, -1):
            c = offset + (i * (dv + 1) + dv) * 4 + k
            q = qt = qtt = 0.0
            for _ in range(dv + 1):
                qtt = qtt * t + qt
                qt = qt * t + q
                q = q * t + coefficients[c]
                c -= 4
            rss = rss * s + rs
            rs = rs * s + r
            r = r * s + q
            rst = rst * s + rt
            rt = rt * s + qt
            rtt = rtt * s + qtt
        rss, rtt = 2.0 * rss, 2.0 * rtt
        if k == 3:
            w, ws, wt, wss, wst, wtt = r, rs, rt, rss, rst, rtt
            continue
        if is_rational:
            r = r / w
            rs, rt = (rs - ws * r) / w, (rt - wt * r) / w
            rss = (rss - 2.0 * ws * rs - wss * r) / w
            rst = (rst - ws * rt - wt * rs - wst * r) / w
            rtt = (rtt - 2.0 * wt * rt - wtt * r) / w
        out[POINT, k], out[DS, k], out[DT, k], out[DSS, k], out[DST, k], out[DTT, k] = r, rs, rt, rss, rst, rtt


@njit(error_model="numpy")
def derive_on_face(arrays, face, u, v, out):
    """As `derive`, but at parameters of a face and with respect to them."""
    coefficients, patch, span = arrays.coefficients, arrays.patch, arrays.span
    q = patch_at(arrays, face, u, v)
    ul, uh, vl, vh = span[q, U_LOW], span[q, U_HIGH], span[q, V_LOW], span[q, V_HIGH]
    s, t = (2.0 * min(max(u, ul), uh) - ul - uh) / (uh - ul), (2.0 * min(max(v, vl), vh) - vl - vh) / (vh - vl)
    derive(coefficients, patch[q, OFFSET], patch[q, DEGREE_U], patch[q, DEGREE_V], patch[q, IS_RATIONAL] != 0, s, t,
           out)
    scale_derivatives(out, 2.0 / (uh - ul), 2.0 / (vh - vl))


@njit(inline="always")
def scale_derivatives(out, a, b):
    """Point and derivatives (6, 3) of `derive`, made those with respect to s / a and t / b."""
    for k in range(3):
        out[DS, k] *= a
        out[DT, k] *= b
        out[DSS, k] *= a * a
        out[DST, k] *= a * b
        out[DTT, k] *= b * b


@njit
def _derive_rows(arrays, face, u, v, out, first, last):
    for k in range(first, last):
        derive_on_face(arrays, face[k], u[k], v[k], out[k])
