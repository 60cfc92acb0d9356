"""Constant scallop height on the wavy patch, judged on the stock it leaves, MeshLib's constant cusp beside it.

The judge knows nothing of how passes are made.  It takes tips, sweeps the ball along them, measures what is
left along the normals of places all over the surface, closer where ridges are, and calls the highest of it within
reach of the next ridge (0.55 of the step that the wanted height allows there, in every direction) the place's
scallop.

Usage: python bench/scallop.py
"""

import tempfile
import time
from functools import lru_cache
from pathlib import Path

import numpy as np
from numba import njit, prange
from peers import peer_python, run_job
from workload import SIZE_MM, patch, patch_mesh, patch_solid

from cuspline.kernel import brep
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind
from cuspline.scallop.stepover import stepover_for_scallop_mm
from cuspline.shop.cutters import Cutter, Holder, HolderSegment, Tool
from cuspline.stock.swept import deviation_mm, swept_paths
from cuspline.toolpaths.drop.exact_dropper import ExactDropper
from cuspline.toolpaths.freeform.iso_scallop_passes import constant_scallop_curves
from cuspline.toolpaths.freeform.plane_curves import PlaneCurve
from cuspline.toolpaths.freeform.scallop_region import ground_of
from cuspline.toolpaths.freeform.tip_field import tip_field
from cuspline.toolpaths.freeform.tip_paths import PathRules, tip_paths

CELLS_UV = 820, 490         # 0.12 mm apart, one place anywhere in each: rows of them would miss the ridges along them
RIDGE_SHARE = 0.8           # cells with at least that much of the highest near them get more places
MORE_PLACES = 12
WINDOW = 0.55               # of the wanted step: half of it reaches the next ridge from everywhere
WITHIN = 0.10
REACHED_MM = 1e-4           # the ball gets to a place when it need not be lifted more
RADIUS_MM, SCALLOPS_MM = 6.0, (0.005, 0.010)
NODES_A_STEP = 7.0          # of the grid, on a flat
RUN_OVER_STEPS = 1.5        # over the patch's end
RULES = PathRules(tolerance_mm=0.0005, lateral_mm=0.005, bridge_mm=3.0)
PARALLEL_MM = 0.4           # parallel passes that are measured, to scale from
LIMIT_MM = 0.2              # more is not told apart
PEER_MESH_MM, PEER_VOXEL_MM = 0.005, 0.2


@lru_cache
def dropper():
    """The ball over all faces of the solid under the patch; face 0 is the patch."""
    return ExactDropper.of_faces(brep.faces_of(patch_solid()), RADIUS_MM, RADIUS_MM)


@lru_cache
def field(pitch_mm, run_over_mm):
    return tip_field(dropper(), [0], ((0.0, 0.0), SIZE_MM), pitch_mm, run_over_mm)


def flat_step_mm(scallop_mm):
    return float(stepover_for_scallop_mm(RADIUS_MM, scallop_mm, 0.0)[0])


def _seen(uv):
    """Points (n, 3), normals (n, 3), area of each per (du dv), Q per (du, dv) (n, 3) of places."""
    p, su, sv, suu, suv, svv = np.moveaxis(patch().derivatives(*uv.T), 1, 0)
    cross = np.cross(su, sv)
    area = np.linalg.norm(cross, axis=1)
    n = cross / area[:, None]
    dot = lambda a, b: np.einsum("ij,ij->i", a, b)
    bend = [dot(a, b) / RADIUS_MM - dot(c, n) for a, b, c in ((su, su, suu), (su, sv, suv), (sv, sv, svv))]
    return p, n, area, np.column_stack(bend)


def _reached(p, n):
    """(n,) bool: the ball gets to these places."""
    center = p + RADIUS_MM * n
    return dropper().tips_mm(np.ascontiguousarray(center[:, :2])) <= center[:, 2] - RADIUS_MM + REACHED_MM


@lru_cache
def _places():
    """(u, v) of a place in each cell, what `_seen` tells of it, whether the ball gets there."""
    jitter = np.random.default_rng(1).random((2, *CELLS_UV))
    uv = np.column_stack([((np.indices(CELLS_UV)[k] + jitter[k]) / CELLS_UV[k]).ravel() for k in range(2)])
    parts = [np.concatenate(c) for c in zip(*(_seen(rows) for rows in np.array_split(uv, 8)))]
    return uv, *parts, _reached(*parts[:2])


def judge(tip_lines, wanted_mm):
    """How even the scallops are that a ball leaves on the wavy patch.

    Args:
        tip_lines: list of (m, 3) tip polylines, straight from row to row; ways between passes left out.
        wanted_mm: scallop height asked for.
    Returns:
        dict: share of the reachable area whose scallop is within 10 % of the wanted one; the scallop's p1, p50,
        p99 and maximum, worst gouge, mm; share of the area that the ball reaches; how many places were looked at.
    """
    _, _, _, area, _, reachable = _places()
    ridge, between, gouge, looked_at = scallops_mm(tip_lines, wanted_mm)
    weight = area * reachable
    within = np.abs(ridge / wanted_mm - 1) <= WITHIN
    order = np.argsort(ridge[reachable])
    share = np.cumsum(area[reachable][order]) / area[reachable].sum()
    at = lambda q: float(ridge[reachable][order][np.searchsorted(share, q)])
    return {"within_10_percent_share": float((weight * within).sum() / weight.sum()),
            "within_10_percent_share_off_the_border": float((weight * between)[within].sum()
                                                             / (weight * between).sum()),
            "over_110_percent_share": float((weight * (ridge > 1.1 * wanted_mm)).sum() / weight.sum()),
            "scallop_p1_mm": at(0.01), "scallop_p50_mm": at(0.5), "scallop_p99_mm": at(0.99),
            "scallop_max_mm": float(ridge[reachable].max()), "gouge_mm": gouge,
            "reachable_share": float(weight.sum() / area.sum()), "places": float(looked_at)}


def scallops_mm(tip_lines, wanted_mm):
    """Local scallop (n,) at a place of each cell, whether the window keeps off the border, gouge, places in all."""
    uv, p, n, _, bend, reachable = _places()
    paths = swept_paths(_as_moves(tip_lines), {1: _ball(RADIUS_MM)})
    low, high = p.min(axis=0) - 50.0, p.max(axis=0) + 50.0
    left = np.where(reachable, deviation_mm(paths, low, high, p, n, LIMIT_MM), -np.inf)
    gouge = max(-float(left[reachable].min()), 0.0)
    grid = lambda a: a.reshape(*CELLS_UV, -1)
    metric = grid(bend) / (8 * wanted_mm)
    near = lambda values, at: _highest_near(grid(values), metric, grid(uv), at.reshape(*CELLS_UV, -1, 2), WINDOW)
    rows = np.flatnonzero(reachable & (left > RIDGE_SHARE * near(left, uv)[0].ravel()))
    cell = np.repeat(rows, MORE_PLACES)
    more = np.column_stack(np.unravel_index(cell, CELLS_UV)) + np.random.default_rng(2).random((len(cell), 2))
    more /= CELLS_UV
    q, m = _seen(more)[:2]
    heights = np.where(_reached(q, m), deviation_mm(paths, low, high, q, m, LIMIT_MM), -np.inf)
    values, at = np.full((len(uv), 1 + MORE_PLACES), -np.inf), np.zeros((len(uv), 1 + MORE_PLACES, 2))
    values[:, 0], at[:, 0] = left, uv
    values[rows, 1:], at[rows, 1:] = heights.reshape(-1, MORE_PLACES), more.reshape(-1, MORE_PLACES, 2)
    ridge, between = near(values, at)
    return ridge.ravel(), between.ravel(), gouge, len(uv) + len(more)


@njit(cache=True, parallel=True)
def _highest_near(values, metric, uv, at, reach):
    """Highest of the values (nu, nv, k), found at `at`, within `reach` of each cell's place in its own metric; whether
    that reach stays on the patch."""
    nu, nv, many = values.shape
    out, between = np.full((nu, nv), -np.inf), np.zeros((nu, nv), np.bool_)
    for i in prange(nu):
        for j in range(nv):
            a, b, c = metric[i, j]
            det = a * c - b * b
            if det <= 0 or a <= 0:
                out[i, j] = values[i, j].max()
                continue
            ru, rv = reach * np.sqrt(c / det), reach * np.sqrt(a / det)
            ri, rj = min(int(ru * nu) + 1, 60), min(int(rv * nv) + 1, 60)
            u, v = uv[i, j]
            between[i, j] = min(u, 1 - u) > ru and min(v, 1 - v) > rv
            for p in range(max(i - ri, 0), min(i + ri, nu - 1) + 1):
                for q in range(max(j - rj, 0), min(j + rj, nv - 1) + 1):
                    for k in range(many):
                        if values[p, q, k] > out[i, j]:
                            x, y = at[p, q, k, 0] - u, at[p, q, k, 1] - v
                            if a * x * x + 2 * b * x * y + c * y * y <= reach * reach:
                                out[i, j] = values[p, q, k]
    return out, between


def _ball(radius_mm):
    cutter = Cutter(name="ball", type="ball", diameter_mm=2 * radius_mm, corner_radius_mm=radius_mm, flutes=2,
                    flute_length_mm=30.0, neck_diameter_mm=1.9 * radius_mm, reach_mm=35.0,
                    shank_diameter_mm=2 * radius_mm, overall_length_mm=90.0)
    holder = Holder(name="collet", segments=(
        HolderSegment(height_mm=50.0, lower_diameter_mm=40.0, upper_diameter_mm=40.0),))
    return Tool(number=1, cutter=cutter, holder=holder, stick_out_mm=45.0)


def _as_moves(tip_lines):
    start, end = (np.vstack([t[a:b] for t in tip_lines]) for a, b in ((0, -1), (1, None)))
    n = len(start)
    return PostedMoves(kind=np.full(n, Kind.FEED), start_mm=start, end_mm=end, center_mm=np.full((n, 3), np.nan),
                       plane=np.zeros(n), turns=np.zeros(n), feed_mm_per_min=np.full(n, 500.0),
                       spindle_rpm=np.full(n, 8000.0), tool=np.ones(n), length_offset_on=np.ones(n, bool),
                       machine_end_mm=end, line=np.arange(n) + 1, operation=np.zeros(n), operations=("finish",),
                       ended=True)


def length_mm(tip_lines):
    return float(sum(np.linalg.norm(np.diff(t, axis=0), axis=1).sum() for t in tip_lines))


@lru_cache
def parallel_mm():
    """Length of parallel passes along x, and the highest scallop they leave."""
    ground = field(flat_step_mm(SCALLOPS_MM[-1]) / NODES_A_STEP, 1.0)
    ys = np.arange(ground.y_mm[0], ground.y_mm[-1], PARALLEL_MM)
    curves = [PlaneCurve(xy_mm=np.array([[ground.x_mm[0], y], [ground.x_mm[-1], y]])) for y in ys]
    lines = [p.tips_mm for p in tip_paths(curves, ground, RULES)]
    return length_mm(lines), judge(lines, SCALLOPS_MM[0])["scallop_max_mm"]


def own_lines(wanted_mm):
    """Tip polylines of our passes, CPU seconds for the curves in plan, for the tips."""
    step = flat_step_mm(wanted_mm)
    grid = field(step / NODES_A_STEP, RUN_OVER_STEPS * step)
    clock = [time.process_time()]
    curves = constant_scallop_curves(ground_of(grid, radius_mm=RADIUS_MM, scallop_mm=wanted_mm))
    clock.append(time.process_time())
    paths = tip_paths(curves, grid, RULES)
    clock.append(time.process_time())
    return [p.tips_mm for p in paths], *np.diff(clock)


def meshlib_lines(wanted_mm):
    """Tip polylines of MeshLib's passes over the patch, CPU seconds; None where it is not at hand."""
    python, held = peer_python()
    if not any(pin.startswith("meshlib") for pin in held):
        return None
    task = {"kind": "cusp", "name": "cusp", "radius_mm": RADIUS_MM, "voxel_mm": PEER_VOXEL_MM,
            "step_mm": flat_step_mm(wanted_mm)}
    with tempfile.TemporaryDirectory() as folder:
        found = run_job(python, "meshlib", Path(folder), patch_mesh(PEER_MESH_MM)[:2], [task], repeats=1)
        rows = np.load(Path(folder) / "cusp meshlib.npy")
    on_patch = field(flat_step_mm(SCALLOPS_MM[-1]) / NODES_A_STEP, 1.0).is_near(rows[:, :2])
    cut = np.flatnonzero((np.diff(rows[:, 3]) != 0) | (np.diff(on_patch.astype(int)) != 0)) + 1
    lines = [part[:, :3] for part, on in zip(np.split(rows, cut), np.split(on_patch, cut)) if on[0] and len(part) > 1]
    return lines, found["tasks"]["cusp"]["cpu_s"]


def rows_of(name, lines, wanted_mm):
    """(what, number, unit) of the judge's findings on some passes."""
    found = judge(lines, wanted_mm)
    rows = [(f"{name}: {what.removesuffix('_mm').replace('_', ' ')}", value, "mm" if what.endswith("_mm") else "")
            for what, value in found.items()]
    length, highest = parallel_mm()
    # scallops grow with the square of the step
    times = length * (highest / found["scallop_max_mm"]) ** 0.5 / length_mm(lines)
    return [*rows, (f"{name}: pieces", float(len(lines)), ""), (f"{name}: length", length_mm(lines), "mm"),
            (f"{name}: parallel passes of the same highest scallop are longer", times, "x")]


def measure():
    """list of (what, number, unit)."""
    out = []
    for wanted in SCALLOPS_MM:
        name = f"constant scallop {1000 * wanted:.0f} um, ball R{RADIUS_MM:.0f}"
        lines, plan_s, tips_s = own_lines(wanted)
        out += rows_of(name, lines, wanted)
        out += [(f"{name}: curves in plan", plan_s, "CPU s"), (f"{name}: exact tips", tips_s, "CPU s")]
        if (peer := meshlib_lines(wanted)) is not None:
            out += rows_of(f"MeshLib, {name}", peer[0], wanted)
            out.append((f"MeshLib, {name}: path", peer[1], "CPU s"))
    return out


if __name__ == "__main__":
    for what, number, unit in measure():
        print(f"{what:90s} {number:12.5g} {unit}")
