r"""Chamfers by a pointed cutter of their own angle: its cone runs along their lower edge.

          \   |   /        tip_below_mm under the lower edge, as far aside as the cone is wide there;
       ____\  |  /         nothing of the part may stand within the cone
           |\_|_/
           |               a hole that is too small for that: straight down in its middle
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.planning.contouring import HIGH_MM, SPOKES, STANDS_MM, STARTS, WITHIN_MM
from cuspline.planning.drilling import in_words
from cuspline.program.program import Moves, MoveWriter
from cuspline.toolpaths.prismatic.chamfer_edges import chamfer_edges
from cuspline.toolpaths.prismatic.contour_moves import arc_leads, follow, lengthened
from cuspline.toolpaths.prismatic.plan_elements import PlanChain, chains_of, offset_chain
from cuspline.values.circles import rings_of
from cuspline.values.errors import CamError, CutterDoesNotFit, PlanError

SAME_RAD = math.radians(0.01)       # of the face's angle and the cutter's: 1 um on a chamfer of 6 mm
BELOW_SHARE = 0.25                  # of the cone's height, that the tip is below the edge where nothing is stated
DISCS = np.linspace(0.02, 1.0, 12)  # of the cone's height, at which it is held against the part
RINGS = np.linspace(0.0, 1.0, 7)
LOOK_MM = 0.8                       # from place to place along a path
MARGIN_MM = 0.5                     # the cone's distance from what is to be cut, where it comes down


@dataclass(frozen=True, eq=False, kw_only=True)
class ChamferWay:
    """One run of a cutter along a chain of edges, or straight down where the path is None."""

    path: PlanChain | None
    tip_mm: float
    high_mm: float              # of the chamfer
    tool: object                # shop.cutters.Tool
    middle: np.ndarray          # (2,) where it comes straight down
    faces: tuple[int, ...]


def chamfered(work):
    """The operations of a chamfer operation: ([PlannedOperation], (n,) bool of the samples that it reaches).

    Args:
        work: PlanningContext of an operation with the fields of strategies.chamfer.Chamfer.
    Raises:
        PlanError, CutterDoesNotFit: a face that is no chamfer, no cutter of its angle, a tip that would cut what is below.
    """
    ways = chamfer_ways(work)
    by_tool = {}
    for way in ways:
        by_tool.setdefault(way.tool.number, []).append(way)
    made = [_operation(work, mine, len(by_tool)) for mine in by_tool.values()]
    return made, np.isin(work.samples.face, [i for w in ways for i in w.faces])


def chamfer_faces(work, operation, widest_mm):
    """Indices of the operation's faces that are chamfers no higher than so much, which pointed cutters of the library make.

    Args:
        work: PlanningContext.   operation: the strategies.chamfer.Chamfer that would do it.
    """
    found = []
    for i in work.wanted:
        edges = chamfer_edges(work.faces[i], i)
        if edges and edges[0].high_mm - edges[0].low_mm <= widest_mm and _is_proud(work, i, edges[0]):
            found.append(i)
    while found:
        try:
            ways = chamfer_ways(work.on(operation, found, work.planned))
            return sorted(i for w in ways for i in w.faces)
        except _Unfit as error:
            found = [i for i in found if i not in error.faces]
        except CamError:
            return []
    return []


class _Unfit(CutterDoesNotFit):
    """What no cutter makes, with its faces."""

    def __init__(self, message, faces):
        super().__init__(message)
        self.faces = set(faces)


def _is_proud(work, index, edge):
    """Whether both level edges of a face stick out: what lies under the lower one is steeper, over the upper one flatter."""
    edges = work.edge_neighbours
    face = work.faces[index]
    near = edges.sides[(edges.sides == index).any(axis=1)]
    points = edges.tree.data[(edges.sides == index).any(axis=1)]
    other = np.where(near[:, 0] == index, near[:, 1], near[:, 0])
    up = np.array([float(work.faces[k].middle.normal[0, 2]) for k in other])
    mine = float(face.middle.normal[0, 2])
    at_low, at_high = np.abs(points[:, 2] - edge.low_mm) < HIGH_MM, np.abs(points[:, 2] - edge.high_mm) < HIGH_MM
    level = lambda rows: rows & (other != index)
    return bool((up[level(at_low)] < mine + HIGH_MM).all() and (up[level(at_high)] > mine - HIGH_MM).all())


def chamfer_ways(work):
    """ChamferWay of every chain of the operation's faces."""
    title, by_shape = work.operation.title, {}
    for i in work.wanted:
        edges = chamfer_edges(work.faces[i], i)
        if not edges:
            place = in_words(work.in_part(work.faces[i].middle.point_mm[0]))
            raise _Unfit(f"{title}: the {work.faces[i].kind} at {place} is no chamfer: a flat strip with a level lower "
                         "edge, or a cone about the setup's Z, seen from above", (i,))
        key = tuple(round(v, 5) for v in (edges[0].low_mm, edges[0].high_mm, edges[0].lean_rad))
        by_shape.setdefault(key, []).extend(edges)
    ways = []
    for edges in by_shape.values():
        for chain in chains_of([e.element for e in edges]):
            mine = [e for e in edges if any(e.element is element for element in chain.elements)]
            ways.append(_way(work, chain, mine))
    return ways


def _way(work, chain, edges):
    """ChamferWay of one chain, by the first cutter that fits."""
    low, high, lean = edges[0].low_mm, edges[0].high_mm, edges[0].lean_rad
    faces, why = tuple(sorted({e.face for e in edges})), []
    for tool in work.tools("chamfer_mill", "spot_drill"):
        cutter = tool.cutter
        if abs(math.radians(cutter.point_angle_deg) / 2 - lean) > SAME_RAD:
            why.append(f"T{tool.number} has {cutter.point_angle_deg:g} degrees")
        elif high - low > cutter.point_height_mm - 2 * WITHIN_MM:
            why.append(f"the cone of T{tool.number} is {cutter.point_height_mm:.3f} mm high")
        else:
            for make in (_along, _straight_down):
                way = make(work, tool, chain, (low, high), faces)
                if way is not None:
                    return way
            why.append(f"T{tool.number} would cut what is beside or below it")
    place = in_words(work.in_part((*chain.elements[0].start, low)))
    raise _Unfit(f"{work.operation.title}: no cutter makes the chamfer of {2 * math.degrees(lean):.4g} degrees, "
                 f"{high - low:.4g} mm high, at {place} ({'; '.join(why)}): add a chamfer mill to the file of --cutters, or lower "
                 "tip_below_mm", faces)


def _along(work, tool, chain, heights, faces):
    """The way along the edges, the tip as far below as is wished, or as the part lets it; None: there is none."""
    (low, high), cutter = heights, tool.cutter
    room, wish = cutter.point_height_mm - (high - low) - WITHIN_MM, work.operation.tip_below_mm
    for below in ((BELOW_SHARE * room, 0.1 * room, 0.02 * room) if wish is None else (min(wish, room),)):
        try:
            path = offset_chain(chain, cutter.cone_radius_mm(below))
        except CutterDoesNotFit:
            continue
        if is_clear(work, cutter, path.places(LOOK_MM), low - below):
            return ChamferWay(path=path, tip_mm=low - below, high_mm=high, tool=tool, middle=path.elements[0].start, faces=faces)
    return None


def _straight_down(work, tool, chain, heights, faces):
    """The way down in the middle of a round hole."""
    (low, high), cutter, first = heights, tool.cutter, chain.elements[0]
    if not (chain.is_closed and first.center is not None and first.is_left):
        return None
    tip = low - (first.radius_mm - cutter.point_flat_mm) / cutter.cone_slope
    if tip > low or high > tip + cutter.point_height_mm or not is_clear(work, cutter, first.center[None], tip):
        return None
    return ChamferWay(path=None, tip_mm=tip, high_mm=high, tool=tool, middle=first.center, faces=faces)


def is_clear(work, cutter, xy_mm, tip_mm):
    """Whether no part stands within a pointed cutter at places (n, 2): its cone as discs, dropped."""
    for share in DISCS.tolist():
        high = share * cutter.point_height_mm
        radius = cutter.cone_radius_mm(high) - WITHIN_MM
        if radius > WITHIN_MM and (work.dropper(radius, 0.0, 0.0).tips_mm(xy_mm) > tip_mm + high + HIGH_MM).any():
            return False
    return True


def _operation(work, ways, number):
    """The PlannedOperation of one cutter's ways."""
    tool = ways[0].tool
    rpm, feed = work.speeds(tool, is_rough=False)
    made = [_moves(work, way, feed) for way in ways]
    name = work.operation.title if number == 1 else f"{work.operation.title} T{tool.number}"
    facts = {"chamfers": len(ways), "tips_mm": sorted({round(w.tip_mm, 6) for w in ways}),
             "straight_down": sum(w.path is None for w in ways), "candidates": []}
    return work.measured(name, tool, rpm, Moves.joined(made), facts)


def _moves(work, way, feed):
    """From the clearance to the clearance."""
    elements = ()
    begin = way.middle
    if way.path is not None:
        middle, leads = _leads(work, way)
        elements, begin = (*leads.way_in, *middle, *leads.way_out), leads.begin
    writer = MoveWriter((*begin, work.clearance_z_mm))
    over = max(way.high_mm, float(stock_under(work, way.tool.cutter, begin[None]).max())) + work.practice.approach_mm
    writer.rapid((*begin, min(over, work.clearance_z_mm)))
    writer.feed((*begin, way.tip_mm), work.practice.plunge_share * feed)
    follow(writer, elements, way.tip_mm, feed)
    writer.rapid((*writer.here_mm[:2], work.clearance_z_mm))
    return writer.moves()


def _leads(work, way):
    """(elements, Leads) so far beside the edge that the cone comes down beside what it cuts."""
    cutter, path = way.tool.cutter, way.path
    wide = (way.high_mm - way.tip_mm) * cutter.cone_slope + MARGIN_MM
    radius = max(work.lead_radius_mm(cutter.radius_mm), wide)
    for along in path.starts_mm()[:STARTS if path.is_closed else 1]:
        elements = path.begun_at(along).elements if path.is_closed else lengthened(path, cutter.diameter_mm)
        for high in (radius, wide, 0.5 * wide):
            leads = arc_leads((elements[0], 0.0), (elements[-1], elements[-1].length_mm), radius, high)
            places = np.vstack([PlanChain(elements=(e,), is_closed=False).places(LOOK_MM) for e in leads.elements])
            is_free = (stock_under(work, cutter, leads.begin[None]) <= way.tip_mm + STANDS_MM).all()
            if is_free and is_clear(work, cutter, places, way.tip_mm):
                return elements, leads
    place = in_words(work.in_part((*path.elements[0].start, way.tip_mm)))
    raise PlanError(f"{work.operation.title}: T{way.tool.number} {cutter.name} finds no free place beside the chamfer at "
                    f"{place} to come down: cut what stands beside it first")


def stock_under(work, cutter, places):
    """(n, rings) heights that the tip keeps over the stock at places (n, 2), the cone held against rings of it."""
    radii = RINGS * cutter.radius_mm
    around = (places[:, None] + rings_of(radii, SPOKES).reshape(-1, 2)).reshape(-1, 2)
    stock = work.stock_mm(around).reshape(len(places), len(radii), -1).max(axis=2)
    return stock - np.maximum(radii - cutter.point_flat_mm, 0.0) / cutter.cone_slope
