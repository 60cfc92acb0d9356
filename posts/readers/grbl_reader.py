"""Reads a Grbl 1.1 program back into moves: what the control will do.

It knows nothing of any post.  What it does not know it refuses, with the line and the remedy.  Facts by Grbl's documentation and
source: a line holds 79 characters beside blanks and comments (error 11); T names the tool that is in, there is no M6; arcs whose
radii differ by more than 0.005 mm and a thousandth, or by more than 0.5 mm, are refused (error 33); the path is run exactly, arcs
as chords within $12.
"""

from math import nan

from cuspline.posts.readers.plain_words import without_brackets, words_of
from cuspline.posts.readers.rs274_arcs import ArcBounds
from cuspline.posts.readers.rs274_blocks import Block, lines_cut, refusal, refuse_block_delete
from cuspline.posts.readers.rs274_codes import finder, named_codes
from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.posts.readers.rs274_flow import refuse_text_after
from cuspline.posts.readers.rs274_modes import UNSAID, Rules
from cuspline.posts.readers.rs274_reader import Controller

LONGEST_CODE = 79
LARGEST_TOOL = 255
LETTERS = frozenset("xyzijkrpfstgmn")
BOUNDS = ArcBounds(radius_error_mm=0.005, largest_error_mm=0.5, smallest_radius_mm=1e-6)
BY_NAME = {
    **named_codes("motion", "G0", "G1", says="canned cycle"),
    **named_codes("motion", "G2", "G3", takes="ijkr", says="canned cycle"),
    **named_codes("non-modal", "G4", takes="p"),
    **named_codes("non-modal", "G53"),
    **named_codes("non-modal", "G92.1", says="axis offset"),
    **named_codes("plane", "G17", "G18", "G19"),
    **named_codes("units", "G20", "G21"),
    **named_codes("cutter compensation", "G40"),
    **named_codes("tool length", "G43.1", takes="z"),
    **named_codes("tool length", "G49"),
    **named_codes("work offset", "G54", "G55", "G56", "G57", "G58", "G59"),
    **named_codes("path control", "G61"),
    **named_codes("canned cycle", "G80"),
    **named_codes("distance", "G90", "G91"),
    **named_codes("arc distance", "G91.1"),
    **named_codes("feed mode", "G93", "G94"),
    **named_codes("stopping", "M0", "M2", "M30"),
    **named_codes("spindle", "M3", "M4", "M5"),
    **named_codes("coolant", "M7", "M8", "M9"),
}
ADVICE = {("m", 6): "Grbl changes no tool: give every tool a program of its own", ("m", 1): "Grbl passes over it: write M0",
          ("g", 43): "Grbl has no tool table: write G43.1 Z with the length", ("g", 64): "Grbl has the exact path alone: G61",
          **{("g", cycle): "Grbl has no canned cycles: write the moves out" for cycle in range(73, 90)}}


def _take_tool(controller, name, values):
    """T names the tool that was put in by hand."""
    if values["t"] > LARGEST_TOOL or values["t"] != int(values["t"]):
        raise Complaint(f"T{values['t']:g}", f"Grbl counts whole tools up to {LARGEST_TOOL}")
    controller.select_tool(name, values)
    if controller.tool not in (0, controller.selected):
        raise Complaint("another T in one program", "Grbl changes no tool: give every tool a program of its own")
    if not controller.tool:
        controller.tool = controller.selected


def _exact(controller, name, values):
    """G61, the only mode that Grbl has: chords within $12."""


RULES = Rules(code_of=finder(BY_NAME, ADVICE), modes=frozenset(UNSAID) - {"canned cycle", "local zero", "path control"},
              takes_own_length=False, moves_z_alone=True, path_tolerance_mm=nan, bounds=(BOUNDS, BOUNDS),
              words={"tool length": ("G43.1 Z", "which tool length is in force")},
              actions={"select tool": _take_tool, "path control": _exact})


def read_program(text, *, work_offsets, tool_lengths, coolants=None):
    """The moves of a Grbl program.

    Args:
        text: the whole program.
        work_offsets: {"G54": (x, y, z)} machine coordinates of each WCS origin, mm.
        tool_lengths: {number: length, mm}, which G43.1 Z is held against.
        coolants: {"M88": (values.coolants.BITS on, off)}, the machine's own M-codes; left out: those of the control alone.
    Returns:
        PostedMoves.
    Raises:
        ReadError: the control would refuse the text or might do something else; `.rows` holds the line.

    >>> moves = read_program("G21 G54\\nG0 X1 Y2 Z3\\nG1 X9 F100\\nM30", work_offsets={}, tool_lengths={})
    >>> moves.end_mm[-1].tolist(), moves.line.tolist()
    ([9.0, 2.0, 3.0], [2, 3])
    """
    blocks = lines_cut(text, _block)
    controller = Controller(work_offsets, tool_lengths, RULES, coolants=coolants)
    end = controller.run((block, block.words) for block in blocks)
    if end is None:
        raise refusal(Complaint("the text stops without a program end", "end it with M2 or M30"), blocks[-1])
    refuse_text_after(blocks, end)
    return controller.posted_moves()


def _block(number, line):
    code, comments = without_brackets(line)
    refuse_block_delete(code)
    if len(code) > LONGEST_CODE:
        raise Complaint(f"{len(code)} characters beside blanks and comments", f"Grbl takes {LONGEST_CODE}: split the block")
    if code.startswith("$"):
        raise Complaint("a command to the control's settings", "programs hold blocks alone")
    words = words_of(code, LETTERS)
    if words and words[0][0] == "n":
        words = words[1:]
    return Block(number, line, words, comments=comments)
