"""Small posted programs and tools with known answers, for the tests of simulation and verification."""

import numpy as np
from known_tools import TAKES_ALL

from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind, Plane
from cuspline.shop.cutters import Cutter, Holder, HolderSegment, Tool

NOWHERE = (np.nan,) * 3


def tool(type_, diameter, corner_radius=None, number=1, stick_out=45.0, flute=20.0, neck=None, limits=None):
    """A tool of plain proportions; the holder is a cylinder of diameter 40.  `limits`: left out, it takes all."""
    corner = {"ball": diameter / 2, "flat": 0.0}.get(type_, corner_radius)
    cutter = Cutter(name=f"{type_} {diameter}", type=type_, diameter_mm=diameter, corner_radius_mm=corner, flutes=2,
                    flute_length_mm=flute, neck_diameter_mm=neck or 0.9 * diameter, reach_mm=max(flute, 30.0),
                    shank_diameter_mm=diameter, overall_length_mm=90.0, **(limits or TAKES_ALL))
    holder = Holder(name="collet", segments=(
        HolderSegment(height_mm=50.0, lower_diameter_mm=40.0, upper_diameter_mm=40.0),))
    return Tool(number=number, cutter=cutter, holder=holder, stick_out_mm=stick_out)


def rapid(*end):
    return Kind.RAPID, end, NOWHERE, Plane.XY


def feed(*end):
    return Kind.FEED, end, NOWHERE, Plane.XY


def arc(end, center, plane, clockwise=False):
    return (Kind.ARC_CW if clockwise else Kind.ARC_CCW), end, center, plane


def program(start, moves, tool_number=1, **changes):
    """PostedMoves of moves made by `rapid`, `feed` and `arc`; single columns can be replaced."""
    n = len(moves)
    kind, end, center, plane = (list(column) for column in zip(*moves))
    end = np.array(end, dtype=float)
    columns = {
        "kind": kind, "start_mm": np.vstack([[start], end])[:-1], "end_mm": end, "center_mm": center,
        "plane": plane, "turns": np.zeros(n), "feed_mm_per_min": np.where(np.array(kind) == Kind.RAPID, 0.0, 500.0),
        "spindle_rpm": np.full(n, 8000.0), "tool": np.full(n, tool_number), "length_offset_on": np.ones(n, bool),
        "machine_end_mm": end, "line": np.arange(n) + 10, "operation": np.zeros(n), "operations": ("finish",),
        "ended": True}
    return PostedMoves(**{**columns, **changes})


def raster(x_range, ys, tip_z):
    """Zig-zag passes along x at the given ys; `tip_z(x, y)` or a number gives the tip."""
    moves = []
    for k, y in enumerate(ys):
        x0, x1 = x_range if k % 2 == 0 else x_range[::-1]
        moves += [feed(x0, y, tip_z), feed(x1, y, tip_z)]
    return moves


def random_moves(rng, count, low, high, arcs=False):
    """Random lines, and arcs in all planes when asked for, one after the other."""
    moves, here = [], rng.uniform(low, high)
    start = here.copy()
    for _ in range(count):
        plane = Plane(int(rng.integers(3)))
        if arcs and rng.random() < 0.6:
            moves.append(_random_arc(rng, here, plane))
        else:
            moves.append(feed(*rng.uniform(low, high)))
        here = np.array(moves[-1][1])
    return start, moves


def _random_arc(rng, here, plane):
    i, j, k = plane.axes
    radius, a0, a1 = rng.uniform(1, 8), *rng.uniform(-np.pi, np.pi, 2)
    center = here.copy()
    center[i] -= radius * np.cos(a0)
    center[j] -= radius * np.sin(a0)
    end = here.copy()
    end[i], end[j] = center[i] + radius * np.cos(a1), center[j] + radius * np.sin(a1)
    end[k] += rng.uniform(-2, 2) if rng.random() < 0.3 else 0.0
    return arc(tuple(end), tuple(center), plane, bool(rng.random() < 0.5))


def tips_along(posted, per_move):
    """(n * per_move, 3) tips, lines and arcs, straight from the definition."""
    rows = []
    share = np.linspace(0, 1, per_move)
    for k in range(len(posted)):
        s, e, c = posted.start_mm[k], posted.end_mm[k], posted.center_mm[k]
        if posted.kind[k] in (Kind.RAPID, Kind.FEED):
            rows.append(s + share[:, None] * (e - s))
            continue
        i, j, m = Plane(int(posted.plane[k])).axes
        a0, a1 = (np.arctan2(p[j] - c[j], p[i] - c[i]) for p in (s, e))
        turn = (a1 - a0) % (2 * np.pi) if posted.kind[k] == Kind.ARC_CCW else -((a0 - a1) % (2 * np.pi))
        points, radius = np.empty((per_move, 3)), np.hypot(s[i] - c[i], s[j] - c[j])
        points[:, i] = c[i] + radius * np.cos(a0 + share * turn)
        points[:, j] = c[j] + radius * np.sin(a0 + share * turn)
        points[:, m] = s[m] + share * (e[m] - s[m])
        rows.append(points)
    return np.vstack(rows)


def box(low, high):
    """Vertices and triangles of a box."""
    corners = np.array([[x, y, z] for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])
