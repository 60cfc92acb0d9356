"""Plate with threads, as small as makes sense: M6 through and M4 blind tapped, M8 milled."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox, Thread
from cuspline.planning.strategies.drill import Drill
from cuspline.planning.strategies.tap import Tap
from cuspline.planning.strategies.thread_mill import ThreadMill

X, Y, Z = 44.0, 20.0, 14.0
SLOPE = 2.7474774194546216      # of a point of 140 degrees: radius over height
PLACES = {"m6": (10, 10), "m4": (22, 10), "m8": (34, 10)}


def plate():
    """The solid: holes of 5 and 6.8 mm through, one of 3.3 mm 11 mm deep with the drill's point below."""
    block = cq.Workplane("XY").box(X, Y, Z, centered=False).faces(">Z").workplane(origin=(0, 0, 0))
    block = block.pushPoints([PLACES["m6"]]).hole(5.0).pushPoints([PLACES["m8"]]).hole(6.8)
    profile = cq.Workplane("XZ").lineTo(1.65, 1.65 / SLOPE).lineTo(1.65, 20).lineTo(0, 20).close()
    point = profile.revolve(360, (0, 0, 0), (0, 1, 0)).translate((*PLACES["m4"], Z - 11.0 - 1.65 / SLOPE))
    return block.cut(point)


def walls():
    """A predicate for each wall."""
    return tuple(FacePredicate(name=name, count=1, kinds=("cylinder",), center_min_mm=(x - 5, 0, 0), center_max_mm=(x + 5, Y, Z))
                 for name, (x, _) in PLACES.items())


def design(p: Parameters) -> Design:
    """The plate, finished outside; its holes are drilled and threaded."""
    return Design(
        name="threaded_plate", description="plate with threads", parameters=p, solid=plate().val(),
        predicates=(*walls(), FacePredicate(name="point", count=1, kinds=("cone",))),
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z)),
        threads={"m6": "M6", "m4": Thread(size="M4", depth_mm=8), "m8": "M8"},
        finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.005, gouge_mm=0.006),
        setups=(Setup(name="setup-1", faces=(*PLACES, "point"), wcs_in_words="X0 Y0 lower left corner, Z0 on the base",
                      operations=(Drill(faces=tuple(PLACES)), Tap(faces=("m6", "m4")), ThreadMill(faces=("m8",)))),))
