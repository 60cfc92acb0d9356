"""Slot: along its middle by a flat cutter, then the walls on both sides."""

from pydantic import Field, model_validator

from cuspline.design.operations import Clearing
from cuspline.planning import slotting


class Slot(Clearing):
    """Straight slots, closed, or open at one end or both, and rings between two circles: its faces are their two long walls, their
    ends and floors. The cutter goes down along the middle by a ramp, level by level from an open end; then the walls are finished
    at their foot. One as wide as the slot makes it in size."""

    kind = "slot"
    picture = """
        |\\        /|     to and fro, down by a ramp,
        |  \\____/  |     from outside where it is open;
        |__________|     then along both walls"""

    lead_radius_mm: float | None = Field(default=None, ge=0, le=50, description="of the arcs in and out; left out: the shop's")
    spring_passes: int = Field(default=0, ge=0, le=9, description="times that the walls' pass is run again")

    @model_validator(mode="after")
    def _has_no_stepover(self):
        if self.stepover_mm is not None:
            raise ValueError("a slot has one middle line and no stepover_mm: leave it out, or give wide slots to pocket")
        return self

    def plan(self, work):
        return slotting.slotted(work)
