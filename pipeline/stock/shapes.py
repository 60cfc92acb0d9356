"""What stands in a setup before anything is cut: the stock as it is delivered, and what holds it.

A box, a cylinder, or a closed mesh.  Each answers the same questions: the stretches of a line that run in it (exactly),
the box round it in a frame, a height it does not exceed within a radius, its closed mesh, its solid.  Neither convex
nor a height field is asked for: what hangs over a hollow is two stretches of an upright line.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from cuspline.kernel import solids
from cuspline.stock import mesh_kernels as kernels
from cuspline.stock.tracing import CLOSE_MM
from cuspline.stock.tree import morton_order
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import DesignError
from cuspline.values.frames import Frame

ROUND_MM = 0.002          # the facets of a cylinder stand out of it by no more than this
SQUARE = 1e-12            # a frame's directions that are a box's own within this run along its sides
CREASE = fixed.cos(np.radians(20.0))     # facets that turn by less are one face
FEW_CROSSINGS = 8         # room for crossings of a line; lines with more are asked again
UP = np.array([0.0, 0.0, 1.0])
BOX_SIDES = np.array([[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
                      [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]])


class Shape(ABC):
    """A solid at rest; its own coordinates are those of the part, or of what it stands on."""

    error_mm = 0.0            # its mesh, and where lines meet it, may be off by so much

    @abstractmethod
    def along(self, origins_mm, directions):
        """(n, k, 2) stretches of lines in the material, from their origins, growing; inf behind the last one.

        Args:
            origins_mm, directions: (n, 3), directions of length 1.
        """

    @property
    @abstractmethod
    def mesh(self):
        """(v, 3) vertices, (t, 3) triangles, counter-clockwise from outside, of a closed mesh that holds all of it."""

    @property
    @abstractmethod
    def figures(self):
        """Array of all that decides it."""

    @abstractmethod
    def in_words(self):
        """What it is, for a header: CYLINDER D20 X 15."""

    def box_in(self, frame):
        """(3,) low and (3,) high corner of the box round it, seen from a frame."""
        seen = frame.into(self.mesh[0])
        return seen.min(axis=0), seen.max(axis=0)

    def fills_box_in(self, frame):
        """Whether it is all of the box round it, as seen from a frame."""
        return False

    @cached_property
    def solid(self):
        """Its mesh as a Manifold."""
        return solids.solid_of(*self.mesh)

    @cached_property
    def size_mm(self):
        """Length of the diagonal of the box round it."""
        low, high = self.box_in(HERE)
        return float(fixed.length(high - low))

    def holds(self, points_mm):
        """(n,) bool: within the material."""
        spans = self.along(points_mm, np.tile(UP, (len(points_mm), 1)))
        return ((spans[..., 0] < 0) & (spans[..., 1] > 0)).any(axis=1)

    def columns(self, frame, xy_mm):
        """(n, k, 2) heights, in a frame, between which the material stands over places (n, 2); inf behind the last."""
        foot = np.column_stack([np.asarray(xy_mm, float), np.zeros(len(xy_mm))])
        return self.along(frame.out(foot), frame.turn_out(np.tile(UP, (len(foot), 1))))

    def tops_mm(self, frame, xy_mm):
        """(n,) height of its highest place over (x, y), in a frame; -inf beside it."""
        tops = self.columns(frame, xy_mm)[..., 1]
        return np.where(np.isfinite(tops), tops, -np.inf).max(axis=1)

    def tops_within_mm(self, frame, xy_mm, radius_mm):
        """(n,) height that it does not exceed within a radius of (x, y); -inf where nothing of it is so near."""
        seen = _seen(self, frame.rotation.tobytes(), frame.origin_mm.tobytes())
        return kernels.tops_within(np.ascontiguousarray(xy_mm, float), float(radius_mm), *seen)

    @cached_property
    def edges_mm(self):
        """[(2, 3), ...] edges to draw it by: where its facets turn."""
        vertices, triangles = self.mesh
        return [vertices[list(edge)] for edge in _creases(vertices, triangles)]


@dataclass(frozen=True, eq=False, kw_only=True)
class BoxShape(Shape):
    """A box along the axes of its coordinates."""

    min_mm: np.ndarray        # (3,)
    max_mm: np.ndarray        # (3,)

    def __post_init__(self):
        for name in ("min_mm", "max_mm"):
            object.__setattr__(self, name, frozen(getattr(self, name), (3,), name))

    def box_in(self, frame):
        return frame.box_into(self.min_mm, self.max_mm)

    def fills_box_in(self, frame):
        size = np.abs(frame.rotation)
        return bool((np.minimum(size, np.abs(size - 1.0)) < SQUARE).all())

    def along(self, origins_mm, directions):
        origins, directions = np.asarray(origins_mm, float), np.asarray(directions, float)
        return _one_span(*_between(origins, directions, self.min_mm, self.max_mm))

    def holds(self, points_mm):
        return ((points_mm > self.min_mm) & (points_mm < self.max_mm)).all(axis=1)

    @property
    def mesh(self):
        corners = np.where([[k >> a & 1 for a in range(3)] for k in range(8)], self.max_mm, self.min_mm)
        return corners, BOX_SIDES

    @property
    def figures(self):
        return np.array([self.min_mm, self.max_mm])

    def in_words(self):
        return "BOX " + " X ".join(f"{x:g}" for x in (self.max_mm - self.min_mm).round(6))


@dataclass(frozen=True, eq=False, kw_only=True)
class CylinderShape(Shape):
    """A cylinder between the middles of its ends."""

    from_mm: np.ndarray       # (3,)
    to_mm: np.ndarray         # (3,)
    radius_mm: float

    def __post_init__(self):
        for name in ("from_mm", "to_mm"):
            object.__setattr__(self, name, frozen(getattr(self, name), (3,), name))

    error_mm = ROUND_MM

    @cached_property
    def length_mm(self):
        """From end to end."""
        return float(fixed.length(self.to_mm - self.from_mm))

    @property
    def axis(self):
        """(3,) unit, from the first end to the second."""
        return (self.to_mm - self.from_mm) / self.length_mm

    def box_in(self, frame):
        ends = frame.into(np.array([self.from_mm, self.to_mm]))
        along = frame.turn_into(self.axis[None])[0]
        aside = self.radius_mm * np.sqrt(np.roll(along, 1) ** 2 + np.roll(along, 2) ** 2)
        return ends.min(axis=0) - aside, ends.max(axis=0) + aside

    def along(self, origins_mm, directions):
        origins, directions, axis = np.asarray(origins_mm, float) - self.from_mm, np.asarray(directions, float), self.axis
        height, rise = (np.einsum("nc,c->n", v, axis) for v in (origins, directions))
        ends = _between(height[:, None], rise[:, None], np.zeros(1), np.array([self.length_mm]))
        aside, sideways = origins - height[:, None] * axis, directions - rise[:, None] * axis
        a, b = (np.einsum("nc,nc->n", v, sideways) for v in (sideways, aside))
        c = np.einsum("nc,nc->n", aside, aside) - self.radius_mm ** 2
        is_along, root = a < SQUARE, b * b - a * c
        half = np.sqrt(np.maximum(root, 0.0)) / np.where(is_along, 1.0, a)
        middle = -b / np.where(is_along, 1.0, a)
        misses = np.where(is_along, c > 2.0 * self.radius_mm * CLOSE_MM, root < 0)
        enter = np.where(misses, np.inf, np.where(is_along, -np.inf, middle - half))
        leave = np.where(misses, -np.inf, np.where(is_along, np.inf, middle + half))
        return _one_span(np.maximum(enter, ends[0]), np.minimum(leave, ends[1]))

    @cached_property
    def mesh(self):
        """Facets round it, at most ROUND_MM outside."""
        radius = self.radius_mm
        count = max(int(np.ceil(np.pi / fixed.arccos(radius / (radius + ROUND_MM)))), 8)
        turn = 2 * np.pi * np.arange(count) / count
        first = np.cross(self.axis, np.eye(3)[np.abs(self.axis).argmin()])
        first = first / fixed.length(first)
        second = np.cross(self.axis, first)
        out = radius / fixed.cos(np.pi / count)
        rim = out * (fixed.cos(turn)[:, None] * first + fixed.sin(turn)[:, None] * second)
        k = np.arange(count)
        nxt = np.roll(k, -1)
        low, high = np.full(count, 2 * count), np.full(count, 2 * count + 1)
        triangles = np.vstack([np.column_stack(three) for three in (
            (k, nxt, nxt + count), (k, nxt + count, k + count), (low, nxt, k), (high, k + count, nxt + count))])
        return np.vstack([self.from_mm + rim, self.to_mm + rim, self.from_mm, self.to_mm]), triangles

    @property
    def figures(self):
        return np.array([*self.from_mm, *self.to_mm, self.radius_mm])

    def in_words(self):
        return f"CYLINDER D{2 * self.radius_mm:g} X {round(self.length_mm, 6):g}"


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshShape(Shape):
    """A closed mesh: a casting out of a STEP file, within a stated deviation, or an STL file."""

    vertices_mm: np.ndarray   # (v, 3)
    triangles: np.ndarray     # (t, 3) counter-clockwise from outside
    error_mm: float           # what it stands for lies off it by no more
    name: str                 # as a header tells it

    def __post_init__(self):
        object.__setattr__(self, "vertices_mm", frozen(self.vertices_mm, (None, 3), "vertices_mm"))
        object.__setattr__(self, "triangles", frozen(self.triangles, (None, 3), "triangles", np.int64))

    @cached_property
    def _lines(self):
        """Triangles and tree as the kernels take them."""
        return _searched(self.vertices_mm[self.triangles])

    def along(self, origins_mm, directions):
        origins, directions = (np.ascontiguousarray(a, float) for a in (origins_mm, directions))
        few, count = kernels.lines_through(origins, directions, *self._lines, FEW_CROSSINGS)
        more = np.flatnonzero(count > FEW_CROSSINGS)
        if not len(more):
            return few
        room = int(count.max()) + 1 >> 1 << 1
        spans = np.pad(few, ((0, 0), (0, (room - FEW_CROSSINGS) // 2), (0, 0)), constant_values=np.inf)
        spans[more] = kernels.lines_through(origins[more], directions[more], *self._lines, room)[0]
        return spans

    def tops_mm(self, frame, xy_mm):
        """The same from above: the highest facet ends the search, where a line through all of it goes on."""
        xy = np.ascontiguousarray(xy_mm, float)
        tops, at_edge = kernels.tops_over(xy, *_turned(self, frame.rotation.tobytes(), frame.origin_mm.tobytes()))
        tops[at_edge] = super().tops_mm(frame, xy[at_edge])
        return tops

    @property
    def mesh(self):
        return self.vertices_mm, self.triangles

    @property
    def figures(self):
        return np.concatenate([self.vertices_mm.ravel(), self.triangles.ravel().astype(float)])

    def in_words(self):
        return self.name


HERE = Frame.shift((0.0, 0.0, 0.0))


def closed_mesh(vertices_mm, triangles, error_mm, name, words):
    """MeshShape of a mesh that bounds a solid.

    Args:
        vertices_mm: (v, 3).   triangles: (t, 3).   error_mm: its deviation.
        name: as a message begins.   words: as a header tells it.
    Raises:
        DesignError: it is open, inside out, or crosses itself.
    """
    fault = solids.fault_of(vertices_mm, triangles)
    if fault:
        raise DesignError(f"{name} is no closed solid: {fault}")
    return MeshShape(vertices_mm=vertices_mm, triangles=triangles, error_mm=error_mm, name=words)


def _between(origins, directions, low, high):
    """(n,) enter and leave of lines through a box in any number of dimensions; enter > leave: it is missed.

    A line that runs along a side counts as within up to CLOSE_MM beside it.
    """
    is_level = np.abs(directions) < SQUARE
    steps = np.where(is_level, 1.0, directions)
    first, last = (low - origins) / steps, (high - origins) / steps
    beside = is_level & ((origins < low - CLOSE_MM) | (origins > high + CLOSE_MM))
    enter = np.where(is_level, np.where(beside, np.inf, -np.inf), np.minimum(first, last)).max(axis=1)
    leave = np.where(is_level, np.where(beside, -np.inf, np.inf), np.maximum(first, last)).min(axis=1)
    return enter, leave


def _one_span(enter, leave):
    """(n, 1, 2) of a convex shape."""
    met = leave > enter
    return np.where(met[:, None], np.column_stack([enter, leave]), np.inf)[:, None]


def _searched(corners):
    """(triangles (t, 3, 3) in the order of their tree, the tree)."""
    corners = np.ascontiguousarray(corners[morton_order(corners.mean(axis=1))])
    leaves = 1
    while leaves * kernels.LEAF < len(corners):
        leaves *= 2
    return corners, kernels.tree_of(corners, leaves)


def _corners_in(shape, rotation, origin):
    """(m, 3, 3) of a shape's triangles, seen from a frame whose arrays stand as bytes."""
    vertices, triangles = shape.mesh
    return Frame(rotation=np.frombuffer(rotation).reshape(3, 3), origin_mm=np.frombuffer(origin)).into(vertices)[triangles]


@lru_cache(maxsize=16)
def _turned(shape, rotation, origin):
    """All of a shape's triangles in a frame, in the order of their tree, and the tree."""
    return _searched(_corners_in(shape, rotation, origin))


@lru_cache(maxsize=16)
def _seen(shape, rotation, origin):
    """A shape's upward facets in a frame, as the kernel takes them: triangles, planes, tree."""
    corners = _corners_in(shape, rotation, origin)
    corners = corners[np.isfinite(kernels.facets_of(corners)[:, kernels.TOP])]
    corners, tree = _searched(corners)
    return corners, kernels.facets_of(corners), tree


def _creases(vertices, triangles):
    """Sides (a, b) of triangles, each once, at which the mesh turns."""
    normal = np.cross(vertices[triangles[:, 1]] - vertices[triangles[:, 0]],
                      vertices[triangles[:, 2]] - vertices[triangles[:, 0]])
    normal = normal / np.maximum(np.sqrt(np.einsum("nc,nc->n", normal, normal)), 1e-300)[:, None]
    owner = {}
    for t, (a, b, c) in enumerate(triangles.tolist()):
        for side in ((a, b), (b, c), (c, a)):
            owner.setdefault((min(side), max(side)), []).append(t)
    sides = np.array([both for both in owner.values() if len(both) == 2]).reshape(-1, 2)
    turned = np.einsum("nc,nc->n", normal[sides[:, 0]], normal[sides[:, 1]]) < CREASE
    return [side for side, is_crease in zip((s for s, both in owner.items() if len(both) == 2), turned) if is_crease]
