"""Rotary axes of Haas, Heidenhain and Siemens: tip control and indexed positions, written, read back, and spoilt.

Accept new gold files with   CUSPLINE_ACCEPT_GOLD=1 pytest tests/posts/test_rotary_dialects.py
"""

import dataclasses
import os
import re
from pathlib import Path

import numpy as np
import pytest
from known_machines import leaning
from known_tilted import (
    FLAT,
    LENGTHS,
    assert_holds_for_any_zero_and_tool,
    assert_plan_is_read,
    assert_position_is_read,
    machine,
    operation,
    position,
    program,
    random_leaning,
    read_with_tools,
    rolling,
    upright,
)

from cuspline.app import catalogue
from cuspline.posts import restart
from cuspline.program.program import Kind
from cuspline.values.errors import PostError, ReadError

TIP = {"haas": "G234", "heidenhain": "TCPM", "siemens": "TRAORI"}
RECORD = {"siemens": {"swivel_record": "TC1"}}
TABLES = ("mill_trunnion_ac", "mill_table_table")
HEADS = ("mill_head_table_bc", "mill_head_head")
EVERY = pytest.mark.parametrize("post", TIP)
ON_MACHINES = [*(("haas", name) for name in TABLES),
               *((post, name) for post in ("heidenhain", "siemens") for name in (*TABLES, *HEADS))]
BEGIN = {"haas": "G254", "heidenhain": "PLANE SPATIAL", "siemens": 'CYCLE800(0,"TC1",0,39,0,0,0,'}
END = {"haas": "G255", "heidenhain": "PLANE RESET STAY", "siemens": "CYCLE800()"}


def mill(post, name="mill_trunnion_ac", tip="own", **control):
    return machine(name, post=post, tip_control=TIP[post] if tip == "own" else tip, **RECORD.get(post, {}), **control)


def fanuc():
    return machine("mill_trunnion_ac", post="fanuc", tip_control="G43.4")


def text_of(m, *operations):
    return catalogue.find_post(m.control.post).post(program(*operations), m).text


def within_reach(m):
    """Of heads that lean: the zero 80 mm higher."""
    x, y, z = m.wcs_origin_mm
    return m.model_copy(update={"wcs_origin_mm": (x, y, z + 80.0)})


@EVERY
def test_the_whole_text_is_the_accepted_one(post):
    m = catalogue.find_machine(f"mill_{post}_5axis")
    text = text_of(m, operation("rough", upright(), FLAT), operation("finish", rolling()), position(25.0, 70.0))
    path = Path(__file__).parents[1] / f"gold/leaning_program_{post}.{catalogue.find_post(post).EXTENSION}"
    if os.environ.get("CUSPLINE_ACCEPT_GOLD"):
        path.write_text(text)
    assert text == path.read_text()


# the tip's control ----------------------------------------------------------------------------


@pytest.mark.parametrize("post, name", ON_MACHINES)
def test_what_is_read_back_is_what_was_planned(post, name):
    m, moves = mill(post, name), rolling()
    assert_plan_is_read(read_with_tools(m, text_of(m, operation("finish", moves))), moves, m)


def test_haas_takes_joints_with_their_times_too():
    m, moves = mill("haas", tip=None), rolling()
    text = text_of(m, operation("finish", moves))
    assert "\nG93\n" in text and "G234" not in text
    assert_plan_is_read(read_with_tools(m, text), moves, m)


def test_klartext_without_tip_control_takes_no_leaning_tool():
    with pytest.raises(PostError, match='operation finish: the post heidenhain states no times .* write tip_control = "TCPM"'):
        text_of(mill("heidenhain", tip=None), operation("finish", rolling()))
    m = mill("heidenhain", tip=None)
    assert read_with_tools(m, text_of(m, operation("rough", upright(), FLAT))).ended


@EVERY
def test_the_machine_goes_where_a_fanuc_would_send_it(post):
    """By posts and readers of two languages, joint for joint at every cut, with the same times."""
    both = []
    for m in (mill(post), fanuc()):
        posted = read_with_tools(m, text_of(m, operation("rough", upright(), FLAT), operation("finish", rolling())))
        cut = posted.kind != Kind.RAPID
        both.append(np.hstack([posted.machine_end_mm[cut], posted.rotary_deg[cut]]))
    assert len(both[0]) > 80 and np.abs(both[0] - both[1]).max() < 1e-9


@EVERY
def test_it_holds_for_any_zero_and_tool(post):
    m = mill(post)
    text = text_of(m, operation("finish", rolling()))
    assert_holds_for_any_zero_and_tool(m, text)


def test_how_haas_begins_and_ends_it():
    lines = text_of(mill("haas"), operation("rough", upright(), FLAT), operation("finish", rolling()),
                    operation("again", upright())).splitlines()
    on = next(k for k, line in enumerate(lines) if line.startswith("G234"))
    assert re.fullmatch(r"G234 G0 X\S+ Y\S+ Z\S+ H7", lines[on])
    off = lines.index("G49", on)
    assert not any(re.match(r"G53|G28|M6|T", line) for line in lines[on:off]) and "T7 M6" in lines[off:]


def test_how_klartext_begins_and_ends_it():
    lines = [re.sub(r"^\d+ ", "", line) for line in text_of(mill("heidenhain"), operation("rough", upright(), FLAT), operation(
        "finish", rolling()), operation("again", upright())).splitlines()]
    on, off = lines.index("FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS"), lines.index("FUNCTION RESET TCPM")
    assert re.fullmatch(r"L X\S+ Y\S+ Z\S+ R0 FMAX", lines[on + 1])
    assert not any(re.search(r"M91|TOOL CALL|CYCL", line) for line in lines[on:off])
    assert any(re.match(r"L .*A[-+]\S+ F[0-9.]+$", line) for line in lines[on:off])


def test_blocks_in_which_the_tip_hardly_moves_take_as_long_on_a_tnc_as_elsewhere():
    """It has no word for a block's time: the feed is that of the way as it is written, or of the rotary axes."""
    moves = rolling()
    ends, axes = moves.end_mm.copy(), moves.axis.copy()
    ends[4:6] = ends[3] + (0.0, 0.0, 0.003)
    axes[4], axes[5:] = leaning(20.0, 100.0)[0], leaning(15.0, 60.0)[0]
    still = operation("finish", dataclasses.replace(moves, end_mm=ends, axis=axes))
    both = []
    for m in (mill("heidenhain"), fanuc()):
        posted = read_with_tools(m, text_of(m, still))
        slow = (posted.feed_mm_per_min > 0) & (posted.feed_mm_per_min < 10)
        way = np.linalg.norm(posted.end_mm - posted.start_mm, axis=1)[slow]
        both.append((slow.sum(), 60 * (way / posted.feed_mm_per_min[slow]).sum()))
    assert both[0][0] == both[1][0] > 3 and both[0][1] == pytest.approx(both[1][1], rel=0.03)


@EVERY
def test_a_small_store_splits_it_into_files_that_each_begin_like_a_program(post):
    large = mill(post)
    told = [operation(f"finish {k}", rolling()) for k in range(3)]
    small = mill(post, program_store_bytes=len(text_of(large, told[0])) + 900)
    texts = catalogue.find_post(post).post(program(*told), small).texts
    assert len(texts) > 1 and all(len(t) <= small.control.program_store_bytes for t in texts)
    cuts = lambda parts: np.vstack([p.end_mm[p.kind == Kind.FEED] for p in parts])
    read = [read_with_tools(large, t) for t in texts]
    assert all(p.ended and p.remarks == () for p in read)
    np.testing.assert_allclose(cuts(read), cuts([read_with_tools(large, text_of(large, *told))]), atol=1e-9)


# indexed positions ------------------------------------------------------------------------------


@pytest.mark.parametrize("post, name", ON_MACHINES)
@pytest.mark.parametrize("tilt_deg, azimuth_deg", [(25.0, 70.0), (40.0, -110.0)])
def test_an_indexed_position_stands_in_its_frame(post, name, tilt_deg, azimuth_deg):
    m, side = within_reach(mill(post, name)), position(tilt_deg, azimuth_deg)
    text = text_of(m, operation("finish", upright()), side)
    lines = [re.sub(r"^\d+ ", "", line) if post == "heidenhain" else line for line in text.splitlines()]
    first = next(k for k, line in enumerate(lines) if line.startswith(BEGIN[post]))
    last = lines.index(END[post])
    assert not any(re.search(r"\b[ABC]-?\+?\d", line) for line in lines[first + 1:last])
    assert_position_is_read(read_with_tools(m, text), side, 1)


@pytest.mark.parametrize("name", (*TABLES, *HEADS))
@pytest.mark.parametrize("tilt_deg, azimuth_deg", [(25.0, 70.0), (40.0, -110.0)])
def test_cycle800_is_told_the_way_in_which_the_tool_is_held(name, tilt_deg, azimuth_deg):
    """The other direction is refused wherever the machine reaches both ways, and says nothing where it reaches one."""
    m = within_reach(mill("siemens", name, tip=None))
    text = text_of(m, position(tilt_deg, azimuth_deg))
    assert "TRAORI" not in text
    said = re.search(r"CYCLE800\(.*,(-?1),0\)", text)
    other = text.replace(said[0], said[0].replace(f",{said[1]},0)", f",{-int(said[1])},0)"))
    both = m.kinematics.inverse([[0.0, 0.0, 0.0]], leaning(tilt_deg, azimuth_deg))[0]
    low, high = m.kinematics.low[3:], m.kinematics.high[3:]
    if ((both[:, 3:] >= low) & (both[:, 3:] <= high)).all():
        with pytest.raises(ReadError, match="would hold the tool the other way"):
            read_with_tools(m, other)
    else:
        assert_position_is_read(read_with_tools(m, other), position(tilt_deg, azimuth_deg), 0)


def test_the_zero_goes_with_tables_alone_on_a_haas():
    with pytest.raises(PostError, match="side: G254 carries the zero with rotary tables, and this machine leans its head"):
        text_of(within_reach(mill("haas", "mill_head_table_bc")), position(25.0, 70.0))


def test_words_under_g254_count_along_the_machines_axes():
    """Two cuts a millimetre apart along the tool are a millimetre apart in Z, whatever the table does."""
    lines = text_of(mill("haas"), position(40.0, 30.0)).splitlines()
    begin = lines.index("G254")
    assert re.fullmatch(r"G0 X\S+ Y\S+", lines[begin + 1]) and re.fullmatch(r"G43 G0 Z\S+ H7", lines[begin + 2])
    heights = [float(re.search(r"Z(\S+)", line)[1]) for line in lines[begin + 2:begin + 4]]
    assert heights[0] - heights[1] == pytest.approx(20.0, abs=1e-3)


@EVERY
def test_a_program_with_block_numbers_begins_at_any_operation_that_brings_its_tool(post):
    """In the tip's control, in an indexed position, upright again: the same cuts as behind the whole program's begin."""
    m = mill(post, block_numbers=10)
    whole = text_of(m, operation("rough", upright(), FLAT), operation("finish", rolling()), operation("more", upright(), FLAT),
                    position(25.0, 70.0), operation("last", rolling()))
    before, points = read_with_tools(m, whole), restart.operations_of(whole)
    assert len(points) >= 4
    for point in points:
        after = read_with_tools(m, restart.restarted_at_operation(whole, point))
        assert after.remarks == () and after.ended and after.operations == before.operations[point - 1:]
        names = [before.operations.index(o) for o in after.operations]
        rows, mine = (np.flatnonzero((p.kind != Kind.RAPID) & np.isin(p.operation, k))
                      for p, k in ((before, names), (after, range(len(names)))))
        for column in ("end_mm", "end_axis", "machine_end_mm", "rotary_deg", "feed_mm_per_min", "tool"):
            np.testing.assert_allclose(getattr(after, column)[mine], getattr(before, column)[rows], atol=1e-9)


# random programs --------------------------------------------------------------------------------


@EVERY
@pytest.mark.parametrize("unit", ("mm", "inch"))
def test_fifty_random_programs_of_leaning_tools_read_back_as_they_were_meant(post, unit):
    """Ends within half the last digit of their words, axes within that of the rotary words."""
    m = within_reach(mill(post, units=unit, decimals_inch=6))
    half_mm = 0.5 * m.control.resolution_mm * np.sqrt(3) * 1.01
    for seed in range(50):
        told = random_leaning(seed)
        posted = read_with_tools(m, text_of(m, *told), LENGTHS)
        assert posted.remarks == () and posted.ended and posted.operations == tuple(o.name for o in told)
        for k, o in enumerate(told):
            rows = np.flatnonzero(posted.operation == k)
            ends, axes = posted.end_mm[rows], posted.end_axis[rows]
            for end, axis in zip(o.moves.end_mm, o.moves.axis):
                near = np.linalg.norm(ends - end, axis=1)
                there = np.nanargmin(np.where(np.abs(axes - axis).max(axis=1) < 2e-6, near, np.inf))
                assert near[there] < half_mm, (seed, k)


# known bad ------------------------------------------------------------------------------------------

LEANING, SIDE = ("finish", lambda: (operation("finish", rolling()),)), ("side", lambda: (position(40.0, 30.0),))


@pytest.mark.parametrize("post, what, old, new, message", [
    ("siemens", SIDE, ",40,0,", ",30,0,", "would turn the rotary axes"),
    ("siemens", SIDE, ",39,", ",57,", "would turn the rotary axes"),
    ("siemens", SIDE, ",39,", ",64,", "in mode 64"),
    ("siemens", SIDE, "(0,", "(1,", "that retracts the tool"),
    ("siemens", SIDE, '"TC1",0,', '"TC1",1,', "adds to a frame"),
    ("siemens", SIDE, '"TC1",', "", "14 parameters"),
    ("siemens", SIDE, '"TC1"', "TC1", "without the name of a swivel"),
    ("siemens", SIDE, "39,0,0,0", "39,0,0,5", "shows"),
    ("siemens", SIDE, "D1\nCYCLE800", "CYCLE800", "without a tool length"),
    ("siemens", SIDE, "CYCLE800()", "CYCLE800() G0", "beside other words"),
    ("siemens", SIDE, "\nCYCLE800()\n", "\n", "in a tilted plane"),
    ("siemens", SIDE, "\nCYCLE800()\n", "\nTRAORI\n", "TRAORI in a frame of CYCLE800"),
    ("haas", LEANING, "G234 G0", "G43 G0", "turns rotary axes under G94 without tool-centre-point control"),
    ("haas", LEANING, "G234 G0", "G0", "no code in this block uses H"),
    ("haas", LEANING, "\nG49\n", "\n", "G53 under tool-centre-point control"),
    ("haas", LEANING, "G234 G0", "G234.5 G0", "unknown word G234.5"),
    ("haas", LEANING, " H7", " H9", "not in the tool table"),
    ("haas", SIDE, "\nG254\n", "\n", "shows"),
    ("haas", SIDE, "\nG254\n", "\nG43 H7\nG254\n", "G254 in another, under G234 or a tool length"),
    ("haas", SIDE, "\nG49\nG255\n", "\nG255\n", "G69 while a tool length is in force"),
    ("haas", SIDE, "\nG49\nG255\n", "\nG49\n", "G53 in a tilted plane"),
    ("haas", SIDE, "\nG255\n", "\nG53 G0 A0.\nG255\n", "G53 in a tilted plane"),
    ("heidenhain", LEANING, "FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS", "M8", "turns rotary axes under G94 without"),
    ("heidenhain", LEANING, "F TCP AXIS POS", "F CONT AXIS POS", "write FUNCTION TCPM F TCP"),
    ("heidenhain", LEANING, "AXIS POS PATHCTRL AXIS", "AXIS SPAT PATHCTRL AXIS", "write FUNCTION TCPM F TCP"),
    ("heidenhain", LEANING, "PATHCTRL AXIS", "PATHCTRL VECTOR", "write FUNCTION TCPM F TCP"),
    ("heidenhain", LEANING, "FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS", "M128", "unknown word M128"),
    ("heidenhain", LEANING, "FUNCTION RESET TCPM", "M9", "under tool-centre-point control"),
    ("heidenhain", LEANING, "FUNCTION RESET TCPM", "FUNCTION RESET TCPM M9", "write it alone"),
    ("heidenhain", SIDE, "PLANE RESET STAY", "PLANE RESET TURN", "that turns the rotary axes"),
    ("heidenhain", SIDE, "PLANE RESET STAY", "M9", "in a tilted plane"),
    ("heidenhain", SIDE, "SPA+40", "SPA+30", "would turn the rotary axes"),
    ("heidenhain", SIDE, " SPB+0", "", "without its three angles"),
    ("heidenhain", SIDE, "TURN FMAX", "MOVE FMAX", "another way to turn"),
    ("heidenhain", SIDE, "TURN FMAX", "TURN FMAX SEQ-", "another way to turn")])
def test_what_is_spoilt_is_refused_by_its_line_or_shows(post, what, old, new, message):
    m = within_reach(mill(post))
    text = text_of(m, *what[1]())
    assert text.count(old) >= 1
    try:
        posted = read_with_tools(m, text.replace(old, new, 1))
    except ReadError as error:
        assert re.search(message, str(error)), error
        assert str(error).startswith("line ")
        return
    meant = read_with_tools(m, text)
    assert message == "shows" and np.nanmax(np.abs(posted.end_mm[-6:] - meant.end_mm[-6:])) > 1.0


@pytest.mark.parametrize("post, other", [("haas", "TCPM"), ("heidenhain", "G234")])
def test_the_control_must_be_its_own(post, other):
    with pytest.raises(PostError, match=f"tip_control {other} is no word of the post {post}, which knows {TIP[post]}"):
        text_of(mill(post, tip=other), operation("rough", upright(), FLAT))


def test_under_g254_every_axis_is_named_before_a_cut():
    m = mill("haas")
    text = re.sub(r"G254\nG0 X\S+ Y\S+\n", "G254\n", text_of(m, position(40.0, 30.0)))
    with pytest.raises(ReadError, match="a cut behind G254 before X Y is named"):
        read_with_tools(m, text)


# speeds that change among the moves --------------------------------------------------------------


SPEEDS = (4, 5000.0), (7, 9000.0)


@pytest.mark.parametrize("m", [mill("haas"), mill("siemens"), fanuc(), machine("mill_trunnion_ac"),
                               machine("mill_trunnion_ac", tip_control="M428")],
                         ids=lambda m: f"{m.control.post} {m.control.tip_control}")
def test_a_leaning_tool_turns_as_fast_as_every_move_asks(m):
    moves = rolling()
    posted = read_with_tools(m, text_of(m, dataclasses.replace(operation("finish", moves), rpm_changes=SPEEDS)))
    assert posted.remarks == () and posted.ended
    planned = np.select([np.arange(len(moves)) >= k for k, _ in reversed(SPEEDS)], [rpm for _, rpm in reversed(SPEEDS)], 8000.0)
    for k in range(2, len(moves) - 1):
        hit = np.nanargmin(np.linalg.norm(posted.end_mm - moves.end_mm[k], axis=1))
        assert posted.spindle_rpm[hit] == planned[k]


@EVERY
def test_so_does_one_in_an_indexed_position(post):
    m, side = within_reach(mill(post)), dataclasses.replace(position(40.0, 30.0), rpm_changes=((2, 5000.0), (3, 9000.0)))
    posted = read_with_tools(m, text_of(m, side))
    assert_position_is_read(posted, side, 0)
    assert posted.spindle_rpm[posted.kind == Kind.FEED].tolist() == [8000.0, 8000.0, 5000.0, 9000.0]


def test_under_tcpm_the_speed_stays():
    m = mill("heidenhain")
    with pytest.raises(PostError, match="which does not go with TCPM: give it one speed"):
        text_of(m, dataclasses.replace(operation("finish", rolling()), rpm_changes=SPEEDS))
