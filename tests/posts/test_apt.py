"""Cutter location data: written, read back, spoilt; three axes and five.  A gold file is accepted as in test_dialects.py."""

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_machines import leaning
from known_tilted import rolling
from random_programs import LENGTHS, TOOLS, WCS, assert_reads_as, random_program
from small_program import changed, operation, program

from cuspline.app import catalogue
from cuspline.posts.readers.apt_reader import read_program
from cuspline.posts.writers import apt
from cuspline.program.arcs import Arc
from cuspline.program.drilling import DrillCycle, drilled
from cuspline.program.program import Kind, Plane
from cuspline.values.errors import PostError, ReadError

GOLD = Path(__file__).parent.parent / "gold/small_program_apt.apt"
MM = catalogue.find_machine("mill_apt")
INCH = changed(MM, units="inch", decimals_inch=6)
SMALL = {o.tool.number: o.tool.length_mm for o in program().operations}
ZERO = {WCS: (-100.0, -150.0, -200.0)}
BOTH = pytest.mark.parametrize("machine", [MM, INCH], ids=["mm", "inch"])


def read(text, lengths=SMALL):
    return read_program(text, work_offsets=ZERO, tool_lengths=lengths)


def text_of(what=None, machine=MM):
    return apt.post(what or program(), machine).text


def leaning_program(seed):
    """A random one whose tool leans and turns all along; arcs are left out."""
    rng = np.random.default_rng(seed)
    told = random_program(seed, planes=(Plane.XY,), helices=())
    axes = lambda n: leaning(rng.uniform(0, 120, n), rng.uniform(-180, 180, n))
    straight = lambda m: replace(m, kind=np.minimum(m.kind, Kind.FEED), axis=axes(len(m)))
    return replace(told, operations=tuple(replace(o, moves=straight(o.moves)) for o in told.operations))


def test_the_whole_text_is_the_accepted_one():
    if os.environ.get("CUSPLINE_ACCEPT_GOLD"):
        GOLD.write_text(text_of())
    assert text_of() == GOLD.read_text() and max(map(len, text_of().splitlines())) <= 72


@BOTH
def test_fifty_random_programs_read_back_as_they_were_meant(machine):
    for seed in range(50):
        told = random_program(seed, helices=())
        result = apt.post(told, machine)
        moves = read(result.text, LENGTHS)
        assert result.arcs_as_lines == 0 and moves.remarks == ()
        assert_reads_as(told, moves, machine.control)


@BOTH
def test_fifty_random_leaning_programs_read_back_as_they_were_meant(machine):
    for seed in range(50):
        told = leaning_program(seed)
        moves = read(text_of(told, machine), LENGTHS)
        assert_reads_as(told, moves, machine.control)
        cuts = moves.kind != Kind.RAPID
        wanted = np.vstack([o.moves.axis[o.moves.kind != Kind.RAPID] for o in told.operations])
        assert np.abs(moves.end_axis[cuts] - wanted).max() < 1e-9


def test_helices_and_leaning_arcs_are_chords_within_the_tolerance():
    for moves, start in ((random_program(3).operations[0].moves, 0), (rolling(), 2)):
        told = program(operation("finish", program().operations[0].tool, moves))
        result = apt.post(told, MM)
        back = read(result.text)
        assert result.arcs_as_lines > 0
        for k in np.flatnonzero(moves.kind >= Kind.ARC_CW):
            end = np.flatnonzero(np.abs(back.end_mm - moves.end_mm[k]).max(axis=1) < 1e-5)[-1]
            if back.kind[end] != Kind.FEED:
                continue
            arc = Arc(moves.starts_mm[k], moves.end_mm[k], moves.center_mm[k], Plane(moves.plane[k]), moves.kind[k])
            a, b, _ = arc.plane.axes
            middle = (0.5 * (back.start_mm + back.end_mm))[end]
            assert abs(np.hypot(*(middle - arc.center_mm)[[a, b]]) - arc.radius_mm) < MM.control.path_tolerance_mm + 2e-5
            np.testing.assert_allclose(back.end_axis[end], moves.axis[k], atol=1e-9)


def test_it_goes_up_before_a_tool_change_and_at_the_end():
    moves = read(text_of())
    for stop in moves.stops:
        if stop.word in ("M6", "M30") and stop.row:
            assert moves.machine_end_mm[stop.row - 1, 2] == 0.0


@pytest.mark.parametrize("old, new, wanted", [
    ("UNITS/MM\n", "", "before UNITS"), ("UNITS/MM", "UNITS/CM", "UNITS/CM"), ("FIXOFF/2\n", "", "unknown_start"),
    ("FIXOFF/2", "FIXOFF/0", "FIXOFF/0"), ("FIXOFF/2", "FIXOFF/1", "wrong_work_offset"),
    ("MULTAX/ON", "MULTAX/YES", "MULTAX/YES"), ("LOADTL/3\n", "", "no tool"),
    ("LOADTL/3", "LOADTL/4", "not in the tool table"), ("LOADTL/3", "LOADTL/3.5", "one whole number"),
    ("SPINDL/8000,CLW", "SPINDL/CLW", "SPINDL/CLW"), ("SPINDL/8000,CLW", "SPINDL/8000,SFM", "SPINDL/8000,SFM"),
    ("COOLNT/FLOOD", "COOLNT/FLUD", "COOLNT/FLUD"), (r"FEDRAT/[\d.]+,MMPM", "FEDRAT/300,MMPR", "MMPR"),
    (r"FEDRAT/[\d.]+,MMPM", "FEDRAT/0,MMPM", "one feed above 0"), (r"FEDRAT/[\d.]+,MMPM\n", "", "no feed is set"),
    ("RAPID\nGOTO", "GOTO", "nobody knows where"), ("RAPID\n", "RAPIDE\n", "unknown word RAPIDE"), ("FINI\n", "", "without an end"),
    ("FINI\n", "FINI\nRAPID\n", "behind the end"),
    (",0,0,1\n", ",0,0,0.5\n", "length 0.5"), (",0,0,1\n", ",0,0\n", "with 5 numbers"),
    (r"GOTO/-?[\d.]+", "GOTO/1O", "GOTO/ with 1O"), ("GOTO/", "GO/", "unknown word GO"),
    ("GOTO/", "CYCLE/DRILL,", "unknown word CYCLE"),
    (r"(?<=\n)CIRCLE/-?[\d.]+", "CIRCLE/1000", "the radius is"), (r"(?<=\n)CIRCLE/", "RAPID\nCIRCLE/", "RAPID before an arc"),
    (r"(?<=,0,-1,0,)[\d.]+\n", "900\n", "states a radius"), (",0,-1,0,", ",0,-0.8,0.6,", "plane that leans"),
    (r"(?<=GOTO/44.35684,6.31499,2.06363,0,0,1\n)FEDRAT/[^\n]*\nCIRCLE/[^\n]*\n", "", "right behind an arc"),
    ("RETRCT", "RETRCT/ON", "RETRCT with parameters"), ("PARTNO/", "PARTN/", "unknown word PARTN"),
    ("MULTAX/ON\nRETRCT\n", "MULTAX/ON $\n", "a comment within"),
    ("CIRCLE/", "TLON,GOFWD/(CIRCLE/", "unknown word TLON")])
def test_a_spoilt_text_is_found(old, new, wanted):
    text = text_of()
    assert re.search(old, text), old
    assert said_of(re.sub(old, lambda _: new, text, count=1), wanted)


def said_of(text, wanted):
    """It is refused with its line, or the move that hangs on it has a remark, or no tool."""
    try:
        moves = read(text)
    except ReadError as error:
        assert re.search(wanted, str(error)), error
        return re.match(r"line \d+", str(error))
    found = {r.kind for r in moves.remarks} | ({"no tool"} if (moves.tool[moves.kind != Kind.RAPID] == 0).any() else set())
    assert wanted in found, found
    return True


def test_what_data_of_other_systems_hold_is_read_or_refused():
    head = "PARTNO SOMETHING ELSE\nUNITS/INCHES\nLOADTL/3,LENGTH,2.5\nSPINDL/RPM,900.0,CCLW\nFROM/1,1,1\n"
    moves = read(head + "FEDRAT/IPM,10\nGOTO / 2.0, 1.0, .5, $\n 0.0, 0.7071, 0.7071\nGODLTA/0,1,0\nMULTAX/OFF\nGOTO/0,0,1E0\nEND")
    moves = moves.between(1, 4)         # behind the way up for the tool
    np.testing.assert_allclose(moves.end_mm, np.array([[2, 1, 0.5], [2, 2, 0.5], [0, 0, 1]]) * 25.4)
    np.testing.assert_allclose(moves.end_axis, 3 * [[0, np.sqrt(0.5), np.sqrt(0.5)]])
    assert moves.line.tolist() == [7, 9, 11] and set(moves.feed_mm_per_min) == {254.0} and set(moves.spindle_rpm) == {-900.0}
    for rest, wanted in (("MULTAX/OFF\nFEDRAT/9,IPM\nGOTO/1,1,1,0,.6,.8\nEND", "line 8: .*MULTAX/OFF"),
                         ("FEDRAT/9,IPM\nCIRCLE/2,1,1,0,0,1,1\nGOTO/3,1,1\nGOTO/2,2,1\nEND", "line 9: .*right behind an arc"),
                         ("FEDRAT/9,IPM\nCIRCLE/2,1,1,0,0,1,1\nGOTO/3,1,1.5\nEND", "line 8: .*rises"),
                         ("CIRCLE/2,1,1,0,0,1,1\nFEDRAT/9,IPM\nEND", "line 7: .*between CIRCLE"),
                         ("RAPID\nGOTO/1,2,3 $", "goes on behind the last line")):
        with pytest.raises(ReadError, match=wanted):
            read(head + rest)


def test_what_the_data_have_no_word_for_is_refused():
    with pytest.raises(PostError, match="G60 is no work offset of the post apt"):
        text_of(replace(program(), wcs="G60"))


def test_no_edit_of_one_character_breaks_the_reader():
    rng, text, refused = np.random.default_rng(4), text_of(), 0
    for _ in range(150):
        at = int(rng.integers(len(text)))
        try:
            read(text[:at] + "GOTUXYZ/$,.-0123456789 \n"[rng.integers(24)] + text[at + 1:])
        except ReadError as error:
            refused += 1
            assert str(error).startswith("line ") and len(error.rows) == 1
    assert refused > 30


def test_a_dwell_at_the_bottom_of_a_hole_is_a_delay_there():
    hole = DrillCycle(kind="dwell", xy_mm=(10.0, 4.0), bottom_z_mm=-6.0, retract_z_mm=2.0, dwell_s=0.25, feed_mm_per_min=100.0,
                      first=0, end=1)
    moves, cycles = drilled((hole,), 30.0, 100.0)
    text = text_of(program(replace(operation("holes", TOOLS[1], moves), cycles=cycles)))
    lines = text.splitlines()
    at = lines.index("DELAY/0.25")
    assert lines[at - 1].startswith("GOTO/10,4,-6") and lines[at + 1] == "RAPID"
    stop, = (s for s in read(text, {7: 0.0}).stops if s.word == "G4")
    assert read(text, {7: 0.0}).end_mm[stop.row - 1, 2] == pytest.approx(-6.0)


@pytest.mark.parametrize("word", ["DELAY", "DELAY/0", "DELAY/-1", "DELAY/1,2", "DELAY/SOON"])
def test_a_delay_without_its_seconds_is_refused(word):
    with pytest.raises(ReadError, match="line "):
        read(text_of().replace("FINI", f"{word}\nFINI"))
