r"""The whole propeller as one solid: blades, fillets and hub with shared edges.

Each blade's loop is cut into four columns of faces.  The hub is cut into one sector a blade, along helical
lines that keep half way between the roots:

     tip        |  4 faces that meet in the tip
     faces      |  face | leading edge | back | trailing edge
     fillets    |   "         "            "         "
     hub        |  one sector round all four
"""

from dataclasses import dataclass, replace

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCone, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.TopAbs import TopAbs_FACE
from OCP.TopTools import TopTools_ListOfShape
from scipy.interpolate import BSpline

from cuspline.designs.propellers.blade import DEGREE, Blade, about_x
from cuspline.designs.propellers.root import OUTERMOST_CONTACT, half_way_line, rolled_round_root
from cuspline.kernel import brep
from cuspline.kernel.shells import (
    ShellBuilder,
    Side,
    cylinder_round_x,
    plane_across_x,
    plane_curve,
    plane_line,
    plane_rational,
    rational_curve,
    spline_curve,
    spline_surface,
)
from cuspline.splines.closed_splines import piece, surface_piece
from cuspline.splines.nurbs import NurbsSurface
from cuspline.splines.spline_interpolation import interpolated
from cuspline.surfaces.rolling_ball import ARC_KNOTS, Fillet, Revolved, Rolling, fillet_of, rolled
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

SIDE_SHARES = (0.0, 1 / 3, 2 / 3)       # of the way between them, where its surface is laid through
CLEAR_MM = 1.0              # by which tools stand out of the hub
LEAST_WALL_SHARE = 0.05     # of the hub's radius, left outside its holes
BELOW = 0.03                # of v: how far the blade's faces go on under their border


@dataclass(frozen=True, eq=False, kw_only=True)
class HubCuts:
    """What is cut out of the hub; 0: not."""

    bore_mm: float = 0.0                # diameter at the fore end
    bore_half_angle_rad: float = 0.0    # the bore grows downstream for a positive angle
    key_width_mm: float = 0.0
    key_depth_mm: float = 0.0           # above the bore
    bolts: int = 0
    bolt_mm: float = 0.0                # diameter
    bolt_circle_mm: float = 0.0         # diameter

    def bore_radii_mm(self, length_mm):
        """Radius of the bore at the fore end and a length behind it; 0 without a bore, whatever its taper."""
        if self.bore_mm <= 0:
            return 0.0, 0.0
        return self.bore_mm / 2, self.bore_mm / 2 + length_mm * fixed.tan(self.bore_half_angle_rad)


@dataclass(frozen=True, eq=False, kw_only=True)
class PropellerSolid:
    """The solid and what it was built from."""

    solid: object                   # MarkedSolid, its faces named
    blade: Blade
    hub: Revolved
    fillet: Fillet
    between: Rolling                # balls found anew, half way between those the fillet is made of
    half_way: BSpline               # over x: polar angle half way between the sides of blade 1's root
    cuts: HubCuts


def propeller_solid(blade, hub, law, cuts=HubCuts()):
    """Build the solid.

    Args:
        blade: Blade, its innermost radius below the hub.
        hub: Revolved.
        law: RadiusLaw.
        cuts: HubCuts.
    Raises:
        DesignError: the fillet or a cut does not fit; says where and what would.
    """
    fillet, between = _rolled_fillet(blade, hub, law)
    builder, table = ShellBuilder(), blade.table
    sector = _Sectors(builder, hub, fillet.rolling, table.blades)
    for k in range(table.blades):
        turn = 2 * np.pi * k / table.blades
        border = _add_blade(builder, k + 1, _turned(blade, turn), _turned(fillet, turn))
        sector.add(k, border)
    sector.add_ends()
    solid, faces = builder.solid()
    solid, faces = _cut(solid, faces, hub, cuts, table.name)
    marked = brep.marked(solid, faces)
    return PropellerSolid(solid=marked, blade=blade, hub=hub, fillet=fillet, between=between,
                          half_way=sector.half_way, cuts=cuts)


def _rolled_fillet(blade, hub, law):
    """(Fillet, Rolling half way between the balls it is made of)."""
    fillet = fillet_of(rolled_round_root(blade, hub, law), 2 * np.pi)
    u = fillet.rolling.u
    middle = (u + np.r_[u[1:], u[0] + 2 * np.pi]) / 2
    return fillet, rolled(blade.surface, blade.outward, hub, law, middle, (0.0, OUTERMOST_CONTACT))


# blades ----------------------------------------------------------------------------------------


def _turned(made, turn):
    """A Blade or a Fillet with its surface turned about X."""
    poles = made.surface.poles.copy()
    poles[..., :3] = fixed.matmul(poles[..., :3], about_x(turn).T)
    return replace(made, surface=replace(made.surface, poles=poles))


def _add_blade(builder, number, blade, fillet):
    """Faces of one blade and its fillet; returns the border on the hub: [(edge, spline of angle and x), ...]."""
    columns, surface, outward = blade.columns, blade.surface, blade.outward
    starts = np.array([first for _, first, _ in columns])
    top = blade.v_of_tip
    at = lambda u, v: surface.derivatives(np.array([u]), np.array([v]))[0, 0]
    across = lambda u, t: fillet.surface.derivatives(np.array([u]), np.array([t]))[0, 0]
    level = fillet.on_blade(starts)[:, 0]
    root, foot = ([builder.vertex(across(u, t)) for u in starts] for t in (0.0, 1.0))
    shoulder = [builder.vertex(at(u, top)) for u in starts]
    meridians = [_meridian(surface, u) for u in starts]
    edges = [builder.edge(m, v, top, a, b) for m, v, a, b in zip(meridians, level, root, shoulder)]
    arcs = [builder.edge(_arc(fillet.surface, u), 0.0, 1.0, a, b) for u, a, b in zip(starts, root, foot)]
    tip, tops = None, None
    if blade.table.has_round_tip:
        tip = builder.vertex(at(starts[0], 1.0))
        tops = [builder.edge(m, top, 1.0, a, tip) for m, a in zip(meridians, shoulder)]
    border, rim = [], []
    for k, (name, low, high) in enumerate(columns):
        n = (k + 1) % len(columns)
        cut = surface_piece(surface, low, high, _floor(fillet, low, high), top)
        ball = surface_piece(fillet.surface, low, high, 0.0, 1.0)
        on_blade, on_hub = piece(fillet.on_blade, low, high), piece(fillet.on_hub, low, high)
        upper = builder.edge(_row(ball, 0), low, high, root[k], root[n])
        lower = builder.edge(_row(ball, -1), low, high, foot[k], foot[n])
        crest = builder.edge(_row(cut, -1), low, high, shoulder[k], shoulder[n])
        builder.face(f"blade {number} {name}", spline_surface(cut), [[
            Side(edge=upper, curve=plane_curve(_graph(on_blade))),
            Side(edge=edges[n], curve=plane_line((high, 0), (0, 1))),
            Side(edge=crest, curve=plane_line((0, top), (1, 0)), is_forward=False),
            Side(edge=edges[k], curve=plane_line((low, 0), (0, 1)), is_forward=False)]], outward < 0)
        builder.face(f"fillet {number}", spline_surface(ball), [[
            Side(edge=upper, curve=plane_line((0, 0), (1, 0))),
            Side(edge=arcs[n], curve=plane_line((high, 0), (0, 1))),
            Side(edge=lower, curve=plane_line((0, 1), (1, 0)), is_forward=False),
            Side(edge=arcs[k], curve=plane_line((low, 0), (0, 1)), is_forward=False)]], outward > 0)
        border.append((lower, on_hub))
        rim.append(crest)
        if tip is not None:
            cap, pole = surface_piece(surface, low, high, top, 1.0), builder.pole(tip)
            builder.face(f"blade {number} tip", spline_surface(cap), [[
                Side(edge=crest, curve=plane_line((0, top), (1, 0))),
                Side(edge=tops[n], curve=plane_line((high, 0), (0, 1))),
                Side(edge=pole, curve=_flat_line(low, high), is_forward=False),
                Side(edge=tops[k], curve=plane_line((low, 0), (0, 1)), is_forward=False)]], outward < 0)
    if tip is None:
        _add_flat_tip(builder, f"blade {number} tip", blade, rim)
    return border


def _floor(fillet, low, high):
    """v a little below the border of a column."""
    return max(0.0, float(fillet.on_blade(np.linspace(low, high, 50)).min()) - BELOW)


def _meridian(surface, u):
    """The blade's curve of constant u, over v."""
    return spline_curve(BSpline(surface.knots_v, BSpline(surface.knots_u, surface.poles, surface.degree_u)(u)[:, :3],
                                surface.degree_v))


def _arc(surface, u):
    return rational_curve(surface.knots_v, 2, BSpline(surface.knots_u, surface.poles, surface.degree_u)(u))


def _row(surface, k):
    """The border of a surface at its first or last v, over u."""
    return spline_curve(BSpline(surface.knots_u, surface.poles[:, k, :3], surface.degree_u))


def _graph(spline):
    """(u, f(u)) of a spline (1,) as a spline of the plane."""
    k = spline.k
    places = np.array([spline.t[i + 1:i + k + 1].mean() for i in range(len(spline.c))])
    return BSpline(spline.t, np.column_stack([places, spline.c]), k)


def _flat_line(low, high):
    """The line v = 1 over a parameter from 0 to 1."""
    return plane_curve(BSpline([0.0, 0.0, 1.0, 1.0], np.array([[low, 1.0], [high, 1.0]]), 1))


def _add_flat_tip(builder, name, blade, rim):
    """The tip of a blade that has a chord there: on the cylinder of the propeller's radius."""
    curves = []
    for edge, (_, low, high) in zip(rim, blade.columns):
        knots = blade.surface.knots_u
        sites = np.unique(np.r_[low, knots[(knots > low) & (knots < high)], high])
        u = np.unique(np.concatenate([sites, (sites[1:] + sites[:-1]) / 2]))
        p = blade.surface.derivatives(u, np.ones(len(u)))[:, 0]
        curves.append((edge, u, fixed.arctan2(p[:, 2], p[:, 1]), p[:, 0]))
    reference = curves[0][2][0]
    near = lambda angle: reference + np.remainder(angle - reference + np.pi, 2 * np.pi) - np.pi
    loop = np.concatenate([np.column_stack([near(a), x]) for _, _, a, x in curves])
    start = loop[:, 0].mean() - np.pi
    sides = [Side(edge=edge, is_forward=_area(loop) > 0, curve=plane_curve(
        interpolated(u, np.column_stack([near(a) - start, x]), DEGREE))) for edge, u, a, x in curves]
    builder.face(name, cylinder_round_x(blade.table.radius_mm, start), [sides if _area(loop) > 0 else sides[::-1]])


def _area(loop):
    """Signed area of a closed polygon (n, 2)."""
    x, y = loop.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


# hub -------------------------------------------------------------------------------------------


class _Sectors:
    """The hub's faces, one sector a blade; neighbours share their helical borders.

    Parameters of a sector: across it t from 0 to 1 over rational arcs, along it x.  So its borders are lines of
    constant parameter for any profile, however far the roots wind round the hub: on the polar angle of a cylinder a
    long root of low pitch would reach round more than once.
    """

    def __init__(self, builder, hub, rolling, blades):
        self._builder, self._hub, self._half, self._blades = builder, hub, np.pi / blades, blades
        self.half_way, _ = half_way_line(hub, rolling, blades)
        sites = np.unique(self.half_way.t)
        self._x = _between(sites, SIDE_SHARES)
        self._ends = [builder.vertex(p) for p in self._places(0, -1.0)[[0, -1]]]
        self._borders = []
        for k in range(blades):
            ends = self._ends if k == 0 else [builder.vertex(p) for p in self._places(k, -1.0)[[0, -1]]]
            curve = interpolated(self._x, self._places(k, -1.0), DEGREE)
            self._borders.append((builder.edge(spline_curve(curve), self._x[0], self._x[-1], *ends), *ends))
        self._rims = []

    def _places(self, k, side):
        """(n, 3) places along a border of sector k, side -1 or +1, or outside the hub over its middle, 0."""
        angle = self.half_way(self._x) + 2 * np.pi * k / self._blades + side * self._half
        return self._hub.points(angle, self._x)

    def _surface(self, k):
        """NurbsSurface of sector k: exact arcs across, interpolated along x."""
        low, high, weight = self._places(k, -1.0), self._places(k, 1.0), fixed.cos(self._half)
        over = self._places(k, 0.0) * [weight, 1.0, 1.0]        # homogeneous: the radius is R / weight there
        ones = np.ones((len(low), 1))
        rows = np.stack([np.hstack([low, ones]), np.hstack([over, weight * ones]), np.hstack([high, ones])])
        along = interpolated(self._x, rows.transpose(1, 0, 2), DEGREE)
        return NurbsSurface(degree_u=2, degree_v=DEGREE, knots_u=ARC_KNOTS, knots_v=along.t,
                            poles=along.c.transpose(1, 0, 2))

    def add(self, k, root):
        """The sector round blade k's root, [(edge, spline of polar angle and x for blade 1), ...]."""
        surface = self._surface(k)
        left, left_fore, left_aft = self._borders[k]
        right, right_fore, right_aft = self._borders[(k + 1) % self._blades]
        arcs = [surface.poles[:, end] for end in (0, -1)]
        rims = [self._builder.edge(rational_curve(ARC_KNOTS, 2, arc), 0.0, 1.0, a, b)
                for arc, a, b in zip(arcs, (left_fore, left_aft), (right_fore, right_aft))]
        fore, aft = self._x[[0, -1]]
        outer = [Side(edge=rims[0], curve=plane_line((0, fore), (1, 0))),
                 Side(edge=right, curve=plane_line((1, 0), (0, 1))),
                 Side(edge=rims[1], curve=plane_line((0, aft), (1, 0)), is_forward=False),
                 Side(edge=left, curve=plane_line((0, 0), (0, 1)), is_forward=False)]
        curves = [(edge, self._unrolled(spline)) for edge, spline in root]
        loop = np.concatenate([s(np.linspace(s.t[0], s.t[-1], 200)[:-1]) for _, s in curves])
        is_forward = _area(loop) < 0
        inner = [Side(edge=edge, curve=plane_curve(s), is_forward=is_forward) for edge, s in curves]
        self._builder.face("hub", spline_surface(surface), [outer, inner if is_forward else inner[::-1]])
        self._rims.append((rims, arcs))

    def _unrolled(self, border):
        """A root's border in a sector's parameters: along an arc of half angle h, tan(a/2) = (2 t - 1) tan(h/2)."""
        u = _between(np.unique(border.t), (0.0, 0.5))
        angle, x = border(u).T
        t = (1 + fixed.tan((angle - self.half_way(x)) / 2) / fixed.tan(self._half / 2)) / 2
        return interpolated(u, np.column_stack([t, x]), DEGREE)

    def add_ends(self):
        for end, name in enumerate(("hub fore end", "hub aft end")):
            sides = [Side(edge=rims[end], curve=plane_rational(ARC_KNOTS, 2, arcs[end][:, 1:]))
                     for rims, arcs in self._rims]
            self._builder.face(name, plane_across_x(self._x[-end]), [sides], end == 0)


def _between(sites, shares):
    """Rising places: every site, and inner ones at shares of the way to the next."""
    inner = [sites[:-1] + share * np.diff(sites) for share in shares]
    return np.unique(np.concatenate([*inner, sites[-1:]]))


def _cut(solid, faces, hub, cuts, name):
    """The solid without bore, keyway and bolt holes; its named faces after that."""
    tools = _tools(hub, cuts, name)
    if not tools:
        return solid, faces
    cut, arguments, knives = BRepAlgoAPI_Cut(), TopTools_ListOfShape(), TopTools_ListOfShape()
    arguments.Append(solid)
    for _, tool in tools:
        knives.Append(tool)
    cut.SetArguments(arguments)
    cut.SetTools(knives)
    cut.Build()
    if not cut.IsDone():
        raise DesignError(f"propeller {name}: bore, keyway or bolt holes cannot be cut from the hub")
    result = cut.Shape()
    left = brep.explore(result, TopAbs_FACE)
    found = []
    for label, face in faces + [(label, f) for label, tool in tools for f in brep.explore(tool, TopAbs_FACE)]:
        after = list(cut.Modified(face)) or [face]
        found += [(label, f) for f in after if any(f.IsSame(other) for other in left)]
    return result, found


def _tools(hub, cuts, name):
    """[(name, TopoDS shape)] of what is to be cut away.

    Raises:
        DesignError: it would break through the hub, or has no size.
    """
    fore, aft = hub.ends_mm
    thinnest = float(hub.profile(np.linspace(fore, aft, 200)).min())
    grow = fixed.tan(cuts.bore_half_angle_rad)
    first, last = cuts.bore_radii_mm(aft - fore)
    widest, narrowest = max(first, last), min(first, last)
    length, tools = aft - fore + 2 * CLEAR_MM, []

    def refuse(what, reach):
        if reach >= thinnest - LEAST_WALL_SHARE * thinnest:
            raise DesignError(f"propeller {name}: the {what} reaches out to a radius of {reach:.3f} mm, the hub is "
                              f"only {thinnest:.3f} mm there; make it smaller")

    if cuts.bore_mm > 0:
        refuse("bore", widest)
        if narrowest <= 0:
            raise DesignError(f"propeller {name}: the tapered bore closes before it is through the hub")
        axis = gp_Ax2(gp_Pnt(fore - CLEAR_MM, 0, 0), gp_Dir(1, 0, 0))
        shape = (BRepPrimAPI_MakeCone(axis, first - CLEAR_MM * grow, last + CLEAR_MM * grow, length) if grow
                 else BRepPrimAPI_MakeCylinder(axis, first, length)).Shape()
        tools.append(("bore", shape))
    if cuts.key_width_mm > 0:
        refuse("keyway", float(fixed.hypot(widest + cuts.key_depth_mm, cuts.key_width_mm / 2)))
        if cuts.bore_mm <= cuts.key_width_mm:
            raise DesignError(f"propeller {name}: a keyway of {cuts.key_width_mm:g} mm needs a bore wider than that, "
                              f"it is {cuts.bore_mm:g} mm")
        half = cuts.key_width_mm / 2
        tools.append(("keyway", BRepPrimAPI_MakeBox(gp_Pnt(fore - CLEAR_MM, -half, 0),
                                                    gp_Pnt(aft + CLEAR_MM, half, widest + cuts.key_depth_mm)).Shape()))
    if cuts.bolts and cuts.bolt_mm <= 0:
        raise DesignError(f"propeller {name}: {cuts.bolts} bolt holes of no diameter; give bolt_mm, or no bolts")
    for k in range(cuts.bolts):
        refuse("bolt circle", (cuts.bolt_circle_mm + cuts.bolt_mm) / 2)
        if (cuts.bolt_circle_mm - cuts.bolt_mm) / 2 <= widest:
            raise DesignError(f"propeller {name}: bolt holes of {cuts.bolt_mm:g} mm on a circle of "
                              f"{cuts.bolt_circle_mm:g} mm run into the bore; widen the circle")
        angle = 2 * np.pi * (k + 0.5) / cuts.bolts
        center = cuts.bolt_circle_mm / 2 * np.array([fixed.cos(angle), fixed.sin(angle)])
        axis = gp_Ax2(gp_Pnt(fore - CLEAR_MM, *map(float, center)), gp_Dir(1, 0, 0))
        tools.append(("bolt hole", BRepPrimAPI_MakeCylinder(axis, cuts.bolt_mm / 2, length).Shape()))
    return tools


def volume_of_cuts_mm3(hub, cuts):
    """What bore, keyway and bolt holes take away, by formulas; the keyway's share by Gauss points along the hub."""
    fore, aft = hub.ends_mm
    length = aft - fore
    first, last = cuts.bore_radii_mm(length)
    bore = np.pi / 3 * length * (first * first + first * last + last * last)
    bolts = cuts.bolts * np.pi / 4 * cuts.bolt_mm ** 2 * length
    if cuts.key_width_mm <= 0:
        return bore + bolts
    nodes, weights = fixed.gauss_points(16)
    radius, half = first + (last - first) * (1 + nodes) / 2, cuts.key_width_mm / 2
    under = half * np.sqrt(radius ** 2 - half ** 2) + radius ** 2 * fixed.arcsin(half / radius)
    height = max(first, last) + cuts.key_depth_mm
    return bore + bolts + float(np.sum(weights * length / 2 * (2 * half * height - under)))
