"""Block with a round trough along y: change it, or put your own parts beside it."""

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox


class Trough(Parameters):
    """Dimensions of the block."""

    length_mm: float = Field(default=24.0, ge=20, le=200, description="along x, across the trough")
    width_mm: float = Field(default=10.0, ge=8, le=200, description="along y")
    height_mm: float = Field(default=12.0, ge=10, le=60, description="of the block")
    depth_mm: float = Field(default=2.0, ge=1, le=8, description="deepest place of the trough")


def design(p: Trough) -> Design:
    """The block, finished outside; only the trough is cut."""
    block = (cq.Workplane("XZ").lineTo(p.length_mm, 0).lineTo(p.length_mm, p.height_mm)
             .threePointArc((p.length_mm / 2, p.height_mm - p.depth_mm), (0, p.height_mm)).close().extrude(-p.width_mm))
    return Design(
        name="trough", description="block with a round trough", parameters=p, solid=block.val(),
        predicates=(FacePredicate(name="trough", count=1, kinds=("cylinder",)),),
        material="aluminium_6061",
        stock=StockBox(min_mm=(0, 0, 0), max_mm=(p.length_mm, p.width_mm, p.height_mm + 1)),
        finish=Finish(scallop_mm=0.02, profile_tolerance_mm=0.004, gouge_mm=0.005),
        setups=(Setup(name="setup-1", faces=("trough",), wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),))
