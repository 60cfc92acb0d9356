"""Fewest tangent arcs and lines within a tolerance along an exact plane curve.

Joints lie on the curve; an arc through two joints is fixed by the heading with which it starts, and
it hands its own end heading to the next: the chain is tangent-continuous by construction.  Letting
headings differ slightly from the curve's doubles as the freedom that makes arcs long: on a curve
whose curvature changes at rate k' per mm an arc of length L then deviates k' L³/125, a biarc with
exact tangents k' L³/40 (per arc).  Dynamic programming over (joint, heading) finds the fewest.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.errors import ToolpathError
from cuspline.values.rows import X, Y, put

JOINTS = 220            # candidate joints along one curve
BUCKETS = 41            # heading states kept at each joint
CHECKS = 24             # points at which an arc's deviation is measured
JOINT, BUCKET, IS_BIARC, MIDDLE_ROW = range(4)      # of where a chain ends; JOINT, BUCKET of where it comes from
SAFETY = 0.985          # between the checks an arc may deviate slightly more


@dataclass(frozen=True, kw_only=True)
class FittedElement:
    """A straight line (radius inf) or an arc between two plane points."""

    start: tuple[float, float]
    end: tuple[float, float]
    center: tuple[float, float] | None
    radius: float                       # inf for lines
    is_left: bool                       # the arc turns left (counter-clockwise) going start to end


def fit_arcs(points, headings, tolerance_mm, largest_radius_mm, breaks=()):
    """Arcs and lines along a sampled curve.

    Args:
        points: (n, 2) exact points, dense compared with the arcs wanted.
        headings: (n,) exact direction angles, radians, without jumps.
        tolerance_mm: largest distance of the elements from the curve.
        largest_radius_mm: flatter arcs become lines.
        breaks: rows where the curvature jumps (joints of the underlying curves): always candidate joints.
    Returns:
        list of FittedElement from the first to the last point; first and last heading are the curve's.
    Raises:
        ToolpathError: the points are too few or the curve turns too sharply for the tolerance.
    """
    points, headings = np.ascontiguousarray(points, float), np.ascontiguousarray(headings, float)
    if len(points) < 3:
        return [line_between(points[0], points[-1])]
    rows = np.union1d(_joint_rows(points, headings), np.asarray(breaks, int))
    if len(rows) < 3:
        return [line_between(points[0], points[-1])]
    spread = _largest_heading_error(points, rows, tolerance_mm)
    chain = _shortest_chain(points, headings, rows, tolerance_mm * SAFETY, spread, largest_radius_mm)
    if len(chain) == 0:
        raise ToolpathError(f"no chain of arcs follows the curve near ({points[0, 0]:.3f}, {points[0, 1]:.3f}) "
                            f"within {tolerance_mm} mm: a kink, a wrong tangent, or a tolerance that "
                            f"{JOINTS} candidate ends of arcs cannot keep")
    return [_element(*row, largest_radius_mm) for row in chain]


def line_between(start, end):
    """A straight element."""
    return FittedElement(start=tuple(map(float, start)), end=tuple(map(float, end)), center=None,
                         radius=math.inf, is_left=False)


def _joint_rows(points, headings):
    """Rows of candidate joints: closer together where the curve bends more."""
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    turn = np.abs(np.diff(headings))
    weight = np.cumsum(np.r_[0.0, step / max(step.sum(), 1e-30) + turn / max(turn.sum(), 1e-12)])
    rows = np.searchsorted(weight, np.linspace(0.0, weight[-1], JOINTS))
    return np.unique(np.clip(rows, 0, len(points) - 1))


def _largest_heading_error(points, rows, tolerance_mm):
    """Heading errors beyond this leave the tolerance within a tenth of the curve."""
    length = np.linalg.norm(np.diff(points[rows], axis=0), axis=1).sum()
    return float(np.clip(16.0 * tolerance_mm / (0.1 * length), 0.03, 0.2))


def _element(x0, y0, x1, y1, heading, largest_radius_mm):
    """The arc from a point with a heading to another point."""
    cx, cy, signed = _arc_center(x0, y0, x1, y1, heading)
    if abs(signed) > largest_radius_mm:
        return line_between((x0, y0), (x1, y1))
    return FittedElement(start=(x0, y0), end=(x1, y1), center=(cx, cy), radius=abs(signed), is_left=signed > 0)


@njit
def _arc_center(x0, y0, x1, y1, heading):
    """Centre and signed radius (positive: turns left) of the arc that starts with a heading."""
    nx, ny = -fixed.sin(heading), fixed.cos(heading)
    dx, dy = x1 - x0, y1 - y0
    lean = 2.0 * (nx * dx + ny * dy)
    if abs(lean) < 1e-14 * (dx * dx + dy * dy + 1e-30):
        return x0, y0, 1e18
    radius = (dx * dx + dy * dy) / lean
    return x0 + radius * nx, y0 + radius * ny, radius


@njit
def _deviation(points, first, last, heading, largest_radius):
    """Largest distance of points first..last from the arc (or line) that joins their ends."""
    x0, y0, x1, y1 = points[first, X], points[first, Y], points[last, X], points[last, Y]
    cx, cy, radius = _arc_center(x0, y0, x1, y1, heading)
    length = math.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
    worst = 0.0
    count = min(CHECKS, last - first - 1)
    for k in range(1, count + 1):
        i = first + k * (last - first) // (count + 1)
        if abs(radius) > largest_radius:
            d = abs((points[i, X] - x0) * (y1 - y0) - (points[i, Y] - y0) * (x1 - x0)) / length
        else:
            d = abs(math.sqrt((points[i, X] - cx) ** 2 + (points[i, Y] - cy) ** 2) - abs(radius))
        worst = max(worst, d)
    return worst


@njit
def _wrapped(angle):
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@njit
def _end_heading(points, first, last, heading, largest_radius):
    """Heading with which the arc arrives; a line arrives along its chord."""
    dx, dy = points[last, X] - points[first, X], points[last, Y] - points[first, Y]
    chord = fixed.arctan2(dy, dx)
    _, _, radius = _arc_center(points[first, X], points[first, Y], points[last, X], points[last, Y], heading)
    if abs(radius) > largest_radius:
        return chord
    return heading + 2.0 * _wrapped(chord - heading)


@njit
def _shortest_chain(points, headings, rows, tolerance, spread, largest_radius):
    """Dynamic programming; returns (k, 5): start, end and start heading of every arc."""
    m = len(rows)
    cost = np.full((m, BUCKETS), 1e18)
    error = np.zeros((m, BUCKETS))              # heading minus the curve's heading
    before = np.full((m, BUCKETS, 2), -1, np.int64)
    cost[0, BUCKETS // 2] = 0.0
    best = 1e18
    tail = np.full(4, -1.0)                     # joint, bucket, 1 for a biarc, middle row
    for a in range(m - 1):
        for s in range(BUCKETS):
            if cost[a, s] > 1e17:
                continue
            start = headings[rows[a]] + error[a, s]
            misses = 0
            for b in range(a + 1, m):
                off = _deviation(points, rows[a], rows[b], start, largest_radius)
                if off > tolerance:
                    misses += 1
                    if misses > 3:              # the deviation may dip back only shortly
                        break
                    continue
                arrived = _end_heading(points, rows[a], rows[b], start, largest_radius)
                e = _wrapped(arrived - headings[rows[b]])
                # a tie-break keeps deviations small, so that equal counts prefer the better arc
                c = cost[a, s] + 1.0 + 1e-3 * off / tolerance
                if b == m - 1:
                    if abs(e) < 2e-4 and c < best:
                        best = c
                        tail[JOINT], tail[BUCKET], tail[IS_BIARC], tail[MIDDLE_ROW] = a, s, 0, 0
                    continue
                if abs(e) > spread:
                    continue
                t = int((e / spread + 1.0) / 2.0 * (BUCKETS - 1) + 0.5)
                if c < cost[b, t]:
                    cost[b, t] = c
                    error[b, t] = e
                    before[b, t, JOINT], before[b, t, BUCKET] = a, s
            # two arcs that end with the exact heading
            if cost[a, s] + 2.0 < best:
                middle = _biarc_middle(points, headings, rows[a], rows[m - 1], start, tolerance, largest_radius)
                if middle >= 0 and cost[a, s] + 2.0 < best:
                    best = cost[a, s] + 2.0
                    tail[JOINT], tail[BUCKET], tail[IS_BIARC], tail[MIDDLE_ROW] = a, s, 1, middle
    out = np.empty((2 * m, 5))
    if best > 1e17:
        return out[:0]
    return _traced(points, headings, rows, error, before, tail, out, largest_radius)


@njit
def _biarc_middle(points, headings, first, last, start, tolerance, largest_radius):
    """Row of a middle joint on the curve from which a second arc arrives with the curve's end heading.

    An arc from the middle that ends with a given heading is the reversed arc from the end; the two
    must share the middle heading.  The mismatch changes sign along the curve: bisect over its points.
    """
    if last - first < 4:
        return -1
    low, high = first + 1, last - 1
    fl = _middle_mismatch(points, headings, first, low, last, start, largest_radius)
    fh = _middle_mismatch(points, headings, first, high, last, start, largest_radius)
    if fl * fh > 0.0:
        return -1
    while high - low > 1:
        middle = (low + high) // 2
        fm = _middle_mismatch(points, headings, first, middle, last, start, largest_radius)
        if fm * fl > 0.0:
            low, fl = middle, fm
        else:
            high = middle
    if _deviation(points, first, low, start, largest_radius) > tolerance:
        return -1
    arrived = _end_heading(points, first, low, start, largest_radius)
    if _deviation(points, low, last, arrived, largest_radius) > tolerance:
        return -1
    end = _end_heading(points, low, last, arrived, largest_radius)
    if abs(_wrapped(end - headings[last])) > 2e-3:
        return -1
    return low


@njit
def _middle_mismatch(points, headings, first, middle, last, start, largest_radius):
    arrived = _end_heading(points, first, middle, start, largest_radius)
    dx, dy = points[last, X] - points[middle, X], points[last, Y] - points[middle, Y]
    needed = headings[last] + 2.0 * _wrapped(fixed.arctan2(dy, dx) - headings[last])
    return _wrapped(arrived - needed)


@njit
def _traced(points, headings, rows, error, before, tail, out, largest_radius):
    """Follow the chain back from its end and write it forward."""
    a, s = int(tail[JOINT]), int(tail[BUCKET])
    n = 0
    last = rows[len(rows) - 1]
    if tail[IS_BIARC] > 0.5:
        middle = int(tail[MIDDLE_ROW])
        start = headings[rows[a]] + error[a, s]
        arrived = _end_heading(points, rows[a], middle, start, largest_radius)
        put(out[n], (points[middle, X], points[middle, Y], points[last, X], points[last, Y], arrived))
        n += 1
        last = middle
    while True:
        i = rows[a]
        put(out[n], (points[i, X], points[i, Y], points[last, X], points[last, Y], headings[i] + error[a, s]))
        n += 1
        if a == 0:
            break
        last = i
        a, s = before[a, s, JOINT], before[a, s, BUCKET]
    return out[:n][::-1].copy()
