"""A tool library file's own units: every tool may say "unit": "mm" or "inch"; inside, all is millimetres.

A tool with a unit names its lengths without one ("diameter", "stick_out"); names that end in _mm are always
millimetres, and do not go with "unit": "inch".
"""

MM = {"mm": 1.0, "inch": 25.4}
LENGTHS = ("diameter", "corner_radius", "flute_length", "neck_diameter", "reach", "shank_diameter", "overall_length",
           "corner_center_radius", "corner_center_height", "tip_radius", "stick_out", "height", "lower_diameter",
           "upper_diameter", "feed_per_tooth", "stepdown", "stepover")


def in_mm(library):
    """A library document with every tool's lengths in millimetres; what is no library is handed back as it is.

    Raises:
        ValueError: an unknown unit, or a name in mm in a tool in inches; says which.
    """
    if not isinstance(library, dict) or not isinstance(library.get("tools"), list):
        return library
    return {**library, "tools": [_tool_in_mm(tool, k) for k, tool in enumerate(library["tools"])]}


def _tool_in_mm(tool, index):
    if not isinstance(tool, dict) or "unit" not in tool:
        return tool
    unit, rest = tool["unit"], {k: v for k, v in tool.items() if k != "unit"}
    if not isinstance(unit, str) or unit not in MM:
        raise ValueError(f"tools.{index}.unit: {unit!r} is no unit of length; write mm or inch")
    return _scaled(rest, MM[unit], f"tools.{index}")


def _scaled(value, mm, where):
    if isinstance(value, list):
        return [_scaled(v, mm, f"{where}.{k}") for k, v in enumerate(value)]
    if not isinstance(value, dict):
        return value
    row = {}
    for key, item in value.items():
        if key.endswith("_mm") and mm != 1.0:
            raise ValueError(f"{where}.{key}: this tool is in inches; write {key[:-3]}, without a unit")
        is_length = key in LENGTHS and isinstance(item, (int, float)) and not isinstance(item, bool)
        row[key + "_mm" if is_length else key] = item * mm if is_length else _scaled(item, mm, f"{where}.{key}")
    return row
