r"""Engravings as posted: place, depth and width of each groove, out of the moves that were read and the tools' own shapes.

    \   /      The design's solid has no groove.  The faces are judged by the same moves raised by the depth, so that the tip runs
     \ /       on the face where it ran in it: what goes deeper still gouges.  The groove is judged here: the tip is to be on its
      V        line all along, the whole line is to be run, and the cutter is to be as wide there as was planned.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from cuspline.program.program import Kind
from cuspline.replay.replay_checks import Reporter
from cuspline.values.findings import Finding

SPACING_MM = 0.1            # of places along lines and moves
GAP_MM = 0.12               # between places of a move, that is no gap in the groove


@dataclass(frozen=True, eq=False, kw_only=True)
class _Line:
    """Places along all lines of an engraving, with the segment each belongs to; the setup's WCS."""

    places: np.ndarray      # (n, 3)
    begin: np.ndarray       # (n, 3) of its segment
    end: np.ndarray         # (n, 3)

    def nearest(self, points):
        """((n,) distance in plan, (n,) height of points over the line)."""
        _, rows = cKDTree(self.places[:, :2]).query(points[:, :2], k=3)
        best = np.full(len(points), np.inf)
        over = np.zeros(len(points))
        for k in range(rows.shape[1]):
            a, way = self.begin[rows[:, k]], self.end[rows[:, k]] - self.begin[rows[:, k]]
            long = np.maximum((way[:, :2] ** 2).sum(axis=1), 1e-18)
            foot = a + np.clip(((points - a)[:, :2] * way[:, :2]).sum(axis=1) / long, 0.0, 1.0)[:, None] * way
            away = np.sqrt(((points - foot)[:, :2] ** 2).sum(axis=1))
            over = np.where(away < best, points[:, 2] - foot[:, 2], over)
            best = np.minimum(best, away)
        return best, over


def raised(posted, rises):
    """PostedMoves with the moves of some operations higher: of engravings by their depth, so that the tip runs on the face.

    Args:
        rises: [(name of an operation, mm)].
    """
    by = np.zeros(len(posted))
    for name, mm in rises:
        by[rows_of(posted, name)] = mm
    up = by[:, None] * np.array([0.0, 0.0, 1.0])
    return replace(posted, start_mm=posted.start_mm + up, end_mm=posted.end_mm + up, center_mm=posted.center_mm + up)


def engraving_findings(posted, setup, engravings, tools):
    """Findings about grooves of one setup.

    Args:
        posted: PostedMoves, as they are.   setup: design.Setup.   engravings: design.engravings.Engraving values of it.
        tools: {number: cutters.Tool}.
    """
    report = Reporter(posted, setup.name, setup.frame)
    return tuple(f for one in engravings for f in _found(posted, setup, one, tools, report))


def rows_of(posted, operation):
    """Numbers of the moves of an operation, by its name."""
    names = [k for k, name in enumerate(posted.operations) if name == operation.lower()]
    return np.flatnonzero(np.isin(posted.operation, names))


def _found(posted, setup, one, tools, report):
    line, rows = _line_of(one, setup.frame), rows_of(posted, one.operation)
    rows = rows[posted.kind[rows] != Kind.RAPID]
    places, row = _places(posted, rows)
    in_face = places[:, 2] < line.places[:, 2].max() + one.depth_mm - one.within_mm
    places, row = places[in_face], row[in_face]
    if len(places):
        away, over = line.nearest(places)
        down = posted.start_mm[row, :2] == posted.end_mm[row, :2]         # straight down: its end alone is on the line
        over = np.where(down.all(axis=1), np.minimum(over, 0.0), over)
        if away.max() > one.within_mm:
            k = int(away.argmax())
            yield report.finding("engraving_beside", row[k], round(float(away[k]), 6), places[k],
                                 "the groove's line is elsewhere: correct the move, or the line that is stated")
        off = np.where(away <= max(one.within_mm, SPACING_MM), np.abs(over), 0.0)
        if off.max() > one.within_mm:
            k = int(off.argmax())
            yield report.finding("engraving_depth", row[k], round(float(off[k]), 6), places[k],
                                 f"the groove is too {'deep' if over[k] < 0 else 'shallow'}: {one.depth_mm:g} mm are stated")
        yield from _wide(one, tools, report, row, places, posted)
    yield from _missing(one, setup, line, places)


def _wide(one, tools, report, row, places, posted):
    for number in np.unique(posted.tool[row]).tolist():
        width = tools[number].cutter.groove_width_mm(one.depth_mm) if number in tools else None
        if width is None or abs(width - one.width_mm) > 2 * one.within_mm:
            k = int(np.flatnonzero(posted.tool[row] == number)[0])
            said = "no groove" if width is None else f"a groove of {width:.4g} mm"
            yield report.finding("engraving_width", row[k], round(abs((width or 0.0) - one.width_mm), 6), places[k],
                                 f"T{number} makes {said}, {one.width_mm:.4g} mm are stated: take the cutter that was planned")


def _missing(one, setup, line, places):
    """What of the line no move runs along."""
    far = cKDTree(places).query(line.places)[0] if len(places) else np.full(len(line.places), np.inf)
    gone = far > GAP_MM + one.within_mm
    if gone.any():
        place = setup.frame.out(line.places[[int(far.argmax())]])[0]
        yield Finding(kind="engraving_missing", amount_mm=round(float(gone.sum()) * SPACING_MM, 3), operation=one.operation, line=0,
                      place_mm=tuple(place.round(6).tolist()), setup=setup.name,
                      advice="so much of the line is not engraved: put the moves back, or take it out of what is stated")


def _line_of(one, frame):
    parts = []
    for points in one.lines:
        p = frame.into(np.array(points))
        parts += [_along(a, b) for a, b in zip(p, p[1:])]
    return _Line(**{name: np.vstack([part[k] for part in parts]) for k, name in enumerate(("places", "begin", "end"))})


def _along(a, b):
    """(places, begin, end), a row a place."""
    count = max(1, int(np.ceil(np.sqrt(((b - a) ** 2).sum()) / SPACING_MM)))
    places = a + (np.arange(count + 1) / count)[:, None] * (b - a)
    return places, np.repeat(a[None], count + 1, axis=0), np.repeat(b[None], count + 1, axis=0)


def _places(posted, rows):
    """((n, 3) places along moves, straight ways for arcs' chords, (n,) their rows)."""
    if not len(rows):
        return np.zeros((0, 3)), np.zeros(0, int)
    parts = [_along(posted.start_mm[k], posted.end_mm[k])[0] for k in rows.tolist()]
    return np.vstack(parts), np.repeat(rows, [len(p) for p in parts])
