"""Lid of a gearbox: R2 round its rim, a chamfered boss, a bore through it, four counterbored M5 screws, in bronze."""

import build123d as bd

from cuspline.design import Design, Finish, Parameters, Setup, StockBox


class FilletLid(Parameters):
    """Nothing to choose."""


def design(p: FilletLid) -> Design:
    with bd.BuildPart() as part:
        with bd.BuildSketch():
            bd.RectangleRounded(60, 46, 8)
        bd.extrude(amount=9)
        bd.fillet(part.faces().sort_by(bd.Axis.Z)[-1].edges(), 2)
        with bd.BuildSketch(bd.Plane.XY.offset(9)):
            bd.Circle(12)
        bd.extrude(amount=4)
        bd.chamfer(part.faces().sort_by(bd.Axis.Z)[-1].edges(), 1)
        with bd.BuildSketch(bd.Plane.XY.offset(13)):
            bd.Circle(7)
        bd.extrude(amount=-13, mode=bd.Mode.SUBTRACT)
        with bd.Locations(bd.Plane.XY.offset(9)):
            with bd.GridLocations(44, 30, 2, 2):
                bd.CounterBoreHole(2.75, 5, 5)
    above = [f for f in part.faces() if f.center().Z > 0.1]
    return Design(
        name="fillet_lid", description="lid with a rounded rim", parameters=p, solid=part.part, predicates={"above": above},
        material="bronze_nial", machine="mill_fanuc", stock=StockBox(min_mm=(-32, -25, 0), max_mm=(32, 25, 14)),
        finish=Finish(scallop_mm=0.02, profile_tolerance_mm=0.008, gouge_mm=0.01),
        setups=(Setup(name="setup-1", faces=("above",), wcs_in_words="X0 Y0 in the bore, Z0 on the base"),))
