"""Fork of a linkage: rounded slot between two cheeks, cross bore drilled from the side on a trunnion."""

import build123d as bd

from cuspline.design import Design, Finish, Parameters, Setup, StockBox


class Knuckle(Parameters):
    """Nothing to choose."""


def design(p: Knuckle) -> Design:
    with bd.BuildPart() as part:
        bd.Box(50, 30, 26, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN))
        with bd.BuildSketch(bd.Plane.XY.offset(26)):
            bd.Rectangle(60, 10)
        bd.extrude(amount=-16, mode=bd.Mode.SUBTRACT)
        with bd.BuildSketch(bd.Plane(origin=(0, 15, 18), z_dir=(0, 1, 0))):
            bd.Circle(5.0)
        bd.extrude(amount=-31, mode=bd.Mode.SUBTRACT)
        with bd.BuildSketch(bd.Plane.XY.offset(26)):
            with bd.Locations((-18, 0), (18, 0)):
                bd.Circle(2.5)
        bd.extrude(amount=-27, mode=bd.Mode.SUBTRACT)
    faces = part.faces()
    bore = [f for f in faces if f.geom_type == bd.GeomType.CYLINDER and abs(f.radius - 5.0) < 1e-6]
    above = [f for f in faces if f not in bore and f.center().Z > 0.1 and abs(f.center().X) < 24.9 and abs(f.center().Y) < 14.9]
    return Design(
        name="knuckle", description="fork of a linkage", parameters=p, solid=part.part,
        predicates={"above": above, "bore": bore},
        material="aluminium_6061", machine="mill_trunnion_ac", stock=StockBox(min_mm=(-25, -15, 0), max_mm=(25, 15, 27)),
        finish=Finish(scallop_mm=0.02, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("above",), wcs_in_words="X0 Y0 middle, Z0 on the base"),
                Setup(name="side", faces=("bore",), wcs_z=(0, 1, 0), indexed=True, wcs_in_words="as before")))
