"""Plate with a pocket, a bored and a reamed hole, with dimensions to be judged on the simulated stock."""

import cadquery as cq

from cuspline.design import Design, Diameter, Distance, FacePredicate, Finish, Parameters, Position, Setup, StockBox
from cuspline.planning.strategies.bore import Bore
from cuspline.planning.strategies.pocket import Pocket
from cuspline.planning.strategies.ream import Ream

X, Y, Z, FLOOR = 62.0, 30.0, 6.0, 4.0
BORE_MM, REAMED_MM = 14.009, 6.006      # in the middle of H7


def plate():
    """The solid."""
    block = cq.Workplane("XY").box(X, Y, Z, centered=False)
    pocket = cq.Workplane("XY", origin=(17, 15, FLOOR)).rect(26, 22).extrude(9).edges("|Z").fillet(6.0)
    bore = cq.Workplane("XY", origin=(42, 15, -1)).circle(BORE_MM / 2).extrude(20)
    return block.cut(pocket).cut(bore).cut(cq.Workplane("XY", origin=(56, 15, -1)).circle(REAMED_MM / 2).extrude(20))


def faces(name, low, high, **says):
    """Predicate of faces whose middles lie in a box."""
    return FacePredicate(name=name, at_least=1, center_min_mm=low, center_max_mm=high, **says)


def design(p: Parameters) -> Design:
    """The plate out of its box, its top finished."""
    pocket = ((1, 1, 3), (31, 29, 5.9))
    return Design(
        name="toleranced_plate", description="plate with dimensions", parameters=p, solid=plate().val(),
        predicates=(faces("pocket", *pocket), faces("bore", (34, 1, 1), (51, 29, 5)),
                    faces("reamed", (52, 1, 1), (61, 29, 5)), faces("top", (0, 0, 5.9), (X, Y, 6.1)),
                    faces("floor", *pocket, kinds=("plane",), normal=(0, 0, 1)),
                    faces("left", *pocket, kinds=("plane",), normal=(1, 0, 0)),
                    faces("right", *pocket, kinds=("plane",), normal=(-1, 0, 0))),
        dimensions=(Diameter(name="bore H7", faces="bore", fit="H7", nominal_mm=14.0), Position(faces="bore", zone_mm=0.02),
                    Diameter(name="reamed H7", faces="reamed", fit="H7", nominal_mm=6.0),
                    Distance(name="depth", faces="floor", from_faces="top", lower_mm=-0.01, upper_mm=0.01),
                    Distance(name="width", faces="left", from_faces="right", lower_mm=-0.02, upper_mm=0.02)),
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z)),
        finish=Finish(scallop_mm=0.1, profile_tolerance_mm=0.02, gouge_mm=0.03),
        setups=(Setup(name="setup-1", faces=("pocket", "bore", "reamed"), wcs_in_words="X0 Y0 lower left, Z0 base",
                      operations=(Pocket(faces=("pocket",), tool="flat 10"), Bore(faces=("bore",)),
                                  Ream(faces=("reamed",)))),))
