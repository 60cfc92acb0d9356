r"""Depths of a leaning, turning cutter's moves for the certificate, sub-step by sub-step.

        ║ ║          The ball of a ball cutter is the same however the tool leans.  From sub-step to sub-step its centre
        ║ ║          runs straight within R w² / 8, w the turn, so it is held against the exact faces as a ball that
        ║_║          moves without leaning, from above and from below (certificate_side.py).
       (   )
        ‾‾‾          Its flanks are swept straight with the axis of their middle, what turning adds to that is taken off, and
                     stretches are halved until that is little (replay/clearance.py).
       (|_|)
       (___)         A cutter of any other outline is held against the exact faces whole (toolpaths/gouge/leaning_depths.py).

Flanks of balls, and cones, are held against triangles of the faces, flanks first against coarse ones.  How far the faces lie
off those is measured, not proven, and counts in full.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cuspline.kernel.tessellation import tessellate
from cuspline.replay.clearance import ClearanceTree, ToolMoves, flute_segments
from cuspline.shop.cutters import POINTED
from cuspline.stock.tilted_pieces import AXIS, TIP, TURN, WAY, posed_pieces
from cuspline.toolpaths.gouge.leaning_depths import FaceBoxes, body_outline
from cuspline.values import fixed_math as fixed
from cuspline.verification.certificate_side import SideViews

LONGEST_RADII = 2.0         # of a sub-step
MESH_SHARE = 0.25           # of the tolerance: the triangles' deviation
COARSER = 10.0              # times as much, and so many times fewer triangles: most flanks keep clear of these
PIECE_SHARE = 100.0         # of the tolerance: how thick pieces of faces may be, they are halved where a cutter touches
CLOSE_SHARE = 0.1           # of the tolerance: how closely flanks are looked at
CONE_SHARE = 0.75           # of the tolerance: how deep a cone may seem to touch what it has made, the triangles' chords counted
CONE_CLOSE_SHARE = 0.2      # of it: how closely that is looked at
DEEPER = 4.0                # times as deep a bound is looked for where one does not hold
SAME_LINE_MM, SAME_AXIS = 1e-7, 1e-9    # moves along one line
MOST_TRIANGLES = 500_000    # of the faces; coarser ones are used where there would be more


@dataclass(frozen=True, eq=False, kw_only=True)
class LeaningViews:
    """A part as leaning cutters meet it."""

    solid: object               # TopoDS_Solid, WCS
    thickness_mm: float         # of the trees' pieces
    tolerance_mm: float

    @cached_property
    def _ball(self):
        return SideViews(solid=self.solid, axis=(0.0, 0.0, 1.0), thickness_mm=self.thickness_mm)

    @cached_property
    def _faces(self):
        return FaceBoxes.of_solid(self.solid, PIECE_SHARE * self.tolerance_mm)

    @cached_property
    def _coarse_mesh(self):
        """(ClearanceTree, deviation) of the part in triangles that are soon made."""
        return _tree_of(self._coarse_triangles)

    @cached_property
    def _mesh(self):
        """(ClearanceTree, deviation) of the part."""
        expected = len(self._coarse_triangles.triangles) * COARSER
        return _tree_of(tessellate(self.solid, MESH_SHARE * self.tolerance_mm * max(1.0, expected / MOST_TRIANGLES)))

    @cached_property
    def _coarse_triangles(self):
        return tessellate(self.solid, COARSER * MESH_SHARE * self.tolerance_mm)

    def depths(self, posted, rows, tool, skin_mm, ask):
        """Depths of moves, each by its deepest sub-step.

        Args:
            posted: PostedMoves.   rows: (k,) of the tool, growing.   skin_mm: of the cutter, that is left out.
            ask: move_depths, or answers as it does.
        Returns:
            (k,) bounds, (k,) shares of the way, (k, 3) places: the tip where none is known.
        """
        cutter, profile = tool.cutter, tool.cutter.profile
        reach = float(fixed.hypot(profile.largest_radius_mm, profile.height_mm))
        pieces = posed_pieces(posted, rows, LONGEST_RADII * profile.largest_radius_mm, reach)
        g = pieces.geometry
        tip_at = lambda share: g[:, TIP:WAY] + share[:, None] * g[:, WAY:AXIS]
        if cutter.type == "ball":
            depth, share, place = self._ball_depths(cutter, pieces, skin_mm, ask)
        elif cutter.type in POINTED:
            depth, place = self._cones(flute_segments(cutter), ToolMoves.of_substeps(g), skin_mm)
            share = np.full(len(g), 0.5)
        else:
            depth, share, place = self._faces.depths(g, body_outline(cutter), self.tolerance_mm, skin_mm)
        depth = np.where(depth > 0, depth + pieces.error_mm, 0.0)
        return _deepest(pieces.row, depth, _share_of_move(pieces.row, share), np.where(np.isfinite(place), place, tip_at(share)))

    def _ball_depths(self, cutter, pieces, skin_mm, ask):
        """(m,) depths of a ball cutter's sub-steps, (m,) where along them, (m, 3) of which place."""
        g, corner, moves = pieces.geometry, cutter.radius_mm, ToolMoves.of_substeps(pieces.geometry)
        centers = [t + corner * a for t, a in ((moves.start_tips_mm, moves.start_axes), (moves.end_tips_mm, moves.end_axes))]
        depth, share, place = self._ball.of_ball(*centers, corner - skin_mm, self.tolerance_mm, ask)
        depth = depth + corner * g[:, TURN] ** 2 / 8
        segments = flute_segments(cutter)
        flank, flank_place = self._flanks(segments[segments[:, 4] != corner], moves, skin_mm)
        is_flank = flank > depth
        depth = _of_whole_cutter(np.where(is_flank, flank, depth), corner, cutter.largest_radius_mm)
        return depth, np.where(is_flank, 0.5, share), np.where(is_flank[:, None], flank_place, place)

    def _cones(self, segments, moves, skin_mm):
        """(m,) how deep faces come to lie in a cone and the cylinder on it at most, (m, 3) where.

        Of both together a point may lie deeper than in either alone: so the body is made smaller all round until it keeps clear.
        """
        n = len(moves.start_tips_mm)
        depth, place = np.zeros(n), np.full((n, 3), np.nan)
        tree, off = self._mesh
        less, most = skin_mm + CONE_SHARE * self.tolerance_mm, float(segments.max())
        closely = lambda less: CONE_CLOSE_SHARE * max(self.tolerance_mm, less - skin_mm)
        inner = _smaller(segments, less)
        plunges, of_plunge = _plunges(moves)
        in_one = np.flatnonzero(of_plunge >= 0)
        if len(inner) and len(in_one):
            found = tree.certified_clearance(inner, plunges, off, tolerance_mm=closely(less))
            depth[in_one], place[in_one] = less - skin_mm, found.place_mm[of_plunge[in_one]]
            of_plunge[in_one[~found.is_clear[of_plunge[in_one]]]] = -1
        left = np.flatnonzero(of_plunge < 0)
        while len(left):
            inner = _smaller(segments, less)
            if not len(inner):
                depth[left] = most
                break
            found = tree.certified_clearance(inner, moves.only(left), off, tolerance_mm=closely(less))
            depth[left], place[left] = np.where(found.is_clear, less - skin_mm, most), found.place_mm
            left = left[~found.is_clear]
            less = skin_mm + DEEPER * (less - skin_mm)
        return depth, place

    def _flanks(self, segments, moves, skin_mm):
        """(m,) how deep faces come to lie in segments at most, (m, 3) where."""
        n = len(moves.start_tips_mm)
        depth, place = np.zeros(n), np.full((n, 3), np.nan)
        if not len(segments):
            return depth, place
        tree, off = self._coarse_mesh
        left = np.flatnonzero(~tree.certified_clearance(segments, moves, off - skin_mm, tolerance_mm=off).is_clear)
        allowed, most = 0.0, float(segments.max())
        while len(left) and allowed < most:
            tree, off = self._mesh
            found = tree.certified_clearance(segments, moves.only(left), off - skin_mm - allowed, tolerance_mm=max(
                CLOSE_SHARE * self.tolerance_mm, CLOSE_SHARE * allowed))
            clear = found.is_clear
            depth[left] = np.where(clear, np.maximum(off - skin_mm - found.clearance_mm, 0.0), most)
            place[left] = found.place_mm
            left, allowed = left[~clear], DEEPER * allowed if allowed else self.tolerance_mm / 2
        return depth, place


def _tree_of(mesh):
    """(ClearanceTree, deviation) of a mesh."""
    return ClearanceTree.of_triangles(mesh.vertices_mm, mesh.triangles), mesh.deviation_mm


def _plunges(moves):
    """Moves along the tool's own axis, those on one line together: (ToolMoves from the highest tip to the lowest, one a line;
    (n,) which of them each move is a part of, -1: of none).

    A hole is pecked in dozens of moves that sweep parts of what the deepest one does.
    """
    axis, way = moves.start_axes, moves.end_tips_mm - moves.start_tips_mm
    is_axial = (np.abs(np.cross(way, axis)).max(axis=1) < SAME_LINE_MM) & (np.abs(moves.end_axes - axis).max(axis=1) < SAME_AXIS)
    along = np.einsum("ic,ic->i", moves.start_tips_mm, axis)
    line = np.column_stack([(moves.start_tips_mm - along[:, None] * axis) / SAME_LINE_MM, axis / SAME_AXIS]).round()
    rows = np.flatnonzero(is_axial)
    _, first, of_row = np.unique(line[rows], axis=0, return_index=True, return_inverse=True)
    of_plunge, first, of_row = np.full(len(axis), -1), rows[first], of_row.reshape(-1)
    of_plunge[rows] = of_row
    low, high = np.full(len(first), np.inf), np.full(len(first), -np.inf)
    for tips in (moves.start_tips_mm, moves.end_tips_mm):
        height = np.einsum("ic,ic->i", tips[rows] - moves.start_tips_mm[first][of_row], axis[rows])
        np.minimum.at(low, of_row, height)
        np.maximum.at(high, of_row, height)
    ends = (moves.start_tips_mm[first] + h[:, None] * axis[first] for h in (high, low))
    return ToolMoves(**dict(zip(("start_tips_mm", "end_tips_mm"), ends)), start_axes=axis[first], end_axes=axis[first]), of_plunge


def _smaller(segments, by_mm):
    """Frusta (k, 5) of a flat, a cone and a cylinder on it whose surface lies so much farther in; none where nothing is left."""
    if by_mm == 0.0:
        return segments
    rows = []
    z0, r0, z1, r1, _ = segments[0]
    if r1 > r0:             # a cone: its side moves along its normal, its flat up
        slope = (z1 - z0) / (r1 - r0)
        lift = by_mm * float(fixed.hypot(1.0, slope))
        radius = max(r0 - (lift - by_mm) / slope, 0.0)
        side = lambda r: z0 + (r - r0) * slope + lift
        low, outer = max(side(radius), z0 + by_mm), r1 - by_mm
        if outer > radius:
            rows.append((low, radius, side(outer), outer, 0.0))
    else:
        outer, low = r1 - by_mm, z0 + by_mm
    top = segments[-1, 2] - by_mm
    base = rows[-1][2] if rows else z0 + by_mm
    if outer > 0 and top > base:
        rows.append((base, outer, top, outer, 0.0))
    return np.array(rows).reshape(-1, 5)


def _of_whole_cutter(depth, corner_mm, largest_mm):
    r"""Depths in a whole cutter, of depths in its parts: a corner that is whole round, and a flank from its middle up.

        │ c↕ │   c above the corner's middle and r from the axis a point lies c deep in the flank, and as deep in the corner as
        (  · )   R - sqrt(r² + c²) says; in both together R - r deep: if m is the larger, R - sqrt(R² - 2 R m) at most
         ‾‾‾‾
    """
    if corner_mm == 0.0:
        return depth
    is_shallow = 2 * depth < corner_mm
    inner = np.sqrt(np.where(is_shallow, corner_mm ** 2 - 2 * corner_mm * depth, 0.0))
    return np.where(is_shallow, corner_mm - inner, np.maximum(depth, largest_mm))


def _share_of_move(row, share):
    """(m,) shares of their moves, of shares of sub-steps."""
    first = np.searchsorted(row, row)
    count = np.searchsorted(row, row, side="right") - first
    return (np.arange(len(row)) - first + share) / count


def _deepest(row, depth, share, place):
    """The same of each move, as its deepest sub-step says."""
    order = np.lexsort((depth, row))
    last = order[np.diff(row[order], append=-1) != 0]
    return depth[last], share[last], place[last]
