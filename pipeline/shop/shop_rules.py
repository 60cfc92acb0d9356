"""What a shop decides where a design is silent, as a TOML file."""

from pydantic import Field

from cuspline.values.input_files import checked, toml_of
from cuspline.values.models import Model


class ShopRules(Model):
    """A shop's own values."""

    stock_allowance_mm: float = Field(ge=0, le=100, description="material all round the part where a design states no stock")


def shop_from_toml(path):
    """Read a shop's file.

    Raises:
        InputError: missing, broken TOML, or values out of range; names every key that is wrong.
    """
    return checked(ShopRules, toml_of(path, "shop file"), f"shop file {path}")
