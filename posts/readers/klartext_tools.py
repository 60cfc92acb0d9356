"""Reads a TNC's tool table TOOL.T back: what the control will take lengths and radii to be."""

import re

from cuspline.program.posted import PostedTool
from cuspline.values.errors import InputError
from cuspline.values.units import MM

HEAD = re.compile(r"BEGIN\s+TOOL\s*\.T\s+(MM|INCH)\b.*")
UNIT = {"MM": MM["mm"], "INCH": MM["inch"]}
# column -> (letter of the offset, how many times it counts)
MEANS = {"L": ("Z", 1.0), "DL": ("Z", 1.0), "R": ("D", 2.0), "DR": ("D", 2.0)}


def read_tool_table(text, control):
    """The rows of a tool table, columns by its second line.

    Args:
        text: of the file.   control: machines.Control; its decimals say how well a value can be told.
    Returns:
        list of PostedTool.
    Raises:
        InputError: no head, no such columns, or a row that is no tool's; `.rows` holds the line.

    >>> from types import SimpleNamespace
    >>> text = "BEGIN TOOL.T MM\\nT  NAME    L     R\\n5  BALL_6  +99.5 +3\\n[END]"
    >>> read_tool_table(text, SimpleNamespace(resolution_mm=0.001))[0].values_mm
    {'Z': 99.5, 'D': 6.0}
    """
    lines = text.upper().split("\n")
    head = HEAD.fullmatch(lines[0].strip())
    if not head:
        raise InputError("line 1: the table does not begin with BEGIN TOOL.T MM or INCH: write that", rows=[1])
    columns = {found[0]: found.start() for found in re.finditer(r"\S+", lines[1] if len(lines) > 1 else "")}
    if not {"T", "L", "R"} <= columns.keys():
        raise InputError("line 2: the table has no columns T, L and R: name them", rows=[2])
    rows = []
    for line, whole in enumerate(lines[2:], 3):
        if whole.strip() == "[END]":
            break
        if whole.strip():
            rows.append(_row(line, whole, columns, UNIT[head[1]], control.resolution_mm))
    return rows


def _row(line, whole, columns, unit_mm, step_mm):
    """One tool."""
    starts = [*sorted(columns.values()), len(whole)]
    cell = {name: whole[begin:starts[starts.index(begin) + 1]].strip() if begin < len(whole) else ""
            for name, begin in columns.items()}
    held = {}
    try:
        for name, (letter, times) in MEANS.items():
            value = cell.get(name, "")
            held[letter] = held.get(letter, 0.0) + times * unit_mm * float(value.replace(",", ".") or 0)
        return PostedTool(number=int(cell["T"]), values_mm=held, line=line, text=whole.strip(), step_mm=step_mm)
    except ValueError:
        raise InputError(f"line {line}: {whole.strip()!r} is no tool: write numbers under T, L and R", rows=[line]) from None
