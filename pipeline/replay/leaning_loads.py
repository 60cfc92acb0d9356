r"""What leaning cutters take off on their way, measured in planes across the feed.

             ______ ______
            |      |   ░░░|   ░ places inside the cutter, in the plane across the feed through its middle, that were stock
            |      |  ░░░░|     when its front came there
             \_____|_░░░░/      slot depth = their area over the diameter

The plane is looked at every half diameter of way.  It is a grid: a figure is sure only as far as one row of places round it
does not count.  Between the planes, and where a cutter takes less than a place of the grid, nothing is said.

Whether an operation takes anything at all is asked along the cutter's outline.  One that seems to take nothing is looked
at again in every sub-step: a pass over a single place is shorter than half a diameter.
"""

import numpy as np

from cuspline.program.program import Kind
from cuspline.replay.replay_loads import Loads
from cuspline.stock.outlines import START_R, START_Z, outline_distance
from cuspline.stock.tilted_pieces import AXIS, AXIS_WAY, LENGTH, TIP, WAY
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit

ACROSS = 12               # places across a diameter
BEHIND = 1.5              # radii of way behind a plane in which the cutter's front has passed through it
EDGE_MM = 1e-3            # in from the outline: places there show whether anything is taken at all
EDGES = 48                # of them
SHARES = np.array([1.0, 3.0, 5.0]) / 6          # of a way down, where the tip is asked for
MOST_LOOKS = 4000         # planes of an operation that seems to take nothing
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
        self.is_feed, self.operation = posted.kind[self.row] != Kind.RAPID, posted.operation
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
        began = np.maximum(np.searchsorted(way, way - BEHIND * diameter / 2), np.searchsorted(cut, cut))
        before = self.number[feeds[began]]
        k, planes = feeds[at], self._planes(feeds[at])
        step = 2 * self.cutter.largest_radius_mm / ACROSS
        places = _grid(self.path.outline, step)
        found = _standing(history, *self._in_cutter(planes, places), before[at])
        area, round_ = found.sum(axis=1) * step * step, _round(found, places, step)
        np.maximum.at(slot, self.row[k], area / diameter)
        np.maximum.at(sure, self.row[k], np.maximum(area - round_ * step, 0.0) / diameter)
        on_edge = _standing(history, *self._on_edge(planes), before[at])
        np.logical_or.at(takes, self.row[k], found.any(axis=1) | on_edge.any(axis=1))
        np.add.at(nodes, self.row[k], NODES_PER_STATION)
        again = self._of_idle(feeds, takes)
        if len(again):
            edges = self._on_edge(self._planes(feeds[again]))
            np.logical_or.at(takes, self.row[feeds[again]], _standing(history, *edges, before[again]).any(axis=1))

    def _of_idle(self, feeds, takes):
        """Those of `feeds` that belong to operations none of whose moves `takes` anything, thinned to MOST_LOOKS each."""
        of = self.operation[self.row[feeds]]
        idle = np.setdiff1d(of, self.operation[takes])
        chosen = [np.flatnonzero(of == number) for number in idle]
        return np.concatenate([np.zeros(0, np.int64), *(rows[::-(-len(rows) // MOST_LOOKS)] for rows in chosen)])

    def _planes(self, k):
        """(k, 3) each, where sub-steps end: the middle, two directions across the feed, the axis.  The second leads upward."""
        axis = self.g[k, AXIS:AXIS_WAY] + self.g[k, AXIS_WAY:AXIS_WAY + 3]
        axis = axis / _size(axis)
        way = self.g[k, WAY:AXIS] + self._middle * self.g[k, AXIS_WAY:AXIS_WAY + 3]
        way = np.where(_size(way) > 1e-9, way / np.maximum(_size(way), 1e-300), axis)
        u = np.cross(axis, way)
        other = np.cross(axis, np.where(np.abs(axis[:, :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
        u = np.where(_size(u) > 1e-6, u, other)
        u = u / _size(u)
        v = np.cross(way, u)
        v = v * np.where((v * axis).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        return self.g[k, TIP:WAY] + self.g[k, WAY:AXIS] + self._middle * axis, u, v, axis

    @property
    def _middle(self):
        """Height over the tip that the planes go through: of a ball, its centre."""
        return min(self.cutter.largest_radius_mm, self.path.outline[:, START_Z].max() / 2)

    def _in_cutter(self, planes, places):
        """(k, p, 3) points at places (p, 2) of planes, and (k, p) whether the cutter holds them."""
        middle, u, v, axis = planes
        points = middle[:, None] + places[:, :1] * u[:, None] + places[:, 1:] * v[:, None]
        return points, self._depths(points, planes) < 0

    def _on_edge(self, planes):
        """(k, EDGES, 3) points all round the cutter in planes, EDGE_MM below its surface, and (k, EDGES) True."""
        middle, u, v, _ = planes
        turn = 2 * np.pi * (np.arange(EDGES) + 0.5) / EDGES
        out = fixed.cos(turn)[:, None] * u[:, None] + fixed.sin(turn)[:, None] * v[:, None]
        low = np.zeros(out.shape[:2])
        high = low + 2 * float(self.path.outline[:, START_R:START_Z + 1].max())
        while (high - low).max() > EDGE_MM / 4:
            half = (low + high) / 2
            inside = self._depths(middle[:, None] + half[..., None] * out, planes) < -EDGE_MM
            low, high = np.where(inside, half, low), np.where(inside, high, half)
        return middle[:, None] + low[..., None] * out, np.ones(low.shape, bool)

    def _depths(self, points, planes):
        """(k, p) signed distance of points to the cutter."""
        middle, _, _, axis = planes
        off = points - middle[:, None]
        up = (off * axis[:, None]).sum(axis=2)
        across = off - up[..., None] * axis[:, None]
        depths = np.empty(up.size)
        _put_depths(np.sqrt((across * across).sum(axis=2)).ravel(), up.ravel() + self._middle, self.path.outline, depths)
        return depths.reshape(up.shape)

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


@njit(error_model="numpy")
def _put_depths(r, z, outline, out):
    """Signed distances of (r, z) to the body of an outline."""
    for i in range(len(r)):
        out[i] = outline_distance(r[i], z[i], outline, 0, len(outline))[0]


def _standing(history, points, inside, before):
    """(k, p) bool: which of points (k, p, 3) are stock before the step that `before` (k,) tells, of those that are `inside`."""
    found = inside.copy()
    found[inside] = history.stands(points[inside], np.broadcast_to(before[:, None], inside.shape)[inside])
    return found


def _size(vectors):
    """(n, 1) lengths."""
    return np.sqrt((vectors * vectors).sum(axis=1))[:, None]


def _grid(outline, step):
    """(p, 2) places round the middle of the plane, as far as a cutter can reach."""
    far = outline[:, START_R:START_Z + 1].max(axis=0)
    side = [step * (np.arange(2 * int(np.ceil(size / step))) + 0.5) - step * np.ceil(size / step) for size in far]
    return np.stack(np.meshgrid(*side, indexing="ij"), axis=-1).reshape(-1, 2)


def _round(found, places, step):
    """(n,) length of the border of what is found: the wide and the high of the box round it, each once."""
    low = np.where(found[..., None], places, np.inf).min(axis=1)
    high = np.where(found[..., None], places, -np.inf).max(axis=1)
    return np.where(found.any(axis=1), (high - low + step).sum(axis=1), 0.0)
