"""Hub: a stepped bore with a fit, a keyway in it, a chamfered rim."""

import build123d as bd

from cuspline.design import Design, Diameter, FacePredicate, Finish, Parameters, Setup, StockCylinder


class Hub(Parameters):
    """Nothing to choose."""


def design(p: Hub) -> Design:
    upright = (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN)
    part = bd.Cylinder(21, 14, align=upright)
    part = bd.chamfer(part.edges().sort_by(bd.Axis.Z)[-1], 1)
    part -= bd.Pos(0, 0, -1) * bd.Cylinder(8.0045, 20, align=upright)
    part -= bd.Pos(0, 0, 9) * bd.Cylinder(13, 20, align=upright)
    part -= bd.Pos(0, 0, -1) * bd.Box(11, 5, 20, align=(bd.Align.MIN, bd.Align.CENTER, bd.Align.MIN))
    return Design(
        name="hub", description="hub with a stepped bore and a keyway", parameters=p, solid=part,
        predicates=(FacePredicate(name="bore", count=1, kinds=("cylinder",),
                                  center_min_mm=(-10, -10, 1), center_max_mm=(10, 10, 8.5)),
                    FacePredicate(name="from above", at_least=8, normal=(0, 0, 1), normal_within_deg=91.0)),
        dimensions=(Diameter(faces="bore", fit="H7", nominal_mm=16.0),),
        material="aluminium_6061", stock=StockCylinder(from_mm=(0, 0, 0), to_mm=(0, 0, 15), diameter_mm=44),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("from above",), wcs_in_words="X0 Y0 in the middle, Z0 on the base"),))
