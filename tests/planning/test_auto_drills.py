"""What Auto makes of holes and level floors: drills, and a flat cutter where it is faster than a ball."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.app import catalogue
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.auto import Auto

MACHINE, SHOP = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)
X, Y, TOP, FLOOR = 110.0, 80.0, 12.0, 6.0


def planned(solid, operation=Auto(), **finish):
    """SetupPlan of a block's inner faces."""
    inner = FacePredicate(name="inside", at_least=1, center_min_mm=(0.5, 0.5, 0.3), center_max_mm=(X - 0.5, Y - 0.5, TOP - 0.3))
    design = Design(name="tray", description="tray", parameters=Parameters(), solid=solid.val(), predicates=(inner,),
                    material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, TOP)),
                    finish=Finish(**{"scallop_mm": 0.01, "profile_tolerance_mm": 0.003, "gouge_mm": 0.004, **finish}),
                    setups=(Setup(name="setup-1", faces=("inside",), operations=(operation,), wcs_in_words="corner"),))
    return plan_setup(design, design.setups[0], MACHINE, SHOP)


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


def test_a_hole_that_no_drill_makes_is_bored_by_a_flat_cutter():
    odd = block().cut(at(-1, (20, 20)).circle(3.0).extrude(20)).cut(at(-1, (70, 40)).circle(9.3).extrude(20))
    drill, *others, walls = planned(odd, scallop_mm=0.1, profile_tolerance_mm=0.02).operations
    assert drill.name == "drill" and walls.name == "waterline" and others
    away = np.hypot(*(walls.moves.end_mm[walls.moves.end_mm[:, 2] < 6.0, :2] - (70, 40)).T)
    assert away.max() == pytest.approx(9.3 - walls.tool.cutter.radius_mm, abs=0.03)


@pytest.fixture(scope="module")
def tray_plan():
    rim = at(-1, (6, 6), (X - 6, Y - 6)).circle(2.5).extrude(20)
    return planned(tray().cut(rim).cut(at(-1, (X / 2, Y / 2)).circle(4.0).extrude(20)))


def test_a_tray_is_drilled_and_finished_by_a_flat_cutter_in_a_fifth_of_a_balls_way(tray_plan):
    names = [o.name for o in tray_plan.operations]
    assert set(names[:2]) == {"drill 5", "drill 8"} and names[-1] == "floor"
    floor = tray_plan.operations[-1]
    assert floor.tool.cutter.type == "flat" and not any(o.tool.cutter.type == "ball" for o in tray_plan.operations)
    ball_mm = (X - 24) * (Y - 24) / 0.7         # passes of the largest ball, a step of 0.7 mm apart, over the floor alone
    assert floor.facts["length_mm"] < ball_mm / 5
    assert tray_plan.area_reached_mm2 == pytest.approx(tray_plan.area_required_mm2, rel=5e-3)


def test_the_floor_is_cut_at_its_height_and_round_its_walls(tray_plan):
    floor = tray_plan.operations[-1]
    low = floor.moves.end_mm[floor.moves.end_mm[:, 2] < FLOOR + 0.01]
    assert low[:, 2].min() >= FLOOR - 1e-6
    reach = 12.0 + floor.tool.cutter.radius_mm
    np.testing.assert_allclose([low[:, 0].min(), low[:, 0].max()], [reach, X - reach], atol=2e-3)


def test_a_stated_strategy_is_kept():
    names = [o.name for o in planned(tray(), Auto(strategy="parallel"), scallop_mm=0.3, profile_tolerance_mm=0.02).operations]
    assert "floor" not in names and "finish" in names
