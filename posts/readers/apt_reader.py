"""Reads cutter location data in APT words back into moves: tips and axes in the part, whatever machine will make them.

It knows nothing of any post.  What it does not know it refuses, with the line and the remedy, rather than pass over it as
post-processors do.  GOTO without an axis keeps the one in force; RAPID holds for the next GOTO alone; CIRCLE makes an arc of the
next GOTO, counter-clockwise about its axis, which is along X, Y or Z.  RETRCT and LOADTL take the tool to the top of the machine,
as common post-processors do.  FIXOFF says which work offset; data of other systems do not, then it is taken for G54.
"""

import re
from array import array
from math import hypot, isfinite, nan, sqrt
from typing import NamedTuple

import numpy as np

from cuspline.posts.readers.rs274_arcs import CLOSE_BOUNDS, MM_PER_INCH, check_radii, is_same_point
from cuspline.posts.readers.rs274_blocks import Block, lines_cut, refusal
from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.program.posted import PostedMoves, Remark, Stop
from cuspline.program.program import UPRIGHT, Kind, Plane
from cuspline.values.coolants import FLOOD, MIST

LONGEST_LINE = 255
OPERATION = re.compile(r"\$\$\s*OPERATION\b[^:]*:([^,]*)", re.IGNORECASE)
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d+)?")
UNKNOWN = (nan, nan, nan)
LONGER = 1e-4               # by which an axis may differ from a length of 1: rounded to four decimals
SAME_AXIS = 1e-9
OFFSETS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
UNITS = {"MM": 1.0, "MMS": 1.0, "INCH": MM_PER_INCH, "INCHES": MM_PER_INCH}
FEEDS = {"MMPM": 1.0, "IPM": MM_PER_INCH}
COOLANTS = {"OFF": 0, "MIST": MIST, "FLOOD": FLOOD, "ON": FLOOD}
PLANES = {2: Plane.XY, 1: Plane.ZX, 0: Plane.YZ}        # by the axis that they are seen from
PASSED_OVER = ("PARTNO", "PPRINT", "REMARK", "MACHIN", "CUTTER", "DISPLY", "TPRINT")
COLUMNS = 22                # numbers kept of a move


class _Statement(NamedTuple):
    """A major word with what stands behind its slash."""

    word: str
    parameters: tuple[str, ...]


def read_program(text, *, work_offsets, tool_lengths):
    """The moves of cutter location data.

    Args:
        text: the whole file, to FINI or END.
        work_offsets: {"G54": (x, y, z)} machine coordinates of each zero, mm.
        tool_lengths: {number: length, or offsets (x, y, z), mm}; a tool that is not listed is refused.
    Returns:
        PostedMoves; straight moves of the tip, the axis turning evenly along.
    Raises:
        ReadError: something that is not known or not sure; `.rows` holds the line.

    >>> text = "UNITS/MM\\nRAPID\\nGOTO/1,2,3\\nFEDRAT/100,MMPM\\nGOTO/9,2,3,0,0.6,0.8\\nFINI"
    >>> moves = read_program(text, work_offsets={}, tool_lengths={})
    >>> moves.end_mm[-1].tolist(), moves.end_axis[-1].tolist(), moves.line.tolist()
    ([9.0, 2.0, 3.0], [0.0, 0.6, 0.8], [3, 5])
    """
    blocks, job = lines_cut(text, Block, LONGEST_LINE), _Job(work_offsets, tool_lengths)
    for block, statement in _statements(blocks):
        try:
            job.take(block, statement)
        except Complaint as complaint:
            raise refusal(complaint, block) from None
    if not job.ended:
        raise refusal(Complaint("the data stop without an end", "end them with FINI"), blocks[-1])
    return job.posted_moves()


def _statements(blocks):
    """Yield (its first block, _Statement, or the comment's text); $ at the end of a line goes on in the next."""
    begun, said = None, ""
    for block in blocks:
        line = block.text.strip()
        if line.startswith("$$"):
            if begun is not None:
                raise refusal(Complaint("a comment within a statement that goes on", "write it before or behind"), block)
            yield block, line
            continue
        begun, said = begun or block, said + line.split("$$")[0].strip()
        if said.endswith("$"):
            said = said[:-1]
            continue
        if said:
            word, slash, rest = said.partition("/")
            parameters = tuple(p.strip().upper() for p in rest.split(",")) if slash else ()
            yield begun, _Statement("".join(word.split()).upper(), parameters)
        begun, said = None, ""
    if begun is not None:
        raise refusal(Complaint("a statement that goes on behind the last line", "write its rest, or take the $ away"), begun)


class _Job:
    """What is in force, statement after statement, and the moves made so far."""

    def __init__(self, work_offsets, tool_lengths):
        self.work_offsets = work_offsets
        self.lengths = {n: float(np.ravel(v)[-1]) for n, v in tool_lengths.items()}       # along the spindle
        self.tip, self.axis = UNKNOWN, UPRIGHT
        self.unit_mm = None
        self.wcs, self.is_wcs_said, self.is_wcs_remarked = "G54", False, False
        self.is_axis_held = False           # MULTAX/OFF
        self.feed, self.is_rapid, self.circle = 0.0, False, None
        self.is_up = False                  # at the top of the machine
        self.was_arc = False                # nothing but GOTOs since an arc
        self.speed, self.speed_line, self.tool, self.coolant = 0.0, 0, 0, 0
        self.names, self.operation = [], -1
        self.line, self.ended = 0, False
        self.rows, self.axes, self.stops, self.remarks = array("d"), array("d"), [], []
        self.used = {}

    def take(self, block, statement):
        """Do what a statement says.

        Raises:
            Complaint: it is not known, or not sure.
        """
        self.line = block.number
        if isinstance(statement, str):
            self._note_operation(statement)
            return
        word, parameters = statement
        if self.ended:
            raise Complaint(f"{word} behind the end", "take it out, or put FINI at the end")
        if word.startswith(PASSED_OVER[:3]) or word in PASSED_OVER:
            return
        if word not in WORDS:
            raise Complaint(f"unknown word {word}", f"known are {', '.join(sorted((*WORDS, *PASSED_OVER)))}")
        if self.circle is not None and word != "GOTO":
            raise Complaint(f"{word} between CIRCLE and the GOTO that ends the arc", "write it before CIRCLE")
        self.was_arc = self.was_arc and word == "GOTO"
        WORDS[word](self, parameters)

    def _note_operation(self, comment):
        if named := OPERATION.match(comment):
            name = named[1].strip().lower()
            self.names += [name] if name not in self.names else []
            self.operation = self.names.index(name)

    # modes ------------------------------------------------------------------------------------------

    def set_units(self, parameters):
        self.unit_mm = UNITS[_one(parameters, UNITS, "UNITS")]

    def set_offset(self, parameters):
        self.wcs, self.is_wcs_said, self.tip = OFFSETS[_whole(parameters, "FIXOFF", len(OFFSETS)) - 1], True, UNKNOWN

    def set_axes(self, parameters):
        self.is_axis_held = bool(parameters) and _one(parameters, ("ON", "OFF"), "MULTAX") == "OFF"

    def set_feed(self, parameters):
        """FEDRAT/f, unit in either order; a feed takes a RAPID back."""
        units = [p for p in parameters if p in (*FEEDS, "PERMIN")]
        numbers = _numbers([p for p in parameters if p not in units], "FEDRAT")
        if len(numbers) != 1 or len(units) > 1 or not numbers[0] > 0:
            raise Complaint("FEDRAT without one feed above 0 by the minute", "write FEDRAT/300,MMPM or FEDRAT/12,IPM")
        self.feed = numbers[0] * (FEEDS.get(units[0]) if units and units[0] in FEEDS else self._unit())
        self.is_rapid = False

    def set_rapid(self, parameters):
        if parameters:
            raise Complaint("RAPID with parameters", "write RAPID alone, for the next GOTO")
        self.is_rapid = True

    def set_speed(self, parameters):
        """SPINDL/rpm, RPM, CLW in any order; or OFF."""
        words = [p for p in parameters if not NUMBER.fullmatch(p)]
        numbers = _numbers([p for p in parameters if p not in words], "SPINDL")
        if parameters == ("OFF",):
            self.speed = 0.0
            self._stand_still("M5")
            return
        if len(numbers) != 1 or not numbers[0] > 0 or not set(words) <= {"RPM", "CLW", "CCLW"} or {"CLW", "CCLW"} <= set(words):
            raise Complaint(f"SPINDL/{','.join(parameters)}", "write SPINDL/8000,CLW or SPINDL/OFF: turns a minute, one sense")
        before, self.speed = self.speed, -numbers[0] if "CCLW" in words else numbers[0]
        self.speed_line = self.line
        if before * self.speed <= 0:
            self._stand_still("M4" if self.speed < 0 else "M3")

    def set_coolant(self, parameters):
        self.coolant = COOLANTS[_one(parameters, COOLANTS, "COOLNT")]

    def load_tool(self, parameters):
        """The tool comes in at the top of the machine, the spindle stands; what else is said of it does not move anything."""
        number = _whole(parameters[:1], "LOADTL", 99999999)
        if number not in self.lengths:
            raise Complaint(f"tool {number} is not in the tool table",
                            f"it lists {', '.join(str(n) for n in sorted(self.lengths)) or 'no tools'}")
        if not self.is_up:
            self.retract(())
        self.tool, self.speed = number, 0.0
        self.tip, self.axis = UNKNOWN, UPRIGHT
        self._stand_still("M6")

    def name_tool(self, parameters):
        """TOOLNO before LOADTL describes what is loaded; alone nobody knows whether it loads."""
        _whole(parameters[:1], "TOOLNO", 99999999)

    def stop(self, parameters):
        self._stand_still("M0")

    def optional_stop(self, parameters):
        self._stand_still("M1")

    def wait(self, parameters):
        """DELAY: seconds."""
        if len(parameters) != 1 or not _numbers(parameters, "DELAY")[0] > 0:
            raise Complaint("DELAY without its seconds", "write DELAY/ and a number above 0")
        self._stand_still("G4", _numbers(parameters, "DELAY")[0])

    def end(self, parameters):
        self.ended = True
        self._stand_still("M30")

    def _stand_still(self, word, seconds=0.0):
        self.stops.append(Stop(row=len(self.rows) // COLUMNS, line=self.line, word=word, seconds=seconds))

    # moves ------------------------------------------------------------------------------------------

    def begin(self, parameters):
        """FROM: where the tool stands."""
        self.tip, self.axis = self._place(parameters, "FROM")

    def go_by(self, parameters):
        """GODLTA: by three lengths."""
        by = _numbers(parameters, "GODLTA")
        if len(by) != 3 or not isfinite(sum(self.tip)):
            raise Complaint("GODLTA without its three lengths, or from a place nobody knows", "write GOTO/ with the place")
        self._go(tuple(t + v * self._unit() for t, v in zip(self.tip, by)), self.axis)

    def go(self, parameters):
        self._go(*self._place(parameters, "GOTO"))

    def _go(self, end, axis):
        kind = Kind.RAPID if self.is_rapid else Kind.FEED
        start, center, plane, was_arc = self.tip, UNKNOWN, Plane.XY, self.was_arc
        if kind != Kind.RAPID:
            self._refuse_unready(start)
        if self.circle is not None:
            kind, end, center, plane = self._arc(start, end, axis)
        elif was_arc:
            raise Complaint("a GOTO right behind an arc: some systems go on along the arc, others straight",
                            "write FEDRAT or RAPID before it where it is straight, CIRCLE where it is an arc")
        self._add(kind, end, center, plane, axis)
        self.was_arc, self.circle, self.is_rapid = kind > Kind.FEED, None, False

    def _refuse_unready(self, start):
        if not isfinite(sum(start)):
            raise Complaint("a cutting move while nobody knows where the tool stands", "go to a place by RAPID and GOTO before")
        if not self.feed > 0:
            raise Complaint("a cutting move, but no feed is set", "write FEDRAT")

    def _place(self, parameters, word):
        """(place, axis) of three or six numbers."""
        numbers = _numbers(parameters, word)
        if len(numbers) not in (3, 6):
            raise Complaint(f"{word} with {len(numbers)} numbers", "write a place, or a place and the tool's axis")
        place, axis = tuple(v * self._unit() for v in numbers[:3]), self.axis
        if len(numbers) == 6:
            axis = _unit_axis(numbers[3:])
            if self.is_axis_held and max(abs(a - b) for a, b in zip(axis, self.axis)) > LONGER:
                raise Complaint("another tool axis under MULTAX/OFF", "write MULTAX/ON before")
        return place, axis

    def begin_circle(self, parameters):
        """Centre, axis and radius of the arc that the next GOTO ends; what NX writes behind the radius says nothing more."""
        numbers = _numbers(parameters, "CIRCLE")
        if len(numbers) < 7:
            raise Complaint(f"CIRCLE with {len(numbers)} numbers", "write centre, axis and radius")
        if self.is_rapid:
            raise Complaint("RAPID before an arc", "write FEDRAT")
        axis = _unit_axis(numbers[3:6])
        third = max(range(3), key=lambda k: abs(axis[k]))
        if abs(axis[third]) < 1 - SAME_AXIS:
            raise Complaint("an arc in a plane that leans", "write chords: arcs run about X, Y or Z")
        self.circle = tuple(v * self._unit() for v in numbers[:3]), PLANES[third], axis[third] > 0, numbers[6] * self._unit()

    def _arc(self, start, end, axis):
        """(kind, end, centre, plane): it ends in its plane, both radii as said; an end that rounds away from the start is on it."""
        center, plane, is_left, radius = self.circle
        a, b, third = plane.axes
        if self.axis != UPRIGHT or axis != UPRIGHT:
            raise Complaint("an arc of a tool that leans", "write chords")
        if max(abs(end[third] - start[third]), abs(center[third] - start[third])) > CLOSE_BOUNDS.radius_error_mm:
            raise Complaint("an arc that rises out of its plane", "write chords: CIRCLE has no rise")
        flat = [(p[a], p[b]) for p in (start, end, center)]
        check_radii(*flat, CLOSE_BOUNDS)
        there = hypot(flat[0][0] - flat[2][0], flat[0][1] - flat[2][1])
        if abs(there - radius) > CLOSE_BOUNDS.radius_error_mm:
            raise Complaint(f"CIRCLE states a radius of {radius:g} mm, its start is {there:g} mm from the centre",
                            "correct one of them")
        end = list(end)
        if is_same_point(flat[0], flat[1]):
            end[a], end[b] = flat[0]
        return (Kind.ARC_CCW if is_left else Kind.ARC_CW), tuple(end), center, plane

    def retract(self, parameters):
        """Straight up to the top of the machine."""
        if parameters:
            raise Complaint("RETRCT with parameters", "write RETRCT alone: up to the top of the machine")
        end = (*self.tip[:2], -self._shift()[2]) if self.axis == UPRIGHT else UNKNOWN
        self._add(Kind.RAPID, end, UNKNOWN, Plane.XY, self.axis, top_mm=0.0)
        self.is_up = True

    def _shift(self):
        """Machine coordinates less the part's, of an upright tool."""
        x, y, z = self.work_offsets.get(self.wcs, UNKNOWN)
        return x, y, z + (self.lengths[self.tool] if self.tool else 0.0)

    def _add(self, kind, end, center, plane, axis, top_mm=nan):
        """`top_mm`: machine height, where it is known without the tip's."""
        if kind != Kind.RAPID:
            self._remark_zero()
        if top_mm != top_mm:
            self.used[self.wcs] = True
        machine = [e + s for e, s in zip(end, self._shift())] if axis == UPRIGHT else UNKNOWN
        machine = machine if top_mm != top_mm else (*machine[:2], top_mm)
        self.rows.extend((kind, *self.tip, *end, *center, plane, self.feed if kind != Kind.RAPID else 0.0, self.speed, self.tool,
                          self.tool > 0, *machine, self.line, self.operation, self.speed_line, self.coolant))
        self.axes.extend((*self.axis, *axis))
        self.tip, self.axis, self.is_up = end, axis, False

    def _remark_zero(self):
        """Once: nobody has said it, or it is not the setup's."""
        if not self.is_wcs_said:
            self._remark("unknown_start", "FIXOFF is missing: the zero is taken for G54; write FIXOFF/1")
        if self.work_offsets and self.wcs not in self.work_offsets and not self.is_wcs_remarked:
            self._remark("wrong_work_offset", f"{self.wcs} is in force, the setup's zero is {' '.join(self.work_offsets)}: "
                                              "write that")
            self.is_wcs_remarked = True
        self.is_wcs_said = True

    def _remark(self, kind, advice):
        self.remarks.append(Remark(kind=kind, amount_mm=0.0, row=len(self.rows) // COLUMNS, advice=advice))

    def _unit(self):
        if self.unit_mm is None:
            raise Complaint("a length before UNITS was said", "write UNITS/MM or UNITS/INCHES above")
        return self.unit_mm

    def posted_moves(self):
        """All moves as one value."""
        table, axes = np.frombuffer(self.rows).reshape(-1, COLUMNS), np.frombuffer(self.axes).reshape(-1, 6)
        (kind, start, end, center, plane, feed, speed, tool, is_length_on, machine, line, operation, speed_line,
         coolant) = np.split(table, (1, 4, 7, 10, 11, 12, 13, 14, 15, 18, 19, 20, 21), axis=1)
        return PostedMoves(
            kind=kind[:, 0], start_mm=start, end_mm=end, center_mm=center, plane=plane[:, 0], turns=np.zeros(len(table)),
            feed_mm_per_min=feed[:, 0], spindle_rpm=speed[:, 0], tool=tool[:, 0], length_offset_on=is_length_on[:, 0],
            machine_end_mm=machine, line=line[:, 0], operation=operation[:, 0], operations=tuple(self.names), ended=self.ended,
            start_axis=axes[:, :3], end_axis=axes[:, 3:], path_tolerance_mm=np.full(len(table), nan), speed_line=speed_line[:, 0],
            coolant=coolant[:, 0], work_offsets=tuple(self.used), remarks=tuple(self.remarks), stops=tuple(self.stops))


def _numbers(parameters, word):
    for parameter in parameters:
        if not NUMBER.fullmatch(parameter):
            raise Complaint(f"{word}/ with {parameter or 'nothing between two commas'}", "write numbers with digits and one point")
    return [float(p) for p in parameters]


def _whole(parameters, word, most):
    """One whole number from 1 to `most`."""
    numbers = _numbers(parameters, word)
    if len(numbers) != 1 or numbers[0] != int(numbers[0]) or not 1 <= numbers[0] <= most:
        raise Complaint(f"{word}/{','.join(parameters)}", f"write {word}/ and one whole number from 1")
    return int(numbers[0])


def _one(parameters, known, word):
    if len(parameters) != 1 or parameters[0] not in known:
        raise Complaint(f"{word}/{','.join(parameters)}", f"write {word}/ and one of {', '.join(known)}")
    return parameters[0]


def _unit_axis(numbers):
    """An axis of length 1; rounded ones are stretched."""
    length = sqrt(sum(v * v for v in numbers))
    if abs(length - 1) > LONGER:
        raise Complaint(f"an axis of length {length:.6g}", "write the three parts of an axis of length 1")
    return tuple(v / length + 0.0 for v in numbers)


WORDS = {
    "UNITS": _Job.set_units, "FIXOFF": _Job.set_offset, "MULTAX": _Job.set_axes, "FEDRAT": _Job.set_feed, "RAPID": _Job.set_rapid,
    "SPINDL": _Job.set_speed, "COOLNT": _Job.set_coolant, "LOADTL": _Job.load_tool, "TOOLNO": _Job.name_tool, "STOP": _Job.stop,
    "OPSTOP": _Job.optional_stop, "DELAY": _Job.wait, "FINI": _Job.end, "END": _Job.end, "FROM": _Job.begin, "GODLTA": _Job.go_by,
    "GOTO": _Job.go, "CIRCLE": _Job.begin_circle, "RETRCT": _Job.retract,
}
