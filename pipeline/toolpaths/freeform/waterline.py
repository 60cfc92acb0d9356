"""Waterline passes: where the cutter's tip at a height z just touches the part, as oriented loops.

The part is known by one function only, the drop height over (x, y).  A grid of drop heights tells which grid
edges the loop at z crosses; each crossing is then found on its edge, safeguarded, so that it is exact on smooth
flanks and at walls, where the drop height jumps.  The cells join the crossings to loops, and points are added
where a chord strays from the loop.

What lies wholly between grid lines is not seen: a slot in which the cutter has less play than the pitch, a tip
that rises above z over less than the pitch.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cuspline.toolpaths.drop.dropcutter import drop_tips_mm, is_held_above
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit
from cuspline.values.errors import ToolpathError

NOTHING_MM = 1e6        # how far below z nothing at all is taken to lie
FEW_HEIGHTS = 5         # up to here asking "above z?" everywhere costs less than all drop heights
SMOOTH_STEPS = 6        # a root not found by then is a jump: only the side counts, and that is had for less
ROUNDS = 12             # halvings of a chord: 4096 points a grid cell
BEYOND_PITCHES = 3.0    # round what is wanted: every chord that is looked at ends in exact crossings
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))      # of a cell, anticlockwise; its edge k runs from corner k to k + 1


@dataclass(frozen=True, eq=False, kw_only=True)
class Waterline:
    """One loop of tips at one height with material on the right: climb milling with M3."""

    tip_mm: np.ndarray          # (n, 3); a closed loop does not repeat its first point
    is_closed: bool             # False: it ends at the border of the region

    def __post_init__(self):
        object.__setattr__(self, "tip_mm", frozen(self.tip_mm, (None, 3), "tip_mm"))

    @property
    def height_mm(self):
        return float(self.tip_mm[0, 2])


@dataclass(frozen=True, eq=False, kw_only=True)
class DropHeights:
    """The part as a cutter's tip feels it over places (n, 2)."""

    tips_at: Callable               # places -> (n,) lowest safe tip heights, -inf over nothing
    above_at: Callable | None = None    # places, z or (n,) of them -> (n,) whether tips_at is above z, where that costs less
    # places, (n,) z -> (n,) anything continuous that is above zero where tips_at is above z; in place of the height's own
    # difference, which jumps at walls
    gap_at: Callable | None = None
    # places, (n,) z, (n,) mm -> (n,) whether a line is wanted anywhere within so many mm; elsewhere it stays as rough as the grid
    near_at: Callable | None = None


def mesh_waterlines(mesh, heights_mm, radius_mm, corner_radius_mm, *, pitch_mm, chord_mm, tolerance_mm=1e-5):
    """waterlines() round the whole of a DropMesh; every loop is closed."""
    low, high = mesh.corners_mm.min(axis=(0, 1))[:2], mesh.corners_mm.max(axis=(0, 1))[:2]
    margin = radius_mm + 1.01 * pitch_mm
    drops = DropHeights(tips_at=lambda xy: drop_tips_mm(mesh, xy, radius_mm, corner_radius_mm),
                        above_at=lambda xy, z: is_held_above(mesh, xy, radius_mm, corner_radius_mm, z))
    return waterlines(drops, heights_mm, low - margin, high + margin, pitch_mm=pitch_mm, chord_mm=chord_mm,
                      tolerance_mm=tolerance_mm)


def waterlines(drops, heights_mm, low_mm, high_mm, *, pitch_mm, chord_mm, tolerance_mm=1e-5):
    """Loops on which the tip at each height touches the part.

    Args:
        drops: DropHeights.
        heights_mm: tip heights, in any order; none of them on a level floor, where the loop has no place.
        low_mm, high_mm: (2,) corners of the region.
        pitch_mm: between grid lines; see the module for what it misses.
        chord_mm: how far the loop may stray from the chord between neighbours, at its middle; inf adds no points.
        tolerance_mm: every point is free, and a point this far off it is not.
    Returns:
        tuple of Waterline, from the top.
    Raises:
        ToolpathError: no region, pitch, chord or tolerance of that size.
    """
    low, high = np.asarray(low_mm, float), np.asarray(high_mm, float)
    if not ((high > low).all() and np.isfinite([low, high]).all() and 0 < tolerance_mm < pitch_mm and chord_mm > 0):
        raise ToolpathError(f"waterline: region {low} to {high} mm, pitch {pitch_mm}, chord {chord_mm}, tolerance "
                            f"{tolerance_mm} mm: each must be above zero, the tolerance below the pitch")
    lines = [np.linspace(low[a], high[a], int(np.ceil((high[a] - low[a]) / pitch_mm)) + 1) for a in (0, 1)]
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    tips_at, above_at, gap_at = drops.tips_at, drops.above_at, drops.gap_at
    is_cheaper = above_at is not None and gap_at is None
    gap_at = gap_at or (lambda xy, z: tips_at(xy) - z)
    above_at = above_at if is_cheaper else lambda xy, z: gap_at(xy, z) > 0
    look = gap_at if not is_cheaper else lambda xy, z: np.where(above_at(xy, z), np.inf, -np.inf)
    levels = sorted({float(z) for z in np.atleast_1d(heights_mm)}, reverse=True)
    tips = _tips_on(grid, tips_at, levels, above_at if is_cheaper and len(levels) <= FEW_HEIGHTS else None)
    chains = [c for z in levels for c in _chains_at(tips_at, grid, tips, z)]
    if not chains:
        return ()
    z = np.concatenate([np.full(len(c.free), c.height_mm) for c in chains])
    chain = np.repeat(np.arange(len(chains)), [len(c.free) for c in chains])
    free, held = (np.concatenate([getattr(c, end) for c in chains]) for end in ("free", "held"))
    nodes = grid.reshape(-1, 2)
    near_at = drops.near_at or (lambda xy, z, within_mm: np.ones(len(xy), bool))
    xy = nodes[free]
    rows = np.flatnonzero(near_at(xy, z, np.full(len(xy), BEYOND_PITCHES * pitch_mm)))
    xy[rows] = _crossings(gap_at, above_at, xy[rows], nodes[held[rows]], z[rows], tolerance_mm)
    closed = np.array([c.is_closed for c in chains])
    if np.isfinite(chord_mm):
        begin = np.searchsorted(chain, np.arange(len(chains)))
        xy, chain = _with_chords_within((gap_at, above_at, look, near_at), xy, chain, (closed, z[begin]), chord_mm,
                                        tolerance_mm)
    ends = np.searchsorted(chain, np.arange(len(chains) + 1))
    loops = (_distinct(xy[a:b], c.is_closed, tolerance_mm) for a, b, c in zip(ends[:-1], ends[1:], chains))
    return tuple(Waterline(tip_mm=np.column_stack([p, np.full(len(p), c.height_mm)]), is_closed=c.is_closed)
                 for p, c in zip(loops, chains) if len(p) > 1)


def _tips_on(grid, tips_at, levels, above_at):
    """Drop heights on the grid; with above_at, far from all loops only stand-ins between the right levels."""
    nodes, shape = grid.reshape(-1, 2), grid.shape[:2]
    if above_at is None:
        return tips_at(nodes).reshape(shape)
    level, near = np.zeros(shape, int), np.zeros(shape, bool)
    for z in levels:
        above = above_at(nodes, z).reshape(shape)
        level += above
        for a, b in (((slice(1, None), slice(None)), (slice(-1), slice(None))),
                     ((slice(None), slice(1, None)), (slice(None), slice(-1)))):
            differs = above[a] != above[b]
            near[a] |= differs
            near[b] |= differs
    # between two levels any height will do
    tips = np.concatenate([[-np.inf], 0.5 * (np.array(levels[1:]) + levels[:-1])[::-1], [np.inf]])[level]
    tips[near] = tips_at(grid[near])
    return tips


@dataclass(frozen=True, eq=False, kw_only=True)
class _Chain:
    """Grid edges in the order of the loop that crosses them."""

    height_mm: float
    free: np.ndarray            # (n,) grid node on the edge's free side
    held: np.ndarray            # (n,) and on its material side
    is_closed: bool


def _chains_at(tips_at, grid, tips, z):
    """Chains of one height: in every cell from each edge that enters material to the edge that leaves it.

    Walking round a cell anticlockwise, free -> material is an entry, material -> free a leave; a stretch of
    the loop from entry to leave has the material on its right.  Where two opposite corners are material the
    drop height at the saddle of the four decides whether they are one body.
    """
    above = tips > z
    m, n = above.shape
    corner = [above[i:m - 1 + i, j:n - 1 + j] for i, j in CORNERS]
    some, every = np.logical_or.reduce(corner), np.logical_and.reduce(corner)
    cells = np.argwhere(some & ~every)
    corner = np.stack([c[cells[:, 0], cells[:, 1]] for c in corner], axis=-1)
    saddle = (corner[:, 0] == corner[:, 2]) & (corner[:, 1] == corner[:, 3]) & (corner[:, 0] != corner[:, 1])
    joined = np.zeros(len(cells), bool)
    if saddle.any():
        joined[saddle] = tips_at(_saddles(grid, np.maximum(tips - z, -NOTHING_MM), *cells[saddle].T)) > z
    node = np.stack([(cells[:, 0] + i) * n + cells[:, 1] + j for i, j in CORNERS], axis=-1)
    starts, ends = [], []
    for k in range(4):
        rows = np.flatnonzero(~corner[:, k] & corner[:, (k + 1) % 4])
        leave = np.full(len(rows), (k + 3) % 4)
        for step in (2, 1):
            leaves_here = corner[rows, (k + step) % 4] & ~corner[rows, (k + step + 1) % 4] & ~joined[rows]
            leave[leaves_here] = (k + step) % 4
        starts.append(np.column_stack([node[rows, k], node[rows, (k + 1) % 4]]))
        ends.append(np.column_stack([node[rows, (leave + 1) % 4], node[rows, leave]]))
    return _linked(np.vstack(starts), np.vstack(ends), m * n, z)


def _saddles(grid, f, i, j):
    """(n, 2) level points of the bilinear patches over cells whose opposite corners agree in sign."""
    f00, f10, f11, f01 = (f[i + a, j + b] for a, b in CORNERS)
    bend = f00 + f11 - f10 - f01
    share = np.column_stack([f00 - f01, f00 - f10]) / bend[:, None]
    return grid[i, j] + share * (grid[i + 1, j + 1] - grid[i, j])


def _linked(starts, ends, nodes, z):
    """Chains of stretches that run from edge to edge; an edge is a row (free node, material node)."""
    keys = np.unique(np.concatenate([e[:, 0] * nodes + e[:, 1] for e in (starts, ends)]))
    follow = np.full(len(keys), -1)
    follow[np.searchsorted(keys, fixed.matmul(starts, (nodes, 1)))] = np.searchsorted(keys, fixed.matmul(ends, (nodes, 1)))
    order, first, closed = _followed(follow)
    return [_Chain(height_mm=z, free=keys[rows] // nodes, held=keys[rows] % nodes, is_closed=bool(is_closed))
            for rows, is_closed in zip(np.split(order, first[1:]), closed)] if len(keys) else []


@njit
def _followed(follow):
    """Order of all rows along their chains, the place where each chain starts in it, and whether it closes."""
    n = len(follow)
    is_first, seen = np.ones(n, np.bool_), np.zeros(n, np.bool_)
    for k in follow:
        if k >= 0:
            is_first[k] = False
    order, first, closed = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.bool_)
    count = chains = 0
    for wants_open in (True, False):
        for start in range(n):
            if seen[start] or is_first[start] != wants_open:
                continue
            first[chains], closed[chains] = count, not wants_open
            chains += 1
            k = start
            while k >= 0 and not seen[k]:
                seen[k] = True
                order[count] = k
                count += 1
                k = follow[k]
    return order, first[:chains], closed[:chains]


def _crossings(gap_at, above_at, free, held, z, tolerance_mm, gaps=None):
    """Last free points before material on stretches free -> held, to tolerance_mm; `gaps` at both where they are known.

    Chandrupatla's root finder in all rows at once: inverse quadratic steps where three points lie well for
    it, else halving; the bracket itself is brought below the tolerance.  What is left then is halved by side.
    Source: T. R. Chandrupatla, Advances in Engineering Software 28 (1997) 145-149.
    """
    length = np.maximum(fixed.hypot(*(held - free).T), 1e-300)
    result = free.copy()
    row = np.arange(len(free))
    x1, x2 = np.zeros(len(free)), np.ones(len(free))
    f1, f2 = (gap_at(free, z), gap_at(held, z)) if gaps is None else gaps
    f1, f2 = np.clip(f1, -NOTHING_MM, 0.0), np.maximum(f2, np.finfo(float).tiny)
    share = np.clip(np.where(f1 > -0.5 * NOTHING_MM, f1 / (f1 - f2), 0.5), 0.05, 0.95)
    for _ in range(SMOOTH_STEPS):
        x = x1 + share * (x2 - x1)
        f = np.maximum(gap_at(free[row] + x[:, None] * (held - free)[row], z[row]), -NOTHING_MM)
        same = (f > 0) == (f1 > 0)
        x3, f3 = np.where(same, x1, x2), np.where(same, f1, f2)
        x2, f2 = np.where(same, x2, x1), np.where(same, f2, f1)
        x1, f1 = x, f
        least = 0.5 * tolerance_mm / (length[row] * np.abs(x2 - x1))
        done = least >= 0.5
        share = np.clip(_step(x1, x2, x3, f1, f2, f3), least, 1 - least)
        result[row[done]] += (np.where(f1 > 0, x2, x1)[:, None] * (held - free)[row])[done]
        row, x1, x2, f1, f2, share = (a[~done] for a in (row, x1, x2, f1, f2, share))
    x_free, x_held = np.where(f1 > 0, x2, x1), np.where(f1 > 0, x1, x2)
    while len(row):
        x = 0.5 * (x_free + x_held)
        above = above_at(free[row] + x[:, None] * (held - free)[row], z[row])
        x_free, x_held = np.where(above, x_free, x), np.where(above, x, x_held)
        done = length[row] * np.abs(x_held - x_free) <= tolerance_mm
        result[row[done]] += (x_free[:, None] * (held - free)[row])[done]
        row, x_free, x_held = (a[~done] for a in (row, x_free, x_held))
    return result


def _step(x1, x2, x3, f1, f2, f3):
    """Share of the way from x1 to x2 for the next look: inverse quadratic, or a half."""
    with np.errstate(all="ignore"):
        xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
        quadratic = (phi * phi < xi) & ((1 - phi) ** 2 < 1 - xi)
        share = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
    return np.where(quadratic & np.isfinite(share), share, 0.5)


def _with_chords_within(asked, xy, chain, of_chains, chord_mm, tolerance_mm):
    """Points added halfway, square to chords, until the loop passes each chord's middle within chord_mm.

    Args:
        asked: (gap_at, above_at, look, near_at): `look` as gap_at, its size infinite where only the side is had for less.
        xy, chain: (n, 2) points and (n,) their chain, ascending.
        of_chains: (whether it is closed, its height), arrays over the chains.
    """
    closed, height = of_chains
    *asked, near_at = asked
    pending = np.ones(len(xy), bool)            # chords, by their first point, that nobody has looked at
    for _ in range(ROUNDS):
        last = np.append(chain[1:] != chain[:-1], True)
        following = np.where(last, np.searchsorted(chain, chain), np.arange(1, len(xy) + 1) % len(xy))
        rows = np.flatnonzero(pending & ~(last & ~closed[chain]))
        length = fixed.hypot(*(xy[following[rows]] - xy[rows]).T)
        rows, length = rows[length > 2 * chord_mm], length[length > 2 * chord_mm]
        rows = rows[near_at(0.5 * (xy[rows] + xy[following[rows]]), height[chain[rows]], 0.5 * length)]
        if len(rows) == 0:
            break
        places, new = _strays(asked, xy[rows], xy[following[rows]], height[chain[rows]], chord_mm, tolerance_mm)
        rows = rows[places]
        pending = np.zeros(len(xy), bool)
        pending[rows] = True
        xy, chain = np.insert(xy, rows + 1, new, axis=0), np.insert(chain, rows + 1, chain[rows])
        pending = np.insert(pending, rows + 1, True)
    return xy, chain


def _strays(asked, a, b, z, chord_mm, tolerance_mm):
    """Which chords a -> b the loop does not pass within chord_mm of the middle, and where it runs instead."""
    gap_at, above_at, look = asked
    middle, length = 0.5 * (a + b), fixed.hypot(*(b - a).T)
    right = np.column_stack([b[:, 1] - a[:, 1], a[:, 0] - b[:, 0]]) / length[:, None]
    beside = [look(middle + way * chord_mm * right, z) for way in (-1, 1)]
    outward = beside[0] > 0                                         # material reaches out to the left
    rows = np.flatnonzero(outward | (beside[1] <= 0))
    middle, right, outward, z, length = (v[rows] for v in (middle, right, outward, z, length))
    side = np.where(outward, -1.0, 1.0)[:, None] * right
    near, far = middle + chord_mm * side, middle + 0.75 * length[:, None] * side
    gap_near, gap_far = np.where(outward, beside[0][rows], beside[1][rows]), look(far, z)
    found = np.flatnonzero((gap_far > 0) != outward)
    near, far, outward, z, gap_near, gap_far = (v[found] for v in (near, far, outward, z, gap_near, gap_far))
    free, held = (np.where((outward == swap)[:, None], far, near) for swap in (True, False))
    gaps = tuple(np.where(outward == swap, gap_far, gap_near) for swap in (True, False))
    return rows[found], _crossings(gap_at, above_at, free, held, z, tolerance_mm, None if np.isinf(gap_near).any() else gaps)


def _distinct(xy, is_closed, tolerance_mm):
    """Points without those that lie on the one before."""
    step = fixed.hypot(*(xy - np.roll(xy, 1, axis=0)).T)
    keep = step > 2 * tolerance_mm
    if not is_closed:
        keep[0] = True
    return xy[keep]
