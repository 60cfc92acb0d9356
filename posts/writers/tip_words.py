"""Operations whose tool leans, for tool-centre-point control: X Y Z are the tip in the part, the control moves the joints.

The tip keeps to its line by itself; blocks are as long as the axis keeps to its great circle while the rotaries run evenly.
Feeds are the tip's (G94), slower where a joint would not follow; where the tip hardly moves the block states its time (G93).
The program holds for any zero, place on the table and tool length within the travels.  On the way in the tool comes down
along its own axis, from near the top of the travels.
"""

import math

import numpy as np

from cuspline.posts.writers.joint_words import JointRun, turn_at_top
from cuspline.program.joint_times import block_seconds, driven_seconds

UNEVEN = 1.05               # within a block joints do not run evenly: so much slower than their speeds, from end to end
ANY_MM = 1e6                # how far the joints' own way may leave the tip's line: the control does not go it
STANDS_MM = 0.02            # a block shorter than this states its time: the digits of its ends do not tell its length,
LEAST_DIGITS = 100          # nor those of its feed how fast it is
STILL = 1e-9                # of a joint beside the tip's way
BELOW_MM = 10.0             # the top of the travels, where the way down begins: zero and tool may differ by so much


class TipMoves:
    """An operation as tips and rotaries."""

    is_tip = True

    def __init__(self, operation, machine, states_times=True, blend_mm=None):
        """
        Args:
            states_times: the control takes the time of a block (G93).
            blend_mm: P of G64 on LinuxCNC, whose blends take time; None: the control looks ahead.
        Raises:
            PostError: see joint_words.JointRun.
        """
        self.run, self.states_times = JointRun(operation, machine, ANY_MM), states_times
        run, self.tool, self.origin_mm = self.run, operation.tool, np.array(machine.wcs_origin_mm)
        tips, self.axes = run.chain.forward(run.joints, run.length_mm)
        self.words_mm = tips - self.origin_mm
        least = (np.abs(np.diff(run.joints, axis=0)) / run.chain.speed).max(axis=1)
        wanted = np.maximum(run.wanted_s, UNEVEN * least)
        self.seconds = np.concatenate([[0.0], block_seconds(run.chain, run.joints, wanted, run.is_linked)])
        self.entry_mm_per_min = min(axis.rapid_mm_per_min for axis in machine.axes)
        self.start_mm, self.starts_mm = self.words_mm[0], self.words_mm[run.first - 1]
        self.turned_deg = run.degrees[run.first - 1]
        driven_s = self.driven_s(blend_mm)
        self.joint_s = driven_s if run.turns else None
        self.notes = ("TOOL-CENTRE-POINT CONTROL: ANY ZERO AND TOOL LENGTH WITHIN THE TRAVELS",
                      f"ABOUT {driven_s:.0f} S FROM BLOCK TO BLOCK")

    def driven_s(self, blend_mm):
        """How long the control takes: LinuxCNC, with this P of G64, runs tip and rotaries as it runs joints; None: as is stated."""
        if blend_mm is None:
            return float(self.seconds.sum())
        poses = np.column_stack([self.words_mm, self.run.joints[:, 3:]])
        return float(driven_seconds(self.run.chain, poses, self.seconds[1:], blend_mm).sum())

    def begin(self, writer, first, dialect):
        """From the top of the machine, rotaries turned, to where move `first` begins."""
        self._enter(writer, self.run.first[first] - 1, dialect)

    def _enter(self, writer, k, dialect):
        """At the top in machine coordinates over where the tool's axis leads up from block k, then down along it."""
        go_above(writer, self.run, k, self.words_mm[k] + self.origin_mm, self.axes[k], dialect)
        first, behind = dialect.tip_on(writer, self.tool)
        feed = () if dialect.tip_rapid == "G0" else ("F" + writer.feed_text(self.entry_mm_per_min),)
        writer.joint_move(dialect.tip_rapid, self.words_mm[k], self.run.degrees[k], (*feed, *behind), first)

    def write(self, writer, first, end, dialect):
        """Blocks of moves `first` to `end`."""
        run, is_inverse = self.run, False
        for k in run.blocks(writer, first, end, dialect):
            if k in run.rewinds:
                is_inverse = self._told(writer, is_inverse, False)
                dialect.tip_off(writer)
                turn_at_top(writer, run.degrees[k], dialect)
                self._enter(writer, k, dialect)
                continue
            if not run.is_feed[k] and dialect.tip_rapid == "G0":
                writer.joint_move("G0", self.words_mm[k], run.degrees[k])
                continue
            way = math.dist(self.words_mm[k], self.words_mm[k - 1])
            digits = writer.scale * 60.0 * way / self.seconds[k] * 10 ** writer.machine.control.decimals_feed
            is_short = way < STANDS_MM or digits < LEAST_DIGITS
            is_inverse = self._told(writer, is_inverse, is_short and self.states_times)
            feed = writer.inverse_time(self.seconds[k]) if is_inverse else self._feed(writer, k, way, is_short)
            writer.joint_move("G1", self.words_mm[k], run.degrees[k], ("F" + feed,))
        self._told(writer, is_inverse, False)
        writer.feed = None

    def _feed(self, writer, k, way_mm, is_short):
        """The F word's number of block k; a short one's is of the way as it is written, or of the rotaries where the tip stands."""
        if not is_short:
            return writer.tip_feed(way_mm, self.seconds[k])
        before, after = ([writer.rounded_mm(v) for v in self.words_mm[n]] for n in (k - 1, k))
        turned = self.run.degrees[k] - self.run.degrees[k - 1]
        written = math.dist(before, after) * writer.scale or float(np.sqrt((turned * turned).sum()))
        return writer.fine_feed(60.0 * written / self.seconds[k])

    @staticmethod
    def _told(writer, was, is_inverse):
        """G93 or G94 where it changes; the new mode."""
        if is_inverse != was:
            writer.block("G93" if is_inverse else "G94")
        return is_inverse


def go_above(writer, run, k, tip_mm, axis, dialect):
    """In machine coordinates to the top of the tool's way down, the rotaries as in block k; for the rest see `room_mm`."""
    high = tip_mm + room_mm(run, k, tip_mm, axis) * axis
    x, y, z = run.chain.placed(high, run.joints[k, 3:], run.length_mm)[0, :3]
    dialect.in_machine(writer, "X" + writer.length(x), "Y" + writer.length(y))
    dialect.in_machine(writer, "Z" + writer.length(z))


def room_mm(run, k, tip_mm, axis):
    """How far a tool may go up along its axis from a tip, the rotaries as in block k, up to BELOW_MM from the travels' ends.

    Args:
        run: JointRun.   tip_mm: (3,) in the part's frame.   axis: (3,) unit.
    """
    chain, angles = run.chain, run.joints[k, 3:]
    tips = tip_mm + np.array([[0.0], [1.0]]) * axis
    here, above = chain.placed(tips, np.array([angles, angles]), run.length_mm)[:, :3]
    step = above - here
    high, low = np.array([*chain.high[:2], min(chain.high[2], 0.0)]) - BELOW_MM, chain.low[:3] + BELOW_MM
    goes = np.abs(step) > STILL
    room = np.where(step > 0, high - here, low - here)[goes] / step[goes]
    return max(float(room.min()), 0.0)
