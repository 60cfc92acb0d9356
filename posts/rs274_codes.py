"""The G and M codes the reader knows: modal group, place in the order of execution, letters they take.

LinuxCNC executes the words of a block in its own order, whatever order they are written in.
"""

from typing import NamedTuple

from cuspline.posts.rs274_expressions import Complaint

ORDER = ("feed mode", "feed", "speed", "select tool", "tool change", "spindle", "coolant", "plane",
         "units", "cutter compensation", "tool length", "work offset", "path control", "corner mode", "distance",
         "reference", "arc distance", "canned cycle", "non-modal", "motion", "move", "stopping")


class Code(NamedTuple):
    """One code; no two of a group may stand in one block."""

    name: str
    group: str
    takes: frozenset = frozenset()

    @property
    def order(self):
        return ORDER.index(self.group)


def _codes(group, *names, takes=""):
    return {name: Code(name, group, frozenset(takes)) for name in names}


ARC_LETTERS = "ijkrp"
BY_NAME = {
    **_codes("motion", "G0", "G1"),
    **_codes("motion", "G2", "G3", takes=ARC_LETTERS),
    **_codes("non-modal", "G4", takes="p"),
    **_codes("non-modal", "G53", "G92.1"),
    **_codes("plane", "G17", "G18", "G19"),
    **_codes("units", "G20", "G21"),
    **_codes("cutter compensation", "G40"),
    **_codes("tool length", "G43", takes="h"),
    **_codes("tool length", "G43.1", takes="z"),
    **_codes("tool length", "G49"),
    **_codes("work offset", "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"),
    **_codes("path control", "G61", "G61.1"),
    **_codes("path control", "G64", takes="pq"),
    **_codes("canned cycle", "G80"),
    **_codes("distance", "G90", "G91"),
    **_codes("arc distance", "G90.1", "G91.1"),
    **_codes("feed mode", "G93", "G94"),
    **_codes("stopping", "M0", "M1", "M2", "M30"),
    **_codes("spindle", "M3", "M4", "M5"),
    **_codes("tool change", "M6"),
    **_codes("coolant", "M7", "M8", "M9"),
}
BY_WORD = {(name[0].lower(), float(name[1:])): code for name, code in BY_NAME.items()}
BY_LETTER = {"f": Code("F", "feed"), "s": Code("S", "speed"), "t": Code("T", "select tool")}
MOVE = Code("move", "move")
TAKEN_ALWAYS = frozenset(BY_LETTER)
MOVING_LETTERS = frozenset("xyzijkr")
TAKEN_BY_MOTION = {"": TAKEN_ALWAYS | MOVING_LETTERS} | {
    name: TAKEN_ALWAYS | set("xyz") | BY_NAME[name].takes for name in ("G0", "G1", "G2", "G3")}
ADVICE = {
    ("g", 41): "let the post write the compensated path",
    ("g", 42): "let the post write the compensated path",
    ("g", 92): "use a work offset, G54 to G59.3",
    ("g", 28): "use G53 G0 with machine coordinates",
    ("g", 30): "use G53 G0 with machine coordinates",
}


def code_of(letter, number):
    """The code of a G or M word.

    Raises:
        Complaint: this reader does not know it.
    """
    try:
        return BY_WORD[letter, number]
    except KeyError:
        known = ", ".join(name for name in BY_NAME if name[0] == letter.upper())
        raise Complaint(f"unknown word {letter.upper()}{number:g}",
                        ADVICE.get((letter, int(number)), f"known are {known}")) from None


def in_order(codes):
    """The codes of one block in the order of execution.

    Raises:
        Complaint: two of one modal group.
    """
    ordered = sorted(codes, key=lambda code: code.order)
    for one, other in zip(ordered, ordered[1:]):
        if one.group == other.group:
            raise Complaint(f"{one.name} and {other.name} in one block, both of the group {one.group}",
                            "leave one of them, or write two blocks")
    return ordered
