"""Cutters and inclinations that could cut a leaning operation's faces, side by side, for plan.json: what fits, why not, step, time.

Each is posed at places taken evenly of the faces, along the feed and against it, and looked at there as the plan looks at its
moves: the cutter against the exact faces, what is above it against the part's triangles.
"""

import math

import numpy as np

from cuspline.planning.context import aside_rad
from cuspline.planning.corner_gouges import bottom_depths_mm, least_bend_per_mm
from cuspline.planning.leaning_finishing import FITS_MM, margins_mm
from cuspline.replay.clearance import shank_and_holder
from cuspline.scallop.stepover import stepover_for_scallop_mm
from cuspline.toolpaths.five_axis.corner_contact import CornerContact
from cuspline.toolpaths.five_axis.tool_axes import LEANING, FastestAxis, LeadTilt
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import PlanError, ToolpathError

LEADS_DEG = (3.0, 5.0, 8.0, 12.0, 20.0, 30.0)
PLACES = 30
MOST_TRIED = 6              # cutters and leads that are planned until one can be
NEAR_MM = 0.01              # how closely the way to holder and shank is measured
LOST = 0.05                 # sine of the angle to the normal below which a feed says nothing
FLATTEST = -0.9             # of one over the radius: a hollow that is tighter is told, not stepped over


def fastest(work, ridge_mm, widest_radii, plan):
    """What `plan` makes of the fastest cutter and lead that fit, of those of an operation with a FastestAxis.

    Args:
        work, ridge_mm, widest_radii: as of `compared`.
        plan: function of a tool's number and a LeadTilt; may raise PlanError or ToolpathError.
    Returns:
        (what it makes, [str] why faster ones that seemed to fit were not taken).
    Raises:
        PlanError: none of those tried can be planned.
    """
    rows = compared(work, ridge_mm, widest_radii)
    fits = sorted((r for r in rows if r["fits"]), key=lambda r: (r["estimated_time_s"], r["tool"], r["lead_deg"]))
    why = []
    for row in fits[:MOST_TRIED]:
        try:
            return plan(row["tool"], work.operation.tool_axis.leading(row["lead_deg"])), why
        except (PlanError, ToolpathError) as error:
            why.append(f"T{row['tool']} leading by {row['lead_deg']:g} degrees: {error}")
    raise PlanError(f"{work.operation.title}: of {len(rows)} cutters and leads {len(fits)} fit, and none of the fastest "
                    f"{len(why)} can be planned; the first: {why[0] if why else rows[0]['reason']}")


def compared(work, ridge_mm, widest_radii):
    """[dict] of every cutter of the library that the operation may take and lead, its own lead among them.

    Args:
        work: PlanningContext of an operation with a LeadTilt or FastestAxis.   ridge_mm: cusp that the steps are for.
        widest_radii: of a cutter's radius, that no step is wider.
    """
    axis, samples = work.tool_axis, work.samples
    leads = axis.leads_deg if isinstance(axis, FastestAxis) else (*LEADS_DEG, axis.lead_deg)
    leading = axis.leading(leads[0]) if isinstance(axis, FastestAxis) else axis
    rows = np.unique(np.linspace(0, len(samples.point_mm) - 1, PLACES).astype(int))
    places, normals = samples.point_mm[rows], samples.normal[rows]
    turn = math.radians(getattr(work.operation, "angle_deg", 0.0))
    feed = np.array([fixed.cos(turn), fixed.sin(turn), 0.0])
    ahead = feed - fixed.matmul(normals, feed)[:, None] * normals
    size = np.sqrt((ahead * ahead).sum(axis=1))
    usable = size > LOST
    poses = _Poses(work, *(np.vstack([a[usable], a[usable]]) for a in (places, normals)),
                   np.vstack([s * ahead[usable] / size[usable, None] for s in (1.0, -1.0)]))
    found = []
    for tool in (t for t in work.library.of_type(*LEANING) if isinstance(axis, LeadTilt) or work.is_asked(t)):
        for lead in sorted(set(leads) if tool.cutter.type != "ball" else {leading.lead_deg}):
            found.append(_of_one(work, tool, leading.model_copy(update={"lead_deg": lead}), poses, ridge_mm, widest_radii))
    return found


class _Poses:
    """Places of the faces and feeds along them."""

    def __init__(self, work, places, normals, feeds):
        self.work, self.places, self.normals, self.feeds = work, places, normals, feeds


def _of_one(work, tool, axis, poses, ridge_mm, widest_radii):
    """One row of the table."""
    cutter = tool.cutter
    row = {"tool": tool.number, "name": cutter.name, "type": cutter.type, "diameter_mm": cutter.diameter_mm,
           "lead_deg": axis.lead_deg, "tilt_deg": axis.tilt_deg}
    try:
        corner = None if cutter.type == "ball" else CornerContact.of(
            cutter, math.radians(axis.lead_deg), math.radians(axis.tilt_deg), aside_rad(axis, work.operation))
    except ToolpathError as error:
        return {**row, "fits": False, "reason": str(error)}
    axes = axis.axes(poses.places, poses.normals, poses.feeds)
    radius = cutter.radius_mm if corner is None else corner.across_mm
    if corner is None:
        tips = poses.places + radius * (poses.normals - axes)
        reason = _why_not_ball(poses, radius)
    else:
        tips = poses.places + corner.ball_radius_mm * poses.normals + corner.tips_off(poses.normals, axes)
        reason = _why_not_corner(poses, tips, axes, corner)
    reason = reason or _why_not_above(poses, tool, tips, axes)
    samples = work.samples
    bend = np.maximum(samples.across_per_mm, FLATTEST / radius)
    steps = np.minimum(stepover_for_scallop_mm(radius, ridge_mm, bend), widest_radii * cutter.radius_mm)
    seconds = float((samples.area_mm2 / steps).sum() / work.speeds(tool, is_rough=False)[1] * 60.0)
    return {**row, "fits": reason is None, "reason": reason, "radius_across_mm": round(radius, 4),
            "stepover_mm": round(float(steps.min()), 4), "cusp_mm": round(ridge_mm, 6), "estimated_time_s": round(seconds, 1)}


def _why_not_ball(poses, radius):
    near = poses.work.closest.closest_points(poses.places + radius * poses.normals).distance_mm
    deep = radius - near
    return None if deep.max() <= FITS_MM else f"meets other faces by {deep.max():.3f} mm"


def _why_not_corner(poses, tips, axes, corner):
    bend = least_bend_per_mm(poses.work.closest_of(tuple(poses.work.wanted)), poses.places, poses.normals, axes, corner)
    if bend.min() < 0.0:
        return f"flatter than the faces at {(bend < 0.0).mean():.0%} of the places"
    deep = bottom_depths_mm(poses.work.closest, tips, axes, corner).max()
    return None if deep <= FITS_MM else f"its bottom would cut {deep:.3f} mm into the part"


def _why_not_above(poses, tool, tips, axes):
    work = poses.work
    _, keep = margins_mm(work)
    for what, segments, kept in zip(("neck or shank", "holder"), shank_and_holder(tool), keep):
        least = float(work.obstacle_tree.distances_mm(segments, tips, axes, NEAR_MM).min()) if len(segments) else math.inf
        if least < kept:
            return f"its {what} would come to {least:.2f} mm of the part, {kept:.2f} mm are kept"
    return None
