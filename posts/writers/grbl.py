"""Post for Grbl 1.1, three axes: one file a tool, lines below 80 characters, no cycles and no sub-programs.

Facts of the control that this post respects (Grbl's own documentation, "Grbl v1.1 Commands" and "Configuration", and its source):
a line holds at most 79 characters beside blanks and comments; it changes no tool, T only names the one that is in; the tool
length goes on by G43.1 Z, for there is no tool table; arcs by I J K whose radii agree within 0.005 mm or a thousandth; M7 is there
only where it was compiled in (ENABLE_M7).  It runs exactly along the path and draws arcs as chords within $12, which the machine's
file states as path_tolerance_mm.  The top of the travels is below machine zero by the pull-off ($27).
"""

from cuspline.posts.writers.program_files import Dialect, posted
from cuspline.posts.writers.words import UNIT_WORD, in_brackets
from cuspline.values.errors import PostError

EXTENSION = "nc"
READER = "grbl_reader"
TOOL_TABLE = None
NEEDS_LENGTHS = True        # of tools: they stand in the program
comment = in_brackets
LENGTH_DECIMALS = {"mm": 5, "inch": 6}
LARGEST_TOOL = 255


def post(program, machine):
    """Write a Program as texts, a new one for every tool.

    Args:
        program: cuspline.program.program.Program.
        machine: cuspline.shop.machines.Machine.
    Returns:
        Posted.
    Raises:
        PostError: rotary axes, a tool beside the spindle's axis or with a number above 255, a work offset that Grbl has not, a
            line longer than the control takes, a spindle speed outside the machine's range, a feed that rounds to nothing, an
            operation that does not start and end at the clearance height.
    """
    return posted(program, machine, _Grbl())


class _Grbl(Dialect):
    """RS-274 as far as Grbl has it."""

    point, end, one_tool_a_file, knows_radii = "", "M30", True, True
    work_offsets = ("G54", "G55", "G56", "G57", "G58", "G59")

    def head(self, writer, program, file_number):
        """Comments, then a known state."""
        for line in program.header:
            writer.comment(line)
        writer.block(UNIT_WORD[writer.machine.control.units])
        writer.block("G17", "G90", "G91.1", "G94", "G40", "G49", "G80", "G92.1")
        writer.block(program.wcs)

    def up(self, writer):
        writer.block("G53", "G0", "Z" + writer.length(min(writer.machine.z.max_mm, 0.0)))

    def change_tool(self, writer, operation):
        number = operation.tool.number
        if number > LARGEST_TOOL:
            raise PostError(f"operation {operation.name}: Grbl counts tools up to {LARGEST_TOOL}, T{number} is beyond: renumber it")
        writer.comment(f"PUT T{number} IN BY HAND BEFORE THIS FILE IS RUN")
        writer.block(f"T{number}")

    def optional_stop(self, writer):
        """Every tool has a file of its own."""

    def halt(self, writer, is_optional):
        """It passes over M1: M0 stops in any case."""
        writer.block("M0")

    def run(self, writer, operation):
        super().run(writer, operation)
        if writer.coolant == "M7":
            writer.comment("M7 NEEDS A GRBL WITH ENABLE_M7")

    def length_on(self, writer, tool):
        writer.block("G43.1", "Z" + writer.length(tool.length_mm, LENGTH_DECIMALS[writer.machine.control.units]))
