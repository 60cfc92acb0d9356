"""Edits after which the control does the same, or nothing worse: the verdict stays green."""

import re

import numpy as np
from sabotages import harmless
from sabotages_of_text import GONE, lines_with, motion_lines, without

from cuspline.program.program import Kind


def each_line(sheet, change, which=None):
    """The text with change(line) for lines outside of comments; `which`: numbers of those."""
    chosen = set(range(1, len(sheet.lines) + 1) if which is None else which)
    lines = [change(line) if k in chosen and not line.startswith("(") else line
             for k, line in enumerate(sheet.lines, 1)]
    return "\n".join(lines) + "\n"


def outside_comments(line, change):
    """change(code) with the comments of a line kept."""
    return "".join(part if part.startswith("(") else change(part) for part in re.split(r"(\([^)]*\))", line))


def plain(sheet):
    """Lines that hold words only: no O-word, no call, no %, no register."""
    return [k for k, line in enumerate(sheet.lines, 1) if re.match(r"[GXYZMST]", line) and "G65" not in line
            and "#" not in line]


@harmless
def blank_lines(sheet, rng):
    return each_line(sheet, lambda line: line + ("\n" if rng.random() < 0.3 else ""), motion_lines(sheet))


@harmless
def comments_between(sheet, rng):
    return each_line(sheet, lambda line: line + ("\n(PASS G1 X1000 %)" if rng.random() < 0.3 else ""),
                     motion_lines(sheet))


@harmless
def comments_behind(sheet, rng):
    if sheet.machine.control.program_store_bytes < 10_000:      # they would not fit
        return None
    return each_line(sheet, lambda line: line + " (HERE, M3)", plain(sheet))


@harmless
def comments_within(sheet, rng):
    return each_line(sheet, lambda line: line.replace(" ", " (AND) ", 1), plain(sheet))


@harmless
def comments_after_a_semicolon(sheet, rng):
    return None if sheet.is_fanuc else each_line(sheet, lambda line: line + " ; G0 Z-99", plain(sheet))


@harmless
def line_numbers(sheet, rng):
    count = iter(range(10, 100000, 10))
    return each_line(sheet, lambda line: f"N{next(count)} {line}", plain(sheet)[::2])      # all would not fit the small store


@harmless
def large_line_numbers(sheet, rng):
    return each_line(sheet, lambda line: f"N99999 {line}", motion_lines(sheet)[::3])


@harmless
def lower_case(sheet, rng):
    return each_line(sheet, lambda line: outside_comments(line, str.lower))


@harmless
def shift_taken_back_elsewhere(sheet, rng):
    """LinuxCNC's in a block of its own, Fanuc's spelt in another way."""
    return sheet.text.replace("G52 X0. Y0. Z0.", "G52 Z0 X.0 Y0.000") if sheet.is_fanuc else sheet.text.replace(
        " G92.1\n", "\nG92.1\n", 1)


@harmless
def many_blanks(sheet, rng):
    return each_line(sheet, lambda line: outside_comments(line, lambda code: code.replace(" ", "   ")) + "  ",
                     plain(sheet))


@harmless
def no_blanks(sheet, rng):
    return each_line(sheet, lambda line: outside_comments(line, lambda code: code.replace(" ", "")), plain(sheet))


@harmless
def tabs(sheet, rng):
    return each_line(sheet, lambda line: "\t" + outside_comments(line, lambda code: code.replace(" ", "\t")),
                     plain(sheet))


@harmless
def trailing_zeros(sheet, rng):
    longer = lambda w: w[0] + ("000" if "." in w[0] else ".000")
    return each_line(sheet, lambda line: re.sub(r"[XYZIJK]-?\d+(\.\d*)?", longer, line), motion_lines(sheet))


@harmless
def leading_zeros(sheet, rng):
    return each_line(sheet, lambda line: re.sub(r"([XYZIJK]-?)(\d)", r"\g<1>00\2", line), motion_lines(sheet))


@harmless
def plus_signs(sheet, rng):
    return each_line(sheet, lambda line: re.sub(r"([XYZIJKF])(\d)", r"\1+\2", line), motion_lines(sheet))


@harmless
def points_without_a_nought(sheet, rng):
    return each_line(sheet, lambda line: re.sub(r"([XYZIJK]-?)0\.(\d)", r"\1.\2", line), motion_lines(sheet))


@harmless
def words_in_another_order(sheet, rng):
    return each_line(sheet, lambda line: " ".join(rng.permutation(line.split())) if "(" not in line else line,
                     motion_lines(sheet))


@harmless
def two_digits_in_codes(sheet, rng):
    longer = lambda code: re.sub(r"\b([GM])(\d)\b(?!\.)", r"\g<1>0\2", code)
    return each_line(sheet, lambda line: outside_comments(line, longer), plain(sheet))


@harmless
def motion_codes_repeated(sheet, rng):
    kinds = {int(k): kind for k, kind in zip(sheet.moves.line, sheet.moves.kind)}
    lines = [f"G{kinds[k]} {line}" if k in kinds and re.match(r"[XYZ]", line) else line
             for k, line in enumerate(sheet.lines, 1)]
    return "\n".join(lines) + "\n"


@harmless
def modes_repeated(sheet, rng):
    """G90 G94 G40 before every third block."""
    lines = motion_lines(sheet)[::3]
    return sheet.with_lines({k: ("G90 G40", sheet.line(k)) for k in lines})


@harmless
def units_and_plane_repeated(sheet, rng):
    """On lines of their own: LinuxCNC would read an F before G20 of its block in the old unit."""
    unit = "G20" if sheet.unit_mm > 1 else "G21"
    return sheet.with_lines({k: (unit, "G17", sheet.line(k)) for k in motion_lines(sheet)[:4]})


@harmless
def feeds_repeated(sheet, rng):
    feed = {int(k): f for k, f in zip(sheet.moves.line, sheet.moves.feed_mm_per_min) if f > 0}
    add = lambda k: f"{sheet.line(k)} F{feed[k] / sheet.unit_mm:.4f}"
    return sheet.with_lines({k: (add(k),) for k in motion_lines(sheet) if k in feed and "F" not in sheet.line(k)})


@harmless
def slower_feeds(sheet, rng):
    return each_line(sheet, lambda line: re.sub(r"F([\d.]+)", lambda w: f"F{float(w[1]) * 0.9:.2f}", line),
                     lines_with(sheet, r"F[\d.]"))


@harmless
def carriage_returns_before_line_feeds(sheet, rng):
    return sheet.text.replace("\n", "\r\n")


@harmless
def last_line_without_its_end(sheet, rng):
    return sheet.text[:-1]


@harmless
def blank_lines_at_the_end(sheet, rng):
    return sheet.text + "\n\n"


@harmless
def a_stop_to_look(sheet, rng):
    """M1 where the tool is up, at the change."""
    lines = lines_with(sheet, r"M6")
    return sheet.with_line(lines[-1], "M1", sheet.lines[lines[-1] - 1])


@harmless
def a_dwell(sheet, rng):
    lines = lines_with(sheet, r"^S\d+ M3")
    return sheet.with_line(lines[-1], sheet.lines[lines[-1] - 1], "G4 P2000" if sheet.is_fanuc else "G4 P2")


@harmless
def coolant_on(sheet, rng):
    lines = lines_with(sheet, r"^S\d+ M3")
    return sheet.with_line(lines[0], sheet.line(lines[0]), "M8")


@harmless
def speed_and_spindle_apart(sheet, rng):
    return each_line(sheet, lambda line: line.replace(" M3", "\nM3"), lines_with(sheet, r"^S\d+ M3"))


@harmless
def speed_a_little_lower(sheet, rng):
    return each_line(sheet, lambda line: line.replace("S8000", "S7500"))


@harmless
def tool_and_change_apart(sheet, rng):
    return each_line(sheet, lambda line: line.replace(" M6", "\nM6"), lines_with(sheet, r"^T\d+ M6"))


@harmless
def length_offset_without_its_number(sheet, rng):
    """LinuxCNC's G43 alone is the tool's in the spindle."""
    return None if sheet.is_fanuc else each_line(sheet, lambda line: re.sub(r"G43 H\d+", "G43", line))


@harmless
def length_offset_number_nought(sheet, rng):
    return None if sheet.is_fanuc else each_line(sheet, lambda line: re.sub(r"G43 H\d+", "G43 H0", line))


@harmless
def length_offset_said_twice(sheet, rng):
    return None if sheet.is_fanuc else each_line(sheet, lambda line: f"{line}\n{line}", lines_with(sheet, r"^G43"))


@harmless
def length_written_out(sheet, rng):
    """G43.1 with the tool's own length."""
    own = lambda w: f"G43.1 Z{sheet.length(sheet.base.tools[int(w[1])].length_mm)}"
    return None if sheet.is_fanuc else each_line(sheet, lambda line: re.sub(r"G43 H(\d+)", own, line))


@harmless
def g49_left_out(sheet, rng):
    """G43 comes before anything hangs on it."""
    return each_line(sheet, lambda line: without(line, "G49"), lines_with(sheet, r"G49"))


@harmless
def g80_left_out(sheet, rng):
    """G53 G0 ends a cycle as well."""
    return None if sheet.is_fanuc else each_line(sheet, lambda line: without(line, "G80"), lines_with(sheet, r"G80"))


@harmless
def g17_left_out_where_every_arc_says_its_plane(sheet, rng):
    arcs = sheet.moves.line[sheet.moves.kind > Kind.FEED]
    if not all(re.search(r"G1[789]", sheet.line(k)) for k in arcs):
        return None
    line = lines_with(sheet, r"^G17 G90")[0]
    return sheet.with_line(line, without(sheet.line(line), "G17"))


@harmless
def header_on_lines_of_their_own(sheet, rng):
    line = lines_with(sheet, r"^G17 G90")[0]
    return sheet.with_line(line, *sheet.line(line).split())


@harmless
def header_twice(sheet, rng):
    line = lines_with(sheet, r"^G17 G90")[0]
    return sheet.with_line(line, sheet.line(line), sheet.line(line))


@harmless
def exact_path(sheet, rng):
    """G61 keeps to the path."""
    if sheet.is_fanuc:
        return each_line(sheet, lambda line: line.replace("G64", "G61"))
    return each_line(sheet, lambda line: re.sub(r"G64 P\S+ Q0", "G61", line))


@harmless
def exact_stop(sheet, rng):
    return None if sheet.is_fanuc else each_line(sheet, lambda line: re.sub(r"G64 P\S+ Q0", "G61.1", line))


@harmless
def closer_path_tolerance(sheet, rng):
    p = f"{0.0002 / sheet.unit_mm:.7f}"
    return None if sheet.is_fanuc else each_line(sheet, lambda line: re.sub(r"G64 P\S+ Q0", f"G64 P{p} Q{p}", line))


@harmless
def corner_mode_not_said_to_fanuc(sheet, rng):
    """Whichever of G61 and G64 is in force, the control's own tolerance is counted."""
    if not sheet.is_fanuc:
        return None
    return each_line(sheet, lambda line: without(line, "G64"), lines_with(sheet, r"\bG64\b"))


@harmless
def g90_of_the_header_left_out_for_fanuc(sheet, rng):
    """G91 G28, then G90, say it before any place is named."""
    line = lines_with(sheet, r"^G17 G90")[0]
    return sheet.with_line(line, without(sheet.line(line), "G90")) if sheet.is_fanuc else None


@harmless
def a_lone_carriage_return_that_only_blanks(sheet, rng):
    """LinuxCNC reads one block: the second line says another axis, and the first none that it changes."""
    if sheet.is_fanuc:
        return None
    lines = lines_with(sheet, r"^M5$")
    return sheet.with_line(lines[-1], "M5\rG90")


@harmless
def percents_round_it(sheet, rng):
    return None if sheet.is_fanuc else f"%\n{sheet.text}%\n"


@harmless
def other_end(sheet, rng):
    return each_line(sheet, lambda line: {"M2": "M30", "M30": "M2"}.get(line, line))


@harmless
def coolant_word_gone(sheet, rng):
    return each_line(sheet, lambda line: GONE if line == "M9" else line)


@harmless
def rapids_higher(sheet, rng):
    """The clearance five millimetres up."""
    heights = sheet.moves.end_mm[sheet.moves.kind == Kind.RAPID, 2]
    top = np.nanmax(np.where(heights < 100, heights, np.nan))
    return each_line(sheet, lambda line: line.replace(f"Z{sheet.length(top)}", f"Z{sheet.length(top + 5)}"),
                     motion_lines(sheet))


@harmless
def a_tool_more_in_the_table(sheet, rng):
    if sheet.is_fanuc:
        return {"tools.nc": (sheet.base.folder / "tools.nc").read_text().replace("M30", "G10 L10 P90 R3.5\nM30")}
    return {"tools.tbl": (sheet.base.folder / "tools.tbl").read_text() + "T90 P90 Z3.5 D1 ;drill\n\n"}


@harmless
def table_in_other_words(sheet, rng):
    if sheet.is_fanuc:
        text = (sheet.base.folder / "tools.nc").read_text()
        return {"tools.nc": text.replace(" ", "").replace("R", "  R+")}
    text = (sheet.base.folder / "tools.tbl").read_text()
    return {"tools.tbl": text.replace("T", "t").replace(" Z", "   Z+").replace(";", " ; ")}
