"""coal on a folder of arrays, in its own environment: python coal_job.py folder.

Needs nothing of cuspline.  job.json holds the tasks; vertices.npy and triangles.npy the mesh; segments.npy the tool's
cylinders (z0, r0, z1, ...); tips.npy and axes.npy the poses.  Only the queries count, in CPU seconds.
"""

import json
import sys
import time
from importlib.metadata import version
from pathlib import Path

import coal
import numpy as np


def mesh_of(vertices, triangles):
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(vertices))
    mesh.addVertices(vertices)
    mesh.addTriangles(triangles.astype(np.int32))
    mesh.endModel()
    return mesh


def placements(tips, axes, segments):
    """[[Transform3s of each cylinder] of each pose]; a cylinder's origin is its middle."""
    side = np.cross(np.where(np.abs(axes[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]]), axes)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    turns = np.stack([side, np.cross(axes, side), axes], axis=2)
    return [[coal.Transform3s(turn, tip + axis * 0.5 * (s[0] + s[2])) for s in segments]
            for turn, tip, axis in zip(turns, tips, axes)]


def distances(mesh, cylinders, places):
    request, result, here = coal.DistanceRequest(), coal.DistanceResult(), coal.Transform3s()
    out = np.empty(len(places))
    start = time.process_time()
    for k, poses in enumerate(places):
        least = np.inf
        for cylinder, pose in zip(cylinders, poses):
            result.clear()
            least = min(least, coal.distance(mesh, here, cylinder, pose, request, result))
        out[k] = least
    return time.process_time() - start, out


def collisions(mesh, cylinders, places, margin):
    request, result, here = coal.CollisionRequest(), coal.CollisionResult(), coal.Transform3s()
    out = np.zeros(len(places))
    request.security_margin, request.num_max_contacts = margin, 1
    start = time.process_time()
    for k, poses in enumerate(places):
        for cylinder, pose in zip(cylinders, poses):
            result.clear()
            if coal.collide(mesh, here, cylinder, pose, request, result):
                out[k] = 1
                break
    return time.process_time() - start, out


def main(folder):
    job = json.loads((folder / "job.json").read_text())
    load = lambda name: np.load(folder / f"{name}.npy")
    segments, mesh = load("segments"), mesh_of(load("vertices"), load("triangles"))
    cylinders = [coal.Cylinder(s[1], s[2] - s[0]) for s in segments]
    results = {}
    for task in job["tasks"]:
        places = placements(load("tips")[::task["every"]], load("axes")[::task["every"]], segments)
        run = ((lambda: distances(mesh, cylinders, places)) if task["kind"] == "distance" else
               (lambda: collisions(mesh, cylinders, places, task["margin_mm"])))
        runs = [run() for _ in range(job["repeats"])]
        np.save(folder / f"{task['name']} coal.npy", runs[0][1])
        results[task["name"]] = {"cpu_s": min(r[0] for r in runs), "count": len(places)}
    (folder / "results coal.json").write_text(json.dumps({"version": version("coal"), "tasks": results}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
