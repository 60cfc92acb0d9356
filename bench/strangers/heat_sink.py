"""Heat sink of a klystron's modulator: nine fins of 1.5 mm, gaps of 3.5 mm, four M4 in its foot."""

import build123d as bd

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox, Thread


class HeatSink(Parameters):
    """Nothing to choose."""


def design(p: HeatSink) -> Design:
    part = bd.Box(60, 40, 12, align=(bd.Align.MIN,) * 3)
    for k in range(8):
        part -= bd.Pos(11.5 + 5 * k , 0, 4) * bd.Box(3.5, 40, 8, align=(bd.Align.CENTER, bd.Align.MIN, bd.Align.MIN))
    part -= bd.Pos(0, 0, 4) * bd.Box(8.25, 40, 8, align=(bd.Align.MIN,) * 3)
    part -= bd.Pos(49.75, 0, 4) * bd.Box(11, 40, 8, align=(bd.Align.MIN,) * 3)
    for x in (4, 55):
        for y in (6, 34):
            part -= bd.Pos(x, y, 2) * bd.Cylinder(1.65, 10)
    return Design(
        name="heat_sink", description="heat sink with thin fins", parameters=p, solid=part,
        predicates=(FacePredicate(name="m4", count=4, kinds=("cylinder",)),
                    FacePredicate(name="above", at_least=10, normal=(0, 0, 1), normal_within_deg=1.0),
                    FacePredicate(name="fins", at_least=8, normal=(1, 0, 0), normal_within_deg=1.0, center_min_mm=(1, 0, 4),
                                  center_max_mm=(59, 40, 12)),
                    FacePredicate(name="fins left", at_least=8, normal=(-1, 0, 0), normal_within_deg=1.0,
                                  center_min_mm=(1, 0, 4), center_max_mm=(59, 40, 12))),
        threads={"m4": Thread(size="M4", depth_mm=4)},
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(60, 40, 13)), machine="mill_haas",
        finish=Finish(scallop_mm=0.02, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("m4", "above", "fins", "fins left"), wcs_in_words="X0 Y0 lower left, Z0 below"),))
