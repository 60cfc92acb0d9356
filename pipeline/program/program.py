"""The Program: controller-free moves of one setup, the waist of the pipeline.

Planning ends here; a post writes it out. Nothing after the post looks at it again:
what is simulated is the text, read back.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from cuspline.shop.cutters import Tool
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import ToolpathError

UPRIGHT = (0.0, 0.0, 1.0)
WORK_OFFSETS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")       # zeros in the order of their numbers
TILT_RAD = 1e-9           # of a tool axis, that is rounding: a nanometre on a tool of 1 m


class Kind(IntEnum):
    """What a move does."""

    RAPID = 0        # straight, non-cutting
    FEED = 1         # straight, cutting
    ARC_CW = 2       # clockwise seen from the plane's positive third axis
    ARC_CCW = 3


class Plane(IntEnum):
    """Arc planes; the third axis is the one the plane is seen from."""

    XY = 0           # G17, seen from +Z
    ZX = 1           # G18, seen from +Y: first axis Z, second axis X
    YZ = 2           # G19, seen from +X: first axis Y, second axis Z

    @property
    def axes(self):
        """(first, second, third) axis indices, right-handed."""
        return ((0, 1, 2), (2, 0, 1), (1, 2, 0))[self]


@dataclass(frozen=True, eq=False, kw_only=True)
class Moves:
    """Moves one after the other, one row each, tip positions in the setup's WCS."""

    start_mm: np.ndarray            # (3,) where the first move begins
    kind: np.ndarray                # (n,) Kind
    end_mm: np.ndarray              # (n, 3) tip at the end of each move
    center_mm: np.ndarray           # (n, 3) arc centre (its third-axis entry is unused); NaN on lines
    plane: np.ndarray               # (n,) Plane of arcs; XY on lines
    axis: np.ndarray                # (n, 3) tool axis at the end, unit, tip to holder
    feed_mm_per_min: np.ndarray     # (n,) 0 on rapids

    def __post_init__(self):
        put = lambda name, shape, dtype: object.__setattr__(
            self, name, frozen(getattr(self, name), shape, name, dtype))
        put("start_mm", (3,), float)
        put("kind", (None,), np.int8)
        n = len(self.kind)
        put("end_mm", (n, 3), float)
        put("center_mm", (n, 3), float)
        put("plane", (n,), np.int8)
        put("axis", (n, 3), float)
        put("feed_mm_per_min", (n,), float)
        cutting = self.kind != Kind.RAPID
        bad = np.flatnonzero(cutting & ~(self.feed_mm_per_min > 0))
        if len(bad):
            raise ToolpathError(f"{len(bad)} cutting moves have no feed, first at row {bad[0]}", rows=bad)
        if not (np.isfinite(self.end_mm).all() and np.isfinite(self.start_mm).all()):
            raise ToolpathError("a move has no end point (NaN or infinite)")

    def __len__(self):
        return len(self.kind)

    @property
    def starts_mm(self):
        """(n, 3) where each move begins."""
        return np.vstack([self.start_mm, self.end_mm])[:-1]

    @classmethod
    def joined(cls, parts):
        """Several runs of moves one after the other; a rapid leads from each end to the next start, and turns to its axis.

        Raises:
            ToolpathError: there is nothing to join.
        """
        if not parts:
            raise ToolpathError("no moves to join: the operation came out empty")
        column = lambda name: np.concatenate(
            [piece for k, part in enumerate(parts) for piece in
             ([cls._link(part)[name]] if k else []) + [getattr(part, name)]])
        return cls(start_mm=parts[0].start_mm, **{n: column(n) for n in (
            "kind", "end_mm", "center_mm", "plane", "axis", "feed_mm_per_min")})

    @staticmethod
    def _link(after):
        """One rapid to where the next part begins, as columns."""
        return {"kind": np.array([Kind.RAPID]), "end_mm": after.start_mm[None], "center_mm": np.full((1, 3), np.nan),
                "plane": np.array([Plane.XY]), "axis": after.axis[:1], "feed_mm_per_min": np.zeros(1)}

    @property
    def tilt_rad(self):
        """(n,) angle of the tool axis at the end of each move to +Z, the spindle of a three-axis machine."""
        return tilt_rad(self.axis)

    def with_feed(self, feed_mm_per_min):
        """The same moves at other feeds (n,)."""
        return Moves(**{**self.__dict__, "feed_mm_per_min": feed_mm_per_min})


def tilt_rad(axes, upright=UPRIGHT):
    """Angles of tool axes to where a machine without rotary axes holds them.

    Args:
        axes: (n, 3) unit, tip to holder.   upright: (3,) unit.
    Returns:
        (n,) 0 .. pi; NaN where an axis is none.

    >>> np.degrees(tilt_rad([[0.0, 0.6, 0.8], [0.0, 0.0, 1.0]])).round(3)
    array([36.87,  0.  ])
    """
    axes, upright = np.asarray(axes, float), np.asarray(upright, float)
    across = np.cross(axes, upright)
    return fixed.arctan2(np.sqrt((across * across).sum(axis=1)), (axes * upright).sum(axis=1))


class MoveWriter:
    """Collects moves while a pass is laid out; `moves()` freezes them.

    >>> w = MoveWriter((0, 0, 10))
    >>> w.feed((0, 0, 0), 100); len(w.moves())
    1
    """

    def __init__(self, start_mm):
        self.start_mm = np.array(start_mm, dtype=float)
        self.here_mm = self.start_mm.copy()
        self._rows = []

    def __len__(self):
        return len(self._rows)

    def _add(self, kind, end_mm, center_mm, plane, feed):
        self.here_mm = np.array(end_mm, dtype=float)
        self._rows.append((kind, self.here_mm, center_mm, plane, feed))

    def rapid(self, end_mm):
        """Straight non-cutting move; a move to where the tool stands is left out."""
        if np.abs(np.asarray(end_mm) - self.here_mm).max() > 1e-9:
            self._add(Kind.RAPID, end_mm, (np.nan,) * 3, Plane.XY, 0.0)

    def feed(self, end_mm, feed_mm_per_min):
        """Straight cutting move; a move to where the tool stands is left out."""
        if np.abs(np.asarray(end_mm) - self.here_mm).max() > 1e-9:
            self._add(Kind.FEED, end_mm, (np.nan,) * 3, Plane.XY, feed_mm_per_min)

    def arc(self, end_mm, center_mm, plane, is_clockwise, feed_mm_per_min):
        """Circular cutting move in the given plane; a helix when the third axis differs."""
        kind = Kind.ARC_CW if is_clockwise else Kind.ARC_CCW
        self._add(kind, end_mm, center_mm, plane, feed_mm_per_min)

    def moves(self):
        """All moves so far as one frozen value."""
        n = len(self._rows)
        kind, end, center, plane, feed = zip(*self._rows) if n else ((),) * 5
        return Moves(start_mm=self.start_mm, kind=kind, end_mm=np.reshape(end, (n, 3)),
                     center_mm=np.reshape(center, (n, 3)), plane=plane,
                     axis=np.tile((0.0, 0.0, 1.0), (n, 1)), feed_mm_per_min=feed)


@dataclass(frozen=True, kw_only=True)
class Pause:
    """The program stands still between two moves of an operation."""

    move: int                       # moves of the operation made before it
    seconds: float = 0.0            # that it takes; 0: until the operator goes on
    is_optional: bool = False       # a stop only where the operator has asked for it
    is_spindle_on: bool = True      # with the coolant; off: both go off before, and on again behind
    is_at_top: bool = False         # at the top of the machine, the spindle off: before the operation's tool comes in, or
                                    # behind its last move


@dataclass(frozen=True, eq=False, kw_only=True)
class Operation:
    """All moves of one operation with one tool at one spindle speed."""

    name: str                 # as in plan, report and findings: "rough", "finish"
    tool: Tool
    spindle_rpm: float
    coolant: str              # values.coolants.Coolant
    moves: Moves
    passes: object = None     # pass_templates.TemplatedPasses that come to the same moves; None: only the moves
    cycles: tuple = ()        # drilling.DrillCycle of its holes, that come to some of the moves; where its axis leans: of those
                              # that no moves say (taps, dwells), their places in the position's own axes
    compensated: tuple = ()   # compensation.CompensatedContour that come to some of the moves
    time_s: float | None = None     # that it takes, as planned; None: nobody has said
    is_from_top: bool = False       # it begins from the top of the machine, whatever tool was in before
    level_mm: float | None = None   # where its axis leans and stands: rapids across run so far above the zero, along the axis
    rpm_changes: tuple[tuple[int, float], ...] = ()     # (move, spindle speed from there on); before the first: spindle_rpm
    pauses: tuple[Pause, ...] = ()  # in the order in which they come
    is_backwards: bool = False      # the spindle turns counter-clockwise seen from the holder (M4)

    def rpm_at(self, move):
        """Spindle speed of a move."""
        return next((rpm for first, rpm in reversed(self.rpm_changes) if first <= move), self.spindle_rpm)


@dataclass(frozen=True, eq=False, kw_only=True)
class Program:
    """One setup's operations in order, with what the operator must know."""

    name: str
    setup: str                          # "setup-1"
    wcs: str                            # "G54"
    wcs_in_words: str                   # where the operator finds the zero
    operations: tuple[Operation, ...]
    clearance_z_mm: float               # rapids across run at or above this WCS height
    header: tuple[str, ...]             # comment lines for the top of the program
