r"""The B-rep of a vane and of the quadrupole: poles set directly, so every section x = const is an exact circle.

          ___  tip: rational quadratic (two arcs) across x quintic along
         /   \
        /     \  flanks: ruled from the tangency, α from the vertical, down to the body's width
       |       |
       |       |  body: A wide, down to the base at z = 0
       └───────┘

The x poles are the Greville abscissae, so u = x.  Faces are split into panels of some cells: the kernel's mesher is
superlinear in the size of a face.  Source: measured in the geometry notes this project was begun with; lofting through
sections is micrometres to millimetres wrong.
"""

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeSolid,
    BRepBuilderAPI_MakeWire,
    BRepBuilderAPI_Sewing,
    BRepBuilderAPI_Transform,
)
from OCP.BRepLib import BRepLib
from OCP.gp import gp_Pnt, gp_Trsf
from OCP.TopoDS import TopoDS, TopoDS_Compound

from cuspline.designs.rfq.setups import LEAST_PANEL_MM
from cuspline.kernel.shells import surface_of_poles
from cuspline.toolpaths.vane.circular_tip import greville_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

SEW_MM = 1e-6           # neighbouring faces share their border pole for pole: rounding alone lies between them
EDGE_MM = 1e-7          # the kernel's own confusion


def vane_solid(tip, half_width_mm, joints_mm):
    """TopoDS solid of a vane, base at z = 0.

    Args:
        tip: CircularTip; its flanks lean.
        half_width_mm: half of the body's width.
        joints_mm: x at which the faces are split; those outside the vane are left out.
    Raises:
        DesignError: the body is narrower than the tip, or the flanks reach its base.
    """
    low, high = tip.range_mm
    breaks = [low, *(x for x in joints_mm if low + LEAST_PANEL_MM < x < high - LEAST_PANEL_MM), high]
    arc, flanks, sides = _arc_surface(tip), _flank_surfaces(tip, half_width_mm), _side_surfaces(tip, half_width_mm)
    sewing = BRepBuilderAPI_Sewing(SEW_MM)
    for a, b in zip(breaks[:-1], breaks[1:]):
        for surface in (arc, *flanks):
            sewing.Add(_part(surface, a, b))
        corners = []
        for surface, sign in zip(sides, (1, -1)):
            face, feet = _side_face(surface, a, b, sign * half_width_mm)
            sewing.Add(face)
            corners.append(feet)
        sewing.Add(_polygon([*corners[0], *corners[1][::-1]]))
    for x in (low, high):
        sewing.Add(_end_face(arc, flanks, x, half_width_mm))
    sewing.Perform()
    if sewing.NbFreeEdges():
        raise DesignError(f"the vane's faces leave {sewing.NbFreeEdges()} open edges: check flank angle and width")
    solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell_s(sewing.SewedShape())).Solid()
    BRepLib.OrientClosedSolid_s(solid)
    return solid


def _arc_surface(tip):
    """The tip: angles from one tangency over the crest to the other, two rational arcs."""
    half = tip.half_arc_rad
    turns = np.array([-half, -half / 2, 0.0, half / 2, half])
    weights = np.array([1.0, fixed.cos(half / 2), 1.0, fixed.cos(half / 2), 1.0])
    y, z = fixed.sin(turns) / weights, fixed.cos(turns) / weights
    x = greville_mm(tip.knots_mm, tip.degree)[:, None]
    z0, R = tip.center_poles_mm[:, None], tip.radius_poles_mm[:, None]
    poles = np.stack([np.repeat(x, len(y), axis=1), R * y, z0 + R * z], axis=-1)
    return surface_of_poles(poles, np.tile(weights, (len(x), 1)), tip.knots_mm, (0, 0, 0, 0.5, 0.5, 1, 1, 1),
                            tip.degree, 2)


def _tangency_poles(tip):
    """(n, 2) poles of Y and Z of the tangency."""
    a = tip.flank_half_angle_rad
    return np.column_stack([tip.radius_poles_mm * fixed.cos(a), tip.center_poles_mm + tip.radius_poles_mm * fixed.sin(a)])


def _foot_poles(tip, half_width_mm):
    """(n,) poles of the height at which the flank is as wide as the body."""
    y, z = _tangency_poles(tip).T
    return z - (half_width_mm - y) / fixed.tan(tip.flank_half_angle_rad)


def _flank_surfaces(tip, half_width_mm):
    """Ruled from the tangency to the body, on the sides of +y and -y."""
    (y, z), foot, x = _tangency_poles(tip).T, _foot_poles(tip, half_width_mm), greville_mm(tip.knots_mm, tip.degree)
    return [_ruled(tip, np.column_stack([x, sign * y, z]),
                   np.column_stack([x, np.full_like(x, sign * half_width_mm), foot])) for sign in (1, -1)]


def _side_surfaces(tip, half_width_mm):
    """As the flanks, but down the body's side from the foot to the base: their upper border is the foot's curve."""
    foot, x = _foot_poles(tip, half_width_mm), greville_mm(tip.knots_mm, tip.degree)
    rows = lambda y, z: np.column_stack([x, np.full_like(x, y), z])
    return [_ruled(tip, rows(y, foot), rows(y, 0 * x)) for y in (half_width_mm, -half_width_mm)]


def _ruled(tip, top, bottom):
    """Geom surface, straight from one row of poles (n, 3) to the other: u along the vane on the tip's knots."""
    poles = np.stack([top, bottom], axis=1)
    return surface_of_poles(poles, np.ones(poles.shape[:2]), tip.knots_mm, (0, 0, 1, 1), tip.degree, 1)


def _segment(surface, a, b):
    """The same surface from x = a to b, exactly: its poles are new, its points are not."""
    part = surface.Copy()
    part.Segment(a, b, 0.0, 1.0)
    return part


def _part(surface, a, b):
    return BRepBuilderAPI_MakeFace(_segment(surface, a, b), EDGE_MM).Face()


def _side_face(surface, a, b, y):
    """(plane face between foot and base from x = a to b, its two corners on the base)."""
    part = _segment(surface, a, b)
    top = part.VIso(0.0)
    start, end = top.StartPoint(), top.EndPoint()
    feet = [(start.X(), y, 0.0), (end.X(), y, 0.0)]
    edges = [BRepBuilderAPI_MakeEdge(top).Edge(), _line(end, feet[1]), _line(feet[1], feet[0]), _line(feet[0], start)]
    return BRepBuilderAPI_MakeFace(_wire(edges), True).Face(), feet


def _end_face(arc, flanks, x, half_width_mm):
    """The plane end at x: arc, two flank lines, the body's outline."""
    low = [f.Value(x, 1.0) for f in flanks]
    feet = [(x, half_width_mm, 0.0), (x, -half_width_mm, 0.0)]
    edges = [BRepBuilderAPI_MakeEdge(arc.UIso(x)).Edge(),
             _line(arc.Value(x, 1.0), low[0]), _line(low[0], feet[0]), _line(feet[0], feet[1]), _line(feet[1], low[1]),
             _line(low[1], arc.Value(x, 0.0))]
    return BRepBuilderAPI_MakeFace(_wire(edges), True).Face()


def _polygon(corners):
    edges = [_line(a, b) for a, b in zip(corners, [*corners[1:], corners[0]])]
    return BRepBuilderAPI_MakeFace(_wire(edges), True).Face()


def _line(a, b):
    a, b = (p if isinstance(p, gp_Pnt) else gp_Pnt(*map(float, p)) for p in (a, b))
    return BRepBuilderAPI_MakeEdge(a, b).Edge()


def _wire(edges):
    made = BRepBuilderAPI_MakeWire()
    for edge in edges:
        made.Add(edge)
    return made.Wire()


# the quadrupole -------------------------------------------------------------------------------------------


def quadrupole(x_vane, y_vane, axis_z_mm):
    """Compound of four vanes round the beam: x vanes left and right, y vanes above and below.

    Args:
        x_vane, y_vane: solids in their part frames, the beam axis at z = axis_z_mm.
    Returns:
        TopoDS compound; the beam runs along x = y = 0 in the direction of +z: x right, y up.
    """
    builder, compound = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(compound)
    for solid, turn_deg in ((x_vane, 0), (y_vane, 90), (x_vane, 180), (y_vane, 270)):
        builder.Add(compound, BRepBuilderAPI_Transform(solid, _about_the_beam(turn_deg, axis_z_mm), True).Shape())
    return compound


def _about_the_beam(turn_deg, axis_z_mm):
    """Motion of a vane to its place: part x to beam z, part +z (toward the beam) to the inside."""
    c, s = fixed.cos(np.radians(turn_deg)), fixed.sin(np.radians(turn_deg))
    # at 0 degrees the vane stands at +x of the beam: its +z points to -x; y follows from a right-handed turn
    inward, along = np.array([-c, -s, 0.0]), np.array([0.0, 0.0, 1.0])
    across = np.cross(inward, along)
    rotation = np.column_stack([along, across, inward])
    shift = -inward * axis_z_mm
    motion = gp_Trsf()
    motion.SetValues(*(float(v) for row, t in zip(rotation, shift) for v in (*row, t)))
    return motion
