"""From passes to moves: lead-in, lead-out, links that lift only as far as is safe.

Passes are (along, up) elements in section planes; moves are tip positions in the part frame.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.program.program import MoveWriter, Plane
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm
from cuspline.toolpaths.sections.profile_passes import reversed_element
from cuspline.values import fixed_math as fixed

LEAD_ANGLE_RAD = math.radians(60)
LINK_SAMPLES = 9
LINK_MARGIN_MM = 0.1        # above the deviation of the planning mesh
SAME_PASS_MM = 1e-7         # passes whose ends differ by less across the step are the same section


@dataclass(frozen=True, eq=False, kw_only=True)
class LinkRules:
    """How a ball gets from pass to pass."""

    mesh: object                    # DropMesh of the part, part frame
    ball_radius_mm: float
    allowance_mm: float
    lead_radius_mm: float
    clearance_z_mm: float           # rapids across run here
    approach_z_mm: float            # from here down the tool feeds: above all stock that may be left
    feed_mm_per_min: float
    plunge_mm_per_min: float
    is_one_way: bool


def moves_of_passes(passes, plane, rules):
    """All moves of one operation, from and back to the clearance plane.

    Args:
        passes: SectionPasses in the order they are cut; those of every second plane are cut backward.
        plane: SectionPlane.
        rules: LinkRules.
    Returns:
        Moves in the part frame; the first begins at the clearance plane above the first pass.
    """
    writer, previous, forward = None, None, True
    for section in passes:
        if not rules.is_one_way and previous is not None and section.across_mm != previous[0].across_mm:
            forward = not forward           # to and fro, plane by plane
        elements = section.elements if forward else tuple(reversed_element(e) for e in reversed(section.elements))
        lead = _lead(elements[0], plane, section.across_mm, rules, at_start=True)
        first = plane.lift(lead[0] if lead else elements[0].start, section.across_mm)[0]
        if writer is None:
            writer = MoveWriter(np.r_[first[:2], rules.clearance_z_mm])
        if previous is None or rules.is_one_way or not _links(writer, elements, plane, section, previous[0], rules):
            if previous is not None:
                _leave(writer, previous, plane, rules)
            enter(writer, first, rules)
            if lead:
                _, center, is_left = lead
                _arc_move(writer, elements[0].start, center, is_left, plane, section.across_mm, rules.feed_mm_per_min)
        _cut(writer, elements, plane, section.across_mm, rules.feed_mm_per_min)
        previous = section, elements
    _leave(writer, previous, plane, rules)
    return writer.moves()


def _cut(writer, elements, plane, across, feed):
    for e in elements:
        _element_move(writer, e, plane, across, feed)


def _element_move(writer, e, plane, across, feed):
    if e.center is None:
        writer.feed(plane.lift(e.end, across)[0], feed)
        return
    _arc_move(writer, e.end, e.center, e.is_left, plane, across, feed)


def _arc_move(writer, end, center, is_left, plane, across, feed):
    """An arc in the section plane; left in (along, up) is counter-clockwise seen from -Y (ZX) or +X (YZ)."""
    is_clockwise = is_left if plane.along == 0 else not is_left
    writer.arc(plane.lift(end, across)[0], plane.lift(center, across)[0],
               Plane.ZX if plane.along == 0 else Plane.YZ, is_clockwise, feed)


def _heading(e, at_start):
    """Direction of travel at an element's end."""
    (x0, z0), (x1, z1) = e.start, e.end
    if e.center is None:
        return fixed.arctan2(z1 - z0, x1 - x0)
    x, z = e.start if at_start else e.end
    turn = 1 if e.is_left else -1
    return fixed.arctan2(turn * (x - e.center[0]), -turn * (z - e.center[1]))


def _lead(element, plane, across, rules, at_start):
    """A tangent arc on the air side as (outer point, centre, is_left), or None where it would not be clear."""
    heading = _heading(element, at_start)
    side = 1 if fixed.cos(heading) >= 0 else -1              # air lies to the left when running forward
    point = np.array(element.start if at_start else element.end)
    center = point + rules.lead_radius_mm * side * np.array([-fixed.sin(heading), fixed.cos(heading)])
    turn = (-1 if at_start else 1) * side * LEAD_ANGLE_RAD
    angles = np.linspace(0.0, turn, LINK_SAMPLES)
    arm = point - center
    spots = center + np.column_stack([arm[0] * fixed.cos(angles) - arm[1] * fixed.sin(angles),
                                      arm[0] * fixed.sin(angles) + arm[1] * fixed.cos(angles)])
    if not _is_clear(plane.lift(spots[1:], across), rules):
        return None
    return spots[-1], center, side > 0


def _is_clear(tips, rules):
    """No tip position cuts into the part, to the accuracy of the planning mesh."""
    return bool((tips[:, 2] >= _floor(tips[:, :2], rules) - 1e-9).all())


def _floor(xy, rules):
    """(n,) lowest tip heights that certainly keep the allowance."""
    r = rules.ball_radius_mm + rules.allowance_mm
    return drop_tips_mm(rules.mesh, xy, r, r) + rules.allowance_mm


def enter(writer, first, rules):
    """Rapid over the first point at the clearance plane, rapid to the approach height, feed down."""
    writer.rapid(np.r_[writer.here_mm[:2], rules.clearance_z_mm])
    writer.rapid(np.r_[first[:2], rules.clearance_z_mm])
    writer.rapid(np.r_[first[:2], max(rules.approach_z_mm, first[2])])
    writer.feed(first, rules.plunge_mm_per_min)


def _leave(writer, previous, plane, rules):
    """Tangent arc out, then up to the clearance plane."""
    section, elements = previous
    exit_ = _lead(elements[-1], plane, section.across_mm, rules, at_start=False)
    if exit_:
        outer, center, is_left = exit_
        _arc_move(writer, outer, center, is_left, plane, section.across_mm, rules.feed_mm_per_min)
    writer.rapid(np.r_[writer.here_mm[:2], rules.clearance_z_mm])


def _links(writer, elements, plane, section, previous, rules):
    """Go on to the next pass near the surface; False where that is not possible.

    Ends of the same section are joined straight.  Others are joined over the highest point in
    between, up and down at feed, when that stays below the clearance plane.
    """
    here, there = writer.here_mm, plane.lift(elements[0].start, section.across_mm)[0]
    same = abs(here[2] - there[2]) < SAME_PASS_MM and abs(here[plane.along] - there[plane.along]) < SAME_PASS_MM
    if same and section.owners == previous.owners:
        writer.feed(there, rules.feed_mm_per_min)
        return True
    share = np.linspace(0.0, 1.0, LINK_SAMPLES)[:, None]
    way = here + share * (there - here)
    if fixed.length(way[-1, :2] - way[0, :2]) > 4 * rules.ball_radius_mm:
        return False
    top = max(_floor(way[:, :2], rules).max(), here[2], there[2]) + LINK_MARGIN_MM
    if top >= rules.clearance_z_mm:
        return False
    writer.feed(np.r_[here[:2], top], rules.feed_mm_per_min)
    writer.feed(np.r_[there[:2], top], rules.feed_mm_per_min)
    writer.feed(there, rules.feed_mm_per_min)
    return True

