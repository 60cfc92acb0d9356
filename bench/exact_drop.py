"""Exact drop-cutter: points and certified moves per CPU second on the common patch and on a trimmed part."""

import time

import numba
import numpy as np
import workload

from cuspline.toolpaths.exact_drop import ExactPart, drop_tips_mm, gouge_depths_mm
from cuspline.toolpaths.path_gouges import path_gouges

MOVE_TOLERANCES_MM = (0.005, 0.001)


def raster(low, high, step_mm, along_mm):
    """(n, 2) rows along x."""
    x, y = np.arange(low[0], high[0], along_mm), np.arange(low[1], high[1], step_mm)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def measure():
    """[(what, number, unit)]."""
    rows, before = [], numba.get_num_threads()
    for name, solid, low, high in (("patch", workload.patch_solid(), (11, 11), (89, 49)),
                                   ("trimmed part", workload.trimmed_part(), None, None)):
        start = time.process_time()
        part = ExactPart.of_solid(solid)
        rows.append((f"{name}: tree built in", time.process_time() - start, "CPU s"))
        rows.append((f"{name}: tree of {len(part.arrays[5])} leaves", part.memory_bytes / 1e6, "MB"))
        if low is None:
            box = part.arrays[7][0]
            low, high = (box[0], box[2]), (box[1], box[3])
        xy = raster(low, high, 1.5, 0.1)
        for cutter, (R, rc) in workload.CUTTERS.items():
            rows += _of_cutter(f"{name}, {cutter}", part, xy, R, rc)
    numba.set_num_threads(before)
    return rows


def _of_cutter(what, part, xy, R, rc):
    """Rates of one cutter over one part."""
    tips = np.column_stack([xy, drop_tips_mm(part, xy, R, rc)])
    tips = tips[np.isfinite(tips[:, 2])]
    numba.set_num_threads(1)
    cpu, wall_1 = _timed(lambda: drop_tips_mm(part, xy, R, rc))
    gouge_cpu, _ = _timed(lambda: gouge_depths_mm(part, tips, R, rc))
    moves = [(tolerance, *_of_moves(part, tips, R, rc, tolerance)) for tolerance in MOVE_TOLERANCES_MM]
    numba.set_num_threads(2)
    _, wall_2 = _timed(lambda: drop_tips_mm(part, xy, R, rc))
    return [(f"{what}: drop", len(xy) / cpu, "points per CPU s"),
            (f"{what}: gouge check of clean points", len(tips) / gouge_cpu, "points per CPU s"),
            (f"{what}: gouge check over drop (goal 0.4)", len(tips) / gouge_cpu / (len(xy) / cpu), "times"),
            *((f"{what}: moves certified to {t * 1e3:.0f} µm", rate, "moves per CPU s") for t, rate, _ in moves),
            *((f"{what}: 99 % of bounds at {t * 1e3:.0f} µm below", bound * 1e3, "µm") for t, _, bound in moves),
            (f"{what}: two threads against one", wall_1 / wall_2, "times")]


def _of_moves(part, tips, R, rc, tolerance):
    """Moves per CPU second between neighbouring clean tips of a row, and the bound that 99 % of them keep, mm."""
    inside = np.abs(np.diff(tips[:, :2], axis=0)).sum(axis=1) < 0.11
    start, end = tips[:-1][inside], tips[1:][inside]
    cpu, _ = _timed(lambda: path_gouges(part, start, end, R, rc, tolerance))
    return len(start) / cpu, np.percentile(path_gouges(part, start, end, R, rc, tolerance)[0], 99)


def _timed(job, runs=2):
    """Best (CPU s, wall s)."""
    best = [np.inf, np.inf]
    for _ in range(runs):
        wall, cpu = time.perf_counter(), time.process_time()
        job()
        best = [min(best[0], time.process_time() - cpu), min(best[1], time.perf_counter() - wall)]
    return best


if __name__ == "__main__":
    for what, number, unit in measure():
        print(f"{what}: {number:.4g} {unit}", flush=True)
