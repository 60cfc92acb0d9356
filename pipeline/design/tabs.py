r"""Tabs: bridges of stock that a contour leaves between the part and what is cut away around it, so that neither moves.

      top  _________            near: along the wall; far: on the other side of the cutter's way
          |         `-._        up straight, down by a ramp, or straight too
      ____|  stays      `-.__   foot
"""

import numpy as np

from cuspline.values.models import Model, Point


class Tab(Model):
    """What is wanted left; lines of places with the same number, part coordinates, mm."""

    setup: str
    operation: str
    width_mm: float             # where it is narrowest
    height_mm: float            # of its top above its foot
    near_top: tuple[Point, ...]
    near_foot: tuple[Point, ...]
    far_top: tuple[Point, ...]
    far_foot: tuple[Point, ...]
    core_top: tuple[Point, ...]         # of its narrowest part: near and far, at one side and the other
    core_foot: tuple[Point, ...]

    @property
    def why(self):
        """Why no tool is to go there."""
        return "a tab is left here"

    @property
    def place_mm(self):
        """(3,) the middle of its foot."""
        return np.mean(np.array(self.core_foot), axis=0)

    def triangles(self):
        """((n, 3) corners, (m, 3)) of the body that it takes at most."""
        lines = [np.array(line) for line in (self.near_top, self.far_top, self.far_foot, self.near_foot)]
        n, strips = len(lines[0]), []
        for k in range(4):
            a, b = k * n, (k + 1) % 4 * n
            strips += [(a + i, b + i, a + i + 1) for i in range(n - 1)] + [(a + i + 1, b + i, b + i + 1) for i in range(n - 1)]
        ends = [corner for i in (0, n - 1) for corner in ((i, n + i, 2 * n + i), (i, 2 * n + i, 3 * n + i))]
        return np.vstack(lines), np.array([*strips, *ends])

    def core_places(self, count):
        """(count, count, count, 3) places within its narrowest part, from its foot up along the last but one axis."""
        share = (np.arange(count) + 0.5) / count
        near, far = np.array([self.core_foot, self.core_top])[:, :2], np.array([self.core_foot, self.core_top])[:, 2:]
        along = lambda ends, s: ends[:, :1] + s * (ends[:, 1:] - ends[:, :1])
        rows = [along(np.stack([along(near, s), along(far, s)], axis=1)[:, :, 0], t)[:, 0] for s in share for t in share]
        foot, top = np.array(rows).transpose(1, 0, 2)
        return (foot[:, None] + share[None, :, None] * (top - foot)[:, None]).reshape(count, count, count, 3)
