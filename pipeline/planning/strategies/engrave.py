"""Engrave: grooves along lines, by a pointed cutter or a ball."""

from pydantic import Field, model_validator

from cuspline.design.operations import Operation
from cuspline.planning import engraving
from cuspline.values.models import Coordinate

PlanPoint = tuple[Coordinate, Coordinate]


class Engrave(Operation):
    """Text and curves along level and free-form faces: outlines of letters, borders of faces, or lines by their places, laid on its
    faces from above. The tip runs depth_mm below where the cutter would rest on the face; depth, width and place are judged, and
    the faces themselves as if nothing were engraved."""

    kind = "engrave"
    picture = r"""
        \ /           the tip along the line,
      ___V___  ____   depth_mm below the face,
         |_A_|        level or free-form"""
    is_mended = False

    depth_mm: float = Field(gt=0, le=5, description="of the tip below the face, along the tool")
    text: str | None = Field(default=None, min_length=1, max_length=200, description="one line, by the outlines of its letters")
    at: PlanPoint | None = Field(default=None, description="X and Y of the text's lower left, in the setup's axes from the part's "
                                 "zero; left out: 0, 0")
    height_mm: float | None = Field(default=None, gt=0, le=500, description="of the font; left out: 5")
    angle_deg: float | None = Field(default=None, ge=-360, le=360, description="of the text to X; left out: 0")
    font_path: str | None = Field(default=None, description="a .ttf or .otf file; left out: DejaVu Sans")
    lines: tuple[tuple[PlanPoint, ...], ...] | None = Field(default=None, min_length=1, description="X and Y of places, in the "
                                                            "same axes")
    borders_of: str | None = Field(default=None, description="name of faces whose borders are engraved")

    @model_validator(mode="after")
    def _has_lines(self):
        if sum(v is not None for v in (self.text, self.lines, self.borders_of)) != 1:
            raise ValueError("state one of text, lines and borders_of")
        if self.text is None and any(v is not None for v in (self.at, self.height_mm, self.angle_deg, self.font_path)):
            raise ValueError("at, height_mm, angle_deg and font_path go with text")
        if self.lines is not None and any(len(line) < 2 for line in self.lines):
            raise ValueError("a line has two places or more")
        return self

    def plan(self, work):
        return engraving.engraved(work)
