"""Sinumerik with rotary axes: solved in joints under G93, and under TRAORI; written, read back, and spoilt."""

import re

import numpy as np
import pytest
from known_tilted import (
    FLAT,
    assert_holds_for_any_zero_and_tool,
    assert_plan_is_read,
    machine,
    operation,
    program,
    read_with_tools,
    rolling,
    upright,
)

from cuspline.posts.writers import fanuc, siemens
from cuspline.program.program import Kind
from cuspline.values.errors import PostError, ReadError


def mill(name="mill_trunnion_ac", tip="TRAORI", **control):
    return machine(name, post="siemens", tip_control=tip, **control)


def text_of(mill, *operations):
    return siemens.post(program(*operations), mill).text


@pytest.mark.parametrize("tip", (None, "TRAORI"))
@pytest.mark.parametrize("name", ("mill_trunnion_ac", "mill_head_table_bc", "mill_head_head"))
def test_what_is_read_back_is_what_was_planned(name, tip):
    """Ends, axes, and the lines between within half the path tolerance (solved) or rounding (TRAORI)."""
    m, moves = mill(name, tip), rolling()
    assert_plan_is_read(read_with_tools(m, text_of(m, operation("finish", moves))), moves, m)


@pytest.mark.parametrize("ours, theirs", [(None, None), ("TRAORI", "G43.4")])
def test_the_machine_goes_where_another_control_would_send_it(ours, theirs):
    """By posts and readers of two languages, joint for joint at every cut."""
    both = []
    for m, post in ((mill(tip=ours), siemens), (machine("mill_trunnion_ac", post="fanuc", tip_control=theirs), fanuc)):
        posted = read_with_tools(m, post.post(program(operation("rough", upright(), FLAT), operation("finish", rolling())), m).text)
        cut = posted.kind != Kind.RAPID
        both.append(np.hstack([posted.machine_end_mm[cut], posted.rotary_deg[cut]]))
    assert len(both[0]) > 80 and np.abs(both[0] - both[1]).max() < 1e-9


def test_nothing_but_moves_of_the_tip_stands_under_traori_and_the_length_comes_back():
    m = mill()
    text = text_of(m, operation("rough", upright(), FLAT), operation("finish", rolling()), operation("again", upright()))
    lines = text.splitlines()
    on, off = lines.index("TRAORI"), lines.index("TRAFOOF")
    assert lines[on - 1:on + 3] == ["D1", "TRAORI", "G54", "ORIAXES"] and lines[off + 1] == "G54" and lines.count("TRAORI") == 1
    assert not any(re.match(r"SUPA|M6|T\d|D", line) for line in lines[on + 3:off])
    posted = read_with_tools(m, text)
    assert posted.remarks == () and posted.length_offset_on[posted.kind != Kind.RAPID].all()


def test_it_holds_for_any_zero_and_tool():
    m = mill()
    text = text_of(m, operation("finish", rolling()))
    assert_holds_for_any_zero_and_tool(m, text)


@pytest.mark.parametrize("old, new, message", [
    ("\nTRAORI\n", "\n", "turns rotary axes under G94 without"), ("\nORIAXES\n", "\n", "without ORIAXES"),
    ("\nD1\nTRAORI\n", "\nTRAORI\n", "without a tool length"), ("\nTRAFOOF\n", "\n", "under tool-centre-point control"),
    ("\nORIAXES\n", "\nORIAXES\nG55\n", "G55 under tool-centre-point control"),
    ("\nORIAXES\n", "\nORIVECT\n", "is no word that this reader knows")])
def test_what_traori_lacks_is_refused(old, new, message):
    m = mill()
    text = text_of(m, operation("finish", rolling()))
    assert text.count(old) == 1
    with pytest.raises(ReadError, match=message):
        read_with_tools(m, text.replace(old, new))


def test_a_work_offset_that_is_not_named_again_is_a_remark():
    m = mill()
    text = text_of(m, operation("finish", rolling())).replace("TRAORI\nG54\n", "TRAORI\n")
    assert {r.kind for r in read_with_tools(m, text).remarks} == {"unknown_start"}


def test_the_control_must_be_its_own():
    with pytest.raises(PostError, match="tip_control M428 is no word of the post siemens, which knows TRAORI"):
        text_of(mill(tip="M428"), operation("rough", upright(), FLAT))
