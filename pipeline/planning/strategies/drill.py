"""Drill: holes by drills of their diameter, in the canned cycles that a control has."""

from typing import Literal

from pydantic import Field, model_validator

from cuspline.design.operations import Operation
from cuspline.planning import drilling


class Drill(Operation):
    """Holes drilled: its faces are their walls, cylinders along the setup's Z, through or blind."""

    kind = "drill"
    picture = """
         ||  ^         G81 drill, G82 dwell at the bottom,
        _||__|__       G83 peck: up to clear the chips,
       #\\/#  |         G73 chip break: up by a little"""

    cycle: Literal["drill", "peck", "chip_break", "dwell"] | None = Field(
        default=None, description="left out: peck where a hole is deeper than three times its diameter, else drill")
    peck_mm: float | None = Field(default=None, gt=0, le=500, description="peck, chip_break: depth of one; left out: the diameter")
    dwell_s: float | None = Field(default=None, gt=0, le=60, description="dwell: time at the bottom; left out: three turns")
    break_through_mm: float = Field(default=0.5, ge=0, le=50, description="below a through hole, behind the drill's point")
    retract_mm: float | None = Field(default=None, gt=0, le=500,
                                     description="above the stock over a hole it begins to feed; left out: the shop's approach_mm")
    spot: bool | None = Field(default=None, description="a spot drill goes before, 0.8 of the hole wide, so that the drill does "
                              "not wander; left out: as the shop's spot_holes says")
    stays_low: bool = Field(default=False, description="from hole to hole in the retract plane (G99), not at the clearance (G98)")

    @model_validator(mode="after")
    def _says_what_its_cycle_has(self):
        if self.peck_mm is not None and self.cycle in ("drill", "dwell"):
            raise ValueError("peck_mm belongs to the cycles peck and chip_break: leave it out, or choose one of them")
        if self.dwell_s is not None and self.cycle != "dwell":
            raise ValueError("dwell_s belongs to the cycle dwell: leave it out, or choose that")
        return self

    def plan(self, work):
        return drilling.drilled_holes(work)
