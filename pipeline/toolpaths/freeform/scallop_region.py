"""The ground that level passes run on: a region's grid with the metric in which passes lie one apart."""

import math
from dataclasses import dataclass

import contourpy
import numpy as np
from scipy import ndimage

from cuspline.toolpaths.freeform.blur import blurred
from cuspline.toolpaths.freeform.fast_marching import metric_distance, seed_distance
from cuspline.toolpaths.freeform.plane_curves import PlaneCurve
from cuspline.toolpaths.freeform.scallop_metric import contact_jumps, scallop_metric
from cuspline.values.errors import ToolpathError

WIDENED = 2             # nodes beyond the region that distances may use, so that lines reach its border
RING = 2                # nodes from a field's zero distance beyond the wanted faces to differences all on them
BORDER_BLUR = 1.0       # grid pitches: a border is drawn through the middle of the steps its nodes make
OUTLINE = 0.69          # of the blurred region, whose nodes begin one beyond the border: half a pitch inward


@dataclass(frozen=True, eq=False, kw_only=True)
class Ground:
    """A region on its grid with the metric in which passes lie one apart."""

    x_mm: np.ndarray        # (nx,) evenly spaced
    y_mm: np.ndarray        # (ny,) the same pitch
    metric: np.ndarray      # (ny, nx, 3) xx, xy, yy
    is_inside: np.ndarray   # (ny, nx) the region and the nodes next to it
    is_cut: np.ndarray      # (ny, nx) of the region: scallops count there, not where the cutter rolls over its end
    is_open: np.ndarray     # (ny, nx) the region and what distances may use around it
    walls: np.ndarray       # (ny, nx, 2) the contact jumps to the next node in x, in y: nothing is cut across
    depth: np.ndarray       # (ny, nx) smooth; OUTLINE on the region's border
    touched_mm: np.ndarray  # (ny, nx, 2) contacts in plan; where the part's own corners are seen

    @property
    def step_mm(self):
        return float(self.x_mm[1] - self.x_mm[0])

    @classmethod
    def of(cls, x_mm, y_mm, metric, is_inside, touched_mm=None, walls=None, is_beyond=None):
        """Leaves out nodes without a metric; without contacts the tips' own places stand for them.

        Nodes beyond the faces wanted, where the cutter runs over their end, take the metric of the nearest that
        is not, so that passes run straight on.

        Raises:
            ToolpathError: nothing is left.
        """
        known = np.isfinite(metric).all(axis=-1)
        if not (known & is_inside).any():
            raise ToolpathError("the region is empty: no grid node on it where the cutter touches; "
                                "choose other faces, a smaller `tool`, or another `strategy`")
        # the border runs somewhere within one node of the last one inside: all of that is to be cut
        inside = ndimage.binary_dilation(is_inside, np.ones((3, 3), bool)) & known
        wide = ndimage.binary_dilation(inside, np.ones((3, 3), bool), iterations=WIDENED) & known
        touched = np.stack(np.meshgrid(x_mm, y_mm), axis=-1) if touched_mm is None else touched_mm
        cut = inside if is_beyond is None else inside & ~is_beyond
        if is_beyond is not None:
            metric = _run_straight_on(metric, known & ~is_beyond, wide)
        near = ndimage.distance_transform_edt(~inside, return_distances=False, return_indices=True)
        return cls(x_mm=np.asarray(x_mm, float), y_mm=np.asarray(y_mm, float), metric=metric, is_inside=inside,
                   is_cut=cut, is_open=wide, walls=np.zeros((*inside.shape, 2), bool) if walls is None else walls,
                   depth=blurred(inside, BORDER_BLUR, mode="constant"),
                   touched_mm=touched[near[0], near[1]])

    def distance(self, lines, farthest=np.inf):
        """(ny, nx) metric distance to polylines, jumps of the contact taken as they come."""
        start = seed_distance(self.metric, self.is_open, self.x_mm, self.y_mm, lines)
        return metric_distance(self.metric, self.is_open, self.step_mm, start, farthest)

    def left_by(self, lines, farthest):
        """(ny, nx) metric distance to passes, on each node's own side of the jumps."""
        start = seed_distance(self.metric, self.is_open, self.x_mm, self.y_mm, lines, walls=self.walls)
        return metric_distance(self.metric, self.is_open, self.step_mm, start, farthest, self.walls)

    def at(self, values, xy_mm):
        """(n,) linear interpolation of node values."""
        col = (xy_mm[:, 0] - self.x_mm[0]) / self.step_mm
        row = (xy_mm[:, 1] - self.y_mm[0]) / self.step_mm
        return ndimage.map_coordinates(values, [row, col], order=1, mode="nearest")


def ground_of(field, *, radius_mm, scallop_mm, corner_radius_mm=None):
    """Ground of a TipField (its arrays run along x first), for a scallop height; None for the corner: a ball."""
    step = float(field.x_mm[1] - field.x_mm[0])
    contact, normal = (np.swapaxes(a, 0, 1) for a in (field.contact_mm, field.normal))
    metric = scallop_metric(contact, normal, step, radius_mm=radius_mm, corner_radius_mm=corner_radius_mm,
                            scallop_mm=scallop_mm, across=field.across)
    jumps = contact_jumps(contact, normal, radius_mm=radius_mm, corner_radius_mm=corner_radius_mm)
    return Ground.of(field.x_mm, field.y_mm, metric, field.is_inside.T, contact[..., :2], jumps, field.beyond_mm.T > 0)


def _run_straight_on(metric, is_wanted, is_open):
    """The metric with that of the nearest wanted node wherever differences at a node reach beyond the wanted ones."""
    core = ndimage.binary_erosion(is_wanted, iterations=RING, border_value=1)
    if not core.any():
        return metric
    near = ndimage.distance_transform_edt(~core, return_distances=False, return_indices=True)
    return np.where((core | ~is_open)[..., None], metric, metric[near[0], near[1]])


def lines_at(ground, values, level):
    """Level lines inside the region, evenly pointed and without the grid's small kinks."""
    shown = np.ma.array(values, mask=~(ground.is_open & np.isfinite(values)))
    lines = contourpy.contour_generator(ground.x_mm, ground.y_mm, shown).lines(level)
    pieces = [p for line in lines for p in clipped(ground, line)]
    smooth = (evened(p, ground.step_mm) for p in pieces)
    return [c for c in smooth if c is not None]


def borders(ground):
    """Closed (m, 2) lines round the region and its islands, first point repeated."""
    framed = np.pad(ground.depth, 2)
    grow = ground.step_mm * np.arange(1, 3)
    stretch = lambda a: np.concatenate([a[0] - grow[::-1], a, a[-1] + grow])
    lines = contourpy.contour_generator(stretch(ground.x_mm), stretch(ground.y_mm), framed).lines(OUTLINE)
    return [c.line_mm for c in (evened(line, ground.step_mm) for line in lines) if c is not None]


def clipped(ground, line):
    """Parts of a polyline inside the region, ends on its border."""
    depth = ground.at(ground.depth, line) - OUTLINE
    inside = depth >= 0
    if inside.all():
        return [line]
    if not inside.any():
        return []
    if np.allclose(line[0], line[-1]):          # a closed one starts outside
        first = int(np.argmin(inside[:-1]))
        line, depth = (np.concatenate([a[first:-1], a[:first + 1]]) for a in (line, depth))
        inside = depth >= 0
    parts, open_part = [], [line[0]] if inside[0] else []
    for k in range(1, len(line)):
        if inside[k] != inside[k - 1]:
            t = depth[k - 1] / (depth[k - 1] - depth[k])
            open_part.append(line[k - 1] + t * (line[k] - line[k - 1]))
            if not inside[k]:
                parts.append(np.array(open_part))
                open_part = []
        if inside[k]:
            open_part.append(line[k])
    return parts + ([np.array(open_part)] if len(open_part) > 1 else [])


def evened(line, step_mm):
    """PlaneCurve with points one grid pitch apart, small kinks smoothed; None where nothing is left."""
    is_closed = len(line) > 3 and np.allclose(line[0], line[-1], atol=1e-9)
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    if run[-1] < 1e-6 * step_mm:
        return None
    count = max(int(math.ceil(run[-1] / step_mm)), 4 if is_closed else 1)
    at = np.linspace(0.0, run[-1], count + 1)
    xy = np.column_stack([np.interp(at, run, line[:, k]) for k in range(2)])
    for _ in range(2):
        if is_closed:
            ring = xy[:-1]
            ring = 0.25 * np.roll(ring, 1, axis=0) + 0.5 * ring + 0.25 * np.roll(ring, -1, axis=0)
            xy = np.vstack([ring, ring[:1]])
        elif len(xy) > 2:
            xy[1:-1] = 0.25 * xy[:-2] + 0.5 * xy[1:-1] + 0.25 * xy[2:]
    return PlaneCurve(xy_mm=xy[:-1] if is_closed else xy, is_closed=is_closed)


def length_mm(line):
    """Length of a polyline."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
