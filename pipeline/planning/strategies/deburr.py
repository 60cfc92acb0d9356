"""Deburr: sharp edges broken by a pointed cutter, though the solid has no chamfer there."""

from pydantic import Field

from cuspline.design.operations import Operation
from cuspline.planning import deburring


class Deburr(Operation):
    """The sharp upper edges of its faces, where a level face ends at an upright wall, get a break of width_mm by a chamfer mill or
    spot drill; what the cutter cannot reach without touching a wall stays sharp and is listed. The faces are judged as if their
    edges were sharp, the break by its width."""

    kind = "deburr"
    picture = r"""
        \  |  /
         \ | /_____    the cone through the sharp edge,
          \_/'|        width_mm into the faces"""
    is_mended = False

    width_mm: float = Field(default=0.2, gt=0, le=1.0, description="of the break: its longer leg, from the sharp edge")
    tip_below_mm: float | None = Field(default=None, ge=0, le=20, description="of the tip under the break's lower edge; left out: "
                                       "a quarter of what the cone has to spare, up to 1 mm, less where something is below")

    def plan(self, work):
        return deburring.deburred(work)
