"""Post for Siemens Sinumerik 840D, three axes and two rotaries; repeated passes move by move.

Facts of the control that this post respects (SINUMERIK 840D sl / 828D Programming Manual, Fundamentals and Job Planning): G710 and
G700 hold for lengths and feeds alike; TRANS alone takes back every programmed frame; SUPA leaves all frames out for its own block
and D0 beside it the tool length; D1 behind the change takes the length of the tool that came in, and moves nothing by itself; I J
K count from where the arc begins, TURN says how many whole turns a helix makes beside its arc; G58 and G59 are no work offsets.
How far blocks may be rounded into each other is CTOL, with G642.  RTLION keeps rapids straight.  Rotaries are solved in joints
under G93, or go with the tip under TRAORI, behind which, and behind TRAFOOF, the work offset is named again; ORIAXES runs the
rotary axes evenly from block to block.  Tools beside the spindle's axis are refused.

Indexed positions go out by CYCLE800 where the machine's file names a swivel data record: no retraction, new frame, axis by axis
about Z, the new X and the new Y (mode 39), the rotary axes named before by SUPA, so that the cycle finds nothing to do; of the two
ways to hold the tool it takes the one with the larger (1) or the smaller angle (-1) of the axis that the record refers to.
CYCLE800() takes the frame back and turns nothing.  Holes are called one by one, RFP a millimetre below where the feed begins.
Feeds may stand as R-parameters at the head.
"""

import math
from types import MappingProxyType, SimpleNamespace

import numpy as np

from cuspline.posts.writers.joint_words import leans
from cuspline.posts.writers.program_files import SET_UP_MM, Dialect, posted
from cuspline.posts.writers.words import Writer, behind_semicolon, check_lines
from cuspline.program.drilling import CLEARANCE_MM, PECKS

EXTENSION = "mpf"
READER = "siemens_reader"
TOOL_TABLE = "tools.spf"
STATES_TOLERANCE = True     # every program says how far the control may leave the path
UNIT_WORD = {"mm": "G710", "inch": "G700"}
TOLERANCE_DECIMALS = 7
ABOUT_Z_X_Y = 39            # of CYCLE800: 2 bits an axis, 3 Z, 1 X, 2 Y
FEED_PARAMETERS = range(10, 100)        # R0 to R99 are there on every control
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


class _Blocks(Writer):
    """Feeds by R-parameters, where the operation has them."""

    parameters = MappingProxyType({})       # text of a feed -> number of its R-parameter

    def feed_words(self, feed_mm_per_min):
        return tuple(f"F=R{self.parameters[word[1:]]}" if word[1:] in self.parameters else word
                     for word in super().feed_words(feed_mm_per_min))


class _Siemens(Dialect):
    """G-code as far as it goes, then words of its own."""

    point, end, comment, knows_rotaries, tip_controls = "", "M30", staticmethod(comment), True, ("TRAORI",)
    knows_radii, knows_swivel, has_drilling = True, True, True
    plane_note = "CYCLE800: ANY ZERO AND TOOL LENGTH WITHIN THE TRAVELS"
    writes = _Blocks
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
        if writer.rotaries and control.swivel_record:
            writer.comment(f"SWIVEL DATA RECORD {control.swivel_record}: ITS DIRECTION REFERS TO {writer.rotaries[-1]}")
        writer.block(UNIT_WORD[control.units])
        writer.block("G17", "G90", "G94", "G40", "RTLION")
        writer.block("TRANS")
        writer.block("G642", "CTOL=" + writer.length(control.path_tolerance_mm, TOLERANCE_DECIMALS))
        writer.block(program.wcs)
        writer.wcs = program.wcs
        self._state_feeds(writer, program)

    def _state_feeds(self, writer, program):
        """Feeds of every operation as R-parameters, as many as there are; of the others they stay numbers."""
        left, self.feeds = list(FEED_PARAMETERS), {}
        for number, operation in enumerate(program.operations if writer.machine.control.feed_parameters else (), 1):
            feeds = operation.moves.feed_mm_per_min
            texts = [writer.feed_text(f) for f in np.unique(feeds[feeds > 0]).tolist()] if not leans(operation.moves) else []
            texts = list(dict.fromkeys(texts))
            if not texts or len(texts) > len(left):
                writer.comment(f"FEEDS OF OPERATION {number} ARE NO R-PARAMETERS: " + (
                    f"{len(texts)} ARE MORE THAN ARE LEFT" if texts else "ITS TOOL LEANS"))
                continue
            self.feeds[operation] = {text: left.pop(0) for text in texts}
            for text, parameter in self.feeds[operation].items():
                writer.block(f"R{parameter}={text}", self.comment(f"F OF OPERATION {number}: {operation.name.upper()}"))

    def tilts(self, control):
        return control.swivel_record is not None

    def run(self, writer, operation):
        writer.parameters = self.feeds.get(operation, {})
        super().run(writer, operation)

    def plane_on(self, writer, laid, place_mm):
        if writer.is_length_off:
            self.length_on(writer, laid.tool)
        about = ",".join(writer.number(v, writer.machine.control.decimals_deg) for v in laid.plane_deg)
        writer.block(f'CYCLE800(0,"{writer.machine.control.swivel_record}",0,{ABOUT_Z_X_Y},0,0,0,{about},0,0,0,{laid.side},0)')
        writer.forget_position()
        writer.is_tip = writer.is_tilted = True
        writer.block("G0", *writer.words(place_mm))

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

    def drill(self, writer, cycle, top_z_mm):
        """CYCLE81, 82, 83 or 85 at the place; strokes of CYCLE83 so that they divide the depth evenly."""
        surface = writer.rounded_mm(cycle.retract_z_mm) - writer.rounded_mm(SET_UP_MM)
        planes = [writer.length(v) for v in (top_z_mm, surface, SET_UP_MM, cycle.bottom_z_mm)]
        feed, = writer.feed_words(cycle.feed_mm_per_min) or (None,)
        if cycle.kind == "ream":
            writer.feed = None              # whether the cycle leaves its own behind the manual does not say
            number = writer.feed_text(cycle.feed_mm_per_min)
            number = f"R{writer.parameters[number]}" if number in writer.parameters else number
            writer.block(self._call("CYCLE85", *planes, "", "", number, number))
            return
        if feed is not None:
            writer.block(feed)
        if cycle.kind in PECKS:
            stroke, is_up = self._stroke(writer, cycle, surface), cycle.kind == "peck"
            off = writer.length(CLEARANCE_MM)
            writer.block(self._call("CYCLE83", *planes, "", "", stroke, "0", "", "", "1", "1" if is_up else "0", "", "",
                                    "" if is_up else off, "", off if is_up else ""))
        elif cycle.dwell_s:
            writer.block(self._call("CYCLE82", *planes, "", f"{cycle.dwell_s:.3f}"))
        else:
            writer.block(self._call("CYCLE81", *planes))

    @staticmethod
    def _call(name, *parameters):
        return f"{name}({','.join(parameters).rstrip(',')})"

    @staticmethod
    def _stroke(writer, cycle, surface):
        """Depth of a stroke, rounded up, so that a whole number of them is the depth or hardly more."""
        depth, step = surface - cycle.bottom_z_mm, writer.machine.control.resolution_mm
        count = math.ceil(depth / cycle.peck_mm - 1e-9)
        return writer.length(math.ceil(depth / count / step - 1e-6) * step)

    def tip_on(self, writer, tool):
        if writer.is_length_off:
            self.length_on(writer, tool)
        self._switch(writer, True, "TRAORI", writer.wcs, "ORIAXES")
        return (), ()

    def tip_off(self, writer):
        self._switch(writer, False, *(("CYCLE800()",) if writer.is_tilted else ("TRAFOOF", writer.wcs)))
        writer.is_tilted = False

    @staticmethod
    def _switch(writer, is_tip, *blocks):
        for block in blocks:
            writer.block(block)
        writer.forget_position()
        writer.is_tip = is_tip
