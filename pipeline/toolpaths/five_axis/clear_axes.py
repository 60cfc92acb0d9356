r"""Tool axes that clear what is in the way: the smallest angle from a standard direction, in one plane or over both angles.

      wall | standard          The ball's middle stands, so no angle makes the ball gouge; flutes above it, neck, shank,
           |  |   / clearing   holder and spindle head must keep their margins.  A bearing says which way the axis turns:
           |  |  /             0 toward the normal, half a turn away from it, others across the plane of both.
           |  o /
    _______|__/_______
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from cuspline.replay.clearance import ClearanceTree, flute_segments, shank_and_holder
from cuspline.replay.clearance_kernels import BOTTOM, GROW, TOP
from cuspline.toolpaths.five_axis.clear_axis_kernels import SPANNED, clear_rows, go_on, smallest_angles
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.threads import in_blocks

BLOCK = 512                 # rows that one thread takes at a time; neighbours help each other
BEARINGS = 24               # looked at first over both angles, then between the best and its neighbours
HALVINGS = 6                # of the way to these: to a quarter of a degree of bearing
SAME_WAY = 1e-6             # a normal nearer to the axis than this spans no plane with it
NEARLY = 0.9                # of a unit vector's X: along X


@dataclass(frozen=True, eq=False, kw_only=True)
class AxisSearch:
    """A ball on a tool, and triangles that the rest of the tool must keep off."""

    tree: ClearanceTree
    segments: np.ndarray        # (k, 5) of replay/clearance.py, grown by what they must keep off
    radius_mm: float            # from the tip to the middle that the tool turns about
    limit_rad: float = math.pi  # the axis leans no farther from Z
    beside: ClearanceTree | None = None                         # what flutes may cut and all the rest must keep off
    beside_segments: np.ndarray = field(default_factory=lambda: np.empty((0, 5)))       # (j, 5) of all the rest

    def __post_init__(self):
        for name in ("segments", "beside_segments"):
            object.__setattr__(self, name, frozen(getattr(self, name), (None, 5), name))

    @classmethod
    def of_tool(cls, tree, tool, *, into_mm=0.0, keep_mm=0.0, limit_rad=math.pi):
        """A ball cutter's own.

        Args:
            tree: ClearanceTree.   tool: shop.cutters.Tool, in its spindle where that counts (`ToolLibrary.in_spindle`).
            into_mm: so deep may flutes come, which touch by design.   keep_mm: so far must all the rest stay
                off; a pair: neck and shank, and holder with what is above it.
        """
        radius = tool.cutter.radius_mm
        flutes = flute_segments(tool.cutter)
        flutes = flutes[~((flutes[:, BOTTOM] == flutes[:, TOP]) & (flutes[:, BOTTOM] <= radius))]     # the ball stands
        return cls(tree=tree, segments=np.vstack([_grown(flutes, -into_mm), _rest(tool, keep_mm)]), radius_mm=radius,
                   limit_rad=limit_rad)

    def with_beside(self, beside, tool, keep_mm):
        """The same beside a ClearanceTree that flutes may go through and all the rest must keep off; None: beside nothing."""
        return self if beside is None else replace(self, beside=beside, beside_segments=_rest(tool, keep_mm))

    def angles_rad(self, middles_mm, axes, ways, most_rad):
        """Smallest clearing angles, each row in its own plane.

        Args:
            middles_mm: (n, 3) of the ball; neighbours one after the other are fastest.
            axes: (n, 3) unit, the standard directions.   ways: (n, 3) unit, square to them: where to they turn.
            most_rad: scalar or (n,); below 0: not looked for.
        Returns:
            (n,) proven clear there; inf: none up to `most_rad`.
        """
        n = len(middles_mm)
        angles, most = np.empty(n), np.broadcast_to(np.asarray(most_rad, float), (n,))
        in_blocks(smallest_angles, n, BLOCK, *self._in_the_way, for_kernel(middles_mm), for_kernel(axes), for_kernel(ways),
                  for_kernel(most), self._lowest_z, self.radius_mm, angles)
        return angles

    def is_clear(self, middles_mm, axes):
        """(n,) bool: proven clear, and within the limit.   middles_mm, axes: (n, 3)."""
        is_clear = np.empty(len(middles_mm), bool)
        in_blocks(clear_rows, len(middles_mm), BLOCK, *self._in_the_way, for_kernel(middles_mm), for_kernel(axes), self.radius_mm,
                  is_clear)
        return is_clear & (np.asarray(axes)[:, 2] >= self._lowest_z)

    def over_both_rad(self, middles_mm, axes, normals, most_rad):
        """Smallest clearing angles whichever way the axis turns.

        Returns:
            (n,) angles, inf: none, and (n,) bearings of `ways_of`.
        """
        n = len(middles_mm)
        best, bearing = np.full(n, np.inf), np.zeros(n)

        def look(bearings):
            """Whether the same bearings (n,) are better."""
            ways = ways_of(axes, normals, bearings)
            found = self.angles_rad(middles_mm, axes, ways, np.where(best > 0.0, np.minimum(best, most_rad), -1.0))
            better = found < best
            best[better], bearing[better] = found[better], bearings[better]

        step = 2 * math.pi / BEARINGS
        for k in range(BEARINGS):
            look(np.full(n, k * step))
        for _ in range(HALVINGS):
            step, middle = step / 2, bearing.copy()
            look(middle - step)
            look(middle + step)
        return best, bearing

    @property
    def _in_the_way(self):
        """(mesh, its segments, what stands beside, its segments) for the kernels."""
        beside = self.tree if self.beside is None else self.beside
        return self.tree.arrays, for_kernel(self.segments), beside.arrays, for_kernel(self.beside_segments)

    @property
    def _lowest_z(self):
        return -1.0 if self.limit_rad >= math.pi else fixed.cos(self.limit_rad)


def square_to(axes):
    """(n, 3) unit, square to the axes: X as seen along these, Y where they are nearly along X."""
    other = np.where(np.abs(axes[:, :1]) < NEARLY, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    level = other - (other * axes).sum(axis=1)[:, None] * axes
    return level / np.sqrt((level * level).sum(axis=1))[:, None]


def ways_of(axes, normals, bearings_rad):
    """(n, 3) unit, square to the axes: bearing 0 is toward the normal, then round to the right, seen along the axis.

    Where axis and normal coincide it is `square_to`: the same way in space on a pass to and on one fro.
    """
    level, length = _level(axes, normals)
    return toward(axes, np.where(length > SAME_WAY, level / np.maximum(length, 1e-300), square_to(axes)), bearings_rad)


def zero_ways(axes, normals):
    """(n, 3) unit, square to the axes: the ways of bearing 0 at stations along a run, none far from that of the station before.

    Toward the normal or straight away from it, whichever goes on as before: a run may pass from one side of a hollow to the
    other.  Where axis and normal hardly differ the way is the one before, at the beginning the one behind.
    """
    level, length = _level(axes, normals)
    spans = length[:, 0] > SPANNED
    found, first = square_to(axes), int(np.argmax(spans))
    if len(found):
        level /= np.maximum(length, 1e-300)
        go_on(for_kernel(axes), level, spans, found, first)
    return found


def square(axes, ways):
    """(n, 3) unit, what is left of ways (n, 3) square to the axes; of one along its axis `square_to`."""
    level, length = _level(axes, ways)
    return np.where(length > SPANNED, level / np.maximum(length, 1e-300), square_to(axes))


def _level(axes, ways):
    """((n, 3) parts of ways square to the axes, (n, 1) how long they are)."""
    level = ways - (ways * axes).sum(axis=1)[:, None] * axes
    return level, np.sqrt((level * level).sum(axis=1))[:, None]


def toward(axes, zero, bearings_rad):
    """(n, 3) unit: ways of bearings (n,), from the ways of bearing 0 round to the right, seen along the axis."""
    return fixed.cos(bearings_rad)[:, None] * zero + fixed.sin(bearings_rad)[:, None] * np.cross(zero, axes)


def turned(axes, ways, angles_rad):
    """(n, 3) axes turned by angles (n,) toward the ways."""
    return fixed.cos(angles_rad)[:, None] * axes + fixed.sin(angles_rad)[:, None] * ways


def _rest(tool, keep_mm):
    """(k, 5) segments above the flutes, grown by what they must keep off: neck and shank, and holder with what is above it."""
    return np.vstack([_grown(part, mm) for part, mm in zip(shank_and_holder(tool), np.broadcast_to(keep_mm, 2))])


def _grown(segments, by_mm):
    found = np.array(segments, float)
    found[:, GROW] += by_mm
    return found
