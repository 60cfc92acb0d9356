"""LinuxCNC's tool table: numbers, lengths and diameters; tools.json beside it holds the whole tools.

A table is not enough to rebuild a tool: `dropped_fields` lists what it leaves out, for a file beside it.
"""

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
