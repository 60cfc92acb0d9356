r"""What `Auto` gives to operations of their own before roughing: holes reamed, drilled or bored, slots and pockets.

        _    ___      ____    each is tried as it would be planned; what is refused is left to the next of them, in the
       | |  |   |    |  __    end to roughing, balls and flat cutters, whose operations then say why (`instead_of`)
       |_|  |_ _|    |_|
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from cuspline.planning.boring import borable_faces
from cuspline.planning.context import path_tolerance_mm
from cuspline.planning.contouring import CURVE_SHARE
from cuspline.planning.drilling import drillable_faces, upright_holes
from cuspline.planning.level_finishing import UPRIGHT, is_level
from cuspline.planning.pocketing import NARROWER_MM
from cuspline.planning.reaming import reamable_faces
from cuspline.planning.slotting import middles_of
from cuspline.planning.strategies.bore import Bore
from cuspline.planning.strategies.contour import Contour
from cuspline.planning.strategies.drill import Drill
from cuspline.planning.strategies.pocket import Pocket
from cuspline.planning.strategies.ream import Ream
from cuspline.planning.strategies.slot import Slot
from cuspline.surfaces.prismatic_features import SMOOTH_SINE, features_of
from cuspline.toolpaths.prismatic.upright_walls import upright_walls
from cuspline.values.amounts import counted
from cuspline.values.errors import PlanError, ToolpathError

CLEARED = ("pocket", "open pocket")
LONG = 1.0                  # times its width, that a slot's middle is at least
LONG_RING = 10.0           # the same of a ring's middle: a shorter one is a pocket round a boss
SLOT_WALLS = 6              # two long ones, what closes its ends
LOWER_MM = 1e-3             # than the rim: an island whose top the pocket's floor finishing takes with it
SAID = 3                    # reasons that are written out, each of another operation
SUNK_MM = 2.0               # of stock over its rim, at least, that a slot or pocket waits for: what a sawn blank has there is less


@dataclass(frozen=True, eq=False, kw_only=True)
class Featured:
    """What has operations of its own so far."""

    operations: tuple = ()      # context.PlannedOperation
    taken: tuple = ()           # indices of the faces that these finish
    refused: tuple = ()         # (indices of faces, why an operation was not for them)
    rows: tuple = ()            # (indices of faces, (n,) bool of their samples that are reached); all are of those not among them

    def left(self, work):
        """Indices of a PlanningContext's faces that are not taken."""
        return [i for i in work.wanted if i not in set(self.taken)]

    def with_made(self, operations, taken, rows=None):
        """The same with more, which say what they stand for.   rows: (n,) bool of samples that are reached; None: all."""
        told = told_of(operations, self.why(taken))
        return replace(self, operations=(*self.operations, *told), taken=(*self.taken, *taken),
                       rows=self.rows if rows is None else (*self.rows, (tuple(taken), rows)))

    def reached(self, samples):
        """(n,) bool of samples on the faces that are taken."""
        reached = np.isin(samples.face, self.taken)
        for faces, rows in self.rows:
            reached[np.isin(samples.face, faces)] = rows
        return reached

    def with_refused(self, refused):
        return replace(self, refused=(*self.refused, *refused))

    def why(self, faces):
        """Why some faces are not made by what was tried before, the first reason of each operation: "" nothing was."""
        found = list(dict.fromkeys(why for mine, why in self.refused if set(mine) & set(faces)))
        titles = [why.partition(":")[0] for why in found]
        said = [why for k, why in enumerate(found) if titles[k] not in titles[:k]][:SAID]
        more = [f"and {counted(len(found) - len(said), 'more reason')}"] if len(found) > len(said) else []
        return "; ".join([*said, *more])


def told_of(operations, why):
    """PlannedOperation values that say in plan.json what they stand for; why: "" nothing."""
    if not why:
        return list(operations)
    before = [o.facts.get("instead_of") for o in operations]
    return [replace(o, facts={**o.facts, "instead_of": f"{b}; {why}" if b else why}) for o, b in zip(operations, before)]


def holes_made(work):
    """Featured of the holes that reamers, drills and helices make."""
    made = Featured()
    for operation, faces_for in ((Ream(), reamable_faces), (Drill(), drillable_faces)):
        walls, others, refused = faces_for(work, operation, made.left(work))
        made = made.with_refused(refused)
        if walls:
            more, _ = operation.plan(work.on(operation, walls, [*work.planned, *made.operations]))
            made = made.with_made(more, (*walls, *others))
    bored, refused = borable_faces(work, Bore(), made.left(work))
    if bored:
        more, _ = Bore().plan(work.on(Bore(), bored, [*work.planned, *made.operations]))
        made = made.with_made(more, bored)
    walls, others, _ = drillable_faces(work, Drill(), made.left(work), leaves_point=True)
    if walls:
        more, _ = Drill().plan(work.on(Drill(), walls, [*work.planned, *made.operations]))
        made = made.with_made(more, (*walls, *others))
    return made.with_refused(refused)


def is_prismatic(work):
    """Whether all faces of a PlanningContext are level or upright."""
    up = np.abs(work.samples.normal[:, 2])
    return bool(((up > 1.0 - UPRIGHT) | (up < UPRIGHT)).all())


def pockets_made(work, made, but=()):
    """The same Featured with slots, then pockets, of upright walls, deepest last, by smaller cutters where the usual ones do not
    get in, as holes that no drill makes; what neither can do stays for others.  `but`: indices of faces that wait."""
    made = _pockets_made(work, made, but)
    for one in work.with_smaller:
        if set(made.left(work)) <= set(but):
            break
        more = _pockets_made(one, _bored(one, made, but), but)
        made = more if more.operations != made.operations else made
    return made


def sunk_faces(work, left):
    """Indices of faces of slots, pockets and holes over whose rims more stands than they are deep, and of those let into them; []
    where nothing else is left.

    What stands there is cleared first: a cutter narrow enough for them would go through it in a gap as narrow, its shank behind it.
    """
    features, sunk = _cleared_features(work, set(left)), set()
    hollows = [(f.faces, _height_mm(work, f.faces[0]), f.size_mm) for f in features]
    hollows += [((*h.faces, *h.floor), float(h.mouth_mm[2]) - h.depth_mm, h.depth_mm) for h in upright_holes(work)
                if set(h.faces) <= set(left)]
    floors = {f.faces[0]: _height_mm(work, f.faces[0]) for f in features}
    for faces, low_mm, deep_mm in sorted(hollows, key=lambda row: (-row[1], row[0])):
        around = {n.index for i in faces for n in work.neighbours[i]} - set(faces)
        let_into = {k for k in around if floors.get(k, -math.inf) > low_mm}
        over = work.samples.point_mm[np.isin(work.samples.face, faces), :2]
        above_mm = float(work.stock_mm(over).max(initial=-math.inf)) - low_mm - deep_mm
        if sunk & let_into or not let_into and above_mm > max(deep_mm, SUNK_MM):
            sunk.update(set(faces) & set(left))
    return sorted(sunk) if sunk < set(left) else []


def _bored(work, made, but):
    bored, _ = borable_faces(work, Bore(), [i for i in made.left(work) if i not in set(but)])
    return tried(work, made, Bore(), bored)[0] if bored else made


def _pockets_made(work, made, but):
    slots, pockets = _slots_and_pockets(work, set(made.left(work)) - set(but))
    for slot in slots:
        made, is_made = tried(work, made, Slot(), slot)
        pockets += [] if is_made else [slot]
    by_cutter = {}
    for faces in pockets:
        by_cutter.setdefault(_widest_radius_mm(work, faces), []).append(faces)
    for radius in sorted(by_cutter, reverse=True):
        mine = by_cutter[radius]
        together, is_made = tried(work, made, Pocket(), [i for faces in mine for i in faces])
        if is_made or len(mine) == 1:
            made = together
            continue
        for faces in mine:
            made, _ = tried(work, made, Pocket(), faces)
    return made


def tried(work, made, operation, faces):
    """(Featured with an operation on some faces, or with the reason why not; whether it is made)."""
    try:
        more, rows = operation.plan(work.on(operation, faces, [*work.planned, *made.operations]))
    except (PlanError, ToolpathError) as error:
        return made.with_refused([(tuple(faces), str(error))]), False
    return made.with_made(more, tuple(faces), rows), True


def _slots_and_pockets(work, left):
    """([faces of a slot], [faces of a pocket]): upward ones, all of whose faces are among those that are left; highest first."""
    tops = [f for f in _features(work) if f.kind == "boss" and f.faces[0] in left and is_level(work.faces[f.faces[0]])]
    slots, pockets = [], []
    level = lambda f: _height_mm(work, f.faces[0])
    for feature in _cleared_features(work, left):
        rim = level(feature) + feature.size_mm - LOWER_MM
        islands = [t.faces[0] for t in tops if set(t.faces[1:]) <= set(feature.faces) and level(t) < rim]
        (slots if not islands and _is_slot(work, feature) else pockets).append([*feature.faces, *islands])
    return slots, pockets


def _features(work):
    return work.once("features", lambda: features_of(work.faces))


def _cleared_features(work, left):
    """Features that slots and pockets may make, all of whose faces are among those that are left; highest first."""
    found = [f for f in _features(work) if f.kind in CLEARED and is_level(work.faces[f.faces[0]]) and set(f.faces) <= left]
    return sorted(found, key=lambda f: (-_height_mm(work, f.faces[0]), f.faces[0]))


def _height_mm(work, floor):
    return float(work.faces[floor].middle.point_mm[0, 2])


def outline_faces(work, left):
    """Upright ones among some faces that stand on nothing: outlines and windows, all whose other neighbours fall away."""
    upright = set(left) - work.samples.leaning_faces(UPRIGHT)
    around = work.neighbours if 0 < len(upright) < len(left) else ()
    is_upright = lambda i: i in upright or bool(np.abs(work.faces[i].middle.normal[0, 2]) < UPRIGHT)
    return [i for i in sorted(upright) if around and all(n.sine < -SMOOTH_SINE or is_upright(n.index) for n in around[i])]


def contoured(work, made, walls):
    """(the same Featured with contours along walls that stand on nothing; whether any is made).

    One cutter for all of them where there is one, else each outline and each window by itself.
    """
    together, is_made = tried(work, made, Contour(), walls)
    if is_made:
        return together, True
    alone = made.with_refused(together.refused[len(made.refused):])
    for faces in _joined(work, walls):
        radius = _widest_radius_mm(work, faces)
        fitting = [t.number for t in work.library.of_type("flat") if t.cutter.radius_mm == radius]
        for operation in (Contour(), *(Contour(tool=n) for n in fitting[:1])):
            alone, is_alone = tried(work, alone, operation, faces)
            if is_alone:
                is_made = True
                break
    return alone, is_made


def _joined(work, walls):
    """[faces of walls that follow one another], those with the first face first."""
    around, left, found = work.neighbours, sorted(walls), []
    while left:
        mine, more = set(), [left[0]]
        while more:
            i = more.pop()
            mine.add(i)
            more += [n.index for n in around[i] if n.index in left and n.index not in mine]
        found.append(sorted(mine))
        left = [i for i in left if i not in mine]
    return found


def _walls(work, faces):
    """UprightWalls of a pocket's faces; [] where they do not all stand upright."""
    try:
        return upright_walls(work.faces, [i for i in faces if not is_level(work.faces[i])],
                             CURVE_SHARE * path_tolerance_mm(work.finish))
    except PlanError:
        return []


def _is_slot(work, feature):
    """Whether two long walls, or two circles, face each other, and hardly anything else is there."""
    if len(feature.faces) - 1 > SLOT_WALLS:
        return False
    middles = middles_of(_walls(work, feature.faces))
    if len(middles) != 1:
        return False
    path, width = middles[0].path, middles[0].width_mm
    return path.length_mm >= (LONG_RING if path.is_closed else LONG) * width


def _widest_radius_mm(work, faces):
    """Radius of the largest flat cutter that goes into a pocket's corners; 0: none does."""
    tightest = min((w.element.radius_mm for w in _walls(work, faces) if w.element.is_left), default=math.inf)
    return max((t.cutter.radius_mm for t in work.library.of_type("flat") if t.cutter.radius_mm <= tightest - NARROWER_MM),
               default=0.0)
