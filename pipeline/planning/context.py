"""What one setup's planning has at hand: the part's faces and mesh, the machine, the shop's tools and speeds."""

import math
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cuspline.design.design import by_clamping
from cuspline.design.fixtures import placed_fixtures
from cuspline.design.operations import Clearing, Finishing
from cuspline.kernel import brep
from cuspline.planning import feeds
from cuspline.planning.cutter_choice import ROUND, ball_reach, choose_cutter, cutter_reach
from cuspline.planning.finishing_chain import FinishingWork
from cuspline.planning.plating import in_metal, library_within_skin
from cuspline.planning.standing_skin import StandingSkin
from cuspline.planning.standing_stock import standing_tree
from cuspline.planning.tool_depth import (
    HOLDER_CLEARANCE_MM,
    ShortToolDropper,
    clear_tips_mm,
    is_clear_above,
    missing_stick_out_mm,
    missing_stick_outs_mm,
)
from cuspline.program.program import UPRIGHT, Kind, Moves
from cuspline.replay.clearance import ClearanceTree
from cuspline.replay.machine_bodies import bodies_with_part, round_the_spindle, together, turned_to, what_holds
from cuspline.shop.cutters import Tool
from cuspline.shop.materials import material_named
from cuspline.shop.practice import ShopFile
from cuspline.shop.presets import preset_of
from cuspline.stock.workpiece import Workpiece
from cuspline.surfaces.curvature import sample_faces, tightest_hollow
from cuspline.surfaces.patches import PatchSet
from cuspline.surfaces.prismatic_features import neighbours_of
from cuspline.surfaces.projection import ClosestTree
from cuspline.surfaces.sections import SectionPlane
from cuspline.surfaces.threaded_walls import faces_with_threads, threaded_walls
from cuspline.surfaces.trims import TrimSet
from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_tips_mm
from cuspline.toolpaths.drop.exact_drop import ExactPart, PartNear
from cuspline.toolpaths.drop.exact_dropper import EdgeNeighbours, ExactDropper
from cuspline.toolpaths.drop.patch_bounds import EVERYWHERE
from cuspline.toolpaths.five_axis.corner_contact import CornerContact
from cuspline.toolpaths.five_axis.leaning_moves import upright_again
from cuspline.toolpaths.five_axis.tool_axes import ClearingAxis, FastestAxis, LeadTilt, ToolAxis
from cuspline.toolpaths.roughing.stock_fields import NOT_COUNTED_ON, lines_of_moves, swept_by_lines
from cuspline.values import fixed_math as fixed
from cuspline.values.circles import rings_of
from cuspline.values.errors import CutterDoesNotFit, PlanError, ToolpathError
from cuspline.values.known import Known

MESH_DEFLECTION_MM = 0.01
OFF_MM = 0.1                # of the triangles from the faces, at the most: the mesher may miss what it is asked threefold
HELD_BY_MM = 0.05           # more than the verdict asks, off fixtures and tables: it judges paths with what they may be off
OFF_BODIES_MM = HOLDER_CLEARANCE_MM + HELD_BY_MM
FAR_MM = 1000.0             # beyond any stock
ROUNDING_MM = 1e-4          # kept back from the tolerances for the post's decimals
LOOK_SHARE, MOST_LOOKS = 0.2, 250       # of the radius between places at which the standing stock is looked up
DONE_RAY = 5.0              # times the cusp: farther it is not asked how much stands
ROUND_PLACES, ROUND_SHARES = 16, np.array([0.25, 0.5, 0.75, 1.0])      # round a place, where the standing stock is looked up
THIN_MM = 0.05              # of the needle that finds the part
STEEP_DEG = 65.0            # clean-up passes of a setup with several operations: walls beyond get waterlines
NEAR_RADII = 3.0            # of a cutter round the faces that a position cuts: what it may touch
MADE_AGAIN = "mesh", "as cast", "geometry", "clearance", "obstacles"       # what `let_go` forgets: 200 MB of a propeller
SIDES = "flat", "bull_nose"     # types of cutters whose sides stand upright
STEEPEST_RAMP_DEG = 44.9    # a preset's may be 90: straight down
AXIS = 1e-9                 # how exactly a tool axis must be the setup's Z


@dataclass(frozen=True, eq=False, kw_only=True)
class PlannedOperation:
    """One operation with everything that plan.json says of it."""

    name: str
    tool: Tool
    rpm: float
    coolant: str
    moves: Moves                # with capped feeds, in the part as it lies in its setup (`setup.turn`)
    facts: dict                 # numbers for plan.json
    cycles: tuple = ()          # drilling.DrillCycle that come to some of the moves
    tabs: tuple = ()            # design.tabs.Tab that it leaves
    engraving: object = None    # design.engravings.Engraving that it cuts
    edge_break: object = None   # design.edge_breaks.EdgeBreak that it leaves
    compensated: tuple = ()     # compensation.CompensatedContour that come to some of the moves
    passes: object = None       # pass_templates.TemplatedPasses that come to the moves; None: only the moves
    left: object = None         # Left; None: it cuts all that its cutter reaches
    rpm_changes: tuple = ()     # (move, spindle speed from there on)
    wishes: object = None       # Wishes; None: speed and feeds are as they are
    orders: tuple = ()          # the same passes in other orders, see tip_orders.other_orders; () once one is chosen

    @cached_property
    def swept_mm(self):
        """stock_fields.Lowest of its cutter, in the frame of its moves."""
        cutter = self.tool.simulated.cutter
        if self.tool.head is not None:      # a disc beside the spindle: nothing is counted on
            return NOT_COUNTED_ON
        leans, is_ball = (self.moves.axis != UPRIGHT).any(), cutter.type == "ball"
        if leans and cutter.corner_radius_mm == 0.0:
            return NOT_COUNTED_ON
        # the lowest places of a ball are those of the upright one; of a bull nose the ball in its middle is counted on
        moves = upright_again(self.moves, cutter.corner_radius_mm) if leans else self.moves
        if leans and not is_ball:
            return swept_by_lines(lines_of_moves(moves), cutter.corner_radius_mm, cutter.corner_radius_mm)
        lines = [line + (0.0, 0.0, cutter.point_height_mm) for line in lines_of_moves(moves)]   # beside the cone is not counted on
        return swept_by_lines(lines, cutter.radius_mm, cutter.corner_radius_mm)


@dataclass(frozen=True, eq=False, kw_only=True)
class Left:
    """Contacts that an operation leaves out since no tool axis clears them."""

    rows: np.ndarray            # (n,) bool of the operation's samples
    area_mm2: float
    reaching: object            # (diameter_mm, stick_out_mm) of a ball that would reach them, None: none does
    why: str                    # with its area, a place, and that cutter


@dataclass(frozen=True, eq=False, kw_only=True)
class Wishes:
    """How speed and feeds of an operation are to follow what its edges meet."""

    feed_mm_per_min: np.ndarray     # (n,) of its moves, before the machine's limits; 0 on rapids
    speed_m_per_min: float          # cutting speed
    is_speed_constant: bool
    is_fed_by_engagement: bool


@dataclass(frozen=True, kw_only=True)
class FinishingStage:
    """What an operation of finishing is called, and what it may leave."""

    name: str
    allowance_mm: float         # of material
    scallop_mm: float           # largest cusp


class PlanningContext:
    """What planning has at hand: of a setup, and (`of`) of one operation in it.

    Lengths in the part as it lies in this setup: `setup.turn` is that frame, the spindle stands along its Z.
    """

    def __init__(self, design, setup, machine, library, before=None, shop=ShopFile(), tolerance_share=1.0):
        """
        Args:
            design, setup, machine, library: see `plan.plan_setup`.
            before: stock.workpiece.Workpiece that earlier setups leave; None: the stock as it comes.
            shop: shop.practice.ShopFile.
            tolerance_share: of every profile tolerance, that paths keep to.
        """
        self.design, self.setup, self.machine, self.before = design, setup, machine, before
        self.plating_mm, self.given, self.magazine = design.finish.plating_mm, library, (library, *library.all_smaller)[-1]
        self.library = self._within_skin(library)
        self.shop, self.tolerance_share, self.planned, self._shared, self.only = shop, tolerance_share, (), Known(), None
        alone = setup.operations[0] if len(setup.operations) == 1 else None
        self.operation = alone if isinstance(alone, Finishing) else Finishing(steep_deg=STEEP_DEG)
        self.finish = _stricter(design.finish, Finishing(), tolerance_share)
        solid = brep.the_solid(design.solid, f"design {design.name}")
        self._faces_of_part = brep.faces_of(solid)
        self.solid = brep.seen_from(solid, setup.turn)
        self.faces = self._faces_of_part if self.solid is solid else brep.faces_of(self.solid)
        self.piece = before or Workpiece(blank=design.stock.shape)
        self.stock_min_mm, self.stock_max_mm = self.piece.box_in(setup.turn)
        self.fixtures = placed_fixtures(setup, setup.turn)
        self.material = material_named(design.material, shop.materials)
        self._mesh_of_part = mesh = design.once("planning mesh", lambda: brep.planning_mesh(solid, MESH_DEFLECTION_MM))
        self.triangles = mesh if self.solid is solid else replace(mesh, vertices_mm=setup.turn.into(mesh.vertices_mm))
        asked = [o.clearance_mm for o in setup.operations if o.clearance_mm is not None]
        self.clearance_mm = max([self.practice.clearance_mm, *asked])
        self.clearance_z_mm = float(max([self.stock_max_mm[2], *(f.box_mm[1][2] for f in self.fixtures)])) + self.clearance_mm
        self._look_at(setup.faces)

    def of(self, operation, planned):
        """The same for one operation of the setup, after those `planned` so far.

        Raises:
            PlanError: a tool axis that this setup has not, a finish looser than the design's.
        """
        mine = copy(self)
        mine.operation, mine.planned = operation, tuple(planned)
        mine.__dict__.pop("standing", None)
        axis = operation.tool_axis
        if isinstance(axis, ToolAxis):
            self._refuse_turning(operation)
        elif axis is not None and fixed.length(np.array(axis) - self.setup.wcs_z) > AXIS:
            raise PlanError(f"{self.setup.name}, {operation.title}: tool_axis {axis} is not the setup's Z "
                            f"{self.setup.wcs_z}: on three axes give the operation to a setup that is turned so")
        if isinstance(operation, Finishing):
            mine.finish = _stricter(self.design.finish, operation, self.tolerance_share)
        if operation.faces is not None or mine.plane is not self.plane:
            mine._look_at(mine.face_names)
        return mine

    def on(self, operation, wanted, planned):
        """As `of`, for some of this operation's faces alone, by their indices, at least one."""
        mine = self.of(operation, planned)
        mine.only = frozenset(wanted)
        mine._look_at(mine.face_names)
        return mine

    @property
    def with_smaller(self):
        """[the same with smaller flat and bull nose cutters beside those of the library, with still smaller ones, ...]"""
        found, count = [], len(self.library.of_type(*SIDES))
        for smaller in self.library.all_smaller:
            if len(smaller.of_type(*SIDES)) > count:
                found.append(copy(self))
                found[-1].library, count = smaller, len(smaller.of_type(*SIDES))
        return found

    def _within_skin(self, library):
        """The library as it is planned with: within the plating, and in the machine's spindle."""
        within = library_within_skin(library, self.plating_mm) if self.plating_mm else library
        smaller = library.smaller and self._within_skin(library.smaller)
        return within.in_spindle(round_the_spindle(self.machine)).with_smaller(smaller)

    def _refuse_turning(self, operation):
        """A turning axis where the machine cannot hold it, or the verdict could not follow it."""
        where = f"{self.setup.name}, {operation.title}: its tool axis turns"
        if not self.machine.rotaries:
            raise PlanError(f"{where}, and {self.machine.name} has no rotary axes: take a machine that has (`cuspline machines`), "
                            "or leave tool_axis out")
        if isinstance(operation.tool_axis, FastestAxis) and operation.kind in ("rest", "waterline"):
            raise PlanError(f"{where} as is fastest, which {operation.kind} does not choose: give it a lead_tilt")
        if self.setup.indexed:
            raise PlanError(f"{where} in an indexed position, which holds it still: give the operation to a setup that holds the "
                            "part for itself")
        beside = [s.name for held in by_clamping(self.design.setups, lambda before, s: s.is_held_as(before)) for s in held
                  if self.setup.name in [h.name for h in held] and s.indexed]
        if beside:
            raise PlanError(f"{where}, and the part is held so for indexed positions as well ({', '.join(beside)}): their "
                            "program is judged position by position; give the operation to a setup that holds the part for itself")

    @property
    def tool_axis(self):
        """The operation's ToolAxis as seen from the part as it lies in the setup; None: it stands along Z."""
        axis = self.operation.tool_axis
        return axis.seen_from(self.setup.turn) if isinstance(axis, ToolAxis) else None

    def corner_of(self, cutter):
        """CornerContact of a cutter of the operation that leans and is no ball; None: it is one, or stands upright.

        Raises:
            PlanError: its axis leans by no lead and tilt, or hardly leans.
        """
        axis = self.tool_axis
        if axis is None or cutter.type == "ball":
            return None
        where = f"{self.setup.name}, {self.operation.title}: {cutter.name}"
        if not isinstance(axis, LeadTilt) or axis.limit_deg is not None:
            raise PlanError(f"{where} touches with its corner, which only a lead_tilt axis without a limit_deg keeps on the faces: "
                            "take that, or a ball")
        try:
            return CornerContact.of(cutter, math.radians(axis.lead_deg), math.radians(axis.tilt_deg),
                                    aside_rad(axis, self.operation))
        except ToolpathError as error:
            raise PlanError(f"{where}: {error}") from None

    def _look_at(self, names):
        """The faces of some predicates: their indices, samples and tightest concave place."""
        chosen = brep.named_faces(self._faces_of_part, self.design.predicates, names)
        self.wanted = [i for i in brep.indices_of(self._faces_of_part, chosen) if self.only is None or i in self.only]
        self.samples = sample_faces(self.faces, self.wanted, self.plane.across)
        hollow = self.design.once(("tightest", tuple(self.wanted)),
                                  lambda: tightest_hollow(self._faces_of_part, self.wanted, geometry=self._geometry_of_part))
        self.hollow = replace(hollow, place_mm=tuple(self.setup.turn.into(np.array([hollow.place_mm]))[0].tolist()))

    @cached_property
    def threaded(self):
        """ThreadedWall of all holes of the part that get a thread, upward where they open upward or go through."""
        named = faces_with_threads(self._faces_of_part, self.design.threads, self.design.predicates)
        return [w.turned_up() if w.hole.is_through and w.hole.axis[2] < 0 else w for w in threaded_walls(self.faces, named)]

    @cached_property
    def _diameters(self):
        """{index of a face: design.dimensions.Diameter} that it has."""
        said = [d for d in self.design.dimensions if d.kind == "diameter"]
        faces = self._faces_of_part
        return {i: d for d in said for i in brep.indices_of(faces, brep.named_faces(faces, self.design.predicates, (d.faces,)))}

    def diameter_limits_mm(self, wall):
        """(least, most) diameter that a dimension allows a surfaces.holes.Wall; None: it has none."""
        found = [self._diameters[i] for i in wall.faces if i in self._diameters]
        return found[0].limits_mm(2 * wall.low_radius_mm) if found else None

    @property
    def face_names(self):
        """Names of the faces that the operation cuts."""
        return self.operation.faces or self.setup.faces

    @property
    def plane(self):
        """SectionPlane of the operation's passes."""
        return _PLANES[getattr(self.operation, "section_plane", "ZX")]

    @property
    def practice(self):
        """The shop's values."""
        return self.shop.practice

    @property
    def semi_scallop_mm(self):
        """Largest cusp of a semi-finish: the shop's, but more than the path's tolerance, which is a part of it."""
        return max(self.practice.semi_scallop_mm, 2.0 * self.finish.profile_tolerance_mm)

    @property
    def finishing_library(self):
        """The library as far as its balls may finish: all, or those that the operation asks for.

        Raises:
            PlanError: it has none of these.
        """
        wish = self.operation.wish
        if wish is None:
            return self.library
        tools = tuple(t for t in self.library.tools if t.cutter.type != "ball" or self.is_asked(t))
        if not any(t.cutter.type == "ball" for t in tools):
            there = ", ".join(f"{t.cutter.diameter_mm:g}" for t in self.library.of_type("ball"))
            raise PlanError(f"{self.setup.name}: the tool library has no {wish.in_words} mm; there are balls of {there} mm")
        return self.library.model_copy(update={"tools": tools})

    def is_asked(self, tool):
        """Whether the operation may take a tool, by its measures in the magazine."""
        whole = next(t for t in self.magazine.tools if t.number == tool.number)
        return self.operation.wish is None or self.operation.wish.allows(whole)

    def as_cut(self, operations):
        """PlannedOperation values, planned with the library, as the magazine's tools cut them: below the plating."""
        def cut(o):
            made = in_metal(o, self.magazine, self.plating_mm) if self.plating_mm else replace(
                o, tool=self.magazine.number(o.tool.number))
            return replace(made, orders=tuple((name, share, other and cut(other)) for name, share, other in o.orders))
        return tuple(map(cut, operations))

    def tools(self, *types):
        """The library's tools of some cutter types that the operation asks for, largest first.

        Raises:
            PlanError: it has none; lists what there is.
        """
        wish = self.operation.wish
        found = [t for t in self.library.of_type(*types) if self.is_asked(t)]
        if not found:
            there = "; ".join(f"T{t.number} {t.cutter.name}" for t in self.library.of_type(*types))
            raise PlanError(f"{self.setup.name}, {self.operation.title}: the tool library has no "
                            f"{wish.in_words if wish else ' or '.join(types)} that this operation can use; there are "
                            f"{there or 'none of the types ' + ', '.join(types)}")
        return found

    @property
    def _geometry_of_part(self):
        """`geometry` of the part as it lies in its own frame."""
        faces = self._faces_of_part
        return self.geometry if self.faces is faces else self.design.once(
            "geometry", lambda: (PatchSet.of_faces(faces), TrimSet.of_faces(faces)))

    @property
    def mesh(self):
        """DropMesh of the part."""
        return self.once("mesh", lambda: DropMesh.from_triangles(self.triangles.vertices_mm, self.triangles.triangles))

    @property
    def geometry(self):
        """(PatchSet, TrimSet) of all faces: what closest points and drops are computed on."""
        return self.once("geometry", lambda: (PatchSet.of_faces(self.faces), TrimSet.of_faces(self.faces)))

    @property
    def box(self):
        """(low, high) (3,) of the part, tight: seconds on one with many splines."""
        return self.once("box of the part", lambda: brep.bounding_box_mm(self.solid))

    def _is_clear_above_all(self, tool, lowest_mm, standing_mm):
        """Whether a tool with its tip so low keeps clear above the highest place of the part, and of what holds it.

        Mostly triangles say it.
        """
        if self._held_by is not None and not is_clear_above(
                tool, lowest_mm, float(self._held_by.corners_mm[:, :, 2].max()), HELD_BY_MM, OFF_BODIES_MM):
            return False
        top = float(self.triangles.vertices_mm[:, 2].max())         # on the faces: none of these is lower
        clear = [is_clear_above(tool, lowest_mm, high, standing_mm) for high in (top, top + OFF_MM)]
        return clear[0] if clear[0] == clear[1] else is_clear_above(tool, lowest_mm, float(self.box[1][2]), standing_mm)

    def let_go(self):
        """Forget what is large and made again in seconds, should somebody ask for it."""
        for name in MADE_AGAIN:
            self._shared.pop(name, None)

    @property
    def closest(self):
        """Closest points on all faces."""
        return self._closest_of_part if self.faces is self._faces_of_part else self._closest_of_part.seen_from(self.setup.turn)

    @property
    def _closest_of_part(self):
        """The same of the part as it lies in its own frame."""
        return self.design.once("closest", lambda: ClosestTree.of_faces(self._faces_of_part, geometry=self._geometry_of_part))

    @property
    def neighbours(self):
        """[[prismatic_features.Neighbour]] of every face."""
        return self.once("neighbours", lambda: neighbours_of(self.faces))

    def faces_near(self, points_mm):
        """(n,) index of the face that is nearest to points (n, 3), part coordinates."""
        return self._closest_of_part.closest_points(points_mm).face

    def faces_named(self, name):
        """The faces of one predicate, as the part lies in this setup."""
        chosen = brep.named_faces(self._faces_of_part, self.design.predicates, (name,))
        return [self.faces[i] for i in brep.indices_of(self._faces_of_part, chosen)]

    def closest_of(self, wanted):
        """Closest points on some faces alone, by their indices."""
        return self.once(("closest", wanted), lambda: ClosestTree.of_faces([self.faces[i] for i in wanted]))

    def once(self, name, make):
        """A value that all operations of the setup share, made when it is first wanted."""
        return self._shared.once(name, make)

    def dropper_of(self, cutter, allowance_mm):
        """A cutter over the exact part, with an allowance; of a tapered one the ball."""
        corner_mm = cutter.radius_mm if cutter.type in ROUND else cutter.corner_radius_mm
        return self.dropper(cutter.radius_mm, corner_mm, allowance_mm)

    def dropper_with(self, tool, allowance_mm):
        """The same of a whole tool: where holder or shank would touch the part it stays up, or its axis turns out of the way."""
        dropper = self.dropper_of(tool.cutter, allowance_mm)
        if self.tool_axis is not None or not self._is_short(tool):
            return dropper

        def lowest_mm(xy_mm, tips_mm):
            for mesh, standing_mm, cutter_mm in self.beside_tools:
                tips_mm = clear_tips_mm(tool, mesh, xy_mm, standing_mm, tips_mm, cutter_mm)
            return tips_mm

        return ShortToolDropper(dropper, lowest_mm)

    @property
    def beside_tools(self):
        """[(DropMesh, mm, mm or None)]: what necks, shanks and holders must clear, the most that stands on it, and how far cutters
        stay off, which may touch where it is None.

        On the part what roughing leaves; on a casting its skin as far as it stands before the setup, but for faces that this setup
        alone cuts; in a position among others its fixtures and the machine's tables as they are.
        """
        found = [(self.mesh, self.practice.rough_allowance_mm, None)]
        if self._skin_mm is not None and self._as_cast is not None:
            found.append((self._as_cast, self._skin_mm, None))
        return found if self._held_by is None else [*found, (self._held_by, HELD_BY_MM, OFF_BODIES_MM)]

    @property
    def _skin_mm(self):
        """The most that stands on a casting's faces; None: the stock is none."""
        return getattr(self.design.stock, "thickest_mm", None)

    @property
    def _as_cast(self):
        """DropMesh of where a casting's skin still stands; None: nowhere."""
        def made():
            is_one_of_many, faces = self._is_among_others, self._faces_of_part
            if is_one_of_many and not self.piece.cuts:
                return self.mesh
            setups = [s for s in self.design.setups if s.planned_as is None] if is_one_of_many else [self.setup]
            cut = brep.named_faces(faces, self.design.predicates, {name for s in setups for name in s.faces})
            is_cut = np.isin(self.triangles.face_of_triangle, brep.indices_of(faces, cut))
            # of positions what none cuts stands as cast; of a setup by itself its own faces are clean from its beginning
            asked = is_cut if is_one_of_many else ~is_cut
            corners = self._mesh_of_part.vertices_mm[self._mesh_of_part.triangles]
            least_mm = self.practice.rough_allowance_mm
            skin = self.design.once(("skin", least_mm, asked.tobytes()), lambda: StandingSkin(corners[asked], least_mm))
            standing = skin.corners_on(self.piece) if self.piece.cuts else corners[asked]
            corners = np.concatenate([corners[~asked] if is_one_of_many else corners[:0], standing])
            corners = self.setup.turn.into(corners.reshape(-1, 3)).reshape(-1, 3, 3)
            return DropMesh.from_triangles(corners.reshape(-1, 3), np.arange(3 * len(corners))) if len(corners) else None

        return self.once("as cast", made)

    @property
    def _is_among_others(self):
        """Whether what the setup does not reach is other positions' to cut."""
        return any(getattr(o, "leave_steep", False) for o in self.setup.operations)

    @property
    def _held_by(self):
        """DropMesh of fixtures and what of the machine turns with the part or carries it, in a position among others; else None."""
        machine, setup = self.machine, self.setup

        def made():
            if setup.clamped_x is None or not machine.rotaries or not self._is_among_others:
                return None
            held = setup.clamped_frame
            found = what_holds(machine, turned_to(machine, held, setup.wcs_z), setup.turn, held, self.fixtures)
            return None if found is None else DropMesh.from_triangles(*found)

        return self.once("held by", made)

    def missing_mm(self, tool, tips_mm, more_mm=0.0):
        """(n,) stick-out that a tool lacks at tips (n, 3), see tool_depth; `more_mm`: that stands on all of it besides."""
        missing = 0.0
        for mesh, standing_mm, cutter_mm in self.beside_tools:
            missing = missing_stick_outs_mm(tool, tips_mm, mesh, standing_mm + more_mm, missing, cutter_mm)
        return missing

    def most_missing_mm(self, tool, tips_mm):
        """The most of these, mm."""
        return max(missing_stick_out_mm(tool, tips_mm, *beside) for beside in self.beside_tools)

    def _is_short(self, tool):
        """Whether a holder or shank would touch the part where its cutter touches the faces of the operation."""
        lowest = float(self.samples.point_mm[:, 2].min()) - tool.cutter.corner_radius_mm
        if self._is_clear_above_all(tool, lowest, max(self._skin_mm or 0.0, self.practice.rough_allowance_mm)):
            return False

        def is_in_the_way():
            reach = cutter_reach(self.samples, self.mesh, tool.cutter)
            return self.most_missing_mm(tool, reach.tip_mm[reach.is_reached]) > 0

        return self.once(("short", tool.number, tuple(self.wanted)), is_in_the_way)

    @property
    def edge_neighbours(self):
        """Which faces meet on the part's edges."""
        return self.once("edges", lambda: EdgeNeighbours.of_faces(self.faces))

    def dropper(self, radius_mm, corner_radius_mm, allowance_mm):
        """The same, the cutter by its measures."""
        return ExactDropper(self._exact_part(radius_mm), self.edge_neighbours, radius_mm, corner_radius_mm, allowance_mm)

    def _exact_part(self, radius_mm):
        """ExactPart; of an indexed position, which sees much of the part that it does not cut, PartNear its faces."""
        make = lambda box: ExactPart.of_faces(self.faces, self.geometry, within_mm=box)
        if not self.setup.indexed:
            return self.once("exact", lambda: make(EVERYWHERE))

        def near():
            more = NEAR_RADII * radius_mm * np.array([[-1.0], [1.0]])
            (low_x, low_y), (high_x, high_y) = self.box_of_wanted + more
            return PartNear(make, (low_x, high_x, low_y, high_y))

        return self.once(("exact", tuple(self.wanted)), near)

    @property
    def box_of_wanted(self):
        """(2, 2) lowest and highest x, y of the faces wanted."""
        def box():
            boxes = np.array([brep.bounding_box_mm(self.faces[i].shape) for i in self.wanted])
            return np.array([boxes[:, 0].min(axis=0)[:2], boxes[:, 1].max(axis=0)[:2]])

        return self.once(("box", tuple(self.wanted)), box)

    @property
    def clearance_tree(self):
        """The part's triangles, MESH_DEFLECTION_MM from its faces, for whole tools at any angle."""
        return self.once("clearance", lambda: ClearanceTree.of_triangles(self.triangles.vertices_mm, self.triangles.triangles))

    @property
    def obstacle_tree(self):
        """The same with the fixtures and what of the machine moves with the part: what no tool may run into."""
        def made():
            carried = bodies_with_part(self.machine, self.setup.turn, self.setup.clamped_frame) if self.machine.rotaries else ()
            if not self.fixtures and not carried:
                return self.clearance_tree
            return ClearanceTree.of_triangles(*together([
                (self.triangles.vertices_mm, self.triangles.triangles), *(f.mesh for f in self.fixtures),
                *((b.vertices_mm, b.triangles) for b in carried)]))

        return self.once("obstacles", made)

    @cached_property
    def standing(self):
        """ClearanceTree of what roughing has left standing beside the faces of the operation; None: no more than it leaves."""
        return standing_tree(self)

    def lead_radius_mm(self, radius_mm):
        """Of the arcs into and out of passes of a cutter."""
        asked = getattr(self.operation, "lead_radius_mm", None)
        return min(self.practice.lead_radius_mm if asked is None else asked, radius_mm)

    def beyond_reach(self, radius_mm):
        """Boxes (min, max) that keep a roughing cutter's tips, and the room it wants, within the setup's reach."""
        if self.setup.reach_x_mm is None:
            return ()
        (low, high), room = self.setup.reach_x_mm, radius_mm + self.practice.keep_out_mm
        first = np.array(self.stock_min_mm) - FAR_MM
        last = np.array([*(self.stock_max_mm[:2] + FAR_MM), self.clearance_z_mm])
        return ((first, np.array([low - room, *last[1:]])), (np.array([high + room, *first[1:]]), last))

    def in_part(self, place_mm):
        """A place in part coordinates, rounded for plan.json."""
        return self.setup.turn.out(np.array(place_mm)[None])[0].round(4).tolist()

    def stock_mm(self, xy_mm, at_most_mm=np.inf):
        """Height of the stock over places (n, 2) before the operation's first move, at most so much; -inf beside it.

        What other directions have cut counts by cells that hold all that is left: too high by less than one, never too low.
        """
        piece, frame = self.piece, self.setup.turn
        inside = np.flatnonzero(((xy_mm >= self.stock_min_mm[:2]) & (xy_mm <= self.stock_max_mm[:2])).all(axis=1))
        tops = np.full(len(inside), self.stock_max_mm[2])
        if not piece.blank.fills_box_in(frame):
            tops = piece.blank.tops_mm(frame, xy_mm[inside])
            inside, tops = inside[np.isfinite(tops)], tops[np.isfinite(tops)]
        height = np.full(len(xy_mm), -np.inf)
        height[inside] = (piece.heights_mm(frame, xy_mm[inside]) if piece.is_cut_along(frame) else
                          piece.bounds_mm(frame, xy_mm[inside], tops))
        for operation in self.planned:
            height = operation.swept_mm(xy_mm, height)
        return np.minimum(height, at_most_mm)

    @property
    def is_done(self):
        """Function of places and normals (n, 3) to (n,) bool: whether earlier setups leave no more than the cusp; None: there are
        none, or the part is plated."""
        if not self.piece.cuts or self.plating_mm:
            return None
        frame, most = self.setup.turn, self.finish.scallop_mm
        return lambda points, normals: self.piece.deviations(frame.out(points), frame.turn_out(normals),
                                                             DONE_RAY * most)[0] <= most

    def standing_mm(self, tool, stock=None):
        """The most that stands over the faces of the operation, straight up, or square to them: what its links go over.

        `stock` is a function of places (n, 2) to heights (n,); None: what stands before the operation.
        """
        radius = tool.cutter.largest_radius_mm
        low, high = self.box_of_wanted[0] - radius, self.box_of_wanted[1] + radius
        lines = [np.linspace(low[k], high[k], min(int((high[k] - low[k]) / (LOOK_SHARE * radius)) + 2, MOST_LOOKS)) for k in (0, 1)]
        xy = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
        stock, part = (stock or self.stock_mm)(xy), drop_tips_mm(self.mesh, xy, THIN_MM, THIN_MM)
        there = np.isfinite(part) & np.isfinite(stock)
        highest = float((stock[there] - part[there]).max(initial=0.0))
        return max(highest if self._skin_mm is None else min(highest, self._skin_mm), self.practice.rough_allowance_mm)

    def standing_round_mm(self, places_mm, reach_mm):
        """The most that stands over the part, straight up, so far round places (n, 2): (n,) mm."""
        off = np.vstack([np.zeros((1, 2)), rings_of(reach_mm * ROUND_SHARES, ROUND_PLACES).reshape(-1, 2)])
        xy = (places_mm[:, None] + off).reshape(-1, 2)
        stock, part = self.stock_mm(xy), drop_tips_mm(self.mesh, xy, THIN_MM, THIN_MM)
        there = np.isfinite(part) & np.isfinite(stock)
        high = np.where(there, np.where(there, stock, 0.0) - np.where(there, part, 0.0), 0.0)
        return np.maximum(high.reshape(-1, len(off)).max(axis=1), 0.0)

    def chosen_tool(self, *types):
        """The fastest cutter of some types that fits the operation's faces with its holder clear and leaves least.

        Where the tightest hollow is too tight for all of them they go as far as they can; what they leave is listed.

        Args:
            types: what the operation can use; where it asks for none, the first.
        Returns:
            (Tool, tuple of Candidate, (n,) bool: which samples it reaches).
        Raises:
            PlanError, CutterDoesNotFit: the library has none; lists each with its reason.
        """
        tools = self.tools(*(types if self.operation.wish else types[:1]))
        looked = {t.number: self.reached_with(t) for t in tools}
        choose = lambda tightest_mm: choose_cutter(self.operation.title, tools, self.samples, tightest_mm,
                                                   lambda tool: looked[tool.number], self.finishing_work())
        if self.operation.wish:
            return choose(np.inf)
        try:
            return choose(self.hollow.radius_mm)
        except CutterDoesNotFit as error:
            with suppress(CutterDoesNotFit):
                return choose(np.inf)
            raise error from None

    def reached_with(self, tool):
        """((n,) bool: which samples a tool reaches, the stick-out that it lacks there, mm).

        Where the axis turns out of the way nothing is lacking; what is left as steep to other positions, what the holder keeps
        this tool from is left to them too.
        """
        corner = self.corner_of(tool.cutter)
        reach = (cutter_reach(self.samples, self.mesh, tool.cutter) if corner is None else
                 ball_reach(self.samples, self.mesh, corner.ball_radius_mm))
        if isinstance(self.operation.tool_axis, ClearingAxis):
            return reach.is_reached, 0.0
        if getattr(self.operation, "steepest_deg", 90.0) == 90.0:
            return reach.is_reached, self.most_missing_mm(tool, reach.tip_mm[reach.is_reached])
        own = reach.is_reached & ~left_as_steep(self.operation, self.samples)
        missing = self.missing_mm(tool, reach.tip_mm[own])
        clear = own.copy()
        clear[own] = missing <= 0.0
        return clear, 0.0 if clear.any() else float(missing.max(initial=0.0))

    def speeds(self, tool, is_rough):
        """(rpm, cutting feed) of a tool in this material: the operation's, else its preset's, else the material's."""
        m, own, preset = self.material, self.operation, self.preset(tool, is_rough)
        if tool.cutter.drills:
            speed, share = m.drilling
            share = share / tool.cutter.flutes
        else:
            speed, share = m.rough_speed_m_per_min if is_rough else m.finish_speed_m_per_min, m.feed_per_tooth_share
        rpm, feed, tooth = own.spindle_rpm, own.feed_mm_per_min, own.feed_per_tooth_mm
        if preset is not None:
            if rpm is None and own.cutting_speed_m_per_min is None:
                rpm, speed = preset.spindle_rpm, preset.cutting_speed_m_per_min or speed
            if feed is None and tooth is None:
                feed, tooth = preset.feed_mm_per_min, preset.feed_per_tooth_mm
        rpm = rpm or feeds.spindle_rpm(tool.cutter, own.cutting_speed_m_per_min or speed, self.machine.spindle)
        share = share if tooth is None else tooth / tool.cutter.diameter_mm
        return rpm, feed or feeds.cutting_feed_mm_per_min(tool.cutter, rpm, share, self.machine)

    def preset(self, tool, is_rough):
        """The shop.presets.Preset that the operation runs a tool by; None: the material's figures.

        Raises:
            PlanError: the operation asks for one that no tool of the library has.
        """
        wish = self.operation.preset
        there = {p.name for t in (tool, *self.magazine.tools) for p in t.presets or ()}
        if wish is not None and wish not in there:
            raise PlanError(f"{self.operation.title}: no tool has a preset {wish!r}; "
                            + (f"there are {', '.join(sorted(there))}" if there else "the library's tools have none: import one "
                               "with presets (`cuspline cutters --import`), or leave preset out"))
        return preset_of(tool, self.material.name, self.operation.kind, is_rough, wish)

    def of_preset(self, name, tool):
        """What a tool's preset says of its way into stock, `stepdown_mm`, `stepover_mm` or `ramp_deg`; None: it has none, or is
        silent.  No deeper than the flutes, no wider than the radius, no steeper than operations may ask for."""
        preset, cutter = self.preset(tool, True), tool.cutter
        value = None if preset is None else getattr(preset, name)
        most = {"stepdown_mm": cutter.flute_length_mm, "stepover_mm": cutter.radius_mm, "ramp_deg": STEEPEST_RAMP_DEG}[name]
        return None if value is None else min(value, most)

    def stepdown_mm(self, tool, asked=None):
        """Of clearing with a tool: the operation's, else its preset's, else the material's share of its diameter.

        `asked`: a value that speaks in the operation's place.
        """
        return (getattr(asked or self.operation, "stepdown_mm", None) or self.of_preset("stepdown_mm", tool)
                or self.material.stepdown_share * tool.cutter.diameter_mm)

    def ramp_deg(self, tool, asked=None):
        """Of its way into stock: the operation's, else its preset's, else the shop's; `asked`: see `stepdown_mm`."""
        return getattr(asked or self.operation, "ramp_deg", None) or self.of_preset("ramp_deg", tool) or self.practice.ramp_deg

    def _run_by(self, tool, rpm):
        """The Preset of a stage in which it runs at that speed, or None."""
        stages = [is_rough for is_rough in (True, False) if self.speeds(tool, is_rough)[0] == rpm]
        return next(filter(None, (self.preset(tool, is_rough) for is_rough in stages)), None)

    def _cutting_data(self, tool, preset):
        """Where speed, feed and coolant of an operation come from, in words, for plan.json."""
        own, material = self.operation, f"material {self.material.name}: {self.material.source}"
        said = lambda *names: [n for n in names if getattr(own, n) is not None]
        by = "" if preset is None else f"preset {preset.name} of T{tool.number}" + (f": {preset.source}" if preset.source else "")
        of_preset = lambda *names: by if any(getattr(preset, n, None) is not None for n in names) else ""
        stated = lambda names, rest: f"{' and '.join(names)} of the operation" if names else rest
        return {"speed": stated(said("spindle_rpm") or said("cutting_speed_m_per_min"),
                                of_preset("spindle_rpm", "cutting_speed_m_per_min") or material),
                "feed": stated(said("feed_mm_per_min") or said("feed_per_tooth_mm"),
                               of_preset("feed_mm_per_min", "feed_per_tooth_mm") or material),
                "coolant": stated(said("coolant"), of_preset("coolant") or f"material {self.material.name}")}

    def finishing_work(self):
        """What the finish asks of a ball."""
        return FinishingWork(scallop_mm=self.finish.scallop_mm, change_s=self.practice.tool_change_s,
                             feed_of=lambda tool: self.speeds(tool, is_rough=False)[1])

    def measured(self, name, tool, rpm, moves, facts, left=None):
        """Cap the feeds, measure length and time.   left: Left."""
        made = self._measured(name, tool, rpm, moves.with_feed(feeds.capped_feeds(moves, self.machine)), facts)
        return replace(made, left=left, wishes=self._wishes(tool, rpm, moves))

    def _wishes(self, tool, rpm, moves):
        """Wishes of the operation, else of the shop; None: neither has any."""
        own = {name: getattr(self.practice, name) if getattr(self.operation, name) is None else getattr(self.operation, name)
               for name in ("constant_speed", "feed_by_engagement")}
        if not any(own.values()):
            return None
        return Wishes(feed_mm_per_min=moves.feed_mm_per_min, speed_m_per_min=self._cutting_speed_m_per_min(tool, rpm),
                      is_speed_constant=own["constant_speed"], is_fed_by_engagement=own["feed_by_engagement"])

    def _cutting_speed_m_per_min(self, tool, rpm):
        """The cutting speed that a speed of the spindle was chosen for."""
        m, asked = self.material, self.operation.cutting_speed_m_per_min
        if self.operation.spindle_rpm or self.preset(tool, isinstance(self.operation, Clearing)):
            return math.pi * tool.cutter.diameter_mm * rpm / 1000
        both = (m.rough_speed_m_per_min, m.finish_speed_m_per_min)
        chosen = [v for v in both if feeds.spindle_rpm(tool.cutter, v, self.machine.spindle) == rpm]
        return asked or (chosen or both)[0 if isinstance(self.operation, Clearing) else -1]

    def measured_holes(self, name, tool, rpm, moves, cycles, facts):
        """The same for drilled holes: one feed, the least of the capped ones; `cycles`: drilling.DrillCycle of the moves."""
        feeding = moves.kind != Kind.RAPID
        feed = float(feeds.capped_feeds(moves, self.machine)[feeding].min())
        made = self._measured(name, tool, rpm, moves.with_feed(np.where(feeding, feed, 0.0)), facts)
        dwells_s = sum(c.dwell_s for c in cycles)
        return replace(made, cycles=tuple(replace(c, feed_mm_per_min=feed) for c in cycles),
                       facts={**made.facts, "time_s": round(made.facts["time_s"] + dwells_s, 1)})

    def measured_taps(self, name, tool, rpm, moves, cycles, facts):
        """The same for tapped holes: the spindle's speed and the pitch are the feed."""
        return replace(self._measured(name, tool, rpm, moves, facts), cycles=cycles)

    def measured_passes(self, name, tool, rpm, passes, facts):
        """The same for templated passes: each feed register gets the lowest of the capped feeds it stands for."""
        moves, _, register = passes.moves_and_items()
        capped = feeds.capped_feeds(moves, self.machine)
        passes = passes.with_registers(**{n: capped[register == n].min() for n in set(register) - {""}})
        return self._measured(name, tool, rpm, passes.moves(), facts, passes)

    def _measured(self, name, tool, rpm, moves, facts, passes=None):
        cutting = moves.kind != Kind.RAPID
        facts = {**facts, "length_mm": round(float(feeds.move_lengths_mm(moves)[cutting].sum()), 3),
                 "time_s": round(float(feeds.times_s(moves, self.machine).sum()), 1),
                 "moves": len(moves), "arcs": int((moves.kind >= Kind.ARC_CW).sum())}
        preset = self._run_by(tool, rpm)
        facts["cutting_data"] = self._cutting_data(tool, preset)
        if preset is not None:
            facts["preset"] = preset.name
        return PlannedOperation(name=name, tool=tool, rpm=rpm, moves=moves, facts=facts, passes=passes,
                                coolant=self.operation.coolant or (preset and preset.coolant) or self.material.coolant)


_PLANES = {name: SectionPlane.named(name) for name in ("ZX", "YZ")}


def left_as_steep(operation, samples):
    """(n,) bool: samples on what an operation leaves to others because it is steep."""
    steepest = getattr(operation, "steepest_deg", 90.0)
    return (samples.normal[:, 2] < fixed.cos(math.radians(steepest))) & (steepest < 90.0)


def _stricter(finish, operation, tolerance_share):
    """The design's Finish with what an operation says of its own.

    Raises:
        PlanError: it says more than the design allows: the verdict holds the design's.
    """
    own = {n: getattr(operation, n) for n in type(finish).model_fields if getattr(operation, n, None) is not None}
    for name, value in own.items():
        if value > getattr(finish, name):
            raise PlanError(f"{operation.title}: {name} {value:g} is looser than the design's {getattr(finish, name):g}, and "
                            "that is what the part is judged by: lower it, or loosen the design's finish")
    own["profile_tolerance_mm"] = tolerance_share * own.get("profile_tolerance_mm", finish.profile_tolerance_mm)
    return finish.model_copy(update=own)


def path_tolerance_mm(finish):
    """What the fitted path may deviate, the post's rounding kept back."""
    return finish.profile_tolerance_mm - ROUNDING_MM


def ridge_for_step_mm(name, scallop_mm, finish):
    """Scallop height to choose the step for: the ridge may stand on a path that is high by its tolerance.

    Raises:
        PlanError: the tolerance leaves nothing for the ridge.
    """
    ridge_mm = scallop_mm - finish.profile_tolerance_mm
    if ridge_mm <= 0 or path_tolerance_mm(finish) <= 0:
        raise PlanError(f"{name}: a cusp of {scallop_mm} mm and a profile tolerance of "
                        f"{finish.profile_tolerance_mm} mm do not go together: the tolerance must be between "
                        f"{ROUNDING_MM} mm and the cusp")
    return ridge_mm


def aside_rad(axis, operation):
    """Angle from the passes of an operation to the direction that a LeadTilt counts from: 0 where that is the feed's.

    Passes that are not parallel may run square to it.
    """
    if axis.toward is None:
        return 0.0
    if operation.kind != "parallel":
        return math.pi / 2
    return float(fixed.arctan2(axis.toward[1], axis.toward[0])) - math.radians(operation.angle_deg)


def finite(value):
    """Rounded for plan.json; None where there is no such number."""
    return round(float(value), 6) if np.isfinite(value) else None
