"""The stock as a height field: a function of (n, 2) places that gives the height of material there, mm.

A box, and what earlier moves have left of it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Kind, Plane
from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_tips_mm, is_held_above
from cuspline.values import fixed_math as fixed

CHORD_MM = 1e-3         # arcs count as chords that lie this close to them
LONGEST_MM = 4.0        # pieces are split for the tree: long ones have loose bounds


def box_stock(min_mm, max_mm):
    """Height field of a box; -inf beside it."""
    low, high = np.array(min_mm, float), np.array(max_mm, float)

    def height_mm(xy_mm):
        inside = ((xy_mm >= low[:2]) & (xy_mm <= high[:2])).all(axis=1)
        return np.where(inside, high[2], -np.inf)

    return height_mm


def stock_after(moves, radius_mm, corner_radius_mm, height_mm):
    """Height field that moves leave of another one.

    Args:
        moves: program.Moves; rapids cut too.
        radius_mm, corner_radius_mm: the cutter, 0 (flat) to radius (ball).
        height_mm: height field before.
    """
    if len(moves) == 0:
        return height_mm
    bottom = swept_by_lines(lines_of_moves(moves), radius_mm, corner_radius_mm)
    return lambda xy_mm: bottom(xy_mm, height_mm(xy_mm))


def swept_by_lines(lines, radius_mm, corner_radius_mm):
    """Lowest of the lowest that the bottom of a cutter comes to along lines.

    The cutter's bottom stands p(d) above its tip.  min over the path of z + p(d) is minus the
    drop-cutter's max over S of S_z - p(d) on the path turned upside down: its pieces are the edges of
    flat triangles, and the answer is exact.

    Args:
        lines: (k, 3) polylines of tips, at least two points in one of them.
        radius_mm, corner_radius_mm: the cutter, 0 (flat) to radius (ball).
    """
    starts, ends = (np.concatenate([line[piece] for line in lines]) for piece in (slice(None, -1), slice(1, None)))
    counts = np.maximum(np.ceil(np.linalg.norm(ends - starts, axis=1) / LONGEST_MM), 1).astype(int)
    row = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    at = lambda k: (starts[row] + (k / counts[row])[:, None] * (ends - starts)[row]) * np.array([1.0, 1.0, -1.0])
    corners = np.stack([at(number), at(number + 1), at(number + 1)], axis=1).reshape(-1, 3)
    path = DropMesh.from_triangles(corners, np.arange(len(corners)).reshape(-1, 3))
    return Lowest(path=path, radius_mm=radius_mm, corner_radius_mm=corner_radius_mm)


@dataclass(frozen=True, eq=False, kw_only=True)
class Lowest:
    """Height field of the lowest that a cutter's bottom comes to; inf where it never comes."""

    path: DropMesh              # upside down
    radius_mm: float
    corner_radius_mm: float

    def __call__(self, xy_mm, at_most_mm=None):
        """(n,) heights over places (n, 2); asked with heights (n,) too, these where they are lower, found for less."""
        if at_most_mm is None:
            return -drop_tips_mm(self.path, xy_mm, self.radius_mm, self.corner_radius_mm)
        lower, out = self.is_below(xy_mm, at_most_mm), at_most_mm.copy()
        out[lower] = -drop_tips_mm(self.path, xy_mm[lower], self.radius_mm, self.corner_radius_mm)
        return out

    def is_below(self, xy_mm, height_mm):
        """(n,) bool: the bottom comes below heights (n,), which takes far less to tell than how far."""
        return is_held_above(self.path, xy_mm, self.radius_mm, self.corner_radius_mm, -height_mm)


@dataclass(frozen=True, eq=False)
class AnyHeights:
    """As Lowest, of any height field: nothing is told for less."""

    height_mm: Callable         # function of places (n, 2) and heights at most (n,), or one, to heights (n,)

    def __call__(self, xy_mm, at_most_mm=np.inf):
        return self.height_mm(xy_mm, at_most_mm)

    def is_below(self, xy_mm, height_mm):
        """(n,) bool: surely below; here of none."""
        return np.zeros(len(xy_mm), bool)


# of a cutter whose work is not counted on
NOT_COUNTED_ON = AnyHeights(lambda xy_mm, at_most_mm: np.broadcast_to(at_most_mm, len(xy_mm)))


def lines_of_moves(moves):
    """[(n, 3)] points along each move; chords of arcs lie within CHORD_MM."""
    return [points_of_move(moves, k) for k in range(len(moves))]


def points_of_move(moves, k):
    """(n, 3) points along one move, its ends included."""
    start, end = moves.end_mm[k - 1] if k else moves.start_mm, moves.end_mm[k]
    if moves.kind[k] in (Kind.RAPID, Kind.FEED):
        return np.stack([start, end])
    return arc_points(start, end, moves.center_mm[k], Plane(moves.plane[k]), moves.kind[k] == Kind.ARC_CCW, CHORD_MM)


def arc_points(start, end, center, plane, is_left, chord_mm):
    """(n, 3) points along an arc or helix whose chords lie within `chord_mm` of it; equal ends: a full turn."""
    a, b, c = plane.axes
    radius = math.hypot(start[a] - center[a], start[b] - center[b])
    first = fixed.arctan2(start[b] - center[b], start[a] - center[a])
    sweep = (fixed.arctan2(end[b] - center[b], end[a] - center[a]) - first) * (1 if is_left else -1) % (2 * math.pi)
    sweep = sweep if sweep > 1e-9 else 2 * math.pi
    n = max(1, math.ceil(sweep / (2 * fixed.arccos(max(1 - chord_mm / radius, -1.0)))))
    share = np.linspace(0.0, 1.0, n + 1)
    angle = first + (1 if is_left else -1) * share * sweep
    points = np.empty((n + 1, 3))
    points[:, a], points[:, b] = center[a] + radius * fixed.cos(angle), center[b] + radius * fixed.sin(angle)
    points[:, c] = start[c] + share * (end[c] - start[c])
    points[0], points[-1] = start, end
    return points
