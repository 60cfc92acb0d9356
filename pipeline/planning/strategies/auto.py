"""Auto: from the stock to the finish, all chosen by curvature: what a setup does that lists no operations."""

import math
from contextlib import suppress
from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field
from scipy.spatial import cKDTree

from cuspline.design.operations import Clearing, Finishing
from cuspline.planning import chamfering, freeform_finishing, level_finishing, roughing, section_finishing
from cuspline.planning.context import FinishingStage
from cuspline.planning.cutter_choice import choose_ball, choose_cutter, choose_rest_ball, leftover_rows
from cuspline.planning.feature_choice import contoured, holes_made, is_prismatic, outline_faces, pockets_made, sunk_faces, told_of
from cuspline.planning.finishing_chain import choose_finishing
from cuspline.planning.roughing import roughed
from cuspline.planning.strategies.chamfer import Chamfer
from cuspline.planning.strategies.contour import Contour
from cuspline.planning.strategies.floor import Floor
from cuspline.planning.strategies.tap import Tap
from cuspline.planning.strategies.thread_mill import ThreadMill
from cuspline.planning.strategies.waterline import Waterline
from cuspline.surfaces.holes import PARALLEL, holes_of
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import CutterDoesNotFit, PlanError, ToolpathError

SEMI, FINISHES = "semi-finish", ("semi-finish", "finish")     # names of the balls' operations
HELIX_SHARE = 0.6           # of the tightest wall's radius: a cutter so small has room for its helix
GIVEN_UP_SHARE = 0.01       # of what a cutter clears: so much it may leave for lack of room
CORNER_SHARE = 0.01         # of the area: what samples may miss beside walls that a flat cutter does reach
GAP_MM, GAP_MM2 = 0.5, 1.0  # farther from all that it reaches, over so much: a corner or a gap, however large the floor
WIDEST_CHAMFER_MM = 4.0     # high: larger strips are faces
FLUSH_MM = 1e-4             # under the stock's top: a level face that far down needs no cut
SWEPT = 1e-6                # of a unit normal along the way on which a face is swept
ALONG = 0.98                # of a unit normal square to the section planes: passes in them leave such a wall to the next plane


class Auto(Finishing):
    """Reams holes whose dimension asks for it, drills those that the library has drills for, bores others and counterbores by
    helices; clears and finishes slots and pockets of upright walls; then roughs, rest roughs, semi-finishes where that is needed,
    finishes with one ball or the fastest chain of balls; last it taps threads, or mills them. What could not be done so says
    why in plan.json."""

    kind = "auto"
    picture = """
        flat, bull nose      ball        smaller balls
         |______|    ->     (____)   ->    (__)  where the
         rough              finish          rest is too tight"""

    strategy: Literal["sections", "parallel", "constant_scallop", "boundary", "spiral"] | None = Field(
        default=None, description="finishing passes: arcs and lines in section planes; on any faces: parallel at an angle, "
        "constant scallop height, along the faces' border, one spiral; left out: sections where section_plane is stated or "
        "all faces are swept along x or y, else parallel")
    section_plane: Literal["ZX", "YZ"] = Field(default="ZX", description="sections: plane in which the finishing passes run")
    pass_angle_deg: float = Field(default=0.0, ge=-180, le=180, description="parallel: direction of the passes from +X")
    steep_deg: float = Field(default=65.0, ge=20, le=90, description="walls steeper than this get waterline passes "
                             "(all strategies but sections); 90: none do")

    @property
    def pattern(self):
        """What plan.json calls the passes."""
        return self.strategy

    def curves(self, field, cutter, ridge_mm):
        """Passes seen from above."""
        return freeform_finishing.pattern_curves(self.strategy, field, cutter, ridge_mm, math.radians(self.pass_angle_deg))

    def plan(self, work):
        made = holes_made(work)
        if self._is_free and made.left(work):
            rest = work.on(self, made.left(work), work.planned) if made.taken else work
            if is_prismatic(rest) or self._chosen(rest).strategy != "sections":
                made = pockets_made(work, made, but=sunk_faces(rest, made.left(work)))
        chosen = self.strategy or self._chosen(work).strategy
        edges = () if chosen == "sections" or self.strategy else chamfering.chamfer_faces(work, Chamfer(), WIDEST_CHAMFER_MM)
        return self._with_threads(work, *self._with_edges(work, made, edges))

    @property
    def _is_free(self):
        """Whether nothing says how faces are finished."""
        return self.strategy is None and "section_plane" not in self.model_fields_set

    def _with_edges(self, work, made, edges):
        """All but threads; where the edges cannot be chamfered they are faces like others, and plan.json says why."""
        if edges:
            try:
                return self._with_others(work, replace(made, taken=(*made.taken, *edges)), edges)
            except (PlanError, CutterDoesNotFit) as error:
                made = made.with_refused([(edges, f"chamfer: {error}")])
        return self._with_others(work, made, ())

    def _with_threads(self, work, made, reached):
        """All that is made, then the threads of its holes: tapped where that can be, else milled."""
        named = {}
        for one in work.threaded:
            if set(one.wall.faces) <= set(work.wanted) and one.hole.axis[2] > 1.0 - PARALLEL:
                named.setdefault((one.name, one.thread), []).extend(one.wall.faces)
        for (_, thread), faces in named.items():
            made = [*made, *_threads(work, [*work.planned, *made], thread, faces)]
            reached = reached | np.isin(work.samples.face, faces)
        return made, reached

    def _with_others(self, work, made, edges):
        """All that is not taken, after what is made (feature_choice.Featured); then chamfers along `edges`."""
        made = self._with_what_waits(work, made)
        operations, left = list(made.operations), made.left(work)
        if not made.taken:
            return self._shaped_in_place(work, made.why(left))
        reached = made.reached(work.samples)
        if left:
            shaped, rows = self._shaped_in_place(work.on(self, left, [*work.planned, *operations]), made.why(left))
            operations += shaped
            reached[np.isin(work.samples.face, left)] = rows
        if edges:
            more, _ = Chamfer().plan(work.on(Chamfer(), edges, [*work.planned, *operations]))
            operations += more
        return operations, reached

    def _shaped_in_place(self, work, why):
        """As `_shaped`, in place of what was refused: `why` stands with the operations, or with what is refused again."""
        try:
            shaped, rows = self._shaped(work)
        except CutterDoesNotFit as error:
            raise CutterDoesNotFit(f"{error} ({why})" if why else str(error), rows=error.rows) from None
        return told_of(shaped, why), rows

    def _with_what_waits(self, work, made):
        """The same with what is not upright shaped, and after it what waits for that, where there are both: slots and pockets sunk
        under it, walls that stand on nothing contoured."""
        left = made.left(work)
        if not self._is_free or not left:
            return made
        sunk = sunk_faces(work.on(self, left, work.planned), left)
        with suppress(CutterDoesNotFit):            # nothing reaches the others alone: they are shaped together
            after = self._sunk_made(work, made, sunk) if sunk else None
            if after is not None:
                return after
        return self._with_outline(work, made)

    def _sunk_made(self, work, made, sunk):
        """The same with all others, then those slots, pockets and holes sunk under them that can be made; None: none can."""
        before = self._with_outline(work, replace(made, taken=(*made.taken, *sunk)))
        others = before.left(work)
        if others:
            shaped, rows = self._shaped(work.on(self, others, [*work.planned, *before.operations]))
            before = before.with_made(shaped, others, rows)
        after = pockets_made(work, replace(before, taken=tuple(i for i in before.taken if i not in set(sunk))))
        done = [i for i in sunk if i in set(after.taken)]
        if len(done) == len(sunk):
            return after
        return self._sunk_made(work, made, done) if done else None

    def _with_outline(self, work, made):
        """The same with what is not upright shaped, and walls that stand on nothing contoured after it, where there are both."""
        left = made.left(work)
        walls = outline_faces(work, left) if left else []
        others = [i for i in left if i not in set(walls)]
        if not walls or not others or self._chosen(work.on(self, left, work.planned)).strategy == "sections":
            return made
        shaped, rows = self._shaped(work.on(self, others, [*work.planned, *made.operations]))
        shaped_too = made.with_made(shaped, others, rows)
        outlined, is_made = contoured(work, shaped_too, walls)
        return outlined if is_made else made.with_refused(outlined.refused[len(made.refused):])

    def _shaped(self, work):
        """All that drills do not make."""
        chosen = self if self.strategy is not None else self._chosen(work)
        work = work if chosen is self else work.of(chosen, work.planned)
        if chosen is not self and (floor := _level_floor(work)) is not None:
            return _with_floors(work, floor)
        if chosen.strategy != "sections":
            return _free_form(work, may_take_floors=chosen is not self and work.tool_axis is None)
        if (np.abs(work.samples.normal[:, work.plane.across]) > ALONG).any():
            return _instead(work, f"faces stand along the section plane {chosen.section_plane}")
        try:
            return _by_sections(work)
        except CutterDoesNotFit as error:               # no one ball everywhere
            if self.strategy is not None:
                raise CutterDoesNotFit(f"{error}, or leave `strategy` out: parallel passes with several balls go as far as "
                                       "these do, and what they leave is listed") from None
            return _instead(work, error)
        except ToolpathError as error:                  # a section with kinks
            return _instead(work, error)

    def _chosen(self, work):
        """The same with a strategy: sections for faces that are swept square to a section plane, parallel for others."""
        as_sections = lambda plane: self.model_copy(update={"strategy": "sections", "section_plane": plane})
        if "section_plane" in self.model_fields_set:
            return as_sections(self.section_plane)
        for plane, across in (("ZX", 1), ("YZ", 0)):
            if (np.abs(work.samples.normal[:, across]) < SWEPT).all():
                return as_sections(plane)
        return self.model_copy(update={"strategy": "parallel"})


def _threads(work, planned, thread, faces):
    """Operations of one thread's holes."""
    on = lambda operation: operation.plan(work.on(operation, faces, planned))[0]
    try:
        return on(Tap())
    except (PlanError, CutterDoesNotFit) as error:
        why = str(error)
    try:
        return told_of(on(ThreadMill()), why)
    except (PlanError, CutterDoesNotFit) as error:
        raise CutterDoesNotFit(f"thread {thread.in_words}: it can neither be tapped ({why}) nor milled ({error})") from None


def _instead(work, why):
    """Parallel passes where sections cannot be: a chain of balls goes where it can."""
    parallel = work.operation.model_copy(update={"strategy": "parallel"})
    made, reached = _free_form(work.of(parallel, work.planned))
    return told_of(made, f"sections: {why}"), reached


def _semi_finish(work):
    return FinishingStage(name=SEMI, allowance_mm=work.practice.semi_allowance_mm, scallop_mm=work.semi_scallop_mm)


def _finish(work):
    return FinishingStage(name="finish", allowance_mm=0.0, scallop_mm=work.finish.scallop_mm)


def _by_sections(work):
    """Operations in section planes: one ball that fits everywhere, and the smallest where it is held off."""
    practice, finishing = work.practice, work.finishing_work()
    ball, candidates, reach = choose_ball(work.finishing_library, work.samples, work.hollow.radius_mm, work.mesh,
                                          practice.rough_allowance_mm, finishing)
    semi = lambda: section_finishing.finish(work, _semi_finish(work), ball, (), reach)
    operations = roughed(work, ball, reach.is_reached, semi)
    operations.append(section_finishing.finish(work, _finish(work), ball, candidates, reach))
    rest, candidates, adds = choose_rest_ball(work.library, work.samples, reach, work.mesh, ball.cutter.radius_mm,
                                              practice.rough_allowance_mm)
    if rest is not None:
        operations.append(section_finishing.rest(work, ball, rest, candidates))
    return operations, reach.is_reached | adds


def _free_form(work, may_take_floors=False):
    """Operations over regions: the fastest chain of balls, each smaller one where the one before leaves too much.

    May_take_floors: level faces are finished by a flat cutter where that is faster.
    """
    if (np.abs(work.samples.normal[:, 2]) < level_finishing.UPRIGHT).all():
        return _upright(work)
    practice = work.practice
    chain, candidates, reached = choose_finishing(work.finishing_library, work.samples, work.mesh,
                                                  practice.rough_allowance_mm, work.finishing_work())
    tools = [link.tool for link in chain]
    floor = level_finishing.faster_floor_cutter(work, tools[0], practice.tool_change_s, reached) if may_take_floors else None
    if floor is not None:
        return _with_floors(work, floor)
    semi = lambda: freeform_finishing.finish(work, _semi_finish(work), tools[0], ())
    operations = roughed(work, tools[0], chain[0].adds, semi)
    finishing = [freeform_finishing.finish(work, _finish(work), tools[0], candidates)]
    made, after = operations + finishing, lambda made: work.of(work.operation, [*work.planned, *made])
    for link in chain[1:]:
        rest = freeform_finishing.rest(work, finishing, link.tool, candidates)
        if rest is not None:
            made += roughing.led_up_to(after(made), rest, link.adds)
            finishing.append(rest)
    return made, reached


def _upright(work):
    """Walls alone, of which nothing is seen from above: a flat cutter goes along their exact plan, or round them by
    waterlines, as deep as its flutes."""
    standing, tightest = work.practice.rough_allowance_mm, work.hollow.radius_mm
    flats = [t for t in work.library.of_type("flat") if t.cutter.radius_mm <= HELIX_SHARE * tightest]
    is_small, round_walls = bool(flats), _walls_of_holes(work)
    if not is_small and round_walls:
        raise CutterDoesNotFit(_no_flat_cutter(work, tightest))
    try:                                # where none is small it leaves corners; whether it has room elsewhere shows as it clears
        tool, candidates, reached = choose_cutter("waterline", flats or work.library.of_type("flat"), work.samples,
                                                  tightest if is_small else math.inf, work.reached_with, work.finishing_work())
    except CutterDoesNotFit as error:
        if round_walls:
            raise
        made, reached = _between_walls(work, work.planned, np.zeros(len(work.samples.area_mm2), bool))
        if not made:
            raise
        return told_of(made, str(error)), reached
    rough, _, _ = roughing.cleared(work, roughing.RoughingStage(name="rough", allowance_mm=standing), tool, candidates,
                                   work.stock_mm, leftover_rows(work.samples), Clearing())
    if not is_small and (rough is None or rough.facts["given_up_mm3"] > GIVEN_UP_SHARE * rough.facts["removed_mm3"]):
        raise CutterDoesNotFit(_no_flat_cutter(work, tightest))
    before = [rough] if rough is not None else []
    try:
        sides, rows = Contour().plan(work.on(Contour(), work.wanted, [*work.planned, *before]))
        return [*before, *sides], rows
    except (PlanError, CutterDoesNotFit) as error:
        why = str(error)
    made = freeform_finishing.walls_alone(work.on(Waterline(), work.wanted, [*work.planned, *before]), tool, candidates)
    made = [*before, *told_of([made] if made is not None else [], why)]
    between, also = _between_walls(work, [*work.planned, *made], reached)
    return [*made, *between], reached | also


def _no_flat_cutter(work, tightest_mm):
    return (f"{work.setup.name}: upright walls alone are left, rounded by {tightest_mm:.3f} mm, and no flat cutter is small enough "
            "to come down between them by a helix: add one to the file of --cutters, or a drill")


def _walls_of_holes(work):
    """Set of the faces wanted that are walls of holes: what drills, reamers and helices have left of these has its own reasons."""
    return {f for hole in holes_of(work.faces) for wall in hole.walls for f in wall.faces} & set(work.wanted)


def _between_walls(work, planned, reached):
    """Operations of a ball that comes in between walls where the flat cutter of `planned` does not, and the rows (n,) that it
    reaches: the stock there is cleared first, which passes of clean-up would meet at its whole depth.  ([], none) where nothing
    stands so deep."""
    none = [], np.zeros(len(reached), bool)
    if not (~reached).any() or not work.finishing_library.of_type("ball"):
        return none
    try:
        chain, candidates, by_balls = choose_finishing(work.finishing_library, work.samples, work.mesh,
                                                       work.practice.rough_allowance_mm, work.finishing_work())
    except CutterDoesNotFit:
        return none
    ball, left = chain[-1].tool, by_balls & ~reached
    faces = np.unique(work.samples.face[left]).tolist()
    on = lambda planned: work.on(Waterline(), faces, planned)
    cleared = roughing.before_passes(on(planned), ball, left[np.isin(work.samples.face, faces)]) if faces else []
    if not cleared:
        return none
    made = freeform_finishing.walls_alone(on([*planned, *cleared]), ball, candidates)
    return [*cleared, *([made] if made is not None else [])], by_balls


def _level_floor(work):
    """FloorCutter of faces that are all level, where it is faster than the largest ball; None: others are among them."""
    balls = work.finishing_library.of_type("ball")
    if not balls or work.tool_axis is not None or not all(level_finishing.is_level(work.faces[i]) for i in work.wanted):
        return None
    return level_finishing.faster_floor_cutter(work, balls[0], change_s=0.0)


def _with_floors(work, floor):
    """Level faces and their walls by a flat cutter between roughing and the balls, which finish all that it does not."""
    others = [i for i in work.wanted if i not in floor.faces]
    flat = lambda planned: _by_flat_cutter(work.on(Floor(), floor.faces, planned), floor)
    if not others or _lean_alone(work.on(work.operation, others, work.planned)):
        return _floors_and_leaning_walls(work, floor, flat, others)
    made, rows = _free_form(work.on(work.operation, others, work.planned))
    reached = floor.is_reached.copy()
    reached[np.isin(work.samples.face, others)] = rows
    first = next((k for k, o in enumerate(made) if o.name in FINISHES), len(made))
    floors = flat([*work.planned, *made[:first]])
    made = [*made[:first], *floors, *made[first:]]
    return [*made, *_corners(work, floor, [*work.planned, *made])], reached


def _floors_and_leaning_walls(work, floor, flat, walls):
    """Roughing, the floors by function `flat` of what is planned, their corners, leaning walls by a ball's waterlines."""
    rough = roughed(work, floor.tool, floor.is_reached, lambda: None)
    made = [*rough, *flat([*work.planned, *rough])]
    made += _corners(work, floor, [*work.planned, *made])
    if not walls:
        return made, floor.is_reached
    mine, reached = work.on(Waterline(), walls, [*work.planned, *made]), floor.is_reached.copy()
    try:
        chain, candidates, rows = choose_finishing(work.finishing_library, mine.samples, work.mesh,
                                                   work.practice.rough_allowance_mm, work.finishing_work())
    except CutterDoesNotFit as error:               # they are so low that no ball comes to them beside the floor
        return told_of(made, f"walls beside the floors: {error}"), reached
    sides = freeform_finishing.walls_alone(mine, chain[-1].tool, candidates)
    reached[np.isin(work.samples.face, walls)] = rows if sides is not None else False
    return [*made, *([sides] if sides is not None else [])], reached


def _lean_alone(work):
    """Whether all faces are walls too steep for passes seen from above, some of them with draft."""
    up = work.samples.normal[:, 2]
    return bool((up < fixed.cos(math.radians(work.operation.steep_deg))).all() and (up > level_finishing.UPRIGHT).any())


def _corners(work, floor, planned):
    """The smallest ball where the flat cutter leaves too much of the level faces, and what that must clear before; [] nowhere."""
    area, is_level = work.samples.area_mm2, np.isin(work.samples.face, floor.levels)
    left, reached = is_level & ~floor.is_reached, is_level & floor.is_reached
    if not left.any():
        return []
    if area[left].sum() <= CORNER_SHARE * area.sum():
        away = cKDTree(work.samples.point_mm[reached]).query(work.samples.point_mm[left])[0]
        if area[left][away > GAP_MM].sum() < GAP_MM2:
            return []
    mine = work.on(work.operation, floor.levels, planned)
    chain, candidates, _ = choose_finishing(work.finishing_library, mine.samples, work.mesh, work.practice.rough_allowance_mm,
                                            work.finishing_work())
    made = freeform_finishing.rest(mine, planned, chain[-1].tool, candidates)
    return roughing.led_up_to(mine, made, left[is_level]) if made is not None else []


def _by_flat_cutter(work, floor):
    """[what it must clear before, the floors]; none beside other operations where all of them are flush with the stock."""
    level = np.flatnonzero(work.samples.normal[:, 2] > level_finishing.LEVEL)
    if work.planned and len(level) and roughing.standing_mm(work, level).max() <= FLUSH_MM:
        return []
    before, stock = roughing.before_floors(work, floor.tool, level)
    return [*before, level_finishing.floors(work, floor.tool, floor.candidates, stock)]
