"""Plate with an outline of lines, arcs and a spline, a window rounded in its corners and a step outside: all by contours."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.contour import Contour

X, Y, Z = 44.0, 36.0, 6.0


def plate():
    """The solid."""
    outline = cq.Workplane("XY").lineTo(X - 6, 0).radiusArc((X, 6), -6).lineTo(X, Y)
    outline = outline.spline([(X / 2, Y - 3), (0, Y)], includeCurrent=True)
    window = cq.Workplane("XY", origin=(X / 2, 16, -1)).rect(24, 18).extrude(20).edges("|Z").fillet(6.0)
    return outline.lineTo(0, 5).lineTo(5, 0).close().extrude(Z).cut(window)


def design(p: Parameters) -> Design:
    """The plate, level faces finished."""
    return Design(
        name="contoured_plate", description="plate with an outline and a window", parameters=p, solid=plate().val(),
        predicates=(FacePredicate(name="walls", count=14, center_min_mm=(-1, -1, 1), center_max_mm=(X + 1, Y + 1, Z - 1)),),
        material="aluminium_6061", stock=StockBox(min_mm=(-2, -2, 0), max_mm=(X + 2, Y + 2, Z)),
        finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.01),
        setups=(Setup(name="setup-1", faces=("walls",), operations=(Contour(faces=("walls",), spring_passes=1),),
                      wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),))
