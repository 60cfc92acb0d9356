"""Plate with a pocket round an island, a pocket in its floor, one open to a side, and two slots, by operations of their own."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.pocket import Pocket
from cuspline.planning.strategies.slot import Slot

X, Y, Z = 92.0, 52.0, 12.0


def box(x, y, size_x, size_y, low, radius=6.0):
    """An upright box with rounded corners, its middle at x, y."""
    return cq.Workplane("XY", origin=(x, y, low)).rect(size_x, size_y).extrude(20).edges("|Z").fillet(radius)


def plate():
    """The solid."""
    block = cq.Workplane("XY").box(X, Y, Z, centered=False)
    block = block.cut(box(26, 27, 44, 38, 8.0)).cut(box(15, 27, 16, 28, 5.0))           # a pocket, one in its floor
    block = block.union(cq.Workplane("XY", origin=(32, 27, 7)).circle(4.0).extrude(4.0))    # an island, lower than the rim
    block = block.cut(box(84, 40, 30, 20, 7.0))                                         # open to +X
    slot = cq.Workplane("XY", origin=(66, 9, 9)).slot2D(26, 11).extrude(9)              # closed at both ends
    return block.cut(slot).cut(cq.Workplane("XY", origin=(56, 50, 8)).rect(10, 40).extrude(9))      # open to +Y, in size


def inside(name, low, high, **says):
    """Predicate of faces whose middles lie in a box."""
    return FacePredicate(name=name, at_least=1, center_min_mm=low, center_max_mm=high, **says)


def design(p: Parameters) -> Design:
    """The plate out of its box, its top finished."""
    return Design(
        name="pocket_plate", description="plate with pockets and slots", parameters=p, solid=plate().val(),
        predicates=(inside("nested", (1, 5, 4), (49, 48, 11.9)), inside("open", (68, 28, 4), (X + 1, 51, 11.9), normal=(0, 0, 1),
                                                                      normal_within_deg=95.0),
                    inside("slots", (50.5, 2, 4), (80, 15, 11.9)), inside("open slot", (50.5, 29, 4), (61.5, 51, 11.9))),
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z)),
        finish=Finish(scallop_mm=0.2, profile_tolerance_mm=0.02, gouge_mm=0.02),
        setups=(Setup(name="setup-1", faces=("nested", "open", "slots", "open slot"), wcs_in_words="X0 Y0 lower left, Z0 base",
                      operations=(Pocket(name="nested", faces=("nested",), tool="flat 10"),
                                  Pocket(name="open pocket", faces=("open",), tool="flat 10"),
                                  Slot(name="slot", faces=("slots",)), Slot(name="open slot", faces=("open slot",)))),))
