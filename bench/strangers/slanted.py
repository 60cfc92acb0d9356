"""Mould cavity: a pocket with walls of 8 degrees draft, fillets at its floor, and two dowel holes H7."""

import build123d as bd

from cuspline.design import Design, Diameter, FacePredicate, Finish, Parameters, Setup, StockBox


class Slanted(Parameters):
    """Nothing to choose."""


def design(p: Slanted) -> Design:
    part = bd.Box(52, 40, 16, align=(bd.Align.MIN,) * 3)
    sketch = bd.Plane.XY.offset(8) * bd.Pos(26, 20) * bd.RectangleRounded(24, 18, 5)
    cavity = bd.extrude(sketch, 9, taper=-8)
    part -= cavity
    upright = (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN)
    for x, y in ((6, 6), (46, 34)):
        part -= bd.Pos(x, y, -1) * bd.Cylinder(3.003, 20, align=upright)
    return Design(
        name="slanted", description="cavity with draft", parameters=p, solid=part,
        predicates=(FacePredicate(name="dowels", count=2, kinds=("cylinder",), center_max_mm=(50, 38, 9), area_min_mm2=250),
                    FacePredicate(name="cavity", at_least=9, center_min_mm=(8, 4, 7), center_max_mm=(44, 36, 15.9))),
        dimensions=(Diameter(faces="dowels", fit="H7", nominal_mm=6.0),),
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(52, 40, 16)),
        finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("dowels", "cavity"), wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),))
