r"""Sharp edges broken by a pointed cutter, as far as its cone touches nothing else.

        \    |    /      top of the break: the level face
         \   |   /_____  the cone through the edge by width_mm; below the break it may touch the wall, above it
          \__|__/ '|     nothing; beside it stands whatever the other side's cone would meet
             tip   |
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from cuspline.design.edge_breaks import EdgeBreak
from cuspline.planning.chamfering import MARGIN_MM, stock_under
from cuspline.planning.context import path_tolerance_mm
from cuspline.planning.contouring import CURVE_SHARE, HIGH_MM, STANDS_MM, STARTS, WITHIN_MM
from cuspline.planning.drilling import in_words
from cuspline.program.program import Moves, MoveWriter
from cuspline.toolpaths.prismatic.contour_moves import arc_leads, follow
from cuspline.toolpaths.prismatic.plan_elements import PlanChain, chains_of, offset_chain
from cuspline.toolpaths.prismatic.sharp_edges import LeftEdge, sharp_edges
from cuspline.toolpaths.prismatic.tabs import stretch_of
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import runs_of
from cuspline.values.errors import CutterDoesNotFit, PlanError

EVEN_RAD = math.radians(45)         # a break of two equal legs
BELOW_SHARES = (0.25, 0.1, 0.02)    # of what the cone has to spare, that the tip is below the break
MOST_BELOW_MM = 1.0
UNDER, OVER = np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 11)       # of the cone's heights below and above the break: discs
LOOK_MM = 0.25                      # from place to place along an edge
LEAST_MM = 0.5                      # a shorter run is none
WORTH = 0.05                        # of a chain, that another cutter breaks more of it by
BESIDE_MM = 0.3                     # a place of an edge nearer than this to one that is broken is broken too
BLOCKED = "the cutter would touch what stands beside it, or below"


@dataclass(frozen=True, eq=False, kw_only=True)
class BreakWay:
    """One run of a cutter along edges, or straight down where the path is None."""

    path: PlanChain | None
    middle: np.ndarray          # (2,) where it comes straight down
    tip_mm: float
    edge_mm: float              # height of the edge
    edge: np.ndarray            # (n, 2) places of the edge that it breaks


@dataclass(frozen=True, eq=False, kw_only=True)
class Cone:
    """A pointed cutter at a break: legs and heights."""

    tool: object                # shop.cutters.Tool
    wide_mm: float              # leg in the level face
    high_mm: float              # leg down the wall
    below_mm: float             # of the tip under the break

    @property
    def foot_mm(self):
        """Its radius at the break's lower edge."""
        return self.tool.cutter.cone_radius_mm(self.below_mm)

    def discs(self):
        """[(radius, height over the tip, how much farther from the wall it is to be asked)]: what must pass, round the cone."""
        cutter, top = self.tool.cutter, self.below_mm + self.high_mm
        slices = [(low, high, 0.0) for part in (self.below_mm * UNDER, top + (cutter.point_height_mm - top) * OVER)
                  for low, high in pairwise(part.tolist())] + [(self.below_mm, top, self.wide_mm)]
        return [(cutter.cone_radius_mm(high) - WITHIN_MM, low, aside) for low, high, aside in slices]


def deburred(work):
    """The operations of a deburr: ([PlannedOperation], (n,) bool: no samples, for no face is finished).

    Args:
        work: PlanningContext of an operation with the fields of strategies.deburr.Deburr.
    Raises:
        PlanError: no sharp edge that a pointed cutter can break; an operation of the same name.
    """
    operation = work.operation
    if sum(o.title.lower() == operation.title.lower() for o in work.setup.operations) > 1:
        raise PlanError(f"{operation.title}: another operation of {work.setup.name} is called so, and a break is found by its "
                        "operation's name: give both a name of their own")
    sharp, left = sharp_edges(work.faces, work.wanted, CURVE_SHARE * path_tolerance_mm(work.finish))
    by_tool, places = {}, {}
    for z, chain in _chains(sharp):
        cone, ways = _best(work, chain, z)
        edge = chain.places(LOOK_MM)
        left += _uncovered(edge, z, np.vstack([w.edge for w in ways]) if ways else None)
        if ways:
            by_tool.setdefault(cone.tool.number, (cone, []))[1].extend(ways)
            places.setdefault(cone.tool.number, []).append(np.column_stack([edge, np.full(len(edge), z)]))
    if not by_tool:
        raise PlanError(f"{operation.title}: no sharp edge is broken: " + (_said(work, left) if left else
                        f"{' and '.join(work.face_names)} have none between a level face and an upright wall"))
    made = [_operation(work, *by_tool[n], places[n], len(by_tool), left if k == 0 else []) for k, n in enumerate(by_tool)]
    return made, np.zeros(len(work.samples.area_mm2), bool)


def _said(work, left):
    return "; ".join(dict.fromkeys(f"at {in_words(work.in_part(e.place_mm))} {e.why}" for e in left[:3]))


def _chains(sharp):
    """[(height, PlanChain)] of SharpEdges that follow one another."""
    by_height = {}
    for edge in sharp:
        by_height.setdefault(round(edge.z_mm, 6), []).extend(edge.elements)
    return [(z, chain) for z in sorted(by_height, reverse=True) for chain in chains_of(by_height[z])]


def _best(work, chain, z):
    """(Cone, [BreakWay]) that breaks most of a chain; (None, []) where none breaks any."""
    best, least, edge = (None, []), chain.length_mm, chain.places(LOOK_MM)
    tools = work.tools("chamfer_mill", "spot_drill")
    lean = lambda t: abs(math.radians(t.cutter.point_angle_deg) / 2 - EVEN_RAD)
    for tool in sorted(tools, key=lambda t: (round(lean(t), 9), -t.cutter.diameter_mm, t.number)):
        for cone in _cones(work.operation, tool):
            ways = _along(work, cone, chain, z) or _straight_down(work, cone, chain, z)
            left = sum(e.length_mm for e in _uncovered(edge, z, np.vstack([w.edge for w in ways]))) if ways else math.inf
            if left < least - max(LEAST_MM, WORTH * chain.length_mm):
                best, least = (cone, ways), left
            if left < LEAST_MM:
                return cone, ways
    return best


def _cones(operation, tool):
    """Cone values of a tool, the tip as far below as is wished, or less and less."""
    slope = tool.cutter.cone_slope
    wide, high = operation.width_mm * min(1.0, slope), operation.width_mm / max(1.0, slope)
    room, wish = tool.cutter.point_height_mm - high - WITHIN_MM, operation.tip_below_mm
    if room <= 0:
        return []
    belows = [min(share * room, MOST_BELOW_MM) for share in BELOW_SHARES] if wish is None else [min(wish, room)]
    return [Cone(tool=tool, wide_mm=wide, high_mm=high, below_mm=b) for b in dict.fromkeys(belows)]


def _along(work, cone, chain, z):
    """BreakWays along the runs of a chain in which the cone passes."""
    try:
        path = offset_chain(chain, cone.foot_mm)
    except CutterDoesNotFit:
        return []
    tip = z - cone.high_mm - cone.below_mm
    along = _lengths(path)
    free = _is_free(work, cone, path, along, tip)
    if path.is_closed and not free.all() and free.any():
        path = path.begun_at(float(along[int((~free).argmax())]))
        along = _lengths(path)
        free = _is_free(work, cone, path, along, tip)
    ways = []
    for first, behind in runs_of(free):
        last = behind - 1
        if along[last] - along[first] >= LEAST_MM:
            ends = float(along[first]), float(along[last])
            part = path if free.all() else PlanChain(elements=stretch_of(path, *ends), is_closed=False)
            ways.append(BreakWay(path=part, middle=part.elements[0].start, tip_mm=tip, edge_mm=z,
                                 edge=_edge_of(part, cone.foot_mm)))
    return ways


def _lengths(path):
    count = max(2, math.ceil(path.length_mm / LOOK_MM))
    return path.length_mm * np.arange(count + 1) / count


def _is_free(work, cone, path, along, tip):
    """(n,) bool: whether the cone touches nothing but what it is to break, at lengths along a path, and no stock stands there."""
    places, lefts = (np.array(rows) for rows in zip(*((e.at(s), e.left(s)) for e, s in map(path.place, along.tolist()))))
    free = np.ones(len(along), bool)
    for radius, high, aside in cone.discs():
        if radius > WITHIN_MM:
            tips = work.dropper(radius, 0.0, 0.0).tips_mm(places + aside * lefts)
            free &= tips <= tip + high + HIGH_MM
    return free & _is_cut_free(work, cone, places, tip)


def _is_cut_free(work, cone, places, tip):
    """(n,) bool: whether no stock stands within the cone but what it is to break, at places (n, 2)."""
    return stock_under(work, cone.tool.cutter, places).max(axis=1) <= tip + cone.high_mm + STANDS_MM


def _edge_of(path, foot_mm):
    """(n, 2) places of the edge beside a path."""
    return np.array([e.at(s) - foot_mm * e.left(s) for e, s in map(path.place, _lengths(path).tolist())])


def _straight_down(work, cone, chain, z):
    """[BreakWay] down in the middle of a round hole, or []."""
    first, cutter = chain.elements[0], cone.tool.cutter
    is_round = chain.is_closed and all(e.center is not None and e.is_left and
                                       fixed.length(e.center - first.center) < HIGH_MM for e in chain.elements)
    if not is_round:
        return []
    below = (first.radius_mm - cutter.point_flat_mm) / cutter.cone_slope
    deep = replace(cone, below_mm=below)
    if below <= 0 or below + cone.high_mm > cutter.point_height_mm:
        return []
    tip, middle = z - cone.high_mm - below, first.center[None]
    for radius, high, aside in deep.discs():
        tips = work.dropper(min(radius, radius - aside), 0.0, 0.0).tips_mm(middle)
        if (tips > tip + high + HIGH_MM).any():
            return []
    if not _is_cut_free(work, cone, middle, tip).all():
        return []
    return [BreakWay(path=None, middle=first.center, tip_mm=tip, edge_mm=z, edge=chain.places(LOOK_MM))]


def _uncovered(edge, z, broken):
    """[LeftEdge] of runs of an edge's places (n, 2) that are far from those that are broken."""
    far = np.ones(len(edge), bool) if broken is None else cKDTree(broken).query(edge)[0] > BESIDE_MM
    return [LeftEdge(place_mm=np.array([*edge[(a + b - 1) // 2], z]), length_mm=LOOK_MM * (b - a), why=BLOCKED)
            for a, b in runs_of(far)]


def _operation(work, cone, ways, places, number, left):
    """The PlannedOperation of one cutter's ways."""
    tool, operation = cone.tool, work.operation
    rpm, feed = work.speeds(tool, is_rough=False)
    name = operation.title if number == 1 else f"{operation.title} T{tool.number}"
    lifted = lambda rows: tuple(map(tuple, work.setup.turn.out(rows).round(6).tolist()))
    edge_break = EdgeBreak(setup=work.setup.name, operation=name, width_mm=operation.width_mm, high_mm=round(cone.high_mm, 6),
                           within_mm=work.finish.profile_tolerance_mm, edges=tuple(map(lifted, places)),
                           lines=tuple(lifted(np.column_stack([w.edge, np.full(len(w.edge), w.edge_mm)])) for w in ways))
    facts = {"width_mm": operation.width_mm, "runs": len(ways), "straight_down": sum(w.path is None for w in ways),
             "edges_left": [{"place_mm": work.in_part(e.place_mm), "length_mm": round(e.length_mm, 2), "why": e.why} for e in left],
             "candidates": []}
    made = work.measured(name, tool, rpm, Moves.joined([_moves(work, cone, w, feed) for w in ways]), facts)
    return replace(made, edge_break=edge_break)


def _moves(work, cone, way, feed):
    """From the clearance to the clearance."""
    elements, begin = (), way.middle
    if way.path is not None:
        elements = _with_leads(work, cone, way)
        begin = elements[0].start
    writer = MoveWriter((*begin, work.clearance_z_mm))
    writer.rapid((*begin, min(way.edge_mm + work.practice.approach_mm, work.clearance_z_mm)))
    writer.feed((*begin, way.tip_mm), work.practice.plunge_share * feed)
    follow(writer, elements, way.tip_mm, feed)
    writer.rapid((*writer.here_mm[:2], work.clearance_z_mm))
    return writer.moves()


def _with_leads(work, cone, way):
    """Elements from beside the edge and back, by arcs where the cone is clear there; else straight down onto the path."""
    cutter, path = cone.tool.cutter, way.path
    wide = (cone.below_mm + cone.high_mm) * cutter.cone_slope + MARGIN_MM
    radius = max(work.lead_radius_mm(cutter.radius_mm), wide)
    for along in path.starts_mm()[:STARTS] if path.is_closed else (0.0,):
        elements = path.begun_at(along).elements if path.is_closed else path.elements
        for high in (radius, wide, 0.5 * wide, 2 * cone.wide_mm):
            leads = arc_leads((elements[0], 0.0), (elements[-1], elements[-1].length_mm), radius, high)
            if _is_clear_beside(work, cone, leads, way.tip_mm):
                return (*leads.way_in, *elements, *leads.way_out)
    return path.elements


def _is_clear_beside(work, cone, leads, tip):
    """Whether the cone, narrower by the break where that is, meets no part on leads, and no stock where they begin and end."""
    places = np.vstack([PlanChain(elements=(e,), is_closed=False).places(LOOK_MM) for e in leads.elements])
    for radius, high, aside in cone.discs():
        if radius - aside > WITHIN_MM and (work.dropper(radius - aside, 0.0, 0.0).tips_mm(places) > tip + high + HIGH_MM).any():
            return False
    return bool(_is_cut_free(work, cone, np.array([leads.begin, leads.end]), tip).all())
