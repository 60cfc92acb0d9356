"""What a replay finds: the stock's history on a z-map, contacts, clearances."""

from dataclasses import dataclass

import numpy as np

from cuspline.replay.scene import ZMap
from cuspline.values.arrays import frozen
from cuspline.values.findings import Finding


@dataclass(frozen=True, eq=False, kw_only=True)
class Replay:
    """The stock's history and what was found on the way.

    Events are tens of a move: their arrays are handed over, not copied.
    """

    zmap: ZMap
    bottom_mm: float
    top_mm: float                   # before the first cut
    design_top_mm: np.ndarray       # (ny, nx) as given; NaN where there is no design
    event_row: np.ndarray           # (e,) row of PostedMoves
    event_cell: np.ndarray          # (e,)
    event_z_mm: np.ndarray          # (e,) new height, below the one before
    final_z_mm: np.ndarray          # (ny, nx) stock after all moves
    findings: tuple[Finding, ...]
    idle: tuple[Finding, ...]       # operations that take nothing off
    holder_clearance_mm: float      # no holder comes nearer to stock or design, proven; inf: beyond 50 mm
    holder_place_mm: tuple[float, float, float] | None      # where it comes nearest; part coordinates
    undecided_lines: tuple[int, ...]    # lines of moves where a contact with a fin of stock is not excluded
    is_table_checked: bool

    def __post_init__(self):
        shape, e = (self.zmap.ny, self.zmap.nx), len(self.event_row)
        for name, form, dtype in (("design_top_mm", shape, float), ("event_row", (e,), np.int32),
                                  ("event_cell", (e,), np.int32), ("event_z_mm", (e,), float),
                                  ("final_z_mm", shape, float)):
            object.__setattr__(self, name, frozen(getattr(self, name), form, name, dtype, name.startswith("event_")))
