"""Post for Fanuc milling controls; repeated passes as custom macro B programs called by G65.

Facts of the control that this post respects: the text stands between % lines and begins with its O-number; every
length and feed has a decimal point (without one the control may count thousandths); the tool length offset goes on
together with the first Z, for G43 alone would move the axis; a macro call hands its numbers over by letters, and
macro programs stand behind M30 with M99 at their ends; brackets nest five deep, calls four on the oldest models; the
reference return instead of machine coordinates.  Path tolerance is the control's own (G64 or its smoothing): it is not
in the text, the machine's file states it as path_tolerance_mm and the verdict counts it.  A zero shifted by G52 is
taken back; a G92 is not, for G92.1 is an option that stops a control without it: the header says what to do.  Rotaries are
solved in joints under G93, or go with the tip under G43.4, which begins with its first move and which nothing but moves of
the tip stands under; indexed positions then stand in tilted planes (G68.2), G53.1 finding the rotary axes where they
belong.  G49 (and G69) ends either, and the tool is called anew for what follows.
"""

from cuspline.posts.writers.offset_programs import offset_program
from cuspline.posts.writers.program_files import Dialect, posted
from cuspline.posts.writers.program_numbers import program_number
from cuspline.posts.writers.sub_programs import Variables
from cuspline.posts.writers.words import UNIT_WORD, in_brackets

EXTENSION = "nc"
READER = "fanuc_reader"
TOOL_TABLE = "tools.nc"
comment = in_brackets
# letters of argument list I and the variables they arrive in
LETTERS = {1: "A", 2: "B", 3: "C", 4: "I", 5: "J", 6: "K", 7: "D", 8: "E", 9: "F", 11: "H", 13: "M", 17: "Q", 18: "R",
           19: "S", 20: "T", 21: "U", 22: "V", 23: "W", 24: "X", 25: "Y", 26: "Z"}


def post(program, machine):
    """Write a Program as text.

    Args:
        program: cuspline.program.program.Program.
        machine: cuspline.shop.machines.Machine.
    Returns:
        Posted.
    Raises:
        PostError: a line longer than the control takes, a spindle speed outside the machine's range, a feed that
            rounds to nothing, an operation that does not start and end at the clearance height, more letters or
            deeper brackets than a macro has.
    """
    return posted(program, machine, _Fanuc())


def tool_table(tools, control):
    """A program that writes lengths and radii into the control's offset memory C, each of them with no wear.

    Args:
        tools: cutters.Tool values.   control: machines.Control.
    """
    return offset_program(tools, control, "O0001")


class _Fanuc(Dialect):
    """Macro B."""

    point, end, knows_rotaries, tip_controls = ".", "M30", True, ("G43.4",)
    has_planes = holds_beside = knows_radii = True
    cycle_words = {"drill": "G81", "dwell": "G82", "peck": "G83", "chip_break": "G73", "ream": "G85", "tap": "G84",
                   "tap left": "G74"}
    variables = Variables(arguments=tuple(LETTERS), locals=(*range(27, 34), 10, 12, 14, 15, 16), deepest_brackets=5)

    def head(self, writer, program, file_number):
        """% and O-number, comments, then a known state."""
        writer.block("%")
        writer.block(f"O{program_number(program, file_number):04d}")
        for line in program.header:
            writer.comment(line)
        writer.comment("RAPIDS MUST BE STRAIGHT: PARAMETER 1401 BIT 1 LRP = 1")
        if writer.machine.control.tip_control:
            writer.comment("G43.4 AND G49 MUST SHIFT THE ZERO, NOT MOVE THE AXES")
            writer.comment("UNDER G43.4 X Y Z GO WITH THE TABLE AS IT STANDS WITH THE ROTARY AXES AT 0")
        writer.comment("A G92 OF ANOTHER PROGRAM STAYS IN FORCE: AFTER ONE GO HOME BY HAND")
        writer.block(UNIT_WORD[writer.machine.control.units])
        writer.block("G17", "G90", "G94", "G40", "G49", "G80", "G64")
        writer.block(program.wcs)
        self.shift_zero(writer, 0.0)

    def shift_zero(self, writer, beside_mm):
        """G52 takes the place of the tool offset's X: G43 of this control moves Z alone."""
        writer.block("G52", "X" + writer.length(beside_mm), "Y0.", "Z0.")
        writer.beside_mm = beside_mm

    def up(self, writer):
        writer.block("G91", "G28", "Z0.")
        writer.block("G90")

    def length_on(self, writer, tool):
        """Together with the first Z; the zero goes where a tool beside the spindle's axis has it."""
        if tool.offset_mm[0] != writer.beside_mm:
            self.shift_zero(writer, tool.offset_mm[0])
        writer.pending_z = ("G43",), (f"H{tool.number}",)

    def compensation(self, writer, number, is_on):
        """The radius in the offset memory."""
        return ("G41", f"D{number}") if is_on else ("G40",)

    def dwell(self, seconds):
        """Milliseconds, without a point."""
        return f"P{1000 * seconds:.0f}"

    def before_taps(self, writer, rpm):
        """Rigid: the spindle is tied to the feed."""
        writer.block("M29", f"S{rpm:.0f}")

    def tip_on(self, writer, tool):
        writer.pending_z = (), ()
        writer.forget_position()
        writer.is_tip = True
        return ("G43.4",), (f"H{tool.number}",)

    def plane_on(self, writer, laid, place_mm):
        writer.pending_z = (), ()
        writer.block("G49")             # of an operation before
        angles = (letter + writer.number(v, writer.machine.control.decimals_deg) for letter, v in zip("IJK", laid.plane_deg))
        writer.block("G68.2", *(letter + writer.length(0.0) for letter in "XYZ"), *angles)
        writer.block("G53.1")
        writer.forget_position()
        writer.is_tip = writer.is_tilted = True
        writer.block("G43", "G0", *writer.words(place_mm), f"H{laid.tool.number}")

    def tip_off(self, writer):
        self.end_tip(writer, "G69")

    def foot(self, writer):
        if writer.beside_mm:
            self.shift_zero(writer, 0.0)
        super().foot(writer)
        writer.tail.append("%")

    def sub_program(self, writer, label, comment, blocks):
        before = len(writer.lines)
        writer.block(f"O{label}")
        writer.comment(comment.upper())
        for block in blocks:
            writer.block(block)
        writer.block("M99")
        writer.tail += writer.lines[before:]
        del writer.lines[before:]

    def call(self, label, numbers):
        letters = list(LETTERS.values())
        return f"G65 P{label} " + " ".join(letter + n for letter, n in zip(letters, numbers))
