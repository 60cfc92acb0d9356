"""Contours as a control runs them beside its D register: G41 D, the contour itself, G40 away from it; or RL and R0."""

from cuspline.posts.writers.joint_words import PlainMoves
from cuspline.program.program import Plane


class CompensatedMoves(PlainMoves):
    """An operation with contours that the control shifts, the spindle upright."""

    def __init__(self, operation, rotaries):
        super().__init__(operation, rotaries)
        self.contours, self.tool = operation.compensated, operation.tool.number
        most = operation.tool.cutter.radius_mm
        least = most - max(c.worn_mm for c in self.contours)
        self.notes = (f"D{self.tool} IS THE RADIUS AS MEASURED: {least:.3f} TO {most:.3f} MM",)

    def write(self, writer, first, end, dialect):
        at = first
        for one in self.contours:
            if first <= one.first < end:
                super().write(writer, at, one.first, dialect)
                self._contour(writer, one, dialect)
                at = one.end
        super().write(writer, at, end, dialect)

    def _contour(self, writer, one, dialect):
        m, last = one.contour, len(one.contour) - 1
        rows = zip(m.kind.tolist(), m.end_mm.tolist(), m.center_mm.tolist(), m.plane.tolist(),
                   self.moves.feed_mm_per_min[one.row].tolist())
        writer.to_plane(Plane.XY)
        for k, row in enumerate(rows):
            if k in (0, last):
                writer.radius_words = dialect.compensation(writer, self.tool, is_on=k == 0)
                writer.motion = None
            writer.move(*row)
