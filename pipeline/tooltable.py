"""LinuxCNC's tool table: numbers, lengths and diameters; tools.json beside it holds the whole tools."""


def tool_table(tools, control):
    """The table's text, one line a tool, in the control's length unit.

    Args:
        tools: Tool values.
        control: machines.Control.
    """
    scale = 1.0 if control.units == "mm" else 1.0 / 25.4
    lines = [f"T{t.number} P{t.number} Z{t.length_mm * scale:.6f} D{t.cutter.diameter_mm * scale:.6f} ;{t.cutter.name}"
             for t in sorted(tools, key=lambda t: t.number)]
    return "\n".join(lines) + "\n"
