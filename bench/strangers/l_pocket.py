"""Plate with an L-shaped pocket, a boss in it 9 mm from the wall."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox


class LPocket(Parameters):
    """Nothing to choose."""


def design(p: LPocket) -> Design:
    outline = (cq.Workplane("XY", origin=(0, 0, 6)).moveTo(6, 6).lineTo(64, 6).lineTo(64, 26).lineTo(30, 26).lineTo(30, 50)
               .lineTo(6, 50).close().extrude(10).edges("|Z").fillet(5))
    body = cq.Workplane("XY").box(70, 56, 12, centered=False).cut(outline)
    body = body.union(cq.Workplane("XY", origin=(18, 38, 5)).circle(3).extrude(6))
    return Design(
        name="l_pocket", description="plate with an L-shaped pocket", parameters=p, solid=body.val(),
        predicates=(FacePredicate(name="pocket", at_least=10, center_min_mm=(1, 1, 5), center_max_mm=(69, 55, 11.5)),),
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(70, 56, 12)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("pocket",), wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),))
