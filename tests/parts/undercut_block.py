"""A block with a T-slot and a dovetail slot, both open at their ends, a plain slot before each."""

import math

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.slot import Slot
from cuspline.planning.strategies.t_slot import TSlot

X, Y, Z = 76.0, 20.0, 14.0
T_X, D_X, LOW, HIGH = 20.0, 54.0, 6.0, 4.0         # middles of the slots, their floors, and how high they are under their necks
NECK, T_WIDE, D_WIDE = 10.0, 16.0, 19.0


def solid():
    """The block."""
    block = cq.Workplane("XY").box(X, Y, Z, centered=False)
    t = cq.Workplane("XY", origin=(T_X, Y / 2, LOW)).rect(T_WIDE, Y + 4).extrude(HIGH)
    neck = cq.Workplane("XY", origin=(T_X, Y / 2, LOW)).rect(NECK, Y + 4).extrude(Z)
    top = D_WIDE / 2 - HIGH * math.tan(math.radians(45))
    section = [(D_X - D_WIDE / 2, LOW), (D_X + D_WIDE / 2, LOW), (D_X + top, LOW + HIGH), (D_X - top, LOW + HIGH)]
    dovetail = cq.Workplane("XZ", origin=(0, -2, 0)).polyline(section).close().extrude(-(Y + 4))
    opening = cq.Workplane("XY", origin=(D_X, Y / 2, LOW + HIGH)).rect(2 * top, Y + 4).extrude(Z)
    return block.cut(t).cut(neck).cut(dovetail).cut(opening)


def design(p: Parameters) -> Design:
    """The block out of its box."""
    inside = lambda name, x, low, high: FacePredicate(name=name, at_least=1, center_min_mm=(x - 10.5, 1, low),
                                                      center_max_mm=(x + 10.5, Y - 1, high))
    return Design(name="undercut_block", description="block with slots under necks", parameters=p, solid=solid().val(),
                  predicates=(inside("t", T_X, LOW - 1, LOW + HIGH + 0.1), inside("t neck", T_X, LOW + HIGH + 0.5, Z - 0.5),
                              inside("dovetail", D_X, LOW - 1, LOW + HIGH - 0.1), inside("d neck", D_X, LOW + HIGH + 0.2, Z - 0.5)),
                  material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z)),
                  finish=Finish(scallop_mm=0.1, profile_tolerance_mm=0.02, gouge_mm=0.02),
                  setups=(Setup(name="setup-1", faces=("t", "t neck", "dovetail", "d neck"), operations=(
                      Slot(name="t plain", faces=("t neck",)), TSlot(name="t slot", faces=("t",)),
                      Slot(name="d plain", faces=("d neck",)), TSlot(name="dovetail", faces=("dovetail",))),
                      wcs_in_words="corner, Z0 on the base"),))
