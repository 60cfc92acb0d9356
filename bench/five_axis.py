"""Five-axis simulation: signed deviations per CPU second, on a wavy surface cut by a leaning, turning cutter.

Parallel passes along x; the axis leans from the normal by 12 to 18 degrees, and the side to which it leans turns once
round along every pass.  The samples lie on the surface.
"""

import time

import numpy as np

from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind
from cuspline.shop.cutters import Cutter, Holder, HolderSegment, Tool
from cuspline.stock.swept import deviation_mm, signed_distance_mm, swept_paths
from cuspline.values.threads import set_thread_count, thread_count

GRIDS = ((500, 120), (1000, 240), (2000, 500))      # moves along a pass, passes
SHAPES = {"ball": (6.0, 6.0), "bull_nose": (6.0, 1.0), "flat": (6.0, 0.0)}
LEAN_RAD = np.radians([12.0, 18.0])
SAMPLES = (400, 250)
LIMIT_MM = 1.0
COMPARED = 40
WITHIN_MM = 9.0           # brute force: moves round a point,
NEAR, STEPS = 600, 41     # the nearest half way, and steps of each


def poses(along, passes, radius_mm, corner_mm):
    """(passes, along + 1, 3) tips and axes."""
    u, v = np.meshgrid(np.linspace(0.03, 0.97, along + 1), np.linspace(0.03, 0.97, passes))
    p, n = _points_and_normals(u.ravel(), v.ravel())
    p, n = p.reshape(*u.shape, 3), n.reshape(*u.shape, 3)
    feed = np.gradient(p, axis=1)
    feed -= (feed * n).sum(axis=2, keepdims=True) * n
    feed /= np.linalg.norm(feed, axis=2, keepdims=True)
    side = np.cross(n, feed)
    turn = 2 * np.pi * u[..., None]
    lean = LEAN_RAD[0] + np.ptp(LEAN_RAD) * np.sin(np.pi * v[..., None]) ** 2
    axis = np.cos(lean) * n + np.sin(lean) * (np.cos(turn) * feed + np.sin(turn) * side)
    across = n - (n * axis).sum(axis=2, keepdims=True) * axis
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    tip = p + corner_mm * n + (radius_mm - corner_mm) * across - corner_mm * axis
    tip[1::2], axis[1::2] = tip[1::2, ::-1], axis[1::2, ::-1]
    return tip, axis


def _points_and_normals(u, v):
    """Points (n, 3) and normals of a wavy blank of 100 x 60 mm, z = 3 sin(2 pi x / 90) cos(2 pi y / 70)."""
    x, y = 100.0 * u, 60.0 * v
    kx, ky = 2 * np.pi / 90.0, 2 * np.pi / 70.0
    n = np.column_stack([-3 * kx * np.cos(kx * x) * np.cos(ky * y), 3 * ky * np.sin(kx * x) * np.sin(ky * y),
                         np.ones_like(x)])
    return (np.column_stack([x, y, 3 * np.sin(kx * x) * np.cos(ky * y)]),
            n / np.sqrt((n ** 2).sum(axis=1, keepdims=True)))


def moves(tip, axis):
    """PostedMoves through all poses, one after the other."""
    tip, axis = tip.reshape(-1, 3), axis.reshape(-1, 3)
    axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    n = len(tip) - 1
    return PostedMoves(kind=np.full(n, Kind.FEED), start_mm=tip[:-1], end_mm=tip[1:], center_mm=np.full((n, 3), np.nan),
                       plane=np.zeros(n), turns=np.zeros(n), feed_mm_per_min=np.full(n, 1000.0),
                       spindle_rpm=np.full(n, 9000.0), tool=np.ones(n), length_offset_on=np.ones(n, bool),
                       machine_end_mm=tip[1:], line=np.arange(n) + 1, operation=np.zeros(n), operations=("",),
                       ended=True, start_axis=axis[:-1], end_axis=axis[1:])


def tool(type_, radius_mm, corner_mm):
    """A cutter with 25 mm of flutes."""
    cutter = Cutter(name=type_, type=type_, diameter_mm=2 * radius_mm, corner_radius_mm=corner_mm, flutes=2,
                    flute_length_mm=25.0, neck_diameter_mm=radius_mm, reach_mm=40.0, shank_diameter_mm=radius_mm,
                    overall_length_mm=90.0)
    segment = HolderSegment(height_mm=50.0, lower_diameter_mm=40.0, upper_diameter_mm=40.0)
    return Tool(number=1, cutter=cutter, holder=Holder(name="collet", segments=(segment,)), stick_out_mm=60.0)


def brute_distances_mm(points, posted, cutter):
    """Least distance (n,) of points to the planes that touch the cutter, at many steps of every near move."""
    gamma = np.linspace(0, np.pi, 20001)
    far = cutter.profile.support(gamma)[0]
    fan = np.stack([np.sin(gamma), np.cos(gamma)])
    out = np.empty(len(points))
    for i, p in enumerate(points):
        center = posted.start_mm + cutter.corner_radius_mm * posted.start_axis
        near = np.flatnonzero(((center - p) ** 2).sum(axis=1) < WITHIN_MM ** 2)
        middle = np.column_stack(_in_tool(p, posted, near, np.full((len(near), 1), 0.5)))
        rows = near[np.argsort((middle @ fan[:, ::200] - far[::200]).max(axis=1))[:NEAR]]
        r, z = _in_tool(p, posted, np.repeat(rows, STEPS), np.tile(np.linspace(0, 1, STEPS), len(rows))[:, None])
        coarse = (np.column_stack([r, z]) @ fan[:, ::50] - far[::50]).max(axis=1)
        best = np.argsort(coarse)[:200]
        out[i] = (np.column_stack([r, z])[best] @ fan - far).max(axis=1).min()
    return out


def _in_tool(p, posted, row, share):
    """(n,) r and z of a point in the cutter at shares (n, 1) of moves; axes turn evenly between both ends."""
    a, b = posted.start_axis[row], posted.end_axis[row]
    angle = np.linalg.norm(b - a, axis=1)[:, None]
    sine = np.where(angle > 1e-7, np.sin(angle), 1.0)
    axis = np.where(angle > 1e-7, (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / sine, a)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    y = p - posted.start_mm[row] - share * (posted.end_mm[row] - posted.start_mm[row])
    z = (y * axis).sum(axis=1)
    return np.linalg.norm(y - z[:, None] * axis, axis=1), z


def measure():
    """[(what, number, unit)]."""
    rows, before = [], thread_count()
    set_thread_count(1)
    for type_, (radius, corner) in SHAPES.items():
        for grid in GRIDS:
            rows += _of_one(type_, radius, corner, grid)
    set_thread_count(before)
    return rows


def _of_one(type_, radius, corner, grid):
    posted, cutter = moves(*poses(*grid, radius, corner)), tool(type_, radius, corner)
    start = time.process_time()
    paths = swept_paths(posted, {1: cutter})
    build = time.process_time() - start
    u, v = np.meshgrid(np.linspace(0.06, 0.94, SAMPLES[0]), np.linspace(0.06, 0.94, SAMPLES[1]))
    points, normals = _points_and_normals(u.ravel(), v.ravel())
    low, high = points.min(axis=0) - 50.0, points.max(axis=0) + 50.0
    ask = lambda k: deviation_mm(paths, low, high, points[:k], normals[:k], LIMIT_MM)
    ask(9)
    cpu = []
    for _ in range(2):
        start = time.process_time()
        deviation = ask(len(points))
        cpu.append(time.process_time() - start)
    some = np.random.default_rng(0).integers(0, len(points), COMPARED)
    on = points[some] + deviation[some, None] * normals[some]
    apart = np.abs(signed_distance_mm(paths, on) - brute_distances_mm(on, posted, cutter.cutter)).max()
    what = f"{type_.replace('_', ' ')}, {len(posted)} moves"
    return [(f"{what}: tree built in", build, "CPU s"),
            (f"{what}: signed deviations (goal 50 000)", len(points) / min(cpu), "samples per CPU s"),
            (f"{what}: against brute force at {COMPARED} samples", apart * 1e3, "µm")]
