"""Plate for faults of every prismatic kind: from above a blind hole, a deep one that is pecked, M6, a ledge whose wall is
chamfered; from below one more hole."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.chamfer import Chamfer
from cuspline.planning.strategies.drill import Drill
from cuspline.planning.strategies.pocket import Pocket
from cuspline.planning.strategies.tap import Tap

X, Y, Z = 52.0, 28.0, 12.0
LEDGE_Y, LEDGE_Z, CHAMFER_MM = 19.0, 10.0, 0.6
SLOPE = 2.7474774194546216      # of a point of 140 degrees: radius over height
BLIND, DEEP, M6, BELOW = (7.0, 9.0), (18.0, 9.0), (29.0, 9.0), (42.0, 9.0)


def pointed(at, radius, depth, turned=False):
    """A drilled hole with its point, its wall so deep; turned: from below."""
    profile = cq.Workplane("XZ").lineTo(radius, radius / SLOPE).lineTo(radius, 30).lineTo(0, 30).close()
    hole = profile.revolve(360, (0, 0, 0), (0, 1, 0)).translate((0, 0, -depth - radius / SLOPE))
    hole = hole.rotate((0, 0, 0), (1, 0, 0), 180) if turned else hole.translate((0, 0, Z))
    return hole.translate((*at, 0))


def plate():
    """The solid."""
    block = cq.Workplane("XY").box(X, Y, Z, centered=False)
    block = block.cut(cq.Workplane("XY", origin=(-1, LEDGE_Y, LEDGE_Z)).box(X + 2, Y, 9, centered=False))
    block = block.edges(cq.selectors.NearestToPointSelector((X / 2, LEDGE_Y, Z))).chamfer(CHAMFER_MM)
    holes = pointed(BLIND, 3.0, 7.0).union(pointed(BELOW, 3.0, 6.0, turned=True))
    through = cq.Workplane("XY", origin=(0, 0, -1)).pushPoints([M6]).circle(2.5).extrude(30)
    return block.cut(holes).cut(through).cut(cq.Workplane("XY", origin=(0, 0, -1)).pushPoints([DEEP]).circle(1.25).extrude(30))


def around(name, at, z):
    """Predicate of the walls of a hole."""
    return FacePredicate(name=name, at_least=1, center_min_mm=(at[0] - 5, at[1] - 5, z[0]),
                         center_max_mm=(at[0] + 5, at[1] + 5, z[1]), kinds=("cylinder",))


def design(p: Parameters) -> Design:
    """The plate in a block of its size."""
    named = (around("blind", BLIND, (0.1, Z)), around("deep", DEEP, (0, Z)), around("m6", M6, (0, Z)),
             around("below", BELOW, (0, Z)),
             FacePredicate(name="point", count=1, kinds=("cone",), center_max_mm=(12, LEDGE_Y, Z)),
             FacePredicate(name="point below", count=1, kinds=("cone",), center_min_mm=(36, 0, 0)),
             FacePredicate(name="wall", count=1, center_min_mm=(1, LEDGE_Y - 0.01, LEDGE_Z), center_max_mm=(X, LEDGE_Y + 0.01, Z)),
             FacePredicate(name="ledge", count=1, normal=(0, 0, 1), normal_within_deg=1.0,
                           center_min_mm=(1, LEDGE_Y, LEDGE_Z - 0.1), center_max_mm=(X, Y, LEDGE_Z + 0.1)),
             FacePredicate(name="chamfer", count=1, center_min_mm=(1, LEDGE_Y - 0.59, Z - 0.59),
                           center_max_mm=(X, LEDGE_Y, Z - 0.01)))
    above = Setup(name="setup-1", faces=("blind", "point", "deep", "m6", "wall", "ledge", "chamfer"),
                  wcs_in_words="corner, Z0 on the base",
                  operations=(Drill(faces=("blind", "m6")), Drill(name="deep drill", faces=("deep",), cycle="peck", peck_mm=3.0),
                              Pocket(faces=("ledge", "wall")), Chamfer(faces=("chamfer",)), Tap(faces=("m6",))))
    below = Setup(name="setup-2", faces=("below", "point below"), wcs_in_words="corner, Z0 on what was the top",
                  wcs_z=(0.0, 0.0, -1.0), wcs_origin_mm=(0.0, Y, Z), operations=(Drill(faces=("below",)),))
    return Design(name="two_sided_plate", description="plate for faults", parameters=p, solid=plate().val(), predicates=named,
                  material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z)), threads={"m6": "M6"},
                  finish=Finish(scallop_mm=0.2, profile_tolerance_mm=0.025, gouge_mm=0.03), setups=(above, below))
