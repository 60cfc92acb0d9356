"""Indexed positions in a frame of the control whose Z is the tool: a tilted plane (G68.2, PLANE), or the zero gone with the table
(G254).  Words are the tip's in it.

The rotary axes are named at the top of the machine before; a plane then finds them where they belong, and has no choice.
"""

import numpy as np

from cuspline.posts.writers.joint_words import JointRun, at_one_speed
from cuspline.posts.writers.tip_words import ANY_MM, go_above
from cuspline.values import fixed_math as fixed
from cuspline.values.frames import Frame


class TiltedMoves:
    """An operation whose axis leans and stands."""

    is_tip, joint_s = True, None

    def __init__(self, operation, machine, dialect):
        """
        Raises:
            PostError: see joint_words.JointRun; see `Dialect.plane_frame`.
        """
        self.run = run = JointRun(operation, machine, ANY_MM)
        self.operation, self.tool, self.moves = operation, operation.tool, operation.moves
        self.origin_mm = np.array(machine.wcs_origin_mm)
        self.axis = operation.moves.axis[0]
        self.plane_deg = plane_angles_deg(self.axis, machine.control.decimals_deg)
        self.frame = dialect.plane_frame(run, self.plane_deg)
        self.start_mm, self.starts_mm = operation.moves.start_mm, operation.moves.starts_mm
        self.ends_mm = self.frame.into(operation.moves.end_mm)
        self.turned_deg = run.degrees[run.first - 1]
        self.notes = (dialect.plane_note,)

    @property
    def at_mm(self):
        """(n + 1, 3) words where each move begins, and where the last ends."""
        return np.vstack([self.frame.into(self.start_mm[None]), self.ends_mm])

    @property
    def side(self):
        """Of the two ways to hold the tool so: 1 where the last rotary axis stands at the larger angle, else -1."""
        both = self.run.chain.branches(self.axis[None])[0][0, :, -1]
        stands = self.run.joints[0, -1]
        mine, other = sorted(both.tolist(), key=lambda angle: abs(float(fixed.sin(0.5 * (angle - stands)))))
        return 1 if mine >= other else -1

    def begin(self, writer, first, dialect):
        """From the top of the machine, rotaries turned, to where move `first` begins."""
        tip = self.starts_mm[first]
        go_above(writer, self.run, self.run.first[first] - 1, tip + self.origin_mm, self.axis, dialect)
        place = self.frame.into(tip[None])[0]
        dialect.plane_on(writer, self, place)
        writer.here_mm = place

    def write(self, writer, first, end, dialect):
        """Blocks of moves `first` to `end`, all of them straight."""
        for begin, stop in at_one_speed(self.operation, writer, first, end, dialect):
            self._write(writer, begin, stop)

    def _write(self, writer, first, end):
        m = self.moves
        for row in zip(m.kind[first:end].tolist(), self.ends_mm[first:end].tolist(), m.center_mm[first:end].tolist(),
                       m.plane[first:end].tolist(), m.feed_mm_per_min[first:end].tolist()):
            writer.move(*row)


def plane_angles_deg(axis, decimals):
    """(I, J, K) about Z, the new X and the new Z, that bring Z to an axis, rounded as they are written.

    >>> plane_angles_deg(np.array([0.0, -1.0, 0.0]), 4)
    (0.0, 90.0, 0.0)
    """
    across = float(fixed.hypot(axis[0], axis[1]))
    about_z = float(np.degrees(fixed.arctan2(axis[0], -axis[1]))) if across > 0.0 else 0.0
    return (round(about_z, decimals) + 0.0, round(float(np.degrees(fixed.arctan2(across, axis[2]))), decimals) + 0.0, 0.0)


def frame_of(plane_deg):
    """Frame in the WCS, its zero the WCS's, of angles about Z and the new X."""
    i, j, _ = np.radians(plane_deg)
    s, c = float(fixed.sin(i)), float(fixed.cos(i))
    sj, cj = float(fixed.sin(j)), float(fixed.cos(j))
    return Frame(rotation=np.array([[c, -s * cj, s * sj], [s, c * cj, -c * sj], [0.0, sj, cj]]), origin_mm=np.zeros(3))
