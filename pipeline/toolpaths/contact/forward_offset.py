"""Tips over a whole parameter grid of a face at once: surface and offset in one compiled pass, axis = +z.

Along a row of constant u the patch shrinks to polynomials of v alone; values, both tangents and the offset then run
over a block of neighbouring v together, so that the processor's vector units work.
"""

import numpy as np

from cuspline.surfaces.patches import find_span
from cuspline.toolpaths.contact.cutter_location import LEVEL
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.threads import in_blocks

BLOCK = 128             # grid points of a row worked on together
ROWS = 4                # a thread takes at a time
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
    first = row[0] + find_span(breaks, row[3], row[1], u) * row[2]
    degree = patch[first, 3]
    lines = np.empty((2, degree + 1, 4))                # the patch and its u tangent at this u, powers of t
    t, work = np.empty(BLOCK), np.empty((12, BLOCK))
    held, k, count = -1, 0, v.shape[0]
    while k < count:
        q = first + find_span(breaks, row[4], row[2], v[k])
        low, high = span[q, 2], span[q, 3]
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
        _along(lines, t, n, patch[q, 4] != 0, work)
        _offset(work, n, sign[face], radius, corner, allowance, out, k)
        k += n


@njit(error_model="numpy")
def _shrink(coefficients, patch, span, u, lines):
    """Polynomials of t along constant u: value and derivative with respect to s."""
    s = (2.0 * min(max(u, span[0]), span[1]) - span[0] - span[1]) / (span[1] - span[0])
    offset, du, dv = patch[1], patch[2], patch[3]
    for j in range(dv + 1):
        for k in range(4):
            value = slope = 0.0
            for i in range(du, -1, -1):
                slope = slope * s + value
                value = value * s + coefficients[offset + (i * (dv + 1) + j) * 4 + k]
            lines[0, j, k], lines[1, j, k] = value, slope


@njit(error_model="numpy")
def _along(lines, t, n, is_rational, work):
    """Point (rows 0..2), s tangent (4..6) and t tangent (8..10) at n places; rows 3, 7, 11 are the weight's."""
    size = 4 if is_rational else 3
    for k in range(size):
        x, xs, xt = work[k], work[4 + k], work[8 + k]
        top, top_s = lines[0, -1, k], lines[1, -1, k]
        for m in range(n):
            x[m], xs[m], xt[m] = top, top_s, 0.0
        for j in range(lines.shape[1] - 2, -1, -1):
            c, cs = lines[0, j, k], lines[1, j, k]
            for m in range(n):
                xt[m] = xt[m] * t[m] + x[m]
                x[m] = x[m] * t[m] + c
                xs[m] = xs[m] * t[m] + cs
    if is_rational:
        for k in range(3):
            for m in range(n):
                w = work[3, m]
                p = work[k, m] / w
                work[k, m] = p
                work[4 + k, m] = (work[4 + k, m] - work[7, m] * p) / w
                work[8 + k, m] = (work[8 + k, m] - work[11, m] * p) / w


@njit(error_model="numpy")
def _offset(work, n, sign, radius, corner, allowance, out, start):
    """tip = contact + (corner + allowance) n + (radius - corner) e - corner z, e the level unit of n."""
    flat, lift = radius - corner, corner + allowance
    for m in range(n):
        ax, ay, az = work[4, m], work[5, m], work[6, m]
        bx, by, bz = work[8, m], work[9, m], work[10, m]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        level = nx * nx + ny * ny
        full = np.sqrt(level + nz * nz)
        g = sign * lift / full
        e = sign * flat / np.sqrt(level) if level > LEVEL * LEVEL * full * full else 0.0
        fail = 0.0 if (nz * sign >= -1e-9 * full and full > 0.0) else np.nan
        out[start + m, 0] = work[0, m] + (g + e) * nx + fail
        out[start + m, 1] = work[1, m] + (g + e) * ny + fail
        out[start + m, 2] = work[2, m] + g * nz - corner + fail
