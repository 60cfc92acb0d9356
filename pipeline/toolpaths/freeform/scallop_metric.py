"""How far apart two passes are, counted in steps of the wanted scallop height.

A cutter resting on the part leaves, a little way w along the surface from its contact, a gap of half of
Q(w, w), Q = (bending of the cutter + bending of the part) at the contact; two passes leave a scallop h
between them when sqrt(Q / 8h) of what lies between is 1.  That is a length in a metric, whichever way the
feed runs.  When the tip moves by dP the contact moves by dS and the normal turns by dn:

    8 h |dP|² = K(dS, dS) + <dS, dn>,       K = bending of the cutter;  ball: <dS, dC> / r,  C = S + r n

    ball on a surface bent by k across: step = sqrt(8 h / (1/r + k)), docs/formulas.md 5 to order h/r

All of it comes from where the cutter rests and what it touches, over a grid of (x, y): nothing is asked
of the surface but contacts.  Where the cutter rolls over an edge the contact stands still and no scallop
can form; where it bridges a hollow the contact jumps and what it jumps over is out of reach.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.errors import ToolpathError
from cuspline.values.rows import X, Y, Z
from cuspline.values.threads import in_blocks

ROLLING_STEP_RADII = 0.5    # over an edge no scallop forms; the centre still goes no farther from pass to pass
TIGHTEST = 50.0             # a hollow within 2 % of the cutter's radius counts as that
JUMP = 3.0                  # a contact that moves this much faster than on both sides of it jumps
LEVEL = 1e-9                # of a unit normal's level part, below which it stands upright
ROWS = 16                   # of the grid that a thread takes at a time
DS, DN, DP, DC = range(4)   # how contact, normal and tip move, and the middle of the corner's circle
ALONG_ROW, ALONG_COLUMN = range(2)      # ways from a node to its next: in x, in y
XX, XY, YY = range(3)       # of a symmetric form


@dataclass(frozen=True, kw_only=True)
class Across:
    """A cutter that leans, on the passes of the ball that stands for it."""

    radius_mm: float            # of what it cuts, across its feed
    widest_mm: float            # no step is wider, however flat it cuts


def scallop_metric(contact_mm, normal, step_mm, *, radius_mm, corner_radius_mm=None, scallop_mm, across=None):
    """Metric in which neighbouring passes lie one apart.

    Args:
        contact_mm: (ny, nx, 3) contact over each node of an even grid, y by rows, x by columns; NaN: none.
        normal: (ny, nx, 3) unit normal there, from the contact into the cutter.
        step_mm: grid pitch, the same in x and y.
        radius_mm: cutter radius R.
        corner_radius_mm: rc; None: a ball.
        scallop_mm: scallop height wanted, far below the corner radius.
        across: Across of the cutter that leaves the scallops; None: the one that touches.
    Returns:
        (ny, nx, 3) xx, xy, yy in 1/mm² of the tip's plan (x, y); NaN where there is no contact.  The error
        of a step is of order step_mm² on smooth faces, and of scallop / radius (a ball on a flat: none).
    Raises:
        ToolpathError: a sharp-cornered cutter, whose scallops are no lengths in any metric.
    """
    rc = radius_mm if corner_radius_mm is None else corner_radius_mm
    if not 0.0 < rc <= radius_mm:
        raise ToolpathError(f"a cutter of radius {radius_mm} mm with a corner of {rc} mm leaves no round scallops; "
                            "constant scallop height needs a ball or a bull-nose cutter")
    R, cuts, widest = (radius_mm, rc, ROLLING_STEP_RADII * radius_mm) if across is None else (
        across.radius_mm, across.radius_mm, across.widest_mm)
    if not 0.0 < scallop_mm < 0.2 * cuts:
        raise ToolpathError(f"scallop height {scallop_mm} mm is not small beside the corner radius {cuts} mm")
    contact, normal = for_kernel(contact_mm), for_kernel(normal)
    height = 8.0 * scallop_mm * (1.0 - scallop_mm / (2.0 * cuts))
    speed, metric = _speeds(contact, normal, radius_mm, rc), np.empty(contact.shape)
    in_blocks(_metric_rows, len(contact), ROWS, contact, normal, speed, float(step_mm), float(radius_mm), float(rc),
              float(R), float(cuts), height, 1.0 / widest ** 2, TIGHTEST / (cuts * height), metric)
    return metric


def contact_jumps(contact_mm, normal, *, radius_mm, corner_radius_mm=None):
    """(ny, nx, 2) bool: the contact jumps from a node to its next in x [0], in y [1]; nothing is cut across.

    Args:
        contact_mm, normal, radius_mm, corner_radius_mm: as for `scallop_metric`.
    """
    rc = radius_mm if corner_radius_mm is None else corner_radius_mm
    contact, normal = for_kernel(contact_mm), for_kernel(normal)
    out = np.zeros((*contact.shape[:2], 2), np.bool_)
    _jump_rows(_speeds(contact, normal, radius_mm, rc), out)
    return out


def _speeds(contact, normal, R, rc):
    """(rows, columns, 2) how fast contact and corner circle move together from a node to its next, for a unit of the cutter's
    motion squared: ALONG_ROW, ALONG_COLUMN; NaN: unknown."""
    speed = np.empty((*contact.shape[:2], 2))
    in_blocks(_speed_rows, len(contact), ROWS, contact, normal, float(R), float(rc), speed)
    return speed


@njit
def _next(i, j, way):
    """The node behind (i, j)."""
    return (i, j + 1) if way == ALONG_ROW else (i + 1, j)


@njit
def _before(i, j, way):
    return (i, j - 1) if way == ALONG_ROW else (i - 1, j)


@njit(error_model="numpy")
def _move(contact, normal, i, j, way, R, rc, out):
    """Differences of contact, normal, cutter and corner circle from a node to its next into out (4, 3)."""
    k, m = _next(i, j, way)
    for c in range(3):
        out[DS, c] = contact[k, m, c] - contact[i, j, c]
        out[DN, c] = normal[k, m, c] - normal[i, j, c]
        out[DC, c] = out[DS, c] + rc * out[DN, c]
        ahead, here = contact[k, m, c] + rc * normal[k, m, c], contact[i, j, c] + rc * normal[i, j, c]
        if R > rc:
            ahead += (R - rc) * _level(normal[k, m], c)
            here += (R - rc) * _level(normal[i, j], c)
        out[DP, c] = ahead - here


@njit(error_model="numpy")
def _level(n, c):
    """Coordinate c of a normal's unit level part, 0 where it stands upright."""
    long = math.sqrt(n[X] * n[X] + n[Y] * n[Y])
    return n[c] / long if c != Z and long > LEVEL else 0.0


@njit(inline="always")
def _dot(a, b):
    """x and z first, as NumPy adds them, which is what recorded programs were made with."""
    return a[X] * b[X] + a[Z] * b[Z] + a[Y] * b[Y]


@njit(error_model="numpy")
def _speed_rows(contact, normal, R, rc, speed, first, end):
    rows, columns, _ = contact.shape
    move = np.empty((4, 3))
    for i in range(first, end):
        for j in range(columns):
            for way in range(2):
                k, m = _next(i, j, way)
                speed[i, j, way] = np.nan
                if k == rows or m == columns:
                    continue
                _move(contact, normal, i, j, way, R, rc, move)
                moved = _dot(move[DP], move[DP])
                if moved > 0.0:
                    speed[i, j, way] = _dot(move[DS], move[DC]) / moved


@njit(error_model="numpy")
def _known(speed, node, way):
    """Speed of a step, 0 where it is unknown or off the grid."""
    i, j = node
    rows, columns, _ = speed.shape
    if i < 0 or j < 0 or i >= rows or j >= columns or not math.isfinite(speed[i, j, way]):
        return 0.0
    return speed[i, j, way]


@njit(error_model="numpy")
def _jumps(speed, i, j, way):
    """Over this step the contact moves far more than over the steps on both sides."""
    beside = max(_known(speed, _before(i, j, way), way), _known(speed, _next(i, j, way), way))
    return _known(speed, (i, j), way) > JUMP * max(beside, 1.0)


@njit(error_model="numpy")
def _jump_rows(speed, out):
    rows, columns, ways = speed.shape
    for i in range(rows):
        for j in range(columns):
            for way in range(ways):
                out[i, j, way] = _jumps(speed, i, j, way)


@njit(error_model="numpy")
def _along(contact, normal, speed, i, j, way, step_mm, R, rc, move, out):
    """How contact, normal and tip move per mm along a row or column, into out (3, 3); never across a jump; NaN: unknown.

    The mean of the steps to both neighbours, clean ones; without any, of what there is.
    """
    k, m = _before(i, j, way)
    known_before = k >= 0 and m >= 0 and math.isfinite(speed[k, m, way])
    known_behind = math.isfinite(speed[i, j, way])
    takes_before = known_before and not _jumps(speed, k, m, way)
    takes_behind = known_behind and not _jumps(speed, i, j, way)
    if not (takes_before or takes_behind):
        takes_before, takes_behind = known_before, known_behind
    out[:] = 0.0
    if takes_before:
        _move(contact, normal, k, m, way, R, rc, move)
        _add(out, move)
    if takes_behind:
        _move(contact, normal, i, j, way, R, rc, move)
        _add(out, move)
    share = 0.5 if takes_before and takes_behind else 1.0 if takes_before or takes_behind else np.nan
    for a in range(3):
        for c in range(3):
            out[a, c] = share * out[a, c] / step_mm


@njit(inline="always")
def _add(out, move):
    for a in range(3):
        for c in range(3):
            out[a, c] += move[a, c]


@njit(error_model="numpy")
def _metric_rows(contact, normal, speed, step_mm, R, rc, across_R, cuts, height, least, most, metric, first, end):
    """Rows of `scallop_metric`; R, rc: of the cutter that touches; across_R, cuts: of the one that leaves the scallops."""
    x, y, move, gap, tip = np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 3)), np.empty(3), np.empty(3)
    _, columns, _ = contact.shape
    for i in range(first, end):
        for j in range(columns):
            _along(contact, normal, speed, i, j, ALONG_ROW, step_mm, R, rc, move, x)
            _along(contact, normal, speed, i, j, ALONG_COLUMN, step_mm, R, rc, move, y)
            gap[XX] = _gap(x, x, normal[i, j], across_R, cuts) / height
            gap[XY] = _gap(x, y, normal[i, j], across_R, cuts) / height
            gap[YY] = _gap(y, y, normal[i, j], across_R, cuts) / height
            tip[XX], tip[XY], tip[YY] = _dot(x[DP], x[DP]), _dot(x[DP], y[DP]), _dot(y[DP], y[DP])
            _clip(gap, tip, least, most, metric[i, j])


@njit(error_model="numpy")
def _gap(a, b, n, R, rc):
    """K(dS, dS') + <dS, dn'>, made symmetric, for two directions' (dS, dn, dP)."""
    part = 0.5 * (_dot(a[DS], b[DN]) + _dot(b[DS], a[DN]))
    cutter = _dot(a[DS], b[DS]) / rc
    if rc == R:
        return cutter + part
    sin = math.sqrt(n[X] * n[X] + n[Y] * n[Y])
    round_x, round_y = -_level(n, Y), _level(n, X)
    bend = sin / (R - rc + rc * sin) - 1.0 / rc
    return cutter + part + bend * (a[DS, X] * round_x + a[DS, Y] * round_y) * (b[DS, X] * round_x + b[DS, Y] * round_y)


@njit(error_model="numpy")
def _clip(gap, tip, least, most, out):
    """The metric with its lengths per mm of tip path kept between two bounds (squared, 1/mm²), into out (3,)."""
    l11 = math.sqrt(tip[XX])                         # tip = L L^T;  gap = L A L^T
    l21 = tip[XY] / l11
    rest = tip[YY] - l21 * l21
    l22 = math.sqrt(rest if not rest < 1e-12 else 1e-12)
    axx = gap[XX] / (l11 * l11)
    axy = (gap[XY] - l21 * l11 * axx) / (l11 * l22)
    ayy = (gap[YY] - 2 * l21 * l22 * axy - l21 * l21 * axx) / (l22 * l22)
    mean, half = 0.5 * (axx + ayy), fixed.hypot(0.5 * (axx - ayy), axy)
    low, high = _kept(mean - half, least, most), _kept(mean + half, least, most)
    turn = (high - low) / max(2 * half, 1e-300) if half > 0.0 else 0.0
    middle = 0.5 * (low + high) - turn * mean
    bxx, bxy, byy = middle + turn * axx, turn * axy, middle + turn * ayy
    out[XX] = bxx * l11 * l11
    out[XY] = l11 * (bxx * l21 + bxy * l22)
    out[YY] = bxx * l21 * l21 + 2 * bxy * l21 * l22 + byy * l22 * l22


@njit(inline="always")
def _kept(value, least, most):
    """Between two bounds; NaN stays."""
    return least if value < least else most if value > most else value
