"""Small plates with pockets that a seed decides: closed or open, round an island, one in another, with draft, a chain of walls;
by the operation that is made for it, or by `Auto`."""

import random

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.auto import Auto
from cuspline.planning.strategies.contour import Contour
from cuspline.planning.strategies.pocket import Pocket

FORMS = ("plain", "island", "nested", "open", "chain", "draft")
RIM = 4.0                   # beside a pocket


class Seeded(Parameters):
    """Which of the plates."""

    seed: int = Field(0, ge=0, le=10**6, description="decides form and sizes")


def upright(x, y, size_x, size_y, low, radius, draft_deg=0.0):
    """A box with rounded corners, its middle at x, y, wider upward by its draft."""
    box = cq.Workplane("XY", origin=(x, y, low)).rect(size_x, size_y).extrude(12, taper=-draft_deg)
    return box.edges("not(#Z)").fillet(radius)


def plate(seed):
    """(form, solid, length along x, along y, height, depth)."""
    say = random.Random(seed)
    form = FORMS[seed % len(FORMS)]
    size_x, size_y = round(say.uniform(17, 24), 1), round(say.uniform(16, 20), 1)
    x, y, z = size_x + 2 * RIM, size_y + 2 * RIM, round(say.uniform(4, 6), 1)
    depth, radius = round(say.uniform(0.8, z - 2.2), 2), round(say.uniform(5.2, 7.5), 2)
    block = cq.Workplane("XY").box(x, y, z, centered=False)
    make = {"plain": plain, "island": island, "nested": nested, "open": opened, "chain": chain, "draft": drafted}[form]
    return form, make(say, block, (x / 2, y / 2, z), (size_x, size_y), depth, radius), x, y, z, depth


def plain(say, block, at, size, depth, radius):
    return block.cut(upright(*at[:2], *size, at[2] - depth, radius))


def island(say, block, at, size, depth, radius):
    """A round one in a corner, as high as the rim or lower."""
    wide = size[0] + 9.0
    block = cq.Workplane("XY").box(wide + 2 * RIM, size[1] + 9 + 2 * RIM, at[2], centered=False)
    middle = (wide / 2 + RIM, (size[1] + 9) / 2 + RIM)
    block = block.cut(upright(*middle, wide, size[1] + 9, at[2] - depth, radius))
    low = at[2] - depth
    return block.union(cq.Workplane("XY", origin=(middle[0] + say.uniform(-1, 1), middle[1], low - 0.5)).circle(
        say.uniform(1.0, (size[1] + 9 - 22) / 2 + 0.5)).extrude(0.5 + depth * say.choice((0.5, 1.0))))


def nested(say, block, at, size, depth, radius):
    inner = (size[0] - say.uniform(2, 5), size[1] - say.uniform(2, 4))
    block = block.cut(upright(*at[:2], *size, at[2] - depth, radius))
    return block.cut(upright(*at[:2], *inner, at[2] - depth - say.uniform(0.5, 1.2), max(5.1, radius - 1)))


def opened(say, block, at, size, depth, radius):
    """Open to +X."""
    return block.cut(upright(at[0] + 15, at[1], size[0] + 30, size[1], at[2] - depth, radius))


def chain(say, block, at, size, depth, radius):
    """An outline of lines and arcs down to a ledge, inner corners included."""
    left, right = say.uniform(7, 9), say.uniform(4.5, 6)
    x, y = 2 * at[0] - 3, 2 * at[1] - 3
    outline = (cq.Workplane("XY", origin=(0, 0, at[2] - depth)).moveTo(3, 3).lineTo(x, 3).lineTo(x, y - left).lineTo(x - right, y)
               .lineTo(3, y).close().extrude(12).edges("|Z").fillet(say.uniform(1.0, 2.4)))
    ring = cq.Workplane("XY", origin=(-5, -5, at[2] - depth)).box(2 * at[0] + 10, 2 * at[1] + 10, 12, centered=False)
    return block.cut(ring.cut(outline))


def drafted(say, block, at, size, depth, radius):
    return block.cut(upright(*at[:2], *size, at[2] - depth, radius, say.uniform(2.0, 12.0)))


def design(p: Seeded) -> Design:
    """The plate out of its box, its top finished."""
    form, solid, x, y, z, depth = plate(p.seed)
    box = solid.val().BoundingBox()
    by_itself = form == "draft" or p.seed // len(FORMS) % 2 == 0
    operation = Auto() if by_itself else Contour() if form == "chain" else Pocket(tool="flat 10")
    inside = FacePredicate(name="pocket", at_least=1, center_min_mm=(1, 1, 0.5),
                           kinds=("plane", "cylinder", "cone", "bspline"), normal=(0, 0, 1), normal_within_deg=91.0,
                           center_max_mm=(box.xmax - 1, box.ymax - 1, z - 0.05))
    if form == "chain":
        inside = FacePredicate(name="pocket", at_least=1, center_min_mm=(1, 1, z - depth + 0.01),
                               center_max_mm=(x - 1, y - 1, z - 0.05))
    return Design(name="seeded_pocket", description="plate with a pocket", parameters=p, solid=solid.val(),
                  predicates=(inside,), material="aluminium_6061",
                  stock=StockBox(min_mm=(0, 0, 0), max_mm=(box.xmax, box.ymax, z)),
                  finish=Finish(scallop_mm=0.2, profile_tolerance_mm=0.03, gouge_mm=0.03),
                  setups=(Setup(name="setup-1", faces=("pocket",), wcs_in_words="X0 Y0 lower left, Z0 base",
                                operations=(operation,)),))
