"""Planning a vane as its controller lays it out, and what such a plan refuses."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from known_vanes import wavy_tip

from cuspline.app.catalogue import find_design, find_library, find_machine
from cuspline.design import Finish, Setup
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.transverse_arcs import TransverseArcs
from cuspline.posts.writers.linuxcnc import post
from cuspline.program.program import Kind
from cuspline.toolpaths.vane.circular_tip import CircularTip
from cuspline.values.errors import DesignError, PlanError


def setup_of(**changes):
    return Setup(name="setup-1", wcs_in_words="", faces=("tip",), **changes)


def work(tip=None, setup=None, stock_half_mm=9.0, gouge_mm=0.0025):
    """As much of a PlanningContext as is asked before anything is planned."""
    finish = Finish(scallop_mm=0.005, profile_tolerance_mm=0.001, gouge_mm=gouge_mm)
    return SimpleNamespace(
        design=SimpleNamespace(name="vane", guide_of=lambda kind: tip), setup=setup or setup_of(), finish=finish,
        operation=TransverseArcs(),
        box=(np.array([0.0, -9.0, 0.0]), np.array([40.0, 9.0, 47.0])),
        stock_min_mm=np.array([0.0, -stock_half_mm, 0.0]), stock_max_mm=np.array([40.0, stock_half_mm, 48.0]))


@pytest.mark.parametrize("asked, said", [
    ({}, r"vane says none \(a CircularTip among Design.guides\): choose another strategy"),
    ({"tip": wavy_tip(), "setup": setup_of(wcs_x=(0, 1, 0))}, r"wcs_x is \(0.0, 1.0, 0.0\).*make them \(1, 0, 0\)"),
    ({"tip": wavy_tip(), "stock_half_mm": 12.0}, "stock reaches 12.000 mm: let it be at most 2 mm wider")])
def test_what_is_no_such_vane_is_refused(asked, said):
    with pytest.raises(PlanError, match=said):
        TransverseArcs().plan(work(**asked))


def test_sections_follow_only_where_the_arcs_leave_more_than_the_finish():
    """From gentle cells into steeper ones: the map's limit is crossed in some of them."""
    design = find_design("rfq_vane").design(["strategy=transverse_arcs", "rest=sections", "from_mm=440", "to_mm=480", "ball_mm=6"])
    made = plan_setup(design, design.setups[0], find_machine(design.machine), find_library(None)).operations
    assert [o.name for o in made][-2:] == ["finish", "rest finish"]
    finish, rest = made[-2:]
    chart, cutting = finish.facts["cut_map"], rest.moves.kind != Kind.RAPID
    over = np.array([max((d for d in row if d is not None), default=0.0) for row in chart["deviation_mm"]]) > 0.001
    x, planes = np.array(chart["x_mm"]), np.unique(rest.moves.end_mm[rest.moves.kind >= Kind.ARC_CW, 0])
    assert 0.02 < over.mean() < 0.9 and cutting.any()
    near = np.abs(planes[:, None] - x[over]).min(axis=1)        # a row's crest lies within the ball's lean of its plane
    assert near.max() < finish.facts["stepover_mm"] + 0.6
    gentle = find_design("rfq_vane").design(["strategy=transverse_arcs", "rest=sections", "from_mm=150", "to_mm=154"])
    made = plan_setup(gentle, gentle.setups[0], find_machine(gentle.machine), find_library(None)).operations
    assert made[-1].name == "finish"


def test_a_vane_is_roughed_both_ways_and_finished_climb_with_one_register():
    design = find_design("rfq_vane").design(["strategy=transverse_arcs", "from_mm=700", "to_mm=708", "ball_mm=6"])
    machine = find_machine(design.machine)
    plan = plan_setup(design, design.setups[0], machine, find_library(None))
    rough, finish = plan.operations[-2:]
    assert [o.name for o in plan.operations][-2:] == ["rough passes", "finish"]
    assert rough.passes.register("r").value == pytest.approx(3.254) and finish.passes.register("r").value == 3.0
    assert {Kind.ARC_CW, Kind.ARC_CCW} <= set(rough.moves.kind) and Kind.ARC_CCW not in set(finish.moves.kind)
    # the cusp asked for is the chosen interval's: 2 sqrt(2 r h) on a flat, a little less or more on slopes and hollows
    assert finish.facts["stepover_mm"] == pytest.approx(2 * np.sqrt(2 * 3.0 * 0.004), rel=0.1)
    assert 0 < finish.facts["cut_map"]["general"]["highest_mm"] < 0.03
    program = plan.program((), "vane")
    shift = program.operations[-1].moves.end_mm - finish.moves.end_mm
    assert np.abs(shift - (-700.0, 0.0, 0.0)).max() < 1e-9            # the zero is at the vane's end
    assert np.abs(program.operations[-1].passes.moves().end_mm - program.operations[-1].moves.end_mm).max() < 1e-9
    assert post(program, machine).largest_rounding_mm < 0.002


def test_a_design_hands_a_guide_to_the_strategy_that_asks_for_it():
    design = find_design("rfq_vane").design(["from_mm=150", "to_mm=152"])
    tip, = design.guides
    assert design.guide_of(CircularTip) is tip and design.guide_of(Finish) is None
    assert tip.facts(design.where)["range_mm"] == [150.0, 152.0]
    with pytest.raises(DesignError, match="two guides are of type CircularTip"):
        replace(design, guides=(tip, tip))
