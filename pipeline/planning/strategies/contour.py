"""Contour: upright walls by the side of a flat cutter, along their exact plan."""

from typing import Literal

from pydantic import Field

from cuspline.design.operations import Finishing
from cuspline.planning import contouring


class Contour(Finishing):
    """Walls that stand along the setup's Z, outside and inside, closed and open chains: climb cutting, roughed by a helix where
    stock stands beside them, finished at their foot with arcs in and out."""

    kind = "contour"
    picture = """
         ___________
        /  _______  \\     lines and arcs at the cutter's radius,
       |  | part  |  |    round outside corners,
        \\_|_______|_/     in and out by arcs"""

    passes: Literal["one-way"] = Field(default="one-way", description="climb cutting alone")
    finish_allowance_mm: float | None = Field(default=None, gt=0, le=20,
                                              description="what the finishing pass takes off; left out: the shop's "
                                              "rough_allowance_mm")
    stepdown_mm: float | None = Field(default=None, gt=0, le=100,
                                      description="of roughing; left out: the material's share of the diameter")
    ramp_deg: float | None = Field(default=None, gt=0, lt=45, description="of the way down; left out: the shop's")
    spring_passes: int = Field(default=0, ge=0, le=9, description="times that the finishing pass is run again, for what the cutter "
                               "was pushed off")

    compensation: Literal["control"] | None = Field(default=None, description="control: the contour itself is programmed, and the "
                                                    "control runs beside it by the radius in its D register (G41); left out: the "
                                                    "cutter's middle is programmed")
    worn_mm: float | None = Field(default=None, gt=0, le=1, description="by which the radius in the register may be smaller, as "
                                  "measured, than the cutter's own; left out, with compensation: 0.1")

    def plan(self, work):
        return contouring.contoured(work)
