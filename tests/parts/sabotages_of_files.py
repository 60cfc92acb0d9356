"""Sabotages of the files beside the programs: the control's tool table, tools.json, anything that was published."""

import json
import re

from sabotages import REFUSED, Expected, Spoilt, changed_manifest, sabotage
from sabotages_of_text import at, cutting, first, pick

TABLE, OFFSETS = "tools.tbl", "tools.nc"


def table_of(sheet):
    return (sheet.base.folder / TABLE).read_text().splitlines()


def is_first(sheet):
    """Files are spoilt once a base."""
    return sheet is sheet.base.programs[0]


def has_table(sheet):
    """Once a base whose control loads a table of LinuxCNC's kind."""
    return is_first(sheet) and not sheet.is_fanuc


def in_table(sheet, line, text):
    lines = table_of(sheet)
    lines[line - 1] = text
    return "\n".join(lines) + "\n"


@sabotage(times=2)
def wrong_length_in_the_table(sheet, rng):
    if not has_table(sheet):
        return None
    line, off = int(rng.integers(1, len(table_of(sheet)) + 1)), round(float(rng.uniform(-3, 3)), 4) or 0.5
    longer = lambda w: f"Z{float(w[1]) + off / sheet.unit_mm:.6f}"
    return Spoilt(name=TABLE, content=in_table(sheet, line, re.sub(r"Z([\d.]+)", longer, table_of(sheet)[line - 1])),
                  expected=Expected(kind="wrong_tool_table", lines=(line, line), amount=abs(off),
                                    within=3e-5))     # six decimals


@sabotage()
def wrong_diameter_in_the_table(sheet, rng):
    if not has_table(sheet):
        return None
    larger = lambda w: f"D{float(w[1]) + 0.2 / sheet.unit_mm:.6f}"
    return Spoilt(name=TABLE, content=in_table(sheet, 1, re.sub(r"D([\d.]+)", larger, table_of(sheet)[0])),
                  expected=Expected(kind="wrong_tool_table", lines=(1, 1), amount=0.2, within=3e-5, words=" D "))


@sabotage()
def tool_beside_its_axis_in_the_table(sheet, rng):
    if not has_table(sheet):
        return None
    return Spoilt(name=TABLE, content=in_table(sheet, 2, table_of(sheet)[1].replace(" Z", " Y1 Z")),
                  expected=Expected(kind="wrong_tool_table", lines=(2, 2), amount=sheet.unit_mm, within=1e-6,
                                    words=" Y "))


@sabotage()
def tool_missing_in_the_table(sheet, rng):
    if not has_table(sheet):
        return None
    number = re.match(r"T(\d+)", table_of(sheet)[0])[1]
    return Spoilt(name=TABLE, content=in_table(sheet, 1, ""),
                  expected=Expected(kind="wrong_tool_table", words=f"no T{number}"))


@sabotage()
def table_missing(sheet, rng):
    if not is_first(sheet):
        return None
    return Spoilt(name=OFFSETS if sheet.is_fanuc else TABLE, content=None,
                  expected=Expected(kind="wrong_tool_table", words="missing"))


@sabotage()
def table_that_cannot_be_read(sheet, rng):
    if not has_table(sheet):
        return None
    return Spoilt(name=TABLE, content=in_table(sheet, 2, "T2 P2 Zlong"),
                  expected=Expected(kind="wrong_tool_table", lines=(2, 2)))


@sabotage()
def table_of_the_other_unit(sheet, rng):
    if not has_table(sheet):
        return None
    factor = 25.4 if sheet.unit_mm > 1 else 1 / 25.4
    length = sheet.base.tools[min(sheet.base.tools)].length_mm
    text = re.sub(r"([ZD])([\d.]+)", lambda w: f"{w[1]}{float(w[2]) * factor:.6f}", "\n".join(table_of(sheet)) + "\n")
    return Spoilt(name=TABLE, content=text, expected=Expected(
        kind="wrong_tool_table", lines=(1, 1), amount=abs(length * factor - length), within=1e-3))


@sabotage()
def tools_that_the_table_does_not_know(sheet, rng):
    """tools.json says another stick-out than the table was written with."""
    if not has_table(sheet):
        return None
    tools = json.loads((sheet.base.folder / "tools.json").read_text())
    tools["tools"][1]["stick_out_mm"] += 2.5
    return Spoilt(name="tools.json", content=json.dumps(tools),
                  expected=Expected(kind="wrong_tool_table", lines=(2, 2), amount=2.5, within=3e-5))


# Fanuc's: a program that writes the offsets ---------------------------------------------------------------


def offset_lines(sheet, memory):
    """[(line number, its words)] of the blocks that write one of the memories."""
    lines = (sheet.base.folder / OFFSETS).read_text().splitlines()
    return [(k, line.split()) for k, line in enumerate(lines, 1) if line.startswith(f"G10 {memory} ")]


def in_offsets(sheet, line, text):
    lines = (sheet.base.folder / OFFSETS).read_text().splitlines()
    lines[line - 1] = text
    return "\n".join(lines) + "\n"


@sabotage(times=2)
def wrong_length_among_the_offsets(sheet, rng):
    """Geometry or wear: the control adds them."""
    if not (sheet.is_fanuc and is_first(sheet)):
        return None
    memory = pick(rng, ["L10", "L11"])
    (line, words), off = pick(rng, offset_lines(sheet, memory)), round(float(rng.uniform(0.01, 3)), 3)
    first = line if memory == "L10" else line - 1
    longer = f"R{float(words[3][1:]) + off / sheet.unit_mm:.6f}"
    return Spoilt(name=OFFSETS, content=in_offsets(sheet, line, " ".join([*words[:3], longer])),
                  expected=Expected(kind="wrong_tool_table", lines=(first, first), amount=off, within=3e-5, words=" Z "))


@sabotage()
def wrong_radius_among_the_offsets(sheet, rng):
    if not (sheet.is_fanuc and is_first(sheet)):
        return None
    line, words = offset_lines(sheet, "L12")[0]
    larger = f"R{float(words[3][1:]) + 0.1 / sheet.unit_mm:.6f}"
    return Spoilt(name=OFFSETS, content=in_offsets(sheet, line, " ".join([*words[:3], larger])),
                  expected=Expected(kind="wrong_tool_table", lines=(line - 2, line - 2), amount=0.2, within=3e-5, words=" D "))


@sabotage()
def offset_without_a_point(sheet, rng):
    """The control would count thousandths."""
    if not (sheet.is_fanuc and is_first(sheet)):
        return None
    line, words = offset_lines(sheet, "L10")[0]
    return Spoilt(name=OFFSETS, content=in_offsets(sheet, line, " ".join([*words[:3], "R100"])),
                  expected=Expected(kind="wrong_tool_table", lines=(line, line)))


@sabotage(times=3)
def file_that_was_not_published(sheet, rng):
    """One file longer by a line feed, or gone, is named."""
    names = sorted(sheet.base.published.files)
    name = pick(rng, names)
    data = (sheet.base.folder / name).read_bytes()
    is_gone = not re.match(r"setup|tools", name) and rng.random() < 0.5
    return Spoilt(name=name, content=None if is_gone else data + b"\n", expected=Expected(
        kind="changed_file", words=f"{name} {'was published and is missing' if is_gone else 'is not the file'}"))


@sabotage(times=2)
def job_that_was_not_published(sheet, rng):
    """What the programs are judged against is loosened where it stands."""
    if not is_first(sheet):
        return None
    name, value = pick(rng, [("finish", {"scallop_mm": 1.0, "profile_tolerance_mm": 0.5, "gouge_mm": 0.5}),
                             ("accepted", ["gouge", "excess"]), ("smallest_ball_radius_mm", 8.0),
                             ("design", "another")])
    return Spoilt(name="manifest.json", content=changed_manifest(sheet, lambda job: job.update({name: value})),
                  expected=Expected(kind="changed_file", words=f"manifest.json: what its job says of {name} is not"))


@sabotage()
def control_that_cuts_corners(sheet, rng):
    """The machine's file says that the control leaves the path by more: of Fanuc's G64 nothing else tells."""
    if not (sheet.is_fanuc and is_first(sheet)):
        return None
    off = round(float(rng.uniform(0.004, 0.2)), 4)
    slack = lambda job: job["machine"]["control"].update(path_tolerance_mm=off)
    return Spoilt(name="manifest.json", content=changed_manifest(sheet, slack),
                  expected=at("path_tolerance", first(sheet, cutting(sheet)), amount=off))


@sabotage()
def program_missing(sheet, rng):
    return Spoilt(content=None, expected=Expected(kind=REFUSED, words="does not exist"))


@sabotage()
def tools_missing(sheet, rng):
    if not is_first(sheet):
        return None
    return Spoilt(name="tools.json", content=None, expected=Expected(kind=REFUSED, words="does not exist"))
