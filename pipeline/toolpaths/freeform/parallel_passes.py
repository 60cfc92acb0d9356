"""Parallel passes at any angle over a region, as far apart as the scallop height allows.

How far the next line may lie follows from what the cutter touches on both (scallop_metric.py): of all
places on the next line the nearest counts.  Where a pass ends at a border of the region, or where the contact
jumps from wall to wall of a hollow, ground between two lines may have a pass on one side only: with the
border at an angle f to the lines they lie closer by (1 + sin f) / 2.  Corners of the region's outline that
stick out between two lines get a line of their own.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_erosion, grey_opening

from cuspline.toolpaths.freeform.blur import blurred
from cuspline.toolpaths.freeform.plane_curves import PlaneCurve
from cuspline.toolpaths.freeform.scallop_metric import scallop_metric
from cuspline.toolpaths.sections.profile_passes import planes_across, smallest_step
from cuspline.values import fixed_math as fixed

EXTREME_MM = 1e-4           # how exactly the first and the last line touch the region
JUMP = 4.0                  # the contact moves this much farther than the cutter: a hollow is bridged
SHORTEST_SPOTS = 5          # half a pitch apart; a first line that holds fewer leaves the region's tip to the next
TIP_SHARE = 0.25            # of the smallest step, from such a tip to the first line: half of what would still do
CORNER_PITCHES = 0.5        # a corner that sticks out less is not seen
SMALLEST_PATCH = 3          # nodes; what asks for closer lines on less ground is noise of the grid


@dataclass(frozen=True, eq=False, kw_only=True)
class Bearing:
    """Direction of parallel lines in plan."""

    angle_rad: float            # from +X towards +Y

    @property
    def along(self):
        return np.array([fixed.cos(self.angle_rad), fixed.sin(self.angle_rad)])

    @property
    def across(self):
        return np.array([-fixed.sin(self.angle_rad), fixed.cos(self.angle_rad)])


def parallel_curves(field, angle_rad, scallop_mm):
    """Lines across the region, in order.

    Args:
        field: TipField; its pitch resolves the surface: a few nodes over every fillet, none finer than the
            facets of a mesh.  For ground up to an edge without one-sided strips its run-over is at least half a step.
        angle_rad: direction of the lines from +X towards +Y.
        scallop_mm: largest scallop height.
    Returns:
        list of PlaneCurve, neighbours one after the other, all in the same direction.
    Raises:
        ToolpathError: a sharp-cornered cutter, or lines without number.
    """
    bearing = Bearing(angle_rad=float(angle_rad))
    steps = allowed_steps_mm(field, bearing, scallop_mm)[field.is_inside]
    nodes = field.node_xy_mm[field.is_inside]
    order = np.argsort(fixed.matmul(nodes, bearing.across), kind="stable")
    at, ahead = (fixed.matmul(nodes, bearing.across))[order], (fixed.matmul(nodes, bearing.along))[order]
    step_between = smallest_step(at, steps[order], margin_mm=field.pitch_mm, elsewhere_mm=float(steps.max()))
    inset = TIP_SHARE * max(float(steps.min()), field.pitch_mm)
    low, high = (_first(field, bearing, outermost, way, ahead, inset)
                 for outermost, way in ((at[0], -1), (at[-1], 1)))
    offsets = planes_across(low, high, step_between) if low < high else [(low + high) / 2]
    offsets = sorted([*offsets, *_corners(offsets, at, ahead, field.pitch_mm)])
    return [_line(bearing, c, at, ahead, field.pitch_mm) for c in offsets if _is_beside(c, at, field.pitch_mm)]


def allowed_steps_mm(field, bearing, scallop_mm):
    """(nx, ny) distance in plan that lines of a bearing may lie apart at each node; NaN outside the region."""
    d = field.dropper
    left = field.contact_mm + d.allowance_mm * field.normal         # what the true cutter touches
    metric = scallop_metric(np.swapaxes(left, 0, 1), np.swapaxes(field.normal, 0, 1), field.pitch_mm,
                            radius_mm=d.radius_mm, corner_radius_mm=d.corner_radius_mm, scallop_mm=scallop_mm, across=field.across)
    metric = np.where(field.is_inside[..., None], np.swapaxes(metric, 0, 1), np.nan)
    uu, uv, vv = (_form(metric, a, b) for a, b in ((bearing.along, bearing.along), (bearing.along, bearing.across),
                                                   (bearing.across, bearing.across)))
    with np.errstate(invalid="ignore", divide="ignore"):
        asked = np.sqrt(np.nan_to_num(np.maximum(vv - uv ** 2 / uu, 0.0)))
    asked = np.maximum(grey_opening(asked, size=SMALLEST_PATCH), 1.0 / (2 * d.radius_mm if field.across is None else
                                                                       field.across.widest_mm))
    asked *= 2.0 / (1.0 + _one_sided(field, bearing, metric))
    return np.where(field.is_inside, 1.0 / asked, np.nan)


def _form(metric, a, b):
    """Inner product of plan directions ((2,) or (..., 2)) in a metric (..., 3)."""
    (ax, ay), (bx, by) = np.moveaxis(np.asarray(a), -1, 0), np.moveaxis(np.asarray(b), -1, 0)
    return ax * bx * metric[..., 0] + (ax * by + ay * bx) * metric[..., 1] + ay * by * metric[..., 2]


def _sine(metric, tangent, bearing):
    """(n,) sine of the angle between directions (n, 2) and the lines as it is on the surface; no direction: 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine2 = _form(metric, tangent, bearing.along) ** 2 / (
            _form(metric, tangent, tangent) * _form(metric, bearing.along, bearing.along))
    return np.sqrt(np.clip(1.0 - np.nan_to_num(cosine2, nan=1.0), 0.0, 1.0))


def _one_sided(field, bearing, metric):
    """(nx, ny) sine of the angle between the lines and a border or a bridged hollow at the node; 1: none there."""
    inside, sine = field.is_inside, np.ones(field.is_inside.shape)
    border = inside & ~binary_erosion(inside) & ~field.is_edge
    slope = np.stack(np.gradient(blurred(inside, 2.0)), axis=-1)[border]
    sine[border] = _sine(metric[border], slope[:, ::-1] * (-1.0, 1.0), bearing)
    for axis in (0, 1):
        _mark_bridged(field, bearing, metric, axis, sine)
    return sine


def _mark_bridged(field, bearing, metric, axis, sine):
    """Lower the sine at neighbours between which the contact jumps over a hollow."""
    swapped = lambda grid: np.moveaxis(grid, axis, 0)
    contact, normal, out = swapped(field.contact_mm), swapped(field.normal), swapped(sine)
    tip = np.where(swapped(field.is_inside), swapped(field.tip_z_mm), np.nan)
    jump = fixed.lengths(np.diff(contact, axis=0))
    turn = fixed.lengths(np.diff(normal, axis=0)) * field.dropper.corner_radius_mm
    move = fixed.hypot(field.pitch_mm, np.diff(tip, axis=0))           # NaN where one of both lies outside
    i, j = np.nonzero((jump > JUMP * move) & (turn > JUMP * field.pitch_mm))
    valley = np.cross(normal[i, j], normal[i + 1, j])[:, :2]
    for row in (i, i + 1):
        np.minimum.at(out, (row, j), _sine(swapped(metric)[row, j], valley, bearing))


def _first(field, bearing, outermost, way, ahead, inset_mm):
    """Across coordinate of the outermost pass: along the border, or near the region's tip where that is pointed.

    Args:
        outermost: across coordinate of the outermost node.
        way: +1 or -1, outward.
        ahead: (n,) along coordinates of the nodes.
        inset_mm: of the first line from a pointed tip.
    """
    spots = np.arange(ahead.min() - field.pitch_mm, ahead.max() + 2 * field.pitch_mm, field.pitch_mm / 2)
    held, lost, count = outermost, outermost + 2 * way * field.pitch_mm, len(spots)
    while abs(held - lost) > EXTREME_MM:
        middle = (held + lost) / 2
        xy = spots[:, None] * bearing.along + middle * bearing.across
        inside = int(field.holds(xy, field.dropper.contacts(xy)).sum())
        held, lost, count = (middle, lost, inside) if inside else (held, middle, count)
    if count >= SHORTEST_SPOTS:
        return float(held)
    return float(held - way * inset_mm)


def _corners(offsets, at, ahead, pitch_mm):
    """Across coordinates of corners of the region that stick out between two lines, past the ends of both."""
    beside = lambda c: slice(*np.searchsorted(at, [c - pitch_mm, c + pitch_mm]))
    found = []
    for way in (1.0, -1.0):
        ends = [(way * ahead[beside(c)]).max(initial=-np.inf) for c in offsets]
        for k in range(len(offsets) - 1):
            first, last = np.searchsorted(at, offsets[k:k + 2])
            if first == last:
                continue
            outermost = first + int((way * ahead[first:last]).argmax())
            if way * ahead[outermost] > max(ends[k], ends[k + 1]) + CORNER_PITCHES * pitch_mm:
                found.append(float(at[outermost]))
    return found


def _is_beside(offset, at, pitch_mm):
    """Some node of the region lies beside the line."""
    first, last = np.searchsorted(at, [offset - 2 * pitch_mm, offset + 2 * pitch_mm])
    return last > first


def _line(bearing, offset, at, ahead, pitch_mm):
    """The line of an offset, as long as the region beside it."""
    first, last = np.searchsorted(at, [offset - 2 * pitch_mm, offset + 2 * pitch_mm])
    low, high = ahead[first:last].min() - 2 * pitch_mm, ahead[first:last].max() + 2 * pitch_mm
    return PlaneCurve(xy_mm=np.array([low, high])[:, None] * bearing.along + offset * bearing.across)
