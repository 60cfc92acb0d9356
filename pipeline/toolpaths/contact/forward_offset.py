"""Tips over a whole parameter grid of a face at once: surface and offset in one compiled pass, axis = +z.

Along a row of constant u the patch shrinks to polynomials of v alone; values, both tangents and the offset then run
over a block of neighbouring v together, so that the processor's vector units work.
"""

import numpy as np

from cuspline.surfaces.patches import (
    BREAKS_U,
    BREAKS_V,
    DEGREE_U,
    DEGREE_V,
    FIRST_PATCH,
    IS_RATIONAL,
    OFFSET,
    SPANS_U,
    SPANS_V,
    U_HIGH,
    U_LOW,
    V_HIGH,
    V_LOW,
    find_span,
)
from cuspline.toolpaths.contact.cutter_location import LEVEL
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.rows import W, X, Y, Z
from cuspline.values.threads import in_blocks

BLOCK = 128             # grid points of a row worked on together
ROWS = 4                # a thread takes at a time
PLACE, IN_S, IN_T = 0, 4, 8     # rows of a block: homogeneous point, its tangents
VALUE, SLOPE = range(2)         # of the polynomials along a row
SERIAL_POINTS = 20_000  # below this, starting threads costs more than it saves


def forward_tips(patches, face, u, v, radius_mm, corner_radius_mm, allowance_mm=0.0):
    """Tips of a ball, bull-nose or flat end mill that touches a face at every point of a parameter grid.

    Args:
        patches: PatchSet.
        face: index.
        u, v: (m,), (k,) parameters of the face's `nurbs`; fastest when v is sorted.
        radius_mm, corner_radius_mm: of the cutter; equal for a ball, corner 0 for a flat.
        allowance_mm: left on the surface.
    Returns:
        (m, k, 3) tips.  NaN where the surface has no normal (a pole) or looks down: no 3-axis cutter touches there.
        Gouging elsewhere is not looked at.
    """
    u, v = for_kernel(u), for_kernel(v)
    out = np.empty((len(u), len(v), 3))
    in_blocks(_rows, len(u), ROWS, patches.arrays, int(face), u, v, float(radius_mm), float(corner_radius_mm),
              float(allowance_mm), out, serial_rows=SERIAL_POINTS // max(len(v), 1))
    return out


@njit
def _rows(arrays, face, u, v, radius, corner, allowance, out, first, last):
    for k in range(first, last):
        _row(arrays, face, u[k], v, radius, corner, allowance, out[k])


@njit(error_model="numpy")
def _row(arrays, face, u, v, radius, corner, allowance, out):
    """One row of the grid."""
    coefficients, patch, span, faces, breaks, sign = arrays
    row = faces[face]
    first = row[FIRST_PATCH] + find_span(breaks, row[BREAKS_U], row[SPANS_U], u) * row[SPANS_V]
    degree = patch[first, DEGREE_V]
    lines = np.empty((2, degree + 1, 4))                # the patch and its u tangent at this u, powers of t
    t, work = np.empty(BLOCK), np.empty((12, BLOCK))
    held, k, count = -1, 0, len(v)
    while k < count:
        q = first + find_span(breaks, row[BREAKS_V], row[SPANS_V], v[k])
        low, high = span[q, V_LOW], span[q, V_HIGH]
        if q != held:
            _shrink(coefficients, patch[q], span[q], u, lines)
            held = q
        n = 0
        while n < BLOCK and k + n < count:
            x = v[k + n]
            if not ((low <= x < high) or n == 0):
                break
            t[n] = (2.0 * min(max(x, low), high) - low - high) / (high - low)
            n += 1
        _along(lines, t, n, patch[q, IS_RATIONAL] != 0, work)
        _offset(work, n, sign[face], radius, corner, allowance, out, k)
        k += n


@njit(error_model="numpy")
def _shrink(coefficients, patch, span, u, lines):
    """Polynomials of t along constant u: value and derivative with respect to s."""
    s = (2.0 * min(max(u, span[U_LOW]), span[U_HIGH]) - span[U_LOW] - span[U_HIGH]) / (span[U_HIGH] - span[U_LOW])
    offset, du, dv = patch[OFFSET], patch[DEGREE_U], patch[DEGREE_V]
    for j in range(dv + 1):
        for k in range(4):
            value = slope = 0.0
            for i in range(du, -1, -1):
                slope = slope * s + value
                value = value * s + coefficients[offset + (i * (dv + 1) + j) * 4 + k]
            lines[VALUE, j, k], lines[SLOPE, j, k] = value, slope


@njit(error_model="numpy")
def _along(lines, t, n, is_rational, work):
    """Point (rows PLACE), s tangent (IN_S) and t tangent (IN_T) at n places, the weight's after each."""
    size = 4 if is_rational else 3
    for k in range(size):
        x, xs, xt = work[k], work[IN_S + k], work[IN_T + k]
        top, top_s = lines[VALUE, -1, k], lines[SLOPE, -1, k]
        for m in range(n):
            x[m], xs[m], xt[m] = top, top_s, 0.0
        for j in range(lines.shape[1] - 2, -1, -1):
            c, cs = lines[VALUE, j, k], lines[SLOPE, j, k]
            for m in range(n):
                xt[m] = xt[m] * t[m] + x[m]
                x[m] = x[m] * t[m] + c
                xs[m] = xs[m] * t[m] + cs
    if is_rational:
        for k in range(3):
            for m in range(n):
                w = work[PLACE + W, m]
                p = work[k, m] / w
                work[k, m] = p
                work[IN_S + k, m] = (work[IN_S + k, m] - work[IN_S + W, m] * p) / w
                work[IN_T + k, m] = (work[IN_T + k, m] - work[IN_T + W, m] * p) / w


@njit(error_model="numpy")
def _offset(work, n, sign, radius, corner, allowance, out, start):
    """tip = contact + (corner + allowance) n + (radius - corner) e - corner z, e the level unit of n."""
    flat, lift = radius - corner, corner + allowance
    for m in range(n):
        ax, ay, az = work[IN_S + X, m], work[IN_S + Y, m], work[IN_S + Z, m]
        bx, by, bz = work[IN_T + X, m], work[IN_T + Y, m], work[IN_T + Z, m]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        level = nx * nx + ny * ny
        full = np.sqrt(level + nz * nz)
        g = sign * lift / full
        e = sign * flat / np.sqrt(level) if level > LEVEL * LEVEL * full * full else 0.0
        fail = 0.0 if (nz * sign >= -1e-9 * full and full > 0.0) else np.nan
        out[start + m, X] = work[PLACE + X, m] + (g + e) * nx + fail
        out[start + m, Y] = work[PLACE + Y, m] + (g + e) * ny + fail
        out[start + m, Z] = work[PLACE + Z, m] + g * nz - corner + fail
