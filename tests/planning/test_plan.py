"""A whole plan of a small block: the choices in it, and that it comes out the same twice."""

from pathlib import Path

import cadquery as cq
import numpy as np
import pytest

import cuspline.posts
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.designs.z_profile import ZProfile, design
from cuspline.kernel import brep
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.auto import Auto
from cuspline.program.program import Kind
from cuspline.shop.cutters import ToolLibrary, library_from_json
from cuspline.shop.machines import machine_from_toml
from cuspline.values.errors import CutterDoesNotFit

POSTS = Path(cuspline.posts.__file__).parent
MACHINE, SHOP = machine_from_toml(POSTS / "machines" / "mill_3axis.toml"), library_from_json(POSTS / "tools" / "tools.json")
# choosing among all roughing cutters takes most of the time of a small part
LIBRARY = ToolLibrary(tools=(*SHOP.of_type("ball"), SHOP.of_type("flat", "bull_nose")[0]))


@pytest.fixture(scope="module")
def small():
    """A narrow block with a coarse finish: every step of planning, in little time."""
    return design(ZProfile(width_mm=10, scallop_mm=0.05))


@pytest.fixture(scope="module")
def plan(small):
    return plan_setup(small, small.setups[0], MACHINE, LIBRARY)


def named(plan, name):
    return next(o for o in plan.operations if o.name == name)


def test_two_plans_have_identical_moves(small, plan):
    again = plan_setup(small, small.setups[0], MACHINE, LIBRARY)
    assert [o.name for o in plan.operations] == [o.name for o in again.operations]
    for a, b in zip(plan.operations, again.operations):
        assert (a.tool, a.rpm, a.facts) == (b.tool, b.rpm, b.facts)
        for column in ("start_mm", "kind", "end_mm", "center_mm", "plane", "feed_mm_per_min"):
            np.testing.assert_array_equal(getattr(a.moves, column), getattr(b.moves, column))


def test_the_tightest_hollow_is_the_profiles_concave_arc(plan):
    assert plan.hollow.radius_mm == pytest.approx(6.0, abs=1e-6)


def test_the_finishing_ball_is_the_largest_that_fits(plan):
    finish = named(plan, "finish")
    chosen = [c for c in finish.facts["candidates"] if c["chosen"]]
    assert [c["tool"] for c in chosen] == [finish.tool.number]
    assert finish.tool.cutter.radius_mm <= 0.9 * plan.hollow.radius_mm
    larger = [c for c in finish.facts["candidates"] if c["diameter_mm"] > finish.tool.cutter.diameter_mm]
    assert larger and all(not c["chosen"] and "exceeds" in c["reason"] for c in larger)


def test_the_foot_of_the_wall_is_listed_as_an_inner_edge(plan):
    assert any(e.opening_deg == pytest.approx(90) for e in plan.inner_edges)


def test_roughing_comes_first_and_every_operation_starts_and_ends_at_clearance(plan):
    assert plan.operations[0].name == "rough"
    for o in plan.operations:
        assert o.moves.start_mm[2] >= plan.clearance_z_mm - 1e-9
        assert o.moves.end_mm[-1, 2] >= plan.clearance_z_mm - 1e-9


def test_no_feed_exceeds_the_machine_and_no_cut_is_without_one(plan):
    for o in plan.operations:
        feeds = o.moves.feed_mm_per_min[o.moves.kind != Kind.RAPID]
        assert 0 < feeds.min() and feeds.max() <= MACHINE.max_feed_mm_per_min


def test_planes_are_as_far_apart_as_the_cusp_allows(plan):
    # the profile is straight across: docs/formulas.md 5 for a flat, with what the path's own tolerance leaves of the cusp
    finish = named(plan, "finish")
    r, h = finish.tool.cutter.radius_mm, finish.facts["ridge_for_step_mm"]
    assert h == pytest.approx(0.05 - 0.0024, abs=2e-4) and h < 0.05 - 0.0023
    widest = 2 * np.sqrt(h * (2 * r - h))
    assert 0.9 * widest < finish.facts["stepover_mm"] <= widest + 1e-6


def test_a_library_without_a_fitting_ball_is_refused_with_every_candidate(small):
    big = ToolLibrary(tools=tuple(t for t in LIBRARY.tools if t.cutter.type != "ball" or t.cutter.diameter_mm > 11))
    with pytest.raises(CutterDoesNotFit, match=r"no ball of the library.*T\d+") as error:
        plan_setup(small, small.setups[0], MACHINE, big)
    assert all(f"T{t.number}" in str(error.value) for t in big.of_type("ball")) and "leave `strategy` out" in str(error.value)


def test_a_wide_step_does_not_let_the_ball_fall_over_an_edge():
    """The stock in a bore that is made later: half the radius over the rim a ball lies 0.134 of its radius lower."""
    plate = cq.Workplane().box(30, 20, 5, centered=False).faces(">Z").workplane(origin=(15, 10, 5)).hole(10)
    setup = Setup(name="setup-1", wcs_in_words="corner", faces=("top",), operations=(Auto(strategy="parallel"),))
    wide = Design(name="plate", description="plate", parameters=Parameters(), solid=brep.the_solid(plate),
                  predicates=(FacePredicate(name="top", count=1, kinds=("plane",), normal=(0, 0, 1)),),
                  material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(30, 20, 6)), setups=(setup,),
                  finish=Finish(scallop_mm=0.3, profile_tolerance_mm=0.03, gouge_mm=0.03))
    library = ToolLibrary(tools=(*(t for t in SHOP.of_type("ball") if t.cutter.diameter_mm == 6), LIBRARY.tools[-1]))
    finish = named(plan_setup(wide, setup, MACHINE, library), "finish")
    cut = finish.moves.end_mm[finish.moves.kind != Kind.RAPID]
    assert finish.facts["stepover_mm"] > 2.4 and len(cut) > 20
    beyond = 1.5 + finish.facts["grid_mm"]      # up to a pitch more
    assert cut[:, 2].min() >= 5.0 - (3.0 - np.sqrt(9.0 - beyond**2)) - 0.03
