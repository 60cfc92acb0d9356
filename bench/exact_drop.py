"""Exact drop-cutter: points per CPU second on the common patch and on a trimmed part."""

import time

import numba
import numpy as np
import workload

from cuspline.toolpaths.drop.exact_drop import ExactPart, drop_tips_mm, gouge_depths_mm


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
    numba.set_num_threads(2)
    _, wall_2 = _timed(lambda: drop_tips_mm(part, xy, R, rc))
    return [(f"{what}: drop", len(xy) / cpu, "points per CPU s"),
            (f"{what}: gouge check of clean points", len(tips) / gouge_cpu, "points per CPU s"),
            (f"{what}: gouge check over drop (goal 0.4)", len(tips) / gouge_cpu / (len(xy) / cpu), "times"),
            (f"{what}: two threads against one", wall_1 / wall_2, "times")]


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
