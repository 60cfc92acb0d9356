"""Elementary functions and linear algebra whose every bit is the same on every processor.

NumPy, BLAS, LAPACK and the C library choose among kernels at run time, by the processor's vector units, and their
results differ in the last digit.  One digit decides a branch, a branch decides a path.  What stands here is made of
+ - * / and square roots in a stated order, which IEEE 754 fixes to the last bit; nothing is fused or reordered.

Functions of numbers take arrays too, broadcast as by ufuncs, and can be called inside kernels; each is within
some units in the last place.  NumPy's own +, -, *, /, sqrt, abs, floor, comparisons, sums, cross and einsum (without
`optimize`) are fixed already and are used as they are.  docs/decisions/same-everywhere.md tells what is not, and why.
"""

import math

import numpy as np

from cuspline.values.compiled import elementwise, njit

HALF_PI_PARTS = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21     # 33 bits, 33 bits, the rest
LOG_2_PARTS = 0.6931471804855391, 7.440617110012397e-11                 # 33 bits, the rest
LARGEST_TURN = 1.0e6        # angles beyond are brought back by whole turns first, and lose digits
SIN_TERMS = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(9))
COS_TERMS = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(10))
EXP_TERMS = tuple(1.0 / math.factorial(k) for k in range(15))
ATAN_TERMS = tuple((-1.0) ** k / (2 * k + 1) for k in range(8))         # of arguments up to 1/16
LOG_TERMS = tuple(1.0 / (2 * k + 1) for k in range(12))                 # of arguments up to 0.172
ATAN_EIGHTHS = np.array([                                               # atan(k/8) as a sum of two numbers
    (0.0, 0.0), (0.12435499454676144, -3.1253241424539383e-18), (0.24497866312686414, 1.0698755618734451e-17),
    (0.35877067027057225, -2.4623815582638635e-17), (0.4636476090008061, 2.2698777452961687e-17),
    (0.5585993153435624, -5.4556305485916264e-18), (0.6435011087932844, 1.5834785051444286e-17),
    (0.7188299996216245, -2.1478388444456983e-17), (0.7853981633974483, 3.061616997868383e-17)])
HIGH, LOW = range(2)    # parts of a number held as a sum
HALF_PI_LOW = 6.123233995736766e-17
MOST_EXP, LEAST_EXP = 709.782712893384, -745.1332191019412
FULL_RANK = 1e-13           # of the longest pivot: what is shorter hangs on the rows before it
JACOBI_SWEEPS = 30


@njit(inline="always")
def _quarter(x):
    """Which quarter turn x is nearest to, and what is over it as a sum of two numbers."""
    if abs(x) > LARGEST_TURN:
        x %= 6.283185307179586
    k = np.rint(x * 0.6366197723675814)
    a = x - k * HALF_PI_PARTS[0]
    b = k * HALF_PI_PARTS[1]
    r = a - b
    low = (a - r) - b - k * HALF_PI_PARTS[2]
    return int(k) & 3, r, low


@njit(inline="always")
def _sin_of(r, low):
    z, s = r * r, 0.0
    for k in range(8, 0, -1):
        s = s * z + SIN_TERMS[k]
    return r + (r * z * s + low * (1.0 - 0.5 * z))


@njit(inline="always")
def _cos_of(r, low):
    z, s = r * r, 0.0
    for k in range(9, 1, -1):
        s = s * z + COS_TERMS[k]
    half = 0.5 * z
    whole = 1.0 - half
    return whole + (((1.0 - whole) - half) + (z * z * s - r * low))


@njit(inline="always")
def _sin_cos(x):
    k, r, low = _quarter(x)
    s, c = _sin_of(r, low), _cos_of(r, low)
    if k & 1:
        s, c = c, -s
    if k & 2:
        s, c = -s, -c
    return s, c


@elementwise
def sin(x):
    """Sine of an angle in rad."""
    return _sin_cos(x)[0] if abs(x) < math.inf else math.nan


@elementwise
def cos(x):
    """Cosine of an angle in rad."""
    return _sin_cos(x)[1] if abs(x) < math.inf else math.nan


@elementwise
def tan(x):
    """Tangent of an angle in rad."""
    if not abs(x) < math.inf:
        return math.nan
    s, c = _sin_cos(x)
    return s / c if c != 0.0 else math.inf


@njit(inline="always")
def _arctan_up_to_one(x):
    """(high, low) of atan for 0 <= x <= 1: about the nearest eighth."""
    k = int(np.rint(8.0 * x))
    c = 0.125 * k
    t = (x - c) / (1.0 + x * c)
    z, s = t * t, 0.0
    for j in range(7, 0, -1):
        s = s * z + ATAN_TERMS[j]
    return ATAN_EIGHTHS[k, HIGH], t + (t * z * s + ATAN_EIGHTHS[k, LOW])


@njit(inline="always")
def _arctan2(y, x):
    if not (abs(x) <= math.inf and abs(y) <= math.inf):
        return math.nan
    a, b = abs(y), abs(x)
    if a == math.inf and b == math.inf:
        a, b = 1.0, 1.0
    if a <= b:
        high, low = _arctan_up_to_one(a / b if b != 0.0 else 0.0)
    else:
        high, low = _arctan_up_to_one(b / a)
        high, low = 2.0 * ATAN_EIGHTHS[8, HIGH] - high, HALF_PI_LOW - low
    if x < 0.0 or (x == 0.0 and math.copysign(1.0, x) < 0.0):
        high, low = 4.0 * ATAN_EIGHTHS[8, HIGH] - high, 2.0 * HALF_PI_LOW - low
    return math.copysign(high + low, y)


@elementwise
def arctan2(y, x):
    """Angle in rad, -pi to pi, of the direction (x, y)."""
    return _arctan2(y, x)


@elementwise
def arctan(x):
    """Angle in rad whose tangent is x."""
    return _arctan2(x, 1.0)


@elementwise
def arcsin(x):
    """Angle in rad, -pi/2 to pi/2, whose sine is x; NaN beyond -1..1."""
    return _arctan2(x, math.sqrt((1.0 - x) * (1.0 + x))) if abs(x) <= 1.0 else math.nan


@elementwise
def arccos(x):
    """Angle in rad, 0 to pi, whose cosine is x; NaN beyond -1..1."""
    return _arctan2(math.sqrt((1.0 - x) * (1.0 + x)), x) if abs(x) <= 1.0 else math.nan


@njit(inline="always")
def _scaled(x, k):
    """x 2^k."""
    return math.ldexp(x, k)


@njit(inline="always")
def _exp(x):
    if x != x:
        return x
    if x > MOST_EXP:
        return math.inf
    if x < LEAST_EXP:
        return 0.0
    k = np.rint(x * 1.4426950408889634)
    r = (x - k * LOG_2_PARTS[HIGH]) - k * LOG_2_PARTS[LOW]
    s = 0.0
    for j in range(14, 1, -1):
        s = s * r + EXP_TERMS[j]
    return _scaled(1.0 + (r + r * r * s), int(k))


@njit(inline="always")
def _log(x):
    if not 0.0 < x < math.inf:
        return -math.inf if x == 0.0 else (math.inf if x > 0.0 else math.nan)
    m, e = math.frexp(x)
    if m < 0.7071067811865476:
        m, e = 2.0 * m, e - 1
    f = m - 1.0
    t = f / (2.0 + f)
    z, s = t * t, 0.0
    for j in range(11, 0, -1):
        s = s * z + LOG_TERMS[j]
    return e * LOG_2_PARTS[HIGH] + (e * LOG_2_PARTS[LOW] + (2.0 * t + 2.0 * t * z * s))


@elementwise
def exp(x):
    """e to the power x."""
    return _exp(x)


@elementwise
def log(x):
    """Natural logarithm; NaN of negative numbers."""
    return _log(x)


@elementwise
def power(x, y):
    """x to the power y, x not negative unless y is whole; whole powers up to 64 by products."""
    if y == np.rint(y) and abs(y) <= 64.0:
        out, base, n = 1.0, x, int(abs(y))
        while n:
            if n & 1:
                out *= base
            base *= base
            n >>= 1
        return out if y >= 0.0 else 1.0 / out
    if x == 0.0:
        return 0.0 if y > 0.0 else math.inf
    if y == 0.5:
        return math.sqrt(x)
    return _exp(y * _log(x))


@elementwise
def cbrt(x):
    """Cube root."""
    if x == 0.0 or not abs(x) < math.inf:
        return x
    root = _exp(_log(abs(x)) / 3.0)
    root -= (root * root * root - abs(x)) / (3.0 * root * root)
    return math.copysign(root, x)


@elementwise
def tanh(x):
    """Hyperbolic tangent."""
    if abs(x) > 20.0:
        return math.copysign(1.0, x)
    if abs(x) < 0.05:           # continued fraction: the difference below would lose digits
        z = x * x
        return x / (1.0 + z / (3.0 + z / (5.0 + z / (7.0 + z / (9.0 + z / 11.0)))))
    e = _exp(2.0 * x)
    return (e - 1.0) / (e + 1.0)


@elementwise
def hypot(x, y):
    """Length of the vector (x, y)."""
    if x != x or y != y:
        return math.nan
    long = max(abs(x), abs(y))
    if 1e-140 < long < 1e140:
        return math.sqrt(x * x + y * y)
    if long == 0.0 or long == math.inf:
        return long
    x, y = x / long, y / long           # squares of these neither overflow nor vanish
    return long * math.sqrt(x * x + y * y)


@elementwise
def bessel_i(order, x):
    """Modified Bessel function of the first kind, whole order >= 0, |x| up to some 50: its power series."""
    half, term = 0.5 * x, 1.0
    for k in range(1, int(order) + 1):
        term *= half / k
    square, total = half * half, 0.0
    for m in range(1, 200):
        total += term
        term *= square / (m * (m + order))
        if abs(term) <= 1e-18 * abs(total):
            break
    return total + term


def bessel_i_slope(order, x):
    """First derivative of `bessel_i` with respect to x."""
    order = np.asarray(order)
    return np.where(order == 0, bessel_i(1, x), (bessel_i(np.maximum(order - 1, 0), x) + bessel_i(order + 1, x)) / 2)


# products of arrays ----------------------------------------------------------------------------


def matmul(a, b):
    """As numpy.matmul, every sum in the order of its terms; a or b may be a vector.

    >>> matmul(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([5.0, 6.0]))
    array([17., 39.])
    """
    a, b = np.asarray(a), np.asarray(b)
    if b.ndim == 1:
        return np.einsum("...k,k->...", a, b)
    return np.einsum("k,...kj->...j", a, b) if a.ndim == 1 else np.einsum("...ik,...kj->...ij", a, b)


def length(vector):
    """Euclidean length of one vector (n,), float."""
    vector = np.asarray(vector, float).ravel()
    return math.sqrt(np.einsum("k,k->", vector, vector))


def lengths(vectors):
    """Euclidean lengths (...) of vectors (..., 3), as NumPy's norm along the last axis to the last bit, in a sixth of its time."""
    x, y, z = np.moveaxis(np.asarray(vectors, float), -1, 0)
    return np.sqrt(x * x + y * y + z * z)


def determinant(a):
    """Determinants of (..., 2, 2) or (..., 3, 3) matrices."""
    a = np.asarray(a, float)
    if a.shape[-1] == 2:
        return a[..., 0, 0] * a[..., 1, 1] - a[..., 0, 1] * a[..., 1, 0]
    return (a[..., 0, :] * np.cross(a[..., 1, :], a[..., 2, :])).sum(axis=-1)


def gauss_points(count):
    """(count,) places in -1..1 and their weights: integrates polynomials up to degree 2 count - 1 (Gauss and Legendre).

    >>> places, weights = gauss_points(3)
    >>> bool(abs((weights * places ** 2).sum() - 2 / 3) < 1e-15)
    True
    """
    x = cos(np.pi * (np.arange(count, 0, -1) - 0.25) / (count + 0.5))
    for _ in range(10):
        before, value = np.ones(count), x.copy()
        for k in range(2, count + 1):
            before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
        slope = count * (x * value - before) / (x * x - 1.0)
        x = x - value / slope
    return x, 2.0 / ((1.0 - x * x) * slope * slope)


# systems of equations --------------------------------------------------------------------------


def solve(a, b):
    """x of a x = b, by elimination with row pivots.

    Args:
        a: (n, n).   b: (n,) or (n, m).
    Raises:
        ZeroDivisionError: the matrix is singular.
    """
    b = np.asarray(b, float)
    return _eliminated(np.array(a, float), b.reshape(len(b), -1).copy()).reshape(b.shape)


@njit
def _eliminated(a, x):
    n = len(a)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if a[best, k] == 0.0:
            raise ZeroDivisionError("singular matrix")
        if best != k:
            for j in range(k, n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            for j in range(x.shape[1]):
                x[k, j], x[best, j] = x[best, j], x[k, j]
        for i in range(k + 1, n):
            share = a[i, k] / a[k, k]
            if share != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= share * a[k, j]
                for j in range(x.shape[1]):
                    x[i, j] -= share * x[k, j]
    for i in range(n - 1, -1, -1):
        for j in range(x.shape[1]):
            rest = x[i, j]
            for k in range(i + 1, n):
                rest -= a[i, k] * x[k, j]
            x[i, j] = rest / a[i, i]
    return x


def solve_banded(first, rows, b):
    """x of a banded system without row exchanges, as splines' totally positive collocation has.

    Args:
        first: (n,) column of each row's first entry, not falling.
        rows: (n, k) entries from there on.
        b: (n, m).
    Raises:
        ZeroDivisionError: a pivot vanishes: a site lies outside its basis function.
    Source: C. de Boor, A. Pinkus, Numer. Math. 27 (1977): elimination of totally positive matrices needs no pivots.
    """
    return _banded(np.asarray(first, np.int64), np.array(rows, float), np.array(b, float))


@njit
def _banded(first, rows, x):
    n, k = rows.shape
    for i in range(n):
        at = i - first[i]
        if at < 0 or at >= k or rows[i, at] == 0.0:
            raise ZeroDivisionError("singular matrix")
        last = min(first[i] + k, n)
        for r in range(i + 1, n):
            if first[r] > i:
                break
            share = rows[r, i - first[r]] / rows[i, at]
            if share != 0.0:
                for c in range(i + 1, last):
                    rows[r, c - first[r]] -= share * rows[i, c - first[i]]
                for j in range(x.shape[1]):
                    x[r, j] -= share * x[i, j]
    for i in range(n - 1, -1, -1):
        last = min(first[i] + k, n)
        for j in range(x.shape[1]):
            rest = x[i, j]
            for c in range(i + 1, last):
                rest -= rows[i, c - first[i]] * x[c, j]
            x[i, j] = rest / rows[i, i - first[i]]
    return x


def null_space_and_particular(rows, values):
    """What rows @ c = values leaves free, and its shortest solution.

    Args:
        rows: (m, n), rows may hang on each other.
        values: (m, k).
    Returns:
        (n, n - rank) orthonormal columns, (n, k).
    """
    rows, values = np.asarray(rows, float), np.asarray(values, float)
    if not len(rows):
        return np.eye(rows.shape[1]), np.zeros((rows.shape[1], values.shape[1]))
    q, r, order, rank = _factored(rows.T.copy())
    shares = _forward(r[:rank, :rank].T.copy(), values[order[:rank]].copy())       # R^T y = the pivoted rows' values
    return q[:, rank:], matmul(q[:, :rank], shares)


def least_squares(a, b):
    """x of least |a x - b|; columns that hang on others, to FULL_RANK, are left at 0.

    Args:
        a: (m, n), m >= n.   b: (m, k).
    """
    q, r, order, rank = _factored(np.array(a, float))
    out = np.zeros((r.shape[1], b.shape[1]))
    right = matmul(q[:, :rank].T, np.asarray(b, float))
    out[order[:rank]] = _backward(r[:rank, :rank].copy(), right)
    return out


@njit
def _factored(a):
    """(q (m, m), r (m, n), order (n,), rank) of a[:, order] = q r, by Householder's reflections with column pivots."""
    m, n = a.shape
    q, order, rank, most = np.eye(m), np.arange(n), min(m, n), 0.0
    for k in range(min(m, n)):
        best, longest = k, -1.0
        for j in range(k, n):
            size = 0.0
            for i in range(k, m):
                size += a[i, j] * a[i, j]
            if size > longest:
                best, longest = j, size
        longest = math.sqrt(longest)
        most = max(most, longest)
        if longest <= FULL_RANK * most:
            rank = k
            break
        if best != k:
            order[k], order[best] = order[best], order[k]
            for i in range(m):
                a[i, k], a[i, best] = a[i, best], a[i, k]
        v = a[k:, k].copy()
        v[0] += math.copysign(longest, v[0])
        size = 0.0
        for x in v:
            size += x * x
        if size > 0.0:
            _reflect(a, v, 2.0 / size, k, k)
            _reflect_columns(q, v, 2.0 / size, k)
    return q, a, order, rank


@njit
def _reflect(a, v, scale, k, first):
    for j in range(first, a.shape[1]):
        s = 0.0
        for i in range(len(v)):
            s += v[i] * a[k + i, j]
        s *= scale
        for i in range(len(v)):
            a[k + i, j] -= s * v[i]


@njit
def _reflect_columns(q, v, scale, k):
    for i in range(len(q)):
        s = 0.0
        for j in range(len(v)):
            s += q[i, k + j] * v[j]
        s *= scale
        for j in range(len(v)):
            q[i, k + j] -= s * v[j]


@njit
def _forward(low, x):
    for i in range(len(low)):
        for j in range(x.shape[1]):
            rest = x[i, j]
            for k in range(i):
                rest -= low[i, k] * x[k, j]
            x[i, j] = rest / low[i, i]
    return x


@njit
def _backward(up, x):
    for i in range(len(up) - 1, -1, -1):
        for j in range(x.shape[1]):
            rest = x[i, j]
            for k in range(i + 1, len(up)):
                rest -= up[i, k] * x[k, j]
            x[i, j] = rest / up[i, i]
    return x


def singular_values(a):
    """(u (n, k), s (k,), v (k, k)) of a = u diag(s) v^T, n >= k, s falling; by Jacobi's rotations of the columns.

    Columns of u that belong to a vanishing s are 0.
    """
    u, v = _rotated(np.array(a, float))
    s = np.sqrt((u * u).sum(axis=0))
    order = np.argsort(-s, kind="stable")
    u, s, v = u[:, order], s[order], v[:, order]
    return u / np.where(s > 0.0, s, 1.0), s, v


@njit
def _rotated(u):
    n, k = u.shape
    v = np.eye(k)
    for _ in range(JACOBI_SWEEPS):
        is_square = True
        for p in range(k - 1):
            for q in range(p + 1, k):
                pp = qq = pq = 0.0
                for i in range(n):
                    pp += u[i, p] * u[i, p]
                    qq += u[i, q] * u[i, q]
                    pq += u[i, p] * u[i, q]
                if abs(pq) <= 1e-16 * math.sqrt(pp * qq):
                    continue
                is_square = False
                t = (qq - pp) / (2.0 * pq)
                t = math.copysign(1.0, t) / (abs(t) + math.sqrt(1.0 + t * t))
                c = 1.0 / math.sqrt(1.0 + t * t)
                s = c * t
                for i in range(n):
                    u[i, p], u[i, q] = c * u[i, p] - s * u[i, q], s * u[i, p] + c * u[i, q]
                for i in range(k):
                    v[i, p], v[i, q] = c * v[i, p] - s * v[i, q], s * v[i, p] + c * v[i, q]
        if is_square:
            break
    return u, v
