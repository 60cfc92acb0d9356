"""A small block whose outline the control runs beside."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.contour import Contour

X, Y, Z = 24.0, 18.0, 4.0


def solid():
    """Its base at Z 0."""
    outline = cq.Workplane("XY").lineTo(X - 6, 0).radiusArc((X, 6), -6).lineTo(X, Y).lineTo(0, Y).lineTo(0, 5).lineTo(5, 0).close()
    return outline.extrude(Z).val()


def design(p: Parameters) -> Design:
    """The block out of its box."""
    walls = FacePredicate(name="walls", at_least=1, center_min_mm=(-1, -1, 1), center_max_mm=(X + 1, Y + 1, Z - 1))
    return Design(name="compensated_boss", description="block with a compensated outline", parameters=p,
                  solid=solid(), predicates=(walls,),
                  material="aluminium_6061", stock=StockBox(min_mm=(-1, -1, 0), max_mm=(X + 1, Y + 1, Z)),
                  finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.01),
                  setups=(Setup(name="setup-1", faces=("walls",), operations=(Contour(compensation="control"),),
                                wcs_in_words="lower left corner, Z0 on the base"),))
