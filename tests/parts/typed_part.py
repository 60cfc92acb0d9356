"""A part as a user writes it: `make lint` holds the type checker against it."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.parallel import Parallel
from cuspline.planning.strategies.rough import Rough


class Plate(Parameters):
    """Its size."""

    length_mm: float = 20.0


def make(p: Plate) -> Design:
    """A plate, its top cut."""
    solid = cq.Workplane().box(p.length_mm, 10, 5, centered=False).val()
    return Design(
        name="typed_part", description="a plate", parameters=p, solid=solid, material="aluminium_6061",
        predicates=(FacePredicate(name="top", count=1, kinds=("plane",), normal=(0.0, 0.0, 1.0)),),
        stock=StockBox(min_mm=(0.0, 0.0, 0.0), max_mm=(p.length_mm, 10.0, 6.0)),
        setups=(Setup(name="setup-1", faces=("top",), wcs_in_words="corner",
                      operations=(Rough(), Parallel(angle_deg=90.0))),),
        finish=Finish(scallop_mm=0.02, profile_tolerance_mm=0.005, gouge_mm=0.005))
