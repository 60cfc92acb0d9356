"""Reads a Heidenhain Klartext program back into moves: what the control will do.

It knows nothing of any post.  What it does not know it refuses, with the line and the remedy.  Facts by the TNC 640 User's Manual
for Klartext Programming: TOOL CALL takes the tool's length with it; FMAX is its block's alone; M5, M9, M0, M1, M2 and M30 act at
the end of their block; M0 and M1 stop spindle and coolant, STOP alone does not; cycle 9 waits as soon as it is defined; M91 heeds
neither preset, datum shift nor tool length; preset 1 stands for G54, 6 for G59; IPA and DR have one sign.  CC says by its axes in
which main plane circles run, DR is the mathematical sense there: from X to Y, from Y to Z, from Z to X (angle reference axis).
Cycle 207 taps with the spindle tied to the feed: Q239 above 0 is right-hand, then to the set-up clearance Q200 and the second one
Q204, both over Q203 (drilling: klartext_drilling).  A circle whose radii differ by more than 0.005 mm is refused (circleDeviation).
FUNCTION TCPM ties X Y Z to the tip, its F TCP is the feed there; PLANE SPATIAL turns about the part's Z, the new Y and the new X by
SPC, SPB and SPA, and PLANE RESET STAY ends it where the axes stand.
"""

import re
from math import cos, hypot, isfinite, nan, radians, sin

import numpy as np

from cuspline.posts.readers.cutter_compensation import Compensation
from cuspline.posts.readers.klartext_blocks import blocks_of, number, path_words
from cuspline.posts.readers.klartext_drilling import NEEDED, checked, drilled
from cuspline.posts.readers.klartext_tools import read_tool_table
from cuspline.posts.readers.rs274_arcs import CLOSE_BOUNDS
from cuspline.posts.readers.rs274_blocks import refusal
from cuspline.posts.readers.rs274_codes import ARC_LETTERS, finder, named_codes
from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.posts.readers.rs274_flow import refuse_text_after
from cuspline.posts.readers.rs274_modes import Rules
from cuspline.posts.readers.rs274_reader import Controller
from cuspline.posts.readers.turns import turned_about
from cuspline.program.program import Plane
from cuspline.values import fixed_math as fixed
from cuspline.values.frames import Frame

__all__ = ["read_program", "read_tool_table"]

# the controller's own table: what the statements are brought to
BY_NAME = {
    **named_codes("motion", "G0", "G1", "G2", "G3", takes=ARC_LETTERS),
    **named_codes("motion", "G331", "G332", takes="k"),
    **named_codes("non-modal", "G4", takes="p"),
    **named_codes("non-modal", "G53"),
    **named_codes("non-modal", "G92.1", says="axis offset"),
    **named_codes("plane", "G17", "G18", "G19"),
    **named_codes("units", "G20", "G21"),
    **named_codes("cutter compensation", "G40", "G41", "G42"),
    **named_codes("tool length", "G43", takes="h"),
    **named_codes("tool length", "G49"),
    **named_codes("tilted plane", "G53.1", "G69"),
    **named_codes("kinematics", "M428", "M429"),
    **named_codes("work offset", "G54", "G55", "G56", "G57", "G58", "G59"),
    **named_codes("path control", "G64", takes="q"),
    **named_codes("arc distance", "G90.1"),
    **named_codes("stopping", "M0", "M1", "M2", "M30"),
    **named_codes("spindle", "M3", "M4", "M5"),
    **named_codes("tool change", "M6"),
    **named_codes("coolant", "M7", "M8", "M9"),
}
AT_THE_END = (0, 1, 2, 5, 9, 30)
AT_THE_BEGIN = (3, 4, 7, 8)
TOGETHER = {13: (3, 8), 14: (4, 8), 0: (0, 5, 9), 1: (1, 5, 9)}        # spindle and coolant: a stop switches them off
MACHINE_DATUM = 91
TCPM = ("F", "TCP", "AXIS", "POS", "PATHCTRL", "AXIS")
IJK = dict(zip("XYZ", "ijk"))
TAP_WORDS = {"Q200", "Q201", "Q239", "Q203", "Q204"}
BELOW_MM = 1e-6             # that is rounding
UNITS = {"MM": ("g", 21.0), "INCH": ("g", 20.0)}


def _smooth(controller, name, values):
    controller.path_tolerance_mm = values["q"] * controller.length_unit_mm() if "q" in values else nan


RULES = Rules(code_of=finder(BY_NAME, {}), takes_own_length=False, moves_z_alone=False, path_tolerance_mm=nan,
              modes=frozenset(("work offset", "cutter compensation", "tool length", "path control", "axis offset")),
              bounds=(CLOSE_BOUNDS, CLOSE_BOUNDS), actions={"path control": _smooth},
              compensation=Compensation(joins_by_arcs=True, needs_register=False),
              words={"work offset": ("CYCL DEF 247", "which preset is in force"),
                     "cutter compensation": ("R0", "whether the path is shifted by a cutter radius"),
                     "tool length": ("TOOL CALL", "which tool length is in force"),
                     "path control": ("CYCL DEF 32", "how far the control may leave the path"),
                     "axis offset": ("CYCL DEF 7 with X+0 Y+0 Z+0", "whether a datum shift moves the zero")})


def read_program(text, *, work_offsets, tool_lengths, chain=None, tool_radii=None, coolants=None):
    """The moves of a Klartext program.

    Args:
        text: the whole program.
        work_offsets: {"G54": (x, y, z)} machine coordinates of each preset, mm; G54 is preset 1.
        tool_lengths: {number: length, mm}.
        chain: kinematics.Chain of a machine with rotary axes, see rs274_reader; under FUNCTION TCPM X Y Z are the tip, in axes
            that go with the table from where it stands with the rotaries at 0.
        tool_radii: {number: radius in the tool's register, mm} that RL and RR shift a contour by; left out: they are refused.
        coolants: {"M88": (values.coolants.BITS on, off)}, the machine's own M-codes; left out: those of the control alone.
    Returns:
        PostedMoves.
    Raises:
        ReadError: the control would refuse the text or might do something else; `.rows` holds the line.

    >>> text = "0 BEGIN PGM A MM\\n1 L X+1 Y+2 Z+3 R0 FMAX\\n2 CC X+2 Y+2\\n3 CP IPA+180 IZ-1 DR+ F100\\n4 END PGM A MM"
    >>> moves = read_program(text, work_offsets={}, tool_lengths={})
    >>> moves.end_mm[-1].round(9).tolist(), moves.line.tolist(), moves.ended
    ([3.0, 2.0, 2.0], [2, 4], True)
    """
    blocks = blocks_of(text)
    controller = Controller(work_offsets, tool_lengths, RULES, chain, tool_radii, coolants)
    end = controller.run(_Tnc(controller).executed(blocks))
    if end is None:
        raise refusal(Complaint("the text stops without END PGM", "end it with END PGM, its name and its unit"), blocks[-1])
    _refuse_other_end(blocks)
    refuse_text_after(blocks, end)
    return controller.posted_moves()


def _refuse_other_end(blocks):
    """
    Raises:
        ReadError: END PGM is missing, or is another program's.
    """
    begin = next(block.words[0].rest for block in blocks if block.words)
    last = next((block for block in blocks if block.flow), None)
    if last is None:
        raise refusal(Complaint("the text has no END PGM", "end it with END PGM, its name and its unit"), blocks[-1])
    if last.words[0].rest != begin:
        raise refusal(Complaint(f"it began as {' '.join(begin)}", "give BEGIN PGM and END PGM one name and one unit"), last)


class _Tnc:
    """The control's own state, and statements brought to the words that the controller knows."""

    def __init__(self, controller):
        self.controller, self.name = controller, None
        self.pole, self.plane = None, Plane.XY      # {"X": place, ...} of the last CC, and the plane of its axes
        self.tapping = {}               # Q parameters of cycle 207, where it was the last that CYCL CALL may run
        self.drilling = ()              # (cycle, Q parameters) of 200, 201, 203 or 205, where it was the last
        self.shifts = set()             # axes whose datum shift has been taken back since cycle 7 began

    def executed(self, blocks):
        """Yield (block, words)."""
        for block in blocks:
            if not block.words:
                yield block, ()
                continue
            try:
                steps = self._steps(block.words[0])
            except Complaint as complaint:
                raise refusal(complaint, block) from None
            for words in steps:
                yield block, words

    def _steps(self, statement):
        kind, rest = statement
        if (self.name is None) != (kind == "BEGIN PGM"):
            raise Complaint("text before BEGIN PGM" if self.name is None else "a second BEGIN PGM",
                            "begin with BEGIN PGM, a name and MM or INCH, once")
        other = {"BEGIN PGM": self._begin, "END PGM": self._end, "BLK FORM 0.1": self._drawn, "BLK FORM 0.2": self._drawn,
                 "TOOL CALL": self._call, "TOOL DEF": self._drawn, "CYCL DEF": self._cycle, "CYCL CALL": self._called,
                 "CC": self._center, "FUNCTION TCPM": self._tip_on, "FUNCTION RESET TCPM": self._tip_off,
                 "PLANE SPATIAL": self._tilt, "PLANE RESET": self._upright}.get(kind)
        return other(rest) if other else self._moves(kind, path_words(rest))

    # the frame ----------------------------------------------------------------------------------

    def _begin(self, rest):
        if len(rest) != 2 or rest[1] not in UNITS:
            raise Complaint("BEGIN PGM without its name or its unit", "write BEGIN PGM, a name and MM or INCH")
        self.name = rest
        return [(UNITS[rest[1]], ("g", 17.0), ("g", 90.1))]

    def _end(self, rest):
        return [(("m", 30.0),)]

    def _drawn(self, rest):
        """What the control draws, or gets ready, and does not do."""
        return [()]

    # tools and cycles ----------------------------------------------------------------------------

    def _call(self, rest):
        words, axis = [], ""
        for word in rest:
            if word.isdigit() and not (words or axis):
                words += [("t", float(word)), ("m", 6.0), ("g", 43.0), ("h", float(word))]
            elif word in ("X", "Y", "Z", "U", "V", "W"):
                axis = word
            elif word[0] in "SF" and _is_number(word[1:]):
                words.append((word[0].lower(), number(word[1:])))
            elif word[:2] not in ("DL", "DR") or not _is_number(word[2:].removeprefix("2")) or number(word[2:]) != 0:
                raise Complaint(f'"{word}" in TOOL CALL', "write the tool's number, Z, S and F, and oversizes into the tool table")
        if axis != "Z":
            raise Complaint(f"a tool along {axis or 'no axis'}", "write TOOL CALL with Z")
        return [tuple(words)]

    def _cycle(self, rest):
        cycle, words = rest[0] if rest else "", rest[1:]
        if cycle == "247":
            return self._preset(words)
        if cycle == "207":
            return self._define_taps(words)
        if cycle in NEEDED:
            self.tapping, self.drilling = {}, (cycle, checked(cycle, _parameters(words)))
            return [()]
        if cycle.startswith("7."):
            return self._shift(int(cycle[2:]) if cycle[2:].isdigit() else -1, words)
        if cycle == "32.1":
            if len(words) > 1 or words and not (words[0][0] == "T" and _is_number(words[0][1:])):
                raise Complaint("cycle 32.1 with anything but T", "write CYCL DEF 32.1 T and the tolerance")
            return [(("g", 64.0), *(("q", number(w[1:])) for w in words))]
        if cycle in ("32.0", "32.2", "9.0"):
            return [()]
        if cycle == "9.1":
            if not words or not _is_number(words[-1]):
                raise Complaint("cycle 9.1 without its time", "write CYCL DEF 9.1 DWELL and the seconds")
            return [(("g", 4.0), ("p", number(words[-1])))]
        raise Complaint(f"cycle {cycle or 'without a number'}",
                        "known are 7 (all zero), 9, 32, 200, 201, 203, 205, 207 and 247: write other cycles out as moves")

    def _define_taps(self, words):
        given = _parameters(words)
        if given.keys() != TAP_WORDS or not (given["Q200"] > 0 > given["Q201"] and given["Q239"]):
            raise Complaint("cycle 207 without all of its parameters, or with one that makes no sense",
                            "write Q200 above 0, Q201 below 0, Q239, Q203 and Q204")
        self.tapping, self.drilling = given, ()
        return [()]

    def _called(self, rest):
        """The cycle that was defined last, where the tool stands."""
        if not (self.tapping or self.drilling) or rest:
            raise Complaint("CYCL CALL without a cycle before it, or with other words",
                            "define cycle 200, 201, 203, 205 or 207, then write CYCL CALL alone")
        if self.controller.is_tip and self.controller.tilted is None:
            raise Complaint("CYCL CALL under FUNCTION TCPM", "drill there move by move, or in a tilted plane")
        if self.drilling:
            return drilled(*self.drilling, self.controller.tip[2] / self.controller.length_unit_mm())
        return self._tap(self.tapping)

    def _tap(self, q):
        """Cycle 207: to the set-up clearance, down and back by the pitch, to the second one."""
        low, high = q["Q203"] + q["Q200"], q["Q203"] + max(q["Q204"], q["Q200"])
        if self.controller.tip[2] < low * self.controller.length_unit_mm() - BELOW_MM:
            raise Complaint("cycle 207 is called below its set-up clearance", "go up before CYCL CALL")
        return [(("g", 0.0), ("z", low)), (("g", 331.0), ("z", q["Q203"] + q["Q201"]), ("k", q["Q239"])),
                (("g", 332.0), ("z", low), ("k", q["Q239"])), (("g", 0.0), ("z", high))]

    def _preset(self, words):
        given = [w.removeprefix("Q339=") for w in words if w.startswith("Q339=")]
        if len(given) != 1 or given[0] not in ("+1", "+2", "+3", "+4", "+5", "+6", *"123456"):
            raise Complaint("cycle 247 without a preset from 1 to 6", "write Q339=+1 for what G54 is elsewhere, to +6 for G59")
        return [(("g", 53.0 + int(given[0])),)]

    def _shift(self, part, words):
        if part == 0:
            self.shifts = set()
            return [()]
        axis = words[0][0] if words else ""
        if len(words) != 1 or axis not in "XYZ" or not _is_number(words[0][1:]) or number(words[0][1:]) != 0:
            raise Complaint("a datum shift", "write CYCL DEF 7 with X+0, Y+0 and Z+0, and set the zero by the preset")
        self.shifts.add(axis)
        return [(("g", 92.1),)] if self.shifts == set("XYZ") else [()]

    # rotary axes ------------------------------------------------------------------------------------

    def _tip_on(self, rest):
        if rest != TCPM:
            raise Complaint("FUNCTION TCPM " + " ".join(rest), f"write FUNCTION TCPM {' '.join(TCPM)}: F of the tip, rotary words "
                            "as the axes stand, run evenly")
        return [(("m", 428.0),)]

    def _tip_off(self, rest):
        if rest:
            raise Complaint(f"{rest[0]} behind FUNCTION RESET TCPM", "write it alone")
        return [(("m", 429.0),)]

    def _tilt(self, rest):
        """The plane takes the tool along as it stands: TURN must find the rotary axes there, MOVE would move X Y Z too."""
        controller = self.controller
        angles = {word[:3]: number(word[3:]) for word in rest if word[:3] in ("SPA", "SPB", "SPC") and _is_number(word[3:])}
        if len(angles) != 3 or rest[3:] not in (("TURN", "FMAX"), ("STAY",)):
            raise Complaint("PLANE SPATIAL without its three angles, or with another way to turn",
                            "write SPA, SPB and SPC, then TURN FMAX or STAY")
        if controller.tilted is not None or controller.is_tip or not controller.rotaries:
            raise Complaint("PLANE SPATIAL in another plane, under FUNCTION TCPM, or without rotary axes",
                            "write PLANE RESET STAY or FUNCTION RESET TCPM before; read with the machine's rotary axes")
        controller.asked_plane = _space_frame(*(angles[name] for name in ("SPA", "SPB", "SPC")))
        return [(("g", 49.0),), (("g", 53.1),), self._own_length()]

    def _upright(self, rest):
        if rest != ("STAY",):
            raise Complaint("PLANE RESET that turns the rotary axes", "write PLANE RESET STAY, then turn them by L and M91")
        return [(("g", 49.0),), (("g", 69.0),), self._own_length()] if self.controller.tilted is not None else [()]

    def _own_length(self):
        """A tool's length, which its call took, stays in force in a plane and behind it."""
        return (("g", 43.0), ("h", float(self.controller.tool))) if self.controller.tool else ()

    # paths ----------------------------------------------------------------------------------------

    def _center(self, rest):
        places = path_words(rest).places
        plane = next((p for p in Plane if places.keys() == {"XYZ"[k] for k in p.axes[:2]}), None)
        if len(places) != len(rest) or plane is None:
            raise Complaint("a circle centre that is not given by two of X, Y and Z", "write two of them, not IX or its like")
        self.pole, self.plane = places, plane
        return [()]

    def _moves(self, kind, said):
        """Functions that act at once, the move, functions that act at its end."""
        functions = [f for m in said.functions for f in TOGETHER.get(m, (m,))]
        own = [int(name[1:]) for name in self.controller.own_coolants if name != "M9"]
        at_begin = (*AT_THE_BEGIN, *own)
        unknown = [f"M{f}" for f in functions if f not in (*AT_THE_END, *at_begin, MACHINE_DATUM)]
        if unknown:
            raise Complaint(f"unknown word {unknown[0]}", "known are " + ", ".join(
                f"M{f}" for f in sorted((*AT_THE_END, *at_begin, *(13, 14), MACHINE_DATUM))))
        begin = [("m", float(f)) for f in functions if f in at_begin] + self._radius(said.radius)
        end = [("m", float(f)) for f in functions if f in AT_THE_END] + ([("m", 0.0)] if kind == "STOP" else [])
        move = self._move(kind, said, MACHINE_DATUM in functions)
        if said.is_rapid and said.feed is not None:
            raise Complaint("F beside FMAX", "leave one of them")
        if said.feed is not None:
            begin.append(("f", said.feed))
        return [tuple(begin + move), *((word,) for word in end)]

    def _radius(self, word):
        """R0, RL or RR as a code; what is in force already may be said again."""
        shifted = self.controller.shifted
        code = {"R0": 40.0, "RL": 41.0, "RR": 42.0}.get(word)
        is_on = shifted is not None and code == (41.0 if shifted.side > 0 else 42.0)
        return [] if code is None or is_on else [("g", code)]

    def _move(self, kind, said, is_machine):
        if kind in ("M", "STOP") or kind == "L" and not said.places:
            if said.places or said.sense or is_machine:
                raise Complaint("places without a path", "write L before them")
            return []
        if is_machine and kind != "L":
            raise Complaint("M91 with a circle", "M91 goes with L")
        if kind == "L":
            if said.sense or said.arc_radius or "IPA" in said.places:
                raise Complaint("DR, IPA or a radius in a straight block", "write C, CR or CP")
            return [("g", 0.0 if said.is_rapid else 1.0), *([("g", 53.0)] if is_machine else []), *self._ends(said, is_machine)]
        if said.is_rapid or not said.sense:
            raise Complaint("a circle without DR, or with FMAX", "write DR+ or DR-, and F")
        turn = ("g", 2.0 if said.sense == "DR-" else 3.0)
        if kind == "CR":
            if "Z" in said.places or "IZ" in said.places or not said.arc_radius:
                raise Complaint("CR outside the plane of X and Y, or without R", "write X, Y, R and DR")
            return [("g", 17.0), turn, *self._ends(said, False), ("r", said.arc_radius)]
        if self.pole is None or said.arc_radius:
            raise Complaint("a circle without its CC", "write CC with its centre before it")
        center = [("g", 17.0 + self.plane), turn, *((IJK[axis], place) for axis, place in self.pole.items())]
        if kind == "CP":
            return [*center, *self._helix(said)]
        if not {name.removeprefix("I") for name in said.places} <= self.pole.keys():
            raise Complaint("C with another axis than its CC", "write CP with IPA and IZ for a helix")
        return [*center, *self._ends(said, False)]

    def _ends(self, said, is_machine):
        """Where it ends, in the program's unit; what counts on is added to where it stands."""
        ends, unit = [], self.controller.length_unit_mm()
        for name, value in said.places.items():
            axis = name.removeprefix("I")
            if name != axis and (is_machine or axis in said.places):
                raise Complaint(f"{name} with M91, or beside {axis}", f"write {axis}")
            stands = self.controller.tip["XYZ".index(axis)] / unit if name != axis else 0.0
            ends.append((axis.lower(), stands + value))
        return ends

    def _helix(self, said):
        """End, rise and whole turns of CP."""
        angle = said.places.get("IPA", nan)
        rises = {"IPA", "IZ"} if self.plane == Plane.XY else {"IPA"}
        if not said.places.keys() <= rises or not isfinite(angle) or not angle:
            raise Complaint("CP without IPA, or with other places than IZ along Z", "write CP IPA IZ DR")
        if (angle > 0) != (said.sense == "DR+"):
            raise Complaint(f"IPA and {said.sense} turn against each other", "give both one sign")
        unit = self.controller.length_unit_mm()
        tip = [v / unit for v in self.controller.tip]
        a, b = ("XYZ"[k] for k in self.plane.axes[:2])
        x, y, z = (tip["XYZ".index(a)], tip["XYZ".index(b)], tip[2])
        u, v = x - self.pole[a], y - self.pole[b]
        if not isfinite(hypot(u, v)):
            raise Complaint("a circle while nobody knows where the tool stands", "go to a named place by L first")
        turns, left = divmod(abs(angle), 360.0)
        c, s = cos(radians(angle)), sin(radians(angle))
        ends = (self.pole[a] + c * u - s * v, self.pole[b] + s * u + c * v) if left else (x, y)
        place = list(zip((a.lower(), b.lower()), ends))
        turns = turns if left else turns - 1
        return [*place, *([("z", z + said.places["IZ"])] if "IZ" in said.places else []), ("p", turns + 1.0)]


def _space_frame(a, b, c):
    """Frame turned about the fixed X, Y and Z by a, b and c degrees: the same as about Z, the new Y and the new X by c, b and a."""
    turns = [turned_about(axis, degrees) for axis, degrees in enumerate((a, b, c))]
    return Frame(rotation=fixed.matmul(turns[2], fixed.matmul(turns[1], turns[0])), origin_mm=np.zeros(3))


def _parameters(words):
    """{Q parameter: number} of a cycle's words; without those that are none."""
    found = [re.fullmatch(r"(Q\d+)=(.*)", word) for word in words]
    return {m[1]: number(m[2]) for m in found if m and _is_number(m[2])}


def _is_number(text):
    try:
        return isfinite(number(text))
    except ValueError:
        return False
