"""Runs of a level written as moves: lines and arcs, helices, links that stay down or lift; gouge-checked."""

import math

import numpy as np

from cuspline.program.program import MoveWriter, Plane
from cuspline.toolpaths.drop.dropcutter import is_held_above
from cuspline.toolpaths.roughing.path_arcs import lines_and_arcs
from cuspline.toolpaths.roughing.stock_fields import CHORD_MM, arc_points
from cuspline.values import fixed_math as fixed

FIT_MM = 0.015              # lines and arcs lie this close to the steered steps, which keep inside by as much
CHECK_GROWTH_MM = 0.01      # a path is checked with a cutter larger by this, which covers what lies between
APPROACH_MM = 1.0           # above what is cut the tool begins to feed down


class ClearingWriter:
    """Collects the moves of one clearing."""

    def __init__(self, rules):
        self.rules, self._writer = rules, None

    @property
    def is_empty(self):
        return self._writer is None

    def moves(self):
        """All moves, the last one up to the clearance plane."""
        self._lift()
        return self._writer.moves()

    def write_level(self, runs, level):
        """Append runs at one height."""
        for run in runs:
            start = np.r_[run.way_mm[0], level]
            if self._writer is None:
                self._writer = MoveWriter(np.r_[start[:2], self.rules.clearance_z_mm])
            if run.entry == "stay":
                self._plane_line(run.way_mm[1:], level)
            elif run.entry == "helix":
                self._helix(run.helix_mm, run.top_mm, level)
            else:
                self._over(np.r_[run.way_mm[-1], level], run.top_mm)
            self._plane_path(run.path_mm, level)

    def is_far(self, way_mm, level):
        """Lifting, crossing and coming down again takes less time than the way (k, 2) on the level."""
        way = float(np.linalg.norm(np.diff(way_mm, axis=0), axis=1).sum())
        across = float(fixed.length(way_mm[-1] - way_mm[0]))
        quick = self._lift_minutes(level) + across / self.rules.rapid_mm_per_min
        return way / self.rules.feed_mm_per_min > quick

    def longest_way_mm(self, level):
        """A longer way on the level is_far wherever it leads: no way is shorter than straight across."""
        slower = 1 / self.rules.feed_mm_per_min - 1 / self.rules.rapid_mm_per_min
        return self._lift_minutes(level) / slower if slower > 0 else math.inf

    def _lift_minutes(self, level):
        """Up to the clearance plane and down again."""
        lift = self.rules.clearance_z_mm - level
        feed_down = APPROACH_MM / self.rules.ramp_feed_mm_per_min
        return 2 * lift / self.rules.rapid_mm_per_min + feed_down + self.rules.lift_s / 60

    def _lift(self):
        self._writer.rapid(np.r_[self._writer.here_mm[:2], self.rules.clearance_z_mm])

    def _over(self, place, top):
        """Across at the clearance plane and down to a place over free ground."""
        self._lift()
        self._writer.rapid(np.r_[place[:2], self.rules.clearance_z_mm])
        self._writer.rapid(np.r_[place[:2], min(top + APPROACH_MM, self.rules.clearance_z_mm)])
        self._writer.feed(place, self.rules.ramp_feed_mm_per_min)

    def _helix(self, helix, top, level):
        """Whole turns down from above the stock, no steeper than the ramp, then one level turn."""
        x, y, radius = helix
        feed = self.rules.ramp_feed_mm_per_min
        start = np.array([x + radius, y, top + APPROACH_MM / 2])
        self._lift()
        self._writer.rapid(np.r_[start[:2], self.rules.clearance_z_mm])
        self._writer.rapid(np.r_[start[:2], min(start[2] + APPROACH_MM, self.rules.clearance_z_mm)])
        self._writer.feed(start, feed)
        halves = max(2, 2 * math.ceil((start[2] - level) / (2 * math.pi * radius * fixed.tan(self.rules.ramp_rad))))
        for k in range(1, halves + 3):
            z = max(level, start[2] - (start[2] - level) * k / halves)
            side = radius if k % 2 == 0 else -radius
            self._writer.arc((x + side, y, z), (x, y, z), Plane.XY, False, feed)

    def _plane_line(self, points, level):
        for p in points:
            self._writer.feed(np.r_[p, level], self.rules.feed_mm_per_min)

    def _plane_path(self, path, level):
        for end, turn, center in self._elements(path):
            if turn == 0:
                self._writer.feed(np.r_[end, level], self.rules.feed_mm_per_min)
            else:
                self._writer.arc(np.r_[end, level], np.r_[center, level], Plane.XY, turn < 0,
                                 self.rules.feed_mm_per_min)

    def _elements(self, path):
        """(end, turn, centre) of the lines and arcs along a path."""
        if len(path) < 2:
            return []
        return [(path[int(row)], int(turn), np.array([cx, cy]))
                for row, turn, cx, cy in lines_and_arcs(np.ascontiguousarray(path), FIT_MM)]

    def keeps_allowance(self, run, level):
        """Nowhere along the run is the part nearer than the allowance: a proof, not only at samples.

        A cutter is a disk with a ball of its corner radius rolled over it.  What it covers between
        two samples d apart lies within sqrt(rc² + d²/4) of the disk at one of them; rc grown by the
        allowance, and d chosen so that this is CHECK_GROWTH_MM more.
        """
        rules, a = self.rules, self.rules.allowance_mm
        rc, grown = rules.corner_radius_mm + a, CHECK_GROWTH_MM
        xy = self._samples(run, 2 * math.sqrt((rc + grown) ** 2 - rc ** 2))
        held = is_held_above(rules.mesh, xy, rules.radius_mm + a + grown, rc + grown, level - a - grown + 1e-9)
        return not held.any()

    def _samples(self, run, apart_mm):
        """(n, 2) places along a run's way, helix and pass."""
        lines = list(zip(run.way_mm, run.way_mm[1:]))
        curves, here = [], run.path_mm[0]
        for end, turn, center in self._elements(run.path_mm):
            if turn == 0:
                lines.append((here, end))
            else:
                curves.append(_arc(here, end, center, turn > 0))
            here = end
        if run.helix_mm is not None:
            x, y, radius = run.helix_mm
            start = np.array([x + radius, y])
            curves.append(_arc(start, start, np.array([x, y]), True))
        lines += [pair for curve in curves for pair in zip(curve, curve[1:])]
        if not lines:
            return run.way_mm
        ends = np.array(lines)
        counts = np.maximum(1, np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / apart_mm)).astype(int)
        line = np.repeat(np.arange(len(counts)), counts)
        share = (np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[line]
        return np.vstack([ends[line, 0] + share[:, None] * (ends[line, 1] - ends[line, 0]), ends[-1:, 1]])


def _arc(start, end, center, is_left):
    """(n, 2) points of a plane arc, chords as in stock_fields."""
    flat = lambda p: np.r_[p, 0.0]
    return arc_points(flat(start), flat(end), flat(center), Plane.XY, is_left, CHORD_MM)[:, :2]
