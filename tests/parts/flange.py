"""Flange by `Auto` with default settings: bored middle, bolt circle with counterbores, M6 threads."""

import math

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockCylinder


class Flange(Parameters):
    """Dimensions of the flange."""

    diameter_mm: float = Field(100.0, ge=40, le=300, description="outside")
    height_mm: float = Field(16.0, ge=8, le=60, description="along z")
    bore_mm: float = Field(30.0, ge=14, le=200, description="in the middle")
    bolts: int = Field(6, ge=2, le=24, description="M6 screws with counterbores on the bolt circle, as many threads between")


def places(p):
    """[(x, y)] of the bolts, then of the threads between them."""
    radius = (p.diameter_mm + p.bore_mm) / 4
    turn = [math.pi * k / p.bolts for k in range(2 * p.bolts)]
    at = [(radius * math.cos(t), radius * math.sin(t)) for t in turn]
    return at[::2], at[1::2]


def flange(p):
    """The solid: a disc with its base on z = 0."""
    bolts, threads = places(p)
    disc = cq.Workplane("XY").circle(p.diameter_mm / 2).circle(p.bore_mm / 2).extrude(p.height_mm)
    top = cq.Workplane("XY", origin=(0, 0, p.height_mm - 6.4))
    through = cq.Workplane("XY", origin=(0, 0, -1))
    disc = disc.cut(through.pushPoints(bolts).circle(3.3).extrude(p.height_mm + 2))
    disc = disc.cut(top.pushPoints(bolts).circle(5.5).extrude(9))
    return disc.cut(through.pushPoints(threads).circle(2.5).extrude(p.height_mm + 2))


def design(p: Flange) -> Design:
    """The flange out of a disc; its faces are turned, its outside and holes are milled."""
    least = 2 * math.pi * 2.4 * p.height_mm
    threads = FacePredicate(name="m6", count=p.bolts, kinds=("cylinder",), area_min_mm2=least,
                            area_max_mm2=2 * math.pi * 2.6 * p.height_mm)
    inside = FacePredicate(name="all but top and base", count=4 * p.bolts + 2, center_min_mm=(-p.diameter_mm, -p.diameter_mm, 0.1),
                           center_max_mm=(p.diameter_mm, p.diameter_mm, p.height_mm - 0.1))
    return Design(
        name="flange", description="flange with counterbores and threads", parameters=p, solid=flange(p).val(),
        predicates=(threads, inside), threads={"m6": "M6"}, material="aluminium_6061",
        stock=StockCylinder(from_mm=(0, 0, 0), to_mm=(0, 0, p.height_mm), diameter_mm=p.diameter_mm + 4),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("all but top and base",), wcs_in_words="X0 Y0 in the middle, Z0 on the base"),))
