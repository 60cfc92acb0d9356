"""Tool tables of controls that take their offsets from a program of G10 blocks."""

from types import SimpleNamespace

from cuspline.posts.writers.words import UNIT_WORD, Writer, check_lines

OFFSETS = ("L10", "L11", "L12", "L13")      # length, its wear, radius, its wear; some controls take the pairs the other way


def offset_program(tools, control, name, notes=()):
    """A program that writes lengths and radii into the control's offset memory, each of them with no wear.

    Args:
        tools: cutters.Tool values.   control: machines.Control.   name: the program's, as "O0001".
        notes: more lines for the operator.
    Returns:
        its text.
    """
    writer = Writer(SimpleNamespace(control=control), ".")
    writer.block("%")
    writer.block(name)
    for note in ("TOOL OFFSETS: RUN BEFORE THE PROGRAMS", *notes):
        writer.comment(note)
    writer.block(UNIT_WORD[control.units])
    writer.block("G90")
    for tool in sorted(tools, key=lambda t: t.number):
        writer.comment(f"T{tool.number} {tool.cutter.name}")
        for memory, value_mm in zip(OFFSETS, (tool.length_mm, 0.0, tool.cutter.diameter_mm / 2, 0.0)):
            writer.block("G10", memory, f"P{tool.number}", "R" + writer.length(value_mm))
    writer.block("M30")
    writer.block("%")
    check_lines(writer.lines, SimpleNamespace(control=control, name="the control"))
    return "\n".join(writer.lines) + "\n"
