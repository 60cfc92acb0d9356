"""Closest points on trimmed faces, edges and corners included: for points measured, simulated or planned.

Every face is cut into pieces that turn little, every edge into stretches; a tree of boxes over both is searched by
`projection_kernels`.  Where a foot lies within CHORD_MM of a border, either side of the border may be answered: the
distance is then wrong by at most CHORD_MM, and by its square over the distance away from the face.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.surfaces import projection_tree
from cuspline.surfaces.patches import PatchSet
from cuspline.surfaces.projection_kernels import CHUNK, NOWHERE, project_rows, refine_rows
from cuspline.surfaces.projection_tree import TreeArrays
from cuspline.surfaces.trims import CHORD_MM, TrimSet
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.errors import PlanError
from cuspline.values.frames import Frame
from cuspline.values.threads import in_blocks

SQUARE = 0.999              # cosine of a way to the normal: nearer to 1 the foot is a perpendicular's
STEP, ASIDE = 0.1, 3.0      # of a distance: from its foot so much back along the way, and so many times that aside of it
MOST_TURNS = 12             # each leaves less than a third of the distance
LEAST_MM = 1e-12            # a way shorter than this has no direction
ONE_LINE = 1e-6             # sine between a way and a normal


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosestPoints:
    """The nearest point of the faces to each of n points."""

    distance_mm: np.ndarray     # (n,)
    point_mm: np.ndarray        # (n, 3)
    face: np.ndarray            # (n,) int
    u: np.ndarray               # (n,) parameters of the face's `nurbs`
    v: np.ndarray               # (n,)
    normal: np.ndarray          # (n, 3) unit, out of the material; NaN at a pole
    is_edge: np.ndarray         # (n,) bool: on an edge or corner; `face` is then one of the faces that meet there

    def __post_init__(self):
        n = len(self.distance_mm)
        for name, shape, dtype in (("distance_mm", (n,), float), ("point_mm", (n, 3), float), ("face", (n,), np.int64),
                                   ("u", (n,), float), ("v", (n,), float), ("normal", (n, 3), float),
                                   ("is_edge", (n,), bool)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))

    def __len__(self):
        return len(self.distance_mm)

    def only(self, rows):
        """The chosen ones."""
        return ClosestPoints(**{name: value[rows] for name, value in vars(self).items()})


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosestTree:
    """Pieces of faces and edges under a tree of boxes; made once for a part."""

    patches: PatchSet
    trims: TrimSet
    nodes: np.ndarray       # (m, 6) boxes, low and high
    children: np.ndarray    # (m, 2) int: both children, or -1 - first and end of a run of `order`
    order: np.ndarray       # (k,) int: leaves
    boxes: np.ndarray       # (k, 6)
    geometry: np.ndarray    # (k, 28) see `projection_tree.measure`
    rows: np.ndarray        # (k, 4) int: face; patch or offset into curves; state in the trim, -1 for an edge; degree
    curves: np.ndarray      # (c,) power coefficients of the edges' curves
    round: np.ndarray       # (k, 17) leaves of cylinders, cones and circles: see `round_pieces`

    @classmethod
    def of_faces(cls, faces, *, geometry=None):
        """The tree of `brep.Face` values; `geometry` = (PatchSet, TrimSet) of them if at hand.

        Raises:
            PlanError: no face at all.
        """
        if not len(faces):
            raise PlanError("closest points need at least one face")
        patches, trims = geometry or (PatchSet.of_faces(faces), TrimSet.of_faces(faces))
        boxes, shape, rows, rounds, curves = projection_tree.leaves(faces, patches, trims)
        nodes, children, order = projection_tree.grown(boxes)
        return cls(patches=patches, trims=trims, nodes=frozen(nodes, (None, 6), "nodes"),
                   children=frozen(children, (None, 2), "children", np.int64),
                   order=frozen(order, (None,), "order", np.int64), boxes=frozen(boxes, (None, 6), "boxes"),
                   geometry=frozen(shape, (None, 28), "geometry"), rows=frozen(rows, (None, 4), "rows", np.int64),
                   curves=frozen(curves, (None,), "curves"), round=frozen(rounds, (None, 17), "round"))

    @property
    def arrays(self):
        """What kernels take as one argument."""
        return TreeArrays(self.nodes, self.children, self.order, self.boxes, self.geometry, self.rows, self.curves,
                          self.round)

    def closest_points(self, points_mm, face=None):
        """Nearest points of the faces, edges and corners.

        Args:
            points_mm: (n, 3); fastest when neighbours in the row are neighbours in space.
            face: one face index or (n,) of them to look at alone; None: all.
        Returns:
            ClosestPoints.
        """
        points = for_kernel(points_mm).reshape(-1, 3)
        n = len(points)
        wanted = for_kernel(np.broadcast_to(NOWHERE if face is None else face, (n,)), np.int64)
        distance, foot, owner, uv = np.empty(n), np.empty((n, 3)), np.empty(n, np.int64), np.empty((n, 2))
        normal, is_edge = np.empty((n, 3)), np.empty(n, np.bool_)
        in_blocks(project_rows, n, CHUNK, self.arrays, self.patches.arrays, self.trims.arrays, points, wanted, distance,
                  foot, owner, uv, normal, is_edge)
        return ClosestPoints(distance_mm=distance, point_mm=foot, face=owner, u=uv[:, 0], v=uv[:, 1], normal=normal,
                             is_edge=is_edge)

    def seen_from(self, frame):
        """The same for points in a frame, a Frame as it is seen from this tree's: nothing is made again."""
        return TurnedTree(tree=self, frame=frame)

    def signed_distances_mm(self, points_mm):
        """(n,) distances of points (n, 3) from the faces of a whole part, negative inside it."""
        points = for_kernel(points_mm).reshape(-1, 3)
        near = self.closest_points(points)
        return np.where(self._are_outside(points, near), near.distance_mm, -near.distance_mm)

    def _are_outside(self, points, near):
        r"""(n,) bool: points on the air side of the faces; `near`: ClosestPoints of them.

             p · · q     Where the foot F is a perpendicular's, the face's normal says it.  On an edge or corner the normal of one
               |/        of the faces there does not: p stands in the air over F, and yet behind the plane of the side face, if the
            \  F\        edge is sharper than square.  But the ball about p that touches F is empty, so every place q in it is on
             \ | \       the side that p is on; aside of the way to p it stands over one face or the other, or nearer to that.
        """
        are_outside = _cosines(points, near) >= 0.0
        rows = np.arange(len(points))
        for turn in range(MOST_TURNS):
            left = ~_are_square(points, near) & (near.distance_mm > CHORD_MM)
            if not left.any():
                break
            rows, (points, near) = rows[left], self._aside(points[left], near.only(left), across=turn % 2 == 1)
            are_outside[rows] = _cosines(points, near) >= 0.0
        return are_outside

    def _aside(self, points, near, across):
        """Of two places beside each foot, both in the point's empty ball, the one more square to its own: (m, 3), ClosestPoints.

        They lie in the plane of the way and the normal, or across it.
        """
        way, step = _ways(points, near), STEP * near.distance_mm[:, None]
        aside = _square_to_way(way, np.nan_to_num(near.normal))
        aside = ASIDE * (np.cross(way, aside) if across else aside)
        places = np.concatenate([near.point_mm + step * (way + aside), near.point_mm + step * (way - aside)])
        found = self.closest_points(places)
        one, other = np.split(np.abs(_cosines(places, found)) + _are_square(places, found), 2)
        best = np.arange(len(points)) + len(points) * (other > one)
        return places[best], found.only(best)


@dataclass(frozen=True, eq=False, kw_only=True)
class TurnedTree:
    """A ClosestTree seen from another frame: points go in, places and normals come out in that."""

    tree: ClosestTree
    frame: Frame                # as it is seen from the tree's

    def closest_points(self, points_mm, face=None):
        """As ClosestTree's: ClosestPoints of (n, 3), places and normals in this frame."""
        found = self.tree.closest_points(self.frame.out(points_mm), face)
        return replace(found, point_mm=self.frame.into(found.point_mm), normal=self.frame.turn_into(found.normal))

    def signed_distances_mm(self, points_mm):
        """As ClosestTree's: (n,), negative inside the part."""
        return self.tree.signed_distances_mm(self.frame.out(points_mm))


def _ways(points, near):
    """(n, 3) unit ways from the nearest places to the points; 0 on the faces."""
    return (points - near.point_mm) / np.maximum(near.distance_mm, LEAST_MM)[:, None]


def _cosines(points, near):
    """(n,) of the angles between the ways to the points and the normals; 0 where there is no normal."""
    return np.einsum("ij,ij->i", _ways(points, near), np.nan_to_num(near.normal))


def _are_square(points, near):
    """(n,) bool: the foot is a perpendicular's within a face."""
    return ~near.is_edge & (np.abs(_cosines(points, near)) > SQUARE)


def _square_to_way(way, normal):
    """(n, 3) unit, square to unit ways, in the plane of way and normal; any where these are one line."""
    aside = normal - np.einsum("ij,ij->i", way, normal)[:, None] * way
    are_one_line = (aside * aside).sum(axis=1) < ONE_LINE ** 2
    aside[are_one_line] = np.cross(way[are_one_line], np.eye(3)[np.abs(way[are_one_line]).argmin(axis=1)])
    return aside / np.sqrt((aside * aside).sum(axis=1))[:, None]


def refined(patches, face, u, v, points_mm):
    """Feet of perpendiculars from a start near them, on the faces' untrimmed surfaces: Newton alone, no search.

    Args:
        patches: PatchSet.
        face: (n,) face indices or one for all.
        u, v: (n,) starts, parameters of the faces' `nurbs`.
        points_mm: (n, 3).
    Returns:
        u (n,), v (n,), feet (n, 3): a local minimum of the distance near the start, or on the domain's border.
    """
    points = for_kernel(points_mm).reshape(-1, 3)
    uv = np.column_stack([np.asarray(u, float), np.asarray(v, float)])
    feet = np.empty_like(points)
    faces = for_kernel(np.broadcast_to(face, (len(points),)), np.int64)
    in_blocks(refine_rows, len(points), CHUNK, patches.arrays, faces, points, uv, feet)
    return uv[:, 0], uv[:, 1], feet
