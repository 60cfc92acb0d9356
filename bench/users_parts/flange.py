"""Flange with bolt circle, counterbores and M6 threads, a recess on its back: two setups of nothing but `Auto`, in CadQuery or
in build123d."""

import math
from typing import Literal

from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockCylinder

OUTSIDE, HIGH, BORE, CIRCLE = 70.0, 14.0, 20.0, 24.0          # diameters; the bolt circle's radius
BOLT, HEAD, HEAD_DEEP, TAPPED, RECESS, RECESS_DEEP = 6.6, 11.0, 6.4, 5.0, 30.0, 2.0
BOLTS, THREADS = ([(CIRCLE * math.cos(t), CIRCLE * math.sin(t)) for t in (first + math.pi * k / 2 for k in range(4))]
                  for first in (0.0, math.pi / 4))


class Flange(Parameters):
    """Which library it is drawn in."""

    library: Literal["cadquery", "build123d"] = Field(default="cadquery", description="the solid is the same in both")


def in_cadquery():
    import cadquery as cq
    low = cq.Workplane("XY", origin=(0, 0, -1))
    disc = cq.Workplane("XY").circle(OUTSIDE / 2).extrude(HIGH).cut(low.circle(BORE / 2).extrude(HIGH + 2))
    disc = disc.cut(low.circle(RECESS / 2).extrude(1 + RECESS_DEEP)).cut(low.pushPoints(BOLTS).circle(BOLT / 2).extrude(HIGH + 2))
    disc = disc.cut(low.pushPoints(THREADS).circle(TAPPED / 2).extrude(HIGH + 2))
    return disc.cut(cq.Workplane("XY", origin=(0, 0, HIGH - HEAD_DEEP)).pushPoints(BOLTS).circle(HEAD / 2).extrude(9)).val()


def in_build123d():
    import build123d as bd
    cylinder = lambda diameter, low, high: bd.Pos(0, 0, low) * bd.Cylinder(
        diameter / 2, high - low, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN))
    disc = cylinder(OUTSIDE, 0, HIGH) - cylinder(BORE, -1, HIGH + 1) - cylinder(RECESS, -1, RECESS_DEEP)
    for x, y in BOLTS:
        disc -= bd.Pos(x, y, 0) * (cylinder(BOLT, -1, HIGH + 1) + cylinder(HEAD, HIGH - HEAD_DEEP, HIGH + 1))
    for x, y in THREADS:
        disc -= bd.Pos(x, y, 0) * cylinder(TAPPED, -1, HIGH + 1)
    return disc


def design(p: Flange) -> Design:
    """The flange out of a turned disc; its outside and both faces are done."""
    inside = {"center_min_mm": (-30, -30, 0.1), "center_max_mm": (30, 30, HIGH - 0.1)}
    return Design(
        name="flange", description="flange with counterbores, threads and a recess", parameters=p,
        solid=in_cadquery() if p.library == "cadquery" else in_build123d(),
        predicates=(FacePredicate(name="m6", count=4, kinds=("cylinder",), area_min_mm2=219.0, area_max_mm2=221.0),
                    FacePredicate(name="from above", at_least=17, normal=(0, 0, 1), normal_within_deg=91.0,
                                  area_max_mm2=800.0, center_min_mm=(-30, -30, RECESS_DEEP), center_max_mm=inside["center_max_mm"]),
                    FacePredicate(name="from below", count=2, center_min_mm=inside["center_min_mm"],
                                  center_max_mm=(30, 30, RECESS_DEEP + 0.1), normal=(0, 0, -1), normal_within_deg=91.0)),
        threads={"m6": "M6"}, material="aluminium_6061",
        stock=StockCylinder(from_mm=(0, 0, 0), to_mm=(0, 0, HIGH), diameter_mm=OUTSIDE),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("from above",), wcs_in_words="X0 Y0 in the middle, Z0 on the base"),
                Setup(name="setup-2", wcs="G55", faces=("from below",), wcs_origin_mm=(0, 0, HIGH), wcs_z=(0, 0, -1),
                      wcs_in_words="turned over about X: X0 Y0 in the middle, Z0 on what was the top")))
