"""The rest of a program for a ball that measures less: its joint in the simulation, and a restart from any retract."""

from functools import partial

import numpy as np
import pytest
from known_programs import feed, program, rapid, tool

import cuspline
from cuspline.app.judge import moves_of_file, read_programs
from cuspline.app.reposting import for_diameter, read_job, read_tools, reposted, restart_lines, restart_rows
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind
from cuspline.stock.swept import deviations_and_moves, swept_paths
from cuspline.values.errors import InputError

BALL, LESS = 10.0, 0.014                    # the radius is 7 um less
DOME, FINE = 25.0, 900


def on_dome(points):
    """Nearest places of a dome round the origin."""
    return DOME * points / np.sqrt((points * points).sum(axis=1))[:, None]


def passes(count=4, radius=BALL / 2):
    """Passes over the dome in ZX planes 0.4 mm apart, a retract between: (start, moves)."""
    moves, start = [], (-30.0, 0.0, 40.0)
    for k in range(count):
        y, x = 0.4 * k, np.linspace(-27, 27, FINE)
        z = np.sqrt((DOME + radius) ** 2 - x * x - y * y) - radius
        moves += [rapid(x[0], y, 40.0), *(feed(*p) for p in np.column_stack([x, np.full(FINE, y), z]).tolist()),
                  rapid(x[-1], y, 40.0)]
    return start, moves


def normals():
    """(41, 3) at places of the dome that the third pass touches, up to 60 degrees steep."""
    x = np.linspace(-26, 26, 41)
    return np.column_stack([x, np.full(41, 0.4 * 2), np.sqrt((DOME + 5) ** 2 - x * x - 0.64)]) / (DOME + 5)


def left_mm(first, second, second_mm):
    """Deviation of what two balls leave there one after the other."""
    paths = [*swept_paths(first, {1: tool("ball", BALL)}), *swept_paths(second, {1: tool("ball", second_mm)})]
    return deviations_and_moves(paths, (-40, -40, -20), (40, 40, 40), DOME * normals(), normals(), 1.0)[0]


@pytest.fixture(scope="module")
def whole():
    return program(*passes())


def test_a_smaller_ball_is_seen_and_reposted_leaves_no_step(whole):
    point = restart_rows(whole)[2]
    first, rest = whole.first(int(point)), whole.between(int(point), len(whole))
    seen = left_mm(first, rest, BALL - LESS)
    assert seen == pytest.approx(LESS / 2 * (1 - normals()[:, 2]), abs=0.0003) and seen.max() > 0.003     # the tip stands right
    moved = for_diameter(rest, 1, tool("ball", BALL).cutter, BALL - LESS, on_dome)
    joint = left_mm(first, moved, BALL - LESS)
    assert np.abs(joint).max() < 0.001
    assert np.abs(left_mm(first, rest, BALL)).max() < 0.0005
    middle = moved.end_mm[moved.kind > 0] + [0, 0, (BALL - LESS) / 2]
    assert np.sqrt((middle ** 2).sum(axis=1)) == pytest.approx(DOME + (BALL - LESS) / 2, abs=1e-9)


def test_restart_points_are_all_retracts_and_the_rest_is_the_same(whole):
    points = restart_rows(whole)
    assert len(points) == 4 and (whole.start_mm[points, 2] == 40.0).all()
    for point in points.tolist():
        joined = PostedMoves.joined([whole.first(point), whole.between(point, len(whole))], [0, 0])
        assert np.array_equal(joined.end_mm, whole.end_mm) and np.array_equal(joined.start_mm, whole.start_mm)


def test_what_cannot_be_posted_again_says_so(whole):
    with pytest.raises(InputError, match="no ball"):
        for_diameter(whole, 1, tool("flat", 10).cutter, 9.99, on_dome)
    with pytest.raises(InputError, match="more than 2% apart"):
        for_diameter(whole, 1, tool("ball", 10).cutter, 9.5, on_dome)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A posted program of three operations with many retracts: the H13 block."""
    return cuspline.build("h13_test", out=tmp_path_factory.mktemp("restart") / "out", stage="gcode", stepover_mm=0.8).folder


def test_a_restart_from_any_restart_point_makes_the_same_part(folder):
    """The program up to the point, then what is posted from there: the same moves, so the same stock."""
    job, tools = read_job(folder).beside(folder), read_tools(folder)
    first = next(read_programs(folder, job, tools))
    whole = first.posted
    rows, lines = restart_rows(whole), sum(restart_lines(folder).values(), [])
    assert len(rows) >= 7 and len(set(whole.operation[rows].tolist())) == 3 and lines == np.unique(whole.line[rows]).tolist()
    read = partial(moves_of_file, setup=first.setup, machine=job.machine, tools=tools)
    for row in rows.tolist():
        rest = read(reposted(folder, int(whole.line[row])).texts[0])
        begin = int(rows[whole.line[rows] <= whole.line[row]].max())
        rest = rest.between(int(np.flatnonzero(rest.kind != Kind.RAPID)[0]), len(rest))          # behind its own approach
        own = whole.between(begin, len(whole))
        own = own.between(int(np.flatnonzero(own.kind != Kind.RAPID)[0]), len(own))
        cut = lambda moves: np.flatnonzero(moves.kind != Kind.RAPID)
        for name in ("end_mm", "tool", "spindle_rpm", "feed_mm_per_min"):
            assert getattr(rest, name)[cut(rest)] == pytest.approx(getattr(own, name)[cut(own)], abs=1e-9), (row, name)
        assert rest.start_mm[cut(rest)] == pytest.approx(own.start_mm[cut(own)], abs=1e-9)
