"""What a control's tool table does not hold; tools.json beside it holds the whole tools.

A table is not enough to rebuild a tool.  The table itself is the post's.
"""

IN_THE_TABLE = ("number", "cutter.name", "cutter.diameter_mm")


def dropped_fields(tools, control):
    """What a tool table does not hold, as a document: per tool the fields left out, with their values.

    Args:
        tools: Tool values.   control: machines.Control.
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
