"""A finding names the block and where the machine's axes stand there."""

import numpy as np
import pytest
from known_programs import feed, program

from cuspline.values.findings import Finding, axes_upright, located
from cuspline.values.frames import Frame

TURNED = Frame(rotation=np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]), origin_mm=(10.0, 20.0, 30.0))
WCS, LENGTH = np.array([-300.0, -200.0, -400.0]), 120.0
LINES = [f"N{k} G1 X{k}" for k in range(1, 20)]


def posted(known=True):
    moves = [feed(1, 2, -3), feed(4, 5, -6)]
    end = np.array([m[1] for m in moves], float)
    return program((0, 0, 0), moves, machine_end_mm=end + WCS + (0, 0, LENGTH) if known else np.full((2, 3), np.nan))


def finding(line, place=(11.0, 18.0, 33.0)):
    return Finding(kind="gouge", amount_mm=0.02, place_mm=place, operation="finish", line=line, setup="setup-1", advice="")


@pytest.mark.parametrize("known", [True, False])
def test_axes_are_frame_offset_and_length_one_after_the_other(known):
    (found,) = located([finding(11)], posted(known), LINES, axes_upright(posted(known), TURNED, WCS, {1: (0.0, 0.0, LENGTH)}))
    assert found.machine_mm == pytest.approx((-300 + 1, -200 + 2, -400 - 3 + LENGTH))
    assert found.block == "N11 G1 X11" and found.place_mm == (11.0, 18.0, 33.0)
    assert {"kind", "amount_mm", "place_mm", "machine_mm", "operation", "line", "block", "setup", "advice",
            "call_line", "amount", "unit", "is_at_least"} == set(found.as_dict())


@pytest.mark.parametrize("line,place,block", [(0, (1.0, 2.0, 3.0), ""), (11, None, "N11 G1 X11"), (400, (1.0, 2.0, 3.0), "")])
def test_what_is_not_known_is_left_open(line, place, block):
    (found,) = located([finding(line, place)], posted(), LINES, axes_upright(posted(), TURNED, WCS, {1: (0.0, 0.0, LENGTH)}))
    assert found.machine_mm is None and found.block == block
