"""Floor: level faces with the flat of a bull nose or flat cutter."""

import numpy as np

from cuspline.design.operations import Finishing
from cuspline.planning import level_finishing, roughing


class Floor(Finishing):
    """Finishing of level faces: passes side by side under the cutter's flat, then once along the walls round them."""

    kind = "floor"
    picture = """
        |  |______|   |
        |__(      )___|     the flat leaves no cusp"""

    def plan(self, work):
        tool, candidates, reached = work.chosen_tool("bull_nose", "flat")
        level = reached & (work.samples.normal[:, 2] > level_finishing.LEVEL)
        before, stock = roughing.before_floors(work, tool, np.flatnonzero(level))
        return [*before, level_finishing.floors(work, tool, candidates, stock)], level
