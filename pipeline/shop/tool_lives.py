"""How long edges last in work materials: data/tool_life.toml."""

from functools import cache

from pydantic import Field

from cuspline.shop.shipped import shipped
from cuspline.values.models import Model


class ToolLife(Model):
    """Of a set of edges, at usual feeds and speeds."""

    material: str = Field(min_length=1, pattern=r"^[a-z0-9_]+$")
    life_min: float = Field(gt=0, le=100_000, description="minutes in the cut")
    time_factor: float = Field(gt=0, le=1000, description="machining time against aluminium or brass")
    source: str = Field(min_length=1)


class ToolLifeFile(Model):
    """A file of them."""

    lives: tuple[ToolLife, ...] = ()


def life_of(material, own=()):
    """ToolLife of a material by name, a shop's own rows first; None: nothing is known."""
    return {**known_lives(), **{t.material: t for t in own}}.get(material)


@cache
def known_lives():
    """{material: ToolLife} of those that come with cuspline."""
    return {t.material: t for t in shipped(ToolLifeFile, "tool_life.toml", "tool lives").lives}
