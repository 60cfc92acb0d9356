"""The stock as delivered and every cut made in it, whatever setup it took: the in-process stock, exact at any point.

Stock = blank minus what each setup's cutters swept.  Each setup answers in its own WCS; here the answers meet in part
coordinates.  A box that stands along a WCS is known to the kernels; any other blank is met by lines (shape_rays.py).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cuspline.stock.extremes import AnyHeight, CutHeight, forest_of_cuts
from cuspline.stock.shape_rays import Stretch
from cuspline.stock.shapes import BoxShape, Shape
from cuspline.stock.stock_cells import StockCells
from cuspline.stock.swept import deviations_and_moves, nearest_moves, shrunk_paths, stock_height_mm
from cuspline.values.frames import Frame

PART = Frame(rotation=np.eye(3), origin_mm=np.zeros(3))
SAME_MM = 1e-7            # a depth found again deeper by less is the same
HELD_MM = 1e-3            # the part may stand out of its stock by the kernel's own tolerance
UNCUT = -1
THIN_MM = 1e-6            # of a column: less is rounding
FIRST_RAY_MM = 0.5        # looked along first
LONGER_RAY = 4.0          # the next as many times as long
ABOVE_MM = 1e-3           # rays begin so far above the cells that hold all stock
ENDLESS_MM = 1e5          # beyond any stock


@dataclass(frozen=True, eq=False, kw_only=True)
class Cut:
    """What one clamping's moves sweep."""

    frame: Frame              # its WCS seen from the part
    paths: tuple              # of swept.SweptPath, WCS


@dataclass(frozen=True, eq=False, kw_only=True)
class Workpiece:
    """Part coordinates."""

    blank: Shape              # as delivered
    cuts: tuple[Cut, ...] = ()
    before: "Workpiece | None" = None       # its last cut, where that is at hand

    def after(self, frame, paths):
        """The same after one more setup."""
        return Workpiece(blank=self.blank, cuts=(*self.cuts, Cut(frame=frame, paths=tuple(paths))), before=self)

    @cached_property
    def cells(self):
        """StockCells of it, part coordinates."""
        if self.before is not None:
            return self.before.cells.less(self.cuts[-1])
        found = StockCells.of_box(*self.box_in(PART))
        for cut in self.cuts:
            found = found.less(cut)
        return found

    @cached_property
    def _tops_seen(self):
        return {}

    def _tops_in(self, frame, more_mm=0.0):
        """CellTops of the cells, larger all round by `more_mm`, as seen from a frame."""
        key = frame.rotation.tobytes(), frame.origin_mm.tobytes(), more_mm
        if key not in self._tops_seen:
            self._tops_seen[key] = self._tops_in(frame).grown(more_mm) if more_mm else self.cells.tops_in(frame)
        return self._tops_seen[key]

    def is_cut_along(self, frame):
        """Whether all cuts were made in frames turned as this one."""
        return all(np.array_equal(cut.frame.rotation, frame.rotation) for cut in self.cuts)

    def box_in(self, frame):
        """(3,) low and (3,) high corner of the box round the blank, seen from a frame."""
        return self.blank.box_in(frame)

    def fills_box_in(self, frame):
        """Whether it is all of the box round it, as seen from a frame: nothing is cut yet."""
        return not self.cuts and self.blank.fills_box_in(frame)

    def cut_distance_mm(self, points_mm):
        """(n,) signed distance to everything cut away: positive where material is left; the billet does not count."""
        found = [nearest_moves(c.paths, c.frame.into(points_mm))[0] for c in self.cuts]
        return np.min([np.full(len(points_mm), np.inf), *found], axis=0)

    def heights(self, sign):
        """Places by `cut_distance_mm` times a sign, 1 or -1: extremes.CutHeight, or AnyHeight where it does not know the tools."""
        if self._forest is None:
            return AnyHeight(height_of=lambda p: sign * self.cut_distance_mm(p))
        forest, setup = self._forest
        return CutHeight(cuts=self.cuts, forest=forest, setup=setup, sign=float(sign))

    @cached_property
    def _forest(self):
        return forest_of_cuts(self.cuts)

    def only(self, number):
        """The blank with one of the cuts alone."""
        return Workpiece(blank=self.blank, cuts=(self.cuts[number],))

    def is_stock(self, points_mm):
        """(n,) bool: within the blank, and not cut away."""
        return self.blank.holds(points_mm) & (self.cut_distance_mm(points_mm) > 0)

    def is_free_within(self, points_mm, radius_mm, frame):
        """(n,) bool: surely no stock within a radius of points; `frame`: any in which the blank's box is tight."""
        own = frame.into(points_mm)
        low, high = self.box_in(frame)
        free = ((own < low - radius_mm) | (own > high + radius_mm)).any(axis=1)
        if not self.blank.fills_box_in(frame):
            free |= own[:, 2] - radius_mm > self.blank.tops_within_mm(frame, own[:, :2], radius_mm)
        return free | (self.cut_distance_mm(points_mm) <= -radius_mm)

    def deviations_of_cuts(self, points_mm, normals, limit_mm, ask=deviations_and_moves):
        """Deviations (cuts, n) and rows of PostedMoves (cuts, n) that each setup alone would leave.

        `ask` is swept.deviations_and_moves, or answers as it would.
        """
        is_square = [self.blank.fills_box_in(c.frame) for c in self.cuts]
        stretch = None if all(is_square) else Stretch.of(self.blank, points_mm, normals)
        found = [_in_box(ask, c, self.box_in(c.frame), points_mm, normals, limit_mm) if square else
                 _in_stretch(ask, c, stretch, points_mm, normals, limit_mm) for c, square in zip(self.cuts, is_square)]
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
            deviation (n,), index of the clamping (n,): 0 where there is none yet.
        """
        if not self.cuts:
            whole = Stretch.of(self.blank, points_mm, normals).cut(np.full(len(points_mm), limit_mm), limit_mm,
                                                                   lambda rows, by: np.zeros(len(rows)))
            return whole, np.zeros(len(points_mm), np.int64)
        each = self.deviations_of_cuts(points_mm, normals, limit_mm)[0] if of_cuts is None else of_cuts
        maker = each.argmin(axis=0)
        least = each[maker, np.arange(each.shape[1])].copy()
        deep = np.flatnonzero(least < 0) if len(self.cuts) > 1 else np.zeros(0, int)
        while len(deep):
            foot = points_mm[deep] + least[deep, None] * normals[deep]
            inside = self._goes_on(foot, normals[deep]) & (-least[deep] < limit_mm)
            deep, foot = deep[inside], foot[inside]
            more = self.deviations_of_cuts(foot, normals[deep], limit_mm)[0].min(axis=0, initial=0.0)
            grows = more < -SAME_MM
            deep = deep[grows]
            least[deep] = np.maximum(least[deep] + more[grows], -limit_mm)
        return least, maker

    def last_cut_leaves_mm(self, points_mm, normals, limit_mm):
        """(n,) deviations along normals that the last setup alone leaves of endless material, as in `deviations`."""
        return _in_box(deviations_and_moves, self.cuts[-1], (ENDLESS.min_mm, ENDLESS.max_mm), points_mm, normals, limit_mm)[0]

    def _goes_on(self, points_mm, normals):
        """(n,) bool: the blank goes on behind points (n, 3), along -normals."""
        if isinstance(self.blank, BoxShape):
            return ((points_mm > self.blank.min_mm + SAME_MM) & (points_mm < self.blank.max_mm - SAME_MM)).all(axis=1)
        stretch = Stretch.of(self.blank, points_mm, normals)
        return (stretch.begins_mm == 0) & (stretch.ends_mm > SAME_MM)

    def heights_mm(self, frame, xy_mm):
        """Height of the highest stock over (x, y), in a frame; the blank's lowest place where nothing is left.

        Args:
            frame: a WCS seen from the part.   xy_mm: (n, 2) in it.
        """
        (low, high), xy = self.box_in(frame), np.asarray(xy_mm, float)
        if not self.blank.fills_box_in(frame):
            return self._heights_in_columns(frame, xy, low[2])
        if not self.cuts:
            return np.full(len(xy), high[2])
        return self._cut_down_mm(frame, xy, low[2], high[2], lambda: self._tops_in(frame))

    def bounds_mm(self, frame, xy_mm, tops_mm):
        """(n,) heights that no stock over (x, y) exceeds, by less than a cell, found fast; `tops_mm` (n,): of the blank there."""
        low = self.box_in(frame)[0][2]
        return np.clip(self._tops_in(frame).at(np.asarray(xy_mm, float)), low, np.maximum(tops_mm, low))

    def _cut_down_mm(self, frame, xy, bottom, top, tops):
        """(n,) heights that the cuts leave over places (n, 2) of material that stands from bottom to top everywhere.

        tops: function () -> CellTops that hold all of it.
        """
        if len(self.cuts) == 1 and self.is_cut_along(frame):
            own = self.cuts[0].frame
            shift = frame.into(own.origin_mm[None])[0]
            return np.maximum(stock_height_mm(self.cuts[0].paths, xy - shift[:2], top - shift[2]) + shift[2], bottom)
        return self._down_mm(frame, xy, np.full(len(xy), bottom), np.full(len(xy), top), tops())

    def _down_mm(self, frame, xy, bottom, top, tops):
        """The same where each stands from bottom (n,) to top (n,), and CellTops hold it all."""
        begin = np.minimum(top, tops.at(xy) + ABOVE_MM)
        found, rows = bottom.copy(), np.flatnonzero(begin > bottom)
        if len(rows):
            begin, bottom = begin[rows], bottom[rows]
            depth = self._depth_mm(frame, xy[rows], begin, begin - bottom)
            found[rows] = np.where(depth < 0, np.maximum(begin + depth, bottom), begin)
        return found

    def _depth_mm(self, frame, xy, top, most_mm):
        """(n,) deviation along the tool axis at places (n, 2) of height `top` (n,), at the top of material so deep (n,); 0: uncut.

        Long rays meet every move that passes above: short ones go first, and where all along one is gone a longer one follows.
        """
        depth, open_, reach = np.zeros(len(xy)), np.arange(len(xy)), FIRST_RAY_MM
        up = frame.turn_out(np.array([[0.0, 0.0, 1.0]]))
        while len(open_):
            starts = np.column_stack([xy[open_], top[open_] + depth[open_] - SAME_MM])
            found = self.deviations(frame.out(starts), np.repeat(up, len(open_), axis=0), reach)[0]
            depth[open_] += np.minimum(found, 0.0)
            open_ = open_[(found <= SAME_MM - reach) & (-depth[open_] < most_mm[open_])]
            reach *= LONGER_RAY
        return depth

    def _heights_in_columns(self, frame, xy, lowest):
        """`heights_mm` of a blank of any form: its columns are asked one after the other, from above."""
        if not self.cuts:
            return np.maximum(self.blank.tops_mm(frame, xy), lowest)
        columns, found = self.blank.columns(frame, xy), np.full(len(xy), lowest)
        is_open = np.ones(len(xy), bool)
        for k in range(columns.shape[1] - 1, -1, -1):
            rows = np.flatnonzero(is_open & np.isfinite(columns[:, k, 1]))
            bottom, top = columns[rows, k].T
            height = self._down_mm(frame, xy[rows], bottom, top, self._tops_in(frame))
            stands = height > bottom + THIN_MM
            found[rows[stands]] = height[stands]
            is_open[rows[stands]] = False
        return found

    def standing_mm(self, frame, xy_mm):
        """(n,) `heights_mm` where stock stands over (x, y), -inf beside the blank and where it is cut through."""
        low, high = self.box_in(frame)
        xy, found = np.asarray(xy_mm, float), np.full(len(xy_mm), -np.inf)
        inside = np.flatnonzero(((xy >= low[:2]) & (xy <= high[:2])).all(axis=1))
        height = self.heights_mm(frame, xy[inside])
        found[inside] = np.where(height > low[2] + SAME_MM, height, -np.inf)
        return found

    def highest_within_mm(self, frame, xy_mm, radius_mm):
        """(n,) height that no stock within a radius of (x, y) exceeds, as `heights_mm`.

        What cutters smaller by the radius all round sweep lies so deep in what the true ones sweep.  Where cuts came from
        several directions, and the radius is no less than half a cube, cubes that hold what is left say it, larger by the radius.
        """
        (low, high), xy, fills = self.box_in(frame), np.asarray(xy_mm, float), self.blank.fills_box_in(frame)
        stands = np.full(len(xy), high[2]) if fills else np.maximum(self.blank.tops_within_mm(frame, xy, radius_mm), low[2])
        if not self.is_cut_along(frame) and self.cells.least_half_mm <= radius_mm:
            return np.minimum(stands, np.maximum(self._tops_in(frame, radius_mm).at(xy), low[2]))
        smaller = [Cut(frame=c.frame, paths=shrunk_paths(c.paths, radius_mm)) for c in self.cuts]
        cuts = tuple(c for c in smaller if c.paths)
        if not cuts:
            return stands
        less = Workpiece(blank=self.blank if fills else ENDLESS, cuts=cuts)
        return np.minimum(stands, less._cut_down_mm(frame, xy, low[2], high[2], lambda: self._tops_in(frame, radius_mm)))


ENDLESS = BoxShape(min_mm=np.full(3, -ENDLESS_MM), max_mm=np.full(3, ENDLESS_MM))


def _in_box(ask, cut, box, points_mm, normals, limit_mm):
    """Deviations (n,) and rows (n,) that one setup leaves of a box along its WCS.

    What stands out of the box by no more than HELD_MM is asked for at its side: a line that runs down beside the box would
    never meet stock, and nobody has cut that away.
    """
    points = cut.frame.into(points_mm)
    held = np.clip(points, *box)
    is_beside = np.abs(points - held).max(axis=1, initial=0.0) <= HELD_MM
    return ask(cut.paths, *box, np.where(is_beside[:, None], held, points), cut.frame.turn_into(normals), limit_mm)


def _in_stretch(ask, cut, stretch, points_mm, normals, limit_mm):
    """The same in what a line through the blank meets of it."""
    def free(ask, points, normals):
        return _in_box(ask, cut, (ENDLESS.min_mm, ENDLESS.max_mm), points, normals, limit_mm)

    deviation, row = free(ask, points_mm, normals)
    free_at = lambda rows, by: free(deviations_and_moves, points_mm[rows] - by[:, None] * normals[rows], normals[rows])[0]
    return stretch.cut(deviation, limit_mm, free_at), row
