"""Tool bits (.fctb) and libraries (.fctl) of FreeCAD: JSON with measures as text, "5.0000 mm".

A bit knows neither stick-out nor holder. TaperAngle is the included angle of a tapered ball nose; FlatRadius of
a bull nose is the radius of its flat, diameter/2 less the corner radius. CuttingEdgeAngle of chamfers and V-bits goes from
side to side, as that program's deburring and V-carving take it; a thread mill has one tooth of 60 degrees, at its edge as
wide as Crest.
"""

import re
from pathlib import PurePath

import numpy as np

from cuspline.shop.threads import MINOR_SHARE
from cuspline.shop.tool_exchange.foreign import LARGEST, OWN, Fields, ForeignTool, SkippedTool, preset_or_none
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import InputError
from cuspline.values.input_files import json_of

LENGTHS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3, "µm": 1e-3, "in": 25.4, '"': 25.4, "thou": 0.0254,
              "mil": 0.0254, "ft": 304.8, "'": 304.8}
ANGLES_DEG = {"°": 1.0, "deg": 1.0, "rad": 180 / np.pi}
SHAPES = {"endmill": "flat", "ballend": "ball", "bullnose": "bull_nose", "torus": "bull_nose",
          "taperedballnose": "tapered_ball", "drill": "drill", "chamfer": "chamfer_mill", "v-bit": "chamfer_mill",
          "vbit": "chamfer_mill", "tap": "tap", "thread-mill": "thread_mill", "threadmill": "thread_mill", "reamer": "reamer"}
USES = {"profile": "contour", "adaptive": "rough"}      # kinds of operations there: as they are called here
CHIPLOAD = "Chipload"       # the preset of a bit that says nothing but this
TAP_CHAMFER = 3.0           # threads, which the format does not say: form C has two to three
ROUNDING = 1e-12            # of a cone that is as high as its flutes
FLANK_DEG = 30.0            # of a thread's tooth, from side to side twice that
MEASURE = re.compile(r"\s*([-+]?\d+(?:[.,]\d*)?(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


def freecad_tools(path):
    """ForeignTools of a library (.fctl, its bits beside it or in ../Bit) or of one bit (.fctb).

    Raises:
        InputError: a file that is missing or no library; says which.
    """
    if path.suffix == ".fctb":
        return [freecad_tool(_document(path, "parameter", dict), None)]
    rows = []
    for k, row in enumerate(_document(path, "tools", list)["tools"]):
        if not isinstance(row, dict) or not isinstance(row.get("nr"), int) or not isinstance(row.get("path"), str):
            raise InputError(f"{path} is no FreeCAD tool library: tools.{k} needs nr, a number, and path, a file")
        rows.append((row["nr"], row["path"]))
    return [freecad_tool(_document(_found(path, bit), "parameter", dict), number) for number, bit in rows]


def _document(path, key, kind):
    document = json_of(path, "tool file")
    if not isinstance(document, dict) or not isinstance(document.get(key), kind):
        raise InputError(f"{path} is no FreeCAD tool file: it has no {kind.__name__} called {key}")
    return document


def _found(library, bit):
    is_plain = bit == PurePath(bit).name and "\0" not in bit
    for folder in (library.parent, library.parent.parent / "Bit"):
        if is_plain and (folder / bit).is_file():
            return folder / bit
    raise InputError(f"{library} names the bit {bit!r}, which stands neither beside it nor in ../Bit")


def freecad_tool(document, number):
    """The ForeignTool of one bit."""
    fields = Fields(document)
    shape = str(fields.get("shape-type") or fields.get("shape") or "").lower().removesuffix(".fcstd")
    fields.used |= {("version",), ("name",), ("shape",), ("shape-type",), ("id",)}
    own = fields.get(OWN)
    units = {m[2] for v in document["parameter"].values() if isinstance(v, str) and (m := MEASURE.fullmatch(v))
             and m[2] in LENGTHS_MM}
    made = {"number": number, "name": str(document.get("name") or "bit without a name"), "foreign_type": shape,
            "unit": ", ".join(sorted(units)) or "mm", "holder": None, "stick_out_mm": None}
    try:
        cutter = _cutter(fields, shape)
        presets, left = _presets(fields)
        return ForeignTool(**made, cutter=cutter, presets=presets, dropped=(*fields.dropped(), *left),
                           assumed=tuple(fields.assumed)).with_own(own)
    except SkippedTool as reason:
        return ForeignTool(**made, cutter={}, dropped=(), assumed=(), skipped_because=str(reason))


def _presets(fields):
    """(Presets in their order, names of what is dropped of them): m/min, mm a tooth; without any, the bit's own Chipload."""
    rows, made, left = fields.get("presets"), [], set()
    for k, row in enumerate(rows if isinstance(rows, list) else ()):
        own = Fields(row if isinstance(row, dict) else {})
        positive = lambda key, own=own: v if isinstance(v := own.get(key), (int, float)) and not isinstance(v, bool) and (
            0 < v < LARGEST) else None
        words = lambda value: value if isinstance(value, str) and value.strip() else None
        found = preset_or_none(
            name=words(own.get("name")) or f"preset {k + 1}", material=words(own.get("material_hint", "name")),
            use=USES.get(use := words(own.get("op_type_hint")), use), cutting_speed_m_per_min=positive("surface_speed"),
            feed_per_tooth_mm=positive("chipload"), plunge_share=positive("vert_feed_ratio"), notes=words(own.get("notes")))
        left |= {f"presets.{name}" for name in own.dropped()} | ({f"presets.{k}"} if found is None else set())
        made += [found] if found is not None else []
    if not made and (load := _chipload_mm(fields)):
        made = [preset_or_none(name=CHIPLOAD, feed_per_tooth_mm=load)]
    return tuple(made), tuple(sorted(left))


def _chipload_mm(fields):
    """What the bit itself says a tooth takes; None: nothing, or 0."""
    for place in ("parameter", "attribute"):
        found = MEASURE.fullmatch(str(fields.get(place, "Chipload")))
        if found and found[2] in LENGTHS_MM and (load := float(found[1].replace(",", ".")) * LENGTHS_MM[found[2]]) > 0:
            return load
    return None


def _cutter(fields, shape):
    if shape == "dovetail":
        raise SkippedTool("CuttingEdgeAngle of a dovetail: the format does not say whether it is measured from the "
                          "bottom or between the flanks; write this cutter into a cuspline library by hand")
    if shape not in SHAPES:
        raise SkippedTool(f"shape {shape!r} has no counterpart; known are {', '.join(SHAPES)}")
    if SHAPES[shape] == "thread_mill":
        return _thread_mill(fields)
    has_shank = shape not in ("drill", "reamer") or fields.get("parameter", "ShankDiameter") is not None
    edge, thick = "CuttingEdgeLength" if shape == "tap" else "CuttingEdgeHeight", "ShankDiameter" if has_shank else "Diameter"
    d, flute, shank, overall = (_measure(fields, key, LENGTHS_MM) for key in ("Diameter", edge, thick, "Length"))
    if not has_shank:
        fields.assume(f"the shank is as thick as the {shape} (ShankDiameter is missing)")
    flutes = _flutes(fields)
    fields.assume("no neck: the shank begins where the flutes end")
    made = _shape(fields, SHAPES[shape], d, flute)
    widest = made["diameter_mm"] if shape != "tap" else d - MINOR_SHARE * made["pitch_mm"]
    return {**made, "flutes": flutes, "flute_length_mm": flute, "shank_diameter_mm": shank, "overall_length_mm": overall,
            "reach_mm": flute, "neck_diameter_mm": min(widest, shank)}


def _thread_mill(fields):
    """Fields of a Cutter with one tooth, which is as high as its crest and both of its flanks."""
    d, neck, length, shank, overall, crest = (_measure(fields, key, LENGTHS_MM) for key in (
        "Diameter", "NeckDiameter", "NeckLength", "ShankDiameter", "Length", "Crest"))
    tooth = crest + (d - neck) * float(fixed.tan(np.radians(FLANK_DEG)))
    return {"type": "thread_mill", "diameter_mm": d, "corner_radius_mm": 0.0, "flutes": _flutes(fields), "flute_length_mm": tooth,
            "neck_diameter_mm": neck, "reach_mm": length, "shank_diameter_mm": shank, "overall_length_mm": overall}


def _shape(fields, type_, d, flute):
    if type_ in ("flat", "ball"):
        return {"type": type_, "diameter_mm": d, "corner_radius_mm": 0.0 if type_ == "flat" else d / 2}
    if type_ == "bull_nose":
        if fields.get("parameter", "CornerRadius") is not None:
            return {"type": type_, "diameter_mm": d, "corner_radius_mm": _measure(fields, "CornerRadius", LENGTHS_MM)}
        return {"type": type_, "diameter_mm": d, "corner_radius_mm": d / 2 - _measure(fields, "FlatRadius", LENGTHS_MM)}
    if type_ == "drill":
        angle = _measure(fields, "TipAngle", ANGLES_DEG)
        return {"type": type_, "diameter_mm": d, "corner_radius_mm": 0.0, "point_angle_deg": angle}
    if type_ == "reamer":
        return {"type": type_, "diameter_mm": d, "corner_radius_mm": 0.0}
    if type_ == "tap":
        fields.assume(f"hand = right, chamfer_threads = {TAP_CHAMFER:g} (neither is stated)")
        return {"type": type_, "diameter_mm": d, "corner_radius_mm": 0.0, "pitch_mm": _measure(fields, "Pitch", LENGTHS_MM),
                "hand": "right", "chamfer_threads": TAP_CHAMFER}
    if type_ == "chamfer_mill":
        return _pointed(fields, d, flute)
    half = _measure(fields, "TaperAngle", ANGLES_DEG) / 2
    _check_taper(fields, d / 2, np.radians(half), flute)
    return {"type": type_, "diameter_mm": d, "corner_radius_mm": d / 2, "taper_deg": half}


def _pointed(fields, d, flute):
    """A chamfer mill; where its edge ends below the diameter that is stated, it is as wide as it ends."""
    angle, has_tip = _measure(fields, "CuttingEdgeAngle", ANGLES_DEG), fields.get("parameter", "TipDiameter") is not None
    tip = _measure(fields, "TipDiameter", LENGTHS_MM) if has_tip else 0.0
    ends = tip + 2 * flute * (1.0 - ROUNDING) * float(fixed.tan(np.radians(angle) / 2))
    if ends < d - 1e-6:
        fields.assume(f"diameter_mm = {ends:.6g}, where its edge ends (Diameter is {d:g} mm)")
    return {"type": "chamfer_mill", "diameter_mm": min(d, ends), "corner_radius_mm": 0.0, "point_angle_deg": angle,
            "tip_diameter_mm": tip}


def _check_taper(fields, r, beta, flute):
    """The diameter at the top must be what taper and height give, unless the taper goes on above the flutes."""
    if fields.get("parameter", "TaperDiameter") is None:
        return
    given = _measure(fields, "TaperDiameter", LENGTHS_MM)
    found = 2 * (r * fixed.cos(beta) + (flute - r * (1 - fixed.sin(beta))) * fixed.tan(beta))
    if found > given + 0.02:
        raise SkippedTool(f"the taper reaches {found:.3f} mm at CuttingEdgeHeight, TaperDiameter is {given:g} mm")
    if found < given - 0.02:
        fields.assume(f"flutes end at diameter {found:.3f} mm, as taper and height give (TaperDiameter {given:g} mm)")


def _flutes(fields):
    value = fields.get("parameter", "Flutes")
    if isinstance(value, int) and value > 0 or isinstance(value, str) and re.fullmatch("0*[1-9][0-9]{0,3}", value):
        return int(value)
    fields.assume(f"flutes = 1, for the slowest feed (Flutes is {value!r})")
    return 1


def _measure(fields, key, units):
    """A length in mm or an angle in degrees.

    Raises:
        SkippedTool: missing, not positive, or in no unit of its kind.
    """
    value = fields.get("parameter", key)
    found = MEASURE.fullmatch(value if isinstance(value, str) else repr(value))
    if value is None or not found:
        raise SkippedTool(f"parameter.{key} is {value!r}, it must be a measure with a unit")
    number, unit = float(found[1].replace(",", ".")), found[2]
    if not unit:
        unit = next(iter(units))
        fields.assume(f"{key} in {unit} ({value!r} has no unit)")
    if unit not in units or number <= 0:
        raise SkippedTool(f"parameter.{key} is {value!r}; it must be positive, in one of {' '.join(units)}")
    return number * units[unit]
