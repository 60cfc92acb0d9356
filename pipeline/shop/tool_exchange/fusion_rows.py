"""Tools as rows of a Fusion library, in millimetres: what `fusion` reads, written."""

import numpy as np

from cuspline.shop.cutters import DRILLS
from cuspline.shop.tool_exchange.foreign import SkippedTool
from cuspline.shop.tool_exchange.fusion import PER_TURN, SEGMENT, exactly

ROUND = {"flat": "flat end mill", "ball": "ball end mill", "bull_nose": "bull nose end mill", "side": "slot mill",
         "thread_mill": "thread mill", "reamer": "reamer"}       # what a corner radius says all of


def fusion_document(tool):
    """One tool as a row of a Fusion library, in millimetres, but its guid.

    Raises:
        SkippedTool: Fusion has no kind for it.
    """
    c = tool.cutter
    type_, own = _said(c)
    holder = [_as_segment(s) for s in tool.holder.segments]
    geometry = {"CSP": False, "DC": c.diameter_mm, "HAND": True, "LB": tool.stick_out_mm, "LCF": c.flute_length_mm, "NOF": c.flutes,
                "OAL": c.overall_length_mm, "SFDM": c.shank_diameter_mm, "assemblyGaugeLength": tool.length_mm, **own}
    if c.reach_mm > c.flute_length_mm and c.shaft_segments is None:
        geometry |= {"shoulder-length": c.reach_mm, "shoulder-diameter": c.neck_diameter_mm}
    row = {"type": type_, "unit": "millimeters", "description": c.name, "BMC": "carbide", "vendor": "", "product-id": "",
           "product-link": "", "geometry": geometry,
           "holder": {"description": tool.holder.name, "type": "holder", "unit": "millimeters", "segments": holder,
                      "gaugeLength": sum(s["height"] for s in holder)},
           "post-process": {"break-control": False, "comment": "", "diameter-offset": tool.number, "length-offset": tool.number,
                            "live": True, "manual-tool-change": False, "number": tool.number, "turret": 0},
           "start-values": {"presets": [_as_preset(p, c, type_) for p in tool.presets or ()]}}
    if c.shaft_segments is not None:
        row["shaft"] = {"type": "shaft", "segments": [_as_segment(s) for s in c.shaft_segments]}
    return row


def _said(c):
    """(type, geometry of its own) of a Cutter."""
    if c.type in ROUND:
        return ROUND[c.type], {"RE": c.corner_radius_mm}
    if c.type == "tapered_ball":
        return "tapered mill", {"RE": c.corner_radius_mm, "TA": c.taper_deg}
    if c.type == "apt" and c.tip_angle_deg == 0 and c.taper_deg > 0 and c.corner_center_height_mm == c.corner_radius_mm:
        wide = 2 * (c.corner_center_radius_mm + c.corner_radius_mm)
        return "tapered mill", {"DC": wide, "RE": c.corner_radius_mm, "TA": c.taper_deg}
    if c.type == "dovetail":
        return "dovetail mill", {"RE": c.corner_radius_mm, "TA": c.taper_deg}
    if c.type == "face_mill":
        return "face mill", {"RE": c.corner_radius_mm, "TA": 90.0 - c.insert_angle_deg}
    if c.type in DRILLS:
        return c.type.replace("_", " "), {"SIG": c.point_angle_deg}
    if c.type == "chamfer_mill":
        return "chamfer mill", {"TA": c.point_angle_deg / 2, "tip-diameter": c.tip_diameter_mm}
    if c.type == "tap":
        return f"tap {c.hand} hand", {"TP": c.pitch_mm}
    raise SkippedTool(f"Fusion has no kind for a cutter of type {c.type}")


def _as_segment(s):
    return dict(zip(SEGMENT, (s.height_mm, s.lower_diameter_mm, s.upper_diameter_mm)))


def _as_preset(p, cutter, type_):
    """A Preset in Fusion's words; speed and feed, which belong together there, as far as both are known."""
    d, rpm = cutter.diameter_mm, p.spindle_rpm
    if rpm is None and p.cutting_speed_m_per_min is not None:
        rpm = exactly(p.cutting_speed_m_per_min * 1000 / (np.pi * d))
    row = {"name": p.name, "description": p.notes or "",
           "material": {"category": "all", "query": p.material or "", "use-hardness": False},
           "tool-coolant": {"off": "disabled"}.get(p.coolant, p.coolant), "ramp-angle": p.ramp_deg,
           "use-stepdown": p.stepdown_mm is not None, "use-stepover": p.stepover_mm is not None,
           "stepdown": p.stepdown_mm, "stepover": p.stepover_mm,
           "n": rpm, "n_ramp": rpm, "v_c": rpm and exactly(np.pi * d * rpm / 1000)}
    tooth = p.feed_per_tooth_mm
    feed = exactly(rpm * tooth * cutter.flutes) if rpm and tooth else None
    if type_ in PER_TURN:
        row |= {"f_n": tooth and exactly(tooth * cutter.flutes), "use-feed-per-revolution": True,
                "v_f_plunge": feed, "v_f_retract": feed}
    else:
        down = exactly(p.plunge_share * feed) if p.plunge_share and feed else None
        row |= {"f_z": tooth, "v_f": feed, "v_f_plunge": down, "f_n": exactly(down / rpm) if down else None,
                "v_f_ramp": down or feed, **dict.fromkeys(("v_f_leadIn", "v_f_leadOut", "v_f_transition"), feed)}
    return {k: v for k, v in row.items() if v is not None}
