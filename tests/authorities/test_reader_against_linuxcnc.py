"""What our reader reads is what LinuxCNC's interpreter executes; what the one refuses, the other does too."""

import numpy as np
import pytest

from .linuxcnc.comparison import assert_same_moves, verdicts
from .linuxcnc.interpreter import write_tool_table

pytestmark = pytest.mark.linuxcnc

TOOL_LENGTHS = {1: 50.0, 2: 80.0, 5: 127.123456}
OFFSET = (101.5, -20.25, -300.125)
HEADER = "G21 G17 G90 G94 G40 G49 G80 G54 G91.1\nT5 M6\nG43 H5\nS9000 M3\nG64 P0.01\nG0 X0 Y0\nZ0\nF500\n"

ACCEPTED = {
    "lines": "G1 X1.5 Y-2\nZ-3.25\nG0 Z5\n",
    "inch": "G20\nG1 X1.5 Y-2 F20\nG2 X2.5 I0.5\nG21\nX53.5 I-5",
    "incremental": "G91 G1 X1.1\nX1.1\nY-.3 Z7\nG3 X3 I1.5 J0\nG90 X0 Y0 R40",
    "absolute centres": "G90.1 G2 X10 Y0 I5 J0\nG18 G3 X20 Z0 I15 K0\nG19 G2 Y10 Z0 J5 K0",
    "full circles": "G2 I5\nG3 J5\nG18 G2 I5 K1\nG19 G3 J1 K-4",
    "helices": "G2 I5 Z3\nG3 X2 Y2 I1 J1 P4 Z-1\nG18 G3 X0 Z0 Y9 I-1 K0.5 P2\nG19 G2 Y3 Z3 R30 X1",
    "arcs by radius": "G2 X10 R5\nG3 X0 R7\nG2 X3 Y4 R-6\nG18 G3 X9 Z4 R20\nG19 G2 Y0 Z9 R-30",
    "radii that differ a little": "G2 X10.02 I5\nG3 X0 I-5.02\nG0 X0\nG2 X200.09 I100",
    "tool lengths": "G43 H1\nG0 Z1\nG49\nG0 Z2\nG43.1 Z12.5\nG0 Z3\nT2 M6\nG43\nG0 Z4\nG43 H0\nG1 Z5",
    "machine coordinates": "G53 G0 Z0\nG0 Z9\nG1 G53 X1 Y2\nG20\nG53 G0 X1\nX1",
    "inverse time": "G93 G1 X10 F2\nG2 X20 Z3 I5 F3 P2\nG94 F100\nG1 X0",
    "feed in the block of G20": "G20 G1 X1 F10\nG1 X2 F10",
    "motion code alone": "G1\nG0\nX3",
    "dwell, coolant, stops": "M8\nG4 P0.1\nM0\nM9\nM1\nM5\nG1 X4",
    "exact stop": "G61\nG1 X1\nG61.1\nX2\nG64 P0.1 Q0.05\nX3",
    "sub-programs": "#31=4\no100 sub\nG1 X[#1+#31*2] Y-#2\nG2 X#1 I[-#31]\n#31=[#31+1]\no100 endsub\n"
                    "o100 call [1][2]\no100 call [#31-[6/4]] [-1]\nG0 X#31",
    "drilled holes": "G0 Z20\nG98 G81 X1 Y2 Z-5 R3\nX1\nY4\nR4 X2\nZ-6 Y3\nF50 X5\nG82 X9 Z-4 R2 P0.5\nX3 P.1\nG80\nG0 X0",
    "pecked holes": "G0 Z20\nG99 G83 X15 Z-5 R3 Q2\nX16 Q2.6666666667\nG73 X15 Z-5 R3 Q2\nX17 Q9\nG1 Z20\nX5\nG20\n"
                    "G98 G83 X.5 Z-.4 R.1 Q.15 F4\nY.2\nG21\nG0 X1",
    "drilled holes from R": "G0 X10 Y10 Z3\nG99 G81 X10 Y10 Z-5 R3\nX11\nR2 X12\nG80\nG0 Z9\nX2",
    "lower case, blanks, comments": "g 1 x 1 0 . 5 (a ; b) y+.5 ; c (d\nN7 X3. Y-.25 (E)\n",
}


@pytest.fixture
def judge(tmp_path):
    """Compares one text; returns the moves as read."""
    write_tool_table(tmp_path / "tool.tbl", TOOL_LENGTHS)

    def same_moves(text):
        (tmp_path / "program.ngc").write_text(text)
        return assert_same_moves(tmp_path / "program.ngc", tmp_path / "tool.tbl", OFFSET)
    return same_moves


@pytest.mark.parametrize("name", ACCEPTED)
def test_the_interpreter_makes_the_moves_that_the_reader_reads(judge, name):
    judge(HEADER + ACCEPTED[name] + "\nM2\n")


@pytest.mark.parametrize("seed", range(12))
def test_random_programs_are_read_alike(judge, seed):
    moves = judge(random_program(np.random.default_rng(seed), blocks=400))
    assert set(moves.kind) == {0, 1, 2, 3} and set(moves.plane) == {0, 1, 2}


def random_program(rng, blocks):
    """Lines and arcs in all planes, mm and inch, absolute and incremental, written with rounded digits."""
    lines, unit, place = [HEADER], 1.0, np.zeros(3)
    for _ in range(blocks):
        if rng.random() < 0.05:
            unit = rng.choice([1.0, 25.4])
            lines.append(f"{'G20' if unit > 1 else 'G21'}\nF{rng.uniform(100, 900) / unit:.2f}")
        if rng.random() < 0.3:
            axes = [axis for axis in range(3) if rng.random() < 0.7] or [0]
            place[axes] = rng.uniform(-60, 60, len(axes))
            lines.append(f"G{rng.integers(0, 2)} " + _words("XYZ", place, axes, unit))
        else:
            lines.append(_random_arc(rng, place, unit))
    return "\n".join(lines) + "\nM2\n"


def _random_arc(rng, place, unit):
    """One arc from place, which is moved to its end."""
    plane = rng.integers(3)
    first, second, third = ((0, 1, 2), (2, 0, 1), (1, 2, 0))[plane]
    radius, begin, turned = rng.uniform(2, 60), rng.uniform(0, 6.28), rng.uniform(0.2, 5.9)
    is_clockwise = bool(rng.random() < 0.5)
    to_start = radius * np.array([np.cos(begin), np.sin(begin)])
    finish = begin - turned if is_clockwise else begin + turned
    center = place[[first, second]] - to_start
    by_radius = rng.random() < 0.3 and abs(turned - np.pi) > 0.1
    words = (f"R{(-radius if turned > np.pi else radius) / unit:.6f}" if by_radius
             else _words("IJK", dict(zip((first, second), -to_start)), (first, second), unit))
    place[[first, second]] = center + radius * np.array([np.cos(finish), np.sin(finish)])
    axes = [first, second]
    if rng.random() < 0.3:
        place[third] += rng.uniform(-5, 5)
        axes.append(third)
    turns = f" P{rng.integers(1, 4)}" if rng.random() < 0.2 else ""
    return f"G{17 + plane} G{2 if is_clockwise else 3} {_words('XYZ', place, axes, unit)} {words}{turns}"


def _words(letters, values_mm, axes, unit):
    return " ".join(f"{letters[axis]}{values_mm[axis] / unit:.6f}" for axis in axes)


REFUSED_BY_BOTH = [
    "G12 X1", "M100", "G0 X1,5", "G0 X1e5", "G0 X", "G0 X1 X2", "G0 G1 X1", "G20 G21", "M3 M5", "M7 M8",
    "G0 X1 R5", "F1 G0 X1 I5", "G0 X1 P5", "G2 I5\nP2", "G94\nG1 X1", "G1 X1 F0", "G94\nG1",
    "G93 G1 X1 F1\nX2", "F-1", "S-1", "T-1", "G80 X1", "G80\nX1", "G4", "G4 P-1", "G80\nG4 P1 X1", "G0 A1",
    "T9", "G43 H9", "G43 Z5\nM2 L5", "G91\nG53 G0 X1", "G53 G2 X1 I0.5", "G53", "G53 G4 P1 G0 X1", "G2 X1",
    "G2", "G18 G2 X1 I1 J1", "G90.1\nG2 X10 I5", "G2 X1 I1 R1", "G2 X10 R4.99", "G2 X0 R5", "G2 Z1 R5",
    "G2 X5 R0", "G2 I0", "G2 X10 Y10 I3", "G2 I5 P1.5", "G2 I5 P0", "G0 X1 (a (b) c)", "G0 X1 (a", "G0 X1 )",
    "G0 N5 X1", "N1 N2 G0 X1", "G0 X1\n%\nG0 X2", "G0 X1 %", "G0 / X1", "G0 X[1/0]", "G0 X[1+2", "G0 X1+2",
    "o1 call", "o1 call [1]\no1 sub\no1 endsub", "o1 sub\nG0 X1",
    "o1 sub\no2 sub\no2 endsub\no1 endsub\no1 call", "o1 call 5", "G0 X2 o1 call", "M3.2", "T1.5", "G1.01 X1",
    "G81 X1 Z-1", "G81 X1 R3", "G0 Z9\nG81 X1 Z-1 R3 P1", "G0 Z9\nG81 X1 Z-1 R3 Q1", "G83 X1 Z-1 R3", "G83 X1 Z-1 R3 Q0",
    "G83 X1 Z-1 R3 Q-1", "G82 X1 Z-1 R3", "G82 X1 Z-1 R3 P-1", "G81 X1 Z4 R3", "G93 G81 X1 Z-1 R3 F3", "G53 G81 X1 Z-1 R3",
    "G81", "G98 G99", "G0 Z9\nG81 X1 Z-1 R3\nR2", "G0 Z9\nG81 X1 Z-1 R3\nG80 X1", "G0 Z9\nG81 X1 Z-1 R3\nG82 X2 P1",
    "G0 Z9\nF0 G81 X1 Z-1 R3", "G0 Z9\nG81 X1 Z-1 R3 I1",
    "G61 P1", "G0 X1 (" + "a" * 245 + ")",
]


@pytest.mark.parametrize("text", REFUSED_BY_BOTH)
def test_what_the_interpreter_refuses_the_reader_refuses(tmp_path, text):
    ours, theirs = verdicts(f"{HEADER}{text}\nM2\n", tmp_path, tool_lengths=TOOL_LENGTHS, work_offsets={"G54": OFFSET})
    assert theirs and ours


@pytest.mark.parametrize("text", ["", "G21\nG0 X1\n", "%\nG21\nG0 X1\n"])
def test_both_want_a_program_end(tmp_path, text):
    ours, theirs = verdicts(text, tmp_path, tool_lengths={}, work_offsets={})
    assert theirs and ours


ONLY_OURS = ["G81 X1 Z-1 R3", "G0 Z9\nG81 X1 Z-1 R3 L2", "G0 Z9\nG91 G81 X1 Z-1 R-3", "G0 Z9\nG18 G81 X1 Y1 Z1 R3",
             "G0 Z9\nG81 X1 Z3 R3", "G0 Z9\nG81 X1 Z-1 R3\nG99\nX5", "G0 Z9\nG81 X1 Z-1 R3\nT2 M6\nX2", "G84 X1 Z-1 R3",
             "/G0 X1", "G64", "M2\nG0 X1", "G0 X#33", "G41 D1 G1 X9", "G92 X0", "G10 L2 P1 X0", "G28",
             "G3 X0 Y0.000001 I-5"]


@pytest.mark.parametrize("text", ONLY_OURS)
def test_what_only_the_reader_refuses_is_known(tmp_path, text):
    ours, theirs = verdicts(f"{HEADER}{text}\nG40\nM2\n", tmp_path, tool_lengths=TOOL_LENGTHS,
                            work_offsets={"G54": OFFSET})
    assert ours and not theirs


@pytest.mark.parametrize("unit, radius", [
    ("G21", 1.0), ("G21", 5.0), ("G21", 28.0), ("G21", 29.0), ("G21", 100.0), ("G21", 1000.0), ("G21", 5000.0),
    ("G20", 0.5), ("G20", 2.0), ("G20", 2.9), ("G20", 10.0), ("G20", 100.0), ("G20", 500.0)])
def test_the_rule_of_the_two_radii_is_the_interpreters(tmp_path, unit, radius):
    """Just inside and just outside of the bound that the reader states."""
    absolute, largest = (0.02, 2.0) if unit == "G21" else (0.002, 0.2)
    allowed = min(max(absolute * 2**0.5, radius * 0.001 / 0.999), largest * 2**0.5)
    for factor, is_accepted in ((0.9999, True), (1.0001, False)):
        end = 2 * radius + allowed * factor
        ours, theirs = verdicts(f"{unit}\nG0 X0 Y0 Z0\nG2 X{end:.9f} Y0 I{radius} F100\nM2\n", tmp_path,
                                tool_lengths={}, work_offsets={})
        assert (ours == "", theirs == "") == (is_accepted, is_accepted), (factor, ours, theirs)


@pytest.mark.parametrize("unit, excess", [("G21", 0.00127), ("G20", 0.00005)])
def test_how_far_an_r_arc_may_be_stretched_is_the_interpreters(tmp_path, unit, excess):
    for factor, is_accepted in ((0.99, True), (1.01, False)):
        ours, theirs = verdicts(f"{unit}\nG0 X0 Y0 Z0\nG2 X{10 + 2 * excess * factor:.9f} Y0 R5 F100\nM2\n", tmp_path,
                                tool_lengths={}, work_offsets={})
        assert (ours == "", theirs == "") == (is_accepted, is_accepted), (factor, ours, theirs)
