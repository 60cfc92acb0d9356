"""Cutting data of work materials: data/materials.toml, and what a shop's own file adds or replaces."""

from functools import cache

from pydantic import Field

from cuspline.shop.shipped import shipped
from cuspline.values.coolants import Coolant
from cuspline.values.errors import InputError
from cuspline.values.models import Model, Sparse

DRILL_SPEED_SHARE, DRILL_FEED_SHARE = 0.4, 0.01     # of a material that says nothing of drills


class Material(Sparse):
    """How fast a material is cut by solid-carbide end mills."""

    LEFT_OUT = ("hardness_hrc",)
    name: str = Field(min_length=1, pattern=r"^[a-z0-9_]+$")
    description: str
    rough_speed_m_per_min: float = Field(gt=0, le=2000)
    finish_speed_m_per_min: float = Field(gt=0, le=2000)
    feed_per_tooth_share: float = Field(gt=0, le=0.1, description="feed per tooth / cutter diameter")
    stepdown_share: float = Field(gt=0, le=1, description="roughing stepdown / cutter diameter")
    coolant: Coolant
    drill_speed_m_per_min: float | None = Field(default=None, gt=0, le=1000, description="of drills; left out: 0.4 of roughing")
    drill_feed_share: float | None = Field(default=None, gt=0, le=0.05, description="of drills, a turn / diameter; left out: 0.01")
    hardness_hrc: float | None = Field(default=None, gt=0, le=70, description="of hardened steels")
    source: str = Field(min_length=1, description="where the figures come from; printed by `cuspline materials`")

    @property
    def drilling(self):
        """(cutting speed m/min, feed a turn / diameter) of drills."""
        speed, share = self.drill_speed_m_per_min, self.drill_feed_share
        return (DRILL_SPEED_SHARE * self.rough_speed_m_per_min if speed is None else speed,
                DRILL_FEED_SHARE if share is None else share)


class MaterialFile(Model):
    """A file of materials."""

    materials: tuple[Material, ...] = ()


@cache
def known_materials():
    """{name: Material} of those that come with cuspline."""
    return {m.name: m for m in shipped(MaterialFile, "materials.toml", "materials").materials}


def material_named(name, own=()):
    """The Material of that name; a shop's own rows come first.

    Raises:
        InputError: unknown; the message lists what there is.
    """
    there = {**known_materials(), **{m.name: m for m in own}}
    if name not in there:
        raise InputError(f"material {name!r} is not known; there are {', '.join(sorted(there))}")
    return there[name]
