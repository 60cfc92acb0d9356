"""Post for Delta Tau PMAC motion programs, three axes; repeated passes move by move.

Facts of the control that this post respects (PMAC User's Manual, Writing and Executing Motion Programs; Software Reference, program
commands): RAPID, LINEAR, CIRCLE1 (clockwise) and CIRCLE2 hold until the next of them; NORMAL K-1, J-1 and I-1 are the planes of X
and Y, Z and X, Y and Z; ABS holds for ends, INC (R) for centres; F counts user units in the time of Ix90; a program is calculated
ahead of the motion, DWELL waits for it.  G, M, S and T are calls of the integrator's own PROG 1000 to 1002, which the header says:
G21 G20 units, G54 zeros, G53 machine coordinates without tool length, G43 the length.  How far blended moves leave their corners
hangs on TA and TS of the set-up: the machine's file states it as path_tolerance_mm.  Rotaries, and tools beside the spindle's axis,
are refused.
"""

from cuspline.posts.writers.program_files import Dialect, posted
from cuspline.posts.writers.program_numbers import program_number
from cuspline.posts.writers.words import UNIT_WORD, Writer, behind_semicolon
from cuspline.program.program import Kind, Plane

EXTENSION = "pmc"
READER = "pmac_reader"
TOOL_TABLE = None
comment = behind_semicolon


def post(program, machine):
    """Write a Program as text.

    Args:
        program: cuspline.program.program.Program.
        machine: cuspline.shop.machines.Machine.
    Returns:
        Posted.
    Raises:
        PostError: rotary axes, a tool beside the spindle's axis, a work offset beyond G59, a line longer than the control takes, a
            spindle speed outside the machine's range, a feed that rounds to nothing, an operation that does not start and end at
            the clearance height.
    """
    return posted(program, machine, _Pmac())


class _Commands(Writer):
    """Moves as PMAC names them."""

    motion_words = {Kind.RAPID: "RAPID", Kind.FEED: "LINEAR", Kind.ARC_CW: "CIRCLE1", Kind.ARC_CCW: "CIRCLE2"}
    plane_words = {Plane.XY: "NORMAL K-1", Plane.ZX: "NORMAL J-1", Plane.YZ: "NORMAL I-1"}


class _Pmac(Dialect):
    """A motion program, the integrator's sub-programs round it."""

    point, end, comment, unnumbered = "", "M30", staticmethod(comment), (";", "OPEN", "CLOSE")
    knows_radii = True
    writes, work_offsets = _Commands, ("G54", "G55", "G56", "G57", "G58", "G59")

    def head(self, writer, program, file_number):
        """The buffer opened, comments, then a known state."""
        writer.block("CLOSE")
        writer.block(f"OPEN PROG {program_number(program, file_number)} CLEAR")
        for line in program.header:
            writer.comment(line)
        writer.comment("G M S T ARE THE INTEGRATOR'S OWN PROG 1000 TO 1002; F COUNTS A MINUTE: IX90 = 60000")
        writer.comment("G53: MACHINE COORDINATES WITHOUT TOOL LENGTH; A PSET OF ANOTHER PROGRAM STAYS IN FORCE")
        writer.block(UNIT_WORD[writer.machine.control.units])
        writer.block("NORMAL K-1")
        writer.block("ABS")
        writer.block("INC (R)")
        writer.block("CC0")
        writer.block(program.wcs)

    def stop(self, writer):
        """Behind the motion, not ahead of it."""
        writer.block("DWELL 0")
        super().stop(writer)

    def wait(self, writer, seconds):
        """Milliseconds, behind the motion."""
        writer.block(f"DWELL {1000 * seconds:.0f}")

    def halt(self, writer, is_optional):
        """Behind the motion; the integrator's program may have left another plane."""
        writer.block("DWELL 0")
        super().halt(writer, is_optional)
        writer.plane = None

    def up(self, writer):
        writer.block("G53", "Z0")

    def change_tool(self, writer, operation):
        super().change_tool(writer, operation)
        writer.plane = None             # the integrator's program may have left another one

    def foot(self, writer):
        super().foot(writer)
        writer.tail.append("CLOSE")
