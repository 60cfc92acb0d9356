r"""Holes drilled: which drill, how deep, in which order.

        |    |  wall        full diameter down to the end of the wall; no deeper than the point leaves
        |    |              every face below it whole: the cone of the hole, a ledge, a floor
        |\  /|  end
        : \/ :              of a through hole: point and break_through_mm below the end
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from cuspline.design.drill_points import drill_point, drill_points, is_deep
from cuspline.planning.context import THIN_MM
from cuspline.planning.freeform_finishing import LEVEL
from cuspline.planning.tool_depth import missing_stick_out_mm
from cuspline.program.drilling import PECKS, DrillCycle, drilled, shortest_way
from cuspline.surfaces.holes import PARALLEL, ends_on_level, holes_of
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.circles import rings_of
from cuspline.values.errors import CamError, CutterDoesNotFit, PlanError

DEEP = 3.0                  # diameters: a deeper hole is pecked
TURNS = 3                   # of a dwell
SHARE = 0.9                 # of the drill's radius: what stands over a hole is looked for within it
RINGS = np.array([0.0, 0.35, 0.7, 0.95])
SPOKES = 12
SPOT_SHARE = 0.8            # of a hole's radius, that its spot is wide
SPOT_NAME = 34              # letters of an operation's name before "spots"
DISCS = 96                  # that a drill's point is held against the part as
SAME_MM = 1e-6
OVER_MM = 0.05              # what may seem to stand over a wall's end: the planning mesh
REACHED_MM = 1e-4
SAME_DEG = 0.5              # of a cone and the drill that leaves it


@dataclass(frozen=True, eq=False, kw_only=True)
class Bore:
    """One wall to be drilled, in the part as it lies in its setup."""

    hole: object            # surfaces.holes.Hole
    wall: object            # surfaces.holes.Wall
    place_mm: tuple         # (3,) of its mouth, part coordinates, for messages

    @property
    def radius_mm(self):
        return self.wall.low_radius_mm

    @property
    def xy_mm(self):
        return tuple(self.hole.point_mm[:2].tolist())

    @property
    def height_mm(self):
        """Z of the hole's point on the axis, from which its walls are measured."""
        return float(self.hole.point_mm[2])

    @property
    def low_z_mm(self):
        """Where the wall ends."""
        return self.height_mm + self.wall.low_mm

    @property
    def high_z_mm(self):
        return self.height_mm + self.wall.high_mm

    @property
    def floor_mm(self):
        """The lowest place of the hole."""
        return self.height_mm + self.hole.walls[0].low_mm


@dataclass(frozen=True, eq=False, kw_only=True)
class Drilled:
    """A Bore with its drill."""

    bore: Bore
    tool: object            # shop.cutters.Tool
    tip_mm: float           # height of the tip at the bottom

    @property
    def full_z_mm(self):
        """Where its full diameter ends."""
        return self.tip_mm + self.tool.cutter.point_height_mm


def drillable_faces(work, operation, wanted, leaves_point=False):
    """Which of some faces drills of the library make whole, upright holes along the setup's Z.

    Through holes, and blind ones that end in the drill's own point; a hole with a dimension by drills within its limits alone.
    Leaves_point: level bottoms too, with what the point leaves there, of holes that are deep or narrower than any ball.

    Args:
        work: PlanningContext.   operation: the strategies.drill.Drill that would make them.   wanted: indices of faces.
    Returns:
        (indices of walls, of other faces that are made with them, [(faces, why no drill makes them)]).
    """
    walls, others, refused = [], [], []
    found = [(hole, wall) for hole in upright_holes(work) for wall in walls_of(hole, wanted)]
    work = work.on(operation, wanted, work.planned) if found else work
    for hole, wall in found:
        bore = Bore(hole=hole, wall=wall, place_mm=work.in_part(hole.mouth_mm))
        try:
            stays = _stays(work, bore, leaves_point)
            tool = _whole_by(work, bore, stays)
        except CamError as error:
            refused.append((wall.faces, str(error)))
            continue
        walls += wall.faces
        others += level_faces(work, bore) if stays is not None else made_with(work, bore, tool)
    return walls, [i for i in others if i in set(wanted)], refused


def _whole_by(work, bore, stays):
    """The drill that makes a wall whole.   stays: DrillPoint that may be left at its end, or None.

    Raises:
        CamError: why none does.
    """
    made, where = _drilled(work, bore), f"{work.operation.title}: T{{}} {{}} {{}} the hole at {in_words(bore.place_mm)}"
    cutter = made.tool.cutter
    say = lambda what: CutterDoesNotFit(where.format(made.tool.number, cutter.name, what))
    if made.full_z_mm > bore.low_z_mm + (0.0 if stays is None else stays.height_mm) + SAME_MM:
        raise say("cannot bring its full diameter down to the end of the wall of")
    top = float(stock_over(work, bore, cutter.radius_mm).max())
    if max(top, bore.high_z_mm) - made.tip_mm > cutter.flute_length_mm:
        raise say("has too short flutes for the stock over")
    limits = work.diameter_limits_mm(bore.wall)
    if limits is not None and not limits[0] <= cutter.diameter_mm <= limits[1]:
        raise say(f"does not come within {limits[0]:g} to {limits[1]:g} mm, the dimension of")
    return made.tool


def made_with(work, bore, tool):
    """Faces that a drill makes beside its wall: the cone of its own angle that the hole ends in, of a flat drill what is level."""
    angle = bore.hole.point_angle_deg
    if tool.cutter.has_flat_bottom:
        return level_faces(work, bore)
    return bore.hole.walls[0].faces if angle is not None and abs(angle - tool.cutter.point_angle_deg) < SAME_DEG else ()


def _stays(work, bore, leaves_point):
    """The DrillPoint that may stay at the level end of a wall: its thread ends above it, or nothing else comes there; None."""
    mine = [w for w in work.threaded if w.wall.faces == bore.wall.faces]
    if mine or not leaves_point or not ends_on_level(bore.hole, bore.wall):
        return next(iter(drill_points(mine)), None)
    balls = [t.cutter.radius_mm for t in work.library.of_type("ball")]
    is_left = is_deep(bore.hole, bore.wall) or bore.radius_mm < min(balls, default=math.inf)
    return drill_point(bore.hole, bore.wall) if is_left else None


def level_faces(work, bore):
    """Indices of level faces at the wall's foot within it."""
    x, y = bore.xy_mm
    out = []
    for i, face in enumerate(work.faces):
        if face.kind == "plane" and face.middle.normal[0, 2] > LEVEL and abs(
                float(face.middle.point_mm[0, 2]) - bore.low_z_mm) < REACHED_MM:
            px, py = face.middle.point_mm[0, :2]
            if math.hypot(px - x, py - y) < bore.radius_mm + REACHED_MM:
                out.append(i)
    return out


def _angle_deg(bore):
    """Of the point that leaves the wall's end as it is drawn; None: any point does, but a flat one finds no middle."""
    lowest = bore.wall == bore.hole.walls[0]
    if lowest and bore.hole.floor or not lowest and any(
            abs(w.high_mm - bore.wall.low_mm) < SAME_MM and w.high_radius_mm < bore.radius_mm - SAME_MM for w in bore.hole.walls):
        return 180.0
    return bore.hole.point_angle_deg


def drilled_holes(work):
    """The operations of a drill operation, one a drill.

    Args:
        work: PlanningContext of an operation with the fields of strategies.drill.Drill.
    Returns:
        (list of PlannedOperation, (n,) bool: samples where the drills come to).
    Raises:
        PlanError, CutterDoesNotFit: a face that is no wall of a hole, a hole that leans, one that no drill fits or is long
            enough for, one with material of the part above it.
    """
    by_tool = {}
    for bore in bores_of(work):
        one = _drilled(work, bore)
        by_tool.setdefault(one.tool.number, []).append(one)
    reached = np.zeros(len(work.samples.area_mm2), bool)
    for one in (d for mine in by_tool.values() for d in mine):
        reached |= is_drilled(work.samples, one.bore, one.full_z_mm)
    spots, why = _spots_before(work, [d.bore for mine in by_tool.values() for d in mine])
    made = [operation_of(work, mine, number=len(by_tool)) for mine in by_tool.values()]
    return [*spots, *(replace(o, facts={**o.facts, "not_spotted": why}) if why else o for o in made)], reached


def _spots_before(work, bores):
    """([PlannedOperation of spots] or [], why there are none though the shop wants them)."""
    if not (work.practice.spot_holes if work.operation.spot is None else work.operation.spot):
        return [], ""
    try:
        return [_spots(work, bores)], ""
    except CamError as error:
        if work.operation.spot:
            raise
        return [], str(error)


def _spots(work, bores):
    """The PlannedOperation that gives every hole a small cone before its drill, within the hole, so that nothing of it stays.

    Raises:
        PlanError, CutterDoesNotFit: no spot drill, or its holder would touch the part.
    """
    before = type(work.operation)(name=f"{work.operation.title[:SPOT_NAME]} spots", tool="spot drill", cycle="drill",
                                  retract_mm=work.operation.retract_mm, coolant=work.operation.coolant)
    mine = work.on(before, work.wanted, work.planned)
    tool, made = mine.tools("spot_drill")[0], []
    for bore in bores:
        wide = min(SPOT_SHARE * bore.radius_mm, tool.cutter.radius_mm)
        top = max(float(stock_over(mine, bore, SPOT_SHARE * bore.radius_mm).max()), bore.high_z_mm)
        tip = top - wide * tool.cutter.point_height_mm / tool.cutter.radius_mm
        missing = missing_stick_out_mm(tool, np.array([[*bore.xy_mm, tip]]), mine.mesh, 0.0)
        if missing > SAME_MM:
            raise CutterDoesNotFit(f"{before.title}: T{tool.number} {tool.cutter.name} is {missing:.3f} mm too short for the hole "
                                   f"at {in_words(bore.place_mm)}: take a longer spot drill, or leave spot out")
        made.append(Drilled(bore=bore, tool=tool, tip_mm=tip))
    return operation_of(mine, made, number=1)


def _drilled(work, bore):
    """Drilled, or CamError: what is in the way."""
    return drilled_by(work, bore, _drill_for(work, bore))


def drilled_by(work, bore, tool):
    """The same by a stated Tool."""
    tip = tip_mm(work, bore, tool)
    refuse_short(work, bore, tool, tip)
    return Drilled(bore=bore, tool=tool, tip_mm=tip)


def upright_holes(work):
    """Holes along the setup's Z that open upward."""
    for hole in holes_of(work.faces):
        hole = hole.turned_up() if hole.is_through and hole.axis[2] < 0 else hole
        if hole.axis[2] > 1.0 - PARALLEL:
            yield hole


def walls_of(hole, wanted):
    """Its cylinders all of whose faces are wanted."""
    return [w for w in hole.walls if w.kind == "cylinder" and set(w.faces) <= set(wanted)]


def bores_of(work, besides=()):
    """Bore of every wall among the operation's faces, but for those `besides` them.

    Raises:
        PlanError: a face that is no wall of a hole, a hole that leans or opens downward.
    """
    title, wanted, found = work.operation.title, set(work.wanted), []
    for hole in holes_of(work.faces):
        hole = hole.turned_up() if hole.is_through and hole.axis[2] < 0 else hole
        walls = [w for w in hole.walls if w.kind == "cylinder" and wanted & set(w.faces)]
        if not walls:
            continue
        place, up = work.in_part(hole.mouth_mm), float(hole.axis[2])
        if abs(abs(up) - 1.0) > PARALLEL:
            lean = math.degrees(fixed.arccos(min(abs(up), 1.0)))
            raise PlanError(f"{title}: the hole at {in_words(place)} leans {lean:.3f} degrees from the setup's Z: drill it in a "
                            "setup, or an indexed position, whose Z runs along it")
        if up < 0:
            raise PlanError(f"{title}: the hole at {in_words(place)} opens downward, seen along the setup's Z: drill it from its "
                            "other side")
        for wall in walls:
            found.append(Bore(hole=hole, wall=wall, place_mm=place))
    there = {i for b in found for i in b.wall.faces}
    if missing := [i for i in work.wanted if i not in there and i not in besides]:
        place = work.in_part(work.faces[missing[0]].middle.point_mm[0])
        raise PlanError(f"{title}: the {work.faces[missing[0]].kind} at {in_words(place)} is no wall of a hole: a drill makes "
                        "cylinders that go all round; give the face to another operation")
    return found


def in_words(place):
    """A place for messages."""
    return f"({', '.join(f'{v:.3f}' for v in place)})"


def _drill_for(work, bore):
    """The drill nearest to the hole's diameter, within what the finish allows."""
    over, under = work.finish.gouge_mm, work.finish.profile_tolerance_mm
    drills, wanted = work.tools("drill"), bore.radius_mm
    fits = [t for t in drills if -under - SAME_MM <= t.cutter.radius_mm - wanted <= over + SAME_MM]
    if not fits:
        there = ", ".join(dict.fromkeys(f"{t.cutter.diameter_mm:g}" for t in drills))
        raise CutterDoesNotFit(f"{work.operation.title}: no drill makes the hole of diameter {2 * wanted:.6g} mm at "
                               f"{in_words(bore.place_mm)}; there are {there} mm: add one of its diameter to the file of "
                               "--cutters, or bore it with a smaller end mill")
    angle = _angle_deg(bore)
    other = lambda t: float(t.cutter.has_flat_bottom) if angle is None else abs(t.cutter.point_angle_deg - angle)
    return min(fits, key=lambda t: (round(abs(t.cutter.radius_mm - wanted), 6), round(other(t), 3), -t.cutter.flute_length_mm,
                                    t.number))


def tip_mm(work, bore, tool):
    """Height of the tip at the bottom.

    Raises:
        PlanError: material of the part stands over the hole.
    """
    cutter, xy = tool.cutter, np.array([bore.xy_mm])
    above = float(drop_tips_mm(work.mesh, xy, SHARE * cutter.radius_mm, 0.0)[0])
    if above > bore.low_z_mm + OVER_MM and above > bore.floor_mm + cutter.point_height_mm + OVER_MM:
        raise PlanError(f"{work.operation.title}: the part stands {above - bore.low_z_mm:.3f} mm over the end of the hole at "
                        f"{in_words(bore.place_mm)}, seen along the setup's Z: drill it from its other side")
    slope = cutter.point_height_mm / cutter.radius_mm
    below = float(drop_tips_mm(work.mesh, xy, THIN_MM, THIN_MM)[0]) if bore.hole.is_through else -math.inf
    ends = bore.floor_mm >= bore.low_z_mm - SAME_MM and bore.hole.is_through
    if ends:
        below = max(below, _over_the_part_mm(work, xy, cutter.radius_mm, slope))
    wanted = bore.low_z_mm - cutter.point_height_mm - (work.operation.break_through_mm if ends else 0.0)
    return max(wanted, below, bore.hole.lowest_tip_mm(bore.wall, cutter.radius_mm, slope) + bore.height_mm)


def _over_the_part_mm(work, xy, radius_mm, slope):
    """Lowest tip of a drill whose point, as discs, comes into nothing of the part; -inf where it may fall through."""
    radii = np.linspace(0.0, SHARE * radius_mm, DISCS + 1)
    return max(float(drop_tips_mm(work.mesh, xy, outer, 0.0)[0]) - inner * slope for inner, outer in zip(radii, radii[1:]))


def refuse_short(work, bore, tool, tip_mm):
    """Flutes must reach the hole's mouth, holder and shank keep clear of the part."""
    depth = bore.high_z_mm - tip_mm
    tips = np.array([[*bore.xy_mm, tip_mm]])
    missing = max(depth - tool.cutter.flute_length_mm, missing_stick_out_mm(tool, tips, work.mesh, 0.0))
    if missing > SAME_MM:
        raise CutterDoesNotFit(
            f"{work.operation.title}: T{tool.number} {tool.cutter.name} is {missing:.3f} mm too short for the hole at "
            f"{in_words(bore.place_mm)}, which is {depth:.3f} mm deep with the drill's point: flutes "
            f"{tool.cutter.flute_length_mm:g} mm, stick-out {tool.stick_out_mm:g} mm; take a longer drill")


def operation_of(work, made, number):
    """The PlannedOperation of the Drilled of one drill; `number`: of drills in the operation."""
    operation, tool, bores, tips_mm = work.operation, made[0].tool, [d.bore for d in made], [d.tip_mm for d in made]
    cutter = tool.cutter
    order = shortest_way(np.array([b.xy_mm for b in bores]))
    rpm, feed = work.speeds(tool, is_rough=False)
    retract = np.array([retract_mm(work, b, tool) for b in bores])
    if operation.stays_low:
        retract[:] = retract.max()
    holes = [_cycle(work, bores[k], tool, float(tips_mm[k]), float(retract[k]), rpm, feed) for k in order.tolist()]
    moves, cycles = drilled(holes, work.clearance_z_mm, feed)
    name = operation.title if number == 1 else f"{operation.title} {cutter.diameter_mm:g}"
    depth = [b.high_z_mm - t for b, t in zip(bores, tips_mm)]
    facts = {"holes": len(bores), "diameter_mm": cutter.diameter_mm, "cycle": holes[0].kind, "depth_mm": round(max(depth), 6),
             "peck_mm": holes[0].peck_mm or None, "retract_z_mm": round(float(retract.max()), 6), "candidates": []}
    return work.measured_holes(name, tool, rpm, moves, cycles, facts)


def retract_mm(work, bore, tool):
    """Height over a hole where feeding begins: above the stock that stands there."""
    above = work.operation.retract_mm or work.practice.approach_mm
    return min(max(float(stock_over(work, bore, tool.cutter.radius_mm).max()), bore.high_z_mm) + above, work.clearance_z_mm)


def stock_over(work, bore, radius_mm):
    """(n,) heights of the stock under a drill over its hole."""
    return work.stock_mm(np.array(bore.xy_mm) + rings_of(RINGS * radius_mm, SPOKES).reshape(-1, 2))


def _cycle(work, bore, tool, tip_mm, retract_z_mm, rpm, feed):
    """The DrillCycle of one hole."""
    operation, d = work.operation, tool.cutter.diameter_mm
    kind = operation.cycle or ("peck" if retract_z_mm - tip_mm > DEEP * d else "drill")
    return DrillCycle(kind=kind, xy_mm=bore.xy_mm, bottom_z_mm=tip_mm, retract_z_mm=retract_z_mm,
                      peck_mm=(operation.peck_mm or d) if kind in PECKS else 0.0,
                      dwell_s=(operation.dwell_s or 60.0 * TURNS / rpm) if kind == "dwell" else 0.0,
                      stays_low=operation.stays_low, feed_mm_per_min=feed, first=0, end=0)


def is_drilled(samples, bore, full_z_mm):
    """(n,) bool: samples on the wall, or on what the point leaves, that are as deep as the full diameter comes."""
    away = samples.point_mm[:, :2] - bore.xy_mm
    near = np.sqrt((away * away).sum(axis=1)) < bore.radius_mm + REACHED_MM
    high = samples.point_mm[:, 2]
    return near & (high <= bore.high_z_mm + REACHED_MM) & (high >= full_z_mm - REACHED_MM)
