"""A billet and every cut made in it, whatever clamping it took: the in-process stock, exact at any point.

Stock = billet minus what each clamping's cutters swept.  Each clamping answers in its own WCS; here the answers meet
in part coordinates.
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from cuspline.stock.swept import deviations_and_moves, nearest_moves, stock_height_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import SimulationError
from cuspline.values.frames import Frame

SAME_MM = 1e-7            # a depth found again deeper by less is the same
UNCUT = -1
LEAST_PARALLEL = fixed.cos(np.radians(10.0))      # a box round a billet further askew would be all air


@dataclass(frozen=True, eq=False, kw_only=True)
class Cut:
    """What one clamping's moves sweep."""

    frame: Frame              # its WCS seen from the part
    paths: tuple              # of swept.SweptPath, WCS


@dataclass(frozen=True, eq=False, kw_only=True)
class Workpiece:
    """Part coordinates."""

    min_mm: np.ndarray        # (3,) billet
    max_mm: np.ndarray
    cuts: tuple[Cut, ...] = ()

    def __post_init__(self):
        for name in ("min_mm", "max_mm"):
            object.__setattr__(self, name, frozen(getattr(self, name), (3,), name))

    def after(self, frame, paths):
        """The same after one more clamping."""
        return Workpiece(min_mm=self.min_mm, max_mm=self.max_mm, cuts=(*self.cuts, Cut(frame=frame, paths=tuple(paths))))

    def box_in(self, frame):
        """(3,) low and (3,) high corner of the billet seen from a frame; of a box round it where it stands askew.

        Raises:
            SimulationError: it stands so far askew that a box round it says nothing.
        """
        if np.abs(frame.rotation).max(axis=0).min() < LEAST_PARALLEL:
            raise SimulationError("the stock box is not parallel to the WCS: its sides must follow the setup's axes, "
                                  f"within {np.degrees(fixed.arccos(LEAST_PARALLEL)):.0f} degrees")
        return frame.box_into(self.min_mm, self.max_mm)

    def cut_distance_mm(self, points_mm):
        """(n,) signed distance to everything cut away: positive where material is left; the billet does not count."""
        found = [nearest_moves(c.paths, c.frame.into(points_mm))[0] for c in self.cuts]
        return np.min([np.full(len(points_mm), np.inf), *found], axis=0)

    def is_stock(self, points_mm):
        """(n,) bool: within the billet, and not cut away."""
        inside = ((points_mm > self.min_mm) & (points_mm < self.max_mm)).all(axis=1)
        return inside & (self.cut_distance_mm(points_mm) > 0)

    def deviations_of_cuts(self, points_mm, normals, limit_mm, ask=deviations_and_moves):
        """Deviations (cuts, n) and rows of PostedMoves (cuts, n) that each clamping alone would leave.

        `ask` is swept.deviations_and_moves, or answers as it would.
        """
        found = [ask(c.paths, *self.box_in(c.frame), c.frame.into(points_mm), c.frame.turn_into(normals), limit_mm)
                 for c in self.cuts]
        empty = np.zeros((0, len(points_mm)))
        return np.array([empty, empty.astype(np.int64)]) if not found else tuple(np.array(c) for c in zip(*found))

    def deviations(self, points_mm, normals, limit_mm, of_cuts=None):
        """Signed deviation of the stock along normals after all clampings, and which of them made it.

        Positive: length along +normal until the ray leaves the stock: the first clamping that meets it.  Negative: depth
        along -normal until stock begins: what one clamping has opened is followed into what another has.

        Args:
            points_mm, normals: (n, 3) on the design, unit normals out of the material.   limit_mm: longest ray.
            of_cuts: deviations (cuts, n) of `deviations_of_cuts` if at hand.
        Returns:
            deviation (n,), index of the clamping (n,).
        """
        each = self.deviations_of_cuts(points_mm, normals, limit_mm)[0] if of_cuts is None else of_cuts
        maker = each.argmin(axis=0)
        least = each[maker, np.arange(each.shape[1])].copy()
        deep = np.flatnonzero(least < 0) if len(self.cuts) > 1 else np.zeros(0, int)
        while len(deep):
            foot = points_mm[deep] + least[deep, None] * normals[deep]
            inside = ((foot > self.min_mm + SAME_MM) & (foot < self.max_mm - SAME_MM)).all(axis=1) & (-least[deep] < limit_mm)
            deep, foot = deep[inside], foot[inside]
            more = self.deviations_of_cuts(foot, normals[deep], limit_mm)[0].min(axis=0, initial=0.0)
            grows = more < -SAME_MM
            deep = deep[grows]
            least[deep] = np.maximum(least[deep] + more[grows], -limit_mm)
        return least, maker

    def heights_mm(self, frame, xy_mm):
        """Height of the highest stock over (x, y), in a frame; the billet's bottom where nothing is left.

        Args:
            frame: a WCS seen from the part.   xy_mm: (n, 2) in it.
        """
        low, high = self.box_in(frame)
        xy = np.asarray(xy_mm, float)
        if not self.cuts:
            return np.full(len(xy), high[2])
        if len(self.cuts) == 1 and np.array_equal(self.cuts[0].frame.rotation, frame.rotation):
            own = self.cuts[0].frame
            shift = frame.into(own.origin_mm[None])[0]
            return np.maximum(stock_height_mm(self.cuts[0].paths, xy - shift[:2], high[2] - shift[2]) + shift[2], low[2])
        tops = np.column_stack([xy, np.full(len(xy), high[2] - SAME_MM)])
        up = np.tile((0.0, 0.0, 1.0), (len(xy), 1))
        depth, _ = self.deviations(frame.out(tops), frame.turn_out(up), float(high[2] - low[2]))
        return np.where(depth < 0, np.maximum(high[2] + depth, low[2]), high[2])

    def standing_mm(self, frame, xy_mm):
        """(n,) `heights_mm` where stock stands over (x, y), -inf beside the billet and where it is cut through."""
        low, high = self.box_in(frame)
        xy, found = np.asarray(xy_mm, float), np.full(len(xy_mm), -np.inf)
        inside = np.flatnonzero(((xy >= low[:2]) & (xy <= high[:2])).all(axis=1))
        height = self.heights_mm(frame, xy[inside])
        found[inside] = np.where(height > low[2] + SAME_MM, height, -np.inf)
        return found

    def highest_within_mm(self, frame, xy_mm, radius_mm):
        """(n,) height that no stock within a radius of (x, y) exceeds, as `heights_mm`.

        What cutters smaller by the radius all round sweep lies so deep in what the true ones sweep.
        """
        smaller = [Cut(frame=c.frame, paths=tuple(_smaller(c.paths, radius_mm))) for c in self.cuts]
        cuts = tuple(c for c in smaller if c.paths)
        return Workpiece(min_mm=self.min_mm, max_mm=self.max_mm, cuts=cuts).heights_mm(frame, xy_mm)


def _smaller(paths, by_mm):
    """Paths of cutters smaller all round; of those of which nothing is left, none."""
    for path in paths:
        with suppress(SimulationError):
            yield path.grown(-by_mm)
