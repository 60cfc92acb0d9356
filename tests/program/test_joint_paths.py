"""Moves as joints run them: how far a block is off, bounded and by brute force; blocks inserted until it is little enough."""

import numpy as np
import pytest
from known_machines import FIVE_AXIS, chain_of, leaning

from cuspline.app.catalogue import find_machine
from cuspline.program.joint_paths import AXIS_BOUND, AXIS_FOUND, TIP_BOUND, TIP_FOUND, Tolerance, block_deviations, joint_path
from cuspline.values.errors import PostError

CLOSE = Tolerance(0.002, np.radians(0.02))
STEPS = 301             # of a block, by brute force
ROUNDING = 1e-9


def turned_on_great_circle(a, b, share):
    """(n, 3) axes between two."""
    whole = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)
    if whole < 1e-12:
        return np.tile(a, (len(share), 1))
    return (np.sin((1 - share) * whole)[:, None] * a + np.sin(share * whole)[:, None] * b) / np.sin(whole)


def off_plan(chain, before, after, tips, axes, shares, length_mm):
    """Largest distance of a block's tip to a move's line, and angle of its axis to where the plan has it, densely sampled."""
    t = np.linspace(0, 1, STEPS)
    tip, axis = chain.forward(before + t[:, None] * (after - before), length_mm)
    along = tips[1] - tips[0]
    on = np.clip((tip - tips[0]) @ along / max(along @ along, 1e-300), 0, 1)
    planned = turned_on_great_circle(*axes, shares[0] + t * (shares[1] - shares[0]))
    return (np.linalg.norm(tip - tips[0] - on[:, None] * along, axis=1).max(),
            2 * np.arcsin(np.linalg.norm(axis - planned, axis=1).max() / 2))


def off_plan_of_all(chain, path, tips, axes, length_mm):
    """(blocks, 2) of a whole path without rewinds."""
    out = []
    for k in range(1, len(path)):
        row = path.row[k]
        begin = path.share[k - 1] if path.row[k - 1] == row else 0.0
        out.append(off_plan(chain, path.joints[k - 1], path.joints[k], tips[row - 1:row + 1], axes[row - 1:row + 1],
                            (begin, path.share[k]), length_mm))
    return np.array(out)


def poses(name, tilt_deg, azimuth_deg, seed=0):
    """Axes that lean so, at places some millimetres from each other."""
    axes = leaning(tilt_deg, azimuth_deg)
    steps = np.random.default_rng(seed).normal(0, 5, (len(axes), 3))
    return np.array(find_machine(name).wcs_origin_mm) + np.cumsum(steps, axis=0), axes


WAYS = {"round a cone": (20.0, np.linspace(0, 360, 19)), "to and fro over the pole": ([25, 10, 5, 20], [0, 0, 180, 180]),
        "to the pole and another way from it": ([20, 0, 0, 20], [0, 0, 0, 90]), "close to the pole": ([10, 10], [0, 179.9]),
        "any": (np.abs(np.random.default_rng(4).normal(0, 15, 12)), np.random.default_rng(5).uniform(0, 360, 12))}


def test_thirty_millimetres_in_one_block_leave_their_line_by_fifteen():
    """On a trunnion, 40 mm from its middle, while A turns by 30 degrees and C by 60."""
    chain = chain_of("mill_trunnion_ac")
    tips = np.array([[40.0, 0, -450], [40 + 30 * np.cos(1.31), 30 * np.sin(1.31), -450]])
    joints = chain.placed(tips, np.radians([[0, 0], [60, 30]]))
    axes = chain.forward(joints)[1]
    brute = off_plan(chain, *joints, tips, axes, (0, 1), 0.0)
    off = block_deviations(chain, joints[:1], joints[1:])[0]
    assert np.linalg.norm(tips[1] - tips[0]) == pytest.approx(30) and 14.5 < brute[0] < 15.5
    for k, found, proven in ((0, TIP_FOUND, TIP_BOUND), (1, AXIS_FOUND, AXIS_BOUND)):       # found: at 17 places only
        assert 0.99 * brute[k] < off[found] <= brute[k] + ROUNDING and brute[k] <= off[proven] < 1.03 * brute[k]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", FIVE_AXIS)
def test_every_block_is_within_the_tolerance_and_within_its_own_bound(name, way):
    chain, (tips, axes) = chain_of(name), poses(name, *WAYS[way])
    path = joint_path(chain, tips, axes, CLOSE, length_mm=120.0)
    off = off_plan_of_all(chain, path, tips, axes, 120.0)
    proven = path.deviation[1:, [TIP_BOUND, AXIS_BOUND]]
    assert len(path.rewinds) == 0 and (off <= proven + 1e-7).all()
    assert (proven <= [CLOSE.tip_mm, CLOSE.axis_rad]).all()


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_the_ends_of_the_moves_are_where_they_were_planned(name):
    chain, (tips, axes) = chain_of(name), poses(name, *WAYS["any"])
    path = joint_path(chain, tips, axes, CLOSE, length_mm=120.0)
    ends = path.joints[path.share == 1.0]
    again, leaning_again = chain.forward(ends, 120.0)
    assert np.abs(again - tips).max() < ROUNDING and np.abs(leaning_again - axes).max() < ROUNDING


def test_a_quarter_of_the_tolerance_takes_twice_the_blocks_and_no_more():
    """A chord's sagitta falls with the square of its length, and so does what the bound adds to it."""
    chain, (tips, axes) = chain_of("mill_trunnion_ac"), poses("mill_trunnion_ac", 20.0, np.linspace(0, 360, 5))
    fine, finer = (len(joint_path(chain, tips, axes, Tolerance(t, 1.0))) for t in (4e-5, 1e-5))
    assert finer / fine == pytest.approx(2.0, rel=0.02)


def test_blocks_are_not_many_more_than_needed():
    """Of a turning table: the tip 40 mm from its middle, so blocks of the largest sagitta by the circle's own formula."""
    chain = chain_of("mill_head_table")
    angle, radius, tolerance = np.pi / 2, 40.0, 1e-3
    axes = leaning(10.0, [0.0, 90.0])
    tips = np.array([[radius, 0, -580], [radius, 0, -580]])
    blocks = len(joint_path(chain, tips, axes, Tolerance(tolerance, 1.0))) - 1
    least = angle / (2 * np.arccos(1 - tolerance / radius))
    assert least <= blocks < 1.5 * least


def test_the_tip_stands_while_the_table_turns_at_a_pole():
    chain, (tips, axes) = chain_of("mill_trunnion_ac"), poses("mill_trunnion_ac", *WAYS["to the pole and another way from it"])
    path = joint_path(chain, tips, axes, CLOSE)
    spot = np.flatnonzero(path.is_spot)
    at, upright = chain.forward(path.joints[spot])
    assert len(spot) > 5 and np.abs(at - tips[2]).max() < ROUNDING and np.abs(upright - [0, 0, 1]).max() < ROUNDING
    assert np.abs(np.degrees(np.diff(path.joints[[spot[0] - 1, spot[-1]], 3])[0])) == pytest.approx(90.0)


def test_upright_moves_stay_single_blocks():
    """On any machine a straight move whose axis keeps still is straight in joints too."""
    for name in ("mill_3axis", *FIVE_AXIS):
        tips, axes = poses(name, 0.0, np.zeros(9))
        path = joint_path(find_machine(name).kinematics, tips, axes, CLOSE, length_mm=50.0)
        assert len(path) == len(tips) and path.deviation.max() < ROUNDING


def test_a_rewind_is_announced_by_row_and_not_laid_out():
    name = "mill_head_table_bc"
    tips, axes = poses(name, 20.0, np.linspace(0, 1080, 37))
    path = joint_path(chain_of(name), tips, axes, CLOSE)
    assert len(path.rewinds) == 1
    block, = np.flatnonzero(~np.isfinite(path.deviation[:, TIP_BOUND]))
    assert path.row[block] == path.rewinds[0] and path.share[block] == 1.0


def test_a_way_between_two_rows_that_the_rotaries_cannot_hold_is_refused_by_row():
    """A head whose spindle leans from 37 to 111 degrees and never less: both ends can be held, the way round is longer."""
    chain = chain_of("mill_head_table_bc", spindle_direction=(0, -0.6, 0.8), b={
        "direction": (0, 0.6, 0.8), "pivot_mm": (0, 0, 100), "rapid_deg_per_min": 9000, "acceleration_deg_per_s2": 500})
    joint_path(chain, np.zeros((2, 3)), leaning(40.0, [0.0, 20.0]), CLOSE)
    with pytest.raises(PostError, match="row 1: on the way to it the tool axis passes where the rotaries C and B cannot hold it"):
        joint_path(chain, np.zeros((2, 3)), leaning(40.0, [0.0, 120.0]), CLOSE)


def test_a_path_without_a_tolerance_is_refused():
    with pytest.raises(PostError, match="both must be above 0"):
        joint_path(chain_of("mill_head_head"), np.zeros((2, 3)), leaning(0.0, [0, 0]), Tolerance(0.0, 1e-3))


def test_a_rotary_that_swings_out_beside_a_pole_stays_within_its_range():
    """Wound up to a degree from its end it would swing half a degree beyond its end: it rewinds beside the cut."""
    chain = chain_of("mill_head_table_bc")
    axes = np.vstack([leaning(8.0, np.linspace(0.0, 720.9, 200)), [[-0.0620629541, -9.17207914e-4, 0.998071815]]])
    off_cut = np.arange(len(axes)) == len(axes) - 1
    path = joint_path(chain, np.zeros((len(axes), 3)), axes, CLOSE, off_cut=off_cut)
    turned = np.degrees(path.joints[:, 3:])
    assert path.rewinds.tolist() == [len(axes) - 1] and np.abs(turned[:, 0]).max() < 540.0
    in_cut = joint_path(chain, np.zeros((len(axes), 3)), axes, CLOSE)
    assert len(in_cut.rewinds) == 0 and np.abs(np.degrees(in_cut.joints[:, 3])).max() > 540.0
