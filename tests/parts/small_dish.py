"""Small block with a wavy top."""

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox


class Dish(Parameters):
    """Dimensions."""

    length_mm: float = Field(24.0, ge=10, le=100)


def design(p: Dish) -> Design:
    points = [(0, 11), (6, 9.5), (12, 10.5), (18, 9.2), (p.length_mm, 11)]
    block = (cq.Workplane("XZ").moveTo(0, 0).lineTo(0, 11).spline(points[1:], includeCurrent=True)
             .lineTo(p.length_mm, 0).close().extrude(-16))
    dish = cq.Workplane("XY").sphere(9.0).translate((12, 8, 16.5))
    solid = block.cut(dish).val()
    return Design(
        name="dish", description="block with a wavy top and a dish", parameters=p, solid=solid,
        predicates=(FacePredicate(name="top", count=2, normal=(0, 0, 1), normal_within_deg=60.0),),
        material="aluminium_6061",
        stock=StockBox(min_mm=(0, 0, 0), max_mm=(p.length_mm, 16, 12.5)),
        finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.003, gouge_mm=0.004),
        setups=(Setup(name="setup-1", faces=("top",), strategy="constant_scallop", wcs_in_words="X0 Y0 lower left, Z0 base"),))
