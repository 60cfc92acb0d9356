"""Panel of a chassis, drawn in inches: 2.5 x 1.75 x 0.125 in, D-sub cut-out, a big hole, four 0.156 holes, louvre slots."""

import cadquery as cq

from cuspline.design import Design, Finish, Parameters, Setup, StockBox

IN = 25.4


class InchPlate(Parameters):
    """Nothing to choose."""


def design(p: InchPlate) -> Design:
    body = cq.Workplane("XY").box(2.5 * IN, 1.75 * IN, 0.125 * IN, centered=(True, True, False)).edges("|Z").fillet(0.125 * IN)
    body = body.faces(">Z").workplane().rect(2.2 * IN, 1.45 * IN, forConstruction=True).vertices().hole(0.156 * IN)
    body = body.faces(">Z").workplane().center(-0.5 * IN, 0.1 * IN).hole(0.75 * IN)
    body = body.cut(cq.Workplane("XY", origin=(0.5 * IN, 0.25 * IN, -1)).rect(0.9 * IN, 0.45 * IN).extrude(10)
                    .edges("|Z").fillet(0.1 * IN))
    for k in range(3):
        body = body.cut(cq.Workplane("XY", origin=(0.5 * IN, (-0.2 - 0.2 * k) * IN, -1)).slot2D(0.8 * IN, 0.125 * IN).extrude(10))
    return Design(
        name="inch_plate", description="panel in inches", parameters=p, solid=body.val(),
        predicates={"above": body.faces("not <Z")},
        material="aluminium_6061", machine="mill_3axis_inch",
        stock=StockBox(min_mm=(-1.35 * IN, -1.0 * IN, 0), max_mm=(1.35 * IN, 1.0 * IN, 0.125 * IN)),
        finish=Finish(scallop_mm=0.0254, profile_tolerance_mm=0.01, gouge_mm=0.0127),
        setups=(Setup(name="setup-1", faces=("above",), wcs_in_words="X0 Y0 middle, Z0 on the base"),))
