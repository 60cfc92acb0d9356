"""LinuxCNC's tool table: numbers, lengths and diameters; tools.json beside it holds the whole tools.

A table is not enough to rebuild a tool: `dropped_fields` lists what it leaves out, for a file beside it.
"""

from typing import NamedTuple

from cuspline.values.errors import InputError
from cuspline.values.units import MM

IN_TABLE_DECIMALS = 6
IN_THE_TABLE = ("number", "cutter.name", "cutter.diameter_mm")


def tool_table(tools, control):
    """The table's text, one line a tool, in the control's length unit.

    Args:
        tools: Tool values.
        control: machines.Control.
    """
    scale = 1.0 if control.units == "mm" else 1.0 / 25.4
    beside = lambda t: f"X{t.offset_mm[0] * scale:.6f} " if t.offset_mm[0] else ""
    lines = [f"T{t.number} P{t.number} {beside(t)}Z{t.length_mm * scale:.6f} D{t.cutter.diameter_mm * scale:.6f} "
             f";{t.cutter.name}" for t in sorted(tools, key=lambda t: t.number)]
    return "\n".join(lines) + "\n"


class TableRow(NamedTuple):
    """One tool in a table."""

    number: int
    values_mm: dict         # letter of an offset, or D -> mm
    line: int               # from 1
    text: str


def read_tool_table(text, control):
    """The rows of a LinuxCNC tool table.

    Args:
        text: of the file.   control: machines.Control, whose length unit it is in.
    Returns:
        list of TableRow.
    Raises:
        InputError: a line that is no tool's; `.rows` holds it.

    >>> from types import SimpleNamespace
    >>> read_tool_table("T5 P5 Z4.000000 D0.5 ;ball", SimpleNamespace(units="inch"))[0].values_mm
    {'Z': 101.6, 'D': 12.7}
    """
    rows = []
    for line, whole in enumerate(text.split("\n"), 1):
        words = whole.split(";")[0].split()
        if not words:
            continue
        try:
            values = {word[0].upper(): float(word[1:]) for word in words}
            number = int(values.pop("T"))
        except (KeyError, ValueError):
            raise InputError(f"line {line}: {whole.strip()!r} is no tool: write T, P, Z and D with their numbers",
                             rows=[line]) from None
        lengths = {letter: value * MM[control.units] for letter, value in values.items() if letter not in "PIJQABC"}
        rows.append(TableRow(number, lengths, line, whole.strip()))
    return rows


def dropped_fields(tools, control):
    """What a tool table does not hold, as a document: per tool the fields left out, with their values.

    Args:
        tools, control: as for `tool_table`.
    """
    rows = {}
    for tool in sorted(tools, key=lambda t: t.number):
        flat = dict(_leaves(tool.model_dump(mode="json")))
        rows[f"T{tool.number}"] = {k: v for k, v in flat.items() if k not in IN_THE_TABLE}
    return {"unit_of_the_table": control.units, "length_of_the_table": "stick-out and height of the holder together",
            "dropped": rows}


def _leaves(value, path=""):
    """(dotted path, value) of everything in a document."""
    if isinstance(value, (dict, list)):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _leaves(item, f"{path}.{key}" if path else str(key))
    else:
        yield path, value
