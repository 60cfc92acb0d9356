"""Parts of coolers, moulds, jigs and instruments, from above with the usual cutters: `-p part=cold_plate`."""

import math
from typing import Literal

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox

IN_MM = 0.01        # inside the part's box: its own sides are sawn


class Shops(Parameters):
    part: Literal["cold_plate", "tee_mould", "lens_array", "star_knob", "vee_block", "cam", "isogrid", "airfoil_block", "mouse",
                  "pin_electrode", "slotted_disc", "scoop", "engraved", "keyed_cover", "drafted_slot", "cavity_slot",
                  "sunk_recess"] = Field(default="cold_plate", description="which of them")


def cold_plate():
    """A serpentine channel inside a groove for a cord of 2 mm."""
    plate = cq.Workplane().box(90, 60, 12).translate((0, 0, -6)).edges("|Z").fillet(4)
    for k in range(5):
        plate = plate.cut(cq.Workplane().center(-32 + 16 * k, 0).slot2D(41, 5, 90).extrude(-5))
    for k in range(4):
        plate = plate.cut(cq.Workplane().center(-24 + 16 * k, 18 if k % 2 == 0 else -18).slot2D(21, 5).extrude(-5))
    plate = plate.cut(cq.Workplane().rect(84, 54).extrude(-1.6).edges("|Z").fillet(6).cut(
        cq.Workplane().rect(79, 49).extrude(-1.6).edges("|Z").fillet(3.5)))
    return plate.faces(">Z").workplane().pushPoints([(-32, -18), (32, 18)]).hole(4)


def tee_mould():
    """Half of a mould for a pipe tee."""
    block = cq.Workplane().box(70, 50, 24).translate((0, 0, -12))
    run = cq.Workplane("YZ", origin=(-30, 0, 0)).circle(9).extrude(60)
    branch = cq.Workplane("XZ", origin=(0, 0, 0)).circle(6).extrude(22)
    both = run.union(branch)
    return block.cut(both)


def lens_array():
    plate = cq.Workplane().box(48, 36, 8).translate((0, 0, -4))
    for i in range(4):
        for j in range(3):
            plate = plate.cut(cq.Workplane().sphere(14).translate((-16.5 + 11 * i, -11 + 11 * j, 14 - 1.0)))
    return plate


def star_knob():
    body = cq.Workplane().circle(22).extrude(12)
    for k in range(6):
        body = body.cut(cq.Workplane().center(25, 0).circle(7).extrude(12).rotate((0, 0, 0), (0, 0, 1), 60 * k))
    body = body.edges("|Z").fillet(2.5).faces(">Z").edges().fillet(2)
    return body.faces(">Z").workplane().circle(6).cutBlind(-8)


def vee_block():
    """A vee with its relief."""
    block = cq.Workplane().box(60, 40, 35).translate((0, 0, -17.5))
    vee = cq.Workplane("YZ", origin=(-40, 0, 0)).moveTo(-15.01, 0.01).lineTo(0, -15).lineTo(15.01, 0.01).close().extrude(80)
    relief = cq.Workplane().rect(80, 3.4).extrude(-18)
    return block.cut(vee).cut(relief)


def cam():
    """A plate cam with a hub and a keyway that no end mill enters."""
    turns = [math.pi * k / 12 for k in range(24)]
    radii = [20 + 5 * math.cos(a) + 1.5 * math.cos(2 * a) for a in turns]
    outline = [(r * math.cos(a), r * math.sin(a)) for r, a in zip(radii, turns)]
    body = cq.Workplane().spline(outline, periodic=True).close().extrude(8)
    body = body.union(cq.Workplane().circle(10).extrude(14)).faces(">Z").workplane().hole(10)
    return body.cut(cq.Workplane().center(0, 5).rect(3, 3.6).extrude(20))


def isogrid():
    """Triangles of 26 mm between ribs."""
    plate, side = cq.Workplane().box(100, 80, 10).translate((0, 0, -5)), 26.0
    high, to_corner = side * math.sqrt(3) / 2, 2 * (side / math.sqrt(12) - 2.0)
    for row in range(-1, 2):
        for col in range(-2, 3):
            x, way = col * side / 2, 1 if (row + col) % 2 else -1
            corners = [(x + to_corner * math.cos(a), row * high + way * high / 6 + to_corner * math.sin(a))
                       for a in (math.radians(120 * k - 90 * way) for k in range(3))]
            plate = plate.cut(cq.Workplane().polyline(corners).close().extrude(-7).edges("|Z").fillet(2.1))
    return plate


def airfoil_block():
    """A twisted blade lying on its block."""
    def section(x, chord, thick, turn_deg):
        cos, sin = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
        flat = [(chord * (k / 12 - 0.5), thick * 4 * k / 12 * (1 - k / 12) + 1.0) for k in range(13)]
        upper = [(cos * a - sin * b, sin * a + cos * b) for a, b in flat]
        outline = cq.Workplane("YZ", origin=(x, 0, 0)).spline(upper).lineTo(upper[-1][0], -8).lineTo(upper[0][0], -8).close()
        return outline.val()

    blade = cq.Solid.makeLoft([section(-25, 36, 6, 5), section(0, 33, 5, 0), section(25, 30, 4, -6)])
    return cq.Workplane(blade).union(cq.Workplane().box(64, 50, 10).translate((0, 0, -9)))


def mouse():
    """A hand's rest: an ellipsoid's top on an oval, the edge at its foot rounded."""
    body = cq.Workplane().ellipse(34, 20).extrude(24)
    dome = cq.Workplane().sphere(60).translate((8, 0, -38))
    body = body.intersect(dome)
    body = body.faces(">Z").edges().fillet(4)
    return body.union(cq.Workplane().box(90, 60, 6).translate((0, 0, -3)))


def pin_electrode():
    base = cq.Workplane().box(50, 50, 10).translate((0, 0, -5))
    for i in range(3):
        for j in range(3):
            base = base.union(cq.Workplane().center(-15 + 15 * i, -15 + 15 * j).circle(2.6).workplane(offset=10).circle(1.8).loft())
    return base


def slotted_disc():
    disc = cq.Workplane().circle(30).extrude(6).faces(">Z").workplane().hole(8)
    disc = disc.cut(cq.Workplane("XY", origin=(0, 0, 4)).polarArray(19, 0, 360, 12).slot2D(12, 3.2, 0).extrude(10))
    return disc.faces(">Z").workplane().polarArray(26.5, 15, 360, 6).cskHole(3, 5.5, 90)


def scoop():
    """A hollow like a spoon's, from deep and narrow to shallow and wide."""
    block = cq.Workplane().box(80, 40, 18).translate((0, 0, -9))
    sec = [cq.Workplane("YZ", origin=(x, 0, 0)).ellipse(r, d).val() for x, r, d in ((-28, 5, 9), (-5, 9, 8), (25, 14, 4))]
    return block.cut(cq.Workplane(cq.Solid.makeLoft(sec)))


def engraved():
    return cq.Workplane().box(80, 30, 8).translate((0, 0, -4)).cut(cq.Workplane().text("LAB 12", 16, -0.8, kind="bold"))


def keyed_cover():
    cover = cq.Workplane().circle(35).extrude(12).faces(">Z").workplane().circle(20).cutBlind(-4)
    cover = cover.cut(cq.Workplane().circle(12).extrude(20)).cut(cq.Workplane().center(0, 12).rect(6, 6).extrude(20))
    return cover.faces(">Z").workplane().polarArray(28, 0, 360, 4).hole(5.5)


def drafted_slot():
    """A slot at the bottom of a cavity with drafted walls."""
    block = cq.Workplane().box(70, 50, 25).translate((0, 0, -12.5)).cut(cq.Workplane().rect(50, 30).extrude(-14, taper=15))
    return block.cut(cq.Workplane("XY", origin=(0, 0, -14)).slot2D(24, 5).extrude(-4))


def cavity_slot():
    """A pocket at the bottom of a ball's hollow."""
    block = cq.Workplane().box(60, 60, 25).translate((0, 0, -12.5)).cut(cq.Workplane().sphere(30).translate((0, 0, 18)))
    return block.cut(cq.Workplane("XY", origin=(0, 0, -16)).rect(8, 16).extrude(10).edges("|Z").fillet(2.6))


def sunk_recess():
    """A pocket and three blind holes at the bottom of a cone."""
    cone = cq.Workplane("XZ").polyline([(0, 0.01), (26, 0.01), (14, -12), (0, -12)]).close().revolve(360, (0, 0, 0), (0, 1, 0))
    block, floor = cq.Workplane().box(60, 60, 30).translate((0, 0, -15)).cut(cone), cq.Workplane("XY", origin=(0, 0, -12))
    return block.cut(floor.polarArray(9, 0, 360, 3).circle(2.6).extrude(-5)).cut(
        cq.Workplane("XY", origin=(0, 0, -12)).rect(7, 7).extrude(-3).edges("|Z").fillet(1.7))


def design(p: Shops) -> Design:
    part = globals()[p.part]()
    box = part.val().BoundingBox()
    upper = FacePredicate(name="upper", at_least=1, normal=(0, 0, 1), normal_within_deg=91,
                          center_min_mm=(box.xmin + IN_MM, box.ymin + IN_MM, box.zmin + IN_MM),
                          center_max_mm=(box.xmax - IN_MM, box.ymax - IN_MM, box.zmax + IN_MM))
    return Design(name=p.part, description=p.part.replace("_", " "), parameters=p, solid=part, predicates=(upper,),
                  material="aluminium_6061", finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.01),
                  stock=StockBox(min_mm=(box.xmin, box.ymin, box.zmin), max_mm=(box.xmax, box.ymax, box.zmax + 0.5)),
                  setups=(Setup(name="setup-1", faces=("upper",), wcs_in_words="as drawn"),))
