"""A tool that leans in the cut: a dome finished on a trunnion, built with all proofs; one surface on every five-axis machine."""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from peers import HERE

from cuspline.app.catalogue import find_library, find_machine, reader_of
from cuspline.planning.plan import plan_setup
from cuspline.posts.writers import linuxcnc
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece

PARTS = HERE.parent / "tests" / "parts"
sys.path.append(str(PARTS))         # for leaning_surface
FIRST, *OTHERS = ("mill_head_table_bc", "mill_head_head", "mill_table_table", "mill_head_table", "mill_a_on_b", "mill_trunnion_ac")
HIGHER_MM = 60.0            # than the preset's zero: heads that lean come down low
EVERY_MM = 1.2              # between places looked at


def measure():
    """[(what, number, unit)]."""
    return _built() + [row for form in ("dome", "saddle", "blade") for row in _alike(form)]


def _built():
    """The dome through `cuspline build`, as a user would."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        begin = os.times()
        subprocess.run([Path(sys.executable).with_name("cuspline"), "build", PARTS / "leaning_surface.py", "--out", out],
                       check=True, capture_output=True)
        end = os.times()
        found = json.loads((out / "verify.json").read_text())
    seconds = end.children_user + end.children_system - begin.children_user - begin.children_system
    proven = found["setups"][0]["certificate"]["moves"]
    return [("dome, 32 x 24 mm, on a trunnion: the whole build", seconds, "CPU s"), ("findings", len(found["findings"]), ""),
            ("moves proven", sum(proven.values()), ""),
            *((f"{name.replace('_mm', '').replace('_', ' ')}", found[name] * 1e3, "um") for name in (
                "gouge_max_mm", "gouge_proven_mm", "excess_max_mm", "excess_proven_mm"))]


def _machine(name):
    found = find_machine(name)
    x, y, z = found.wcs_origin_mm
    return found.model_copy(update={"wcs_origin_mm": (x, y, z + HIGHER_MM)})


def _alike(form):
    """One plan, posted for every machine, read back and cut: how far what is left differs at the same places."""
    from leaning_surface import Surface, design
    library, part = find_library(None), design(Surface(form=form))
    begin = time.process_time()
    plan = plan_setup(part, part.setups[0], _machine(FIRST), library)
    planned = time.process_time() - begin
    tools = {t.number: t for t in library.tools}
    samples = plan.context.samples
    rows = np.unique(np.round(samples.point_mm[:, :2] / EVERY_MM).astype(int), axis=0, return_index=True)[1]

    def left(name):
        mill = _machine(name)
        text = linuxcnc.post(plan.program(("LEANING",), "leaning"), mill).text
        moves = reader_of(mill)(text, work_offsets={"G54": mill.wcs_origin_mm},
                                tool_lengths={n: t.length_mm for n, t in tools.items()})
        cut = Workpiece(blank=part.stock.shape).after(part.setups[0].frame, swept_paths(moves, tools))
        return cut.deviations(samples.point_mm[rows], samples.normal[rows], 1.0)[0]

    first = left(FIRST)
    worst = max(float(np.abs(left(name) - first).max()) for name in OTHERS)
    return [(f"{form}, {len(rows)} places: largest difference between {FIRST} and five others", worst * 1e3, "um"),
            (f"{form}: to plan it", planned, "CPU s")]
