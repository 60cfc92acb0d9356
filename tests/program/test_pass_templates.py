"""Repeated passes as sub-programs: both dialects come to the moves of the templates, whole and from any restart."""

import itertools
import re

import numpy as np
import pytest
from known_passes import BALL, LENGTHS, PER_RESTART, ZERO, machine, passes, program

from cuspline.app.catalogue import find_post, reader_of
from cuspline.posts.readers.fanuc_reader import read_program as read_fanuc
from cuspline.posts.restart import restart_points, restarted
from cuspline.program.pass_templates import (
    Call,
    Go,
    Let,
    Named,
    PassTemplate,
    Quantity,
    Register,
    Restart,
    Root,
    TemplatedPasses,
)
from cuspline.program.program import Kind
from cuspline.values.errors import InputError, PostError, ReadError, ToolpathError


def read(text, a_machine):
    return reader_of(a_machine)(text, work_offsets=ZERO, tool_lengths=LENGTHS)


def cut(moves, operation, planned):
    """(kinds, ends, centres) of an operation's moves that have a length, from the first one that was planned on."""
    far = ~(np.abs(moves.end_mm - moves.start_mm).max(axis=1) < 1e-9)
    rows = np.flatnonzero(far & (moves.operation == operation))
    offsets = range(len(rows) - len(planned) + 1)
    off = [np.abs(moves.end_mm[rows[k:k + len(planned)]] - planned.end_mm).max() for k in offsets]
    rows = rows[int(np.nanargmin(off)):][:len(planned)]
    return moves.kind[rows], moves.end_mm[rows], moves.center_mm[rows]


EVERY = pytest.mark.parametrize("post, units", list(itertools.product(("linuxcnc", "fanuc"), ("mm", "inch"))))


@EVERY
def test_the_calls_come_to_the_long_hand_moves_within_the_stated_rounding(post, units):
    mill = machine(post, units)
    posted = find_post(post).post(program(), mill)
    moves = read(posted.text, mill)
    assert moves.ended and moves.operations == ("rough", "finish")
    assert 0 < posted.largest_rounding_mm < 4 * mill.control.resolution_mm
    for k, operation in enumerate(program().operations):
        planned = operation.moves
        kinds, ends, centers = cut(moves, k, planned)
        arcs = kinds >= Kind.ARC_CW
        assert np.array_equal(kinds, planned.kind) and arcs.sum() == 12
        assert np.abs(ends - planned.end_mm).max() <= posted.largest_rounding_mm + 1e-9
        assert np.abs(centers[arcs] - planned.center_mm[arcs]).max() <= posted.largest_rounding_mm + 1e-9


@EVERY
def test_the_long_hand_program_makes_the_same_moves(post, units):
    mill = machine(post, units)
    compact = find_post(post).post(program(), mill)
    long_hand = find_post(post).post(program(), machine(post, units, sub_programs=False))
    assert "7001" in compact.text and "7001" not in long_hand.text
    a, b = (read(p.text, mill) for p in (compact, long_hand))
    for k, operation in enumerate(program().operations):
        (kinds, ends, centers), (other_kinds, other_ends, other_centers) = (cut(m, k, operation.moves) for m in (a, b))
        off = compact.largest_rounding_mm + 2 * long_hand.largest_rounding_mm
        assert np.array_equal(kinds, other_kinds)
        assert np.abs(ends - other_ends).max() <= off
        assert np.nanmax(np.abs(centers - other_centers)) <= off


@EVERY
def test_what_is_read_is_the_expansion_of_the_rounded_numbers(post, units):
    """The controller's arithmetic on the text's numbers, and ours on the same numbers."""
    mill = machine(post, units)
    decimals, scale = (4, 1.0) if units == "mm" else (6, 25.4)
    rounding = lambda v, unit: round(v / scale, decimals) * scale if unit == "mm" else round(v / scale, 1) * scale
    moves = read(find_post(post).post(program(), mill).text, mill)
    for k, operation in enumerate(program().operations):
        expected = operation.passes.rounded(rounding).moves()
        _, ends, centers = cut(moves, k, expected)
        assert np.abs(ends - expected.end_mm).max() < 1e-9
        assert np.nanmax(np.abs(centers - expected.center_mm)) < 1e-9


def test_one_register_offsets_all_passes():
    mill = machine()
    wide, true = (find_post("linuxcnc").post(program(("finish", BALL, passes(radius=r))), mill).text
                  for r in (3.2, 3.0))
    changed = [(a, b) for a, b in zip(wide.splitlines(), true.splitlines()) if a != b and a[0] != "("]
    assert len(changed) == 1 and changed[0][0].startswith("#101=3.2 ")
    moves = read(wide, mill), read(true, mill)
    radii = [np.linalg.norm((m.end_mm - m.center_mm)[m.kind >= Kind.ARC_CW, 1:], axis=1) for m in moves]
    assert np.abs(radii[0] - radii[1] - 0.2).max() < 1e-12


@EVERY
def test_every_restart_point_leads_to_the_same_moves(post, units):
    mill = machine(post, units)
    text = find_post(post).post(program(), mill).text
    whole = read(text, mill)
    assert restart_points(text) == [1001, 1002, 1003, 2001, 2002, 2003]
    rows = lambda m: np.column_stack([m.kind, m.end_mm, np.nan_to_num(m.center_mm), m.feed_mm_per_min, m.tool])
    for point in restart_points(text):
        moves = read(restarted(text, point), mill)
        # behind the preamble and the lift the two are the same to the last bit
        count = len(moves) - 1 - (np.flatnonzero(moves.kind != Kind.RAPID)[0] - 2)
        assert np.array_equal(rows(moves)[-count:], rows(whole)[-count:])
        left = int(str(point)[-1]) - 1
        arcs_of_last = 12 * (2 if point < 2000 else 1) - PER_RESTART * left
        assert (moves.kind >= Kind.ARC_CW).sum() == arcs_of_last
        assert moves.length_offset_on[moves.kind != Kind.RAPID].all()


def test_a_restart_point_that_is_not_there_is_refused():
    text = find_post("linuxcnc").post(program(), machine()).text
    with pytest.raises(InputError, match="N1004 is not in this program; it has N1001 to N2003"):
        restarted(text, 1004)


@pytest.mark.parametrize("post", ["linuxcnc", "fanuc"])
def test_a_restart_point_where_nothing_counts_on_is_a_block_number_alone(post):
    level = Go(Kind.FEED, x=Named("a"), y=Named("a"), z=Named("clear"), feed=Named("feed"))
    told = TemplatedPasses(
        start_mm=(0, 0, 40), items=(Restart(1, ()), Call("go", (1.0,)), Restart(2, ()), Call("go", (2.0,))),
        registers=(Register(Quantity("clear", axis=2), 40.0), Register(Quantity("feed", "mm/min"), 100.0)),
        templates=(PassTemplate("go", (Quantity("a"),), (Go(Kind.RAPID, z=Named("clear")), level)),))
    mill = machine(post)
    text = find_post(post).post(program(("rough", BALL, told)), mill).text
    assert "\nN1002\n" in text and restart_points(text) == [1001, 1002]
    ends = [m.end_mm[m.kind == Kind.FEED, 0].tolist() for m in (read(text, mill), read(restarted(text, 1002), mill))]
    assert ends == [[1.0, 2.0], [2.0]]


@pytest.mark.parametrize("post", ["linuxcnc", "fanuc"])
def test_a_program_beyond_the_store_becomes_a_set_that_cuts_the_same(post):
    mill = machine(post, program_store_bytes=1110)
    whole = find_post(post).post(program(), machine(post))
    posted = find_post(post).post(program(), mill)
    assert len(posted.texts) > 2 and max(len(t) for t in posted.texts) <= 950
    with pytest.raises(PostError, match="a set of"):
        posted.text
    parts = [read(t, mill) for t in posted.texts]
    assert all(p.ended for p in parts)
    arcs = lambda m: np.column_stack([m.end_mm, m.center_mm, m.feed_mm_per_min, m.tool])[m.kind >= Kind.ARC_CW]
    assert np.array_equal(np.vstack([arcs(p) for p in parts]), arcs(read(whole.text, mill)))
    assert [p for t in posted.texts for p in restart_points(t)] == restart_points(whole.text)
    assert "(FROM RESTART POINT N" in posted.texts[1]


@pytest.mark.parametrize("post", ["linuxcnc", "fanuc"])
def test_a_store_smaller_than_one_span_is_refused(post):
    with pytest.raises(PostError, match="put restart points closer together"):
        find_post(post).post(program(), machine(post, program_store_bytes=760))


# what templates refuse --------------------------------------------------------------------------------


def refused(match, **changes):
    parts = {"start_mm": (0, 0, 40), "registers": (Register(Quantity("clear", axis=2), 40.0),), "items": (
        Restart(1, (("clear", 40.0),)), Call("up", ())),
             "templates": (PassTemplate("up", (), (Go(Kind.RAPID, z=Named("clear")),)),)} | changes
    with pytest.raises(ToolpathError, match=match):
        TemplatedPasses(**parts).moves()


def test_faulty_templates_are_refused():
    up = Go(Kind.RAPID, z=Named("clear"))
    refused("uses .'r'., which nothing gives", templates=(PassTemplate("up", (), (Let("a", Named("r")), up)),))
    refused("needs a feed", templates=(PassTemplate("up", (), (up, Go(Kind.FEED, x=Named("clear")))),))
    across = Go(Kind.RAPID, x=Named("clear"))
    refused("begin with a rapid straight up", templates=(PassTemplate("up", (), (across, up)),))
    refused("begin with a restart point", items=(Call("up", ()),))
    refused("call of 'down' with 0 arguments: templates are 'up' with 0", items=(Restart(1, ()), Call("down", ())))
    refused("share a name", templates=(PassTemplate("up", (Quantity("clear"),), (up,)),))
    counts = (PassTemplate("up", (), (up, Let("clear", Named("clear") + 1))),)
    refused("restart point 1 gives ..; registers that count on are .'clear'.", items=(Restart(1, ()), Call("up", ())),
            templates=counts)
    refused("restart point 1 gives .'r'.", items=(Restart(1, (("r", 1.0),)), Call("up", ())))
    refused("call 1 of 'up'", templates=(PassTemplate("up", (), (up, Let("a", Root(Named("clear") * -1)))),))


def test_a_macro_with_too_many_letters_or_brackets_is_refused():
    many = PassTemplate("up", tuple(Quantity(f"a{k}") for k in range(22)), (Go(Kind.RAPID, z=Named("clear")),))
    deep = Named("clear")
    for _ in range(6):
        deep = Named("clear") - (deep - 1)
    nested = PassTemplate("up", (), (Go(Kind.RAPID, z=Named("clear")), Let("a", deep)))
    for template, arguments, match in ((many, (1.0,) * 22, "needs 22 arguments, the control has 21"),
                                       (nested, (), "nests brackets deeper than the 5")):
        told = TemplatedPasses(start_mm=(0, 0, 40), registers=(Register(Quantity("clear", axis=2), 40.0),),
                               templates=(template,), items=(Restart(1, (("clear", 40.0),)), Call("up", arguments)))
        with pytest.raises(PostError, match=match):
            find_post("fanuc").post(program(("rough", BALL, told)), machine("fanuc"))


def test_shifting_the_zero_shifts_every_move():
    by = np.array([10.0, -3.0, 7.5])
    there, here = passes().shifted(by).moves(), passes().moves()
    assert np.abs(there.end_mm - here.end_mm - by).max() < 1e-12
    arcs = here.kind >= Kind.ARC_CW
    assert np.abs((there.center_mm - here.center_mm)[arcs] - by)[:, 1:].max() < 1e-12


# Fanuc text -------------------------------------------------------------------------------------------

GOOD = ("%\nO0001\nG21 G90 G54\nT7 M6\nS100 M3\nG0 X0. Y0.\nG43 Z5. H7\n{}\nM30\n"
        "O7001\nG1 X#1 Y[#2+#500] F100.\nM99\n%\n")
REFUSED = {
    "a length without a point": ("G1 X10 F100.", "X10 without a decimal point may be millimetres or thousandths"),
    "a feed without a point": ("G1 X10. F100", "F100 without a decimal point"),
    "an argument without a point": ("#500=0.\nG65 P7001 A1 B2.", "A1 without a decimal point"),
    "a variable nobody has set": ("G65 P7001 A1. B2.", "#500 is read before it is set"),
    "an argument that was not given": ("#500=0.\nG65 P7001 A1.", "#2 is read before it is set"),
    "a program that is not there": ("M98 P7002", "O7002 is called, but the text holds no such"),
    "a loop": ("WHILE[#500LT3]DO1", "control flow that this reader does not follow"),
    "a jump": ("GOTO 10", "control flow that this reader does not follow"),
    "a system variable": ("#5221=3.", "#5221 is no variable of a program's own"),
    "LinuxCNC's words": ("G64 P0.01", "no code in this block uses P|P"),
    "a zero that is shifted": ("G52 X0. Y0. Z5.", "shifts the zero, or leaves it shifted"),
    "a zero that stays shifted along Z": ("G52 X0. Y0.", "shifts the zero, or leaves it shifted"),
    "a local zero and a move": ("G52 G0 X0. Y0. Z0.", "G52 and G0 share the axis words"),
    "a local zero on the way home": ("G91 G28 G52 X0. Y0. Z0.", "G28 and G52 share the axis words"),
    "another way home": ("G28 Z0.", "write G91 G28 Z0."),
    "a return from the main program": ("M99", "M99 in the main program"),
    "a letter twice": ("G65 P7001 I1. I2.", "a letter twice"),
    "block delete": ("/G0 X1.", "block delete"),
    "a second block in the line": ("G1 X1. F100. ; G1 X2.", "or a ;"),
    "turns of an arc": ("G2 X0. Y0. I5. J0. P3 F100.", "no code in this block uses P"),
    "cutter compensation": ("G41 D1", "G41 while the radius in D1 is not known"),
    "a length offset without its number": ("G43 Z5.", "takes the offset that was last in force"),
    "a carriage return between blocks": ("G0 X1.\rG0 Y1.", "carriage return inside a line"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_fanuc_text_that_is_not_sure_is_refused_with_its_line(name):
    line, match = REFUSED[name]
    with pytest.raises(ReadError, match=match) as caught:
        read_fanuc(GOOD.format(line), work_offsets=ZERO, tool_lengths=LENGTHS)
    assert re.match(r"line \d+(, called in line \d+)?: ", str(caught.value))


def nested_in_fanuc(levels, times=1):
    """Text whose O7001 moves, O7002 calls it `times` times, and so on; the main program calls the last."""
    subs = "".join(f"O{7000 + k}\n" + f"M98 P{6999 + k}\n" * times + "M99\n" for k in range(2, levels + 1))
    return GOOD.format(f"#500=2.\n#1=1.\n#2=1.\nM98 P{7000 + levels}")[:-2] + subs + "%\n"


def test_fanuc_calls_nest_four_deep_and_no_deeper(monkeypatch):
    read = lambda text: read_fanuc(text, work_offsets=ZERO, tool_lengths=LENGTHS)
    assert len(read(nested_in_fanuc(4))) == 3
    with pytest.raises(ReadError, match="line 17, called in line 11: 'M98 P7001': calls nested deeper than 4"):
        read(nested_in_fanuc(5))
    monkeypatch.setattr("cuspline.posts.readers.rs274_blocks.MOST_CALLED", 1000)
    with pytest.raises(ReadError, match="called in line 11: .* come to more than 1,000 blocks"):
        read(nested_in_fanuc(4, 10))


def test_fanuc_h0_switches_the_length_offset_off():
    moves = read_fanuc(GOOD.format("G43 Z5. H0\nG1 X1. F100."), work_offsets=ZERO, tool_lengths=LENGTHS)
    assert not moves.length_offset_on[-1] and moves.machine_end_mm[-2, 2] == pytest.approx(5.0)


@pytest.mark.parametrize("word, line", [("G54", 7), ("G40", 7), ("G80", 5), ("G94", 9), ("G17", 10),
                                        ("G52 X0. Y0. Z0.", 7)])
def test_what_a_fanuc_move_relies_on_must_have_been_said(word, line):
    text = ("%\nO0001\nG21 G17 G90 G94 G40 G80 G54\nG52 X0. Y0. Z0.\nG91 G28 Z0.\nG90 T7 M6\nG0 X0. Y0.\n"
            "G43 Z5. H7\nG1 X1. F9.\nG2 X3. Y0. I1. J0.\nM30\n%\n")
    read = lambda text: read_fanuc(text, work_offsets=ZERO, tool_lengths=LENGTHS)
    assert not read(text).remarks and np.isnan(read(text).path_tolerance_mm).all()     # G64's is a parameter
    (remark,) = read(re.sub(rf" ?{re.escape(word)}", "", text, count=1)).remarks
    assert remark.kind == "unknown_start" and remark.advice.startswith(word) and read(text).line[remark.row] == line


def test_fanuc_calls_have_variables_of_their_own_and_m98_has_not():
    text = GOOD.format("#500=2.\n#1=7.\nG65 P7001 A1. B3.\nG1 X[#1+1.]\n#2=4.\nM98 P7001")
    moves = read_fanuc(text, work_offsets=ZERO, tool_lengths=LENGTHS)
    assert moves.end_mm[-3:, :2].tolist() == [[1.0, 5.0], [8.0, 5.0], [7.0, 6.0]]


@pytest.mark.parametrize("text, match", [
    ("O1\nM30\n", "does not stand between two % lines"), ("%\nG21\nM30\n%", "text before the first O-number"),
    ("%\nO1\nG21\n%", "runs into the next one"), ("%\nO1\nM30\nO1\nM99\n%", "O1 twice")])
def test_fanuc_text_has_a_frame(text, match):
    with pytest.raises(ReadError, match=match):
        read_fanuc(text, work_offsets=ZERO, tool_lengths=LENGTHS)
