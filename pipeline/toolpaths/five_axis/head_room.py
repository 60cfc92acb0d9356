"""Whether what goes with the tool beside its spindle, a fork or a ram, has room over all that stands, in one indexed position.

Both are looked at along the tool, on grids: how low the head hangs from the gauge line, how high the part stands.  A node speaks
for all round it: what a disc there can meet.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cuspline.toolpaths.drop.disc_tops import DiscTops
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.frames import Frame
from cuspline.values.rows import X, Y, Z

PITCH_MM = 5.0              # of both grids
OWN_SHARE, BESIDE_SHARE = 0.75, 1.5     # of the pitch: a node's cell reaches 0.71; with the rounding from grid to grid 1.41


@dataclass(frozen=True, eq=False)
class HeadRoom:
    """What stands, and a head over it, in a position whose tool points along `way`; frames of the part."""

    way: np.ndarray         # (3,) unit, from the tip to the holder
    standing: tuple         # (v, 3) vertices and (t, 3) triangles
    head: tuple             # the same, from the spindle's gauge point
    keep_mm: float          # between both

    def is_free(self, gauge_mm):
        """Whether the head keeps clear, and may be lifted off along the tool, with its gauge point at each of (n, 3) places."""
        if not len(gauge_mm):
            return True
        low, hangs = self._head
        corner, stands = self._standing
        places = self._along.into(gauge_mm)
        first = np.rint((places[:, :2] + low - corner) / PITCH_MM).astype(np.int64)
        return _is_above(for_kernel(first, np.int64), for_kernel(places[:, Z]), hangs, stands + self.keep_mm)

    @cached_property
    def _along(self):
        return Frame.along(self.way)

    @cached_property
    def _head(self):
        """((2,) its grid's first node, (i, j) how low it hangs)."""
        vertices, triangles = self.head
        low, tops = _tops(self._along.into(vertices) * (1.0, 1.0, -1.0), triangles, OWN_SHARE * PITCH_MM)
        return low, -tops

    @cached_property
    def _standing(self):
        """The same of what stands, how high it does."""
        vertices, triangles = self.standing
        return _tops(self._along.into(vertices), triangles, BESIDE_SHARE * PITCH_MM + self.keep_mm)


def _tops(vertices, triangles, disc_mm):
    """((2,) first node, (i, j) how high a mesh stands under discs at the nodes of a grid; -inf: nothing does)."""
    low, high = vertices[:, :2].min(axis=0) - disc_mm, vertices[:, :2].max(axis=0) + disc_mm
    count = np.ceil((high - low) / PITCH_MM).astype(np.int64) + 1
    nodes = low + PITCH_MM * np.stack(np.meshgrid(*map(np.arange, count), indexing="ij"), axis=2).reshape(-1, 2)
    box = np.column_stack([vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)]).ravel()
    return low, DiscTops.of_triangles(vertices[triangles], box, disc_mm).over(nodes).reshape(count)


@njit
def _is_above(first, z, hangs, stands):
    """Whether a grid of heights, its first node on nodes (n, 2) of another and z (n,) higher, is nowhere below that one."""
    (rows, columns), (all_rows, all_columns) = hangs.shape, stands.shape
    for place in range(len(z)):
        i, j = first[place, X], first[place, Y]
        for k in range(max(i, 0), min(i + rows, all_rows)):
            for m in range(max(j, 0), min(j + columns, all_columns)):
                if z[place] + hangs[k - i, m - j] < stands[k, m]:
                    return False
    return True
