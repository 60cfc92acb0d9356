"""Contour: upright walls by the side of a flat cutter, along their exact plan."""

from typing import Literal

from pydantic import Field, model_validator

from cuspline.design.operations import Finishing
from cuspline.planning import contouring
from cuspline.values.models import Coordinate


class Contour(Finishing):
    """Walls that stand along the setup's Z, outside and inside, closed and open chains: climb cutting, roughed by a helix where
    stock stands beside them, finished at their foot with arcs in and out."""

    kind = "contour"
    picture = """
         ___________
        /  _______  \\     lines and arcs at the cutter's radius,
       |  | part  |  |    round outside corners,
        \\_|_______|_/     in and out by arcs"""

    passes: Literal["one-way"] = Field(default="one-way", description="climb cutting alone")
    finish_allowance_mm: float | None = Field(default=None, gt=0, le=20,
                                              description="what the finishing pass takes off; left out: the shop's "
                                              "rough_allowance_mm")
    stepdown_mm: float | None = Field(default=None, gt=0, le=100,
                                      description="of roughing; left out: the material's share of the diameter")
    ramp_deg: float | None = Field(default=None, gt=0, lt=45, description="of the way down; left out: the shop's")
    spring_passes: int = Field(default=0, ge=0, le=9, description="times that the finishing pass is run again, for what the cutter "
                               "was pushed off")

    finish_passes: int | None = Field(default=None, ge=1, le=9, description="in which finish_allowance_mm is taken off, in equal "
                                      "shares; left out: one")
    compensation: Literal["control"] | None = Field(default=None, description="control: the contour itself is programmed, and the "
                                                    "control runs beside it by the radius in its D register (G41); left out: the "
                                                    "cutter's middle is programmed")
    worn_mm: float | None = Field(default=None, gt=0, le=1, description="by which the radius in the register may be smaller, as "
                                  "measured, than the cutter's own; left out, with compensation: 0.1")

    tabs: int | None = Field(default=None, ge=1, le=50, description="bridges of stock left along each chain, evenly: at its "
                             "foot, as wide as the cutter's way")
    tab_places: tuple[tuple[Coordinate, Coordinate], ...] | None = Field(
        default=None, min_length=1, description="in place of tabs: X and Y of their middles, part coordinates, each on the chain "
        "that is nearest")
    tab_width_mm: float | None = Field(default=None, gt=0, le=200, description="where they are narrowest; left out: 4")
    tab_height_mm: float | None = Field(default=None, gt=0, le=50, description="above the foot; left out: 1")
    tab_shape: Literal["ramp", "square"] | None = Field(default=None, description="how the cutter comes down behind a tab; "
                                                        "straight down takes one that cuts at its centre; left out: ramp")

    @model_validator(mode="after")
    def _tabs_go_together(self):
        has_tabs = self.tabs is not None or self.tab_places is not None
        if self.tabs is not None and self.tab_places is not None:
            raise ValueError("tabs and tab_places: state one of them")
        if not has_tabs and any(v is not None for v in (self.tab_width_mm, self.tab_height_mm, self.tab_shape)):
            raise ValueError("tab_width_mm, tab_height_mm and tab_shape go with tabs, or tab_places")
        if has_tabs and (self.compensation is not None or self.finish_passes is not None):
            raise ValueError("a contour with tabs goes up and down, in one finishing pass without cutter compensation: leave out "
                             "compensation and finish_passes")
        return self

    @property
    def has_tabs(self):
        return self.tabs is not None or self.tab_places is not None

    def plan(self, work):
        return contouring.contoured(work)
