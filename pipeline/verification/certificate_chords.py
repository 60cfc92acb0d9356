"""Posted moves as straight lines for the certificate: arcs of every plane, spirals and helices cut into chords."""

from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Kind
from cuspline.stock.path_pieces import Arcs, part_counts, repeated_parts
from cuspline.values.arrays import frozen


@dataclass(frozen=True, eq=False, kw_only=True)
class Chords:
    """Straight moves in the order in which they are cut; millimetres, tips in the WCS."""

    start_mm: np.ndarray        # (m, 3)
    end_mm: np.ndarray          # (m, 3)
    row: np.ndarray             # (m,) row of PostedMoves, growing
    share: np.ndarray           # (m, 2) where on that row's move the chord begins and ends, 0..1
    off_mm: np.ndarray          # (m,) no tip of the move is farther from the chord's tip of the same share; 0 on lines

    def __post_init__(self):
        m = len(self.row)
        for name, shape, dtype in (("start_mm", (m, 3), float), ("end_mm", (m, 3), float), ("row", (m,), np.int64),
                                   ("share", (m, 2), float), ("off_mm", (m,), float)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))


def chords_of(posted, rows, sagitta_mm):
    """Chords of the given moves.

    Args:
        posted: PostedMoves.
        rows: (k,) rows with known start and end, growing.
        sagitta_mm: > 0; no chord lies farther from its arc.
    Raises:
        SimulationError: an arc without a radius, or with ends of clearly different radius.
    """
    rows = np.asarray(rows, dtype=np.int64)
    is_line = (posted.kind[rows] == Kind.RAPID) | (posted.kind[rows] == Kind.FEED)
    lines = rows[is_line]
    parts = [(posted.start_mm[lines], posted.end_mm[lines], lines, np.tile([0.0, 1.0], (len(lines), 1)),
              np.zeros(len(lines)))]
    if not is_line.all():
        parts.append(_chords_of_arcs(Arcs(posted, rows[~is_line]), sagitta_mm))
    start, end, row, share, off = (np.concatenate(column) for column in zip(*parts))
    order = np.argsort(row, kind="stable")
    return Chords(start_mm=start[order], end_mm=end[order], row=row[order], share=share[order], off_mm=off[order])


def _chords_of_arcs(arcs, sagitta_mm):
    """A curve p(angle) leaves its chord over w by at most w^2 / 8 of its largest |p''|: r + 2 |r'| for a spiral."""
    swept = arcs.angle1 - arcs.angle0
    bend = np.maximum(arcs.radius0, arcs.radius1) + 2 * np.abs((arcs.radius1 - arcs.radius0) / swept)
    counts = part_counts(np.abs(swept), np.sqrt(8 * sagitta_mm / bend))
    whole, part = repeated_parts(counts)
    share = np.column_stack([part, part + 1]) / counts[whole, None]
    start, end = (arcs.points(whole, arcs.angle0[whole] + s * swept[whole]) for s in share.T)
    return start, end, arcs.row[whole], share, ((swept / counts) ** 2 / 8 * bend)[whole]
