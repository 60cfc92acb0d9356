"""Facing: the stock's top taken down to a height, across the whole of it."""

import numpy as np
from pydantic import Field

from cuspline.design.operations import Clearing
from cuspline.planning import level_finishing


class Facing(Clearing):
    """Passes across the whole stock, in and out beside it, down to the part's top."""

    kind = "facing"
    picture = """
        ===|______|===>     across, over the edge,
        ##############      and back beside it"""

    height_mm: float | None = Field(default=None, ge=-1e5, le=1e5,
                                    description="to this height, part coordinates along the setup's Z; "
                                    "left out: the top of the part and the allowance")
    angle_deg: float = Field(default=0.0, ge=-180, le=180, description="direction of the passes from +X")

    def plan(self, work):
        tool = level_finishing.facing_tool(work)
        made, height = level_finishing.faced(work, tool, 0.0 if self.allowance_mm is None else self.allowance_mm)
        on_top = (work.samples.normal[:, 2] > level_finishing.LEVEL) & (
            np.abs(work.samples.point_mm[:, 2] - height) < level_finishing.SAME_MM)
        return [made] if made is not None else [], on_top
