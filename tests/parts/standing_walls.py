"""What a short tool must lean past: a floor beside a wall, a channel between two twisted walls, a blade with both sides."""

from functools import cache
from typing import Literal

import cadquery as cq

from cuspline.app.catalogue import find_library, find_machine
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.parallel import Parallel
from cuspline.planning.strategies.rough import Rough
from cuspline.planning.strategies.waterline import Waterline
from cuspline.toolpaths.five_axis.tool_axes import ClearingAxis, FixedAxis

FLOOR_MM = 10.0
BALL = "ball 8"             # of the library that comes with it: 42 mm out of its holder
UPRIGHT = FixedAxis(direction=(0, 0, 1))
LONG = 98
HALF_MM = {"wall": (25.0, 8.0), "channel": (30.0, 14.0), "blade": (25.0, 20.0)}


class Standing(Parameters):
    form: Literal["wall", "channel", "blade"] = "channel"
    tall_mm: float = 46.0
    floor_mm: float = 16.0      # width of the channel's floor
    foot_mm: float = 0.0        # radius of the fillets round the feet of walls and blade
    ball: str = BALL
    around: Literal["normal", "up"] = "normal"      # the axis where nothing is in the way
    is_whole: bool = False      # a channel's walls and fillets too, not the floor alone
    upright: bool = False       # three axes, with a ball that is long enough: the same, 62 mm out of its holder
    scallop_mm: float = 0.3
    tolerance_mm: float = 0.02  # of the profile and of gouges


def mill(name="mill_trunnion_ac"):
    """A machine, its zero higher than usual: heads that lean come down low."""
    found = find_machine(name)
    x, y, z = found.wcs_origin_mm
    return found.model_copy(update={"wcs_origin_mm": (x, y, z + 80.0)})


def long_ball():
    """The library's ball of 8 mm in a longer shank, numbered LONG."""
    ball = next(t for t in find_library(None).of_type("ball") if t.cutter.diameter_mm == 8.0)
    cutter = ball.cutter.model_copy(update={"name": "ball 8 mm, long", "overall_length_mm": 120.0})
    return ball.model_copy(update={"number": LONG, "stick_out_mm": 62.0, "cutter": cutter})


@cache
def solid(form, tall_mm, floor_mm, foot_mm=0.0):
    """A block (50 x 16, 60 x 28 or 50 x 40 mm, 10 mm to the floor) with what stands on it."""
    if foot_mm:
        sharp, (x, y) = solid(form, tall_mm, floor_mm), HALF_MM[form]
        is_foot = lambda m: abs(m.z - FLOOR_MM) < 1e-6 and abs(m.x) < x - 1 and abs(m.y) < y - 1
        return sharp.fillet(foot_mm, [edge for edge in sharp.Edges() if is_foot(edge.Center())])
    x, y = HALF_MM[form]
    base = cq.Workplane().box(2 * x, 2 * y, FLOOR_MM, centered=(True, True, False))
    if form == "wall":
        wall = cq.Workplane().box(10, 2 * y, FLOOR_MM + tall_mm, centered=(True, True, False))
        return base.union(wall.translate((-20, 0, 0))).val()
    above = cq.Workplane().workplane(offset=FLOOR_MM)
    if form == "blade":
        return base.union(above.rect(7, 24).workplane(offset=tall_mm).transformed(rotate=(0, 0, 8)).rect(2.5, 18).loft(
            ruled=True)).val()
    block = cq.Workplane().box(2 * x, 2 * y, FLOOR_MM + tall_mm, centered=(True, True, False))
    return block.cut(above.rect(floor_mm, 3 * y).workplane(offset=tall_mm).transformed(rotate=(0, 0, 10)).rect(
        floor_mm + 16, 3 * y).loft(ruled=True)).val()


def design(p: Standing, axis=None, **finishing) -> Design:
    """One setup: roughed upright, then the floor, or the blade's sides, along an axis (left out: whatever clears)."""
    x, y = HALF_MM[p.form]
    standard = {"around": UPRIGHT} if p.around == "up" else {}
    axis = None if p.upright else axis or ClearingAxis(**standard)
    of = {"tool": LONG if p.upright else p.ball, "tool_axis": axis, **finishing}
    faces, walls, finish = _faces(p), (), (Waterline if p.form == "blade" else Parallel)(name="finish", **of)
    if p.is_whole:
        walls = (Waterline(name="walls", faces=("walls", "fillets"), **of),)
        finish = Parallel(name="finish", faces=("cut", "fillets"), **of)
    return Design(
        name="standing_walls", description="what a short tool must lean past", parameters=p,
        tools=(long_ball(),) if p.upright else (),
        solid=solid(p.form, p.tall_mm, p.floor_mm, p.foot_mm), predicates=faces, material="aluminium_6061",
        machine="mill_trunnion_ac",
        stock=StockBox(min_mm=(-x, -y, 0), max_mm=(x, y, FLOOR_MM + p.tall_mm)),
        finish=Finish(scallop_mm=p.scallop_mm, profile_tolerance_mm=p.tolerance_mm, gouge_mm=p.tolerance_mm),
        setups=(Setup(name="setup-1", faces=tuple(f.name for f in faces), wcs_in_words="middle of the base",
                      operations=(Rough(tool="flat 10"), *walls, finish)),))


def _faces(p):
    """(FacePredicate, ...) of what is finished."""
    if p.form == "blade":
        side = lambda name, x: FacePredicate(name=name, count=1, normal=(x, 0, 0), normal_within_deg=20,
                                             center_min_mm=(-99, -99, FLOOR_MM))
        return side("cut", 1), side("back", -1)
    x, y = (half - 1.0 for half in HALF_MM[p.form])
    foot = FLOOR_MM + p.foot_mm
    floor = FacePredicate(name="cut", count=1, normal=(0, 0, 1), normal_within_deg=5, center_max_mm=(99, 99, FLOOR_MM + 1))
    within = lambda name, low, high: FacePredicate(name=name, count=2, center_min_mm=(-x, -y, low), center_max_mm=(x, y, high))
    walls = within("walls", foot + 1.0, FLOOR_MM + p.tall_mm - 1.0), within("fillets", FLOOR_MM + 0.1, foot)
    return (floor, *walls) if p.is_whole else (floor,)
