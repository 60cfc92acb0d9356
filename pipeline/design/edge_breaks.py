"""Edges that an operation breaks, which the design's solid has sharp."""

from pydantic import Field

from cuspline.values.models import Model, Point


class EdgeBreak(Model):
    """What is to be broken by one operation, part coordinates."""

    setup: str
    operation: str
    width_mm: float = Field(gt=0, description="the longer leg, from the sharp edge")
    high_mm: float = Field(gt=0, description="the leg along the tool's axis, down the wall")
    within_mm: float = Field(gt=0, description="that legs may be off")
    lines: tuple[tuple[Point, ...], ...] = Field(min_length=1, description="places of the sharp edge that are to be broken")
    edges: tuple[tuple[Point, ...], ...] = Field(min_length=1, description="places of all edges that may be broken, their corners "
                                                 "that stay sharp among them")
