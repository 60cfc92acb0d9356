"""What a shop decides: allowances, depths of cut, clearances, ways into stock.  Data, with the defaults here.

A shop's own file (`--shop my_shop.toml`) has a table [practice] and rows [[materials]], [[forces]] and [[lives]]; one value
alone is `-p shop.clearance_mm=8`; an operation's own value goes before both.
"""

from pydantic import Field

from cuspline.shop.cutting_forces import CuttingForce
from cuspline.shop.hole_forces import HoleForce
from cuspline.shop.materials import Material
from cuspline.shop.tool_lives import ToolLife
from cuspline.values.input_files import checked, toml_of
from cuspline.values.models import Sparse


class Practice(Sparse):
    """Values of a shop for every job; lengths in millimetres."""

    LEFT_OUT = ("constant_speed", "feed_by_engagement", "feed_most", "spot_holes")
    rough_allowance_mm: float = Field(default=0.3, ge=0, le=20, description="roughing leaves it on the faces")
    semi_allowance_mm: float = Field(default=0.1, ge=0, le=5, description="a semi-finish leaves it")
    semi_scallop_mm: float = Field(default=0.05, gt=0, le=5, description="largest cusp of a semi-finish")
    finish_depth_share: float = Field(default=0.1, gt=0, le=1, description="of its diameter a ball finishes at most so deep")
    radial_share: float = Field(default=0.45, gt=0.01, le=0.5, description="of the diameter: largest radial depth of roughing")
    rest_threshold_mm: float = Field(default=0.5, ge=0, le=20, description="rest roughing leaves alone what stands less than this "
                                     "above the allowance")
    facing_share: float = Field(default=0.65, gt=0.05, le=0.9, description="of the diameter: stepover of facing and floors")
    clearance_mm: float = Field(default=5.0, gt=0, le=500, description="of rapids above stock and fixtures")
    approach_mm: float = Field(default=1.0, gt=0, le=100, description="above stock and fixtures the tool begins to feed down")
    keep_out_mm: float = Field(default=2.0, ge=0, le=200, description="between roughing tools and fixtures")
    ramp_deg: float = Field(default=3.0, gt=0, lt=45, description="of the way down into stock")
    plunge_share: float = Field(default=0.3, gt=0, le=1, description="of the cutting feed, going down")
    lead_radius_mm: float = Field(default=2.0, ge=0, le=50,
                                  description="of the arcs in and out, never more than the cutter's radius")
    stock_allowance_mm: float = Field(default=2.0, ge=0, le=500,
                                      description="material all round the part where a design states no stock")
    spot_holes: bool = Field(default=False, description="drills that do not say it are preceded by a spot drill")
    tool_change_s: float = Field(default=60.0, ge=0, le=3600, description="what one more tool costs: its change, approach, overlap")
    constant_speed: bool = Field(default=False, description="S words that keep the cutting speed where the edge cuts")
    feed_by_engagement: bool = Field(default=False, description="feeds that keep the thickness of chips on the stock as it stands")
    feed_most: float = Field(default=1.5, ge=1, le=2, description="times the feed per tooth: the most where chips are thin")


class ShopFile(Sparse):
    """A shop's own file."""

    LEFT_OUT = ("forces", "lives", "hole_forces")
    practice: Practice = Practice()
    materials: tuple[Material, ...] = ()
    forces: tuple[CuttingForce, ...] = Field(default=(), description="rows that go before cuspline's own, by material")
    lives: tuple[ToolLife, ...] = Field(default=(), description="the same of tool life")
    hole_forces: tuple[HoleForce, ...] = Field(default=(), description="the same of drills and taps")

    @property
    def given(self):
        """{name: value} of what the file says itself."""
        return self.practice.model_dump(exclude_unset=True)


def shop_file(path, assignments=()):
    """ShopFile of a TOML file and [("name", "value"), ...] that go before it; no path: the defaults.

    Raises:
        InputError: missing, broken, an unknown name; says which.
    """
    found = ShopFile() if path is None else checked(ShopFile, toml_of(path, "shop file"), f"shop file {path}")
    if not assignments:
        return found
    practice = checked(Practice, {**found.given, **dict(assignments)}, "shop")
    return found.model_copy(update={"practice": practice})
