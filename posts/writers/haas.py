"""Post for Haas mills (Next Generation Control), three axes and two rotaries of the table; repeated passes move by move.

Facts of the control that this post respects (Haas Mill Operator's Manual: program structure, G-codes): the text stands between
% lines and begins with O and five digits; a length, a feed or an angle without a decimal point counts thousandths or less; G43
goes on together with the first Z; G53 stands in its own block and heeds neither work nor tool length offset, G28 would also
switch the length off; G20 and G21 must agree with setting 9.  How far corners may be rounded is G187 E, in force until M30; P3 is
the smoothness of finishing.  M7 is no mist: where that is wanted the operator reads it.  A shift by G52 is taken back; one by G92
is the operator's.  Tools beside the spindle's axis are refused.

Rotaries are solved in joints under G93, or go with the tip under G234 (tool center point control), which begins with its first
move and takes the length by H; G49 ends it.  Indexed positions then have the zero gone with the table (G254, dynamic work
offset): the rotary axes turn before it, X Y and then Z are named behind it, words count along the machine's own axes, and G255
ends it before anything turns again.  Both want rotary values of 0 in the work offset.
"""

import math

import numpy as np

from cuspline.posts.writers.offset_programs import offset_program
from cuspline.posts.writers.program_files import Dialect, posted
from cuspline.posts.writers.program_numbers import program_number
from cuspline.posts.writers.words import UNIT_WORD, in_brackets
from cuspline.values.errors import PostError

EXTENSION = "nc"
READER = "haas_reader"
TOOL_TABLE = "tools.nc"
STATES_TOLERANCE = True     # every program says how far the control may leave the path
comment = in_brackets
COOLANT_WORD = {"off": "M9", "mist": "M9", "flood": "M8"}
STANDS_RAD = 1e-6           # between the tool and Z


def post(program, machine):
    """Write a Program as text.

    Args:
        program: cuspline.program.program.Program.
        machine: cuspline.shop.machines.Machine.
    Returns:
        Posted.
    Raises:
        PostError: a tool beside the spindle's axis, rotaries in the head for indexed positions, a line longer than the control
            takes, a spindle speed outside the machine's range, a feed or a path tolerance that rounds to nothing, an operation
            that does not start and end at the clearance height.
    """
    return posted(program, machine, _Haas())


def tool_table(tools, control):
    """A program that writes lengths and radii into the control's offset memory; setting 40 says that they are radii.

    Args:
        tools: cutters.Tool values.   control: machines.Control.
    """
    return offset_program(tools, control, "O00001", ("SETTING 40 TOOL OFFSET MEASURE: RADIUS",))


class _Haas(Dialect):
    """Its own words for path tolerance and home."""

    point, end, coolants, knows_radii = ".", "M30", COOLANT_WORD, True
    knows_rotaries, tip_controls, has_planes = True, ("G234",), True
    plane_note = "DYNAMIC WORK OFFSET: ANY ZERO AND TOOL LENGTH WITHIN THE TRAVELS"
    cycle_words = {"drill": "G81", "dwell": "G82", "peck": "G83", "chip_break": "G73", "ream": "G85", "tap": "G84",
                   "tap left": "G74"}

    def dwell(self, seconds):
        """Seconds, which the point says; without one they are milliseconds."""
        return f"P{seconds:.3f}"

    def head(self, writer, program, file_number):
        """% and O-number, comments, then a known state."""
        writer.block("%")
        writer.block(f"O{program_number(program, file_number):05d}")
        for line in program.header:
            writer.comment(line)
        if any(o.compensated for o in program.operations):
            writer.comment("CUTTER COMPENSATION: SETTING 40 RADIUS, SETTING 58 FANUC")
        writer.comment("A G92 OF ANOTHER PROGRAM STAYS IN FORCE: AFTER ONE SET IT TO ZERO BY HAND")
        if writer.rotaries:
            writer.comment("ROTARY AXES COUNT ON BEYOND 360 DEGREES")
        if writer.machine.control.tip_control:
            writer.comment("ROTARY VALUES OF THE WORK OFFSET MUST BE 0; UNDER G234 X Y Z GO WITH THE TABLE")
        writer.block(UNIT_WORD[writer.machine.control.units])
        writer.block("G17", "G90", "G94", "G40", "G49", "G80", "G64")
        writer.block("G187", "P3", "E" + _tolerance(writer))
        writer.block(program.wcs)
        writer.block("G52", "X0.", "Y0.", "Z0.")

    def up(self, writer):
        writer.block("G53", "G0", "Z0.")

    def run(self, writer, operation):
        super().run(writer, operation)
        if operation.coolant == "mist" and "mist" not in writer.machine.control.coolants:
            writer.comment("MIST ON BY HAND")

    def compensation(self, writer, number, is_on):
        """The radius in the offset memory, by setting 40; outer corners by setting 58."""
        return ("G41", f"D{number}") if is_on else ("G40",)

    def length_on(self, writer, tool):
        """Together with the first Z."""
        writer.pending_z = ("G43",), (f"H{tool.number}",)

    def tip_on(self, writer, tool):
        writer.pending_z = (), ()
        writer.forget_position()
        writer.is_tip = True
        return ("G234",), (f"H{tool.number}",)

    def plane_frame(self, run, plane_deg):
        """Of the machine's own linear axes, seen from the part that has turned.

        Raises:
            PostError: the tool does not stand along Z.
        """
        frame = run.chain.linear_axes(np.radians(run.degrees[0].round(run.decimals_deg)))
        if math.dist(frame.rotation[:, 2], run.chain.forward(run.joints[:1])[1][0]) > STANDS_RAD:
            raise PostError(f"operation {run.name}: G254 carries the zero with rotary tables, and this machine leans its head: "
                            "choose a machine with tables, or another post")
        return frame

    def plane_on(self, writer, laid, place_mm):
        writer.block("G49")             # of an operation before
        writer.block("G254")
        writer.forget_position()
        writer.is_tip = writer.is_tilted = True
        writer.pending_z = ("G43",), (f"H{laid.tool.number}",)
        self.approach(writer, place_mm)

    def tip_off(self, writer):
        self.end_tip(writer, "G255")

    def foot(self, writer):
        super().foot(writer)
        writer.tail.append("%")


def _tolerance(writer):
    """How far the control may leave the path, rounded to the smaller side."""
    control = writer.machine.control
    step = 10 ** control.decimals
    whole = math.floor(control.path_tolerance_mm * writer.scale * step * (1 + 1e-9))
    if not whole:
        raise PostError(f"a path tolerance of {control.path_tolerance_mm:g} mm is nothing with {control.decimals} decimals: raise "
                        "path_tolerance_mm in the machine's file")
    return writer.number(whole / step, control.decimals)
