"""Machines and controls on which a tool leans and stands, and the frame of one such position."""

import numpy as np
from known_machines import leaning
from known_tilted import machine

from cuspline.values.frames import Frame

CONTROLS = {"linuxcnc": {"post": "linuxcnc"}, "fanuc": {"post": "fanuc", "tip_control": "G43.4"},
            "fanuc, joints": {"post": "fanuc"}, "haas": {"post": "haas", "tip_control": "G234"},
            "heidenhain": {"post": "heidenhain", "tip_control": "TCPM"},
            "siemens": {"post": "siemens", "tip_control": "TRAORI", "swivel_record": "TC1"}}
TURNING_THE_PART, HEADS = ("mill_trunnion_ac", "mill_table_table"), ("mill_head_table_bc", "mill_head_head")
IN_PLANES = [name for name in CONTROLS if "tip_control" in CONTROLS[name]]
ON_MACHINES = [*((c, m) for c in CONTROLS for m in TURNING_THE_PART),
               *((c, m) for c in IN_PLANES if c != "haas" for m in HEADS)]


def mill(control, name):
    m = machine(name, **CONTROLS[control])
    x, y, z = m.wcs_origin_mm
    return m.model_copy(update={"spindle": m.spindle.model_copy(update={"min_rpm": 100.0}),
                                "wcs_origin_mm": (x, y, z + (80.0 if name in HEADS else 0.0))})


def leaning_frame(tilt_deg=25.0, azimuth_deg=70.0):
    """Frame in the WCS whose Z leans."""
    axis = leaning(tilt_deg, azimuth_deg)[0]
    across = np.cross(axis, (0.3, 0.2, 0.1))
    across /= np.linalg.norm(across)
    return Frame(rotation=np.column_stack([across, np.cross(axis, across), axis]), origin_mm=np.zeros(3))
