"""The block of compensated_boss.py out of a standing one: the control runs beside its outline in an indexed position."""

import cadquery as cq
from compensated_boss import X, Y, Z, solid

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.contour import Contour


def design(p: Parameters) -> Design:
    """Its base is at the back."""
    standing = solid().rotate(cq.Vector(), cq.Vector(1, 0, 0), 90)
    walls = FacePredicate(name="walls", at_least=1, center_min_mm=(-1, 1 - Z, -1), center_max_mm=(X + 1, -1, Y + 1))
    return Design(name="compensated_turned", description="block with a compensated outline, cut from the side", parameters=p,
                  solid=standing, predicates=(walls,), material="aluminium_6061", machine="mill_trunnion_ac",
                  stock=StockBox(min_mm=(-1, -Z, -1), max_mm=(X + 1, 0, Y + 1)),
                  finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.01),
                  setups=(Setup(name="side", faces=("walls",), operations=(Contour(compensation="control"),), indexed=True,
                                wcs_z=(0, -1, 0), wcs_x=(1, 0, 0), clamped_x=(1, 0, 0), clamped_z=(0, 0, 1),
                                wcs_in_words="lower left corner"),))
