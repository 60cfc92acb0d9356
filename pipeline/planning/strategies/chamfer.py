"""Chamfer: edges broken by a pointed cutter of the chamfer's own angle."""

from pydantic import Field

from cuspline.design.operations import Operation
from cuspline.planning import chamfering


class Chamfer(Operation):
    """Chamfers and countersinks by a chamfer mill or spot drill of their angle: its faces are flat strips along level edges, and
    cones about the setup's Z."""

    kind = "chamfer"
    picture = r"""
        \  |  /
         \ | /____     the cone along the lower edge,
          \_/    |     the tip below it"""

    tip_below_mm: float | None = Field(default=None, ge=0, le=50, description="of the tip under the chamfer's lower edge; left "
                                       "out: a quarter of what the cone has to spare, less where something is below")

    def plan(self, work):
        return chamfering.chamfered(work)
