"""A setup from which the part looks as from another is cut by the same moves, and mended there."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cuspline.app import build as recipe
from cuspline.app import catalogue, mending
from cuspline.app.judge import read_programs
from cuspline.app.mending import Wants, mended
from cuspline.design.job import read_job, read_tools
from cuspline.planning.copied_plans import copied
from cuspline.planning.strategies.auto import Auto
from cuspline.values.errors import DesignError, PlanError

PART = Path(__file__).parents[1] / "parts" / "indexed_block.py"
NOTHING = Wants(places_mm=np.zeros((0, 3)), left_mm=0.0, gouge_mm=0.0)


def with_right_as(design, name, **changes):
    """The block's top, front and right side; the right one cut as another."""
    top, front, right, *_ = design.setups
    copy = right.model_copy(update={"planned_as": name, "wcs_x": (0.0, 1.0, 0.0), **changes})
    return replace(design, setups=(top, front, copy))


@pytest.fixture(scope="module")
def order(tmp_path_factory):
    source = catalogue.find_design(str(PART))
    design = with_right_as(catalogue.make_design(source, ["sides=3"]), "front")
    return recipe.Order(source=source, design=design, machine=catalogue.find_machine(design.machine), accepted=(),
                        library=catalogue.find_library(None), last_stage="gcode", out=tmp_path_factory.mktemp("copied") / "block")


@pytest.fixture(scope="module")
def plans(order):
    return recipe._planned(order, lambda text: None)


def test_the_posted_tips_of_a_copy_are_those_of_what_it_is_copied_from(order, monkeypatch):
    """Read back from the text, each seen from its own setup; to the post's last decimals, a tool 120 mm from its rotary axes.
    The planner's own check looks at what is copied alone: the copy is as good."""
    looked_at, begun = [], recipe.begun
    monkeypatch.setattr(recipe, "begun", lambda folder, job, *rest: looked_at.append(job) or begun(folder, job, *rest))
    folder = recipe.build(order).folder
    job = read_job(folder)
    assert [[p.setup.name for p in looked.posted] for looked in looked_at] == [["top", "front"]]
    _, front, right = read_programs(folder, job, read_tools(folder))
    assert right.setup.planned_as == "front" and len(right.posted) > 100
    cutting = [p.posted.end_mm[p.posted.kind != 0] for p in (front, right)]
    assert np.abs(cutting[0] - cutting[1]).max() < 3e-4


def test_planning_is_done_once(order, plans, monkeypatch):
    assert plans[2].operations is plans[1].operations and plans[2].setup.name == "right"
    asked = []
    monkeypatch.setattr(recipe, "plan_setup", lambda design, setup, *rest: asked.append(setup.name) or plans[len(asked) - 1])
    recipe._planned(order, lambda text: None)
    assert asked == ["top", "front"]


def test_what_stands_too_high_in_a_copy_is_mended_in_the_original_where_it_lies_there(plans, monkeypatch):
    asked = []
    monkeypatch.setattr(mending, "_mended", lambda plan, want, *rest: asked.append((plan, want)) or replace(plan, operations=()))
    high = Wants(places_mm=np.array([[5.9, 1.0, 8.0]]), left_mm=0.2, gouge_mm=0.0)
    (_, front, right), is_changed = mended(plans, [NOTHING, NOTHING, high], 1, "the verdict")
    (plan, want), = asked
    assert is_changed and plan.setup.name == "front" and want.left_mm == 0.2
    assert want.places_mm == pytest.approx(np.array([[1.0, -5.9, 8.0]]))        # turned back by 90 degrees
    assert front.operations == right.operations == () and right.setup.name == "right"


def test_a_setup_that_sees_another_part_is_refused(plans):
    right = plans[2].setup
    with pytest.raises(PlanError, match="right is to be cut as front is, but from there its faces lie .* mm elsewhere: correct"):
        copied(plans[1], right.model_copy(update={"wcs_x": (0.0, 0.0, 1.0)}))
    with pytest.raises(PlanError, match="its faces are 2, not 1"):
        copied(plans[1], right.model_copy(update={"faces": ("right", "top")}))


@pytest.mark.parametrize("name, changes, words", [
    ("left", {}, "planned_as left names no setup before it that is planned for itself; there are .'front', 'top'."),
    ("right", {}, "planned_as right names no setup before it"),
    ("front", {"operations": (Auto(strategy="spiral"),)}, "planned as front, and lists other operations")])
def test_a_copy_of_what_is_not_planned_before_is_refused(order, name, changes, words):
    with pytest.raises(DesignError, match=words):
        with_right_as(order.design, name, **changes)
