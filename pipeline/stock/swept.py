"""The volume that each cutter sweeps along its posted moves, answered by query.

An upright ball, bull nose or flat cutter (SweptPath) takes away everything above its bottom (flutes, then a neck no
wider), so what it leaves is a height field h(x, y), and its swept volume is closed upward.  Two sets of
formulas answer for it and know nothing of each other: the signed distance of a point, and the
height over (x, y).  Where the move that made a place has its flutes' end below it, `deviations_and_moves` looks again,
with that tool's moves ended there: beside a neck thinner than the flutes, stock is left.

Every other cutter, and every move with a tilted axis (PosedPath, tilted.py), takes away what its flutes pass through
and no more: above flutes shorter than the slot is deep, stock is left.  One formula, the signed distance,
answers for it; heights and intervals of stock come from rays in it (rays.py).
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from cuspline.program.program import Kind
from cuspline.shop.cutters import Tool
from cuspline.stock import rays, tracing, tree
from cuspline.stock.path_pieces import ARC, CENTER_V, FORM, Z0, Z1, chorded, kept_by, pieces_of
from cuspline.stock.tilted import PosedPath, path_of_pieces, posed_forest, posed_path
from cuspline.stock.tilted_pieces import upright_pieces
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.errors import SimulationError

CLOSED_UPWARD = ("ball", "bull_nose", "flat")     # types that a SweptPath knows, while they stand upright
LONGEST_RADII = 2.0       # pieces are at most this many cutter radii long: boxes stay tight

FEW_INTERVALS = 4         # room for intervals of stock on a line; lines with more are asked again, all together
BESIDE_MM = 1e-6          # so little above the flutes is rounding
MET = -2                  # a piece that is still to be found
_WORLDS = WeakKeyDictionary()       # first path -> the other paths, and what `kept_world` gives of all


@dataclass(frozen=True, eq=False, kw_only=True)
class SweptPath:
    """Upright moves of one ball, bull nose or flat cutter, ready to be queried; WCS, mm."""

    tool: Tool
    flat_radius_mm: float         # a = R - rc
    corner_radius_mm: float       # rc
    geometry: np.ndarray          # (m, 12) pieces in the tree's order, see pieces.py
    row: np.ndarray               # (m,) row of PostedMoves
    blocks: np.ndarray            # (k, 8, 8), see tree.py
    levels: int                   # of blocks
    second: int                   # blocks of the second level
    error_mm: float               # bound on what chords and rounded arcs may be off

    def __post_init__(self):
        object.__setattr__(self, "geometry", frozen(self.geometry, (None, 12), "geometry", is_handed_over=True))
        object.__setattr__(self, "row", frozen(self.row, (None,), "row", np.int64))
        object.__setattr__(self, "blocks", frozen(self.blocks, (None, 8, 8), "blocks", is_handed_over=True))

    @property
    def is_height_field(self):
        """It leaves no stock above where it cut."""
        return True

    @property
    def grown_mm(self):
        """How much farther out the cutter's surface lies than the tool's own."""
        return self.flat_radius_mm + self.corner_radius_mm - self.tool.cutter.radius_mm

    @cached_property
    def flutes_end_mm(self):
        """(m,) height up to which the flutes reach wherever they are on a piece."""
        low = np.minimum(self.geometry[:, Z0], self.geometry[:, Z1])
        return low + 2 * self.grown_mm + self.tool.cutter.flute_length_mm

    @cached_property
    def lowest_end_mm(self):
        """The lowest of `flutes_end_mm`."""
        return self.flutes_end_mm.min(initial=np.inf)

    @cached_property
    def ended(self):
        """PosedPath of the same moves: what the flutes alone sweep."""
        lines, of = chorded(self.geometry)
        lines[:, (Z0, Z1)] += self.grown_mm
        pieces = upright_pieces(lines[:, :Z1 + 1], self.row[of])
        return path_of_pieces(pieces, self.tool, is_height_field=False).grown(self.grown_mm)

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
        geometry[:, (Z0, Z1)] -= by_mm
        geometry[geometry[:, FORM] == ARC, CENTER_V] -= by_mm
        blocks[:, (4, 7)] -= by_mm
        return replace(self, flat_radius_mm=a, corner_radius_mm=rc, geometry=geometry, blocks=blocks)


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
        tuple in order of tool number: for each tool a SweptPath of what is upright and of its types, and a
        PosedPath of all else; one that would hold no move is left out.
    Raises:
        SimulationError: a feed move without a tool or with one that is not given, a cutter whose body is not
            convex, an axis that turns half round in one move, an arc that is none; `.rows`.
    """
    lost = (posted.kind != Kind.RAPID) & ~np.isin(posted.tool, list(tools))
    if lost.any():
        k = int(np.flatnonzero(lost)[0])
        raise SimulationError(f"line {posted.line[k]}: feed move with T{posted.tool[k]}, which the tool library "
                              f"does not hold; it holds {sorted(tools)}", rows=np.flatnonzero(lost))
    known = cutting_rows(posted)
    paths = []
    for number in (int(n) for n in np.unique(posted.tool[known]) if int(n) in tools):
        rows, tool = np.flatnonzero(known & (posted.tool == number)), tools[number]
        plain = posted.is_upright[rows] & (tool.cutter.type in CLOSED_UPWARD or tool.cutter.has_flat_bottom)
        paths += [make(posted, some, tool) for make, some in ((_swept, rows[plain]), (posed_path, rows[~plain]))
                  if len(some)]
    return tuple(paths)


def shrunk_paths(paths, by_mm):
    """Paths of cutters smaller by so much all round; of those of which nothing is left, none."""
    made = []
    for path in paths:
        with suppress(SimulationError):
            made.append(path.grown(-by_mm))
    return tuple(made)


def upright_paths(paths):
    """The SweptPaths among paths: balls, bull noses and flat cutters that stand upright."""
    return tuple(p for p in paths if isinstance(p, SweptPath))


def is_height_field(paths):
    """Whether all that these paths leave is a height field: no stock above a place that was cut."""
    return all(p.is_height_field for p in paths)


def _swept(posted, rows, tool):
    cutter = tool.cutter
    a = 0.0 if cutter.type == "ball" else cutter.radius_mm - cutter.corner_radius_mm
    pieces = pieces_of(posted, rows, kept_by(cutter), LONGEST_RADII * cutter.radius_mm)
    g = pieces.geometry
    low = np.minimum(g[:, 2], g[:, 5])
    order = tree.halved_order(np.column_stack([g[:, 0] + g[:, 3], g[:, 1] + g[:, 4], 2 * low]) / 2, tree.WIDTH)
    g = g[order]
    blocks, levels, second = tree.build_blocks(g)
    return SweptPath(tool=tool, flat_radius_mm=a, corner_radius_mm=cutter.radius_mm - a, geometry=g,
                     row=pieces.row[order], blocks=blocks, levels=levels, second=second, error_mm=pieces.error_mm)


def forest_of(paths):
    """SweptPaths as one argument of the kernels of `tree`: all their pieces, path after path."""
    trees, block, piece = np.zeros((len(paths), 5), np.int64), 0, 0
    for k, p in enumerate(paths):
        trees[k] = block, piece, len(p.row), p.levels, p.second
        block, piece = block + len(p.blocks), piece + len(p.row)
    stack = lambda arrays, *shape: np.concatenate([np.zeros((0, *shape)), *arrays])
    tools = np.array([(p.flat_radius_mm, p.corner_radius_mm) for p in paths]).reshape(-1, 2)
    return stack([p.geometry for p in paths], 12), stack([p.blocks for p in paths], 8, 8), trees, tools


def world_of(paths):
    """SweptPaths and PosedPaths as one argument of the kernels of `rays`."""
    return forest_of(upright_paths(paths)) + posed_forest([p for p in paths if isinstance(p, PosedPath)])


def kept_world(paths):
    """Rows of PostedMoves of all pieces (-1 at the end), their forest, and for rays.py both forests: None without PosedPath.

    Kept for as long as the first path is: whoever climbs asks a few points at a time, and the arrays are large.
    """
    paths = tuple(paths)
    known = _WORLDS.get(paths[0]) if paths else None
    if known is None or known[0] != paths[1:]:
        upright, posed = upright_paths(paths), [p for p in paths if isinstance(p, PosedPath)]
        forest = forest_of(upright)
        rows = np.concatenate([*(p.row for p in (*upright, *posed)), [-1]])
        known = paths[1:], rows, forest, forest + posed_forest(posed) if posed else None
        if paths:
            _WORLDS[paths[0]] = known
    return known[1:]


def in_morton_order(points, query):
    """Answers of `query(points)`, which likes neighbours one after the other, in the given order."""
    order = tree.morton_order(points)
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    return tuple(column[back] for column in query(order))


def _rows3(points, name):
    return for_kernel(frozen(points, (None, 3), name))


def signed_distance_mm(paths, points_mm):
    """Distance of points to everything swept: positive where material is left, negative inside.

    Inside, it is a lower bound of the depth (the deepest in any one piece).

    Args:
        paths: tuple of SweptPath and PosedPath.
        points_mm: (n, 3) WCS.
    Returns:
        (n,); inf everywhere if nothing moves.
    """
    return nearest_moves(paths, points_mm)[0]


def nearest_moves(paths, points_mm):
    """Signed distances (n,) and the row of PostedMoves (n,) each belongs to; -1: nothing moves."""
    d, piece = _nearest(paths, _rows3(points_mm, "points_mm"))
    return d, kept_world(paths)[0][piece]


def _nearest(paths, points):
    """Signed distances (n,) and the pieces (n,) they belong to, in the order of `paths`, upright ones first; -1: none."""
    _, forest, world = kept_world(paths)
    return in_morton_order(points, lambda order: tree.distances(points[order], forest) if world is None else
                           rays.distances(points[order], world))


def stock_height_mm(paths, xy_mm, top_mm, inflate_mm=0.0, bottom_mm=-np.inf):
    """Exact height of the highest stock over each (x, y) after all moves.

    Args:
        paths: tuple of SweptPath and PosedPath; with a PosedPath, what lies lower may be hollow.
        xy_mm: (n, 2) WCS.
        top_mm: stock top before the first move.
        inflate_mm: cutters grown by this (the stock eroded, exactly), or shrunk where negative
            (the stock dilated; along ridges between passes by more than that).
        bottom_mm: of the billet; heights below it (nothing is left) are given as this.
    Returns:
        (n,).
    """
    return lowest_moves(paths, xy_mm, top_mm, inflate_mm, bottom_mm)[0]


def lowest_moves(paths, xy_mm, top_mm, inflate_mm=0.0, bottom_mm=-np.inf):
    """Heights (n,) as `stock_height_mm`, and the row of PostedMoves (n,) that left each; -1: uncut."""
    xy = for_kernel(frozen(xy_mm, (None, 2), "xy_mm"))
    rows, forest, world = kept_world([p.grown(inflate_mm) for p in paths] if inflate_mm else paths)
    flat = np.column_stack([xy, np.zeros(len(xy))])
    ask = lambda order: (tree.heights(xy[order], forest, float(top_mm)) if world is None else
                         rays.highest_stock(xy[order], float(top_mm), float(bottom_mm), world))
    z, piece = in_morton_order(flat, ask)
    return np.maximum(z, bottom_mm), rows[piece]


def deviation_mm(paths, stock_min, stock_max, points_mm, normals, limit_mm):
    """Signed deviation of the remaining stock along design normals, after all moves.

    Positive: length along +normal until the ray leaves the remaining stock.  Negative: depth
    along -normal until remaining stock begins or the billet ends.  A ray that only grazes the swept volume, over
    less than a hundredth of its own length, is taken not to meet it.

    Args:
        paths: tuple of SweptPath and PosedPath.
        stock_min, stock_max: (3,) corners of the billet, WCS.
        points_mm, normals: (n, 3) on the design, unit normals out of the material, WCS.
        limit_mm: longest ray; a deviation of that size means "at least".
    Returns:
        (n,) to 1e-7 mm where the ray meets the surface squarely.
    """
    return deviations_and_moves(paths, stock_min, stock_max, points_mm, normals, limit_mm)[0]


def deviations_and_moves(paths, stock_min, stock_max, points_mm, normals, limit_mm):
    """Deviations (n,) as `deviation_mm`, and the row of PostedMoves (n,) nearest to each point."""
    ask = _tracing(stock_min, stock_max, points_mm, normals, limit_mm)
    points, normals, paths = np.asarray(points_mm, float), np.asarray(normals, float), tuple(paths)
    asked = np.arange(len(points))
    d, row, piece = ask(paths, asked)
    while len(asked):
        met = points[asked] + np.maximum(d[asked], 0.0)[:, None] * normals[asked]
        maker, above = _above_flutes(paths, met, np.where(d[asked] > 0, MET, piece[asked]))
        short = {paths[k] for k in np.unique(maker)}
        paths = (*(p.ended for p in paths if p in short), *(p for p in paths if p not in short))
        asked = asked[above]
        d[asked], row[asked], piece[asked] = ask(paths, asked)
    return d, row


def deviations_of_columns(paths, stock_min, stock_max, points_mm, normals, limit_mm):
    """The same where upright balls, bull noses and flat cutters took all above them, however short their flutes."""
    return _tracing(stock_min, stock_max, points_mm, normals, limit_mm)(paths, slice(None))[:2]


def _tracing(stock_min, stock_max, points_mm, normals, limit_mm):
    """Function of paths and an index of points to deviations, rows of PostedMoves, and pieces in the paths' order, upright
    ones first: (n,) each; -1: none."""
    points, normals = _rows3(points_mm, "points_mm"), _rows3(normals, "normals")
    low, high = frozen(stock_min, (3,), "stock_min"), frozen(stock_max, (3,), "stock_max")

    def traced(paths, some):
        rows, forest, world = kept_world(paths)
        trace, cut = (tracing.deviations, forest) if world is None else (rays.deviations, world)
        of, along = points[some], normals[some]
        d, piece = in_morton_order(of, lambda order: trace(of[order], along[order], low, high, float(limit_mm), cut))
        return d, rows[piece], piece
    return traced


def _above_flutes(paths, places, piece):
    """Places that upright moves made whose flutes end below them: number of the path (k,), and index (k,).

    Args:
        places: (n, 3) on the stock's surface, or in what is cut.   piece: (n,) that made them; MET: the one nearest to the place.
    """
    numbers = [k for k, p in enumerate(paths) if isinstance(p, SweptPath)]
    lowest = min((paths[k].lowest_end_mm for k in numbers), default=np.inf)
    high = np.flatnonzero(places[:, 2] > lowest + BESIDE_MM)
    if not len(high):
        return high, high
    met = high[piece[high] == MET]
    piece = piece.copy()
    piece[met] = _nearest(paths, places[met])[1]
    maker, above, first = [], [], 0
    for k in numbers:
        mine = high[(piece[high] >= first) & (piece[high] < first + len(paths[k].row))]
        mine = mine[places[mine, 2] > paths[k].flutes_end_mm[piece[mine] - first] + BESIDE_MM]
        maker, above, first = [*maker, np.full(len(mine), k)], [*above, mine], first + len(paths[k].row)
    return np.concatenate(maker), np.concatenate(above)


def stock_intervals(paths, stock_min, stock_max, origins_mm, directions):
    """All intervals of remaining stock along lines through the billet, after all moves.

    Stock or air along less than 2e-5 mm of a line may be left out; a line that runs in a cut surface counts as
    cut there.

    Args:
        paths: tuple of SweptPath and PosedPath.
        stock_min, stock_max: (3,) corners of the billet, WCS.
        origins_mm: (n, 3) points on the lines, WCS.   directions: (n, 3) unit vectors along them.
    Returns:
        (k, 2) begin and end of intervals along the lines, mm from their origins, growing; (n + 1,) line i holds
        intervals offsets[i] to offsets[i + 1].
    """
    origins, directions = _rows3(origins_mm, "origins_mm"), _rows3(directions, "directions")
    low, high = frozen(stock_min, (3,), "stock_min"), frozen(stock_max, (3,), "stock_max")
    world = world_of(paths)
    room, count = FEW_INTERVALS, np.zeros(0, np.int64)
    while not len(count) or count.max() > room:
        room = max(room, count.max(initial=0))
        ask = lambda order: rays.stock_along(origins[order], directions[order], low, high, room, world)
        found, count = in_morton_order(origins, ask)
    return found[np.arange(room) < count[:, None]], np.r_[0, np.cumsum(count)]
