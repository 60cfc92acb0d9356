"""Presets of a tool: speeds and feeds that a shop has found for it, by name and work material."""

import math

from pydantic import Field, model_validator

from cuspline.values.coolants import Coolant
from cuspline.values.models import Sparse

STAGES = ("rough", "finish")        # what `use` may say beside an operation's kind


class Preset(Sparse):
    """Speed, feed and coolant of one tool in one work material."""

    LEFT_OUT = ("material", "use", "spindle_rpm", "cutting_speed_m_per_min", "feed_mm_per_min", "feed_per_tooth_mm", "plunge_share",
                "ramp_deg", "stepdown_mm", "stepover_mm", "coolant", "notes", "source")
    name: str = Field(min_length=1, max_length=200, description="what an operation's `preset` names")
    material: str | None = Field(default=None, min_length=1, max_length=200, description="work material; where it is the name of "
                                 "the job's, the preset is used by itself; left out: the preset's own name")
    use: str | None = Field(default=None, min_length=1, max_length=60, description='what it is for: "rough", "finish" or the kind '
                            "of an operation (drill, pocket); left out: all")
    spindle_rpm: float | None = Field(default=None, gt=0, le=1e6, description="goes before the cutting speed")
    cutting_speed_m_per_min: float | None = Field(default=None, gt=0, le=1e5, description="on the full diameter")
    feed_mm_per_min: float | None = Field(default=None, gt=0, le=1e6, description="goes before the feed a tooth")
    feed_per_tooth_mm: float | None = Field(default=None, gt=0, le=100, description="of drills: a turn's, shared by flutes")
    plunge_share: float | None = Field(default=None, gt=0, le=10, description="of the feed, straight down; kept for export")
    ramp_deg: float | None = Field(default=None, gt=0, le=90, description="of the way down into stock")
    stepdown_mm: float | None = Field(default=None, gt=0, le=1e3, description="of clearing")
    stepover_mm: float | None = Field(default=None, gt=0, le=1e3, description="largest radial depth of clearing")
    coolant: Coolant | None = Field(default=None, description="off, air, mist, flood or high_pressure")
    notes: str | None = Field(default=None, min_length=1, max_length=2000)
    source: str | None = Field(default=None, min_length=1, max_length=2000, description="of the figures; plan.json says it")

    @model_validator(mode="after")
    def _says_something(self):
        if all(getattr(self, n) is None for n in self.LEFT_OUT if n not in ("material", "use", "notes", "source")):
            raise ValueError(f"preset {self.name!r} has neither speed, feed, depth nor coolant")
        return self

    def speed_m_per_min(self, diameter_mm):
        """Cutting speed on that diameter that it asks for, or None."""
        return self.cutting_speed_m_per_min if self.spindle_rpm is None else math.pi * diameter_mm * self.spindle_rpm / 1000.0

    def suits(self, kind, is_rough):
        """Whether it is for an operation of that kind, in that stage."""
        return self.use is None or self.use in (STAGES[0 if is_rough else 1], kind)


def preset_of(tool, material, kind, is_rough, wish=None):
    """The preset that a tool is run by, or None.

    Args:
        tool: shop.cutters.Tool.   material: name of the work material.   kind: of the operation.
        is_rough: whether stock is cleared.   wish: name that the operation asks for; else the material's own are used.
    Returns:
        Preset that says most exactly what it is for, the first of several.

    >>> from types import SimpleNamespace
    >>> own = Preset(name="soft", material="Aluminium 6061", feed_per_tooth_mm=0.1), Preset(name="slow", spindle_rpm=900)
    >>> tool = SimpleNamespace(presets=own)
    >>> [(p := preset_of(tool, "aluminium_6061", "pocket", True, w)) and p.name for w in (None, "slow", "fast")]
    ['soft', 'slow', None]
    """
    mine = [p for p in tool.presets or () if p.suits(kind, is_rough) and (
        p.name == wish if wish is not None else plain(p.material or p.name) == plain(material))]
    return min(mine, key=lambda p: p.use is None, default=None)


def plain(name):
    """A material's name without its spelling: small letters and digits."""
    return "".join(c for c in name.lower() if c.isalnum())
