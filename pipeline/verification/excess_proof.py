"""The proof that no place between samples stands higher than what was found: faces halved into cells until all are cut.

A face moved out along its normals by a height lies all in what was cut away: then the stock stands no higher anywhere,
measured along the normals as deviations are.  The height is a little more than the highest place known (SHARE of it and
SLACK_MM, but no more than SLACK_MM above what is allowed, nor less than LEAST_SHARE of it).  The faces are cells, each a
parallelogram and what the true
piece is off it; a cell is cut away if a mean of distances to pieces of path says so (excess_kernels.py), or if all of
its parts are.  A middle that is not cut away is a place that stands higher: it raises the height, or is excess.

What is left without a proof, and counted: cells whose middle is excess, or cannot be reached; cells as small as
FLOOR_MM, which lie at rims where passes end with the face, round excess, at poles, and where what two clampings have
cut meets (each is asked alone).  A plane that no stock as delivered stands above needs no cut.  A proof knows every
cutter: of a ball cutter that turns its ball, of others what is nearly convex of each sub-step (excess_kernels.py).
Pieces of path lie off the posted path by its `error_mm`.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.stock.swept import SweptPath, world_of
from cuspline.surfaces.face_pieces import halves, in_face_parameters
from cuspline.surfaces.sampling import served_pieces
from cuspline.values.frames import Frame
from cuspline.verification.excess_kernels import ABOVE, ROOM, prove_roots

SHARE = 0.01              # the height proven is higher than the highest place known by this share
SLACK_MM = 1e-4           # and by this
LEAST_SHARE = 0.1         # of what is allowed, that is always proven: a drilled wall stands 0 high, and less costs most
ROOT_MM = 0.4             # reach of the first cells
BORDER_MM = 0.1           # cells whose middle cannot be reached are not halved below this
SPLIT_MM = 0.02           # cells of which one clamping has cut a part and another the rest are not halved below this
NOISE_MM = 1e-6           # a height is exceeded only by more than this
ROUNDS = 60               # of raising the height, and of halving what cannot be reached
BATCH = 4000              # roots that there is room for at a time
MOST_AT_RIMS = 4096       # of the cells given up as too small, whose heights are looked at: they lie side by side
REASONS = ("excess", "unreachable", "rim", "inside")


@dataclass(frozen=True, eq=False, kw_only=True)
class ExcessProof:
    """What is proven of the stock on some faces, part coordinates."""

    height_mm: float          # no place stands higher, but for the areas below; NaN: nothing was cut, nothing proven
    cells: int                # looked at
    unproven_mm2: dict        # reason -> area, at most: see REASONS
    higher_mm: np.ndarray     # (n, 3) places that stand higher than allowed
    amount_mm: np.ndarray     # (n,) how high they stand

    @classmethod
    def of_nothing(cls, area_mm2):
        """Where nothing was cut, all of an area is unproven."""
        return cls(height_mm=np.nan, cells=0, higher_mm=np.zeros((0, 3)), amount_mm=np.zeros(0),
                   unproven_mm2={**dict.fromkeys(REASONS, 0.0), "inside": area_mm2})

    def as_dict(self):
        """For verify.json."""
        return {"cells": self.cells, "unproven_mm2": self.unproven_mm2, "not_covered": []}

    @property
    def is_complete(self):
        """All is proven that can be reached and is no excess."""
        return bool(np.isfinite(self.height_mm)) and not self.unproven_mm2["rim"] and not self.unproven_mm2["inside"]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Cells:
    """Cells of patches; some were given up.  What was asked of a middle stays known: other cuts give most cells back whole."""

    patch: np.ndarray         # (n,)
    box: np.ndarray           # (n, 4)
    reason: np.ndarray        # (n,) ABOVE or FLOOR
    is_rim: np.ndarray        # (n,) bool
    area_mm2: np.ndarray      # (n,)
    fair: np.ndarray          # (n,) 1 its middle can be reached, 0 it cannot; NaN not asked
    height_mm: np.ndarray     # (n,) how high its middle stands; NaN not asked

    def __len__(self):
        return len(self.patch)

    def only(self, rows):
        """The chosen ones."""
        return _Cells(**{name: value[rows] for name, value in self.__dict__.items()})

    @classmethod
    def joined(cls, parts):
        """Several one after the other."""
        return cls(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in cls.__dataclass_fields__})

    def halved(self):
        """Twice as many, cut across the wider side in parameters as often as across the other."""
        wide = self.box[:, 3] - self.box[:, 2] >= self.box[:, 1] - self.box[:, 0]
        patch, box = halves(self.patch, self.box, wide.astype(int))
        twice, unknown = lambda a: np.concatenate([a, a]), np.full(len(patch), np.nan)
        return _Cells(patch=patch, box=box, reason=twice(self.reason), is_rim=twice(self.is_rim),
                      area_mm2=twice(self.area_mm2 / 2), fair=unknown, height_mm=unknown)


def is_bare(faces, blank, allowed_mm):
    """(f,) bool: plane faces of the part that no stock as delivered stands above, anywhere: they need no cut.

    Args:
        faces: brep.Face values.   blank: stock.shapes.Shape in part coordinates.   allowed_mm: see `prove_excess`.
    """
    return np.array([face.kind == "plane" and _above_mm(face.middle, blank) <= LEAST_SHARE * allowed_mm for face in faces], bool)


def _above_mm(place, blank):
    """How high a shape stands above the plane through a face's place, along its normal."""
    frame = Frame.along(place.normal[0])
    return float(blank.box_in(frame)[1][2] - frame.into(place.point_mm)[0, 2])


def prove_excess(ground, cuts, known_mm, allowed_mm, deviation_of, is_reachable, bare=None):
    """Prove that no reachable place of some faces stands higher than what is known and allowed.

    Args:
        ground: climbing.Ground of the faces.
        cuts: workpiece.Cut values that may have cut them, the one that probably did first, each with paths.
        known_mm: a height that is known to be reached, scalar >= 0.   allowed_mm: higher places are excess.
        deviation_of: function of points and normals (n, 3), part coordinates, to exact deviations (n,).
        is_reachable: function of the same and faces (n,) to (n,) bool.
        bare: (f,) bool of `is_bare`; None: no face is.
    Returns:
        ExcessProof.
    """
    known = [replace(c, paths=tuple(map(_of_balls, c.paths))) for c in cuts]
    asked = np.arange(len(ground.domains)) if bare is None else np.flatnonzero(~bare)
    return _Search(ground, asked, allowed_mm, deviation_of, is_reachable).run(known, min(known_mm, allowed_mm))


def _of_balls(path):
    """A path; of a ball whose axis turns that of its ball, whose sub-steps are convex."""
    return path if isinstance(path, SweptPath) or path.is_steady else path.of_its_ball() or path


def _some(chosen, most):
    """(n,) bool: of the rows that are chosen every so many-th, no more than so many."""
    rows = np.flatnonzero(chosen)
    out = np.zeros(len(chosen), bool)
    out[rows[::max(1, -(-len(rows) // most))]] = True
    return out


class _Search:
    """One run of the proof."""

    def __init__(self, ground, asked, allowed_mm, deviation_of, is_reachable):
        self.ground, self.asked, self.allowed = ground, asked, allowed_mm
        self.deviation_of, self.is_reachable = deviation_of, is_reachable
        self.cells, self.areas, self.higher = 0, dict.fromkeys(REASONS, 0.0), []

    def run(self, cuts, known_mm):
        self.height = max(self._raised(known_mm), LEAST_SHARE * self.allowed)
        todo = self._roots()
        left = todo.only(slice(0))                          # by all cuts, at this height
        for _ in range(ROUNDS):
            if not len(todo):
                break
            height = self.height
            for cut in cuts:
                todo = self._proven_by(cut, todo)
            wide = (todo.reason == ABOVE) & (todo.area_mm2 > SPLIT_MM ** 2) & (len(cuts) > 1)
            left, todo = _Cells.joined([left, todo.only(~wide)]), todo.only(wide).halved()
            if self.height > height:                        # what was left at less may be proven now
                left, todo = left.only(slice(0)), _Cells.joined([left, todo])
        self._count(_Cells.joined([left, todo]))
        places, amounts = (np.concatenate(column) for column in zip((np.zeros((0, 3)), np.zeros(0)), *self.higher))
        return ExcessProof(height_mm=self.height, cells=self.cells, higher_mm=places, amount_mm=amounts,
                           unproven_mm2={name: round(area, 6) for name, area in self.areas.items()})

    def _raised(self, known_mm):
        """The height to prove where this one is reached."""
        return min((1 + SHARE) * known_mm, self.allowed) + SLACK_MM

    def _roots(self):
        """Cells of all faces that are asked for, to begin with."""
        patches, trims = self.ground.patches, self.ground.trims
        parts = [served_pieces(patches, trims, face, ROOT_MM)[:2] for face in self.asked.tolist()]
        patch, box = (np.concatenate(column) for column in zip((np.zeros(0, int), np.zeros((0, 4))), *parts))
        none, unknown = np.zeros(len(patch)), np.full(len(patch), np.nan)
        return _Cells(patch=patch, box=box, reason=none, is_rim=none.astype(bool), area_mm2=none, fair=unknown, height_mm=unknown)

    def _proven_by(self, cut, todo):
        """Cells that this cut does not prove."""
        world, failed, failed_at = world_of(cut.paths), [], self.height
        frame = np.vstack([cut.frame.rotation, cut.frame.origin_mm])
        for _ in range(ROUNDS if len(todo) else 0):
            given, crowded = self._given_up(frame, world, todo)
            again, rest = self._judged(given)
            failed.append(rest)
            todo = _Cells.joined([crowded.halved(), again])
            if not len(todo) and self.height > failed_at:           # what failed at less may be proven now
                todo, failed, failed_at = _Cells.joined(failed), [], self.height
            if not len(todo):
                break
        return _Cells.joined([*failed, todo])

    def _given_up(self, frame, world, todo):
        """Cells that could not be proven, and roots of too many of them."""
        parts = [self._given_up_of(frame, world, todo.only(slice(k, k + BATCH))) for k in range(0, len(todo), BATCH)]
        return tuple(_Cells.joined(column) for column in zip(*parts))

    def _given_up_of(self, frame, world, todo):
        patches, trims = self.ground.patches, self.ground.trims
        cells, count, out = prove_roots(patches.arrays, trims.arrays, frame, world, todo.patch, todo.box, self.height)
        self.cells += int(cells.sum())
        crowded = count > ROOM
        rows, places = np.nonzero(np.arange(ROOM) < np.where(crowded, 0, count)[:, None])
        found = out[rows, places]
        is_whole = (found[:, :4] == todo.box[rows]).all(axis=1)
        known = lambda values: np.where(is_whole, values[rows], np.nan)
        return _Cells(patch=todo.patch[rows], box=found[:, :4], reason=found[:, 4], is_rim=found[:, 5] > 0, area_mm2=found[:, 6],
                      fair=known(todo.fair), height_mm=known(todo.height_mm)), todo.only(crowded)

    def _judged(self, given):
        """Cells to be tried again, and cells to be left.

        The height rises with every middle: a peak narrower than the smallest cells may have no other within it.
        """
        above, fair = given.reason == ABOVE, self._fair(given)
        rows = np.flatnonzero(fair & (above | _some(~above & fair, MOST_AT_RIMS)))     # along a rim there are very many more
        given = self._measured(given, fair, rows)
        d = np.full(len(given), -np.inf)
        d[rows] = given.height_mm[rows]
        excess = above & fair & (d > self.allowed + NOISE_MM)
        self.higher.append((self._middles(given.only(excess))[0], d[excess]))
        self.areas["excess"] += float(given.area_mm2[excess].sum())
        raises = above & fair & ~excess & (d > self.height - NOISE_MM)
        self.height = max(self.height, self._raised(d[fair & ~excess].max(initial=0.0)))
        again = above & ~fair & (given.area_mm2 > BORDER_MM ** 2)
        self.areas["unreachable"] += float(given.area_mm2[above & ~fair & ~again].sum())
        return (_Cells.joined([given.only(raises), given.only(again).halved()]),
                given.only(~raises & ~excess & (fair | ~above)))

    def _fair(self, cells):
        """(n,) bool: whether the middles of cells can be reached."""
        fair = cells.fair == 1.0
        asked = np.flatnonzero(np.isnan(cells.fair))
        points, normals, face = self._middles(cells.only(asked))
        known = np.isfinite(normals).all(axis=1)
        fair[asked[known]] = self.is_reachable(points[known], normals[known], face[known])
        return fair

    def _measured(self, cells, fair, rows):
        """The same cells, `fair` noted, and how high the middles of some rows stand."""
        height, asked = cells.height_mm.copy(), rows[np.isnan(cells.height_mm[rows])]
        points, normals, _ = self._middles(cells.only(asked))
        height[asked] = self.deviation_of(points, normals)
        return replace(cells, fair=fair.astype(float), height_mm=height)

    def _middles(self, cells):
        """Points and outward normals (n, 3) in the middles of cells, and their faces (n,)."""
        middle = (cells.box[:, ::2] + cells.box[:, 1::2]) / 2
        u, v = in_face_parameters(self.ground.patches, cells.patch, middle[:, 0], middle[:, 1])
        face = self.ground.patches.patch[cells.patch, 0]
        place = self.ground.places(face, u, v)
        return place.point_mm, place.normal, face

    def _count(self, left):
        """Areas of cells that nothing proved."""
        _, normals, _ = self._middles(left)
        fair = self._fair(left) | ~np.isfinite(normals).all(axis=1)
        for name, chosen in (("unreachable", ~fair), ("rim", fair & left.is_rim), ("inside", fair & ~left.is_rim)):
            self.areas[name] += float(left.area_mm2[chosen].sum())
