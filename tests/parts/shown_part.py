"""Block with a small round trough: what the pages call part.py, trough.py, cradle.py and plate.py."""

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Marker, Parameters, Setup, StockBox

SIZE_MM = (24.0, 4.0, 12.0)


class Block(Parameters):
    depth_mm: float = Field(default=1.0, ge=1, le=8, description="of the trough")
    radius_mm: float = Field(default=30.0, ge=15, le=60, description="that the pages name; here nothing hangs on it")
    a: float = Field(default=1.0, description="as radius_mm")
    b: float = Field(default=2.0, description="as radius_mm")
    name: str = Field(default="x", description="as radius_mm")


def design(p: Block) -> Design:
    x, y, z = SIZE_MM
    block = cq.Workplane("XZ").lineTo(x, 0).lineTo(x, z).threePointArc((x / 2, z - p.depth_mm), (0, z)).close().extrude(-y)
    markers = tuple(Marker(name=name, at_mm=at) for name, at in (("one", (0, 0, 0)), ("two", (x, 0, 0)), ("three", (0, y, 0))))
    return Design(
        name="part", description="block with a round trough", parameters=p, solid=block.val(),
        predicates=(FacePredicate(name="trough", count=1, kinds=("cylinder",)),), material="aluminium_6061",
        stock=StockBox(min_mm=(0, 0, 0), max_mm=(x, y, z + 1)),
        finish=Finish(scallop_mm=0.1, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("trough",), wcs_in_words="lower left corner, Z0 on the base", markers=markers),))
