"""The cusps as they were cut: height at ridges between passes, beside what was wanted and what the formula gives there.

At places spread over the faces a walk across the pass climbs to the ridge beside a sample.  A hair to either side of it
the nearest move is one of the two passes that made it:

      pass a       pass b          step = chord between the contacts of both balls, across the feed
       ( o )        ( o )          formula = planning.stepover with that step, the ball's radius and the face's
         \\__ridge__/              own curvature across
"""

from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Kind, Plane
from cuspline.scallop.stepover import scallop_for_stepover_mm
from cuspline.stock.swept import nearest_moves
from cuspline.stock.tilted import PosedPath
from cuspline.surfaces.projection import refined
from cuspline.values.arrays import frozen
from cuspline.verification.climbing import CELL, CLOSE_MM, FIRST, Ground, Tops, hill_rows, unit, walked
from cuspline.verification.samples import Samples, in_parameters

PLACES = 4000             # ridges that are measured, at most
BESIDE_MM = 5 * CLOSE_MM  # from a ridge to either side
ASIDE = 0.3               # a move that runs across the ridge by more than this share is no pass beside it, but a link
AGREES = 0.10             # share by which formula and measured height may differ and still agree
ROUND_MM = 6


@dataclass(frozen=True, eq=False, kw_only=True)
class Cusps:
    """Ridges, one row each, part coordinates."""

    point_mm: np.ndarray      # (n, 3) on the design
    height_mm: np.ndarray     # (n,) measured
    formula_mm: np.ndarray    # (n,)
    step_mm: np.ndarray       # (n,) between the two passes beside it
    face: np.ndarray          # (n,) place in the solid's faces
    operation: np.ndarray     # (n,) index into the program's operations
    names: tuple[str, ...]    # of the operations

    def __post_init__(self):
        n = len(self.height_mm)
        for name, shape, dtype in (("point_mm", (n, 3), float), ("height_mm", (n,), float), ("formula_mm", (n,), float),
                                   ("step_mm", (n,), float), ("face", (n,), np.int64), ("operation", (n,), np.int64)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))

    def as_rows(self, wanted_mm):
        """One dict a face and operation for verify.json."""
        keys = np.unique(np.column_stack([self.face, self.operation]), axis=0)
        return [self._row(int(f), int(o), np.flatnonzero((self.face == f) & (self.operation == o)), wanted_mm)
                for f, o in keys]

    def _row(self, face, operation, rows, wanted_mm):
        height, formula = self.height_mm[rows], self.formula_mm[rows]
        off = np.abs(height - formula)
        worst = rows[off.argmax()]
        return {"face": face, "operation": self.names[operation] if operation >= 0 else "", "ridges": len(rows),
                "wanted_mm": wanted_mm, "measured_mm": _spread(height), "formula_mm": _spread(formula),
                "step_mm": _spread(self.step_mm[rows]),
                "share_within_10_percent": round(float((off <= AGREES * formula).mean()), 4),
                "differs_most": {"place_mm": self.point_mm[worst].round(ROUND_MM).tolist(),
                                 "by_mm": round(float(off.max()), ROUND_MM),
                                 "measured_mm": round(float(self.height_mm[worst]), ROUND_MM),
                                 "formula_mm": round(float(self.formula_mm[worst]), ROUND_MM)}}


def _spread(values):
    shares = {"p50": 0.5, "p90": 0.9, "p99": 0.99, "max": 1.0}
    return {name: round(float(np.quantile(values, share)), ROUND_MM) for name, share in shares.items()}


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledStock:
    """Samples of the faces of one clamping, with the stock that stands there and the passes beside it; part coordinates."""

    ground: Ground
    samples: Samples
    spacing_mm: float         # of them
    height_mm: np.ndarray     # (n,) of the stock; -inf where no cusp is to be looked for
    feed: np.ndarray          # (n, 3) direction of the pass beside each sample


def measured_cusps(sampled, cut, posted, heights, exact_of, face_numbers):
    """Cusps of the faces of one clamping.

    Args:
        sampled: SampledStock.
        cut: workpiece.Cut.   posted: PostedMoves of the same clamping.
        heights: extremes.CutHeight or AnyHeight, quick.   exact_of: of points and normals, exact along these.
        face_numbers: (f,) of the faces in the solid.
    Returns:
        Cusps; ridges between passes of one ball only.
    """
    ground, samples, spacing_mm = sampled.ground, sampled.samples, sampled.spacing_mm
    rows = hill_rows(samples.points_mm, samples.face, sampled.height_mm, CELL * spacing_mm)
    rows = np.sort(rows)[np.unique(np.linspace(0, len(rows) - 1, PLACES).astype(int))] if len(rows) else rows
    u, v, found = ground.parameters(samples.points_mm[rows], samples.face[rows])
    rows = rows[found]
    begin = Tops(face=samples.face[rows], u=u[found], v=v[found], height_mm=sampled.height_mm[rows])
    across = unit(np.cross(ground.places(begin.face, begin.u, begin.v).normal, sampled.feed[rows]))
    tops = walked(ground, begin, heights, FIRST * spacing_mm, along=across)
    inside = np.flatnonzero(~ground.is_at_rim(tops.face, tops.u, tops.v) & (np.abs(across).sum(axis=1) > 0))
    tops, across = tops.only(inside), across[inside]
    place = ground.places(tops.face, tops.u, tops.v)
    sides = [cut.frame.into(place.point_mm + s * BESIDE_MM * across) for s in (-1, 1)]
    moves = [nearest_moves(cut.paths, p)[1] for p in sides]
    balls = {p.tool.number: p.tool.cutter.radius_mm + _grown_mm(p) for p in cut.paths if p.tool.cutter.type == "ball"}
    tool = posted.tool[moves[0]]
    radius = np.array([balls.get(int(n), 0.0) for n in tool], float)
    centers = [cut.frame.out(centers_mm(posted, m, p, radius)) for m, p in zip(moves, sides)]
    contacts = [refined(ground.patches, tops.face, tops.u, tops.v, c)[2] for c in centers]
    chord = contacts[1] - contacts[0]
    step = np.einsum("nc,nc->n", chord, across)
    before, after = (np.einsum("nc,nc->n", c - place.point_mm, across) for c in contacts)
    ways = [cut.frame.turn_out(unit(posted.end_mm[m] - posted.start_mm[m])) for m in moves]
    runs_along = np.all([np.abs(np.einsum("nc,nc->n", way, across)) < ASIDE for way in ways], axis=0)
    good = np.flatnonzero(runs_along & (tool == posted.tool[moves[1]]) & (before < -CLOSE_MM) & (after > CLOSE_MM)
                          & (step < 2 * radius))
    bend = curvature_across(ground, tops.only(good), across[good])
    formula = np.empty(len(good))
    for r in np.unique(radius[good]):
        same = radius[good] == r
        fits = np.maximum(bend[same], -0.999 / r)
        formula[same] = scallop_for_stepover_mm(r, step[good][same], fits)
    return Cusps(point_mm=place.point_mm[good], height_mm=exact_of(place.point_mm[good], place.normal[good]),
                 formula_mm=formula, step_mm=step[good], face=np.asarray(face_numbers, np.int64)[tops.face[good]],
                 operation=posted.operation[moves[0][good]], names=posted.operations)


def _grown_mm(path):
    """How far the surface of a ball's path lies outside the cutter's."""
    return path.grown_mm if isinstance(path, PosedPath) else path.corner_radius_mm - path.tool.cutter.radius_mm


def centers_mm(posted, rows, points_mm, radius_mm):
    """(n, 3) centre of a ball, on its move, where it is nearest to a point; WCS.  While the axis turns it runs as good as straight.

    Args:
        posted: PostedMoves.   rows: (n,) lines, or arcs whose middle part the point lies beside.
        points_mm: (n, 3).   radius_mm: (n,) of the balls.
    """
    lift = radius_mm[:, None] * posted.start_axis[rows]
    start = posted.start_mm[rows] + lift
    way = posted.end_mm[rows] + radius_mm[:, None] * posted.end_axis[rows] - start
    share = np.einsum("nc,nc->n", points_mm - start, way) / np.maximum(np.einsum("nc,nc->n", way, way), 1e-300)
    out = start + np.clip(share, 0, 1)[:, None] * way
    arc = np.flatnonzero(posted.kind[rows] >= Kind.ARC_CW)
    axes = np.array([Plane(p).axes[:2] for p in range(3)])[posted.plane[rows[arc]]].reshape(-1, 2)
    pick = lambda a: np.take_along_axis(a[arc], axes, axis=1)
    middle = pick(posted.center_mm[rows] + lift)
    about = middle + np.linalg.norm(pick(start) - middle, axis=1)[:, None] * unit(pick(points_mm) - middle)
    rounds = out[arc]
    np.put_along_axis(rounds, axes, about, axis=1)
    out[arc] = rounds
    return out


def curvature_across(ground, tops, directions):
    """(n,) normal curvature in tangent directions (n, 3); positive on a ridge."""
    d = ground.patches.derivatives(tops.face, tops.u, tops.v)
    su, sv, suu, suv, svv = np.moveaxis(d[:, 1:], 1, 0)
    dot = lambda a, b: np.einsum("nc,nc->n", a, b)
    normal = unit(np.cross(su, sv)) * ground.patches.sign[tops.face][:, None]
    du, dv = in_parameters(directions, su, sv).T
    first = dot(su, su) * du * du + 2 * dot(su, sv) * du * dv + dot(sv, sv) * dv * dv
    second = dot(suu, normal) * du * du + 2 * dot(suv, normal) * du * dv + dot(svv, normal) * dv * dv
    return -second / np.maximum(first, 1e-300)

