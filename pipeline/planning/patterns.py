"""What finishing operations that are laid out as seen from above have in common."""

from abc import abstractmethod

from cuspline.design.operations import Finishing
from cuspline.planning import freeform_finishing, roughing


class Pattern(Finishing):
    """Passes over the region where a ball, bull nose or tapered ball touches the faces."""

    @property
    def pattern(self):
        """What plan.json calls the passes."""
        return self.kind

    @abstractmethod
    def curves(self, field, cutter, ridge_mm):
        """Passes in plan: list of toolpaths.freeform.plane_curves.PlaneCurve.

        Args:
            field: tip_field.TipField.   cutter: shop.cutters.Cutter.   ridge_mm: largest cusp.
        """

    def plan(self, work):
        tool, candidates, reached = work.chosen_tool("ball", "bull_nose", "tapered_ball", "flat")
        made = freeform_finishing.passes_over(work, tool, candidates)
        return [*roughing.before_passes(work, tool, reached), made] if made is not None else [], reached
