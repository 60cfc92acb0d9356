"""The G and M codes of Fanuc's milling controls that the reader knows, with the groups they share with RS-274."""

from cuspline.posts.rs274_codes import ARC_LETTERS, Code
from cuspline.posts.rs274_expressions import Complaint


def _codes(group, *names, takes=""):
    return {name: Code(name, group, frozenset(takes)) for name in names}


BY_NAME = {
    **_codes("motion", "G0", "G1"),
    **_codes("motion", "G2", "G3", takes=ARC_LETTERS.replace("p", "")),     # no P turns: one turn at most
    **_codes("non-modal", "G4", takes="p"),
    **_codes("plane", "G17", "G18", "G19"),
    **_codes("units", "G20", "G21"),
    **_codes("reference", "G28", takes="xyz"),
    **_codes("cutter compensation", "G40"),
    **_codes("tool length", "G43", takes="h"),
    **_codes("tool length", "G49"),
    **_codes("non-modal", "G53"),
    **_codes("work offset", "G54", "G55", "G56", "G57", "G58", "G59"),
    **_codes("corner mode", "G61", "G64"),
    **_codes("canned cycle", "G80"),
    **_codes("distance", "G90", "G91"),
    **_codes("feed mode", "G94"),
    **_codes("stopping", "M0", "M1", "M2", "M30"),
    **_codes("spindle", "M3", "M4", "M5"),
    **_codes("tool change", "M6"),
    **_codes("coolant", "M7", "M8", "M9"),
}
BY_WORD = {(name[0].lower(), float(name[1:])): code for name, code in BY_NAME.items()}


def code_of(letter, number):
    """The code of a G or M word.

    Raises:
        Complaint: this reader does not know it.
    """
    try:
        return BY_WORD[letter, number]
    except KeyError:
        known = ", ".join(name for name in BY_NAME if name[0] == letter.upper())
        raise Complaint(f"unknown word {letter.upper()}{number:g}", f"known are {known}") from None
