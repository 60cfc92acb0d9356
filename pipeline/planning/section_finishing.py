"""Finishing in section planes: a ball along the part's profile, plane by plane, in arcs and lines."""

import numpy as np

from cuspline.planning.context import finite, path_tolerance_mm, ridge_for_step_mm
from cuspline.scallop.stepover import stepover_for_scallop_mm
from cuspline.toolpaths.sections.pass_links import LinkRules, moves_of_passes
from cuspline.toolpaths.sections.profile_passes import ProfilePlanner, planes_across, smallest_step
from cuspline.toolpaths.sections.rest_passes import rest_passes
from cuspline.values.errors import PlanError

ROWS_BESIDE = 2.0           # largest gaps between samples, that are looked at beside every step


def finish(work, stage, tool, candidates, reach, within=((-np.inf, np.inf),)):
    """Section passes over all faces wanted with one ball; `stage` is a FinishingStage.

    `within`: (first, last) places of the planes; those that lie in none of these stretches are left out.
    """
    name, allowance_mm, scallop_mm = stage.name, stage.allowance_mm, stage.scallop_mm
    tolerance = path_tolerance_mm(work.finish)
    planner = ProfilePlanner(work.solid, work.plane, tool.cutter.radius_mm, allowance_mm, tolerance,
                             work.machine.control.arc_max_radius_mm)
    ridge_mm = ridge_for_step_mm(name, scallop_mm, work.finish)
    step = _plane_step(work, tool.cutter.radius_mm, ridge_mm)
    low, high = planner.extent(*work.box)
    wanted = set(work.wanted)
    across = planes_across(*_across_range(work, tool, reach), step)
    planes = [planner.section_passes(c, low, high, wanted) for c in across
              if any(first <= c <= last for first, last in within)]
    passes = _in_cutting_order([plane for plane in planes if plane], work.operation.passes == "one-way")
    if not passes:
        raise PlanError(f"{name}: no section plane meets the faces {work.face_names}")
    rpm, feed = work.speeds(tool, is_rough=False)
    moves = moves_of_passes(passes, work.plane, _link_rules(work, tool, allowance_mm, feed))
    steps = np.diff(np.unique([p.across_mm for p in passes]))
    facts = {"allowance_mm": allowance_mm, "scallop_mm": scallop_mm, "segment_tolerance_mm": tolerance,
             "ridge_for_step_mm": round(ridge_mm, 6), "stepover_mm": round(float(steps.max(initial=0.0)), 6),
             "stepover_min_mm": round(float(steps.min(initial=np.inf)), 6) if len(steps) else 0.0,
             "passes": len(passes), "section_plane": work.plane.name, "links": work.operation.passes,
             "min_concave_radius_mm": finite(work.hollow.radius_mm),
             "min_concave_place_mm": work.in_part(work.hollow.place_mm),
             "candidates": [c.as_dict() for c in candidates]}
    return work.measured(name, tool, rpm, moves, facts)


def _in_cutting_order(planes, is_one_way):
    """Passes plane by plane; every second plane from its far end."""
    return [p for k, plane in enumerate(planes) for p in (plane if is_one_way or k % 2 == 0 else plane[::-1])]


def rest(work, ball, tool, candidates):
    """Passes of a smaller ball where the finishing ball was held off."""
    finish = work.finish
    tolerance, ridge_mm = path_tolerance_mm(finish), ridge_for_step_mm("rest finish", finish.scallop_mm, finish)
    rpm, feed = work.speeds(tool, is_rough=False)
    small, large = (ProfilePlanner(work.solid, work.plane, t.cutter.radius_mm, 0.0, tolerance,
                                   work.machine.control.arc_max_radius_mm) for t in (tool, ball))
    moves, facts = rest_passes(small, large, set(work.wanted), work.box, ridge_mm, _link_rules(work, tool, 0.0, feed))
    facts = {"allowance_mm": 0.0, "scallop_mm": finish.scallop_mm, "segment_tolerance_mm": tolerance,
             **facts, "candidates": [c.as_dict() for c in candidates]}
    return work.measured("rest finish", tool, rpm, moves, facts)


def _link_rules(work, tool, allowance_mm, feed):
    return LinkRules(mesh=work.mesh, ball_radius_mm=tool.cutter.radius_mm, allowance_mm=allowance_mm,
                     lead_radius_mm=work.lead_radius_mm(tool.cutter.radius_mm), clearance_z_mm=work.clearance_z_mm,
                     approach_z_mm=work.clearance_z_mm - work.clearance_mm + work.practice.approach_mm, feed_mm_per_min=feed,
                     plunge_mm_per_min=work.practice.plunge_share * feed, is_one_way=work.operation.passes == "one-way")


def _across_range(work, tool, reach):
    """First and last plane: where the ball's centre stands when it touches the outermost points."""
    k, r = work.plane.across, tool.cutter.radius_mm
    rims = [work.faces[i].shape_at(*_rim(work.faces[i])) for i in work.wanted]
    centers = np.concatenate([rim.point_mm[:, k] + r * rim.normal[:, k] for rim in rims] + [reach.tip_mm[:, k]])
    return float(centers.min()), float(centers.max())


def _rim(face):
    """Parameters along the border of the face's domain."""
    u0, u1, v0, v1 = face.nurbs.domain
    t = np.linspace(0.0, 1.0, 33)
    u = np.concatenate([u0 + t * (u1 - u0), u0 + t * (u1 - u0), np.full(33, u0), np.full(33, u1)])
    v = np.concatenate([np.full(33, v0), np.full(33, v1), v0 + t * (v1 - v0), v0 + t * (v1 - v0)])
    return u, v


def _plane_step(work, radius_mm, ridge_mm):
    """Function (low, high) -> widest plane step for planes between two across coordinates.

    Across the surface the step follows from the curvature there; the planes' own distance is that
    times the cosine of the surface's slope across (docs/formulas.md 5).
    """
    samples, k = work.samples, work.plane.across
    usable = samples.across_per_mm * radius_mm > -0.98      # a hollow that the ball does not enter
    chord = stepover_for_scallop_mm(radius_mm, ridge_mm, samples.across_per_mm[usable])
    slope = np.sqrt(np.maximum(1.0 - samples.normal[usable][:, k] ** 2, 1e-6))
    # neighbouring contacts lie on the surface, the planes cut the centres: closer together in a hollow
    spread = 1.0 + radius_mm * samples.across_per_mm[usable]
    allowed = chord * slope * np.minimum(spread, 1.0)
    at = samples.point_mm[usable][:, k] + radius_mm * samples.normal[usable][:, k]
    smallest = float(allowed.min())
    # on a long face the samples lie farther apart than the planes: those on both sides count for what lies between
    apart = float(np.diff(np.sort(at)).max(initial=0.0))
    return smallest_step(at, allowed, margin_mm=max(smallest, ROWS_BESIDE * apart), elsewhere_mm=smallest)
