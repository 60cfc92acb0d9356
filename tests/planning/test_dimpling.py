"""Seats of markers in what stands on a part: a ball's own, whatever way the tool stands; refused where they would reach it."""

from dataclasses import replace
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest

from cuspline.app import build as recipe
from cuspline.app import catalogue
from cuspline.design import Design, FacePredicate, Finish, Marker, Parameters, Setup, StockBox
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.dimples import Dimples
from cuspline.stock.workpiece import Workpiece
from cuspline.values.errors import PlanError

SKIN_MM, RADIUS_MM = 1.0, 3.0
UP = (0.0, 0.0, 1.0)
LEANING = (0.0, -0.5, 0.75 ** 0.5)
OVER_TOP, ON_FRONT = (5.0, 0.0, 20.0 + RADIUS_MM + 0.5), (-5.0, -10.0 - RADIUS_MM - 0.4, 12.0)


def design(*places, way=UP, names=None):
    """A block with a skin; dimples are cut with the tool along `way` and touched from below."""
    markers = tuple(Marker(name=f"m{k}", at_mm=at) for k, at in enumerate(places))
    dimples = Dimples(markers=names or tuple(m.name for m in markers), tool="ball 6")
    x = (1.0, 0.0, 0.0)
    return Design(
        name="block", description="block with a skin", parameters=Parameters(), material="aluminium_6061", machine="mill_3axis",
        solid=cq.Workplane().box(40, 20, 20, centered=(True, True, False)).val(),
        predicates=(FacePredicate(name="top", count=1, normal=(0, 0, 1)),), finish=Finish(
            scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.02),
        stock=StockBox(min_mm=(-21, -11, 0), max_mm=(21, 11, 21)),
        setups=(Setup(name="one", faces=("top",), wcs_in_words="base", wcs_x=x, wcs_z=way, operations=(dimples,)),
                Setup(name="two", faces=("top",), wcs_in_words="base", wcs_z=(0, 0, -1), markers=markers)))


def order(made):
    return recipe.Order(source=None, design=made, machine=catalogue.find_machine(made.machine), accepted=(), out=Path("nowhere"),
                        library=catalogue.find_library(None), last_stage="gcode")


def planned(made):
    return plan_setup(made, made.setups[0], order(made).machine, order(made).library)


@pytest.mark.parametrize("way", [UP, LEANING])
def test_a_ball_rests_in_the_simulated_seat_with_its_middle_in_the_marker(way):
    """The stock is nowhere nearer to the marker than the ball's radius, and touches it all over the seat."""
    made = design(OVER_TOP, *((ON_FRONT,) if way is LEANING else ()), way=way)
    left = recipe._cut_by(order(made), Workpiece(blank=made.stock.shape), planned(made))
    for at, n, deep in ((OVER_TOP, (0, 0, 1), 0.5), (ON_FRONT, (0, -1, 0), 0.6))[:len(made.setups[1].markers)]:
        n, side = np.array(n, float), np.array([1.0, 0.0, 0.0])
        seat = np.linspace(0.0, 0.95 * np.arccos(1 - deep / RADIUS_MM), 9)
        out = -np.cos(seat)[:, None] * n + np.sin(seat)[:, None] * side
        on_ball = np.array(at) + RADIUS_MM * out
        assert not left.is_stock(on_ball - 1e-4 * out).any() and left.is_stock(on_ball + 1e-4 * out).all()


@pytest.mark.parametrize("place, way, words", [
    ((5.0, 0.0, 20.0 + RADIUS_MM + 0.02), UP, r"would be cut to 0\.020 mm above the part by T\d+ .*: put it 0\.010 mm farther out"),
    ((5.0, 0.0, 20.0 + RADIUS_MM + 0.95), UP, r"would be 0\.050 mm deep, 0\.1 at least: 1\.000 mm stand .* 0\.050 mm farther in"),
    (ON_FRONT, (0.0, 0.75 ** 0.5, 0.5), "cannot be reached by T.* from this direction")])
def test_a_seat_that_cannot_be_is_refused_with_what_would(place, way, words):
    with pytest.raises(PlanError, match=r"one, dimples: marker m0 at \[.*\] " + words):
        planned(design(place, way=way))


def test_a_marker_that_no_setup_has_is_refused():
    with pytest.raises(PlanError, match="no setup has a marker 'hub'; there are m0"):
        planned(design(OVER_TOP, names=("hub",)))


def test_what_a_casting_lacks_is_no_seat():
    made = replace(design(OVER_TOP), stock=StockBox(min_mm=(-21, -11, 0), max_mm=(21, 11, 20)))
    with pytest.raises(PlanError, match="would be 0.000 mm deep"):
        planned(made)
