"""Parts with closed-form centre curves, made in CadQuery, for section planes of both kinds.

A profile is drawn in (along, up) and swept across: along = x, across = y for ZX, the other way for YZ.
"""

import math
from dataclasses import dataclass

import cadquery as cq
import numpy as np

from cuspline.kernel.brep import bounding_box_mm, the_solid
from cuspline.surfaces.sections import SectionPlane
from cuspline.toolpaths.sections.profile_passes import ProfilePlanner

TOLERANCE_MM = 0.0024
LARGEST_RADIUS_MM = 1e4
JOIN_MM = 1e-5          # pieces shorter than this are left out of a chain (profile_passes.MERGE_MM)


@dataclass(frozen=True)
class Drawing:
    """Edges of a profile in the section plane, `across` millimetres from zero."""

    plane: str = "ZX"
    across: float = 0.0

    def at(self, along, up):
        return cq.Vector(along, self.across, up) if self.plane == "ZX" else cq.Vector(self.across, along, up)

    def direction(self, along, up):
        return cq.Vector(along, 0, up) if self.plane == "ZX" else cq.Vector(0, along, up)

    def line(self, start, end):
        return cq.Edge.makeLine(self.at(*start), self.at(*end))

    def arc(self, center, radius, from_deg, to_deg):
        """Counter-clockwise from `along` toward `up`."""
        points = [self.at(center[0] + radius * math.cos(math.radians(d)), center[1] + radius * math.sin(math.radians(d)))
                  for d in (from_deg, (from_deg + to_deg) / 2, to_deg)]
        return cq.Edge.makeThreePointArc(*points)

    def ellipse(self, center, along_mm, up_mm, from_deg, to_deg):
        """Eccentric angles, counter-clockwise from `along` toward `up`."""
        normal = self.direction(1, 0).cross(self.direction(0, 1))
        if along_mm >= up_mm:
            return cq.Edge.makeEllipse(along_mm, up_mm, self.at(*center), normal, self.direction(1, 0),
                                       from_deg, to_deg)
        return cq.Edge.makeEllipse(up_mm, along_mm, self.at(*center), normal, self.direction(0, 1),
                                   from_deg - 90, to_deg - 90)

    def bezier(self, *points):
        return cq.Edge.makeBezier([self.at(*p) for p in points])

    def closed(self, edges, first, last, base=0.0):
        """The profile from first to last with walls down to the base."""
        sides = [self.line(last, (last[0], base)), self.line((last[0], base), (first[0], base)),
                 self.line((first[0], base), first)]
        return cq.Wire.assembleEdges(list(edges) + sides)


def swept(drawing, wire, width=20.0, rise_deg=0.0):
    """The profile swept `width` across, rising by an angle."""
    rise = width * math.tan(math.radians(rise_deg))
    way = cq.Vector(0, width, rise) if drawing.plane == "ZX" else cq.Vector(width, 0, rise)
    return the_solid(cq.Solid.extrudeLinear(wire, [], way))


def planner(solid, plane, radius, allowance=0.0):
    return ProfilePlanner(solid, SectionPlane.named(plane), radius, allowance, TOLERANCE_MM, LARGEST_RADIUS_MM)


def chain_of(solid, plane, radius, across=7.3):
    """The centre's chain over all of the solid in one plane."""
    p = planner(solid, plane, radius)
    return p.chain(across, *p.extent(*bounding_box_mm(solid)))[0]


def up_of(chain, along):
    """(n,) height of a chain, at most JOIN_MM beside one of its pieces; -inf elsewhere."""
    along = np.atleast_1d(np.asarray(along, float))
    up = np.full(len(along), -np.inf)
    for reach in (0.0, JOIN_MM):
        open_ = np.isinf(up)
        for piece in chain:
            if piece.span[1] - piece.span[0] > 1e-12:
                inside = open_ & (along >= piece.span[0] - reach) & (along <= piece.span[1] + reach)
                up[inside] = np.maximum(up[inside], piece.up_at(np.clip(along[inside], *piece.span)))
    return up


def largest_gap_mm(chain):
    return max((float(np.abs(b.start - a.end).max()) for a, b in zip(chain, chain[1:])), default=0.0)
