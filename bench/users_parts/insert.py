"""Mould insert: a free-form crown, a pocket beside it, ejector holes in H7 with counterbores from below; two setups of nothing
but `Auto`, in CadQuery or in build123d."""

import math
from typing import Literal

from pydantic import Field

from cuspline.design import Design, Diameter, FacePredicate, Finish, Parameters, Setup, StockBox

X, Y, LAND, CROWN, RISE = 60.0, 40.0, 12.0, 34.0, 2.0        # the crown stands on x < CROWN, its border as high as the land
NODES = (9, 7)
POCKET, CORNER, FLOOR = (47.0, 20.0, 18.0, 28.0), 6.0, 8.0     # middle, size; radius; height
EJECTORS, PIN, HEAD, HEAD_DEEP = [(8.0, 8.0), (8.0, 32.0), (26.0, 8.0), (26.0, 32.0)], 4.006, 8.0, 4.0     # PIN: the middle of H7


class Insert(Parameters):
    """Which library it is drawn in."""

    library: Literal["cadquery", "build123d"] = Field(default="cadquery", description="the solid is the same in both")


def nodes():
    """[[(x, y, z)]] of the crown, beyond its borders."""
    x = [-2.0 + (CROWN + 2.0) * k / (NODES[0] - 1) for k in range(NODES[0])]
    y = [-2.0 + (Y + 4.0) * k / (NODES[1] - 1) for k in range(NODES[1])]
    high = lambda a, b: LAND + RISE * math.sin(math.pi * max(a, 0.0) / CROWN) ** 2 * (0.7 + 0.3 * math.cos(2 * math.pi * b / Y))
    return [[(a, b, high(a, b)) for b in y] for a in x]


def in_cadquery():
    import cadquery as cq
    crown = cq.Face.makeSplineApprox([[cq.Vector(*p) for p in row] for row in nodes()], tol=1e-4)
    under = cq.Workplane(obj=cq.Solid.extrudeLinear(crown, cq.Vector(0, 0, -40)))
    block = cq.Workplane("XY").box(CROWN, Y, 30, centered=False).intersect(under)
    block = block.union(cq.Workplane("XY", origin=(CROWN, 0, 0)).box(X - CROWN, Y, LAND, centered=False))
    x, y, size_x, size_y = POCKET
    block = block.cut(cq.Workplane("XY", origin=(x, y, FLOOR)).rect(size_x, size_y).extrude(9).edges("|Z").fillet(CORNER))
    low = cq.Workplane("XY", origin=(0, 0, -1)).pushPoints(EJECTORS)
    return block.cut(low.circle(PIN / 2).extrude(30)).cut(low.circle(HEAD / 2).extrude(1 + HEAD_DEEP)).val()


def in_build123d():
    import build123d as bd
    crown = bd.Face.make_surface_from_array_of_points([[bd.Vector(*p) for p in row] for row in nodes()], tol=1e-4)
    upright = (bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN)
    block = bd.Box(CROWN, Y, 30, align=(bd.Align.MIN,) * 3) & bd.extrude(crown, 40, dir=(0, 0, -1))
    block += bd.Pos(CROWN, 0, 0) * bd.Box(X - CROWN, Y, LAND, align=(bd.Align.MIN,) * 3)
    x, y, size_x, size_y = POCKET
    pocket = bd.Box(size_x, size_y, 9, align=upright)
    block -= bd.Pos(x, y, FLOOR) * bd.fillet(pocket.edges().filter_by(bd.Axis.Z), CORNER)
    for place in EJECTORS:
        block -= bd.Pos(*place, -1) * bd.Cylinder(PIN / 2, 30, align=upright)
        block -= bd.Pos(*place, -1) * bd.Cylinder(HEAD / 2, 1 + HEAD_DEEP, align=upright)
    return block


def design(p: Insert) -> Design:
    """The insert out of its ground block, 1 mm higher than the crown."""
    inside = {"center_min_mm": (1, 1, 0.1), "center_max_mm": (X - 1, Y - 1, 20)}
    return Design(
        name="insert", description="mould insert with crown, pocket and ejector holes", parameters=p,
        solid=in_cadquery() if p.library == "cadquery" else in_build123d(),
        predicates=(FacePredicate(name="ejectors", count=4, kinds=("cylinder",), area_max_mm2=128.0, area_min_mm2=95.0,
                                  center_min_mm=(1, 1, HEAD_DEEP), center_max_mm=(CROWN, Y, 20)),
                    FacePredicate(name="from above", at_least=15, normal=(0, 0, 1), normal_within_deg=91.0,
                                  center_min_mm=(1, 1, HEAD_DEEP), center_max_mm=inside["center_max_mm"]),
                    FacePredicate(name="from below", count=8, normal=(0, 0, -1), normal_within_deg=91.0,
                                  center_min_mm=inside["center_min_mm"], center_max_mm=(X - 1, Y - 1, HEAD_DEEP + 0.1))),
        dimensions=(Diameter(name="ejectors H7", faces="ejectors", fit="H7", nominal_mm=4.0),),
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, LAND + RISE + 1.0)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.008, gouge_mm=0.01),
        setups=(Setup(name="setup-1", faces=("from above",), wcs_in_words="X0 Y0 lower left corner, Z0 on the base"),
                Setup(name="setup-2", wcs="G55", faces=("from below",), wcs_origin_mm=(0, Y, LAND), wcs_z=(0, 0, -1),
                      wcs_in_words="turned over about X: X0 Y0 lower left corner, Z0 on the land")))
