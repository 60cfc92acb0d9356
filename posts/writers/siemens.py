"""Post for Siemens Sinumerik 840D, three axes; repeated passes move by move.

Facts of the control that this post respects (SINUMERIK 840D sl / 828D Programming Manual, Fundamentals and Job Planning): G710 and
G700 hold for lengths and feeds alike; TRANS alone takes back every programmed frame; SUPA leaves all frames out for its own block
and D0 beside it the tool length; D1 behind the change takes the length of the tool that came in, and moves nothing by itself; I J
K count from where the arc begins, TURN says how many whole turns a helix makes beside its arc; G58 and G59 are no work offsets.
How far blocks may be rounded into each other is CTOL, with G642.  Rotaries, and tools beside the spindle's axis, are refused.
"""

from types import SimpleNamespace

from cuspline.posts.writers.program_files import Dialect, posted
from cuspline.posts.writers.words import Writer, behind_semicolon, check_lines
from cuspline.values.errors import PostError

EXTENSION = "mpf"
READER = "siemens_reader"
TOOL_TABLE = "tools.spf"
UNIT_WORD = {"mm": "G710", "inch": "G700"}
WORK_OFFSETS = ("G54", "G55", "G56", "G57")
TOLERANCE_DECIMALS = 7
TOOL_TYPES = {"ball": 110, "flat": 120}
BULL_NOSE = 121
comment = behind_semicolon


def post(program, machine):
    """Write a Program as text.

    Args:
        program: cuspline.program.program.Program.
        machine: cuspline.shop.machines.Machine.
    Returns:
        Posted.
    Raises:
        PostError: rotary axes, a tool beside the spindle's axis, a work offset that the control has not, a line longer than it
            takes, a spindle speed outside the machine's range, a feed that rounds to nothing, an operation that does not start
            and end at the clearance height.
    """
    return posted(program, machine, _Siemens())


def tool_table(tools, control):
    """A sub-program that writes lengths and radii into the control's tool data, the first cutting edge of each tool.

    Args:
        tools: cutters.Tool values.   control: machines.Control, whose length unit is the basic system's.
    """
    writer = Writer(SimpleNamespace(control=control), comment=comment)
    writer.comment("TOOL DATA: RUN BEFORE THE PROGRAMS")
    for tool in sorted(tools, key=lambda t: t.number):
        writer.comment(f"T{tool.number} {tool.cutter.name}")
        data = {1: str(TOOL_TYPES.get(tool.cutter.type, BULL_NOSE)), 3: writer.length(tool.length_mm),
                6: writer.length(tool.cutter.diameter_mm / 2), 12: "0", 15: "0"}
        for parameter, value in data.items():
            writer.block(f"$TC_DP{parameter}[{tool.number},1]={value}")
    writer.block("M17")
    check_lines(writer.lines, SimpleNamespace(control=control, name="the control"))
    return "\n".join(writer.lines) + "\n"


class _Siemens(Dialect):
    """G-code as far as it goes, then words of its own."""

    point, end, comment = "", "M30", staticmethod(comment)

    def writer(self, machine):
        writer = super().writer(machine)
        writer.helix_words = ("TURN=0",)
        return writer

    def head(self, writer, program, file_number):
        """Comments, then a known state."""
        if program.wcs not in WORK_OFFSETS:
            raise PostError(f"{program.setup}: {program.wcs} is no work offset of this control: choose one of "
                            f"{', '.join(WORK_OFFSETS)}")
        control = writer.machine.control
        for line in program.header:
            writer.comment(line)
        writer.block(UNIT_WORD[control.units])
        writer.block("G17", "G90", "G94", "G40")
        writer.block("TRANS")
        writer.block("G642", "CTOL=" + writer.length(control.path_tolerance_mm, TOLERANCE_DECIMALS))
        writer.block(program.wcs)

    def up(self, writer):
        writer.block("SUPA", "G0", "Z0", "D0")

    def length_on(self, writer, tool):
        writer.block("D1")
