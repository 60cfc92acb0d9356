"""How far the machine was from the programmed path: lines and exact arcs."""

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Kind, Plane

WIDENING = (2, 20, 200)     # segments on either side of the reported one; wider only where still far


@dataclass(frozen=True, eq=False, kw_only=True)
class MachinePath:
    """The spindle nose's programmed path in machine coordinates, one segment a row."""

    kind: np.ndarray        # (n,) program.Kind
    start_mm: np.ndarray    # (n, 3)
    end_mm: np.ndarray      # (n, 3)
    center_mm: np.ndarray   # (n, 3) NaN on lines
    plane: np.ndarray       # (n,) program.Plane
    turns: np.ndarray       # (n,)
    line: np.ndarray        # (n,)

    def __len__(self):
        return len(self.kind)


def path_of(moves, home_mm):
    """The path of PostedMoves for a machine that stands at home_mm (3,) before the first.

    Segments where nothing moves are left out.
    """
    end = np.vstack([home_mm, moves.machine_end_mm])
    for before, here in zip(end, end[1:]):
        here[np.isnan(here)] = before[np.isnan(here)]
    start, end = end[:-1], end[1:]
    keep = (moves.kind >= Kind.ARC_CW) | (np.abs(end - start).max(axis=1) > 0)
    center = moves.center_mm + (moves.machine_end_mm - moves.end_mm)
    return MachinePath(start_mm=start[keep], end_mm=end[keep], center_mm=center[keep],
                       **{name: getattr(moves, name)[keep] for name in ("kind", "plane", "turns", "line")})


def deviation_mm(position_mm, line, path, near_mm=1e-6):
    """Distance of each sample to the programmed path.

    Looked for near the segment whose line the controller reports, so a neighbouring pass can stand in
    for the true one only where it is less than the largest of WIDENING away, and nearer.
    Args:
        position_mm: (n, 3) samples, in the order they were taken.
        line: (n,) program line of each; lines that do not move count as the segment before.
        path: MachinePath.
        near_mm: a sample this near needs no wider look, which could only bring it nearer.
    Returns:
        (n,) distances, those below near_mm perhaps a little too large.
    """
    at = segments_of(line, path.line)
    best = np.full(len(position_mm), np.inf)
    rows = np.arange(len(position_mm))
    for reach in WIDENING:
        for step in range(-reach, reach + 1):
            segment = np.clip(at[rows] + step, 0, len(path) - 1)
            best[rows] = np.minimum(best[rows], distance_mm(position_mm[rows], path, segment))
        rows = np.flatnonzero(best > near_mm)
    return best


def segments_of(line, path_line):
    """(n,) index of the segment each sample belongs to: the next one with its line.

    A sub-program's line comes again with every call, so the search goes forward only.
    """
    places = {}
    for index, number in enumerate(path_line.tolist()):
        places.setdefault(number, []).append(index)
    begins = np.flatnonzero(np.diff(line, prepend=line[:1] - 1))
    segment, current = np.zeros(len(line), dtype=int), 0
    for begin, end in zip(begins, [*begins[1:], len(line)]):
        of_line = places.get(int(line[begin]), [])
        place = bisect_left(of_line, current)
        current = of_line[place] if place < len(of_line) else current
        segment[begin:end] = current
    return segment


def distance_mm(position_mm, path, segment):
    """(n,) distance of each sample to the segment of that index."""
    out = np.empty(len(segment))
    is_arc = path.kind[segment] >= Kind.ARC_CW
    out[~is_arc] = _line_distance_mm(position_mm[~is_arc], path, segment[~is_arc])
    for plane in Plane:
        rows = np.flatnonzero(is_arc & (path.plane[segment] == plane))
        out[rows] = _arc_distance_mm(position_mm[rows], path, segment[rows], plane.axes)
    return out


def _line_distance_mm(position_mm, path, segment):
    start = path.start_mm[segment]
    along, from_start = path.end_mm[segment] - start, position_mm - start
    share = np.einsum("ij,ij->i", along, from_start) / np.einsum("ij,ij->i", along, along)
    return np.linalg.norm(from_start - np.clip(share, 0, 1)[:, None] * along, axis=1)


def _arc_distance_mm(position_mm, path, segment, axes):
    """Distance to the point of the arc at the sample's own angle; exact off the ends of a flat arc,
    to second order on a helix, where the turn is taken that lies nearest in height."""
    first, second, third = axes
    start, end, center = path.start_mm[segment], path.end_mm[segment], path.center_mm[segment]
    sense = np.where(path.kind[segment] == Kind.ARC_CCW, 1.0, -1.0)

    def polar(point):
        a, b = point[:, first] - center[:, first], point[:, second] - center[:, second]
        return np.hypot(a, b), sense * np.arctan2(b, a)

    (r0, begin), (r1, finish), (_, angle) = polar(start), polar(end), polar(position_mm)
    sweep = (finish - begin) % (2 * np.pi)
    is_closed = (start[:, first] == end[:, first]) & (start[:, second] == end[:, second])
    sweep = np.where(is_closed, 2 * np.pi, sweep) + 2 * np.pi * path.turns[segment]
    rise = end[:, third] - start[:, third]
    best = np.full(len(segment), np.inf)
    for turn in range(-1, int(path.turns[segment].max(initial=0)) + 2):
        share = np.clip(((angle - begin) % (2 * np.pi) + 2 * np.pi * turn) / sweep, 0, 1)
        radius, around = r0 + share * (r1 - r0), sense * (begin + share * sweep)
        nearest = np.empty_like(position_mm)
        nearest[:, first] = center[:, first] + radius * np.cos(around)
        nearest[:, second] = center[:, second] + radius * np.sin(around)
        nearest[:, third] = start[:, third] + share * rise
        best = np.minimum(best, np.linalg.norm(position_mm - nearest, axis=1))
    return best
