"""What a piece of a patch can be at most: proven bounds on its curvature and its size.

A piece is a rectangle of a patch's local parameters.  Every quantity on it is held as a form
c + a s + b t + r e, with s, t, e anywhere in [-1, 1]: products keep the linear part and collect the rest in r, so a
bound closes in with the square of the piece's size.  Rounding (1e-15 of the values) stays far below the slack that is
asked of the bounds (1e-2).
"""

import math

import numpy as np

from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, IS_RATIONAL, OFFSET
from cuspline.values.compiled import njit
from cuspline.values.rows import W, X, Y, Z

SOUND = 0.05            # share of its middle's area element that must be left all over a piece, else no bound
TINY = 1e-9             # sine between two tangents that are one
S_LOW, S_HIGH, T_LOW, T_HIGH = range(4)         # of a piece: its rectangle
MID, BY_S, BY_T, REST = range(4)                # of a form: c, a, b, r
BOUND, VALUE, PLACE = 0, 1, 2                   # of `curvature_of_piece`: PLACE is three columns
REACH, LENGTH_S, LENGTH_T, CUTS_T = range(5, 9)
SIZE_REACH, SIZE_S, SIZE_T = range(3, 6)        # of `size_of_piece`, behind its middle


@njit(error_model="numpy")
def _add(x, y):
    return x[MID] + y[MID], x[BY_S] + y[BY_S], x[BY_T] + y[BY_T], x[REST] + y[REST]


@njit(error_model="numpy")
def _scaled(f, x):
    return f * x[MID], f * x[BY_S], f * x[BY_T], abs(f) * x[REST]


@njit(error_model="numpy")
def _mul(x, y):
    rest = (abs(x[MID]) * y[REST] + abs(y[MID]) * x[REST]
            + (abs(x[BY_S]) + abs(x[BY_T]) + x[REST]) * (abs(y[BY_S]) + abs(y[BY_T]) + y[REST]))
    return x[MID] * y[MID], x[MID] * y[BY_S] + y[MID] * x[BY_S], x[MID] * y[BY_T] + y[MID] * x[BY_T], rest


@njit(error_model="numpy")
def _reach(x):
    return abs(x[BY_S]) + abs(x[BY_T]) + x[REST]


@njit(error_model="numpy")
def _dot(a, b):
    return _add(_add(_mul(a[X], b[X]), _mul(a[Y], b[Y])), _mul(a[Z], b[Z]))


@njit(error_model="numpy")
def _cross(a, b):
    return (_add(_mul(a[Y], b[Z]), _scaled(-1.0, _mul(a[Z], b[Y]))),
            _add(_mul(a[Z], b[X]), _scaled(-1.0, _mul(a[X], b[Z]))),
            _add(_mul(a[X], b[Y]), _scaled(-1.0, _mul(a[Y], b[X]))))


@njit(error_model="numpy")
def _mix(f, a, g, b):
    """f a + g b of vectors of forms."""
    return (_add(_scaled(f, a[X]), _scaled(g, b[X])), _add(_scaled(f, a[Y]), _scaled(g, b[Y])),
            _add(_scaled(f, a[Z]), _scaled(g, b[Z])))


@njit(error_model="numpy")
def shifted(coefficients, patch, box, work):
    """Coefficients of a patch about the middle of a piece and in units of its half sides.

    Args:
        patch: row of PatchSet.patch.
        box: (4,) s low, s high, t low, t high.
        work: (du + 1, dv + 1, 4) or larger; filled.
    """
    offset, du, dv = patch[OFFSET], patch[DEGREE_U], patch[DEGREE_V]
    s, hs, t, ht = ((box[S_LOW] + box[S_HIGH]) / 2, (box[S_HIGH] - box[S_LOW]) / 2, (box[T_LOW] + box[T_HIGH]) / 2,
                    (box[T_HIGH] - box[T_LOW]) / 2)
    for i in range(du + 1):
        for j in range(dv + 1):
            for k in range(4):
                work[i, j, k] = coefficients[offset + (i * (dv + 1) + j) * 4 + k]
    for m in range(du):                         # Taylor shift by repeated synthetic division
        for i in range(du - 1, m - 1, -1):
            for j in range(dv + 1):
                for k in range(4):
                    work[i, j, k] += s * work[i + 1, j, k]
    for m in range(dv):
        for j in range(dv - 1, m - 1, -1):
            for i in range(du + 1):
                for k in range(4):
                    work[i, j, k] += t * work[i, j + 1, k]
    fi = 1.0
    for i in range(du + 1):
        f = fi
        for j in range(dv + 1):
            for k in range(4):
                work[i, j, k] *= f
            f *= ht
        fi *= hs


@njit(error_model="numpy")
def _derived(work, du, dv, k, ms, mt):
    """Form of the derivative of order (ms, mt) of component k over the piece."""
    c = a = b = r = 0.0
    for i in range(ms, du + 1):
        fi = 1.0
        for m in range(ms):
            fi *= i - m
        for j in range(mt, dv + 1):
            f = fi
            for m in range(mt):
                f *= j - m
            x = f * work[i, j, k]
            if i == ms and j == mt:
                c += x
            elif i == ms + 1 and j == mt:
                a += x
            elif i == ms and j == mt + 1:
                b += x
            else:
                r += abs(x)
    return c, a, b, r


@njit(error_model="numpy")
def _vector(work, du, dv, ms, mt):
    return _derived(work, du, dv, 0, ms, mt), _derived(work, du, dv, 1, ms, mt), _derived(work, du, dv, 2, ms, mt)


@njit(error_model="numpy")
def _recentred(work, du, dv, out):
    """Take the middle point away from the piece and its weight to one there; the middle into out (3,)."""
    w = work[0, 0, W]
    for k in range(3):
        out[k] = work[0, 0, k] / w
    for i in range(du + 1):
        for j in range(dv + 1):
            for k in range(3):
                work[i, j, k] = (work[i, j, k] - out[k] * work[i, j, W]) / w
    for i in range(du + 1):
        for j in range(dv + 1):
            work[i, j, W] /= w


@njit(error_model="numpy")
def _upright(work, du, dv):
    """Turn a piece about its middle so that its normal there is Z and its first tangent X.

    Forms of components are tightest so: a surface that lies askew would spread its size over all three.
    """
    ax, ay, az = work[1, 0, X], work[1, 0, Y], work[1, 0, Z]
    bx, by, bz = work[0, 1, X], work[0, 1, Y], work[0, 1, Z]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    a, n = np.sqrt(ax * ax + ay * ay + az * az), np.sqrt(nx * nx + ny * ny + nz * nz)
    if not (a > 0.0 and n > TINY * a * np.sqrt(bx * bx + by * by + bz * bz)):
        return
    ax, ay, az, nx, ny, nz = ax / a, ay / a, az / a, nx / n, ny / n, nz / n
    bx, by, bz = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
    for i in range(du + 1):
        for j in range(dv + 1):
            x, y, z = work[i, j, X], work[i, j, Y], work[i, j, Z]
            work[i, j, X] = ax * x + ay * y + az * z
            work[i, j, Y] = bx * x + by * y + bz * z
            work[i, j, Z] = nx * x + ny * y + nz * z


@njit(error_model="numpy")
def _inverse(x):
    """1 / x; all NaN where x may vanish."""
    reach, c = _reach(x), x[MID]
    low = c - reach
    if low <= 0.0:
        return np.nan, np.nan, np.nan, np.nan
    return 1.0 / c, -x[BY_S] / (c * c), -x[BY_T] / (c * c), x[REST] / (c * c) + reach * reach / low ** 3


@njit(error_model="numpy")
def _inverse_root(x):
    """x^-1/2; all NaN where x may vanish."""
    reach, c = _reach(x), x[MID]
    low = c - reach
    if low <= SOUND * c:
        return np.nan, np.nan, np.nan, np.nan
    f, g = 1.0 / np.sqrt(c), -0.5 / (c * np.sqrt(c))
    return f, g * x[BY_S], g * x[BY_T], abs(g) * x[REST] + 0.375 * reach * reach / (low * low * math.sqrt(low))


@njit(error_model="numpy")
def _quotients(work, du, dv, is_rational):
    """Forms of S (about its middle), Ss, St, Sss, Sst, Stt."""
    p, ps, pt = _vector(work, du, dv, 0, 0), _vector(work, du, dv, 1, 0), _vector(work, du, dv, 0, 1)
    pss, pst, ptt = _vector(work, du, dv, 2, 0), _vector(work, du, dv, 1, 1), _vector(work, du, dv, 0, 2)
    if not is_rational:
        return p, ps, pt, pss, pst, ptt
    i = _inverse(_derived(work, du, dv, 3, 0, 0))
    ws, wt = _derived(work, du, dv, 3, 1, 0), _derived(work, du, dv, 3, 0, 1)
    wss, wst, wtt = _derived(work, du, dv, 3, 2, 0), _derived(work, du, dv, 3, 1, 1), _derived(work, du, dv, 3, 0, 2)
    p = _times(i, p)
    ps, pt = _times(i, _less(ps, ws, p)), _times(i, _less(pt, wt, p))
    pss = _times(i, _less(_less(_less(pss, ws, ps), ws, ps), wss, p))
    pst = _times(i, _less(_less(_less(pst, ws, pt), wt, ps), wst, p))
    ptt = _times(i, _less(_less(_less(ptt, wt, pt), wt, pt), wtt, p))
    return p, ps, pt, pss, pst, ptt


@njit(error_model="numpy")
def _times(f, a):
    return _mul(f, a[X]), _mul(f, a[Y]), _mul(f, a[Z])


@njit(error_model="numpy")
def _less(a, f, b):
    """a - f b."""
    return (_add(a[X], _scaled(-1.0, _mul(f, b[X]))), _add(a[Y], _scaled(-1.0, _mul(f, b[Y]))),
            _add(a[Z], _scaled(-1.0, _mul(f, b[Z]))))


@njit(error_model="numpy")
def _middle_length(a):
    return np.sqrt(a[X][MID] ** 2 + a[Y][MID] ** 2 + a[Z][MID] ** 2)


@njit(error_model="numpy")
def _likely_length(a):
    """Size of a vector of forms without its proven rest: good for choosing, not for proving."""
    x, y, z = (abs(a[X][MID]) + abs(a[X][BY_S]) + abs(a[X][BY_T]), abs(a[Y][MID]) + abs(a[Y][BY_S]) + abs(a[Y][BY_T]),
               abs(a[Z][MID]) + abs(a[Z][BY_S]) + abs(a[Z][BY_T]))
    return np.sqrt(x * x + y * y + z * z)


@njit(error_model="numpy")
def _largest_eigenvalue(p, q, r):
    """Of the symmetric matrix ((p, q), (q, r))."""
    return (p + r) / 2 + np.sqrt(((p - r) / 2) ** 2 + q * q)


@njit(error_model="numpy")
def _largest_over_piece(p, q, r):
    """Upper bound of the largest eigenvalue: convex in the matrix, so its linear part peaks at a corner."""
    most = -np.inf
    for s in (-1.0, 1.0):
        for t in (-1.0, 1.0):
            most = max(most, _largest_eigenvalue(p[MID] + s * p[BY_S] + t * p[BY_T], q[MID] + s * q[BY_S] + t * q[BY_T],
                                                 r[MID] + s * r[BY_S] + t * r[BY_T]))
    return most + max(p[REST], r[REST]) + q[REST]


@njit(error_model="numpy")
def size_of_piece(coefficients, patch, box, work, out):
    """Bounds on a piece's size, for pieces of any patch.

    Args:
        out: (6,) filled: middle point; largest distance of a point of the piece from it; likely lengths along s and t.
    """
    du, dv, is_rational = patch[DEGREE_U], patch[DEGREE_V], patch[IS_RATIONAL] != 0
    shifted(coefficients, patch, box, work)
    _recentred(work, du, dv, out)
    x, y, z = _vector(work, du, dv, 0, 0)
    if is_rational:
        i = _inverse(_derived(work, du, dv, 3, 0, 0))
        x, y, z = _mul(i, x), _mul(i, y), _mul(i, z)
    reach = np.sqrt(_reach(x) ** 2 + _reach(y) ** 2 + _reach(z) ** 2)
    out[SIZE_REACH] = reach if reach == reach else np.inf
    out[SIZE_S] = 2.0 * np.sqrt(x[BY_S] ** 2 + y[BY_S] ** 2 + z[BY_S] ** 2)
    out[SIZE_T] = 2.0 * np.sqrt(x[BY_T] ** 2 + y[BY_T] ** 2 + z[BY_T] ** 2)


@njit(error_model="numpy")
def curvature_of_piece(coefficients, patch, sign, box, work, out):
    """Bounds on the most hollow principal curvature over a piece (here: positive in a hollow, 1/mm).

    With the tangents made orthonormal in the middle by a constant map, II - K I <= d everywhere on the piece gives
    curvature <= K + d / (smallest eigenvalue of I); K is the middle's own curvature.

    Args:
        patch: row of PatchSet.patch; sign: of its face.
        box: (4,) s low, s high, t low, t high.
        out: (9,) filled: upper bound (inf: none), value in the middle (NaN at a pole), middle point (3), largest
            distance from it, likely lengths along s and t, 1 to split t and 0 to split s.
    """
    du, dv = patch[DEGREE_U], patch[DEGREE_V]
    shifted(coefficients, patch, box, work)
    _recentred(work, du, dv, out[PLACE:REACH])
    _upright(work, du, dv)
    S, Ss, St, Sss, Sst, Stt = _quotients(work, du, dv, patch[IS_RATIONAL] != 0)
    reach = np.sqrt(_reach(S[X]) ** 2 + _reach(S[Y]) ** 2 + _reach(S[Z]) ** 2)
    out[BOUND], out[VALUE], out[REACH] = np.inf, np.nan, (reach if reach == reach else np.inf)
    ls, lt = _middle_length(Ss), _middle_length(St)
    out[LENGTH_S], out[LENGTH_T] = 2.0 * ls, 2.0 * lt
    tiny = 1e-300
    bend_s = _likely_length(Sss) / (ls + tiny) + _likely_length(Sst) / (lt + tiny)
    bend_t = _likely_length(Sst) / (ls + tiny) + _likely_length(Stt) / (lt + tiny)
    if bend_s + bend_t < np.inf:
        out[CUTS_T] = 1.0 if (bend_t > bend_s or bend_s + bend_t == 0.0 and lt > ls) else 0.0
    else:                       # no bound at all, as when weights cannot be told from 0: the wider side
        out[CUTS_T] = 1.0 if box[T_HIGH] - box[T_LOW] > box[S_HIGH] - box[S_LOW] else 0.0
    if ls == 0.0 or lt == 0.0 or not reach < np.inf:
        return
    along = (Ss[X][MID] * St[X][MID] + Ss[Y][MID] * St[Y][MID] + Ss[Z][MID] * St[Z][MID]) / (ls * ls)
    square = lt * lt - along * along * ls * ls
    if square <= 1e-18 * lt * lt:
        return
    f, g = 1.0 / ls, 1.0 / np.sqrt(square)
    h = -along * g
    A, B = _mix(f, Ss, 0.0, Ss), _mix(g, St, h, Ss)
    AA, AB = _mix(f * f, Sss, 0.0, Sss), _mix(f * g, Sst, f * h, Sss)
    BB = _mix(1.0, _mix(g * g, Stt, 2.0 * g * h, Sst), h * h, Sss)
    N = _cross(A, B)
    n = _scaled(sign, _inverse_root(_dot(N, N)))
    # II about the middle, where the normal is exact: value first, bound after
    p0 = sign * (AA[X][MID] * N[X][MID] + AA[Y][MID] * N[Y][MID] + AA[Z][MID] * N[Z][MID])
    q0 = sign * (AB[X][MID] * N[X][MID] + AB[Y][MID] * N[Y][MID] + AB[Z][MID] * N[Z][MID])
    r0 = sign * (BB[X][MID] * N[X][MID] + BB[Y][MID] * N[Y][MID] + BB[Z][MID] * N[Z][MID])
    K = _largest_eigenvalue(p0, q0, r0)
    out[VALUE] = K
    E, F, G = _dot(A, A), _dot(A, B), _dot(B, B)
    smallest = -_largest_over_piece(_scaled(-1.0, E), _scaled(-1.0, F), _scaled(-1.0, G))
    if not (smallest > SOUND and n[MID] == n[MID]):
        return
    P = _add(_mul(_dot(AA, N), n), _scaled(-K, E))
    Q = _add(_mul(_dot(AB, N), n), _scaled(-K, F))
    R = _add(_mul(_dot(BB, N), n), _scaled(-K, G))
    more = _largest_over_piece(P, Q, R)
    out[BOUND] = K + max(more, 0.0) / smallest
