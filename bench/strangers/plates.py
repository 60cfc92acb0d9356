"""Ten parts cut from above with the usual cutters and no operation listed: `cuspline build plates.py -p part=gland_flange`."""

from typing import Literal

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox

IN_MM = 0.01        # inside the part's box: its own sides are sawn


class Plates(Parameters):
    part: Literal["gland_flange", "phone_holder", "bearing_seat", "mould_core", "optic_mount", "stamp", "nameplate", "raised_u",
                  "ring_wheel", "saddle_block"] = Field(default="gland_flange", description="which of them")


def gland_flange():
    plate = cq.Workplane().circle(30).extrude(10).faces(">Z").workplane().hole(18)
    plate = plate.faces(">Z").workplane().polarArray(24, 0, 360, 6).cboreHole(4.5, 8, 4.4)
    return plate.cut(cq.Workplane("XY", origin=(0, 0, 8.2)).circle(16.2).circle(13.8).extrude(5))


def phone_holder():
    block = cq.Workplane().box(50, 34, 14).edges("|Z").fillet(5).faces(">Z").edges().fillet(1.5)
    block = block.cut(cq.Workplane("XY", origin=(0, 0, 1)).rect(36, 20).extrude(9).edges("|Z").fillet(2.2))
    return block.cut(cq.Workplane("XY", origin=(0, 0, -2)).slot2D(20, 5.2).extrude(9))


def bearing_seat():
    block = cq.Workplane().box(60, 30, 20).translate((0, 0, -10))
    block = block.cut(cq.Workplane("XZ", origin=(0, 20, 0)).circle(13).extrude(40))
    block = block.cut(cq.Workplane("XZ", origin=(0, 4, 0)).circle(16).extrude(8))
    return block.faces(">Z").workplane().pushPoints([(-23, 8), (-23, -8), (23, 8), (23, -8)]).hole(3.3, 14)


def mould_core():
    boss = cq.Workplane().rect(26, 18).workplane(offset=9).rect(21, 13).loft()
    boss = boss.edges("not(#Z)").fillet(2).faces(">Z").edges().fillet(0.8)
    core = cq.Workplane().box(46, 36, 12).translate((0, 0, -6)).union(boss)
    return core.edges(cq.selectors.BoxSelector((-14, -10, -0.1), (14, 10, 0.1))).fillet(1.2)


def optic_mount():
    groove = cq.Workplane("XZ", origin=(0, 30, 0)).moveTo(-6, 0.01).lineTo(0, -6).lineTo(6, 0.01).close().extrude(60)
    block = cq.Workplane().box(40, 40, 16).translate((0, 0, -8)).cut(groove)
    block = block.faces(">Z").workplane().pushPoints([(-14, 12), (14, 12), (-14, -12), (14, -12)]).cboreHole(3.4, 6.5, 3.4)
    return block.cut(cq.Workplane("XY", origin=(14, 0, -5)).slot2D(14, 3.2, 90).extrude(9))


def stamp():
    return cq.Workplane().box(44, 16, 8).translate((0, 0, -4)).union(cq.Workplane().text("CUSP", 11, 1.2, kind="bold"))


def nameplate():
    return cq.Workplane().box(120, 50, 8).translate((0, 0, -4)).union(cq.Workplane().text("PUMP 3", 16, 1.5, kind="bold"))


def raised_u():
    legs = cq.Workplane().box(6.6, 8, 1.6, centered=(True, True, False)).cut(cq.Workplane().box(2.6, 7, 4).translate((0, 0.5, 0)))
    return cq.Workplane().box(44, 30, 8).translate((0, 0, -4)).union(legs)


def ring_wheel():
    wheel = cq.Workplane().circle(22).extrude(8).cut(cq.Workplane("XY", origin=(0, 0, 5)).circle(19).circle(8).extrude(9))
    for k in range(5):
        wheel = wheel.cut(cq.Workplane().center(13.5, 0).circle(4).extrude(20).rotate((0, 0, 0), (0, 0, 1), 72 * k))
    return wheel.faces(">Z").workplane().hole(6).faces(">Z").edges("%CIRCLE").chamfer(0.5)


def saddle_block():
    height = lambda x, y: 2.0 * (x / 20) ** 2 - 1.5 * (y / 15) ** 2 + 0.03 * (x + y)
    saddle = cq.Face.makeSplineApprox([[cq.Vector(x, y, height(x, y)) for y in (-15, -7, 0, 7, 15)]
                                       for x in (-20, -10, 0, 10, 20)])
    air = cq.Workplane(cq.Solid.extrudeLinear(saddle, cq.Vector(0, 0, 20)))
    block = cq.Workplane().box(38, 28, 10).translate((0, 0, -2)).cut(air)
    return block.faces("<Z").workplane(invert=True).circle(3.2).cutThruAll()


ABOVE_MM = {"phone_holder": 1.0, "mould_core": 1.0, "saddle_block": 1.0, "optic_mount": 0.0}     # stock over the top; others 0.5


def design(p: Plates) -> Design:
    part = globals()[p.part]()
    box = part.val().BoundingBox()
    upper = FacePredicate(name="upper", at_least=1, normal=(0, 0, 1), normal_within_deg=91,
                          center_min_mm=(box.xmin + IN_MM, box.ymin + IN_MM, box.zmin + IN_MM),
                          center_max_mm=(box.xmax - IN_MM, box.ymax - IN_MM, box.zmax + IN_MM))
    top_mm = box.zmax + ABOVE_MM.get(p.part, 0.5)
    return Design(name=p.part, description=p.part.replace("_", " "), parameters=p, solid=part, predicates=(upper,),
                  material="aluminium_6061", finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.01),
                  stock=StockBox(min_mm=(box.xmin, box.ymin, box.zmin), max_mm=(box.xmax, box.ymax, top_mm)),
                  setups=(Setup(name="setup-1", faces=("upper",), wcs_in_words="as drawn"),))
