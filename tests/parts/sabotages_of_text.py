"""Sabotages of a program's text that need no simulation to be seen."""

import re

import numpy as np
from sabotages import REFUSED, Expected, Spoilt, refused_at, sabotage

from cuspline.program.program import Kind

GONE = "(GONE)"
MOTION = re.compile(r"(G[0123] )?[XYZ]-?[\d.]+")


# finding places in a sheet -------------------------------------------------------------------------------


def lines_with(sheet, pattern):
    """Numbers of lines in which a pattern is found, comments left out."""
    return [k for k, line in enumerate(sheet.lines, 1) if re.search(pattern, line.split("(")[0])]


def motion_lines(sheet):
    """Numbers of the plain motion lines."""
    return [k for k, line in enumerate(sheet.lines, 1) if MOTION.match(line) and "#" not in line]


def first(sheet, flags):
    """(line range, call range) of the first move with a flag; None where there is none."""
    rows = np.flatnonzero(flags)
    if not len(rows):
        return None
    line, call = int(sheet.moves.line[rows[0]]), int(sheet.moves.call_line[rows[0]])
    return (line, line), (call, call)


def cutting(sheet):
    return sheet.moves.kind != Kind.RAPID


def placed(sheet):
    """(n,) moves to a place of the work coordinate system: neither G53 nor G28."""
    return np.array([not re.search(r"G53|G28", sheet.line(k)) for k in sheet.moves.line])


def named(sheet, letter):
    """(n,) moves in whose line a letter stands."""
    return np.array([letter in sheet.line(k).split("(")[0] for k in sheet.moves.line])


def without(line, word):
    """A line without a word; a comment where nothing is left."""
    return " ".join(w for w in line.split() if w != word) or GONE


def at(kind, where, **more):
    """Expected at what `first` has found; None where that is nothing."""
    return where and Expected(kind=kind, lines=where[0], calls=where[1], **more)


def pick(rng, items):
    return items[int(rng.integers(len(items)))] if len(items) else None


# modes that nobody has said ---------------------------------------------------------------------------------


def word_gone(sheet, word, where):
    """The word taken out of the header; expected at the first move that relies on it."""
    lines = lines_with(sheet, rf"\b{re.escape(word)}\b(?!\.)")
    if not lines or where is None:
        return None
    return Spoilt(content=sheet.with_line(lines[0], without(sheet.line(lines[0]), word)),
                  expected=at("unknown_start", where, amount=0.0, words=f"{word} is missing"))


@sabotage()
def g90_missing(sheet, rng):
    return None if sheet.is_fanuc else word_gone(sheet, "G90", first(sheet, np.ones(len(sheet.moves), bool)))


@sabotage()
def work_offset_missing(sheet, rng):
    spoilt = word_gone(sheet, sheet.setup.wcs, first(sheet, placed(sheet)))
    return Spoilt(content=spoilt.content, expected=at("unknown_start", first(sheet, placed(sheet)), amount=0.0,
                                                      words="G54 is missing"))


@sabotage()
def another_work_offset(sheet, rng):
    wcs, other = sheet.setup.wcs, pick(rng, [w for w in ("G54", "G55", "G56", "G57", "G58", "G59")
                                             if w != sheet.setup.wcs])
    line = lines_with(sheet, rf"\b{wcs}\b")[0]
    return Spoilt(content=sheet.with_line(line, sheet.line(line).replace(wcs, other)),
                  expected=at("wrong_work_offset", first(sheet, placed(sheet)), amount=0.0, words=other))


@sabotage()
def g40_missing(sheet, rng):
    return word_gone(sheet, "G40", first(sheet, placed(sheet)))


@sabotage()
def g94_missing(sheet, rng):
    return word_gone(sheet, "G94", first(sheet, cutting(sheet)))


@sabotage()
def g80_missing(sheet, rng):
    """Fanuc goes home by axis words before any G0 has ended a cycle; LinuxCNC's G53 G0 ends it."""
    return word_gone(sheet, "G80", first(sheet, ~placed(sheet))) if sheet.is_fanuc else None


@sabotage()
def plane_missing(sheet, rng):
    arcs = sheet.moves.kind > Kind.FEED
    is_said_again = (len(lines_with(sheet, r"\bG17\b(?!\.)")) > 1
                     or any(re.search(r"G1[789]", sheet.line(k)) for k in sheet.moves.line[arcs]))
    return None if is_said_again else word_gone(sheet, "G17", first(sheet, arcs))


@sabotage()
def g91_1_missing(sheet, rng):
    return word_gone(sheet, "G91.1", first(sheet, sheet.moves.kind > Kind.FEED))


@sabotage()
def shift_of_the_zero_left_in_force(sheet, rng):
    """What takes back a G92 or G52 of another program is gone."""
    if not sheet.is_fanuc:
        return word_gone(sheet, "G92.1", first(sheet, placed(sheet)))
    line = lines_with(sheet, r"^G52 ")[0]
    return Spoilt(content=sheet.with_line(line, GONE),
                  expected=at("unknown_start", first(sheet, placed(sheet)), amount=0.0, words="G52"))


@sabotage()
def shift_of_the_zero(sheet, rng):
    if not sheet.is_fanuc:
        return None
    line = lines_with(sheet, r"^G52 ")[0]
    text = pick(rng, ["G52 X0. Y0. Z12.5", "G52 X-3. Y0. Z0.", "G52 X0. Y0."])
    return Spoilt(content=sheet.with_line(line, text), expected=refused_at(line, words="G52 X0. Y0. Z0."))


@sabotage()
def safety_line_missing(sheet, rng):
    line = lines_with(sheet, r"^G17 G90")[0]
    where = first(sheet, placed(sheet))
    return Spoilt(content=sheet.with_line(line, GONE), expected=at("unknown_start", where, amount=0.0, words="G40"))


@sabotage()
def units_missing(sheet, rng):
    line = lines_with(sheet, r"^G2[01]$")[0]
    needs = lines_with(sheet, r"G64 P") or [int(sheet.moves.line[placed(sheet)][0])]
    return Spoilt(content=sheet.with_line(line, GONE),
                  expected=refused_at(needs[0], words="G20 or G21"))


@sabotage()
def tool_lengths_never_said(sheet, rng):
    """Neither G43 nor G49: which length is in force nobody knows."""
    changes = {k: (re.sub(r"G43( H\d+)?|G49|H\d+", "", sheet.line(k)).strip() or GONE,)
               for k in lines_with(sheet, r"G43|G49")}
    relies = placed(sheet) & (cutting(sheet) | named(sheet, "Z"))
    return Spoilt(content=sheet.with_lines(changes), expected=at("unknown_start", first(sheet, relies), words="G43"))


# tool length offsets ----------------------------------------------------------------------------------------


def after(sheet, line):
    """The first move from a line on that uses the tool's length; of calls the one that comes first."""
    order = np.maximum(sheet.moves.line, 0) if not sheet.moves.call_line.any() else np.where(
        sheet.moves.call_line > 0, sheet.moves.call_line, sheet.moves.line)
    return first(sheet, (order >= line) & placed(sheet) & (cutting(sheet) | named(sheet, "Z")))


def own_length(sheet, line):
    """(number, length in mm) of the tool whose offset a line switches on."""
    number = int(re.search(r"H(\d+)", sheet.line(line))[1])
    return number, sheet.base.tools[number].length_mm


@sabotage()
def length_of_another_tool(sheet, rng):
    line = pick(rng, lines_with(sheet, r"G43"))
    number, length = own_length(sheet, line)
    other = pick(rng, [n for n in sheet.base.tools if n != number])
    off = abs(sheet.base.tools[other].length_mm - length)
    return Spoilt(content=sheet.with_line(line, sheet.line(line).replace(f"H{number}", f"H{other}")),
                  expected=at("wrong_length_offset", after(sheet, line), amount=off, words=f"H{other}"))


@sabotage()
def second_length_missing(sheet, rng):
    lines = lines_with(sheet, r"G43")
    if len(lines) < 2:
        return None
    off = abs(np.diff([own_length(sheet, k)[1] for k in lines[:2]])[0])
    text = re.sub(r"G43 ?|\s?H\d+", "", sheet.line(lines[1])).strip() or GONE
    return Spoilt(content=sheet.with_line(lines[1], text),
                  expected=at("wrong_length_offset", after(sheet, lines[1]), amount=off))


@sabotage(times=2)
def dynamic_length(sheet, rng):
    """G43.1 with another value than the tool's."""
    if sheet.is_fanuc:
        return None
    line, off = pick(rng, lines_with(sheet, r"G43")), round(float(rng.choice([-1, 1]) * rng.uniform(0.01, 20)), 4)
    _, length = own_length(sheet, line)
    text = f"G43.1 Z{sheet.length(length + off)}"
    return Spoilt(content=sheet.with_line(line, text),
                  expected=at("wrong_length_offset", after(sheet, line), amount=abs(off),
                              within=2e-5))   # digits of an inch


@sabotage()
def another_tool_called(sheet, rng):
    """T of another tool in the change: its length offset is not the one that follows."""
    line = pick(rng, lines_with(sheet, r"\bT\d+ M6"))
    number = int(re.search(r"T(\d+)", sheet.line(line))[1])
    other = pick(rng, [n for n in sheet.base.tools if n != number])
    off = abs(sheet.base.tools[other].length_mm - sheet.base.tools[number].length_mm)
    return Spoilt(content=sheet.with_line(line, f"T{other} M6"),
                  expected=at("wrong_length_offset", after(sheet, line), amount=off, words=f"T{other}"))


@sabotage()
def first_tool_not_changed_in(sheet, rng):
    line = lines_with(sheet, r"M6")[0]
    return Spoilt(content=sheet.with_line(line, without(sheet.line(line), "M6")),
                  expected=at(REFUSED, first(sheet, cutting(sheet)), words="no tool was changed in"))


@sabotage()
def second_tool_not_changed_in(sheet, rng):
    lines = lines_with(sheet, r"M6")
    if len(lines) < 2:
        return None
    return Spoilt(content=sheet.with_line(lines[1], without(sheet.line(lines[1]), "M6")),
                  expected=at("wrong_length_offset", after(sheet, lines[1]),
                              amount=abs(np.diff([t.length_mm for t in sheet.base.tools.values()])[0])))


@sabotage()
def unknown_tool(sheet, rng):
    line = pick(rng, lines_with(sheet, r"T\d+ M6"))
    return Spoilt(content=sheet.with_line(line, "T77 M6"), expected=refused_at(line, words="tool 77"))


@sabotage()
def lengths_switched_off(sheet, rng):
    """Every G43 gone, G49 stays; told at the first move that cuts or is low."""
    changes = {k: (re.sub(r"G43 ?|\s?H\d+", "", sheet.line(k)).strip() or GONE,) for k in lines_with(sheet, r"G43")}
    begin, end = min(changes), first(sheet, cutting(sheet))[0][1]
    return Spoilt(content=sheet.with_lines(changes),
                  expected=Expected(kind="no_length_offset", lines=(min(begin, end), max(begin, end)), words="G43"))


# path tolerance ---------------------------------------------------------------------------------------------


@sabotage(times=3)
def wide_path_tolerance(sheet, rng):
    lines = lines_with(sheet, r"G64 P")
    if not lines:
        return None
    p, q = (round(float(v), 4) for v in rng.uniform(0.01, 0.9, 2))
    cycle = 5e-4 / sheet.unit_mm            # what the reader counts for a blend's servo cycle at least
    words, total = pick(rng, [(f"P{p}", 3 * p), (f"P{p} Q{q}", 2 * p + q), (f"P{p} Q0", 2 * p),
                              (f"P0.00001 Q{q}", q + 1e-5 + cycle)])
    return Spoilt(content=sheet.with_line(lines[0], f"G64 {words}"),
                  expected=at("path_tolerance", first(sheet, cutting(sheet)), amount=total * sheet.unit_mm,
                              within=2e-6))


@sabotage()
def path_tolerance_never_said(sheet, rng):
    lines = lines_with(sheet, r"G64 P")
    return lines and Spoilt(content=sheet.with_line(lines[0], GONE),
                            expected=at("unknown_start", first(sheet, cutting(sheet)), words="G64 P")) or None


@sabotage()
def path_tolerance_without_p(sheet, rng):
    lines = lines_with(sheet, r"G64 P")
    return lines and Spoilt(content=sheet.with_line(lines[0], "G64"),
                            expected=refused_at(lines[0], words="any amount")) or None


# speeds and feeds -------------------------------------------------------------------------------------------


@sabotage(times=3)
def spindle_speed(sheet, rng):
    line, rpm = pick(rng, lines_with(sheet, r"^S\d+ M3")), int(pick(rng, [1, 20, 99, 18001, 24000, 100000]))
    return Spoilt(content=sheet.with_line(line, f"S{rpm} M3"),
                  expected=Expected(kind="spindle_out_of_range", lines=(line, line), amount=float(rpm), words="S word"))


@sabotage()
def spindle_backwards(sheet, rng):
    line = pick(rng, lines_with(sheet, r"^S\d+ M3"))
    return Spoilt(content=sheet.with_line(line, sheet.line(line).replace("M3", "M4")),
                  expected=at("no_spindle", _cut_after(sheet, line), amount=0.0))


@sabotage()
def spindle_never_started(sheet, rng):
    line = pick(rng, lines_with(sheet, r"^S\d+ M3"))
    return Spoilt(content=sheet.with_line(line, sheet.line(line).replace(" M3", "")),
                  expected=at("no_spindle", _cut_after(sheet, line), amount=0.0))


def _cut_after(sheet, line):
    """The first cutting move from a line on."""
    moves = sheet.moves
    return first(sheet, cutting(sheet) & (np.where(moves.call_line > 0, moves.call_line, moves.line) >= line))


def _register_of_feed(sheet):
    return [k for k, line in enumerate(sheet.lines, 1) if re.match(r"#\d+=[\d.]+ \(FEED\)", line)]


@sabotage(times=2)
def feed_beyond_the_machine(sheet, rng):
    lines = [k for k in lines_with(sheet, r"F[\d.]+")]
    register, feed = _register_of_feed(sheet), float(pick(rng, [60000, 6001, 9999])) / sheet.unit_mm
    if register and rng.random() < 0.7:
        line = pick(rng, register)
        where = _cut_after(sheet, line)
        text = re.sub(r"=[\d.]+", f"={feed:.1f}", sheet.line(line))
    elif lines:
        line = pick(rng, lines)
        where = (line, line), (0, 0)
        text = re.sub(r"F[\d.]+", f"F{feed:.1f}", sheet.line(line))
    else:
        return None
    return Spoilt(content=sheet.with_line(line, text),
                  expected=at("feed_out_of_range", where, amount=feed * sheet.unit_mm,
                              within=2.0))     # one decimal of an inch


@sabotage()
def slow_spindle_breaks_the_cutter(sheet, rng):
    """100 rpm, which the spindle has, at the feed for 8000; told where the feed is largest."""
    line = lines_with(sheet, r"^S8000 M3")[0]
    moves, place = sheet.moves, np.where(sheet.moves.call_line > 0, sheet.moves.call_line, sheet.moves.line)
    later = cutting(sheet) & (place >= line)
    mine = later & (moves.operation == moves.operation[np.argmax(later)])
    feed = moves.feed_mm_per_min[mine].max()
    flutes = sheet.base.tools[int(moves.tool[np.flatnonzero(mine)[0]])].cutter.flutes
    return Spoilt(content=sheet.with_line(line, "S100 M3"),
                  expected=at("chip_load", first(sheet, mine & (moves.feed_mm_per_min == feed)),
                              amount=feed / (100 * flutes), within=1e-3))


@sabotage()
def no_feed_at_all(sheet, rng):
    lines = lines_with(sheet, r"F[\d.]+")
    if not lines or _register_of_feed(sheet) and not lines:
        return None
    changes = {k: (re.sub(r" ?F[\d.]+", "", sheet.line(k)),) for k in lines}
    return Spoilt(content=sheet.with_lines(changes), expected=refused_at(lines[0], words="no feed"))


@sabotage()
def feed_of_nothing(sheet, rng):
    lines = lines_with(sheet, r"F[\d.]+")
    line = pick(rng, lines)
    return line and Spoilt(content=sheet.with_line(line, re.sub(r"F[\d.]+", "F0.", sheet.line(line))),
                           expected=refused_at(line, words="no feed")) or None


@sabotage()
def inverse_time(sheet, rng):
    """G93 for G94 wants F in every cutting block."""
    line = lines_with(sheet, r"\bG94\b")[0]
    bare = cutting(sheet) & ~named(sheet, "F")
    if not bare.any():
        return None
    return Spoilt(content=sheet.with_line(line, sheet.line(line).replace("G94", "G93")),
                  expected=at(REFUSED, first(sheet, bare), words="G93"))


# places -----------------------------------------------------------------------------------------------------


def _rapid_with(sheet, letter):
    """Lines of plain rapids with a number behind a letter."""
    rows = np.flatnonzero(~cutting(sheet))
    return sorted({int(k) for k in sheet.moves.line[rows] if re.match(rf"(G0 )?.*\b{letter}-?[\d.]+", sheet.line(k))
                   and "#" not in sheet.line(k) and not re.search("G53|G28", sheet.line(k))})


@sabotage(times=2)
def far_away(sheet, rng):
    """A kilometre and more: nothing could be simulated."""
    letter = pick(rng, ["X", "Y"])
    line = pick(rng, _rapid_with(sheet, letter))
    far = f"{letter}{10 ** int(rng.integers(6, 12))}."
    return line and Spoilt(content=sheet.with_line(line, re.sub(rf"{letter}-?[\d.]+", far, sheet.line(line))),
                           expected=refused_at(line, words="beyond")) or None


@sabotage(times=2)
def beyond_the_travel(sheet, rng):
    letter = pick(rng, ["X", "Y"])
    axis = "XY".index(letter)
    line = pick(rng, _rapid_with(sheet, letter))
    if line is None:
        return None
    to = float(rng.choice([-1, 1]) * np.round(rng.uniform(2000, 3000)))
    machine = to + sheet.machine.wcs_origin_mm[axis]
    limits = sheet.machine.axes[axis]
    over = max(limits.min_mm - machine, machine - limits.max_mm)
    word = f"{letter}{sheet.length(to)}"
    return Spoilt(content=sheet.with_line(line, re.sub(rf"{letter}-?[\d.]+", word, sheet.line(line))),
                  expected=Expected(kind="travel_exceeded", lines=(line, line), amount=over, within=1e-3, words=letter))


@sabotage(times=2)
def digit_too_many_in_a_call(sheet, rng):
    """The first number of a call is a place across the work: the line of the call must stand."""
    calls = [k for k in sorted({int(k) for k in sheet.moves.call_line if k})] if sheet.base.has_solid else []
    if not calls:
        return None
    line = pick(rng, calls)
    to = 2500.0
    over = to + sheet.machine.wcs_origin_mm[1] - sheet.machine.y.max_mm
    number = re.compile(r"\[-?[\d.]+\]|\bA-?[\d.]+")
    new = f"A{sheet.length(to)}" if sheet.is_fanuc else f"[{sheet.length(to)}]"
    inside = sheet.moves.line[(sheet.moves.call_line == line)]
    return Spoilt(content=sheet.with_line(line, number.sub(new, sheet.line(line), count=1)),
                  expected=Expected(kind="travel_exceeded", lines=(int(inside.min()), int(inside.max())),
                                    calls=(line, line), amount=over, within=1e-3, words="Y"))


@sabotage()
def inches_for_mm(sheet, rng):
    if sheet.unit_mm != 1.0:
        return None
    line = lines_with(sheet, r"^G21$")[0]
    moves, axes = sheet.moves, sheet.machine.axes
    ends = np.where(placed(sheet)[:, None], 25.4 * moves.end_mm, np.nan)
    far = ends + sheet.machine.wcs_origin_mm
    over = np.nanmax(np.concatenate([[a.min_mm - far[:, k], far[:, k] - a.max_mm] for k, a in enumerate(axes[:2])]))
    return Spoilt(content=sheet.with_line(line, "G20"),
                  expected=Expected(kind="travel_exceeded", lines=(1, len(sheet.lines)), amount=float(over),
                                    within=0.05))


@sabotage()
def no_moves(sheet, rng):
    if len(sheet.base.programs) > 1 or sheet.moves.call_line.any():
        return None
    gone = {int(k): (GONE,) for k in sheet.moves.line}
    return Spoilt(content=sheet.with_lines(gone), expected=Expected(kind=REFUSED, words="no move"))


@sabotage(times=2)
def incremental(sheet, rng):
    """G91 in the middle: the places that follow are not those meant; the first is refused or out of travel."""
    if not sheet.is_fanuc:
        return None
    lines = [k for k in lines_with(sheet, r"^G90$")]
    line = lines[0]
    return Spoilt(content=sheet.with_line(line, GONE),
                  expected=Expected(kind=REFUSED, lines=_cut_after(sheet, line)[0], words="knows where"))


# arcs and planes --------------------------------------------------------------------------------------------


def arc_lines(sheet):
    rows = np.flatnonzero(sheet.moves.kind > Kind.FEED)
    return sorted({int(k) for k in sheet.moves.line[rows]})


@sabotage(times=2)
def arc_centre_of_the_wrong_sign(sheet, rng):
    lines = [k for k in arc_lines(sheet) if re.search(r"[IJ]-?[1-9.]*[1-9]", sheet.line(k))
             and "#" not in sheet.line(k)]
    line = pick(rng, lines)
    if line is None:
        return None
    flip = lambda w: w[1] + (w[2][1:] if w[2].startswith("-") else "-" + w[2])
    return Spoilt(content=sheet.with_line(line, re.sub(r"([IJ])(-?[\d.]*[1-9][\d.]*)", flip, sheet.line(line),
                                                       count=1)),
                  expected=refused_at(line, words="radius"))


@sabotage()
def another_plane(sheet, rng):
    """Arcs in the wrong plane: told in the line of the arc, and in that of its call."""
    line = arc_lines(sheet)[0] if arc_lines(sheet) else None
    if line is None:
        return None
    said = re.search(r"G1[789]", sheet.line(line))
    where = first(sheet, sheet.moves.kind > Kind.FEED)
    if said:
        text = sheet.with_line(line, sheet.line(line).replace(said[0], "G17"))
    else:
        plane = [k for k in lines_with(sheet, r"\bG17\b") if k < line][-1]
        text = sheet.with_line(plane, sheet.line(plane).replace("G17", "G19"))
    return Spoilt(content=text, expected=at(REFUSED, where))


@sabotage()
def absolute_arc_centres(sheet, rng):
    lines = lines_with(sheet, r"G91\.1")
    if not lines:
        return None
    return Spoilt(content=sheet.with_line(lines[0], sheet.line(lines[0]).replace("G91.1", "G90.1")),
                  expected=at(REFUSED, first(sheet, sheet.moves.kind > Kind.FEED)))


# bytes and blocks -------------------------------------------------------------------------------------------


def with_inserted(sheet, line, what, at_column):
    """The text with bytes put into a line."""
    text = sheet.line(line).encode()
    return sheet.with_line(line, "\x00").encode().replace(b"\x00", text[:at_column] + what + text[at_column:])


@sabotage(times=4)
def strange_byte(sheet, rng):
    line = pick(rng, motion_lines(sheet))
    if line is None:
        return None
    what = bytes([int(rng.choice([0, 1, 4, 8, 11, 12, 26, 27, 28, 31, 127, 0x85, 0xA0, 0xE9, 0xFF]))])
    return Spoilt(content=with_inserted(sheet, line, what, int(rng.integers(len(sheet.line(line)) + 1))),
                  expected=refused_at(line))


@sabotage(times=2)
def lone_carriage_return(sheet, rng):
    """Two blocks with one letter in common, between which only a CR stands: LinuxCNC reads one block, and stops."""
    pairs = [k for k in motion_lines(sheet)[:-1] if MOTION.match(sheet.lines[k]) and "#" not in sheet.lines[k]
             and {w[0] for w in sheet.line(k).split()} & {w[0] for w in sheet.lines[k].split()} & set("XYZ")]
    line = pick(rng, pairs)
    if line is None:
        return None
    lines = [*sheet.lines[:line - 1], f"{sheet.line(line)}\r{sheet.lines[line]}", *sheet.lines[line + 1:]]
    return Spoilt(content="\n".join(lines) + "\n", expected=refused_at(line))


@sabotage()
def block_delete(sheet, rng):
    line = pick(rng, motion_lines(sheet))
    return line and Spoilt(content=sheet.with_line(line, "/" + sheet.line(line)),
                           expected=refused_at(line, words="block delete")) or None


@sabotage()
def line_too_long(sheet, rng):
    line = pick(rng, motion_lines(sheet))
    if line is None:
        return None
    text = sheet.line(line)
    long = f"{text} ({'A' * (int(rng.integers(253, 300)) - len(text) - 3)})"
    return Spoilt(content=sheet.with_line(line, long), expected=refused_at(line, words="characters"))


@sabotage()
def line_longer_than_this_control_takes(sheet, rng):
    room, line = sheet.machine.control.line_length, pick(rng, motion_lines(sheet))
    if line is None or room > 200:
        return None
    text = sheet.line(line)
    long = f"{text} ({'A' * (200 - len(text) - 3)})"
    return Spoilt(content=sheet.with_line(line, long),
                  expected=Expected(kind="line_too_long", lines=(line, line), amount=200.0))


@sabotage(times=3)
def unknown_word(sheet, rng):
    line = pick(rng, motion_lines(sheet))
    if line is None:
        return None
    word = pick(rng, ["G12", "G41 D1", "A10.", "M100", "G92 X0.", "G51", "!", "U5.", "G1,"])
    return Spoilt(content=sheet.with_line(line, f"{sheet.line(line)} {word}"), expected=refused_at(line))


@sabotage()
def word_twice(sheet, rng):
    line = pick(rng, motion_lines(sheet))
    if line is None:
        return None
    word = re.search(r"[XYZ]-?[\d.]+", sheet.line(line))[0]
    return Spoilt(content=sheet.with_line(line, f"{sheet.line(line)} {word}"),
                  expected=refused_at(line, words=f"two {word[0]} words"))


@sabotage()
def two_codes_of_a_group(sheet, rng):
    line = pick(rng, lines_with(sheet, r"^G[01] "))
    return Spoilt(content=sheet.with_line(line, sheet.line(line).replace(sheet.line(line)[:2], "G0 G1", 1)),
                  expected=refused_at(line))


@sabotage()
def comment_not_closed(sheet, rng):
    line = pick(rng, motion_lines(sheet))
    return line and Spoilt(content=sheet.with_line(line, sheet.line(line) + " (PASS"),
                           expected=refused_at(line, words="comment")) or None


@sabotage()
def letter_o_for_a_nought(sheet, rng):
    line = pick(rng, [k for k in motion_lines(sheet) if re.search(r"[XYZ]-?\d*0", sheet.line(k))])
    return line and Spoilt(content=sheet.with_line(line, re.sub(r"([XYZ]-?\d*)0", r"\1O", sheet.line(line), count=1)),
                           expected=refused_at(line)) or None


@sabotage(times=2)
def point_missing(sheet, rng):
    """Fanuc may take X64 for 64 thousandths."""
    lines = [k for k in motion_lines(sheet) if re.search(r"[XYZ]-?[1-9]\d*\.(?!\d)", sheet.line(k))]
    line = pick(rng, lines) if sheet.is_fanuc else None
    return line and Spoilt(content=sheet.with_line(line, re.sub(r"([XYZ]-?[1-9]\d*)\.(?!\d)", r"\1", sheet.line(line),
                                                                count=1)),
                           expected=refused_at(line, words="decimal point")) or None


@sabotage()
def end_missing(sheet, rng):
    line = lines_with(sheet, r"^M2$|^M30$")[0]
    return Spoilt(content=sheet.with_line(line, GONE), expected=Expected(kind=REFUSED))


@sabotage()
def end_too_early(sheet, rng):
    line = pick(rng, motion_lines(sheet)[:-1])
    if line is None or sheet.is_fanuc:
        return None
    after_it = next(k for k in range(line + 1, len(sheet.lines) + 1) if not sheet.line(k).startswith("("))
    return Spoilt(content=sheet.with_line(line, "M2"),
                  expected=refused_at(after_it, words="after the program end"))


@sabotage()
def percent_in_the_middle(sheet, rng):
    line = pick(rng, motion_lines(sheet)[:-1])
    return line and Spoilt(content=sheet.with_line(line, "%"), expected=Expected(kind=REFUSED)) or None


@sabotage()
def cut_off(sheet, rng):
    """The file ends in the middle of a line."""
    line = pick(rng, motion_lines(sheet))
    return line and Spoilt(content="\n".join([*sheet.lines[:line - 1], sheet.line(line)[:2]]),
                           expected=Expected(kind=REFUSED)) or None


@sabotage()
def file_larger_than_the_store(sheet, rng):
    room = sheet.machine.control.program_store_bytes
    if room > 1_000_000:
        return None
    end = lines_with(sheet, r"^M30$")[0]
    comments = [f"({'A' * 100})"] * (room // 100)
    return Spoilt(content=sheet.with_line(end, *comments, "M30"),
                  expected=Expected(kind="program_too_long", words=str(room)))


# sub-programs -----------------------------------------------------------------------------------------------


@sabotage()
def call_of_nothing(sheet, rng):
    line = pick(rng, lines_with(sheet, r"^o7001 call|^G65 P7001"))
    return line and Spoilt(content=sheet.with_line(line, sheet.line(line).replace("7001", "7009")),
                           expected=refused_at(line, words="7009")) or None


@sabotage()
def register_never_set(sheet, rng):
    lines = [k for k, line in enumerate(sheet.lines, 1) if re.match(r"#10\d=.*\((CLEAR|FEED|FLOOR)\)", line)]
    if not lines:
        return None
    line = lines[int(rng.integers(3 if len(lines) > 3 else len(lines)))]
    operation = [k for k in range(1, line) if sheet.line(k).startswith("(OPERATION")][0]
    if any(k < line and sheet.line(k).split("=")[0] == sheet.line(line).split("=")[0]
           for k in lines) or operation > line:
        return None
    call = next(k for k in lines_with(sheet, r"^o7001 call|^G65 P7001") if k > line)
    name = sheet.line(line).split("=")[0]
    return Spoilt(content=sheet.with_line(line, GONE), expected=Expected(
        kind=REFUSED, lines=(1, len(sheet.lines)), calls=(call, call), words=f"{name} is read before it is set"))


@sabotage()
def sub_program_without_end(sheet, rng):
    lines = lines_with(sheet, r"endsub|^M99$")
    return lines and Spoilt(content=sheet.with_line(lines[0], GONE), expected=Expected(kind=REFUSED)) or None
