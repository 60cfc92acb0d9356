"""Which indexed positions see what of some faces: fewest directions from which a ball of the shop finishes most of them.

A place is seen from a direction where its normal leans no more than a limit from it, a ball touches it without meeting the part
anywhere else, holder, shank and spindle keep clear, the whole tool of the machine's tables and the fixtures too, and the machine
can turn there and go to all that is seen, with what carries the spindle.  Directions are taken greedily, the one that adds most
area first.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.design.fixtures import placed
from cuspline.kernel import brep
from cuspline.planning.context import MESH_DEFLECTION_MM
from cuspline.planning.cutter_choice import TOUCH_MM
from cuspline.planning.tool_depth import CLEARANCES_MM, HOLDER_CLEARANCE_MM
from cuspline.replay.clearance import ClearanceTree
from cuspline.replay.machine_bodies import beside_the_spindle, round_the_spindle, together, turned_to, what_holds
from cuspline.shop.cutters import ToolLibrary
from cuspline.shop.kinematics import LINEARS
from cuspline.shop.rotary_way import shortest_way
from cuspline.surfaces.curvature import sample_faces
from cuspline.toolpaths.five_axis.clear_axes import AxisSearch
from cuspline.toolpaths.five_axis.head_room import HeadRoom
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import CutterDoesNotFit, PostError
from cuspline.values.frames import Frame

RING_DEG = 20.0             # between directions
CLOSER_DEG = 10.0           # between those that are tried for what these leave
LEAST_LEFT_MM2 = 0.5        # then: a direction that adds less is not worth its turn
LOOKED_AT = 5000            # places of the faces, spread over their samples, unless others are asked for
LEAST_SHARE = 1e-3          # of the area: a direction that adds less is not worth its turn
NEARLY_ALL = 0.99           # of what a direction adds: the largest ball that sees so much is named
SEED = 20
NEARLY = 1e-9               # of a cosine: a place on the border counts
BALL_MIDDLE = np.zeros((1, 5))      # as a segment of replay/clearance.py
UP = (0.0, 0.0, 1.0)
AS_IT_LIES = Frame.of_axes(np.zeros(3), (1, 0, 0), (0, 0, 1))
ENDS_MM = 5.0               # of X, Y and Z, that paths keep from: they go a little beyond the places that are looked at
UNIT_DECIMALS = 11          # of directions: unit vectors as a setup takes them


@dataclass(frozen=True, eq=False, kw_only=True)
class Position:
    """One direction of the tool, from its tip to its holder, part coordinates."""

    direction: np.ndarray       # (3,) unit
    tool: object                # Tool: the largest ball that sees nearly all that is added here
    sees_mm2: float
    adds_mm2: float             # to what the positions before it see
    held: object = None         # Held: the clamping in which it is taken; None: no machine was named

    @property
    def axes(self):
        """`axes_along` its direction."""
        return axes_along(self.direction)


@dataclass(frozen=True, eq=False, kw_only=True)
class Positions:
    """Positions in the order in which they add most, and what none of them sees."""

    positions: tuple
    area_mm2: float
    left_mm2: float
    left_at_mm: np.ndarray      # (3,) a place in the middle of what is left; NaN: nothing is


def positions(solid, indices, library, *, ways=None, steepest_deg=60.0, standing_mm=0.0,
              finely=(LOOKED_AT, None, None)):
    """Few positions that see most of some faces.

    Args:
        solid: TopoDS solid.   indices: of its faces, in its own order.   library: ToolLibrary; its balls count.
        ways: (n, 3) unit directions to choose from, part coordinates, see `turnable`; or Held: those of a part on a machine, whose
            spindle and tables are in the way; or a tuple of these, of clampings on one machine; None: `directions`.
        steepest_deg: between a place's normal and the direction, at the most.
        standing_mm: material that may still stand on the part, which holder and shank keep clear of.
        finely: places of the faces that are looked at, at the most; the mesh that tools keep clear of, None: MESH_DEFLECTION_MM
            off the part; None or (places, steepest_deg) of a second look at what these positions leave: directions CLOSER_DEG apart
            are tried for it until none adds LEAST_LEFT_MM2; `ways` are of Held then.
    Returns:
        Positions; what is left is that of the last look.
    Raises:
        CutterDoesNotFit: the library has no ball.
    """
    candidates = _candidates(ways)
    held = candidates[0][1] if candidates else None
    balls = (library if held is None else library.in_spindle(round_the_spindle(held.machine))).of_type("ball")
    if not balls:
        raise CutterDoesNotFit("no position sees anything: the tool library has no ball; add one to the file of --cutters")
    places, meshed, closer = finely
    meshed = meshed or brep.planning_mesh(solid, MESH_DEFLECTION_MM)
    mesh = meshed.vertices_mm, meshed.triangles
    tree = ClearanceTree.of_triangles(*mesh)
    look = _Look.at(_some_samples(solid, indices, places), balls, mesh, tree, standing_mm)
    area = look.samples.area_mm2
    found, left = look.chosen(candidates, np.ones(len(area), bool), steepest_deg, LEAST_SHARE * float(area.sum()))
    if closer is not None:
        more, steepest_deg = closer
        look = _Look.at(_some_samples(solid, indices, more), balls, mesh, tree, standing_mm)
        left = ~look.seen([(p.direction, p.held) for p in found], steepest_deg).any(axis=(0, 1))
        again = [(way, h) for h in _helds(ways) for way in turnable(directions(CLOSER_DEG), h.machine.kinematics, h.frame)]
        added, left = look.chosen(again, left, steepest_deg, LEAST_LEFT_MM2)
        found += added
    area = look.samples.area_mm2
    return Positions(positions=tuple(found), area_mm2=float(area.sum()), left_mm2=float(area[left].sum()),
                     left_at_mm=_middle_of(look.samples.point_mm[left]))


def _helds(ways):
    """(Held, ...) of the `ways` of `positions`."""
    return ways if isinstance(ways, tuple) else (ways,)


def _candidates(ways):
    """[((3,) direction, Held or None)] of the `ways` of `positions`."""
    if isinstance(ways, (Held, tuple)):
        return [(way, held) for held in _helds(ways) for way in held.ways]
    return [(way, None) for way in (directions() if ways is None else ways)]


@dataclass(frozen=True, eq=False, kw_only=True)
class Held:
    """A part on a machine with rotaries."""

    machine: object             # Machine
    frame: Frame                # of the clamping's WCS, seen from the part
    ways: np.ndarray            # (n, 3) unit directions, part coordinates, that it turns to
    fixtures: tuple = ()        # of design.fixtures

    @classmethod
    def on(cls, machine, frame, fixtures=()):
        """All directions that the machine turns to."""
        return cls(machine=machine, frame=frame, ways=turnable(directions(), machine.kinematics, frame), fixtures=fixtures)

    def goes_to(self, turned_rad, tips_mm, length_mm):
        """Whether X, Y and Z reach all tips (n, 3), part coordinates, of a tool so long, ENDS_MM to spare, its rotaries at (r,)."""
        chain, tips = self.machine.kinematics, self.frame.into(tips_mm) + self.machine.wcs_origin_mm
        linear = slice(0, LINEARS)
        joints = chain.placed(tips, np.tile(turned_rad, (len(tips), 1)), length_mm)[:, linear]
        return bool(((joints >= chain.low[linear] + ENDS_MM) & (joints <= chain.high[linear] - ENDS_MM)).all())

    def comes_to(self, way, turned_rad, tools, standing, keep_mm):
        """Whether X, Y and Z reach all tips of tools along `way` (3,), with room for what carries the spindle.

        Args:
            turned_rad: (r,) where the rotaries stand then.   tools: [((n, 3) tips, part coordinates, length in mm)].
            standing, keep_mm: see `head_room`.
        """
        if not all(self.goes_to(turned_rad, tips, length) for tips, length in tools):
            return False
        room = self.head_room(turned_rad, way, standing, keep_mm)
        return room is None or all(room.is_free(tips + length * way) for tips, length in tools)

    def beside_at(self, turned_rad):
        """(vertices, triangles) of fixtures and what turns with the part or carries it, part coordinates, the rotaries at (r,);
        None: there is nothing."""
        return what_holds(self.machine, turned_rad, AS_IT_LIES, self.frame, placed(self.fixtures, self.frame, AS_IT_LIES))

    def head_room(self, turned_rad, way, standing, keep_mm):
        """HeadRoom over meshes of what stands, or None where the machine has nothing beside the spindle.

        Args:
            turned_rad: (r,) where the rotaries stand with the tool along `way` (3,).
            standing: [((v, 3) vertices, (t, 3) triangles)], part coordinates.   keep_mm: between head and meshes.
        """
        head = beside_the_spindle(self.machine, turned_rad, self.frame)
        return head and HeadRoom(way, together(standing), head, keep_mm)


def ways_with_room(asked, held, ball, meshed, standing_mm):
    """[(3,) or None]: of each question the first direction from which a ball comes to its places, tool and head clear.

    Args:
        asked: [((n, 3) middles of the ball, [(3,) unit directions])], part coordinates.
        held: Held.   ball: Tool.   meshed: brep mesh of the part, see `brep.planning_mesh`.   standing_mm: that stands on it.
    """
    part = meshed.vertices_mm, meshed.triangles
    tool, = ToolLibrary(tools=(ball,)).in_spindle(round_the_spindle(held.machine)).tools
    search = AxisSearch.of_tool(ClearanceTree.of_triangles(*part), tool, keep_mm=CLEARANCES_MM + standing_mm)

    def has_room(way, middles):
        if not len(turnable(way[None], held.machine.kinematics, held.frame)):
            return False
        turned, tips = turned_to(held.machine, held.frame, way), middles - ball.cutter.radius_mm * way
        holds = held.beside_at(turned)
        beside = search.with_beside(holds and ClearanceTree.of_triangles(*holds), tool, CLEARANCES_MM)
        standing = [part] if holds is None else [part, holds]
        return (bool(beside.is_clear(middles, np.broadcast_to(way, middles.shape)).all())
                and held.comes_to(way, turned, [(tips, ball.length_mm)], standing, standing_mm + HOLDER_CLEARANCE_MM))

    return [next((way for way in ways if has_room(way, middles)), None) for middles, ways in asked]


def directions(apart_deg=RING_DEG):
    """(n, 3) unit vectors on rings about Z, so far apart or less, the poles and the main directions among them."""
    found = [np.eye(3), -np.eye(3)]
    rings = np.radians(np.arange(apart_deg, 180.0, apart_deg))
    for polar in rings:
        count = int(np.ceil(360.0 / apart_deg * fixed.sin(polar) - 1e-9))
        around = 2 * np.pi * np.arange(count) / count
        found.append(np.column_stack([fixed.sin(polar) * fixed.cos(around), fixed.sin(polar) * fixed.sin(around),
                                      np.full(count, fixed.cos(polar))]))
    return np.vstack(found)


def axes_along(direction):
    """(wcs_x, wcs_z) of a setup whose tool stands along a direction (3,), as it takes them: rounded, so that they can be pasted."""
    frame = Frame.along(direction)
    return tuple(tuple((np.round(v, UNIT_DECIMALS) + 0.0).tolist()) for v in (frame.rotation[:, 0], frame.rotation[:, 2]))


def turnable(ways, chain, clamped):
    """Those of directions (n, 3), part coordinates, that a machine's rotaries reach.

    Args:
        chain: shop.kinematics.Chain; None: all of them.
        clamped: Frame of the clamping, seen from the part; None: as the part lies.
    """
    if chain is None:
        return ways
    seen = ways if clamped is None else clamped.turn_into(ways)
    return ways[[_is_reached(chain, way) for way in seen]]


def _is_reached(chain, way):
    try:
        shortest_way(chain, way[None])
    except PostError:
        return False
    return True


def _some_samples(solid, indices, most):
    """FaceSamples of the faces, at most so many, areas raised to stand for all."""
    samples = sample_faces(brep.faces_of(solid), indices, across_axis=2)
    count = len(samples.area_mm2)
    pick = np.sort(np.random.default_rng(SEED).permutation(count)[:most])
    raised = samples.area_mm2.sum() / samples.area_mm2[pick].sum()
    part = {name: getattr(samples, name)[pick] for name in ("point_mm", "normal", "hollow_per_mm", "across_per_mm", "face")}
    return replace(samples, area_mm2=samples.area_mm2[pick] * raised, **part)


@dataclass(frozen=True, eq=False)
class _Ball:
    """A ball on its tool, where it touches the places that are looked at."""

    search: AxisSearch
    beside: AxisSearch          # of what holds the part, which flutes do not touch either
    length_mm: float
    middles_mm: np.ndarray      # (n, 3)
    fits: np.ndarray            # (n,) bool: the ball alone meets the part nowhere else

    @classmethod
    def of_tool(cls, tool, tree, samples, standing_mm):
        radius = tool.cutter.radius_mm
        middles = samples.point_mm + radius * samples.normal
        away = tree.distances_mm(BALL_MIDDLE, middles, np.broadcast_to(UP, middles.shape), TOUCH_MM / 10)
        searches = (AxisSearch.of_tool(tree, tool, into_mm=into, keep_mm=standing_mm + CLEARANCES_MM)
                    for into in (TOUCH_MM, -HOLDER_CLEARANCE_MM))
        return cls(*searches, tool.length_mm, middles, away >= radius - TOUCH_MM)

    def tips_mm(self, way, rows):
        """(k, 3) with its tool along a direction (3,), at some of the places."""
        return self.middles_mm[rows] - self.search.radius_mm * way

    def seen_from(self, way, is_gentle, beside=None):
        """(n,) bool: which of places (n,) that lean little enough it finishes with its tool along a direction (3,).

        `beside` is a ClearanceTree of what holds the part.
        """
        is_seen = is_gentle & self.fits
        if beside is not None:
            middles = self.middles_mm[is_seen]
            away = beside.distances_mm(BALL_MIDDLE, middles, np.broadcast_to(UP, middles.shape), TOUCH_MM / 10)
            is_seen[is_seen] = away >= self.search.radius_mm + HOLDER_CLEARANCE_MM
        for search in (self.search, *(() if beside is None else (replace(self.beside, tree=beside),))):
            middles = self.middles_mm[is_seen]
            is_seen[is_seen] = search.is_clear(middles, np.broadcast_to(way, middles.shape))
        return is_seen


@dataclass(frozen=True, eq=False)
class _Look:
    """Places of the faces, and balls where they touch them."""

    samples: object             # FaceSamples
    balls: list                 # Tools
    on_tools: list              # _Ball of each
    mesh: tuple                 # (vertices, triangles) of the part
    standing_mm: float          # on it

    @classmethod
    def at(cls, samples, balls, mesh, tree, standing_mm):
        """`tree`: ClearanceTree of the mesh."""
        return cls(samples, balls, [_Ball.of_tool(tool, tree, samples, standing_mm) for tool in balls], mesh, standing_mm)

    def seen(self, candidates, steepest_deg, wanted=None):
        """(candidates, balls, n) bool: who sees which places; of those that are not wanted (n,) none is asked."""
        found = np.zeros((len(candidates), len(self.balls), len(self.samples.area_mm2)), bool)
        steep = fixed.cos(np.radians(steepest_deg)) - NEARLY
        for k, (way, held) in enumerate(candidates):
            gentle = fixed.matmul(self.samples.normal, way) >= steep
            gentle = gentle if wanted is None else gentle & wanted
            if gentle.any():
                if held is None:
                    found[k] = [ball.seen_from(way, gentle) for ball in self.on_tools]
                    continue
                turned = turned_to(held.machine, held.frame, way)
                holds = held.beside_at(turned)
                beside = holds and ClearanceTree.of_triangles(*holds)
                found[k] = [ball.seen_from(way, gentle, beside) for ball in self.on_tools]
                found[k] &= self._comes_to(found[k], way, held, turned, holds)
        return found

    def _comes_to(self, seen, way, held, turned_rad, holds):
        """Whether the machine goes to all places that balls see (balls, n), and has room there for what carries its spindle."""
        tools = [(ball.tips_mm(way, rows), ball.length_mm) for ball, rows in zip(self.on_tools, seen)]
        standing = [self.mesh] if holds is None else [self.mesh, holds]
        return held.comes_to(way, turned_rad, tools, standing, self.standing_mm + HOLDER_CLEARANCE_MM)

    def chosen(self, candidates, left, steepest_deg, least_mm2):
        """([Position], (n,) bool: places that they leave), greedily, of places that are left (n,) bool.

        Args:
            least_mm2: a direction that adds less is not taken.
        """
        seen, area, found = self.seen(candidates, steepest_deg, None if left.all() else left), self.samples.area_mm2, []
        by_any, left = seen.any(axis=1), left.copy()
        while candidates:
            adds = np.array([area[sees & left].sum() for sees in by_any])
            best = int(adds.argmax())
            if adds[best] < least_mm2:
                break
            found.append(self._position(candidates[best], seen[best], by_any[best] & left))
            left &= ~by_any[best]
        return found, left

    def _position(self, candidate, sees, new):
        """Position of a candidate whose balls see places (balls, n) and add some (n,)."""
        area, (direction, held) = self.samples.area_mm2, candidate
        adds, of_ball = area[new].sum(), np.array([area[own & new].sum() for own in sees])
        enough = np.flatnonzero(of_ball >= NEARLY_ALL * adds)
        largest = max(enough if len(enough) else [int(of_ball.argmax())], key=lambda k: self.balls[k].cutter.diameter_mm)
        return Position(direction=direction, tool=self.balls[largest], sees_mm2=float(area[sees.any(axis=0)].sum()),
                        adds_mm2=float(adds), held=held)


def _middle_of(points_mm):
    """(3,) of points (n, 3) the one nearest to their mean; NaN where there is none."""
    if not len(points_mm):
        return np.full(3, np.nan)
    away = ((points_mm - points_mm.mean(axis=0)) ** 2).sum(axis=1)
    return points_mm[away.argmin()]
