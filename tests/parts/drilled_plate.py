"""Plate with holes, as small as makes sense: through, blind with the drill's own point, all from one side."""

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.drill import Drill


class Plate(Parameters):
    """Dimensions of the plate."""

    length_mm: float = Field(60.0, ge=40, le=200, description="along x")
    width_mm: float = Field(40.0, ge=30, le=200, description="along y")
    height_mm: float = Field(12.0, ge=8, le=30, description="along z")


def plate(p):
    """The solid: two holes of 6 mm and one of 5 mm through, one of 8 mm blind, its bottom a cone of 140 degrees."""
    block = cq.Workplane("XY").box(p.length_mm, p.width_mm, p.height_mm, centered=False).faces(">Z").workplane(origin=(0, 0, 0))
    block = block.pushPoints([(10, 10), (p.length_mm - 10, 10)]).hole(6.0).pushPoints([(10, p.width_mm - 10)]).hole(5.0)
    profile = cq.Workplane("XZ").lineTo(4, 4 / 2.7474774194546216).lineTo(4, 20).lineTo(0, 20).close()
    return block.cut(profile.revolve(360, (0, 0, 0), (0, 1, 0)).translate((p.length_mm - 10, p.width_mm - 10, p.height_mm - 7)))


def design(p: Plate) -> Design:
    """The plate, finished outside; only its holes are made."""
    return Design(
        name="drilled_plate", description="plate with four holes", parameters=p, solid=plate(p).val(),
        predicates=(FacePredicate(name="holes", count=4, kinds=("cylinder",)),
                    FacePredicate(name="point", count=1, kinds=("cone",))),
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(p.length_mm, p.width_mm, p.height_mm)),
        finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.005, gouge_mm=0.006),
        setups=(Setup(name="setup-1", faces=("holes", "point"), operations=(Drill(faces=("holes",)),),
                      wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),))
