"""ThreadMill: threads by the one tooth of a thread mill, by helices."""

from pydantic import Field

from cuspline.design.operations import Operation
from cuspline.planning import thread_milling


class ThreadMill(Operation):
    """Threads milled: its faces are the walls of holes that the design states threads for, drilled or bored before."""

    kind = "thread_mill"
    picture = """
        |>  ( . )  <|     in by an arc, round by helices of the pitch,
        |>    ||   <|     climb cutting; out by an arc"""

    passes: int | None = Field(default=None, ge=1, le=20, description="radially; left out: one for each millimetre of the pitch")

    def plan(self, work):
        return thread_milling.milled_threads(work)
