"""Fanuc with rotary axes: solved in joints under G93, and under G43.4; written, read back, and spoilt."""

import re

import numpy as np
import pytest
from known_machines import FIVE_AXIS
from known_tilted import BALL, FLAT, machine, off_lines, operation, program, rolling, upright

from cuspline.app.catalogue import reader_of
from cuspline.posts.writers import fanuc
from cuspline.program.program import Kind
from cuspline.values.errors import PostError, ReadError

ROUNDING_MM = 2e-4          # four decimals of a length, five of a degree 300 mm from a rotary
ROUNDING_RAD = 2e-7
LENGTHS = {7: BALL.length_mm, 3: FLAT.length_mm + 4.0}


def mill(name="mill_trunnion_ac", tip=None, **control):
    return machine(name, post="fanuc", tip_control=tip, **control)


def text_of(mill, *operations):
    return fanuc.post(program(*operations), mill).text


def read(mill, text, lengths=LENGTHS):
    return reader_of(mill)(text, work_offsets={"G54": mill.wcs_origin_mm}, tool_lengths=lengths)


@pytest.mark.parametrize("tip", (None, "G43.4"))
@pytest.mark.parametrize("name", FIVE_AXIS)
def test_what_is_read_back_is_what_was_planned(name, tip):
    """Ends, axes, and the lines between within half the path tolerance (solved) or rounding (G43.4)."""
    m, moves = mill(name, tip), rolling()
    posted = read(m, text_of(m, operation("finish", moves)))
    assert posted.remarks == () and posted.ended
    for k in range(1, len(moves)):
        near = np.linalg.norm(posted.end_mm - moves.end_mm[k], axis=1)
        hit = np.nanargmin(np.where(np.linalg.norm(posted.end_axis - moves.axis[k], axis=1) < 1e-3, near, np.inf))
        assert near[hit] < ROUNDING_MM and np.abs(posted.end_axis[hit] - moves.axis[k]).max() < ROUNDING_RAD
    arc = int(np.flatnonzero(moves.kind > Kind.FEED)[0])
    cut = np.flatnonzero((posted.kind == Kind.FEED) & (posted.end_mm[:, 0] < moves.end_mm[arc - 1, 0] - 1))
    allowed = ROUNDING_MM + (0.5 * m.control.path_tolerance_mm if tip is None else 0.0)
    assert len(cut) > 50 and off_lines(posted.end_mm[cut], moves.starts_mm[1:arc], moves.end_mm[1:arc]).max() < allowed


def test_the_orientation_is_stated_after_every_tool_change_and_g43_4_comes_with_the_first_move():
    m = mill(tip="G43.4")
    text = text_of(m, operation("rough", upright(), FLAT), operation("finish", rolling()), operation("again", upright()))
    lines = text.splitlines()
    on = next(k for k, line in enumerate(lines) if line.startswith("G43.4"))
    assert re.fullmatch(r"G43\.4 G0 X\S+ Y\S+ Z\S+ H7", lines[on])
    off = lines.index("G49")
    assert not any(re.match(r"G53|G91|G28|M6|T", line) for line in lines[on:off])
    changes = [k for k, line in enumerate(lines) if line.endswith(" M6")]
    assert len(changes) == 3 and [lines[k + 1] for k in changes] == ["G53 G0 C0. A0.", lines[changes[1] + 1], "G53 G0 C0. A0."]
    assert {"C", "A"} <= {w[0] for w in lines[changes[1] + 1].split()}
    assert read(m, text).remarks == ()


def test_g43_4_holds_for_any_zero_and_tool():
    m = mill(tip="G43.4")
    text = text_of(m, operation("finish", rolling()))
    here = read(m, text)
    x, y, z = m.wcs_origin_mm
    there = read(m.model_copy(update={"wcs_origin_mm": (x - 2, y + 1, z + 3)}), text, {7: BALL.length_mm - 6})
    begin = int(np.nanargmin(np.linalg.norm(here.end_mm - rolling().end_mm[1], axis=1)))
    assert np.abs(here.end_mm - there.end_mm)[begin:-2].max() < 1e-9


@pytest.mark.parametrize("tip", (None, "G43.4"))
def test_rotary_words_are_degrees_in_inches_too(tip):
    in_mm, in_inches = (text_of(mill(tip=tip, units=unit), operation("finish", rolling())) for unit in ("mm", "inch"))
    turned = lambda text: [re.findall(r"[AC](-?[0-9.]+)", line) for line in text.splitlines() if not line.startswith("(")]
    assert turned(in_mm) == turned(in_inches) and sum(map(len, turned(in_mm))) > 50


def spoilt(old, new, tip="G43.4", count=1):
    m = mill(tip=tip)
    text = text_of(m, operation("finish", rolling()))
    assert old in text
    return m, text.replace(old, new, count)


def test_without_g43_4_it_is_refused():
    with pytest.raises(ReadError, match="turns rotary axes under G94 without tool-centre-point control"):
        read(*spoilt("G43.4 G0", "G43 G0"))


def test_without_any_length_it_is_named():
    m, text = spoilt("G43.4 G0", "G0")
    with pytest.raises(ReadError, match="without tool-centre-point control|no code in this block uses H"):
        read(m, text)


def test_a_wrong_h_is_named_and_cuts_beside_the_plan():
    posted = read(*spoilt(" H7", " H3"))
    assert {r.kind for r in posted.remarks} == {"wrong_length_offset"} and posted.remarks[0].amount_mm == pytest.approx(4.0)
    assert np.nanmin(np.linalg.norm(posted.end_mm - rolling().end_mm[6], axis=1)) > 1.0


def test_a_missing_g49_is_refused():
    with pytest.raises(ReadError, match="G28 under tool-centre-point control"):
        read(*spoilt("\nG49\n", "\n"))


def test_rotary_words_in_inches_cut_elsewhere():
    """A post that scales degrees as if they were millimetres."""
    m = mill(tip="G43.4")
    text = text_of(m, operation("finish", rolling()))
    scaled = re.sub(r"\b([AC])(-?[\d.]+)", lambda w: f"{w[1]}{float(w[2]) / 25.4:.5f}", text)
    posted, meant = read(m, scaled), read(m, text)
    assert np.abs(posted.rotary_deg[-5:] - meant.rotary_deg[-5:]).max() > 5


def test_a_rotary_word_without_a_point_is_refused():
    with pytest.raises(ReadError, match="without a decimal point"):
        read(mill(), "%\nO1\nG21\nG54\nG0 A10\nM30\n%\n")


def test_the_control_must_be_its_own():
    with pytest.raises(PostError, match="tip_control M428 is no word of the post fanuc, which knows G43.4"):
        text_of(mill(tip="M428"), operation("rough", upright(), FLAT))
