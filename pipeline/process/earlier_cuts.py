r"""The stock in front of a cutter as it stood when the cutter came there: how deep any place is in it.

Moves are pieces, numbered in the order of cutting: straight ones of upright balls, bull noses and flat cutters, sub-steps of
all others.  A place is so deep in the stock as it is from the nearest of:

    what earlier pieces have swept        exact outside, at least so much inside (tree.py; timed.py where cutters lean or have
                                          another form); a branch is left out where its least number is no earlier than what
                                          is asked for
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
from cuspline.stock.distance_kernels import piece_distance
from cuspline.stock.path_pieces import X0, X1, Arcs, repeated_parts
from cuspline.stock.swept import CLOSED_UPWARD, LONGEST_RADII, cutting_rows
from cuspline.stock.tilted import posed_path
from cuspline.stock.tilted_kernels import substep_distance
from cuspline.stock.tilted_pieces import AXIS, AXIS_WAY, LENGTH
from cuspline.stock.tilted_tree import BEHIND_LAST, FIRST_LINE
from cuspline.stock.timed import nearest_within, timed_forest
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit
from cuspline.values.rows import HIGH_X, HIGH_Y, HIGH_Z, LOW_X, LOW_Y, LOW_Z

SAGITTA_MM = 2e-4         # of the chords of arcs: a tenth of the thinnest chip that is seen
LATER = np.iinfo(np.int64).max
GRID_X, GRID_Y, GRID_PITCH = range(3)
FOREST_OUTLINES, FOREST_TREES = 2, 3        # of a timed forest
SEEN = (*CLOSED_UPWARD, "tapered_ball")      # types whose edges are looked at, leaning or not


@dataclass(frozen=True, eq=False, kw_only=True)
class CutPieces:
    """All moves of a program, but for those of tools on angle heads, in the order of cutting; WCS, mm."""

    geometry: np.ndarray      # (m, 14) straight pieces (12), see path_pieces.py, or sub-steps, see tilted_pieces.py
    tree: np.ndarray          # (m,) that holds it: of straight pieces 0 and on, of sub-steps -2 and on downwards
    start_mm: np.ndarray      # (m, 3) tip
    way_mm: np.ndarray        # (m, 3) of the tip
    axis: np.ndarray          # (m, 3) where it begins
    turn: np.ndarray          # (m, 3) axis where it ends less axis where it begins
    row: np.ndarray           # (m,) row of PostedMoves
    tool: np.ndarray          # (m,) number of the tool
    world: tuple              # forest, numbers and least numbers of straight pieces, timed forest of sub-steps

    def __post_init__(self):
        m = len(self.geometry)
        object.__setattr__(self, "geometry", frozen(self.geometry, (m, 14), "geometry", is_handed_over=True))
        for name in ("start_mm", "way_mm", "axis", "turn"):
            object.__setattr__(self, name, frozen(getattr(self, name), (m, 3), name, is_handed_over=True))
        for name in ("tree", "row", "tool"):
            object.__setattr__(self, name, frozen(getattr(self, name), (m,), name, np.int64))

    @classmethod
    def of(cls, posted, tools):
        """Of PostedMoves and {number: cutters.Tool}; moves of tools on angle heads are left out."""
        known = cutting_rows(posted)
        plain = known & posted.is_upright & np.isin(posted.tool, plain_tools(tools))
        rows = np.flatnonzero(plain)
        straight, row = straight_pieces(posted, rows, LONGEST_RADII * radii_mm(posted.tool[rows], tools))
        tool = posted.tool[row].astype(np.int64)
        numbers = np.unique(tool)
        paths = [posed_path(posted, np.flatnonzero(known & ~plain & (posted.tool == n)), tools[n])
                 for n in np.unique(posted.tool[known & ~plain]).tolist() if n in tools and tools[n].head is None]
        whole = np.zeros((len(row), 14))
        whole[:, :12] = straight
        parts = [(whole, np.searchsorted(numbers, tool), row, tool)]
        for k, path in enumerate(paths):
            geometry, rows = np.empty_like(path.geometry), np.empty_like(path.row)
            geometry[path.step], rows[path.step] = path.geometry, path.row
            parts.append((geometry, np.full(len(rows), -2 - k), rows, np.full(len(rows), path.tool.number)))
        geometry, trees, row, tool = (np.concatenate(column) for column in zip(*parts))
        order = np.argsort(row, kind="stable")              # no row has pieces of both kinds
        rank = np.empty(len(order), np.int64)
        rank[order] = np.arange(len(order))
        of_parts = np.split(rank, np.cumsum([len(part[0]) for part in parts])[:-1])
        posed = timed_forest(paths, [mine[path.step] for mine, path in zip(of_parts[1:], paths)])
        world = (*_world(straight, parts[0][3], of_parts[0], tools), posed)
        geometry, trees = geometry[order], trees[order]
        is_posed, up = trees[:, None] < -1, np.array([0.0, 0.0, 1.0])
        return cls(geometry=geometry, tree=trees, row=row[order], tool=tool[order], world=world,
                   start_mm=geometry[:, X0:X1], way_mm=geometry[:, X1:X1 + 3] - np.where(is_posed, 0.0, geometry[:, X0:X1]),
                   axis=np.where(is_posed, geometry[:, AXIS:AXIS_WAY], up),
                   turn=np.where(is_posed, geometry[:, AXIS_WAY:LENGTH], 0.0))


def radii_mm(numbers, tools, of="radius_mm"):
    """(m,) radius of the cutter of each of tool numbers (m,), or another of its lengths."""
    used, which = np.unique(numbers, return_inverse=True)
    return np.array([getattr(tools[n].cutter, of) or 0.0 for n in used.tolist()], float)[which]


def seen_tools(tools):
    """Numbers of the tools whose edges are looked at."""
    return [n for n, t in tools.items() if t.cutter.type in SEEN and t.head is None]


def plain_tools(tools):
    """Numbers of the tools that, upright, leave nothing above where they have cut."""
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


def _world(geometry, tool, own, tools):
    """(forest, number of each of its pieces, least numbers (blocks, 8)) of straight pieces, whose numbers are `own` (m,)."""
    numbers, parts, block, piece = np.unique(tool).tolist(), [], 0, 0
    trees, cutters = np.zeros((len(numbers), 5), np.int64), np.zeros((len(numbers), 2))
    for k, number in enumerate(numbers):
        mine, cutter = np.flatnonzero(tool == number), tools[number].cutter
        g = geometry[mine]
        middle = np.column_stack([g[:, 0] + g[:, 3], g[:, 1] + g[:, 4], 2 * np.minimum(g[:, 2], g[:, 5])]) / 2
        order = tree.halved_order(middle, tree.WIDTH)
        blocks, levels, second = tree.build_blocks(np.ascontiguousarray(g[order]))
        least = np.full((len(blocks), tree.WIDTH), LATER)
        _fill_least(own[mine[order]], levels, second, least)
        trees[k] = block, piece, len(mine), levels, second
        corner = cutter.radius_mm if cutter.type == "ball" else cutter.corner_radius_mm
        cutters[k] = cutter.radius_mm - corner, corner
        parts.append((g[order], blocks, own[mine[order]], least))
        block, piece = block + len(blocks), piece + len(mine)
    empty = np.zeros((0, 12)), np.zeros((0, 8, 8)), np.zeros(0, np.int64), np.zeros((0, tree.WIDTH), np.int64)
    pieces, blocks, number, least = (np.concatenate(column) for column in zip(empty, *parts))
    return (pieces, blocks, trees, cutters), number, least


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
def swept_depth(px, py, pz, before, best, enough, world, hint, stack, bounds, waiting):
    """How far a place is outside all that pieces before a number have swept, at most `best`, and the nearest piece or -1.

    Below `enough` (negative: so deep in what one piece has swept) nothing deeper is looked for.
    """
    forest, number, least, posed = world
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
    if best > enough and len(posed[FOREST_TREES]):
        best = min(best, nearest_within(px, py, pz, best, posed, before, stack, bounds, waiting))
    return best, found


@njit
def cut_off_distance(px, py, pz, behind, k, best, world, waiting):
    """Of a place to what one piece has swept, `k` being its tree, see CutPieces; of a sub-step above `best` anything from it on.

    behind: (14,) the piece.
    """
    (_, _, _, tools), _, _, posed = world
    if k >= 0:
        return piece_distance(px, py, pz, behind, tools[k, tree.FLAT_RADIUS], tools[k, tree.CORNER_RADIUS])
    outlines, trees = posed[FOREST_OUTLINES], posed[FOREST_TREES]
    d, _ = substep_distance(px, py, pz, behind.reshape(1, -1), 0, outlines, trees[-2 - k, FIRST_LINE], trees[-2 - k, BEHIND_LAST],
                            best, waiting)
    return d
