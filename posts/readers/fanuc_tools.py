"""Reads a Fanuc program of G10 blocks back: what the control will hold of each tool once it has run."""

import re

from cuspline.program.posted import PostedTool
from cuspline.values.errors import InputError
from cuspline.values.units import MM

NAMED = re.compile(r"O\d+|%|G90|M30|")
UNIT = {"G20": "inch", "G21": "mm"}
OFFSET = re.compile(r"G10L(10|11|12|13)P(\d+)R([+-]?\d*\.\d*)")
LETTER, TIMES = {10: "Z", 11: "Z", 12: "D", 13: "D"}, {10: 1.0, 11: 1.0, 12: 2.0, 13: 2.0}


def read_tool_table(text, control):
    """What a program of offsets leaves in memory C: geometry and wear together.

    Args:
        text: of the file.   control: machines.Control; its decimals say how well an offset can be told.
    Returns:
        list of PostedTool, one a tool.
    Raises:
        InputError: a line that sets no offset, or does not say in which unit; `.rows` holds it.

    >>> from types import SimpleNamespace
    >>> text = "%\\nO0001\\nG21\\nG90\\nG10 L10 P5 R104.5 (LENGTH)\\nG10 L12 P5 R3.\\nM30\\n%"
    >>> read_tool_table(text, SimpleNamespace(resolution_mm=0.001))[0].values_mm
    {'Z': 104.5, 'D': 6.0}
    """
    unit, parts = None, {}
    for line, whole in enumerate(text.split("\n"), 1):
        block = "".join(re.sub(r"\([^()]*\)", "", whole).split())
        found = OFFSET.fullmatch(block)
        unit = UNIT.get(block, unit)
        if found and unit is not None:
            memory, number, value = int(found[1]), int(found[2]), float(found[3])
            first, _, held = parts.setdefault(number, (line, whole.strip(), {}))
            held[memory] = TIMES[memory] * value * MM[unit]
        elif found or not (block in UNIT or NAMED.fullmatch(block)):
            raise InputError(f"line {line}: {whole.strip()!r} sets no offset: write G20 or G21, then G10 L10 to L13 with P "
                             "and R", rows=[line])
    return [PostedTool(number=number, values_mm=_summed(held), line=line, text=told, step_mm=control.resolution_mm)
            for number, (line, told, held) in parts.items()]


def _summed(held):
    """{letter: mm} of {memory: mm}."""
    sums = {}
    for memory, value in held.items():
        sums[LETTER[memory]] = sums.get(LETTER[memory], 0.0) + value
    return sums
