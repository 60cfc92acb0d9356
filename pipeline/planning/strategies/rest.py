"""Rest: passes of a smaller cutter where all operations before leave more than the cusp."""

import math
from typing import Literal

from pydantic import Field

from cuspline.planning import freeform_finishing
from cuspline.planning.patterns import Pattern


class Rest(Pattern):
    """Finishing passes only where the operations before leave more than the cusp."""

    kind = "rest"
    picture = """
         \\  (      )  /
          \\_(______)_/     what the larger ball leaves
             ( ) ( )        in corners and fillets"""

    strategy: Literal["parallel", "constant_scallop"] = Field(default="parallel", description="how the passes run")
    angle_deg: float = Field(default=0.0, ge=-180, le=180, description="parallel: direction of the passes from +X")

    @property
    def may_be_idle(self):
        """A smaller tool that nobody has named: where the one before leaves nothing there is none to be looked for."""
        return self.tool is None

    def curves(self, field, cutter, ridge_mm):
        return freeform_finishing.pattern_curves(self.strategy, field, cutter, ridge_mm, math.radians(self.angle_deg))

    def plan(self, work):
        tool, candidates, reached = work.chosen_tool(*self.types)
        before = [o.swept_mm for o in work.planned]
        made = freeform_finishing.passes_over(work, tool, candidates, before or [work.stock_mm])
        return [made] if made is not None else [], reached
