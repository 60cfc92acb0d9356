"""Our chains beside LinuxCNC's own kinematics modules: the same joints for the same poses, and back.

Each chain is written from what the module's manual says of its pins; a module's pose is the tip plus the tool's length
along Z, its joints are the spindle nose.  Table-table modules count as their table turns (+A, +C right-handed), but
xyzab_tdr_kins as the tool does, seen from the part.
"""

import numpy as np
import pytest
from known_machines import JUDGED, free_chain, random_joints

from cuspline.app.catalogue import find_machine

from .linuxcnc import kinematics, spindles
from .linuxcnc.kinematics import A, B, C

pytestmark = pytest.mark.kinematics
ROTATION, OFFSET, LENGTH = np.array([3.0, -4.0, 5.0]), np.array([12.0, 20.0, 10.0]), 50.0
PIVOT = 230.0          # not the 250 with which the module begins
POINTS = {"x-rot-point": 3.0, "y-rot-point": -4.0, "z-rot-point": 5.0}
MM = 1e-9
LINEAR = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]


def table(letters, directions, far, near):
    """A table-table chain by the pivots of what is near the part and what is far from it."""
    return free_chain([*"XYZ", *letters], [*letters, *"XYZ"], 2, LINEAR + directions, [[0] * 3] * 3 + [near, far])


# chain, pins, tool length, columns of the rotaries in a pose and in joints
MODULES = {
    "xyzac-trt-kins": (table("CA", [[0, 0, 1], [1, 0, 0]], ROTATION + OFFSET * [0, 1, 1], ROTATION),
                       {**POINTS, "y-offset": 20.0, "z-offset": 10.0, "tool-offset": LENGTH}, LENGTH, (C, A), (4, 3)),
    "xyzbc-trt-kins": (table("CB", [[0, 0, 1], [0, 1, 0]], ROTATION + OFFSET * [1, 0, 1], ROTATION),
                       {**POINTS, "x-offset": 12.0, "z-offset": 10.0, "tool-offset": LENGTH}, LENGTH, (C, B), (4, 3)),
    "xyzab_tdr_kins": (table("AB", [[-1, 0, 0], [0, -1, 0]], ROTATION, ROTATION + [0, 0, 10]),
                       {**POINTS, "z-offset": 10.0, "tool-offset-z": LENGTH, "switch": 1}, LENGTH, (A, B), (3, 4)),
    "5axiskins": (free_chain("XYZCB", "XYZCB", 0, LINEAR + [[0, 0, 1], [0, -1, 0]], [[0] * 3] * 3 + [[0, 0, PIVOT]] * 2),
                  {"pivot-length": PIVOT}, 0.0, (C, B), (4, 3)),
}


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    return kinematics.built_host(tmp_path_factory.mktemp("host"))


@pytest.mark.parametrize("module", MODULES)
def test_linuxcnc_moves_its_joints_where_we_move_ours(module, host):
    chain, pins, length, in_pose, in_joints = MODULES[module]
    rng = np.random.default_rng(12)
    tips, angles = rng.uniform(-200, 200, (500, 3)), rng.uniform(-np.pi, np.pi, (500, 2))
    poses = np.zeros((500, 9))
    poses[:, :3] = tips + [0, 0, length]
    poses[:, in_pose] = np.degrees(angles)
    theirs = kinematics.joints_of(host, module, pins, poses)
    ours = chain.placed(tips, angles, length)
    assert np.abs(theirs[:, :3] - ours[:, :3]).max() < MM
    assert np.abs(theirs[:, in_joints] - np.degrees(ours[:, 3:])).max() < 1e-12


@pytest.mark.parametrize("module", MODULES)
def test_linuxcnc_finds_the_tip_where_we_find_it(module, host):
    chain, pins, length, in_pose, in_joints = MODULES[module]
    rng = np.random.default_rng(13)
    joints = np.hstack([rng.uniform(-200, 200, (500, 3)), rng.uniform(-np.pi, np.pi, (500, 2))])
    given = np.zeros((500, 9))
    given[:, :3] = joints[:, :3]
    given[:, in_joints] = np.degrees(joints[:, 3:])
    theirs = kinematics.poses_of(host, module, pins, given)
    tips, _ = chain.forward(joints, length)
    assert np.abs(theirs[:, :3] - [0, 0, length] - tips).max() < MM


@pytest.mark.parametrize("name", JUDGED)
def test_linuxcnc_puts_tip_and_axis_of_every_preset_where_our_chain_does(name, host):
    machine = find_machine(name)
    joints = random_joints(machine.kinematics, 500, seed=14)
    degrees = {c: np.degrees(joints[:, 3 + k]) for k, c in enumerate(machine.rotaries)}
    tips, axes = spindles.tool_in_part(host, machine, joints[:, :3], degrees, LENGTH)
    ours = machine.kinematics.forward(joints, LENGTH)
    assert np.abs(tips - ours[0]).max() < MM and np.abs(axes - ours[1]).max() < 1e-11
