"""A numbered set read back: its files one after the other, every line in its own file."""

import numpy as np
import pytest
from known_passes import BALL, CLEARANCE_MM, LENGTHS, ZERO, machine, program
from typer.testing import CliRunner

from cuspline.app.catalogue import find_post, reader_of
from cuspline.app.cli import app
from cuspline.app.judge import _in_files
from cuspline.posts.restart import restarted
from cuspline.posts.writers.linuxcnc import post
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind, MoveWriter, Operation, Program
from cuspline.values.findings import Finding
from cuspline.verification.file_checks import program_findings


def read_set():
    mill = machine(program_store_bytes=1110)
    texts = post(program(), mill).texts
    parts = [reader_of(mill)(t, work_offsets=ZERO, tool_lengths=LENGTHS) for t in texts]
    return texts, parts, PostedMoves.joined(parts, [t.count("\n") for t in texts])


def test_a_set_is_its_files_one_after_the_other():
    texts, parts, whole = read_set()
    assert len(texts) > 2 and len(whole) == sum(len(p) for p in parts)
    assert whole.operations == ("rough", "finish") and whole.ended
    names = [whole.operation_name(k) for k in np.flatnonzero(whole.kind >= Kind.ARC_CW)]
    assert names == 12 * ["rough"] + 12 * ["finish"]
    lines = "".join(texts).splitlines()
    assert all("G2 " in lines[n - 1] for n in whole.line[whole.kind >= Kind.ARC_CW])
    assert not PostedMoves.joined([*parts[:-1], PostedMoves(**{**parts[-1].__dict__, "ended": False})],
                                  [t.count("\n") for t in texts]).ended


def test_a_finding_names_the_file_and_its_own_line():
    texts, _, whole = read_set()
    parts = {f"setup-1-{k:02d}.ngc": t for k, t in enumerate(texts, 1)}
    at = int(whole.line[np.flatnonzero(whole.kind >= Kind.ARC_CW)[-1]])
    block = "".join(texts).splitlines()[at - 1]
    finding = Finding(kind="excess", amount_mm=0.1, place_mm=None, operation="finish", line=at, setup="setup-1",
                      advice="", block=block)
    found, = _in_files((finding,), parts)
    name, _, said = found.block.partition(": ")
    assert name == list(parts)[-1] and parts[name].splitlines()[found.line - 1] == said == block
    first, = _in_files((Finding(**{**finding.as_dict(), "line": 3, "block": "G17"}),), parts)
    assert (first.line, first.block) == (3, "setup-1-01.ngc: G17")
    assert _in_files((finding,), {"setup-1.ngc": texts[0]}) == (finding,)


def hops(count=40):
    """Plain strokes with a retract to the clearance height after each."""
    w = MoveWriter((0, 0, CLEARANCE_MM))
    for k in range(count):
        w.rapid((k, 0, CLEARANCE_MM))
        w.feed((k, 0, 1 / 3), 300)
        w.feed((k, 50.123, 1 / 3), 900)
        w.rapid((k, 50.123, CLEARANCE_MM))
    return w.moves()


def of_hops(*counts):
    told = tuple(Operation(name=f"rough {k}", tool=BALL, spindle_rpm=8000.0, coolant="off", moves=hops(count))
                 for k, count in enumerate(counts or (40,), 1))
    return Program(name="hops", setup="setup-1", wcs="G55", wcs_in_words="", clearance_z_mm=CLEARANCE_MM,
                   header=("HOPS",), operations=told)


@pytest.mark.parametrize("name", ["linuxcnc", "fanuc", "haas", "grbl", "siemens", "heidenhain", "pmac"])
def test_plain_moves_are_split_where_the_tool_stands_high(name):
    told = of_hops()
    large, small = machine(name), machine(name, program_store_bytes=1200)
    whole, parts = find_post(name).post(told, large), find_post(name).post(told, small).texts
    assert len(whole.texts) == 1 and len(parts) > 1 and max(len(t) for t in parts) <= 1200
    rows = lambda m: np.column_stack([m.start_mm, m.end_mm, m.feed_mm_per_min])[m.kind == Kind.FEED]
    cut = lambda texts: np.vstack([rows(reader_of(large)(t, work_offsets=ZERO, tool_lengths=LENGTHS)) for t in texts])
    assert np.array_equal(cut(parts), cut(whole.texts))


@pytest.mark.parametrize("name, numbers", [("pmac", 0), ("pmac", 10), ("linuxcnc", 0), ("heidenhain", 0)])
def test_plain_moves_are_split_where_a_store_of_sub_blocks_is_full(name, numbers):
    """Files no longer than the control counts, word by word; one word less of room is one that the verdict tells."""
    told, large = of_hops(), machine(name, block_numbers=numbers)
    small = machine(name, block_numbers=numbers, program_store_sub_blocks=160)
    whole, parts = find_post(name).post(told, large), find_post(name).post(told, small).texts
    words = [sum(len(line.split(";")[0].split()) for line in t.splitlines() if not line.startswith("(")) for t in parts]
    assert len(whole.texts) == 1 and len(parts) > 1 and max(words) <= 160
    feeds = lambda texts: np.vstack([m.end_mm[m.kind == Kind.FEED] for m in (
        reader_of(large)(t, work_offsets=ZERO, tool_lengths=LENGTHS) for t in texts)])
    assert np.array_equal(feeds(parts), feeds(whole.texts))
    for room, found in ((max(words), 0), (max(words) - 1, 1)):
        tight = machine(name, program_store_sub_blocks=room)
        kinds = [f.kind for t in parts for f in program_findings("a", t, "setup-1", tight)]
        assert (kinds.count("program_too_long") > 0) == bool(found)


@pytest.mark.parametrize("name", ["linuxcnc", "fanuc", "grbl", "heidenhain"])
@pytest.mark.parametrize("first", range(8, 20))
def test_an_operation_that_begins_where_the_store_is_full_begins_a_file(name, first):
    large, small = machine(name), machine(name, program_store_bytes=1200)
    whole, parts = (find_post(name).post(of_hops(first, 5), m).texts for m in (large, small))
    assert max(len(t) for t in parts) <= 1200 - 160       # room is kept for the verdict in the header
    read = lambda texts: [reader_of(large)(t, work_offsets=ZERO, tool_lengths=LENGTHS) for t in texts]
    feeds = lambda texts: np.vstack([m.end_mm[m.kind == Kind.FEED] for m in read(texts)])
    assert np.array_equal(feeds(parts), feeds(whole))


def test_a_stroke_longer_than_the_store_stays_whole():
    """No place to split: the judge says that the program is too long."""
    assert len(post(of_hops(1), machine(program_store_bytes=100)).texts) == 1


def test_the_command_lists_restart_points_and_begins_at_one(tmp_path):
    (tmp_path / "a.ngc").write_text(post(program(), machine()).text)
    run = lambda *more: CliRunner().invoke(app, ["restart", str(tmp_path / "a.ngc"), *more])
    first, second, points = run().output.splitlines()
    assert first.startswith("OP1  ") and second.startswith("OP2  ") and ", T" in first
    assert points == "N1001 N1002 N1003 N2001 N2002 N2003"
    assert run("n2002").output == restarted((tmp_path / "a.ngc").read_text(), 2002)
    assert run("N2003", "--to", str(tmp_path / "b.ngc")).exit_code == 0
    assert (tmp_path / "b.ngc").read_text().count("call") < 6
    assert "write it as in the program, such as N2003" in str(run("second").exception)
    assert "N7 is not in this program" in str(run("N7").exception)
