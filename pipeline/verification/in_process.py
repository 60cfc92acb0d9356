"""The stock as it stands after every operation of every clamping: solids to look at, to load elsewhere, to go on from.

Each is known by a hash of all that made it: blank, tools and the posted moves so far.  What goes on from it, the next
clamping's plan and replay, asks the exact workpiece; the file is that workpiece at a stated pitch.
"""

import hashlib
from dataclasses import dataclass

import numpy as np

from cuspline.kernel import solids
from cuspline.stock.stock_solids import StockSolids
from cuspline.stock.swept import is_height_field, stock_height_mm, swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.values.checkpoints import NOTHING
from cuspline.values.frames import Frame

SIMPLER_MM = 0.002        # the file's triangles may lie this far off the grid's
COARSER = 2.0             # grid of the stock between a clamping's operations, in pitches of what it leaves in the end
PART = Frame.shift((0.0, 0.0, 0.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class StockState:
    """Stock after one operation, part coordinates."""

    setup: str
    operation: str
    number: int               # of the operation in its clamping, from 1
    piece: Workpiece
    solid: object             # Manifold
    inputs_sha256: str        # of all that made it
    pitch_mm: float

    @property
    def file(self):
        """Name of its file."""
        return f"{self.setup}.stock-{self.number}.stl"

    def as_dict(self):
        """For verify.json."""
        return {"setup": self.setup, "operation": self.operation, "file": self.file, "inputs_sha256": self.inputs_sha256,
                "volume_mm3": round(self.solid.volume(), 3), "pitch_mm": round(self.pitch_mm, 6), "simplified_mm": SIMPLER_MM}


def stock_states(programs, tools, stock, pitches_mm, kept=NOTHING, finished=None):
    """Stock after each operation, one at a time: only the one asked for is in memory.

    Args:
        programs: verdict.SetupProgram values in the order in which they are cut.
        tools: dict of tool number -> cutters.Tool.   stock: a value of design.stock.
        pitches_mm: of each clamping's grid, for what it leaves in the end.
        kept: kept.Kept for the heights of every operation's stock.
        finished: StockSolids after all clampings, where they are at hand: what is hollow is not made once more.
    Yields:
        StockState.
    """
    before, left, made, heights = Workpiece(blank=stock.shape), None, hashlib.sha256(), _Heights(kept.of(stock_height_mm))
    made.update(stock.shape.figures.tobytes())
    for k, program in enumerate(programs):
        frame, name, start, piece, solid = program.setup.frame, program.setup.name, 0, before, left
        heights.look_anew()
        made.update(np.concatenate([frame.rotation.ravel(), frame.origin_mm]).tobytes())
        ends = operation_ends(program.posted)
        for number, end in enumerate(ends, start=1):
            made.update(_told(program.posted, start, end, tools))
            paths = swept_paths(program.posted.between(0, end), tools)
            piece = before.after(frame, paths)
            heights.own = swept_paths(program.posted.between(start, end), tools)
            pitch_mm = pitches_mm[k] * (1.0 if number == len(ends) else COARSER)
            if number == len(ends):
                heights.look_anew()
            is_last = k == len(programs) - 1 and number == len(ends)
            alone = StockSolids(Workpiece(blank=stock.shape).after(frame, paths), [pitch_mm], heights=heights)
            solid = finished.stock(PART) if is_last and finished is not None and finished.is_hollow else _within(left, alone)
            yield StockState(setup=name, operation=program.posted.operation_name(end - 1), number=number, piece=piece,
                             solid=solids.simpler(solid, SIMPLER_MM), inputs_sha256=made.hexdigest(), pitch_mm=pitch_mm)
            start = end
        before, left = piece, solid and solids.made(solid)


def _within(left, alone):
    """Manifold of what a clamping's cuts, alone (StockSolids), leave of what those before it left; None: of the stock."""
    return alone.stock(PART) if left is None else alone.less(left, PART)


def operation_ends(posted):
    """Rows after the last of each operation; moves before the first belong to it."""
    starts = [0, *(np.flatnonzero(np.diff(posted.operation)) + 1).tolist(), len(posted)]
    named = [end for begin, end in zip(starts, starts[1:]) if end > begin and posted.operation[begin] >= 0]
    return named or ([len(posted)] if len(posted) else [])


class _Heights:
    """stock_height_mm of a clamping that goes on: an operation lowers what those before it have left, only its moves are asked."""

    def __init__(self, height_mm):
        """height_mm: swept.stock_height_mm, or answers as it would."""
        self.height_mm, self.z, self.own = height_mm, None, ()

    def look_anew(self):
        """Of the clamping that goes on everything is asked again: on another grid, or of another clamping."""
        self.z = None

    def __call__(self, paths, *grid):
        """`own` are the paths of the last operation among these."""
        goes_on = self.z is not None and is_height_field(paths)
        z = self.height_mm(self.own if goes_on else paths, *grid)
        self.z = np.minimum(z, self.z) if goes_on else z
        return self.z


def _told(posted, start, end, tools):
    """Bytes of the rows that decide what is cut, and of their tools."""
    part = slice(start, end)
    columns = [posted.kind, posted.start_mm, posted.end_mm, posted.center_mm, posted.plane, posted.turns, posted.tool]
    if not posted.is_upright[part].all():
        columns += [posted.start_axis, posted.end_axis]
    used = "".join(tools[int(n)].model_dump_json() for n in np.unique(posted.tool[part]) if int(n) in tools)
    return b"".join(np.ascontiguousarray(c[part]).tobytes() for c in columns) + used.encode()
