"""Contours as a control runs them beside its D register: G41 D, the contour itself, G40 away from it; or RL and R0.

Of a tool that leans the contour goes out in the X and Y of the plane that it stands square to, or of the joints' words where the
part has turned under a tool along Z; arcs stay arcs there, and F is that of the tip's way (G94), for nothing turns.
"""

from dataclasses import replace

from cuspline.program.program import Plane


class CompensatedMoves:
    """An operation with contours that the control shifts; the rest as PlainMoves, TiltedMoves or SolvedMoves lay it out."""

    def __init__(self, laid, operation):
        """
        Args:
            laid: the operation move by move.
        Raises:
            PostError: the tool leans out of the words' Z, see joint_words.SolvedMoves.frame.
        """
        self.laid, self.contours, self.tool = laid, operation.compensated, operation.tool
        self.feed_mm_per_min, self.frame = operation.moves.feed_mm_per_min, laid.frame
        most = operation.tool.cutter.radius_mm
        least = most - max(c.worn_mm for c in self.contours)
        self.notes = (*laid.notes, f"D{self.tool.number} IS THE RADIUS AS MEASURED: {least:.3f} TO {most:.3f} MM")

    def __getattr__(self, name):
        return getattr(self.laid, name)

    def write(self, writer, first, end, dialect):
        at = first
        for one in self.contours:
            if first <= one.first < end:
                self.laid.write(writer, at, one.first, dialect)
                self._contour(writer, one, dialect)
                at = one.end
        self.laid.write(writer, at, end, dialect)

    def _contour(self, writer, one, dialect):
        m, last = self._in_words(one), len(one.contour) - 1
        rows = zip(m.kind.tolist(), m.end_mm.tolist(), m.center_mm.tolist(), m.plane.tolist(),
                   self.feed_mm_per_min[one.row].tolist())
        writer.to_plane(Plane.XY)
        for k, row in enumerate(rows):
            if k in (0, last):
                writer.radius_words = dialect.compensation(writer, self.tool.number, is_on=k == 0)
                writer.motion = None
            writer.move(*row)

    def _in_words(self, one):
        """Moves of a contour in the words' axes; rounded angles of a plane would let its height wander by less than a digit."""
        if self.frame is None:
            return one.contour
        contour = one.moved(self.frame.into).contour
        end_mm = contour.end_mm.copy()
        end_mm[:, 2] = self.laid.at_mm[one.first, 2]
        return replace(contour, end_mm=end_mm)
