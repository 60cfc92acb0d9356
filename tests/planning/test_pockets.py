"""Pockets and slots planned: engagement, floors at their height, walls kept, ways in, what is refused."""

import functools

import cadquery as cq
import numpy as np
import pytest
import seeded_pockets
from clearing_meter import measure_cuts

from cuspline.app import catalogue
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.feeds import move_lengths_mm
from cuspline.planning.plan import plan_setup
from cuspline.planning.slotting import middles_of
from cuspline.planning.strategies.pocket import Pocket
from cuspline.planning.strategies.slot import Slot
from cuspline.program.program import Kind
from cuspline.toolpaths.prismatic.plan_elements import PlanElement
from cuspline.toolpaths.prismatic.upright_walls import UprightWall
from cuspline.values.errors import CamError

MACHINE, SHOP = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)
X, Y, Z, FLOOR = 60.0, 40.0, 6.0, 4.6
INSIDE = {"center_min_mm": (1, 1, 1), "center_max_mm": (X - 1, Y - 1, Z - 0.1)}
METER_RAD = np.radians(3.0)         # a bin of the meter


def pocketed(corner=6.0, draft=0.0):
    """A block with one pocket round an island."""
    block = cq.Workplane("XY").box(X, Y, Z, centered=False)
    pocket = cq.Workplane("XY", origin=(X / 2, Y / 2, FLOOR)).rect(52, 32).extrude(9, taper=-draft).edges("not(#Z)").fillet(corner)
    return block.cut(pocket).union(cq.Workplane("XY", origin=(36, 20, 4)).circle(3.0).extrude(2.0))


def slotted(width=11.0, y=20.0):
    """A block with one slot, closed at both ends; near to the edge Y it is open at its side."""
    block = cq.Workplane("XY").box(X, Y, Z, centered=False)
    return block.cut(cq.Workplane("XY", origin=(X / 2, y, FLOOR)).slot2D(36, width).extrude(9))


def planned(solid, operation, faces=None):
    """SetupPlan of a part with one operation."""
    design = Design(name="plate", description="plate", parameters=Parameters(), solid=solid.val(),
                    predicates=(FacePredicate(name="pocket", at_least=1, **(faces or INSIDE)),), material="aluminium_6061",
                    stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z)),
                    finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.01),
                    setups=(Setup(name="setup-1", faces=("pocket",), operations=(operation,), wcs_in_words="corner"),))
    return plan_setup(design, design.setups[0], MACHINE, SHOP)


@functools.cache
def pocket():
    return planned(pocketed(), Pocket(tool="flat 10"))


def stock_mm(xy):
    return np.where(((xy >= 0) & (xy <= (X, Y))).all(axis=1), Z, -1.0)


def test_engagement_is_within_five_percent_of_its_limit_on_99_percent_of_the_way():
    rough = pocket().operations[0]
    radius, limit = rough.tool.cutter.radius_mm, np.radians(rough.facts["engagement_deg"])
    found = measure_cuts(rough.moves, radius, 0.0, stock_mm, (-1, -1, 0), (X + 1, Y + 1, Z), 0.1, 0.05, 0.5)
    ramp = rough.moves.feed_mm_per_min == rough.moves.feed_mm_per_min[rough.moves.kind == Kind.FEED][0]
    steered = (found.engaged_rad > 0) & (found.fall_rad == 0) & ~ramp       # a helix' last turn is at the ramp's feed
    way = move_lengths_mm(rough.moves)
    assert way[steered & (found.engaged_rad <= 1.05 * limit + METER_RAD)].sum() >= 0.99 * way[steered].sum()
    assert way[steered].sum() > 200.0 and found.deepest_rapid_mm == 0.0


def test_floors_come_to_their_height_and_walls_are_left_to_the_contour():
    rough, floor, walls = pocket().operations
    x, y = np.meshgrid(np.arange(5.0, X - 5, 0.4), np.arange(5.0, Y - 5, 0.4))
    xy = np.column_stack([x.ravel(), y.ravel()])
    within = (np.abs(xy - (X / 2, Y / 2)) < (25.6, 15.6)).all(axis=1) & (np.hypot(*(xy - (36, 20)).T) > 3.4)
    corner = np.maximum(np.abs(xy - (X / 2, Y / 2)) - (20.0, 10.0), 0.0)
    within &= np.hypot(*corner.T) < 5.6
    height = floor.swept_mm(xy, rough.swept_mm(xy, np.full(len(xy), Z)))
    assert np.mean(np.abs(height[within] - FLOOR) < 1e-5) > 0.995
    assert floor.moves.end_mm[:, 2].min() == pytest.approx(FLOOR, abs=2e-6) == walls.moves.end_mm[:, 2].min()
    assert (height >= FLOOR - 1e-9).all()


def test_corners_that_are_hardly_wider_than_the_cutter_are_roughed_from_above_the_walls():
    made = {o.name: o for o in planned(pocketed(corner=5.2), Pocket(tool="flat 10")).operations}
    rough = made["pocket walls rough"].moves
    assert rough.end_mm[rough.kind == Kind.RAPID, 2].min() >= Z
    low = rough.end_mm[np.abs(rough.end_mm[:, 2] - FLOOR) < 1e-6]
    assert low[:, 0].min() == pytest.approx(4 + 5 + 0.15, abs=1e-6)         # half of the share stays where all of it has no room


def test_a_slot_is_entered_by_a_ramp_and_finished_along_both_walls():
    along, walls = planned(slotted(), Slot()).operations
    starts, ends = along.moves.starts_mm, along.moves.end_mm
    in_cut = (along.moves.kind == Kind.FEED) & (starts[:, 2] <= Z + 1e-9) & (ends[:, 2] < starts[:, 2] - 1e-9)
    fall, flat = (starts - ends)[in_cut, 2], np.hypot(*(starts - ends)[in_cut, :2].T)
    assert in_cut.sum() >= 1 and (fall <= flat * np.tan(np.radians(3.0)) + 1e-9).all()
    assert np.abs(ends[along.moves.kind == Kind.FEED, 1] - 20.0).max() < 1e-9
    assert walls.moves.end_mm[:, 1].max() == pytest.approx(20.5, abs=0.02)



@pytest.mark.parametrize("solid, operation, faces, why", [
    (pocketed(corner=4.0), Pocket(), None, "rounded by 4.000 mm, and no flat cutter"),
    (pocketed(), Pocket(), {**INSIDE, "kinds": ("cylinder",)}, "is a level floor"),
    (cq.Workplane("XY").box(X, Y, Z, centered=False).faces(">Z").workplane().rect(40, 20).cutBlind(-2.0, taper=8), Pocket(), None,
     "neither level nor upright"),
    (slotted(width=9.0), Slot(), None, "T3 is wider than 9.000 mm"),
    (pocketed(), Slot(), None, "too narrow for 32.000 mm"),
])
def test_what_cannot_be_done_is_refused(solid, operation, faces, why):
    with pytest.raises(CamError, match=why):
        planned(solid, operation, faces)


def test_a_floor_between_drafted_walls_is_finished_by_a_flat_cutter_and_the_walls_by_a_ball():
    """Balls alone left 278 of 556 mm2: their own radius along the whole foot."""
    part = seeded_pockets.design(seeded_pockets.Seeded(seed=77))
    plan = plan_setup(part, part.setups[0], MACHINE, SHOP)
    rough, floor, walls = plan.operations
    assert [o.tool.cutter.type for o in (rough, floor, walls)] == ["flat", "flat", "ball"] and floor.facts["strategy"] == "floor"
    assert plan.area_reached_mm2 > 370.0


def ringed(radius=14.0, width=10.0, depth=2.2):
    """A plate with a ring groove in its top, as deep."""
    ring = cq.Workplane("XY", origin=(X / 2, Y / 2, Z)).circle(radius + width / 2).circle(radius - width / 2).extrude(-depth)
    return cq.Workplane("XY").box(X, Y, Z, centered=False).cut(ring)


@pytest.mark.parametrize("width", [10.0, 11.0])
def test_a_ring_groove_is_entered_by_a_helix_along_its_middle(width):
    """As wide as the cutter it is made in size, a wider one has its two walls finished."""
    made = planned(ringed(width=width), Slot()).operations
    along, x, y = made[0].moves, X / 2, Y / 2
    cut = np.flatnonzero(along.kind == Kind.ARC_CCW)
    assert np.abs(np.hypot(*(along.end_mm[cut, :2] - (x, y)).T) - 14.0).max() < 1e-9
    fall = along.starts_mm[cut, 2] - along.end_mm[cut, 2]
    assert fall.max() <= 14.0 * np.pi * np.tan(np.radians(3.0)) + 1e-9 and (fall[-2:] == 0.0).all()
    assert along.end_mm[:, 2].min() == pytest.approx(Z - 2.2)
    turn = np.linspace(0, 2 * np.pi, 400)
    across = np.linspace(9.0 - (width - 10) / 2 + 0.03, 19.0 + (width - 10) / 2 - 0.03, 60)
    xy = np.concatenate([np.column_stack([x + r * np.cos(turn), y + r * np.sin(turn)]) for r in across])
    height = np.full(len(xy), Z)
    for operation in made:
        height = operation.swept_mm(xy, height)
    assert np.abs(height - (Z - 2.2)).max() < 1e-5
    assert len(made) == (1 if width == 10.0 else 2)


def half(radius, is_left, face, is_first):
    """Half a circle about (3, 4) as an UprightWall."""
    way = np.array([radius if is_first else -radius, 0.0])
    middle = np.array([3.0, 4.0])
    return UprightWall(element=PlanElement(start=middle + way, end=middle - way, center=middle, is_left=is_left),
                       low_mm=1.0, high_mm=3.0, face=face)


def test_a_ring_of_half_cylinders_is_one_ring_and_three_quarters_of_one_is_none():
    walls = [half(r, is_left, face, is_first) for face, (r, is_left, is_first) in enumerate(
        ((9.0, True, True), (9.0, True, False), (6.0, False, True), (6.0, False, False)))]
    ring, = middles_of(walls)
    assert ring.path.is_closed and ring.width_mm == 3.0 and set(ring.faces) == {0, 1, 2, 3} and ring.low_mm == 1.0
    assert ring.path.length_mm == pytest.approx(2 * np.pi * 7.5)
    assert middles_of(walls[:3]) == []
