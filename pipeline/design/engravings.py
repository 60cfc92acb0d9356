"""Engravings: grooves that an operation cuts along lines of a face, which the design's solid does not have."""

from pydantic import Field

from cuspline.values.models import Model, Point


class Engraving(Model):
    """What is wanted cut, part coordinates."""

    setup: str
    operation: str
    depth_mm: float = Field(gt=0, description="of the tip below where the cutter would rest on the face, along its axis")
    width_mm: float = Field(gt=0, description="of the groove in a level face")
    within_mm: float = Field(gt=0, description="that depth, width and place may be off")
    lines: tuple[tuple[Point, ...], ...] = Field(min_length=1, description="where the tip runs, at its depth")
