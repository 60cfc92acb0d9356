"""Tool libraries on their way out: the file, what was dropped beside it, and a report to read."""

import json

from cuspline.shop.tool_exchange.exporting import FREECAD, FUSION, exported, is_foreign
from cuspline.shop.tool_table import dropped_fields
from cuspline.values.errors import InputError


def refuse_target(path, table_suffix):
    """
    Args:
        table_suffix: of the control's tool table, such as ".tbl"; "": it loads none.
    Raises:
        InputError: neither a .json nor such a table, or its folder does not exist.
    """
    if path.suffix not in (".json", table_suffix) and not is_foreign(path):
        raise InputError(f"--to {path}: tools are written to a .json library, to Fusion ({', '.join(FUSION)}), to FreeCAD "
                         f"({', '.join(FREECAD)})"
                         + (f" or the control's {table_suffix}" if table_suffix else "; this control loads no table"))
    if not path.parent.is_dir():
        raise InputError(f"--to {path}: the folder {path.parent} does not exist")


def sidecar(path):
    """The file beside a library or table that lists what was dropped: tools.json -> tools.dropped.json."""
    return path.with_name(f"{path.stem}.dropped.json")


def write_tools(library, path, control, table_of, imported=None):
    """Write a library (.json) or the control's tool table, and its sidecar.

    Args:
        library: ToolLibrary.
        path: what to write.
        control: machines.Control, whose length unit a table is in.
        table_of: the post's function (tools, control) -> text of a table.
        imported: Import that the library came from, if it did.
    """
    report = {} if imported is None else {"import": imported.as_dict()}
    if is_foreign(path):
        made = exported(library.tools, path)
        for name, content in made.files.items():
            _replaced(path.with_name(name), content)
        report["export"] = made.as_dict()
    elif path.suffix != ".json":
        _replace(path, table_of(library.tools, control))
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
    _replaced(path, text.encode())


def _replaced(path, content):
    """Write beside, then rename: no half-written file."""
    part = path.with_name(path.name + ".part")
    part.write_bytes(content)
    part.replace(path)
