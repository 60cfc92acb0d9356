"""Bearing block: bore 22 H7, a grease groove of 3 mm with an oil hole, two counterbored screws, in brass on a Fanuc."""

import cadquery as cq

from cuspline.design import Design, Diameter, Finish, Parameters, Setup, StockBox


class BearingBlock(Parameters):
    """Nothing to choose."""


def design(p: BearingBlock) -> Design:
    body = cq.Workplane("XY").box(64, 40, 18, centered=(True, True, False)).edges("|Z").chamfer(3)
    body = body.faces(">Z").workplane().circle(11).cutThruAll()
    body = body.faces(">Z").workplane().circle(17).circle(14).cutBlind(-2)
    body = body.faces(">Z").workplane(origin=(0, 0, 0)).pushPoints([(-24, 0), (24, 0)]).cboreHole(6.6, 11, 6.8)
    body = body.faces(">Z").workplane(origin=(0, 0, 0)).pushPoints([(0, 15.5)]).hole(2.5, 8)
    bore = [f for f in body.faces("%CYLINDER").vals() if abs(f.Area() - 3.14159 * 22 * 18) < 1.0]
    return Design(
        name="bearing_block", description="bearing block with a grease groove", parameters=p, solid=body.val(),
        predicates={"bore": cq.Workplane().newObject(bore), "rest": [f for f in body.faces("not <Z").vals() if f not in bore]},
        dimensions=(Diameter(faces="bore", fit="H7", nominal_mm=22.0),),
        material="brass_c360", stock=StockBox(min_mm=(-34, -22, 0), max_mm=(34, 22, 19)), machine="mill_fanuc",
        finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.008, gouge_mm=0.01),
        setups=(Setup(name="setup-1", faces=("bore", "rest"), wcs_in_words="X0 Y0 in the bore, Z0 on the base"),))
