"""A program in another control's words: the same moves to the last bit that both can write, or a refusal with its line."""

import json
import subprocess
import sys
from dataclasses import replace
from itertools import permutations

import known_tilted
import numpy as np
import pytest
from random_programs import LENGTHS, TOOLS, random_program
from small_program import BALL, FLAT, program
from tapped_holes import tapped
from typer.testing import CliRunner

from cuspline.app import catalogue, translation
from cuspline.app.cli import app
from cuspline.posts.readers.apt_reader import read_program
from cuspline.posts.writers import apt
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind, Plane
from cuspline.values.errors import InputError, PostError, ReadError

POSTS = ("linuxcnc", "fanuc", "haas", "grbl", "siemens", "heidenhain", "pmac", "apt")
BY_NUMBER = {t.number: t for t in TOOLS}
HEAD = "G21\nG17 G90 G91.1 G94 G40 G49 G80 G92.1\nG64 P0.0005 Q0\nG55\n(OPERATION 1: SLOT)\nG53 G0 Z0\nT3 M6\n" \
       "G43 H3\nS8000 M3\nM8\n"


def machine(post, **control):
    """With as many digits as all the others."""
    mill = translation.machine_of(post)
    return mill.model_copy(update={"control": mill.control.model_copy(update={"decimals_mm": 4, **control})})


def read(texts, post):
    return PostedMoves.joined([catalogue.reader_of(machine(post))(t, work_offsets={}, tool_lengths=LENGTHS) for t in texts],
                              [t.count("\n") for t in texts])


def one_tool(seed, helices):
    """A random program of one tool: Grbl has no others in one file."""
    told = random_program(seed, planes=(Plane.XY,), helices=helices)
    return replace(told, operations=tuple(replace(o, tool=TOOLS[0]) for o in told.operations))


@pytest.mark.parametrize("source, target", list(permutations(POSTS, 2)))
def test_every_control_gets_the_moves_of_every_other(source, target):
    helices = () if "apt" in (source, target) else tuple(Plane)        # which go out as chords there
    text = catalogue.find_post(source).post(one_tool(7, helices), machine(source)).text
    done = translation.translated(text, name="a.nc", source=machine(source), target=machine(target), tools=BY_NUMBER)
    here, there = (m.kind != Kind.RAPID for m in (read([text], source), read(done.texts, target)))
    before, after = read([text], source), read(done.texts, target)
    assert np.array_equal(before.kind[here], after.kind[there])
    off = np.abs(before.end_mm[here] - after.end_mm[there]).max()
    if "heidenhain" not in (source, target):        # whose helices end by an angle
        assert off < 1e-9 and [note for note in done.notes if "leave the path" not in note] == []
    assert off < 3e-4
    for column in ("tool", "spindle_rpm", "coolant", "feed_mm_per_min"):
        if column != "coolant" or "haas" not in (source, target):       # which has no mist
            np.testing.assert_allclose(getattr(before, column)[here], getattr(after, column)[there], atol=1e-9)


@pytest.mark.parametrize("post", ["linuxcnc", "siemens", "haas"])
def test_a_translation_into_its_own_words_changes_nothing_more(post):
    own = machine(post)
    text = catalogue.find_post(post).post(random_program(3), own).text
    translate = lambda t: translation.translated(t, name="a.nc", source=own, target=own).texts[0]
    once = translate(text)
    assert translate(once) == once and once.count("M6") == text.count("M6")


def test_several_tools_become_several_files_where_none_is_changed():
    text = catalogue.find_post("linuxcnc").post(program(), machine("linuxcnc")).text
    tools = {t.number: t for t in (FLAT, BALL)}
    done = translation.translated(text, name="a.ngc", source=machine("linuxcnc"), target=machine("grbl"), tools=tools)
    assert len(done.texts) == 2
    assert all(f"T{n}\nG43.1 Z{tools[n].length_mm:g}\n" in t for n, t in zip((3, 7), done.texts))


def test_between_cuts_by_way_of_the_machines_top_it_goes_there_again():
    """Where a machine move left the tip unknown, no rapid may cut across."""
    text = HEAD + "G0 X0 Y0\nG0 Z5\nG1 Z-1 F100\nG53 G0 Z0\nG0 X50 Y50\nG0 Z5\nG1 Z-2\nG53 G0 Z0\nM2\n"
    done = translation.translated(text, name="a.ngc", source=machine("linuxcnc"), target=machine("siemens"))
    lines = done.texts[0].splitlines()
    first, second = (k for k, line in enumerate(lines) if line.startswith("G1 Z-"))
    assert any(line.startswith("SUPA G0 Z0") for line in lines[first:second])


def test_more_than_one_turn_goes_out_in_pieces():
    text = HEAD + "G0 X10 Y0\nG0 Z5\nG3 X0 Y10 Z-1 I-10 J0 P3 F100\nG0 Z5\nM2\n"
    done = translation.translated(text, name="a.ngc", source=machine("linuxcnc"), target=machine("siemens"))
    moves = read(done.texts, "siemens")
    arcs = moves.kind == Kind.ARC_CCW
    turned = np.diff(np.unwrap(np.arctan2(*np.vstack([moves.start_mm[arcs][:1], moves.end_mm[arcs]])[:, [1, 0]].T)))
    assert turned.sum() == pytest.approx(4.5 * np.pi, abs=1e-4) and moves.end_mm[arcs][-1].tolist() == [0, 10, -1]


@pytest.mark.parametrize("block, wanted", [
    ("M5\nX9", "while the spindle stands"), ("G56\nG0 X9 Y0 Z5\nG55\nG0 X0 Y0 Z5", "G55 and G56"), ("M7\nX9", "mist and flood"),
    ("G86 X9", "unknown word G86"), ("X9 A90", "line 14")])
def test_what_would_be_lost_is_refused(block, wanted):
    text = HEAD + f"G0 X0 Y0\nG0 Z5\nG1 Z-1 F100\n{block}\nG1 X10\nM2\n"
    with pytest.raises((InputError, ReadError), match=wanted):
        translation.translated(text, name="a.ngc", source=machine("linuxcnc"), target=machine("haas"))


BACKWARDS = HEAD.replace("S8000 M3", "S6000 M4") + (
    "G0 X0 Y0\nG0 Z5\nG1 Z-1 F100\nG1 X9\nG0 Z5\nG0 X0 Y5\nM5\nS7000 M3\nG1 Z-1\nG1 X9\nG0 Z5\nM2\n")


@pytest.mark.parametrize("target", [p for p in POSTS if p != "linuxcnc"])
def test_a_spindle_that_turns_backwards_does_so_there_too(target):
    done = translation.translated(BACKWARDS, name="a.ngc", source=machine("linuxcnc"), target=machine(target), tools=BY_NUMBER)
    back = read(done.texts, target)
    assert back.spindle_rpm[back.kind == Kind.FEED].tolist() == [-6000, -6000, 7000, 7000]


def test_another_sense_of_the_spindle_is_found(monkeypatch):
    monkeypatch.setattr("cuspline.posts.writers.program_files.spindle_word", lambda operation: "M3")
    with pytest.raises(ReadError, match="line 13: the spindle does not come back with its speed and sense"):
        translation.translated(BACKWARDS, name="a.ngc", source=machine("linuxcnc"), target=machine("haas"))


# threads -----------------------------------------------------------------------------------------


def slow(mill):
    """With a spindle that turns as slowly as a tap."""
    return mill.model_copy(update={"spindle": mill.spindle.model_copy(update={"min_rpm": 100.0})})


TAPPING = "linuxcnc", "fanuc", "haas", "siemens", "heidenhain"


@pytest.mark.parametrize("source, target", list(permutations(TAPPING, 2)))
@pytest.mark.parametrize("sign", [1, -1])
def test_tapped_holes_come_back_with_pitch_and_hand(source, target, sign):
    text, _, operation = tapped(f"mill_{source}" if source != "linuxcnc" else "mill_3axis", sign)
    tools = {3: operation.tool}
    done = translation.translated(text, name="a.txt", source=slow(machine(source)), target=slow(machine(target)), tools=tools)
    back = catalogue.reader_of(machine(target))(done.texts[0], work_offsets={}, tool_lengths={3: operation.tool.length_mm})
    cuts = back.kind == Kind.FEED
    assert back.pitch_mm[cuts] == pytest.approx(6 * [float(sign)])
    assert back.end_mm[cuts][::2] == pytest.approx(np.array([[10, 10, -9], [30, 10, -9], [30, 25, -11.5]]))


@pytest.mark.parametrize("target", ["grbl", "pmac", "apt"])
def test_where_nothing_taps_threads_are_refused(target):
    text, _, operation = tapped("mill_fanuc")
    with pytest.raises(PostError, match="no rigid tapping|taps"):
        translation.translated(text, name="a.nc", source=machine("fanuc"), target=slow(machine(target)), tools={3: operation.tool})


def test_a_tied_feed_that_is_no_tapped_hole_is_refused():
    text = HEAD + "G0 X0 Y0\nG0 Z5\nG33 X1 Z-1 K1\nM2\n"
    with pytest.raises((InputError, ReadError), match="line 13"):
        translation.translated(text, name="a.ngc", source=machine("linuxcnc"), target=machine("haas"))


PAUSED = HEAD.replace("S8000 M3", "M0\nS8000 M3\nG4 P2.5") + (
    "G0 X0 Y0\nG0 Z5\nG1 Z-1 F100\nG4 P0.25\nG1 X10\nM5\nM9\nM0\nS8000 M3\nM8\nG1 Y10\nM1\nM3\nM8\nG2 X0 Y0 I-5 J-5 P2\nG0 Z2\n"
    "G82 Z-2 R0.5 P0.5 X3 Y3\nG80\nG0 Z5\nM5\nM1\nG53 G0 Z0\nM1\nT7 M6\nM0\nG43 H7\nS8000 M3\nG0 X0 Y0\nG0 Z5\nG1 Z-1 F100\n"
    "G53 G0 Z0\nM5\nM0\nM2\n").replace("G0 X0", "G98\nG0 X0", 1)
# (word, seconds, cuts before, whether the spindle turns, tool)
STANDS = [("M0", 0, 0, False, 3), ("G4", 2.5, 0, True, 3), ("G4", 0.25, 1, True, 3), ("M0", 0, 2, False, 3), ("M1", 0, 3, True, 3),
          ("G4", 0.5, 5, True, 3), ("M1", 0, 5, False, 3), ("M1", 0, 5, False, 3), ("M0", 0, 5, False, 7), ("M0", 0, 6, False, 7)]


def where_it_stands(moves):
    """Of every stop and dwell of a millisecond or more; arcs of more than a turn, and those in pieces, count once."""
    cuts = np.flatnonzero(moves.kind != Kind.RAPID)
    begins = cuts[np.r_[True, np.diff(moves.line[cuts]) != 0] | (moves.kind[cuts] == Kind.FEED)]
    begins = begins[np.r_[True, ~((moves.kind[begins[1:]] > Kind.FEED) & (moves.kind[begins[:-1]] > Kind.FEED))]]
    turns, tool, out = False, 0, []
    for stop in moves.stops:
        if stop.word == "M6":
            tool = int(moves.tool[min(stop.row, len(moves) - 1)])
        if stop.word in ("M0", "M1") or stop.seconds >= 1e-3:
            out.append((stop.word, round(stop.seconds, 3), int(np.searchsorted(begins, stop.row)), turns, tool))
        turns = {"M3": True, "M5": False, "M6": False}.get(stop.word, turns)
    return out


@pytest.mark.parametrize("target", [p for p in POSTS if p != "grbl"])
def test_stops_and_dwells_come_back_where_they_were_with_the_spindle_as_it_was(target):
    tools = {3: FLAT, 7: BALL}
    done = translation.translated(PAUSED, name="a.ngc", source=machine("linuxcnc"), target=machine(target), tools=tools)
    back = PostedMoves.joined([catalogue.reader_of(machine(target))(t, work_offsets={}, tool_lengths={3: 0, 7: 0})
                               for t in done.texts], [t.count("\n") for t in done.texts])
    assert where_it_stands(read_plain(PAUSED)) == STANDS == where_it_stands(back)
    assert (back.spindle_rpm[back.kind != Kind.RAPID] == 8000).all() and back.remarks == ()
    assert [note for note in done.notes if "stop" in note] == []


def read_plain(text):
    return catalogue.reader_of(machine("linuxcnc"))(text, work_offsets={}, tool_lengths={3: 0, 7: 0})


def test_an_optional_stop_becomes_one_that_stops_where_the_control_passes_over_it():
    text = HEAD + "G0 X0 Y0\nG0 Z5\nG1 Z-1 F100\nM1\nM3\nG1 X10\nM2\n"
    done = translation.translated(text, name="a.ngc", source=machine("linuxcnc"), target=machine("grbl"), tools={3: FLAT})
    assert "line 14: the optional stop became one that always stops" in done.notes and "\nM0\nS8000 M3\n" in done.texts[0]


@pytest.mark.parametrize("block, wanted", [("M0", "line 14: M0"), ("G4 P2", "line 14: G4")])
def test_a_stop_or_a_dwell_that_a_post_drops_or_moves_is_found(block, wanted):
    text = HEAD + f"G0 X0 Y0\nG0 Z5\nG1 Z-1 F100\n{block}\nM3\nG1 X10\nM2\n"
    moves, control = read_plain(text), machine("linuxcnc").control
    assert translation._compared(moves, moves, control, 0) == []
    stop = next(s for s in moves.stops if s.word in ("M0", "G4"))
    for other in ((), (replace(stop, row=stop.row + 1),), (replace(stop, seconds=stop.seconds + 0.01),)):
        with pytest.raises(ReadError, match=wanted):
            translation._compared(moves, replace(moves, stops=other), control, 0)


@pytest.mark.parametrize("post, tip", [("linuxcnc", None), ("fanuc", "G43.4"), ("siemens", "TRAORI")])
def test_a_program_with_rotaries_becomes_cutter_locations(post, tip):
    """Tip by tip and axis by axis, joints solved or not; and those become the same in inches."""
    source = known_tilted.machine("mill_trunnion_ac", post=post, tip_control=tip)
    told = known_tilted.program(known_tilted.operation("finish", known_tilted.rolling()))
    text, tools = catalogue.find_post(post).post(told, source).text, {7: known_tilted.BALL}
    done = translation.translated(text, name="a.nc", source=source, target=machine("apt"), tools=tools)
    back = read_program(done.texts[0], work_offsets={}, tool_lengths={7: 0.0})
    known_tilted.assert_ends_are_read(back, known_tilted.rolling(), 2e-4, 2e-7)
    inch = machine("apt", units="inch", decimals_inch=6)
    again = translation.translated(done.texts[0], name="a.apt", source=machine("apt"), target=inch)
    assert "UNITS/INCHES" in again.texts[0] and again.texts[0].count("GOTO/") == done.texts[0].count("GOTO/")
    with pytest.raises(InputError, match="give the tools by --cutters"):
        translation.translated(text, name="a.nc", source=source, target=machine("apt"))
    with pytest.raises(PostError, match="the tool axis leans"):
        translation.translated(done.texts[0], name="a.apt", source=machine("apt"), target=machine("haas"))


ROTARY = ("mill_trunnion_ac", "mill_haas_5axis", "mill_heidenhain_5axis", "mill_siemens_5axis")


@pytest.fixture(scope="module")
def leaning_locations():
    told = known_tilted.program(known_tilted.operation("finish", known_tilted.rolling()), known_tilted.position(25.0, 70.0))
    return apt.post(told, machine("apt")).text


@pytest.mark.parametrize("name", ROTARY)
def test_cutter_locations_of_a_leaning_tool_become_rotary_words(name, leaning_locations):
    """Joints solved under G93, or the tip's own control; every end and axis comes back through the machine's joints."""
    target, tools = catalogue.find_machine(name), {7: known_tilted.BALL}
    done = translation.translated(leaning_locations, name="a.apt", source=machine("apt"), target=target, tools=tools)
    back = known_tilted.read_with_tools(target, done.texts[0])
    known_tilted.assert_ends_are_read(back, known_tilted.rolling(), 1e-3, 2e-5)
    assert not any("arc" in note for note in done.notes)
    with pytest.raises(InputError, match="turns rotary axes: where its joints are .* give the tools by --cutters"):
        translation.translated(leaning_locations, name="a.apt", source=machine("apt"), target=target)


@pytest.mark.parametrize("spoil", [
    lambda m, k: edited(m, "end_mm", k, m.end_mm[k] + (0.0, 0.0, 0.02)), lambda m, k: edited(m, "end_axis", k, m.end_axis[k - 1]),
    lambda m, k: edited(m, "feed_mm_per_min", k, 0.5 * m.feed_mm_per_min[k])])
def test_rotary_words_that_lead_elsewhere_are_found(spoil, leaning_locations):
    """An end, an axis, or a feed that is lower in the program than in what came back."""
    target, tools = catalogue.find_machine("mill_haas_5axis"), {7: known_tilted.BALL}
    text = translation.translated(leaning_locations, name="a.apt", source=machine("apt"), target=target, tools=tools).texts[0]
    back = known_tilted.read_with_tools(target, text)
    moves = read_program(leaning_locations, work_offsets={}, tool_lengths={7: 0.0})
    row = int(np.flatnonzero((moves.kind == Kind.FEED) & (moves.end_axis[:, 2] < 0.99))[4])
    assert translation._compared(moves, back, target.control, 0, target.rotaries) is not None
    with pytest.raises(ReadError, match=f"line {moves.line[row]}: "):
        translation._compared(spoil(moves, row), back, target.control, 0, target.rotaries)


def edited(moves, name, row, value):
    """The same moves, but for one value."""
    column = getattr(moves, name).copy()
    column[row] = value
    return replace(moves, **{name: column})


def test_a_program_of_one_machine_with_rotaries_becomes_one_of_another():
    source = known_tilted.machine("mill_trunnion_ac", post="fanuc", tip_control="G43.4")
    told = known_tilted.program(known_tilted.operation("finish", known_tilted.rolling()))
    target, tools = catalogue.find_machine("mill_heidenhain_5axis"), {7: known_tilted.BALL}
    text = catalogue.find_post("fanuc").post(told, source).text
    done = translation.translated(text, name="a.nc", source=source, target=target, tools=tools)
    back = known_tilted.read_with_tools(target, done.texts[0])
    known_tilted.assert_ends_are_read(back, known_tilted.rolling(), 1e-3, 2e-5)


def test_another_axis_is_another_program():
    text = apt.post(known_tilted.program(known_tilted.operation("finish", known_tilted.rolling())), machine("apt")).text
    moves = read_program(text, work_offsets={}, tool_lengths={7: 0.0})
    turned = moves.end_axis.copy()
    turned[20] = (0.0, 0.6, 0.8)
    with pytest.raises(ReadError, match=f"line {moves.line[20]}: "):
        translation._compared(moves, replace(moves, end_axis=turned), machine("apt").control, 0)


def test_a_post_that_writes_another_program_is_found():
    text = catalogue.find_post("linuxcnc").post(program(), machine("linuxcnc")).text
    control, moves = machine("linuxcnc").control, read([text], "linuxcnc")
    arc = int(np.flatnonzero(moves.kind >= Kind.ARC_CW)[0])
    assert translation._compared(moves, moves, control, 0) == []
    for column, change in (("end_mm", 0.001), ("center_mm", 0.01), ("kind", 1), ("feed_mm_per_min", 5.0)):
        changed = getattr(moves, column).copy()
        changed[arc] += change
        with pytest.raises(ReadError):
            translation._compared(moves, replace(moves, **{column: changed}), control, 0)
    last = int(np.flatnonzero(moves.kind != Kind.RAPID)[-1])
    for other in (moves.between(0, last), moves.between(0, arc)):
        with pytest.raises(ReadError, match="line"):
            translation._compared(moves, other, control, 0)
    with pytest.raises(ReadError, match="more than the program has"):
        translation._compared(moves.between(0, last), moves, control, 0)


def test_the_command_writes_and_refuses(tmp_path):
    text = catalogue.find_post("linuxcnc").post(program(), machine("linuxcnc")).text
    (tmp_path / "a.ngc").write_text(text)
    (tmp_path / "finer.ngc").write_text(text.replace("X20 F1200", "X20.00004 F1200"))
    run = lambda *words: CliRunner().invoke(app, ["translate", *map(str, words)])
    done = run(tmp_path / "a.ngc", "--to", "heidenhain")
    assert done.exit_code == 0 and done.stdout.startswith("0 BEGIN PGM SETUP_1 MM\n") and done.stderr == ""
    finer = run(tmp_path / "finer.ngc", "--to", "heidenhain")
    assert finer.exit_code == 0 and "note: ends are up to 4e-05 mm off: 4 decimals in mm" in finer.stderr
    assert run(tmp_path / "a.ngc", "--to", "haas", "--out", tmp_path / "b.nc").exit_code == 0
    assert (tmp_path / "b.nc").read_text().startswith("%\nO00101\n")
    back = run(tmp_path / "b.nc", "--from", "haas", "--to", "linuxcnc")
    assert back.exit_code == 0 and "T7 M6" in back.stdout
    library = {"tools": [t.model_dump(mode="json") for t in (FLAT, BALL)]}
    (tmp_path / "tools.json").write_text(json.dumps(library))
    assert run(tmp_path / "a.ngc", "--to", "grbl", "--cutters", tmp_path / "tools.json", "--out", tmp_path / "c.nc").exit_code == 0
    assert sorted(p.name for p in tmp_path.glob("c*")) == ["c-01.nc", "c-02.nc"]
    assert run(tmp_path / "a.ngc", "--to", "apt", "--out", tmp_path / "d.apt").exit_code == 0
    assert run(tmp_path / "d.apt", "--to", "siemens").exit_code == 0
    (tmp_path / "e.apt").write_text((tmp_path / "d.apt").read_text().replace("RAPID", "RAPIDD", 1))
    assert subprocess.run([sys.executable, "-m", "cuspline", "translate", tmp_path / "e.apt", "--to", "haas"]).returncode == 2
    for words, wanted in (((tmp_path / "b.nc", "--to", "siemens"), "say which one by --from"),
                          ((tmp_path / "a.ngc", "--to", "grbl"), "give the tools by --cutters"),
                          ((tmp_path / "a.ngc", "--to", "okuma"), "there is no post 'okuma'"),
                          ((tmp_path / "a.ngc", "--to", "haas", "--from", "siemens"), "line ")):
        assert wanted in str(run(*words).exception)
