"""Drilled holes as canned cycles: G98 G81 X Y Z R F, then X Y a hole, then G80; or move by move where a control has none.

Of an operation whose tool leans only taps and dwells are cycles, in the words of where it stands: along Z there too.

G98 leads back to where the first cycle began, G99 to R; all words of a cycle stay in force until G80.  Tapped holes have no
moves of their own to go out as: G84 and G74, or what the control has in their place.  Controls with calls of their own
(CYCLE81, cycle 200) get one a hole, where the tool stands over it.
"""

from dataclasses import replace

import numpy as np

from cuspline.posts.writers.joint_words import leans
from cuspline.program.program import Kind, Plane
from cuspline.values.errors import PostError


class DrilledMoves:
    """An operation of drilled holes; what is no cycle goes out as PlainMoves, TiltedMoves or SolvedMoves lay it out."""

    def __init__(self, laid, operation, has_cycles, resolution_mm):
        """
        Args:
            laid: the operation move by move.
            has_cycles: whether the control takes cycles; tapping ones it does in any case.
            resolution_mm: a step of the last decimal.
        Raises:
            PostError: a tool that leans goes down along more than Z.
        """
        self.laid, self.moves, self.at_mm, self.rpm = laid, operation.moves, laid.at_mm, operation.spindle_rpm
        self.has_cycles, self.cycles = has_cycles, operation.cycles
        if leans(self.moves):
            self.has_cycles, self.cycles = False, tuple(self._as_laid(c, operation.name, resolution_mm) for c in operation.cycles)

    def __getattr__(self, name):
        return getattr(self.laid, name)

    def _first_feed(self, cycle):
        return cycle.first + int((self.moves.kind[cycle.first:cycle.end] == Kind.RAPID).argmin())

    def _as_laid(self, cycle, name, resolution_mm):
        """The cycle in the words of what is laid out."""
        feeds = self._first_feed(cycle)
        above, bottom = self.at_mm[feeds], self.at_mm[feeds + 1]
        if np.abs(above[:2] - bottom[:2]).max() > resolution_mm:
            raise PostError(f"operation {name}: its tool goes down along X or Y too, which taps and dwells do not: mill the thread "
                            "(thread_mill), or choose a machine that turns the part, or whose control takes planes")
        return replace(cycle, xy_mm=tuple(bottom[:2].tolist()), bottom_z_mm=float(bottom[2]), retract_z_mm=float(above[2]))

    def write(self, writer, first, end, dialect):
        at = first
        for k, cycle in enumerate(self.cycles):
            self.laid.write(writer, at, cycle.first, dialect)
            is_tap = cycle.kind == "tap"
            if self.has_cycles and not is_tap and self._called(writer, cycle, dialect):
                pass
            elif cycle.word not in dialect.cycle_words or not (self.has_cycles or is_tap):
                (self._tapped if is_tap else self._spelled_out)(writer, cycle, dialect)
            else:
                writer.to_plane(Plane.XY)
                if is_tap and not (k and at == cycle.first):
                    dialect.before_taps(writer, self.rpm)
                _begin_or_go_on(writer, cycle, self.cycles[k - 1] if k and at == cycle.first else None, dialect)
                if k + 1 == len(self.cycles) or self.cycles[k + 1].first != cycle.end:
                    self._leave(writer, cycle)
            at = cycle.end
        self.laid.write(writer, at, end, dialect)

    def _called(self, writer, cycle, dialect):
        """Over the hole, and the control's own call of its cycle there; whether it has one."""
        if not dialect.drills(cycle):
            return False
        at = self.at_mm
        over = [k for k in range(cycle.first, self._first_feed(cycle)) if (at[k, :2] != at[k + 1, :2]).any()]
        if over:
            self.laid.write(writer, over[0], over[-1] + 1, dialect)
        end_mm = at[cycle.end]
        writer.to_plane(Plane.XY)       # cycles go square to it; arcs before may have left another
        dialect.drill(writer, cycle, float(end_mm[2]))
        writer.count_rounding((*cycle.xy_mm, cycle.bottom_z_mm))
        writer.words(end_mm)
        writer.here_mm, writer.motion = end_mm, None
        return True

    def _spelled_out(self, writer, cycle, dialect):
        """The cycle's moves, and its dwell behind the last that feeds."""
        self.laid.write(writer, cycle.first, cycle.end - 1, dialect)
        if cycle.dwell_s:
            dialect.wait(writer, cycle.dwell_s)
        self.laid.write(writer, cycle.end - 1, cycle.end, dialect)

    def _tapped(self, writer, cycle, dialect):
        """Over the hole, the control's own words for the thread, and up."""
        feeds = self._first_feed(cycle)
        self.laid.write(writer, cycle.first, feeds, dialect)
        dialect.tap(writer, cycle, self.rpm, float(self.at_mm[cycle.end, 2]))
        writer.motion = writer.feed = None
        self.laid.write(writer, feeds + 2, cycle.end, dialect)

    def _leave(self, writer, cycle):
        """G80, and where the tool stands then."""
        writer.block("G80")
        writer.motion = None
        end_mm = self.at_mm[cycle.end]
        writer.words(end_mm)
        writer.here_mm = end_mm


def _begin_or_go_on(writer, cycle, before, dialect):
    """The block of one hole; of what stays in force only what changes is written."""
    x, y = ("XY"[k] + writer.length(v) for k, v in enumerate(cycle.xy_mm))
    words, old = _modal_words(writer, cycle, dialect), [] if before is None else _modal_words(writer, before, dialect)
    is_new = before is None or words[:2] != old[:2]
    head = words[:2] if is_new else []
    depth = [w for k, w in enumerate(words[2:]) if is_new or w != old[2 + k]]
    writer.count_rounding((*cycle.xy_mm, cycle.bottom_z_mm))
    writer.block(*head, x, y, *depth, *writer.feed_words(cycle.feed_mm_per_min))


def _modal_words(writer, cycle, dialect):
    """[return level, cycle, Z, R, and what its kind has]."""
    words = ["G99" if cycle.stays_low else "G98", dialect.cycle_words[cycle.word], "Z" + writer.length(cycle.bottom_z_mm),
             "R" + writer.length(cycle.retract_z_mm)]
    if cycle.peck_mm:
        words.append("Q" + writer.length(cycle.peck_mm))
    return words + ([dialect.dwell(cycle.dwell_s)] if cycle.dwell_s else [])
