"""Reads a Haas mill's text back into moves: what the control will do.

It knows nothing of any post.  What it does not know it refuses, with the line and the remedy.  Facts by the Haas Mill Operator's
Manual: G28 switches the tool length off for what follows, G53 heeds it not; G187 E bounds how far corners are rounded, without E
setting 85 does; G84 and G74 tie the spindle to the feed and start it themselves; G52 counts by setting 33, so that only taking it
back is read.  M0 and M1 stop spindle and coolant.  G234 ties X Y Z to the tip and ends with G49, G254 carries the zero with the
table until G255, and wants X Y Z named anew.  Which radii an arc may have at its ends the manual does not say: they are held to
0.005 mm.
"""

from math import isfinite, nan, radians

from cuspline.posts.readers.cutter_compensation import Compensation
from cuspline.posts.readers.fanuc_flow import executed
from cuspline.posts.readers.fanuc_tools import read_tool_table
from cuspline.posts.readers.haas_blocks import blocks_of
from cuspline.posts.readers.rs274_arcs import CLOSE_BOUNDS
from cuspline.posts.readers.rs274_blocks import refusal
from cuspline.posts.readers.rs274_codes import ARC_LETTERS, COMPENSATION_CODES, CYCLE_CODES, TAP_CODES, finder, named_codes
from cuspline.posts.readers.rs274_cycles import EVERY
from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.posts.readers.rs274_modes import UNSAID, Rules
from cuspline.posts.readers.rs274_reader import Controller
from cuspline.values.errors import PostError

__all__ = ["read_program", "read_tool_table"]

BY_NAME = {
    **named_codes("motion", "G0", "G1", says="canned cycle"),
    **named_codes("motion", "G2", "G3", takes=ARC_LETTERS.replace("p", ""), says="canned cycle"),
    **CYCLE_CODES,
    **TAP_CODES,
    **COMPENSATION_CODES,
    **named_codes("return level", "G98", "G99"),
    **named_codes("non-modal", "G4", takes="p"),
    **named_codes("plane", "G17", "G18", "G19"),
    **named_codes("units", "G20", "G21"),
    **named_codes("reference", "G28", takes="xyz"),
    **named_codes("cutter compensation", "G40"),
    **named_codes("tool length", "G43", "G234", takes="h"),
    **named_codes("tool length", "G49"),
    **named_codes("non-modal", "G52", takes="xyz", says="local zero"),
    **named_codes("non-modal", "G53"),
    **named_codes("work offset", "G54", "G55", "G56", "G57", "G58", "G59"),
    **named_codes("corner mode", "G61", "G64"),
    **named_codes("canned cycle", "G80"),
    **named_codes("distance", "G90", "G91"),
    **named_codes("feed mode", "G93", "G94"),
    **named_codes("path control", "G187", takes="pe"),
    **named_codes("tilted plane", "G254", "G255"),
    **named_codes("stopping", "M0", "M1", "M2", "M30"),
    **named_codes("spindle", "M3", "M4", "M5"),
    **named_codes("tool change", "M6"),
    **named_codes("coolant", "M8", "M9"),
}
ADVICE = {("m", 7): "M7 is no mist on a Haas: write M8, or what the machine's maker says"}


def _stop(controller, name, values):
    """M0 and M1 stop the spindle and the coolant too."""
    controller.stop(name, values)
    if name in ("M0", "M1"):
        controller.turn_spindle("M5", values)
        controller.set_coolant("M9", values)


def _smooth(controller, name, values):
    """G187: smoothness P, and E how far corners may be rounded."""
    if "p" in values and values["p"] not in (1, 2, 3):
        raise Complaint(f"G187 P{values['p']:g}", "P is 1 (rough), 2 (medium) or 3 (finish)")
    if not values.get("e", 1.0) > 0:
        raise Complaint("G187 with an E of nothing", "write how far corners may be rounded, above 0")
    controller.rounded_mm = values["e"] * controller.length_unit_mm() if "e" in values else nan
    if controller.path_tolerance_mm != 0.0:
        controller.path_tolerance_mm = controller.rounded_mm


def _corner_mode(controller, name, values):
    """G61 stops at every corner; G64 rounds them as G187 has it."""
    controller.path_tolerance_mm = 0.0 if name == "G61" else controller.rounded_mm


def _go_home(controller, name, values):
    """G28 leaves the tool length off."""
    controller.go_home(name, values)
    if controller.is_length_on:
        controller.set_length("G49", {})


def _set_length(controller, name, values):
    """G234 takes length and tip's control at once, G49 ends both."""
    controller.set_length("G43.4" if name == "G234" else name, values)


def _go_with_table(controller, name, values):
    """G254: the zero goes with the table as it has turned, X Y Z count along the machine's axes; they are to be named anew."""
    if name == "G255":
        controller.tilt_plane("G69", values)
        return
    if controller.tilted is not None or controller.is_tip or controller.is_length_on or not controller.rotaries:
        raise Complaint("G254 in another, under G234 or a tool length, or without rotary axes",
                        "write G49 and G255 before; read with the machine's rotary axes")
    if not isfinite(sum(controller.turned)):
        raise Complaint("G254 while nobody knows where the rotary axes stand", "name every rotary axis by G53 G0 before")
    try:
        controller.asked_plane = controller.chain.linear_axes([radians(a) for a in controller.turned])
    except PostError as error:
        raise Complaint("G254 on this machine", str(error)) from None
    controller.tilt_plane("G53.1", values)
    controller.unnamed = frozenset("xyz")


def _move(controller, name, values):
    """Behind G254 every axis is named before a cut."""
    controller.unnamed -= values.keys()
    if controller.unnamed and controller.motion not in ("", "G0"):
        raise Complaint(f"a cut behind G254 before {' '.join(sorted(controller.unnamed)).upper()} is named",
                        "write G0 X Y, then G43 G0 Z H")
    controller.move(name, values)


RULES = Rules(code_of=finder(BY_NAME, ADVICE), modes=frozenset(UNSAID) - {"arc distance", "axis offset"},
              takes_own_length=False, moves_z_alone=False, path_tolerance_mm=nan, bounds=(CLOSE_BOUNDS, CLOSE_BOUNDS),
              words={"path control": ("G187 E", "how far the control may leave the path")},
              cycles=EVERY, compensation=Compensation(joins_by_arcs=False, needs_register=True),
              actions={"path control": _smooth, "corner mode": _corner_mode, "reference": _go_home,
                       "tool length": _set_length, "tilted plane": _go_with_table, "move": _move, "stopping": _stop})


def read_program(text, *, work_offsets, tool_lengths, chain=None, tool_radii=None, coolants=None):
    """The moves of a Haas program.

    Args:
        text: the whole file: %, the main program, its sub-programs, %.
        work_offsets: {"G54": (x, y, z)} machine coordinates of each WCS origin, mm.
        tool_lengths: {number: length offset, mm}; the control's offset number is the tool's.
        chain: kinematics.Chain of a machine with rotary axes, see rs274_reader; under G234 X Y Z are the tip, in axes that
            go with the table from where it stands with the rotaries at 0; under G254 the tip, along the machine's axes.
        tool_radii: {number: radius in the tool's register, mm} that G41 and G42 shift a contour by; left out: they are refused.
        coolants: {"M88": (values.coolants.BITS on, off)}, the machine's own M-codes; left out: those of the control alone.
    Returns:
        PostedMoves.
    Raises:
        ReadError: the control would refuse the text or might do something else; `.rows` holds the line.

    >>> text = "%\\nO00101\\nG21 G54\\nG0 X1. Y2. Z3.\\nM97 P9\\nM30\\nN9 G1 X9. F100.\\nM99\\n%"
    >>> moves = read_program(text, work_offsets={}, tool_lengths={})
    >>> moves.end_mm[-1].tolist(), moves.line.tolist()
    ([9.0, 2.0, 3.0], [4, 7])
    """
    blocks = blocks_of(text)
    controller = Controller(work_offsets, tool_lengths, RULES, chain, tool_radii, coolants)
    if controller.run(executed(blocks)) is None:
        raise refusal(Complaint("the text stops without a program end", "end the main program with M30"), blocks[-1])
    return controller.posted_moves()
