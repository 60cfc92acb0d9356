r"""What leaning cutters take off on their way, measured in the plane of the axis across the feed.

                 |axis
           ______|______
          |      |   ░░░|   ░ places of the plane inside the cutter that were stock when its front came there
          |      |  ░░░░|
           \_____|_░░░░/    slot depth = their area over the diameter

The plane is looked at every half diameter of way.  It is a grid: a figure is sure only as far as one row of places round it
does not count.  Between the planes, and where a cutter takes less than a place of the grid, nothing is said.
"""

import numpy as np

from cuspline.program.program import Kind
from cuspline.replay.replay_loads import Loads
from cuspline.stock.outlines import outline_distance
from cuspline.stock.tilted_pieces import AXIS, AXIS_WAY, LENGTH, TIP, WAY
from cuspline.values import fixed_math as fixed

ACROSS = 12               # places across a diameter
BEHIND = 1.5              # radii of way behind a plane in which the cutter's front has passed through it
EDGE_MM = 1e-3            # in from the outline: places there show whether anything is taken at all
EDGES = 48                # of them
SHARES = np.array([1.0, 3.0, 5.0]) / 6          # of a way down, where the tip is asked for
NODES_PER_STATION = 100   # a plane counts as so many of the map's nodes, where an operation is asked whether it is idle


def loads(posted, script, history):
    """Loads of one program; `script`, `history`: of leaning_replay.py."""
    n = len(posted)
    slot, sure, plunge, slope, fall = np.zeros((5, n))
    takes, nodes = np.zeros(n, bool), np.zeros(n)
    for path, numbers in zip(script.paths, script.numbers):
        order = np.argsort(path.step, kind="stable")
        own = _Way(path, order, numbers[order], posted)
        own.put_planes(history, slot, sure, takes, nodes)
        own.put_plunges(history, plunge, slope, fall)
    return Loads(slot_mm=slot, sure_mm=sure, plunge_mm=plunge, slope_rad=slope, fall=fall, takes=takes, nodes=nodes)


class _Way:
    """The sub-steps of one tool in the order of cutting."""

    def __init__(self, path, order, numbers, posted):
        self.path, self.g, self.row, self.number = path, path.geometry[order], path.row[order], numbers
        self.is_feed = posted.kind[self.row] != Kind.RAPID
        self.cutter = path.tool.cutter

    def put_planes(self, history, slot, sure, takes, nodes):
        """Looks at the planes, and fills in what they show at the rows that they lie in."""
        diameter, feeds = self.cutter.diameter_mm, np.flatnonzero(self.is_feed)
        if not len(feeds):
            return
        way = np.cumsum(self.g[feeds, LENGTH])
        cut = np.cumsum(np.diff(feeds, prepend=feeds[0]) > 1)               # runs of feed moves between rapids
        mark = np.floor(2 * way / diameter).astype(np.int64)
        at = np.flatnonzero(np.r_[True, (np.diff(mark) > 0) | (np.diff(cut) > 0)])
        back = np.maximum(np.searchsorted(way, way[at] - BEHIND * diameter / 2), np.searchsorted(cut, cut[at]))
        k, before = feeds[at], self.number[feeds[back]]
        inside, edge, step = self._places()
        u, axis, tip = self._planes(k)
        for places, is_grid in ((inside, True), (edge, False)):
            points = (tip[:, None] + places[:, 0, None] * u[:, None] + places[:, 1, None] * axis[:, None]).reshape(-1, 3)
            found = history.stands(points, np.repeat(before, len(places))).reshape(len(k), -1)
            np.logical_or.at(takes, self.row[k], found.any(axis=1))
            if is_grid:
                area, round_ = found.sum(axis=1) * step * step, _round(found, places, step)
                np.maximum.at(slot, self.row[k], area / diameter)
                np.maximum.at(sure, self.row[k], np.maximum(area - round_ * step, 0.0) / diameter)
        np.add.at(nodes, self.row[k], NODES_PER_STATION)

    def _planes(self, k):
        """(k, 3) directions across the feed and along the axis, (k, 3) tips, where sub-steps end."""
        axis = self.g[k, AXIS:AXIS_WAY] + self.g[k, AXIS_WAY:AXIS_WAY + 3]
        axis = axis / np.sqrt((axis * axis).sum(axis=1))[:, None]
        u = np.cross(axis, self.g[k, WAY:AXIS])
        size = np.sqrt((u * u).sum(axis=1))
        other = np.cross(axis, np.where(np.abs(axis[:, :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
        u = np.where((size > 1e-6)[:, None], u / np.maximum(size, 1e-300)[:, None], other)
        return u / np.sqrt((u * u).sum(axis=1))[:, None], axis, self.g[k, TIP:WAY] + self.g[k, WAY:AXIS]

    def _places(self):
        """(p, 2) places inside the cutter, in a grid; (q, 2) on its edge; (across, along); the grid's step."""
        outline, radius = self.path.outline, self.cutter.largest_radius_mm
        height, step = outline[:, 2].max(), 2 * radius / ACROSS
        grid = np.stack(np.meshgrid((np.arange(ACROSS) + 0.5) * step - radius, np.arange(0.5 * step, height, step),
                                    indexing="ij"), axis=-1).reshape(-1, 2)
        depth = lambda r, z: outline_distance(abs(r), z, outline, 0, len(outline))[0]
        inside = grid[np.array([depth(r, z) < 0 for r, z in grid])]
        angle = np.pi * (np.arange(EDGES) + 0.5) / EDGES
        middle = min(radius, height / 2)
        edge = []
        for a in angle:                     # from a place on the axis outward and down, to where the outline is met
            way, low, high = np.array([fixed.cos(a), -fixed.sin(a)]), 0.0, 2 * (radius + height)
            while high - low > EDGE_MM / 4:
                half = (low + high) / 2
                r, z = half * way[0], middle + half * way[1]
                low, high = (half, high) if depth(r, z) < -EDGE_MM else (low, half)
            edge.append((low * way[0], middle + low * way[1]))
        return inside, np.array(edge), step

    def put_plunges(self, history, plunge, slope, fall):
        """How steeply feeds lead down along their own axis, and how deep the tip goes into stock on the way."""
        way, length = self.g[:, WAY:AXIS], self.g[:, LENGTH]
        down = -(way * self.g[:, AXIS:AXIS_WAY]).sum(axis=1)
        steepest = min(self.cutter.steepest_rad, np.pi / 4)
        share = np.divide(down, length, out=np.zeros(len(down)), where=length > 1e-9)
        k = np.flatnonzero(self.is_feed & (share > fixed.sin(steepest)))
        if not len(k):
            return
        points = (self.g[k, None, TIP:WAY] + SHARES[:, None] * way[k, None]).reshape(-1, 3)
        points += np.repeat(EDGE_MM * self.g[k, AXIS:AXIS_WAY], len(SHARES), axis=0)
        found = history.stands(points, np.repeat(self.number[k], len(SHARES))).reshape(len(k), -1).mean(axis=1)
        np.add.at(plunge, self.row[k], found * down[k])
        np.maximum.at(fall, self.row[k], np.minimum(share[k], 1.0))
        slope[self.row[k]] = np.maximum(slope[self.row[k]], fixed.arcsin(np.minimum(share[k], 1.0)))


def _round(found, places, step):
    """(n,) length of the border of what is found: the wide and the high of the box round it, each once."""
    low = np.where(found[..., None], places, np.inf).min(axis=1)
    high = np.where(found[..., None], places, -np.inf).max(axis=1)
    return np.where(found.any(axis=1), (high - low + step).sum(axis=1), 0.0)
