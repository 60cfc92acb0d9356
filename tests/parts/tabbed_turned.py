"""The plate of tabbed_plate.py out of a standing sheet, cut from its front in an indexed position."""

import cadquery as cq
from tabbed_plate import CONTOUR, SHEET, X, Y, Z, solid

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox


def design(p: Parameters) -> Design:
    """The plate's base is at the back."""
    standing = solid().rotate(cq.Vector(), cq.Vector(1, 0, 0), 90)
    walls = FacePredicate(name="walls", at_least=1, center_min_mm=(-1, 1 - Z, -1), center_max_mm=(X + 1, -1, Y + 1))
    return Design(name="tabbed_turned", description="plate held by tabs, cut from the side", parameters=p, solid=standing,
                  predicates=(walls,), material="aluminium_6061", machine="mill_trunnion_ac",
                  stock=StockBox(min_mm=(-SHEET, -Z, -SHEET), max_mm=(X + SHEET, 0, Y + SHEET)),
                  finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.01),
                  setups=(Setup(name="side", faces=("walls",), operations=(CONTOUR,), indexed=True, wcs_z=(0, -1, 0),
                                wcs_x=(1, 0, 0), clamped_x=(1, 0, 0), clamped_z=(0, 0, 1), wcs_in_words="lower left corner"),))
