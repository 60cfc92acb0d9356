"""Fanuc with rotary axes: solved in joints under G93, and under G43.4; written, read back, and spoilt."""

import re

import numpy as np
import pytest
from known_machines import FIVE_AXIS
from known_tilted import (
    FLAT,
    assert_holds_for_any_zero_and_tool,
    assert_plan_is_read,
    assert_position_is_read,
    machine,
    operation,
    position,
    program,
    read_with_tools,
    rolling,
    upright,
)

from cuspline.posts.writers import fanuc
from cuspline.values.errors import PostError, ReadError


def mill(name="mill_trunnion_ac", tip=None, **control):
    return machine(name, post="fanuc", tip_control=tip, **control)


def text_of(mill, *operations):
    return fanuc.post(program(*operations), mill).text


@pytest.mark.parametrize("tip", (None, "G43.4"))
@pytest.mark.parametrize("name", FIVE_AXIS)
def test_what_is_read_back_is_what_was_planned(name, tip):
    """Ends, axes, and the lines between within half the path tolerance (solved) or rounding (G43.4)."""
    m, moves = mill(name, tip), rolling()
    assert_plan_is_read(read_with_tools(m, text_of(m, operation("finish", moves))), moves, m)


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
    assert read_with_tools(m, text).remarks == ()


def test_g43_4_holds_for_any_zero_and_tool():
    m = mill(tip="G43.4")
    text = text_of(m, operation("finish", rolling()))
    assert_holds_for_any_zero_and_tool(m, text)


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
        read_with_tools(*spoilt("G43.4 G0", "G43 G0"))


def test_without_any_length_it_is_named():
    m, text = spoilt("G43.4 G0", "G0")
    with pytest.raises(ReadError, match="without tool-centre-point control|no code in this block uses H"):
        read_with_tools(m, text)


def test_a_wrong_h_is_named_and_cuts_beside_the_plan():
    posted = read_with_tools(*spoilt(" H7", " H3"))
    assert {r.kind for r in posted.remarks} == {"wrong_length_offset"} and posted.remarks[0].amount_mm == pytest.approx(4.0)
    assert np.nanmin(np.linalg.norm(posted.end_mm - rolling().end_mm[6], axis=1)) > 1.0


def test_a_missing_g49_is_refused():
    with pytest.raises(ReadError, match="G28 under tool-centre-point control"):
        read_with_tools(*spoilt("\nG49\n", "\n"))


def test_rotary_words_in_inches_cut_elsewhere():
    """A post that scales degrees as if they were millimetres."""
    m = mill(tip="G43.4")
    text = text_of(m, operation("finish", rolling()))
    scaled = re.sub(r"\b([AC])(-?[\d.]+)", lambda w: f"{w[1]}{float(w[2]) / 25.4:.5f}", text)
    posted, meant = read_with_tools(m, scaled), read_with_tools(m, text)
    assert np.abs(posted.rotary_deg[-5:] - meant.rotary_deg[-5:]).max() > 5


def test_a_rotary_word_without_a_point_is_refused():
    with pytest.raises(ReadError, match="without a decimal point"):
        read_with_tools(mill(), "%\nO1\nG21\nG54\nG0 A10\nM30\n%\n")


def test_the_control_must_be_its_own():
    with pytest.raises(PostError, match="tip_control M428 is no word of the post fanuc, which knows G43.4"):
        text_of(mill(tip="M428"), operation("rough", upright(), FLAT))


# tilted planes ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FIVE_AXIS)
@pytest.mark.parametrize("tilt_deg, azimuth_deg", [(25.0, 70.0), (40.0, -110.0)])
def test_an_indexed_position_stands_in_a_tilted_plane(name, tilt_deg, azimuth_deg):
    m, side = mill(name, "G43.4"), position(tilt_deg, azimuth_deg)
    x, y, z = m.wcs_origin_mm
    m = m.model_copy(update={"wcs_origin_mm": (x, y, z + 80.0)})       # within reach of heads that lean
    text = text_of(m, operation("finish", upright()), side)
    lines = text.splitlines()
    on = next(k for k, line in enumerate(lines) if line.startswith("G68.2 X0. Y0. Z0. I"))
    assert lines[on + 1] == "G53.1" and re.fullmatch(r"G43 G0( [XYZ]\S+){3} H7", lines[on + 2])
    off = lines.index("G49", on)
    assert lines[off:off + 2] == ["G49", "G69"] and not any(re.search("[ABC]", line) for line in lines[on:off])
    assert_position_is_read(read_with_tools(m, text), side, 1)


def tilted():
    m = mill(tip="G43.4")
    return m, text_of(m, position(40.0, 30.0))


@pytest.mark.parametrize("old, new, message", [
    ("\nG49\nG69\n", "\nG49\n", "G28 in a tilted plane"), ("\nG49\nG69\n", "\nG69\n", "G69 while a tool length is in force"),
    ("\nG53.1\n", "\n", "a move between G68.2 and G53.1"), ("J40.", "J30.", "G53.1 would turn the rotary axes"),
    ("K0.", "", "G68.2 without all of X Y Z I J K"), ("\nG49\nG69\n", "\nG53 G0 A0.\nG49\nG69\n", "G53 in a tilted plane")])
def test_what_a_tilted_plane_lacks_is_refused(old, new, message):
    m, text = tilted()
    assert old in text
    with pytest.raises(ReadError, match=message):
        read_with_tools(m, text.replace(old, new))


def test_a_plane_turned_about_its_own_axis_is_read_as_it_says():
    """K turns what is programmed about the tool."""
    m, text = tilted()
    posted, meant = read_with_tools(m, text.replace("K0.", "K90.")), read_with_tools(m, text)
    axis = meant.end_axis[-6]
    off = posted.end_mm[-6] - meant.end_mm[-6]
    assert abs(off @ axis) < 1e-9 and np.linalg.norm(off) > 1.0
