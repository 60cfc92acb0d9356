"""Small plate that `Auto` makes whole: outline, holes, one of them bored, chamfers on all upper edges; its top is finished."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox

X, Y, Z = 36.0, 24.0, 6.0


def plate():
    """The solid: rounded on its right, holes of 14 mm and of 5 mm, chamfers of 0.6 mm."""
    block = cq.Workplane("XY").box(X, Y, Z, centered=False).edges("|Z and >X").fillet(5.0)
    hole = cq.Workplane("XY", origin=(0, 0, -1))
    block = block.cut(hole.pushPoints([(24, 12)]).circle(7.0).extrude(20)).cut(hole.pushPoints([(8, 12)]).circle(2.5).extrude(20))
    return block.faces(">Z").edges().chamfer(0.6)


def design(p: Parameters) -> Design:
    """The plate in its stock, 2 mm all round."""
    sides = FacePredicate(name="all but top and base", count=16, center_min_mm=(-1, -1, 0.5), center_max_mm=(X + 1, Y + 1, Z - 0.1))
    return Design(
        name="auto_plate", description="plate for Auto", parameters=p, solid=plate().val(), predicates=(sides,),
        material="aluminium_6061", stock=StockBox(min_mm=(-2, -2, 0), max_mm=(X + 2, Y + 2, Z)),
        finish=Finish(scallop_mm=0.2, profile_tolerance_mm=0.02, gouge_mm=0.02),
        setups=(Setup(name="setup-1", faces=("all but top and base",), wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),))
