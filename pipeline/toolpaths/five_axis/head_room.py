"""Whether what goes with the tool beside its spindle, a fork or a ram, has room over all that stands, in one indexed position.

Both are looked at along the tool, on grids: how low the head hangs from the gauge line, how high the part stands.  A node speaks
for all round it: what a disc there can meet.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cuspline.toolpaths.drop.disc_tops import DiscTops
from cuspline.values.frames import Frame

PITCH_MM = 5.0              # of both grids
OWN_SHARE, BESIDE_SHARE = 0.75, 1.5     # of the pitch: a disc that holds a node's cell; and, wherever both grids lie, the other's


@dataclass(frozen=True, eq=False)
class HeadRoom:
    """What stands, and a head over it, in a position whose tool points along `way`; frames of the part."""

    way: np.ndarray         # (3,) unit, from the tip to the holder
    standing: tuple         # (v, 3) vertices and (t, 3) triangles
    head: tuple             # the same, from the spindle's gauge point
    keep_mm: float          # between both

    def is_free(self, gauge_mm):
        """Whether the head keeps clear, and may be lifted off along the tool, with its gauge point at each of (n, 3) places."""
        low, hangs = self._head
        corner, stands = self._standing
        for place in self._along.into(gauge_mm):
            first = np.rint((place[:2] + low - corner) / PITCH_MM).astype(np.int64)
            begin, end = np.maximum(first, 0), np.minimum(first + hangs.shape, stands.shape)
            if (begin < end).all():
                (i, j), (m, n) = begin - first, end - first
                if (place[2] + hangs[i:m, j:n] < stands[begin[0]:end[0], begin[1]:end[1]] + self.keep_mm).any():
                    return False
        return True

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
