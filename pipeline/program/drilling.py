"""Holes as drills make them: a canned cycle a hole, and the moves that it stands for.

    level  ──► across ──┐                        "drill": down at the feed, up by a rapid; "tap", "ream": up at the feed too
                        ▼                        "dwell": the same, standing still at the bottom
    retract (R) ────────┬───── begin to feed     "peck": up to R after every peck, back to a little above the last
                        ┊ pecks                  "chip_break": up by a little after every peck
    bottom (Z) ─────────┴
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cuspline.program.program import Kind, MoveWriter
from cuspline.values.errors import ToolpathError

CycleKind = Literal["drill", "dwell", "peck", "chip_break", "tap", "ream"]
PECKS = ("peck", "chip_break")
CLEARANCE_MM = 0.5          # above the last peck, to which rapids come back; a control has its own
MOST_PECKS = 1000


@dataclass(frozen=True, kw_only=True)
class DrillCycle:
    """One hole of an Operation; the tip's places in the WCS, mm."""

    kind: CycleKind
    xy_mm: tuple[float, float]
    bottom_z_mm: float
    retract_z_mm: float             # the R plane: from here on it feeds
    peck_mm: float = 0.0            # of "peck" and "chip_break"
    dwell_s: float = 0.0            # at the bottom, of "dwell"
    pitch_mm: float = 0.0           # of "tap": way a turn of the spindle, below 0 of a left-hand thread
    stays_low: bool = False         # it ends in the R plane (G99), not where it began (G98)
    feed_mm_per_min: float
    first: int                      # of the operation's moves it stands for `first` to `end`
    end: int

    def __post_init__(self):
        if not self.bottom_z_mm < self.retract_z_mm:
            raise ToolpathError(f"a hole drilled from Z{self.retract_z_mm:g} to Z{self.bottom_z_mm:g}: its bottom must be lower")
        if (self.kind in PECKS) != (self.peck_mm > 0) or (self.kind == "dwell") != (self.dwell_s > 0):
            raise ToolpathError(f"a cycle {self.kind!r} with pecks of {self.peck_mm:g} mm and a dwell of {self.dwell_s:g} s: "
                                f"pecks belong to {' and '.join(PECKS)}, a dwell to dwell")
        if (self.kind == "tap") != (self.pitch_mm != 0):
            raise ToolpathError(f"a cycle {self.kind!r} with a pitch of {self.pitch_mm:g} mm: a pitch belongs to tap")
        if self.peck_mm and (self.retract_z_mm - self.bottom_z_mm) / self.peck_mm > MOST_PECKS:
            raise ToolpathError(f"more than {MOST_PECKS} pecks of {self.peck_mm:g} mm in one hole: raise the peck")

    @property
    def word(self):
        """Its kind, of a left-hand tap "tap left": which word a control has for it."""
        return "tap left" if self.pitch_mm < 0 else self.kind

    def shifted(self, by_mm):
        """The same, its places moved by (3,)."""
        x, y, z = (float(v) for v in by_mm)
        return DrillCycle(**{**self.__dict__, "xy_mm": (self.xy_mm[0] + x, self.xy_mm[1] + y),
                             "bottom_z_mm": self.bottom_z_mm + z, "retract_z_mm": self.retract_z_mm + z})


def cycle_way(cycle, clearance_mm, top_z_mm):
    """What a control does once it stands over the hole in the R plane.

    Args:
        cycle: DrillCycle.   clearance_mm: above the last peck.   top_z_mm: where it ends.
    Yields:
        (program.Kind, height of the tip).
    """
    depth = cycle.retract_z_mm - cycle.peck_mm if cycle.kind in PECKS else cycle.bottom_z_mm
    while depth > cycle.bottom_z_mm:
        yield Kind.FEED, depth
        if cycle.kind == "peck":
            yield Kind.RAPID, cycle.retract_z_mm
        yield Kind.RAPID, depth + clearance_mm
        depth -= cycle.peck_mm
    yield Kind.FEED, cycle.bottom_z_mm
    if cycle.kind in ("tap", "ream"):
        yield Kind.FEED, cycle.retract_z_mm
    yield Kind.RAPID, top_z_mm


def drilled(holes, level_z_mm, feed_mm_per_min):
    """Moves of holes one after the other, and their cycles.

    Args:
        holes: DrillCycle values, their `first` and `end` not yet known.
        level_z_mm: height of rapids across; a hole that stays low is followed by one with the same R plane.
        feed_mm_per_min: of all of them.
    Returns:
        (Moves from the level to the level, tuple of DrillCycle).
    """
    writer, cycles = MoveWriter((*holes[0].xy_mm, level_z_mm)), []
    for hole in holes:
        first = len(writer)
        writer.rapid((*hole.xy_mm, writer.here_mm[2]))
        writer.rapid((*hole.xy_mm, hole.retract_z_mm))
        for kind, z in cycle_way(hole, CLEARANCE_MM, hole.retract_z_mm if hole.stays_low else level_z_mm):
            if kind == Kind.FEED:
                writer.feed((*hole.xy_mm, z), feed_mm_per_min)
            else:
                writer.rapid((*hole.xy_mm, z))
        cycles.append(DrillCycle(**{**hole.__dict__, "feed_mm_per_min": feed_mm_per_min, "first": first, "end": len(writer)}))
    writer.rapid((*holes[-1].xy_mm, level_z_mm))
    return writer.moves(), tuple(cycles)


def shortest_way(xy_mm):
    """Order in which places are visited by a short way: the nearest next, then stretches turned round while that helps.

    Args:
        xy_mm: (n, 2).
    Returns:
        (n,) indices.

    >>> shortest_way(np.array([[0.0, 0.0], [20.0, 0.0], [10.0, 0.0], [30.0, 0.0]])).tolist()
    [0, 2, 1, 3]
    """
    away = np.sqrt(((xy_mm[:, None] - xy_mm[None]) ** 2).sum(axis=2))
    order, left = [int(np.lexsort((xy_mm[:, 1], xy_mm[:, 0]))[0])], set(range(len(xy_mm)))
    left.discard(order[0])
    while left:
        order.append(min(sorted(left), key=lambda k: away[order[-1], k]))
        left.discard(order[-1])
    gains = True
    while gains:
        gains = any(_turned_round(order, away, i) for i in range(len(order) - 1))
    return np.array(order, int)


def _turned_round(order, away, i):
    """Turns the stretch behind place i round where that is shorter; whether it did."""
    for j in range(i + 2, len(order)):
        before = away[order[i], order[i + 1]] + (away[order[j], order[j + 1]] if j + 1 < len(order) else 0.0)
        after = away[order[i], order[j]] + (away[order[i + 1], order[j + 1]] if j + 1 < len(order) else 0.0)
        if after < before - 1e-9:
            order[i + 1:j + 1] = order[i + 1:j + 1][::-1]
            return True
    return False
