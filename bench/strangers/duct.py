"""Half of an air duct: a channel lofted from a rectangle to a circle's half, with O-ring land and dowels."""

import cadquery as cq

from cuspline.design import Design, Finish, Parameters, Setup, StockBox


class Duct(Parameters):
    """Nothing to choose."""


def design(p: Duct) -> Design:
    block = cq.Workplane("XY").box(90, 60, 24, centered=(True, True, False)).translate((0, 0, -24))
    wires = []
    for x, half, deep in ((-46, 20, 6), (-15, 17, 9), (15, 14, 12), (46, 12, 12)):
        wires.append(cq.Workplane("YZ", origin=(x, 0, 0)).moveTo(-half, 1).lineTo(half, 1).lineTo(half, 0)
                     .spline([(0.8 * half, -0.72 * deep), (0, -deep), (-0.8 * half, -0.72 * deep), (-half, 0)], includeCurrent=True)
                     .close().val())
    body = block.cut(cq.Workplane(cq.Solid.makeLoft(wires, False)))
    spots = [(x, y) for x in (-36, 36) for y in (-25, 25)]
    body = body.cut(cq.Workplane("XY").pushPoints(spots).circle(3.0).extrude(-30))
    faces = body.faces().vals()
    above = [f for f in faces if f.Center().z > -23.9 and abs(f.Center().x) < 44.9 and abs(f.Center().y) < 29.9]
    return Design(
        name="duct", description="half of an air duct", parameters=p, solid=body.val(), predicates={"above": above},
        material="aluminium_6061", machine="mill_fanuc", stock=StockBox(min_mm=(-45, -30, -24), max_mm=(45, 30, 0.5)),
        finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("above",), wcs_in_words="X0 Y0 middle, Z0 on top"),))
