"""Electrode for sinking a ribbed cap: a tapered head with ribs on a square base."""

import build123d as bd

from cuspline.design import Design, Finish, Parameters, Setup, StockBox


class Electrode(Parameters):
    """Nothing to choose."""


def design(p: Electrode) -> Design:
    """Head and shoulder are cut, the base is bought square."""
    with bd.BuildPart() as part:
        bd.Box(36, 36, 10, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN))
        with bd.BuildSketch(bd.Plane.XY.offset(10)):
            bd.RectangleRounded(20, 14, 3)
        bd.extrude(amount=12, taper=3)
        with bd.BuildSketch(bd.Plane.XY.offset(22)):
            with bd.GridLocations(6.5, 1, 2, 1):
                bd.RectangleRounded(3, 9, 1)
        bd.extrude(amount=5, taper=1)
        bd.fillet(part.faces().sort_by(bd.Axis.Z)[-1].edges() + part.faces().sort_by(bd.Axis.Z)[-2].edges(), 0.4)
    up = [f for f in part.faces() if f.center().Z > 9.9]
    return Design(name="electrode", description="electrode", parameters=p, solid=part.part, predicates={"head": up},
                  material="copper_ofhc", stock=StockBox(min_mm=(-18, -18, 0), max_mm=(18, 18, 28)),
                  finish=Finish(scallop_mm=0.02, profile_tolerance_mm=0.004, gouge_mm=0.005),
                  setups=(Setup(name="setup-1", faces=("head",), wcs_in_words="middle, Z0 below"),))
