"""Cycles 200, 201 and 203 of a TNC: what the control does at the place where CYCL CALL or M99 finds the tool.

    Q203 + Q200   set-up clearance over the surface: to it by a rapid, from it at the feed Q206
    Q203 + Q201   bottom, Q201 below 0            200 drills by Q202 at a time: up to the set-up clearance, back to Q200 above the
    Q203 + Q204   second set-up clearance, at         last depth, both by rapids; stands still for Q211 at the bottom
                  the end, where it is the higher  201 reams: up to the set-up clearance at Q208, at Q206 where that is 0
                                                  203 breaks chips: up by Q256 after each Q202, as often as Q213 says

By the TNC 640 User's Manual for Cycle Programming.  Depths count to the tip (Q395 = 0).
"""

from math import ceil

from cuspline.posts.readers.rs274_expressions import Complaint

COMMON = {"Q200", "Q201", "Q206", "Q203", "Q204", "Q211"}
NEEDED = {"200": COMMON | {"Q202", "Q210", "Q395"}, "201": COMMON | {"Q208"},
          "203": COMMON | {"Q202", "Q210", "Q212", "Q213", "Q205", "Q208", "Q256", "Q395"}}
MOST_STROKES = 10_000
EVEN = 1e-9
BELOW_MM = 1e-6             # that is rounding
RAPID = 99999               # of Q208: what FMAX comes to


def checked(cycle, q):
    """The parameters {name: number} of a cycle, as they are.

    Raises:
        Complaint: one is missing, one too many, or one that makes no sense or is not read.
    """
    if q.keys() != NEEDED[cycle]:
        odd = sorted(q.keys() ^ NEEDED[cycle])
        raise Complaint(f"cycle {cycle} without all of its parameters, or with others ({', '.join(odd)})",
                        f"write {', '.join(sorted(NEEDED[cycle]))}")
    if not q["Q200"] > 0 or not q["Q201"] < 0 or not q["Q206"] > 0 or q["Q211"] < 0 or q["Q204"] < 0:
        raise Complaint(f"cycle {cycle} with a parameter that makes no sense",
                        "write Q200 and Q206 above 0, Q201 below 0, Q204 and Q211 no less than 0")
    if q.get("Q210") or q.get("Q212") or q.get("Q205") or q.get("Q395"):
        raise Complaint(f"cycle {cycle} that stands still at the top, lessens its strokes or counts to the full diameter",
                        "write 0 for Q210, Q212, Q205 and Q395")
    if "Q202" in q and not 0 < -q["Q201"] / max(q["Q202"], EVEN) <= MOST_STROKES:
        raise Complaint(f"cycle {cycle} with strokes of {q['Q202']:g}", "write a larger Q202")
    if cycle == "203" and (q["Q213"] < _strokes(q) - 1 or not q["Q256"] > 0):
        raise Complaint("cycle 203 that comes up between its strokes, or breaks no chips",
                        "write Q213 no less than its strokes and Q256 above 0, or take cycle 200")
    return q


def _strokes(q):
    return ceil(-q["Q201"] / q["Q202"] - EVEN)


def drilled(cycle, q, here_z):
    """Words, a tuple a block, of one hole; `q` in the program's unit, `here_z`: where the tool stands, in the same.

    Raises:
        Complaint: the tool stands below the set-up clearance.
    """
    top, begin, bottom = q["Q203"], q["Q203"] + q["Q200"], q["Q203"] + q["Q201"]
    if here_z < begin - BELOW_MM:
        raise Complaint(f"cycle {cycle} is called below its set-up clearance", "go up before")
    feed = ("f", q["Q206"])
    stands = [(("g", 4.0), ("p", q["Q211"]))] if q["Q211"] else []
    way = [(("g", 0.0), ("z", begin))]
    if cycle == "201":
        return [*way, (("g", 1.0), ("z", bottom), feed), *stands, (("g", 1.0), ("z", begin), ("f", q["Q208"] or q["Q206"])),
                *_left(q, begin)]
    for k in range(1, _strokes(q)):
        z = top - k * q["Q202"]
        way += [(("g", 1.0), ("z", z), feed)]
        way += [(("g", 0.0), ("z", z + q["Q256"]))] if cycle == "203" else [(("g", 0.0), ("z", begin)),
                                                                           (("g", 0.0), ("z", z + q["Q200"]))]
    way += [(("g", 1.0), ("z", bottom), feed), *stands]
    if cycle == "203" and q["Q208"] < RAPID:
        way += [(("g", 1.0), ("z", begin), ("f", q["Q208"] or q["Q206"]))]
    return [*way, *_left(q, begin)]


def _left(q, begin):
    """Up to the higher of both clearances."""
    return [(("g", 0.0), ("z", max(begin, q["Q203"] + q["Q204"])))]
