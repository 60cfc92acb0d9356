"""Level ground under the flat of a cutter: the stock's top taken down, and floors finished."""

import math
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from cuspline.kernel.brep import bounding_box_mm
from cuspline.planning.context import path_tolerance_mm
from cuspline.planning.cutter_choice import choose_cutter
from cuspline.planning.freeform_finishing import LEVEL, SAME_MM, TERRACE_SHARE, link_rules
from cuspline.program.program import Moves, MoveWriter
from cuspline.surfaces.prismatic_features import SMOOTH_SINE
from cuspline.toolpaths.contact.contacts import NO_FACE
from cuspline.toolpaths.drop.droppers import Dropper
from cuspline.toolpaths.freeform.parallel_passes import Bearing
from cuspline.toolpaths.freeform.plane_curves import PlaneCurve
from cuspline.toolpaths.freeform.tip_field import tip_field
from cuspline.toolpaths.freeform.tip_links import moves_of_tip_paths
from cuspline.toolpaths.freeform.tip_merging import straight_rows
from cuspline.toolpaths.freeform.tip_paths import PathRules, TipPath, tip_paths
from cuspline.toolpaths.freeform.waterline import DropHeights, waterlines
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import runs_of
from cuspline.values.errors import CutterDoesNotFit, PlanError, ToolpathError

UPRIGHT = 1e-6              # of a unit normal's z: an upright wall
FLAT_SHARE = 0.95           # of the width of its flat a cutter moves over: no ridge is left
FOOT_SHARE = 0.01           # of the floors, that a flat cutter is to finish beyond what balls come to
ASIDE_MM = 0.01             # from a wall, of the outermost passes side by side: those along the walls come nearer
HOP_MM = 0.1                # a pass interrupted for less runs where its cutter just fits between walls, or just does not
PITCH_SHARE = 0.05          # of the cutter's radius: grid on which the region of a floor is looked for
STRAIGHT_SHARE = 0.25       # of the tolerance, that chords along walls may leave them
STRIP_PITCHES = 2           # how much farther than need be a cutter may stand beside a strip along a wall
OVER_SHARE = 0.2            # of the radius that passes run over an open edge
ON_IT_MM = 2e-5             # a tip so near to a floor's height lies on it: contacts are found to half of that
BESIDE_MM = 2.0             # facing passes begin and end so far beside the stock


def facing_tool(work):
    """The tool that an operation asks for; where it asks for none, the largest face mill no wider than the stock is narrow, so
    that no stroke leaves most of it in the air, else the largest flat or bull nose cutter."""
    wish, narrow = work.operation.wish, float(np.min(np.subtract(work.stock_max_mm, work.stock_min_mm)[:2]))
    mills = [t for t in work.library.of_type("face_mill") if work.is_asked(t) and (wish or t.cutter.diameter_mm <= narrow)]
    return mills[0] if mills else work.tools("flat", "bull_nose")[0]


def faced(work, tool, allowance_mm):
    """Passes across the whole stock, level by level, down to a height.

    Args:
        work: PlanningContext of a facing.   tool: flat, bull nose or face mill; no level is deeper than its inserts.
        allowance_mm: left on the part's top.
    Returns:
        (PlannedOperation or None where nothing stands above, the height).
    Raises:
        PlanError: the part, or a fixture, stands above the height.
    """
    operation, practice = work.operation, work.practice
    top = float(work.box[1][2])
    height = top + allowance_mm if operation.height_mm is None else operation.height_mm
    if height < top - SAME_MM:
        raise PlanError(f"{operation.title}: height_mm {height:g} is below the part's top at {top:g}: facing goes across "
                        "everything; raise it, or cut what is lower by other operations")
    for fixture in work.fixtures:
        high = fixture.box_mm[1]
        if high[2] > height - practice.keep_out_mm:
            raise PlanError(f"{operation.title}: a fixture stands up to Z {high[2]:g}, and passes at Z {height:g} run across "
                            "the whole stock: hold the part lower")
    stock_top = float(work.stock_mm(_over(work)).max())
    if stock_top <= height + SAME_MM:
        return None, height
    stepdown = work.stepdown_mm(tool)
    if tool.cutter.type == "face_mill":
        stepdown = within_inserts_mm(operation, tool, stepdown)
    levels = np.linspace(stock_top, height, math.ceil((stock_top - height) / stepdown - 1e-9) + 1)[1:]
    step = _step_mm(work, tool, operation.stepover_mm)
    rpm, feed = work.speeds(tool, is_rough=True)
    writer = None
    for level in levels:
        for a, b in _strokes(work, tool, step):
            writer = writer or MoveWriter(np.r_[a, work.clearance_z_mm])
            writer.rapid((*a, work.clearance_z_mm))
            writer.rapid((*a, level))
            writer.feed((*b, level), feed)
            writer.rapid((*b, work.clearance_z_mm))
    facts = {"allowance_mm": allowance_mm, "height_mm": round(height, 6), "levels": len(levels), "stepover_mm": round(step, 6),
             "stepdown_mm": round(float((stock_top - height) / len(levels)), 6), "candidates": []}
    return work.measured(operation.title, tool, rpm, writer.moves(), facts), height


def within_inserts_mm(operation, tool, stepdown_mm):
    """A stepdown that a face mill's inserts can take.

    Raises:
        PlanError: a deeper one is asked for.
    """
    deepest = tool.cutter.flute_length_mm
    if operation.stepdown_mm is not None and operation.stepdown_mm > deepest:
        raise PlanError(f"{operation.title}: stepdown_mm {operation.stepdown_mm:g} is more than the inserts of T{tool.number} "
                        f"{tool.cutter.name} cut, {deepest:g} mm: lower it")
    return min(stepdown_mm, deepest)


def _over(work):
    """Places (n, 2) all over the stock."""
    lines = [np.linspace(work.stock_min_mm[k], work.stock_max_mm[k], 64) for k in (0, 1)]
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)


def _step_mm(work, tool, asked_mm):
    """Stepover under the cutter's flat.

    Raises:
        PlanError: what is asked for leaves ridges.
    """
    flat = FLAT_SHARE * 2 * (tool.cutter.radius_mm - tool.cutter.corner_radius_mm)
    if asked_mm is not None and asked_mm > flat:
        raise PlanError(f"{work.operation.title}: stepover_mm {asked_mm:g} leaves ridges: the flat of T{tool.number} "
                        f"{tool.cutter.name} covers {flat:g} mm; lower it")
    return min(work.practice.facing_share * tool.cutter.diameter_mm if asked_mm is None else asked_mm, flat)


def _strokes(work, tool, step_mm):
    """[(start, end)] in plan, (2,) each: lines across the stock, all the same way, beginning and ending beside it."""
    bearing = Bearing(angle_rad=math.radians(work.operation.angle_deg))
    corners = np.array([(x, y) for x in (work.stock_min_mm[0], work.stock_max_mm[0])
                        for y in (work.stock_min_mm[1], work.stock_max_mm[1])])
    along, across = fixed.matmul(corners, bearing.along), fixed.matmul(corners, bearing.across)
    beside = (tool.cutter.largest_radius_mm if tool.cutter.type == "face_mill" else tool.cutter.radius_mm) + BESIDE_MM
    # the first line takes one stepover of stock, its cutter hanging over the edge
    first = float(across.min()) + step_mm - tool.cutter.radius_mm
    count = max(1, math.ceil((float(across.max()) - first - tool.cutter.radius_mm) / step_mm - 1e-9) + 1)
    for k in range(count):
        c = first + k * step_mm
        yield (float(along.min() - beside) * bearing.along + c * bearing.across,
               float(along.max() + beside) * bearing.along + c * bearing.across)


@dataclass(frozen=True, eq=False, kw_only=True)
class FloorCutter:
    """Who finishes level faces in place of a ball, and upright walls that stand on them."""

    tool: object                # shop.cutters.Tool, flat
    candidates: tuple
    levels: tuple[int, ...]     # indices of the level faces
    walls: tuple[int, ...]      # and of the walls: no higher than its flutes cut at once
    is_reached: np.ndarray      # (n,) bool: samples on them that it reaches, of all the operation's

    @property
    def faces(self):
        """Indices of all."""
        return (*self.levels, *self.walls)


def faster_floor_cutter(work, ball, change_s, by_balls=None):
    """FloorCutter of the operation's level faces, where a flat cutter with its change takes less time there than a ball, or comes
    to a foot of walls that lean, where balls leave their own radius.

    Args:
        work: PlanningContext.   ball: the Tool that would finish them.   change_s: of the flat cutter; 0: there is no ball then.
        by_balls: (n,) bool of the samples that balls would reach; None: they count for all.
    """
    levels = tuple(i for i in work.wanted if is_level(work.faces[i]))
    tools = work.library.of_type("flat")
    if not levels or not tools:
        return None
    upright = _walls_on(work, levels)
    faces = (*levels, *upright)
    mine = work.on(work.operation, faces, work.planned)
    tightest_mm = work.on(work.operation, upright, work.planned).hollow.radius_mm if upright else math.inf
    with suppress(CutterDoesNotFit):
        tool, candidates, reached = choose_cutter("floor", tools, mine.samples, tightest_mm, mine.reached_with,
                                                  work.finishing_work())
        highest = TERRACE_SHARE * tool.cutter.flute_length_mm
        walls = tuple(i for i in upright if _height_mm(work, i) <= highest)
        on = np.isin(work.samples.face, (*levels, *walls))
        is_reached = np.zeros(len(on), bool)
        is_reached[on] = reached[np.isin(mine.samples.face, (*levels, *walls))]
        is_floor, area = np.isin(work.samples.face, levels), work.samples.area_mm2
        seconds = lambda t: work.finishing_work().seconds(t, work.samples, is_reached & is_floor)
        more_mm2 = 0.0 if by_balls is None else area[is_reached & is_floor & ~by_balls].sum()
        if more_mm2 > FOOT_SHARE * area[is_floor].sum() or seconds(tool) + change_s < seconds(ball):
            return FloorCutter(tool=tool, candidates=candidates, levels=levels, walls=walls, is_reached=is_reached)
    return None


def is_level(face):
    """Whether a brep.Face is a plane across Z, seen from the spindle."""
    return face.kind == "plane" and face.middle.normal[0, 2] > LEVEL


def _walls_on(work, levels):
    """Indices of the operation's upright faces that end on one of its level ones."""
    heights = {round(float(work.faces[i].middle.point_mm[0, 2]) / SAME_MM) for i in levels}
    others = work.samples.leaning_faces(UPRIGHT) | set(levels)
    return tuple(i for i in work.wanted if i not in others and round(float(
        bounding_box_mm(work.faces[i].shape)[0][2]) / SAME_MM) in heights)


def _height_mm(work, index):
    low, high = bounding_box_mm(work.faces[index].shape)
    return float(high[2] - low[2])


def floors(work, tool, candidates, stock):
    """Level faces finished, height by height from the top.

    Args:
        work: PlanningContext of a floor operation.   tool: flat or bull nose.   candidates: for plan.json.
        stock: function of places (n, 2) to the heights (n,) that stand there.
    Raises:
        PlanError: none of its faces is level, or the cutter comes to none of them.
    """
    heights = _heights(work)
    tolerance, operation = path_tolerance_mm(work.finish), work.operation
    step = _step_mm(work, tool, operation.stepover_mm)
    rpm, feed = work.speeds(tool, is_rough=False)
    left, made = work.standing_mm(tool, stock), []
    for height, faces in heights:
        field = _region(work, tool, faces)
        if field is None:
            continue
        tip_z = height + operation.allowance_mm
        paths = _held_up(_side_by_side(field, step, tolerance), tip_z, tolerance) + _along_walls(field, tip_z, tolerance)
        if paths:
            rules = replace(link_rules(work, tool, field, tolerance, step, feed, left), heights=stock, least_z_mm=tip_z)
            made.append(moves_of_tip_paths(paths, rules))
    if not made:
        raise PlanError(f"{operation.title}: T{tool.number} {tool.cutter.name} comes to none of the level faces "
                        f"{work.face_names}: choose a smaller one")
    facts = {"allowance_mm": operation.allowance_mm, "scallop_mm": 0.0, "segment_tolerance_mm": tolerance,
             "stepover_mm": round(step, 6), "heights_mm": [round(h, 6) for h, _ in heights], "links": operation.passes,
             "strategy": operation.kind, "candidates": [c.as_dict() for c in candidates]}
    return work.measured(operation.title, tool, rpm, Moves.joined(made), facts)


def _heights(work):
    """[(height, indices of the level faces there)], from the top."""
    found = {}
    for i in work.wanted:
        face = work.faces[i]
        if face.kind == "plane" and face.middle.normal[0, 2] > LEVEL:
            found.setdefault(round(float(face.middle.point_mm[0, 2]) / SAME_MM), []).append(i)
    if not found:
        raise PlanError(f"{work.operation.title}: none of the faces {work.face_names} is a level plane seen from the spindle: "
                        "floor is for these")
    return [(float(work.faces[found[k][0]].middle.point_mm[0, 2]), found[k]) for k in sorted(found, reverse=True)]


class FloorDropper(Dropper):
    """A dropper that says of a flat which lies on a floor and on the rims of what is let into it: it touches the floor.

    Where it touches a face that runs smoothly out of the floor at the floor's height, it lies on the rim between them.  Beyond the
    floor's box, where its rim alone lies on it, it touches an edge as before.
    """

    def __init__(self, dropper, face, smooth, tip_z_mm, box_mm):
        """
        Args:
            dropper: Dropper of the cutter.   face: index of the floor.   smooth: those of faces that it runs smoothly into.
            tip_z_mm: of a tip on it.   box_mm: ((2,), (2,)) lowest and highest x, y of the floor.
        """
        self.radius_mm, self.corner_radius_mm = dropper.radius_mm, dropper.corner_radius_mm
        self.allowance_mm, self._dropper, self._face, self._smooth, self._tip_z_mm, self._box = (
            dropper.allowance_mm, dropper, face, list(smooth), tip_z_mm, box_mm)

    def tips_mm(self, xy_mm):
        return self._dropper.tips_mm(xy_mm)

    def contacts(self, xy_mm):
        found, (low, high) = self._dropper.contacts(xy_mm), self._box
        is_on = np.abs(found.tip_z_mm - self._tip_z_mm) <= ON_IT_MM
        at_rim = is_on & ~found.is_edge & np.isin(found.face, self._smooth)
        found = replace(found, is_edge=found.is_edge | at_rim, beside=np.where(at_rim, self._face, found.beside))
        lies = found.is_edge & is_on & ((xy_mm >= low) & (xy_mm <= high)).all(axis=1) & found.touches_rim([self._face])
        normal = np.where(lies[:, None], (0.0, 0.0, 1.0), found.normal)
        return replace(found, face=np.where(lies, self._face, found.face), normal=normal, is_edge=found.is_edge & ~lies,
                       beside=np.where(lies, NO_FACE, found.beside))


def _region(work, tool, faces):
    """TipField of the cutter over some faces at one height; None where it touches none of them."""
    boxes = [bounding_box_mm(work.faces[i].shape) for i in faces]
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    dropper = work.dropper_with(tool, work.operation.allowance_mm)
    tip_z = float(work.faces[faces[0]].middle.point_mm[0, 2]) + work.operation.allowance_mm
    for i, (first, last) in zip(faces, boxes):
        smooth = {n.index for n in work.neighbours[i] if abs(n.sine) <= SMOOTH_SINE}
        dropper = FloorDropper(dropper, i, smooth, tip_z, (first[:2], last[:2]))
    radius = tool.cutter.radius_mm
    try:
        field = tip_field(dropper, faces, (low[:2], high[:2]), PITCH_SHARE * radius, OVER_SHARE * radius)
    except ToolpathError:
        return None
    return _beside_strips(field, work.samples.point_mm[np.isin(work.samples.face, faces), :2], tip_z)


def _beside_strips(field, places, tip_z_mm):
    """The field with where the cutter stands beside a floor that is narrower, along a wall, than its radius: as little as it can.

    Args:
        field: TipField.   places: (n, 2) samples of its floors.   tip_z_mm: of a tip on them.
    """
    bare = places[cKDTree(field.node_xy_mm[field.is_inside]).query(places)[0] > field.dropper.radius_mm]
    beside = ~field.is_inside & field.is_edge & (np.abs(field.tip_z_mm - tip_z_mm) <= ON_IT_MM)
    if not len(bare) or not beside.any():
        return field
    beside[beside] = field.dropper.contacts(field.node_xy_mm[beside]).touches_rim(field.wanted)
    nodes = field.node_xy_mm[beside]
    away, near = cKDTree(places).query(nodes)[0], cKDTree(nodes)
    least = np.full(len(nodes), -np.inf)        # how far off the floor the nearest stands that comes to the places it comes to
    for place in bare:                          # one by one: all their nodes together may be many
        rows = near.query_ball_point(place, field.dropper.radius_mm)
        least[rows] = np.maximum(least[rows], away[rows].min(initial=np.inf))
    taken = np.zeros(beside.shape, bool)
    taken[beside] = away <= least + STRIP_PITCHES * field.pitch_mm
    beyond = np.minimum(field.beyond_mm, np.maximum(distance_transform_edt(~taken) - 1.0, 0.0) * field.pitch_mm)
    return replace(field, beyond_mm=beyond, is_inside=field.is_inside | (beside & (beyond < field.run_over_mm)))


def _side_by_side(field, step_mm, tolerance_mm):
    """Lines along x over the region, a stepover apart."""
    nodes = field.node_xy_mm[field.is_inside]
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    if high[1] - low[1] > 2 * ASIDE_MM:         # a line along the wall itself would be on it here and beside it there
        low[1], high[1] = low[1] + ASIDE_MM, high[1] - ASIDE_MM
    count = max(1, math.ceil((high[1] - low[1]) / step_mm))
    along = lambda *ys: tip_paths([PlaneCurve(xy_mm=np.array([(low[0] - field.pitch_mm, y), (high[0] + field.pitch_mm, y)]))
                                   for y in ys], field, PathRules(tolerance_mm=tolerance_mm, lateral_mm=0.0, bridge_mm=0.0))
    ys = np.linspace(low[1], high[1], count + 1)
    paths = along(*ys)
    for k in sorted({p.curve for p in paths}):
        if _hops([p for p in paths if p.curve == k]):
            tried = (along(ys[k] + aside) for aside in (ASIDE_MM, -ASIDE_MM, 2 * ASIDE_MM, -2 * ASIDE_MM))
            if again := next((some for some in tried if some and not _hops(some)), ()):
                paths = [p for p in paths if p.curve != k] + [replace(p, curve=k) for p in again]
    return sorted(paths, key=lambda p: p.curve)


def _held_up(paths, tip_z_mm, tolerance_mm):
    """The same TipPaths over gaps hardly wider than the cutter, into which they would sink: a floor there has its own passes."""
    raised = [np.maximum(p.tips_mm, (-np.inf, -np.inf, tip_z_mm)) for p in paths]
    return [p if (tips == p.tips_mm).all() else replace(p, tips_mm=_straightened(tips, tolerance_mm))
            for p, tips in zip(paths, raised)]


def _hops(paths):
    """Whether parts of one pass follow each other closely, or leave its height: its line is on a wall here, beside it there."""
    ends = sorted(tuple(sorted(p.tips_mm[[0, -1], 0].tolist())) for p in paths)
    return (any(later - end < HOP_MM for (_, end), (later, _) in zip(ends, ends[1:]))
            or any(np.ptp(p.tips_mm[:, 2]) > ON_IT_MM for p in paths))


def _along_walls(field, height_mm, tolerance_mm):
    """Once round what stands above the floor, as near as the cutter comes."""
    low, high = field.node_xy_mm[0, 0], field.node_xy_mm[-1, -1]
    z = height_mm + tolerance_mm / 2            # where the loop has a place
    drops = DropHeights(tips_at=field.dropper.tips_mm)
    lines = waterlines(drops, [z], low, high, pitch_mm=field.pitch_mm, chord_mm=tolerance_mm / 2)
    found = []
    for k, line in enumerate(lines):
        is_near = field.is_near(line.tip_mm[:, :2])
        if is_near.all():
            tips = np.vstack([line.tip_mm, line.tip_mm[:1]]) if line.is_closed else line.tip_mm
            found.append(TipPath(tips_mm=_straightened(tips, tolerance_mm), is_closed=line.is_closed, curve=k))
            continue
        begin = int(np.argmin(is_near)) if line.is_closed else 0        # a loop is opened where it is off the floor
        tips, is_near = np.roll(line.tip_mm, -begin, axis=0), np.roll(is_near, -begin)
        found += [TipPath(tips_mm=_straightened(tips[a:b], tolerance_mm), is_closed=False, curve=k)
                  for a, b in runs_of(is_near) if b - a > 1]
    return found


def _straightened(tips, tolerance_mm):
    """Fewer of them: the crossings of the grid's lines stand in no relation to how the wall bends."""
    return tips[straight_rows(tips, STRAIGHT_SHARE * tolerance_mm)]
