"""Finishing and semi-finishing passes of the Z-profile kind: one section plane after the other.

Each pass is the upper envelope of the ball's centre in its plane, cut to the faces wanted, fitted
with arcs and lines and let down by the ball radius: the programmed point is the ball's south pole.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from cuspline.toolpaths.sections.arcfit import FittedElement, fit_arcs, line_between
from cuspline.toolpaths.sections.ball_centers import WALL_MM, CenterSections
from cuspline.toolpaths.sections.envelope import upper_envelope
from cuspline.toolpaths.sections.section_pieces import EDGE_RANK, NO_FACE, ArcPiece, CurvePiece, LinePiece
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import ToolpathError

EXTENT_MARGIN_MM = 1e-5     # the rolling circles about the outermost corners end level: stay just inside
TANGENT_RAD = 2e-3          # curve pieces that meet at less are one smooth run
# a ball that rolls over an edge too low by e cuts e / cos(angle) off it, seen along either face's normal
EDGE_SHARE = 0.4
GAP_SAMPLES = 9             # a piece between wanted faces is looked at in so many places
MERGE_MM = 1e-5             # runs shorter than this are artefacts of a crossing


@dataclass(frozen=True, eq=False, kw_only=True)
class SectionPass:
    """One pass in one section plane, tip positions, in the direction of rising `along`."""

    across_mm: float
    elements: tuple[FittedElement, ...]     # (along, up) of the ball's south pole
    owners: tuple[int, ...]                 # face index touched by each element; NO_FACE: edge or corner

    @property
    def start(self):
        return self.elements[0].start

    @property
    def end(self):
        return self.elements[-1].end


class ProfilePlanner:
    """Passes over chosen faces of one solid with one ball."""

    def __init__(self, solid, plane, ball_radius_mm, allowance_mm, tolerance_mm, largest_radius_mm):
        """
        Args:
            solid: TopoDS solid.
            plane: surfaces.sections.SectionPlane.
            ball_radius_mm: radius of the cutter.
            allowance_mm: material to leave, 0 for finishing.
            tolerance_mm: largest distance of fitted elements from the exact centre curve.
            largest_radius_mm: flatter arcs become lines.
        """
        self.plane = plane
        self.ball_radius_mm, self.allowance_mm = ball_radius_mm, allowance_mm
        self.tolerance_mm, self.largest_radius_mm = tolerance_mm, largest_radius_mm
        self.centers = CenterSections(solid, plane, ball_radius_mm + allowance_mm)
        self._fits = {}

    def extent(self, box_min, box_max):
        """Along range in which something lies beneath the ball."""
        r = self.ball_radius_mm + self.allowance_mm - EXTENT_MARGIN_MM
        return box_min[self.plane.along] - r, box_max[self.plane.along] + r

    def chain(self, across, low, high):
        """The centre's envelope in one plane: (pieces, owners, walls); vertical lines belong to their wall's face."""
        pieces, walls = self.centers.pieces(across)
        # where the plane passes beside the part or over a hole, the ball goes no deeper than the part's base
        base = self.centers.lowest_mm
        pieces.append(LinePiece(start=np.array([low, base]), end=np.array([high, base]), owner=NO_FACE))
        chain = [p for p in upper_envelope(pieces, low, high)
                 if np.abs(p.end - p.start).max() > MERGE_MM]
        return chain, [_owner(p, walls) for p in chain], walls

    def section_passes(self, across, low, high, wanted):
        """The passes over the wanted faces in one plane, by rising `along`; none where it meets none of them.

        Between wanted faces the ball goes on over whatever lies there, unless that leads it down by more
        than its radius, into a hole: there the pass ends and another begins behind it.
        """
        chain, owners, _ = self.chain(across, low, high)
        rows = [k for k, owner in enumerate(owners) if owner in wanted]
        ends = [k for k, (a, b) in enumerate(zip(rows[:-1], rows[1:])) if b > a + 1 and self._leads_down(chain, a, b)]
        runs = np.split(rows, np.array(ends, int) + 1) if rows else []
        return [self.fitted_pass(across, chain[run[0]:run[-1] + 1], owners[run[0]:run[-1] + 1]) for run in runs]

    def _leads_down(self, chain, first, last):
        """What lies between two pieces of the chain takes the ball down by more than its radius."""
        between = chain[first + 1:last]
        floor = min(chain[first].end[1], chain[last].start[1]) - self.ball_radius_mm
        return any(np.min(p.up_at(np.linspace(p.start[0], p.end[0], GAP_SAMPLES)), initial=p.end[1]) < floor
                   if p.end[0] - p.start[0] > MERGE_MM else min(p.start[1], p.end[1]) < floor for p in between)

    def fitted_pass(self, across, chain, owners):
        """Arcs and lines for a chain of centre pieces, let down to the tip."""
        elements, element_owners = [], []
        for run, owner in _smooth_runs(chain, owners):
            fitted = self._fitted(run)
            elements += fitted
            element_owners += [owner] * len(fitted)
        down = [_shifted(e, -self.ball_radius_mm) for e in _joined(elements)]
        return SectionPass(across_mm=float(across), elements=tuple(down), owners=tuple(element_owners))

    def _fitted(self, run):
        first = run[0]
        if isinstance(first, LinePiece):
            return [line_between(first.start, first.end)]
        if isinstance(first, ArcPiece):
            return self._arc(first)
        points, headings, breaks = _sampled_run(run)
        key = np.round(points, 9).tobytes()
        if key not in self._fits:
            over_edge = any(p.owner == NO_FACE or p.rank == EDGE_RANK for p in run)
            tolerance = self.tolerance_mm * (EDGE_SHARE if over_edge else 1.0)
            self._fits[key] = fit_arcs(points, headings, tolerance, self.largest_radius_mm, breaks)
        return self._fits[key]

    def _arc(self, piece):
        """The arc itself; one too flat for the control as chords within the tolerance."""
        if piece.radius > self.largest_radius_mm:
            longest = math.sqrt(8 * piece.radius * self.tolerance_mm)
            count = math.ceil(float(fixed.length(piece.end - piece.start)) / longest)
            along = np.linspace(piece.start[0], piece.end[0], count + 1)
            points = np.vstack([piece.start, np.column_stack([along, piece.up_at(along)])[1:-1], piece.end])
            return [line_between(a, b) for a, b in zip(points[:-1], points[1:])]
        return [FittedElement(start=tuple(map(float, piece.start)), end=tuple(map(float, piece.end)),
                              center=tuple(map(float, piece.center)), radius=float(piece.radius),
                              is_left=not piece.is_over)]


def planes_across(low_mm, high_mm, step_at):
    """Across coordinates of the section planes from low to high.

    Args:
        low_mm, high_mm: first and last plane, both cut.
        step_at: function (across_low, across_high) -> widest plane step allowed in between.
    Returns:
        list of floats; steps are as wide as allowed, evened out where the allowance is constant.
    """
    planes = [low_mm]
    while planes[-1] < high_mm - 1e-9:
        here = planes[-1]
        widest = step_at(here, min(high_mm, here + step_at(here, here)))
        left = math.ceil((high_mm - here) / widest - 1e-9)
        planes.append(high_mm if left <= 1 else here + min(widest, (high_mm - here) / left))
        if len(planes) > 1_000_000:
            raise ToolpathError(f"more than a million section planes from {low_mm} to {high_mm} mm: "
                                "the wanted scallop is too small")
    return planes


def smallest_step(at_mm, allowed_mm, margin_mm, elsewhere_mm):
    """For `planes_across`: function (low, high) -> smallest step allowed between two across coordinates.

    Args:
        at_mm: (n,) across coordinates of the places that allow steps.
        allowed_mm: (n,) what they allow.
        margin_mm: places so far outside low and high count as between.
        elsewhere_mm: the step where there are none.
    """
    order = np.argsort(at_mm, kind="stable")
    at, allowed = at_mm[order], allowed_mm[order]

    def step_at(low, high):
        first, last = np.searchsorted(at, [low - margin_mm, high + margin_mm])
        return float(allowed[first:last].min()) if last > first else elsewhere_mm

    return step_at


def reversed_element(element):
    """The same element run the other way."""
    return replace(element, start=element.end, end=element.start, is_left=not element.is_left)


def _owner(piece, walls):
    """Face that a piece touches; a vertical line belongs to the wall it slides along."""
    if piece.owner != NO_FACE or abs(piece.end[0] - piece.start[0]) > 1e-9:
        return piece.owner
    low, high = sorted((piece.start[1], piece.end[1]))
    for wall in walls:
        if abs(wall.along - piece.start[0]) < WALL_MM and wall.low < high and wall.high > low:
            return wall.owner
    return NO_FACE


def _smooth_runs(chain, owners):
    """Group consecutive curve pieces that join tangentially; lines and arcs stay alone."""
    runs = []
    for piece, owner in zip(chain, owners):
        joins = (runs and isinstance(piece, CurvePiece) and isinstance(runs[-1][0][-1], CurvePiece)
                 and abs(runs[-1][0][-1].headings()[1] - piece.headings()[0]) < TANGENT_RAD)
        if joins:
            runs[-1][0].append(piece)
        else:
            runs.append(([piece], owner))
    return runs


def _sampled_run(run):
    """Exact points and heading angles of consecutive curve pieces, joints once, and the joints' rows."""
    points = np.vstack([run[0].points] + [p.points[1:] for p in run[1:]])
    headings = np.concatenate([fixed.arctan(run[0].slopes)] + [fixed.arctan(p.slopes[1:]) for p in run[1:]])
    keep = np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 3e-6]
    keep[-1] = True
    joints = np.cumsum([len(p.points) - 1 for p in run[:-1]]).astype(int)
    return points[keep], headings[keep], np.cumsum(keep)[joints] - 1


def _joined(elements):
    """Make each element begin exactly where the one before ends."""
    out = list(elements[:1])
    for e in elements[1:]:
        out.append(replace(e, start=out[-1].end))
    return out


def _shifted(element, up):
    move = lambda p: None if p is None else (p[0], p[1] + up)
    return replace(element, start=move(element.start), end=move(element.end), center=move(element.center))
