"""Sabotages of what is cut: seen by sweeping the text, on the bases that have a solid.

`places` are those of the boss (written_parts): its plate's floor is Z6, the mill is a flat of radius 3 and works round
the boss at X38, the ball of radius 3 finishes the strip Y < 6.4 in passes 0.4 apart.
"""

import json
import re

import numpy as np
from sabotages import Expected, Spoilt, changed_manifest, sabotage
from sabotages_of_text import cutting, lines_with, pick

from cuspline.program.program import Kind

FLOOR_MM, BALL_MM, STEP_MM = 6.0, 3.0, 0.4
HALF_GAP = lambda gap_mm: BALL_MM - (BALL_MM ** 2 - (gap_mm / 2) ** 2) ** 0.5     # ridge between passes so far apart
GRID_MM = 1e-3            # where the climb ends, pieces of arcs, four decimals


def operation(sheet, name):
    return sheet.moves.operation == sheet.moves.operations.index(name) if name in sheet.moves.operations else None


def row_to(sheet, end, name):
    """(row, line) of the first cutting move of an operation that ends at a place."""
    mine = operation(sheet, name)
    if mine is None:
        return None
    rows = np.flatnonzero(mine & cutting(sheet) & (np.abs(sheet.moves.end_mm - end).max(axis=1) < 2e-3))
    return (int(rows[0]), int(sheet.moves.line[rows[0]])) if len(rows) else None


def passes_of_the_strip(sheet):
    """Lines of the ball's long passes, where they are written out."""
    mine = operation(sheet, "finish")
    if mine is None or sheet.moves.call_line.any():
        return []
    long = np.abs(sheet.moves.end_mm - sheet.moves.start_mm)[:, 0] > 60
    return [int(k) for k in sheet.moves.line[np.flatnonzero(mine & cutting(sheet) & long)]]


@sabotage(needs_solid=True)
def pass_too_deep(sheet, rng):
    """A stretch of one pass runs deeper."""
    line, depth = pick(rng, passes_of_the_strip(sheet)[3:-3]), round(float(rng.uniform(0.006, 0.2)), 4)
    if line is None:
        return None
    text, mm = sheet.line(line), sheet.length
    down = [f"X{mm(20)}", f"Z{mm(FLOOR_MM - depth)}", f"X{mm(40)}", f"Z{mm(FLOOR_MM)}", text]
    if "X-" in text:
        down[0], down[2] = down[2], down[0]
    return Spoilt(content=sheet.with_line(line, *down),
                  expected=Expected(kind="gouge", lines=(line + 1, line + 3), amount=depth, within=GRID_MM))


@sabotage(needs_solid=True)
def pass_repeated_in_place_of_the_next(sheet, rng):
    """One pass is missing: a ridge of two steps stays."""
    lines = passes_of_the_strip(sheet)
    k = int(rng.integers(4, max(len(lines) - 4, 5)))
    if len(lines) < 10:
        return None
    steps = [lines[k] - 1, lines[k - 1] - 1]
    before = re.search(r"Y-?[\d.]+", sheet.line(steps[1]))[0]
    return Spoilt(content=sheet.with_line(steps[0], re.sub(r"Y-?[\d.]+", before, sheet.line(steps[0]))),
                  expected=Expected(kind="excess", lines=(lines[0], lines[-1]), amount=HALF_GAP(2 * STEP_MM),
                                    within=2e-3))


@sabotage(needs_solid=True)
def call_missing(sheet, rng):
    """A call is two passes: a ridge of three steps stays, more than five times what is allowed."""
    calls = sorted({int(k) for k in sheet.moves.call_line if k})
    if not calls:
        return None
    line = pick(rng, calls[2:-2])
    return Spoilt(content=sheet.with_line(line, "(GONE)"),
                  expected=Expected(kind="missing_area", lines=(1, len(sheet.lines)), amount=HALF_GAP(3 * STEP_MM),
                                    within=4e-3))


@sabotage(needs_solid=True)
def register_of_the_floor_too_low(sheet, rng):
    """Every call of the sub-program cuts too deep; the line is the sub-program's, the call's stands beside it."""
    lines = [k for k, line in enumerate(sheet.lines, 1) if re.match(r"#\d+=.*\(FLOOR\)", line)]
    if not lines:
        return None
    depth = round(float(rng.uniform(0.01, 0.2)), 4 if sheet.unit_mm > 1 or not sheet.is_fanuc else 3)
    inside = sheet.moves.line[sheet.moves.call_line > 0]
    calls = sheet.moves.call_line[sheet.moves.call_line > 0]
    text = re.sub(r"=[\d.]+", f"={sheet.length(FLOOR_MM - depth)}", sheet.line(lines[0]))
    return Spoilt(content=sheet.with_line(lines[0], text), expected=Expected(
        kind="gouge", lines=(int(inside.min()), int(inside.max())), calls=(int(calls.min()), int(calls.max())),
        amount=depth, within=GRID_MM))


@sabotage(needs_solid=True)
def mill_too_near_to_the_boss(sheet, rng):
    """X38 less a little: the side of the boss is cut."""
    found = row_to(sheet, (38.0, 9.0, FLOOR_MM), "clear")
    if found is None:
        return None
    row, line = found
    off, curve = round(float(rng.uniform(0.05, 0.4)), 3), int(sheet.moves.line[row + 2])
    changes = {line: re.sub(r"X[\d.]+", f"X{sheet.length(38 - off)}", sheet.line(line)),
               curve: f"G1 X{sheet.length(38)}"}
    text = sheet.with_lines({line: (changes[line],), curve: (changes[curve], _arc_again(sheet.line(curve)))})
    return Spoilt(content=text, expected=Expected(kind="gouge", lines=(line, curve), amount=off, within=GRID_MM))


def _arc_again(line):
    """An arc's block with its motion code, which a block put before it has taken."""
    return line if line.startswith("G") else "G3 " + line


@sabotage(needs_solid=True)
def arc_the_other_way_round(sheet, rng):
    """Three quarters of a turn through the boss in place of a quarter round its corner."""
    arcs = np.flatnonzero((sheet.moves.kind == Kind.ARC_CCW) & ~np.isclose(sheet.moves.end_mm[:, 2], 12))
    if not len(arcs):
        return None
    line = int(sheet.moves.line[arcs[0]])
    return Spoilt(content=sheet.with_line(line, sheet.line(line).replace("G3", "G2")),
                  expected=Expected(kind="gouge", lines=(line, line)))


@sabotage(needs_solid=True)
def finishing_missing(sheet, rng):
    """The floor of the strip stays as the mill has left it: 0.3 mm proud."""
    if "finish" not in sheet.moves.operations:
        return None
    begin = next(k for k, line in enumerate(sheet.lines, 1) if line.startswith("(OPERATION 2"))
    end = max(lines_with(sheet, r"^M5$"))
    return Spoilt(content=sheet.with_lines({k: ("(GONE)",) for k in range(begin, end)}),
                  expected=Expected(kind="missing_area", lines=(1, begin), amount=0.3, within=0.01))


@sabotage(needs_solid=True)
def mm_for_inches(sheet, rng):
    """All is cut in a twenty-fifth of the size, in one corner."""
    line = lines_with(sheet, r"^G20$")
    return line and Spoilt(content=sheet.with_line(line[0], "G21"), expected=Expected(kind="missing_area")) or None


@sabotage(needs_solid=True)
def floor_of_the_second_clamping_too_deep(sheet, rng):
    """Told with the second program's own lines."""
    if sheet.setup.name != "setup-2":
        return None
    depth = round(float(rng.uniform(0.01, 0.2)), 4)
    line = next(k for k, text in enumerate(sheet.lines, 1) if text == "G1 Z0 F900")
    return Spoilt(content=sheet.with_line(line, f"G1 Z{-depth} F900"),
                  expected=Expected(kind="gouge", lines=(line, len(sheet.lines)), amount=depth, within=GRID_MM))


@sabotage(needs_solid=True)
def zero_of_the_clamping_too_low(sheet, rng):
    """The part stands higher than the program believes: everything is cut too deep by that."""
    depth, at = round(float(rng.uniform(0.01, 0.2)), 4), [p.name for p in sheet.base.programs].index(sheet.name)
    sunk = lambda job: _shift(job["posted"][at]["setup"], sheet.setup, depth)
    return Spoilt(name="manifest.json", content=changed_manifest(sheet, sunk),
                  expected=Expected(kind="gouge", lines=(1, len(sheet.lines)), amount=depth, within=GRID_MM))


def _shift(document, setup, depth_mm):
    zero = np.array(setup.wcs_origin_mm) - depth_mm * np.array(setup.wcs_z)
    document["wcs_origin_mm"] = zero.tolist()


@sabotage(needs_solid=True)
def mill_larger_than_the_program_believes(sheet, rng):
    """Both the tools and the table say so: the side of the boss is cut by the difference."""
    if sheet is not sheet.base.programs[0]:
        return None
    off = round(float(rng.uniform(0.01, 0.1)), 4)
    tools = json.loads((sheet.base.folder / "tools.json").read_text())
    tools["tools"][0]["cutter"]["diameter_mm"] += 2 * off
    name, word, share = ("tools.nc", r"(L12 P1 R)([\d.]+)", 1) if sheet.is_fanuc else ("tools.tbl", r"(T1 .*D)([\d.]+)", 2)
    larger = re.sub(word, lambda w: f"{w[1]}{float(w[2]) + share * off / sheet.unit_mm:.6f}",
                    (sheet.base.folder / name).read_text())
    return Spoilt(name="tools.json", content=json.dumps(tools), more={name: larger},
                  expected=Expected(kind="gouge", lines=(1, len(sheet.lines)), amount=off, within=GRID_MM))


@sabotage(needs_solid=True)
def retract_missing_before_a_rapid_across(sheet, rng):
    """The mill goes back across the part by a rapid, through the strip that it has left and the boss."""
    if sheet.setup.name != "setup-1":
        return None
    found = row_to(sheet, (64.0, 9.0, FLOOR_MM), "clear")
    row, line = found
    lift, across = (int(k) for k in sheet.moves.line[[row + 1, row + 2]])
    words = sheet.line(across).split()
    text = sheet.with_lines({lift: ("(GONE)",), across: (" ".join(["G0", *[w for w in words if w != "G0"]]),)})
    return Spoilt(content=text, expected=Expected(kind="rapid_through_stock", lines=(across, across)))
