"""Valve body on the trunnion: a pocket and M5 threads from above, a port with its seat from the front, both indexed."""

import build123d as bd

from cuspline.design import Design, Finish, Parameters, Setup, StockBox, Thread

RISER = 70.0


class TrunnionValve(Parameters):
    """Nothing to choose."""


def design(p: TrunnionValve) -> Design:
    part = bd.Box(46, 40, 30, align=(bd.Align.MIN,) * 3)
    part -= bd.extrude(bd.Plane.XY.offset(30) * bd.Pos(23, 22) * bd.RectangleRounded(24, 20, 5), -6)
    for x in (6, 40):
        part -= bd.extrude(bd.Plane.XY.offset(30) * bd.Pos(x, 22) * bd.Circle(2.1), -12)
    front = bd.Plane(origin=(0, 0, 0), x_dir=(1, 0, 0), z_dir=(0, -1, 0))
    part -= bd.extrude(front * bd.Pos(23, 14) * bd.Circle(10), -3)
    part -= bd.extrude(front * bd.Pos(23, 14) * bd.Circle(4), -18)
    part = bd.Pos(0, 0, RISER) * part
    holes = [f for f in part.faces() if f.geom_type == bd.GeomType.CYLINDER and abs(f.radius - 2.1) < 1e-6]
    inside = [f for f in part.faces() if 0.1 < f.center().X < 45.9 and 0.1 < f.center().Y < 39.9
              and RISER + 0.1 < f.center().Z < RISER + 29.9 and f not in holes]
    bottoms = [f for f in inside if f.center().Z > RISER + 17.5 and f.area < 14]
    above = [f for f in inside if f.center().Z > RISER + 23.9 and f not in bottoms]
    ahead = [f for f in inside if f not in above and f not in bottoms]
    return Design(
        name="trunnion_valve", description="valve body from two sides", parameters=p, solid=part,
        predicates={"m5": holes, "above": above, "ahead": ahead}, threads={"m5": Thread(size="M5", depth_mm=8)},
        machine="mill_siemens_5axis", material="brass_c360",
        stock=StockBox(min_mm=(0, 0, RISER), max_mm=(46, 40, RISER + 30)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="top", faces=("m5", "above"), wcs_in_words="X0 Y0 lower left, Z0 on the table"),
                Setup(name="front", faces=("ahead",), indexed=True, wcs_z=(0, -1, 0),
                      wcs_in_words="X0 Y0 lower left, Z0 on the table")))
