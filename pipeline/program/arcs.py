"""Arcs and helices of the Program: points along them, chords in their place."""

import math

import numpy as np

from cuspline.program.program import Kind, Moves, Plane
from cuspline.values import fixed_math as fixed

ROUNDING_MM = 1e-9      # between an arc's two radii
CHORD_SHARE = 0.25      # of the path tolerance, that chords may take where no plane of the control's holds an arc


class Arc:
    """Points along an arc or helix of the Program, or a spiral, as a control runs ends of two radii.

    >>> Arc((1, 0, 0), (0, 2, 8), (0, 0, 0), Plane.XY, Kind.ARC_CCW, turns=1).at(0.2).round(9).tolist()
    [0.0, 1.2, 1.6]
    """

    def __init__(self, start_mm, end_mm, center_mm, plane, kind, turns=0):
        """`turns`: whole ones beside the arc."""
        self.start_mm, self.end_mm, self.center_mm, self.plane = start_mm, np.asarray(end_mm), center_mm, plane
        a, b, _ = plane.axes
        x, y = start_mm[a] - center_mm[a], start_mm[b] - center_mm[b]
        u, v = end_mm[a] - center_mm[a], end_mm[b] - center_mm[b]
        self.radius_mm, self.from_rad = math.hypot(x, y), fixed.arctan2(y, x)
        self.side = -1.0 if kind == Kind.ARC_CW else 1.0
        wider_mm = math.hypot(u, v) - self.radius_mm
        self.wider_mm = wider_mm if abs(wider_mm) > ROUNDING_MM else 0.0        # at its end than at its start
        sweep = self.side * (fixed.arctan2(v, u) - self.from_rad) % (2 * math.pi)
        self.sweep_rad = (sweep if sweep > 1e-9 else 2 * math.pi) + 2 * math.pi * turns

    @classmethod
    def of_posted(cls, moves, row):
        """Of a row of PostedMoves; whole turns beside it are not counted."""
        return cls(moves.start_mm[row], moves.end_mm[row], moves.center_mm[row], Plane(moves.plane[row]), moves.kind[row])

    def at(self, share):
        """Point after a share of the sweep."""
        a, b, third = self.plane.axes
        angle = self.from_rad + self.side * share * self.sweep_rad
        point, radius_mm = np.empty(3), self.radius_mm + share * self.wider_mm
        point[a] = self.center_mm[a] + radius_mm * fixed.cos(angle)
        point[b] = self.center_mm[b] + radius_mm * fixed.sin(angle)
        point[third] = self.start_mm[third] + share * (self.end_mm[third] - self.start_mm[third])
        return point

    def chords(self, tolerance_mm):
        """End points of the chords that stay within the tolerance, the arc's own end last."""
        radius_mm = max(self.radius_mm, self.radius_mm + self.wider_mm)
        largest = 2 * fixed.arccos(max(1 - tolerance_mm / max(radius_mm, tolerance_mm), 0.0))
        count = math.ceil(self.sweep_rad / largest)
        return [self.at(k / count) for k in range(1, count)] + [self.end_mm]


def lowest_z_mm(moves):
    """The lowest tip of moves, arcs between their ends too.

    >>> from cuspline.program.program import MoveWriter
    >>> half = MoveWriter((-3, 0, 0)); half.arc((3, 0, 0), (0, 0, 0), Plane.ZX, True, 100); half.feed((9, 0, -1), 100)
    >>> lowest_z_mm(half.moves()), lowest_z_mm(half.moves()) == -3
    (-3.0, True)
    """
    lowest, starts = min(float(moves.start_mm[2]), float(moves.end_mm[:, 2].min(initial=np.inf))), moves.starts_mm
    for k in np.flatnonzero((moves.kind >= Kind.ARC_CW) & (moves.plane != Plane.XY)).tolist():
        plane = Plane(moves.plane[k])
        arc = Arc(starts[k], moves.end_mm[k], moves.center_mm[k], plane, moves.kind[k])
        down = math.pi if plane == Plane.ZX else -math.pi / 2
        if arc.side * (down - arc.from_rad) % (2 * math.pi) < arc.sweep_rad:
            lowest = min(lowest, float(moves.center_mm[k, 2]) - arc.radius_mm)
    return lowest


def straightened(moves, tolerance_mm):
    """The same moves with chords in place of arcs, and the row (n,) with which each of the moves begins among them.

    No chord is farther than the tolerance (mm) from its arc.

    >>> from cuspline.program.program import MoveWriter
    >>> half = MoveWriter((1, 0, 0)); half.arc((-1, 0, 0), (0, 0, 0), Plane.XY, False, 100)
    >>> chords, first = straightened(half.moves(), 0.01)
    >>> len(chords), float(np.abs(np.hypot(*chords.end_mm[:, :2].T) - 1).max()) < 1e-12, first.tolist()
    (12, True, [0])
    """
    is_arc, starts = moves.kind >= Kind.ARC_CW, moves.starts_mm
    ways = {k: Arc(starts[k], moves.end_mm[k], moves.center_mm[k], Plane(moves.plane[k]), moves.kind[k]).chords(tolerance_mm)
            for k in np.flatnonzero(is_arc).tolist()}
    counts = np.ones(len(moves), int)
    counts[is_arc] = [len(way) for way in ways.values()]
    row, first = np.repeat(np.arange(len(moves)), counts), np.cumsum(counts) - counts
    end_mm = moves.end_mm[row]
    for k, way in ways.items():
        end_mm[first[k]:first[k] + len(way)] = way
    return Moves(start_mm=moves.start_mm, kind=np.where(is_arc, Kind.FEED, moves.kind)[row], end_mm=end_mm,
                 center_mm=np.full((len(row), 3), np.nan), plane=np.full(len(row), Plane.XY), axis=moves.axis[row],
                 feed_mm_per_min=moves.feed_mm_per_min[row]), first
