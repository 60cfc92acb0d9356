"""Certificate: moves of a dense raster proven free of gouges per CPU second, and the bound."""

import time

import numba
import numpy as np
import workload

from cuspline.toolpaths.drop.exact_drop import ExactPart, drop_tips_mm
from cuspline.toolpaths.gouge.depth_tree import DepthTree
from cuspline.toolpaths.gouge.move_depths import move_depths
from cuspline.verification.certificate import THICKNESS_SHARE

TOLERANCES_MM = (0.005, 0.001)
STEP_MM, ALONG_MM = 0.25, 0.1
MARGIN_MM = 0.5


def measure():
    """[(what, number, unit)]."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    part = ExactPart.of_solid(workload.patch_solid())
    x, y = (np.arange(MARGIN_MM, size - MARGIN_MM, step) for size, step in zip(workload.SIZE_MM, (ALONG_MM, STEP_MM)))
    xy = np.stack(np.meshgrid(x, y), axis=-1)
    rows = []
    for tolerance_mm in TOLERANCES_MM:
        built, tree = _timed(lambda: DepthTree.of_part(part, THICKNESS_SHARE * tolerance_mm))
        label = f"to {tolerance_mm * 1e3:.0f} µm"
        rows.append((f"{label}: tree built in", built, "CPU s"))
        rows.append((f"{label}: tree of {len(tree.arrays[3])} pieces", tree.memory_bytes / 1e6, "MB"))
        for cutter, (R, rc) in workload.CUTTERS.items():
            tips = np.dstack([xy, drop_tips_mm(part, xy.reshape(-1, 2), R, rc).reshape(xy.shape[:2])])
            start, end = tips[:, :-1].reshape(-1, 3), tips[:, 1:].reshape(-1, 3)
            cpu, (bound, *_) = _timed(lambda: move_depths(tree, start, end, R, rc, tolerance_mm))
            what = f"{label}, {cutter}: {len(start)} moves"
            rows += [(f"{what} proven", len(start) / cpu, "moves per CPU s"),
                     (f"{what} with the tree", len(start) / (cpu + built), "moves per CPU s"),
                     (f"{what}, largest proven gouge", bound.max() * 1e3, "µm"),
                     (f"{what} not proven clean to the tolerance", (bound > tolerance_mm).sum(), "")]
    numba.set_num_threads(before)
    return rows


def _timed(job, runs=2):
    """Best CPU seconds of some runs, and what the job returned."""
    best = np.inf
    for _ in range(runs):
        start = time.process_time()
        result = job()
        best = min(best, time.process_time() - start)
    return best, result


if __name__ == "__main__":
    for what, number, unit in measure():
        print(f"{what}: {number:.4g} {unit}", flush=True)
