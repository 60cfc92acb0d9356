"""A tray of 160 x 110 x 14 mm by `Auto` alone: a pocket 8 mm deep with corners of R6, six holes through its floor."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox

X, Y, Z, RIM, DEPTH, CORNER_MM = 160.0, 110.0, 14.0, 8.0, 8.0, 6.0
HOLES = (((30, 30), 5.0), ((80, 30), 5.0), ((130, 30), 5.0), ((30, 80), 8.0), ((80, 80), 8.0), ((130, 80), 8.0))


def tray():
    """The solid."""
    hollow = cq.Workplane("XY", origin=(X / 2, Y / 2, Z - DEPTH)).rect(X - 2 * RIM, Y - 2 * RIM).extrude(20)
    solid = cq.Workplane("XY").box(X, Y, Z, centered=False).cut(hollow.edges("|Z").fillet(CORNER_MM))
    for at, wide in HOLES:
        solid = solid.cut(cq.Workplane("XY", origin=(*at, -1)).circle(wide / 2).extrude(20))
    return solid


def design(p: Parameters) -> Design:
    """The tray in a block of its own size, its inside made."""
    inside = FacePredicate(name="inside", count=9 + len(HOLES), center_min_mm=(1, 1, 0.5), center_max_mm=(X - 1, Y - 1, Z - 0.1))
    return Design(name="tray", description="tray with drilled floor", parameters=p, solid=tray().val(), predicates=(inside,),
                  material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z)),
                  finish=Finish(scallop_mm=0.01, profile_tolerance_mm=0.0024, gouge_mm=0.0024),
                  setups=(Setup(name="setup-1", faces=("inside",), wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),))
