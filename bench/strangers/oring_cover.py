"""Round cover: O-ring groove in its face, a boss in the middle, four counterbored screws."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockCylinder


class Cover(Parameters):
    """Nothing to choose."""


def design(p: Cover) -> Design:
    body = cq.Workplane("XY").circle(28).extrude(8)
    body = body.faces(">Z").workplane().circle(17.5).circle(12.3).cutBlind(-2.2)
    body = body.faces(">Z").workplane().polarArray(22.5, 45, 360, 4).cboreHole(4.5, 8, 4)
    return Design(
        name="oring_cover", description="cover with an O-ring groove", parameters=p, solid=body.val(),
        predicates=(FacePredicate(name="from above", at_least=8, normal=(0, 0, 1), normal_within_deg=91.0),),
        material="aluminium_6061", stock=StockCylinder(from_mm=(0, 0, 0), to_mm=(0, 0, 9), diameter_mm=60),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("from above",), wcs_in_words="X0 Y0 in the middle, Z0 on the base"),))
