"""Memory: programs of a million moves over the patch, posted, read back and verified in all stages.

A process of its own plans the passes of a ball, writes the text, reads it and asks for the whole verdict; after each
stage it tells the most memory that it has held so far (VmHWM, Linux).  The tips stay within the patch's outline, so
that stock is left along its border: the verdict has findings there.  The second program leans the ball about its middle, to a
side that turns once round along every pass, on a preset with two rotaries in its head.

    python bench/memory.py [upright | leaning] [moves]     one of both, of so many moves
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import simulation
import workload
from peers import peak_mb

from cuspline.app import catalogue
from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep
from cuspline.posts.writers.linuxcnc import post
from cuspline.program.program import Kind, Moves, Operation, Plane, Program
from cuspline.toolpaths.drop.exact_drop import ExactPart, drop_tips_mm
from cuspline.verification.samples import face_area_mm2
from cuspline.verification.verdict import Options, verify_setup

ALONG_MM, STEP_MM = 0.05, 0.12         # 2000 moves a pass, 500 passes
GOAL_GIB = {"upright": 4.0, "leaning": 1.5}
CLEARANCE_MM = 25.0
FEED = 1000.0
TOP_MM = 12.0                          # of the billet: above the highest place of the patch
FINISH = Finish(scallop_mm=0.01, profile_tolerance_mm=0.005, gouge_mm=0.01)
SHARE = "--moves"
MACHINES = {"upright": "mill_3axis", "leaning": "mill_head_head"}
LEAN_RAD = np.radians(12.0)
HIGHER_MM = 60.0                       # than the preset's zero: a head that leans comes down low


def program(tool, count, form):
    """Program of the first `count` moves of the passes, and those that lead to and from them."""
    xy = simulation.zigzag(ALONG_MM, STEP_MM)[:count]
    tips = np.column_stack([xy, drop_tips_mm(ExactPart.of_solid(workload.patch_solid()), xy, 6.0, 6.0)])
    axis = _axes(xy[:, 0], LEAN_RAD if form == "leaning" else 0.0)
    tips += tool.cutter.radius_mm * ((0.0, 0.0, 1.0) - axis)
    above = lambda tip: np.array([[*tip[:2], CLEARANCE_MM]])
    ends = np.vstack([tips, above(tips[-1])])
    kind = np.full(len(ends), Kind.FEED)
    kind[-1] = Kind.RAPID
    moves = Moves(start_mm=above(tips[0])[0], kind=kind, end_mm=ends, center_mm=np.full((len(ends), 3), np.nan),
                  plane=np.full(len(ends), Plane.XY), axis=np.vstack([axis, axis[-1:]]),
                  feed_mm_per_min=np.where(kind == Kind.FEED, FEED, 0.0))
    finish = Operation(name="finish", tool=tool, spindle_rpm=9000.0, coolant="off", moves=moves)
    return Program(name="patch", setup="setup-1", wcs="G54", wcs_in_words="corner of the patch", operations=(finish,),
                   clearance_z_mm=CLEARANCE_MM, header=("PATCH",))


def _axes(x, lean_rad):
    """(n, 3) axes that lean to a side that turns once round along a pass."""
    side = 2 * np.pi * x / workload.SIZE_MM[0]
    return np.column_stack([np.sin(lean_rad) * np.cos(side), np.sin(lean_rad) * np.sin(side), np.full(len(x), np.cos(lean_rad))])


def _machine(form):
    found = catalogue.find_machine(MACHINES[form])
    x, y, z = found.wcs_origin_mm
    return found.model_copy(update={"wcs_origin_mm": (x, y, z + HIGHER_MM)}) if form == "leaning" else found


def child(form, count):
    """Tells (what was done, CPU seconds, peak in MB) of every stage, one JSON list a line."""
    last = ["libraries loaded", time.process_time()]

    def say(text):
        print(json.dumps([last[0], time.process_time() - last[1], peak_mb()]), flush=True)
        last[:] = text, time.process_time()

    machine, tool = _machine(form), simulation.tool("ball", 6.0, 6.0)
    say("passes planned")
    planned = program(tool, count, form)
    say("text posted")
    text = post(planned, machine).text
    del planned
    say(f"text of {len(text) / 1e6:.0f} MB read")
    offset = machine.wcs_origin_mm if form == "leaning" else (100.0, 100.0, -300.0)
    moves = catalogue.reader_of(machine)(text, work_offsets={"G54": offset}, tool_lengths={1: tool.length_mm})
    del text
    solid = brep.the_solid(workload.patch_solid(), "patch")
    setup = Setup(name="setup-1", wcs_in_words="corner of the patch", faces=("patch",))
    top = max(brep.faces_of(solid), key=lambda face: face_area_mm2(face.shape))
    stock = StockBox(min_mm=(0.0, 0.0, workload.BOTTOM_MM), max_mm=(*workload.SIZE_MM, TOP_MM))
    verdict = verify_setup(moves, {1: tool}, solid, (top,), setup=setup, stock=stock, finish=FINISH, ball_radius_mm=6.0,
                           options=Options(mesh_checks=True), say=say)
    say("")
    kinds = ", ".join(sorted({f.kind for f in verdict.findings})) or "none"
    print(json.dumps([f"verdict on {len(moves)} moves (findings: {kinds})", 0.0, peak_mb()]), flush=True)


def measure(forms=tuple(MACHINES), count=1_000_000):
    """[(what, number, unit)]."""
    return [row for form in forms for row in _of_one(form, count)]


def _of_one(form, count):
    done = subprocess.run([sys.executable, __file__, SHARE, form, str(count)], cwd=Path(__file__).parent, capture_output=True,
                          text=True, check=True)
    *stages, (what, _, peak) = (json.loads(line) for line in done.stdout.splitlines())
    rows = [(f"{form}, {name.removeprefix('setup-1: ')}: most so far", mb, f"MB, {cpu:.0f} CPU s") for name, cpu, mb in stages]
    return [*rows, (f"{form}, {what}, all stages (goal at most {GOAL_GIB[form]:g})", peak / 1024, "GiB")]


if __name__ == "__main__":
    if SHARE in sys.argv:
        child(sys.argv[-2], int(sys.argv[-1]))
    else:
        given = sys.argv[1:]
        for what, number, unit in measure(*((given[:1],) if given else ()), *map(int, given[1:])):
            print(f"{what}: {number:.4g} {unit}", flush=True)
