"""Tool libraries of Autodesk Fusion: .json, or .tools (a zip that holds tools.json).

Lengths stand in the tool's own unit, a holder's in the holder's own; TA is the side's angle to the axis, SIG a drill's
point from side to side, TP a tap's pitch; a face mill is as wide as DC at its face, a slot mill's LCF is its width; LB is the
length below the holder; holder segments run from the nose up, those above the gauge line last.
"""

import zipfile
import zlib

import numpy as np
from pydantic import ValidationError

from cuspline.shop.cutters import Holder
from cuspline.shop.threads import MINOR_SHARE
from cuspline.shop.tool_exchange.foreign import LARGEST, OWN, Fields, ForeignTool, SkippedTool, preset_or_none
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import InputError
from cuspline.values.input_files import LARGEST_BYTES, json_of, parsed_json
from cuspline.values.models import complaints, shortened

UNITS_MM = {"millimeters": 1.0, "inches": 25.4}
POINTS = {"drill": "drill", "spot drill": "spot_drill", "chamfer mill": "chamfer_mill", "counter sink": "chamfer_mill"}
HANDS = {"tap right hand": "right", "tap left hand": "left"}
TAP_CHAMFER = 3.0           # threads, which the format does not say: form C has two to three
SHARP_MM = 0.01             # corners of a slot mill that states none: rounder ones cut less
TYPES = ("flat end mill", "ball end mill", "bull nose end mill", "tapered mill", "dovetail mill", *POINTS, *HANDS, "thread mill",
         "face mill", "slot mill", "reamer", "counter bore")
PER_TURN = ("drill", "spot drill", "counter bore", "counter sink", "reamer")      # whose feed is down, by the turn
FOLLOWERS = ("guid", "n_ramp", "v_f_leadIn", "v_f_leadOut", "v_f_transition", "v_f_ramp", "v_f_retract", "use-feed-per-revolution")
COOLANTS = {"flood": "flood", "mist": "mist", "disabled": "off"}
METRES = 0.3048             # of a foot
SEGMENT = ("height", "lower-diameter", "upper-diameter")


def fusion_tools(path):
    """ForeignTools of a Fusion library, in its order; its bare holders are left out.

    Raises:
        InputError: no such library, or no tools in it.
    """
    return [fusion_tool(row) for row in _rows(path) if row["type"] != "holder"]


def _rows(path):
    """The tools and holders of a library, each a dict with a type in words."""
    if path.suffix == ".tools":
        document = parsed_json(_unzipped(path), f"{path}: its tools.json")
    else:
        document = json_of(path, "tool library")
    rows = document.get("data") if isinstance(document, dict) else None
    if not isinstance(rows, list):
        raise InputError(f"{path} is no Fusion tool library: it has no list called data")
    for k, row in enumerate(rows):
        if not isinstance(row, dict) or not isinstance(row.get("type"), str):
            raise InputError(f"{path} is no Fusion tool library: data.{k} has no type in words")
    return rows


def _unzipped(path):
    """The text of tools.json in a .tools file."""
    try:
        with zipfile.ZipFile(path) as archive, archive.open("tools.json") as file:
            content = file.read(LARGEST_BYTES + 1)
        if len(content) > LARGEST_BYTES:
            raise InputError(f"{path}: its tools.json is larger than {LARGEST_BYTES >> 20} MiB: it is no tool library")
        return content.decode("utf-8")
    except (OSError, ValueError, KeyError, EOFError, RuntimeError, NotImplementedError, zlib.error,
            zipfile.BadZipFile) as error:
        raise InputError(f"{path} is no Fusion tool library: {type(error).__name__}: {error}") from None


def fusion_holders(path):
    """{name: Holder} of the holders that stand in a Fusion .json library by themselves."""
    rows = _rows(path) if path.suffix == ".json" else []
    try:
        found = [_holder(Fields({"holder": row}), 1.0) for row in rows if row["type"] == "holder"]
    except SkippedTool as error:
        raise InputError(f"{path}: one of its holders cannot be used: {error}") from None
    return {h.name: h for h in found if h is not None}


def fusion_tool(row, number=None):
    """The ForeignTool of one row; `number`: left out, the row's own."""
    fields, unit = Fields(row), str(row.get("unit"))
    fields.used |= {("type",), ("unit",), ("description",)}
    number = fields.get("post-process", "number") if number is None else number
    own = fields.get(OWN)
    made = {"number": number if isinstance(number, int) and number > 0 else None, "foreign_type": row["type"],
            "name": str(row.get("description") or f"{row['type']} without a description"), "unit": unit}
    try:
        if unit not in UNITS_MM:
            raise SkippedTool(f"unit is {unit!r}; known are {', '.join(UNITS_MM)}")
        if row["type"] not in TYPES:
            raise SkippedTool(f"type {row['type']!r} has no counterpart; known are {', '.join(TYPES)}")
        mm = UNITS_MM[unit]
        cutter, holder = _cutter(fields, row["type"], mm), _holder(fields, mm)
        stick_out = fields.number("geometry", "LB")
        presets, left = _presets(fields, cutter, mm)
        return ForeignTool(**made, cutter=cutter, holder=holder, stick_out_mm=None if stick_out is None else stick_out * mm,
                           presets=presets, dropped=(*fields.dropped(), *left), assumed=tuple(fields.assumed)).with_own(own)
    except SkippedTool as reason:
        return ForeignTool(**made, cutter={}, holder=None, stick_out_mm=None, dropped=(), assumed=(),
                           skipped_because=str(reason))


def _presets(fields, cutter, mm):
    """(Presets in their order, names of what is dropped of them).

    Feeds stand in the tool's length a minute and a tooth or turn, v_c in m/min, of tools in inches in feet a minute; what
    v_f and v_c repeat is not kept twice.
    """
    rows, made, left = fields.get("start-values", "presets"), [], set()
    for k, row in enumerate(rows if isinstance(rows, list) else ()):
        own = Fields(row if isinstance(row, dict) else {})
        positive = lambda key, own=own: v if isinstance(v := own.get(key), (int, float)) and not isinstance(v, bool) and (
            0 < v < LARGEST) else None
        scaled = lambda value: None if value is None else exactly(value * mm)
        rpm, speed, feed, down = (positive(key) for key in ("n", "v_c", "v_f", "v_f_plunge"))
        turn, tooth = positive("f_n"), positive("f_z")
        if fields.document["type"] in PER_TURN:
            per_turn = turn or (down / rpm if rpm and down else None)
            tooth, down = per_turn and per_turn / cutter["flutes"], None
        elif tooth is None and rpm and feed:
            tooth = feed / rpm / cutter["flutes"]
        full = (rpm or 0.0) * (tooth or 0.0) * cutter["flutes"]
        hint = own.get("material") if isinstance(own.get("material"), dict) else {}
        words = [w for w in (hint.get("query"), hint.get("category")) if isinstance(w, str) and w.strip() and w != "all"]
        coolant, name = own.get("tool-coolant"), own.get("name")
        found = preset_or_none(
            name=name if isinstance(name, str) and name.strip() else f"preset {k + 1}", material=words[0] if words else None,
            spindle_rpm=rpm, cutting_speed_m_per_min=exactly(speed * (METRES if mm != 1.0 else 1.0)) if speed and not rpm else None,
            feed_per_tooth_mm=scaled(tooth), plunge_share=exactly(down / full) if down and full else None,
            ramp_deg=positive("ramp-angle"), stepdown_mm=scaled(positive("stepdown")) if own.get("use-stepdown") is True else None,
            stepover_mm=scaled(positive("stepover")) if own.get("use-stepover") is True else None, coolant=COOLANTS.get(coolant),
            notes=own.get("description") if isinstance(own.get("description"), str) and own.get("description") else None)
        left |= {f"start-values.presets.{name}" for name in own.dropped() if name not in FOLLOWERS}
        left |= {f"start-values.presets.tool-coolant ({coolant})"} if coolant and coolant not in COOLANTS else set()
        left |= {f"start-values.presets.{k}"} if found is None else set()
        made += [found] if found is not None else []
    return tuple(made), tuple(sorted(left))


def exactly(value):
    """A number out of arithmetic to the twelve digits that it is good for, so that what is written is read the same again."""
    return float(f"{value:.12g}")


def _cutter(fields, foreign_type, mm):
    """Fields of a Cutter."""
    need = lambda key: fields.needed("geometry", key) * mm
    d, flute, shank, overall = need("DC"), need("LCF"), need("SFDM"), need("OAL")
    shape = _shape(fields, foreign_type, d, mm)
    if (flutes := fields.number("geometry", "NOF")) is None:
        fields.assume("flutes = 1, for the slowest feed (NOF is missing)")
    neck = _neck(fields, d, flute, shank, mm)
    if shape["type"] == "tap" and neck["neck_diameter_mm"] > (core := d - MINOR_SHARE * shape["pitch_mm"]):
        fields.assume(f"neck_diameter_mm = {core:.6g}, the thread's core (the neck that is stated would not follow it)")
        neck = {**neck, "neck_diameter_mm": core} if "shaft_segments" not in neck else neck
    return {**shape, "flutes": int(flutes or 1), "flute_length_mm": flute, "shank_diameter_mm": shank,
            "overall_length_mm": overall, **neck}


def _shape(fields, foreign_type, d, mm):
    corner = (fields.number("geometry", "RE", least=-1e-12) or 0.0) * mm
    if foreign_type == "flat end mill":
        if corner > 1e-9:
            raise SkippedTool(f"a flat end mill with a corner radius RE of {corner:g} mm: it is a bull nose end mill")
        return {"type": "flat", "diameter_mm": d, "corner_radius_mm": 0.0}
    if foreign_type == "ball end mill":
        if corner and abs(corner - d / 2) > 1e-3:
            raise SkippedTool(f"a ball end mill of diameter {d:g} mm with a corner radius RE of {corner:g} mm")
        return {"type": "ball", "diameter_mm": d, "corner_radius_mm": d / 2}
    if foreign_type == "bull nose end mill":
        return {"type": "bull_nose", "diameter_mm": d, "corner_radius_mm": fields.needed("geometry", "RE") * mm}
    if foreign_type in HANDS:
        fields.assume(f"chamfer_threads = {TAP_CHAMFER:g} (a tap's chamfer is not stated)")
        return {"type": "tap", "diameter_mm": d, "corner_radius_mm": 0.0, "hand": HANDS[foreign_type],
                "pitch_mm": fields.needed("geometry", "TP") * mm, "chamfer_threads": TAP_CHAMFER}
    if foreign_type == "thread mill":
        return {"type": "thread_mill", "diameter_mm": d, "corner_radius_mm": 0.0}
    if foreign_type in ROUND_TYPES:
        return ROUND_TYPES[foreign_type](fields, d, corner)
    if foreign_type in POINTS:
        return _pointed(fields, POINTS[foreign_type], d, mm)
    taper = fields.needed("geometry", "TA")
    if foreign_type == "dovetail mill":
        return {"type": "dovetail", "diameter_mm": d, "corner_radius_mm": corner, "taper_deg": taper}
    return _tapered(d, corner, taper)


def _face_mill(fields, d, corner):
    """Inserts that lean out by TA; without it they stand upright."""
    lean = fields.number("geometry", "TA", least=-1e-12) or 0.0
    return {"type": "face_mill", "diameter_mm": d, "corner_radius_mm": corner, "insert_angle_deg": 90.0 - lean}


def _slot_mill(fields, d, corner):
    """A T-slot or Woodruff cutter: a side cutter under its neck."""
    if not corner:
        fields.assume(f"corner_radius_mm = {SHARP_MM:g} (its corners are sharp)")
    return {"type": "side", "diameter_mm": d, "corner_radius_mm": corner or SHARP_MM}


def _reamer(fields, d, corner):
    return {"type": "reamer", "diameter_mm": d, "corner_radius_mm": 0.0}


def _counterbore(fields, d, corner):
    """A drill with a flat bottom; its pilot is not known."""
    fields.assume("it has no pilot")
    return {"type": "drill", "diameter_mm": d, "corner_radius_mm": 0.0, "point_angle_deg": 180.0}


ROUND_TYPES = {"face mill": _face_mill, "slot mill": _slot_mill, "reamer": _reamer, "counter bore": _counterbore}


def _pointed(fields, type_, d, mm):
    """A drill, whose tip is taken for a point, a chamfer mill, whose TA is half of its point, or a countersink, which has SIG."""
    tip = (fields.number("geometry", "tip-diameter", least=-1e-12) or 0.0) * mm
    if type_ == "chamfer_mill" and fields.number("geometry", "SIG") is not None:
        return {"type": type_, "diameter_mm": d, "corner_radius_mm": 0.0, "tip_diameter_mm": tip,
                "point_angle_deg": fields.needed("geometry", "SIG")}
    if type_ == "chamfer_mill":
        return {"type": type_, "diameter_mm": d, "corner_radius_mm": 0.0, "tip_diameter_mm": tip,
                "point_angle_deg": 2 * fields.needed("geometry", "TA")}
    if tip > 0:
        fields.assume(f"its tip is a point (tip-diameter is {tip:g} mm)")
    return {"type": type_, "diameter_mm": d, "corner_radius_mm": 0.0, "point_angle_deg": fields.needed("geometry", "SIG")}


def _tapered(d, corner, taper_deg):
    """Fusion's tapered mill: flat of diameter DC - 2 RE at the tip, rounded by RE into the side."""
    if abs(corner - d / 2) < 1e-3:
        return {"type": "tapered_ball", "diameter_mm": d, "corner_radius_mm": d / 2, "taper_deg": taper_deg}
    e, f, beta = d / 2 - corner, corner, np.radians(taper_deg)
    crossing = (corner + e * fixed.cos(beta) - f * fixed.sin(beta)) / fixed.cos(beta)
    return {"type": "apt", "diameter_mm": float(2 * crossing), "corner_radius_mm": corner, "taper_deg": taper_deg,
            "tip_angle_deg": 0.0, "corner_center_radius_mm": e, "corner_center_height_mm": f}


def _neck(fields, d, flute, shank, mm):
    """Neck, reach and shaft segments."""
    length, width = (fields.number("geometry", key) for key in ("shoulder-length", "shoulder-diameter"))
    reach = max(flute, (length or 0.0) * mm)
    if reach > flute and width is None:
        fields.assume(f"neck_diameter_mm = {min(d, shank):g} (shoulder-diameter is missing)")
    neck = width * mm if width is not None and reach > flute else min(d, shank)
    segments = _segments(fields, mm, "shaft", "segments")
    if not segments and neck <= d:
        return {"neck_diameter_mm": neck, "reach_mm": reach}
    if reach > flute:
        segments = [{"height_mm": reach - flute, "lower_diameter_mm": neck, "upper_diameter_mm": neck}, *segments]
    return {"neck_diameter_mm": segments[0]["lower_diameter_mm"], "shaft_segments": segments,
            "reach_mm": flute + sum(s["height_mm"] for s in segments)}


def _segments(fields, mm, *path):
    rows = fields.get(*path) or []
    try:
        rows = [{name: float(row[key]) * mm for name, key in zip(
            ("height_mm", "lower_diameter_mm", "upper_diameter_mm"), SEGMENT)} for row in rows]
    except (KeyError, TypeError, ValueError, OverflowError):
        raise SkippedTool(f"{'.'.join(path)} must be a list of {', '.join(SEGMENT)}") from None
    return [row for row in rows if row["height_mm"] > 0]


def _holder(fields, tool_mm):
    """The Holder up to its gauge line, or None."""
    unit = fields.get("holder", "unit")
    if unit is not None and (not isinstance(unit, str) or unit not in UNITS_MM):
        raise SkippedTool(f"holder.unit is {shortened(unit)}; known are {', '.join(UNITS_MM)}")
    mm = tool_mm if unit is None else UNITS_MM[unit]
    segments = _segments(fields, mm, "holder", "segments")
    if not segments:
        return None
    if unit is None:
        fields.assume("holder in the tool's unit (holder.unit is missing)")
    gauge = fields.number("holder", "gaugeLength")
    if gauge is not None:
        segments = _below(segments, gauge * mm)
    name = fields.get("holder", "description") or "holder without a description"
    fields.get("holder", "type")
    try:
        return Holder(name=str(name), segments=segments)
    except ValidationError as error:
        raise SkippedTool(f"its holder: {complaints(error)}") from None


def _below(segments, gauge_mm):
    """Segments up to the gauge line; the one that it crosses is cut there."""
    kept, z = [], 0.0
    for s in segments:
        share = min((gauge_mm - z) / s["height_mm"], 1.0)
        if share > 1e-9:
            low, high = s["lower_diameter_mm"], s["upper_diameter_mm"]
            kept.append({"height_mm": s["height_mm"] * share, "lower_diameter_mm": low,
                         "upper_diameter_mm": high if share == 1.0 else low + share * (high - low)})
        z += s["height_mm"]
    return kept
