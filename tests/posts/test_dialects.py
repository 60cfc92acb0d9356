"""Other people's controls: each post against its gold file and its independent reader, each reader against spoilt texts.

Accept new gold files with   CUSPLINE_ACCEPT_GOLD=1 pytest tests/posts/test_dialects.py
and review their diff like code.  None of these controls is at hand: what their manuals say stands in docs/decisions/controllers.md.
"""

import os
import re
from dataclasses import replace
from pathlib import Path

import known_passes
import numpy as np
import pytest
from random_programs import LENGTHS, WCS, assert_reads_as, random_program
from small_program import BALL, FLAT, changed, finishing, one, operation, program, roughing
from spoilt_words import BAD

from cuspline.app import catalogue
from cuspline.posts import restart
from cuspline.posts.writers import haas
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind, Plane
from cuspline.values.errors import InputError, PostError, ReadError

GOLD = Path(__file__).parent.parent / "gold"
MACHINES = {name: catalogue.find_machine(f"mill_{name}") for name in ("haas", "grbl", "siemens", "heidenhain", "pmac")}
INCH = {name: changed(m, units="inch", decimals_inch=6) for name, m in MACHINES.items()}
ALL = {**MACHINES, "linuxcnc": catalogue.find_machine("mill_3axis"), "fanuc": catalogue.find_machine("mill_fanuc")}
HELICES = {"heidenhain": (Plane.XY,)}
HELIX_ENDS = {"heidenhain": 4.0}        # IPA starts where start and centre were rounded to
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
        told = random_program(seed, helices=HELICES.get(name, tuple(Plane)))
        result = posted(machine, told)
        assert result.arcs_as_lines == 0 and result.largest_rounding_mm <= machine.control.resolution_mm
        moves = joined(result.texts, machine, LENGTHS)
        assert moves.remarks == ()
        assert_reads_as(told, moves, machine.control, HELIX_ENDS.get(name, 1.0))


@pytest.mark.parametrize("name", ALL)
def test_a_finer_finish_tightens_the_path_tolerance_where_programs_state_it(name):
    machine = changed(ALL[name], path_tolerance_mm=0.002)
    held = catalogue.held_to(machine, 0.0015)
    said = [m.path_tolerance_mm[m.kind == Kind.FEED].max() for m in (joined(posted(m).texts, m) for m in (machine, held))]
    if name in ("fanuc", "grbl", "pmac"):
        assert held is machine and np.isnan(said).all()
    else:
        assert said == pytest.approx([0.002, 0.001 if name == "haas" else 0.0015], abs=1e-9)
    assert catalogue.held_to(machine, 0.002) is machine
    assert catalogue.held_to(machine, 1e-5).control.path_tolerance_mm in (0.002, machine.control.resolution_mm)


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
    rotary = catalogue.find_machine("mill_trunnion_ac").model_copy(update={"control": machine.control})
    if name in ("grbl", "pmac"):
        with pytest.raises(PostError, match="has the rotary axes"):
            post.post(program(), rotary)
    with pytest.raises(PostError, match="rpm, the spindle of"):
        post.post(program(operation("rough", FLAT, roughing(), rpm=90000)), machine)


@pytest.mark.parametrize("name, wcs, there", [("siemens", "G58", "G55, G56, G57$"), ("heidenhain", "G59.1", "G58, G59$"),
                                              ("pmac", "G59.1", "G58, G59$"), ("grbl", "G59.1", "G58, G59$")])
def test_a_work_offset_that_the_control_has_not_is_refused(name, wcs, there):
    with pytest.raises(PostError, match=f"setup-1: {wcs} is no work offset of the post {name}: choose one of G54, .*{there}"):
        catalogue.find_post(name).post(replace(program(), wcs=wcs), MACHINES[name])


@EVERY
def test_no_edit_of_one_character_breaks_the_reader(name):
    """It is read through, or refused with its line."""
    machine, rng = MACHINES[name], np.random.default_rng(4)
    text = posted(machine).texts[0]
    refused = 0
    for _ in range(150):
        at, new = int(rng.integers(len(text))), CHARACTERS[rng.integers(len(CHARACTERS))]
        try:
            read(text[:at] + new + text[at + 1:], machine)
        except ReadError as error:
            refused += 1
            assert str(error).startswith("line ") and len(error.rows) == 1
    assert refused > 30


# known-bad ----------------------------------------------------------------------------------------------

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


# what a reader alone knows ------------------------------------------------------------------------------


def moves_of(name, text):
    return read(text, MACHINES[name])


def test_klartext_helices_along_other_axes_go_out_as_chords_within_the_tolerance():
    machine, middle, radius = MACHINES["heidenhain"], np.array([0.0, 3.0, 50.0]), 8.0
    told = one(("feed", (8.0, 3.0, 50.0), 400), ("arc", (-8.0, 5.0, 50.0), tuple(middle), Plane.ZX, True, 500), start=(8, 3, 60))
    result = posted(machine, told)
    moves = read(result.text, machine)
    rows = np.flatnonzero(moves.feed_mm_per_min == 500)
    off = np.abs(np.hypot(*(0.5 * (moves.start_mm + moves.end_mm)[rows] - middle)[:, [0, 2]].T) - radius)
    assert result.arcs_as_lines == 1 and len(rows) > 20 and off.max() < machine.control.path_tolerance_mm + 1e-4


@pytest.mark.parametrize("start, center, angle, end", [
    ("X-52 Z+7.5", "CC X-44 Z+7.5", "IPA-90 DR-", (-44.0, 0.0, -0.5)), ("Y-2 Z+0", "CC Y+0 Z+0", "IPA+90 DR+", (0.0, 0.0, -2.0)),
    ("X+2 Y+0", "CC X+0 Y+0", "IPA+90 DR+", (0.0, 2.0, 0.0))])
def test_dr_is_the_mathematical_sense_in_the_main_planes(start, center, angle, end):
    """The first two are lead-ins as a post that many shops run writes them: from the side down into the cut."""
    moves = read(KLARTEXT.format(f"11 L {start} F100\n12 {center}\n13 CP {angle}"), MACHINES["heidenhain"])
    np.testing.assert_allclose(moves.end_mm[-1], end, atol=1e-9)


SIEMENS = "G710 G55 G17 G90 G94 G40\nTRANS\nG642 CTOL=0.002\nT3 M6\nD1\nS1000 M3\nG0 X0 Y0\nG0 Z0\n{}\nM30\n"


@pytest.mark.parametrize("plane, block", [
    (Plane.XY, "CIP X10 Y10 I1=2.9289321881345245 J1=7.0710678118654755 F100"),
    (Plane.ZX, "CIP Z10 X10 K1=2.9289321881345245 I1=7.0710678118654755 F100"),
    (Plane.YZ, "CIP Y10 Z10 J1=2.9289321881345245 K1=7.0710678118654755 F100")])
def test_a_circle_through_a_point_is_the_one_by_its_centre(plane, block):
    a, b, third = plane.axes
    moves = moves_of("siemens", SIEMENS.format(block + "\nG1 X1"))
    arc = int(np.flatnonzero(moves.kind >= Kind.ARC_CW)[0])
    wanted = np.zeros(3)
    wanted[a] = 10.0
    assert moves.kind[arc] == Kind.ARC_CW and moves.plane[arc] == plane
    np.testing.assert_allclose(moves.center_mm[arc][[a, b]], wanted[[a, b]], atol=1e-9)
    np.testing.assert_allclose(moves.end_mm[arc][[a, b]], [10, 10], atol=1e-9)
    assert (moves.line[-1], moves.kind[-1]) == (10, Kind.FEED)


@pytest.mark.parametrize("blocks, wanted", [
    ("CIP X10 Y10 Z3 I1=3 J1=7 K1=1 F100", "outside the main planes"), ("CIP X10 Y10 I1=5 J1=5 F100", "of one line"),
    ("G91\nCIP X10 Y10 I1=3 J1=7 F100", "under G91"), ("G1 X5 I1=3 F100", "I1 without CIP"), ("G4 S5", "without its time"),
    ("G2 X10 Y0 I5 J0 TURN=1.5 F100", "turns"), ("T7\nD1 M6 M5 M3", "both of the group")])
def test_what_sinumerik_would_not_run_is_refused_in_its_line(blocks, wanted):
    with pytest.raises(ReadError, match=wanted) as caught:
        moves_of("siemens", SIEMENS.format(blocks))
    assert list(caught.value.rows) == [8 + blocks.count("\n") + 1]


def test_sinumerik_turns_radii_and_tolerances_are_read():
    text = SIEMENS.format("G3 X10 Y0 I5 J0 Z-4 TURN=2 F100\nG2 X0 CR=-6\nCTOL=0.03\nG1 X=5.5\nG641 ADIS=0.5 X6\nG60 X7\nG64 X8\n"
                          "G4 F2")
    moves = moves_of("siemens", text)
    assert moves.turns[moves.kind == Kind.ARC_CCW].tolist() == [2]
    short = np.flatnonzero(moves.kind == Kind.ARC_CW)[0]
    assert moves.center_mm[short, 1] == pytest.approx(-np.sqrt(11))       # the longer way round
    assert moves.path_tolerance_mm[-5:-1].tolist() == [0.002, 0.03, 0.5, 0.0] and np.isnan(moves.path_tolerance_mm[-1])


def test_sinumerik_r_parameters_are_computed_as_they_stand():
    text = SIEMENS.format("R1=4 R2=R1*2.5\nN70 G1 X=R2 Y=-(R1+1)/2 F=R2*10\nR1=R1+1\nG3 X=R2+2*R1 I=R1 J0\nG1 X=R1+R2*-1")
    moves = moves_of("siemens", text)
    cuts = moves.kind != Kind.RAPID
    np.testing.assert_allclose(moves.end_mm[cuts][:2, :2], [[10, -2.5], [20, -2.5]], atol=1e-9)
    assert moves.feed_mm_per_min[cuts][0] == 100


@pytest.mark.parametrize("blocks, wanted", [
    ("X=R9", "R9 has no value"), ("R1=0\nX=5/R1", "divides by nothing"), ("R1=(4", "cannot be computed"),
    ("R1=4 5", "cannot be computed"), ("R1=", "beside an R-parameter"), ("R1=3 G1 X5", "beside an R-parameter"),
    ("R1=SIN(3)", "beside an R-parameter")])
def test_r_parameters_that_nobody_can_compute_are_refused_in_their_line(blocks, wanted):
    with pytest.raises(ReadError, match=wanted) as caught:
        moves_of("siemens", SIEMENS.format(blocks))
    assert list(caught.value.rows) == [8 + blocks.count("\n") + 1]


@pytest.mark.parametrize("unit", ["mm", "inch"])
def test_feeds_as_r_parameters_are_the_same_and_an_operator_may_change_them(unit):
    plain = (MACHINES if unit == "mm" else INCH)["siemens"]
    told = program(operation("rough", FLAT, roughing()), operation("finish", BALL, finishing(), 12000))
    text = posted(changed(plain, feed_parameters=True), told).text
    before, after = read(posted(plain, told).text, plain), read(text, plain)
    assert not re.search(r"F\d", re.sub(r";.*", "", text)) and after.remarks == ()
    for column in ("kind", "end_mm", "feed_mm_per_min", "line"):
        was, now = getattr(before, column), getattr(after, column)
        np.testing.assert_array_equal(was + (6 if column == "line" else 0), now)
    slower = re.sub(r"(?m)^R13=\S+ ; F OF OPERATION 1: ROUGH$", "R13=1.5 ; SLOWER", text)
    changed_rows = np.flatnonzero(read(slower, plain).feed_mm_per_min != after.feed_mm_per_min)
    assert after.feed_mm_per_min[changed_rows].tolist() == [pytest.approx(1200.0, rel=1e-3)]


def test_more_feeds_than_there_are_r_parameters_stay_numbers_and_the_head_says_so():
    steps = [("feed", (k, 0.0, 5.0), 100.0 + k) for k in range(1, 120)]
    told = one(*steps)
    text = posted(changed(MACHINES["siemens"], feed_parameters=True), told).text
    assert "; FEEDS OF OPERATION 1 ARE NO R-PARAMETERS: 119 ARE MORE THAN ARE LEFT\n" in text and "F219.0" in text


@pytest.mark.parametrize("name", ["haas", "heidenhain"])
def test_what_a_sinumerik_alone_has_is_refused_elsewhere(name):
    for control in ({"feed_parameters": True}, {"swivel_record": "TC1"}):
        with pytest.raises(PostError, match=f"{next(iter(control))} is a Sinumerik's, and the post is {name}: leave it out"):
            posted(changed(MACHINES[name], **control))


KLARTEXT = ("0 BEGIN PGM A MM\n1 CYCL DEF 247 DATUM SETTING ~\n  Q339=+2 ;DATUM NUMBER\n2 CYCL DEF 7.0 DATUM SHIFT\n"
            "3 CYCL DEF 7.1 X+0\n4 CYCL DEF 7.2 Y+0\n5 CYCL DEF 7.3 Z+0\n6 CYCL DEF 32.0 TOLERANCE\n7 CYCL DEF 32.1 T0,002\n"
            "8 TOOL CALL 3 Z S1000 F250\n9 L X+0 Y+0 R0 FMAX M13\n10 L Z+0 FMAX\n{}\n99 END PGM A MM\n")


def test_klartext_counts_on_turns_and_rounds_as_its_manual_says():
    text = KLARTEXT.format("11 L IX+2,5 Y-1 M5\n12 M3\n13 CC X+0 Y-1\n14 CP IPA-810 IZ-3 DR- F80\n15 CR X+0 Y+5 R+6,5 DR+\n"
                           "16 TOOL CALL Z S2000\n17 STOP M9\n18 L X+1")
    moves = read(text, MACHINES["heidenhain"])
    assert moves.remarks == () and moves.ended
    cuts = moves.kind != Kind.RAPID
    np.testing.assert_allclose(moves.end_mm[cuts], [[2.5, -1, 0], [0, -3.5, -3], [0, 5, -3], [1, 5, -3]], atol=1e-9)
    assert moves.turns[cuts].tolist() == [0, 2, 0, 0] and moves.feed_mm_per_min[cuts].tolist() == [250, 80, 80, 80]
    assert moves.spindle_rpm[cuts].tolist() == [1000, 1000, 1000, 2000]
    assert [s.word for s in moves.stops if s.row] == ["M5", "M3", "M0", "M30"]
    assert moves.line[cuts].tolist() == [13, 16, 17, 20] and set(moves.path_tolerance_mm) == {0.002}


@pytest.mark.parametrize("blocks, wanted", [
    ("11 CC X+5 Y+0\n12 C X+10 Z+5 DR+", "another axis than its CC"), ("11 L IX+5 X+3", "beside X"),
    ("11 L IZ+5 M91 FMAX", "with M91"),
    ("11 CC X+5 Y+0\n12 C X+10 Y+0 DR+ FMAX", "with FMAX"), ("11 C X+10 Y+0 DR+", "without its CC"),
    ("11 BEGIN PGM B MM", "second BEGIN"), ("11 CC IX+5 IY+0", "given by two of X, Y and Z"),
    ("11 LBL 1", "no statement"), ("11 CYCL DEF 10.0 ROTATION", "cycle 10.0")])
def test_what_klartext_does_not_say_surely_is_refused_in_its_line(blocks, wanted):
    with pytest.raises(ReadError, match=wanted) as caught:
        read(KLARTEXT.format(blocks), MACHINES["heidenhain"])
    assert list(caught.value.rows) == [12 + blocks.count("\n") + 1]


HAAS = ("%\nO00101\nG21\nG17 G90 G94 G40 G49 G80 G64\nG187 P3 E0.002\nG55\nG52 X0. Y0. Z0.\nT3 M6\nS1000 M3\nG0 X0. Y0.\n"
        "G43 Z9. H3\n{}\nM30\nN100 G1 X5. F100.\nM99\nO00200\nG1 Y5. F100.\nM99\n%\n")


def test_haas_calls_and_goes_home_as_its_manual_says():
    moves = read(HAAS.format("M97 P100\nM98 P200\nG61\nG1 X7.\nG64\nG1 X8."), MACHINES["haas"])
    cuts = moves.kind != Kind.RAPID
    assert moves.end_mm[cuts, :2].tolist() == [[5, 0], [5, 5], [7, 5], [8, 5]]
    assert moves.line[cuts].tolist() == [19, 22, 15, 17] and moves.call_line[cuts].tolist() == [12, 13, 0, 0]
    assert moves.path_tolerance_mm[cuts].tolist() == [0.002, 0.002, 0.0, 0.002]
    home = read(HAAS.format("G91 G28 Z0.\nG90\nG1 Z5. F100."), MACHINES["haas"])
    assert home.machine_end_mm[-2, 2] == 0.0 and not home.length_offset_on[-1]


DWELT = {"linuxcnc": ("G4 P1.5",), "fanuc": ("G4 P1500", "G04 X1.5"), "haas": ("G4 P1.5", "G04 P1500"), "grbl": ("G4 P1.5",),
         "siemens": ("G4 F1.5",), "heidenhain": ("CYCL DEF 9.0 DWELL TIME\n91 CYCL DEF 9.1 DWELL 1,5",),
         "pmac": ("DWELL1500", "DELAY 1500")}
UNDWELT = {"linuxcnc": ("G4", "G4 P-1"), "fanuc": ("G4 P1.5", "G4 P1 X1.", "G4 X2"), "haas": ("G4", "G4 X1."), "grbl": ("G4 P-2",),
           "siemens": ("G4", "G4 S5"), "heidenhain": ("CYCL DEF 9.1 DWELL", "CYCL DEF 9.2 V.ZEIT 1"),
           "pmac": ("DWELL 500 X1", "DWELL", "DELAYED 5")}


@pytest.mark.parametrize("name", DWELT)
def test_a_dwell_lasts_as_long_as_its_control_takes_it(name):
    """Milliseconds on one control, seconds on another, on a Haas by the point; where it is not sure it is refused in its line."""
    machine = ALL[name]
    text = posted(machine).texts[0]
    at = re.search(r"(?m)^.*OPERATION 1:.*\n", text).end()
    number = "90 " if name == "heidenhain" else ""
    told = lambda words: read(text[:at] + number + words + "\n" + text[at:], machine)
    for words in DWELT[name]:
        assert [s.seconds for s in told(words).stops if s.word == "G4"] == [1.5]
        np.testing.assert_array_equal(told(words).end_mm, read(text, machine).end_mm)
    for words in UNDWELT[name]:
        with pytest.raises(ReadError, match=f"^line {text[:at].count(chr(10)) + 1}:"):
            told(words)


@pytest.mark.parametrize("name, starts", [("haas", False), ("heidenhain", False), ("siemens", True), ("linuxcnc", True)])
def test_a_stop_leaves_the_spindle_as_its_control_does(name, starts):
    """M0 in the middle of a program whose spindle is not started again behind it."""
    machine = ALL[name]
    lines = posted(machine).texts[0].split("\n")
    cut = next(k for k, line in enumerate(lines) if "F1200" in line)
    lines.insert(cut, "90 M0" if name == "heidenhain" else "M0")
    moves = read("\n".join(lines), machine)
    assert (moves.spindle_rpm[moves.line == cut + 2] > 0).tolist() == [starts]
    assert (moves.coolant[moves.line == cut + 2] > 0).tolist() == [starts]


@pytest.mark.parametrize("name", [n for n in MACHINES if catalogue.find_post(n).TOOL_TABLE])
@pytest.mark.parametrize("machines", [MACHINES, INCH], ids=["mm", "inch"])
def test_a_tool_table_is_read_back(name, machines):
    machine = machines[name]
    tools = (FLAT, FLAT.model_copy(update={"number": 12, "stick_out_mm": 51.25}))
    text = catalogue.find_post(name).tool_table(tools, machine.control)
    _, read_table = catalogue.tool_table_of(machine)
    rows = {row.number: row for row in read_table(text)}
    assert set(rows) == {3, 12}
    for tool in tools:
        assert rows[tool.number].values_mm["Z"] == pytest.approx(tool.length_mm, abs=machine.control.resolution_mm)
        assert rows[tool.number].values_mm["D"] == pytest.approx(tool.cutter.diameter_mm, abs=2 * machine.control.resolution_mm)


@EVERY
def test_templated_passes_go_out_move_by_move(name):
    """No calls where the control has none that we are sure of: the same cuts as LinuxCNC makes of sub-programs."""
    told = known_passes.program()
    cuts = {}
    for post in ("linuxcnc", name):
        machine = known_passes.machine(post, line_length=MACHINES[name].control.line_length)
        texts = catalogue.find_post(post).post(told, machine).texts
        lengths = {t.number: t.length_mm for t in (known_passes.OTHER, known_passes.BALL)}
        moves = PostedMoves.joined([catalogue.reader_of(machine)(t, work_offsets=known_passes.ZERO, tool_lengths=lengths)
                                    for t in texts], [t.count("\n") for t in texts])
        cuts[post] = moves.end_mm[moves.kind == Kind.FEED][::7]
        assert moves.remarks == () and moves.operations == ("rough", "finish")
    np.testing.assert_allclose(cuts[name], cuts["linuxcnc"], atol=2e-4)


# what an operator reads, and may ask for in the machine's file -----------------------------------------------


def timed(program_, *seconds):
    return replace(program_, operations=tuple(replace(o, time_s=s) for o, s in zip(program_.operations, seconds)))


@pytest.mark.parametrize("name", ALL)
def test_every_operation_says_its_speed_feeds_depth_and_time(name):
    text = "".join(posted(ALL[name], timed(program(), 90.0, 36.0)).texts)
    first, second = (re.sub(r"[+.](?=,|$| TO|\))", "", line) for line in re.findall("S8000, .*|S12000, .*", text))
    assert re.match(r"S8000, F300 TO 1200, LOWEST TIP Z-0.135, 1.5 MIN, 2.1 MIN LEFT", first)
    assert re.match(r"S12000, F150 TO 700\.[56], LOWEST TIP Z\+?0, 0.6 MIN, 0.6 MIN LEFT", second)
    assert "MIN LEFT" not in "".join(posted(ALL[name], timed(program(), 90.0, None)).texts).split("OPERATION 2")[0]


@pytest.mark.parametrize("name", ALL)
def test_block_numbers_and_optional_stops_change_no_move(name):
    plain = ALL[name]
    numbered = changed(plain, block_numbers=10, optional_stops=True)
    before, after = (joined(posted(m).texts, plain) for m in (plain, numbered))
    for column in ("kind", "end_mm", "feed_mm_per_min", "tool"):
        np.testing.assert_array_equal(getattr(before, column), getattr(after, column))
    texts = posted(numbered).texts
    numbers = [int(n) for text in texts for n in re.findall(r"(?m)^N(\d+) ", text)]
    assert name == "heidenhain" or numbers[:3] == [10, 20, 30] and not re.search(r"(?m)^[GXYZTSM]", "".join(texts))
    stops = [s for s in after.stops if s.word == "M1"]
    assert len(stops) == (0 if name == "grbl" else 1)
    for stop in stops:
        assert after.machine_end_mm[stop.row - 1, 2] == plain.tool_change_height_mm and after.tool[stop.row - 1] == 3


def test_block_numbers_begin_again_below_a_hundred_thousand():
    lines = haas._Haas().numbered(["%", "O00101", "(A)", *1001 * ["G0 X1."]], changed(MACHINES["haas"], block_numbers=100).control)
    numbers = [int(line[1:].split()[0]) for line in lines[3:]]
    assert lines[:4] == ["%", "O00101", "(A)", "N100 G0 X1."] and max(numbers) <= 99999 and min(numbers) > 0


def test_block_numbers_among_restart_points_are_refused():
    mill = known_passes.machine("fanuc", block_numbers=10)
    with pytest.raises(PostError, match="restart points"):
        catalogue.find_post("fanuc").post(known_passes.program(), mill)


@pytest.mark.parametrize("name", ALL)
def test_a_program_begins_at_any_operation_that_brings_its_tool(name):
    machine = ALL[name]
    told = program(operation("rough", FLAT, roughing()), operation("again", FLAT, finishing(), 5000),
                   operation("finish", BALL, roughing()), operation("last", FLAT, finishing()))
    for whole in posted(machine, told).texts:
        before, points = read(whole, machine), restart.operations_of(whole)
        for point in points:
            after = read(restart.restarted_at_operation(whole, point), machine)
            assert after.remarks == () and after.operations == before.operations[-len(after.operations):]
            rows = np.flatnonzero(np.isin(before.operation, [before.operations.index(o) for o in after.operations]))
            rows, mine = (r[m.kind[r] != Kind.RAPID] for r, m in ((rows, before), (np.arange(len(after)), after)))
            for column in ("kind", "end_mm", "center_mm", "plane", "feed_mm_per_min", "tool", "spindle_rpm", "coolant"):
                np.testing.assert_array_equal(getattr(before, column)[rows], getattr(after, column)[mine])
        if name != "grbl":
            assert points == [1, 3, 4]
            with pytest.raises(InputError, match="operation 2 goes on with the tool that is in: it can begin at OP1, OP3, OP4"):
                restart.restarted_at_operation(whole, 2)
    with pytest.raises(InputError, match="operation 9 is not in this program"):
        restart.restarted_at_operation(whole, 9)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("planes", [("XY",), ()])
def test_a_control_without_arcs_in_a_plane_gets_chords_there(name, planes):
    machine = changed(ALL[name], arc_planes=planes)
    texts = posted(machine).texts
    moves = joined(texts, machine)
    arcs = moves.kind >= Kind.ARC_CW
    assert arcs.any() == bool(planes) and set(moves.plane[arcs]) <= {Plane.XY}
    chords = np.flatnonzero((moves.kind == Kind.FEED) & (moves.feed_mm_per_min == 900) & (moves.operation == 0))
    assert len(chords) > 60 and not re.search(r"G18\b", "".join(texts))
