"""Housing: a cavity with a step for its lid, four threads M4, a hole for a cable in the floor."""

import cadquery as cq

from cuspline.design import Design, Finish, Parameters, Setup, StockBox, Thread


class Housing(Parameters):
    """Nothing to choose."""


def design(p: Housing) -> Design:
    body = cq.Workplane("XY").box(56, 44, 14, centered=(True, True, False)).edges("|Z").fillet(4)
    body = body.faces(">Z").workplane().rect(50, 38).cutBlind(-2)
    body = body.cut(cq.Workplane("XY", origin=(0, 0, 3)).rect(34, 36).extrude(20).edges("|Z").fillet(5.5))
    body = body.faces("<Z").workplane(origin=(0, 0, 0)).circle(6).cutThruAll()
    screws = (cq.Workplane("XY", origin=(0, 0, 3)).rect(43, 30, forConstruction=True).vertices().circle(1.65).extrude(20))
    body = body.cut(screws)
    threads = [f for f in body.faces("%CYLINDER").vals() if abs(f.Area() - 2 * 3.14159 * 1.65 * 9) < 1.0]
    return Design(
        name="housing", description="housing with a lid's step", parameters=p, solid=body.val(),
        predicates={"m4": cq.Workplane().newObject(threads),
                    "from above": body.faces("not <Z")},
        threads={"m4": Thread(size="M4", depth_mm=6)},
        material="aluminium_6061", stock=StockBox(min_mm=(-29, -23, 0), max_mm=(29, 23, 15)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("from above",), wcs_in_words="X0 Y0 in the middle, Z0 on the base"),))
