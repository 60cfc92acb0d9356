"""The G and M codes of Fanuc's milling controls that the reader knows, with the groups they share with RS-274."""

from cuspline.posts.readers.rs274_codes import ARC_LETTERS, COMPENSATION_CODES, CYCLE_CODES, TAP_CODES, finder, named_codes

BY_NAME = {
    **named_codes("motion", "G0", "G1", says="canned cycle"),
    # no P turns: one turn at most
    **named_codes("motion", "G2", "G3", takes=ARC_LETTERS.replace("p", ""), says="canned cycle"),
    **CYCLE_CODES,
    **TAP_CODES,
    **COMPENSATION_CODES,
    **named_codes("rigid tapping", "M29"),
    **named_codes("non-modal", "G4", takes="px"),
    **named_codes("plane", "G17", "G18", "G19"),
    **named_codes("units", "G20", "G21"),
    **named_codes("reference", "G28", takes="xyz"),
    **named_codes("tilted plane", "G68.2", takes="xyzijk"),
    **named_codes("tilted plane", "G53.1", "G69"),
    **named_codes("cutter compensation", "G40"),
    **named_codes("tool length", "G43", "G43.4", takes="h"),
    **named_codes("tool length", "G49"),
    **named_codes("non-modal", "G52", takes="xyz", says="local zero"),
    **named_codes("non-modal", "G53"),
    **named_codes("work offset", "G54", "G55", "G56", "G57", "G58", "G59"),
    **named_codes("corner mode", "G61", "G64"),
    **named_codes("canned cycle", "G80"),
    **named_codes("distance", "G90", "G91"),
    **named_codes("feed mode", "G93", "G94"),
    **named_codes("stopping", "M0", "M1", "M2", "M30"),
    **named_codes("spindle", "M3", "M4", "M5"),
    **named_codes("tool change", "M6"),
    **named_codes("coolant", "M7", "M8", "M9"),
}
code_of = finder(BY_NAME, advice={})
