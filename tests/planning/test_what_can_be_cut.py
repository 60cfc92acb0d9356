"""What cannot be done whole is done as far as it goes, and the rest is said: short tools, spirals, blanks near to the part."""

from pathlib import Path
from types import SimpleNamespace

import build123d as bd
import cadquery as cq
import numpy as np
import pytest
from known_tools import tool

import cuspline.posts
from cuspline.app import catalogue
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox, StockSolid
from cuspline.design.operations import Clearing
from cuspline.planning.clean_up import _touched, why_out_of_reach
from cuspline.planning.context import PlanningContext
from cuspline.planning.cutter_choice import choose_roughing, leftover_rows
from cuspline.planning.plan import plan_setup
from cuspline.planning.roughing import RoughingStage, cleared
from cuspline.planning.strategies.auto import Auto
from cuspline.planning.strategies.floor import Floor
from cuspline.planning.strategies.parallel import Parallel
from cuspline.planning.strategies.rest import Rest
from cuspline.planning.strategies.rough import Rough
from cuspline.planning.tool_depth import clear_tips_mm
from cuspline.program.program import Kind
from cuspline.shop.cutters import ToolLibrary, library_from_json
from cuspline.shop.machines import machine_from_toml
from cuspline.values.errors import PlanError

POSTS = Path(cuspline.posts.__file__).parent
MACHINE, SHOP = machine_from_toml(POSTS / "machines" / "mill_3axis.toml"), library_from_json(POSTS / "tools" / "tools.json")
FEW = ToolLibrary(tools=(*SHOP.of_type("ball")[::4], SHOP.of_type("flat", "bull_nose")[0]))
COARSE = Finish(scallop_mm=0.3, profile_tolerance_mm=0.03, gouge_mm=0.03)       # every step of planning, in little time
FINER = Finish(scallop_mm=0.08, profile_tolerance_mm=0.03, gouge_mm=0.03)


def part(solid, predicate, stock, *operations, finish=COARSE):
    return Design(name="part", description="a part", parameters=Parameters(), solid=solid, predicates=(predicate,),
                  material="aluminium_6061", stock=stock, finish=finish,
                  setups=(Setup(name="setup-1", faces=(predicate.name,), wcs_in_words="X0 Y0 in the middle, Z0 on the base",
                                operations=operations),))


def context_of(design):
    return PlanningContext(design, design.setups[0], MACHINE, SHOP)


@pytest.fixture(scope="module")
def beside_a_column():
    """A plate with a column that is higher than any tool sticks out; its upper face is wanted. By sections."""
    solid = cq.Workplane("XY").box(70, 20, 10, centered=(True, True, False)).union(
        cq.Workplane("XY").box(8, 20, 90, centered=(True, True, False)).translate((-31, 0, 0)))
    plate = FacePredicate(name="plate", count=1, kinds=("plane",), normal=(0, 0, 1), center_max_mm=(99, 99, 11),
                          center_min_mm=(-99, -99, 9))
    return part(solid, plate, StockBox(min_mm=(-35, -10, 0), max_mm=(35, 10, 90)), Auto())


@pytest.fixture(scope="module")
def plan_beside_a_column(beside_a_column):
    return plan_setup(beside_a_column, beside_a_column.setups[0], MACHINE, FEW)


def test_short_tools_cut_what_they_come_to(plan_beside_a_column):
    plan = plan_beside_a_column
    assert [o.name for o in plan.operations][0] == "rough" and plan.operations[-1].name.endswith("finish")
    assert 0.2 * plan.area_required_mm2 < plan.area_reached_mm2 < 0.9 * plan.area_required_mm2
    assert all("T5" in o.facts["instead_of"] and "short" in o.facts["instead_of"] for o in plan.operations)


def test_no_holder_of_theirs_touches_the_part(plan_beside_a_column):
    work = plan_beside_a_column.context
    for o in plan_beside_a_column.operations:
        ends = o.moves.end_mm[o.moves.kind != Kind.RAPID]
        assert (ends[:, 2] >= clear_tips_mm(o.tool, work.mesh, ends[:, :2], 0.0) - 1e-9).all()


def test_what_is_left_beside_the_column_says_the_stick_out_that_would_do(plan_beside_a_column):
    plan, place = plan_beside_a_column, np.array([[-20.0, 0.0, 10.0]])
    why = why_out_of_reach(plan.context, plan.operations, place, 0.0)
    assert "a stick-out of 8" in why and "--cutters" in why
    assert why_out_of_reach(plan.context, plan.operations, place * (1, 1, 1.5), 0.0) == why       # a place off the faces: its foot


def test_clearing_needs_a_flat_cutter_in_the_library():
    with pytest.raises(PlanError, match="--cutters"):
        choose_roughing((), 0.3)


@pytest.fixture(scope="module")
def drafted():
    """A drafted pocket with rounded corners hardly wider than the smallest ball."""
    with bd.BuildPart() as made:
        bd.Box(40, 30, 20, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN))
        with bd.BuildSketch(bd.Plane.XY.offset(20)):
            bd.RectangleRounded(26, 18, 5)
        bd.extrude(amount=-8, taper=8, mode=bd.Mode.SUBTRACT)
    walls = FacePredicate(name="walls", at_least=1, center_min_mm=(-18, -13, 12.1), center_max_mm=(18, 13, 19.9))
    return part(made.part, walls, StockBox(min_mm=(-20, -15, 0), max_mm=(20, 15, 20)), Auto(strategy="parallel"),
                finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.01))


def test_on_a_steep_wall_a_ball_touches_what_it_is_micrometres_off(drafted):
    """Dropped beside a wall of 8 degrees' draft, 0.4 µm off it is 2.6 µm higher."""
    work = context_of(drafted)
    foot = work.closest.closest_points(np.array([[12.117, 4.068, 13.719]]))
    small, large = work.library.of_type("ball")[-1], work.library.of_type("ball")[0]
    assert _touched(work, small, foot, 0.06).all() and not _touched(work, large, foot, 0.06).any()


@pytest.fixture(scope="module")
def stepped():
    """A block with a step across, its upright wall and the sharp foot of it."""
    solid = cq.Workplane("XY").box(20, 12, 9, centered=(True, True, False)).cut(
        cq.Workplane("XY").box(10, 12, 6, centered=(False, True, False)).translate((0, 0, 3)))
    both = FacePredicate(name="wall and floor", count=2, kinds=("plane",), center_min_mm=(-0.1, -1, 2.9), center_max_mm=(9, 1, 6.1))
    return part(solid, both, StockBox(min_mm=(-10, -6, 0), max_mm=(10, 6, 9.2)), Auto(strategy="parallel"))


def test_a_ball_touches_an_upright_wall_down_to_its_own_radius(stepped):
    work = context_of(stepped)
    small = work.library.of_type("ball")[-1]
    foot = work.closest.closest_points(np.array([[0.0, 0.0, 4.0], [0.0, 0.0, 5.001], [0.0, 0.0, 5.5]]))
    assert _touched(work, small, foot, 0.1).tolist() == [False, True, True]


def test_a_ball_is_of_use_where_it_is_held_off_by_less_than_half_the_cusp():
    """Beside the line of a valley of two planes 0.1 rad steep a ball of 2 mm is held off by sin 0.2 of the way that is missing."""
    rise = 8 * np.tan(0.1)
    valley = cq.Workplane("XZ").polyline([(-8, -6), (8, -6), (8, rise), (0, 0), (-8, rise)]).close().extrude(10)
    planes = FacePredicate(name="planes", count=2, normal=(0, 0, 1), normal_within_deg=30)
    fine = Finish(scallop_mm=0.01, profile_tolerance_mm=0.0024, gouge_mm=0.003)
    work = context_of(part(valley, planes, StockBox(min_mm=(-8, -10, -6), max_mm=(8, 0, 1)), finish=fine))
    short = np.array([0.015, 0.04])         # held off by 3 and by 8 um
    along = 2.0 * np.tan(0.1) - short
    places = np.column_stack([along * np.cos(0.1), np.full(2, -5.0), along * np.sin(0.1)])
    assert _touched(work, SHOP.number(10), work.closest.closest_points(places), 0.1).tolist() == [True, False]


def test_a_pass_runs_along_the_foot_of_a_wall(stepped):
    plan = plan_setup(stepped, stepped.setups[0], MACHINE, FEW)
    finish = plan.operations[-1]
    moves, radius = finish.moves, finish.tool.cutter.radius_mm
    there = lambda at: (np.abs(at[:, ::2] - (radius, 3.0)) <= COARSE.profile_tolerance_mm).all(axis=1)
    along = there(moves.end_mm[:-1]) & there(moves.end_mm[1:]) & (moves.kind[1:] != Kind.RAPID)
    assert np.abs(np.diff(moves.end_mm[:, 1]))[along].sum() > 11.9


def test_where_no_spiral_goes_the_passes_follow_the_borders():
    """A ring has two borders."""
    ring = cq.Workplane("XY").box(30, 30, 8, centered=(True, True, False)).cut(
        cq.Workplane("XY").circle(8).extrude(3).translate((0, 0, 5)))
    top = FacePredicate(name="top", count=1, kinds=("plane",), normal=(0, 0, 1), center_min_mm=(-99, -99, 7.9),
                        center_max_mm=(99, 99, 8.1), area_min_mm2=300)
    design = part(ring, top, StockBox(min_mm=(-15, -15, 0), max_mm=(15, 15, 8.2)), Auto(strategy="spiral"))
    finish = plan_setup(design, design.setups[0], MACHINE, FEW).operations[-1]
    assert finish.facts["strategy"] == "boundary" and "2 borders" in finish.facts["instead_of"]


def reached_by(strategy, *kinds):
    """(strategy of the finish, why another was to be) of a groove along x with round ends, by sections or none stated."""
    groove = cq.Workplane("XY").box(40, 20, 10, centered=(True, True, False)).cut(
        cq.Workplane("XY").slot2D(24, 10).extrude(4).translate((0, 0, 6)))
    faces = FacePredicate(name="groove", at_least=1, kinds=kinds, center_min_mm=(-15, -6, 5.9), center_max_mm=(15, 6, 9.9))
    design = part(groove, faces, StockBox(min_mm=(-20, -10, 0), max_mm=(20, 10, 10.2)), Auto(strategy=strategy))
    facts = plan_setup(design, design.setups[0], MACHINE, FEW).operations[-1].facts
    return facts.get("strategy", "sections"), facts.get("instead_of", "")


def test_sections_are_chosen_for_swept_faces_alone():
    name, why = reached_by(None, "plane", "cylinder")
    assert name == "parallel" and "pocket: its walls are rounded by 5.000 mm, and no flat cutter is smaller" in why
    assert why.startswith("slot: no flat cutter makes the slot (T1 is wider than 10.000 mm)")
    name, why = reached_by("sections", "plane", "cylinder")
    assert name == "parallel" and why.startswith("sections: faces stand along the section plane ZX")


def near_net(*operations):
    """A block that has hardly 0.1 mm on it."""
    block = cq.Workplane("XY").box(20, 20, 8, centered=(True, True, False))
    top = FacePredicate(name="top", count=1, kinds=("plane",), normal=(0, 0, 1))
    design = part(block, top, StockBox(min_mm=(-10, -10, 0), max_mm=(10, 10, 8.1)), *operations)
    return plan_setup(design, design.setups[0], MACHINE, FEW)


def test_level_ground_alone_is_a_flat_cutters():
    finish = near_net().operations[-1]
    assert finish.name == "floor" and finish.tool.cutter.type == "flat" and "instead_of" not in finish.facts


def test_a_blank_near_to_the_part_needs_no_roughing():
    plan = near_net(Rough(), Parallel())
    assert [o.name for o in plan.operations] == ["parallel"] and plan.idle == ()


@pytest.mark.parametrize("skin, is_rough", [(0.34, False), (0.6, True)])
def test_clearing_whose_rounded_corner_meets_nothing_is_left_out(skin, is_rough):
    block = cq.Workplane("XY").box(20, 20, 6).translate((0, 0, -3))
    hollowed = lambda radius: block.cut(cq.Workplane("XY").sphere(radius).translate((0, 0, 15.5)))
    dish = FacePredicate(name="dish", count=1, kinds=("sphere",))
    work = context_of(part(hollowed(18.5), dish, StockSolid(solid=hollowed(18.5 - skin).val().wrapped)))
    bull = SHOP.number(4)
    made, _, _ = cleared(work, RoughingStage(name="rough", allowance_mm=0.3), bull, (), work.stock_mm,
                         leftover_rows(work.samples), Clearing())
    assert bull.cutter.corner_radius_mm == 1.0 and (made is not None) == is_rough


def test_roughing_after_the_finish_is_idle():
    assert [f.operation for f in near_net(Parallel(), Rough()).idle] == ["rough"]


def test_a_rest_operation_whose_tool_nobody_named_may_find_nothing():
    assert near_net(Parallel(), Rest()).idle == ()
    assert [f.operation for f in near_net(Parallel(), Rest(tool="ball")).idle] == ["rest"]


@pytest.mark.parametrize("deep_mm, names", [(4.0, ["rest rough", "parallel"]), (1.0, ["parallel"])])
def test_listed_passes_are_led_by_clearing_where_their_ball_would_cut_too_deep_a_slot(deep_mm, names):
    block = cq.Workplane("XY").box(16, 12, 8).translate((0, 0, -4))
    groove = cq.Workplane("YZ").center(0, 2.4 - deep_mm).circle(2.4).extrude(8, both=True)
    open_up = cq.Workplane("XY").box(16, 4.8, 8).translate((0, 0, 6.4 - deep_mm))
    bottom = FacePredicate(name="bottom", at_least=1, kinds=("cylinder",))
    design = part(block.cut(groove).cut(open_up), bottom, StockBox(min_mm=(-8, -6, -8), max_mm=(8, 6, 0)), Parallel())
    plan = plan_setup(design, design.setups[0], MACHINE, SHOP)
    assert [o.name for o in plan.operations] == names
    assert {o.tool.number for o in plan.operations} == {10}


@pytest.mark.parametrize("deep_mm, names", [(4.0, ["rest rough", "floor"]), (0.5, ["floor"])])
def test_a_floor_that_nobody_cleared_is_cleared_and_entered_on_ramps(deep_mm, names):
    pocket = cq.Workplane("XY").box(24, 16, deep_mm, centered=(True, True, False)).edges("|Z").fillet(6).translate((0, 0, -deep_mm))
    design = part(cq.Workplane("XY").box(30, 22, 8).translate((0, 0, -4)).cut(pocket),
                  FacePredicate(name="floor", count=1, kinds=("plane",), normal=(0, 0, 1), center_max_mm=(1, 1, -0.1),
                                center_min_mm=(-1, -1, -7)),
                  StockBox(min_mm=(-15, -11, -8), max_mm=(15, 11, 0)), Floor(tool="bull 10 r1"))
    *_, floor = plan = plan_setup(design, design.setups[0], MACHINE, SHOP).operations
    assert [o.name for o in plan] == names
    down = floor.moves.starts_mm[:, 2] - floor.moves.end_mm[:, 2]
    way = np.linalg.norm((floor.moves.end_mm - floor.moves.starts_mm)[:, :2], axis=1)
    entering = (down > 1e-9) & (floor.moves.end_mm[:, 2] < -deep_mm + 0.3)
    assert entering.any() and (np.arctan2(down[entering], way[entering]) < floor.tool.cutter.steepest_rad).all()


def test_a_groove_that_no_level_enters_is_semi_finished_in_layers():
    block = cq.Workplane("XY").box(20, 12, 8).translate((0, 0, -4))
    groove = FacePredicate(name="groove", at_least=1, kinds=("cylinder",))
    design = part(block.cut(cq.Workplane("YZ").circle(4.5).extrude(10, both=True)), groove,
                  StockBox(min_mm=(-10, -6, -8), max_mm=(10, 6, 0)), Auto(strategy="parallel"), finish=FINER)
    *_, above, semi, finish = plan_setup(design, design.setups[0], MACHINE, SHOP).operations
    lift = above.moves.end_mm - semi.moves.end_mm
    assert (semi.name, finish.name) == ("semi-finish", "finish") and semi.tool.cutter.deepest_slot_mm == 4.0
    np.testing.assert_allclose(lift, np.tile((0, 0, above.facts["lifted_mm"]), (len(lift), 1)), atol=6e-4)     # rounded there
    assert 1.5 < above.facts["lifted_mm"] < 3.2


def test_a_fillet_too_tight_for_every_ball_keeps_no_listed_operation_from_the_rest():
    hole = cq.Workplane("XY").box(14, 12, 6).edges("|Z").fillet(3).faces("<Z").edges().fillet(1.0).translate((0, 0, 1))
    floor = FacePredicate(name="inside", at_least=2, normal=(0, 0, 1), normal_within_deg=89, center_max_mm=(9, 9, -1e-3))
    design = part(cq.Workplane("XY").box(22, 20, 8).translate((0, 0, -4)).cut(hole), floor,
                  StockBox(min_mm=(-11, -10, -8), max_mm=(11, 10, 0)), Rough(), Parallel())
    plan = plan_setup(design, design.setups[0], MACHINE, SHOP)
    assert plan.operations[-1].tool.cutter.diameter_mm == 4.0
    assert 0.3 * plan.area_required_mm2 < plan.area_reached_mm2 < 0.95 * plan.area_required_mm2


def test_a_short_tool_is_the_last_choice():
    at = lambda number, missing, leaves: SimpleNamespace(tool=tool("flat", 10, number=number), missing_stick_out_mm=missing,
                                                         leaves_mm=leaves, candidate=lambda best: best)
    assert choose_roughing((at(1, 5.0, 0.1), at(2, 0.0, 3.0)), 0.3)[0].tool.number == 2
    assert choose_roughing((at(1, 5.0, 0.1), at(2, 9.0, 3.0)), 0.3)[0].tool.number == 1


def test_a_hole_hardly_wider_than_its_finishing_ball_is_cleared_by_a_smaller_one():
    """7 mm, for which the library has no drill, and a ball of 6: no helix has room, and it would go down into the whole stock."""
    plate = cq.Workplane().box(22, 20, 10).cut(cq.Workplane().circle(3.5).extrude(20, both=True))
    upper = FacePredicate(name="cut", at_least=2, normal=(0, 0, 1), normal_within_deg=91.0, center_min_mm=(-10.9, -9.9, -9),
                          center_max_mm=(10.9, 9.9, 9))
    design = part(plate, upper, StockBox(min_mm=(-11, -10, -5), max_mm=(11, 10, 6)), Auto(strategy="parallel"))
    made = plan_setup(design, design.setups[0], MACHINE, SHOP).operations
    diameter = {o.name: o.tool.cutter.diameter_mm for o in made}
    assert diameter["finish"] == 6.0 and diameter["rest rough"] == 4.0


def test_a_gap_in_which_no_level_has_room_is_entered_layer_by_layer():
    """A groove hardly wider than the smallest ball, 1.8 mm under the top, which a larger one finishes."""
    plate = cq.Workplane("XY").box(20, 16, 6).translate((0, 0, -3))
    groove = cq.Workplane("XY").box(30, 2.4, 1.8).translate((0, 0, -0.9))
    upper = FacePredicate(name="upper", at_least=2, normal=(0, 0, 1), normal_within_deg=91, center_min_mm=(-11, -7.9, -5),
                          center_max_mm=(11, 7.9, 1))
    stock = StockBox(min_mm=(-10, -8, -6), max_mm=(10, 8, 0.3))
    design = part(plate.cut(groove), upper, stock, Auto(strategy="parallel"), finish=FINER)
    made = plan_setup(design, design.setups[0], MACHINE, catalogue.find_library("small_balls")).operations
    *above, rest = [o for o in made if o.tool.cutter.diameter_mm == 2.0]
    lifts = [o.facts["lifted_mm"] for o in above]
    limit = rest.tool.cutter.deepest_slot_mm
    assert above and [o.name for o in above] == [f"{rest.name} {mm:.1f} mm above" for mm in lifts]
    assert (-np.diff([2.1, *lifts, 0.0]) <= limit + 1e-3).all() and (rest.tool.cutter.diameter_mm, limit) == (2.0, 1.0)


def test_a_gap_beside_wide_floors_is_entered_layer_by_layer():
    """Between the legs of a raised U: 2.6 mm wide, half a hundredth of the level ground, no room for a flat cutter of 3 mm."""
    plate = cq.Workplane("XY").box(44, 30, 8).translate((0, 0, -4))
    letter = cq.Workplane("XY").box(6.6, 8, 1.6, centered=(True, True, False)).cut(
        cq.Workplane("XY").box(2.6, 7, 4).translate((0, 0.5, 0)))
    upper = FacePredicate(name="upper", at_least=2, normal=(0, 0, 1), normal_within_deg=91, center_min_mm=(-21.9, -14.9, -7),
                          center_max_mm=(21.9, 14.9, 2))
    stock = StockBox(min_mm=(-22, -15, -8), max_mm=(22, 15, 2))
    design = part(plate.union(letter), upper, stock, Auto(), finish=FINER)
    made = plan_setup(design, design.setups[0], MACHINE, catalogue.find_library("small_balls")).operations
    rest = next(o for o in made if o.name == "rest finish")
    above = [o for o in made if o.name.startswith("rest finish ") and o.name.endswith(" above")]
    lifts, limit = [1.6, *(o.facts["lifted_mm"] for o in above), 0.0], rest.tool.cutter.deepest_slot_mm
    assert above and made.index(above[-1]) == made.index(rest) - 1 and (-np.diff(lifts) <= limit + 1e-3).all()


def test_passes_over_tops_do_not_sink_into_a_gap_hardly_wider_than_the_cutter():
    """Two blocks 10.2 mm apart, their tops finished by a flat cutter of 10 mm in passes across: nothing has cleared the gap."""
    block = lambda x: cq.Workplane("XY").box(12, 16, 5, centered=(True, True, False)).translate((x, 0, 0))
    solid = cq.Workplane("XY").box(40, 20, 8).translate((0, 0, -4)).union(block(-11.1)).union(block(11.1))
    tops = FacePredicate(name="tops", count=2, kinds=("plane",), normal=(0, 0, 1), center_min_mm=(-20, -10, 4.9),
                         center_max_mm=(20, 10, 5.1))
    design = part(solid, tops, StockBox(min_mm=(-20, -10, -8), max_mm=(20, 10, 5.5)), Floor(tool="flat 10"))
    floor = plan_setup(design, design.setups[0], MACHINE, SHOP).operations[-1]
    places = floor.moves.end_mm
    assert floor.name == "floor" and places[:, 2].min() == pytest.approx(5.0)
    cut = floor.moves.kind != Kind.RAPID
    crossing = cut & (np.sign(places[:, 0]) != np.sign(floor.moves.starts_mm[:, 0])) & (places[:, 2] < 5.0 + 1e-9)
    assert crossing.any()
