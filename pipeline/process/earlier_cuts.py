r"""The stock in front of a cutter as it stood when the cutter came there: how deep any place is in it.

Moves of upright balls, bull noses and flat cutters are pieces, numbered in the order of cutting.  A place is so deep in the
stock as it is from the nearest of:

    what earlier pieces have swept        exact outside, at least so much inside (tree.py); a branch is left out where
                                          its least number is no earlier than what is asked for
    the way just behind the cutter        the last piece, cut off a little behind: what sweeps the place itself
    the stock that the program found      a box, and heights over a grid

The depth is positive in stock and changes no faster than the place, but over steep heights of that grid.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Kind
from cuspline.replay.scene import FoundStock
from cuspline.stock import tree
from cuspline.stock.path_pieces import X0, X1, Arcs, repeated_parts
from cuspline.stock.swept import CLOSED_UPWARD, LONGEST_RADII, cutting_rows
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit
from cuspline.values.rows import HIGH_X, HIGH_Y, HIGH_Z, LOW_X, LOW_Y, LOW_Z

SAGITTA_MM = 2e-4         # of the chords of arcs: a tenth of the thinnest chip that is seen
LATER = np.iinfo(np.int64).max
GRID_X, GRID_Y, GRID_PITCH = range(3)


@dataclass(frozen=True, eq=False, kw_only=True)
class CutPieces:
    """All moves of a program with upright balls, bull noses and flat cutters, in the order of cutting; WCS, mm."""

    geometry: np.ndarray      # (m, 12) straight pieces, see path_pieces.py
    row: np.ndarray           # (m,) row of PostedMoves
    tool: np.ndarray          # (m,) number of the tool
    world: tuple              # forest, numbers and least numbers for the kernels

    def __post_init__(self):
        object.__setattr__(self, "geometry", frozen(self.geometry, (None, 12), "geometry", is_handed_over=True))
        object.__setattr__(self, "row", frozen(self.row, (len(self.geometry),), "row", np.int64))
        object.__setattr__(self, "tool", frozen(self.tool, (len(self.geometry),), "tool", np.int64))

    @classmethod
    def of(cls, posted, tools):
        """Of PostedMoves and {number: cutters.Tool}; moves of other tools, and such as lean, are left out."""
        known = cutting_rows(posted) & posted.is_upright & np.isin(posted.tool, plain_tools(tools))
        rows = np.flatnonzero(known)
        longest = LONGEST_RADII * radii_mm(posted.tool[rows], tools)
        geometry, row = straight_pieces(posted, rows, longest)
        tool = posted.tool[row].astype(np.int64)
        return cls(geometry=geometry, row=row, tool=tool, world=_world(geometry, tool, tools))


def radii_mm(numbers, tools):
    """(m,) radius of the cutter of each of tool numbers (m,)."""
    used, which = np.unique(numbers, return_inverse=True)
    return np.array([tools[n].cutter.radius_mm for n in used.tolist()])[which]


def plain_tools(tools):
    """Numbers of the tools that are known here."""
    return [n for n, t in tools.items() if t.cutter.type in CLOSED_UPWARD and t.head is None]


def straight_pieces(posted, rows, longest_mm):
    """(m, 12) straight pieces of moves in the order of cutting, and their rows; `longest_mm` (k,) of each move's."""
    is_arc = posted.kind[rows] >= Kind.ARC_CW
    arcs = Arcs(posted, rows[is_arc]) if is_arc.any() else None
    length = np.sqrt(((posted.end_mm[rows] - posted.start_mm[rows]) ** 2).sum(axis=1))
    counts = np.maximum(np.ceil(length / longest_mm - 1e-9), 1)
    if arcs is not None:
        turned, radius = np.abs(arcs.angle1 - arcs.angle0), np.maximum(arcs.radius0, arcs.radius1)
        widest = np.minimum(2 * fixed.arccos(1 - np.minimum(SAGITTA_MM / radius, 0.5)), longest_mm[is_arc] / radius)
        counts[is_arc] = np.maximum(np.ceil(turned / widest - 1e-9), 1)
    counts = counts.astype(np.int64)
    whole, part = repeated_parts(counts)
    which = np.cumsum(is_arc) - 1                              # of the arcs

    def at(share):
        points = posted.start_mm[rows[whole]] + share[:, None] * (posted.end_mm - posted.start_mm)[rows[whole]]
        if arcs is not None:
            bent = is_arc[whole]
            k = which[whole[bent]]
            points[bent] = arcs.points(k, arcs.angle0[k] + share[bent] * (arcs.angle1 - arcs.angle0)[k])
        return points

    geometry = np.zeros((len(whole), 12))
    geometry[:, X0:X1], geometry[:, X1:X1 + 3] = at(part / counts[whole]), at((part + 1) / counts[whole])
    return geometry, rows[whole]


def _world(geometry, tool, tools):
    """(forest, number of each of its pieces, least numbers (blocks, 8), tool number of each tree)."""
    numbers, parts, block, piece = np.unique(tool).tolist(), [], 0, 0
    trees, cutters = np.zeros((len(numbers), 5), np.int64), np.zeros((len(numbers), 2))
    for k, number in enumerate(numbers):
        mine, cutter = np.flatnonzero(tool == number), tools[number].cutter
        g = geometry[mine]
        middle = np.column_stack([g[:, 0] + g[:, 3], g[:, 1] + g[:, 4], 2 * np.minimum(g[:, 2], g[:, 5])]) / 2
        order = tree.halved_order(middle, tree.WIDTH)
        blocks, levels, second = tree.build_blocks(np.ascontiguousarray(g[order]))
        least = np.full((len(blocks), tree.WIDTH), LATER)
        _fill_least(mine[order], levels, second, least)
        trees[k] = block, piece, len(mine), levels, second
        corner = cutter.radius_mm if cutter.type == "ball" else cutter.corner_radius_mm
        cutters[k] = cutter.radius_mm - corner, corner
        parts.append((g[order], blocks, mine[order], least))
        block, piece = block + len(blocks), piece + len(mine)
    empty = np.zeros((0, 12)), np.zeros((0, 8, 8)), np.zeros(0, np.int64), np.zeros((0, tree.WIDTH), np.int64)
    pieces, blocks, number, least = (np.concatenate(column) for column in zip(empty, *parts))
    return (pieces, blocks, trees, cutters), number, least, np.array(numbers, np.int64)


@njit
def _fill_least(number, levels, second, least):
    """Least number under each child, in the order of tree.build_blocks' blocks."""
    span, row = 1, len(least)
    for level in range(levels - 1, -1, -1):
        count = second << 3 * (level - 1) if level > 0 else 1         # 1 << 3: tree.WIDTH
        row -= count
        for i in range(count * tree.WIDTH):
            for j in range(i * span, min((i + 1) * span, len(number))):
                least[row + i // tree.WIDTH, i % tree.WIDTH] = min(least[row + i // tree.WIDTH, i % tree.WIDTH], number[j])
        span *= tree.WIDTH


def found_for_kernel(stock: FoundStock):
    """(box (6,), grid (3,), heights (ny, nx) or (0, 0) where all of the box is stock) of a FoundStock."""
    box = np.array([*stock.min_mm, *stock.max_mm], float)
    grid = np.array([*stock.zmap.origin_mm, stock.pitch_mm], float)
    return box, grid, np.zeros((0, 0)) if stock.top_mm is None else np.array(stock.top_mm)


@njit
def found_depth(px, py, pz, found):
    """How deep a place is in the stock that the program found."""
    box, grid, heights = found
    depth = min(min(px - box[LOW_X], box[HIGH_X] - px), min(min(py - box[LOW_Y], box[HIGH_Y] - py),
                                                           min(pz - box[LOW_Z], box[HIGH_Z] - pz)))
    if depth <= 0.0 or len(heights) == 0:
        return depth
    ny, nx = heights.shape
    x = min(max((px - grid[GRID_X]) / grid[GRID_PITCH], 0.0), nx - 1.0)
    y = min(max((py - grid[GRID_Y]) / grid[GRID_PITCH], 0.0), ny - 1.0)
    i, j = max(min(int(x), nx - 2), 0), max(min(int(y), ny - 2), 0)
    ii, jj, u, v = min(i + 1, nx - 1), min(j + 1, ny - 1), x - i, y - j
    low, high = heights[j, i] * (1 - u) + heights[j, ii] * u, heights[jj, i] * (1 - u) + heights[jj, ii] * u
    sx = (heights[j, ii] - heights[j, i]) * (1 - v) + (heights[jj, ii] - heights[jj, i]) * v
    sy = high - low
    steep = math.sqrt(1.0 + (sx * sx + sy * sy) / (grid[GRID_PITCH] * grid[GRID_PITCH]))
    return min(depth, (low * (1 - v) + high * v - pz) / steep)


@njit
def swept_depth(px, py, pz, before, best, enough, world, hint, stack, bounds):
    """How far a place is outside all that pieces before a number have swept, at most `best`, and the nearest piece or -1.

    Below `enough` (negative: so deep in what one piece has swept) nothing deeper is looked for.
    """
    forest, number, least, _ = world
    _, _, trees, _ = forest
    found = -1
    if hint >= 0 and number[hint] < before:             # first the hint alone, then all trees
        d = tree.one_piece_distance(px, py, pz, hint, forest)
        if d < best:
            best, found = d, hint
    for k in range(len(trees)):
        if best <= enough:
            break
        best, t = tree.nearest_in(k, px, py, pz, forest, least, before, enough, best, stack, bounds)
        found = t if t >= 0 else found
    return best, found
