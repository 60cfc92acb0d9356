"""A tool library on its way out to other programs: Fusion (.tools, .fusion.json) and FreeCAD (.fctl with its .fctb bits).

What a format says of a tool is written in its own words; the rest of it (holder and stick-out in FreeCAD's, a tap's chamfer)
stands under one key that other programs pass over, so that what is read in again is the same tool.
"""

import io
import json
import uuid
import zipfile
from dataclasses import dataclass

from cuspline.shop.tool_exchange.foreign import OF_A_TOOL, OWN, SkippedTool
from cuspline.shop.tool_exchange.freecad import freecad_tool
from cuspline.shop.tool_exchange.freecad_bits import freecad_document
from cuspline.shop.tool_exchange.fusion import fusion_tool
from cuspline.shop.tool_exchange.fusion_rows import fusion_document
from cuspline.shop.tool_exchange.importing import made_of
from cuspline.values.errors import InputError

FUSION = (".tools", ".fusion.json")
FREECAD = (".fctl",)
VERSION = 36                # of Fusion's libraries
WRITTEN = (1980, 1, 1, 0, 0, 0)         # the day in an archive that knows none


@dataclass(frozen=True, kw_only=True)
class Export:
    """Files of a foreign library, and what became of every tool."""

    files: dict                         # {name: bytes}
    left_out: tuple[tuple[str, str], ...]       # (name, why) of tools that the format has no kind for
    beyond: dict                        # {"T5": what stands under OWN}

    def as_dict(self):
        return {"left_out": dict(self.left_out), "beyond_the_format": self.beyond}


def is_foreign(path):
    """Whether a file's name is that of another program's library."""
    return path.name.endswith((*FUSION, *FREECAD))


def exported(tools, path):
    """Export of tools to a file of that name.

    Args:
        tools: cutters.Tool values.   path: its ending says whose library.
    Raises:
        InputError: none of them has a counterpart there.
    """
    to_fusion = path.name.endswith(FUSION)
    document, read = (fusion_document, fusion_tool) if to_fusion else (freecad_document, freecad_tool)
    rows, left, beyond = [], [], {}
    for tool in sorted(tools, key=lambda t: t.number):
        try:
            row = document(tool)
            if own := _beyond(tool, read(row, tool.number)):
                row[OWN] = beyond[f"T{tool.number}"] = own
            rows.append((tool, row))
        except SkippedTool as reason:
            left.append((f"T{tool.number} {tool.cutter.name}", str(reason)))
    if not rows:
        raise InputError(f"--to {path}: no tool has a counterpart there: " + "; ".join(f"{n}: {w}" for n, w in left[:5]))
    files = _fusion_files(rows, path.name) if to_fusion else _freecad_files(rows, path)
    return Export(files=files, left_out=tuple(left), beyond=beyond)


def _beyond(tool, foreign):
    """What another program's words do not say of a tool, as ForeignTool.with_own takes it."""
    if foreign.skipped_because:
        raise SkippedTool(foreign.skipped_because)
    mine, found = tool.model_dump(mode="json"), made_of(foreign)
    theirs = {} if found is None else found.model_dump(mode="json")
    if found is None:                       # without holder or stick-out it is no tool yet
        theirs = {"cutter": {"name": foreign.name, **foreign.cutter}, "stick_out_mm": foreign.stick_out_mm,
                  "presets": [p.model_dump(mode="json") for p in foreign.presets] or None}
    out = {}
    for key in OF_A_TOOL:
        if key == "cutter":
            both = {**dict.fromkeys(theirs["cutter"]), **mine["cutter"]}
            out[key] = {k: v for k, v in both.items() if v != theirs["cutter"].get(k)}
        elif mine.get(key) != theirs.get(key):
            out[key] = mine.get(key)
    return {k: v for k, v in out.items() if v != {}}


def _fusion_files(rows, name):
    for tool, row in rows:
        row["guid"] = str(uuid.uuid5(uuid.NAMESPACE_OID, json.dumps(tool.model_dump(mode="json"), sort_keys=True)))
        for k, preset in enumerate(row["start-values"]["presets"]):
            preset["guid"] = str(uuid.uuid5(uuid.NAMESPACE_OID, f"{row['guid']} preset {k}"))
    text = json.dumps({"data": [row for _, row in rows], "version": VERSION}, indent=1) + "\n"
    if not name.endswith(".tools"):
        return {name: text.encode()}
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo("tools.json", WRITTEN), text)
    return {name: packed.getvalue()}


def _freecad_files(rows, path):
    bits = {f"{path.stem}-T{tool.number}.fctb": {**row, "id": f"{path.stem}-T{tool.number}"} for tool, row in rows}
    named = [{"nr": tool.number, "path": name} for (tool, _), name in zip(rows, bits)]
    library = {"label": path.stem, "tools": named, "version": 1}
    return {name: (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode()
            for name, document in {**bits, path.name: library}.items()}
