"""Valve cover: an oval in two steps, a well with draft in its top, two counterbored ears."""

import build123d as bd

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox


class ValveCover(Parameters):
    """Nothing to choose."""


def design(p: ValveCover) -> Design:
    """Milled from above out of a sawn block, its base finished."""
    part = bd.extrude(bd.SlotOverall(76, 44), 8) + bd.Pos(0, 0, 8) * bd.extrude(bd.SlotOverall(50, 30), 6)
    part -= bd.Pos(0, 0, 14) * bd.extrude(bd.SlotOverall(36, 18), -6, taper=4)
    upright = (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN)
    for x in (-31, 31):
        part -= bd.Pos(x, 0, -1) * bd.Cylinder(2.75, 20, align=upright)
        part -= bd.Pos(x, 0, 5) * bd.Cylinder(5, 20, align=upright)
    return Design(
        name="valve_cover", description="valve cover with a drafted well", parameters=p, solid=part,
        predicates=(FacePredicate(name="from above", at_least=8, normal=(0, 0, 1), normal_within_deg=91.0),),
        material="aluminium_6061", stock=StockBox(min_mm=(-39, -23, 0), max_mm=(39, 23, 15)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("from above",), wcs_in_words="X0 Y0 in the middle, Z0 on the base"),))
