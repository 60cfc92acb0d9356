"""What a monitor at the machine is to expect of every operation: forces, power, and the bands in which its teeth strike."""

from pathlib import Path

from cuspline.design.job import read_tools
from cuspline.values.errors import InputError
from cuspline.values.input_files import json_of

BAND = 0.05               # of a frequency, to both sides: a spindle under load slows down
HARMONICS = 1, 2, 3       # of the frequency of the teeth
FORCES = "radial_n", "axial_n", "torque_n_m", "power_kw"


def expected(folder):
    """A document of a folder's verify.json: per operation speeds, forces and bands; null: not known.

    Raises:
        InputError: the folder holds no verdict with a process.
    """
    path, tools = Path(folder) / "verify.json", read_tools(folder)
    document = json_of(path, "verdict") if path.exists() else {}
    setups = [(part["setup"], [*part["process"]["operations"], *map(_as_operation, part["process"].get("holes", ()))])
              for part in document.get("setups", ()) if part.get("process")]
    if not setups:
        raise InputError(f"{path}: no verdict that says what the edges meet: build the folder to --stage verify or further")
    return {"units": {"force": "N", "torque": "Nm", "power": "kW", "frequency": "Hz"}, "edges": "sharp; worn ones take up to three "
            "times the force", "setups": [{"setup": name, "operations": [_row(op, tools[op["tool"]].cutter.flutes) for op in rows]}
                                          for name, rows in setups]}


def _as_operation(hole):
    """A row of verify.json's "holes" as one of its "operations"."""
    return {**hole, "rpm": [hole["rpm"], hole["rpm"]], "removal_cm3_per_h": None}


def _row(op, flutes):
    slow, fast = op["rpm"]
    bands = [{"harmonic": k, "low_hz": round(k * flutes * slow / 60 * (1 - BAND), 2),
              "high_hz": round(k * flutes * fast / 60 * (1 + BAND), 2)} for k in HARMONICS]
    return {"operation": op["name"], "tool": op["tool"], "teeth": flutes, "rpm": [slow, fast],
            "spindle_hz": [round(slow / 60, 3), round(fast / 60, 3)], "teeth_bands": bands,
            "largest": {name: op.get(name) for name in FORCES}, "removal_cm3_per_h": op["removal_cm3_per_h"]}
