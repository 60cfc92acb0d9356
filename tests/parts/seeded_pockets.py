"""Plates with pockets that a seed decides: closed or open, with an island, with a pocket in the floor; all by `Pocket`."""

import random

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.pocket import Pocket


class Seeded(Parameters):
    """Which of the plates."""

    seed: int = Field(0, ge=0, le=10**6, description="decides form and sizes")


def upright(x, y, size_x, size_y, low, radius):
    """An upright box with rounded corners, its middle at x, y."""
    return cq.Workplane("XY", origin=(x, y, low)).rect(size_x, size_y).extrude(40).edges("|Z").fillet(radius)


def plate(seed):
    """(solid, length along x, along y, height)."""
    say = random.Random(seed)
    size_x, size_y = round(say.uniform(26, 44), 1), round(say.uniform(24, 34), 1)
    x, y, z = size_x + 8, size_y + 8, round(say.uniform(6, 12), 1)
    depth, radius = round(say.uniform(1.0, min(6.0, z - 2)), 2), round(say.uniform(5.2, 9.0), 2)
    block = cq.Workplane("XY").box(x, y, z, centered=False)
    form = say.choice(("plain", "island", "nested", "open"))
    at_x = x / 2 + (20 if form == "open" else 0)
    block = block.cut(upright(at_x, y / 2, size_x + (40 if form == "open" else 0), size_y, z - depth, radius))
    if form == "island" and size_x > 34:
        wide = say.uniform(2.0, (size_x - 26) / 2)
        block = block.union(cq.Workplane("XY", origin=(x / 2, y / 2, 1)).circle(min(wide, (size_y - 23) / 2)).extrude(
            z - 1 - depth * say.choice((0.0, 0.5))))
    if form == "nested" and z - depth > 2:
        block = block.cut(upright(x / 2, y / 2, size_x - 8, size_y - 8, z - depth - 1, max(5.2, radius - 2)))
    return block, x, y, z


def design(p: Seeded) -> Design:
    """The plate out of its box, its top finished."""
    solid, x, y, z = plate(p.seed)
    inside = FacePredicate(name="pocket", at_least=1, center_min_mm=(1, 1, 0.5), center_max_mm=(x + 30, y - 1, z - 0.05))
    return Design(name="seeded_pocket", description="plate with a pocket", parameters=p, solid=solid.val(),
                  predicates=(inside,), material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(x, y, z)),
                  finish=Finish(scallop_mm=0.1, profile_tolerance_mm=0.02, gouge_mm=0.02),
                  setups=(Setup(name="setup-1", faces=("pocket",), wcs_in_words="X0 Y0 lower left, Z0 base",
                                operations=(Pocket(tool="flat 10"),)),))
