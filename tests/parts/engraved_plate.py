"""A plate with a line engraved in its level top and one along a round back, by a pointed cutter and a ball."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.engrave import Engrave
from cuspline.planning.strategies.parallel import Parallel

X, Y, Z = 24.0, 16.0, 6.0
BACK = Engrave(name="back", faces=("back",), tool="ball 4", depth_mm=0.15, lines=(((3.0, 3.0), (9.0, 13.0)),))
LEVEL = Engrave(name="mark", faces=("level",), depth_mm=0.2, text="A7", height_mm=6.0, at=(13.5, 5.0))


def design(p: Parameters) -> Design:
    """Half of the top is level, the other half a part of a cylinder along Y."""
    block = cq.Workplane("XZ").lineTo(X, 0).lineTo(X, Z).lineTo(12, Z).radiusArc((0, Z - 3), -25.5).close().extrude(-Y)
    return Design(name="engraved_plate", description="plate with engravings", parameters=p, solid=block.val(),
                  predicates=(FacePredicate(name="back", count=1, kinds=("cylinder",)),
                              FacePredicate(name="level", count=1, kinds=("plane",), normal=(0, 0, 1))),
                  material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z)),
                  finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
                  setups=(Setup(name="setup-1", faces=("back",), operations=(Parallel(), BACK, LEVEL),
                                wcs_in_words="corner, Z0 on the base"),))
