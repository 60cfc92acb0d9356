"""Cycles 200, 201, 203 and 205 of a TNC: what the control does at the place where CYCL CALL or M99 finds the tool.

    Q203 + Q200   set-up clearance over the surface: to it by a rapid, from it at the feed Q206
    Q203 + Q201   bottom, Q201 below 0            200 drills by Q202 at a time: up to the set-up clearance, back to Q200 above the
    Q203 + Q204   second set-up clearance, at         last depth, both by rapids; stands still for Q211 at the bottom
                  the end, where it is the higher  201 reams: up to the set-up clearance at Q208, at Q206 where that is 0
                                                  203 breaks chips: up by Q256 after each Q202, as often as Q213 says
                                                  205 drills by Q202, less by Q212 each time and no less than Q205: up at Q208,
                                                      back to Q258 above the last depth; breaks chips each Q257 between

By the TNC 640 User's Manual for Cycle Programming.  Depths count to the tip (Q395 = 0).  Of 205 is read what the manual leaves no
choice in: one advanced stop distance (Q258 = Q259), no deeper start (Q379 = 0), Q202 a multiple of Q257.
"""

from math import ceil

from cuspline.posts.readers.rs274_expressions import Complaint

COMMON = {"Q200", "Q201", "Q206", "Q203", "Q204", "Q211"}
LATER = {"Q208", "Q395"}        # of 205, which older controls have not
NEEDED = {"200": COMMON | {"Q202", "Q210", "Q395"}, "201": COMMON | {"Q208"},
          "203": COMMON | {"Q202", "Q210", "Q212", "Q213", "Q205", "Q208", "Q256", "Q395"},
          "205": COMMON | {"Q202", "Q212", "Q205", "Q258", "Q259", "Q257", "Q256", "Q379", "Q253", *LATER}}
MOST_STROKES = 10_000
EVEN = 1e-9
BELOW_MM = 1e-6             # that is rounding
RAPID = 99999               # of Q208: what FMAX comes to


def checked(cycle, q):
    """The parameters {name: number} of a cycle, as they are; of an older control's 205 with those that it has not.

    Raises:
        Complaint: one is missing, one too many, or one that makes no sense or is not read.
    """
    if cycle == "205" and not LATER & q.keys():
        q = q | {"Q208": RAPID, "Q395": 0.0}
    if q.keys() != NEEDED[cycle]:
        odd = sorted(q.keys() ^ NEEDED[cycle])
        raise Complaint(f"cycle {cycle} without all of its parameters, or with others ({', '.join(odd)})",
                        f"write {', '.join(sorted(NEEDED[cycle]))}")
    if not q["Q200"] > 0 or not q["Q201"] < 0 or not q["Q206"] > 0 or q["Q211"] < 0 or q["Q204"] < 0:
        raise Complaint(f"cycle {cycle} with a parameter that makes no sense",
                        "write Q200 and Q206 above 0, Q201 below 0, Q204 and Q211 no less than 0")
    if q.get("Q395"):
        raise Complaint(f"cycle {cycle} that counts to the full diameter", "write 0 for Q395")
    if "Q202" in q and not 0 < -q["Q201"] / max(q["Q202"], EVEN) <= MOST_STROKES:
        raise Complaint(f"cycle {cycle} with strokes of {q['Q202']:g}", "write a larger Q202")
    if cycle == "205":
        return _checked_pecking(q)
    if q.get("Q210") or q.get("Q212") or q.get("Q205"):
        raise Complaint(f"cycle {cycle} that stands still at the top or lessens its strokes", "write 0 for Q210, Q212 and Q205")
    if cycle == "203" and (q["Q213"] < ceil(-q["Q201"] / q["Q202"] - EVEN) - 1 or not q["Q256"] > 0):
        raise Complaint("cycle 203 that comes up between its strokes, or breaks no chips",
                        "write Q213 no less than its strokes and Q256 above 0, or take cycle 200")
    return q


def _checked_pecking(q):
    """The same of cycle 205, where it says one thing.

    Raises:
        Complaint: it may come down in more ways than one.
    """
    whole, between = -q["Q201"], q["Q257"]
    times = q["Q202"] / between if between > 0 else 0.0
    for is_so, what, advice in (
            (q["Q379"], "that begins in a hole", "write 0 for Q379"),
            (q["Q258"] != q["Q259"] or not q["Q258"] > 0, "whose stop above the last depth changes, or is none",
             "write Q258 above 0 and Q259 the same"),
            (q["Q208"] < 0 or between < 0 or q["Q212"] < 0 or q["Q205"] < 0, "with a parameter below 0",
             "write Q208, Q257, Q212 and Q205 no less than 0"),
            (q["Q212"] and (between or not whole / MOST_STROKES <= q["Q205"] <= q["Q202"]),
             "that lessens its strokes to nothing, or breaks chips as well", "write Q205 above 0 up to Q202, and 0 for Q257"),
            (between and not (q["Q256"] > 0 and whole / between <= MOST_STROKES), "whose breaks of chips are none",
             "write Q256 above 0, and a larger Q257"),
            (between and q["Q202"] < whole - EVEN and not (times >= 1 - EVEN and abs(times - round(times)) < EVEN * times),
             "whose strokes are no multiple of Q257", "write a Q202 that is, or one as large as the depth")):
        if is_so:
            raise Complaint(f"cycle 205 {what}", advice)
    return q


def _depths(q):
    """Depths below the surface where each stroke but the last ends."""
    whole, stroke, depth = -q["Q201"], q["Q202"], 0.0
    if not q.get("Q212"):
        return [k * stroke for k in range(1, ceil(whole / stroke - EVEN))]
    out = []
    while (depth := depth + stroke) < whole * (1 - EVEN):
        out.append(depth)
        stroke = max(stroke - q["Q212"], q["Q205"])
    return out


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
    up = (("g", 0.0), ("z", begin))
    if cycle in ("203", "205") and q["Q208"] < RAPID:
        up = (("g", 1.0), ("z", begin), ("f", q["Q208"] or q["Q206"]))
    breaks = {"203": q["Q202"], "205": q.get("Q257", 0.0)}.get(cycle, 0.0)
    broken = [k * breaks for k in range(1, ceil(-q["Q201"] / breaks - EVEN))] if breaks else []
    pecks = [] if cycle == "203" else _depths(q)
    for depth in sorted({*pecks, *(b for b in broken if min((abs(b - p) for p in pecks), default=1.0) > BELOW_MM)}):
        z = top - depth
        way.append((("g", 1.0), ("z", z), feed))
        if depth in pecks:
            way += [up, (("g", 0.0), ("z", min(z + q.get("Q258", q["Q200"]), begin)))]
        else:
            way.append((("g", 0.0), ("z", z + q["Q256"])))
    way += [(("g", 1.0), ("z", bottom), feed), *stands]
    return [*way, *([up] if up[0] == ("g", 1.0) else []), *_left(q, begin)]


def _left(q, begin):
    """Up to the higher of both clearances."""
    return [(("g", 0.0), ("z", max(begin, q["Q203"] + q["Q204"])))]
