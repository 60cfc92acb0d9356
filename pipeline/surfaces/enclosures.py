"""What a piece of a patch can be at most: proven bounds on its curvature and its size.

A piece is a rectangle of a patch's local parameters.  Every quantity on it is held as a form
c + a s + b t + r e, with s, t, e anywhere in [-1, 1]: products keep the linear part and collect the rest in r, so a
bound closes in with the square of the piece's size.  Rounding (1e-15 of the values) stays far below the slack that is
asked of the bounds (1e-2).
"""

import math

import numpy as np

from cuspline.values.compiled import njit

SOUND = 0.05            # share of its middle's area element that must be left all over a piece, else no bound


@njit(error_model="numpy")
def _add(x, y):
    return x[0] + y[0], x[1] + y[1], x[2] + y[2], x[3] + y[3]


@njit(error_model="numpy")
def _scaled(f, x):
    return f * x[0], f * x[1], f * x[2], abs(f) * x[3]


@njit(error_model="numpy")
def _mul(x, y):
    rest = (abs(x[0]) * y[3] + abs(y[0]) * x[3]
            + (abs(x[1]) + abs(x[2]) + x[3]) * (abs(y[1]) + abs(y[2]) + y[3]))
    return x[0] * y[0], x[0] * y[1] + y[0] * x[1], x[0] * y[2] + y[0] * x[2], rest


@njit(error_model="numpy")
def _reach(x):
    return abs(x[1]) + abs(x[2]) + x[3]


@njit(error_model="numpy")
def _dot(a, b):
    return _add(_add(_mul(a[0], b[0]), _mul(a[1], b[1])), _mul(a[2], b[2]))


@njit(error_model="numpy")
def _cross(a, b):
    return (_add(_mul(a[1], b[2]), _scaled(-1.0, _mul(a[2], b[1]))),
            _add(_mul(a[2], b[0]), _scaled(-1.0, _mul(a[0], b[2]))),
            _add(_mul(a[0], b[1]), _scaled(-1.0, _mul(a[1], b[0]))))


@njit(error_model="numpy")
def _mix(f, a, g, b):
    """f a + g b of vectors of forms."""
    return (_add(_scaled(f, a[0]), _scaled(g, b[0])), _add(_scaled(f, a[1]), _scaled(g, b[1])),
            _add(_scaled(f, a[2]), _scaled(g, b[2])))


@njit(error_model="numpy")
def shifted(coefficients, patch, box, work):
    """Coefficients of a patch about the middle of a piece and in units of its half sides.

    Args:
        patch: row of PatchSet.patch.
        box: (4,) s low, s high, t low, t high.
        work: (du + 1, dv + 1, 4) or larger; filled.
    """
    offset, du, dv = patch[1], patch[2], patch[3]
    s, hs, t, ht = (box[0] + box[1]) / 2, (box[1] - box[0]) / 2, (box[2] + box[3]) / 2, (box[3] - box[2]) / 2
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
    w = work[0, 0, 3]
    for k in range(3):
        out[k] = work[0, 0, k] / w
    for i in range(du + 1):
        for j in range(dv + 1):
            for k in range(3):
                work[i, j, k] = (work[i, j, k] - out[k] * work[i, j, 3]) / w
    for i in range(du + 1):
        for j in range(dv + 1):
            work[i, j, 3] /= w


@njit(error_model="numpy")
def _inverse(x):
    """1 / x; all NaN where x may vanish."""
    reach, c = _reach(x), x[0]
    low = c - reach
    if low <= 0.0:
        return np.nan, np.nan, np.nan, np.nan
    return 1.0 / c, -x[1] / (c * c), -x[2] / (c * c), x[3] / (c * c) + reach * reach / low ** 3


@njit(error_model="numpy")
def _inverse_root(x):
    """x^-1/2; all NaN where x may vanish."""
    reach, c = _reach(x), x[0]
    low = c - reach
    if low <= SOUND * c:
        return np.nan, np.nan, np.nan, np.nan
    f, g = 1.0 / np.sqrt(c), -0.5 / (c * np.sqrt(c))
    return f, g * x[1], g * x[2], abs(g) * x[3] + 0.375 * reach * reach / (low * low * math.sqrt(low))


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
    return _mul(f, a[0]), _mul(f, a[1]), _mul(f, a[2])


@njit(error_model="numpy")
def _less(a, f, b):
    """a - f b."""
    return (_add(a[0], _scaled(-1.0, _mul(f, b[0]))), _add(a[1], _scaled(-1.0, _mul(f, b[1]))),
            _add(a[2], _scaled(-1.0, _mul(f, b[2]))))


@njit(error_model="numpy")
def _middle_length(a):
    return np.sqrt(a[0][0] ** 2 + a[1][0] ** 2 + a[2][0] ** 2)


@njit(error_model="numpy")
def _likely_length(a):
    """Size of a vector of forms without its proven rest: good for choosing, not for proving."""
    x, y, z = (abs(a[0][0]) + abs(a[0][1]) + abs(a[0][2]), abs(a[1][0]) + abs(a[1][1]) + abs(a[1][2]),
               abs(a[2][0]) + abs(a[2][1]) + abs(a[2][2]))
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
            most = max(most, _largest_eigenvalue(p[0] + s * p[1] + t * p[2], q[0] + s * q[1] + t * q[2],
                                                 r[0] + s * r[1] + t * r[2]))
    return most + max(p[3], r[3]) + q[3]


@njit(error_model="numpy")
def size_of_piece(coefficients, patch, box, work, out):
    """Bounds on a piece's size, for pieces of any patch.

    Args:
        out: (6,) filled: middle point; largest distance of a point of the piece from it; likely lengths along s and t.
    """
    du, dv, is_rational = patch[2], patch[3], patch[4] != 0
    shifted(coefficients, patch, box, work)
    _recentred(work, du, dv, out)
    x, y, z = _vector(work, du, dv, 0, 0)
    if is_rational:
        i = _inverse(_derived(work, du, dv, 3, 0, 0))
        x, y, z = _mul(i, x), _mul(i, y), _mul(i, z)
    reach = np.sqrt(_reach(x) ** 2 + _reach(y) ** 2 + _reach(z) ** 2)
    out[3] = reach if reach == reach else np.inf
    out[4] = 2.0 * np.sqrt(x[1] ** 2 + y[1] ** 2 + z[1] ** 2)
    out[5] = 2.0 * np.sqrt(x[2] ** 2 + y[2] ** 2 + z[2] ** 2)


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
    du, dv = patch[2], patch[3]
    shifted(coefficients, patch, box, work)
    _recentred(work, du, dv, out[2:5])
    S, Ss, St, Sss, Sst, Stt = _quotients(work, du, dv, patch[4] != 0)
    reach = np.sqrt(_reach(S[0]) ** 2 + _reach(S[1]) ** 2 + _reach(S[2]) ** 2)
    out[0], out[1], out[5] = np.inf, np.nan, (reach if reach == reach else np.inf)
    ls, lt = _middle_length(Ss), _middle_length(St)
    out[6], out[7] = 2.0 * ls, 2.0 * lt
    tiny = 1e-300
    bend_s = _likely_length(Sss) / (ls + tiny) + _likely_length(Sst) / (lt + tiny)
    bend_t = _likely_length(Sst) / (ls + tiny) + _likely_length(Stt) / (lt + tiny)
    if bend_s + bend_t < np.inf:
        out[8] = 1.0 if (bend_t > bend_s or bend_s + bend_t == 0.0 and lt > ls) else 0.0
    else:                       # no bound at all, as when weights cannot be told from 0: the wider side
        out[8] = 1.0 if box[3] - box[2] > box[1] - box[0] else 0.0
    if ls == 0.0 or lt == 0.0 or not reach < np.inf:
        return
    along = (Ss[0][0] * St[0][0] + Ss[1][0] * St[1][0] + Ss[2][0] * St[2][0]) / (ls * ls)
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
    p0 = sign * (AA[0][0] * N[0][0] + AA[1][0] * N[1][0] + AA[2][0] * N[2][0])
    q0 = sign * (AB[0][0] * N[0][0] + AB[1][0] * N[1][0] + AB[2][0] * N[2][0])
    r0 = sign * (BB[0][0] * N[0][0] + BB[1][0] * N[1][0] + BB[2][0] * N[2][0])
    K = _largest_eigenvalue(p0, q0, r0)
    out[1] = K
    E, F, G = _dot(A, A), _dot(A, B), _dot(B, B)
    smallest = -_largest_over_piece(_scaled(-1.0, E), _scaled(-1.0, F), _scaled(-1.0, G))
    if not (smallest > SOUND and n[0] == n[0]):
        return
    P = _add(_mul(_dot(AA, N), n), _scaled(-K, E))
    Q = _add(_mul(_dot(AB, N), n), _scaled(-K, F))
    R = _add(_mul(_dot(BB, N), n), _scaled(-K, G))
    more = _largest_over_piece(P, Q, R)
    out[0] = K + max(more, 0.0) / smallest
