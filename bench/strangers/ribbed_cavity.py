"""Mould cavity: drafted walls, two drafted rib slots in its floor, four ejector holes 4 H7, in H13."""

import build123d as bd

from cuspline.design import Design, Finish, Parameters, Setup, StockBox


class RibbedCavity(Parameters):
    """Nothing to choose."""


def design(p: RibbedCavity) -> Design:
    with bd.BuildPart() as part:
        bd.Box(64, 48, 24, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MAX))
        with bd.BuildSketch():
            bd.RectangleRounded(46, 30, 6)
        bd.extrude(amount=-8, taper=3, mode=bd.Mode.SUBTRACT)
        with bd.BuildSketch(bd.Plane.XY.offset(-8)):
            with bd.Locations((-10, 0), (10, 0)):
                bd.RectangleRounded(5, 20, 2.4)
        bd.extrude(amount=-4, taper=2, mode=bd.Mode.SUBTRACT)
        with bd.BuildSketch(bd.Plane.XY.offset(-8)):
            with bd.GridLocations(34, 14, 2, 2):
                bd.Circle(2.003)
        bd.extrude(amount=-16, mode=bd.Mode.SUBTRACT)
        floor = [f for f in part.faces() if f.normal_at().Z > 0.99 and abs(f.center().Z + 8) < 1e-6][0]
        bd.fillet([e for e in floor.outer_wire().edges()], 2.5)
    inside = [f for f in part.faces() if -23.9 < f.center().Z < -0.1
              and abs(f.center().X) < 31 and abs(f.center().Y) < 23]
    holes = [f for f in inside if f.geom_type == bd.GeomType.CYLINDER and abs(f.radius - 2.003) < 1e-6]
    return Design(
        name="ribbed_cavity", description="mould cavity with ribs and ejector holes", parameters=p, solid=part.part,
        predicates={"ejectors": holes, "cavity": [f for f in inside if f not in holes]},
        material="steel_h13_48hrc", machine="mill_heidenhain",
        stock=StockBox(min_mm=(-32, -24, -24), max_mm=(32, 24, 0)),
        finish=Finish(scallop_mm=0.01, profile_tolerance_mm=0.004, gouge_mm=0.005),
        setups=(Setup(name="setup-1", faces=("ejectors", "cavity"), wcs_in_words="X0 Y0 middle, Z0 on top"),))
