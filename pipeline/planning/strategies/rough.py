"""Rough: levels cleared with bounded engagement, on the stock as it stands."""

from pydantic import Field

from cuspline.design.operations import Clearing
from cuspline.planning import roughing
from cuspline.planning.cutter_choice import Candidate, choose_roughing, cutter_reach, leftover_rows, roughing_tools


class Rough(Clearing):
    """Roughing level by level, in by ramps or from outside; on what really stands, so a second one is rest roughing."""

    kind = "rough"
    picture = """
        #########  ________
        ####   ##  |      |     levels, from the top,
        ###     #  |______|     then the steps between them"""

    threshold_mm: float | None = Field(default=None, ge=0, le=50,
                                       description="what stands less than this above the allowance is left "
                                       "alone; left out: nothing for the first, the shop's for others")

    def plan(self, work):
        practice = work.practice
        allowance = practice.rough_allowance_mm if self.allowance_mm is None else self.allowance_mm
        threshold = self.threshold_mm
        if threshold is None:
            threshold = practice.rest_threshold_mm if work.planned else 0.0
        tool, candidates = self._tool(work, allowance)
        stage = roughing.RoughingStage(name=self.title, allowance_mm=allowance, threshold_mm=threshold)
        made, _, _ = roughing.cleared(work, stage, tool, candidates, work.stock_mm, leftover_rows(work.samples), self)
        return [made] if made is not None else [], cutter_reach(work.samples, work.mesh, tool.cutter).is_reached

    def _tool(self, work, allowance_mm):
        """(Tool, candidates): the one asked for, or the largest that leaves least."""
        usable = work.tools("flat", "bull_nose")
        if len(usable) == 1:
            return usable[0], (Candidate(tool=usable[0], is_chosen=True, reason="as requested"),)
        library = work.library.model_copy(update={"tools": tuple(usable)})
        found = roughing_tools(library, work.mesh, work.samples, work.stock_min_mm, work.stock_max_mm, allowance_mm)
        best, candidates = choose_roughing(found, allowance_mm)
        return best.tool, candidates
