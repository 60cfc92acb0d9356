"""Post for cutter location data in APT words, as one CAM system hands them to another's post-processor; tilted axes as they are.

Words (ISO 4343 and what CAM systems publish of their import): UNITS/MM or INCHES; LOADTL/n; CUTTER/ with the seven parameters of
the APT tool; SPINDL/rpm,CLW; COOLNT/; FEDRAT/ with MMPM or IPM; RAPID for the next GOTO alone; MULTAX/ON, behind which GOTO/ has
the tool axis; CIRCLE/ with centre, axis and radius before the GOTO that ends the arc, which runs counter-clockwise about that axis;
RETRCT to the top of the machine; FIXOFF/n the n-th work offset, G54 the first.  A post-processor may make something else of the
last two.  Helices, and arcs of a tool that leans, go out as chords.  Nothing of a machine is in it: no joints, no travels.
"""

import numpy as np

from cuspline.posts.writers.program_files import planes_of
from cuspline.posts.writers.words import Posted, Writer, check_lines
from cuspline.program.arcs import Arc
from cuspline.program.program import UPRIGHT, WORK_OFFSETS, Kind, Plane
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import PostError

EXTENSION = "apt"
READER = "apt_reader"
TOOL_TABLE = None
UNITS = {"mm": ("MM", "MMPM"), "inch": ("INCHES", "IPM")}
AXIS_DECIMALS = 9           # of a tool axis: a nanometre on a tool of a metre
DWELL_DECIMALS = 3          # of seconds
SAME_AXIS = 5e-10           # half of the last of them
DEGREES_A_CHORD = 2.0       # by which the axis may turn within a chord of an arc


def comment(text):
    """A line that is passed over.

    >>> comment("ball  (6 mm)")
    '$$ ball (6 mm)'
    """
    return "$$ " + " ".join(text.encode("ascii", "replace").decode().split())


def post(program, machine):
    """Write a Program as text.

    Args:
        program: cuspline.program.program.Program.
        machine: cuspline.shop.machines.Machine, of which units, decimals and tolerance alone count.
    Returns:
        Posted.
    Raises:
        PostError: what cutter locations do not say: taps, cutter compensation, tools beside the spindle's axis; a work offset
            beyond G59.3, a feed that rounds to nothing.
    """
    writer = _Locations(machine, comment=comment, planes=planes_of(machine.control))
    _head(writer, program)
    for number, operation in enumerate(program.operations, 1):
        _refuse_what_is_not_said(operation)
        _operation(writer, operation, number)
    for words in (("SPINDL", "OFF"), ("COOLNT", "OFF"), ("RETRCT",), ("FINI",)):
        writer.say(*words)
    check_lines(writer.lines, machine)
    return Posted(texts=("\n".join(writer.lines) + "\n",), arcs_as_lines=writer.arcs_as_lines,
                  largest_rounding_mm=writer.largest_rounding_mm)


class _Locations(Writer):
    """GOTO after GOTO, and the axis in force."""

    axis = UPRIGHT

    def say(self, word, *parameters):
        """A statement, continued by $ where the line is full."""
        line, room = word + ("/" if parameters else ""), self.machine.control.line_length - 3
        for k, parameter in enumerate(parameters):
            text = parameter + ("," if k + 1 < len(parameters) else "")
            if len(line) + len(text) > room:
                self.lines.append(line + "$")
                line = "  "
            line += text
        self.lines.append(line)

    def lengths(self, values_mm):
        return [self.length(v) for v in values_mm]

    def go(self, end_mm):
        """To a place, the axis as it is now."""
        self.count_rounding(end_mm)
        self.say("GOTO", *self.lengths(end_mm), *(self.number(v, AXIS_DECIMALS) for v in self.axis))
        self.here_mm = np.asarray(end_mm)

    def feed_words(self, feed_mm_per_min):
        """FEDRAT where the feed changes."""
        text = self.feed_text(feed_mm_per_min)
        if text != self.feed:
            self.feed = text
            self.say("FEDRAT", text, UNITS[self.machine.control.units][1])

    def _straight(self, kind, end_mm, feed):
        if kind == Kind.RAPID:
            self.say("RAPID")
        else:
            self.feed_words(feed)
        self.go(end_mm)

    def _arc(self, kind, end_mm, center_mm, plane, feed):
        """Behind an arc FEDRAT is said again: two GOTOs in a row would let the second be taken for another arc."""
        self.feed_words(feed)
        a, b, third = plane.axes
        center = np.array(self.here_mm, float)
        center[[a, b]] = center_mm[[a, b]]
        axis = np.zeros(3)
        axis[third] = -1.0 if kind == Kind.ARC_CW else 1.0
        radius = self.length(self._radius_mm(center_mm, plane))
        self.say("CIRCLE", *self.lengths(center), *(self.number(v, 0) for v in axis), radius)
        self.go(end_mm)
        self.feed = None

    def leaning_arc(self, arc, end_axis, feed):
        """Chords, the axis turned along."""
        self.arcs_as_lines += 1
        start = np.asarray(self.axis)
        turn_deg = np.degrees(float(fixed.arccos(np.clip((start * end_axis).sum(), -1.0, 1.0))))
        count = max(len(arc.chords(self.machine.control.path_tolerance_mm)), int(turn_deg / DEGREES_A_CHORD) + 1)
        for k in range(1, count + 1):
            share = k / count
            between = (1 - share) * start + share * end_axis
            self.axis = end_axis if k == count else between / np.sqrt((between ** 2).sum())
            self._straight(Kind.FEED, arc.at(share) if k < count else arc.end_mm, feed)


def _head(writer, program):
    """What the data are of, units, zero."""
    if program.wcs not in WORK_OFFSETS:
        raise PostError(f"{program.setup}: {program.wcs} is no work offset of the post apt: choose one of "
                        f"{', '.join(WORK_OFFSETS)}")
    writer.say("PARTNO", program.setup.upper())
    for line in program.header:
        writer.comment(line)
    writer.say("UNITS", UNITS[writer.machine.control.units][0])
    writer.say("FIXOFF", str(WORK_OFFSETS.index(program.wcs) + 1))
    writer.say("MULTAX", "ON")


def _refuse_what_is_not_said(operation):
    head = f"operation {operation.name}: cutter location data have no word for "
    for is_so, what in (
            (any(cycle.pitch_mm for cycle in operation.cycles), "taps: mill the thread (thread_mill)"),
            (bool(operation.compensated), "cutter compensation by a register: leave compensation out of the contour"),
            (any(operation.tool.offset_mm[:2]) or operation.tool.head is not None, "tools on an angle head: choose another post")):
        if is_so:
            raise PostError(head + what)


def _operation(writer, operation, number):
    """Its tool, then move by move."""
    tool, moves = operation.tool, operation.moves
    is_new = tool.number != writer.tool
    if is_new or operation.is_from_top:
        writer.say("RETRCT")
        writer.here_mm = None
    writer.comment(f"OPERATION {number}: {operation.name.upper()}, T{tool.number} {tool.cutter.name}")
    for pause in _begun_with(operation, is_at_top=True):
        _stand(writer, pause)
    if is_new:
        writer.say("LOADTL", str(tool.number))
        _cutter(writer, tool.cutter)
        writer.tool = tool.number
    for pause in _begun_with(operation, is_at_top=False):
        _stand(writer, pause)
    _run(writer, operation)
    _to_start(writer, moves)
    starts, dwells = moves.starts_mm, {cycle.end - 1: cycle.dwell_s for cycle in operation.cycles if cycle.dwell_s}
    for k in range(len(moves)):
        if k in dwells:                 # at the bottom of a hole, before the way up
            writer.say("DELAY", writer.number(dwells[k], DWELL_DECIMALS))
        _pauses(writer, operation, k)
        _move(writer, operation, k, starts[k])
    _pauses(writer, operation, len(moves))


def _sense(operation):
    return "CCLW" if operation.is_backwards else "CLW"


def _run(writer, operation):
    """Spindle and coolant on; the feed is said again behind."""
    writer.say("SPINDL", f"{operation.spindle_rpm:.0f}", _sense(operation))
    if operation.coolant not in ("off", "mist", "flood"):
        raise PostError(f"operation {operation.name}: cutter locations know the coolants off, mist and flood alone, not "
                        f"{operation.coolant}: choose one of these")
    writer.say("COOLNT", operation.coolant.upper())
    writer.feed, writer.rpm = None, operation.spindle_rpm


def _pauses(writer, operation, k):
    """Where the program stands still before move k; a post-processor's stop may have switched off what ran."""
    for pause in operation.pauses:
        if pause.move != k or k == 0 and not pause.is_spindle_on:
            continue
        if pause.is_at_top:
            writer.say("RETRCT")
        _stand(writer, pause)
        if k < len(operation.moves) and not (pause.seconds and pause.is_spindle_on):
            _run(writer, operation)


def _begun_with(operation, is_at_top):
    """Where it stands still before its spindle turns: before its tool comes in, or behind."""
    return [p for p in operation.pauses if p.move == 0 and not p.is_spindle_on and p.is_at_top == is_at_top]


def _stand(writer, pause):
    if not pause.is_spindle_on:
        writer.say("SPINDL", "OFF")
        writer.say("COOLNT", "OFF")
    if pause.seconds:
        writer.say("DELAY", writer.number(pause.seconds, DWELL_DECIMALS))
    else:
        writer.say("OPSTOP" if pause.is_optional else "STOP")


def _cutter(writer, cutter):
    """The seven parameters, of shapes that they say in full."""
    if getattr(cutter, "type", None) in ("ball", "bull_nose", "flat"):
        corner, half = cutter.corner_radius_mm, cutter.diameter_mm / 2
        shape = (2 * half, corner, half - corner, corner)
        writer.say("CUTTER", *writer.lengths(shape), "0", "0", writer.length(cutter.flute_length_mm))


def _to_start(writer, moves):
    """Across at the height of the higher end, then down; from the top of the machine across first, at the start's height."""
    writer.axis = moves.axis[0]
    if writer.here_mm is not None and np.abs(writer.here_mm - moves.start_mm).max() > 0:
        x, y, z = moves.start_mm
        for place in ((*writer.here_mm[:2], max(z, writer.here_mm[2])), (x, y, max(z, writer.here_mm[2]))):
            writer.move(Kind.RAPID, np.array(place), None, Plane.XY, 0.0)
    writer.move(Kind.RAPID, moves.start_mm, None, Plane.XY, 0.0)


def _move(writer, operation, k, start_mm):
    moves = operation.moves
    rpm = operation.rpm_at(k)
    if rpm != writer.rpm:
        writer.say("SPINDL", f"{rpm:.0f}", _sense(operation))
        writer.rpm = rpm
    kind, end, axis, feed = moves.kind[k], moves.end_mm[k], moves.axis[k], moves.feed_mm_per_min[k]
    leans = np.abs(np.array([writer.axis, axis]) - UPRIGHT).max() > SAME_AXIS
    if kind >= Kind.ARC_CW and leans:
        writer.leaning_arc(Arc(start_mm, end, moves.center_mm[k], Plane(moves.plane[k]), kind), axis, feed)
        return
    if kind >= Kind.ARC_CW and abs((end - start_mm)[Plane(moves.plane[k]).axes[2]]) > writer.machine.control.resolution_mm / 2:
        _helix(writer, Arc(start_mm, end, moves.center_mm[k], Plane(moves.plane[k]), kind), feed)
        return
    writer.axis = axis
    writer.move(kind, end, moves.center_mm[k], Plane(moves.plane[k]), feed)


def _helix(writer, arc, feed):
    """Chords: CIRCLE has no rise."""
    writer.arcs_as_lines += 1
    for point in arc.chords(writer.machine.control.path_tolerance_mm):
        writer.move(Kind.FEED, point, None, Plane.XY, feed)
