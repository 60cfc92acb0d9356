"""First verifier: exact deviations along the design's normals at sample points."""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.stock.path_pieces import ARC, FORM, middles
from cuspline.stock.swept import deviations_and_moves, deviations_of_columns, is_height_field, signed_distance_mm, upright_paths
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.checkpoints import NOTHING
from cuspline.values.clusters import clusters_of
from cuspline.values.known import Known
from cuspline.verification.climbing import Ground, bottoms_of, tops_of
from cuspline.verification.foot_of_walls import SQUARE, between_walls, with_own_cutters
from cuspline.verification.reach import (
    DOWNWARD,
    FINISHABLE,
    REACHABLE,
    REASONS,
    TOO_NARROW,
    is_drilled,
    why_unreachable,
    why_unreachable_leaning,
)
from cuspline.verification.reporter import MISSED_MM2
from cuspline.verification.samples import Samples

LIMIT_MM = 2.0            # deviations are capped here: far more than any tolerance
PER_SPACING2 = 17.0       # samples on a square of one spacing
UNDER_NEAR_MM = 0.5         # of what an undercutting cutter sweeps: places that it was to make
RUNS_OUT_MM = 0.05          # what a corner keeps is as thin somewhere, where it runs out into the wall
LEAST_CORNER_MM = 0.05      # of a cutter without one, whose place in a corner nothing tells
TARGET = 60_000           # samples wanted on one setup: every top and bottom between them is climbed to


@dataclass(frozen=True, eq=False, kw_only=True)
class Residuals:
    """What the stock leaves at each sample, part coordinates.

    Behind the samples stand the tops and bottoms that were climbed to from them; they have no weight.
    """

    samples: Samples
    deviation_mm: np.ndarray      # (n,) positive left, negative gouged
    reach: np.ndarray             # (n,) REACHABLE, or why not
    row: np.ndarray               # (n,) row of the clamping's PostedMoves nearest to the sample; -1 none
    is_own: np.ndarray            # (n,) bool: this clamping's moves made the deviation, no other's
    is_top: np.ndarray            # (n,) bool: climbed to
    spacing_mm: float

    def __post_init__(self):
        n = len(self.samples)
        for name, dtype in (("deviation_mm", float), ("reach", np.int64), ("row", np.int64), ("is_own", bool),
                            ("is_top", bool)):
            object.__setattr__(self, name, frozen(getattr(self, name), (n,), name, dtype))

    @property
    def is_reachable(self):
        return np.isin(self.reach, FINISHABLE)

    @property
    def is_for_balls(self):
        """(n,) bool: a ball gets there, and no wall stands beside."""
        return self.reach == REACHABLE

    def area_mm2(self, mask):
        """Area that the chosen samples stand for."""
        return float(self.samples.weight_mm2[mask].sum())

    def groups(self, mask):
        """Index arrays of connected groups of the chosen samples."""
        chosen = np.flatnonzero(mask)
        return [chosen[g] for g in clusters_of(self.samples.points_mm[chosen], 2 * self.spacing_mm)]


def default_spacing_mm(area_mm2):
    """Sample spacing that gives about TARGET samples, between 0.1 and 2 mm."""
    return float(np.clip(np.sqrt(PER_SPACING2 * area_mm2 / TARGET), 0.1, 2.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledFaces:
    """The faces that one clamping cuts, as they are looked at; part coordinates."""

    samples: Samples
    ground: Ground                # of the same faces
    feeds: np.ndarray             # (m, 3) direction of each of the clamping's moves; zero where not known
    drops: object                 # DropMesh of the design, in the clamping's WCS
    spacing_mm: float             # of the samples
    holes: tuple = ()             # surfaces.holes.Hole of the part in the clamping's WCS, where drills are used
    beside: tuple = ()            # Beside: other positions that cut some of these faces too

    def reach(self, cut, points_mm, normals, face, closest, ball_radius_mm):
        """(n,) REACHABLE, or why no ball of the shop finishes points on faces from here or from a position that cuts them too.

        Args:
            cut: workpiece.Cut of the clamping.   face: (n,) index into the faces; the rest as for `reach_of`.
        """
        reach = reach_of(points_mm, normals, cut, self, closest, ball_radius_mm)
        for other in self.beside:
            rows = np.flatnonzero((reach != REACHABLE) & other.cuts_too[face])
            again = reach_of(points_mm[rows], normals[rows], other.cut, other, closest, ball_radius_mm)
            reach[rows[again == REACHABLE]] = REACHABLE
        return reach


@dataclass(frozen=True, eq=False, kw_only=True)
class Beside:
    """Another indexed position of the same clamping that cuts faces which are judged elsewhere."""

    cut: object                   # workpiece.Cut
    drops: object                 # DropMesh of the design, in its WCS
    cuts_too: np.ndarray          # (f,) bool: which of the faces
    holes: tuple = ()             # of the part there, as in SampledFaces


def residuals(piece, sampled, closest, ball_radius_mm, allowed_mm, gouge_mm, kept=NOTHING):
    """Deviations and reach of all samples, clamping by clamping, and of the tops and bottoms between them.

    Args:
        piece: workpiece.Workpiece after all clampings.
        sampled: SampledFaces of each clamping.
        closest: ClosestTree of the design, part coordinates; needed where cutters undercut or lean.
        ball_radius_mm: smallest ball of the shop.
        allowed_mm: largest deviation of a finished point.
        gouge_mm: deepest that a cut may go, positive.
        kept: kept.Kept for what takes long.
    Returns:
        list of (Residuals of its faces after all clampings, Residuals of all faces after it alone).
    """
    parts, feeds = ([getattr(s, name) for s in sampled] for name in ("samples", "feeds"))
    reach_at = lambda k, own: sampled[k].reach(piece.cuts[k], own.points_mm, own.normals, own.face, closest, ball_radius_mm)
    looked = _Looked.at(piece, parts, reach_at, gouge_mm, kept)
    known = Known()
    stands = lambda j, apart_mm: known.once((j, apart_mm), lambda: _stands(piece.cuts[j], apart_mm))
    more = [_tops(piece, k, looked, feeds, s, stands) for k, s in enumerate(sampled)]
    beyond = _Looked.at(piece, more, reach_at, gouge_mm, kept)
    every = Samples.joined([p for pair in zip(parts, more) for p in pair])
    climbed = np.concatenate([np.full(len(p), flag) for pair in zip(parts, more) for flag, p in zip((False, True), pair)])
    found = []
    for k, (mine, tops) in enumerate(zip(parts, more)):
        join = lambda name: np.concatenate([getattr(looked, name)[k], getattr(beyond, name)[k]], axis=-1)
        alone = lambda name: np.concatenate([getattr(a, name)[j][k] for j in range(len(parts))
                                             for a in (looked, beyond)])
        after_all = Residuals(samples=Samples.joined([mine, tops]), deviation_mm=join("final"), row=join("rows")[k],
                              is_own=join("maker") == k, is_top=np.arange(len(mine) + len(tops)) >= len(mine),
                              reach=join("reach"), spacing_mm=sampled[k].spacing_mm)
        after_all = replace(after_all, reach=with_own_cutters(
            after_all, piece.cuts[k], sampled[k].drops, ball_radius_mm, allowed_mm, piece.cut_distance_mm))
        own = Residuals(samples=every, deviation_mm=alone("each"), row=alone("rows"), is_own=np.ones(len(every), bool),
                        is_top=climbed, reach=np.full(len(every), REACHABLE), spacing_mm=sampled[k].spacing_mm)
        found.append((after_all, own))
    return found


def as_columns(found, piece, above_mm):
    """The same Residuals as if all cutters' flutes were long enough: what stands higher than `above_mm` is asked again.

    So the second verifier takes it, whose heights hold no stock that hangs over a place that was cut.
    """
    rows, deviation = np.flatnonzero(found.deviation_mm > above_mm), found.deviation_mm.copy()
    if len(rows):
        asked = found.samples.points_mm[rows], found.samples.normals[rows], LIMIT_MM
        each, _ = piece.deviations_of_cuts(*asked, deviations_of_columns)
        deviation[rows] = np.minimum(deviation[rows], piece.deviations(*asked, each)[0])
    return replace(found, deviation_mm=deviation)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Looked:
    """Deviations at several Samples, one list entry each."""

    final: list               # (n,) after all clampings
    each: list                # (cuts, n) after each alone
    rows: list                # (cuts, n)
    maker: list               # (n,)
    reach: list               # (n,) in the clamping of the same number

    @classmethod
    def at(cls, piece, parts, reach_at, gouge_mm, kept):
        together = Samples.joined(parts)
        points, normals = together.points_mm, together.normals
        each, rows = piece.deviations_of_cuts(points, normals, LIMIT_MM, kept.of(deviations_and_moves))
        final, maker = piece.deviations(points, normals, LIMIT_MM, each)
        depth = np.array([_at_edges(d, together, c.paths, c.frame, gouge_mm) for d, c in zip(each, piece.cuts)])
        deepest = depth.min(axis=0)     # of any cut alone: two of them, neither too deep, may take a razor's edge between them
        is_edge = together.is_border | ((final < -gouge_mm) & (deepest >= -gouge_mm))
        final = np.where(is_edge, np.maximum(final, deepest), final) if len(piece.cuts) > 1 else deepest
        ends = np.cumsum([len(p) for p in parts])[:-1]
        reach = [reach_at(k, own) for k, own in enumerate(parts)]
        split = lambda a: np.split(a, ends, axis=-1)
        return cls(final=split(final), each=split(depth), rows=split(rows), maker=split(maker), reach=reach)


def reach_of(points_mm, normals, cut, sampled, closest, ball_radius_mm):
    """(n,) why no ball of the shop, nor a drill of the program, could finish points in a clamping.

    Cutters that undercut or lean come from any side.

    Args:
        points_mm, normals: (n, 3) part coordinates.   cut: workpiece.Cut.
        sampled: SampledFaces of the clamping.   closest: of the design, see `residuals`.
        ball_radius_mm: smallest ball of the shop.
    """
    places = cut.frame.into(points_mm)
    if is_height_field(cut.paths):
        reach = why_unreachable(sampled.drops, places, cut.frame.turn_into(normals), ball_radius_mm)
    else:
        reach = why_unreachable_leaning(closest, points_mm, normals, ball_radius_mm)
    under = [p for p in cut.paths if p.tool.cutter.is_undercutting and p.tool.head is None]
    if under and closest is not None:
        reach = _under_necks(points_mm, normals, places, under, closest, reach)
    drills = [p.tool.cutter for p in cut.paths if p.tool.cutter.drills]
    if not drills or not sampled.holes:
        return reach
    return np.where(is_drilled(places, cut.frame.turn_into(normals), sampled.holes, drills), REACHABLE, reach)


def _under_necks(points_mm, normals, places, paths, closest, reach):
    """The same, REACHABLE too where an undercutting cutter has come near and its corner fits; `places`: points in the WCS."""
    reach = reach.copy()
    for path in paths:
        rows = np.flatnonzero(reach != REACHABLE)
        rows = rows[np.abs(signed_distance_mm((path,), places[rows])) < UNDER_NEAR_MM]
        corner = max(path.tool.cutter.corner_radius_mm, LEAST_CORNER_MM)
        reach[rows[why_unreachable_leaning(closest, points_mm[rows], normals[rows], corner) == REACHABLE]] = REACHABLE
    return reach


def _tops(piece, k, looked, feeds, sampled, stands):
    """Samples without weight at the tops of what is left on clamping k's faces, and at the bottoms of all gouges.

    `stands`: function of a clamping's number and a distance that answers as `_stands`.
    """
    final, ground, samples, spacing_mm = looked.final[k], sampled.ground, sampled.samples, sampled.spacing_mm
    beside = lambda j: np.where((looked.rows[k][j] >= 0)[:, None], feeds[j][looked.rows[k][j]], 0.0)
    feed = np.array([beside(j) for j in range(len(feeds))])[looked.maker[k], np.arange(len(samples))]
    left, deep = piece.heights(1.0), piece.heights(-1.0)
    alone = [deep] if len(piece.cuts) == 1 else [piece.only(j).heights(-1.0) for j in range(len(piece.cuts))]
    hills = [(np.where(looked.reach[k] == REACHABLE, final, -np.inf), feed, left), (-final, feed, deep)]
    if len(piece.cuts) > 1:
        hills += [(-looked.each[k][j], beside(j), depths) for j, depths in enumerate(alone)]
    tops = [tops_of(ground, samples.points_mm, samples.face, *hill, spacing_mm) for hill in hills]
    tops += [bottoms_of(ground, samples.points_mm, samples.normals, samples.face, stands(j, spacing_mm), depths, spacing_mm)
             for j, depths in enumerate(alone)]
    face, u, v = (np.concatenate([getattr(t, name) for t in tops]) for name in ("face", "u", "v"))
    places = ground.places(face, u, v)
    good = np.flatnonzero(places.is_regular)
    return Samples(points_mm=places.point_mm[good], normals=places.normal[good], weight_mm2=np.zeros(len(good)),
                   face=face[good], is_border=ground.is_at_rim(face, u, v)[good])


def _stands(cut, apart_mm):
    """Where a clamping's tools have stood: [(tips (n, 3), axis (3,), flat radius, corner radius)], part coordinates.

    Ends of pieces, and the middles of those that are longer than `apart_mm`, but for arcs in vertical planes.
    """
    def tips(g):
        way = g[:, 3:6] - g[:, :3]
        long = (g[:, FORM] != ARC) & ((way * way).sum(axis=1) > apart_mm * apart_mm)
        return np.concatenate([g[:, :3], g[:, 3:6], middles(g[long])])
    return [(cut.frame.out(np.unique(tips(p.geometry), axis=0)), cut.frame.rotation[:, 2], p.flat_radius_mm, p.corner_radius_mm)
            for p in upright_paths(cut.paths) if p.corner_radius_mm > 0]


def _at_edges(deviation, samples, paths, frame, gouge_mm):
    """Deviations with gouges at edges measured another way: as far as the point lies from the nearest material.

    A rim has no one normal: along its face's a hair taken off the face beside it would look as deep as that is high.  Inside a face
    the same holds beside an edge that is thinner than the cut is deep: 0.0005 mm off a razor's edge look as deep as the air behind
    it.  There it counts where it tells that the cutter goes no deeper than it may; where it goes deeper, the normal's is kept.
    """
    out, beyond = deviation.copy(), np.flatnonzero(deviation < np.where(samples.is_border, 0.0, -gouge_mm))
    near = np.minimum(signed_distance_mm(paths, frame.into(samples.points_mm[beyond])), 0.0)
    counts = samples.is_border[beyond] | (near >= -gouge_mm)
    out[beyond] = np.where(counts, np.maximum(out[beyond], near), out[beyond])
    return out


def weighted_percentile(values, weights, share):
    """Smallest value below which at least `share` of the weight lies; 0 without weight."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    if not len(total) or total[-1] <= 0:
        return 0.0
    return float(values[order][np.searchsorted(total, share * total[-1])])


def unreachable_places(found, axis, radius_of):
    """Where no cutter can go: area, box (part coordinates) and reason of each connected group, largest first.

    Inner corners of upright walls have `stays_radius_mm` too, that of the cutter which went round in them.

    Args:
        axis: (3,) the setup's Z, part coordinates.   radius_of: function of a row of PostedMoves to the radius of its cutter.
    """
    places = []
    for reason in (DOWNWARD, TOO_NARROW):
        for group in found.groups(found.reach == reason):
            points = found.samples.points_mm[group]
            middle = points[((points - points.mean(axis=0)) ** 2).sum(axis=1).argmin()]
            stays = _radius_that_stays(found, group, axis, radius_of) if reason == TOO_NARROW else {}
            places.append({"place_mm": middle.round(6).tolist(), "area_mm2": round(float(found.samples.weight_mm2[group].sum()), 6),
                           "min_mm": points.min(axis=0).round(6).tolist(),
                           "max_mm": points.max(axis=0).round(6).tolist(),
                           "reason": REASONS[reason], **stays,
                           "largest_deviation_mm": round(float(found.deviation_mm[group].max()), 6)})
    return sorted(places, key=lambda p: (-p["area_mm2"], p["min_mm"]))


def _radius_that_stays(found, group, axis, radius_of):
    """{"stays_radius_mm": ...} of a group that lies on upright walls too and goes over into what came out in size; else {}: where
    much of it is between walls that face each other more narrowly than that cutter is wide, it is no corner."""
    upright = group[np.abs(fixed.matmul(found.samples.normals[group], np.asarray(axis))) < SQUARE]
    least = upright[found.deviation_mm[upright].argmin()] if len(upright) else -1
    if least < 0 or found.row[least] < 0 or found.deviation_mm[least] > RUNS_OUT_MM:
        return {}
    radius, left = float(radius_of(int(found.row[least]))), upright[found.deviation_mm[upright] > RUNS_OUT_MM]
    facing = between_walls(found.samples.points_mm[left], found.samples.normals[left], 2.0 * radius, found.spacing_mm)
    return {} if found.samples.weight_mm2[left[facing]].sum() >= MISSED_MM2 else {"stays_radius_mm": round(radius, 6)}
