"""A tool's own cutting data, by the name of a work material or any other: out of a library, or of the user's own file."""

from pydantic import Field, model_validator

from cuspline.values.coolants import Coolant
from cuspline.values.models import Model


class Preset(Model):
    """How fast one tool is run; goes before the material's figures where it has its name, or an operation asks for it."""

    name: str = Field(min_length=1, description="of a work material, as `cuspline materials` has it, or any other")
    spindle_rpm: float | None = Field(default=None, gt=0, description="in its place:")
    cutting_speed_m_per_min: float | None = Field(default=None, gt=0, le=2000, description="on the full diameter")
    feed_mm_per_min: float | None = Field(default=None, gt=0, description="in its place:")
    feed_per_tooth_mm: float | None = Field(default=None, gt=0, le=10)
    coolant: Coolant | None = None
    source: str = Field(min_length=1, description="where the figures come from; printed in plan.json")

    @model_validator(mode="after")
    def _says_speed_and_feed_once(self):
        for one, other in (("spindle_rpm", "cutting_speed_m_per_min"), ("feed_mm_per_min", "feed_per_tooth_mm")):
            if (getattr(self, one) is None) == (getattr(self, other) is None):
                raise ValueError(f"state one of {one} and {other}")
        return self


def preset_of(tool, wanted, material):
    """The Preset of a tool (cutters.Tool) by its name, or of a material (name); None: it has none for the material.

    Raises:
        KeyError: it has none of the wanted name.
    """
    own = {p.name: p for p in tool.presets}
    return own.get(material) if wanted is None else own[wanted]
