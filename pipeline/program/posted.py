"""What the machine will do: the moves read back from posted text.

This is the only input of simulation and verification.  It is made by a reader in posts/
from the text on disk, never from the Program.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from cuspline.program.joint_sweeps import sweeps_of
from cuspline.program.program import UPRIGHT, Kind
from cuspline.values.arrays import frozen
from cuspline.values.errors import SimulationError

UNIT = 1e-9               # how far a tool axis may be from length 1


@dataclass(frozen=True, kw_only=True)
class Remark:
    """What the reader holds against a move, although a control would make it."""

    kind: str               # of finding
    amount_mm: float        # how much; 0 where a length makes no sense
    row: int                # of the move
    advice: str             # how to fix it


@dataclass(frozen=True, kw_only=True)
class PostedTool:
    """A tool as the control's tool table has it."""

    number: int
    values_mm: dict           # letter of an offset (X, Y, Z), or D the diameter -> mm
    line: int                 # of the table, from 1
    text: str                 # of that line
    step_mm: float            # as well as the table can tell a value


@dataclass(frozen=True, kw_only=True)
class Stop:
    """A block that stands still: the spindle, the tool or the program changes between two moves."""

    row: int                  # moves made before it
    line: int                 # of the text, from 1
    word: str                 # M0 M1 M2 M3 M4 M5 M6 M30, G4
    seconds: float = 0.0      # of a G4
    nose_z_mm: float = math.nan     # machine height of the spindle nose, where the row before it is another position's


@dataclass(frozen=True, eq=False, kw_only=True)
class PostedMoves:
    """Executed moves of one program, one row each, millimetres, cutter tip in the active WCS.

    A start coordinate is NaN while the text has not yet said where that axis stands.  The tool axis turns along
    the great circle from where a move begins to where it ends; without axes it is upright, +Z.
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
    length_offset_on: np.ndarray    # (n,) bool: a tool length offset (G43) is active, whichever tool's
    machine_end_mm: np.ndarray      # (n, 3) spindle nose in machine coordinates; NaN: unknown
    line: np.ndarray                # (n,) line number in the text, from 1
    operation: np.ndarray           # (n,) index into operations; -1 before the first
    operations: tuple[str, ...]     # names out of the text's own `(OPERATION ...)` comments
    ended: bool                     # M2 or M30 was reached
    start_axis: np.ndarray | None = None    # (n, 3) unit, tip towards holder, WCS; left out: +Z
    end_axis: np.ndarray | None = None      # (n, 3)
    path_tolerance_mm: np.ndarray | None = None     # (n,) how far the control may leave the path, by the text; inf: any
                                                    # way, NaN: the control's own parameters say it; left out: 0
    speed_line: np.ndarray | None = None    # (n,) line of the S word in force; left out: 0, not known
    call_line: np.ndarray | None = None     # (n,) line in the main program that called the sub-program; 0 none
    remarks: tuple[Remark, ...] = ()
    stops: tuple[Stop, ...] = ()            # in the order of execution
    rotary_deg: np.ndarray | None = None    # (n, r) where the rotary axes stand at the end; NaN: unknown; left out: there are none
    coolant: np.ndarray | None = None       # (n,) values.coolants.BITS added; left out: 0, off
    work_offsets: tuple[str, ...] = ()      # in force at moves that are not in machine coordinates, in the order of their use
    pitch_mm: np.ndarray | None = None      # (n,) way down a turn where the feed is tied to the spindle: above 0 as a right-hand
                                            # thread runs, below as a left-hand one; left out: 0, not tied

    radius_register: np.ndarray | None = None       # (n,) D whose radius shifts the move (G41, G42); 0, and left out: none does

    def __post_init__(self):
        n = len(self.kind)
        for name, shape, dtype in (
                ("kind", (n,), np.int8), ("start_mm", (n, 3), float), ("end_mm", (n, 3), float),
                ("center_mm", (n, 3), float), ("plane", (n,), np.int8), ("turns", (n,), np.int32),
                ("feed_mm_per_min", (n,), float), ("spindle_rpm", (n,), float), ("tool", (n,), np.int32),
                ("length_offset_on", (n,), bool), ("machine_end_mm", (n, 3), float),
                ("line", (n,), np.int32), ("operation", (n,), np.int32)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))
        for name, dtype in (("path_tolerance_mm", float), ("speed_line", np.int32), ("call_line", np.int32),
                            ("coolant", np.int8), ("pitch_mm", float), ("radius_register", np.int32)):
            given = getattr(self, name)
            object.__setattr__(self, name, frozen(np.zeros(n) if given is None else given, (n,), name, dtype))
        given = np.zeros((n, 0)) if self.rotary_deg is None else self.rotary_deg
        object.__setattr__(self, "rotary_deg", frozen(given, (n, None), "rotary_deg"))
        for name in ("start_axis", "end_axis"):
            given = getattr(self, name)
            axis = frozen(np.tile(UPRIGHT, (n, 1)) if given is None else given, (n, 3), name)
            object.__setattr__(self, name, axis)
            if n and not np.abs((axis ** 2).sum(axis=1) - 1).max() < 2 * UNIT:
                raise SimulationError(f"{name} must hold unit vectors from the tip towards the holder")
        if not np.isfinite(self.end_mm[self.kind != Kind.RAPID]).all():
            raise SimulationError("a cutting move ends at an unknown place")

    def __len__(self):
        return len(self.kind)

    @property
    def is_upright(self):
        """(n,) bool: the tool axis is +Z all along the move."""
        return (self.start_axis == UPRIGHT).all(axis=1) & (self.end_axis == UPRIGHT).all(axis=1)

    def between(self, first, end):
        """Some rows, as a program that has not ended."""
        cut = {f.name: getattr(self, f.name)[first:end] for f in fields(self) if isinstance(getattr(self, f.name), np.ndarray)}
        return replace(self, ended=False, **cut)

    @classmethod
    def joined(cls, parts, line_counts):
        """The programs of a set as one, run one after the other; lines count on from file to file.

        Args:
            parts: PostedMoves.   line_counts: lines of each one's text.
        """
        if len(parts) == 1:
            return parts[0]
        names = tuple(dict.fromkeys(name for p in parts for name in p.operations))
        number = [np.array([names.index(name) for name in p.operations] + [-1], int)[p.operation] for p in parts]
        before = np.concatenate([[0], np.cumsum(line_counts)])
        columns = {f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)
                   if isinstance(getattr(parts[0], f.name), np.ndarray)}
        columns |= {"operation": np.concatenate(number)} | {
            name: np.concatenate([np.where(getattr(p, name) > 0, getattr(p, name) + first, 0)
                                  for p, first in zip(parts, before)]) for name in ("line", "speed_line", "call_line")}
        rows = np.concatenate([[0], np.cumsum([len(p) for p in parts])])
        remarks = tuple(replace(r, row=r.row + int(first)) for p, first in zip(parts, rows) for r in p.remarks)
        stops = tuple(replace(s, row=s.row + int(first), line=s.line + int(lines))
                      for p, first, lines in zip(parts, rows, before) for s in p.stops)
        offsets = tuple(dict.fromkeys(offset for p in parts for offset in p.work_offsets))
        return cls(operations=names, ended=all(p.ended for p in parts), remarks=remarks, stops=stops, work_offsets=offsets,
                   **columns)

    def through_joints(self, chain, blocks):
        """The same blocks as the tip and the axis go while the control runs joints evenly; upright ones stay as they are.

        Args:
            chain: kinematics.Chain.   blocks: joint_sweeps.JointBlocks, one a move.
        """
        sweeps = sweeps_of(chain, blocks)
        row, stays = sweeps.row, sweeps.is_upright
        chosen = lambda name: np.where(stays if getattr(self, name).ndim == 1 else stays[:, None], getattr(self, name)[row],
                                       getattr(sweeps, name))
        swept = ("start_mm", "end_mm", "start_axis", "end_axis", "machine_end_mm", "feed_mm_per_min")
        is_same = len(row) == len(self)            # no block has become two: the other columns are not copied
        columns = {} if is_same else {f.name: getattr(self, f.name)[row] for f in fields(self) if f.name not in swept
                                      and isinstance(getattr(self, f.name), np.ndarray)}
        columns |= {name: chosen(name) for name in swept}
        first = np.searchsorted(row, np.arange(len(self) + 1))
        return replace(self, **columns | {"rotary_deg": sweeps.rotary_deg},
                       remarks=tuple(replace(r, row=int(first[r.row])) for r in self.remarks),
                       stops=tuple(replace(s, row=int(first[s.row])) for s in self.stops))

    def first(self, count):
        """The first `count` moves."""
        return self._only(slice(count), tuple(s for s in self.stops if s.row < count))

    def without(self, left_out):
        """The moves but those that are chosen (n,) bool, and without stops: what all else sweeps."""
        return self._only(~left_out, ())

    def _only(self, rows, stops):
        """Some of the moves, with these stops."""
        return replace(self, stops=stops, **{f.name: getattr(self, f.name)[rows] for f in fields(self)
                                             if isinstance(getattr(self, f.name), np.ndarray)})

    def on_head(self, number, axis, driven_mm):
        """The same with the moves of one tool on a head: read as the place that the program drives, its axis turned.

        Args:
            number: of the tool.   axis: (3,) unit, from its tip towards the head, WCS.
            driven_mm: from the tip to the driven place, along that axis.
        """
        mine = (self.tool == number)[:, None]
        back = driven_mm * np.asarray(axis)
        turned = {name: np.where(mine, axis, getattr(self, name)) for name in ("start_axis", "end_axis")}
        moved = {name: np.where(mine, getattr(self, name) - back, getattr(self, name))
                 for name in ("start_mm", "end_mm", "center_mm")}
        return replace(self, **turned, **moved)

    def operation_name(self, row):
        """Name of the operation that row belongs to; "" before the first."""
        index = int(self.operation[row])
        return self.operations[index] if index >= 0 else ""
