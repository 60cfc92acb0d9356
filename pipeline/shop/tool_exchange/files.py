"""Tool libraries on their way out: the file, what was dropped beside it, and a report to read."""

import json

from cuspline.shop.tool_table import dropped_fields, tool_table
from cuspline.values.errors import InputError


def refuse_target(path):
    """
    Raises:
        InputError: neither a .json nor a .tbl, or its folder does not exist.
    """
    if path.suffix not in (".json", ".tbl"):
        raise InputError(f"--to {path}: tools are written to a .json library or a LinuxCNC .tbl")
    if not path.parent.is_dir():
        raise InputError(f"--to {path}: the folder {path.parent} does not exist")


def sidecar(path):
    """The file beside a library or table that lists what was dropped: tools.json -> tools.dropped.json."""
    return path.with_name(f"{path.stem}.dropped.json")


def write_tools(library, path, control, imported=None):
    """Write a library (.json) or a tool table (.tbl), and its sidecar.

    Args:
        library: ToolLibrary.
        path: what to write.
        control: machines.Control, whose length unit a table is in.
        imported: Import that the library came from, if it did.
    """
    report = {} if imported is None else {"import": imported.as_dict()}
    if path.suffix == ".tbl":
        _replace(path, tool_table(library.tools, control))
        report["export"] = dropped_fields(library.tools, control)
    else:
        _replace(path, _text(library.model_dump(mode="json")))
    _replace(sidecar(path), _text(report))


def report_lines(imported):
    """A table of what became of every tool, one line a tool and one for each thing dropped or assumed."""
    taken = sum(r.tool is not None for r in imported.rows)
    lines = [f"{imported.source}: {taken} of {len(imported.rows)} tools imported"]
    for row in imported.rows:
        number = f"T{row.number}" if row.number is not None else "-"
        became = f"skipped: {row.skipped_because}" if row.tool is None else row.tool.cutter.type
        lines.append(f"  {number:>5}  {row.name:<32}  {row.foreign_type:<20}  {row.unit:<11}  {became}")
        lines += [f"         assumed: {what}" for what in row.assumed]
        if row.dropped:
            lines.append(f"         dropped: {', '.join(row.dropped)}")
    return lines


def _text(document):
    return json.dumps(document, indent=1) + "\n"


def _replace(path, text):
    """Write beside, then rename: no half-written file."""
    part = path.with_name(path.name + ".part")
    part.write_text(text)
    part.replace(path)
