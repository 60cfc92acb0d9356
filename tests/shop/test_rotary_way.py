"""The shortest way of the rotaries: turns counted, poles met, rewinds announced, ranges held."""

import itertools

import numpy as np
import pytest
from known_machines import FIVE_AXIS, chain_of, leaning

from cuspline.shop.rotary_way import shortest_way
from cuspline.values.errors import PostError

RAD = 1e-9
ROUND = np.linspace(0, 720, 73)


def held(chain, way):
    """(n, 3) the axes at which the tool is held."""
    return chain.forward(chain.placed(np.zeros((len(way.angles), 3)), way.angles))[1]


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_the_way_holds_every_axis(name):
    chain, rng = chain_of(name), np.random.default_rng(1)
    axes = leaning(np.abs(rng.normal(0, 20, 3000)).clip(0, 60), np.cumsum(rng.normal(0, 8, 3000)))
    way = shortest_way(chain, axes)
    assert np.abs(held(chain, way) - axes).max() < RAD
    assert (way.angles >= chain.low[3:] - RAD).all() and (way.angles <= chain.high[3:] + RAD).all()


def test_an_endless_table_follows_a_cone_round_and_round():
    chain = chain_of("mill_trunnion_ac")
    way = shortest_way(chain, leaning(20.0, ROUND))
    assert len(way.rewinds) == 0
    assert np.abs(np.diff(np.degrees(way.angles[:, 0])) + 10).max() < 1e-9 and np.ptp(way.angles[:, 1]) < 1e-12


def test_a_table_that_may_not_wind_up_rewinds_once_where_its_range_ends():
    """Three turns are its whole range; a way that begins beside its end must turn back, as late as once is enough."""
    limited = chain_of("mill_head_table_bc")
    way = shortest_way(limited, leaning(20.0, np.linspace(0, 1080, 109)))
    assert len(way.rewinds) == 1
    steps = np.abs(np.diff(way.angles[:, 0]))
    assert np.flatnonzero(steps > np.radians(10.001)).tolist() == [way.rewinds[0] - 1]
    assert len(shortest_way(limited, leaning(20.0, np.linspace(0, 900, 91))).rewinds) == 0


def test_the_way_begins_a_turn_earlier_where_it_will_be_short_of_range():
    """From 0 the nearest beginning would run out of range after one and a half turns."""
    chain = chain_of("mill_head_table_bc")
    up, down = (shortest_way(chain, leaning(20.0, sign * np.linspace(0, 900, 91))) for sign in (1, -1))
    assert up.angles[0, 0] > np.pi > -np.pi > down.angles[0, 0]


@pytest.mark.parametrize("name", ["mill_trunnion_ac", "mill_head_table", "mill_head_table_bc"])
def test_no_other_way_is_shorter(name):
    """Against every combination of branches and turns, each step the continuation of the one before."""
    chain, rng = chain_of(name), np.random.default_rng(2)
    if name == "mill_trunnion_ac":
        chain = chain_of(name, c={"direction": (0, 0, 1), "pivot_mm": (0, 0, -450), "min_deg": -400, "max_deg": 400,
                                  "rapid_deg_per_min": 9000, "acceleration_deg_per_s2": 600})
    for _ in range(5):
        axes = leaning(rng.uniform(8, 25, 5), np.cumsum(rng.uniform(-120, 120, 5)))
        way = shortest_way(chain, axes)
        angles, _ = chain.branches(axes)
        turns = 2 * np.pi * np.array(list(itertools.product((-2, -1, 0, 1, 2), (-1, 0, 1))))
        speed = chain.speed[3:]

        def travels(route):
            return (np.abs(np.diff(np.vstack([[0, 0], route]), axis=0)) / speed).sum()
        best = np.inf
        for branch in range(2):         # without a pole a way stays on its branch; whole turns are those of its first row
            for turn in turns:
                route = [angles[0, branch] + turn]
                for k in range(1, len(axes)):
                    step = angles[k, branch] - angles[k - 1, branch]
                    route.append(route[-1] + (step + np.pi) % (2 * np.pi) - np.pi)
                route = np.array(route)
                if ((route >= chain.low[3:] - RAD) & (route <= chain.high[3:] + RAD)).all():
                    best = min(best, travels(route))
        if np.isfinite(best):
            assert len(way.rewinds) == 0 and travels(way.angles) <= best + 1e-6


def test_on_a_pole_the_free_rotary_keeps_the_angle_with_which_it_came():
    chain = chain_of("mill_trunnion_ac")
    way = shortest_way(chain, leaning([20, 0, 0, 20], [60, 0, 0, 150]))
    assert way.is_pole.tolist() == [False, True, True, False]
    assert np.ptp(way.angles[:3, 0]) < RAD and np.abs(way.angles[1:3, 1]).max() < RAD
    assert abs(abs(way.angles[3, 0] - way.angles[2, 0]) - np.pi / 2) < RAD and len(way.rewinds) == 0


def test_on_a_pole_from_the_start_it_stays_where_the_machine_stands():
    chain = chain_of("mill_trunnion_ac")
    upright = leaning(np.zeros(4), 0.0)
    assert (shortest_way(chain, upright).angles == 0).all()
    assert np.abs(shortest_way(chain, upright, start=[0.7, 0.0]).angles[:, 0] - 0.7).max() < RAD


def test_a_way_over_the_pole_changes_the_branch_and_turns_nothing():
    chain = chain_of("mill_head_table")
    way = shortest_way(chain, leaning([15, 15], [40, 220]))
    assert way.passes_pole.tolist() == [False, True] and len(way.rewinds) == 0
    assert way.sign.tolist() in ([1, -1], [-1, 1]) and abs(np.ptp(way.angles[:, 0])) < RAD


def test_a_way_over_the_pole_that_may_not_change_the_branch_turns_on_the_spot():
    chain = chain_of("mill_head_table", b={"direction": (0, 1, 0), "pivot_mm": (0, 0, 150), "min_deg": 0, "max_deg": 100,
                                           "rapid_deg_per_min": 9000, "acceleration_deg_per_s2": 600})
    way = shortest_way(chain, leaning([15, 15], [40, 220]))
    assert len(way.rewinds) == 0 and (way.sign == way.sign[0]).all() and abs(np.ptp(way.angles[:, 0]) - np.pi) < RAD


def test_a_rotary_over_its_range_by_a_tenth_of_a_degree_is_refused_by_row_axis_and_value():
    chain = chain_of("mill_head_head")
    with pytest.raises(PostError, match=r"row 1: B would stand at 100\.1000 degrees, its range is -100.0000 degrees to "
                                        r"100.0000 degrees") as refused:
        shortest_way(chain, leaning([90.0, 100.1], 0.0))
    assert refused.value.rows.tolist() == [1]


def test_an_axis_that_turns_right_round_in_one_move_is_refused():
    with pytest.raises(PostError, match="row 1: the tool axis turns right round in one move"):
        shortest_way(chain_of("mill_head_head"), [[1, 0, 0], [-1, 0, 0]])


def test_where_it_may_choose_it_rewinds_beside_the_cut():
    """The same three turns with two rapids among them: at the later the range is not yet at its end, at the earlier too full."""
    limited, axes = chain_of("mill_head_table_bc"), leaning(20.0, np.linspace(0, 1080, 109))
    off_cut = np.isin(np.arange(109), [30, 70])
    way = shortest_way(limited, axes, off_cut=off_cut)
    assert way.rewinds.tolist() == [70] and np.degrees(np.abs(way.angles[:, 0])).max() <= 540 + 1e-6
    nowhere_else = shortest_way(limited, axes, off_cut=np.arange(109) == 5)
    assert len(nowhere_else.rewinds) == 1 and nowhere_else.rewinds[0] != 5
