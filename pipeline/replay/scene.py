"""What a program is replayed in: the stock that it finds, the finished design, and what stands round both.  WCS."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cuspline.replay.clearance import ClearanceTree
from cuspline.values.arrays import frozen
from cuspline.values.frames import Frame

HOLDER_CLEARANCE_MM = 1.0
SHANK_CLEARANCE_MM = 0.0  # the neck follows the flutes into the slot they cut


@dataclass(frozen=True, eq=False, kw_only=True)
class ZMap:
    """Nodes of the replay's z-map: x = origin + i pitch, y = origin + j pitch, cell j * nx + i."""

    origin_mm: tuple[float, float]
    pitch_mm: float
    nx: int
    ny: int

    @classmethod
    def over(cls, stock_min, stock_max, pitch_mm):
        """Nodes at the given pitch from the stock's lower corner on, none beyond the stock."""
        count = [int(np.floor((b - a) / pitch_mm + 1e-9)) + 1 for a, b in zip(stock_min[:2], stock_max[:2])]
        return cls(origin_mm=(float(stock_min[0]), float(stock_min[1])), pitch_mm=float(pitch_mm),
                   nx=count[0], ny=count[1])

    @property
    def shape(self):
        """Of heights at the nodes: (ny, nx)."""
        return self.ny, self.nx

    @property
    def xy_mm(self):
        """(ny * nx, 2) nodes in order of their cell number."""
        x = self.origin_mm[0] + self.pitch_mm * np.arange(self.nx)
        y = self.origin_mm[1] + self.pitch_mm * np.arange(self.ny)
        return np.column_stack([np.tile(x, self.ny), np.repeat(y, self.nx)])


@dataclass(frozen=True, eq=False, kw_only=True)
class FoundStock:
    """The stock that a program finds, on a z-map's nodes, and what can be asked of it before each of its moves."""

    min_mm: tuple[float, float, float]      # corners of the billet
    max_mm: tuple[float, float, float]
    pitch_mm: float                         # distance of the nodes
    # (ny, nx) height at the nodes; None: the whole billet.  Between them no contact is taken to be sure above the lowest
    # node round about.
    top_mm: np.ndarray | None = None
    # function of places (n, 2) and a radius to heights (n,) that no stock so near exceeds before the first move, see
    # `Workpiece.highest_within_mm`; None: all that is between the nodes may stand to the top
    within_mm: Callable | None = None
    parts: int = 4                          # of a cell's side between nodes, in each of which within_mm is asked
    # function of a row of PostedMoves to a function as within_mm, of the stock before that move: what the cells leave
    # undecided is asked there once more, and tools on right-angle heads are held against the stock that the first of them
    # finds, as head_clearance.py says; None: what is undecided stays so, and heads meet the whole billet
    within_before: Callable | None = None
    # function of a row to a function of places (n, 2) to heights (n,) of the stock before that move, -inf beside it: what a
    # tool that stands still touches; None: that is not asked
    standing_before: Callable | None = None
    # function of places (n, 2) to heights (n,) that tools on heads alone leave of the billet, and the rows (n,) that left
    # them: the nodes are lowered by it in the end, contacts of other tools do not know of it; None: they are not
    left_by_heads: Callable | None = None
    # (ny * nx, k, 2) of a stock that is no box: heights between which it stands over the nodes as delivered
    columns: np.ndarray | None = None
    # functions of places (n, 3), and of places and a radius, to (n,) bool: stock before the first move; surely none so near.
    # Asked where a tool leans, which has no use for heights; None: the whole billet
    is_stock: Callable | None = None
    is_free_within: Callable | None = None

    def __post_init__(self):
        if self.top_mm is not None:
            object.__setattr__(self, "top_mm", frozen(self.top_mm, self.zmap.shape, "top_mm"))

    @cached_property
    def zmap(self):
        return ZMap.over(self.min_mm, self.max_mm, self.pitch_mm)

    @property
    def highest_mm(self):
        return float(self.max_mm[2])

    @property
    def heights_mm(self):
        """(ny, nx) at the nodes before the first move, the caller's own."""
        return np.full(self.zmap.shape, self.highest_mm) if self.top_mm is None else np.array(self.top_mm)


@dataclass(frozen=True, eq=False, kw_only=True)
class FinishedDesign:
    """The finished design as far as it is known."""

    top_mm: np.ndarray | None = None        # (ny, nx) height at the stock's nodes, NaN beside it
    tree: ClearanceTree | None = None       # None: pins of the heights
    error_mm: float = 0.0       # how deep neck, shank and holder may seem to touch it: of its triangles and the finish's gouge

    def heights_mm(self, zmap):
        """(ny, nx) at the nodes of a ZMap; NaN where it is not known."""
        return np.full(zmap.shape, np.nan) if self.top_mm is None else frozen(self.top_mm, zmap.shape, "design.top_mm")


@dataclass(frozen=True, eq=False, kw_only=True)
class Fixture:
    """A box that no part of the tool may enter; WCS.  What lies below it counts as part of it."""

    name: str
    min_mm: tuple[float, float, float]
    max_mm: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class SolidFixture:
    """A fixture of any form, as a closed mesh; WCS."""

    name: str
    vertices_mm: np.ndarray         # (v, 3)
    triangles: np.ndarray           # (t, 3)

    @property
    def min_mm(self):
        """(3,) low corner of the box round it."""
        return self.vertices_mm.min(axis=0)

    @property
    def max_mm(self):
        """(3,) high corner of it."""
        return self.vertices_mm.max(axis=0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Surroundings:
    """What stands round stock and tool, how near they may come to each other, and where all that is seen from."""

    machine: object = None          # machines.Machine; None: travel and table are not checked, no spindle head is known
    fixtures: tuple = ()            # Fixture and SolidFixture; tools on right-angle heads keep clear of the boxes round them
    frame: Frame = Frame.shift((0.0, 0.0, 0.0))         # the WCS seen from the part, for the places of findings
    setup: str = "setup-1"
    holder_clearance_mm: float = HOLDER_CLEARANCE_MM    # to stock and design; the spindle head counts as part of the holder
    shank_clearance_mm: float = SHANK_CLEARANCE_MM

    @property
    def spindle_head(self):
        """(height, diameter) cylinders above the holder, mm."""
        return () if self.machine is None else self.machine.spindle_head

    @property
    def clearances_mm(self):
        """(3,) distance by kind of part: what cuts, shank, holder."""
        return np.array([0.0, self.shank_clearance_mm, self.holder_clearance_mm])

    @property
    def rapid_clearance_mm(self):
        return 0.0 if self.machine is None else self.machine.rapid_clearance_mm
