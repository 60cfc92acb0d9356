"""The stock as closed solids: one height field a clamping over its own grid, intersected where there are several."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from cuspline.kernel import solids
from cuspline.stock.shapes import HERE
from cuspline.stock.swept import distance_to, is_height_field, signed_distance_mm, stock_height_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.frames import Frame
from cuspline.values.rows import X, Y, Z

LATTICE = 400_000         # cells of the lattice on which stock with undercuts is met
MET_MM = 1e-5             # how well
NODE_EDGES, FAR_EDGES = 2.5, 1.5        # of the lattice
WALL_MM = 1e-4            # grid lines hug vertical walls at this distance


@dataclass(frozen=True, eq=False, kw_only=True)
class Field:
    """Exact heights of the stock at the nodes of a grid, WCS of one clamping."""

    frame: Frame              # that WCS seen from the part
    pitch_mm: float           # of the grid, but for lines that hug walls
    xs: np.ndarray
    ys: np.ndarray
    low: np.ndarray           # (3,) billet
    high: np.ndarray
    z: np.ndarray             # (ny * nx,) of the highest stock; () of a hollow one
    solid: object             # Manifold
    is_height_field: bool     # nothing is hollow below the heights: the solid is what lies under them

    def height_at(self, xy_mm):
        """(n,) heights of the solid's facets over places (n, 2) within the grid."""
        i = np.clip(np.searchsorted(self.xs, xy_mm[:, 0], side="right") - 1, 0, len(self.xs) - 2)
        j = np.clip(np.searchsorted(self.ys, xy_mm[:, 1], side="right") - 1, 0, len(self.ys) - 2)
        s = (xy_mm[:, 0] - self.xs[i]) / (self.xs[i + 1] - self.xs[i])
        t = (xy_mm[:, 1] - self.ys[j]) / (self.ys[j + 1] - self.ys[j])
        z = self.z.reshape(len(self.ys), len(self.xs))
        a, b, c, d = z[j, i], z[j, i + 1], z[j + 1, i + 1], z[j + 1, i]
        rising = solids.is_split_upward(a, b, c, d)
        first = np.where(s >= t, a + s * (b - a) + t * (c - b), a + s * (c - d) + t * (d - a))
        second = np.where(s + t <= 1, a + s * (b - a) + t * (d - a), c + (1 - s) * (d - c) + (1 - t) * (b - c))
        return np.maximum(np.where(rising, first, second), self.low[2])


class StockSolids:
    """Fields of all clampings of a workpiece, each made once."""

    def __init__(self, piece, pitches_mm, wall_vertices_mm=None, wall_triangles=None, heights=stock_height_mm):
        """Grid lines hug upright walls of the triangles (part coordinates), if any are given.

        `heights` is swept.stock_height_mm, or answers as it would.
        """
        self.piece, self.pitches_mm, self._heights = piece, pitches_mm, heights
        self._walls = [upright_walls(c.frame.into(wall_vertices_mm), wall_triangles) if wall_vertices_mm is not None
                       else ([], []) for c in piece.cuts]
        self._made = {}

    def field(self, k, grown_mm=0.0):
        """Field of clamping k, its cutters grown by so much (negative: shrunk)."""
        if (k, grown_mm) not in self._made:
            self._made[k, grown_mm] = self._field(k, grown_mm)
        return self._made[k, grown_mm]

    def _field(self, k, grown_mm):
        cut = self.piece.cuts[k]
        low, high = self.piece.box_in(cut.frame)
        xs, ys = (grid_lines(low[i], high[i], self.pitches_mm[k], self._walls[k][i]) for i in (0, 1))
        field = partial(Field, frame=cut.frame, pitch_mm=self.pitches_mm[k], xs=xs, ys=ys, low=low, high=high)
        if not is_height_field(cut.paths):
            solid = self._hollow(cut, low, high, self.pitches_mm[k], grown_mm)
            return field(z=np.zeros(0), solid=solid, is_height_field=False)
        xy = np.column_stack([np.tile(xs, len(ys)), np.repeat(ys, len(xs))])
        z = self._heights(cut.paths, xy, high[2], grown_mm)
        return field(z=z, solid=solids.height_field(xs, ys, z.reshape(len(ys), len(xs)), low[2]), is_height_field=True)

    def _hollow(self, cut, low, high, pitch_mm, grown_mm):
        """Stock with undercuts: the surface is found along the edges of a lattice, in seven directions."""
        edge = max(pitch_mm, float(fixed.cbrt(np.prod(high - low) / LATTICE)))
        around = edge * np.ones(3)
        left_mm = _asked_near(tuple(p.grown(grown_mm) for p in cut.paths), low - around, high + around, edge)
        stock = solids.level_set(left_mm, low - around, high + around, edge, MET_MM)
        return stock ^ solids.box(low, high)

    @property
    def is_hollow(self):
        """Whether some clamping leaves stock above where it cut: its field takes long."""
        return not all(is_height_field(c.paths) for c in self.piece.cuts)

    def stock(self, frame, grown_mm=0.0):
        """What all setups leave, as a Manifold seen from a frame."""
        blank, cuts = self.piece.blank, self.piece.cuts
        left = [solids.moved(self.field(k, grown_mm).solid, c.frame.seen_from(frame)) for k, c in enumerate(cuts)]
        if not all(blank.fills_box_in(f) for f in ([c.frame for c in cuts] or [frame])):
            left.append(solids.moved(blank.solid, HERE.seen_from(frame)))
        return solids.common(left) if left else solids.box(*self.piece.box_in(frame))


def _asked_near(paths, low, high, edge_mm):
    """Distance (x, y, z) -> float to what paths have swept for `solids.level_set`: near the surface as it is, else a bound.

    A distance is 1-Lipschitz: nodes of a grid, NODE_EDGES edges apart, say of places round them that no surface is within
    FAR_EDGES, so that no edge of the lattice from there meets one, and on which side they lie.
    """
    step, far = NODE_EDGES * edge_mm, FAR_EDGES * edge_mm
    count = np.ceil((high - low) / step).astype(int) + 1
    nodes = [first + step * np.arange(n) for first, n in zip(low, count)]
    known = signed_distance_mm(paths, np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, 3)).reshape(count)
    exact_mm, low = distance_to(paths), for_kernel(low)

    def distance_mm(x, y, z):
        rough = _bound_mm(x, y, z, known, low, step)
        return rough if abs(rough) > far else exact_mm(x, y, z)

    return distance_mm


@njit
def _bound_mm(x, y, z, known, low, step):
    """Signed distance to the surface, nearer to 0 than it is: 0 where the grid's next node does not tell the side."""
    i = min(max(int(np.rint((x - low[X]) / step)), 0), known.shape[0] - 1)
    j = min(max(int(np.rint((y - low[Y]) / step)), 0), known.shape[1] - 1)
    k = min(max(int(np.rint((z - low[Z]) / step)), 0), known.shape[2] - 1)
    dx, dy, dz = x - low[X] - i * step, y - low[Y] - j * step, z - low[Z] - k * step
    off = math.sqrt(dx * dx + dy * dy + dz * dz)
    return math.copysign(max(abs(known[i, j, k]) - off, 0.0), known[i, j, k])


def grid_lines(low, high, pitch_mm, walls):
    """Coordinates from low to high at the pitch, and two lines hugging each wall between."""
    lines = np.linspace(low, high, max(1, int(np.ceil((high - low) / pitch_mm))) + 1)
    hugging = [w + s for w in walls for s in (-WALL_MM, WALL_MM) if low < w + s < high]
    lines = np.unique(np.concatenate([lines, hugging]))
    keep = np.concatenate([[True], np.diff(lines) > WALL_MM / 10])
    return lines[keep]


def upright_walls(mesh_vertices, triangles):
    """Coordinates x and y of axis-parallel vertical planes in a tessellation."""
    corners = mesh_vertices[triangles]
    spread = np.ptp(corners, axis=1)
    found = []
    for k in (0, 1):
        upright = (spread[:, k] < 1e-9) & (spread[:, 2] > 1e-6)
        found.append(np.unique(corners[upright, 0, k].round(9)))
    return found
