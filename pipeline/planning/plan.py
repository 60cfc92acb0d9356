"""The plan: operations of each setup with cutters, steps, feeds and the moves they came to.

Order: rough, semi-finish where roughing leaves too much, finish, and rest passes with the smallest
ball where the finishing ball cannot go.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline import brep
from cuspline.cutters import Tool
from cuspline.errors import PlanError
from cuspline.planning import feeds
from cuspline.planning.cutter_choice import (
    choose_ball, choose_rest_ball, choose_roughing, left_by_moves_mm, leftover_rows)
from cuspline.planning.materials import material_named
from cuspline.planning.stepover import stepover_for_scallop_mm
from cuspline.program import Kind, Moves, Operation, Program
from cuspline.surfaces.curvature import inner_edges, sample_faces, tightest_hollow
from cuspline.surfaces.sections import SectionPlane
from cuspline.toolpaths.dropcutter import DropMesh
from cuspline.toolpaths.pass_links import LinkRules, moves_of_passes
from cuspline.toolpaths.profile_passes import ProfilePlanner, planes_across
from cuspline.toolpaths.rest_passes import rest_passes
from cuspline.toolpaths.roughing import RoughingRules, rough

MESH_DEFLECTION_MM = 0.01
ROUGH_ALLOWANCE_MM = 0.3
SEMI_ALLOWANCE_MM = 0.1
SEMI_SCALLOP_MM = 0.05
FINISH_DEPTH_SHARE = 0.1    # a ball finishes at most this share of its diameter deep
CLEARANCE_MM = 5.0          # of rapids above stock and fixtures
APPROACH_MM = 1.0           # above stock and fixtures the tool begins to feed down
ROUNDING_MM = 1e-4          # kept back from the tolerances for the post's decimals
RAMP_RAD = np.radians(3.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class PlannedOperation:
    """One operation with everything that plan.json says of it."""

    name: str
    tool: Tool
    rpm: float
    coolant: str
    moves: Moves                # with capped feeds, part frame
    facts: dict                 # numbers for plan.json


@dataclass(frozen=True, eq=False, kw_only=True)
class SetupPlan:
    """One setup's operations and what they rest on."""

    setup: object               # design.Setup
    operations: tuple[PlannedOperation, ...]
    clearance_z_mm: float
    hollow: object              # surfaces.curvature.Hollow
    inner_edges: tuple
    area_required_mm2: float
    area_reached_mm2: float

    def program(self, header, name):
        """The controller-free Program, in the setup's WCS."""
        into = self.setup.frame.into
        return Program(
            name=name, setup=self.setup.name, wcs=self.setup.wcs, wcs_in_words=self.setup.wcs_in_words,
            clearance_z_mm=float(self.clearance_z_mm - self.setup.wcs_origin_mm[2]), header=tuple(header),
            operations=tuple(Operation(name=o.name, tool=o.tool, spindle_rpm=o.rpm, coolant=o.coolant,
                                       moves=_moved(o.moves, into)) for o in self.operations))


def _moved(moves, into):
    return replace(moves, start_mm=into(moves.start_mm), end_mm=into(moves.end_mm), center_mm=into(moves.center_mm))


class _Shop:
    """What one setup's planning has at hand; lengths in the part frame."""

    def __init__(self, design, setup, machine, library):
        self.design, self.setup, self.machine, self.library = design, setup, machine, library
        self.solid = brep.the_solid(design.solid, f"design {design.name}")
        self.faces = brep.faces_of(self.solid)
        chosen = [f for p in design.predicates if p.name in setup.faces for f in brep.select_faces(self.faces, p)]
        self.wanted = [i for i, f in enumerate(self.faces) if any(f is c for c in chosen)]
        self.plane = SectionPlane.named(setup.section_plane)
        self.material = material_named(design.material)
        mesh = brep.planning_mesh(self.solid, MESH_DEFLECTION_MM)
        self.mesh = DropMesh.from_triangles(mesh.vertices_mm, mesh.triangles)
        self.samples = sample_faces(self.faces, self.wanted, self.plane.across)
        self.hollow = tightest_hollow(self.faces, self.wanted)
        self.box = brep.bounding_box_mm(self.solid)
        self.clearance_z_mm = max([design.stock.max_mm[2], *(f.max_mm[2] for f in setup.fixtures)]) + CLEARANCE_MM

    def speeds(self, tool, is_rough):
        """(rpm, cutting feed) of a tool in this material."""
        m = self.material
        speed = m.rough_speed_m_per_min if is_rough else m.finish_speed_m_per_min
        rpm = feeds.spindle_rpm(tool.cutter, speed, self.machine.spindle)
        return rpm, feeds.cutting_feed_mm_per_min(tool.cutter, rpm, m.feed_per_tooth_share, self.machine)

    def operation(self, name, tool, rpm, moves, facts):
        """Cap the feeds, measure length and time."""
        moves = moves.with_feed(feeds.capped_feeds(moves, self.machine))
        cutting = moves.kind != Kind.RAPID
        facts = {**facts, "length_mm": round(float(feeds.move_lengths_mm(moves)[cutting].sum()), 3),
                 "time_s": round(float(feeds.times_s(moves, self.machine).sum()), 1),
                 "moves": len(moves), "arcs": int((moves.kind >= Kind.ARC_CW).sum())}
        return PlannedOperation(name=name, tool=tool, rpm=rpm, coolant=self.material.coolant, moves=moves, facts=facts)


def plan_setup(design, setup, machine, library):
    """Plan one setup.

    Args:
        design: Design.
        setup: one of its setups.
        machine: Machine.
        library: ToolLibrary.
    Returns:
        SetupPlan.
    Raises:
        PlanError, CutterDoesNotFit, ToolpathError: what cannot be done, where, and how to mend it.
    """
    for name, scallop_mm in (("semi-finish", SEMI_SCALLOP_MM), ("finish", design.finish.scallop_mm)):
        _ridge_mm(name, scallop_mm, design.finish)
    shop = _Shop(design, setup, machine, library)
    ball, candidates, reach = choose_ball(library, shop.samples, shop.hollow.radius_mm, shop.mesh, ROUGH_ALLOWANCE_MM)
    operations = list(_roughed(shop, ball, reach))
    operations.append(_ball_passes(shop, "finish", ball, 0.0, design.finish.scallop_mm, candidates, reach))
    rest, rest_candidates, adds = choose_rest_ball(library, shop.samples, reach, shop.mesh, ball.cutter.radius_mm,
                                                   ROUGH_ALLOWANCE_MM)
    reached = reach.is_reached | adds
    if rest is not None:
        operations.append(_rest(shop, ball, rest, rest_candidates))
    return SetupPlan(setup=setup, operations=tuple(operations), clearance_z_mm=shop.clearance_z_mm, hollow=shop.hollow,
                     inner_edges=tuple(inner_edges(shop.faces, set(shop.wanted))),
                     area_required_mm2=float(shop.samples.area_mm2.sum()),
                     area_reached_mm2=float(shop.samples.area_mm2[reached].sum()))


def _roughed(shop, ball, reach):
    """Roughing with rows along X or along Y, and a semi-finish where it leaves too much: the faster of the two."""
    low, high = np.array(shop.design.stock.min_mm), np.array(shop.design.stock.max_mm)
    tool, candidates = choose_roughing(shop.library, shop.mesh, shop.samples, low, high, ROUGH_ALLOWANCE_MM)
    rows = leftover_rows(shop.samples)
    rows = rows[reach.is_reached[rows]]
    limit = FINISH_DEPTH_SHARE * ball.cutter.diameter_mm
    semi, ways = None, []
    for along in (0, 1):
        roughing = _rough(shop, tool, candidates, along, low, high)
        left = left_by_moves_mm(roughing.moves, tool, shop.samples, rows)
        roughing.facts["leaves_mm"] = round(float(np.percentile(left, 99.5)), 3)
        if roughing.facts["leaves_mm"] <= limit:
            ways.append((roughing,))
            continue
        semi = semi or _ball_passes(shop, "semi-finish", ball, SEMI_ALLOWANCE_MM, SEMI_SCALLOP_MM, (), reach)
        ways.append((roughing, semi))
    return min(ways, key=lambda way: sum(o.facts["time_s"] for o in way))


def _rough(shop, tool, candidates, along, low, high):
    """Level-wise clearing with rows along one axis."""
    rpm, feed = shop.speeds(tool, is_rough=True)
    d = tool.cutter.diameter_mm
    rules = RoughingRules(
        mesh=shop.mesh, radius_mm=d / 2, corner_radius_mm=tool.cutter.corner_radius_mm,
        allowance_mm=ROUGH_ALLOWANCE_MM, stepdown_mm=shop.material.stepdown_share * d, stepover_mm=0.45 * d,
        stock_min_mm=low, stock_max_mm=high, along=along, ramp_rad=RAMP_RAD, lead_mm=2.0,
        clearance_z_mm=shop.clearance_z_mm, feed_mm_per_min=feed, slot_feed_mm_per_min=0.6 * feed,
        plunge_mm_per_min=0.3 * feed)
    facts = {"allowance_mm": ROUGH_ALLOWANCE_MM, "stepdown_mm": rules.stepdown_mm, "stepover_mm": rules.stepover_mm,
             "rows_along": "XY"[along], "candidates": [c.as_dict() for c in candidates]}
    return shop.operation("rough", tool, rpm, rough(rules), facts)


def _ball_passes(shop, name, tool, allowance_mm, scallop_mm, candidates, reach):
    """Section passes over all faces wanted with one ball."""
    tolerance = _tolerance_mm(shop.design.finish)
    planner = ProfilePlanner(shop.solid, shop.plane, tool.cutter.radius_mm, allowance_mm, tolerance,
                             shop.machine.control.arc_max_radius_mm)
    ridge_mm = _ridge_mm(name, scallop_mm, shop.design.finish)
    step = _plane_step(shop, tool.cutter.radius_mm, ridge_mm)
    low, high = planner.extent(*shop.box)
    wanted = set(shop.wanted)
    passes = [planner.section_pass(c, low, high, wanted) for c in planes_across(*_across_range(shop, tool, reach), step)]
    passes = [p for p in passes if p is not None]
    if not passes:
        raise PlanError(f"{name}: no section plane meets the faces {shop.setup.faces}")
    rpm, feed = shop.speeds(tool, is_rough=False)
    moves = moves_of_passes(passes, shop.plane, _link_rules(shop, tool, allowance_mm, feed))
    steps = np.diff([p.across_mm for p in passes])
    facts = {"allowance_mm": allowance_mm, "scallop_mm": scallop_mm, "segment_tolerance_mm": tolerance,
             "ridge_for_step_mm": round(ridge_mm, 6), "stepover_mm": round(float(steps.max(initial=0.0)), 6),
             "stepover_min_mm": round(float(steps.min(initial=np.inf)), 6) if len(steps) else 0.0,
             "passes": len(passes), "section_plane": shop.plane.name, "links": shop.setup.passes,
             "min_concave_radius_mm": _finite(shop.hollow.radius_mm),
             "min_concave_place_mm": [round(x, 4) for x in shop.hollow.place_mm],
             "candidates": [c.as_dict() for c in candidates]}
    return shop.operation(name, tool, rpm, moves, facts)


def _tolerance_mm(finish):
    """What the fitted path may deviate, the post's rounding kept back."""
    return finish.profile_tolerance_mm - ROUNDING_MM


def _ridge_mm(name, scallop_mm, finish):
    """Scallop height to choose the step for: the ridge may stand on a path that is high by its tolerance.

    Raises:
        PlanError: the tolerance leaves nothing for the ridge.
    """
    ridge_mm = scallop_mm - finish.profile_tolerance_mm
    if ridge_mm <= 0 or _tolerance_mm(finish) <= 0:
        raise PlanError(f"{name}: a cusp of {scallop_mm} mm and a profile tolerance of {finish.profile_tolerance_mm} mm "
                        f"do not go together: the tolerance must lie between {ROUNDING_MM} mm and the cusp")
    return ridge_mm


def _rest(shop, ball, tool, candidates):
    """Passes of a smaller ball where the finishing ball was held off."""
    finish = shop.design.finish
    tolerance, ridge_mm = _tolerance_mm(finish), _ridge_mm("rest finish", finish.scallop_mm, finish)
    rpm, feed = shop.speeds(tool, is_rough=False)
    small, large = (ProfilePlanner(shop.solid, shop.plane, t.cutter.radius_mm, 0.0, tolerance,
                                   shop.machine.control.arc_max_radius_mm) for t in (tool, ball))
    moves, facts = rest_passes(small, large, set(shop.wanted), shop.box, ridge_mm, _link_rules(shop, tool, 0.0, feed))
    facts = {"allowance_mm": 0.0, "scallop_mm": finish.scallop_mm, "segment_tolerance_mm": tolerance,
             **facts, "candidates": [c.as_dict() for c in candidates]}
    return shop.operation("rest finish", tool, rpm, moves, facts)


def _link_rules(shop, tool, allowance_mm, feed):
    return LinkRules(mesh=shop.mesh, ball_radius_mm=tool.cutter.radius_mm, allowance_mm=allowance_mm,
                     lead_radius_mm=min(2.0, tool.cutter.radius_mm), clearance_z_mm=shop.clearance_z_mm,
                     approach_z_mm=shop.clearance_z_mm - CLEARANCE_MM + APPROACH_MM, feed_mm_per_min=feed,
                     plunge_mm_per_min=0.3 * feed, is_one_way=shop.setup.passes == "one-way")


def _across_range(shop, tool, reach):
    """First and last plane: where the ball's centre stands when it touches the outermost points."""
    k, r = shop.plane.across, tool.cutter.radius_mm
    rims = [shop.faces[i].shape_at(*_rim(shop.faces[i])) for i in shop.wanted]
    centers = np.concatenate([rim.point_mm[:, k] + r * rim.normal[:, k] for rim in rims] + [reach.tip_mm[:, k]])
    return float(centers.min()), float(centers.max())


def _rim(face):
    """Parameters along the border of the face's domain."""
    u0, u1, v0, v1 = face.nurbs.domain
    t = np.linspace(0.0, 1.0, 33)
    u = np.concatenate([u0 + t * (u1 - u0), u0 + t * (u1 - u0), np.full(33, u0), np.full(33, u1)])
    v = np.concatenate([np.full(33, v0), np.full(33, v1), v0 + t * (v1 - v0), v0 + t * (v1 - v0)])
    return u, v


def _plane_step(shop, radius_mm, ridge_mm):
    """Function (low, high) -> widest plane step for planes between two across coordinates.

    Across the surface the step follows from the curvature there; the planes' own distance is that
    times the cosine of the surface's slope across (FORMULAS 4).
    """
    samples, k = shop.samples, shop.plane.across
    usable = samples.across_per_mm * radius_mm > -0.98      # a hollow that the ball does not enter
    chord = stepover_for_scallop_mm(radius_mm, ridge_mm, samples.across_per_mm[usable])
    slope = np.sqrt(np.maximum(1.0 - samples.normal[usable][:, k] ** 2, 1e-6))
    # neighbouring contacts lie on the surface, the planes cut the centres: closer together in a hollow
    spread = 1.0 + radius_mm * samples.across_per_mm[usable]
    allowed = chord * slope * np.minimum(spread, 1.0)
    at = samples.point_mm[usable][:, k] + radius_mm * samples.normal[usable][:, k]
    order = np.argsort(at)
    at, allowed = at[order], allowed[order]
    widest = float(allowed.min())

    def step(low, high):
        first, last = np.searchsorted(at, [low - widest, high + widest])
        return float(allowed[first:last].min()) if last > first else widest

    return step


def _finite(value):
    return round(float(value), 6) if np.isfinite(value) else None
