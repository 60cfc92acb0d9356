"""Contours that the control runs beside (G41, RL): what is read is what was planned, at the nominal radius and a worn one."""

import re

import numpy as np
import pytest
from compensated_plate import RADIUS, TOOL, WORN, away_mm, posted, program, read

from cuspline.program.arcs import Arc
from cuspline.program.program import Kind, Plane
from cuspline.values.errors import PostError, ReadError

ARCS, LINES = ("linuxcnc", "siemens", "heidenhain"), ("fanuc", "haas")       # how corners are joined
ON = {"linuxcnc": "G41 D3", "fanuc": "G41 D3", "haas": "G41 D3", "siemens": "G41", "heidenhain": "RL"}


def beside(moves):
    """Rows between G41 and G40, the ways in and out left out."""
    rows = np.flatnonzero(moves.radius_register == 3)
    return rows[1:-1]


def places(moves, rows):
    """(n, 2) along moves."""
    out = []
    for k in rows.tolist():
        share = np.linspace(0.0, 1.0, 60)
        if moves.kind[k] == Kind.FEED:
            out.append((moves.start_mm[k] + share[:, None] * (moves.end_mm[k] - moves.start_mm[k]))[:, :2])
        else:
            arc = Arc(moves.start_mm[k], moves.end_mm[k], moves.center_mm[k], Plane.XY, moves.kind[k])
            out.append(np.array([arc.at(s)[:2] for s in share]))
    return np.vstack(out)


@pytest.mark.parametrize("post", ARCS)
def test_at_the_nominal_radius_the_moves_are_those_planned(post):
    moves, planned = read(post, posted(post)), program().operations[0].moves
    on = moves.radius_register == 3
    want = planned.end_mm[1:-1]
    assert on.sum() == len(want)
    np.testing.assert_allclose(moves.end_mm[on], want, atol=2e-3)        # three decimals of words; an inner corner has less angle
    assert (moves.kind[on] == planned.kind[1:-1]).all() and not moves.remarks


@pytest.mark.parametrize("radius_mm", [RADIUS, RADIUS - WORN])
@pytest.mark.parametrize("post", ON)
def test_the_wall_is_where_it_was_by_whatever_radius_is_measured(post, radius_mm):
    moves = read(post, posted(post), radius_mm)
    away = away_mm(places(moves, beside(moves)))
    assert away.min() > radius_mm - 2e-3
    on_wall = np.abs(away - radius_mm) < 2e-3
    assert on_wall.mean() > (0.8 if post in ARCS else 0.4)              # the rest: arcs in and out, corners of straight lines


def test_straight_corners_go_round_no_farther_than_the_radius_on_both_sides():
    away = away_mm(places(moves := read("fanuc", posted("fanuc")), beside(moves)[1:-1]))
    assert RADIUS * 1.4 < away.max() < RADIUS * np.sqrt(2.0) + 2e-3


@pytest.mark.parametrize("post", ON)
def test_a_register_that_is_wrong_moves_the_wall_by_as_much(post):
    moves = read(post, posted(post), RADIUS + 0.05)
    away = away_mm(places(moves, beside(moves)))
    assert np.abs(away - RADIUS - 0.05).min() < 2e-3 and away.min() > RADIUS + 0.045


BAD = {     # what is done to the text: (posts, pattern, what stands in its place, what the reader says)
    "D of another radius": (("linuxcnc", "fanuc", "haas"), r"G41 D3", "G41 D4", None),
    "missing G40": (tuple(ON), "", "", "write G40 before"),
    "G42 for G41": (tuple(ON), r"G41|RL", lambda m: {"G41": "G42", "RL": "RR"}[m[0]], "does not reach|inner arc"),
    "a way in that is shorter": (("linuxcnc", "fanuc"), r"G0 X34(\.?) Y-15", r"G0 X34\1 Y-13", "no longer than"),
    "D that nobody knows": (("linuxcnc", "fanuc", "haas"), "G41 D3", "G41 D77", "D77 is not known"),
    "no D": (("fanuc", "haas"), "G41 D3", "G41", "without D"),
    "the program's end before G40": (("linuxcnc", "siemens"), r"(G41.*\n)", r"\1M30\n", "write G40 before"),
    "a spindle that stops beside the contour": (("fanuc",), r"(G41.*\n)", r"\1M5\n", "write G40 before"),
    "up beside the contour": (("linuxcnc", "haas"), r"(G41.*\n)", r"\1G1 Z5.\n", "without a way in X or Y"),
    "G450 unsaid": (("siemens",), "NORM G450", "NORM", "G450"),
}


@pytest.mark.parametrize("bad, post", [(bad, post) for bad, (posts, *_) in BAD.items() for post in posts])
def test_known_bad_words_are_found(bad, post):
    _, pattern, other, why = BAD[bad]
    text = posted(post)
    if bad == "missing G40":
        head, tail = text.split(ON[post], 1)
        spoilt = head + ON[post] + re.sub(r"\bG40 | R0(?=\n)", "", tail, count=1)
    else:
        spoilt = re.sub(pattern, other, text, count=1)
    assert spoilt != text
    if why is None:
        remark, = read(post, spoilt).remarks
        assert remark.kind == "wrong_radius_offset" and remark.amount_mm == pytest.approx(1.0)
        return
    if bad == "G42 for G41":
        try:
            moves = read(post, spoilt)
        except ReadError as error:
            assert re.search(why, str(error))
        else:
            away = away_mm(places(moves, beside(moves)))
            assert away.min() < 0.5 * RADIUS                # through the part: a gouge
        return
    with pytest.raises(ReadError, match=why) as error:
        read(post, spoilt)
    assert error.value.rows[0] > 5


@pytest.mark.parametrize("post", ["linuxcnc", "fanuc"])
def test_an_inner_arc_no_wider_than_the_register_is_refused_with_its_line(post):
    text = posted(post)
    with pytest.raises(ReadError, match="inner arc of 8.000 mm, and 8.100 mm in D3") as error:
        read(post, text.replace("Y-15", "Y-25"), 8.1)
    assert re.search("G3", text.split("\n")[int(error.value.rows[0]) - 1])


@pytest.mark.parametrize("post", ["grbl", "pmac"])
def test_a_control_without_compensation_refuses_in_one_sentence(post):
    with pytest.raises(PostError, match="has no cutter compensation"):
        posted(post)


def test_one_speed_goes_with_compensation():
    with pytest.raises(PostError, match="give it one speed"):
        posted("linuxcnc", rpm_changes=((2, 2500.0),))


def test_the_operator_reads_which_radii_may_stand_in_the_register():
    assert f"(D{TOOL.number} IS THE RADIUS AS MEASURED: 4.900 TO 5.000 MM)" in posted("linuxcnc")
