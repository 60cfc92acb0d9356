"""The stock as closed solids: one height field a clamping over its own grid; what several take off is taken off the blank."""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from cuspline.kernel import solids
from cuspline.stock.hollow import HollowStock
from cuspline.stock.shapes import HERE
from cuspline.stock.swept import is_height_field, stock_height_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.frames import Frame
from cuspline.values.known import Known

LATTICE = 800_000         # cubes of the lattice on which stock with undercuts is met
WALL_MM = 1e-4            # grid lines hug vertical walls at this distance
HELD = 4                  # clampings up to which their solids are held: each is some 40 MB


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
    hollow: object = None     # Manifold of a hollow one; None: the solid is what lies under the heights

    @property
    def is_height_field(self):
        """Nothing is hollow below the heights."""
        return self.hollow is None

    @cached_property
    def solid(self):
        """Manifold."""
        return self.hollow if self.hollow is not None else solids.height_field(self.xs, self.ys, self._grid, self.low[2])

    @property
    def over(self):
        """Manifold of what was taken off, and more above and beside the billet; None: nothing."""
        return solids.over_field(self.xs, self.ys, self._grid, self.low[2], self.high[2])

    @property
    def _grid(self):
        return self.z.reshape(len(self.ys), len(self.xs))

    def height_at(self, xy_mm):
        """(n,) heights of the solid's facets over places (n, 2) within the grid."""
        i = np.clip(np.searchsorted(self.xs, xy_mm[:, 0], side="right") - 1, 0, len(self.xs) - 2)
        j = np.clip(np.searchsorted(self.ys, xy_mm[:, 1], side="right") - 1, 0, len(self.ys) - 2)
        s = (xy_mm[:, 0] - self.xs[i]) / (self.xs[i + 1] - self.xs[i])
        t = (xy_mm[:, 1] - self.ys[j]) / (self.ys[j + 1] - self.ys[j])
        z = self._grid
        a, b, c, d = z[j, i], z[j, i + 1], z[j + 1, i + 1], z[j + 1, i]
        rising = solids.is_split_upward(a, b, c, d)
        first = np.where(s >= t, a + s * (b - a) + t * (c - b), a + s * (c - d) + t * (d - a))
        second = np.where(s + t <= 1, a + s * (b - a) + t * (d - a), c + (1 - s) * (d - c) + (1 - t) * (b - c))
        return np.maximum(np.where(rising, first, second), self.low[2])


class StockSolids:
    """Fields of all clampings of a workpiece.

    What is asked again and again is made once: the fields as they are, of up to HELD clampings, and the heights of all.  A
    field with grown cutters is asked for once or twice, and not held.
    """

    def __init__(self, piece, pitches_mm, wall_vertices_mm=None, wall_triangles=None, heights=stock_height_mm):
        """Grid lines hug upright walls of the triangles (part coordinates), if any are given.

        `heights` is swept.stock_height_mm, or answers as it would.
        """
        self.piece, self.pitches_mm, self._heights = piece, pitches_mm, heights
        self._walls = [upright_walls(c.frame.into(wall_vertices_mm), wall_triangles) if wall_vertices_mm is not None
                       else ([], []) for c in piece.cuts]
        self._made, self._z, self._lattices, self._whole = Known(), Known(), Known(), Known()

    def field(self, k, grown_mm=0.0):
        """Field of clamping k, its cutters grown by so much (negative: shrunk)."""
        if grown_mm or len(self.piece.cuts) > HELD:
            return self._field(k, grown_mm)
        return self._made.once(k, lambda: self._field(k, grown_mm))

    def _field(self, k, grown_mm):
        cut = self.piece.cuts[k]
        low, high = self.piece.box_in(cut.frame)
        xs, ys = (grid_lines(low[i], high[i], self.pitches_mm[k], self._walls[k][i]) for i in (0, 1))
        field = partial(Field, frame=cut.frame, pitch_mm=self.pitches_mm[k], xs=xs, ys=ys, low=low, high=high)
        if not is_height_field(cut.paths):
            return field(z=np.zeros(0), hollow=self._hollow(k, low, high).solid(grown_mm))
        ask = lambda: self._heights(cut.paths, np.column_stack([np.tile(xs, len(ys)), np.repeat(ys, len(xs))]), high[2], grown_mm)
        return field(z=ask() if grown_mm else self._z.once(k, ask))

    def _hollow(self, k, low, high):
        """HollowStock of clamping k."""
        edge = max(self.pitches_mm[k], float(fixed.cbrt(np.prod(high - low) / LATTICE)))
        return self._lattices.once(k, lambda: HollowStock(self.piece.cuts[k].paths, low, high, edge))

    @property
    def is_hollow(self):
        """Whether some clamping leaves stock above where it cut: its field takes long."""
        return not all(is_height_field(c.paths) for c in self.piece.cuts)

    def stock(self, frame, grown_mm=0.0):
        """What all setups leave, as a Manifold seen from a frame; of several it is met once, in the part's coordinates."""
        if len(self.piece.cuts) < 2:
            return self._met(frame, grown_mm)
        whole = self._whole.once(grown_mm, lambda: solids.made(self._met(HERE, grown_mm)))
        return solids.moved(whole, HERE.seen_from(frame))

    def _met(self, frame, grown_mm):
        """`stock` from the blank and what each setup leaves."""
        blank, cuts = self.piece.blank, self.piece.cuts
        if len(cuts) > 1:
            return self.less(solids.moved(blank.solid, HERE.seen_from(frame)), frame, grown_mm)
        left = [solids.moved(self.field(0, grown_mm).solid, cuts[0].frame.seen_from(frame))] if cuts else []
        if not blank.fills_box_in(cuts[0].frame if cuts else frame):
            left.append(solids.moved(blank.solid, HERE.seen_from(frame)))
        return solids.common(left) if left else solids.box(*self.piece.box_in(frame))

    def less(self, solid, frame, grown_mm=0.0):
        """What the setups leave of a Manifold within the blank's boxes, seen from a frame.

        Each takes off what lies over its heights; where it leaves stock above where it cut, both have the rest in common.
        """
        taken = []
        for k, cut in enumerate(self.piece.cuts):
            field, seen = self.field(k, grown_mm), cut.frame.seen_from(frame)
            if not field.is_height_field:
                solid = solids.common([solid, solids.moved(field.solid, seen)])
            elif (over := field.over) is not None:
                taken.append(solids.moved(over, seen))
        return solids.less(solid, taken)


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
