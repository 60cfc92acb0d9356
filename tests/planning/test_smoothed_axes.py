"""Axes of a ball evened out until the rotaries follow: by no more than allowed, and only where they would not."""

import math

import numpy as np
import pytest

from cuspline.app.catalogue import find_machine
from cuspline.planning.clearing_axes import RotaryUse
from cuspline.planning.smoothed_axes import SmoothingSwing, smoothing_facts
from cuspline.toolpaths.five_axis.leaning_moves import Stations

COUNT, JUMP_DEG = 121, 6.0


def run(lean_deg):
    """Stations 1 mm apart along X, leaning toward X by degrees (n,)."""
    lean = np.radians(lean_deg)
    axes = np.column_stack([np.sin(lean), np.zeros(COUNT), np.cos(lean)])
    up = np.tile((0.0, 0.0, 1.0), (COUNT, 1))
    places = np.column_stack([np.arange(COUNT), np.zeros((COUNT, 2))])
    return Stations(along_mm=np.arange(COUNT, dtype=float), middle_mm=places, normal=up, feed=np.tile((1.0, 0, 0), (COUNT, 1)),
                    axis=axes)


def swing(most_deg, feed_mm_per_s=25.0):
    use = RotaryUse(chain=find_machine("mill_head_table").kinematics, clamped=lambda axes: axes, feed_mm_per_s=feed_mm_per_s)
    return SmoothingSwing(use, 4.0, math.radians(most_deg))


def jumping():
    return run(np.where(np.arange(COUNT) < COUNT // 2, 20.0, 20.0 + JUMP_DEG))


def test_a_jump_is_spread_until_the_rotaries_follow():
    turn, = swing(JUMP_DEG).turns([jumping()])
    assert turn.share[0] > 1.0 >= turn.share[1] and 0.0 < math.degrees(turn.most_rad) < JUMP_DEG
    assert turn.turned(jumping())[[0, -1]] == pytest.approx(jumping().axis[[0, -1]], abs=1e-12)
    told = smoothing_facts([turn])
    assert told["rotary_share"][0] > 1.0 >= told["rotary_share"][1] and told["rotary_reversals"] == [0, 0]


def test_no_axis_leaves_its_strategy_by_more_than_allowed():
    turn, = swing(0.5).turns([jumping()])
    off = np.degrees(np.arccos(np.clip((turn.turned(jumping()) * jumping().axis).sum(axis=1), -1.0, 1.0)))
    assert 0.4 < off.max() <= 0.5 + 1e-6 and turn.share[1] < turn.share[0]


def test_what_the_rotaries_follow_stays_as_it_is():
    even = run(np.linspace(20.0, 21.0, COUNT))
    turn, = swing(JUMP_DEG).turns([even])
    assert turn.axis is None and len(turn.corners_mm) == 0 and (turn.turned(even) == even.axis).all()


def test_an_axis_that_trembles_turns_round_less_often():
    turn, = swing(3.0).turns([run(20.0 + np.where(np.arange(COUNT) % 2, 1.0, -1.0))])
    assert turn.reversals[1] < turn.reversals[0] and turn.share[1] < turn.share[0]
