r"""Holes bored by a flat cutter: round and round, down by helices, then once round at the bottom.

      ring by ring outward, each a helix      the last one leaves finish_allowance_mm
       | (  (  .  )  ) |
       |_______________|   a ledge or a flat bottom; a through hole is bored break_through_mm deeper
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.planning.contouring import (
    LOOK_SHARE,
    SLOT_SHARE,
    STANDS_MM,
    closed_leads,
    finish_heights_mm,
    helical,
    left_mm,
    one_pass,
    refuse_blocked,
    stock_over,
)
from cuspline.planning.drilling import SAME_MM, Bore, bores_of, in_words, level_faces, upright_holes, walls_of
from cuspline.planning.freeform_finishing import LEVEL
from cuspline.planning.tool_depth import missing_stick_out_mm
from cuspline.program.program import Moves
from cuspline.toolpaths.prismatic.contour_moves import ring
from cuspline.toolpaths.prismatic.plan_elements import PlanChain
from cuspline.values.errors import CutterDoesNotFit, PlanError

CORE_SHARE = 0.9            # of the cutter's radius: the innermost ring leaves no core
ROOM_SHARE = 0.75           # of the hole's radius: larger cutters have no room for their chips
MOST_RINGS = 4              # more is a pocket
REACHED_MM = 1e-4


@dataclass(frozen=True, eq=False, kw_only=True)
class Bored:
    """A Bore with its cutter."""

    bore: Bore
    tool: object            # shop.cutters.Tool
    bottom_mm: float        # lowest tip
    top_mm: float           # of the stock

    def path(self, radius_mm):
        """Closed PlanChain of the cutter's middle."""
        return PlanChain(elements=ring(self.bore.xy_mm, radius_mm), is_closed=True)

    @property
    def path_radius_mm(self):
        """Of the middle's way round the finished wall."""
        return self.bore.radius_mm - self.tool.cutter.radius_mm


def borable_faces(work, operation, wanted):
    """Which of some faces are walls, ledges and flat bottoms that flat cutters of the library bore.

    Args:
        work: PlanningContext.   operation: the strategies.bore.Bore that would do it.   wanted: indices of faces.
    Returns:
        (their indices, [(faces of a wall, why no cutter bores it)]).
    """
    found = [(hole, wall) for hole in upright_holes(work) for wall in walls_of(hole, wanted)]
    work, out, refused = work.on(operation, wanted, work.planned) if found else work, [], []
    for hole, wall in found:
        bore = Bore(hole=hole, wall=wall, place_mm=work.in_part(hole.mouth_mm))
        try:
            _bored(work, bore)
        except (CutterDoesNotFit, PlanError) as error:
            refused.append((wall.faces, str(error)))
            continue
        out += [*wall.faces, *(i for i in level_faces(work, bore) if i in set(wanted))]
    return sorted(set(out)), refused


def bored_holes(work):
    """The operations of a bore operation: ([PlannedOperation], (n,) bool of the samples that it reaches).

    Args:
        work: PlanningContext of an operation with the fields of strategies.bore.Bore.
    Raises:
        PlanError, CutterDoesNotFit: a face that is no wall of a hole nor its flat bottom, a hole that leans, one that no flat
            cutter fits into or is long enough for.
    """
    level = [i for i in work.wanted if work.faces[i].kind == "plane" and work.faces[i].middle.normal[0, 2] > LEVEL]
    bores = bores_of(work, besides=level)
    by_tool, floors = {}, set()
    for one in (_bored(work, bore) for bore in bores):
        by_tool.setdefault(one.tool.number, []).append(one)
        floors.update(level_faces(work, one.bore))
    if stray := [i for i in level if i not in floors]:
        place = in_words(work.in_part(work.faces[stray[0]].middle.point_mm[0]))
        raise PlanError(f"{work.operation.title}: the plane at {place} is no ledge or flat bottom of the holes: give "
                        "it to another operation")
    made = []
    for mine in by_tool.values():
        name = work.operation.title if len(by_tool) == 1 else f"{work.operation.title} T{mine[0].tool.number}"
        rough = _roughed(work.on(work.operation, work.wanted, [*work.planned, *made]), mine, name)
        made += [rough] if rough is not None else []
        made.append(_finished(work.on(work.operation, work.wanted, [*work.planned, *made]), mine, name))
    reached = np.isin(work.samples.face, [*(i for b in bores for i in b.wall.faces), *floors])
    return made, reached


def _bored(work, bore):
    """Bored, or CutterDoesNotFit: no cutter has room, flutes or stick-out."""
    wall, hole = bore.wall, bore.hole
    ends = hole.is_through and wall is hole.walls[0]
    bottom = bore.low_z_mm - (work.operation.break_through_mm if ends else 0.0)
    why = []
    for tool in sorted(work.tools("flat"), key=lambda t: -t.cutter.radius_mm):
        cutter = tool.cutter
        last = bore.radius_mm - cutter.radius_mm - left_mm(work, cutter)
        if cutter.radius_mm > ROOM_SHARE * bore.radius_mm or last <= 0:
            why.append(f"T{tool.number} is too large")
            continue
        if len(_rings(work, tool, last)) > MOST_RINGS:
            why.append(f"T{tool.number} would go round more than {MOST_RINGS} times: it is a pocket")
            continue
        tips = np.array([[*bore.xy_mm, bottom]])
        missing = missing_stick_out_mm(tool, tips, work.mesh, 0.0)
        if missing > SAME_MM:
            why.append(f"T{tool.number} is {missing:.3f} mm too short")
            continue
        made = Bored(bore=bore, tool=tool, bottom_mm=bottom, top_mm=bore.high_z_mm)
        refuse_blocked(work, tool, made.path(made.path_radius_mm), bottom)
        top = float(stock_over(work, np.array([bore.xy_mm]), bore.radius_mm).max())
        return Bored(bore=bore, tool=tool, bottom_mm=bottom, top_mm=max(top, bottom))
    raise CutterDoesNotFit(f"{work.operation.title}: no flat cutter bores the hole of diameter {2 * bore.radius_mm:.6g} mm at "
                           f"{in_words(bore.place_mm)} ({'; '.join(why)}): add one to the file of --cutters, or a drill")


def _rings(work, tool, last_mm):
    """Radii of the rings of the cutter's middle, outward, the last one given."""
    first = min(last_mm, CORE_SHARE * tool.cutter.radius_mm)
    step = work.operation.stepover_mm or work.practice.radial_share * tool.cutter.diameter_mm
    return np.linspace(last_mm, first, math.ceil((last_mm - first) / step - 1e-9) + 1)[::-1].tolist()


def _roughed(work, bores, name):
    """The helices of the holes of one cutter; None where nothing stands in them."""
    tool = bores[0].tool
    cutter = tool.cutter
    rpm, feed = work.speeds(tool, is_rough=True)
    stepdown = min(work.stepdown_mm(tool), SLOT_SHARE * cutter.deepest_slot_mm)
    made, count = [], 0
    for one in bores:
        rings = _rings(work, tool, one.path_radius_mm - left_mm(work, cutter))
        standing = [stock_over(work, one.path(r).places(LOOK_SHARE * cutter.radius_mm), cutter.radius_mm).max() for r in rings]
        for radius, top in zip(rings, standing):
            if top > one.bottom_mm + STANDS_MM:
                made.append(helical(work, tool, one.path(radius), (float(top), one.bottom_mm), (stepdown, feed)))
                count += 1
    if not made:
        return None
    facts = {"allowance_mm": left_mm(work, cutter), "stepdown_mm": round(stepdown, 6), "holes": len(bores), "helices": count,
             "candidates": []}
    return work.measured(f"{name} rough", tool, rpm, Moves.joined(made), facts)


def _finished(work, bores, name):
    """Once round every hole at its bottom, or as deep as the cutter takes what the helices left at a time, from the stock's top."""
    tool = bores[0].tool
    rpm, feed = work.speeds(tool, is_rough=False)
    made = []
    for one in bores:
        path = one.path(one.path_radius_mm)
        elements, leads = closed_leads(work, tool, path, one.bottom_mm)
        way = (elements * (1 + work.operation.spring_passes), leads)
        heights = max(one.bore.high_z_mm, one.top_mm), one.bottom_mm
        for z in finish_heights_mm(tool.cutter, path, left_mm(work, tool.cutter), heights):
            made.append(one_pass(work, way, tool.cutter.radius_mm, z, feed))
    facts = {"holes": len(bores), "diameters_mm": sorted({round(2 * b.bore.radius_mm, 6) for b in bores}),
             "bottoms_mm": sorted({round(b.bottom_mm, 6) for b in bores}), "finish_allowance_mm": left_mm(work, tool.cutter),
             "spring_passes": work.operation.spring_passes, "candidates": []}
    return work.measured(name, tool, rpm, Moves.joined(made), facts)
