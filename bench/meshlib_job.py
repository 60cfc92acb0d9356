"""MeshLib on a folder of arrays, in its own environment: python meshlib_job.py folder.

Needs nothing of cuspline.  job.json holds the tasks; vertices.npy and triangles.npy a mesh of the part's top.

cusp: constant cusp.  Its positions are the ball's centre; ways above the safe height are left out.  Each task's path is
written as rows (x, y, z of the tip, number of the pass).

swept: what a ball sweeps along the tips of a file, by its distance volume; written are the mesh's vertices.
"""

import json
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
from meshlib import mrmeshnumpy, mrmeshpy

SAFE_MM = 40.0


def constant_cusp(mesh, task, folder):
    params = mrmeshpy.ConstantCuspParams()
    params.millRadius, params.voxelSize, params.sectionStep = task["radius_mm"], task["voxel_mm"], task["step_mm"]
    params.safeZ, params.critTransitionLength = SAFE_MM, 0.0
    params.plungeLength = params.retractLength = 1.0
    params.plungeFeed, params.retractFeed, params.baseFeed = 200.0, 1000.0, 500.0
    cpu, wall = time.process_time(), time.perf_counter()
    found = mrmeshpy.constantCuspToolPath(mrmeshpy.MeshPart(mesh), params)
    seconds = time.process_time() - cpu, time.perf_counter() - wall
    rows = positions(found.commands)
    rows[:, 2] -= task["radius_mm"]
    np.save(folder / f"{task['name']} meshlib.npy", rows)
    return *seconds, len(rows)


def swept(mesh, task, folder):
    cutter = mrmeshpy.EndMillCutter()
    cutter.type = mrmeshpy.EndMillCutter.Type.Ball
    tool = mrmeshpy.EndMillTool(task["length_mm"], 2 * task["radius_mm"], cutter)
    body = tool.toMesh()
    path = mrmeshpy.Polyline3(mrmeshnumpy.fromNumpyArray(np.load(folder / task["tips"])))
    params = mrmeshpy.ComputeSweptVolumeParameters(path, mrmeshpy.MeshPart(body), tool, task["voxel_mm"], 0,
                                                   mrmeshpy.func_bool_from_float())
    cpu, wall = time.process_time(), time.perf_counter()
    found = mrmeshpy.computeSweptVolumeWithDistanceVolume(params)
    seconds = time.process_time() - cpu, time.perf_counter() - wall
    vertices = mrmeshnumpy.getNumpyVerts(found)
    np.save(folder / f"{task['name']} meshlib.npy", vertices)
    return *seconds, len(vertices)


def positions(commands):
    """(n, 4) x, y, z and pass of the linear moves below the safe height; a coordinate not given stays as it is."""
    at, rows, run, is_down = [np.nan] * 3, [], 0, False
    for c in commands:
        for k, value in enumerate((c.x, c.y, c.z)):
            at[k] = value if np.isfinite(value) else at[k]
        down = c.type == mrmeshpy.MoveType.Linear and np.isfinite(at).all() and at[2] < SAFE_MM - 1.0
        run += is_down and not down
        is_down = down
        if down:
            rows.append((*at, run))
    return np.array(rows)


def main(folder):
    job = json.loads((folder / "job.json").read_text())
    mesh = mrmeshnumpy.meshFromFacesVerts(np.load(folder / "triangles.npy").astype(np.int32),
                                          np.load(folder / "vertices.npy"))
    results = {}
    for task in job["tasks"]:
        cpu, wall, count = {"cusp": constant_cusp, "swept": swept}[task["kind"]](mesh, task, folder)
        results[task["name"]] = {"cpu_s": cpu, "wall_s": wall, "count": count}
    (folder / "results meshlib.json").write_text(json.dumps({"version": version("meshlib"), "tasks": results}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
