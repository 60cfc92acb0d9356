"""A propeller's blade cut by positions, built with all proofs; and judged with three things wrong, each of which must turn it red.

`python bench/blade.py name=value ...` builds with other parameters and prints its figures alone.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from cuspline.app.judge import judge
from cuspline.design.job import read_job
from cuspline.design.stock import StockSkin, settled
from cuspline.kernel import brep
from cuspline.shop.practice import Practice
from cuspline.verification.verdict import Options

SMALL = ("diameter_mm=100", "bore_mm=8", "fillet_leading_edge_mm=2", "fillet_trailing_edge_mm=2", "fillet_face_mm=3",
         "fillet_back_mm=3", "blades_cut=one", "skin_mm=0.6", "scallop_mm=0.02")
COARSE = Options(spacing_mm=0.6, solid_pitch_mm=0.6, replay_pitch_mm=0.6, tessellation_mm=0.02)
THICKER_MM = 1.0            # casting
OFF_MM = 0.05               # of where A and B meet


def measure(parameters=SMALL, is_spoilt=True):
    """[(what, number, unit)]."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        begin = os.times()
        run = subprocess.run([Path(sys.executable).with_name("cuspline"), "build", "dtmb_4119", "--out", out,
                              *(word for p in parameters for word in ("-p", p))], capture_output=True, text=True)
        end = os.times()
        made = out if run.returncode == 0 else out.with_name("out-rejected")
        seconds = end.children_user + end.children_system - begin.children_user - begin.children_system
        rows = [("the whole build", seconds, "CPU s"), *figures(made)]
        return rows + (spoilt(out) if is_spoilt and run.returncode == 0 else [])


def figures(folder):
    found, plan = (json.loads((folder / name).read_text()) for name in ("verify.json", "plan.json"))
    setups = found["setups"]
    kinds = sorted({f["kind"] for f in found["findings"]})
    proven = sum(sum(s["certificate"]["moves"].values()) for s in setups if s.get("certificate"))
    return [("findings" + (f" ({', '.join(kinds)})" if kinds else ""), len(found["findings"]), ""),
            ("positions", len(setups), ""), ("time at the machine", sum(s["time_s"] for s in plan["setups"]) / 60, "min"),
            ("area to be cut", found["area_required_mm2"], "mm2"), ("area reached", found["area_reached_mm2"], "mm2"),
            ("moves whose depth is proven", proven, ""),
            *((name.removesuffix("_mm").replace("_", " "), (found[name] or np.nan) * 1e3, "um") for name in (
                "gouge_max_mm", "gouge_proven_mm", "excess_max_mm", "excess_proven_mm", "cusp_max_mm", "cusp_p99_mm"))]


def spoilt(folder):
    """[(what, findings, "")] of the same programs judged as if something had gone wrong."""
    job = read_job(folder)
    part = brep.the_solid(brep.read_step(folder / job.step), job.step)
    skin = next(float(p.split("=")[1]) for p in SMALL if p.startswith("skin_mm"))
    cases = [("the casting 1 mm thicker than stated", _with_stock(job, part, skin + THICKER_MM)),
             ("A 0.05 mm off where the program thinks it", _with_offset(job, "a", (0.0, OFF_MM, 0.0))),
             ("B 0.05 mm off where the program thinks it", _with_offset(job, "b", (OFF_MM, 0.0, 0.0)))]
    rows = []
    for what, wrong in cases:
        found = judge(folder, wrong, options=COARSE).findings
        rows.append((f"{what}: findings ({', '.join(sorted({f.kind for f in found}))})", len(found), ""))
    return rows


def _with_stock(job, part, skin_mm):
    return job.model_copy(update={"stock": settled(StockSkin(skin_mm=skin_mm), part, Practice())})


def _with_offset(job, letter, offset_mm):
    """The job on a machine whose rotary axis stands off its place, and nobody has told."""
    rotary = getattr(job.machine, letter)
    return job.model_copy(update={"machine": job.machine.model_copy(update={letter: rotary.model_copy(update={
        "offset_mm": offset_mm})})})


if __name__ == "__main__":
    for what, number, unit in measure(tuple(sys.argv[1:]) or SMALL, is_spoilt=not sys.argv[1:]):
        print(f"{what}: {number:.5g} {unit}", flush=True)
