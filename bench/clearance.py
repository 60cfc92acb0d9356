"""Clearance of shank and holder along a tilted raster, beside coal.

The tool (shank R5 from 12 to 45 mm above the tip, holder R20 to 100 mm) follows the wavy patch, leaning up to 30° and
20°, past a wall of 60 mm.  coal answers poses, one at a time; cuspline answers distances of poses, and the whole
motion from each pose to the next.
"""

import tempfile
import time
from pathlib import Path

import numpy as np
import workload
from peers import peer_python, run_job

from cuspline.replay.clearance import ClearanceTree, ToolMoves
from cuspline.values.threads import set_thread_count

SEGMENTS = np.array([[12.0, 5.0, 45.0, 5.0, 0.0], [45.0, 20.0, 100.0, 20.0, 0.0]])
MARGIN_MM, CAP_MM = 1.0, 4.0
EVERY = 100               # of the poses, for distances: far apart, nothing is inherited
COAL_EVERY, MARGIN_EVERY = 500, 10
TOLERANCES_MM = (1e-2, 1e-3)
DEVIATIONS_MM = (0.020, 0.005)


def mesh_with_wall(deviation_mm):
    """The wavy patch's triangles and a wall beside it, in triangles of about 4 mm."""
    vertices, triangles, _ = workload.patch_mesh(deviation_mm)
    x, z = (a.ravel() for a in np.meshgrid(np.linspace(-10, 110, 31), np.linspace(-10, 60, 18), indexing="ij"))
    index = len(vertices) + np.arange(31 * 18).reshape(31, 18)
    a, b, c, d = (q.ravel() for q in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    return (np.vstack([vertices, np.column_stack([x, np.full(len(x), 78.0), z])]),
            np.vstack([triangles, np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def poses():
    """Tips and axes every 0.1 mm along rows 1 mm apart, to and fro."""
    x, y = np.arange(2, 98, 0.1), np.arange(2, 58, 1.0)
    xy = np.vstack([np.column_stack([x if k % 2 == 0 else x[::-1], np.full(len(x), level)])
                    for k, level in enumerate(y)])
    bump = 5 * np.exp(-((xy[:, 0] - 70) ** 2 + (xy[:, 1] - 38) ** 2) / (2 * 7.0 ** 2))
    z = 5 * np.sin(2 * np.pi * xy[:, 0] / 50) * np.sin(2 * np.pi * xy[:, 1] / 40) + bump
    lean, tilt = np.radians(30) * np.sin(xy[:, 0] / 15), np.radians(20) * np.cos(xy[:, 1] / 11)
    axes = np.column_stack([np.sin(lean) * np.cos(tilt), np.sin(tilt), np.cos(lean) * np.cos(tilt)])
    return np.column_stack([xy, z]), axes


def _rate(run, count, repeats=3):
    """Answers per CPU second, best of a few runs after one that compiles, and the answers."""
    run()
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        found = run()
        seconds.append(time.process_time() - start)
    return count / min(seconds), found


def _coal(mesh, tips, axes):
    """(distance rate, distances, margin rate, hits) of coal, or None where it is not there."""
    python, held = peer_python()
    if not any(pin.startswith("coal") for pin in held):
        return None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for key, value in (("segments", SEGMENTS), ("tips", tips), ("axes", axes)):
            np.save(folder / f"{key}.npy", value)
        done = run_job(python, "coal", folder, mesh, [
            {"name": "distance", "kind": "distance", "every": COAL_EVERY},
            {"name": "margin", "kind": "margin", "every": MARGIN_EVERY, "margin_mm": MARGIN_MM}], repeats=2)["tasks"]
        rate = lambda task: done[task]["count"] / done[task]["cpu_s"]
        found = [np.load(folder / f"{name} coal.npy") for name in ("distance", "margin")]
        return rate("distance"), found[0], rate("margin"), found[1]


def measure():
    """[(what, number, unit)]."""
    set_thread_count(1)
    rows = []
    for deviation in DEVIATIONS_MM:
        rows += _on_mesh(mesh_with_wall(deviation))
    return rows


def _on_mesh(mesh):
    tips, axes = poses()
    tree, label, peer = ClearanceTree.of_triangles(*mesh), f"{len(mesh[1])} triangles", _coal(mesh, tips, axes)
    far = slice(None, None, EVERY)
    for tolerance in TOLERANCES_MM:
        rate, _ = _rate(lambda: tree.distances_mm(SEGMENTS, tips[far], axes[far], tolerance), len(tips[far]))
        yield f"{label}: distance to {tolerance * 1e3:g} µm, scattered poses", rate / 1e3, "k poses / CPU s"
        if peer:
            yield f"{label}: the same against coal's distance", rate / peer[0], "x (goal 25 at 1 µm)"
    moves = ToolMoves(start_tips_mm=tips[:-1], end_tips_mm=tips[1:], start_axes=axes[:-1], end_axes=axes[1:])
    rate, found = _rate(lambda: tree.certified_clearance(SEGMENTS, moves, MARGIN_MM, CAP_MM), len(tips) - 1)
    yield f"{label}: whole moves proven to keep {MARGIN_MM:g} mm", rate / 1e3, "k moves / CPU s"
    yield f"{label}: moves that do not keep it", 100 * (1 - found.is_clear.mean()), "%"
    if not peer:
        return
    yield f"{label}: the same against coal's collide of poses", rate / peer[2], "x (goal 5)"
    yield f"{label}: coal, distance", peer[0], "poses / CPU s"
    yield f"{label}: coal, collide with security_margin 1 mm", peer[2] / 1e3, "k poses / CPU s"
    own, clear = tree.distances_mm(SEGMENTS, tips[::COAL_EVERY], axes[::COAL_EVERY], 1e-4), peer[1] > 0.05
    yield f"{label}: largest difference from coal's distance", float(np.abs(own - peer[1])[clear].max()), "mm"
    unseen = peer[3][:-1].astype(bool) & np.append(found.is_clear, False)[::MARGIN_EVERY][:len(peer[3]) - 1]
    yield f"{label}: poses that coal finds too near on moves proven clear", float(unseen.sum()), ""


if __name__ == "__main__":
    for what, number, unit in measure():
        print(f"{what:75s} {number:12.4g} {unit}")
