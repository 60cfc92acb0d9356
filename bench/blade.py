"""A propeller's blade cut by positions, built with all proofs; and judged with four things wrong, each of which must turn it red.

`python bench/blade.py name=value ...` builds with other parameters and prints its figures alone.
`python bench/blade.py FOLDER` takes what stands built in a folder: its figures, and a first look with each thing wrong.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from cuspline.app.build import DRAFT_OPTIONS
from cuspline.app.judge import begun
from cuspline.design.job import read_job
from cuspline.design.stock import StockMesh, StockSkin, settled
from cuspline.kernel import brep
from cuspline.shop.practice import Practice

SMALL = ("diameter_mm=100", "bore_mm=8", "fillet_leading_edge_mm=2", "fillet_trailing_edge_mm=2", "fillet_face_mm=3",
         "fillet_back_mm=3", "blades_cut=one", "skin_mm=0.6", "scallop_mm=0.02")
THICKER_MM = 3.0            # casting
OFF_MM = 0.05               # of where A and B meet
BENT_RAD = np.radians(50.0)     # a neighbour's tip round the shaft, towards the blade that is cut
STRAIGHT_SHARE = 0.45       # of the tip's radius: further in it is not bent


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
    """[(what, findings, "")] of a first look at the same programs as if something had gone wrong."""
    job, parameters = read_job(folder), json.loads((folder / "manifest.json").read_text())["parameters"]
    part = brep.the_solid(brep.read_step(folder / job.step), job.step)
    cases = [("nothing wrong", job),
             (f"the casting {THICKER_MM:g} mm thicker than stated", _with_stock(job, part, parameters["skin_mm"] + THICKER_MM)),
             ("a neighbouring blade bent into the way", _with_bent_blade(job.beside(folder))),
             (f"A {OFF_MM:g} mm off where the program thinks it", _with_offset(job, "a", (0.0, OFF_MM, 0.0))),
             (f"B {OFF_MM:g} mm off where the program thinks it", _with_offset(job, "b", (OFF_MM, 0.0, 0.0)))]
    rows = []
    for what, wrong in cases:
        found = begun(folder, wrong, options=DRAFT_OPTIONS).drafted().findings
        rows.append((f"{what}: findings ({', '.join(sorted({f.kind for f in found}))})", len(found), ""))
    return rows


def _with_stock(job, part, skin_mm):
    return job.model_copy(update={"stock": settled(StockSkin(skin_mm=skin_mm), part, Practice())})


def _with_bent_blade(job):
    """The job with a casting whose other blades lean round the shaft, X, towards blade 1, along Z: the more, the farther out."""
    vertices, triangles = job.stock.shape.mesh
    radius, angle = np.hypot(*vertices[:, 1:].T), np.arctan2(-vertices[:, 1], vertices[:, 2])
    out = np.clip((radius / radius.max() - STRAIGHT_SHARE) / (1 - STRAIGHT_SHARE), 0.0, 1.0)
    is_other = np.abs(angle) > np.pi / sum(p.name.endswith(" face") for p in job.predicates)
    angle = angle - np.where(is_other, np.sign(angle) * BENT_RAD * out, 0.0)
    bent = np.column_stack([vertices[:, 0], -radius * np.sin(angle), radius * np.cos(angle)])
    return job.model_copy(update={"stock": StockMesh(mesh=(bent, triangles))})


def _with_offset(job, letter, offset_mm):
    """The job on a machine whose rotary axis stands off its place, and nobody has told."""
    rotary = getattr(job.machine, letter)
    return job.model_copy(update={"machine": job.machine.model_copy(update={letter: rotary.model_copy(update={
        "offset_mm": offset_mm})})})


if __name__ == "__main__":
    asked = tuple(sys.argv[1:])
    if len(asked) == 1 and Path(asked[0]).is_dir():
        rows = [*figures(Path(asked[0])), *spoilt(Path(asked[0]))]
    else:
        rows = measure(asked or SMALL, is_spoilt=not asked)
    for what, number, unit in rows:
        print(f"{what}: {number:.5g} {unit}", flush=True)
