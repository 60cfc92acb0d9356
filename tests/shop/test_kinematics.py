"""Joints to the tool and back: check vectors, sameness with closed forms, poles, branches, limits."""

import numpy as np
import pytest
from known_machines import FIVE_AXIS, chain_of, free_chain, leaning, random_joints
from scipy.spatial.transform import Rotation

from cuspline.app.catalogue import find_machine
from cuspline.values.errors import PostError

ANGLES = {"A": 10.0, "B": 20.0, "C": 30.0}
CARRIED = {     # axis of the tool at A 10, B 20, C 30 degrees: both on the head, both on the table, one each, A on B
    "mill_head_head": (0.342020, -0.163176, 0.925417), "mill_table_table": (-0.336824, 0.173648, 0.925417),
    "mill_head_table": (0.296198, -0.171010, 0.939693), "mill_a_on_b": (-0.342020, 0.163176, 0.925417)}
POSES = 100_000
MM, RAD = 1e-9, 1e-9
JUST_BESIDE = np.array([0.0, 1e-12, 1e-11, 3e-10, 1e-9, 1e-7, 1e-4])     # rad from a pole


@pytest.mark.parametrize("name", CARRIED)
def test_the_tool_leans_as_the_types_of_machine_say(name):
    chain = chain_of(name)
    _, axis = chain.forward([[0, 0, 0, *(np.radians(ANGLES[c]) for c in chain.rotaries)]])
    assert np.abs(axis[0] - CARRIED[name]).max() < 5e-7


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_forward_after_inverse_is_where_it_began(name):
    """Both branches, everywhere that the rotaries reach."""
    chain = chain_of(name)
    joints = random_joints(chain, POSES, seed=5)
    length = np.random.default_rng(6).uniform(0, 250, POSES)
    tips, axes = chain.forward(joints, length)
    both = chain.inverse(tips, axes, length)
    for branch in range(2):
        again, leaning_again = chain.forward(both[:, branch], length)
        assert np.abs(again - tips).max() < MM and np.abs(leaning_again - axes).max() < RAD
    apart = np.abs((both[:, :, 3:] - joints[:, None, 3:] + np.pi) % (2 * np.pi) - np.pi).max(axis=2).min(axis=1)
    assert apart.max() < 1e-7       # one of the two is the one that it came from; less sharp where the branches meet


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_forward_after_inverse_is_where_it_began_on_and_beside_the_pole(name):
    chain = chain_of(name)
    pole = np.abs(chain.links.direction[3])
    rng = np.random.default_rng(7)
    off = np.repeat(JUST_BESIDE, 200)
    across = np.cross(pole, rng.normal(size=(len(off), 3)))
    across /= np.linalg.norm(across, axis=1)[:, None]
    axes = pole * np.cos(off)[:, None] + across * np.sin(off)[:, None]
    tips = rng.uniform(-300, 300, (len(off), 3))
    angles, is_pole = chain.branches(axes)
    assert (is_pole == (off <= 1e-10)).all()
    for branch in range(2):
        again, leaning_again = chain.forward(chain.placed(tips, angles[:, branch], 80.0), 80.0)
        assert np.abs(again - tips).max() < MM and np.abs(leaning_again - axes).max() < RAD


@pytest.mark.parametrize("count", [0, 1, 2])
def test_any_directions_and_pivots_in_any_order_will_do(count):
    """Slanted linear axes, rotaries between them, a spindle that leans, one rotary alone or none."""
    rng = np.random.default_rng(8 + count)
    for _ in range(15):
        order = list(rng.permutation(["X", "Y", "Z", "A", "C"][:3 + count]))
        letters = [*"XYZ", *(c for c in order if c in "AC")]
        chain = free_chain(letters, order, int(rng.integers(0, len(order) + 1)),
                           np.vstack([np.eye(3) + rng.uniform(-0.2, 0.2, (3, 3)), rng.normal(size=(count, 3))]),
                           np.vstack([np.zeros((3, 3)), rng.uniform(-200, 200, (count, 3))]), rng.normal(size=3))
        joints = np.hstack([rng.uniform(-300, 300, (300, 3)), rng.uniform(-np.pi, np.pi, (300, count))])
        tips, axes = chain.forward(joints, 70.0)
        angles, _ = chain.branches(axes)
        for branch in range(2):
            steps = [chain.forward(np.hstack([np.tile(np.eye(3)[k], (300, 1)), angles[:, branch]]))[0]
                     - chain.forward(np.hstack([np.zeros((300, 3)), angles[:, branch]]))[0] for k in range(3)]
            spans = np.abs(np.linalg.det(np.stack(steps, axis=1))) > 0.05       # a rotary between them may turn X onto Y
            again, leaning_again = chain.forward(chain.placed(tips[spans], angles[spans, branch], 70.0), 70.0)
            assert spans.sum() > 100
            assert np.abs(again - tips[spans]).max() < MM and np.abs(leaning_again - axes[spans]).max() < RAD


def test_linear_axes_that_a_rotary_has_turned_into_one_plane_are_refused_by_row():
    chain = free_chain("XYZA", "XAYZ", 0, [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]])
    with pytest.raises(PostError, match="row 1: with the rotaries so, X, Y and Z move in one plane"):
        chain.placed(np.zeros((2, 3)), [[0.0], [np.pi / 2]])


def test_the_chain_is_the_product_of_its_motions():
    """Written out for a table in a trunnion and a head above it, with rotations of somebody else."""
    chain = chain_of("mill_head_table")
    q = random_joints(chain, 50, seed=9)
    turn = lambda axis, angle: Rotation.from_rotvec(np.outer(angle, axis))
    b, c = q[:, chain.letters.index("B")], q[:, chain.letters.index("C")]
    nose = turn([0, 1, 0], b).apply(np.array([0, 0, -60.0]) - [0, 0, 150]) + [0, 0, 150] + q[:, :3]
    tips, axes = chain.forward(q, 60.0)
    assert np.abs(turn([0, 0, -1], c).apply(nose - [0, 0, -620]) + [0, 0, -620] - tips).max() < MM
    assert np.abs(turn([0, 0, -1], c).apply(turn([0, 1, 0], b).apply([0, 0, 1.0])) - axes).max() < RAD


def test_three_axes_are_the_chain_without_rotaries():
    chain = find_machine("mill_3axis").kinematics
    tips = np.random.default_rng(10).uniform(-300, 300, (100, 3))
    assert chain.letters == ("X", "Y", "Z") and chain.rotaries == ()
    joints = chain.inverse(tips, np.tile([0, 0, 1.0], (100, 1)), 70.0)
    assert (joints[:, 0] == joints[:, 1]).all() and np.abs(joints[:, 0] - tips - [0, 0, 70.0]).max() < 1e-12
    with pytest.raises(PostError, match=r"row 1: the rotaries \(there are none\) cannot hold the tool along this axis"):
        chain.branches(leaning([0.0, 3.0], 0.0))


def test_an_axis_beyond_the_cones_is_refused_by_row_and_angle():
    """A head at 45 degrees leans by 90 degrees at most."""
    chain = chain_of("mill_head_table_bc")
    with pytest.raises(PostError, match=r"row 2: the rotaries C and B cannot hold .* miss it by 1\.000000 degrees") as refused:
        chain.branches(leaning([10.0, 89.9, 91.0], 40.0))
    assert refused.value.rows.tolist() == [2]


def test_a_limit_is_refused_by_row_axis_and_value():
    chain = chain_of("mill_trunnion_ac")
    joints = chain.placed(np.zeros((3, 3)) + [0, 0, -450], np.radians([[0, 0], [0, 30], [0, 30.1]]))
    with pytest.raises(PostError, match=r"row 7: A would stand at 30\.1000 degrees, its limit is 30\.0000 degrees") as refused:
        chain.refuse_beyond_limits(joints, rows=[5, 6, 7])
    assert refused.value.rows.tolist() == [7]
    with pytest.raises(PostError, match="row 0: X would stand at 301.0000 mm, its limit is 300.0000 mm, and so in 1 other rows"):
        chain.refuse_beyond_limits(np.array([[301.0, 0, 0, 0, 0]] * 2))


def test_moving_the_pivot_and_the_part_together_changes_no_angle_and_shifts_the_joints():
    chain, shift = chain_of("mill_trunnion_ac"), np.array([11.0, -7.0, 23.0])
    machine = find_machine("mill_trunnion_ac")
    moved = machine.model_copy(update={
        letter: getattr(machine, letter).model_copy(update={"offset_mm": tuple(shift)}) for letter in "ac"}).kinematics
    joints = random_joints(chain, 50, seed=11)
    tips, axes = chain.forward(joints, 33.0)
    other_tips, other_axes = moved.forward(joints + [*shift, 0, 0], 33.0)
    assert np.abs(other_tips - tips - shift).max() < MM and np.abs(other_axes - axes).max() < RAD
