"""Post for Siemens Sinumerik 840D, three axes and two rotaries; repeated passes move by move.

Facts of the control that this post respects (SINUMERIK 840D sl / 828D Programming Manual, Fundamentals and Job Planning): G710 and
G700 hold for lengths and feeds alike; TRANS alone takes back every programmed frame; SUPA leaves all frames out for its own block
and D0 beside it the tool length; D1 behind the change takes the length of the tool that came in, and moves nothing by itself; I J
K count from where the arc begins, TURN says how many whole turns a helix makes beside its arc; G58 and G59 are no work offsets.
How far blocks may be rounded into each other is CTOL, with G642.  RTLION keeps rapids straight.  Rotaries are solved in joints
under G93, or go with the tip under TRAORI, behind which, and behind TRAFOOF, the work offset is named again; ORIAXES runs the
rotary axes evenly from block to block.  Tools beside the spindle's axis are refused.
"""

from types import SimpleNamespace

from cuspline.posts.writers.program_files import Dialect, posted
from cuspline.posts.writers.words import Writer, behind_semicolon, check_lines

EXTENSION = "mpf"
READER = "siemens_reader"
TOOL_TABLE = "tools.spf"
UNIT_WORD = {"mm": "G710", "inch": "G700"}
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
        PostError: a tool beside the spindle's axis, a work offset that the control has not, a line longer than it
            takes, a spindle speed outside the machine's range, a feed that rounds to nothing, an operation that does not start
            and end at the clearance height, rotaries that cannot follow.
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

    point, end, comment, knows_rotaries, tip_controls = "", "M30", staticmethod(comment), True, ("TRAORI",)
    knows_radii = True
    work_offsets = ("G54", "G55", "G56", "G57")

    def writer(self, machine):
        writer = super().writer(machine)
        writer.radius_name = "CR="
        writer.helix_words, writer.is_length_off = ("TURN=0",), True
        return writer

    def head(self, writer, program, file_number):
        """Comments, then a known state."""
        control = writer.machine.control
        for line in program.header:
            writer.comment(line)
        if writer.rotaries:
            writer.comment("ROTARY AXES COUNT ON BEYOND 360 DEGREES: NO MODULO")
        if control.tip_control:
            writer.comment("UNDER TRAORI X Y Z GO WITH THE TABLE AS IT STANDS WITH THE ROTARY AXES AT 0")
        writer.block(UNIT_WORD[control.units])
        writer.block("G17", "G90", "G94", "G40", "RTLION")
        writer.block("TRANS")
        writer.block("G642", "CTOL=" + writer.length(control.path_tolerance_mm, TOLERANCE_DECIMALS))
        writer.block(program.wcs)
        writer.wcs = program.wcs

    def up(self, writer):
        self.in_machine(writer, "Z0")

    def in_machine(self, writer, *words):
        """Where the spindle nose is meant the tool length goes off with it."""
        is_nose = any(word[0] in "XYZ" for word in words)
        writer.block("SUPA", "G0", *words, *(("D0",) if is_nose else ()))
        writer.is_length_off |= is_nose

    def dwell(self, seconds):
        """Seconds; the feed in force stays."""
        return f"F{seconds:.3f}"

    def length_on(self, writer, tool):
        writer.block("D1")
        writer.is_length_off = False

    def approach(self, writer, start_mm):
        if writer.is_length_off:
            self.length_on(writer, None)
        super().approach(writer, start_mm)

    def compensation(self, writer, number, is_on):
        """Square to the contour's begin and end, by arcs about its corners, F that of the cutter's middle."""
        if is_on:
            writer.block("NORM", "G450", "CFTCP")
        return ("G41",) if is_on else ("G40",)

    def tap(self, writer, cycle, rpm, top_z_mm):
        """What CYCLE84 is made of: the spindle positioned, down by G331, back by G332; K below 0 is left-hand."""
        writer.count_rounding((*cycle.xy_mm, cycle.bottom_z_mm))
        pitch = "K" + writer.length(cycle.pitch_mm, TOLERANCE_DECIMALS)
        writer.block("SPOS=0")
        writer.block("G331", "Z" + writer.length(cycle.bottom_z_mm), pitch, f"S{rpm:.0f}")
        writer.block("G332", "Z" + writer.length(cycle.retract_z_mm), pitch)

    def tip_on(self, writer, tool):
        if writer.is_length_off:
            self.length_on(writer, tool)
        self._switch(writer, True, "TRAORI", writer.wcs, "ORIAXES")
        return (), ()

    def tip_off(self, writer):
        self._switch(writer, False, "TRAFOOF", writer.wcs)

    @staticmethod
    def _switch(writer, is_tip, *blocks):
        for block in blocks:
            writer.block(block)
        writer.forget_position()
        writer.is_tip = is_tip
