r"""Broken edges as posted: how wide each break is all along, and that its cutter gouges nothing beside it.

     r(z) .___      The design's solid is sharp there.  The faces are judged by the same moves raised by the break's leg, so that
     \    |  /      the cone runs through the edge: what goes deeper still gouges.  The break is judged here, out of the moves that
      \ d | /___    were read and the cutter's own cone: at a place of the edge the leg in the level face is r(z) - d.
       \__|/'|      Then the moves as they are, held against places of all faces but those beside the edges themselves.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from cuspline.program.arcs import Arc
from cuspline.program.program import Kind
from cuspline.replay.replay_checks import Reporter
from cuspline.surfaces.sampling import samples_of_faces
from cuspline.values.findings import Finding
from cuspline.verification.engraving import rows_of
from cuspline.verification.reporter import rounded

SPACING_MM = 0.02           # of places along moves: a leg at 0.2 mm from the axis is known to 0.25 um
NEAREST = 48                # places of the moves that are looked at for one of an edge
PLACE_MM = 1e-4             # places of moves that are one in plan: the lowest counts
APART_MM = 0.5              # of a stretch that is not broken, at the least, to be one
FACE_MM = 0.3               # between places of faces at which moves are held against them
BESIDE_MM = 0.02            # beyond its legs, that belongs to a break


@dataclass(frozen=True, eq=False, kw_only=True)
class _Cut:
    """Where one pointed cutter's tip went, the setup's WCS."""

    cutter: object              # shop.cutters.Cutter
    tips: np.ndarray            # (n, 3), one a place in plan, the lowest
    rows: np.ndarray            # (n,) of the posted moves

    def sunk_mm(self, points):
        """((n,) how far inside the cone points (n, 3) come, square to its axis; below 0 outside, (n,) place of the tips)."""
        count = min(NEAREST, len(self.tips))
        away, near = cKDTree(self.tips[:, :2]).query(points[:, :2], k=count)
        away, near = away.reshape(len(points), -1), near.reshape(len(points), -1)
        high = points[:, 2, None] - self.tips[near, 2]
        radius = np.minimum(self.cutter.cone_radius_mm(high), self.cutter.radius_mm)
        sunk = np.where((high >= 0) & (high <= self.cutter.flute_length_mm), radius - away, -np.inf)
        best = sunk.argmax(axis=1)
        rows = np.arange(len(points))
        return sunk[rows, best], near[rows, best]


def edge_break_findings(posted, setup, breaks, faces, tools, gouge_mm):
    """(rows of verify.json, findings) about the broken edges of one setup.

    Args:
        posted: PostedMoves, as they are.   setup: design.Setup.   breaks: design.edge_breaks.EdgeBreak values of it.
        faces: all brep.Face values of the part.   tools: {number: cutters.Tool}.   gouge_mm: that the finish allows.
    """
    report, table, found = Reporter(posted, setup.name, setup.frame), [], []
    samples = samples_of_faces(faces, FACE_MM).point_mm if breaks else None
    for one in breaks:
        cuts = _cuts(posted, one, tools)
        row, own = _judged(posted, setup, one, cuts, report)
        table.append(row)
        found += [*own, *_beside(setup, one, cuts, samples, report, gouge_mm)]
    return tuple(table), tuple(found)


def _cuts(posted, one, tools):
    """[_Cut] of the pointed cutters of an operation."""
    rows = rows_of(posted, one.operation)
    rows = rows[posted.kind[rows] != Kind.RAPID]
    out = []
    for number in np.unique(posted.tool[rows]).tolist():
        cutter = tools[number].cutter if number in tools else None
        if cutter is not None and cutter.point_height_mm > 0:
            mine = rows[posted.tool[rows] == number]
            parts = [_places(posted, k) for k in mine.tolist()]
            out.append(_lowest(cutter, np.vstack(parts), np.repeat(mine, [len(p) for p in parts])))
    return out


def _places(posted, row):
    """(n, 3) along one move, its end among them."""
    start, end = posted.start_mm[row], posted.end_mm[row]
    if posted.kind[row] == Kind.FEED:
        count = max(1, math.ceil(math.dist(start, end) / SPACING_MM))
        return start + (np.arange(1, count + 1) / count)[:, None] * (end - start)
    arc = Arc.of_posted(posted, row)
    count = max(1, math.ceil(arc.radius_mm * arc.sweep_rad / SPACING_MM))
    return np.array([*(arc.at(k / count) for k in range(1, count)), end])


def _lowest(cutter, places, rows):
    """_Cut, of places over one another the lowest."""
    order = np.lexsort((places[:, 2], *np.round(places[:, :2] / PLACE_MM).T))
    key = np.round(places[order, :2] / PLACE_MM)
    first = np.r_[True, (np.diff(key, axis=0) != 0).any(axis=1)]
    return _Cut(cutter=cutter, tips=places[order][first], rows=rows[order][first])


def _judged(posted, setup, one, cuts, report):
    """(row of verify.json, [Finding]) of the legs along the lines."""
    edge = np.vstack([setup.frame.into(np.array(line)) for line in one.lines])
    legs, row = np.full(len(edge), -np.inf), np.full(len(edge), -1)
    for cut in cuts:
        sunk, near = cut.sunk_mm(edge)
        leg = np.maximum(sunk, 0.0) * max(1.0, 1.0 / cut.cutter.cone_slope)
        better = leg > legs
        legs, row = np.where(better, leg, legs), np.where(better, cut.rows[near], row)
    legs = np.maximum(legs, 0.0)
    is_broken = legs > one.within_mm
    off = np.where(is_broken, np.abs(legs - one.width_mm), 0.0)
    found = []
    if off.max(initial=0.0) > one.within_mm:
        k = int(off.argmax())
        said = "wide" if legs[k] > one.width_mm else "narrow"
        found.append(report.finding("edge_break_width", row[k], off[k], edge[k], f"the break is {legs[k]:.4g} mm wide, too {said}: "
                                    f"{one.width_mm:g} mm are stated"))
    found += _missing(setup, one, edge, is_broken)
    least, most = (float(legs[is_broken].min()), float(legs[is_broken].max())) if is_broken.any() else (0.0, 0.0)
    return {"setup": setup.name, "operation": one.operation, "width_mm": one.width_mm, "least_mm": rounded(least),
            "most_mm": rounded(most), "places": len(edge), "ok": not found}, found


def _missing(setup, one, edge, is_broken):
    """A finding where a place of a line is not broken at all."""
    if is_broken.all():
        return []
    k = int((~is_broken).argmax())
    return [Finding(kind="edge_break_missing", amount_mm=rounded(one.width_mm), operation=one.operation, line=0,
                    place_mm=tuple(setup.frame.out(edge[[k]])[0].round(6).tolist()), setup=setup.name,
                    advice=f"{(~is_broken).sum()} of {len(edge)} places of the edges are sharp: put the moves back, or leave the "
                           "edges out of the operation")]


def _beside(setup, one, cuts, samples, report, gouge_mm):
    """A finding where a cutter comes into a face elsewhere than beside the edges that it may break."""
    points = setup.frame.into(samples)
    edges = np.vstack([setup.frame.into(np.array(line)) for line in one.edges])
    for cut in cuts:
        low, high = cut.tips.min(axis=0), cut.tips.max(axis=0)
        wide = cut.cutter.radius_mm
        near = ((points[:, :2] > low[:2] - wide) & (points[:, :2] < high[:2] + wide)).all(axis=1) & (points[:, 2] > low[2])
        mine = points[near]
        mine = mine[cKDTree(edges).query(mine)[0] > math.hypot(one.width_mm, APART_MM / 2) + BESIDE_MM] if len(mine) else mine
        if not len(mine):
            continue
        sunk, place = cut.sunk_mm(mine)
        deep = sunk / math.sqrt(1.0 + cut.cutter.cone_slope ** 2)
        flat = mine[:, 2] - cut.tips[place, 2]              # straight down it may be nearer out
        deep = np.where(np.isfinite(sunk), np.minimum(deep, np.maximum(flat, 0.0)), -np.inf)
        k = int(deep.argmax())
        if deep[k] > gouge_mm:
            yield report.finding("gouge", cut.rows[place[k]], deep[k], mine[k], "the cutter that breaks the edges comes into a "
                                 "face beside them: keep its tip higher, or take a slimmer one")
