"""Post for LinuxCNC (RS-274/NGC), three axes and two rotaries; repeated passes as O-word sub-programs.

Facts of the controller that this post respects: units on a line of their own before anything else; every line
below the machine's line length; a path tolerance always with G64 (a bare G64 cuts corners by millimetres); arc
radii compared after rounding, arcs it would refuse cut into chords; sub-programs before their first call; M2 at the
end.  Rotaries are solved in joints, or its kinematics are switched to the tip's (`tip_control`): after a dwell, for joints lag
behind by some servo cycles; nothing but moves of the tip stands under it, and no rapid, whose joints nobody would hold to
their speeds.
"""

from cuspline.posts.writers.joint_words import LEANING_BLEND_SHARE, leans
from cuspline.posts.writers.program_files import Dialect, posted
from cuspline.posts.writers.sub_programs import Variables
from cuspline.posts.writers.words import INCH_MM, UNIT_WORD, in_brackets

EXTENSION = "ngc"
READER = "rs274_reader"
TOOL_TABLE = "tools.tbl"
STATES_TOLERANCE = True     # every program says how far the control may leave the path
TOLERANCE_DECIMALS = 7
BLEND_SHARE = 0.5         # of the path tolerance, for P: blends begin on a servo cycle, and leave the path by up to twice P
SETTLE = "P0.05"          # seconds until the joints stand where the program is
TIP = {"M428": (("M428",), ("M429",)), "M68": (("M68 E3 Q1", "M66 E0 L0"), ("M68 E3 Q0", "M66 E0 L0"))}
comment = in_brackets


def post(program, machine):
    """Write a Program as text.

    Args:
        program: cuspline.program.program.Program.
        machine: cuspline.shop.machines.Machine.
    Returns:
        Posted.
    Raises:
        PostError: a line longer than the control takes, a spindle speed outside the machine's range, a
            feed that rounds to nothing, an operation that does not start and end at the clearance height.
    """
    return posted(program, machine, _LinuxCNC())


def tool_table(tools, control):
    """The table's text, one line a tool, in the control's length unit.

    Args:
        tools: cutters.Tool values.   control: machines.Control.
    """
    scale = 1.0 if control.units == "mm" else 1.0 / INCH_MM
    beside = lambda t: f"X{t.offset_mm[0] * scale:.6f} " if t.offset_mm[0] else ""
    lines = [f"T{t.number} P{t.number} {beside(t)}Z{t.length_mm * scale:.6f} D{t.cutter.diameter_mm * scale:.6f} "
             f";{t.cutter.name}" for t in sorted(tools, key=lambda t: t.number)]
    return "\n".join(lines) + "\n"


class _LinuxCNC(Dialect):
    """O-words; #1 to #30 are a call's own."""

    point, end, knows_rotaries, holds_beside = "", "M2", True, True
    knows_radii = True
    variables = Variables(arguments=tuple(range(1, 31)), locals=tuple(range(1, 31)), deepest_brackets=100)
    tip_controls, tip_rapid, tip_blend_share = tuple(TIP), "G1", LEANING_BLEND_SHARE
    cycle_words = {"drill": "G81", "dwell": "G82", "peck": "G83", "chip_break": "G73", "ream": "G85"}

    def head(self, writer, program, file_number):
        """Comments, then a known state: units, plane, absolute, no compensation, no shift, path tolerance."""
        control = writer.machine.control
        for line in program.header:
            writer.comment(line)
        writer.block(UNIT_WORD[control.units])
        writer.block("G17", "G90", "G91.1", "G94", "G40", "G49", "G80", "G92.1")
        share = LEANING_BLEND_SHARE if any(leans(o.moves) for o in program.operations) else BLEND_SHARE
        writer.block("G64", "P" + writer.length(share * control.path_tolerance_mm, TOLERANCE_DECIMALS), "Q0")
        writer.block(program.wcs)

    def up(self, writer):
        writer.block("G53", "G0", "Z0")

    def compensation(self, writer, number, is_on):
        """The diameter in the tool table's row."""
        return ("G41", f"D{number}") if is_on else ("G40",)

    def tip_on(self, writer, tool):
        self._switch(writer, True)
        return (), ()

    def tip_off(self, writer):
        self._switch(writer, False)

    @staticmethod
    def _switch(writer, is_tip):
        writer.block("G4", SETTLE)
        for block in TIP[writer.machine.control.tip_control][0 if is_tip else 1]:
            writer.block(block)
        writer.forget_position()
        writer.is_tip = is_tip

    def tap(self, writer, cycle, rpm, top_z_mm):
        """G33.1 goes down and back by K a turn; the spindle's sense, M3 or M4, is the thread's."""
        writer.count_rounding((*cycle.xy_mm, cycle.bottom_z_mm))
        pitch = writer.length(abs(cycle.pitch_mm), TOLERANCE_DECIMALS)
        writer.block("G33.1", "Z" + writer.length(cycle.bottom_z_mm), "K" + pitch)

    def sub_program(self, writer, label, comment, blocks):
        writer.comment(comment.upper())
        writer.block(f"o{label} sub")
        for block in blocks:
            writer.block(block)
        writer.block(f"o{label} endsub")

    def call(self, label, numbers):
        return f"o{label} call " + " ".join(f"[{n}]" for n in numbers)
