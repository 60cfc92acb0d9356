"""What work materials resist drills and taps with: data/hole_forces.toml.  Programs do not depend on it."""

from functools import cache

from pydantic import Field

from cuspline.shop.shipped import shipped
from cuspline.values.models import Model


class HoleForce(Model):
    """Force on sharp drills and taps, mean figures."""

    material: str = Field(min_length=1, pattern=r"^[a-z0-9_]+$")
    drill_n_per_mm2: float = Field(gt=0, le=20000, description="of a drill: force along the cut / area of the chip across it")
    tap_n_per_mm2: float | None = Field(default=None, gt=0, le=20000, description="of a tap: its torque in Nm, times 8000, / pitch "
                                        "/ pitch / diameter in mm; left out: taps are not checked")
    source: str = Field(min_length=1)


class HoleForceFile(Model):
    """A file of them."""

    hole_forces: tuple[HoleForce, ...] = ()


def hole_force_of(material, own=()):
    """HoleForce of a material by name, a shop's own rows first; None: nothing is known."""
    return {**known_hole_forces(), **{f.material: f for f in own}}.get(material)


@cache
def known_hole_forces():
    """{material: HoleForce} of those that come with cuspline."""
    return {f.material: f for f in shipped(HoleForceFile, "hole_forces.toml", "forces of drills and taps").hole_forces}
