"""Simulation and verdict beside planning, and beside peers' simulators, on the common patch.

Planning: exact tips of the passes.  Simulate and verify: the index over all moves and the deviation of more than
301 000 sample points of the patch along its normals.  One thread each, CPU seconds, one run.

MeshLib (swept volume by a distance volume) and FreeCAD (path simulator, if `freecadcmd` is on the path) simulate the
same ball along the same moves; ours gives the stock's height at every node of a grid of the same pitch.  MeshLib's work
is spread over all cores: its CPU seconds count.  Error: distance of vertices of the mesh, or of our nodes, to the exact
swept surface.
"""

import json
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numba
import numpy as np
import workload
from peers import HERE, peer_python, run_job

from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind, Plane
from cuspline.shop.cutters import Cutter, Holder, HolderSegment, Tool
from cuspline.stock.swept import deviations_and_moves, signed_distance_mm, stock_height_mm, swept_paths
from cuspline.toolpaths.drop.exact_drop import ExactPart, drop_tips_mm

LOW, HIGH = np.zeros(2), np.array(workload.SIZE_MM)           # passes; samples keep REACH_MM from their border
REACH_MM = 8.0
STEPS_MM = {240_000: (0.1, 0.25), 1_200_000: (0.05, 0.1)}     # along a pass, and from pass to pass
GOALS = {240_000: 2.0, 1_200_000: 1.0}
CUTTERS = {"ball R6": ("ball", 6.0, 6.0), "bull nose R10 r1": ("bull_nose", 10.0, 1.0)}
SAMPLES = (1000, 500)                                         # of the whole patch: 301 000 of them lie inside
CHECKED = 60                                                  # samples held against brute force
BRACKET_MM = 0.05                                             # in which brute force looks for the surface
SHOWN_MM = 0.04                                               # samples with a deviation below this are held against it
PEER_MOVES = 240_000
VOXELS_MM = (0.5, 0.25)
TOOL_MM = 20.0                                                # MeshLib's, tip to upper end: all of the patch's height
GRID_MM = 0.1                                                 # FreeCAD's
LEAST_MM = 1e-9                                               # error that cuspline is counted with at least
BILLET = (np.array((0.0, 0.0, workload.BOTTOM_MM)), np.array((100.0, 60.0, 20.0)))


def tool(kind, radius_mm, corner_mm):
    """A tool with room for every pass."""
    cutter = Cutter(name=kind, type=kind, diameter_mm=2 * radius_mm, corner_radius_mm=corner_mm, flutes=2,
                    flute_length_mm=40.0, neck_diameter_mm=1.8 * radius_mm, reach_mm=60.0,
                    shank_diameter_mm=2 * radius_mm, overall_length_mm=100.0)
    segment = HolderSegment(height_mm=40.0, lower_diameter_mm=40.0, upper_diameter_mm=40.0)
    holder = Holder(name="holder", segments=(segment,))
    return Tool(number=1, cutter=cutter, holder=holder, stick_out_mm=70.0)


def zigzag(along_mm, step_mm):
    """(n, 2) places of the passes, to and fro."""
    x, rows = np.arange(LOW[0], HIGH[0], along_mm), np.arange(LOW[1], HIGH[1], step_mm)
    return np.concatenate([np.column_stack([x if k % 2 == 0 else x[::-1], np.full(len(x), y)])
                           for k, y in enumerate(rows)])


def posted(tips):
    """Feed moves from tip to tip, as if read from a program."""
    n = len(tips) - 1
    return PostedMoves(
        kind=np.full(n, Kind.FEED), start_mm=tips[:-1], end_mm=tips[1:], center_mm=np.full((n, 3), np.nan),
        plane=np.full(n, Plane.XY), turns=np.zeros(n), feed_mm_per_min=np.full(n, 1000.0),
        spindle_rpm=np.full(n, 9000.0), tool=np.ones(n), length_offset_on=np.ones(n, bool), machine_end_mm=tips[1:],
        line=np.arange(n) + 1, operation=np.zeros(n), operations=("finish",), ended=True)


def samples():
    """Points (n, 3) and normals (n, 3) of the patch, away from the passes' border."""
    rng = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(*((np.arange(n) + 0.5) / n for n in SAMPLES), indexing="ij"), axis=-1).reshape(-1, 2)
    u, v = (grid + rng.uniform(-0.4, 0.4, grid.shape) / SAMPLES).T
    shape = workload.local_shape(workload.patch().derivatives(u, v))
    inside = ((shape.point_mm[:, :2] > LOW + REACH_MM) & (shape.point_mm[:, :2] < HIGH - REACH_MM)).all(axis=1)
    return shape.point_mm[inside], shape.normal[inside]


def measure():
    """[(what, number, unit)]."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    part, (points, normals) = ExactPart.of_solid(workload.patch_solid()), samples()
    rows = [("sample points", len(points), "")]
    for count, steps in STEPS_MM.items():
        for name, (kind, R, rc) in CUTTERS.items():
            rows += _of_path(f"{name}, {count // 1000} 000 moves", part, points, normals, tool(kind, R, rc),
                             zigzag(*steps), count)
    rows += _beside_peers(part)
    numba.set_num_threads(before)
    return rows


def _of_path(what, part, points, normals, cutter, xy, count):
    radius, corner = cutter.cutter.radius_mm, cutter.cutter.corner_radius_mm
    drop_tips_mm(part, xy[:1000], radius, corner)                      # compiled before
    plan, tips = timed(lambda: drop_tips_mm(part, xy, radius, corner))
    moves = posted(np.column_stack([xy, tips]))
    swept_paths(posted(np.column_stack([xy, tips])[:1000]), {1: cutter})
    build, paths = timed(lambda: swept_paths(moves, {1: cutter}))
    deviations_and_moves(paths, *BILLET, points[:100], normals[:100], 2.0)
    verify, (found, _) = timed(lambda: deviations_and_moves(paths, *BILLET, points, normals, 2.0))
    ratio = (build + verify) / plan
    return [(f"{what}: planning", plan, "CPU s"), (f"{what}: index", build, "CPU s"),
            (f"{what}: deviations", verify, "CPU s"),
            (f"{what}: simulate and verify over planning (goal at most {GOALS[count]:g})", ratio, "times"),
            (f"{what}: deepest gouge", -found.min() * 1e3, "µm"),
            (f"{what}: largest difference to brute force of {CHECKED} samples",
             _off(moves, points, normals, found, radius, corner), "mm")]


def _beside_peers(part):
    """Rows of the ball's path simulated by the peers that are here, and by us at the same pitch."""
    kind, R, rc = CUTTERS["ball R6"]
    xy = zigzag(*STEPS_MM[PEER_MOVES])
    tips = np.column_stack([xy, drop_tips_mm(part, xy, R, rc)])
    build, paths = timed(lambda: swept_paths(posted(tips), {1: tool(kind, R, rc)}))
    rows = []
    for what, pitch, seconds, off, (goal, error_goal) in [*_meshlib(tips, paths, R), *_freecad(tips, paths, R)]:
        nodes = _nodes(pitch)
        stock_height_mm(paths, nodes[:100], BILLET[1][2])
        query, z = timed(lambda: stock_height_mm(paths, nodes, BILLET[1][2]))
        own, error = _node_error(tips, nodes, z, R, rc), np.percentile(np.abs(off), 98)
        rows += [(f"{what}, {len(xy)} moves", seconds, "CPU s"),
                 (f"{what}: 98 % of {len(off)} vertices are off by no more than", error * 1e3, "µm"),
                 (f"cuspline, {len(nodes)} nodes {pitch} mm apart: index and heights", build + query, "CPU s"),
                 (f"cuspline, same: largest error of {CHECKED} nodes by brute force", own * 1e3, "µm"),
                 (f"{what} over cuspline: CPU seconds (goal at least {goal})", seconds / (build + query), "times"),
                 (f"{what} over cuspline: error, no less than {LEAST_MM:g} mm (goal at least {error_goal})",
                  error / max(own, LEAST_MM), "times")]
    return rows


def _nodes(pitch_mm):
    """(n, 2) nodes of a grid over the billet."""
    x, y = (np.arange(a, b, pitch_mm) for a, b in zip(*(corner[:2] for corner in BILLET)))
    return np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])


def _node_error(tips, nodes, z, radius, corner):
    """Largest distance from the swept surface, by brute force, of nodes under the passes."""
    inside = ((nodes > LOW + REACH_MM) & (nodes < HIGH - REACH_MM)).all(axis=1)
    pick = np.random.default_rng(5).choice(np.flatnonzero(inside), CHECKED, replace=False)
    near = [np.flatnonzero(np.abs(tips[:-1, :2] - nodes[k]).max(axis=1) < 2 * radius + 1.0) for k in pick]
    return max(abs(_distance(tips[rows], tips[rows + 1], np.array((*nodes[k], z[k])), radius, corner))
               for k, rows in zip(pick, near))


def _meshlib(tips, paths, radius):
    """[(what, pitch, CPU seconds, errors of vertices in mm, goals)]."""
    python, held = peer_python()
    if not any(pin.startswith("meshlib") for pin in held):
        return []
    tasks = [{"kind": "swept", "name": f"swept {voxel}", "tips": "tips.npy", "radius_mm": radius, "length_mm": TOOL_MM,
              "voxel_mm": voxel} for voxel in VOXELS_MM]
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        np.save(folder / "tips.npy", tips)
        mesh = workload.patch_grid(2, 2)[:2]
        done = run_job(python, "meshlib", folder, mesh, tasks, repeats=1)["tasks"]
        found = [(v, done[t["name"]]["cpu_s"], np.load(folder / f"{t['name']} meshlib.npy"))
                 for v, t in zip(VOXELS_MM, tasks)]
    highest = tips[:, 2].min() + TOOL_MM / 2
    return [(f"MeshLib, voxel {v} mm", v, seconds, _vertex_errors(paths, vertices, highest), (100, 10))
            for v, seconds, vertices in found]


def _freecad(tips, paths, radius):
    """The same of FreeCAD; [] where it is not installed."""
    program = shutil.which("freecadcmd") or shutil.which("FreeCADCmd")
    if program is None:
        print("freecadcmd is not on the path: FreeCAD's rows are left out", flush=True)
        return []
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        np.save(folder / "tips.npy", tips)
        (folder / "job.json").write_text(json.dumps({"low_mm": BILLET[0].tolist(), "high_mm": BILLET[1].tolist(),
                                                     "pitch_mm": GRID_MM, "radius_mm": radius}))
        subprocess.run([program, HERE / "freecad_job.py"], cwd=folder, check=True, stdin=subprocess.DEVNULL)
        told, vertices = json.loads((folder / "results freecad.json").read_text()), np.load(folder / "freecad.npy")
    return [(f"FreeCAD {told['version']}, grid {GRID_MM} mm", GRID_MM, told["cpu_s"],
             _vertex_errors(paths, vertices, BILLET[1][2] - 1.0), (10, 1000))]


def _vertex_errors(paths, vertices, highest_mm):
    """(n,) signed distances to the exact swept volume of vertices under the passes and below a height."""
    under = ((vertices[:, :2] > LOW + REACH_MM) & (vertices[:, :2] < HIGH - REACH_MM)).all(axis=1)
    under &= (vertices[:, 2] > BILLET[0][2] + 1.0) & (vertices[:, 2] < highest_mm)
    return signed_distance_mm(paths, vertices[under])


def _off(moves, points, normals, found, radius, corner):
    """Largest difference of the deviations to a bisection with every move asked, mm."""
    pick = np.random.default_rng(3).choice(np.flatnonzero(np.abs(found) < SHOWN_MM), CHECKED, replace=False)
    return max(abs(found[k] - _by_brute_force(moves, points[k], normals[k], radius, corner)) for k in pick)


def _by_brute_force(moves, point, normal, radius, corner):
    near = np.abs(moves.start_mm[:, :2] - point[:2]).max(axis=1) < 2 * radius + 1.0
    start, end = moves.start_mm[near], moves.end_mm[near]
    distance = lambda t: _distance(start, end, point + t * normal, radius, corner)
    here = distance(0.0)
    low, high = (0.0, BRACKET_MM) if here > 0 else (-BRACKET_MM, 0.0)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if distance(middle) > 0 else (low, middle)
    return (low + high) / 2


def _distance(start, end, point, radius, corner):
    """Least signed distance of a point to cutters anywhere along the moves: ternary search along each, all at once.

    Moves that are farther in their middle by more than half their length cannot be the nearest.
    """
    a, half = radius - corner, np.linalg.norm(end - start, axis=1) / 2

    def at(t, start=start, end=end):
        tip = start + t[:, None] * (end - start)
        beside, below = np.hypot(*(point[:2] - tip[:, :2]).T) - a, tip[:, 2] + corner - point[2]
        out = np.hypot(np.maximum(beside, 0), np.maximum(below, 0))
        return np.where((beside > 0) & (below > 0), out, np.maximum(beside, below)) - corner

    middle = at(np.full(len(start), 0.5))
    near = middle - half <= (middle + half).min()
    start, end = start[near], end[near]
    low, high = np.zeros(len(start)), np.ones(len(start))
    for _ in range(90):
        one, two = low + (high - low) / 3, high - (high - low) / 3
        left = at(one, start, end) < at(two, start, end)
        low, high = np.where(left, low, one), np.where(left, two, high)
    return at((low + high) / 2, start, end).min()


def timed(job):
    """(CPU seconds, what came of it)."""
    begin = time.process_time()
    found = job()
    return time.process_time() - begin, found


if __name__ == "__main__":
    for what, number, unit in measure():
        print(f"{what}: {np.round(number, 9)} {unit}", flush=True)
