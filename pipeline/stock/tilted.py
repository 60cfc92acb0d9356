"""What a cutter of any shape sweeps along moves with any tool axis.

The cutter is the closed solid of revolution of its cutting outline: the flutes only.  Neck, shank and holder cut
nothing, so where a slot is deeper than the flutes are long, what stood above them is left.  (The replay says
whether neck or holder would hit it.)
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from cuspline.shop.cutters import Tool
from cuspline.stock import tilted_pieces, tilted_tree, tree
from cuspline.stock.outlines import outline_distance, outline_pieces
from cuspline.stock.tilted_pieces import TURN_ERROR_MM, posed_pieces
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import covered, frozen, lent
from cuspline.values.errors import SimulationError

LONGEST_RADII = 2.0       # sub-steps are at most this many cutter radii long: boxes stay tight

HIGHEST_RADII = 10.0      # where contact normals are looked for on the axis: a lean of 6 degrees meets it there


@dataclass(frozen=True, eq=False, kw_only=True)
class PosedPath:
    """Moves of one tool as sub-steps of a tilted, turning cutter, ready to be queried; WCS, mm."""

    tool: Tool
    outline: np.ndarray           # (o, 10) see outlines.py
    grown_mm: float               # the cutter's surface lies this much farther out
    geometry: np.ndarray          # (m, 14) sub-steps in the tree's order, see tilted_pieces.py
    row: np.ndarray               # (m,) row of PostedMoves
    step: np.ndarray              # (m,) place of each sub-step in the order of cutting, from 0
    nodes: np.ndarray             # (k, 56), see tilted_tree.py
    touches: np.ndarray           # (m, 6), see contact_bounds.py
    leaves: int
    error_mm: float               # bound on what chords of arcs and sub-steps of turns may be off
    is_height_field: bool         # upright, and nowhere narrower above: it leaves no stock above where it cut

    def __post_init__(self):
        object.__setattr__(self, "outline", frozen(self.outline, (None, 10), "outline"))
        for name, width in (("geometry", 14), ("nodes", tilted_tree.COLUMNS), ("touches", 6)):
            object.__setattr__(self, name, covered(getattr(self, name), (None, width), name))
        for name in ("row", "step"):
            object.__setattr__(self, name, frozen(getattr(self, name), (len(self.geometry),), name, np.int64))

    @property
    def is_steady(self):
        """The axis keeps its direction in every move: what a sub-step sweeps is convex."""
        return not self.geometry[:, 9:12].any()

    def of_body(self, outline, chosen=slice(None)):
        """What another body of revolution (`outline`, (o, 10)) sweeps while this tool moves; `chosen`: some of the sub-steps."""
        geometry, height, radius = self.geometry[chosen], outline[:, 2].max(), outline[:, 1].max()
        nodes, touches, leaves = tilted_tree.build_nodes(geometry, outline, 0.0, max(height, HIGHEST_RADII * radius))
        return PosedPath(**{**self.__dict__, "outline": outline, "grown_mm": 0.0, "geometry": geometry, "nodes": nodes,
                            "touches": touches, "leaves": leaves, "row": self.row[chosen], "step": self.step[chosen],
                            "is_height_field": False})

    def of_its_ball(self):
        """What the ball of a ball cutter sweeps, its centre moving straight, less what turning adds; None: no whole ball cuts.

        A ball is the same however the tool leans, so that its sub-steps sweep what is convex though the axis turns.
        """
        cutter, g = self.tool.cutter, self.geometry.copy()
        radius = cutter.radius_mm
        if cutter.type != "ball" or cutter.flute_length_mm < 2 * radius:
            return None
        bend = radius * float(g[:, tilted_pieces.TURN].max(initial=0.0)) ** 2 / 8
        tips, ways, axes, turns = (g[:, first:first + 3] for first in (
            tilted_pieces.TIP, tilted_pieces.WAY, tilted_pieces.AXIS, tilted_pieces.AXIS_WAY))
        tips += radius * axes
        ways += radius * turns
        axes[:], turns[:], g[:, tilted_pieces.TURN] = (0.0, 0.0, 1.0), 0.0, 0.0
        g[:, tilted_pieces.LENGTH] = np.sqrt((ways ** 2).sum(axis=1))
        outline = np.array([[1.0, 0.0, -radius, 0.0, 0.0, radius, 0.0, -1.0, 0.0, 1.0]])
        nodes, touches, leaves = tilted_tree.build_nodes(g, outline, -radius, radius)
        return PosedPath(**{**self.__dict__, "outline": outline, "geometry": g, "nodes": nodes, "touches": touches,
                            "leaves": leaves, "grown_mm": self.grown_mm - bend, "is_height_field": False})

    def grown(self, by_mm):
        """The same path of a cutter whose surface lies `by_mm` farther out (negative: in).

        Its distances are those of the cutter, less `by_mm`: of a smaller cutter exact in sign and inside, and a
        lower bound outside, opposite its edges.

        Raises:
            SimulationError: nothing is left of the cutter.
        """
        by = self.grown_mm + by_mm
        if by <= -inradius_mm(self.outline):
            raise SimulationError(f"T{self.tool.number} cannot be made smaller by {-by_mm} mm")
        return PosedPath(**{**self.__dict__, "grown_mm": by})


def inradius_mm(outline):
    """Radius of the largest ball in the cutter's body; its centre is on the axis."""
    height = outline[:, 2].max()
    depth = minimize_scalar(lambda z: outline_distance(0.0, z, outline, 0, len(outline))[0], bounds=(0.0, height),
                            method="bounded", options={"xatol": 1e-9 * height})
    return -float(depth.fun)


def posed_path(posted, rows, tool, turn_error_mm=TURN_ERROR_MM, longest_mm=np.inf):
    """PosedPath of the given moves.

    Args:
        posted: PostedMoves.
        rows: (k,) rows with known start and end, growing, made with `tool`.
        tool: cutters.Tool.
        turn_error_mm: how far the cutter's farthest point may be off where the axis turns.
        longest_mm: no sub-step's tip runs farther, nor than LONGEST_RADII.
    Raises:
        SimulationError: a cutter whose body is not convex; an axis that turns half round in a move; a bad arc.
    """
    profile = tool.cutter.profile
    radius, height = profile.largest_radius_mm, profile.height_mm
    longest = min(LONGEST_RADII * radius, longest_mm)
    pieces = posed_pieces(posted, rows, longest, float(fixed.hypot(radius, height)), turn_error_mm)
    return path_of_pieces(pieces, tool, is_height_field=bool(posted.is_upright[rows].all()) and not profile.is_undercutting)


def path_of_pieces(pieces, tool, is_height_field):
    """PosedPath of PosedPieces of a tool."""
    profile = tool.cutter.profile
    outline = outline_pieces(profile, f"T{tool.number} {tool.cutter.name}")
    radius, height = profile.largest_radius_mm, profile.height_mm
    lowest = outline[0, 4] if outline[0, 0] else outline[1, 4] if outline[1, 0] else 0.0
    g = pieces.geometry
    order = tree.halved_order(g[:, :3] + 0.5 * g[:, 3:6] + lowest * (g[:, 6:9] + 0.5 * g[:, 9:12]), tilted_tree.LEAF)
    g = g[order]
    nodes, touches, leaves = tilted_tree.build_nodes(g, outline, lowest, max(height, lowest + HIGHEST_RADII * radius))
    return PosedPath(tool=tool, outline=outline, grown_mm=0.0, geometry=g,
                     row=pieces.row[order], step=order, nodes=nodes, touches=touches, leaves=leaves, error_mm=pieces.error_mm,
                     is_height_field=is_height_field)


def posed_forest(paths):
    """All PosedPaths as one argument of the kernels."""
    trees, node, piece, first = np.zeros((len(paths), 6), np.int64), 0, 0, 0
    for k, p in enumerate(paths):
        trees[k] = node, piece, len(p.row), p.leaves, first, first + len(p.outline)
        node, piece, first = node + len(p.nodes), piece + len(p.row), first + len(p.outline)
    stack = lambda arrays, width: lent(arrays[0]) if len(arrays) == 1 else np.concatenate([np.zeros((0, width)), *arrays])
    grown = np.array([p.grown_mm for p in paths])
    return (stack([p.geometry for p in paths], 14), stack([p.nodes for p in paths], tilted_tree.COLUMNS),
            stack([p.outline for p in paths], 10), trees, grown, stack([p.touches for p in paths], 6))
