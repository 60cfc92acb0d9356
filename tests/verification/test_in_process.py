"""Stock after every operation: its volume, its hash and its file."""

import dataclasses

import numpy as np
import pytest
from known_programs import feed, program, rapid, tool

from cuspline.design import Setup, StockBox
from cuspline.kernel import solids
from cuspline.verification.in_process import operation_ends, stock_states
from cuspline.verification.verdict import SetupProgram

STOCK = StockBox(min_mm=(0, 0, 0), max_mm=(20, 16, 12))
TOOLS = {1: tool("flat", 4.0), 2: tool("flat", 6.0, number=2)}
ABOVE = Setup(name="setup-1", wcs_in_words="", faces=("f",))
BELOW = Setup(name="setup-2", wcs_in_words="", faces=("f",), wcs_origin_mm=(0, 16, 0), wcs_z=(0, 0, -1))


def slots(*ys, z=8.0, setup=ABOVE):
    """One operation a slot along X, 4 wide, then 6 wide."""
    moves = [m for y in ys for m in (rapid(-5, y, z), feed(25, y, z), rapid(25, y, 30))]
    n = len(moves)
    return SetupProgram(posted=program((-5, ys[0], 30), moves, tool=np.repeat(np.arange(n // 3) % 2 + 1, 3),
                                       operation=np.repeat(np.arange(n // 3), 3), operations=("rough", "finish", "rest")[:n // 3]),
                        setup=setup, faces=())


def states(*programs, pitch=0.1):
    return list(stock_states(programs, TOOLS, STOCK, [pitch] * len(programs)))


def test_each_operation_leaves_what_it_did_not_take():
    found = states(slots(3, 10), slots(8, z=-4.0, setup=BELOW))
    assert [s.file for s in found] == ["setup-1.stock-1.stl", "setup-1.stock-2.stl", "setup-2.stock-1.stl"]
    assert [s.operation for s in found] == ["rough", "finish", "rough"]
    want = 20 * (16 * 12 - 4 * np.array([4, 10, 14]))          # the last comes from below, 4 deep: z 0..4
    np.testing.assert_allclose([s.solid.volume() for s in found], want, rtol=0.015)
    fine = states(slots(3, 10), pitch=0.02)
    np.testing.assert_allclose([s.solid.volume() for s in fine], want[:2], rtol=0.003)


def test_the_hash_tells_what_was_cut_and_nothing_else():
    one, again = states(slots(3, 10)), states(slots(3, 10), pitch=0.3)
    assert [s.inputs_sha256 for s in one] == [s.inputs_sha256 for s in again]
    other = states(slots(3, 10.5))
    assert other[0].inputs_sha256 == one[0].inputs_sha256 and other[1].inputs_sha256 != one[1].inputs_sha256
    comments = slots(3, 10)
    comments = dataclasses.replace(comments, posted=dataclasses.replace(comments.posted, line=comments.posted.line + 7))
    assert [s.inputs_sha256 for s in states(comments)] == [s.inputs_sha256 for s in one]
    worn = dict(TOOLS) | {1: tool("flat", 3.9)}
    assert next(iter(stock_states([slots(3, 10)], worn, STOCK, [0.1]))).inputs_sha256 != one[0].inputs_sha256


def test_the_file_holds_a_closed_solid_and_is_the_same_each_time():
    solid = states(slots(3))[0].solid
    text = solids.stl_of(solid)
    assert text == solids.stl_of(states(slots(3))[0].solid)
    rows = np.frombuffer(text[84:], dtype=[("f", "<f4", 12), ("attributes", "<u2")])
    assert len(rows) == np.frombuffer(text[80:84], "<u4")[0] == solid.num_tri()
    corners = rows["f"][:, 3:].reshape(-1, 3, 3).astype(float)
    assert np.einsum("nc,nc->n", corners[:, 0],
                     np.cross(corners[:, 1], corners[:, 2])).sum() / 6 == pytest.approx(solid.volume(), rel=1e-5)


def test_moves_before_the_first_operation_are_kept_with_it():
    posted = slots(3, 10).posted
    early = dataclasses.replace(posted, operation=np.array([-1, 0, 0, 1, 1, 1]))
    assert operation_ends(early) == [3, 6] and operation_ends(posted) == [3, 6]
    assert len(posted.between(0, 3)) == 3 and not posted.between(0, 3).ended
