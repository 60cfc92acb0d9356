"""Reads LinuxCNC's tool table back: what the control will take a tool's length and diameter to be."""

from cuspline.program.posted import PostedTool
from cuspline.values.errors import InputError
from cuspline.values.units import MM

DECIMALS = 6


def read_tool_table(text, control):
    """The rows of a LinuxCNC tool table.

    Args:
        text: of the file.   control: machines.Control, whose length unit it is in.
    Returns:
        list of PostedTool.
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
        rows.append(PostedTool(number=number, values_mm=lengths, line=line, text=whole.strip(),
                               step_mm=MM[control.units] / 10 ** DECIMALS))
    return rows
