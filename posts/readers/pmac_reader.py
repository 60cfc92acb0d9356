"""Reads a PMAC motion program back into moves: what the control will do.

It knows nothing of any post.  What it does not know it refuses, with the line and the remedy.  Facts by the PMAC User's Manual and
Software Reference; G, M, S and T are taken for what an integrator's PROG 1000 to 1002 commonly make of them.  PMAC makes a spiral
of a circle whose radii differ: beyond 0.005 mm it is refused.  How far blended moves leave their corners is the set-up's (TA, TS).
"""

import re
from math import nan

from cuspline.posts.readers.rs274_arcs import CLOSE_BOUNDS
from cuspline.posts.readers.rs274_blocks import Block, lines_cut, refusal, refuse_block_delete
from cuspline.posts.readers.rs274_codes import ARC_LETTERS, finder, named_codes
from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.posts.readers.rs274_flow import refuse_text_after
from cuspline.posts.readers.rs274_modes import Rules
from cuspline.posts.readers.rs274_reader import Controller

LONGEST_LINE = 255
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
OPEN = re.compile(r"OPEN\s+PROG\s*(\d+)(\s+CLEAR)?")
TOKEN = re.compile(rf"(RAPID|RPD|LINEAR|LIN|CIRCLE[12]|CIR[12]|(?:NORMAL|NRM)\s+[IJK]-1|(?:ABS|INC)(?:\s*\(R\))?|CC0|"
                   rf"(?:DWELL|DWE|DELAY|DLY|TA|TS)\s*{NUMBER})(?![A-Z])|([XYZIJKRFSTGMHN])({NUMBER})(?![\d.]|\s*=)")
DWELL = re.compile("DWELL|DWE|DELAY|DLY")
WORDS = {"RAPID": ("g", 0.0), "RPD": ("g", 0.0), "LINEAR": ("g", 1.0), "LIN": ("g", 1.0), "CIRCLE1": ("g", 2.0), "CIR1": ("g", 2.0),
         "CIRCLE2": ("g", 3.0), "CIR2": ("g", 3.0), "K-1": ("g", 17.0), "J-1": ("g", 18.0), "I-1": ("g", 19.0), "ABS": ("g", 90.0),
         "INC": ("g", 91.0), "ABS(R)": ("g", 90.1), "INC(R)": ("g", 91.1), "CC0": ("g", 40.0)}
CALLED = frozenset((20.0, 21.0, 43.0, 49.0, 53.0, 54.0, 55.0, 56.0, 57.0, 58.0, 59.0))
BY_NAME = {
    **named_codes("motion", "G0", "G1"),
    **named_codes("motion", "G2", "G3", takes=ARC_LETTERS.replace("p", "")),
    **named_codes("non-modal", "G4", takes="p"),    # no word of the control: DWELL
    **named_codes("non-modal", "G53"),
    **named_codes("plane", "G17", "G18", "G19"),
    **named_codes("units", "G20", "G21"),
    **named_codes("cutter compensation", "G40"),
    **named_codes("tool length", "G43", takes="h"),
    **named_codes("tool length", "G49"),
    **named_codes("work offset", "G54", "G55", "G56", "G57", "G58", "G59"),
    **named_codes("canned cycle", "G80"),           # no word of the control: no motion in force
    **named_codes("distance", "G90", "G91"),
    **named_codes("arc distance", "G90.1", "G91.1"),
    **named_codes("stopping", "M0", "M1", "M2", "M30"),
    **named_codes("spindle", "M3", "M4", "M5"),
    **named_codes("tool change", "M6"),
    **named_codes("coolant", "M7", "M8", "M9"),
}
RULES = Rules(code_of=finder(BY_NAME, {}), takes_own_length=False, moves_z_alone=False, path_tolerance_mm=nan, dwell_unit_s=1e-3,
              modes=frozenset(("distance", "work offset", "cutter compensation", "tool length", "plane", "arc distance")),
              bounds=(CLOSE_BOUNDS, CLOSE_BOUNDS),
              words={"distance": ("ABS", "whether axis words are places or distances"),
                     "cutter compensation": ("CC0", "whether the path is shifted by a cutter radius"),
                     "plane": ("NORMAL K-1", "the plane of the circle"),
                     "arc distance": ("INC (R)", "whether I J K are places or distances")})


def read_program(text, *, work_offsets, tool_lengths, coolants=None):
    """The moves of a PMAC motion program.

    Args:
        text: from OPEN PROG to CLOSE.
        work_offsets: {"G54": (x, y, z)} machine coordinates of each zero, mm.
        tool_lengths: {number: length, mm}.
        coolants: {"M88": (values.coolants.BITS on, off)}, the machine's own M-codes; left out: those of the control alone.
    Returns:
        PostedMoves.
    Raises:
        ReadError: the control would refuse the text or might do something else; `.rows` holds the line.

    >>> text = "OPEN PROG 1 CLEAR\\nG21 G54\\nRAPID X1 Y2 Z3\\nNORMAL K-1\\nCIRCLE2 X3 I1 F100\\nCLOSE"
    >>> moves = read_program(text, work_offsets={}, tool_lengths={})
    >>> moves.center_mm[-1].tolist(), moves.line.tolist(), moves.ended
    ([2.0, 2.0, 3.0], [3, 5], True)
    """
    blocks = lines_cut(text, _block, LONGEST_LINE)
    controller = Controller(work_offsets, tool_lengths, RULES, coolants=coolants)
    end = controller.run(_executed(blocks))
    if end is None or not any(block.flow == "%" for block in blocks[-3:]):
        raise refusal(Complaint("the text has no CLOSE at its end", "write CLOSE behind the program"), blocks[-1])
    refuse_text_after(blocks, end)
    return controller.posted_moves()


def _executed(blocks):
    """Yield (block, words): the buffer is opened once, closed once behind, and perhaps once before."""
    is_open = False
    for block in blocks:
        if block.flow == "open" and not is_open:
            is_open = True
        elif block.flow == "%" and is_open:
            yield block, (("m", 30.0),)
        elif block.flow == "open" or block.words and not is_open:
            raise refusal(Complaint("a second OPEN PROG" if is_open else "text before OPEN PROG",
                                    "begin with OPEN PROG, its number and CLEAR, once"), block)
        elif not block.flow:
            try:
                steps = _steps(block.words)
            except Complaint as complaint:
                raise refusal(complaint, block) from None
            yield from ((block, words) for words in steps)


def _steps(words):
    """G53 is a call that moves by itself, rapidly, and leaves a motion mode that nobody knows."""
    if ("g", 4.0) in words and len(words) > 2:
        raise Complaint("a dwell beside other words: whether it comes before or behind them", "give DWELL a line of its own")
    if ("g", 53.0) not in words:
        return [words]
    if any(letter == "g" and value <= 3.0 for letter, value in words):
        raise Complaint("G53 beside a motion", "give the call G53 a block of its own")
    return [(*words, ("g", 0.0)), (("g", 80.0),)]


def _block(number, line):
    code, _, comment = line.partition(";")
    block = Block(number, line, comments=(comment,) if comment else ())
    code = code.strip().upper()
    refuse_block_delete(code)
    if code == "CLOSE":
        return block._replace(flow="%")
    if found := OPEN.fullmatch(code):
        if not found[2]:
            raise Complaint("OPEN PROG without CLEAR: the program would be added to what is there", "write CLEAR behind it")
        return block._replace(flow="open")
    return block._replace(words=tuple(_words(code)))


def _words(code):
    words, at = [], 0
    while at < len(code):
        if code[at].isspace():
            at += 1
            continue
        found = TOKEN.match(code, at)
        if not found:
            raise Complaint(f'"{code[at:]}" is nothing that this reader knows',
                            "known are RAPID, LINEAR, CIRCLE1, CIRCLE2, NORMAL, ABS, INC, CC0, DWELL, DELAY, TA, TS, letters with "
                            "numbers")
        words += _word("".join((found[1] or "").split()), found[2], found[3])
        at = found.end()
    return words


def _word(command, letter, number):
    """[(letter, value)] of one command or word; none of what moves nothing, and of a dwell of nothing."""
    if dwell := DWELL.match(command):
        return [("g", 4.0), ("p", float(command[dwell.end():]))] if float(command[dwell.end():]) else []
    if letter == "N" or command.startswith(("TA", "TS")):
        return []
    if letter is None:
        return [WORDS[command.removeprefix("NORMAL").removeprefix("NRM")]]
    if letter == "G" and float(number) not in CALLED:
        raise Complaint(f"unknown word G{number}",
                        "known are G20, G21, G43, G49, G53 and G54 to G59: what moves is RAPID, LINEAR and CIRCLE")
    return [(letter.lower(), float(number))]
