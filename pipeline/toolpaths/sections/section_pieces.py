"""Curve pieces in a vertical section plane: (along, up) coordinates, along strictly increasing.

The centre of a ball that rolls over a section runs on such pieces: a line over a line, an arc of
radius R + r over a convex arc (R - r in a concave one), a sampled curve over anything else.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen

SAME_MM = 1e-9
PAD_MM = 2e-6           # lifts the ball by PAD_MM**2 / 2 r at most: nothing
STEEP_SLOPE = 300.0     # beyond this a tip reaches on to where the curve would stand upright


@dataclass(frozen=True, eq=False, kw_only=True)
class LinePiece:
    """Straight from start to end."""

    start: np.ndarray       # (2,) along, up
    end: np.ndarray
    owner: int              # face index; NO_FACE for an edge or a corner
    rank = 0                # among coinciding pieces the lower rank is kept

    @property
    def span(self):
        return self.start[0], self.end[0]

    def up_at(self, along):
        t = (along - self.start[0]) / (self.end[0] - self.start[0])
        return self.start[1] + t * (self.end[1] - self.start[1])

    def cut(self, low, high):
        """The part between two along coordinates; the ends stay exact where they coincide."""
        start = self.start if low <= self.start[0] + SAME_MM else np.array([low, self.up_at(low)])
        end = self.end if high >= self.end[0] - SAME_MM else np.array([high, self.up_at(high)])
        return replace(self, start=start, end=end)

    def headings(self):
        """Direction angles at start and end."""
        d = self.end - self.start
        angle = float(fixed.arctan2(d[1], d[0]))
        return angle, angle


@dataclass(frozen=True, eq=False, kw_only=True)
class ArcPiece:
    """Circular arc that runs over the top (`is_over`) or through the bottom of its circle."""

    center: np.ndarray      # (2,)
    radius: float
    start: np.ndarray
    end: np.ndarray
    is_over: bool
    owner: int
    rank: int = 1

    @property
    def span(self):
        return self.start[0], self.end[0]

    def up_at(self, along):
        height = np.sqrt(np.maximum(self.radius ** 2 - (along - self.center[0]) ** 2, 0.0))
        return self.center[1] + (height if self.is_over else -height)

    def cut(self, low, high):
        start = self.start if low <= self.start[0] + SAME_MM else np.array([low, self.up_at(low)])
        end = self.end if high >= self.end[0] - SAME_MM else np.array([high, self.up_at(high)])
        return replace(self, start=start, end=end)

    def headings(self):
        return tuple(self._heading(p) for p in (self.start, self.end))

    def _heading(self, point):
        d = (point - self.center) * (1 if self.is_over else -1)
        return float(fixed.arctan2(-d[0], d[1]))


@dataclass(frozen=True, eq=False, kw_only=True)
class CurvePiece:
    """Exact points and directions, dense enough that cubic Hermite between them is exact to 1e-8 mm."""

    points: np.ndarray      # (n, 2), along strictly increasing
    slopes: np.ndarray      # (n,) d up / d along
    owner: int
    rank: int = 2

    def __post_init__(self):
        object.__setattr__(self, "points", frozen(self.points, (None, 2), "points"))
        object.__setattr__(self, "slopes", frozen(self.slopes, (len(self.points),), "slopes"))

    @property
    def start(self):
        return self.points[0]

    @property
    def end(self):
        return self.points[-1]

    @property
    def span(self):
        return self.points[0, 0], self.points[-1, 0]

    def _local(self, along):
        x = self.points[:, 0]
        i = np.clip(np.searchsorted(x, along, side="right") - 1, 0, len(x) - 2)
        h = x[i + 1] - x[i]
        return i, h, (along - x[i]) / h

    def up_at(self, along):
        i, h, t = self._local(along)
        z, m = self.points[:, 1], self.slopes
        return ((1 + 2 * t) * (1 - t) ** 2 * z[i] + t * (1 - t) ** 2 * h * m[i]
                + t * t * (3 - 2 * t) * z[i + 1] + t * t * (t - 1) * h * m[i + 1])

    def slope_at(self, along):
        i, h, t = self._local(along)
        z, m = self.points[:, 1], self.slopes
        return (6 * t * (1 - t) * (z[i + 1] - z[i]) / h
                + (1 - t) * (1 - 3 * t) * m[i] + t * (3 * t - 2) * m[i + 1])

    def cut(self, low, high):
        x = self.points[:, 0]
        inside = (x > low + SAME_MM) & (x < high - SAME_MM)
        ends = np.array([max(low, x[0]), min(high, x[-1])])
        along = np.concatenate([ends[:1], x[inside], ends[1:]])
        return CurvePiece(points=np.column_stack([along, self.up_at(along)]),
                          slopes=self.slope_at(along), owner=self.owner, rank=self.rank)

    def headings(self):
        return tuple(float(fixed.arctan(s)) for s in (self.slopes[0], self.slopes[-1]))


NO_FACE = -1
EDGE_RANK = 3           # of pieces over edges and corners


def curve_pieces(points, normals, owner, rank=2):
    """Split a sampled centre curve into pieces that run forward in `along`.

    Args:
        points: (n, 2) centre positions in order along the curve (along, up).
        normals: (n, 2) contact normals in the plane; only those that point up (second > 0) count:
            a contact from the side or from below never carries the ball.
        owner: face index.
    Returns:
        list of CurvePiece; runs that fold back (the swallow tails of a too large offset) and
        vertical runs are left out where they have no extent.
    """
    up = normals[:, 1] > 1e-7
    ahead = np.diff(points[:, 0])
    usable = up[:-1] & up[1:] & (np.abs(ahead) > 1e-12)
    direction = np.where(usable, np.sign(ahead), 0.0)
    pieces = []
    for first, last in _runs(direction):
        if direction[first] == 0.0 or abs(points[last, 0] - points[first, 0]) < 1e-7:
            continue
        rows = np.arange(first, last + 1)
        if direction[first] < 0:
            rows = rows[::-1]
        pieces.append(_padded(points[rows], -normals[rows, 0] / normals[rows, 1], owner, rank))
    return pieces


def _padded(points, slopes, owner, rank):
    """A curve piece with straight tips of PAD_MM, so that neighbours overlap instead of leaving a slit."""
    tips = []
    for point, slope, sign, before in ((points[0], slopes[0], -1, 1), (points[-1], slopes[-1], 1, -2)):
        step = sign * max(PAD_MM / fixed.hypot(1.0, slope),
                          _left_to_upright(abs(points[before, 0] - point[0]), slopes[before], slope))
        tips.append(point + np.array([step, slope * step]))
    return CurvePiece(points=np.vstack([tips[0], points, tips[1]]),
                      slopes=np.r_[slopes[0], slopes, slopes[-1]], owner=owner, rank=rank)


def _left_to_upright(run, before, slope):
    """Along distance from a steep end to where a circle through its last two headings stands upright."""
    if abs(slope) < STEEP_SLOPE or abs(before) >= abs(slope):
        return 0.0
    return 1.2 * run / ((slope / before) ** 2 - 1.0)


def _runs(values):
    """(first, last+1) point ranges of equal consecutive segment values."""
    if len(values) == 0:
        return []
    cuts = np.flatnonzero(np.diff(values)) + 1
    return list(zip(np.r_[0, cuts], np.r_[cuts, len(values)]))


def half_circle(center, radius, owner):
    """The upper half circle of the ball's centre about a point it rolls over."""
    center = np.asarray(center, float)
    side = np.array([radius, 0.0])
    return ArcPiece(center=center, radius=float(radius), start=center - side, end=center + side,
                    is_over=True, owner=owner, rank=EDGE_RANK)
