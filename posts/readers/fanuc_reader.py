"""Reads Fanuc text (custom macro B) back into moves: what the control will do.

It knows nothing of any post.  What it does not know it refuses, with the line and the remedy.  Rapids count as
straight: parameter 1401 bit 1 (LRP) must be 1.
"""

from math import nan

from cuspline.posts.readers.cutter_compensation import Compensation
from cuspline.posts.readers.fanuc_blocks import blocks_of
from cuspline.posts.readers.fanuc_codes import code_of
from cuspline.posts.readers.fanuc_flow import executed
from cuspline.posts.readers.fanuc_tools import read_tool_table
from cuspline.posts.readers.rs274_blocks import refusal
from cuspline.posts.readers.rs274_cycles import EVERY
from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.posts.readers.rs274_modes import UNSAID, Rules
from cuspline.posts.readers.rs274_reader import Controller

__all__ = ["read_program", "read_tool_table"]

# I J K are always distances; how far corners may be cut is a parameter of the control, whichever mode is in force; a
# G92 is taken back by hand, or by an option of the control
RULES = Rules(code_of=code_of, modes=frozenset(UNSAID) - {"arc distance", "path control", "axis offset"},
              takes_own_length=False, moves_z_alone=True, path_tolerance_mm=nan, cycles=EVERY, needs_rigid=True, dwell_unit_s=1e-3,
              compensation=Compensation(joins_by_arcs=False, needs_register=True))


def read_program(text, *, work_offsets, tool_lengths, chain=None, tool_radii=None, coolants=None):
    """The moves of a Fanuc program.

    Args:
        text: the whole file: %, the main program, its sub-programs, %.
        work_offsets: {"G54": (x, y, z)} machine coordinates of each WCS origin, mm.
        tool_lengths: {number: length offset, mm}; the control's offset number is the tool's.
        chain: kinematics.Chain of a machine with rotary axes, see rs274_reader; under G43.4 X Y Z are the tip, in axes that
            go with the table from where it stands with the rotaries at 0.
        tool_radii: {number: radius in the tool's register, mm} that G41 and G42 shift a contour by; left out: they are refused.
        coolants: {"M88": (values.coolants.BITS on, off)}, the machine's own M-codes; left out: those of the control alone.
    Returns:
        PostedMoves.
    Raises:
        ReadError: the control would refuse the text or might do something else; `.rows` holds the line.

    >>> text = "%\\nO0001\\nG21 G54\\nG0 X1. Y2. Z3.\\nG65 P8001 A9.\\nM30\\nO8001\\nG1 X#1 F100.\\nM99\\n%"
    >>> moves = read_program(text, work_offsets={}, tool_lengths={})
    >>> moves.end_mm[-1].tolist(), moves.line.tolist()
    ([9.0, 2.0, 3.0], [4, 8])
    """
    blocks = blocks_of(text)
    controller = Controller(work_offsets, tool_lengths, RULES, chain, tool_radii, coolants)
    if controller.run(executed(blocks)) is None:
        raise refusal(Complaint("the text stops without a program end", "end the main program with M30"), blocks[-1])
    return controller.posted_moves()
