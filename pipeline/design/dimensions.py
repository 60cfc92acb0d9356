"""Dimensions with tolerances: what a drawing says of faces beyond their finish, judged on the simulated stock."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cuspline.shop.fits import limits_mm
from cuspline.values.models import Model

MARK = r"^[A-Za-z0-9 ._+-]+$"


class Toleranced(Model):
    """A size and its limits."""

    name: str | None = Field(default=None, min_length=1, max_length=60, pattern=MARK,
                             description="what report and findings call it; left out: its kind and faces")
    faces: str = Field(min_length=1, description="name of the faces it is about")
    fit: str | None = Field(default=None, description="ISO 286 class: H7, g6, js9")
    lower_mm: float | None = Field(default=None, ge=-50, le=50, description="in place of fit: lower limit, from the nominal size")
    upper_mm: float | None = Field(default=None, ge=-50, le=50, description="and upper limit")
    nominal_mm: float | None = Field(default=None, gt=0, le=1e4, description="left out: the design's own size; another where the "
                                     "solid is drawn at the middle of its limits")

    @model_validator(mode="after")
    def _has_limits(self):
        stated = (self.lower_mm is not None, self.upper_mm is not None)
        if (self.fit is not None) == all(stated) or stated[0] != stated[1]:
            raise ValueError(f"{self.title}: state fit (H7), or lower_mm and upper_mm")
        if all(stated) and self.lower_mm >= self.upper_mm:
            raise ValueError(f"{self.title}: lower_mm {self.lower_mm:g} is not below upper_mm {self.upper_mm:g}")
        if self.fit is not None:
            limits_mm(self.nominal_mm or 10.0, self.fit)
        return self

    @property
    def title(self):
        return self.name or f"{self.kind} of {self.faces}"

    def limits_mm(self, drawn_mm):
        """(lower, upper) size, mm; `drawn_mm`: the design's own."""
        nominal = drawn_mm if self.nominal_mm is None else self.nominal_mm
        low, high = (self.lower_mm, self.upper_mm) if self.fit is None else limits_mm(nominal, self.fit)
        return nominal + low, nominal + high


class Diameter(Toleranced):
    """Of every cylinder among the faces, holes and bosses: all radii about the axis that fits best, twice."""

    kind: Literal["diameter"] = "diameter"


class Distance(Toleranced):
    """From one level of planes to another, parallel to them: a depth, a height, the width of a slot or over flats."""

    kind: Literal["distance"] = "distance"
    from_faces: str = Field(min_length=1, description="name of the faces that it is measured from")


class Position(Model):
    """Of every cylinder among the faces: its axis within a cylinder about where the design has it, part coordinates."""

    kind: Literal["position"] = "position"
    name: str | None = Field(default=None, min_length=1, max_length=60, pattern=MARK)
    faces: str = Field(min_length=1)
    zone_mm: float = Field(gt=0, le=50, description="diameter of the zone")

    @property
    def title(self):
        return self.name or f"position of {self.faces}"


class ChamferWidth(Toleranced):
    """Of every chamfer among the faces, flat strips and cones: the longer leg, from where both faces would meet to its edge."""

    kind: Literal["chamfer"] = "chamfer"


Dimension = Annotated[Diameter | Distance | Position | ChamferWidth, Field(discriminator="kind")]
