"""Half of a model's hull, starboard, for a towing tank: lofted through five stations, on its centre plane; oversize block."""

import cadquery as cq

from cuspline.design import Design, Finish, Parameters, Setup, StockBox

STATIONS = ((0, 1.5, 9), (18, 8, 11), (38, 11, 12), (58, 9, 12), (76, 4, 8))      # x, half beam, draught


class HullHalf(Parameters):
    """Nothing to choose."""


def design(p: HullHalf) -> Design:
    wires = []
    for x, beam, draught in STATIONS:
        w = (cq.Workplane("YZ", origin=(x, 0, 0)).moveTo(-draught, 0).lineTo(draught, 0)
             .spline([(0.75 * draught, 0.72 * beam), (0, beam), (-0.75 * draught, 0.72 * beam)], includeCurrent=True)
             .lineTo(-draught, 0).close())
        wires.append(w.val())
    hull = cq.Solid.makeLoft(wires, False)
    body = cq.Workplane("XY", origin=(-4, -18, -6)).box(84, 36, 6, centered=False).union(cq.Workplane(hull))
    skin = [f for f in body.faces().vals() if f.Center().z > 0.05 and f.geomType() != "PLANE"]
    level = [f for f in body.faces("+Z").vals() if f.Center().z < 0.01]
    ends = [f for f in body.faces("|X").vals() if f.Center().z > 0.05]
    return Design(
        name="hull_half", description="half of a model's hull", parameters=p, solid=body.val(),
        predicates={"hull": skin, "ends": ends, "base": level},
        material="aluminium_6061", machine="mill_siemens", stock=StockBox(min_mm=(-4, -18, -6), max_mm=(80, 18, 14)),
        finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("hull", "ends", "base"), wcs_in_words="X0 at the bow, Y0 keel, Z0 centre plane"),))
