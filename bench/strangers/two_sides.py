"""Plate with counterbores on both sides, and a pocket on each."""

import cadquery as cq

from cuspline.design import Design, Finish, Parameters, Setup, StockBox


class TwoSides(Parameters):
    """Nothing to choose."""


def design(p: TwoSides) -> Design:
    body = cq.Workplane("XY").box(60, 34, 12, centered=False)
    body = body.faces(">Z").workplane(origin=(0, 0, 12)).pushPoints([(8, 8), (52, 26)]).cboreHole(5.5, 10, 5.5)
    body = body.faces("<Z").workplane(origin=(0, 0, 0)).pushPoints([(8, -26), (52, -8)]).cboreHole(5.5, 10, 5.5)
    body = body.cut(cq.Workplane("XY", origin=(30, 17, 9)).rect(26, 22).extrude(5).edges("|Z").fillet(6))
    body = body.cut(cq.Workplane("XY", origin=(30, 17, -1)).rect(24, 20).extrude(4).edges("|Z").fillet(6))
    above = body.faces(cq.selectors.BoxSelector((1, 1, 6), (59, 33, 11.9)))
    below = body.faces(cq.selectors.BoxSelector((1, 1, 0.1), (59, 33, 6)))
    return Design(
        name="two_sides", description="plate with counterbores on both sides", parameters=p, solid=body.val(),
        predicates={"above": above, "below": below},
        material="steel_17_4ph", stock=StockBox(min_mm=(0, 0, 0), max_mm=(60, 34, 12)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="top", faces=("above",), wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),
                Setup(name="bottom", wcs="G55", faces=("below",), wcs_origin_mm=(0, 34, 12), wcs_z=(0, 0, -1),
                      wcs_in_words="turned over about X: X0 Y0 lower left corner, Z0 on the face that was up")))
