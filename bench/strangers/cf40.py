"""Flange CF40: knife edge of 20 degrees in its recess, leak groove, six clearance holes, bore; turned blank of stainless."""

import cadquery as cq

from cuspline.design import Design, Finish, Parameters, Setup, StockCylinder


class Cf40(Parameters):
    """Nothing to choose."""


def design(p: Cf40) -> Design:
    profile = [(19, 0), (34.9, 0), (34.9, 13), (24.15, 13), (24.15, 11.6), (20.95, 11.9 + 0.35), (20.45, 10.9), (19, 10.9)]
    body = cq.Workplane("XZ").polyline(profile).close().revolve(360, (0, 0, 0), (0, 1, 0))
    body = body.cut(cq.Workplane("XY", origin=(0, 0, -1)).polarArray(29.35, 0, 360, 6).circle(3.3).extrude(20))
    body = body.cut(cq.Workplane("XY", origin=(29.5, 0, 11.5)).rect(14, 3).extrude(5))
    return Design(
        name="cf40", description="flange CF40 with its knife edge", parameters=p, solid=body.val(),
        predicates={"above": [f for f in body.faces("not <Z").vals() if not (f.geomType() == "CYLINDER"
                                                                          and f.BoundingBox().xlen > 69)]},
        material="steel_17_4ph", machine="mill_siemens",
        stock=StockCylinder(from_mm=(0, 0, 0), to_mm=(0, 0, 13.5), diameter_mm=69.8),
        finish=Finish(scallop_mm=0.01, profile_tolerance_mm=0.004, gouge_mm=0.005),
        setups=(Setup(name="setup-1", faces=("above",), wcs_in_words="X0 Y0 in the bore, Z0 on the base"),))
