"""Which library of smaller cutters gets to what is left: closed forms of grooves in a plate."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.app import catalogue
from cuspline.app.spare_cutters import first_that_helps
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.plan import plan_setup

SMALLER = [catalogue.find_library(name) for name in ("small_mills", "small_balls")]
USUAL = catalogue.find_library(None)


def grooved(width_mm, depth_mm):
    return cq.Workplane().box(40, 40, 40).cut(cq.Workplane().box(60, width_mm, 2 * depth_mm).translate((0, 0, 20)))


def plan_of(part):
    """SetupPlan of the top of a plate, seen with X along the part's -Y."""
    top = FacePredicate(name="top", at_least=1, normal=(0, 0, 1), center_min_mm=(-20, -20, 19.9), center_max_mm=(20, 20, 20.1))
    design = Design(name="plate", description="plate", parameters=Parameters(), solid=part, predicates=(top,),
                    material="aluminium_6061", stock=StockBox(min_mm=(-20, -20, -20), max_mm=(20, 20, 21)),
                    finish=Finish(scallop_mm=0.3, profile_tolerance_mm=0.03, gouge_mm=0.03),
                    setups=(Setup(name="setup-1", faces=("top",), wcs_in_words="middle", wcs_x=(0, -1, 0)),))
    return plan_setup(design, design.setups[0], catalogue.find_machine("mill_3axis"), USUAL)


@pytest.mark.parametrize("width, depth, helping", [
    (3.4, 5.0, 0),          # the flat cutter of 3 mm
    (2.4, 5.0, 1),          # the ball of 2 mm
    (1.6, 5.0, None),       # nothing is narrow enough
    (3.4, 30.0, None)])     # nothing is long enough
def test_the_first_library_is_taken_that_has_a_cutter_narrow_and_long_enough(width, depth, helping):
    floor = np.array([(x, y, 20.0 - depth) for x in np.linspace(-15, 15, 7) for y in (-0.1, 0.0, 0.1)])
    place = floor, np.tile([0.0, 0.0, 1.0], (len(floor), 1))
    assert first_that_helps(SMALLER, USUAL, [plan_of(grooved(width, depth))], [[place]]) == helping


def test_where_nothing_is_left_none_helps():
    assert first_that_helps(SMALLER, USUAL, [plan_of(grooved(3.4, 5.0))], [[]]) is None


@pytest.mark.parametrize("diameter, helping", [(1.5, 0), (1.8, None)])
def test_a_drill_helps_with_holes_of_its_own_size(diameter, helping):
    part = cq.Workplane().box(40, 40, 40).cut(cq.Workplane().circle(diameter / 2).extrude(60, both=True).translate((0, 9, 0)))
    angles = np.repeat(np.linspace(0.0, 2 * np.pi, 12, endpoint=False), 3)
    out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    wall = out * diameter / 2 + (0, 9, 0) + np.outer(np.tile([12.0, 15.0, 18.0], 12), (0, 0, 1))
    assert first_that_helps(SMALLER[:1], USUAL, [plan_of(part)], [[(wall, -out)]]) == helping
