"""What an operation leaves to others because it is steep: neither cut nor counted as reached."""

import math

import cadquery as cq
import numpy as np
import pytest

from cuspline.app.catalogue import find_library, find_machine
from cuspline.app.judge import post_module, posted_positions
from cuspline.design import Design, Finish, Parameters, Setup, StockBox
from cuspline.planning.plan import clamping_program, plan_setup
from cuspline.planning.strategies.parallel import Parallel
from cuspline.planning.strategies.rest import Rest
from cuspline.planning.strategies.rough import Rough
from cuspline.planning.strategies.waterline import Waterline
from cuspline.program.program import Kind
from cuspline.shop.cutters import simulated
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece

RADIUS_MM, LENGTH_MM, LIMIT_DEG = 8.0, 6.0, 45.0


def ridge(**steep):
    """Half a cylinder along X that lies on a plate, planned with a ball of 8 mm."""
    design = ridge_of(Parallel(tool="ball 8", angle_deg=0, **steep))
    return plan_setup(design, design.setups[0], find_machine(design.machine), find_library(None))


def ridge_of(finishing, *more):
    """Design of it, and more setups."""
    body = cq.Workplane("YZ").circle(RADIUS_MM).extrude(LENGTH_MM).translate((-LENGTH_MM / 2, 0, 0))
    body = body.intersect(cq.Workplane().box(40, 40, RADIUS_MM, centered=(True, True, False)))
    design = Design(name="ridge", description="", parameters=Parameters(), solid=body.val(), material="aluminium_6061",
                    stock=StockBox(min_mm=(-4, -10, 0), max_mm=(4, 10, 9)), predicates={"ridge": body.faces("%CYLINDER")},
                    finish=Finish(scallop_mm=0.1, profile_tolerance_mm=0.01, gouge_mm=0.01),
                    setups=(Setup(name="one", faces=("ridge",), wcs_in_words="middle",
                                  operations=(Rough(tool="flat 10"), finishing)), *more))
    return design


@pytest.fixture(scope="module")
def gentle():
    return ridge(steep_deg=LIMIT_DEG, leave_steep=True)


def test_nothing_steeper_is_cut(gentle):
    moves, facts = gentle.operations[-1].moves, gentle.operations[-1].facts
    cuts = moves.kind != Kind.RAPID
    middle = moves.end_mm[cuts] + (0, 0, 4.0)           # of the ball; the normal is its way from the ridge's axis
    on_ridge = np.abs(np.hypot(middle[:, 1], middle[:, 2]) - RADIUS_MM - 4.0) < 0.02
    steep = np.degrees(np.arctan2(np.abs(middle[on_ridge, 1]), middle[on_ridge, 2]))
    assert on_ridge.sum() > 30 and facts["wall_passes"] == 0
    assert LIMIT_DEG - 3.0 < steep.max() < LIMIT_DEG + 2.0


def test_it_does_not_count_as_reached(gentle):
    account = gentle.accounts[-1].as_dict()
    share = account["area_reached_mm2"] / account["area_wanted_mm2"]
    assert share == pytest.approx(LIMIT_DEG / 90, abs=0.04)
    assert "steeper than 45 degrees" in account["why"]


def test_otherwise_waterlines_go_round_it():
    whole = ridge(steep_deg=LIMIT_DEG)
    account = whole.accounts[-1].as_dict()
    assert whole.operations[-1].facts["wall_passes"] > 0
    assert account["area_reached_mm2"] > 0.9 * account["area_wanted_mm2"] and math.isfinite(account["area_left_mm2"])


def test_waterlines_are_for_what_is_steep():
    with pytest.raises(ValueError, match="leave leave_steep out"):
        Waterline(leave_steep=True)


def test_from_another_direction_only_what_is_not_done_is_cut(gentle):
    """Leaning by 60 degrees a rest operation begins where the first setup ended: 45 degrees from its Z, and a little before."""
    lean = math.radians(60)
    other = Setup(name="two", faces=("ridge",), wcs_in_words="middle", wcs_z=(0, math.sin(lean), math.cos(lean)),
                  operations=(Rest(tool="ball 8", angle_deg=0, steep_deg=LIMIT_DEG, leave_steep=True),))
    design = ridge_of(Parallel(tool="ball 8", angle_deg=0, steep_deg=LIMIT_DEG, leave_steep=True), other)
    machine = find_machine(design.machine)
    posted = posted_positions(post_module(machine).post(clamping_program([gentle], (), "one"), machine).texts, [gentle.setup],
                              machine, {o.tool.number: o.tool for o in gentle.operations})[-1]
    tools = simulated({o.tool.number: o.tool for o in gentle.operations})
    before = Workpiece(blank=design.stock.shape).after(gentle.setup.frame, swept_paths(posted, tools))
    angles = {}
    for name, piece in (("after the first", before), ("alone", None)):
        (made,) = plan_setup(design, other, machine, find_library(None), piece).operations
        middle = other.turn.out(made.moves.end_mm + (0, 0, 4.0))
        on_ridge = (made.moves.kind != Kind.RAPID) & (np.abs(np.hypot(middle[:, 1], middle[:, 2]) - RADIUS_MM - 4.0) < 0.02)
        angles[name] = np.degrees(np.arctan2(middle[on_ridge, 1], middle[on_ridge, 2]))
    assert angles["alone"].min() == pytest.approx(60 - LIMIT_DEG, abs=3.0)
    assert LIMIT_DEG - 12.0 < angles["after the first"].min() < LIMIT_DEG and angles["after the first"].max() > 80.0
