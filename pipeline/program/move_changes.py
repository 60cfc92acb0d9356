"""Two programs compared by their moves as read back, not by lines: what was added, removed, moved and by how much."""

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from cuspline.program.arcs import Arc
from cuspline.program.program import Kind
from cuspline.values import fixed_math as fixed

SAME_MM = 1e-6                  # ends closer than that are the same place
NOT_KNOWN = -float(2 ** 62)      # stands for a coordinate that is not known
POINTS, FINEST_MM = 20_000, 0.02        # along the moves of a place that are held against each other; how close they stand


@dataclass(frozen=True, kw_only=True)
class MoveChange:
    """One place of an operation where two programs differ, moves without a change between them."""

    operation: str
    removed: int                        # moves of the old program
    added: int                          # moves of the new one
    apart_mm: float | None              # how far the cutting moves of one run from those of the other; None: only one has any
    old_lines: tuple[int, int] | None   # of the text, first and last
    new_lines: tuple[int, int] | None
    low_mm: tuple[float, float, float]  # box of the ends, of cuts where there are any, WCS
    high_mm: tuple[float, float, float]

    @property
    def kind(self):
        """added, removed, or moved: the same number of moves otherwise, or replaced."""
        if not self.removed or not self.added:
            return "added" if self.added else "removed"
        return "moved" if self.removed == self.added else "replaced"


@dataclass(frozen=True, eq=False, kw_only=True)
class ProgramChanges:
    """What differs between two programs."""

    changes: tuple[MoveChange, ...]
    refed: dict                         # operation -> (moves that run otherwise in feed or speed, largest change of feed, mm/min)
    old_rows: np.ndarray                # (r,) rows of the old moves that are gone
    new_rows: np.ndarray                # (a,) rows of the new moves that were not there


def program_changes(old, new):
    """ProgramChanges of two PostedMoves; operations are known by their names, moves by where and how they end."""
    names = dict.fromkeys((*_names(old), *_names(new)))
    changes, refed, gone, come = [], {}, [], []
    for name in names:
        rows, others = _rows(old, name), _rows(new, name)
        keys, other_keys = _keys(old, rows), _keys(new, others)
        pairs = matched(keys, other_keys)
        for left, right in _gaps(pairs, len(keys), len(other_keys)):
            changes.append(_change(name, (old, rows[left]), (new, others[right])))
            gone.append(rows[left])
            come.append(others[right])
        if found := _refed(old, rows[[i for i, _ in pairs]], new, others[[j for _, j in pairs]]):
            refed[name] = found
    together = lambda parts: np.concatenate([*parts, np.empty(0, int)]).astype(int)
    return ProgramChanges(changes=tuple(changes), refed=refed, old_rows=together(gone), new_rows=together(come))


def matched(old, new):
    """Pairs (i, j), both ascending, of equal keys: heads and tails first, then keys that stand once on either side, and so on
    between them.

    >>> matched("abcde", "abxde"), matched("abab", "ab"), matched("abc", "bcd")
    ([(0, 0), (1, 1), (3, 3), (4, 4)], [(0, 0), (1, 1)], [(1, 0), (2, 1)])
    """
    found, waiting = [], [(0, len(old), 0, len(new))]
    while waiting:
        i, i_end, j, j_end = waiting.pop()
        while i < i_end and j < j_end and old[i] == new[j]:
            found.append((i, j))
            i, j = i + 1, j + 1
        while i < i_end and j < j_end and old[i_end - 1] == new[j_end - 1]:
            i_end, j_end = i_end - 1, j_end - 1
            found.append((i_end, j_end))
        anchors = _ascending(_once_in_both(old, i, i_end, new, j, j_end))
        if anchors:
            found += anchors
            ends = [(i - 1, j - 1), *anchors, (i_end, j_end)]
            waiting += [(a + 1, c, b + 1, d) for (a, b), (c, d) in zip(ends, ends[1:])]
    return sorted(found)


def _once_in_both(old, i, i_end, new, j, j_end):
    """(i, j) of keys that stand once in either part, by i."""
    there = {}
    for k in range(j, j_end):
        there[new[k]] = -1 if new[k] in there else k
    seen = {}
    for k in range(i, i_end):
        seen[old[k]] = -1 if old[k] in seen else k
    return [(k, there[key]) for key, k in seen.items() if k >= 0 and there.get(key, -1) >= 0]


def _ascending(pairs):
    """The longest part of pairs (ascending in i) that ascends in j too."""
    ends, rows, before = [], [], [-1] * len(pairs)
    for row, (_, j) in enumerate(pairs):
        place = bisect_left(ends, j)
        before[row] = rows[place - 1] if place else -1
        ends[place:place + 1], rows[place:place + 1] = [j], [row]
    chosen, row = [], rows[-1] if rows else -1
    while row >= 0:
        chosen.append(pairs[row])
        row = before[row]
    return chosen[::-1]


def _gaps(pairs, count, other_count):
    """(slice of the old, slice of the new) between pairs, where either holds something."""
    ends = [(-1, -1), *pairs, (count, other_count)]
    for (a, b), (c, d) in zip(ends, ends[1:]):
        if c > a + 1 or d > b + 1:
            yield slice(a + 1, c), slice(b + 1, d)


def _names(moves):
    """Operations in the order in which they begin; "" what comes before the first."""
    return [moves.operations[k] if k >= 0 else "" for k in dict.fromkeys(moves.operation.tolist())]


def _rows(moves, name):
    number = moves.operations.index(name) if name in moves.operations else -1 if not name else None
    return np.flatnonzero(moves.operation == number) if number is not None else np.empty(0, int)


def _keys(moves, rows):
    """What each move does, as bytes: kind, tool, end, axis, of arcs centre, plane and turns."""
    whole = lambda values: np.where(np.isfinite(values), np.round(np.nan_to_num(values) / SAME_MM), NOT_KNOWN).astype(np.int64)
    columns = [moves.kind[rows, None], moves.tool[rows, None], whole(moves.end_mm[rows]), whole(moves.center_mm[rows]),
               moves.plane[rows, None] * (moves.kind[rows, None] > Kind.FEED), moves.turns[rows, None], whole(moves.end_axis[rows])]
    table = np.ascontiguousarray(np.hstack([np.asarray(c, np.int64) for c in columns]))
    return [row.tobytes() for row in table]


def _refed(old, rows, new, others):
    """(moves, largest change of feed) of the same moves with another feed or speed; None: there are none."""
    off = np.abs(old.feed_mm_per_min[rows] - new.feed_mm_per_min[others])
    is_other = (off > SAME_MM) | (np.abs(old.spindle_rpm[rows] - new.spindle_rpm[others]) > SAME_MM)
    return (int(is_other.sum()), float(off.max())) if is_other.any() else None


def _change(name, old, new):
    """MoveChange of rows that match nothing on the other side."""
    ends = np.vstack([moves.end_mm[rows] for moves, rows in (old, new)])
    cuts = np.concatenate([moves.kind[rows] != Kind.RAPID for moves, rows in (old, new)])
    known = np.nan_to_num(ends[cuts] if cuts.any() else ends)
    lines = [(int(m.line[r].min()), int(m.line[r].max())) if len(r) else None for m, r in (old, new)]
    return MoveChange(operation=name, removed=len(old[1]), added=len(new[1]), apart_mm=_apart_mm(old, new), old_lines=lines[0],
                      new_lines=lines[1], low_mm=tuple(known.min(axis=0).tolist()), high_mm=tuple(known.max(axis=0).tolist()))


def _apart_mm(old, new):
    """Largest distance from a point along the cutting moves of one to the nearest of the other's; None: one has none."""
    cuts = [(m, r[(m.kind[r] != Kind.RAPID) & np.isfinite(m.start_mm[r]).all(axis=1)]) for m, r in (old, new)]
    if not all(len(rows) for _, rows in cuts):
        return None
    length = sum(float(np.linalg.norm(m.end_mm[r] - m.start_mm[r], axis=1).sum()) for m, r in cuts)
    every_mm = max(length / POINTS, FINEST_MM)
    a, b = (np.vstack([points_along(m, row, every_mm) for row in rows.tolist()]) for m, rows in cuts)
    return float(max(cKDTree(a).query(b)[0].max(), cKDTree(b).query(a)[0].max()))


def points_along(moves, row, every_mm):
    """(k, 3) points of a move, its start and end among them, no farther apart than a length, WCS."""
    start, end = moves.start_mm[row], moves.end_mm[row]
    if moves.kind[row] <= Kind.FEED:
        count = max(int(np.ceil(fixed.length(end - start) / every_mm)), 1)
        return start + np.linspace(0, 1, count + 1)[:, None] * (end - start)
    arc = Arc.of_posted(moves, row)
    sweep_rad = arc.sweep_rad + 2 * np.pi * int(moves.turns[row])
    count = max(int(np.ceil(sweep_rad * arc.radius_mm / every_mm)), 1)
    return np.array([arc.at(k / count * sweep_rad / arc.sweep_rad) for k in range(count)] + [end])
