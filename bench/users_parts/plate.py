"""Plate with twelve holes, two pockets with islands and a chamfered outline, in CadQuery or in build123d; nothing but `Auto`."""

from typing import Literal

from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox

X, Y, Z, FLOOR, ROUND, EASED = 84.0, 56.0, 10.0, 6.0, 6.0, 0.8
POCKETS, POCKET, CORNER, ISLAND = ((24.0, 28.0), (60.0, 28.0)), (30.0, 32.0), 6.5, 3.0       # middles, size, radii
HOLES = [(x, y) for y in (5.5, 50.5) for x in (9.0, 22.2, 35.4, 48.6, 61.8, 75.0)]          # of 5 mm


class Plate(Parameters):
    """Which library it is drawn in."""

    library: Literal["cadquery", "build123d"] = Field(default="cadquery", description="the solid is the same in both")


def in_cadquery():
    import cadquery as cq
    block = cq.Workplane("XY").box(X, Y, Z, centered=False).edges("|Z").fillet(ROUND).faces(">Z").edges().chamfer(EASED)
    high = cq.Workplane("XY", origin=(0, 0, FLOOR))
    pocket = high.pushPoints(POCKETS).rect(*POCKET).extrude(9).edges("|Z").fillet(CORNER)
    block = block.cut(pocket).union(high.pushPoints(POCKETS).circle(ISLAND).extrude(Z - FLOOR - 1.0))
    return block.cut(cq.Workplane("XY", origin=(0, 0, -1)).pushPoints(HOLES).circle(2.5).extrude(20)).val()


def in_build123d():
    import build123d as bd
    corner = (bd.Align.MIN,) * 3
    block = bd.Box(X, Y, Z, align=corner)
    block = bd.fillet(block.edges().filter_by(bd.Axis.Z), ROUND)
    block = bd.chamfer(block.faces().sort_by(bd.Axis.Z)[-1].edges(), EASED)
    upright = (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN)
    for x, y in POCKETS:
        pocket = bd.Box(*POCKET, 9, align=upright)
        block -= bd.Pos(x, y, FLOOR) * bd.fillet(pocket.edges().filter_by(bd.Axis.Z), CORNER)
        block += bd.Pos(x, y, FLOOR) * bd.Cylinder(ISLAND, Z - FLOOR - 1.0, align=upright)
    for x, y in HOLES:
        block -= bd.Pos(x, y, -1) * bd.Cylinder(2.5, 20, align=upright)
    return block


def design(p: Plate) -> Design:
    """The plate out of a sawn piece, 2 mm larger all round and 1 mm higher; its base is done."""
    return Design(
        name="plate", description="plate with holes, pockets and a chamfered outline", parameters=p,
        solid=in_cadquery() if p.library == "cadquery" else in_build123d(),
        predicates=(FacePredicate(name="all but the base", at_least=40, normal=(0, 0, 1), normal_within_deg=91.0),),
        material="aluminium_6061", stock=StockBox(min_mm=(-2, -2, 0), max_mm=(X + 2, Y + 2, Z + 1)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("all but the base",), wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),))
