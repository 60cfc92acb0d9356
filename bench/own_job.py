"""cuspline on the same folder of arrays as opencamlib_job.py: python own_job.py folder.

The kernels are compiled beforehand on one triangle, so that neither time nor memory counts the compiler.
"""

import json
import os
import sys
import time
from pathlib import Path

import numba
import numpy as np
from peers import peak_mb

from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_tips_mm
from cuspline.toolpaths.freeform.waterline import mesh_waterlines


def timed(run):
    cpu, wall = time.process_time(), time.perf_counter()
    result = run()
    return time.process_time() - cpu, time.perf_counter() - wall, result


def drop(mesh, task, folder):
    xy = np.load(folder / task["xy"])
    cpu, wall, tips = timed(lambda: drop_tips_mm(mesh, xy, task["radius_mm"], task["corner_radius_mm"]))
    np.save(folder / f"{task['name']} own.npy", tips)
    return cpu, wall, len(tips)


def waterline(mesh, task, folder):
    cpu, wall, loops = timed(lambda: mesh_waterlines(
        mesh, task["heights_mm"], task["radius_mm"], task["corner_radius_mm"], pitch_mm=task["pitch_mm"],
        chord_mm=np.inf, tolerance_mm=task["tolerance_mm"]))
    return cpu, wall, sum(len(loop.tip_mm) for loop in loops)


def warm():
    mesh = DropMesh.from_triangles([[0, 0, 0], [9, 0, 0], [0, 9, 5]], [[0, 1, 2]])
    drop_tips_mm(mesh, np.random.default_rng(1).uniform(0, 9, (4000, 2)), 2.0, 1.0)
    mesh_waterlines(mesh, [1.0], 2.0, 2.0, pitch_mm=1.0, chord_mm=np.inf)


def main(folder):
    job = json.loads((folder / "job.json").read_text())
    numba.set_num_threads(min(job["threads"], os.cpu_count()))
    vertices, triangles = np.load(folder / "vertices.npy"), np.load(folder / "triangles.npy")
    warm()
    before = peak_mb()
    build_s, _, mesh = timed(lambda: DropMesh.from_triangles(vertices, triangles))
    results = {}
    for task in job["tasks"]:
        kind = {"drop": drop, "waterline": waterline}[task["kind"]]
        cpu, wall, count = zip(*(kind(mesh, task, folder) for _ in range(job["repeats"])))
        results[task["name"]] = {"cpu_s": min(cpu), "wall_s": min(wall), "count": count[0]}
    (folder / "results own.json").write_text(json.dumps(
        {"tasks": results, "build_cpu_s": build_s, "before_mb": before, "peak_mb": peak_mb()}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
