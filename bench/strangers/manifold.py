"""Manifold block: two ports with threads from above that meet a cross bore from the side."""

import build123d as bd

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox, Thread

POINT = 1.237               # height of a drill's point of 140 degrees


class Manifold(Parameters):
    """Nothing to choose."""


def design(p: Manifold) -> Design:
    upright = (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MAX)
    part = bd.Box(50, 30, 26, align=(bd.Align.MIN,) * 3)
    for x in (14, 36):
        part -= bd.Pos(x, 15, 26) * bd.Cylinder(3.4, 10.8, align=upright)
        part -= bd.Pos(x, 15, 15.2) * bd.Cone(0.001, 3.4, POINT, align=upright)
        part -= bd.Pos(x, 15, 26) * bd.Cylinder(7, 1.5, align=upright)
    part -= bd.Pos(0, 15, 12) * bd.Rot(0, 90, 0) * bd.Cylinder(3, 42, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN))
    return Design(
        name="manifold", description="manifold block", parameters=p, solid=part,
        predicates=(FacePredicate(name="ports", count=2, kinds=("cylinder",),
                                  center_min_mm=(10, 10, 16), center_max_mm=(40, 20, 24)),
                    FacePredicate(name="seats", at_least=2, center_min_mm=(5, 5, 24), center_max_mm=(45, 25, 25.9)),
                    FacePredicate(name="cross", at_least=1, kinds=("cylinder",), center_min_mm=(-1, 10, 8),
                                  center_max_mm=(43, 20, 16))),
        threads={"ports": Thread(size="M8", depth_mm=6)},
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(50, 30, 26)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("ports", "seats"), wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),
                Setup(name="setup-2", wcs="G55", faces=("cross",), wcs_origin_mm=(50, 0, 0), wcs_z=(-1, 0, 0), wcs_x=(0, 1, 0),
                      wcs_in_words="left side up: X0 along Y, Z0 on the right side, which lies on the table")))
