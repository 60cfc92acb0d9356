"""Drilled holes as canned cycles: G98 G81 X Y Z R F, then X Y a hole, then G80; or move by move where a control has none.

G98 leads back to where the first cycle began, G99 to R; all words of a cycle stay in force until G80.  Tapped holes have no
moves of their own to go out as: G84 and G74, or what the control has in their place.  Controls with calls of their own
(CYCLE81, cycle 200) get one a hole, where the tool stands over it.
"""

import numpy as np

from cuspline.posts.writers.joint_words import PlainMoves
from cuspline.program.program import Kind


class DrilledMoves(PlainMoves):
    """An operation of drilled holes, the spindle upright."""

    def __init__(self, operation, rotaries, has_cycles):
        """`has_cycles`: whether the control takes them; tapping ones it does in any case."""
        super().__init__(operation, rotaries)
        self.cycles, self.has_cycles, self.rpm = operation.cycles, has_cycles, operation.spindle_rpm

    def write(self, writer, first, end, dialect):
        at = first
        for k, cycle in enumerate(self.cycles):
            super().write(writer, at, cycle.first, dialect)
            is_tap = cycle.kind == "tap"
            if self.has_cycles and not is_tap and self._called(writer, cycle, dialect):
                pass
            elif cycle.word not in dialect.cycle_words or not (self.has_cycles or is_tap):
                (self._tapped if is_tap else self._spelled_out)(writer, cycle, dialect)
            else:
                if is_tap and not (k and at == cycle.first):
                    dialect.before_taps(writer, self.rpm)
                _begin_or_go_on(writer, cycle, self.cycles[k - 1] if k and at == cycle.first else None, dialect)
                if k + 1 == len(self.cycles) or self.cycles[k + 1].first != cycle.end:
                    self._leave(writer, cycle)
            at = cycle.end
        super().write(writer, at, end, dialect)

    def _called(self, writer, cycle, dialect):
        """Over the hole, and the control's own call of its cycle there; whether it has one."""
        if not dialect.drills(cycle):
            return False
        feeds = cycle.first + (self.moves.kind[cycle.first:cycle.end] == Kind.RAPID).argmin()
        starts = np.vstack([self.start_mm, self.moves.end_mm])
        over = [k for k in range(cycle.first, int(feeds)) if (starts[k, :2] != self.moves.end_mm[k, :2]).any()]
        if over:
            super().write(writer, over[0], over[-1] + 1, dialect)
        end_mm = self.moves.end_mm[cycle.end - 1]
        dialect.drill(writer, cycle, float(end_mm[2]))
        writer.count_rounding((*cycle.xy_mm, cycle.bottom_z_mm))
        writer.words(end_mm)
        writer.here_mm, writer.motion = end_mm, None
        return True

    def _spelled_out(self, writer, cycle, dialect):
        """The cycle's moves, and its dwell behind the last that feeds."""
        super().write(writer, cycle.first, cycle.end - 1, dialect)
        if cycle.dwell_s:
            dialect.wait(writer, cycle.dwell_s)
        super().write(writer, cycle.end - 1, cycle.end, dialect)

    def _tapped(self, writer, cycle, dialect):
        """Over the hole, the control's own words for the thread, and up."""
        feeds = cycle.first + (self.moves.kind[cycle.first:cycle.end] == Kind.RAPID).argmin()
        super().write(writer, cycle.first, int(feeds), dialect)
        dialect.tap(writer, cycle, self.rpm, float(self.moves.end_mm[cycle.end - 1, 2]))
        writer.motion = writer.feed = None
        super().write(writer, int(feeds) + 2, cycle.end, dialect)

    def _leave(self, writer, cycle):
        """G80, and where the tool stands then."""
        writer.block("G80")
        writer.motion = None
        end_mm = self.moves.end_mm[cycle.end - 1]
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
