"""Block with a wavy top and a dish in it, as small as makes sense: even scallops in seconds."""

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.auto import Auto


class Dish(Parameters):
    """Dimensions of the block."""

    length_mm: float = Field(14.0, ge=10, le=100, description="along x")
    width_mm: float = Field(10.0, ge=8, le=100, description="along y")


def design(p: Dish) -> Design:
    """The block, its top finished by lines of even cusp height."""
    x, y = p.length_mm, p.width_mm
    crown = [(0.25 * x, 9.6), (0.5 * x, 10.4), (0.75 * x, 9.3), (x, 10.5)]
    block = cq.Workplane("XZ").lineTo(0, 10.6).spline(crown, includeCurrent=True).lineTo(x, 0).close().extrude(-y)
    dish = cq.Workplane("XY").sphere(8.0).translate((x / 2, y / 2, 17.4))
    return Design(
        name="small_dish", description="block with a wavy top and a dish", parameters=p, solid=block.cut(dish).val(),
        predicates=(FacePredicate(name="top", count=2, normal=(0, 0, 1), normal_within_deg=60.0),),
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(x, y, 13.0)),
        finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.003, gouge_mm=0.004),
        setups=(Setup(name="setup-1", faces=("top",), operations=(Auto(strategy="constant_scallop"),),
                      wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),))
