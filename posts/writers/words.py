"""What the posts share: words and blocks, rounding, and arcs that a control accepts.

Blocks are built as lists of words first and joined to text second.  Arc radii are compared after rounding; arcs that
a control would refuse are cut into chords.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from cuspline.program.arcs import Arc
from cuspline.program.program import Kind, Plane
from cuspline.values.errors import PostError

INCH_MM = 25.4
INVERSE_DECIMALS = 4        # of a feed under G93, 1/min
FINE_FEED_DECIMALS = 3      # of a feed so slow that fewer do not tell it
# LinuxCNC refuses an arc whose radii at start and end differ by more than 0.0283 mm and 0.1 %
# (0.0014 in); a tenth of that leaves room for what other versions and controls may ask
ARC_RADIUS_MISMATCH_MM = 0.00283
PLANE_WORD = {Plane.XY: "G17", Plane.ZX: "G18", Plane.YZ: "G19"}
NEARLY_FULL_RAD = math.radians(350)     # rounding must not turn a full circle into none: two halves
WIDEST_BY_RADIUS_RAD = math.radians(120)    # beyond, the rounding of R moves the middle of the arc by more than itself
MOTION_WORD = {Kind.RAPID: "G0", Kind.FEED: "G1", Kind.ARC_CW: "G2", Kind.ARC_CCW: "G3"}
FIRST_ARC = int(Kind.ARC_CW)
UNIT_WORD = {"mm": "G21", "inch": "G20"}
COOLANT_WORD = {"off": "M9", "mist": "M7", "flood": "M8"}


@dataclass(frozen=True, kw_only=True)
class Posted:
    """A posted program and what the post had to do to it."""

    texts: tuple[str, ...]      # one file, or a numbered set in the order in which it is run
    arcs_as_lines: int          # arcs that went out as G1 because the rounded block would be refused
    largest_rounding_mm: float  # largest distance of a rounded end point from the planned one
    joint_s: dict = field(default_factory=dict)     # number of an operation (from 1) -> seconds, where rotaries turn in it

    @property
    def text(self):
        """The program, where it is one file.

        Raises:
            PostError: it is a set.
        """
        if len(self.texts) != 1:
            raise PostError(f"the program is a set of {len(self.texts)} files, not one text")
        return self.texts[0]


def in_brackets(text):
    """A comment of RS-274 and of Fanuc: ASCII, no brackets within.

    >>> in_brackets("ball (6 mm)")
    '(ball [6 mm])'
    """
    clean = text.translate({ord("("): "[", ord(")"): "]"}).encode("ascii", "replace").decode()
    return f"({' '.join(clean.split())})"


def behind_semicolon(text):
    """A comment of controls that pass over what stands behind a semicolon: ASCII.

    >>> behind_semicolon("ball (6 mm)")
    '; ball (6 mm)'
    """
    return "; " + " ".join(text.encode("ascii", "replace").decode().split())


class Writer:
    """Lines so far and the modal state that the control is in."""

    motion_words, plane_words = MOTION_WORD, PLANE_WORD
    radius_name = "R"               # of an arc by its radius
    number_bytes = 0                # that a block number takes before a line, at most

    def __init__(self, machine, point="", comment=in_brackets, rotaries=(), planes=tuple(Plane)):
        """
        Args:
            point: what a control wants behind a number without decimals: "" nothing, "." a point.
            comment: function text -> the line that a control passes over.
            rotaries: letters of the rotary axes.
            planes: in which the control runs arcs; others go out as chords.
        """
        self.machine, self.point, self.comment_of, self.planes = machine, point, comment, planes
        control = machine.control
        self.scale = 1.0 if control.units == "mm" else 1.0 / INCH_MM
        self.decimals = control.decimals
        self.lines, self.tail, self.tool = [], [], None
        self.beside_mm = 0.0            # by which the zero is shifted for a tool beside the spindle's axis
        self.pending_z = (), ()         # words before and behind the next Z of an approach
        self.helix_words = ()           # behind the centre of a helix
        self.radius_words = ()          # of cutter compensation, in the next straight block
        self.here_mm = np.zeros(3)
        self.arcs_as_lines, self.largest_rounding_mm = 0, 0.0
        self.plane, self.feed, self.coolant = Plane.XY, None, "M9"
        self.coolant_end = None                         # the word that ends it, where M9 does not
        self.speed = ""                                 # the S word in force
        self.by_radius = control.arc_centres == "R"
        self.rotaries = rotaries
        self.is_tip = False                             # under tool-centre-point control, or
        self.is_tilted = False                          # in a tilted plane
        self.turn_words = [None] * len(rotaries)       # of the rotary axes; None: nobody knows where they stand
        self.forget_position()

    def state(self):
        """What `go_back_to` needs to forget all that is written from here on."""
        return len(self.lines), len(self.tail), {**self.__dict__, "axis_words": list(self.axis_words),
                                                 "turn_words": list(self.turn_words)}

    def go_back_to(self, state):
        """Forget what was written since."""
        lines, tail, values = state
        self.__dict__.update(values)
        del self.lines[lines:], self.tail[tail:]

    def forget_position(self):
        """After a tool change every axis word is written again."""
        self.motion, self.axis_words = None, [None] * 3

    def block(self, *words):
        self.lines.append(" ".join(words))

    def comment(self, text):
        """Lines that the control passes over, split to the line length."""
        clean = " ".join(text.split())
        room = self.machine.control.line_length - 2 - len(self.comment_of("")) - self.number_bytes
        for k in range(0, max(len(clean), 1), room):
            self.lines.append(self.comment_of(clean[k:k + room]))

    def length(self, value_mm, decimals=None):
        """A length in mm as the control reads it."""
        return self.number(value_mm * self.scale, decimals or self.decimals)

    def number(self, value, decimals):
        """A number without useless zeros; never an exponent, never minus zero."""
        text = "%.*f" % (decimals, value)
        text = text.rstrip("0").rstrip(".") if "." in text else text
        text = "0" if text in ("-0", "") else text
        return text if "." in text else text + self.point

    def rounded_mm(self, value_mm):
        """What the control will read, in mm."""
        return round(value_mm * self.scale, self.decimals) / self.scale

    def words(self, point_mm, axes=(0, 1, 2)):
        """Axis words that differ from where the control stands."""
        out = []
        for k in axes:
            text = self.length(point_mm[k])
            if text != self.axis_words[k]:
                out.append("XYZ"[k] + text)
                self.axis_words[k] = text
        return out

    def turned(self, degrees):
        """Rotary words that differ from where the control stands; degrees in either unit."""
        out = []
        for k, letter in enumerate(self.rotaries):
            text = self.number(degrees[k], self.machine.control.decimals_deg)
            if text != self.turn_words[k]:
                out.append(letter + text)
                self.turn_words[k] = text
        return out

    def joint_move(self, motion, point_mm, degrees, more=(), first=()):
        """A block that runs joints evenly; `first` words stand before it, `more` behind; without a place none is written."""
        self.largest_rounding_mm = max(self.largest_rounding_mm, math.dist([self.rounded_mm(v) for v in point_mm], point_mm))
        words = [*self.words(point_mm), *self.turned(degrees)]
        if words:
            self._jointly(motion, first, words, more)
        self.here_mm = np.asarray(point_mm)

    def _jointly(self, motion, first, words, more):
        self.block(*first, *self._motion(motion), *words, *more)

    def tip_feed(self, way_mm, seconds):
        """The F word's number under G94 for a way in a time, rounded to the slower side."""
        scale = 10 ** self.machine.control.decimals_feed
        return self.number(math.floor(60.0 * way_mm * self.scale / seconds * scale) / scale, self.machine.control.decimals_feed)

    def fine_feed(self, a_minute):
        """A slow F word's number in the control's unit, rounded to the slower side as far as it is not nothing."""
        scale = 10 ** FINE_FEED_DECIMALS
        return self.number(max(math.floor(a_minute * scale), 1) / scale, FINE_FEED_DECIMALS)

    def inverse_time(self, seconds):
        """The F word's number under G93: one over the minutes, rounded to the slower side."""
        scale = 10 ** INVERSE_DECIMALS
        return self.number(max(math.floor(60.0 / seconds * scale), 1) / scale, INVERSE_DECIMALS)

    def count_rounding(self, place_mm):
        """A place that goes out rounded."""
        self.largest_rounding_mm = max(self.largest_rounding_mm, math.dist([self.rounded_mm(v) for v in place_mm], place_mm))

    def move(self, kind, end_mm, center_mm, plane, feed):
        self.count_rounding(end_mm)
        if kind >= FIRST_ARC:
            self._curved(kind, end_mm, center_mm, Plane(plane), feed)
        else:
            self._straight(kind, end_mm, feed)

    def _straight(self, kind, end_mm, feed):
        words = self.words(end_mm)
        if words:
            first, self.radius_words = self.radius_words, ()
            self.block(*first, *self._motion(self.motion_words[kind]), *words,
                       *(self.feed_words(feed) if kind == Kind.FEED else ()))
        self.here_mm = end_mm

    def _curved(self, kind, end_mm, center_mm, plane, feed):
        """An arc as the control takes it: whole, in two halves, or as chords within the path tolerance."""
        arc = Arc(self.here_mm, end_mm, center_mm, plane, kind)
        if arc.sweep_rad > (WIDEST_BY_RADIUS_RAD if self.by_radius else NEARLY_FULL_RAD):
            self._curved(kind, arc.at(0.5), center_mm, plane, feed)
            self._curved(kind, end_mm, center_mm, plane, feed)
        elif plane in self.planes and self._arc_is_accepted(end_mm, center_mm, plane):
            self._arc(kind, end_mm, center_mm, plane, feed)
        else:
            self.arcs_as_lines += 1
            for point in arc.chords(self.machine.control.path_tolerance_mm):
                self._straight(Kind.FEED, point, feed)

    def _motion(self, word):
        """The motion word where it changes."""
        if word == self.motion:
            return ()
        self.motion = word
        return (word,)

    def feed_text(self, feed_mm_per_min):
        """A feed as the control reads it.

        Raises:
            PostError: it rounds to nothing.
        """
        text = f"{feed_mm_per_min * self.scale:.{self.machine.control.decimals_feed}f}"
        if float(text) == 0:
            raise PostError(f"a feed of {feed_mm_per_min:g} mm/min is nothing with "
                            f"{self.machine.control.decimals_feed} decimals: raise it, or decimals_feed")
        return text if "." in text else text + self.point

    def feed_words(self, feed_mm_per_min):
        """The F word where the feed changes."""
        text = self.feed_text(feed_mm_per_min)
        if text == self.feed:
            return ()
        self.feed = text
        return ("F" + text,)

    def _arc_words(self, end_mm, center_mm, plane):
        """Rounded start, end and centre offsets of an arc in its plane, mm."""
        a, b, _ = plane.axes
        start = [self.rounded_mm(self.here_mm[k]) for k in (a, b)]
        end = [self.rounded_mm(end_mm[k]) for k in (a, b)]
        offset = [self.rounded_mm(center_mm[k] - s) for k, s in zip((a, b), start)]
        return start, end, offset

    def _arc_is_accepted(self, end_mm, center_mm, plane):
        """The controller's own rule on the rounded words: both radii agree, the arc has a length."""
        control = self.machine.control
        start, end, offset = self._arc_words(end_mm, center_mm, plane)
        if self.by_radius:
            return control.arc_min_length_mm < math.dist(start, end) and self._radius_is_accepted(start, end, center_mm, plane)
        r0 = math.hypot(*offset)
        r1 = math.hypot(end[0] - start[0] - offset[0], end[1] - start[1] - offset[1])
        chord = math.dist(start, end)
        return (abs(r0 - r1) <= ARC_RADIUS_MISMATCH_MM and control.arc_min_length_mm < chord
                and r0 <= control.arc_max_radius_mm)

    def _radius_is_accepted(self, start, end, center_mm, plane):
        """The control's arc by the rounded R spans the rounded ends, and its middle is where the arc's is."""
        radius, half = self._radius_mm(center_mm, plane), math.dist(start, end) / 2
        written = self.rounded_mm(radius)
        if not half < min(radius, written) or written > self.machine.control.arc_max_radius_mm:
            return False
        rise = lambda r: r - math.sqrt(r * r - half * half)
        return abs(rise(written) - rise(radius)) <= ARC_RADIUS_MISMATCH_MM

    def _radius_mm(self, center_mm, plane):
        a, b, _ = plane.axes
        return math.hypot(self.here_mm[a] - center_mm[a], self.here_mm[b] - center_mm[b])

    def to_plane(self, plane):
        """The plane's word where it changes."""
        if plane != self.plane:
            self.block(self.plane_words[plane])
            self.plane = plane

    def _arc(self, kind, end_mm, center_mm, plane, feed):
        self.to_plane(plane)
        a, b, third = plane.axes
        _, _, offset = self._arc_words(end_mm, center_mm, plane)
        names = {0: "I", 1: "J", 2: "K"}
        # an arc names both its axes: some controls take a missing one for a full circle
        for k in (a, b):
            self.axis_words[k] = None
        is_helix = abs(end_mm[third] - self.here_mm[third]) > 1e-9
        words = self.words(end_mm, [*sorted((a, b)), *([third] if is_helix else [])])
        centre = [names[k] + self.length(o) for k, o in sorted(zip((a, b), offset))]
        if self.by_radius:
            centre = [self.radius_name + self.length(self._radius_mm(center_mm, plane))]
        more = self.helix_words if is_helix else ()
        self.block(*self._motion(self.motion_words[kind]), *words, *centre, *more, *self.feed_words(feed))
        self.here_mm = end_mm


def check_lines(lines, machine):
    """Every line fits the control."""
    for number, line in enumerate(lines, 1):
        if len(line) >= machine.control.line_length:
            raise PostError(f"line {number} has {len(line)} characters, {machine.name} takes fewer than "
                            f"{machine.control.line_length}")
