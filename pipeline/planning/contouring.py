r"""Contours: upright walls cut by the side of a flat cutter, along their exact plan.

    stock  ____          rough: round the chain by a helix (an open one level by level), finish_allowance_mm off it
          |    |  |cut|  finish: at the foot, or as deep as flutes and chips go, in and out by arcs,
    part  |____|  |ter|          spring_passes times more
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from cuspline.planning.context import path_tolerance_mm
from cuspline.planning.freeform_finishing import TERRACE_SHARE
from cuspline.planning.tabs import is_clear_of, overs_beside, overs_from, tabs_on
from cuspline.program.program import Moves, MoveWriter
from cuspline.toolpaths.prismatic.compensated_path import compensated_contour, is_move, with_straight_ways
from cuspline.toolpaths.prismatic.contour_moves import Leads, arc_leads, follow, helix, lengthened
from cuspline.toolpaths.prismatic.cut_width import widest_cut_mm
from cuspline.toolpaths.prismatic.plan_elements import PlanChain, PlanElement, chains_of, offset_chain
from cuspline.toolpaths.prismatic.tabs import follow_over
from cuspline.toolpaths.prismatic.upright_walls import upright_walls
from cuspline.values import fixed_math as fixed
from cuspline.values.circles import rings_of
from cuspline.values.errors import CutterDoesNotFit, PlanError

CURVE_SHARE = 0.4           # of the path tolerance, that arcs along general curves take
LOOK_SHARE = 0.25           # of the radius, from place to place along a path
WITHIN_MM = 0.01            # a cutter smaller by this on its radius must pass
HIGH_MM = 1e-3              # what the exact part may stand over a level that a path runs at
RINGS = np.array([0.0, 0.4, 0.75, 0.95])
SPOKES = 16
RIM_SPOKES, RIM_RINGS, RIM_MM = 96, 5, 0.1      # places at a cutter's rim, and so far beside it, that are looked at before a rapid
STANDS_MM = 0.01            # stock no higher is none
SLOT_SHARE = 0.8            # of the deepest slot that a cutter takes
FINISH_SHARE = 0.6          # of it, that finishing takes: the arc in meets half as much again as the way along the wall
HIGHS = (1.0, 0.5, 0.25)    # of the lead radius: how high above the path the cutter comes down
QUARTERS = (1.0, 0.5, 0.2, 0.05)    # of the lead radius: quarter circles on which the control begins beside a contour
FARTHER = (0.0, 1.0, 2.0, 3.0)      # diameters beyond the ends of an open chain where it may come down
FINE_MM = 3.0               # of a cutter this wide the shop's usual allowance is a tenth; narrower ones leave less in proportion
SHARES = (1.0, 0.5, 0.2, 0.05)      # of what the finishing pass takes off, in corners too tight for all of it
WORN_MM = 0.1               # by which the radius in the D register may be smaller than the cutter's own
BETWEEN = 60                # places along a chain with tabs that are looked at for its leads
STARTS = 12                 # places along a closed chain that are looked at for its leads


@dataclass(frozen=True, eq=False, kw_only=True)
class Section:
    """Chains of walls between two heights."""

    chains: tuple
    high_mm: float
    low_mm: float


def contoured(work):
    """The operations of a contour: ([PlannedOperation], (n,) bool of the samples that it reaches).

    Args:
        work: PlanningContext of an operation with the fields of strategies.contour.Contour.
    Raises:
        PlanError, CutterDoesNotFit: a face that does not stand upright, a cutter too large, no room for its way in.
    """
    walls = _walls(work)
    tool, candidates, reached = work.chosen_tool("flat")
    sections, before = _sections(walls), []
    tabs = _tabbed(work, tool, sections[-1]) if work.operation.has_tabs else {}
    rough = _roughed(work, tool, sections, tabs)
    if rough is not None:
        before.append(rough)
        work = work.on(work.operation, work.wanted, [*work.planned, rough])
    return [*before, _finished(work, tool, candidates, sections, tabs)], reached


def _tabbed(work, tool, section):
    """{chain of the lowest section: (path of the finishing cutter's middle, its Overs, its Tabs)}."""
    paths = {id(c): _offset(work, c, tool.cutter.radius_mm + work.operation.allowance_mm) for c in section.chains}
    return {key: (path, *tabs_on(work, tool, path, section.low_mm)) for key, path in paths.items()}


def _walls(work):
    title = work.operation.title
    try:
        return upright_walls(work.faces, work.wanted, CURVE_SHARE * path_tolerance_mm(work.finish))
    except PlanError as error:
        raise PlanError(f"{title}: {error}") from None


def _sections(walls):
    """Section values from the top: a wall counts in all that lie above its foot."""
    lows = sorted({round(w.low_mm, 6) for w in walls}, reverse=True)
    high, out = max(w.high_mm for w in walls), []
    for low in lows:
        chains = chains_of([w.element for w in walls if w.low_mm < low + HIGH_MM])
        out.append(Section(chains=tuple(chains), high_mm=high, low_mm=low))
        high = low
    return out


def _roughed(work, tool, sections, tabs):
    """The operation that takes what stands beside the walls; None where nothing does."""
    operation, cutter = work.operation, tool.cutter
    rpm, feed = work.speeds(tool, is_rough=True)
    stepdown = min(work.stepdown_mm(tool), SLOT_SHARE * cutter.deepest_slot_mm)
    made = []
    for section in sections:
        for chain in section.chains:
            path, top = _rough_path(work, chain, cutter)
            if top > section.low_mm + STANDS_MM and _is_thick(work, chain, cutter, section.low_mm):
                refuse_blocked(work, tool, path, section.low_mm)
                lay, overs = helical if path.is_closed else _level_by_level, ()
                if id(chain) in tabs and section is sections[-1]:
                    path, overs = overs_beside(tabs[id(chain)][1], tabs[id(chain)][0], path)
                made.append(lay(work, tool, path, (top, section.low_mm), (stepdown, feed), overs))
    if not made:
        return None
    facts = {"allowance_mm": round(operation.allowance_mm + left_mm(work, cutter), 6), "stepdown_mm": round(stepdown, 6),
             "chains": len(made), "candidates": []}
    return work.measured(f"{operation.title} rough", tool, rpm, Moves.joined(made), facts)


def _rough_path(work, chain, cutter):
    """(PlanChain beside which the finishing pass' share stays, top of the stock in its way).

    Where a corner is too tight for the whole share, less of it stays, and what stands all round the cutter counts: it comes down
    from above the walls.

    Raises:
        CutterDoesNotFit: the corner is too tight for the cutter.
    """
    for share in SHARES:
        try:
            path = _offset(work, chain, cutter.radius_mm + work.operation.allowance_mm + share * left_mm(work, cutter))
            break
        except CutterDoesNotFit:
            if share == SHARES[-1]:
                raise
    reach = cutter.radius_mm if share == SHARES[0] else cutter.radius_mm / RINGS[-1]
    return path, float(stock_over(work, path.places(LOOK_SHARE * cutter.radius_mm), reach).max())


def _is_thick(work, chain, cutter, low_mm):
    """Whether more stands beside a wall than its finishing pass takes: a slot hardly wider than its cutter has left less."""
    inward = cutter.radius_mm - left_mm(work, cutter)
    if inward <= 0.0:
        return True
    path = _offset(work, chain, cutter.radius_mm + work.operation.allowance_mm)
    return float(stock_over(work, path.places(LOOK_SHARE * cutter.radius_mm), inward).max()) > low_mm + STANDS_MM


def left_mm(work, cutter):
    """What the finishing pass takes off: of a fine cutter's width no greater a share than of one of FINE_MM."""
    asked = work.operation.finish_allowance_mm
    return work.practice.rough_allowance_mm * min(1.0, cutter.diameter_mm / FINE_MM) if asked is None else asked


def finish_heights_mm(cutter, path, taken_mm, heights_mm):
    """Heights of the finishing passes along one wall, from the top: within the flutes, the chips no heavier than a slot's.

    Args:
        cutter: Cutter.   path: PlanChain of its middle.   taken_mm: what each takes off the wall.
        heights_mm: (top, foot) of what is cut.
    """
    high, low = heights_mm
    width = widest_cut_mm(path, cutter.radius_mm, taken_mm, cutter.diameter_mm / 2)
    deepest = min(TERRACE_SHARE * cutter.flute_length_mm,
                  FINISH_SHARE * cutter.deepest_slot_mm * cutter.diameter_mm / width if width > 0 else math.inf)
    if cutter.diameter_mm < FINE_MM:            # in a sharp corner what is left for it stands as wide as it is
        deepest = min(deepest, SLOT_SHARE * cutter.deepest_slot_mm)
    count = max(1, math.ceil((high - low) / deepest - 1e-9))
    return np.linspace(high, low, count + 1)[1:].tolist()


def _offset(work, chain, away_mm):
    try:
        return offset_chain(chain, away_mm)
    except CutterDoesNotFit as error:
        raise CutterDoesNotFit(f"{work.operation.title}: {error}") from None


def helical(work, tool, path, heights_mm, how, overs=()):
    """Moves round a closed path, down evenly: no cutter plunges.

    Args:
        work: PlanningContext of an operation with `ramp_deg`.   path: PlanChain of the cutter's middle.
        heights_mm: (top of the stock there, bottom).   how: (deepest turn, feed).   overs: tabs.Over, what it rises over.
    """
    (top, low), (_, feed) = heights_mm, how
    writer, turn = _begun_on_top(work, tool, path, top, how)
    if overs:
        turns = max(1, math.ceil((top - low) / turn - 1e-9))
        for high, z in pairwise([*np.linspace(top, low, turns + 1).tolist(), low]):
            follow_over(writer, path, overs, (high, z), (feed, work.practice.plunge_share * feed))
    else:
        helix(writer, path, (top, low), turn, (feed, feed))
    writer.rapid((*writer.here_mm[:2], work.clearance_z_mm))
    return writer.moves()


def _begun_on_top(work, tool, path, top, how):
    """(MoveWriter that has come down onto the stock where a path begins, how far down it may go along the path)."""
    (stepdown, feed), begin = how, path.elements[0].start
    ramp = math.radians(min(work.ramp_deg(tool), math.degrees(tool.cutter.steepest_rad)))
    writer = MoveWriter((*begin, work.clearance_z_mm))
    over = max(top, over_mm(work, begin, tool.cutter.radius_mm)) + work.practice.approach_mm
    writer.rapid((*begin, min(over, work.clearance_z_mm)))
    writer.feed((*begin, top), work.practice.plunge_share * feed)
    return writer, min(stepdown, path.length_mm * float(fixed.tan(ramp)))


def _level_by_level(work, tool, path, heights_mm, how, overs):
    """Moves along an open path, each level from beside the stock, or down by a ramp where there is no such place; no tabs."""
    (top, low), (stepdown, feed) = heights_mm, how
    try:
        elements, leads = _open_leads(work, tool, path, low)
    except PlanError:
        return _to_and_fro(work, tool, path, heights_mm, how)
    count = math.ceil((top - low) / stepdown - 1e-9)
    heights = np.linspace(top, low, count + 1)[1:].tolist()
    parts = [one_pass(work, (elements, leads), tool.cutter.radius_mm, z, feed) for z in heights]
    return Moves.joined(parts)


def _to_and_fro(work, tool, path, heights_mm, how):
    """Moves to and fro along an open path, evenly down by a ramp, and once along it at the bottom; it begins on the stock's top."""
    (top, low), (_, feed) = heights_mm, how
    writer, turn = _begun_on_top(work, tool, path, top, how)
    ways, count = (path.elements, path.reversed().elements), math.ceil((top - low) / turn - 1e-9)
    heights = [*np.linspace(top, low, count + 1).tolist(), low]
    for k, (high, z) in enumerate(pairwise(heights)):
        follow(writer, ways[k % 2], z, feed, high)
    writer.rapid((*writer.here_mm[:2], work.clearance_z_mm))
    return writer.moves()


def _finished(work, tool, candidates, sections, tabs):
    """The finishing operation."""
    operation, cutter = work.operation, tool.cutter
    _refuse_compensation(work)
    rpm, feed = work.speeds(tool, is_rough=False)
    away = cutter.radius_mm + operation.allowance_mm
    made, runs, levels, length = [], [], set(), 0.0
    for section in sections:
        for chain in section.chains:
            path = _offset(work, chain, away)
            length += path.length_mm
            refuse_blocked(work, tool, path, section.low_mm)
            heights = finish_heights_mm(cutter, path, left_mm(work, cutter) / (operation.finish_passes or 1),
                                        (_top_mm(work, cutter, path, section), section.low_mm))
            levels |= {round(z, 6) for z in heights}
            if id(chain) in tabs and section is sections[-1]:
                made += _passes_over(work, tool, tabs[id(chain)], (section.low_mm, heights), feed)
                continue
            for path, rounds in [*((_offset(work, chain, away + more), 1) for more in _shares_mm(work, cutter)),
                                 (path, 1 + operation.spring_passes)]:
                elements, leads = (closed_leads if path.is_closed else _open_leads)(work, tool, path, section.low_mm)
                again = elements * rounds if path.is_closed else elements
                for z in (z for z in heights for _ in range(1 if path.is_closed else rounds)):
                    made.append(one_pass(work, (again, leads), cutter.radius_mm, z, feed))
                    runs.append(((*leads.way_in, *again, *leads.way_out), z))
    facts = {"allowance_mm": operation.allowance_mm, "finish_allowance_mm": left_mm(work, cutter),
             "heights_mm": sorted(levels, reverse=True), "chains": sum(len(s.chains) for s in sections),
             "contour_mm": round(length, 3),
             "spring_passes": operation.spring_passes, "strategy": operation.kind, "candidates": [c.as_dict() for c in candidates]}
    if tabs:
        left = tuple(tab for _, _, mine in tabs.values() for tab in mine)
        facts["tabs"] = [{"place_mm": t.place_mm.round(4).tolist(), "width_mm": t.width_mm, "height_mm": t.height_mm} for t in left]
        return replace(work.measured(operation.title, tool, rpm, Moves.joined(made), facts), tabs=left)
    if operation.compensation is None:
        return work.measured(operation.title, tool, rpm, Moves.joined(made), facts)
    worn = WORN_MM if operation.worn_mm is None else operation.worn_mm
    facts |= {"compensation": operation.compensation, "worn_mm": worn}
    return replace(work.measured(operation.title, tool, rpm, Moves.joined(made), facts),
                   compensated=_beside(made, runs, cutter.radius_mm, worn))


def _top_mm(work, cutter, path, section):
    """Where the finishing passes begin: at the wall's top; a fine cutter's where the stock beside it ends."""
    if cutter.diameter_mm >= FINE_MM:
        return section.high_mm
    return max(section.high_mm, float(stock_over(work, path.places(LOOK_SHARE * cutter.radius_mm), cutter.radius_mm).max()))


def _shares_mm(work, cutter):
    """How far off the wall the finishing passes before the last run."""
    count = work.operation.finish_passes or 1
    return [left_mm(work, cutter) * (count - k) / count for k in range(1, count)]


def _passes_over(work, tool, tabbed, heights_mm, feed):
    """Moves round a closed path that rises over tabs, a pass a height."""
    (path, overs, _), (low, heights) = tabbed, heights_mm
    along, begun, leads = _leads_between(work, tool, path, overs, low)
    overs, made = overs_from(overs, path, along), []
    for z in heights:
        writer = _entered(work, leads, tool.cutter.radius_mm, z, feed)
        follow(writer, leads.way_in, z, feed)
        for _ in range(1 + work.operation.spring_passes):
            follow_over(writer, begun, overs, (z, z), (feed, work.practice.plunge_share * feed))
        follow(writer, leads.way_out, z, feed)
        writer.rapid((*writer.here_mm[:2], work.clearance_z_mm))
        made.append(writer.moves())
    return made


def _leads_between(work, tool, path, overs, low_mm):
    """(length along the path, the path begun there, Leads): where no tab is near.

    Raises:
        PlanError: there is no such place.
    """
    radius = work.lead_radius_mm(tool.cutter.radius_mm)
    places = [s for s in np.linspace(0.0, path.length_mm, BETWEEN, endpoint=False).tolist()
              if is_clear_of(overs, s, tool.cutter.diameter_mm) and is_clear_of(overs, s + path.length_mm, tool.cutter.diameter_mm)]
    for high in (*(h * radius for h in HIGHS), min(left_mm(work, tool.cutter), radius)):
        for along in sorted(places, key=lambda s: path.place(s)[0].center is not None):
            begun = path.begun_at(along)
            leads = _leads(work, tool, begun.elements, radius, high)
            stands = stock_over(work, leads.begin[None], (tool.cutter.radius_mm - WITHIN_MM) / RINGS[-1]) > low_mm + STANDS_MM
            if not stands.any() and _is_free(work, tool, leads, low_mm):
                return along, begun, leads
    raise _no_way_in(work, tool, path, low_mm)


def _beside(made, runs, radius_mm, worn_mm):
    """CompensatedContours of passes: each ends with one rapid up, behind its run of (elements, height)."""
    out, before = [], 0
    for moves, (elements, z) in zip(made, runs):
        first = before + len(moves) - 1 - sum(is_move(e) for e in elements)
        out.append(compensated_contour(elements, radius_mm, z, first, worn_mm))
        before += len(moves) + 1
    return tuple(out)


def _refuse_compensation(work):
    """
    Raises:
        PlanError: what goes with no contour that the control shifts.
    """
    operation, is_on = work.operation, work.operation.compensation is not None
    for is_so, what in ((operation.worn_mm is not None and not is_on, "worn_mm goes with compensation: leave it out"),
                        (is_on and work.setup.indexed and not work.machine.is_along_z_turned,
                         f"{work.machine.name} does not compensate in an indexed position, where its tool is along no Z of the "
                         "control: leave compensation out"),
                        (is_on and work.plating_mm > 0, "a part that is plated is cut by a radius that is none of the tool table: "
                         "leave compensation out"),
                        (is_on and operation.lead_radius_mm == 0, "compensation begins on an arc: give lead_radius_mm")):
        if is_so:
            raise PlanError(f"{operation.title}: {what}")


def one_pass(work, way, radius_mm, height_mm, feed):
    """Moves at one height, from the clearance to the clearance.

    Args:
        way: (elements, Leads).   radius_mm: of the cutter.
    """
    elements, leads = way
    writer = _entered(work, leads, radius_mm, height_mm, feed)
    follow(writer, (*leads.way_in, *elements, *leads.way_out), height_mm, feed)
    writer.rapid((*writer.here_mm[:2], work.clearance_z_mm))
    return writer.moves()


def _entered(work, leads, radius_mm, height_mm, feed):
    """A MoveWriter that has come down where Leads begin."""
    writer = MoveWriter((*leads.begin, work.clearance_z_mm))
    over = max(over_mm(work, leads.begin, radius_mm), height_mm) + work.practice.approach_mm
    writer.rapid((*leads.begin, min(over, work.clearance_z_mm)))
    writer.feed((*leads.begin, height_mm), feed)
    return writer


def closed_leads(work, tool, path, low_mm):
    """(the elements from the place where the path is met, Leads): lines first, then the longest."""
    radius = work.lead_radius_mm(tool.cutter.radius_mm)
    arcs = [(radius, high) for high in (*(h * radius for h in HIGHS), min(left_mm(work, tool.cutter), radius))]
    for round_mm, high in [(h * radius, h * radius) for h in QUARTERS] if _is_shifted(work) else arcs:
        for along in path.starts_mm()[:STARTS]:
            begun = path.begun_at(along)
            leads = _leads(work, tool, begun.elements, round_mm, high)
            if _is_free(work, tool, leads, low_mm):
                return begun.elements, leads
    raise _no_way_in(work, tool, path, low_mm)


def _open_leads(work, tool, path, low_mm):
    """(the elements with straight ways before and behind, Leads), as short as they may be."""
    radius = work.lead_radius_mm(tool.cutter.radius_mm)
    for farther in FARTHER:
        elements = lengthened(path, farther * tool.cutter.diameter_mm) if farther else path.elements
        leads = _leads(work, tool, elements, radius, radius)
        beyond = PlanChain(elements=elements, is_closed=False)
        if _is_free(work, tool, leads, low_mm) and _blocked(work, tool, beyond, low_mm) is None:
            return elements, leads
    return path.elements, _leads_in_the_cut(work, tool, path, low_mm)


def _leads_in_the_cut(work, tool, path, low_mm):
    """Leads straight across from where the pass before ran, and back: for a path both of whose ends are within stock.

    Raises:
        PlanError: stock stands there, or the control shifts the contour, which wants its arcs.
    """
    first, last = path.elements[0], path.elements[-1]
    across = (first.left(0.0), last.left(last.length_mm))
    begin, end = first.start + left_mm(work, tool.cutter) * across[0], last.end + left_mm(work, tool.cutter) * across[1]
    inside = (tool.cutter.radius_mm - WITHIN_MM) / RINGS[-1]
    if _is_shifted(work) or (stock_over(work, begin[None], inside) > low_mm + STANDS_MM).any():
        raise _no_way_in(work, tool, path, low_mm)
    return Leads(way_in=(PlanElement(start=begin, end=first.start),), way_out=(PlanElement(start=last.end, end=end),))


def _leads(work, tool, elements, radius_mm, high_mm):
    """Leads onto elements and off them; where the control shifts the contour, with straight ways before and behind."""
    leads = arc_leads((elements[0], 0.0), (elements[-1], elements[-1].length_mm), radius_mm, high_mm)
    return with_straight_ways(leads, tool.cutter.radius_mm) if _is_shifted(work) else leads


def _is_shifted(work):
    """Whether the control is to run beside the contour by its D register."""
    return getattr(work.operation, "compensation", None) is not None


def _no_way_in(work, tool, path, low_mm):
    x, y, z = work.in_part((*path.elements[0].start, low_mm))
    return PlanError(f"{work.operation.title}: T{tool.number} {tool.cutter.name} finds no free place "
                     f"beside its path near ({x:.3f}, {y:.3f}, {z:.3f}) to come down for its arc in: clear the "
                     "stock there by an operation rough before, or lower lead_radius_mm")


def _is_free(work, tool, leads, low_mm):
    """Whether the arcs pass the part, and nothing of the stock stands where the cutter comes down."""
    if (stock_over(work, leads.begin[None], tool.cutter.radius_mm) > low_mm + STANDS_MM).any():
        return False
    return all(_blocked(work, tool, PlanChain(elements=(e,), is_closed=False), low_mm) is None for e in leads.elements)


def stock_over(work, xy_mm, radius_mm):
    """(n,) height of the stock under a cutter at places (n, 2)."""
    places = xy_mm[:, None] + rings_of(RINGS * radius_mm, SPOKES).reshape(1, -1, 2)
    return work.stock_mm(places.reshape(-1, 2)).reshape(len(xy_mm), -1).max(axis=1)


def over_mm(work, xy_mm, radius_mm):
    """Height of what stands under a whole cutter at a place (2,), its rim and slivers beside it included."""
    out = np.concatenate([RINGS * radius_mm, np.linspace(RINGS[-1] * radius_mm, radius_mm + RIM_MM, RIM_RINGS)])
    return float(work.stock_mm(xy_mm + rings_of(out, RIM_SPOKES).reshape(-1, 2)).max())


def _blocked(work, tool, path, low_mm):
    """The first place (2,) of a path where the exact part, or a fixture, stands in the cutter's way; None: it is clear."""
    cutter, places = tool.cutter, path.places(LOOK_SHARE * tool.cutter.radius_mm)
    thinner = cutter.radius_mm - WITHIN_MM
    held = work.dropper(thinner, 0.0, 0.0).tips_mm(places) > low_mm + HIGH_MM
    for fixture in work.fixtures:
        low, high = (np.asarray(corner)[:2] for corner in fixture.box_mm)
        reach = cutter.radius_mm + work.practice.keep_out_mm
        held |= (float(fixture.box_mm[1][2]) > low_mm) & ((places > low - reach) & (places < high + reach)).all(axis=1)
    return places[int(held.argmax())] if held.any() else None


def refuse_blocked(work, tool, path, low_mm):
    place = _blocked(work, tool, path, low_mm)
    if place is not None:
        x, y, z = work.in_part((*place, low_mm))
        raise CutterDoesNotFit(f"{work.operation.title}: beside these walls T{tool.number} {tool.cutter.name} would "
                               f"cut other faces, or a fixture, near ({x:.3f}, {y:.3f}, {z:.3f}): name the walls there "
                               "too, or choose a smaller one")
