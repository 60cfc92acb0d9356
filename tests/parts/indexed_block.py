"""A small block with a round hollow in its top and in some of its sides, cut in one clamping by indexed positions."""

import cadquery as cq
import numpy as np
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.auto import Auto

HALF_MM, RADIUS_MM, DEPTH_MM = 7.0, 16.0, 1.0
SIDES = {"top": (0, 0, 1), "front": (0, -1, 0), "right": (1, 0, 0), "back": (0, 1, 0), "left": (-1, 0, 0)}
MIDDLE = np.array([0.0, 0.0, HALF_MM])


class IndexedBlock(Parameters):
    sides: int = Field(default=2, ge=1, le=5, description="of top, front, right, back and left, that have a hollow")


def design(p: IndexedBlock) -> Design:
    sides = dict(list(SIDES.items())[:p.sides])
    body = cq.Workplane().box(*3 * (2 * HALF_MM,), centered=(True, True, False))
    for n in sides.values():
        center = MIDDLE + (HALF_MM + RADIUS_MM - DEPTH_MM) * np.array(n)
        poles = cq.Vector(n[1], n[2], n[0])             # off the face
        body = body.cut(cq.Workplane(cq.Solid.makeSphere(RADIUS_MM, cq.Vector(*center), poles, -90, 90, 360)))
    predicates = tuple(FacePredicate(name=name, count=1, kinds=("sphere",), normal=n, normal_within_deg=5)
                       for name, n in sides.items())
    setups = tuple(Setup(name=name, faces=(name,), wcs_in_words="middle of the base", indexed=name != "top", wcs_z=n,
                         wcs_x=(0, 1, 0) if n[0] else (1, 0, 0), operations=(Auto(strategy="parallel"),))
                   for name, n in sides.items())
    return Design(name="indexed_block", description="Block with round hollows", parameters=p, solid=body.val(), setups=setups,
                  predicates=predicates, material="aluminium_6061", machine="mill_trunnion_ac",
                  stock=StockBox(min_mm=(-HALF_MM, -HALF_MM, 0), max_mm=(HALF_MM, HALF_MM, 2 * HALF_MM)),
                  finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.01))
