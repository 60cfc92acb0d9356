"""Ten parts of laboratories, model basins and mould shops, from above with the usual cutters: `-p part=waveguide`."""

import math
from typing import Literal

import build123d as bd
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox

IN_MM = 0.01        # inside the part's box: its own sides are sawn
DOWN = (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MAX)
AHEAD = (bd.Align.MIN, bd.Align.CENTER, bd.Align.MAX)


class Labs(Parameters):
    part: Literal["pole_tip", "waveguide", "half_cell", "rudder", "bulb", "bottle_mould", "lens_insert", "chevron", "watch_bridge",
                  "big_plate"] = Field(default="waveguide", description="which of the ten")


def pole_tip():
    """A quadrupole's pole: a hyperbola about an aperture of R16, ends chamfered."""
    top = [(x / 2, 40 - math.hypot(16, x / 2)) for x in range(-24, 25)]
    with bd.BuildPart() as part:
        with bd.BuildSketch(bd.Plane.XZ):
            with bd.BuildLine():
                bd.Spline(*top)
                bd.Polyline(top[-1], (20, 7), (20, -10), (-20, -10), (-20, 7), top[0])
            bd.make_face()
        bd.extrude(amount=50, both=True)
        bd.chamfer([e for e in part.edges() if abs(e.center().Y) > 49.9 and e.center().Z > 12], 3.0)
    return part.part


def waveguide():
    """Half of a split WR-28 guide with a bend to and fro."""
    with bd.BuildPart() as part:
        bd.Box(70, 40, 12, align=DOWN)
        with bd.BuildSketch(bd.Plane.XY):
            with bd.BuildLine() as path:
                bd.Line((-35, -8), (-10, -8))
                bd.RadiusArc((-10, -8), (-2, 0), -8)
                bd.RadiusArc((-2, 0), (6, 8), 8)
                bd.Line((6, 8), (35, 8))
            bd.trace(path.line, line_width=7.112)
        bd.extrude(amount=-3.556, mode=bd.Mode.SUBTRACT)
        with bd.Locations((-25, 12, 0), (25, -12, 0), (0, -14, 0), (0, 14, 0)):
            bd.Hole(1.65, 12)
    return part.part


def half_cell():
    """The die of an elliptical cavity."""
    with bd.BuildPart() as part:
        bd.Cylinder(60, 30, align=DOWN)
        with bd.BuildSketch(bd.Plane.XZ):
            with bd.BuildLine():
                bd.EllipticalCenterArc((30, 0), 20, 18, start_angle=270, arc_size=90)
                bd.Polyline((50, 0), (0, 0), (0, -18), (30, -18))
            bd.make_face()
        bd.revolve(axis=bd.Axis.Z, mode=bd.Mode.SUBTRACT)
        rims = part.edges().filter_by(bd.GeomType.CIRCLE).group_by(bd.Axis.Z)[-1]
        bd.fillet(rims.sort_by(bd.SortBy.RADIUS)[0], 4)
    return part.part


def rudder():
    """Half of a tapered rudder of NACA sections."""
    def half(x, thick):
        return 5 * thick * (0.2969 * math.sqrt(x) - 0.126 * x - 0.3516 * x ** 2 + 0.2843 * x ** 3 - 0.1036 * x ** 4)

    sections, stations = [], [(1 - math.cos(math.pi * k / 24)) / 2 for k in range(25)]
    for y, chord, thick in ((0, 60, 0.18), (40, 50, 0.16), (80, 38, 0.14)):
        upper = [(chord * (x - 0.3), chord * half(x, thick)) for x in stations]
        with bd.BuildSketch(bd.Plane(origin=(0, y, 0), x_dir=(1, 0, 0), z_dir=(0, -1, 0))) as section:
            with bd.BuildLine():
                bd.Spline(*upper)
                bd.Polyline(upper[-1], (upper[-1][0], -6), (upper[0][0], -6), upper[0])
            bd.make_face()
        sections.append(section.sketch)
    return bd.loft(sections)


def bulb():
    """Half of a bulbous bow on its plate."""
    with bd.BuildPart() as part:
        with bd.BuildSketch(bd.Plane.XY):
            with bd.BuildLine():
                bd.Spline((0, 14), (20, 18), (45, 13), (60, 0), tangents=((1, 0.3), (0, -1)))
                bd.Polyline((60, 0), (0, 0), (0, 14))
            bd.make_face()
        bd.revolve(axis=bd.Axis.X)
        bd.Box(60, 40, 40, align=AHEAD, mode=bd.Mode.SUBTRACT)
        bd.Box(70, 50, 8, align=AHEAD)
    return part.part


def bottle_mould():
    with bd.BuildPart() as part:
        bd.Box(110, 60, 30, align=DOWN)
        with bd.BuildSketch(bd.Plane.XY):
            with bd.BuildLine():
                bd.FilletPolyline((-40, 0), (-40, 20), (15, 20), (35, 9), (55, 9), radius=5)
                bd.Polyline((55, 9), (55, 0), (-40, 0))
            bd.make_face()
        bd.revolve(axis=bd.Axis.X, mode=bd.Mode.SUBTRACT)
    return part.part


def lens_insert():
    """An aspheric dome on its post."""
    sag = lambda r: 6 - r * r / 30 / (1 + math.sqrt(1 - 0.4 * r * r / 900)) + 2e-6 * r ** 4
    with bd.BuildPart() as part:
        bd.Cylinder(18, 8, align=DOWN)
        with bd.BuildSketch(bd.Plane.XZ):
            with bd.BuildLine():
                bd.Spline(*[(r, sag(r)) for r in range(0, 11, 2)], tangents=((1, 0), (1, -0.75)))
                bd.Polyline((10, sag(10)), (10, -1), (0, -1), (0, sag(0)))
            bd.make_face()
        bd.revolve(axis=bd.Axis.Z)
    return part.part


def chevron():
    """A plate of waves at 30 degrees, both ways."""
    lean = math.tan(math.radians(30))
    wave = lambda x, y: 1.5 * math.cos(2 * math.pi * (x - y * lean) / 14)
    plate = bd.Pos(0, 0, 3) * bd.Box(50, 38, 8, align=DOWN)
    for side in (1, -1):
        grid = [[bd.Vector(x, side * y, wave(x, y)) for y in (2.5 * n for n in range(9))]
                for x in (1.75 * n - 28 for n in range(33))]
        plate -= bd.extrude(bd.Face.make_surface_from_array_of_points(grid), amount=20, dir=(0, 0, 1))
    return plate


def watch_bridge():
    with bd.BuildPart() as part:
        bd.Box(22, 14, 3, align=DOWN)
        bd.fillet(part.edges().filter_by(bd.Axis.Z), 2)
        with bd.BuildSketch(bd.Plane.XY):
            with bd.Locations((-5, 0)):
                bd.Circle(4.2)
            with bd.Locations((5, 1)):
                bd.SlotOverall(9, 3.4, rotation=20)
        bd.extrude(amount=-1.1, mode=bd.Mode.SUBTRACT)
        with bd.Locations((-5, 0, -1.1)):
            bd.Hole(0.75)
        with bd.Locations((8.5, -5, 0), (-8.5, 5, 0)):
            bd.CounterBoreHole(0.5, 1.0, 0.8)
        with bd.BuildSketch(bd.Plane.XY):
            with bd.Locations((2, -4.5)):
                bd.SlotOverall(8, 1.2)
        bd.extrude(amount=-0.6, mode=bd.Mode.SUBTRACT)
    return part.part


def big_plate():
    """420 x 260 mm with 24 pockets and 35 counterbored holes."""
    with bd.BuildPart() as part:
        bd.Box(420, 260, 25, align=DOWN)
        with bd.BuildSketch(bd.Plane.XY):
            with bd.GridLocations(64, 60, 6, 4):
                bd.RectangleRounded(52, 48, 8)
        bd.extrude(amount=-18, mode=bd.Mode.SUBTRACT)
        with bd.GridLocations(64, 60, 7, 5):
            bd.CounterBoreHole(2.75, 5.0, 5.5)
    return part.part


ABOVE_MM = {"rudder": 1.0, "pole_tip": 1.0, "lens_insert": 1.0, "bulb": 1.0, "chevron": 0.5}     # stock over the top; others 0.3


def design(p: Labs) -> Design:
    part = globals()[p.part]()
    low, high = part.bounding_box().min, part.bounding_box().max
    upper = FacePredicate(name="upper", at_least=1, normal=(0, 0, 1), normal_within_deg=91,
                          center_min_mm=(low.X + IN_MM, low.Y + IN_MM, low.Z + IN_MM),
                          center_max_mm=(high.X - IN_MM, high.Y - IN_MM, high.Z + 1))
    stock = StockBox(min_mm=(low.X, low.Y, low.Z), max_mm=(high.X, high.Y, high.Z + ABOVE_MM.get(p.part, 0.3)))
    return Design(name=p.part, description=p.part.replace("_", " "), parameters=p, solid=part, predicates=(upper,), stock=stock,
                  material="aluminium_6061", finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.005, gouge_mm=0.01),
                  setups=(Setup(name="setup-1", faces=("upper",), wcs_in_words="as drawn"),))
