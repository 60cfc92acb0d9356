"""Sensor plate: O-ring groove and window from above, counterbores and a pocket from below; zero on top in both setups."""

import cadquery as cq

from cuspline.design import Design, Finish, Parameters, Setup, StockBox

T = 14.0


class SensorPlate(Parameters):
    """Nothing to choose."""


def design(p: SensorPlate) -> Design:
    body = cq.Workplane("XY").box(80, 56, T, centered=(True, True, False)).translate((0, 0, -T)).edges("|Z").fillet(6)
    body = body.faces(">Z").edges().chamfer(0.6)
    ring = cq.Workplane("XY").circle(17.0).circle(14.0).extrude(-2.2)
    body = body.cut(ring).cut(cq.Workplane("XY").circle(9.0).extrude(-20))
    holes = [(x, y) for x in (-32, 32) for y in (-20, 20)]
    body = body.cut(cq.Workplane("XY").pushPoints(holes).circle(2.75).extrude(-20))
    body = body.cut(cq.Workplane("XY", origin=(0, 0, -T)).pushPoints(holes).circle(5.0).extrude(5.5))
    body = body.cut(cq.Workplane("XY", origin=(0, 0, -T)).rect(44, 20).extrude(5.0).edges("|Z").fillet(5.0))
    m4 = [(-25, 0), (25, 0)]
    body = body.cut(cq.Workplane("XY").pushPoints(m4).circle(1.65).extrude(-8.0))
    faces = body.faces().vals()
    below = [f for f in faces if f.Center().z < -T + 5.6 and abs(f.Center().x) < 38 and abs(f.Center().y) < 26
             and not (f.geomType() == "CYLINDER" and abs(f._geomAdaptor().Cylinder().Radius() - 9.0) < 1e-6)
             and f.Center().z > -T + 0.01]
    taps = [f for f in faces if f.geomType() == "CYLINDER" and abs(f._geomAdaptor().Cylinder().Radius() - 1.65) < 1e-6]
    rest = [f for f in faces if all(not f.isSame(g) for g in below + taps) and f.Center().z > -T + 0.01]
    return Design(
        name="sensor_plate", description="sensor plate", parameters=p, solid=body.val(),
        predicates={"below": below, "taps": taps, "above": rest}, threads={"taps": "M4"},
        material="aluminium_6061", machine="mill_haas", stock=StockBox(min_mm=(-42, -30, -T), max_mm=(42, 30, 1.0)),
        finish=Finish(scallop_mm=0.02, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("above", "taps"), wcs_in_words="X0 Y0 middle, Z0 on top"),
                Setup(name="setup-2", faces=("below",), wcs_z=(0, 0, -1), wcs_origin_mm=(0, 0, -T),
                      wcs_in_words="X0 Y0 middle, Z0 on what was the bottom")))
