"""Waterline: passes round walls at constant height."""

from pydantic import Field, model_validator

from cuspline.planning import freeform_finishing
from cuspline.planning.patterns import Pattern


class Waterline(Pattern):
    """Finishing passes round steep faces at constant height, from the top: ball, bull nose, flat cutter, a barrel that leans."""

    kind = "waterline"
    picture = """
          ______
         /------\\       heights as the cusp allows;
        /--------\\      a flat cutter on upright walls:
       /----------\\     as deep as its flutes"""

    steep_deg: float = Field(default=30.0, ge=1, le=90, description="places less steep than this are left to other operations")

    @model_validator(mode="after")
    def _is_for_what_is_steep(self):
        if self.leave_steep:
            raise ValueError("waterline passes are for what is steep: leave leave_steep out, or take another strategy")
        return self

    @property
    def types(self):
        """A flat cutter too, on upright walls; whatever leans by lead and tilt."""
        return super().types if self.turns else ("ball", "bull_nose", "flat")

    def curves(self, field, cutter, ridge_mm):
        return []

    def plan(self, work):
        tool, candidates, reached = work.chosen_tool(*self.types)
        made = freeform_finishing.walls_alone(work, tool, candidates)
        return [made] if made is not None else [], reached
