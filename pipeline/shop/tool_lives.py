"""How long edges last in work materials: data/tool_life.toml."""

from functools import cache
from importlib import resources

from pydantic import Field

from cuspline.values.input_files import checked, toml_of
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


@cache
def known_lives():
    """{material: ToolLife} of those that come with cuspline."""
    path = resources.files("cuspline.shop") / "data" / "tool_life.toml"
    return {t.material: t for t in checked(ToolLifeFile, toml_of(path, "tool lives"), "tool lives").lives}
