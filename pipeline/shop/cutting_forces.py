"""What work materials resist an edge with: data/cutting_forces.toml.  Apart from materials.toml: programs do not depend on it."""

from functools import cache

from pydantic import Field

from cuspline.shop.shipped import shipped
from cuspline.values.models import Model


class CuttingForce(Model):
    """Force on a sharp edge, mean figures."""

    material: str = Field(min_length=1, pattern=r"^[a-z0-9_]+$")
    force_n_per_mm2: float = Field(gt=0, le=20000, description="whole force / area of the chip across the cut")
    edge_n_per_mm: float = Field(ge=0, le=200, description="force of the edge itself / length of edge in the cut")
    force_angle_deg: float = Field(gt=0, le=90, description="between the force and the normal of the surface that is cut")
    source: str = Field(min_length=1)


class CuttingForceFile(Model):
    """A file of them."""

    forces: tuple[CuttingForce, ...] = ()


def force_of(material, own=()):
    """CuttingForce of a material by name, a shop's own rows first; None: nothing is known."""
    return {**known_forces(), **{f.material: f for f in own}}.get(material)


@cache
def known_forces():
    """{material: CuttingForce} of those that come with cuspline."""
    return {f.material: f for f in shipped(CuttingForceFile, "cutting_forces.toml", "cutting forces").forces}
