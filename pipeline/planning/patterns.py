"""What finishing operations that are laid out as seen from above have in common."""

from abc import abstractmethod
from dataclasses import replace
from typing import Literal

from pydantic import Field

from cuspline.design.operations import Finishing
from cuspline.planning import freeform_finishing, roughing
from cuspline.planning.context import left_as_steep
from cuspline.toolpaths.five_axis.tool_axes import LEANING, AnyAxis, FastestAxis, LeadTilt, ToolAxis


class Pattern(Finishing):
    """Passes over the region where a ball, bull nose or tapered ball touches the faces."""

    tool_axis: AnyAxis | None = Field(
        default=None, description="left out: the setup's Z, which a unit vector towards the spindle may state too, part "
        "coordinates; a table: how the axis turns along the passes, on a machine with rotary axes: "
        "lead_tilt (which cutters of other forms take too), of a ball also fixed, through_point, along_line, "
        "between_guides, clearing (any of them, turned out of the way)")
    leave_steep: bool = Field(default=False, description="walls steeper than steep_deg are left to other operations, or to indexed "
                              "positions that see them better")

    bearing: Literal["step-up", "uphill", "nearest"] | None = Field(
        default=None, description="how passes keep the tip out of the cut: step-up, the lowest pass first; uphill, each from "
        "its lower end; nearest: not at all, the nearest next; left out: what keeps a ball's tip out in little more time")

    @property
    def waterline_deg(self):
        return 90.0 if self.leave_steep else self.steep_deg

    @property
    def steepest_deg(self):
        return self.steep_deg if self.leave_steep else 90.0

    @property
    def pattern(self):
        """What plan.json calls the passes."""
        return self.kind

    @property
    def turns(self):
        """Whether its tool axis is anything but the setup's Z."""
        return isinstance(self.tool_axis, ToolAxis)

    @property
    def types(self):
        """Cutter types that it can use, the first of them unless others are asked for."""
        if self.turns:
            return LEANING if isinstance(self.tool_axis, (LeadTilt, FastestAxis)) else ("ball",)
        return ("ball", "bull_nose", "tapered_ball", "flat")

    @abstractmethod
    def curves(self, field, cutter, ridge_mm):
        """Passes in plan: list of toolpaths.freeform.plane_curves.PlaneCurve.

        Args:
            field: tip_field.TipField.   cutter: shop.cutters.Cutter.   ridge_mm: largest cusp.
        """

    def plan(self, work):
        if isinstance(self.tool_axis, FastestAxis):
            return self._plan_fastest(work)
        tool, candidates, reached = work.chosen_tool(*self.types)
        made = freeform_finishing.passes_over(work, tool, candidates)
        own = reached & ~left_as_steep(self, work.samples)
        return [*roughing.before_passes(work, tool, own), made] if made is not None else [], reached

    def _plan_fastest(self, work):
        """The same with the fastest cutter and lead that can be planned."""
        def plan(number, axis):
            one = self.model_copy(update={"tool": number, "tool_axis": axis, "name": self.name or self.title})
            return one.plan(work.of(one, list(work.planned)))

        (made, reached), why = freeform_finishing.with_fastest(work, plan)
        return [replace(o, facts={**o.facts, "not_taken": why}) if o is made[-1] else o for o in made], reached
