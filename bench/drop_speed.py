"""Drop-cutter and waterline on meshes against opencamlib: CPU seconds, one thread each, same mesh, same tips."""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import workload
from peers import run_job

RASTER_MM = (10, 90, 0.1), (10, 50, 1.0)        # low, high, step: 0.1 mm along rows 1 mm apart
PEER_POINTS = {0.020: 600, 0.005: 150}          # opencamlib takes about a second for so many
DROP_GOALS = {0.020: 200, 0.005: 1000}
WATERLINE_GOAL = 100
HEIGHTS_MM = np.linspace(-4, 8, 25).tolist()
PITCH_MM = 0.5
CURVE = (10_000, 100_000, 1_000_000, 10_000_000)


@dataclass(frozen=True, eq=False, kw_only=True)
class Ratio:
    """One line of the table of ratios; rates are per CPU second."""

    what: str
    own: float
    unit: str
    peer: float = np.nan
    goal: float = np.nan        # own over peer
    below_mm: float = np.nan    # how far our tips lie below the peer's at most: cutting in, should the peer be right
    above_mm: float = np.nan    # and above; each of our tips has its contact on the mesh, so there the peer cuts in

    @property
    def ratio(self):
        return self.own / self.peer


def raster():
    """(n, 2) positions in the order of a raster path."""
    x, y = (np.arange(low, high + 1e-9, step) for low, high, step in RASTER_MM)
    return np.stack(np.meshgrid(y, x, indexing="ij")[::-1], axis=-1).reshape(-1, 2)


def _task(kind, name, **more):
    radius, corner = workload.CUTTERS[name]
    return {"kind": kind, "name": name, "radius_mm": radius, "corner_radius_mm": corner, **more}


def drop_ratios(peer, mesh, label, goal, peer_points):
    """A Ratio a cutter on one mesh, and the memory of both sides; peer None leaves opencamlib out."""
    with tempfile.TemporaryDirectory() as name:
        folder, rows = Path(name), raster()
        few = np.sort(np.random.default_rng(1).choice(len(rows), peer_points, replace=False))
        np.save(folder / "all.npy", rows)
        np.save(folder / "few.npy", rows[few])
        own = run_job(sys.executable, "own", folder, mesh, [_task("drop", c, xy="all.npy") for c in workload.CUTTERS])
        other = run_job(peer, "opencamlib", folder, mesh, [_task("drop", c, xy="few.npy") for c in workload.CUTTERS],
                        repeats=2) if peer else None
        ratios = []
        for cutter in workload.CUTTERS:
            rate = _rate(own, cutter)
            if other is None:
                ratios.append(Ratio(what=f"drop, {label}, {cutter}", own=rate, unit="points/s", goal=goal))
                continue
            tips, peers = np.load(folder / f"{cutter} own.npy")[few], np.load(folder / f"{cutter} opencamlib.npy")
            ratios.append(Ratio(what=f"drop, {label}, {cutter}", own=rate, unit="points/s", goal=goal,
                                peer=_rate(other, cutter), below_mm=max(0.0, (peers - tips).max()),
                                above_mm=max(0.0, (tips - peers).max())))
    return ratios, own, other


def _rate(results, name, by="cpu_s"):
    task = results["tasks"][name]
    return task["count"] / task[by]


def two_thread_rows(mesh):
    """(what, number, unit): wall time of one thread over that of two."""
    rows = raster()
    with tempfile.TemporaryDirectory() as name:
        np.save(Path(name) / "all.npy", np.vstack([rows] * 5))
        tasks = [_task("drop", c, xy="all.npy") for c in workload.CUTTERS]
        one, two = (run_job(sys.executable, "own", Path(name), mesh, tasks, threads=k) for k in (1, 2))
    return [(f"drop, two threads over one, {c}", _rate(two, c, "wall_s") / _rate(one, c, "wall_s"), "x")
            for c in workload.CUTTERS]


def waterline_ratios(peer, mesh):
    """Waterlines at 25 heights and at one; every point to 1e-4 mm or better."""
    tasks = [_task("waterline", "ball R6", heights_mm=HEIGHTS_MM, pitch_mm=PITCH_MM, tolerance_mm=1e-4),
             {**_task("waterline", "ball R6", heights_mm=[2.0], pitch_mm=PITCH_MM, tolerance_mm=1e-4), "name": "one"}]
    with tempfile.TemporaryDirectory() as name:
        own = run_job(sys.executable, "own", Path(name), mesh, tasks)
        other = run_job(peer, "opencamlib", Path(name), mesh,
                        [{**tasks[0], "heights_mm": HEIGHTS_MM[::6]}, tasks[1]], repeats=1) if peer else None
    return [Ratio(what=f"waterline, 20 µm, {what}, ball R6", own=_rate(own, task), unit="points/s",
                  peer=_rate(other, task) if other else np.nan, goal=WATERLINE_GOAL)
            for task, what in (("ball R6", "25 heights (opencamlib 5 of them)"), ("one", "one height"))]


def growth_rows(mesh):
    """(what, number, unit): CPU seconds of 1e4 to 1e7 positions over the same area, one thread."""
    with tempfile.TemporaryDirectory() as name:
        tasks = []
        for n in CURVE:
            across = int(round((n * 40 / 80) ** 0.5))
            x, y = np.linspace(10, 90, -(-n // across)), np.linspace(10, 50, across)
            np.save(Path(name) / f"{n}.npy", np.stack(np.meshgrid(y, x, indexing="ij")[::-1], axis=-1).reshape(-1, 2))
            tasks.append({**_task("drop", "ball R6", xy=f"{n}.npy"), "name": f"{n}"})
        own = run_job(sys.executable, "own", Path(name), mesh, tasks, repeats=1)
    return [(f"drop, ball R6, {t['count']:_} positions".replace("_", " "), t["cpu_s"], "s")
            for t in own["tasks"].values()]


def memory_rows(own, other):
    """(what, number, unit): what mesh, tree and tips added to each process."""
    rows = [("memory above the empty process, 5 µm, cuspline", own["peak_mb"] - own["before_mb"], "MB"),
            ("whole process, cuspline with numpy, numba", own["peak_mb"], "MB"),
            ("tree over the 5 µm mesh, CPU time", own["build_cpu_s"], "s")]
    if other:
        rows += [("memory above the empty process, 5 µm, opencamlib", other["peak_mb"] - other["before_mb"], "MB"),
                 ("whole process, opencamlib with numpy", other["peak_mb"], "MB")]
    return rows
