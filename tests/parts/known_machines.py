"""Five-axis machines that tests share, and tool axes to ask them for."""

import numpy as np

from cuspline.app.catalogue import find_machine
from cuspline.shop.kinematics import Chain

FIVE_AXIS = ("mill_head_head", "mill_table_table", "mill_head_table", "mill_a_on_b", "mill_trunnion_ac", "mill_head_table_bc")
JUDGED = (*FIVE_AXIS[:-1], "mill_gantry_5axis")     # by kinematics of LinuxCNC's own, which has no head at 45 degrees


def chain_of(name, **changed):
    """The kinematics of a machine, rotaries (or anything else) changed."""
    machine = find_machine(name)
    return type(machine).model_validate({**machine.model_dump(), **changed}).kinematics


def free_chain(letters, carried, bed, directions, pivots=None, spindle=(0, 0, 1), low=None, high=None):
    """A chain by its directions and pivots alone; rotaries without ranges."""
    unit = np.array(directions, float)
    m = len(letters)
    return Chain(letters=tuple(letters), order=[letters.index(c) for c in carried], bed=bed,
                 direction=unit / np.linalg.norm(unit, axis=1)[:, None],
                 pivot_mm=np.zeros((m, 3)) if pivots is None else pivots, spindle=np.array(spindle) / np.linalg.norm(spindle),
                 low=np.full(m, -np.inf) if low is None else low, high=np.full(m, np.inf) if high is None else high,
                 speed=np.ones(m), acceleration=np.ones(m))


def leaning(tilt_deg, azimuth_deg):
    """(n, 3) axes that lean from Z by a tilt, toward an azimuth."""
    tilt, azimuth = np.broadcast_arrays(np.radians(np.atleast_1d(tilt_deg).astype(float)), np.radians(azimuth_deg))
    return np.column_stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])


def random_joints(chain, count, seed):
    """(count, m) joints within travels and ranges."""
    rng = np.random.default_rng(seed)
    low, high = np.where(np.isfinite(chain.low), chain.low, -np.pi), np.where(np.isfinite(chain.high), chain.high, np.pi)
    return rng.uniform(low, high, (count, len(low)))
