"""What the machine will do: the moves read back from posted text.

This is the only input of simulation and verification.  It is made by a reader in posts/
from the text on disk, never from the Program.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.arrays import frozen
from cuspline.errors import SimulationError
from cuspline.program import Kind


@dataclass(frozen=True, eq=False, kw_only=True)
class PostedMoves:
    """Executed moves of one program, one row each, millimetres, cutter tip in the active WCS.

    A start coordinate is NaN while the text has not yet said where that axis stands.
    """

    kind: np.ndarray                # (n,) program.Kind
    start_mm: np.ndarray            # (n, 3) tip where the move begins; NaN: unknown
    end_mm: np.ndarray              # (n, 3) tip where it ends; NaN: axis not yet known
    center_mm: np.ndarray           # (n, 3) arc centres; NaN on lines
    plane: np.ndarray               # (n,) program.Plane
    turns: np.ndarray               # (n,) arcs: full extra turns (P word - 1); 0 on lines
    feed_mm_per_min: np.ndarray     # (n,) 0 on rapids
    spindle_rpm: np.ndarray         # (n,) 0 while stopped
    tool: np.ndarray                # (n,) number of the tool in the spindle; 0 none
    length_offset_on: np.ndarray    # (n,) bool: a tool length offset (G43) is active
    machine_end_mm: np.ndarray      # (n, 3) spindle nose in machine coordinates; NaN: unknown
    line: np.ndarray                # (n,) line number in the text, from 1
    operation: np.ndarray           # (n,) index into operations; -1 before the first
    operations: tuple[str, ...]     # names out of the text's own `(OPERATION ...)` comments
    ended: bool                     # M2 or M30 was reached

    def __post_init__(self):
        n = len(self.kind)
        for name, shape, dtype in (
                ("kind", (n,), np.int8), ("start_mm", (n, 3), float), ("end_mm", (n, 3), float),
                ("center_mm", (n, 3), float), ("plane", (n,), np.int8), ("turns", (n,), np.int32),
                ("feed_mm_per_min", (n,), float), ("spindle_rpm", (n,), float), ("tool", (n,), np.int32),
                ("length_offset_on", (n,), bool), ("machine_end_mm", (n, 3), float),
                ("line", (n,), np.int32), ("operation", (n,), np.int32)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))
        if not np.isfinite(self.end_mm[self.kind != Kind.RAPID]).all():
            raise SimulationError("a cutting move ends at an unknown place")

    def __len__(self):
        return len(self.kind)

    def operation_name(self, row):
        """Name of the operation that row belongs to; "" before the first."""
        index = int(self.operation[row])
        return self.operations[index] if index >= 0 else ""
