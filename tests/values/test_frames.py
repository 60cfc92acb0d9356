"""Rigid motions."""

import numpy as np
import pytest

from cuspline.values.frames import Frame


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 0, 0), (0, -1, 0), (0.6, 0, 0.8)])
def test_a_frame_lies_along_an_axis(axis):
    turn = Frame.along(axis).rotation
    assert np.abs(turn @ turn.T - np.eye(3)).max() < 1e-12 and np.linalg.det(turn) == pytest.approx(1)
    assert turn[:, 2].tolist() == pytest.approx(axis)
