"""Post for Heidenhain TNC controls in Klartext, three axes and two rotaries; repeated passes move by move.

Facts of the control that this post respects (TNC 640 User's Manual for Klartext Programming): blocks are numbered from 0 and stand
between BEGIN PGM and END PGM of one name and unit; TOOL CALL takes the tool's length with it; FMAX holds for its own block, F until
the next; M91 counts from the machine's datum and heeds neither preset, datum shift nor tool length; a circle runs round the last
CC, in DR's sense; a helix is CP with IPA and IZ, IPA of DR's sign; how far the control may leave the contour is cycle 32.  The
preset is cycle 247's: number 1 stands for G54, 6 for G59.  DR is the mathematical sense in the main planes XY, YZ and ZX, whose
first axes are X, Y and Z (TNC 407 User's Manual 5-19, TNC 426 Pilot, angle reference axis); helices go out along Z alone, others as
chords.  Tools beside the spindle's axis are refused.

A leaning tool goes out under FUNCTION TCPM alone, for the control takes no times of blocks: F TCP is the tip's feed in the part
(of the rotary axes, degrees a minute, where the tip stands), AXIS POS takes rotary words as they are, PATHCTRL AXIS runs the axes
evenly from block to block.  Indexed positions stand in a plane by space angles (PLANE SPATIAL: about Z by SPC, then the new X by
SPA); the rotary axes stand there before, by M91, so that TURN finds nothing to do.  PLANE RESET STAY leaves them.
"""

import math
import re

import numpy as np

from cuspline.posts.writers.program_files import SET_UP_MM, Dialect, posted, spindle_word
from cuspline.posts.writers.words import ARC_RADIUS_MISMATCH_MM, INCH_MM, Writer, behind_semicolon
from cuspline.program.drilling import CLEARANCE_MM, PECKS
from cuspline.program.program import Kind, Plane
from cuspline.values import fixed_math as fixed

EXTENSION = "h"
READER = "klartext_reader"
TOOL_TABLE = "tool.t"
STATES_TOLERANCE = True     # every program says how far the control may leave the path
PRESETS = {"G54": 1, "G55": 2, "G56": 3, "G57": 4, "G58": 5, "G59": 6}
UNIT_WORD = {"mm": "MM", "inch": "INCH"}
ANGLE_DECIMALS = 4
HALF_ANGLE_RAD = math.radians(0.5e-4)     # half a step of the last one
TOLERANCE_DECIMALS = 5
LEAST_SIDE_MM = 1.0         # of BLK FORM, which the control draws and nothing else
TABLE = (("T", 8), ("NAME", 32), ("L", 14), ("R", 14), ("R2", 14), ("DL", 8), ("DR", 8))
comment = behind_semicolon


def post(program, machine):
    """Write a Program as text.

    Args:
        program: cuspline.program.program.Program.
        machine: cuspline.shop.machines.Machine.
    Returns:
        Posted.
    Raises:
        PostError: a leaning tool without tip control, a tool beside the spindle's axis, a work offset beyond G59, a line longer
            than the control takes, a spindle speed outside the machine's range, a feed that rounds to nothing, an operation that
            does not start and end at the clearance height.
    """
    return posted(program, machine, _Heidenhain())


def tool_table(tools, control):
    """TOOL.T: lengths, radii and corner radii, no wear, columns as its second line says.

    Args:
        tools: cutters.Tool values.   control: machines.Control.
    """
    scale = 1.0 if control.units == "mm" else 1.0 / INCH_MM
    row = lambda values: "".join(str(v).ljust(width) for v, (_, width) in zip(values, TABLE)).rstrip()
    length = lambda mm: f"{mm * scale:+.{control.decimals}f}"
    name = lambda text: re.sub(r"[^A-Z0-9.]+", "_", text.upper())[:30]
    lines = [f"BEGIN TOOL.T {UNIT_WORD[control.units]}", row([column for column, _ in TABLE])]
    for tool in sorted(tools, key=lambda t: t.number):
        cutter = tool.cutter
        lines.append(row([tool.number, name(cutter.name), length(tool.length_mm), length(cutter.diameter_mm / 2),
                          length(cutter.corner_radius_mm), "+0", "+0"]))
    return "\n".join([*lines, "[END]"]) + "\n"


class _Blocks(Writer):
    """Moves as Klartext blocks."""

    number_bytes = 8
    name, rpm, pole = "", None, None        # of the program; the spindle's; CC as last written
    cycle = None                            # (number, rows) of the drilling cycle that is defined

    def number(self, value, decimals):
        """A number with its sign.

        >>> from types import SimpleNamespace
        >>> control = SimpleNamespace(units="mm", decimals=3, arc_centres="IJK")
        >>> _Blocks(SimpleNamespace(control=control)).number(-1e-9, 3)
        '+0'
        """
        text = super().number(value, decimals)
        return text if text.startswith("-") else "+" + text

    def forget_position(self):
        super().forget_position()
        self.pole = None

    def to_plane(self, plane):
        """It is that of the axes of a circle's CC."""

    def _straight(self, kind, end_mm, feed):
        words = self.words(end_mm)
        if words:
            radius, self.radius_words = self.radius_words, ()
            self.block("L", *words, *radius, *(("FMAX",) if kind == Kind.RAPID else self.feed_words(feed)))
        self.here_mm = end_mm

    def tip_feed(self, way_mm, seconds):
        return super().tip_feed(way_mm, seconds).lstrip("+")

    def fine_feed(self, a_minute):
        return super().fine_feed(a_minute).lstrip("+")

    def _jointly(self, motion, first, words, more):
        rapid = ("FMAX",) if motion == "G0" else ()
        self.block("L", *words, *(("R0",) if rapid else ()), *more, *rapid)

    def _arc_words(self, end_mm, center_mm, plane):
        """As for every control, the centre rounded where it is."""
        a, b, _ = plane.axes
        start, end, _ = super()._arc_words(end_mm, center_mm, plane)
        return start, end, [self.rounded_mm(center_mm[k]) - s for k, s in zip((a, b), start)]

    def _arc_is_accepted(self, end_mm, center_mm, plane):
        """A helix runs along Z, and ends where its angle leads, which is rounded too."""
        if not super()._arc_is_accepted(end_mm, center_mm, plane):
            return False
        radius_mm = math.dist(self.here_mm[:2], center_mm[:2])
        return not self._rises(end_mm, plane) or (
            plane == Plane.XY and radius_mm * HALF_ANGLE_RAD < ARC_RADIUS_MISMATCH_MM)

    def _rises(self, end_mm, plane):
        third = plane.axes[2]
        return self.length(end_mm[third]) != self.length(self.here_mm[third])

    def _arc(self, kind, end_mm, center_mm, plane, feed):
        a, b, third = plane.axes
        pole = ["XYZ"[k] + self.length(center_mm[k]) for k in sorted((a, b))]
        if pole != self.pole:
            self.block("CC", *pole)
            self.pole = pole
        sense = "DR-" if kind == Kind.ARC_CW else "DR+"
        for k in (a, b):
            self.axis_words[k] = None
        if self._rises(end_mm, plane):
            self.block("CP", *self._helix(kind, end_mm, center_mm, plane), sense, *self.feed_words(feed))
            self.axis_words[third] = None
        else:
            self.block("C", *self.words(end_mm, sorted((a, b))), sense, *self.feed_words(feed))
        self.here_mm = end_mm

    def _helix(self, kind, end_mm, center_mm, plane):
        """Its whole angle and rise from where it begins, both as the control reads them."""
        third = plane.axes[2]
        (x, y), end, (i, j) = self._arc_words(end_mm, center_mm, plane)
        sweep = float(fixed.arctan2(end[1] - y - j, end[0] - x - i) - fixed.arctan2(-j, -i))
        side = -1.0 if kind == Kind.ARC_CW else 1.0
        degrees = side * math.degrees(side * sweep % (2 * math.pi))
        rise = self.rounded_mm(end_mm[third]) - self.rounded_mm(self.here_mm[third])
        return "IPA" + self.number(degrees, ANGLE_DECIMALS), "I" + "XYZ"[third] + self.length(rise)


class _Heidenhain(Dialect):
    """Klartext."""

    point, end, comment, writes, work_offsets = "", "M30", staticmethod(comment), _Blocks, tuple(PRESETS)
    knows_rotaries, tip_controls, has_planes, states_times = True, ("TCPM",), True, False
    has_drilling = True

    def head(self, writer, program, file_number):
        """Name and unit, comments, the blank for the control's picture, then a known state."""
        control = writer.machine.control
        writer.name = f"{re.sub(r'[^A-Z0-9]+', '_', program.setup.upper())} {UNIT_WORD[control.units]}"
        writer.block("BEGIN PGM", writer.name)
        for line in program.header:
            writer.comment(line)
        if writer.rotaries:
            writer.comment("ROTARY AXES COUNT ON BEYOND 360 DEGREES: NO MODULO, OR M126 WOULD TURN THEM THE SHORT WAY")
        if control.tip_control:
            writer.comment("UNDER TCPM X Y Z GO WITH THE TABLE AS IT STANDS WITH THE ROTARY AXES AT 0")
        low, high = _drawn_mm(program)
        writer.block("BLK FORM 0.1 Z", *(axis + writer.length(v) for axis, v in zip("XYZ", low)))
        writer.block("BLK FORM 0.2", *(axis + writer.length(v) for axis, v in zip("XYZ", high)))
        writer.block("CYCL DEF 247 DATUM SETTING ~")
        writer.block(f"  Q339=+{PRESETS[program.wcs]} ;DATUM NUMBER")
        writer.block("CYCL DEF 7.0 DATUM SHIFT")
        for k, axis in enumerate("XYZ", 1):
            writer.block(f"CYCL DEF 7.{k} {axis}+0")
        writer.block("CYCL DEF 32.0 TOLERANCE")
        writer.block("CYCL DEF 32.1 T" + writer.length(control.path_tolerance_mm, TOLERANCE_DECIMALS).lstrip("+"))

    def up(self, writer):
        writer.block("L", "Z+0", "R0", "FMAX", "M91")

    def in_machine(self, writer, *words):
        writer.block("L", *words, "R0", "FMAX", "M91")

    def tip_on(self, writer, tool):
        writer.block("FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS")
        writer.forget_position()
        writer.is_tip = True
        return (), ()

    def plane_on(self, writer, laid, place_mm):
        spc, spa, _ = (writer.number(v, writer.machine.control.decimals_deg) for v in laid.plane_deg)
        writer.block(f"PLANE SPATIAL SPA{spa} SPB+0 SPC{spc} TURN FMAX")
        writer.forget_position()
        writer.is_tip = writer.is_tilted = True
        writer.block("L", *writer.words(place_mm), "R0", "FMAX")

    def tip_off(self, writer):
        writer.block("PLANE RESET STAY" if writer.is_tilted else "FUNCTION RESET TCPM")
        writer.forget_position()
        writer.is_tip = writer.is_tilted = False

    def change_tool(self, writer, operation):
        writer.rpm = f"S{operation.spindle_rpm:.0f}"
        writer.block("TOOL CALL", str(operation.tool.number), "Z", writer.rpm)

    def length_on(self, writer, tool):
        """It came with the call."""

    def wait(self, writer, seconds):
        """Cycle 9 waits as soon as it is defined."""
        writer.block("CYCL DEF 9.0 DWELL TIME")
        writer.block(f"CYCL DEF 9.1 DWELL {seconds:.3f}")

    def run(self, writer, operation):
        rpm = f"S{operation.spindle_rpm:.0f}"
        if rpm != writer.rpm:
            writer.block("TOOL CALL", "Z", rpm)
            writer.rpm = rpm
        writer.block(spindle_word(operation))
        self.cool(writer, operation)
        writer.feed = writer.cycle = None

    def turn_at(self, writer, rpm):
        word = f"S{rpm:.0f}"
        if word != writer.rpm:
            writer.block("TOOL CALL", "Z", word)
            writer.rpm = word

    def tap(self, writer, cycle, rpm, top_z_mm):
        """Cycle 207, its surface SET_UP_MM below where it begins to feed; a pitch below 0 is left-hand."""
        writer.count_rounding((*cycle.xy_mm, cycle.bottom_z_mm))
        surface = cycle.retract_z_mm - SET_UP_MM
        rows = (("Q200", SET_UP_MM, "SET-UP CLEARANCE"), ("Q201", cycle.bottom_z_mm - surface, "DEPTH OF THREAD"),
                ("Q239", cycle.pitch_mm, "THREAD PITCH"), ("Q203", surface, "SURFACE COORDINATE"),
                ("Q204", top_z_mm - surface, "2ND SET-UP CLEARANCE"))
        writer.block("CYCL DEF 207 RIGID TAPPING ~")
        for k, (name, value, what) in enumerate(rows, 1):
            writer.block(f"  {name}={writer.length(value, TOLERANCE_DECIMALS)} ;{what}" + ("" if k == len(rows) else " ~"))
        writer.block("CYCL CALL")
        writer.cycle = None
        writer.words((*cycle.xy_mm, top_z_mm), (2,))

    def drill(self, writer, cycle, top_z_mm):
        """Cycle 200, 201 or 203, defined where it is not that of the hole before, and its call where the tool stands."""
        number, name, rows = _cycle_rows(writer, cycle, top_z_mm)
        if (number, rows) != writer.cycle:
            writer.block(f"CYCL DEF {number} {name} ~")
            for k, (q, text, what) in enumerate(rows, 1):
                writer.block(f"  {q}={text} ;{what}" + ("" if k == len(rows) else " ~"))
            writer.cycle = number, rows
        writer.block("CYCL CALL")
        writer.feed = None

    def compensation(self, writer, number, is_on):
        """The radius is the called tool's."""
        return ("RL",) if is_on else ("R0",)

    def approach(self, writer, start_mm):
        writer.block("L", *writer.words(start_mm, (0, 1)), "R0", "FMAX")
        writer.block("L", *writer.words(start_mm, (2,)), "R0", "FMAX")

    def foot(self, writer):
        super().foot(writer)
        writer.tail.append(f"END PGM {writer.name}")

    def numbered(self, lines, control):
        """Block numbers from 0; what goes on behind ~ has none."""
        out, number = [], 0
        for before, line in zip(["", *lines], lines):
            if before.endswith("~"):
                out.append(line)
                continue
            out.append(f"{number} {line}")
            number += 1
        return out


def _cycle_rows(writer, cycle, top_z_mm):
    """(number, name, [(parameter, text, what it is)]) of the cycle that makes a hole."""
    surface = cycle.retract_z_mm - SET_UP_MM
    whole = surface - cycle.bottom_z_mm
    length = lambda mm: writer.length(mm, max(TOLERANCE_DECIMALS, writer.machine.control.decimals))
    head = [("Q200", length(SET_UP_MM), "SET-UP CLEARANCE"), ("Q201", length(-whole), "DEPTH"),
            ("Q206", writer.feed_text(cycle.feed_mm_per_min), "FEED RATE FOR PLUNGING")]
    seconds, planes = ("Q211", f"{cycle.dwell_s:.3f}", "DWELL TIME AT DEPTH"), [
        ("Q203", length(surface), "SURFACE COORDINATE"), ("Q204", length(top_z_mm - surface), "2ND SET-UP CLEARANCE")]
    if cycle.kind == "ream":
        return "201", "REAMING", [*head, seconds, ("Q208", "0", "RETRACTION FEED RATE"), *planes]
    stroke = ("Q202", length(cycle.peck_mm if cycle.kind in PECKS else whole), "PLUNGING DEPTH")
    head, tip = [*head, stroke, ("Q210", "0", "DWELL TIME AT TOP"), *planes], ("Q395", "0", "DEPTH REFERENCE")
    if cycle.kind != "chip_break":
        return "200", "DRILLING", [*head, seconds, tip]
    breaks = math.ceil(whole / cycle.peck_mm)
    return "203", "UNIVERSAL DRILLING", [
        *head, ("Q212", "0", "DECREMENT"), ("Q213", str(breaks), "NR OF BREAKS"), ("Q205", "0", "MIN. PLUNGING DEPTH"), seconds,
        ("Q208", "99999", "RETRACTION FEED RATE"), ("Q256", length(CLEARANCE_MM), "DIST. FOR CHIP BRKNG"), tip]


def _drawn_mm(program):
    """Corners of the blank that the control draws: as far as the program cuts."""
    ends = np.vstack([o.moves.end_mm[o.moves.kind != Kind.RAPID] for o in program.operations])
    low, high = ends.min(axis=0), ends.max(axis=0)
    return low, np.maximum(high, low + LEAST_SIDE_MM)
