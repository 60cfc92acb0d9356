"""A plate cut out of a sheet, held by two tabs."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.contour import Contour

X, Y, Z, SHEET = 48.0, 36.0, 3.0, 14.0
CONTOUR = Contour(tool="flat 10", tabs=2, tab_width_mm=3)


def solid():
    """The plate, one of its corners round."""
    return cq.Workplane("XY").lineTo(X - 6, 0).radiusArc((X, 6), -6).lineTo(X, Y).lineTo(0, Y).close().extrude(Z).val()


def design(p: Parameters, operation=CONTOUR, sheet=SHEET) -> Design:
    """The plate out of its sheet."""
    walls = FacePredicate(name="walls", at_least=1, center_min_mm=(-1, -1, 1), center_max_mm=(X + 1, Y + 1, Z - 1))
    return Design(name="tabbed_plate", description="plate held by tabs", parameters=p, solid=solid(), predicates=(walls,),
                  material="aluminium_6061", stock=StockBox(min_mm=(-sheet, -sheet, 0), max_mm=(X + sheet, Y + sheet, Z)),
                  finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.01),
                  setups=(Setup(name="setup-1", faces=("walls",), operations=(operation,),
                                wcs_in_words="lower left corner, Z0 on the base"),))
