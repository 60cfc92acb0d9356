"""Feeds within what the drives follow, and times in closed form."""

import math
from pathlib import Path

import numpy as np
import pytest

import cuspline.posts
from cuspline.planning import feeds
from cuspline.program.program import MoveWriter, Plane
from cuspline.shop.machines import machine_from_toml

MACHINE = machine_from_toml(Path(cuspline.posts.__file__).parent / "machines" / "mill_3axis.toml")
A = 2000.0              # mm/s², the slowest axis


def line(length, feed):
    w = MoveWriter((0, 0, 0))
    w.feed((length, 0, 0), feed)
    return w.moves()


def arc(radius, turn_deg, feed, plane=Plane.XY, is_clockwise=False, rise=0.0):
    """From angle 0 round the origin of the plane."""
    a, b, c = plane.axes
    start, end = np.zeros(3), np.zeros(3)
    turn = math.radians(-turn_deg if is_clockwise else turn_deg)
    start[a], end[a], end[b], end[c] = radius, radius * math.cos(turn), radius * math.sin(turn), rise
    w = MoveWriter(start)
    w.arc(end, (0, 0, 0), plane, is_clockwise, feed)
    return w.moves()


def test_the_lag_cap_is_the_check_number_of_the_source():
    # T = 0.033 s: V [in/min] = 909 s [in]
    for inches in (0.01, 0.05, 0.1):
        capped = feeds.capped_feeds(line(inches * 25.4, 5900.0), MACHINE)[0] / 25.4
        assert capped == pytest.approx(909 * inches, rel=1e-3, abs=1 / 25.4)         # whole mm/min, rounded down
        assert capped <= 60 * inches / (2 * 0.033)


def test_a_long_line_keeps_the_cutters_feed_and_a_rapid_has_none():
    w = MoveWriter((0, 0, 0))
    w.feed((100, 0, 0), 900)
    w.rapid((100, 0, 50))
    assert feeds.capped_feeds(w.moves(), MACHINE).tolist() == [900, 0]


def test_no_feed_exceeds_what_was_commanded():
    assert feeds.capped_feeds(line(0.001, 7.0), MACHINE)[0] == 7.0


@pytest.mark.parametrize("plane", Plane)
@pytest.mark.parametrize("radius", [0.5, 2.0, 10.0])
def test_an_arc_is_capped_by_the_acceleration_across_it(plane, radius):
    moves = arc(radius, 180, 1e5, plane)
    capped = feeds.capped_feeds(moves, MACHINE)[0]
    lag = 60 * math.pi * radius / (2 * 0.033)
    across = 60 * math.sqrt(feeds.ARC_ACCELERATION_SHARE * A * radius)
    assert capped == pytest.approx(min(lag, across), abs=1)
    assert (capped / 60) ** 2 / radius <= feeds.ARC_ACCELERATION_SHARE * A


def test_a_slanted_rapid_runs_as_fast_as_its_first_axis_allows():
    w = MoveWriter((0, 0, 0))
    w.rapid((300, 0, 400))
    # z runs at most 10000 mm/min and takes 0.8 of the speed: 12500 along the line
    speed, length = 12500 / 60, 500.0
    assert feeds.times_s(w.moves(), MACHINE).sum() == pytest.approx(length / speed + speed / A, rel=1e-9)


@pytest.mark.parametrize("length", [500.0, 5.0, 0.05])
def test_a_single_move_takes_its_trapezoid(length):
    speed = 3000 / 60
    exact = length / speed + speed / A if length > speed ** 2 / A else 2 * math.sqrt(length / A)
    assert feeds.times_s(line(length, 3000.0), MACHINE)[0] == pytest.approx(exact, rel=1e-9)


def test_straight_moves_in_one_line_are_run_through_without_stopping():
    w = MoveWriter((0, 0, 0))
    for x in np.linspace(0, 200, 41)[1:]:
        w.feed((x, 0, 0), 3000)
    alone = feeds.times_s(line(200.0, 3000.0), MACHINE)[0]
    assert feeds.times_s(w.moves(), MACHINE).sum() == pytest.approx(alone, rel=1e-9)


def test_a_reversal_stops():
    w = MoveWriter((0, 0, 0))
    w.feed((100, 0, 0), 3000)
    w.feed((0, 0, 0), 3000)
    alone = feeds.times_s(line(100.0, 3000.0), MACHINE)[0]
    assert feeds.times_s(w.moves(), MACHINE).sum() == pytest.approx(2 * alone, rel=1e-4)


def test_a_tangent_arc_is_entered_without_slowing():
    w = MoveWriter((-100, 10, 0))
    w.feed((0, 10, 0), 600)
    w.arc((10, 0, 0), (0, 0, 0), Plane.XY, True, 600)
    w.feed((10, -100, 0), 600)
    length, speed = 200 + 5 * math.pi, 10.0
    assert feeds.times_s(w.moves(), MACHINE).sum() == pytest.approx(length / speed + speed / A, rel=1e-6)


@pytest.mark.parametrize("plane", Plane)
@pytest.mark.parametrize("is_clockwise", [True, False])
def test_lengths_follow_the_arc_and_its_rise(plane, is_clockwise):
    moves = arc(10.0, 270, 100, plane, is_clockwise, rise=3.0)
    assert feeds.move_lengths_mm(moves)[0] == pytest.approx(math.hypot(15 * math.pi, 3.0))


def test_a_full_circle_has_its_circumference():
    w = MoveWriter((5, 0, 0))
    w.arc((5, 0, 0), (0, 0, 0), Plane.XY, True, 100)
    assert feeds.move_lengths_mm(w.moves())[0] == pytest.approx(10 * math.pi)


def test_spindle_and_feed_follow_the_cutting_data_within_the_machine():
    from known_tools import tool
    ball = tool("ball", 10).cutter
    assert feeds.spindle_rpm(ball, 450, MACHINE.spindle) == round(450_000 / (10 * math.pi))
    assert feeds.spindle_rpm(tool("ball", 1).cutter, 450, MACHINE.spindle) == 18000
    assert feeds.cutting_feed_mm_per_min(ball, 10000, 0.008, MACHINE) == 10000 * ball.flutes * 0.08
    assert feeds.cutting_feed_mm_per_min(ball, 18000, 0.1, MACHINE) == MACHINE.max_feed_mm_per_min
