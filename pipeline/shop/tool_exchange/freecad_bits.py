"""Tools as bits of FreeCAD: what `freecad` reads, written."""

import numpy as np

from cuspline.shop.cutters import DRILLS
from cuspline.shop.tool_exchange.foreign import SkippedTool
from cuspline.shop.tool_exchange.freecad import FLANK_DEG, USES
from cuspline.values import fixed_math as fixed

FILES = {"ThreadMill": "thread-mill"}                # names of shapes that are no file's name
LEAST_CREST_MM = 0.01


def freecad_document(tool):
    """One tool as a bit (.fctb); the library gives it its number.

    Raises:
        SkippedTool: FreeCAD has no shape for it.
    """
    c = tool.cutter
    shape, own = _said(c)
    parameter = {"Diameter": c.diameter_mm, "CuttingEdgeHeight": c.flute_length_mm, "Length": c.overall_length_mm,
                 "ShankDiameter": c.shank_diameter_mm, **own}
    in_words = lambda key, v: f"{v!r} {'°' if key.endswith('Angle') else 'mm'}"
    return {"version": 2, "name": c.name, "shape": f"{FILES.get(shape, shape.lower())}.fcstd", "shape-type": shape,
            "parameter": {**{k: in_words(k, float(v)) for k, v in parameter.items() if v is not None}, "Flutes": c.flutes,
                          "Material": "Carbide", "SpindleDirection": "Reverse" if c.hand == "left" else "Forward"},
            "attribute": {}, "presets": [_as_preset(p, c) for p in tool.presets or ()]}


def _said(c):
    """(shape, parameters of its own; None: those it has not) of a Cutter."""
    if c.type in ("flat", "ball", "reamer"):
        return {"flat": "Endmill", "ball": "Ballend", "reamer": "Reamer"}[c.type], {}
    if c.type == "bull_nose":
        return "Bullnose", {"CornerRadius": c.corner_radius_mm}
    if c.type == "tapered_ball":
        return "TaperedBallNose", {"TaperAngle": 2 * c.taper_deg, "TaperDiameter": 2 * c.profile.top_radius_mm}
    if c.type in DRILLS:
        return "Drill", {"TipAngle": c.point_angle_deg}
    if c.type == "chamfer_mill":
        return "Chamfer", {"CuttingEdgeAngle": c.point_angle_deg, "TipDiameter": c.tip_diameter_mm}
    if c.type == "tap":
        return "Tap", {"Pitch": c.pitch_mm, "CuttingEdgeLength": c.flute_length_mm, "CuttingEdgeHeight": None}
    if c.type == "thread_mill":
        crest = c.flute_length_mm - (c.diameter_mm - c.neck_diameter_mm) * float(fixed.tan(np.radians(FLANK_DEG)))
        return "ThreadMill", {"NeckDiameter": c.neck_diameter_mm, "NeckLength": c.reach_mm, "Crest": max(crest, LEAST_CREST_MM),
                              "CuttingEdgeHeight": None}
    if c.type == "face_mill" and c.insert_angle_deg == 90.0:
        return ("Bullnose", {"CornerRadius": c.corner_radius_mm}) if c.corner_radius_mm else ("Endmill", {})
    why = " whose angle the format does not say how to measure" if c.type == "dovetail" else ""
    raise SkippedTool(f"FreeCAD has no shape for a cutter of type {c.type}{why}")


def _as_preset(p, cutter):
    use = {v: k for k, v in USES.items()}.get(p.use, p.use)
    row = {"name": p.name, "material_hint": p.material and {"uuid": None, "name": p.material}, "op_type_hint": use,
           "surface_speed": p.speed_m_per_min(cutter.diameter_mm), "chipload": p.feed_per_tooth_mm,
           "vert_feed_ratio": p.plunge_share, "notes": p.notes}
    return {k: v for k, v in row.items() if v is not None or k != "vert_feed_ratio"}
