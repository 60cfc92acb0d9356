"""Other people's controls: each post against its gold file and its independent reader, each reader against spoilt texts.

Accept new gold files with   CUSPLINE_ACCEPT_GOLD=1 pytest tests/posts/test_dialects.py
and review their diff like code.  None of these controls is at hand: what their manuals say stands in docs/decisions/controllers.md.
"""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from random_programs import LENGTHS, WCS, assert_reads_as, random_program
from small_program import FLAT, changed, operation, program, roughing

from cuspline.app import catalogue
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind, Plane
from cuspline.values.errors import PostError, ReadError

GOLD = Path(__file__).parent.parent / "gold"
MACHINES = {name: catalogue.find_machine(f"mill_{name}") for name in ("haas", "grbl")}
INCH = {name: changed(m, units="inch", decimals_inch=6) for name, m in MACHINES.items()}
PLANES = {"heidenhain": (Plane.XY,)}
HELIX_ENDS = {}
ZERO = {WCS: (-100.0, -150.0, -200.0)}
SMALL = {o.tool.number: o.tool.length_mm for o in program().operations}
CHARACTERS = "GMXYZIJKFSTHDRPLNC0123456789.-+ ();%=\"~\n"
EVERY = pytest.mark.parametrize("name", MACHINES)


def read(text, machine, lengths=None):
    return catalogue.reader_of(machine)(text, work_offsets=ZERO, tool_lengths=SMALL if lengths is None else lengths)


def posted(machine, what=None):
    return catalogue.find_post(machine.control.post).post(what or program(), machine)


def joined(texts, machine, lengths=None):
    return PostedMoves.joined([read(t, machine, lengths) for t in texts], [t.count("\n") for t in texts])


@EVERY
def test_the_whole_text_is_the_accepted_one(name):
    texts = posted(MACHINES[name]).texts
    extension = catalogue.find_post(name).EXTENSION
    for k, text in enumerate(texts, 1):
        path = GOLD / f"small_program_{name}{'' if len(texts) == 1 else f'_{k}'}.{extension}"
        if os.environ.get("CUSPLINE_ACCEPT_GOLD"):
            path.write_text(text)
        assert path.is_file(), "no gold file: accept one, see the top of this file"
        assert text == path.read_text()


@EVERY
@pytest.mark.parametrize("machines", [MACHINES, INCH], ids=["mm", "inch"])
def test_fifty_random_programs_read_back_as_they_were_meant(name, machines):
    machine = machines[name]
    for seed in range(50):
        told = random_program(seed, PLANES.get(name, tuple(Plane)))
        result = posted(machine, told)
        assert result.arcs_as_lines == 0 and result.largest_rounding_mm <= machine.control.resolution_mm
        moves = joined(result.texts, machine, LENGTHS)
        assert moves.remarks == ()
        assert_reads_as(told, moves, machine.control, HELIX_ENDS.get(name, 1.0))


@EVERY
def test_the_header_survives_in_short_lines_and_its_verdict_is_stamped(name):
    machine = MACHINES[name]
    told = program(header=("VERDICT: NOT VERIFIED YET", "x" * 300, "é (in brackets); and more"))
    for text in posted(machine, told).texts:
        assert max(map(len, text.splitlines())) < machine.control.line_length and text.isascii()
        assert text.count(catalogue.find_post(name).comment("VERDICT: NOT VERIFIED YET")) == 1
        assert text.count("x") >= 300 and read(text, machine).remarks == ()


@EVERY
def test_a_full_circle_stays_one(name):
    moves = joined(posted(MACHINES[name]).texts, MACHINES[name])
    arcs = np.flatnonzero((moves.kind == Kind.ARC_CCW) & (moves.plane == Plane.XY) & (moves.operation == 0))[-2:]
    turned = 0.0
    for k in arcs:
        u, v = moves.start_mm[k] - moves.center_mm[k], moves.end_mm[k] - moves.center_mm[k]
        turned += (np.arctan2(v[1], v[0]) - np.arctan2(u[1], u[0])) % (2 * np.pi)
    assert turned == pytest.approx(2 * np.pi, abs=1e-3)


@EVERY
def test_the_tool_changes_at_the_top_and_comes_down_over_the_work(name):
    machine = MACHINES[name]
    moves = joined(posted(machine).texts, machine)
    top = machine.tool_change_height_mm
    for stop in moves.stops:
        if stop.word in ("M6", "M30") and stop.row:
            assert moves.machine_end_mm[stop.row - 1, 2] == pytest.approx(top)
    for row in np.flatnonzero(moves.kind == Kind.RAPID):
        way = moves.end_mm[row] - moves.start_mm[row]
        assert not (way[2] < 0 and np.abs(way[:2]).max() > 0)


@EVERY
def test_what_the_control_cannot_do_is_refused_by_name(name):
    machine, post = MACHINES[name], catalogue.find_post(name)
    rotary = catalogue.find_machine("mill_trunnion_ac")
    with pytest.raises(PostError, match="has the rotary axes"):
        post.post(program(), rotary.model_copy(update={"control": machine.control}))
    with pytest.raises(PostError, match="rpm, the spindle of"):
        post.post(program(operation("rough", FLAT, roughing(), rpm=90000)), machine)


@EVERY
def test_no_edit_of_one_character_breaks_the_reader(name):
    """It is read through, or refused with its line."""
    machine, rng = MACHINES[name], np.random.default_rng(4)
    text = posted(machine).texts[0]
    refused = 0
    for _ in range(300):
        at, new = int(rng.integers(len(text))), CHARACTERS[rng.integers(len(CHARACTERS))]
        try:
            read(text[:at] + new + text[at + 1:], machine)
        except ReadError as error:
            refused += 1
            assert str(error).startswith("line ") and len(error.rows) == 1
    assert refused > 60


# known-bad ----------------------------------------------------------------------------------------------

BAD = {
    "haas": [
        ("X20. F1200.0", "X20 F1200.0", "X20 without a decimal point"),
        ("^%\n", "", "between two % lines"), ("O00101\n", "", "before the first O-number"),
        ("G21\n", "", "before G20 or G21"), (" H3", " H7", "wrong_length_offset"), (" H3", "", "G43 without H"),
        ("G43 G0 Z30. H3", "G0 Z30.", "no length"), ("G55\n", "", "unknown_start"), ("G55", "G54", "wrong_work_offset"),
        ("G52 X0. Y0. Z0.\n", "", "unknown_start"), ("G52 X0.", "G52 X5.", "G52 that shifts"),
        ("G18\n", "", "no K"), ("I7.301", "I-7.301", "the radius is"), ("J2.657", "K2.657", "no K"),
        (" G90", "", "unknown_start"), (" G40", "", "unknown_start"), (" G94", "", "unknown_start"), ("G17 ", "", "unknown_start"),
        ("G187 P3 E0.001\n", "", "unbounded"), ("E0.001", "E0.5", "unbounded"),
        ("G187 P3", "G187 P7", "G187 P7"), ("T3 M6", "T3", "no tool"), ("T3 M6", "T4 M6", "not in the tool table"),
        ("M30\n", "", "runs into the next one"), ("M8\n", "M7\n", "no mist"), ("X20. ", "X20.. ", "is no word"),
        ("X20. ", "X2O. ", "without a decimal point|is no word|unknown word"), ("X20. ", "/X20. ", "block delete"),
        ("X20. ", "X#5 ", "variables"), ("X20. ", "G81 X20. ", "unknown word G81"), ("X20. ", "G41 D3 X20. ", "unknown word G41"),
        ("X20. ", "X20. (in (out) ", "comment"), ("G18\n", "M97 P55\n", "no such sub-program"), ("G18\n", "M99\n", "run for ever"),
        ("F1200.0", "F0.", "no feed is set"), ("G53 G0 Z0.", "G53 Z0. G2", "G53 with an arc"),
        ("T3 M6", "T3 M6 M5 M3", "both of the group"),
    ],
    "grbl": [
        ("G21\n", "", "before G20 or G21"), ("T3\n", "", "no tool"), ("T3\n", "T3 M6\n", "changes no tool"),
        ("T3\n", "T4\n", "not in the tool table"), ("G43.1 Z95", "G43.1 Z94", "wrong_length_offset"),
        ("G43.1 Z95\n", "", "no length"), ("G43.1 Z95", "G43 H3", 'word "H"'), ("G55\n", "", "unknown_start"),
        ("G55", "G54", "wrong_work_offset"), ("G55", "G59.1", "unknown word G59.1"), (" G92.1", "", "unknown_start"),
        (" G91.1", " G90.1", "unknown word G90.1"), ("G18\n", "", "no K"), ("I7.3014", "I-7.3014", "the radius is"),
        ("I7.3014", "I7.3114", "the radius is"), (" G90", "", "unknown_start"), ("G17 ", "", "unknown_start"),
        ("M30\n", "", "without a program end"), ("M30\n", "M30\nG0 X1\n", "text after the program end"),
        ("X20 ", "G81 X20 ", "no canned cycles"), ("X20 ", "G64 P0.1 X20 ", "exact path"), ("X20 ", "$H\nX20 ", "settings"),
        ("X20 ", f"X{'0' * 80}20 ", "characters beside blanks"), ("X20 ", "#1=3\nX20 ", "is no word"),
        ("X20 ", "A20 ", 'unknown word "A"'), ("M8\n", "M1\n", "passes over it"), ("X20 ", "/X20 ", "block delete"),
        ("M8\n", "T7\n", "another T in one program"), ("M8\n", "o100 call\n", "unknown word|is no word"),
        ("^", "%\n", "is no word"), ("F1200.0", "F0", "no feed is set"),
    ],
}


@pytest.mark.parametrize("name, old, new, wanted", [(name, *row) for name, rows in BAD.items() for row in rows])
def test_a_spoilt_text_is_found(name, old, new, wanted):
    """It is refused with its line, or the move that hangs on it has a remark, or its tool and tolerance show it."""
    machine = MACHINES[name]
    text = posted(machine).texts[0]
    assert re.search(old, text, re.M), old
    spoilt = re.sub(old, lambda _: new, text, count=1, flags=re.M)
    assert said(spoilt, machine, wanted)


def said(text, machine, wanted):
    try:
        moves = read(text, machine)
    except ReadError as error:
        assert re.search(wanted, str(error)), error
        return re.match(r"line \d+", str(error))
    cuts = moves.kind != Kind.RAPID
    found = {r.kind for r in moves.remarks}
    if (moves.tool[cuts] == 0).any():
        found.add("no tool")
    if not moves.length_offset_on[cuts].all():
        found.add("no length")
    if not (np.nan_to_num(moves.path_tolerance_mm[cuts], nan=np.inf) <= 0.01).all():
        found.add("unbounded")
    assert wanted in found, found
    return True
