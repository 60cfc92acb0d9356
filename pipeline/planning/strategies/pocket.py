"""Pocket: cleared with bounded engagement round its islands, walls and floors finished by a flat cutter."""

from pydantic import Field, model_validator

from cuspline.design.operations import Clearing, understood
from cuspline.planning import pocketing


class Pocket(Clearing):
    """Pockets, closed or open to a side, one in another, with islands: its faces are their level floors and upright walls.
    Cleared in levels, or at their whole depth and narrower where that is faster and nothing is stated; what the clearing cutter
    leaves in corners a smaller one clears; then the floors are finished, and the walls at their foot."""

    kind = "pocket"
    picture = """
        |  ( )  __  ( )  |     spirals of bounded engagement,
        |_( ~ )|__|( ~ )_|     round islands; corners by a
                               smaller cutter; walls, floors"""

    rest_tool: int | str | None = Field(default=None, description="clears what the first leaves in corners; left out: chosen where "
                                        "`tool` is left out too, else none does")
    finish_tool: int | str | None = Field(default=None, description="flat, of walls and floors; left out: the fastest that fits "
                                          "their corners")
    finishes: bool = Field(default=True, description="false: cleared alone, to the allowance")
    lead_radius_mm: float | None = Field(default=None, ge=0, le=50, description="of the arcs in and out; left out: the shop's")
    spring_passes: int = Field(default=0, ge=0, le=9, description="times that the walls' pass is run again")

    _tools_are_understood = understood("rest_tool", "finish_tool")


    @model_validator(mode="after")
    def _says_what_it_does(self):
        if not self.finishes and (self.finish_tool is not None or self.spring_passes):
            raise ValueError("finishes = false clears alone: leave finish_tool and spring_passes out, or finishes")
        return self

    def plan(self, work):
        return pocketing.pocketed(work)
