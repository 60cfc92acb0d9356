"""Tips of one cutter over a regular grid, and the region where it touches the faces wanted.

Holes, islands and trimmed borders need no case of their own: a position is in when the cutter that
rests there touches a wanted face, or an edge between two of them.  Over the outer edges of the wanted
faces the cutter may roll on for a stated run-over, so that the last pass cuts the edge clean.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import distance_transform_edt

from cuspline.toolpaths.drop.droppers import Dropper
from cuspline.toolpaths.freeform.scallop_metric import Across
from cuspline.values.arrays import frozen
from cuspline.values.errors import ToolpathError

MOST_NODES = 50_000_000


@dataclass(frozen=True, eq=False, kw_only=True)
class TipField:
    """Where a cutter rests over the nodes of a grid, part frame; node (i, j) stands at (x_mm[i], y_mm[j])."""

    dropper: Dropper
    wanted: tuple               # indices of the faces to cut
    pitch_mm: float
    run_over_mm: float          # how far over the outer edges of the wanted faces, in plan
    x_mm: np.ndarray            # (nx,)
    y_mm: np.ndarray            # (ny,)
    tip_z_mm: np.ndarray        # (nx, ny) -inf where nothing lies beneath
    contact_mm: np.ndarray      # (nx, ny, 3)
    normal: np.ndarray          # (nx, ny, 3) from the contact into the cutter
    face: np.ndarray            # (nx, ny) touched face
    is_edge: np.ndarray         # (nx, ny)
    beyond_mm: np.ndarray       # (nx, ny) distance in plan from the wanted faces' contacts, up to a pitch short
    rest_mm: np.ndarray         # (nx, ny) distance in plan from the nearest node to be cut, margin taken off
    is_inside: np.ndarray       # (nx, ny) the region
    across: Across | None = None    # the leaning cutter that the dropper's ball stands for; None: it stands for itself

    def __post_init__(self):
        put = lambda name, shape, dtype=float: object.__setattr__(
            self, name, frozen(getattr(self, name), shape, name, dtype))
        put("x_mm", (None,))
        put("y_mm", (None,))
        grid = len(self.x_mm), len(self.y_mm)
        for name in ("tip_z_mm", "beyond_mm", "rest_mm"):
            put(name, grid)
        for name in ("contact_mm", "normal"):
            put(name, (*grid, 3))
        put("face", grid, np.int64)
        put("is_edge", grid, bool)
        put("is_inside", grid, bool)

    @cached_property
    def node_xy_mm(self):
        """(nx, ny, 2) plan positions of the nodes."""
        return np.stack(np.meshgrid(self.x_mm, self.y_mm, indexing="ij"), axis=2)

    def holds(self, xy_mm, contacts):
        """(n,) bool: positions of the region, told by their exact contacts.

        Args:
            xy_mm: (n, 2).
            contacts: TipContacts of the same positions from `dropper`.
        """
        rolls = contacts.touches_rim(self.wanted) & (self._at(self.beyond_mm, xy_mm) < self.run_over_mm)
        return (contacts.touches(self.wanted) | rolls) & (self._at(self.rest_mm, xy_mm) <= 0.0)

    def is_near(self, xy_mm):
        """(n,) bool: a node of the region is a corner of the cell around the position."""
        node = (np.asarray(xy_mm, float) - (self.x_mm[0], self.y_mm[0])) / self.pitch_mm
        size = np.array(self.is_inside.shape)
        i, j = np.clip(np.floor(node).astype(int), 0, size - 2).T
        grid = self.is_inside
        near = grid[i, j] | grid[i + 1, j] | grid[i, j + 1] | grid[i + 1, j + 1]
        return near & ((node >= 0) & (node <= size - 1)).all(axis=1)

    def narrowed(self, seeds, margin_mm):
        """The part of the region within a margin in plan of the nodes (nx, ny) bool marked."""
        away = distance_transform_edt(~seeds) * self.pitch_mm - margin_mm
        return replace(self, rest_mm=np.maximum(away, self.rest_mm), is_inside=self.is_inside & (away <= 0.0))

    def _at(self, grid, xy_mm):
        """(n,) values of a grid of distances between its nodes, infinite outside."""
        at = (np.asarray(xy_mm, float) - (self.x_mm[0], self.y_mm[0])) / self.pitch_mm
        size = np.array(grid.shape)
        outside = ((at < -1e-9) | (at > size - 1 + 1e-9)).any(axis=1)
        cell = np.clip(at.astype(int), 0, size - 2)
        s, t = np.clip(at - cell, 0.0, 1.0).T
        i, j = cell.T
        value = ((1 - s) * ((1 - t) * grid[i, j] + t * grid[i, j + 1])
                 + s * ((1 - t) * grid[i + 1, j] + t * grid[i + 1, j + 1]))
        return np.where(outside, np.inf, value)


def tip_field(dropper, wanted, box_mm, pitch_mm, run_over_mm=0.0, may_be_empty=False):
    """Lower the cutter over a grid that covers every position from which it touches the wanted faces.

    Args:
        dropper: Dropper.
        wanted: indices of the faces to cut.
        box_mm: ((2,), (2,)) lowest and highest x, y of those faces.
        pitch_mm: distance of the nodes.
        run_over_mm: how far the cutter may roll over the outer edges of the wanted faces, in plan; up to a
            pitch more is taken.
        may_be_empty: walls alone: from above the cutter touches none of them.
    Returns:
        TipField.
    Raises:
        ToolpathError: the grid is out of proportion, or the cutter touches none of the faces.
    """
    low, high = (np.asarray(c, float)[:2] for c in box_mm)
    grow = dropper.radius_mm + dropper.allowance_mm + pitch_mm
    counts = np.ceil((high - low + 2 * grow) / pitch_mm).astype(np.int64) + 1
    if counts.prod() > MOST_NODES:
        raise ToolpathError(f"a grid of {counts[0]} x {counts[1]} nodes {pitch_mm} mm apart is too fine for faces of "
                            f"{high - low} mm: choose a wider pitch")
    x, y = (low[k] - grow + pitch_mm * np.arange(counts[k]) for k in (0, 1))
    nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=2)
    nodes[1::2] = nodes[1::2, ::-1].copy()                       # to and fro: neighbours stay neighbours
    contacts = dropper.contacts(nodes.reshape(-1, 2))
    back = lambda column: _to_and_fro(np.asarray(column).reshape(*counts, *np.shape(column)[1:]))
    core, rim = back(contacts.touches(wanted)), back(contacts.touches_rim(wanted))
    if not core.any() and not may_be_empty:
        raise ToolpathError(f"a cutter of radius {dropper.radius_mm} mm touches none of the faces {list(wanted)} "
                            f"from above on a grid of {pitch_mm} mm: choose other faces or a smaller cutter")
    # the faces' border lies up to a pitch beyond the last node that touches them
    beyond = np.maximum(distance_transform_edt(~core) - 1.0, 0.0) * pitch_mm
    return TipField(dropper=dropper, wanted=tuple(wanted), pitch_mm=float(pitch_mm), run_over_mm=float(run_over_mm),
                    x_mm=x, y_mm=y, tip_z_mm=back(contacts.tip_z_mm), contact_mm=back(contacts.contact_mm),
                    normal=back(contacts.normal), face=back(contacts.face), is_edge=back(contacts.is_edge),
                    beyond_mm=beyond, rest_mm=np.zeros(core.shape),
                    is_inside=core | (rim & (beyond < run_over_mm)))


def _to_and_fro(grid):
    out = grid.copy()
    out[1::2] = grid[1::2, ::-1]
    return out
