r"""Lines that stand for an arc at one height: beside it, for what is near one place, or within it, one after the other.

        ____tangent____            chord and tangent of a stretch lie h and 0 within the arc: the line between them is off it by
       /     line      \           h/2 at most, on both sides
      arc____chord_____
"""

import math

import numpy as np

from cuspline.stock.height_kernels import bottom
from cuspline.stock.path_pieces import CENTER_U, CENTER_V, FORM, LEVEL_ARC, LINE, RADIUS, SAGITTA_MM, X0, X1, Y0, Y1, Z0
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, put

MOST_WAYS = 64            # chords of one piece: a power of two no less than the root of LEVEL_SAGITTA_MM / SAGITTA_MM, which is 50


@njit
def line_beside(g, px, py, reach, out):
    """Writes a line that stands for a level arc to all that lies within `reach` of a place; how far off the arc it is, mm."""
    x, y, r = px - g[CENTER_U], py - g[CENTER_V], g[RADIUS]
    x0, y0, x1, y1 = g[X0] - g[CENTER_U], g[Y0] - g[CENTER_V], g[X1] - g[CENTER_U], g[Y1] - g[CENTER_V]
    if x0 * y - y0 * x < 0.0 or x * y1 - y * x1 < 0.0:
        x, y = (x0, y0) if (x - x0) ** 2 + (y - y0) ** 2 < (x - x1) ** 2 + (y - y1) ** 2 else (x1, y1)
    far = math.sqrt(x * x + y * y)
    x, y = (x / far, y / far) if far > 0.0 else (x0 / r, y0 / r)
    half = r * reach / max(far - reach, reach) if reach > 0.0 else 0.0
    back, ahead = max(x * y0 - y * x0, -half), min(x * y1 - y * x1, half)
    most = max(-back, ahead)
    low = r - most * most / (4.0 * r)
    back, ahead = back * low / r, ahead * low / r              # its ends point where the arc still goes
    put(out, g)
    out[X0], out[Y0] = g[CENTER_U] + low * x - back * y, g[CENTER_V] + low * y + back * x
    out[X1], out[Y1] = g[CENTER_U] + low * x - ahead * y, g[CENTER_V] + low * y + ahead * x
    out[FORM] = LINE
    return max(r - low, math.sqrt(low * low + most * most) - r)


@njit
def _beside_line(x, y, g):
    """Seen from above, distance of a place to a line."""
    dx, dy = g[X1] - g[X0], g[Y1] - g[Y0]
    square = dx * dx + dy * dy
    t = min(max(((x - g[X0]) * dx + (y - g[Y0]) * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
    ex, ey = x - g[X0] - t * dx, y - g[Y0] - t * dy
    return math.sqrt(ex * ex + ey * ey)


@njit
def level_cover(x, y, hx, hy, g, a, rc, spare):
    """No point of a rectangle keeps more height than this after a level arc; inf: not all of it is passed over.

    The distance to the line that stands for the arc is convex: it is largest in a corner.
    """
    more = line_beside(g, x, y, math.sqrt(hx * hx + hy * hy), spare)
    most = more + max(max(_beside_line(x - hx, y - hy, spare), _beside_line(x + hx, y - hy, spare)),
                      max(_beside_line(x - hx, y + hy, spare), _beside_line(x + hx, y + hy, spare)))
    return g[Z0] + bottom(most, a, rc) if most <= a + rc else math.inf


@njit
def level_sagitta(g):
    """How far a level arc lies from its chord, mm; 0: the piece is another."""
    if g[FORM] != LEVEL_ARC:
        return 0.0
    half = 0.25 * ((g[X1] - g[X0]) * (g[X1] - g[X0]) + (g[Y1] - g[Y0]) * (g[Y1] - g[Y0]))
    return g[RADIUS] - math.sqrt(max(g[RADIUS] * g[RADIUS] - half, 0.0))


@njit
def chord_count(g):
    """How many chords of a level arc keep within SAGITTA_MM of it, a power of two; 1: of other pieces."""
    count, sagitta = 1, level_sagitta(g)
    while sagitta > SAGITTA_MM and count < MOST_WAYS:
        count, sagitta = 2 * count, 0.25 * sagitta
    return count


@njit
def chords_within(g, corners):
    """The corners of a level arc's chords into (MOST_WAYS + 1, 2); how many chords, see `chord_count`."""
    count = chord_count(g)
    corners[0, X], corners[0, Y], corners[count, X], corners[count, Y] = g[X0], g[Y0], g[X1], g[Y1]
    step = count
    while step > 1:
        for k in range(0, count, step):
            x = 0.5 * (corners[k, X] + corners[k + step, X]) - g[CENTER_U]
            y = 0.5 * (corners[k, Y] + corners[k + step, Y]) - g[CENTER_V]
            share = g[RADIUS] / math.sqrt(x * x + y * y)
            corners[k + step // 2, X], corners[k + step // 2, Y] = g[CENTER_U] + share * x, g[CENTER_V] + share * y
        step //= 2
    return count


@njit
def chord_room():
    """(MOST_WAYS + 1, 2) for `chords_within`."""
    return np.empty((MOST_WAYS + 1, 2))
