"""Motor mount: a round plate with a bore and its recess, four slots for its screws, a flat side; its top edges broken."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.auto import Auto
from cuspline.planning.strategies.deburr import Deburr


class MotorMount(Parameters):
    """Nothing to choose."""


def design(p: MotorMount) -> Design:
    """Milled from above out of a sawn block, its base finished."""
    body = cq.Workplane("XY").circle(32).extrude(9).cut(cq.Workplane("XY", origin=(0, 34, -1)).rect(80, 16).extrude(20))
    body = body.cut(cq.Workplane("XY", origin=(0, 0, -1)).circle(8).extrude(20))
    body = body.cut(cq.Workplane("XY", origin=(0, 0, 6)).circle(12).extrude(20))
    slots = cq.Workplane("XY", origin=(0, 0, -1)).polarArray(20.5, 45, 360, 4).slot2D(9, 6).extrude(20)
    body = body.cut(slots)
    return Design(
        name="motor_mount", description="motor mount", parameters=p, solid=body.val(),
        predicates=(FacePredicate(name="from above", at_least=8, normal=(0, 0, 1), normal_within_deg=91.0),
                    FacePredicate(name="top", count=1, normal=(0, 0, 1), center_min_mm=(-40, -40, 8.9),
                                  center_max_mm=(40, 40, 9.1))),
        material="aluminium_6061", stock=StockBox(min_mm=(-33, -33, 0), max_mm=(33, 27, 10)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("from above",), wcs_in_words="X0 Y0 in the bore, Z0 on the base",
                      operations=(Auto(faces=("from above",)), Deburr(faces=("top",), width_mm=0.2))),))
