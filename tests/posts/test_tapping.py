"""Rigid taps as posted: what each control has for them, and what its reader makes of it."""

import numpy as np
import pytest
from tapped_holes import LEVEL, tapped

from cuspline.program.drilling import DrillCycle
from cuspline.program.program import Kind
from cuspline.values.errors import PostError, ReadError, ToolpathError

WORDS = {("mill_3axis", 1): ["S500 M3", "G33.1 Z-9 K1"], ("mill_3axis", -1): ["S500 M4", "G33.1 Z-9 K1"],
         ("mill_fanuc", 1): ["M29 S500", "G98 G84 X10. Y10. Z-9. R3. F500.0", "X30. Y10.", "X30. Y25. Z-11.5", "G80"],
         ("mill_fanuc", -1): ["M29 S500", "G98 G74 X10. Y10. Z-9. R3. F500.0"],
         ("mill_haas", 1): ["G98 G84 X10. Y10. Z-9. R3. F500.0"], ("mill_haas", -1): ["G98 G74 X10. Y10. Z-9. R3. F500.0"],
         ("mill_siemens", 1): ["SPOS=0", "G331 Z-9 K1 S500", "G332 Z3 K1"],
         ("mill_siemens", -1): ["SPOS=0", "G331 Z-9 K-1 S500", "G332 Z3 K-1"],
         ("mill_heidenhain", 1): ["  Q201=-11 ;DEPTH OF THREAD ~", "  Q239=+1 ;THREAD PITCH ~"],
         ("mill_heidenhain", -1): ["  Q201=-11 ;DEPTH OF THREAD ~", "  Q239=-1 ;THREAD PITCH ~"]}


@pytest.mark.parametrize("machine, sign", WORDS)
def test_a_tap_goes_down_and_back_by_its_pitch(machine, sign):
    text, read, operation = tapped(machine, sign)
    lines = [line.lstrip("0123456789 ") if machine == "mill_heidenhain" and not line.startswith(" ") else line
             for line in text.split("\n")]
    k = lines.index(WORDS[machine, sign][0])
    assert lines[k:k + len(WORDS[machine, sign])] == WORDS[machine, sign] or WORDS[machine, sign][1] in lines[k:]
    moves = read()
    tied = np.flatnonzero(moves.pitch_mm)
    assert moves.pitch_mm[tied].tolist() == [sign] * 6 and (moves.kind[tied] == Kind.FEED).all()
    assert moves.end_mm[tied].tolist() == [[10, 10, -9], [10, 10, 3], [30, 10, -9], [30, 10, 3], [30, 25, -11.5], [30, 25, 3]]
    assert moves.feed_mm_per_min[tied].tolist() == [500.0] * 6 and (moves.spindle_rpm[tied] == 500 * sign).all()
    assert not moves.remarks and moves.ended
    after = moves.end_mm[tied[1] + 1]
    assert after[2] == LEVEL                                     # up before it goes across


@pytest.mark.parametrize("machine", ["mill_3axis_inch", "mill_fanuc"])
def test_a_pitch_is_what_it_was_within_the_last_digit(machine):
    _, read, _ = tapped(machine, pitch=0.75, **({"units": "inch"} if machine == "mill_fanuc" else {}))
    assert np.abs(read().pitch_mm[read().pitch_mm != 0] - 0.75).max() < (1e-5 if machine == "mill_3axis_inch" else 2e-3)


@pytest.mark.parametrize("machine", ["mill_grbl", "mill_pmac"])
def test_a_control_that_does_not_tap_says_so(machine):
    with pytest.raises(PostError, match="no rigid tapping: mill the thread"):
        tapped(machine)


HALF_SAID = [("mill_3axis", "S500 M3", "S500 M5", "spindle stands"), ("mill_3axis", " K1", "", "without Z or K"),
             ("mill_3axis", "G33.1 Z-9 K1", "G84 Z-9 R3", "unknown word G84"),
             ("mill_3axis", "Z-9 K1", "X11 Z-9 K1", "a way across"),
             ("mill_fanuc", "M29 S500\n", "", "G84 without M29"), ("mill_fanuc", "R3. F", "F", "without R"),
             ("mill_fanuc", "M29 S500", "M29", "M29 without S"),
             ("mill_haas", "R3. F", "F", "without R"), ("mill_siemens", "SPOS=0\n", "", "not positioned"),
             ("mill_siemens", "G331 Z-9 K1 S500", "G331 Z-9 S500", "without Z or K"),
             ("mill_heidenhain", "  Q239=+1 ;THREAD PITCH ~\n", "", "without all of its parameters"),
             ("mill_heidenhain", "Q201=-11", "Q201=+11", "makes no sense")]


@pytest.mark.parametrize("machine, old, new, why", HALF_SAID)
def test_a_tap_that_is_half_said_is_refused(machine, old, new, why):
    text, read, _ = tapped(machine)
    assert old in text
    with pytest.raises(ReadError, match=why):
        read(text.replace(old, new, 1))


def test_a_spindle_that_tapping_has_stopped_stands():
    text, read, _ = tapped("mill_fanuc")
    moves = read("G80\nG1 Z19. F100.\n".join(text.rsplit("G80\n", 1)))
    assert moves.spindle_rpm[np.flatnonzero(moves.pitch_mm)[-1] + 2:].max() == 0


def test_a_pitch_belongs_to_taps():
    hole = {"xy_mm": (0, 0), "bottom_z_mm": -5, "retract_z_mm": 3, "feed_mm_per_min": 100, "first": 0, "end": 0}
    for wrong in ({"kind": "tap"}, {"kind": "drill", "pitch_mm": 1.0}):
        with pytest.raises(ToolpathError, match="a pitch belongs to tap"):
            DrillCycle(**hole, **wrong)
