"""A plate that is finished but for its sharp edges: a pocket, a hole, a ledge, and a boss that stands close to the rim."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockSolid
from cuspline.planning.strategies.deburr import Deburr

X, Y, Z = 40.0, 28.0, 8.0
BREAK = Deburr(faces=("top",), width_mm=0.2)


def plate():
    """The solid: a pocket with corners of 5 mm, a hole of 6 mm through, a ledge 1.5 mm down, a boss 1 mm beside the rim."""
    block = cq.Workplane("XY").box(X, Y, Z, centered=False)
    pocket = cq.Workplane("XY").box(20, 16, 4, centered=False).edges("|Z").fillet(5).translate((4, 6, Z - 3))
    ledge = cq.Workplane("XY").box(4, Y, 2, centered=False).translate((X - 2, 0, Z - 1.5))
    boss = cq.Workplane("XY").circle(1.5).extrude(3).translate((30, 2.5, Z))
    return block.cut(pocket).cut(cq.Workplane("XY").circle(3).extrude(20).translate((32, 14, -1))).cut(ledge).union(boss)


def design(p: Parameters, operation=BREAK, solid=None) -> Design:
    """The plate out of itself: nothing is cut but its edges."""
    solid = (solid or plate()).val()
    return Design(name="deburred_plate", description="plate whose edges are broken", parameters=p, solid=solid,
                  predicates=(FacePredicate(name="top", count=1, normal=(0, 0, 1), area_min_mm2=300.0),
                              FacePredicate(name="floor", count=1, normal=(0, 0, 1), center_min_mm=(4, 6, Z - 4),
                                            center_max_mm=(24, 22, Z - 2))),
                  material="aluminium_6061", stock=StockSolid(solid=solid),
                  finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
                  setups=(Setup(name="setup-1", faces=("floor",), operations=(operation,), wcs_in_words="corner, Z0 on the base"),))
