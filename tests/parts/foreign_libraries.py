"""Fusion and FreeCAD tool libraries as those programs write them, in small."""

import json
import zipfile

HOLDER = {"description": "ER16", "type": "holder", "unit": "millimeters", "gaugeLength": 60.0, "vendor": "V",
          "segments": [
    {"height": 30.0, "lower-diameter": 22.0, "upper-diameter": 28.0},
    {"height": 20.0, "lower-diameter": 40.0, "upper-diameter": 40.0},
    {"height": 20.0, "lower-diameter": 63.0, "upper-diameter": 73.0}]}      # the last one is half above the gauge line


def fusion_tool(type_="flat end mill", number=1, unit="millimeters", holder=HOLDER, **geometry):
    """One tool with the keys that Fusion writes."""
    values = {"CSP": False, "DC": 10.0, "HAND": True, "LB": 45.0, "LCF": 22.0, "NOF": 3, "OAL": 80.0, "SFDM": 10.0,
              "shoulder-length": 30.0, "shoulder-diameter": 9.2, "assemblyGaugeLength": 105.0, **geometry}
    tool = {"type": type_, "unit": unit, "description": f"{type_} {number}", "BMC": "carbide", "guid": f"guid-{number}",
            "vendor": "", "geometry": {k: v for k, v in values.items() if v is not None}, "expressions": {"a": "b"},
            "post-process": {"number": number, "live": True}, "start-values": {"presets": [{"n": 9000}]}}
    return tool if holder is None else {**tool, "holder": holder}


def inch(tool):
    """The same tool written in inches; its holder stays in millimetres."""
    geometry = {k: v / 25.4 if isinstance(v, float) and k != "TA" else v for k, v in tool["geometry"].items()}
    return {**tool, "unit": "inches", "geometry": geometry}


def fusion_library(path, *tools):
    """Write .json or .tools."""
    text = json.dumps({"data": list(tools), "version": 36})
    if path.suffix == ".tools":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("tools.json", text)
    else:
        path.write_text(text)
    return path


def freecad_bit(shape="Endmill", **parameters):
    """A bit with the keys that FreeCAD writes."""
    values = {"Diameter": "10.0000 mm", "CuttingEdgeHeight": "22.0000 mm", "Length": "80.0000 mm",
              "ShankDiameter": "10.0000 mm", "Flutes": 3, "Chipload": "0.0 mm", **parameters}
    return {"version": 2, "name": f"{shape} bit", "shape": f"{shape.lower()}.fcstd", "shape-type": shape,
            "parameter": {k: v for k, v in values.items() if v is not None}, "attribute": {}}


def freecad_library(folder, *bits):
    """Write a .fctl and its .fctb files."""
    for k, bit in enumerate(bits):
        (folder / f"bit{k}.fctb").write_text(json.dumps(bit))
    path = folder / "shop.fctl"
    tools = [{"nr": 10 + k, "path": f"bit{k}.fctb"} for k in range(len(bits))]
    path.write_text(json.dumps({"version": 1, "tools": tools}))
    return path
