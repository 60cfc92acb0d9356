"""Parallel: finishing passes in parallel vertical planes over any faces."""

import math

from pydantic import Field

from cuspline.planning import freeform_finishing
from cuspline.planning.patterns import Pattern


class Parallel(Pattern):
    """Finishing passes in parallel vertical planes over any faces."""

    kind = "parallel"
    picture = """
        | | | | | | |     planes as far apart as the cusp allows
        | | | | | | |     where the faces need most"""

    angle_deg: float = Field(default=0.0, ge=-180, le=180, description="direction of the passes from +X")

    def curves(self, field, cutter, ridge_mm):
        return freeform_finishing.pattern_curves("parallel", field, cutter, ridge_mm, math.radians(self.angle_deg))
