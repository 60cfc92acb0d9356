"""Floor: level faces with the flat of a bull nose or flat cutter."""

from cuspline.design.operations import Finishing
from cuspline.planning import level_finishing


class Floor(Finishing):
    """Finishing of level faces: passes side by side under the cutter's flat, then once along the walls round them."""

    kind = "floor"
    picture = """
        |  |______|   |
        |__(      )___|     the flat leaves no cusp"""

    def plan(self, work):
        tool, candidates, reached = work.chosen_tool("bull_nose", "flat")
        made = level_finishing.floors(work, tool, candidates)
        return [made], reached & (work.samples.normal[:, 2] > level_finishing.LEVEL)
