r"""Depths of a side-and-face cutter's moves for the certificate: part and path turned until its axis is the kernels' z.

A cutter whose axis keeps its direction sweeps what an upright one would in the frame that is turned with it.  It ends
above as it does below, so the part's faces may touch it from either side of its middle plane:

    faces that look towards the head   seen along the axis, from the cutter's tip
    all the others                     seen against it, from its other face
              ___                      each time the cutter is whole: depth is to the nearer of both its faces
     axis  ──(___)──►                  and to its rim

No face of the part is inside a cutter that is outside, and none in one that is all inside the part: its middle says
which.  That is asked where a path begins, and of all that follows a move so deep that the middle may have gone in.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cuspline.kernel import brep
from cuspline.surfaces.projection import ClosestTree
from cuspline.toolpaths.drop.exact_drop import ExactPart
from cuspline.toolpaths.gouge.depth_tree import DepthTree
from cuspline.values.frames import Frame

WALLS = -1e-6           # faces along the axis count as looking either way


@dataclass(frozen=True, eq=False, kw_only=True)
class SideViews:
    """A part as cutters whose axis points one way meet it."""

    solid: object               # TopoDS_Solid, WCS
    axis: tuple                 # unit, tip towards head, WCS
    thickness_mm: float         # of the trees' pieces

    @cached_property
    def _views(self):
        """(Frame, DepthTree) along the axis, and against it."""
        frames = [frame_along(sign * np.asarray(self.axis)) for sign in (1.0, -1.0)]
        parts = [ExactPart.of_solid(brep.seen_from(self.solid, frame), upward=WALLS) for frame in frames]
        return [(frame, DepthTree.of_part(part, self.thickness_mm)) for frame, part in zip(frames, parts)]

    @cached_property
    def _closest(self):
        return ClosestTree.of_faces(brep.faces_of(self.solid))

    def depths(self, start_mm, end_mm, cutter, skin_mm, tolerance_mm, ask):
        """As `move_depths`, of moves of the cutter's tip (n, 3), WCS; `ask` answers as that does.

        Args:
            cutter: cutters.Cutter of type "side".   skin_mm: of it, that is left out.
        """
        rc, height = max(cutter.corner_radius_mm - skin_mm, 0.0), cutter.flute_length_mm - 2 * skin_mm
        middle = 0.5 * cutter.flute_length_mm * np.asarray(self.axis)
        return self._of_body(start_mm + middle, end_mm + middle, (cutter.radius_mm - skin_mm, rc, height), tolerance_mm, ask)

    def of_ball(self, start_mm, end_mm, radius_mm, tolerance_mm, ask):
        """The same of a ball whose centre moves from `start_mm` to `end_mm` (n, 3)."""
        return self._of_body(start_mm, end_mm, (radius_mm, radius_mm, 2 * radius_mm), tolerance_mm, ask)

    def _of_body(self, start_mm, end_mm, body, tolerance_mm, ask):
        """Of a body (radius, corner radius, height) whose middle moves."""
        radius, rc, height = body
        found = []
        for sign, (frame, tree) in zip((1.0, -1.0), self._views):
            start, end = (frame.into(middle - sign * 0.5 * height * np.asarray(self.axis)) for middle in (start_mm, end_mm))
            depth, share, place = ask(tree, start, end, radius, rc, tolerance_mm, height)
            found.append((depth, share, frame.out(place)))
        (depth, share, place), (other, other_share, other_place) = found
        nearer = other > depth
        depth, share = np.where(nearer, other, depth), np.where(nearer, other_share, share)
        self._raise_swallowed(depth, start_mm, end_mm, min(radius, 0.5 * height))
        return depth, share, np.where(nearer[:, None], other_place, place)

    def _raise_swallowed(self, depth, start_mm, end_mm, most_mm):
        """Give moves whose cutter begins with its middle inside the part the most that a depth can be."""
        begins = np.r_[True, (start_mm[1:] != end_mm[:-1]).any(axis=1)][:len(depth)]
        rows = np.flatnonzero(begins | np.logical_or.accumulate(depth >= most_mm))
        inside = self._closest.signed_distances_mm(start_mm[rows]) < 0
        depth[rows[inside]] = np.maximum(depth[rows[inside]], most_mm)


def frame_along(axis):
    """Frame at the origin whose z is a unit axis (3,)."""
    least = np.zeros(3)
    least[np.abs(axis).argmin()] = 1.0
    x = least - axis * (axis * least).sum()
    return Frame.of_axes(np.zeros(3), x / np.sqrt((x * x).sum()), axis)
