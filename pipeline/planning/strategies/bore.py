"""Bore: holes, counterbores and flat bottoms by helices of a flat cutter."""

from pydantic import Field

from cuspline.design.operations import Operation
from cuspline.planning import boring


class Bore(Operation):
    """Holes whose diameter no drill has, and counterbores: its faces are their walls, cylinders along the setup's Z, with the
    ledges and flat bottoms at their foot."""

    kind = "bore"
    picture = """
        |  (    )  |      down by helices, ring by ring,
        |   (  )   |      then once round at the bottom
        |__________|"""

    finish_allowance_mm: float | None = Field(default=None, gt=0, le=20, description="what the finishing pass takes off; left out: "
                                              "the shop's rough_allowance_mm")
    stepdown_mm: float | None = Field(default=None, gt=0, le=100,
                                      description="deepest turn of a helix; left out: the material's share of the diameter")
    stepover_mm: float | None = Field(default=None, gt=0, le=100, description="from ring to ring; left out: the shop's")
    ramp_deg: float | None = Field(default=None, gt=0, lt=45, description="of the helices; left out: the shop's")
    break_through_mm: float = Field(default=0.5, ge=0, le=50, description="below a through hole")
    spring_passes: int = Field(default=0, ge=0, le=9, description="times that the finishing pass is run again")

    def plan(self, work):
        return boring.bored_holes(work)
