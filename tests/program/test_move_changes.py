"""Moves of two programs held against each other: what matches is as much as can match, and distances are true."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cuspline.posts.readers.rs274_reader import read_program
from cuspline.program.move_changes import matched, points_along, program_changes

HEAD = "G21\nG17 G90 G94\nG64 P0.001\nG54\n(OPERATION 1: FINISH, T1 BALL)\nT1 M6\nG43 H1\nS1000 M3\nG0 X0 Y0\nG0 Z5\nG1 Z0 F100\n"
PASSES = ("G1 X10 F200\nG1 Y1\n", "G1 X0 Y1 Z0\nG1 X0 Y2 Z0\n", "G18\nG3 X10 Y2 Z0 I5 K0\nG1 X10 Y3 Z0\n", "G1 X0 Y3 Z0\n")
END = "G1 X-5 Y5 Z0\nG0 Z5\nG53 G0 Z0\nM2\n"


def moves(*passes):
    return read_program(HEAD + "".join(passes) + END, work_offsets={"G54": (0, 0, 0)}, tool_lengths={1: 100.0})


def longest_common(a, b):
    """By the textbook's table."""
    table = np.zeros((len(a) + 1, len(b) + 1), int)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            table[i + 1, j + 1] = table[i, j] + 1 if x == y else max(table[i, j + 1], table[i + 1, j])
    return table[-1, -1]


@given(st.permutations(range(9)), st.sets(st.integers(0, 8)), st.sets(st.integers(0, 8)))
def test_of_moves_that_stand_once_as_many_match_as_can(order, kept, others):
    old, new = [k for k in range(9) if k in kept], [k for k in order if k in others]
    assert len(matched(old, new)) == longest_common(old, new)


@given(st.lists(st.integers(0, 3), max_size=12), st.lists(st.integers(0, 3), max_size=12))
def test_pairs_are_equal_and_ascend_on_both_sides(old, new):
    pairs = matched(old, new)
    assert all(old[i] == new[j] for i, j in pairs)
    assert all(a < c and b < d for (a, b), (c, d) in zip(pairs, pairs[1:]))


def test_a_program_is_the_same_as_itself():
    found = program_changes(moves(*PASSES), moves(*PASSES))
    assert found.changes == () and found.refed == {}


@pytest.mark.parametrize("spoil, kind, removed, added, apart", [
    (lambda p: (p[0], "G1 X0\nG1 X0 Y2.25\n", *p[2:]), "moved", 2, 2, 0.25),
    (lambda p: (*p[:3], "G1 X0 Y3 Z0\nG1 Y4\nG1 X10\n"), "added", 0, 2, None),
    (lambda p: p[:3], "removed", 1, 0, None),
    (lambda p: (p[0], "G1 X0 Z0.5\nG1 Y2 Z0.5\n", *p[2:]), "moved", 3, 3, 0.5)])
def test_a_changed_pass_is_found_and_nothing_else(spoil, kind, removed, added, apart):
    found = program_changes(moves(*PASSES), moves(*spoil(PASSES)))
    change, = (c for c in found.changes if c.operation == "finish")
    assert (change.kind, change.removed, change.added) == (kind, removed, added)
    assert (change.apart_mm, len(found.old_rows), len(found.new_rows)) == (apart and pytest.approx(apart, abs=0.02), removed, added)


def test_another_arc_between_the_same_ends_is_another_move():
    found = program_changes(moves(*PASSES), moves(*PASSES[:2], "G18\nG3 X10 Y2 Z0 I5 K-1\nG1 X10 Y3 Z0\n", PASSES[3]))
    change, = found.changes
    depth_mm = 5 - ((26 ** 0.5) - 1)
    assert (change.kind, change.added) == ("moved", 1) and change.apart_mm == pytest.approx(depth_mm, abs=0.3)


def test_another_feed_is_no_other_move():
    found = program_changes(moves(*PASSES), moves("G1 X10 F150\nG1 Y1 F200\n", *PASSES[1:]))
    assert found.changes == () and found.refed == {"finish": (1, 50.0)}


def test_points_along_an_arc_lie_on_it_and_close():
    posted = moves(*PASSES)
    row = int(np.flatnonzero(posted.kind > 1)[0])
    points = points_along(posted, row, 0.1)
    radii = np.linalg.norm(points - posted.center_mm[row], axis=1)
    assert radii == pytest.approx(5.0, abs=1e-9) and np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= 0.1
