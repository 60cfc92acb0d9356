"""Rib of a model wing: airfoil outline, two lightening pockets with a web of 1.5 mm, a spar slot open to its top, Grbl router."""

import math

import build123d as bd

from cuspline.design import Design, Finish, Parameters, Setup, StockBox

CHORD = 78.0


class WingRib(Parameters):
    """Nothing to choose."""


def half(x, t=0.16):
    """Half thickness of a four-digit section at a share x of its chord."""
    return 5 * t * (0.2969 * math.sqrt(x) - 0.1260 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)


def design(p: WingRib) -> Design:
    shares = [0.5 * (1 - math.cos(math.pi * k / 14)) for k in range(15)]
    upper = [(CHORD * x, CHORD * half(x)) for x in shares if x < 0.9]
    end = upper[-1]
    with bd.BuildPart() as part:
        with bd.BuildSketch():
            with bd.BuildLine():
                points = [(x, -y) for x, y in reversed(upper)] + upper[1:]
                bd.Spline(*points)
                bd.Line(end, (end[0], -end[1]))
            bd.make_face()
        bd.extrude(amount=6)
        with bd.BuildSketch(bd.Plane.XY.offset(6)):
            with bd.Locations((14, 0)):
                bd.SlotOverall(14, 6.6)
            with bd.Locations((44, 0)):
                bd.RectangleRounded(17, 5.6, 2.4)
        bd.extrude(amount=-4.5, mode=bd.Mode.SUBTRACT)
        with bd.BuildSketch(bd.Plane.XY.offset(6)):
            with bd.Locations((27, 5.5)):
                bd.Rectangle(5, 9)
        bd.extrude(amount=-6, mode=bd.Mode.SUBTRACT)
    above = [f for f in part.faces() if f.center().Z > 0.1]
    return Design(
        name="wing_rib", description="rib of a model wing", parameters=p, solid=part.part, predicates={"above": above},
        material="aluminium_6061", machine="mill_grbl", stock=StockBox(min_mm=(-4, -12, 0), max_mm=(80, 12, 6)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.02, gouge_mm=0.025),
        setups=(Setup(name="setup-1", faces=("above",), wcs_in_words="X0 at the nose, Y0 on the chord, Z0 on the base"),))
