"""Reads a Sinumerik 840D program back into moves: what the control will do.

It knows nothing of any post.  What it does not know it refuses, with the line and the remedy.  Facts by the SINUMERIK 840D sl
Programming Manual: D takes the length of the tool in the spindle; SUPA leaves frames out, not the tool length; TRANS without axes
takes back programmed frames; TURN counts whole turns beside the arc; CTOL bounds what G642 rounds, ADIS what G641 does, G60 stops
exactly, G64 leaves it to the machine data; G331 goes down by K a turn of a spindle that SPOS has positioned, above 0 right-hand,
G332 back by the same K; drilling cycles are run where they stand (siemens_drilling); a circle's radii may differ by MD21000
(0.01 mm) or MD21010 (a thousandth).
"""

from math import inf, nan

from cuspline.posts.readers.cutter_compensation import Compensation
from cuspline.posts.readers.rs274_arcs import ArcBounds
from cuspline.posts.readers.rs274_blocks import refusal
from cuspline.posts.readers.rs274_codes import ARC_LETTERS, finder, named_codes
from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.posts.readers.rs274_flow import refuse_text_after
from cuspline.posts.readers.rs274_modes import UNSAID, Rules
from cuspline.posts.readers.rs274_reader import Controller
from cuspline.posts.readers.siemens_blocks import blocks_of
from cuspline.posts.readers.siemens_circles import arc_through
from cuspline.posts.readers.siemens_drilling import drilled
from cuspline.posts.readers.siemens_swivel import refuse_other_side, swivelled
from cuspline.posts.readers.siemens_tools import read_tool_table

__all__ = ["read_program", "read_tool_table"]

BOUNDS = ArcBounds(radius_error_mm=0.01, largest_error_mm=inf, smallest_radius_mm=1e-6)
# the controller's own table: what the blocks are brought to
BY_NAME = {
    **named_codes("motion", "G0", "G1", says="canned cycle"),
    **named_codes("motion", "G2", "G3", takes=ARC_LETTERS, says="canned cycle"),
    **named_codes("motion", "G331", "G332", takes="k", says="canned cycle"),
    **named_codes("non-modal", "G4", takes="p"),
    **named_codes("non-modal", "G53"),
    **named_codes("non-modal", "G92.1", says="axis offset"),
    **named_codes("plane", "G17", "G18", "G19"),
    **named_codes("kinematics", "M428", "M429"),
    **named_codes("tilted plane", "G53.1", "G69"),
    **named_codes("units", "G20", "G21"),
    **named_codes("cutter compensation", "G40", "G41", "G42"),
    **named_codes("tool length", "G43", takes="h"),
    **named_codes("tool length", "G49"),
    **named_codes("work offset", "G54", "G55", "G56", "G57"),
    **named_codes("path control", "G642", takes="q"),
    **named_codes("distance", "G90", "G91"),
    **named_codes("feed mode", "G93", "G94"),
    **named_codes("stopping", "M0", "M1", "M2", "M30"),
    **named_codes("spindle", "M3", "M4", "M5"),
    **named_codes("tool change", "M6"),
    **named_codes("coolant", "M7", "M8", "M9"),
}
BROUGHT = ("G20", "G21", "G43", "G49", "G53", "G53.1", "G69", "G92.1", "G642", "M428", "M429")        # by words of its own
SAME = BY_NAME.keys() - set(BROUGHT)
UNITS = {"G700": 20.0, "G710": 21.0}
TIP = {"TRAORI": ("m", 428.0), "TRAFOOF": ("m", 429.0)}
SMOOTHING = ("G60", "G64", "G641", "G642", "G643", "G645")
ADVICE = {"G70": "F would stay in the basic system: write G700", "G71": "F would stay in the basic system: write G710",
          "G53": "write SUPA, which leaves out the basic frames too", "G153": "write SUPA, which leaves out the basic frames too",
          "G58": "it shifts the zero by a program's own words: use G54 to G57",
          "G59": "it shifts the zero by a program's own words: use G54 to G57",
          "G500": "nobody knows where the zero is then: use G54 to G57",
          "G451": "corners would be joined otherwise than G450 does: write G450"}


def _smooth(controller, name, values):
    controller.path_tolerance_mm = values["q"] * controller.length_unit_mm() if "q" in values else nan


def _change_tool(controller, name, values):
    """Whether the first cutting edge comes into force by itself is machine data: the text has to say D."""
    controller.change_tool(name, values)
    if controller.is_length_on:
        controller.set_length("G49", {})
    controller.unsaid.add("tool length")


def _switch_kinematics(controller, name, values):
    """Frames are to be named again behind TRAORI and TRAFOOF."""
    controller.switch_kinematics(name, values)
    controller.unsaid.add("work offset")


def _set_wcs(controller, name, values):
    """The one in force may be named again, whatever transformation is on."""
    if name != controller.wcs:
        controller.set_wcs(name, values)


RULES = Rules(code_of=finder(BY_NAME, {}), modes=frozenset(UNSAID) - {"canned cycle", "local zero", "arc distance"},
              takes_own_length=False, moves_z_alone=False, path_tolerance_mm=nan, bounds=(BOUNDS, BOUNDS),
              words={"tool length": ("D1", "which tool length is in force"),
                     "path control": ("G642 CTOL", "how far the control may leave the path"),
                     "axis offset": ("TRANS", "whether a programmed frame shifts the zero")},
              actions={"path control": _smooth, "tool change": _change_tool, "kinematics": _switch_kinematics,
                       "work offset": _set_wcs},
              compensation=Compensation(joins_by_arcs=True, needs_register=False))


def read_program(text, *, work_offsets, tool_lengths, chain=None, tool_radii=None, coolants=None):
    """The moves of a Sinumerik program.

    Args:
        text: the whole program.
        work_offsets: {"G54": (x, y, z)} machine coordinates of each WCS origin, mm.
        tool_lengths: {number: length of the first cutting edge, mm}.
        chain: kinematics.Chain of a machine with rotary axes, see rs274_reader; under TRAORI X Y Z are the tip, in axes that go
            with the table from where it stands with the rotaries at 0.
        tool_radii: {number: radius in the tool's register, mm} that G41 and G42 shift a contour by; left out: they are refused.
        coolants: {"M88": (values.coolants.BITS on, off)}, the machine's own M-codes; left out: those of the control alone.
    Returns:
        PostedMoves.
    Raises:
        ReadError: the control would refuse the text or might do something else; `.rows` holds the line.

    >>> text = "G710 G54\\nG0 X1 Y2 Z3\\nG1 X9 F100\\nCIP X13 Y2 I1=11 J1=4\\nM30"
    >>> moves = read_program(text, work_offsets={}, tool_lengths={})
    >>> moves.end_mm[-1].tolist(), moves.center_mm[-1].round(9).tolist(), moves.line.tolist()
    ([13.0, 2.0, 3.0], [11.0, 2.0, 3.0], [2, 3, 4])
    """
    blocks = blocks_of(text)
    controller = Controller(work_offsets, tool_lengths, RULES, chain, tool_radii, coolants)
    end = controller.run(_Channel(controller).executed(blocks))
    if end is None:
        raise refusal(Complaint("the text stops without a program end", "end it with M30"), blocks[-1])
    refuse_text_after(blocks, end)
    return controller.posted_moves()


class _Channel:
    """The control's own modes, and blocks brought to the words that the controller knows."""

    def __init__(self, controller):
        self.controller = controller
        self.is_evenly = False                  # ORIAXES: rotary axes run evenly under TRAORI
        self.is_positioned = False              # SPOS has taken the spindle to an angle: G331 may turn it
        self.unsaid_beside = {"NORM", "G450", "CFTCP"}      # what G41 and G42 hang on
        self.is_cip = False                     # circles through a point between, until another motion code
        self.smoothing, self.contour, self.distance = "", nan, nan      # G642 and its like; CTOL; ADIS

    def executed(self, blocks):
        """Yield (block, words)."""
        for block in blocks:
            try:
                steps = self._words(block.words[0]) if block.words else [()]
            except Complaint as complaint:
                raise refusal(complaint, block) from None
            for words in steps:
                yield block, words

    def _words(self, said):
        """One tuple of words, or two where a circle leaves the plane in force, or three round a swivelled frame."""
        if "CYCLE800" in said.keywords:
            return self._swivel(said.swivel)
        if "TRAORI" in said.keywords and self.controller.tilted is not None:
            raise Complaint("TRAORI in a frame of CYCLE800", "write CYCLE800() before")
        if said.drilling:
            return self._drill(*said.drilling)
        values, names = dict(said.values), [f"{letter}{number:g}" for letter, number in said.codes]
        if "G4" in names and ("S" in values or "F" not in values):
            raise Complaint("a dwell without its time", "write G4 F and seconds in a block of its own")
        if "CIP" in said.keywords or {"G0", "G1", "G2", "G3"} & set(names):
            self.is_cip = "CIP" in said.keywords
        words = [word for (letter, number), name in zip(said.codes, names) for word in self._code(letter.lower(), number, name)]
        self._beside(names, said.keywords)
        self._position(names, values)
        words += self._path_control(names, values)
        words += self._tool(values, "M6" in names)
        words += [TIP[keyword] for keyword in said.keywords if keyword in TIP]
        self.is_evenly |= "ORIAXES" in said.keywords
        if self.controller.is_tip and not self.is_evenly and {"A", "B", "C"} & values.keys():
            raise Complaint("rotary axes under TRAORI without ORIAXES: between its ends the tool may lean another way",
                            "write ORIAXES behind TRAORI")
        if "TRANS" in said.keywords:
            words += self._no_frame(said)
        if "SUPA" in said.keywords:
            words.append(("g", 53.0))
            if "Z" in values and self.controller.is_length_on and ("g", 49.0) not in words:
                raise Complaint("SUPA leaves the tool length in force", "write D0 in the same block")
        if self.is_cip and {"X", "Y", "Z"} & values.keys():
            return self._circle(words, values)
        return [tuple(words + self._letters(values, names))]

    def _swivel(self, parameters):
        """The frame of CYCLE800, for a tool that stands square to it already; without parameters it is taken back."""
        controller = self.controller
        own = (("g", 43.0), ("h", float(controller.tool))) if controller.is_length_on and controller.tool else ()
        if not parameters:
            return [(("g", 49.0),), (("g", 69.0),), own] if controller.tilted is not None else [()]
        if controller.tilted is not None or controller.is_tip or not controller.rotaries:
            raise Complaint("CYCLE800 in another frame of its own, under TRAORI, or without rotary axes",
                            "write CYCLE800() or TRAFOOF before; read with the machine's rotary axes")
        if not own:
            raise Complaint("CYCLE800 without a tool length", "write D1 before")
        frame, side = swivelled(parameters, controller.length_unit_mm())
        refuse_other_side(controller.chain, controller.turned, frame, side)
        controller.asked_plane = frame
        return [(("g", 49.0),), (("g", 53.1),), own]

    def _drill(self, name, numbers):
        """One hole where the tool stands; the motion that was in force is again behind it."""
        controller = self.controller
        if controller.plane != 0 or controller.is_tip or not controller.is_absolute or controller.motion not in ("G0", "G1"):
            raise Complaint(f"{name} outside of G17 and G90, under TRAORI, or behind an arc",
                            "write G17, G90 and G0 before")
        unit = controller.length_unit_mm()
        way = drilled(name, numbers, controller.tip[2] / unit, controller.feed / unit)
        return [*way, (("g", 1.0),)] if controller.motion == "G1" else way

    def _code(self, letter, number, name):
        if name in SAME or name in self.controller.own_coolants:
            return [(letter, number)]
        if name in UNITS:
            return [("g", UNITS[name])]
        if name in (*SMOOTHING, "G450"):
            return []
        known = ", ".join([*sorted(SAME), *UNITS, *SMOOTHING])
        raise Complaint(f"unknown word {name}", ADVICE.get(name, f"known are {known}"))

    def _beside(self, names, keywords):
        """How a contour is begun, its corners joined and its feed counted: all by words, for all may stand otherwise."""
        self.unsaid_beside -= {*names, *keywords}
        if {"G41", "G42"} & set(names) and self.unsaid_beside:
            raise Complaint(f"G41 or G42 before {' and '.join(sorted(self.unsaid_beside))}",
                            "write NORM G450 CFTCP before, or the control begins and joins the contour as it was left")

    def _position(self, names, values):
        """SPOS, which G331 and G332 need; M3, M4, M5 and a tool change end it."""
        if {"M3", "M4", "M5", "M6"} & set(names):
            self.is_positioned = False
        if "SPOS" in values:
            values.pop("SPOS")
            self.is_positioned = True
        if {"G331", "G332"} & set(names) and not self.is_positioned:
            raise Complaint("G331 or G332 while the spindle is not positioned", "write SPOS=0 before")

    def _path_control(self, names, values):
        """G642 with how far it may round, where the block says either."""
        mine = [name for name in names if name in SMOOTHING]
        if len(mine) > 1:
            raise Complaint(f"{' and '.join(mine)} in one block", "leave one of them")
        says = bool(mine) or not values.keys().isdisjoint(("CTOL", "ADIS"))
        self.contour, self.distance = values.pop("CTOL", self.contour), values.pop("ADIS", self.distance)
        self.smoothing = (mine or [self.smoothing])[0]
        allowed = {"": None, "G60": 0.0, "G64": None, "G641": self.distance}.get(self.smoothing, self.contour)
        if not (says and self.smoothing):
            return []
        return [("g", 642.0), *([("q", allowed)] if allowed is not None and allowed >= 0 else [])]

    def _tool(self, values, is_change):
        """T as it stands; D as the length of the tool in the spindle."""
        words = [("t", values["T"])] if "T" in values else []
        edge = values.pop("D", None)
        tool = values.pop("T", self.controller.selected or 0) if is_change else self.controller.tool
        values.pop("T", None)
        if edge is None:
            return words
        if edge == 0:
            return [*words, ("g", 49.0)]
        if edge != 1 or not tool:
            raise Complaint(f"D{edge:g}" + ("" if tool else " without a tool in the spindle"),
                            "known are D0 and the first cutting edge D1 of a tool that is in")
        return [*words, ("g", 43.0), ("h", tool)]

    def _no_frame(self, said):
        if {"X", "Y", "Z"} & said.values.keys() or len(said.keywords) > 1:
            raise Complaint("TRANS that shifts the zero", "write TRANS alone, and set the zero by a work offset")
        return [("g", 92.1)]

    def _letters(self, values, names):
        """Values as letters: CR= is R, TURN= whole turns more, the time of G4 its P."""
        out = []
        for name, value in values.items():
            if name in ("I1", "J1", "K1"):
                raise Complaint(f"{name} without CIP", "write CIP, or leave it out")
            if name == "TURN":
                out.append(("p", value + 1))
            elif name == "F" and "G4" in names:
                out.append(("p", value))
            else:
                out.append(("r" if name == "CR" else name.lower(), value))
        return out

    def _circle(self, words, values):
        """CIP: through I1 J1 K1 to X Y Z, in one of the three planes."""
        controller = self.controller
        if not controller.is_absolute or {"I", "J", "K", "CR", "TURN"} & values.keys():
            raise Complaint("CIP under G91, or with another centre or turns", "give X Y Z and I1= J1= K1= under G90")
        unit = controller.length_unit_mm()
        start = [v / unit for v in controller.tip]
        through = [values.pop(name, start[k]) for k, name in enumerate(("I1", "J1", "K1"))]
        end = [values.pop(name, start[k]) for k, name in enumerate("XYZ")]
        plane, is_clockwise, center = arc_through(start, through, end)
        a, b, _ = plane.axes
        codes = [w for w in words if w[0] != "g" or w[1] not in (17.0, 18.0, 19.0)]
        move = [("g", 17.0 + plane), ("g", 2.0 if is_clockwise else 3.0), *zip("xyz", end),
                *(("ijk"[k], center[k] - start[k]) for k in (a, b))]
        return [tuple([*codes, *move, *self._letters(values, ())]), (("g", 17.0 + controller.plane),)]
