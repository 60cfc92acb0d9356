"""Tap: threads by rigid taps, the spindle tied to the feed."""

from pydantic import Field

from cuspline.design.operations import Operation
from cuspline.planning import tapping


class Tap(Operation):
    """Threads tapped: its faces are the walls of holes that the design states threads for, drilled before."""

    kind = "tap"
    picture = """
        |/|  |\\|     G84, G74, G33.1, G331: down by a pitch a turn,
        |\\|  |/|     the spindle turns round at the bottom
        |/|  |\\|     and leads it back"""

    retract_mm: float | None = Field(default=None, gt=0, le=500, description="above the stock over a hole where feed and spindle "
                                     "are tied; left out: three pitches, the shop's approach_mm at least")

    def plan(self, work):
        return tapping.tapped_holes(work)
