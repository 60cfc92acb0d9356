"""Floor: level faces with the flat of a bull nose or flat cutter."""

from cuspline.design.operations import Finishing
from cuspline.planning import level_finishing
from cuspline.values.errors import CutterDoesNotFit


class Floor(Finishing):
    """Finishing of level faces: passes side by side under the cutter's flat, then once along the walls round them."""

    kind = "floor"
    picture = """
        |  |______|   |
        |__(      )___|     the flat leaves no cusp"""

    def plan(self, work):
        tool, candidates, reached = self._tool(work)
        made = level_finishing.floors(work, tool, candidates)
        return [made], reached & (work.samples.normal[:, 2] > level_finishing.LEVEL)

    def _tool(self, work):
        """As `chosen_tool`: a bull nose, or where none fits the fillets a flat cutter, which leaves them whole."""
        try:
            return work.chosen_tool("bull_nose", "flat")
        except CutterDoesNotFit:
            if self.tool is not None or not any(t.cutter.type == "flat" for t in work.library.tools):
                raise
            return work.chosen_tool("flat")
