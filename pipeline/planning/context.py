"""What one setup's planning has at hand: the part's faces and mesh, the machine, the shop's tools and speeds."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cuspline.design.fixtures import placed_fixtures
from cuspline.kernel import brep
from cuspline.planning import feeds
from cuspline.planning.finishing_chain import FinishingWork
from cuspline.program.program import Kind, Moves
from cuspline.shop.cutters import Tool
from cuspline.shop.materials import material_named
from cuspline.stock.workpiece import Workpiece
from cuspline.surfaces.curvature import sample_faces, tightest_hollow
from cuspline.surfaces.patches import PatchSet
from cuspline.surfaces.projection import ClosestTree
from cuspline.surfaces.sections import SectionPlane
from cuspline.surfaces.trims import TrimSet
from cuspline.toolpaths.drop.dropcutter import DropMesh
from cuspline.toolpaths.drop.exact_drop import ExactPart
from cuspline.toolpaths.drop.exact_dropper import EdgeNeighbours, ExactDropper
from cuspline.toolpaths.roughing.stock_fields import lines_of_moves, swept_by_lines
from cuspline.values.errors import PlanError

MESH_DEFLECTION_MM = 0.01
ROUGH_ALLOWANCE_MM = 0.3
SEMI_ALLOWANCE_MM = 0.1
SEMI_SCALLOP_MM = 0.05
FINISH_DEPTH_SHARE = 0.1    # a ball finishes at most this share of its diameter deep
CLEARANCE_MM = 5.0          # of rapids above stock and fixtures
KEEP_OUT_MM = 2.0           # between roughing tools and fixtures
FAR_MM = 1000.0             # beyond any billet
APPROACH_MM = 1.0           # above stock and fixtures the tool begins to feed down
ROUNDING_MM = 1e-4          # kept back from the tolerances for the post's decimals
RAMP_RAD = np.radians(3.0)
SAME_MM = 1e-6              # diameters that are the same
TOOL_CHANGE_S = 60.0        # one more tool, its approach and its passes' overlap included
PLUNGE_SHARE = 0.3          # of the cutting feed, going down


@dataclass(frozen=True, eq=False, kw_only=True)
class PlannedOperation:
    """One operation with everything that plan.json says of it."""

    name: str
    tool: Tool
    rpm: float
    coolant: str
    moves: Moves                # with capped feeds, in the part as it lies in its setup (`setup.turn`)
    facts: dict                 # numbers for plan.json
    passes: object = None       # pass_templates.TemplatedPasses that come to the moves; None: only the moves

    @cached_property
    def swept_mm(self):
        """Height field (function (n, 2) -> (n,)) of the lowest that its cutter comes to, in the frame of its moves."""
        cutter = self.tool.cutter
        return swept_by_lines(lines_of_moves(self.moves), cutter.radius_mm, cutter.corner_radius_mm)


class Shop:
    """What one setup's planning has at hand.

    Lengths in the part as it lies in this setup: `setup.turn` is that frame, the spindle stands along its Z.
    """

    def __init__(self, design, setup, machine, library, before=None):
        """`before`: stock.workpiece.Workpiece that earlier setups leave; None: the stock as delivered."""
        self.design, self.setup, self.machine, self.library, self.before = design, setup, machine, library, before
        solid = brep.the_solid(design.solid, f"design {design.name}")
        faces = brep.faces_of(solid)
        chosen = [f for p in design.predicates if p.name in setup.faces for f in brep.select_faces(faces, p)]
        self.wanted = [i for i, f in enumerate(faces) if any(f is c for c in chosen)]
        self.solid = brep.seen_from(solid, setup.turn)
        self.faces = faces if self.solid is solid else brep.faces_of(self.solid)
        self.piece = before or Workpiece(blank=design.stock.shape)
        self.stock_min_mm, self.stock_max_mm = self.piece.box_in(setup.turn)
        self.fixtures = placed_fixtures(setup, setup.turn)
        self.plane = SectionPlane.named(setup.section_plane)
        self.material = material_named(design.material)
        mesh = brep.planning_mesh(self.solid, MESH_DEFLECTION_MM)
        self.mesh = DropMesh.from_triangles(mesh.vertices_mm, mesh.triangles)
        self.samples = sample_faces(self.faces, self.wanted, self.plane.across)
        self.hollow = tightest_hollow(self.faces, self.wanted, geometry=self.geometry)
        self.box = brep.bounding_box_mm(self.solid)
        self.clearance_z_mm = float(max([self.stock_max_mm[2], *(f.box_mm[1][2] for f in self.fixtures)])) + CLEARANCE_MM

    @cached_property
    def finishing_library(self):
        """The library as far as its balls may finish: all, or those of the diameter that the setup asks for.

        Raises:
            PlanError: it has none of that diameter.
        """
        asked = self.setup.ball_mm
        if asked is None:
            return self.library
        tools = tuple(t for t in self.library.tools
                      if t.cutter.type != "ball" or abs(t.cutter.diameter_mm - asked) < SAME_MM)
        if not any(t.cutter.type == "ball" for t in tools):
            there = ", ".join(f"{t.cutter.diameter_mm:g}" for t in self.library.of_type("ball"))
            raise PlanError(f"{self.setup.name}: the tool library has no ball of {asked:g} mm; there are {there} mm")
        return self.library.model_copy(update={"tools": tools})

    @cached_property
    def geometry(self):
        """(PatchSet, TrimSet) of all faces: what hollows, closest points and drops are computed on."""
        return PatchSet.of_faces(self.faces), TrimSet.of_faces(self.faces)

    @cached_property
    def closest(self):
        """Closest points on all faces."""
        return ClosestTree.of_faces(self.faces, geometry=self.geometry)

    @cached_property
    def _exact(self):
        return ExactPart.of_faces(self.faces, self.geometry), EdgeNeighbours.of_faces(self.faces)

    def dropper_of(self, radius_mm, allowance_mm):
        """A ball over the exact part, with an allowance."""
        return ExactDropper(*self._exact, radius_mm, radius_mm, allowance_mm)

    def beyond_reach(self, radius_mm):
        """Boxes (min, max) that keep a roughing cutter's tips, and the room it wants, within the setup's reach."""
        if self.setup.reach_x_mm is None:
            return ()
        (low, high), room = self.setup.reach_x_mm, radius_mm + KEEP_OUT_MM
        first = np.array(self.stock_min_mm) - FAR_MM
        last = np.array([*(self.stock_max_mm[:2] + FAR_MM), self.clearance_z_mm])
        return ((first, np.array([low - room, *last[1:]])), (np.array([high + room, *first[1:]]), last))

    def in_part(self, place_mm):
        """A place in part coordinates, rounded for plan.json."""
        return self.setup.turn.out(np.array(place_mm)[None])[0].round(4).tolist()

    def stock_mm(self, xy_mm):
        """Height of the stock over places (n, 2) before the first move; -inf beside it."""
        inside = ((xy_mm >= self.stock_min_mm[:2]) & (xy_mm <= self.stock_max_mm[:2])).all(axis=1)
        if not self.piece.blank.fills_box_in(self.setup.turn):
            inside[inside] = np.isfinite(self.piece.blank.tops_mm(self.setup.turn, xy_mm[inside]))
        height = np.full(len(xy_mm), -np.inf)
        height[inside] = self.piece.heights_mm(self.setup.turn, xy_mm[inside])
        return height

    def speeds(self, tool, is_rough):
        """(rpm, cutting feed) of a tool in this material."""
        m = self.material
        speed = m.rough_speed_m_per_min if is_rough else m.finish_speed_m_per_min
        rpm = feeds.spindle_rpm(tool.cutter, speed, self.machine.spindle)
        return rpm, feeds.cutting_feed_mm_per_min(tool.cutter, rpm, m.feed_per_tooth_share, self.machine)

    def finishing_work(self):
        """What the finish asks of a ball."""
        return FinishingWork(scallop_mm=self.design.finish.scallop_mm, change_s=TOOL_CHANGE_S,
                             feed_of=lambda tool: self.speeds(tool, is_rough=False)[1])

    def operation(self, name, tool, rpm, moves, facts):
        """Cap the feeds, measure length and time."""
        return self._measured(name, tool, rpm, moves.with_feed(feeds.capped_feeds(moves, self.machine)), facts)

    def operation_of_passes(self, name, tool, rpm, passes, facts):
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
        return PlannedOperation(name=name, tool=tool, rpm=rpm, coolant=self.material.coolant, moves=moves, facts=facts,
                                passes=passes)


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
                        f"{finish.profile_tolerance_mm} mm do not go together: the tolerance must lie between "
                        f"{ROUNDING_MM} mm and the cusp")
    return ridge_mm


def finite(value):
    """Rounded for plan.json; None where there is no such number."""
    return round(float(value), 6) if np.isfinite(value) else None
