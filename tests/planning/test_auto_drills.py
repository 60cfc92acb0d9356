"""What Auto makes of holes and level floors: drills, and a flat cutter where it is faster than a ball."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.app import catalogue
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox, Thread
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.auto import Auto
from cuspline.planning.strategies.bore import Bore
from cuspline.planning.strategies.drill import Drill
from cuspline.program.program import Kind
from cuspline.shop.practice import Practice, ShopFile
from cuspline.values.errors import PlanError

MACHINE, SHOP = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)
X, Y, TOP, FLOOR = 110.0, 80.0, 12.0, 6.0


def planned(solid, operation=Auto(), threads=None, inner=None, shop=ShopFile(), library=SHOP, **finish):
    """SetupPlan of a block's inner faces."""
    inner = inner or FacePredicate(name="inside", at_least=1, center_min_mm=(0.5, 0.5, 0.3),
                                   center_max_mm=(X - 0.5, Y - 0.5, TOP - 0.3))
    bored = FacePredicate(name="m6", count=1, kinds=("cylinder",), area_min_mm2=150, area_max_mm2=160)
    design = Design(name="tray", description="tray", parameters=Parameters(), solid=solid.val(),
                    predicates=(inner, *([bored] if threads else [])), threads=threads or {},
                    material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, TOP)),
                    finish=Finish(**{"scallop_mm": 0.01, "profile_tolerance_mm": 0.003, "gouge_mm": 0.004, **finish}),
                    setups=(Setup(name="setup-1", faces=("inside",), operations=(operation,), wcs_in_words="corner"),))
    return plan_setup(design, design.setups[0], MACHINE, library, shop=shop)


def block():
    return cq.Workplane("XY").box(X, Y, TOP, centered=False)


def at(z, *places):
    return cq.Workplane("XY", origin=(0, 0, z)).pushPoints(places)


def tray():
    pocket = cq.Workplane("XY", origin=(0, 0, FLOOR)).center(X / 2, Y / 2).rect(X - 24, Y - 24).extrude(20).edges("|Z").fillet(6.0)
    return block().cut(pocket)


def test_a_plate_of_holes_is_drilled_and_nothing_else():
    plate = block().cut(at(-1, (10, 10), (90, 20)).circle(3.0).extrude(20)).cut(at(-1, (40, 40)).circle(4.25).extrude(20))
    plan = planned(plate)
    assert [(o.name, o.facts["holes"]) for o in plan.operations] == [("drill 6", 2), ("drill 8.5", 1)]
    assert plan.area_reached_mm2 == pytest.approx(plan.area_required_mm2)


@pytest.fixture(scope="module")
def bored_plan():
    """A hole that no drill makes, and one with a counterbore."""
    odd = block().cut(at(-1, (70, 40)).circle(9.3).extrude(20)).cut(at(-1, (20, 20)).circle(3.0).extrude(20))
    return planned(odd.cut(at(8, (20, 20)).circle(7.0).extrude(20)), scallop_mm=0.1, profile_tolerance_mm=0.02)


def test_holes_that_no_drill_makes_and_counterbores_are_bored(bored_plan):
    assert [o.name for o in bored_plan.operations] == ["drill", "bore rough", "bore"]
    assert bored_plan.area_reached_mm2 == pytest.approx(bored_plan.area_required_mm2)
    bore = bored_plan.operations[2]
    assert bore.facts["diameters_mm"] == [14.0, 18.6] and bore.facts["bottoms_mm"] == [-0.5, 8.0]


def test_the_last_way_round_a_bore_is_its_circle(bored_plan):
    moves, radius = bored_plan.operations[2].moves, bored_plan.operations[2].tool.cutter.radius_mm
    for (x, y, r) in ((70, 40, 9.3), (20, 20, 7.0)):
        away = np.hypot(*(moves.end_mm[:, :2] - (x, y)).T)
        low = moves.end_mm[:, 2] < 8.0 + 1e-6
        assert away[low & (away < 12)].max() == pytest.approx(r - radius, abs=1e-9)
    assert (moves.kind == Kind.ARC_CCW).sum() >= 2 * 2 + 4              # inside, the material on the right


def test_helices_go_down_no_steeper_than_the_ramp_and_leave_no_core(bored_plan):
    moves = bored_plan.operations[1].moves
    arcs = np.flatnonzero(moves.kind >= Kind.ARC_CW)
    starts, ends = moves.starts_mm[arcs], moves.end_mm[arcs]
    radius = np.hypot(*(starts[:, :2] - moves.center_mm[arcs, :2]).T)
    slope = (starts[:, 2] - ends[:, 2]) / (np.pi * radius)
    assert 0.0 < slope.max() <= np.tan(np.radians(3.0)) + 1e-9
    assert radius.min() < bored_plan.operations[1].tool.cutter.radius_mm


def test_what_helices_leave_in_a_tight_bore_is_taken_in_steps_from_the_top_of_the_stock():
    part = tray().cut(at(-1, (X / 2, Y / 2)).circle(2.55).extrude(20))
    plan = planned(part, library=catalogue.find_library("small_mills"))
    bore = next(o for o in plan.operations if o.name == "bore")
    cutter, moves = bore.tool.cutter, bore.moves
    low = np.unique(moves.end_mm[moves.kind >= Kind.ARC_CW, 2])[::-1]       # the levels of its ways round
    depths = -np.diff([TOP, *low])                                          # the pocket above is cut later
    path = 2.55 - cutter.radius_mm
    left = bore.facts["finish_allowance_mm"]
    as_slot = depths * (2.55**2 - (2.55 - left)**2) / (2 * path) / cutter.diameter_mm
    assert cutter.diameter_mm == 3.0 and low[-1] == pytest.approx(-0.5)
    assert (1.5 * as_slot <= cutter.deepest_slot_mm * (1 + 1e-9)).all()    # 1.45 times it where its arc comes in
    assert (depths <= cutter.flute_length_mm).all()


def test_the_wall_of_a_pocket_is_no_bore():
    with pytest.raises(PlanError, match="is no wall of a hole"):
        planned(tray().cut(at(-1, (X / 2, Y / 2)).circle(7.3).extrude(20)), Bore(faces=("inside",)))


@pytest.fixture(scope="module")
def tray_plan():
    rim = at(-1, (6, 6), (X - 6, Y - 6)).circle(2.5).extrude(20)
    return planned(tray().cut(rim).cut(at(-1, (X / 2, Y / 2)).circle(4.0).extrude(20)))


def test_a_tray_is_drilled_and_its_pocket_finished_by_a_flat_cutter_in_a_third_of_a_balls_way(tray_plan):
    names = [o.name for o in tray_plan.operations]
    assert set(names[:2]) == {"drill 5", "drill 8"} and names[2:] == [
        "pocket rough", "pocket floor", "pocket floor corners", "pocket walls"]
    floor, _, walls = tray_plan.operations[-3:]
    assert floor.tool.cutter.type == "flat" and not any(o.tool.cutter.type == "ball" for o in tray_plan.operations)
    ball_mm = (X - 24) * (Y - 24) / 0.7         # passes of the largest ball, a step of 0.7 mm apart, over the floor alone
    assert floor.facts["length_mm"] + walls.facts["length_mm"] < ball_mm / 3
    assert tray_plan.area_reached_mm2 == pytest.approx(tray_plan.area_required_mm2, rel=5e-3)


def test_a_pocket_is_cleared_at_its_whole_depth_where_that_is_faster_and_a_tooth_takes_no_more_than_in_levels(tray_plan):
    rough, _, corners = tray_plan.operations[2:5]
    for made in (rough, corners):
        d, facts = made.tool.cutter.diameter_mm, made.facts
        assert facts["levels"] == 1 and facts["stepdown_mm"] == pytest.approx(TOP - FLOOR)
        assert facts["stepdown_mm"] * facts["stepover_mm"] == pytest.approx(0.15 * 0.45 * d * d)        # aluminium's and the shop's
        assert [way["time_s"] > facts["time_s"] for way in facts["slower_ways"]] == [True]
        assert facts["largest_engagement_deg"] <= facts["engagement_deg"] + 0.1
    assert corners.tool == tray_plan.operations[-1].tool and corners.facts["time_s"] < rough.facts["time_s"] / 4


def test_the_floor_is_cut_at_its_height_and_round_its_walls(tray_plan):
    floor = tray_plan.operations[-1]
    low = floor.moves.end_mm[floor.moves.end_mm[:, 2] < FLOOR + 0.01]
    assert low[:, 2].min() >= FLOOR - 1e-6
    reach = 12.0 + floor.tool.cutter.radius_mm
    np.testing.assert_allclose([low[:, 0].min(), low[:, 0].max()], [reach, X - reach], atol=2e-3)


def test_a_stated_strategy_is_kept():
    names = [o.name for o in planned(tray(), Auto(strategy="parallel"), scallop_mm=0.3, profile_tolerance_mm=0.02).operations]
    assert "floor" not in names and "finish" in names


def test_a_thread_in_a_flat_bottomed_hole_is_drilled_as_far_as_the_point_touches_the_bottom():
    """The cone that stays is below the thread; a thread down to the bottom leaves no room for it."""
    solid = block().cut(at(2, (30, 30)).circle(2.5).extrude(20))
    plan = planned(solid, threads={"m6": Thread(size="M6", depth_mm=6)})
    assert [o.name for o in plan.operations] == ["drill", "tap"]
    assert plan.operations[0].moves.end_mm[:, 2].min() == pytest.approx(2.0)


def test_deep_and_narrow_holes_with_a_level_bottom_are_drilled():
    narrow, deep = at(6, (30, 30)).circle(1.5).extrude(20), at(0.5, (60, 30)).circle(1.7).extrude(20)
    plan = planned(block().cut(narrow).cut(deep))
    assert [o.name for o in plan.operations] == ["drill 3", "drill 3.4"]


def test_a_drill_that_comes_out_in_a_cross_bore_leaves_what_stands_of_the_bottom_there():
    """Its point of 140 degrees touches the inner edge of the two crescents, 1.732 mm from the axis."""
    across = cq.Workplane("YZ", origin=(0, 30, 5)).circle(2.0).extrude(X)
    solid = block().cut(at(4, (30, 30)).circle(3.0).extrude(20)).cut(across)
    wall = FacePredicate(name="inside", count=1, kinds=("cylinder",), center_min_mm=(25, 25, 6), center_max_mm=(35, 35, 11))
    plan = planned(solid, Drill(), inner=wall)
    tip = plan.operations[0].moves.end_mm[:, 2].min()
    assert 4 - 1.732 * np.tan(np.radians(20)) - 1e-3 < tip < 4 - 1.732 * np.tan(np.radians(20)) + 0.03


def test_auto_spots_where_the_shop_says_so_and_says_why_where_it_cannot():
    shop = ShopFile(practice=Practice(spot_holes=True))
    plate = block().cut(at(-1, (10, 10), (90, 20)).circle(3.0).extrude(20))
    spots, drill = planned(plate, shop=shop).operations
    assert (spots.tool.cutter.type, spots.facts["holes"], "not_spotted" in drill.facts) == ("spot_drill", 2, False)
    alone = SHOP.model_copy(update={"tools": tuple(t for t in SHOP.tools if t.cutter.type != "spot_drill")})
    drill, = planned(plate, shop=shop, library=alone).operations
    assert "has no spot drill" in drill.facts["not_spotted"]
    drill, = planned(plate, Drill(spot=False), shop=shop).operations
    assert drill.name == "drill"


def test_spots_go_before_the_drill_and_are_narrower_than_their_holes():
    solid = block().cut(at(-1, (20, 20), (60, 20)).circle(2.5).extrude(20))
    spots, drill = planned(solid, Drill(spot=True)).operations
    assert (spots.name, spots.tool.cutter.type, drill.name) == ("drill spots", "spot_drill", "drill") and spots.facts["holes"] == 2
    assert TOP - spots.moves.end_mm[:, 2].min() == pytest.approx(0.8 * 2.5)         # of 90 degrees: as deep as wide
    assert all(c.kind == "drill" for c in spots.cycles)
