"""Verdicts on a dome finished by a ball that leans: the good program has no finding, each fault is found by name and line."""

from functools import cache

import numpy as np
import pytest
import tilted_dome as dome
from known_programs import tool

from cuspline.shop.cutters import Holder, HolderSegment
from cuspline.verification.verdict import Options, verify_setup

OPTIONS = Options(spacing_mm=0.6, solid_pitch_mm=0.4, replay_pitch_mm=0.5, tessellation_mm=0.005)
SOLID = dome.solid()
# the holder 14 mm over the tip: with 10 degrees of lead, on a slope of 15, its edge comes 2 mm near to the dome's other side
SHORT = tool("ball", 6, number=7, flute=8.0, neck=5.6, stick_out=14.0)


def judged(posted, tools=dome.TOOLS, mill=None):
    return verify_setup(posted, tools, SOLID, dome.dome_of(SOLID), setup=dome.SETUP, finish=dome.FINISH, stock=dome.STOCK,
                        ball_radius_mm=1.0, machine=mill or dome.trunnion(), options=OPTIONS)


@cache
def good_text():
    return dome.text_of(dome.trunnion(), dome.finishing())


def with_ball(ball):
    return {**dome.TOOLS, 7: ball}


def test_the_good_program_is_verified_with_no_finding_and_all_of_it_is_proven():
    v = judged(dome.read(dome.trunnion(), good_text()))
    assert v.findings == ()
    numbers = v.numbers
    assert numbers["area_reached_mm2"] == pytest.approx(numbers["area_required_mm2"])
    sagitta = 0.8 ** 2 / 8 / (dome.RADIUS_MM + 3.0)                 # of the chords of the ball's centre, mm
    assert 0.8 * sagitta < numbers["gouge_max_mm"] < sagitta + 1.5e-3
    assert numbers["gouge_max_mm"] <= numbers["gouge_proven_mm"] < numbers["gouge_max_mm"] + 0.004
    assert list(numbers["certificate"]["not_covered"]) == ["the program does not say where the move begins or ends"]
    cusp = 0.6 ** 2 / 8 * (1 / 3.0 + 1 / dome.RADIUS_MM)            # of passes so far apart over the dome
    assert 0.7 * cusp < numbers["cusp_max_mm"] < 1.1 * cusp
    assert numbers["excess_max_mm"] <= numbers["excess_proven_mm"] < 1.03 * numbers["excess_max_mm"]
    assert numbers["sampling"]["unproven_mm2"]["inside"] < 0.01 and numbers["sampling"]["not_covered"] == []
