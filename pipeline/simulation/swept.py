"""The volume that each cutter sweeps along its posted moves, answered by query.

A cutter takes away everything above its bottom (flutes, then a neck no wider), so what one
setup leaves is a height field h(x, y), and the swept volume is closed upward.  Two sets of
formulas answer for it and know nothing of each other: the signed distance of a point, and the
height over (x, y).
"""

from dataclasses import dataclass

import numpy as np

from cuspline.arrays import frozen
from cuspline.cutters import Tool
from cuspline.errors import SimulationError
from cuspline.program import Kind
from cuspline.simulation import tracing, tree
from cuspline.simulation.pieces import pieces_of

SIMULATED = ("ball", "bull_nose", "flat")
LONGEST_RADII = 2.0       # pieces are at most this many cutter radii long: boxes stay tight


@dataclass(frozen=True, eq=False, kw_only=True)
class SweptPath:
    """All moves of one tool, ready to be queried; WCS, mm."""

    tool: Tool
    flat_radius_mm: float         # a = R - rc
    corner_radius_mm: float       # rc
    geometry: np.ndarray          # (m, 12) pieces in Morton order, see pieces.py
    row: np.ndarray               # (m,) row of PostedMoves
    blocks: np.ndarray            # (k, 8, 8), see tree.py
    levels: int                   # of blocks
    root: int                     # children of the root
    error_mm: float               # bound on what chords and rounded arcs may be off

    def __post_init__(self):
        object.__setattr__(self, "geometry", frozen(self.geometry, (None, 12), "geometry"))
        object.__setattr__(self, "row", frozen(self.row, (None,), "row", np.int64))
        object.__setattr__(self, "blocks", frozen(self.blocks, (None, 8, 8), "blocks"))

    def grown(self, by_mm):
        """The same path of a cutter whose surface lies `by_mm` farther out (negative: in).

        Raises:
            SimulationError: nothing is left of the cutter.
        """
        a, rc = self.flat_radius_mm, self.corner_radius_mm + by_mm
        if rc < 0:
            a, rc = a + rc, 0.0
        if a < 0 or a + rc <= 0:
            raise SimulationError(f"T{self.tool.number} cannot be made smaller by {-by_mm} mm")
        geometry, blocks = self.geometry.copy(), self.blocks.copy()
        geometry[:, (2, 5, 8)] -= by_mm
        blocks[:, (4, 7)] -= by_mm
        return SweptPath(**{**self.__dict__, "flat_radius_mm": a, "corner_radius_mm": rc,
                            "geometry": geometry, "blocks": blocks})


def cutting_rows(posted):
    """(n,) bool: moves whose start and end are known and that are made with a tool."""
    known = np.isfinite(posted.start_mm).all(axis=1) & np.isfinite(posted.end_mm).all(axis=1)
    return known & (posted.tool > 0)


def swept_paths(posted, tools):
    """What each tool of a program sweeps, rapids included.

    Moves with an unknown start are left out; the replay judges them.

    Args:
        posted: PostedMoves.
        tools: dict of tool number -> cutters.Tool.
    Returns:
        one SweptPath a tool that moves, in order of tool number.
    Raises:
        SimulationError: a feed move without a tool, with one that is not given, or with a cutter whose type
            cannot be simulated; `.rows`.
    """
    _refuse_unknown_shapes(posted, tools)
    lost = (posted.kind != Kind.RAPID) & ~np.isin(posted.tool, list(tools))
    if lost.any():
        k = int(np.flatnonzero(lost)[0])
        raise SimulationError(f"line {posted.line[k]}: feed move with T{posted.tool[k]}, which the tool library "
                              f"does not hold; it holds {sorted(tools)}", rows=np.flatnonzero(lost))
    known = cutting_rows(posted)
    numbers = [int(n) for n in np.unique(posted.tool[known]) if int(n) in tools]
    return tuple(_swept(posted, np.flatnonzero(known & (posted.tool == n)), tools[n]) for n in numbers)


def _refuse_unknown_shapes(posted, tools):
    for number in np.unique(posted.tool[cutting_rows(posted)]):
        if number in tools and tools[number].cutter.type not in SIMULATED:
            raise SimulationError(
                f"T{number} {tools[number].cutter.name} is of type {tools[number].cutter.type}, which the simulation "
                f"does not know yet; it knows {', '.join(SIMULATED)}: choose one of these for this operation",
                rows=np.flatnonzero(posted.tool == number))


def _swept(posted, rows, tool):
    cutter = tool.cutter
    a = 0.0 if cutter.type == "ball" else cutter.radius_mm - cutter.corner_radius_mm
    pieces = pieces_of(posted, rows, cutter.type == "ball", LONGEST_RADII * cutter.radius_mm)
    g = pieces.geometry
    low = np.minimum(g[:, 2], g[:, 5])
    order = tree.morton_order(np.column_stack([g[:, 0] + g[:, 3], g[:, 1] + g[:, 4], 2 * low]) / 2)
    blocks, levels, root = tree.build_blocks(g[order])
    return SweptPath(tool=tool, flat_radius_mm=a, corner_radius_mm=cutter.radius_mm - a, geometry=g[order],
                     row=pieces.row[order], blocks=blocks, levels=levels, root=root, error_mm=pieces.error_mm)


def _forest(paths):
    """All paths as one argument of the kernels."""
    trees, block, piece = np.zeros((len(paths), 5), np.int64), 0, 0
    for k, p in enumerate(paths):
        trees[k] = block, piece, len(p.row), p.levels, p.root
        block, piece = block + len(p.blocks), piece + len(p.row)
    stack = lambda arrays, *shape: np.concatenate([np.zeros((0, *shape)), *arrays])
    tools = np.array([(p.flat_radius_mm, p.corner_radius_mm) for p in paths]).reshape(-1, 2)
    return stack([p.geometry for p in paths], 12), stack([p.blocks for p in paths], 8, 8), trees, tools


def _in_morton_order(points, query):
    """Answers of `query(points)`, which likes neighbours one after the other, in the given order."""
    order = tree.morton_order(points)
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    return tuple(column[back] for column in query(order))


def _rows_of(paths, piece):
    """Rows of PostedMoves of pieces; -1 stays -1."""
    rows = np.concatenate([*(p.row for p in paths), [-1]])
    return rows[piece]


def _rows3(points, name):
    return np.ascontiguousarray(frozen(points, (None, 3), name))


def signed_distance_mm(paths, points_mm):
    """Distance of points to everything swept: positive where material is left, negative inside.

    Inside, it is a lower bound of the depth (the deepest in any one piece).

    Args:
        paths: tuple of SweptPath.
        points_mm: (n, 3) WCS.
    Returns:
        (n,); inf everywhere if nothing moves.
    """
    return nearest_moves(paths, points_mm)[0]


def nearest_moves(paths, points_mm):
    """Signed distances (n,) and the row of PostedMoves (n,) each belongs to; -1: nothing moves."""
    points, forest = _rows3(points_mm, "points_mm"), _forest(paths)
    d, piece = _in_morton_order(points, lambda order: tree.distances(points[order], forest))
    return d, _rows_of(paths, piece)


def stock_height_mm(paths, xy_mm, top_mm, inflate_mm=0.0):
    """Exact height of the stock over each (x, y) after all moves.

    Args:
        paths: tuple of SweptPath.
        xy_mm: (n, 2) WCS.
        top_mm: stock top before the first move.
        inflate_mm: cutters grown by this (the stock eroded, exactly), or shrunk where negative
            (the stock dilated; along ridges between passes by more than that).
    Returns:
        (n,).
    """
    return lowest_moves(paths, xy_mm, top_mm, inflate_mm)[0]


def lowest_moves(paths, xy_mm, top_mm, inflate_mm=0.0):
    """Heights (n,) as `stock_height_mm`, and the row of PostedMoves (n,) that left each; -1: uncut."""
    xy = np.ascontiguousarray(frozen(xy_mm, (None, 2), "xy_mm"))
    forest = _forest([p.grown(inflate_mm) for p in paths] if inflate_mm else paths)
    flat = np.column_stack([xy, np.zeros(len(xy))])
    z, piece = _in_morton_order(flat, lambda order: tree.heights(xy[order], forest, float(top_mm)))
    return z, _rows_of(paths, piece)


def deviation_mm(paths, stock_min, stock_max, points_mm, normals, limit_mm):
    """Signed deviation of the remaining stock along design normals, after all moves.

    Positive: length along +normal until the ray leaves the remaining stock.  Negative: depth
    along -normal until remaining stock begins or the billet ends.  A ray that only grazes the swept volume, over
    less than a hundredth of its own length, is taken not to meet it.

    Args:
        paths: tuple of SweptPath.
        stock_min, stock_max: (3,) corners of the billet, WCS.
        points_mm, normals: (n, 3) on the design, unit normals out of the material, WCS.
        limit_mm: longest ray; a deviation of that size means "at least".
    Returns:
        (n,) to 1e-7 mm where the ray meets the surface squarely.
    """
    return deviations_and_moves(paths, stock_min, stock_max, points_mm, normals, limit_mm)[0]


def deviations_and_moves(paths, stock_min, stock_max, points_mm, normals, limit_mm):
    """Deviations (n,) as `deviation_mm`, and the row of PostedMoves (n,) nearest to each point."""
    points, normals, forest = _rows3(points_mm, "points_mm"), _rows3(normals, "normals"), _forest(paths)
    low, high = frozen(stock_min, (3,), "stock_min"), frozen(stock_max, (3,), "stock_max")
    ask = lambda order: tracing.deviations(points[order], normals[order], low, high, float(limit_mm), forest)
    d, piece = _in_morton_order(points, ask)
    return d, _rows_of(paths, piece)
