"""Clearance of a tool, turned as it may be, to triangles: at poses to a tolerance, over whole moves proven.

The tool is a union of convex segments of revolution (`tool_segments`).  Nothing is sampled: every answer is a
lower bound of the true distance to the triangles given.  Their own deviation from a design is the caller's to add.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.replay import clearance_kernels as kernels
from cuspline.stock.tilted_pieces import AXIS, AXIS_WAY, LENGTH, TIP, WAY
from cuspline.stock.tree import morton_order
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.errors import SimulationError

SAGITTA_MM = 1e-3         # of outlines whose arcs cannot be taken whole; the segments are grown by as much
UNIT = 1e-6               # how far an axis may be from length 1
FAR_MM = 1e6
LOOK_MM = 3.0             # a cap this far above the margin lets a pose vouch for many moves at little cost
NEARLY_MM = 1e-9          # heights on a tool that differ by less are the same
SLICE_RATIO = 2.5         # of the levers at a slice's two ends


@dataclass(frozen=True, eq=False, kw_only=True)
class ToolMoves:
    """Moves of a tool: its tip runs straight, its axis turns evenly along the great circle between start and end."""

    start_tips_mm: np.ndarray     # (n, 3)
    end_tips_mm: np.ndarray
    start_axes: np.ndarray        # (n, 3) unit, tip to holder
    end_axes: np.ndarray

    @classmethod
    def of_substeps(cls, geometry):
        """Of sub-steps (n, 14) of stock/tilted_pieces.py."""
        unit = lambda a: a / np.sqrt((a * a).sum(axis=1))[:, None]
        tips, axes = geometry[:, TIP:WAY], geometry[:, AXIS:AXIS_WAY]
        return cls(start_tips_mm=tips, end_tips_mm=tips + geometry[:, WAY:AXIS], start_axes=unit(axes),
                   end_axes=unit(axes + geometry[:, AXIS_WAY:LENGTH]))

    def only(self, rows):
        """The chosen ones."""
        return ToolMoves(**{name: value[rows] for name, value in vars(self).items()})


@dataclass(frozen=True, eq=False, kw_only=True)
class MoveClearance:
    """What is proven of moves, one row each."""

    clearance_mm: np.ndarray      # (n,) of clear moves: no nearer anywhere on the way; of others: too near, as found
    is_clear: np.ndarray          # (n,) bool: proven to keep the margin all the way
    place_mm: np.ndarray          # (n, 3) point of the triangles that came nearest; NaN: none within the cap


@dataclass(frozen=True, eq=False, kw_only=True)
class ClearanceTree:
    """Triangles in a tree of boxes."""

    triangles_mm: np.ndarray      # (t, 3, 3) corners, in Morton order
    nodes: np.ndarray             # (k, 15) boxes, see clearance_kernels
    leaves: int

    @classmethod
    def of_triangles(cls, vertices_mm, triangles):
        """Tree of triangles given by (v, 3) vertices and (t, 3) indices.

        Raises:
            SimulationError: there are none.
        """
        corners = frozen(vertices_mm, (None, 3), "vertices_mm")[frozen(triangles, (None, 3), "triangles", np.int64)]
        if not len(corners):
            raise SimulationError("a clearance needs triangles to keep away from: none are given")
        corners = np.ascontiguousarray(corners[morton_order(corners.mean(axis=1))])
        leaves = 1
        while leaves * kernels.LEAF < len(corners):
            leaves *= 2
        return cls(triangles_mm=corners, nodes=kernels.build_nodes(corners, leaves), leaves=leaves)

    @property
    def arrays(self):
        """What the kernels take."""
        return self.triangles_mm, self.nodes, self.leaves

    def distances_mm(self, segments, tips_mm, axes, tolerance_mm):
        """Signed distance of the tool at each pose to the nearest triangle; negative: so deep inside the tool.

        Args:
            segments: (k, 5), see `tool_segments`.
            tips_mm, axes: (n, 3) tip and unit axis (tip to holder); neighbours one after the other are fastest.
            tolerance_mm: > 0.
        Returns:
            (n,) never above the true distance, nor more than the tolerance below it.
        Raises:
            SimulationError: an axis that is no unit vector, or a segment that is none.
        """
        tips, axes = _rows(tips_mm, "tips_mm"), _units(axes, "axes")
        return kernels.distances(self.arrays, tips, axes, _segments(segments), FAR_MM, _above_zero(tolerance_mm))[0]

    def certified_clearance(self, segments, moves, margin_mm, cap_mm=None, tolerance_mm=1e-3):
        """Whether moves keep a margin all the way, not only at their ends.

        Args:
            segments: (k, 5).   moves: ToolMoves; those that follow on each other use what the one before has proven.
            margin_mm: wanted; negative allows so deep a touch.
            cap_mm: clearances above it are not told apart; None: 3 mm above the margin.
            tolerance_mm: a move that keeps the margin by less than this may count as not clear.
        Returns:
            MoveClearance.
        Raises:
            SimulationError: an axis that is no unit vector or turns by half a turn, a segment that is none, a cap
                below the margin.
        """
        tips = [_rows(t, name) for t, name in ((moves.start_tips_mm, "start_tips_mm"), (moves.end_tips_mm, "end_tips_mm"))]
        axes = [_units(a, name) for a, name in ((moves.start_axes, "start_axes"), (moves.end_axes, "end_axes"))]
        cap = margin_mm + LOOK_MM if cap_mm is None else float(cap_mm)
        if cap <= margin_mm:
            raise SimulationError(f"clearances are capped at {cap} mm, the margin is {margin_mm} mm: raise the cap")
        opposite = np.einsum("ij,ij->i", *axes) < -0.999
        if opposite.any():
            raise SimulationError("a move turns the axis by half a turn, which has no way of its own: split it",
                                  rows=np.flatnonzero(opposite))
        n = len(tips[0])
        lower, is_clear, place = np.full(n, cap), np.ones(n, bool), np.full((n, 3), np.nan)
        for row in _sliced(_segments(segments)):
            kernels.certify(self.arrays, *tips, *axes, row[None], lever_mm(row[None]), float(margin_mm), cap,
                            _above_zero(tolerance_mm), lower, is_clear, place)
        return MoveClearance(clearance_mm=lower, is_clear=is_clear, place_mm=place)


def lever_mm(segments):
    """Farthest point of a tool from its tip."""
    s = np.asarray(segments)
    return float((np.maximum(fixed.hypot(s[:, 0], s[:, 1]), fixed.hypot(s[:, 2], s[:, 3])) + s[:, 4]).max(initial=0.0))


def tool_segments(tool, spindle_head=(), with_flutes=True):
    """A tool as convex segments of revolution.

    Args:
        tool: cutters.Tool.
        spindle_head: (height_mm, diameter_mm) cylinders above the holder's top, from below.
        with_flutes: False: only what must never touch.
    Returns:
        (k, 5) rows (z0, r0, z1, r1, grow): a frustum above the tip, grown by a ball; mm.
    """
    rest = np.array([*tool.non_cutting_frusta(), *head_frusta(tool, spindle_head)])
    rest = np.column_stack([rest, np.zeros(len(rest))])
    return np.vstack([flute_segments(tool.cutter), rest]) if with_flutes else rest


def shank_and_holder(tool):
    """((k, 5) segments of neck and shank, (j, 5) of the holder and all above it): what must never touch."""
    rest = tool_segments(tool, with_flutes=False)
    is_holder = rest[:, 0] >= tool.stick_out_mm - NEARLY_MM
    return rest[~is_holder], rest[is_holder]


def head_frusta(tool, spindle_head):
    """[(z0, r, z1, r), ...] of the spindle head's cylinders above the holder of a tool."""
    return stacked_head(spindle_head, tool.length_mm)


def stacked_head(spindle_head, z):
    """The same from a height on, mm."""
    rows = []
    for height, diameter in spindle_head:
        rows.append((z, diameter / 2, z + height, diameter / 2))
        z += height
    return rows


def flute_segments(cutter):
    """(k, 5) segments of the cutting part: corners as grown discs where they end below the flutes, else chords."""
    profile, rows = cutter.profile, []
    for k in range(len(profile.start_mm)):
        rho, ends = profile.arc_radius_mm[k], np.array([profile.start_mm[k], profile.end_mm[k]])
        center = profile.center_mm[k]
        if rho > 0 and center[0] >= 0 and center[1] + rho <= profile.height_mm:
            rows.append((center[1], center[0], center[1], center[0], rho))
            continue
        if rho > 0:
            first, last = profile.arc_angles_rad[k]
            steps = int(np.ceil((last - first) / (2 * fixed.arccos(max(1 - SAGITTA_MM / rho, -1.0))))) + 1
            turn = np.linspace(first, last, steps)[:, None]
            ends = center + rho * np.hstack([fixed.cos(turn), fixed.sin(turn)])
        grow = SAGITTA_MM if rho > 0 else 0.0
        rows += [(z0, r0, z1, r1, grow) for (r0, z0), (r1, z1) in zip(ends[:-1], ends[1:]) if z1 > z0]
    return np.maximum(np.array(rows), 0.0)


def _sliced(segments):
    """Segments cut across so that no slice's farthest point is much farther from the tip than its nearest.

    Turning uses up what a distance proves in proportion to that: the upper end of a tool turns fast, but far away.
    """
    for row in segments:
        z0, r0, z1, r1, grow = row
        near, far = fixed.hypot(z0, r0), fixed.hypot(z1, r1)
        is_cut = grow == 0 and far > near > 0
        pieces = int(np.ceil(fixed.log(far / near) / fixed.log(SLICE_RATIO))) if is_cut else 1
        share = np.linspace(0.0, 1.0, pieces + 1)
        for a, b in zip(share[:-1], share[1:]):
            yield np.array([z0 + a * (z1 - z0), r0 + a * (r1 - r0), z0 + b * (z1 - z0), r0 + b * (r1 - r0), grow])


def _rows(values, name):
    return for_kernel(frozen(values, (None, 3), name))


def _units(values, name):
    rows = _rows(values, name)
    wrong = np.abs(np.linalg.norm(rows, axis=1) - 1.0) > UNIT
    if wrong.any():
        raise SimulationError(f"{name}: a tool axis must have length 1", rows=np.flatnonzero(wrong))
    return rows


def _segments(values):
    rows = for_kernel(frozen(values, (None, 5), "segments"))
    if not len(rows) or (rows[:, 2] < rows[:, 0]).any() or (rows[:, [1, 3, 4]] < 0).any() \
            or ((rows[:, 2] == rows[:, 0]) & (rows[:, 1] != rows[:, 3])).any():
        raise SimulationError("a tool's segments are rows (z0, r0, z1, r1, grow) with z1 >= z0 and no radius below 0, "
                              "equal radii where z1 = z0")
    return rows


def _above_zero(tolerance_mm):
    if not tolerance_mm > 0:
        raise SimulationError(f"the tolerance of a clearance must be above 0, not {tolerance_mm} mm")
    return float(tolerance_mm)
