"""Rest: passes of a smaller cutter where all operations before leave more than the cusp."""

import math
from typing import Literal

from pydantic import Field

from cuspline.planning import freeform_finishing
from cuspline.planning.patterns import Pattern
from cuspline.toolpaths.roughing.stock_fields import AnyHeights


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
        """Nobody has named its tool, where the one before may leave nothing; or it is a position among others, which may."""
        return self.tool is None or self.leave_steep

    def curves(self, field, cutter, ridge_mm):
        return freeform_finishing.pattern_curves(self.strategy, field, cutter, ridge_mm, math.radians(self.angle_deg))

    def plan(self, work):
        tool, candidates, reached = work.chosen_tool(*self.types)
        before, is_done = [o.swept_mm for o in work.planned], work.is_done
        if not before and is_done is None:
            before = [AnyHeights(work.stock_mm)]
        made = freeform_finishing.passes_over(work, tool, candidates, before, is_done)
        return [made] if made is not None else [], reached
