"""The G and M codes the reader knows: modal group, place in the order of execution, letters they take.

LinuxCNC executes the words of a block in its own order, whatever order they are written in.
"""

from typing import NamedTuple

from cuspline.posts.readers.rs274_expressions import Complaint

ORDER = ("kinematics", "tilted plane", "feed mode", "feed", "speed", "select tool", "tool change", "spindle", "coolant", "plane",
         "units", "cutter compensation", "tool length", "work offset", "path control", "corner mode", "distance",
         "reference", "arc distance", "return level", "rigid tapping", "canned cycle", "non-modal", "motion", "move", "stopping")


class Code(NamedTuple):
    """One code; no two of a group may stand in one block."""

    name: str
    group: str
    takes: frozenset = frozenset()
    says: str = ""              # mode that it settles beside that of its group

    @property
    def order(self):
        return ORDER.index(self.group)


def named_codes(group, *names, takes="", says=""):
    return {name: Code(name, group, frozenset(takes), says) for name in names}


ARC_LETTERS = "ijkrp"
CYCLE_CODES = {
    **named_codes("motion", "G81", "G85", takes="r", says="canned cycle"),
    **named_codes("motion", "G82", takes="rp", says="canned cycle"),
    **named_codes("motion", "G73", "G83", takes="rq", says="canned cycle"),
    **named_codes("return level", "G98", "G99"),
}
TAP_CODES = named_codes("motion", "G74", "G84", takes="r", says="canned cycle")
COMPENSATION_CODES = named_codes("cutter compensation", "G41", "G42", takes="d")
BY_NAME = {
    **named_codes("motion", "G0", "G1", says="canned cycle"),
    **named_codes("motion", "G2", "G3", takes=ARC_LETTERS, says="canned cycle"),
    **COMPENSATION_CODES,
    **named_codes("motion", "G33.1", takes="k", says="canned cycle"),
    **CYCLE_CODES,
    **named_codes("non-modal", "G4", takes="p"),
    **named_codes("non-modal", "G53"),
    **named_codes("non-modal", "G92.1", says="axis offset"),
    **named_codes("plane", "G17", "G18", "G19"),
    **named_codes("units", "G20", "G21"),
    **named_codes("cutter compensation", "G40"),
    **named_codes("tool length", "G43", takes="h"),
    **named_codes("tool length", "G43.1", takes="z"),
    **named_codes("tool length", "G49"),
    **named_codes("work offset", "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"),
    **named_codes("path control", "G61", "G61.1"),
    **named_codes("path control", "G64", takes="pq"),
    **named_codes("canned cycle", "G80"),
    **named_codes("distance", "G90", "G91"),
    **named_codes("arc distance", "G90.1", "G91.1"),
    **named_codes("feed mode", "G93", "G94"),
    **named_codes("stopping", "M0", "M1", "M2", "M30"),
    **named_codes("spindle", "M3", "M4", "M5"),
    **named_codes("tool change", "M6"),
    **named_codes("coolant", "M7", "M8", "M9"),
    # LinuxCNC's switched kinematics: remapped, or by the output and the wait that these stand for
    **named_codes("kinematics", "M428", "M429"),
    **named_codes("kinematics", "M68", takes="eq"),
    **named_codes("kinematics", "M66", takes="el"),
}
BY_LETTER = {"f": Code("F", "feed"), "s": Code("S", "speed"), "t": Code("T", "select tool")}
MOVE = Code("move", "move")
TAKEN_ALWAYS = frozenset(BY_LETTER)
MOVING_LETTERS = frozenset("xyzijkr")
ADVICE = {
    ("g", 74): "its spindle is not tied to the feed: write G33.1 under M4",
    ("g", 84): "its spindle is not tied to the feed: write G33.1",
    ("g", 92): "use a work offset, G54 to G59.3",
    ("g", 28): "use G53 G0 with machine coordinates",
    ("g", 30): "use G53 G0 with machine coordinates",
}


def finder(by_name, advice):
    """The function (letter, number) -> Code of a G or M word; what is not in the table it refuses with a Complaint.

    Args:
        by_name: {"G0": Code} of what a controller knows.
        advice: {("g", 41): how to mend it} for some of what it does not know.
    """
    by_word = {(name[0].lower(), float(name[1:])): code for name, code in by_name.items()}

    def code_of(letter, number):
        try:
            return by_word[letter, number]
        except KeyError:
            known = ", ".join(name for name in by_name if name[0] == letter.upper())
            raise Complaint(f"unknown word {letter.upper()}{number:g}",
                            advice.get((letter, int(number)), f"known are {known}")) from None
    return code_of


code_of = finder(BY_NAME, ADVICE)


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
