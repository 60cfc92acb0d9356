"""Upper envelope of centre pieces: the lowest height at which the ball cuts into nothing.

Over one `along` coordinate the ball rests on whatever holds it highest.  Valleys narrower than
the ball, swallow tails and loops all lie below that and vanish by themselves; what remains is
trimmed at exact crossings and closed with vertical lines along walls.
"""

import numpy as np

from cuspline.toolpaths.sections.section_pieces import NO_FACE, ArcPiece, LinePiece
from cuspline.values.errors import ToolpathError

GRID_MM = 0.02          # a piece that surfaces between two crossings closer than this may be missed:
                        # its height there is below GRID_MM**2 / (8 r), 0.01 µm for r = 5 mm
RANK_BIAS_MM = 1e-9     # among coinciding pieces lines win over arcs, arcs over sampled curves
JOIN_MM = 1e-6
REPEATED_MM = 1e-7


def upper_envelope(pieces, low, high):
    """The chain of pieces that carries the ball between two along coordinates.

    Args:
        pieces: centre pieces (LinePiece, ArcPiece, CurvePiece), in any order.
        low, high: along range, mm.
    Returns:
        list of pieces from low to high, end to start joined within 1e-6 mm; walls are vertical
        LinePieces (start and end share `along`).
    Raises:
        ToolpathError: somewhere in the range nothing lies beneath the ball.
    """
    pieces = _distinct([p for p in pieces if p.span[1] > low and p.span[0] < high and p.span[1] - p.span[0] > 1e-7])
    marks = np.unique(np.concatenate(
        [np.linspace(low, high, max(2, int((high - low) / GRID_MM) + 1))]
        + [np.clip(p.span, low, high) for p in pieces]))
    marks = marks[np.r_[True, np.diff(marks) > 1e-8]]
    middles = (marks[1:] + marks[:-1]) / 2
    owners = _owners(pieces, middles)
    if (owners < 0).any():
        at = middles[np.argmax(owners < 0)]
        raise ToolpathError(f"nothing to rest on at {at:.3f} mm along the section")
    return _chained(pieces, owners, marks, middles)


def _distinct(pieces):
    """Without repeated arcs: two elements that share a corner roll about it twice, and noise would alternate them."""
    arcs = [k for k, p in enumerate(pieces) if isinstance(p, ArcPiece)]
    if not arcs:
        return pieces
    shape = np.array([(*pieces[k].center, pieces[k].radius, *pieces[k].span, pieces[k].rank) for k in arcs])
    same = (np.abs(shape[:, None] - shape).max(axis=2) < REPEATED_MM) & np.tri(len(arcs), k=-1, dtype=bool)
    repeated = {arcs[row] for row in np.flatnonzero(same.any(axis=1))}
    return [p for k, p in enumerate(pieces) if k not in repeated]


def _owners(pieces, along):
    """Index of the highest piece over each coordinate; -1 where there is none."""
    best = np.full(len(along), -np.inf)
    owner = np.full(len(along), -1)
    for index, piece in enumerate(pieces):
        first, last = np.searchsorted(along, piece.span)
        if first == last:
            continue
        up = piece.up_at(along[first:last]) - piece.rank * RANK_BIAS_MM
        wins = up > best[first:last]
        best[first:last][wins] = up[wins]
        owner[first:last][wins] = index
    return owner


def _chained(pieces, owners, marks, middles):
    """Cut the owners at their crossings and join them, with vertical lines where they jump."""
    changes = np.flatnonzero(np.diff(owners))
    borders = [marks[0]]
    for k in changes:
        borders.append(_border(pieces[owners[k]], pieces[owners[k + 1]], middles[k], middles[k + 1], marks[k + 1]))
    borders.append(marks[-1])
    firsts = np.r_[0, changes + 1]
    chain = []
    for first, low, high in zip(firsts, borders[:-1], borders[1:]):
        if high - low < 1e-9:
            continue
        part = pieces[owners[first]].cut(low, high)
        if chain:
            gap = part.start - chain[-1].end
            if abs(gap[1]) > JOIN_MM:
                wall = LinePiece(start=chain[-1].end, end=np.array([chain[-1].end[0], part.start[1]]), owner=NO_FACE)
                chain.append(wall)
        chain.append(part)
    return chain


def _border(left, right, low, high, mark):
    """Where the envelope passes from one piece to the next, by bisection of their difference.

    Where one of them ends in between and the other lies lower there, the path jumps along a wall.
    """
    low, high = max(low, right.span[0]), min(high, left.span[1])
    if low >= high:
        return mark
    if not _above(left, right, low):
        return low
    if _above(left, right, high):
        return high
    while high - low > 1e-13 * max(1.0, abs(high)):
        middle = (low + high) / 2
        if middle in (low, high):
            break
        if _above(left, right, middle):
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _above(a, b, along):
    return a.up_at(along) > b.up_at(along)
