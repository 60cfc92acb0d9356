"""Angle bracket: upright with two holes' worth of slot, base with counterbored screws, fillet in the inner corner."""

import build123d as bd

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox


class Bracket(Parameters):
    """Nothing to choose."""


def design(p: Bracket) -> Design:
    """Milled from above out of a sawn block."""
    low = (bd.Align.MIN,) * 3
    part = bd.Box(46, 30, 6, align=low) + bd.Box(8, 30, 18, align=low)
    part = bd.fillet(part.edges().filter_by(bd.Axis.Y).filter_by_position(bd.Axis.X, 7.9, 8.1).filter_by_position(
        bd.Axis.Z, 5.9, 6.1), 4)
    upright = (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN)
    for y in (8, 22):
        part -= bd.Pos(36, y, -1) * bd.Cylinder(2.75, 20, align=upright)
        part -= bd.Pos(36, y, 3) * bd.Cylinder(5, 20, align=upright)
    part -= bd.Pos(22, 15, -1) * bd.extrude(bd.SlotCenterToCenter(8, 6, rotation=90), 20)
    return Design(
        name="bracket", description="angle bracket", parameters=p, solid=part,
        predicates=(FacePredicate(name="from above", at_least=8, normal=(0, 0, 1), normal_within_deg=91.0),),
        material="aluminium_6061", stock=StockBox(min_mm=(-1, -1, 0), max_mm=(47, 31, 19)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("from above",), wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),))
