"""opencamlib on a folder of arrays, in its own environment: python opencamlib_job.py folder.

Needs nothing of cuspline.  job.json holds threads, repeats and the tasks; vertices.npy and triangles.npy the mesh.
Only run() counts; results.json takes CPU and wall seconds (best of the repeats) and the peak memory.
opencamlib keeps bare pointers to what it is handed: cutter and surface must outlive the run.
"""

import json
import re
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import opencamlib as ocl

LENGTH_MM = 100.0       # of the cutter
FLOOR_MM = -100.0       # tips never come out lower than the point they start from


def peak_mb():
    return int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())[1]) / 1024


def surface_of(vertices, triangles):
    surface = ocl.STLSurf()
    for triangle in triangles:
        surface.addTriangle(ocl.Triangle(*(ocl.Point(*vertices[k].tolist()) for k in triangle)))
    return surface


def cutter_of(radius_mm, corner_radius_mm):
    if corner_radius_mm == 0:
        return ocl.CylCutter(2 * radius_mm, LENGTH_MM)
    if corner_radius_mm == radius_mm:
        return ocl.BallCutter(2 * radius_mm, LENGTH_MM)
    return ocl.BullCutter(2 * radius_mm, corner_radius_mm, LENGTH_MM)


def timed(run):
    cpu, wall = time.process_time(), time.perf_counter()
    run()
    return time.process_time() - cpu, time.perf_counter() - wall


def drop(surface, cutter, task, threads, folder):
    batch = ocl.BatchDropCutter()
    batch.setSTL(surface)
    batch.setCutter(cutter)
    batch.setThreads(threads)
    for x, y in np.load(folder / task["xy"]).tolist():
        batch.appendPoint(ocl.CLPoint(x, y, FLOOR_MM))
    seconds = timed(batch.run)
    tips = np.array([p.z for p in batch.getCLPoints()])
    np.save(folder / f"{task['name']} opencamlib.npy", tips)
    return *seconds, len(tips)


def waterline(surface, cutter, task, threads, folder):
    cpu = wall = points = 0
    for height in task["heights_mm"]:
        line = ocl.Waterline()
        line.setSTL(surface)
        line.setCutter(cutter)
        line.setThreads(threads)
        line.setSampling(task["pitch_mm"])
        line.setZ(height)
        c, w = timed(line.run)
        cpu, wall, points = cpu + c, wall + w, points + sum(len(loop) for loop in line.getLoops())
    return cpu, wall, points


def main(folder):
    job = json.loads((folder / "job.json").read_text())
    vertices, triangles = np.load(folder / "vertices.npy"), np.load(folder / "triangles.npy")
    before = peak_mb()
    surface, results = surface_of(vertices, triangles), {}
    for task in job["tasks"]:
        cutter = cutter_of(task["radius_mm"], task["corner_radius_mm"])
        kind = {"drop": drop, "waterline": waterline}[task["kind"]]
        cpu, wall, count = zip(*(kind(surface, cutter, task, job["threads"], folder) for _ in range(job["repeats"])))
        results[task["name"]] = {"cpu_s": min(cpu), "wall_s": min(wall), "count": count[0]}
    (folder / "results opencamlib.json").write_text(json.dumps(
        {"version": version("opencamlib"), "tasks": results, "before_mb": before, "peak_mb": peak_mb()}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
