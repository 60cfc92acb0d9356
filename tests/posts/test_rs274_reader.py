"""The reader's own facts; tests/authorities asks LinuxCNC about the same texts."""

import itertools
import re
import time

import numpy as np
import pytest

from cuspline.posts.readers.rs274_reader import read_program
from cuspline.program.program import Kind, Plane
from cuspline.values.errors import ReadError

WORK_OFFSETS = {"G54": (100.0, 200.0, -300.0), "G55": (110.0, 200.0, -290.0)}
TOOL_LENGTHS = {1: 50.0, 2: 80.0, 3: 50.0, 5: 127.0}
AT_ZERO = "G21\nG0 X0 Y0 Z0\n"
GIVEN_DIGITS = 1e-9         # mm; the texts are written to ten decimals of an inch or of a mm


def read(text, ending="\nM2\n"):
    return read_program(text + ending, work_offsets=WORK_OFFSETS, tool_lengths=TOOL_LENGTHS)


def last(text):
    """(end, machine end) of the last move."""
    moves = read(text)
    return moves.end_mm[-1].tolist(), moves.machine_end_mm[-1].tolist()


# what it reads ----------------------------------------------------------------------------------------

ARCS = list(itertools.product(Plane, (True, False), ("offsets", "absolute", "short R", "long R"), ("G20", "G21")))


@pytest.mark.parametrize("plane, is_clockwise, spelling, unit", ARCS)
def test_an_arc_has_its_centre_in_every_spelling(plane, is_clockwise, spelling, unit):
    first, second, third = plane.axes
    center, radius, turned = np.array([7.0, -4.0, 2.5]), 12.0, 4.0 if spelling == "long R" else 1.1
    angles = (0.3, 0.3 - turned) if is_clockwise else (0.3, 0.3 + turned)
    start, end = (center + radius * _on_circle(plane, angle) for angle in angles)
    center[third] = start[third]
    centre_words = {"offsets": _words("IJK", center - start, (first, second), unit),
                    "absolute": _words("IJK", center, (first, second), unit),
                    "short R": _words("R", [radius], (0,), unit), "long R": _words("R", [-radius], (0,), unit)}
    text = (f"{unit} {('G17', 'G18', 'G19')[plane]} {'G90.1' if spelling == 'absolute' else 'G91.1'}\n"
            f"G0 {_words('XYZ', start, range(3), unit)}\nF100\n"
            f"{'G2' if is_clockwise else 'G3'} {_words('XYZ', end, (first, second), unit)} {centre_words[spelling]}")
    moves = read(text)
    assert (moves.kind[-1], moves.plane[-1]) == (Kind.ARC_CW if is_clockwise else Kind.ARC_CCW, plane)
    np.testing.assert_allclose(moves.center_mm[-1], center, atol=50 * GIVEN_DIGITS)     # R squares the digits
    np.testing.assert_allclose(moves.end_mm[-1], end, atol=GIVEN_DIGITS)
    assert moves.feed_mm_per_min[-1] == pytest.approx(2540.0 if unit == "G20" else 100.0)


def _on_circle(plane, angle):
    first, second, _ = plane.axes
    point = np.zeros(3)
    point[first], point[second] = np.cos(angle), np.sin(angle)
    return point


def _words(letters, values_mm, indices, unit):
    scale = 25.4 if unit == "G20" else 1.0
    return " ".join(f"{letters[i]}{values_mm[i] / scale:.10f}" for i in indices)


def test_a_helix_turns_as_often_as_p_says():
    moves = read("G21\nG0 X10 Y0 Z0\nG3 X10 Y0 Z-6 I-10 P3 F100")
    assert moves.turns[-1] == 2
    assert moves.end_mm[-1].tolist() == [10, 0, -6]
    assert moves.center_mm[-1].tolist() == [0, 0, 0]


def test_a_full_circle_ends_exactly_where_it_began():
    moves = read("G20\nG0 X0.1 Y0.2 Z0\nG91 G2 X0 Y0 J-1.3 F9\nG90 X0.1 Y0.2 J-1.3")
    assert (moves.end_mm[-2:] == moves.start_mm[-2:]).all()
    assert moves.turns.tolist() == [0, 0, 0]


def test_modes_stay_until_they_are_changed():
    moves = read(AT_ZERO + "G1 X1 F100\nY2\nG91\nX5\nG90 G20\nX1\nG21\nG0 Z7\nG18\nG17\nX3")
    np.testing.assert_allclose(
        moves.end_mm, [[0, 0, 0], [1, 0, 0], [1, 2, 0], [6, 2, 0], [25.4, 2, 0], [25.4, 2, 7], [3, 2, 7]])
    assert moves.kind.tolist() == [0, 1, 1, 1, 1, 0, 0]
    assert moves.feed_mm_per_min.tolist() == [0, 100, 100, 100, 100, 0, 0]


def test_a_feed_beside_g20_is_still_in_the_old_unit():
    assert read(AT_ZERO + "G20 G1 X1 F10").feed_mm_per_min[-1] == 10
    assert read(AT_ZERO + "G20\nG1 X1 F10").feed_mm_per_min[-1] == 254


def test_inverse_time_feed_is_length_times_f():
    moves = read(AT_ZERO + "G93 G1 X3 Y4 F2\nG2 X13 I5 F2\nG2 X23 Z10 I5 P2 F1")
    half = 5 * np.pi
    np.testing.assert_allclose(moves.feed_mm_per_min[1:], [10, 2 * half, np.hypot(3 * half, 10)])


def test_places_are_unknown_until_named():
    moves = read("G21\nG0 Z5\nX1 Y2\nG1 X3 F9")
    np.testing.assert_equal(moves.start_mm[0], [np.nan] * 3)
    np.testing.assert_equal(moves.end_mm[0], [np.nan, np.nan, 5])
    np.testing.assert_equal(moves.machine_end_mm[0], [np.nan, np.nan, -295])
    assert moves.end_mm[-1].tolist() == [3, 2, 5]


def test_machine_position_is_tip_plus_work_offset_plus_tool_length():
    assert last("G21\nT5 M6\nG43 H5\nG0 X1 Y2 Z3") == ([1, 2, 3], [101, 202, -170])


def test_a_change_of_offset_moves_the_coordinates_not_the_machine():
    moves = read(AT_ZERO + "G55\nG0 X0\nG43 H2\nG0 Y0\nG49\nG0 Y1\nG43.1 Z4\nG0 Y2")
    np.testing.assert_allclose(moves.end_mm[1:, 2], [-10, -90, -10, -14])
    np.testing.assert_allclose(moves.machine_end_mm[:, 2], -300)
    np.testing.assert_allclose(moves.machine_end_mm[:, 0], [100, 110, 110, 110, 110])


def test_g53_goes_to_machine_coordinates_once():
    tip, machine = last("G21\nT1 M6 G43\nG53 G0 X7 Y8 Z9")
    assert (tip, machine) == ([-93, -192, 259], [7, 8, 9])
    assert last("G21\nG53 G0 X7 Y8 Z9\nX1")[0][0] == 1


def test_without_its_work_offset_a_wcs_has_no_machine_coordinates():
    moves = read_program("G21 G56\nG0 X1 Y2 Z3\nM2", work_offsets=WORK_OFFSETS, tool_lengths={})
    assert np.isnan(moves.machine_end_mm).all()
    assert moves.end_mm.tolist() == [[1, 2, 3]]


def test_tool_and_spindle_follow_the_text():
    moves = read(AT_ZERO + "T2 S900 M3\nX1\nM6\nX2\nM4\nX3\nS50\nX4\nM5\nX5")
    assert moves.tool.tolist() == [0, 0, 2, 2, 2, 2]
    assert moves.spindle_rpm.tolist() == [0, 900, 0, -900, -50, 0]


def remarks(text, kind):
    """(line, amount) of the remarks of a kind."""
    moves = read(text)
    return [(int(moves.line[r.row]), round(r.amount_mm, 9)) for r in moves.remarks if r.kind == kind]


@pytest.mark.parametrize("blocks, found", [
    ("T1 M6\nG43\nZ2\nT2 M6\nG43 H2\nZ4", []),
    ("T1 M6\nG43\nZ2\nT2 M6\nX3\nZ4\nZ5", [(8, 30.0)]),                # the second G43 is missing
    ("T1 M6\nG43 H2\nX2\nG1 X3 F9", [(6, 30.0)]),
    ("T1 M6\nG43 H2\nG53 G0 Z0\nG43 H1\nZ5", []),
    ("T1 M6\nG43.1 Z50\nZ5", []), ("T1 M6\nG43.1 Z115\nZ5", [(5, 65.0)]),
    ("T1 M6\nG43 H3\nZ5", [(5, 0.0)])])                                   # as long, but another tool's
def test_the_length_offset_in_force_is_that_of_the_tool_in_the_spindle(blocks, found):
    assert remarks(AT_ZERO + blocks, "wrong_length_offset") == found


SAID = "G21\nG17 G90 G91.1 G94 G40 G49 G92.1\nG64 P0.001 Q0\nG54\nT1 M6\nG43 H1\nG0 X0 Y0\nZ0\nG1 X1 F9\nG2 X3 I1"


@pytest.mark.parametrize("word, line", [
    ("G90", 7), ("G54", 7), ("G40", 7), ("G64 P0.001 Q0", 9), ("G94", 9), ("G17", 10), ("G91.1", 10),
    ("G92.1", 7)])
def test_what_a_move_relies_on_must_have_been_said(word, line):
    text = SAID.replace(word, "").replace("\n\n", "\n(gone)\n")
    (remark,) = [r for r in read(text).remarks if r.kind == "unknown_start"]
    assert read(text).line[remark.row] == line and remark.advice.startswith(word[:5])


@pytest.mark.parametrize("text", [SAID, SAID.replace("G49", ""), SAID.replace("G2 X3 I1", "G2 X3 R1").replace("G91.1",
                                                                                                              ""),
                                  SAID.replace("G17", "").replace("G2", "G17 G2")])
def test_what_no_move_relies_on_need_not_be_said(text):
    assert not read(text).remarks


@pytest.mark.parametrize("said, tolerance_mm", [
    ("G64 P0.5", 1.5), ("G64 P0.001 Q0.5", 0.502), ("G64 P0.001 Q0", 0.002), ("G64 P0.0002 Q0", 0.0007), ("G61", 0.0),
    ("G61.1", 0.0), ("", np.inf), ("G20\nG64 P0.001 Q0", 0.0508)])
def test_the_path_tolerance_is_what_the_text_sets(said, tolerance_mm):
    """Q joins blocks before P blends them, and is P where it is left out; P counts twice, for a blend begins on a servo cycle."""
    assert read(f"G21 G54\n{said}\nG0 X0 Y0 Z0\nG1 X1 F9").path_tolerance_mm[-1] == pytest.approx(tolerance_mm,
                                                                                                  abs=1e-12)


def test_a_move_in_a_sub_program_names_the_line_of_its_call():
    moves = read("G21 G54\no1 sub\nG0 X1\no1 endsub\no2 sub\no1 call\no2 endsub\no2 call\nG0 X2\no1 call")
    assert moves.line.tolist() == [3, 9, 3] and moves.call_line.tolist() == [8, 0, 10]
    with pytest.raises(ReadError, match="line 3, called in line 5: 'G0 X#9'"):
        read("G21\no1 sub\nG0 X#9\no1 endsub\no1 call")


def test_operations_are_named_by_their_comments():
    moves = read("(PART: BLOCK)\nG21\nG0 X0\n(OPERATION 1: ROUGH, T1 FLAT 16 MM)\nX1\n"
                 "(operation 2: Semi Finish)\nX2 (a note)\nX3")
    assert moves.operations == ("rough", "semi finish")
    assert moves.operation.tolist() == [-1, 0, 1, 1]
    assert [moves.operation_name(row) for row in (0, 1)] == ["", "rough"]


def test_subs_run_with_their_own_parameters():
    moves = read("G21 #1=7 #31=2\no100 sub\n G0 X#1 Y[#2*#31-1] Z-[#1/[2+3]]\n #31=[#31 + 1]\n o100 return\n G0 X99\n"
                 "o100 endsub\no<twice> sub\no100 call [#1] [4]\no100 call [-#1][+5]\no<twice> endsub\n"
                 "o<Twice> call [10]\nG0 X#1")
    assert moves.end_mm.tolist() == [[10, 7, -2], [-10, 14, 2], [7, 14, 2]]
    assert moves.line.tolist() == [3, 3, 13]


@pytest.mark.parametrize("text", [
    "%\nG21 G0 X1\nM2\n%\n", "%\nO1234 (NAME)\nG21 G0 X1\n%\n", "g21 g 0 x 1 . 0\nm2", "N10 G21 G00 X+1.\r\nN5 M30\r\n",
    "G21 G0 (one) X1 (two; three) ; four (five\nM2\n(after the end)\n\n%",
    "G21 G17 G90 G94 G40 G49 G80 G54 G91.1 G92.1 G61\nM7\nM8\nM9 G4 P0.5\nG61.1\nM0\nM1\nG64 P0.01 Q0.005 G0 X1\nM2"])
def test_every_way_of_writing_it_is_the_same_move(text):
    moves = read(text, ending="")
    assert moves.end_mm[-1, 0] == 1
    assert moves.ended == ("M" in text.upper().replace("NAME", ""))


def test_the_time_of_long_programs_grows_as_their_length():
    """Not as its square: eight times the blocks would take 64 times as long."""
    block = "X1.2345 Y-2.3456 Z3.4567\nG2 X2.2345 I0.5 J0\nG1 X0 Y0\nZ1\n"
    taken = []
    for blocks in (6250, 50_000):
        begin = time.process_time()
        assert len(read("G21\nG0 X0 Y0 Z0\nG1 F100 X0\n" + blocks * block)) == 4 * blocks + 2
        taken.append(time.process_time() - begin)
    assert taken[1] < 24 * taken[0]


# what it refuses --------------------------------------------------------------------------------------

REFUSED = {     # name: (text after AT_ZERO, line refused, words of the complaint)
    "unknown G": ("G12 X1", 3, "unknown word G12"),
    "cutter compensation": ("G41 D1", 3, "the radius in D1 is not known"),
    "axis offset": ("G92 X0", 3, "work offset"),
    "unknown M": ("M100", 3, "unknown word M100"),
    "unknown letter": ("G0 A10", 3, "uses A"),
    "unknown character": ("G0 X1,5", 3, '","'),
    "exponent": ("G0 X1e5", 3, "uses E"),
    "no number": ("G0 X", 3, "number expected"),
    "word twice": ("G0 X1 X2", 3, "two X words"),
    "two of a group": ("G0 G1 X1", 3, "G0 and G1"),
    "two units": ("G20 G21", 3, "G20 and G21"),
    "two M of a group": ("M3 M5", 3, "M3 and M5"),
    "letter without use": ("G0 X1 R5", 3, "uses R"),
    "P without use": ("F100 G2 I5\nP2", 4, "uses P"),
    "no feed": ("G1 X1", 3, "no feed"),
    "zero feed": ("G1 X1 F0", 3, "no feed"),
    "feed forgotten by G94": ("F100\nG94\nG1 X1", 5, "no feed"),
    "no feed under G93": ("G93 G1 X1 F1\nX2", 4, "without F"),
    "negative feed": ("F-1", 3, "below zero"),
    "negative speed": ("S-1", 3, "below zero"),
    "no motion code": ("G80\nX1", 4, "no G0 G1 G2 G3"),
    "bare G64": ("G64", 3, "any amount"),
    "dwell without time": ("G4", 3, "dwell"),
    "unknown tool": ("T9 M6", 3, "tool 9"),
    "unknown length": ("G43 H9", 3, "tool 9"),
    "length without Z": ("G43.1", 3, "without Z"),
    "G53 under G91": ("G91\nG53 G0 X1", 4, "G91"),
    "G53 with an arc": ("F100\nG53 G2 X1 I0.5", 4, "G53 with an arc"),
    "G53 alone": ("G53", 3, "without a move"),
    "arc without centre": ("F100 G2 X1", 3, "without its centre"),
    "centre off the plane": ("F100 G18 G2 X1 I1 J1", 3, "no J"),
    "half an absolute centre": ("F100 G90.1\nG2 X10 I5", 4, "half a centre"),
    "centre and radius": ("F100 G2 X1 I1 R1", 3, "R and I J K"),
    "radius too small": ("F100 G2 X10 R4.99", 3, "cannot span"),
    "full circle by radius": ("F100 G2 X0 R5", 3, "ends where it begins"),
    "no radius": ("F100 G2 X1 I0", 3, "radius"),
    "two radii": ("F100 G2 X10 Y10 I3", 3, "3.00000 mm at the start and 12.20656"),
    "nearly a full circle": ("F100 G3 X0 Y0.000001 I-5", 3, "whole circle"),
    "half a turn word": ("F100 G2 I5 P1.5", 3, "P1.5"),
    "block delete": ("/G0 X1", 3, "block delete"),
    "line too long": ("G0 X1 (" + "a" * 245 + ")", 3, "253 characters"),
    "comment in a comment": ("G0 X1 (a (b) c)", 3, "comment"),
    "comment not closed": ("G0 X1 (a", 3, "comment"),
    "text after the end": ("M2\nG0 X1", 4, "after the program end in line 3"),
    "N inside a block": ("G0 N5 X1", 3, "unknown word"),
    "% inside": ("G0 X1\n%\nG0 X2", 5, "after the program end"),
    "parameter never set": ("G0 X#33", 3, "#33"),
    "parameter of the controller": ("G0 X#5420", 3, "#5420"),
    "division by zero": ("G0 X[1/0]", 3, "division by zero"),
    "open bracket": ("G0 X[1+2", 3, '"]"'),
    "call of nothing": ("o1 call", 3, "not defined"),
    "other O-word": ("o1 while [1]", 3, "O-word"),
    "sub without endsub": ("o1 sub\nG0 X1", 3, "no endsub"),
    "return outside": ("o1 return", 3, "outside"),
    "calls without end": ("o1 sub\no1 call\no1 endsub\no1 call", 4, "deeper"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_sure_is_refused_with_its_line(name):
    text, line, words = REFUSED[name]
    with pytest.raises(ReadError) as refusal:
        read(AT_ZERO + text)
    assert refusal.value.rows.tolist() == [line]
    assert words in str(refusal.value)
    assert re.match(rf"line {line}(, called in line \d+)?: ", str(refusal.value))


def nested(levels, times=1):
    """Sub-programs that call one another so deep, each `times` times; the innermost moves."""
    bodies = ["G1 X5 F100"] + ["\n".join([f"o{k} call"] * times) for k in range(1, levels)]
    return "\n".join(f"o{k} sub\n{body}\no{k} endsub" for k, body in enumerate(bodies, 1)) + f"\no{levels} call"


def test_calls_nest_as_deep_as_the_control_takes_and_no_deeper():
    assert len(read(AT_ZERO + nested(9))) == 2
    with pytest.raises(ReadError, match="line 7, called in line 33: 'o1 call': calls nested deeper than 9"):
        read(AT_ZERO + nested(10))


def test_calls_that_multiply_are_refused_with_the_line_of_the_call(monkeypatch):
    monkeypatch.setattr("cuspline.posts.readers.rs274_blocks.MOST_CALLED", 1000)
    assert len(read(AT_ZERO + nested(3, 10))) == 101
    with pytest.raises(ReadError, match=r"called in line 42: .*: the sub-programs called come to more than 1,000 blocks"):
        read(AT_ZERO + nested(4, 10))


@pytest.mark.parametrize("text, words", [
    ("", "program end"), ("G21\nG0 X1\n", "program end"), ("G0 X1\nM2", "G20 or G21"), ("F10\nG21\nM2", "G20 or G21"),
    ("G21\nX1\nM2", "no G0"), ("G21\nG0 X1 Y1\nG1 X2 F9\nM2", "where Z stands"),
    ("G21\nG91\nG0 X1\nG90 G1 Z0 F9\nM2", "where X Y Z stands")])
def test_a_program_must_say_how_it_begins_and_that_it_ends(text, words):
    with pytest.raises(ReadError, match=words):
        read_program(text, work_offsets=WORK_OFFSETS, tool_lengths={})


@pytest.mark.parametrize("unit, radius, allowed", [
    ("G21", 5.0, 0.02 * 2**0.5), ("G21", 100.0, 100 * 0.001 / 0.999), ("G21", 5000.0, 2 * 2**0.5),
    ("G20", 1.0, 0.002 * 2**0.5), ("G20", 10.0, 10 * 0.001 / 0.999), ("G20", 1000.0, 0.2 * 2**0.5)])
def test_radii_may_differ_as_much_as_the_controller_allows(unit, radius, allowed):
    def text(error):
        return f"{unit}\nG0 X0 Y0 Z0\nG2 X{2 * radius + error:.9f} Y0 I{radius} F100"
    read(text(allowed * 0.9999))
    with pytest.raises(ReadError, match="the radius is"):
        read(text(allowed * 1.0001))
