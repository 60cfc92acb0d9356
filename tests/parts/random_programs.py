"""Programs made at random, small enough to be posted and read back by the hundred, and the comparison of what was read."""

import math

import numpy as np
from known_tools import tool

from cuspline.program.program import Kind, MoveWriter, Operation, Plane, Program

CLEARANCE_MM = 60.0
TOOLS = tuple(tool(kind, size, number=n) for kind, size, n in (("flat", 10, 3), ("ball", 6, 7), ("ball", 8, 12)))
LENGTHS = {t.number: t.length_mm for t in TOOLS}
WCS = "G55"
COOLANTS = ("off", "mist", "flood")


def random_program(seed, planes=tuple(Plane), moves=12, helices=tuple(Plane)):
    """One to four operations of lines, arcs and helices in those planes, rapids, feeds, speeds, coolants."""
    rng = np.random.default_rng(seed)
    operations = tuple(Operation(
        name=f"cut {k}", tool=TOOLS[rng.integers(len(TOOLS))], spindle_rpm=float(rng.integers(4000, 12000)),
        coolant=COOLANTS[rng.integers(3)], moves=_moves(rng, planes, moves, helices)) for k in range(rng.integers(1, 5)))
    return Program(name="random", setup="setup-1", wcs=WCS, wcs_in_words="corner", clearance_z_mm=CLEARANCE_MM,
                   header=("RANDOM",), operations=operations)


def _moves(rng, planes, count, helices):
    x, y = rng.uniform(-100, 100, 2)
    w = MoveWriter((x, y, CLEARANCE_MM))
    for _ in range(count):
        feed = float(rng.integers(50, 2000))
        chance = rng.random()
        if chance < 0.1:
            w.rapid((*w.here_mm[:2], CLEARANCE_MM))
            w.rapid((*rng.uniform(-100, 100, 2), CLEARANCE_MM))
        elif chance < 0.5:
            w.feed((*rng.uniform(-100, 100, 2), rng.uniform(-20, 40)), feed)
        else:
            _arc(w, rng, planes[rng.integers(len(planes))], feed, helices)
    w.rapid((*w.here_mm[:2], CLEARANCE_MM))
    return w.moves()


def _arc(w, rng, plane, feed, helices):
    """An arc, or one in three times a helix, of at most 340 degrees."""
    a, b, third = plane.axes
    radius, first, turn = rng.uniform(1.0, 40.0), rng.uniform(0, 2 * math.pi), rng.uniform(0.05, 5.9)
    is_clockwise = bool(rng.random() < 0.5)
    center, end = w.here_mm.copy(), w.here_mm.copy()
    center[[a, b]] -= radius * np.array([math.cos(first), math.sin(first)])
    last = first - turn if is_clockwise else first + turn
    end[[a, b]] = center[[a, b]] + radius * np.array([math.cos(last), math.sin(last)])
    if rng.random() < 0.3 and plane in helices:
        end[third] += rng.uniform(-5, 5)
    w.arc(end, center, plane, is_clockwise, feed)


def assert_reads_as(program, moves, control, helix_ends=1.0):
    """The moves read are the program's, operation by operation, to half the last digit.

    Args:
        moves: posted.PostedMoves, all files joined.   control: machines.Control.
        helix_ends: half last digits by which helices may end elsewhere.
    """
    half_mm = 0.5 * control.resolution_mm * (1 + 1e-6)
    half_feed = 0.5 * control.resolution_mm * 10.0 ** (control.decimals - control.decimals_feed) * (1 + 1e-6)
    assert moves.operations == tuple(o.name for o in program.operations) and moves.ended
    for index, operation in enumerate(program.operations):
        wanted, rows = operation.moves, np.flatnonzero(moves.operation == index)
        rows = rows[np.isfinite(moves.start_mm[rows]).all(axis=1)]
        first = rows[moves.kind[rows] != Kind.RAPID][0]
        rows = rows[(rows >= first) & (rows < first + len(wanted))]
        skipped = int(np.flatnonzero(wanted.kind != Kind.RAPID)[0])
        part = slice(skipped, None)
        rows = rows[:len(wanted) - skipped]
        np.testing.assert_array_equal(moves.kind[rows], wanted.kind[part])
        is_arc = wanted.kind[part] >= Kind.ARC_CW
        np.testing.assert_array_equal(moves.plane[rows][is_arc], wanted.plane[part][is_arc])
        third = np.array([(2, 1, 0)[p] for p in wanted.plane[part]])
        rises = np.abs((wanted.end_mm - wanted.starts_mm)[part][np.arange(len(third)), third]) > 1e-9
        allowed = np.where(is_arc & (rises | (helix_ends > 1)), helix_ends, 1.0) * half_mm     # arcs keep an axis as it stands
        off = np.abs(moves.end_mm[rows] - wanted.end_mm[part])
        assert (off <= allowed[:, None]).all(), off.max()
        plane_axes = np.array([(0, 1), (2, 0), (1, 2)])[wanted.plane[part][is_arc]]
        off = np.abs(moves.center_mm[rows] - wanted.center_mm[part])[is_arc][np.arange(len(plane_axes))[:, None], plane_axes]
        assert (off <= 2 * half_mm + (helix_ends > 1) * helix_ends * half_mm).all(), off.max()
        cuts = wanted.kind[part] != Kind.RAPID
        assert np.abs(moves.feed_mm_per_min[rows] - wanted.feed_mm_per_min[part])[cuts].max() <= half_feed
        assert set(moves.tool[rows]) == {operation.tool.number} and set(moves.spindle_rpm[rows]) == {operation.spindle_rpm}
        assert moves.length_offset_on[rows].all()
