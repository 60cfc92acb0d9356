r"""Pockets: levels cleared with bounded engagement within their borders, then floors and walls by a flat cutter.

     ___           ___      a tip may be where it fits beside the walls and its flat meets a floor below;
        |_   _   __         an open side lets it run beside the stock
          |_| |_|           floors may lie in floors; islands are what stands on them
"""

import math
from dataclasses import replace

import numpy as np

from cuspline.design.operations import Clearing
from cuspline.planning import roughing
from cuspline.planning.context import path_tolerance_mm
from cuspline.planning.contouring import CURVE_SHARE
from cuspline.planning.cutter_choice import choose_cutter, choose_rest_roughing, choose_roughing, leftover_rows, roughing_tools
from cuspline.planning.freeform_finishing import TERRACE_SHARE
from cuspline.planning.level_finishing import LEVEL, UPRIGHT, is_level
from cuspline.planning.strategies.contour import Contour
from cuspline.planning.strategies.floor import Floor
from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_tips_mm, is_held_above
from cuspline.toolpaths.prismatic.upright_walls import upright_walls
from cuspline.values.errors import CutterDoesNotFit, PlanError

BESIDE_MM = 2.0             # beside an open side a tip may stand so far from the floor, and its radius
SURE_MM = 1e-3              # tips that clear the floor by less clear it
SKIN_MM = 0.04              # on floors, of what their finish takes off: no plunge is so shallow
NARROWER_MM = 1e-3          # than the tightest corner of the walls a cutter must be
CORNERS_SHARE = 0.02        # of the area: what samples in corners that a cutter fits may miss, by the facets they are held against
NAME = 40                   # letters of an operation's name
CORNERS = " corners"        # of floors, that the clearing's cutter did not come to
SLIVER_MM = 0.05            # along walls, that a larger cutter leaves beyond the allowance: their contour takes it with it
DEEPEST_SHARE = 1.0         # of its diameter a cutter clears so deep at once
NARROWEST_SHARE = 0.04      # and at least so wide: below, edges rub


def pocketed(work):
    """The operations of a pocket: ([PlannedOperation], (n,) bool of the samples that it reaches).

    Args:
        work: PlanningContext of an operation with the fields of strategies.pocket.Pocket.
    Raises:
        PlanError, CutterDoesNotFit: a face that is neither level nor upright, no floor, no cutter that fits.
    """
    levels, walls = floors_and_walls(work)
    made = cleared(work, levels)
    reached = np.zeros(len(work.samples.face), bool)
    if not work.operation.finishes:
        return made, reached
    for more, faces, rows in finished(work, made, levels, walls):
        made = [*made, *more]
        reached[np.isin(work.samples.face, faces)] |= rows
    return made, reached


def floors_and_walls(work, needs_floor=True):
    """(indices of the level faces, of the upright ones) that the operation is about.

    Raises:
        PlanError: another face is among them, or there is no floor.
    """
    levels = [i for i in work.wanted if is_level(work.faces[i])]
    walls = [i for i in work.wanted if i not in set(levels)]
    leaning = work.samples.leaning_faces(UPRIGHT)
    for i in walls:
        if i in leaning:
            place = ", ".join(f"{v:.3f}" for v in work.in_part(work.faces[i].middle.point_mm[0]))
            raise PlanError(f"{work.operation.title}: the {work.faces[i].kind} at ({place}) is neither level nor upright: it is "
                            "for floors and the walls on them; give drafted and rounded faces to waterline, rest or rough")
    if needs_floor and not levels:
        raise PlanError(f"{work.operation.title}: none of the faces {work.face_names} is a level floor: name the floor with the "
                        "walls, or give walls alone to contour")
    return levels, walls


def cleared(work, levels):
    """Clearing operations, the largest cutter first: [] where nothing stands on the floors."""
    operation, practice = work.operation, work.practice
    allowance = _allowance_mm(work)
    floors = work.on(operation, levels, work.planned)
    rows = leftover_rows(floors.samples)
    usable = work.library.model_copy(update={"tools": tuple(work.tools("flat", "bull_nose"))})
    tools = roughing_tools(usable, work.mesh, floors.samples, work.stock_min_mm, work.stock_max_mm, allowance)
    first, candidates = choose_roughing(tools, allowance)
    stage = roughing.RoughingStage(name=f"{operation.title} rough"[:NAME], allowance_mm=allowance, counts_stops=True,
                                   over_floors_mm=SKIN_MM if operation.finishes else None)
    made, stock, left = _clear(floors, stage, first.tool, candidates, work.stock_mm, rows, levels)
    rest, candidates = _rest_tool(work, floors, first, tools, left, is_entered=made is not None)
    if rest is not None:
        if made is not None:
            stage = replace(stage, name=f"{operation.title} rest"[:NAME], threshold_mm=practice.rest_threshold_mm)
        more, _, _ = _clear(floors, stage, rest, candidates, stock, rows, levels)
        return [o for o in (made, more) if o is not None]
    return [] if made is None else [made]


def _clear(work, stage, tool, candidates, stock, rows, levels):
    stage = replace(stage, within=borders(work, tool.cutter, stage.allowance_mm, levels))
    return _faster(work, stage, tool, candidates, stock, rows, (work.operation, *along_flutes(work, tool, levels)))


def along_flutes(work, tool, levels):
    """(Clearing,) as deep as the floors and so much narrower that a tooth takes what it would in levels; () where it is no deeper.

    Where the operation, or the preset, states stepdown or stepover these stand, there is none.  `levels`: indices of the floors.
    """
    stated, cutter, share = work.operation, tool.cutter, work.material.stepdown_share
    d = cutter.diameter_mm
    if any(getattr(stated, n, None) is not None or work.of_preset(n, tool) is not None for n in ("stepdown_mm", "stepover_mm")):
        return ()
    section_mm2 = share * work.practice.radial_share * d * d
    lowest = min(float(work.faces[i].middle.point_mm[0, 2]) for i in levels)
    depth = min(float(work.stock_max_mm[2]) - lowest, DEEPEST_SHARE * d, TERRACE_SHARE * cutter.flute_length_mm,
                section_mm2 / (NARROWEST_SHARE * d))
    if depth <= share * d:
        return ()
    return (Clearing(stepdown_mm=depth, stepover_mm=section_mm2 / depth, ramp_deg=getattr(stated, "ramp_deg", None)),)


def _faster(work, stage, tool, candidates, stock, rows, ways):
    """What roughing.cleared gives of the fastest of some ways (Clearing); others are tried where the first takes several levels."""
    first = roughing.cleared(work, stage, tool, candidates, stock, rows, ways[0])
    if first[0] is None or first[0].facts["levels"] < 2 or len(ways) < 2:
        return first
    others = [roughing.cleared(work, stage, tool, candidates, stock, rows, way) for way in ways[1:]]
    made = [first, *(o for o in others if o[0] is not None and o[0].facts["given_up_mm3"] <= first[0].facts["given_up_mm3"])]
    best = min(made, key=lambda m: m[0].facts["time_s"])
    slower = [{"stepdown_mm": o.facts["stepdown_mm"], "time_s": o.facts["time_s"]} for o, *_ in made if o is not best[0]]
    return (replace(best[0], facts={**best[0].facts, "slower_ways": slower}), *best[1:]) if slower else best


def _rest_tool(work, floors, first, tools, left_mm, is_entered):
    """(Tool or None, candidates) of what follows a clearing."""
    operation = work.operation
    if operation.rest_tool is not None:
        asked = floors.of(operation.model_copy(update={"tool": operation.rest_tool}), work.planned).tools("flat", "bull_nose")
        return asked[0], ()
    if operation.tool is not None or left_mm <= _allowance_mm(work) + work.practice.rest_threshold_mm:
        return None, ()
    smaller, candidates = choose_rest_roughing(tools, first, left_mm)
    if smaller is None and not is_entered:      # the first one fits between the walls, and has no room there to come down
        below = [t for t in tools if t.tool.cutter.diameter_mm < first.tool.cutter.diameter_mm and not t.missing_stick_out_mm]
        smaller = max(below, key=lambda t: t.tool.cutter.diameter_mm, default=None)
    return (None, ()) if smaller is None else (smaller.tool, candidates)


def borders(work, cutter, allowance_mm, levels):
    """Function (n, 2) -> (n,) lowest tips of a cutter that stays within the pockets of some floors.

    Args:
        levels: indices of the floors.
    """
    heights, mesh = {}, work.triangles
    for i in levels:
        heights.setdefault(round(float(work.faces[i].middle.point_mm[0, 2]), 6), []).append(i)
    floors = [(z, DropMesh.from_triangles(mesh.vertices_mm, mesh.triangles[np.isin(mesh.face_of_triangle, faces)]))
              for z, faces in sorted(heights.items(), reverse=True)]
    radius = cutter.radius_mm + allowance_mm

    def lowest_mm(xy_mm):
        lowest = np.full(len(xy_mm), work.clearance_z_mm)
        for z, floor in floors:
            near = np.isfinite(drop_tips_mm(floor, xy_mm, cutter.radius_mm + BESIDE_MM, 0.0))
            free = near.copy()
            free[near] = ~is_held_above(work.mesh, xy_mm[near], radius, 0.0, z + SURE_MM)
            lowest[free] = z
        return lowest

    return lowest_mm


def finished(work, made, levels, walls):
    """[(operations, indices of faces, (n,) bool of their samples that are reached)]: floors as near to the walls as the clearing
    left these, then walls."""
    operation = work.operation
    tool = finishing_tool(work, walls)
    mine = alike(operation, Floor(name=f"{operation.title} floor"[:NAME], tool=tool.number))
    floors = work.on(mine, levels, [*work.planned, *made])
    floor = _floors_finished(floors, made, tool, _allowance_mm(work), levels)
    done = [(floor, levels, floors.chosen_tool("flat")[2] & (floors.samples.normal[:, 2] > LEVEL))]
    if walls:
        mine = alike(operation, Contour(name=f"{operation.title} walls"[:NAME], tool=tool.number, **said_of_walls(operation)))
        more, rows = mine.plan(work.on(mine, walls, [*work.planned, *made, *floor]))
        done.append((more, walls, rows))
    return done


def _floors_finished(work, made, tool, allowance_mm, levels):
    """The operations that take the skin off the floors: by the clearing's cutter, where it is larger, then by `tool`."""
    larger = [o.tool for o in made[:1] if o.tool.cutter.type == "flat" and o.tool.cutter.radius_mm > tool.cutter.radius_mm]
    title, stock, done = work.operation.title, work.stock_mm, []
    for mine in (*larger, tool):
        name, keeps = (f"{title[:NAME - len(CORNERS)]}{CORNERS}", allowance_mm + SLIVER_MM) if done else (title, allowance_mm)
        stage = roughing.RoughingStage(name=name, allowance_mm=keeps, over_floors_mm=0.0, is_rough=False,
                                       counts_stops=True, within=borders(work, mine.cutter, keeps, levels))
        ways = (Clearing(stepover_mm=mine.cutter.radius_mm), *along_flutes(work, mine, levels))
        one, stock, _ = _faster(work, stage, mine, (), stock, leftover_rows(work.samples), ways)
        done += [] if one is None else [one]
    return done


def _allowance_mm(work):
    """What the clearing leaves."""
    asked = work.operation.allowance_mm
    return work.practice.rough_allowance_mm if asked is None else asked


def said_of_walls(operation):
    """What an operation says of its walls' Contour."""
    return {n: getattr(operation, n) for n in ("spring_passes", "lead_radius_mm", "stepdown_mm", "ramp_deg")}


def alike(operation, mine):
    """Another operation with the coolant of this one."""
    return mine.model_copy(update={"coolant": operation.coolant})


def finishing_tool(work, walls):
    """The flat cutter of walls and floors: the fastest of those that leave least and fit the walls' rounded corners.

    Raises:
        CutterDoesNotFit: none does.
    """
    asked = work.operation.finish_tool
    mine = work.on(Floor(name=work.operation.title, tool=asked), work.wanted, work.planned)
    tightest = math.inf
    if walls:
        elements = [w.element for w in upright_walls(work.faces, walls, CURVE_SHARE * path_tolerance_mm(work.finish))]
        tightest = min((e.radius_mm for e in elements if e.is_left), default=math.inf)
    tools = [t for t in mine.tools("flat") if t.cutter.radius_mm <= tightest - NARROWER_MM]
    if not tools:
        raise CutterDoesNotFit(f"{work.operation.title}: its walls are rounded by {tightest:.3f} mm, and no flat cutter "
                               f"{'of those that it may use ' if asked is not None else ''}is smaller: add one to the file of "
                               "--cutters, or request another finish_tool")
    return choose_cutter(work.operation.title, tools, mine.samples, math.inf, mine.reached_with, mine.finishing_work(),
                         worth_share=CORNERS_SHARE)[0]
