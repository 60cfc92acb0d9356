"""CYCLE81, 82, 83 and 85 of a Sinumerik: what the control does at the place where the tool stands.

    RTP     retraction plane: up to it by a rapid at the end      CYCLE81(RTP, RFP, SDIS, DP, DPR)
    RFP     reference plane, SDIS above it begins the feed        CYCLE82(..., DTB)          stands still at the bottom, seconds
    DP      bottom, or DPR below RFP                              CYCLE85(..., DTB, FFR, RFF)     down at FFR, up to SDIS at RFF
    CYCLE83(..., FDEP, FDPR, DAM, DTB, DTS, FRF, VARI, AXN, MDEP, VRT, DTD, DIS1)
        strokes as deep as the first, counted from RFP; VARI 1: up to SDIS and back to DIS1 above the last depth, by rapids;
        VARI 0: up by VRT at the feed.  What the last two strokes are the manual says for a degression: none is read, nor are
        strokes that do not divide the depth evenly.

By the SINUMERIK 840D sl Programming Manual, cycles.
"""

from math import ceil

from cuspline.posts.readers.rs274_expressions import Complaint

LONGEST = {"CYCLE81": 5, "CYCLE82": 6, "CYCLE83": 17, "CYCLE85": 8}
TOOL_AXIS = 3               # of AXN: Z under G17; left out it is that too
UNEVEN = 0.02               # of a stroke, by which the last may be shorter: rounding of the word
EVEN = 1e-9
MOST_STROKES = 10_000
BELOW_MM = 1e-6             # that is rounding


def drilled(name, numbers, here_z, feed):
    """Words, a tuple a block, of one hole.

    Args:
        name: of LONGEST.   numbers: between its brackets, None where one is left out.
        here_z: where the tool stands, and `feed`: in force, both in the program's unit.
    Raises:
        Complaint: a parameter that is missing, makes no sense, or that the manual leaves open.
    """
    if len(numbers) > LONGEST[name]:
        raise Complaint(f"{name} with {len(numbers)} parameters", f"write at most {LONGEST[name]} of them")
    given = [*numbers, *[None] * (LONGEST[name] - len(numbers))]
    retract, reference, apart, bottom = _planes(name, given)
    begin = reference + apart
    if here_z < begin - BELOW_MM:
        raise Complaint(f"{name} is called below RFP and SDIS", "go up before")
    way = [(("g", 0.0), ("z", begin))]
    if name == "CYCLE83":
        way += _pecked(given, reference, begin, bottom)
    elif name == "CYCLE85":
        down, up = (_positive(given[k], "CYCLE85", what) for k, what in ((6, "FFR"), (7, "RFF")))
        way += [(("g", 1.0), ("z", bottom), ("f", down)), *_stands(given[5]), (("g", 1.0), ("z", begin), ("f", up)),
                *([(("f", feed),)] if feed else [])]
    else:
        way += [(("g", 1.0), ("z", bottom)), *(_stands(given[5]) if name == "CYCLE82" else [])]
    return [*way, (("g", 0.0), ("z", retract))]


def _planes(name, given):
    """(RTP, RFP, SDIS, bottom)."""
    retract, reference, apart, bottom, deep = given[:5]
    if None in (retract, reference) or (bottom is None) == (deep is None):
        raise Complaint(f"{name} without RTP and RFP, or without one of DP and DPR", f"write {name}(RTP,RFP,SDIS,DP")
    bottom = reference - deep if bottom is None else bottom
    apart = apart or 0.0
    if apart < 0 or retract < reference + apart - BELOW_MM or not reference > bottom:
        raise Complaint(f"{name} whose planes are not one over the other", "RTP no lower than RFP and SDIS, RFP above the bottom")
    return retract, reference, apart, bottom


def _stands(seconds):
    """The dwell at the bottom; below 0 it would be turns of the spindle."""
    if seconds is not None and seconds < 0:
        raise Complaint("a dwell in turns of the spindle", "write DTB in seconds")
    return [(("g", 4.0), ("p", seconds))] if seconds else []


def _positive(value, name, what):
    if value is None or not value > 0:
        raise Complaint(f"{name} without {what}", f"write {what} above 0")
    return value


def _pecked(given, reference, begin, bottom):
    """Strokes of CYCLE83."""
    first_at, first, degression, at_depth, at_top, factor, kind, axis, least, back, at_bottom, off = given[5:]
    if (first_at is None) == (first is None):
        raise Complaint("CYCLE83 without its first depth, or with two", "write one of FDEP and FDPR")
    stroke = reference - first_at if first is None else first
    _refuse_open(degression, at_depth, at_top, factor, axis, least)
    if kind not in (0, 1, None):
        raise Complaint(f"CYCLE83 with VARI {kind:g}", "write 0 to break chips, 1 to bring them up")
    depth = reference - bottom
    count = ceil(depth / stroke - EVEN) if stroke > 0 else MOST_STROKES + 1
    if not 0 < count <= MOST_STROKES:
        raise Complaint("CYCLE83 whose first depth is not below RFP, or with strokes beyond count", "write a larger first depth")
    if count > 1 and count * stroke - depth > UNEVEN * stroke:
        raise Complaint("CYCLE83 whose strokes do not divide the depth evenly: how the last ones are shared out is open",
                        "write a first depth that goes into the depth a whole number of times")
    is_up = kind == 1
    apart = _positive(off if is_up else back, "CYCLE83", "DIS1" if is_up else "VRT") if count > 1 else 0.0
    way = []
    for k in range(1, count):
        z = reference - k * stroke
        way += [(("g", 1.0), ("z", z))]
        way += [(("g", 0.0), ("z", begin)), (("g", 0.0), ("z", z + apart))] if is_up else [(("g", 1.0), ("z", z + apart))]
    return [*way, (("g", 1.0), ("z", bottom)), *_stands(at_bottom)]


def _refuse_open(degression, at_depth, at_top, factor, axis, least):
    """What changes strokes, or stands still among them, is not read."""
    if degression or at_depth or at_top or least:
        raise Complaint("CYCLE83 with DAM, DTB, DTS or MDEP", "write 0 for them, or leave them out")
    if factor not in (None, 1):
        raise Complaint("CYCLE83 with another feed on its first stroke", "write 1 for FRF")
    if axis not in (None, 0, TOOL_AXIS):
        raise Complaint(f"CYCLE83 along axis {axis:g}", "leave AXN out under G17")
