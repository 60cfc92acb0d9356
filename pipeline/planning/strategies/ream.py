"""Ream: holes of close fits, drilled under size, then reamed down and up at the feed."""

from pydantic import Field

from cuspline.design.operations import Operation
from cuspline.planning import reaming


class Ream(Operation):
    """Holes reamed: its faces are their walls, cylinders along the setup's Z. What is not there yet is drilled first, by the
    largest drill that leaves the reamer `least_stock_mm` on the diameter."""

    kind = "ream"
    picture = """
        | || |  |       G85: down at the feed,
        | || |  |       and up at the feed,
        | \\/ |  |       through, or to the wall's end"""

    least_stock_mm: float = Field(default=0.1, gt=0, le=2, description="on the diameter, that the drill before leaves")
    most_stock_mm: float = Field(default=0.6, gt=0, le=5, description="and no more than that")
    break_through_mm: float = Field(default=0.5, ge=0, le=50, description="below a through hole")
    retract_mm: float | None = Field(default=None, gt=0, le=500,
                                     description="above the stock over a hole it begins to feed; left out: the shop's approach_mm")
    stays_low: bool = Field(default=False, description="from hole to hole in the retract plane (G99), not at the clearance (G98)")

    def plan(self, work):
        return reaming.reamed_holes(work)
