"""Passes run in the order that keeps a ball's tip out of the cut, where that costs less than a tenth of the time."""

from dataclasses import replace

import pytest

from cuspline.app import catalogue
from cuspline.designs.h13_test import BALL, H13Test, design
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.parallel import Parallel
from cuspline.planning.tip_orders import MOST_TIME

SLOPE = {"faces": ("step-up slope",), "tool": BALL.number, "spindle_rpm": 5000.0, "feed_mm_per_min": 1270.0, "stepover_mm": 0.5}


@pytest.fixture(scope="module")
def planned():
    """The H13 block's slope cut by level passes as left to the planner, and asked for as the nearest next; its plane."""
    made = design(H13Test())
    setup, = made.setups
    operations = (Parallel(name="left out", angle_deg=90.0, **SLOPE),
                  Parallel(name="nearest", angle_deg=90.0, bearing="nearest", **SLOPE),
                  Parallel(name="across", angle_deg=0.0, **SLOPE),
                  Parallel(name="plane", angle_deg=90.0, **{**SLOPE, "faces": ("plane",)}))
    library = catalogue.find_library(None)
    library = library.model_copy(update={"tools": (*library.tools, BALL)})
    plans = {}
    for operation in operations:
        alone = replace(made, setups=(setup.model_copy(update={"operations": (operation,)}),))
        one, = plan_setup(alone, alone.setups[0], catalogue.find_machine("mill_3axis"), library).operations
        plans[operation.name] = one
    return plans


def test_level_passes_on_a_slope_run_step_up_by_default(planned):
    facts = planned["left out"].facts
    assert facts["bearing"] == "step-up" and planned["left out"].orders == ()
    row = facts["orders"]["step-up"]
    assert row["times_as_long"] <= MOST_TIME and row["tip_share"] == 0.0 < facts["orders"]["as laid"]["tip_share"]
    nearest = planned["nearest"].facts
    assert facts["time_s"] == pytest.approx(row["times_as_long"] * nearest["time_s"], rel=0.01) and "orders" not in nearest


def test_an_order_that_takes_long_is_not_taken_and_says_so(planned):
    row = planned["across"].facts["orders"]["uphill"]
    assert row["times_as_long"] > MOST_TIME and "longer: more than 10 %" in row["why_not"]


def test_an_order_that_gains_nothing_is_not_taken(planned):
    facts = planned["plane"].facts
    assert "bearing" not in facts and facts["orders"]["as laid"]["tip_share"] > 0.5
