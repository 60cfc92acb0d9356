"""Cutting data of work materials: data/materials.toml, and what a shop's own file adds or replaces."""

from functools import cache
from importlib import resources

from pydantic import Field

from cuspline.values.errors import InputError
from cuspline.values.input_files import checked, toml_of
from cuspline.values.models import Model


class Material(Model):
    """How fast a material is cut by solid-carbide end mills."""

    name: str = Field(min_length=1, pattern=r"^[a-z0-9_]+$")
    description: str
    rough_speed_m_per_min: float = Field(gt=0, le=2000)
    finish_speed_m_per_min: float = Field(gt=0, le=2000)
    feed_per_tooth_share: float = Field(gt=0, le=0.1, description="feed per tooth / cutter diameter")
    stepdown_share: float = Field(gt=0, le=1, description="roughing stepdown / cutter diameter")
    coolant: str
    source: str = Field(min_length=1, description="where the figures come from; printed by `cuspline materials`")


class MaterialFile(Model):
    """A file of materials."""

    materials: tuple[Material, ...] = ()


@cache
def known_materials():
    """{name: Material} of those that come with cuspline."""
    path = resources.files("cuspline.shop") / "data" / "materials.toml"
    return {m.name: m for m in checked(MaterialFile, toml_of(path, "materials"), "materials").materials}


def material_named(name, own=()):
    """The Material of that name; a shop's own rows come first.

    Raises:
        InputError: unknown; the message lists what there is.
    """
    there = {**known_materials(), **{m.name: m for m in own}}
    if name not in there:
        raise InputError(f"material {name!r} is not known; there are {', '.join(sorted(there))}")
    return there[name]
