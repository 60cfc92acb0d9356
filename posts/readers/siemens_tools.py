"""Reads a sub-program of Sinumerik's tool data back: what the control will hold of each tool once it has run."""

import re

from cuspline.program.posted import PostedTool
from cuspline.values.errors import InputError
from cuspline.values.units import MM

DATUM = re.compile(r"\$TC_DP(\d+)\[(\d+),1\]=([+-]?\d+\.?\d*)")
TYPE, WITHOUT = 1, re.compile(r"M17|RET|")
# parameter -> (letter of the offset, how many times it counts): lengths and their wear, radius and its wear
MEANS = {3: ("Z", 1.0), 12: ("Z", 1.0), 6: ("D", 2.0), 15: ("D", 2.0), 4: ("Y", 1.0), 5: ("X", 1.0)}


def read_tool_table(text, control):
    """What the sub-program leaves of each tool's first cutting edge: geometry and wear together.

    Args:
        text: of the file.   control: machines.Control, whose length unit is the basic system's.
    Returns:
        list of PostedTool, one a tool.
    Raises:
        InputError: a line that is no tool datum; `.rows` holds it.

    >>> from types import SimpleNamespace
    >>> text = "$TC_DP3[5,1]=104.5 ; LENGTH\\n$TC_DP6[5,1]=3\\nM17"
    >>> read_tool_table(text, SimpleNamespace(units="mm", resolution_mm=0.001))[0].values_mm
    {'Z': 104.5, 'D': 6.0}
    """
    unit, parts = MM[control.units], {}
    for line, whole in enumerate(text.split("\n"), 1):
        block = "".join(whole.split(";")[0].split()).upper()
        found = DATUM.fullmatch(block)
        parameter = int(found[1]) if found else None
        if parameter in MEANS:
            letter, times = MEANS[parameter]
            _, _, held = parts.setdefault(int(found[2]), (line, whole.strip(), {}))
            held[letter] = held.get(letter, 0.0) + times * float(found[3]) * unit
        elif parameter != TYPE and not WITHOUT.fullmatch(block):
            raise InputError(f"line {line}: {whole.strip()!r} is no datum of a tool's first cutting edge: write $TC_DP3[3,1]=95 "
                             "and its like", rows=[line])
    return [PostedTool(number=number, values_mm=held, line=line, text=said, step_mm=control.resolution_mm)
            for number, (line, said, held) in parts.items()]
