"""Small parts with what troubles path planners: a hole, islands, knife edges, poles, closed faces, slivers."""

import math

import cadquery as cq
import numpy as np

from cuspline.design import Design, FacePredicate, Finish, Marker, Parameters, Setup, StockBox
from cuspline.kernel import brep
from cuspline.planning.strategies.auto import Auto


def knife_edge():
    """A roof that comes to a sharp edge, across a plate."""
    roof = cq.Workplane("XZ").polyline([(-7, 0), (0, 5), (7, 0)]).close().extrude(9, both=True)
    return cq.Workplane().box(24, 18, 6, centered=(True, True, False)).translate((0, 0, -6)).union(roof)


def pole_and_apex():
    """A hemisphere, whose top is a pole of its face, and a cone that comes to a point."""
    plate = cq.Workplane().box(30, 18, 6, centered=(True, True, False)).translate((0, 0, -6))
    cone = cq.Solid.makeCone(5, 0, 4, pnt=(8, 0, 0))
    dome = cq.Workplane().sphere(5).translate((-7, 0, -1)).intersect(
        cq.Workplane().box(40, 40, 10, centered=(True, True, False)).translate((0, 0, -3)))
    return plate.union(cq.Workplane(cone)).union(dome)


def closed_face():
    """Half a torus out of a plate: a face closed on itself both ways, before it was cut."""
    ring = cq.Workplane("XZ").center(8, 0).circle(2.5).revolve(360, (-8, 0), (-8, 1))
    return cq.Workplane().box(28, 28, 6, centered=(True, True, False)).translate((0, 0, -6)).union(ring)


def slivers():
    """A step with a bevel of 0.02 mm and a drilled rim that leaves a web of 0.05 mm."""
    step = cq.Workplane().box(24, 18, 10, centered=False).cut(
        cq.Workplane().box(12, 18, 2, centered=False).translate((12, 0, 8)))
    step = step.edges(cq.selectors.BoxSelector((11, -1, 9.5), (13, 19, 10.5))).chamfer(0.02)
    return step.cut(cq.Workplane().circle(3).extrude(4).translate((18, 3.05, 6.5))).translate((-12, -9, -10))


def hole_and_islands():
    """Two bosses with a fillet and a through hole in a shallow dish."""
    dish = cq.Workplane().box(34, 24, 8, centered=(True, True, False)).translate((0, 0, -8)).cut(
        cq.Workplane().sphere(60).translate((0, 0, 58)))
    bosses = cq.Workplane().pushPoints([(-8, 3), (9, -4)]).circle(3.5).extrude(4).translate((0, 0, -3))
    body = dish.union(bosses)
    foot = body.edges(cq.selectors.BoxSelector((-13, -9, -2.5), (13, 8, -0.3)))
    return foot.fillet(2.5).cut(cq.Workplane().circle(2.5).extrude(20).translate((1, 7, -15)))


FINISH = Finish(scallop_mm=0.08, profile_tolerance_mm=0.006, gouge_mm=0.008)
PARTS = {"knife_edge": knife_edge, "pole_and_apex": pole_and_apex, "closed_face": closed_face, "slivers": slivers,
         "hole_and_islands": hole_and_islands}


def design_of(name, strategy="constant_scallop"):
    """A Design of one of the parts: all faces seen from above are cut, coarsely."""
    solid = brep.the_solid(PARTS[name]().val(), name)
    low, high = (np.round(corner, 4) for corner in brep.bounding_box_mm(solid))
    faces = brep.faces_of(solid)
    rings = [f for f in faces if f.kind == "torus"]         # closed: which way its middle looks is anybody's guess
    seen = [f for f in faces if f.middle.normal[0, 2] > math.cos(math.radians(89)) and f not in rings]
    inner = [f for f in seen if (abs(f.middle.point_mm[0, :2]) < high[:2] - 1e-3).all()]
    kinds = tuple(sorted({f.kind for f in inner}))
    ring = (FacePredicate(name="ring", count=len(rings), kinds=("torus",)),) if rings else ()
    return Design(
        name=name, description=name.replace("_", " "), parameters=Parameters(), solid=solid,
        predicates=(FacePredicate(name="top", count=len(inner), normal=(0, 0, 1), normal_within_deg=89, kinds=kinds,
                                  center_min_mm=tuple(low + 1e-3),
                                  center_max_mm=(high[0] - 1e-3, high[1] - 1e-3, high[2] + 1e-3)), *ring),
        material="aluminium_6061", stock=StockBox(min_mm=tuple(low), max_mm=tuple(high + (0.0, 0.0, 0.5))),
        finish=FINISH,
        setups=(Setup(name="setup-1", wcs_in_words="as the part is drawn",
                      faces=("top", *(p.name for p in ring)), operations=(Auto(strategy=strategy),)),))


def two_sided():
    """A plate with a dish in its top and another in its bottom, cut in two clampings.

    The second lies turned over the part's X.  The lower dish touches the plate's side in one point.
    """
    plate = cq.Workplane().box(30, 20, 8)
    plate = plate.cut(cq.Workplane().sphere(25).translate((-4, 0, 27))).cut(cq.Workplane().sphere(15).translate((5, 1, -16)))
    solid = brep.the_solid(plate.val(), "two_sided")
    top, bottom = (FacePredicate(name=name, count=2, normal=(0, 0, z), normal_within_deg=70)
                   for name, z in (("top", 1), ("bottom", -1)))
    markers = tuple(Marker(name=n, at_mm=at) for n, at in (
        ("left", (-15, 0, 0)), ("right", (15, 0, 0)), ("front", (0, -10, 0)), ("back", (0, 10, 2))))
    common = {"operations": (Auto(strategy="parallel"),), "markers": markers, "wcs_in_words": "middle of the plate, on the side up"}
    return Design(
        name="two_sided", description="plate with a dish on either side", parameters=Parameters(), solid=solid,
        predicates=(top, bottom), material="aluminium_6061",
        stock=StockBox(min_mm=(-15, -10, -4.5), max_mm=(15, 10, 4.5)),
        finish=FINISH,
        setups=(Setup(name="setup-1", faces=("top",), wcs_origin_mm=(0, 0, 4), **common),
                Setup(name="setup-2", wcs="G55", faces=("bottom",), wcs_origin_mm=(0, 0, -4), wcs_z=(0, 0, -1), **common)))


def bow_tie(low_mm=0):
    """Four sides over a polygon like an 8, closed by points above and below; `low_mm` makes its right loop smaller."""
    corners = [(0, 0), (10, 8), (10, low_mm), (0, 8)]
    ring = lambda z: [(x, y, z) for x, y in corners]
    low, high, faces = ring(0.0), ring(5.0), []
    for a, b, c, d in zip(low, low[1:] + low[:1], high[1:] + high[:1], high):
        faces += [(a, b, c, d), (d, c, (7, 4.5, 9)), (b, a, (7, 4.5, -4))]
    made = [cq.Face.makeFromWires(cq.Wire.makePolygon([cq.Vector(*p) for p in f], close=True)) for f in faces]
    return cq.Solid.makeSolid(cq.Shell.makeShell(made)).wrapped
